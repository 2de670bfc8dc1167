//! Finds objects of the 80 classes of COCO in a photograph, by NanoDet (RangiLyu 2020): one
//! run of a small network on the photograph shrunk to 416 pixels.
//!
//! The result is a function of the photograph alone, with the same bits on any machine. The
//! network itself is in `pcadlang-nanodet`.

mod boxes;
mod classes;
pub mod json;
mod sample;
#[cfg(test)]
mod tests;

pub use classes::CLASSES;

use crate::nn::{Memory, Network, NetworkError};
use pcadlang_numerics::platform::threads::map_side_by_side;
use pcadlang_scene::vision::Photo;
use sample::Placed;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// The longer side of a photograph in a whole view, in samples.
const SIDE: usize = 416;
/// The distances between cells, in samples.
const STRIDES: [usize; 3] = [8, 16, 32];
/// The number of distances that each side of a box is a mixture of, in strides: 0 to 10.
const BINS: usize = 11;

/// A view of a photograph: the network sees things best that are as large as those that it was
/// trained with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The longer side as a part of 416 samples: above 0, at most 1.
    pub part: f64,
    /// True to exchange left and right.
    pub mirrored: bool,
}

impl View {
    /// The photograph as it is, as large as it can be.
    pub const WHOLE: View = View { part: 1.0, mirrored: false };
}

/// Views for where an object that is missed, or a box that is off, costs more than the time: the
/// larger an object is in the photograph, the smaller the view that shows it as the network knows
/// its kind (docs/measurements/objects.md).
pub const VIEWS: [View; 4] = [
    View::WHOLE,
    View { part: 0.67, mirrored: false },
    View { part: 0.55, mirrored: false },
    View { part: 0.55, mirrored: true },
];

/// Options of the search for objects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectOptions {
    /// The minimum score, 0 to 1.
    pub least: f64,
    /// The maximum number of objects.
    pub most: usize,
}

impl Default for ObjectOptions {
    fn default() -> Self {
        ObjectOptions { least: 0.3, most: 20 }
    }
}

/// An object in a photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundObject {
    /// Left, top, right and bottom, in pixels of the photograph from its upper left corner;
    /// within it, and the right and bottom larger.
    pub bounds: [f64; 4],
    /// The index of its class in [`CLASSES`].
    pub class: usize,
    /// How likely the network takes it to be an object of its class: 0 to 1.
    pub score: f64,
}

impl FoundObject {
    /// The name of its class.
    pub fn name(&self) -> &'static str {
        CLASSES[self.class].0
    }
}

/// The network that detects objects, as stored: it is read for each size of its input, and freed.
#[derive(Clone, Copy, Debug)]
pub struct ObjectFinder {
    model: &'static [u8],
    weights: &'static [u8],
}

impl ObjectFinder {
    /// Returns the one included in the program. As a constant it would have a second copy of the
    /// files.
    pub fn included() -> ObjectFinder {
        ObjectFinder::new(pcadlang_nanodet::MODEL, pcadlang_nanodet::WEIGHTS)
    }

    /// Takes NanoDet as a graph model of TensorFlow.js: the bytes of its JSON and of its weights.
    pub fn new(model: &'static [u8], weights: &'static [u8]) -> ObjectFinder {
        ObjectFinder { model, weights }
    }

    /// Returns the objects in a photograph, each once for each view that it is seen in, those with
    /// the highest scores first. The views are examined in parallel.
    ///
    /// # Errors
    /// If the files cannot be read, or contain a different network.
    pub fn find_in_views(
        self,
        photo: &Photo,
        views: &[View],
        options: &ObjectOptions,
    ) -> Result<Vec<FoundObject>, NetworkError> {
        let placed: Vec<Placed> = views.iter().map(|view| sample::place(photo, *view)).collect();
        let mut sizes: Vec<[usize; 2]> = placed.iter().map(|p| p.input).collect();
        sizes.sort_unstable();
        sizes.dedup();
        let read = |size: &[usize; 2]| Ok((*size, Detector::read(self, *size)?));
        let detectors = map_side_by_side(&sizes, read).into_iter();
        let detectors = detectors.collect::<Result<HashMap<_, _>, NetworkError>>()?;
        // A view takes what memory one before it left.
        let left = Mutex::new(Vec::new());
        let left = || left.lock().unwrap_or_else(PoisonError::into_inner);
        let found = map_side_by_side(&placed, |placed| {
            let mut memory = left().pop().unwrap_or_default();
            let found = detectors[&placed.input].look(photo, placed, options, &mut memory);
            left().push(memory);
            found
        });
        let mut all = found.concat();
        all.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(all)
    }
}

/// The network for inputs of one size.
struct Detector {
    network: Network<'static>,
    /// For each stride, which outputs are the scores and the sides of boxes.
    outputs: [[usize; 2]; 3],
}

impl Detector {
    fn read(finder: ObjectFinder, [width, height]: [usize; 2]) -> Result<Detector, NetworkError> {
        let image = Some([height, width]);
        let network = Network::read_graph_model(finder.model, finder.weights, image)?;
        let outputs = outputs(&network, width * height)
            .filter(|_| network.input_shape() == [1, 3, height, width]);
        let outputs = outputs.ok_or_else(|| {
            NetworkError::Format("it is not a detector of objects (nanodet.json)".into())
        })?;
        Ok(Detector { network, outputs })
    }

    fn look(
        &self,
        photo: &Photo,
        placed: &Placed,
        options: &ObjectOptions,
        memory: &mut Memory,
    ) -> Vec<FoundObject> {
        let fill = |input: &mut [f32]| sample::letterbox(photo, placed, input);
        let outputs = self.network.run_in(memory, &[true; 6], fill);
        let grids = self.outputs.map(|pair| pair.map(|i| outputs[i]));
        let found = boxes::decode(&grids, placed, options.least);
        boxes::best(found, options.most)
    }
}

/// Returns which outputs are the scores and the sides of boxes for each stride, by their
/// shapes, for an input of this number of samples.
fn outputs(network: &Network, samples: usize) -> Option<[[usize; 2]; 3]> {
    let find = |stride: usize, numbers: usize| {
        let cells = samples / (stride * stride);
        network.output_shapes().position(|s| s == [1, cells, numbers])
    };
    let [a, b, c] = STRIDES.map(|s| Some([find(s, CLASSES.len())?, find(s, 4 * BINS)?]));
    Some([a?, b?, c?])
}
