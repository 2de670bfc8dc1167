//! Arguments of commands: what a run is given, and what is asked of its folder.

// Comments of arguments are the help that the command prints, not Markdown.
#![allow(rustdoc::broken_intra_doc_links, rustdoc::invalid_html_tags, rustdoc::bare_urls)]

mod live;
mod reopening;
mod values;

pub use live::Live;
pub use reopening::{Compare, Film, Report, Show};
pub use values::{duration, limit, pair};

use crate::files::program_name;
use crate::people::PersonArgs;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueHint};
use pcadlang_workbench::tradeoff::Quality;
use std::path::PathBuf;
use std::time::Duration;

/// The inputs of a program.
#[derive(Args, Clone, Debug)]
pub struct Inputs {
    /// The program: a file, the name of a shipped one such as lathe.pcad, or - for the
    /// standard input
    #[arg(value_name = "PROG", value_hint = ValueHint::FilePath, value_parser = program_name)]
    pub program: String,
    /// Set a `param`; the value is written as in a program; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = pair)]
    pub sets: Vec<(String, String)>,
    /// The camera, a JSON file; by default a view 4.4 units across at distance 8
    #[arg(long, value_name = "FILE")]
    pub camera: Option<PathBuf>,
    /// A contour detector to replace colour gradients: a structured forest (model.yml.gz)
    /// or, if this build supports it, a network (.onnx). Options follow, as in a
    /// program's `detector`: 'net.onnx, colours = "bgr", white = 255'
    #[arg(long, value_name = "FILE[,OPTION=VALUE…]")]
    pub edges: Option<String>,
    /// Whom it is about
    #[command(flatten)]
    pub who: PersonArgs,
    /// The files it may read, and its limits
    #[command(flatten)]
    pub allowed: Allowed,
}

/// The files that a program may read, and its limits.
#[derive(Args, Clone, Debug, Default)]
pub struct Allowed {
    /// A folder the program may read files from, besides its own; may be repeated
    #[arg(long, value_name = "DIR")]
    pub allow_read: Vec<PathBuf>,
    /// Change a limit on evaluation: depth, nodes, elements or operations; may be
    /// repeated
    #[arg(long = "limit", value_name = "NAME=N", value_parser = limit)]
    pub limits: Vec<(String, u64)>,
}

/// The value of `--quality`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QualityArg {
    /// A measured preset of speed and accuracy.
    Known(Quality),
    /// The program's own settings (`own`).
    Own,
}

impl QualityArg {
    fn parser() -> impl TypedValueParser<Value = QualityArg> {
        let names = Quality::ALL.map(Quality::name).into_iter().chain(["own"]);
        PossibleValuesParser::new(names).map(|name| {
            let known = Quality::ALL.into_iter().find(|q| q.name() == name);
            known.map_or(QualityArg::Own, QualityArg::Known)
        })
    }
}

/// How a program is sampled.
#[derive(Args, Clone, Debug, Default)]
pub struct Sampling {
    /// The random seed: the same seed gives the same draws
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// The number of chains [default: 4]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub chains: Option<u32>,
    /// The number of threads [default: all hardware threads]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub threads: Option<u32>,
    /// Kernel applications per chain after warm-up, overriding the program's
    #[arg(long)]
    pub steps: Option<u64>,
    /// Kernel applications per chain in warm-up, overriding the program's
    #[arg(long)]
    pub warmup: Option<u64>,
    /// A measured preset of speed and accuracy; `own` uses the program's own settings
    #[arg(long, value_parser = QualityArg::parser())]
    pub quality: Option<QualityArg>,
    /// The total time (of a dataset: per case), such as 10s, 2m or 500ms; at most half is
    /// warm-up. Selects the measured preset for that time, unless --quality is given
    #[arg(long, value_parser = duration)]
    pub time: Option<Duration>,
    /// Re-run the whole program at each step: the same draws, but slow; for testing the
    /// engine
    #[arg(long)]
    pub no_incremental: bool,
}

impl Sampling {
    /// The default number of chains.
    pub const CHAINS: u32 = 4;

    /// Returns the number of chains.
    pub fn chains(&self) -> u32 {
        self.chains.unwrap_or(Self::CHAINS)
    }
}

/// One run: a program, what it observes, how it is sampled.
#[derive(Args, Clone, Debug)]
pub struct Job {
    /// Program, parameters, camera
    #[command(flatten)]
    pub inputs: Inputs,
    /// A file for a `data` item, or FILE#ID for one entry of a JSON file; the name may be
    /// omitted if only one item fits
    #[arg(long, value_name = "[NAME=]FILE")]
    pub observe: Vec<String>,
    /// A contour map (bright pixels are contour) to use instead of the photograph's own
    /// contours
    #[arg(long, value_name = "FILE")]
    pub observe_contours: Option<PathBuf>,
    /// Keypoints from a pose detector: a file for the program's one keypoints `data`
    /// item. `#ID` selects one of several people [default: the entry named after the
    /// photograph's file]
    #[arg(long, value_name = "FILE[#ID]")]
    pub keypoints: Option<String>,
    /// The command that computes the photograph's features, for a bank that was made with
    /// it
    #[arg(long, value_name = "CMD")]
    pub features_from: Option<String>,
    /// Seed, chains, steps, time
    #[command(flatten)]
    pub sampling: Sampling,
}

impl Job {
    /// Makes a job without observations.
    pub fn of(inputs: Inputs, sampling: Sampling) -> Job {
        Job {
            inputs,
            observe: Vec::new(),
            observe_contours: None,
            keypoints: None,
            features_from: None,
            sampling,
        }
    }
}

/// `run`.
#[derive(Args, Debug)]
pub struct Run {
    /// The run
    #[command(flatten)]
    pub job: Job,
    /// The folder for results [default: runs/PROG]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Resume the run that the same command began in this folder, if there is one;
    /// `--steps` and `--time` may be larger than before
    #[arg(long)]
    pub resume: bool,
    /// The time between checkpoints, from which an interrupted run resumes
    #[arg(long, value_parser = duration, default_value = "10s", value_name = "TIME")]
    pub checkpoint: Duration,
    /// How many complete states to keep for `show`, evenly spaced, over all chains
    #[arg(long, default_value_t = 100, value_name = "N", value_parser = clap::value_parser!(u32).range(..=100_000))]
    pub keep: u32,
    /// Send the best state as it improves to a folder or to http://HOST[:PORT]/PATH:
    /// overlay.png, best.glb, state.json; for a viewer of your own
    #[arg(long, value_name = "DIR|URL")]
    pub live: Option<Live>,
    /// Also report what was modelled, proposed, redrawn and skipped, and why
    #[arg(long)]
    pub explain: bool,
    /// List every approximation made in the run
    #[arg(long, short)]
    pub verbose: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
    /// Print each draw as a line of JSON as soon as it is made, and no tables
    #[arg(long)]
    pub stream: bool,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
}
