//! A program that is ready to run: compiled, with its data.

use crate::args::Job;
use crate::failure::Failure;
use crate::inputs;
use pcadlang_engine::lang::value::Value;
use pcadlang_library::scene::ImageValue;
use pcadlang_library::{Model, Program};
use pcadlang_scene::vision::Photo;
use std::time::Instant;

/// A compiled program with its observed data.
pub struct Ready {
    /// The program with its data.
    pub model: Model,
    /// The name and value of the photograph.
    pub named_image: Option<(String, Value)>,
    /// True if the program has a param `person`, which selects a person in the
    /// photograph.
    pub chooses: bool,
    /// When the run's time began.
    pub begun: Instant,
}

impl Ready {
    /// Returns the width and height of the photograph, if there is one.
    pub fn size(&self) -> Option<(u32, u32)> {
        self.photo().map(|p| (p.width(), p.height()))
    }

    /// Returns the photograph, if there is one.
    pub fn photo(&self) -> Option<&Photo> {
        self.image()?.as_photo()
    }

    /// Returns the photograph with its detections, or a contour map without a photograph,
    /// if there is one.
    pub fn image(&self) -> Option<&ImageValue> {
        self.named_image.as_ref()?.1.downcast::<ImageValue>()
    }
}

/// Reads and compiles a program; the time of a run begins here.
pub fn prepare(job: &Job, quiet: bool) -> Result<Ready, Failure> {
    let begun = Instant::now();
    prepare_program(inputs::program(&job.inputs, quiet)?, job, begun)
}

/// Compiles a program that was read for a job; the time of a run began at `begun`.
pub fn prepare_program(program: Program, job: &Job, begun: Instant) -> Result<Ready, Failure> {
    let (program, image) = inputs::observe(program, job)?;
    let chooses = program.interface().params.iter().any(|p| p.name == "person");
    Ok(Ready { model: program.compile()?, named_image: image, chooses, begun })
}
