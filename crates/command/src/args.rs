//! The command line.

// Comments of arguments are the help that the command prints, not Markdown.
#![allow(rustdoc::broken_intra_doc_links, rustdoc::invalid_html_tags, rustdoc::bare_urls)]

use super::camera::CameraOf;
use super::detect::Detect;
use super::manual::{Completions, Man};
use clap::{Args, Parser, Subcommand, ValueHint};
pub use pcadlang_runs::args::{
    Allowed, Compare, Film, Inputs, Job, Live, QualityArg, Report, Run, Sampling, Show,
};
use pcadlang_runs::args::{duration, pair};
use pcadlang_runs::files::program_name;
use pcadlang_studio::Studio;
use std::path::PathBuf;
use std::time::Duration;

/// The help text on exit codes.
const EXIT_CODES: &str = "\
Exit codes: 0 success, 1 an error in the program, its data or a file, 2 an error in the command line, \
3 interrupted (results so far are kept), 130 interrupted twice.";

/// A probabilistic CAD language: Bayesian inference of 3D scenes from photographs.
#[derive(Debug, Parser)]
#[command(name = "pcadlang", version, max_term_width = 100, after_help = EXIT_CODES)]
pub struct Cli {
    /// The command.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Sample from the posterior of a program, given its observations
    Run(Run),
    /// Run a program on every picture of a dataset and write results for scoring
    Evaluate(Evaluate),
    /// Measure the trade-off of speed and accuracy over settings, on cases with ground
    /// truth
    Tradeoff(Tradeoff),
    /// Draw scenes from the prior and show them on a contact sheet
    Sample(Sample),
    /// Fill a bank with scenes drawn from the prior, for the proposals of the kernel
    /// `knn`
    Learn(Learn),
    /// Check programs for mistakes, or test whether their plans sample from the posterior
    Check(Check),
    /// Predictive check: draw replicated data and compare them with the observed data
    Predict(Predict),
    /// Detect the contours in a photograph
    Contours(Contours),
    /// Detect the people in a photograph
    Detect(Detect),
    /// Print what is understood of a camera file, and draw the axes of its world
    Camera(CameraOf),
    /// Explain a built-in, search the built-ins, or list them all
    Doc(Doc),
    /// Explore a program interactively; `:help` at the prompt lists the commands
    Repl(Repl),
    /// Serve a web application on this machine: write programs, run them over photographs,
    /// look at what they find
    Studio(Studio),
    /// Format programs: spacing and line breaks; comments are kept
    Fmt(Fmt),
    /// Serve an editor: the Language Server Protocol over standard input and output
    Lsp,
    /// Print a shell completion script
    Completions(Completions),
    /// Show a kept state of a finished run: a picture, a mesh, or its choices
    Show(Show),
    /// Compare two runs: their settings, quantities and pictures
    Compare(Compare),
    /// Make a film of a run: from the prior to the posterior, and around the best state
    Film(Film),
    /// Make the page of a run anew, `report.html`, from what its folder holds
    Report(Report),
    /// Print the manual page, or write one for every command
    Man(Man),
}

/// `evaluate`.
#[derive(Args, Debug)]
#[command(after_help = LAYOUTS)]
pub struct Evaluate {
    /// Program, parameters, the camera for cases without one
    #[command(flatten)]
    pub inputs: Inputs,
    /// The folder of the dataset
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// The folder for results: one run folder per case, and summaries
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Detected keypoints, JSON keyed by case; cases without any run on their picture
    /// alone
    #[arg(long, value_name = "FILE")]
    pub keypoints: Option<PathBuf>,
    /// Only these cases
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Seed, chains, steps, time
    #[command(flatten)]
    pub sampling: Sampling,
    /// Redo all cases; otherwise completed ones are kept, and changed settings are an
    /// error
    #[arg(long)]
    pub fresh: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
}

/// The help text on the layouts of a dataset.
const LAYOUTS: &str = "\
The dataset is either
  * one folder per case, with image.png (or .jpg) and, if the camera is known, camera.json
  * or annotations.json = {\"people\": [{\"id\": …, \"image\": FILE}, …]} with the pictures beside it
Other files and fields are ignored.

Besides one folder per case, DIR gets evaluation.json, table.md and, for people, predictions.json.
Repeat the command to resume after an interruption. Exit code 1 if a case failed, 3 if interrupted.";

/// `tradeoff`.
#[derive(Args, Debug)]
#[command(after_help = ANSWERS)]
pub struct Tradeoff {
    /// Program, parameters, camera
    #[command(flatten)]
    pub inputs: Inputs,
    /// The cases: one folder each, with the observed data and the ground truth
    #[arg(long, value_name = "DIR")]
    pub cases: PathBuf,
    /// The settings to try, a JSON file; may be repeated [default: PROG.settings.json]
    #[arg(long, value_name = "FILE")]
    pub settings: Vec<PathBuf>,
    /// Detected keypoints for the cases: {CASE: {"keypoints": {NAME: [x, y, …], …}}, …}
    #[arg(long, value_name = "FILE")]
    pub keypoints: Option<PathBuf>,
    /// The folder for results; results already there are reused
    #[arg(long, value_name = "DIR", default_value = "tradeoff")]
    pub out: PathBuf,
    /// The total time, earlier calls with the same folder included; if it is short,
    /// settings that do badly on a few cases are dropped
    #[arg(long, value_parser = duration, default_value = "1h")]
    pub budget: Duration,
    /// Runs of each setting on each case
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub seeds: u32,
    /// Only these cases, separated by commas
    #[arg(long, value_name = "CASES", value_delimiter = ',')]
    pub only: Vec<String>,
    /// The number of threads per run [default: 2]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub threads: Option<u32>,
    /// The number of concurrent runs [default: as many as the hardware threads allow]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub jobs: Option<u32>,
    /// Also write the Pareto front to this file; as PROG.quality.json it has the presets
    /// for `run --quality` and `--time`
    #[arg(long, value_name = "FILE")]
    pub presets: Option<PathBuf>,
    /// Discard earlier results and measure everything again
    #[arg(long)]
    pub fresh: bool,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
}

/// The help text on the formats of cases, ground truth and settings.
const ANSWERS: &str = "\
A case is a folder with image.png (or .jpg), camera.json if the camera is known, and the ground truth:
depth.npy (and normals.npy), or gt.npz with arrays of these names; or a person in annotations.json, with
the `keypoints` as ground truth. Without pictures: a folder with reference.json,
{QUANTITY: {\"mean\": …, \"sd\": …}, …}, and a file named after each `data` item, such as y.csv.

Settings: {\"base\": {\"chains\": 4, \"size\": 128}, \"cross\": {\"time\": [1, 3]}, \"vary\": {\"size\": [64], \"chains\": [1, 2]}}
Every combination of the `cross` values is run with each change in `vary`, one at a time; `also` lists further
settings, `random` is a number of random ones; with `compare: true` none of them becomes a preset. Names other
than program, chains, time, steps and warmup are parameters of the program.";

/// `sample`.
#[derive(Args, Debug)]
pub struct Sample {
    /// Program, parameters, camera
    #[command(flatten)]
    pub inputs: Inputs,
    /// The number of scenes
    #[arg(short, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub n: u32,
    /// The random seed
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// The picture to write
    #[arg(long, value_name = "FILE", default_value = "sheet.png")]
    pub out: PathBuf,
    /// The longer side of each picture in pixels
    #[arg(long, default_value_t = 192, value_parser = clap::value_parser!(u32).range(16..=2048))]
    pub size: u32,
}

/// `learn`.
#[derive(Args, Debug)]
pub struct Learn {
    /// Program, parameters, camera
    #[command(flatten)]
    pub inputs: Inputs,
    /// The number of scenes
    #[arg(short, default_value_t = 10_000, value_parser = clap::value_parser!(u32).range(1..))]
    pub n: u32,
    /// The number of the first scene, for a part of a bank
    #[arg(long, default_value_t = 0, value_name = "K")]
    pub first: u32,
    /// Join these parts, drawn with --first, instead of drawing scenes
    #[arg(long, value_name = "BANK", num_args = 1.., conflicts_with_all = ["n", "first"])]
    pub join: Vec<PathBuf>,
    /// The bank to write
    #[arg(short, long, value_name = "BANK")]
    pub out: PathBuf,
    /// The random seed: the same seed gives the same bank
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// The number of threads [default: all hardware threads]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub threads: Option<u32>,
    /// The features that pictures are compared by
    #[arg(long, value_enum, default_value_t = FeatureKind::Contours)]
    pub features: FeatureKind,
    /// A command that prints a picture's features, equally many for all. {png} is
    /// replaced by the picture's file; no shell is used
    #[arg(long, value_name = "CMD", conflicts_with = "features")]
    pub features_from: Option<String>,
    /// The longer side of the pictures that features are computed from, in pixels
    #[arg(long, default_value_t = 128, value_parser = clap::value_parser!(u32).range(16..=2048))]
    pub features_size: u32,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
}

/// The built-in features.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FeatureKind {
    /// Distances to contours and histograms of contour orientations
    Contours,
    /// The positions of landmarks
    Keypoints,
}

/// `check`.
#[derive(Args, Debug)]
#[command(after_help = CHECKS)]
pub struct Check {
    /// The programs
    #[arg(required = true, value_name = "PROG", value_hint = ValueHint::FilePath, value_parser = program_name)]
    pub programs: Vec<String>,
    /// Check again whenever a source file changes, until interrupted
    #[arg(long, conflicts_with_all = ["sbc", "geweke"])]
    pub watch: bool,
    /// Simulation-based calibration: rank the true values of simulated data among the
    /// draws
    #[arg(long)]
    pub sbc: bool,
    /// Geweke's test: alternate updates and simulated data, and compare with the prior
    #[arg(long)]
    pub geweke: bool,
    /// The number of data sets for --sbc [default: 200], of chains for --geweke [default:
    /// 100]
    #[arg(long, value_parser = clap::value_parser!(u32).range(20..=1_000_000))]
    pub replicates: Option<u32>,
    /// The random seed: the same seed gives the same result
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// The number of threads [default: all hardware threads]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub threads: Option<u32>,
    /// Kernel applications per chain after warm-up, overriding the program's
    #[arg(long)]
    pub steps: Option<u64>,
    /// Set a `param`; the value is written as in a program; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = pair)]
    pub sets: Vec<(String, String)>,
    /// A file for a `data` item; simulated data have the same shape
    #[arg(long, value_name = "[NAME=]FILE")]
    pub observe: Vec<String>,
    /// The files that the programs may read, and their limits
    #[command(flatten)]
    pub allowed: Allowed,
}

/// The help text on `--sbc` and `--geweke`.
const CHECKS: &str = "\
With --sbc or --geweke, data are simulated from the program, so every observation needs a sampler: all
distributions have one, and scene.mask, scene.depth, scene.keypoints and scene.region (powers 1 and 0). Exit
code 1 if a quantity fails or the program cannot be simulated. A correct plan fails once in 1000 by chance.";

/// `predict`.
#[derive(Args, Debug)]
pub struct Predict {
    /// The run
    #[command(flatten)]
    pub job: Job,
    /// Draw from the prior instead of the posterior
    #[arg(long)]
    pub prior: bool,
    /// The number of draws from the prior
    #[arg(short, default_value_t = 1000, requires = "prior", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub n: u32,
    /// The folder for results [default: runs/PROG-predictive]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// `contours`.
#[derive(Args, Debug)]
pub struct Contours {
    /// The photograph
    #[arg(value_name = "IMG")]
    pub image: PathBuf,
    /// The contour map to write
    #[arg(short, long, value_name = "FILE", default_value = "contours.png")]
    pub out: PathBuf,
    /// The longer side in pixels at which contours are detected [default: 256; with
    /// --edges 512]
    #[arg(long, value_parser = clap::value_parser!(u32).range(8..=8192))]
    pub size: Option<u32>,
    /// A contour detector to replace colour gradients, in builds with the feature
    /// contour_detectors: a structured forest (model.yml.gz) or a network (.onnx). Options
    /// follow, as in a program's `detector`: 'net.onnx, colours = "bgr", white = 255'
    #[arg(long, value_name = "FILE[,OPTION=VALUE…]")]
    pub edges: Option<String>,
}

/// `doc`.
#[derive(Args, Debug)]
pub struct Doc {
    /// The name of a built-in; without it, all of them, as Markdown
    pub name: Option<String>,
    /// Search names, sections and descriptions for these words
    #[arg(long, value_name = "WORDS", num_args = 1.., conflicts_with = "name")]
    pub search: Option<Vec<String>>,
}

/// `fmt`.
#[derive(Args, Debug)]
pub struct Fmt {
    /// Programs, or folders containing programs
    #[arg(value_name = "FILE", value_hint = ValueHint::AnyPath, required_unless_present = "stdin")]
    pub paths: Vec<PathBuf>,
    /// Only list the files that would change, and exit with code 1 if there are any
    #[arg(long)]
    pub check: bool,
    /// Read a program from standard input and write it to standard output
    #[arg(long, conflicts_with = "paths")]
    pub stdin: bool,
}

/// `repl`.
#[derive(Args, Debug)]
#[command(after_help = PROMPT)]
pub struct Repl {
    /// The program to start from: a file, the name of a shipped program, or the folder of
    /// a run (its program, data, settings and best state are loaded). Without it, an
    /// empty program
    #[arg(value_name = "PROG|RUN", value_parser = program_name)]
    pub program: Option<String>,
    /// Set a `param`; the value is written as in a program; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = pair, requires = "program")]
    pub sets: Vec<(String, String)>,
    /// The camera, as of `run`
    #[arg(long, value_name = "FILE[#PICTURE]", requires = "program")]
    pub camera: Option<PathBuf>,
    /// A file for a `data` item; the name may be omitted if only one item fits
    #[arg(long, value_name = "[NAME=]FILE", requires = "program")]
    pub observe: Vec<String>,
    /// Keypoints from a pose detector: a file for the program's one keypoints `data` item
    #[arg(long, value_name = "FILE[#ID]", requires = "program")]
    pub keypoints: Option<String>,
    /// The files that the program may read, and its limits
    #[command(flatten)]
    pub allowed: Allowed,
    /// The random seed: the same input with the same seed gives the same session
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// How to show pictures [default: detected from the environment]
    #[arg(long, value_enum)]
    pub graphics: Option<Graphics>,
    /// Echo each line with its prompt and continue after errors: a transcript of a
    /// session
    #[arg(long)]
    pub transcript: bool,
}

/// The help text on terminals, scripts and keys.
const PROMPT: &str = "\
A terminal has line editing, history and completion (Tab). Piped input runs as a script, which stops with
exit code 1 at the first error. Ctrl-C clears the line, ends inference and keeps its draws, or cancels
another running command, which then changes nothing; Ctrl-D quits.";

/// Ways to show a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Graphics {
    /// The graphics protocol of kitty and ghostty
    Kitty,
    /// The graphics protocol of iTerm2, WezTerm and mintty
    Iterm,
    /// Half blocks in 24-bit colours
    #[value(alias = "sixel")]
    Blocks,
    /// Half blocks in 256 colours
    Blocks256,
    /// Write pictures to files
    File,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().debug_assert();
    }
}
