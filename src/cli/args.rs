//! The command line.

mod values;

use super::compare::Compare;
use super::detect::Detect;
use super::files::program_name;
use super::manual::{Completions, Man};
use super::people::Who;
use super::report::Report;
use super::show::Show;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueHint};
use pcadlang::tradeoff::Quality;
use std::path::PathBuf;
use std::time::Duration;
use values::{duration, limit, pair};

/// From a photograph back to a 3D scene, by Bayesian inference.
#[derive(Debug, Parser)]
#[command(name = "pcadlang", version, max_term_width = 100, after_help = super::EXIT_CODES)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Sample the scenes that explain what is observed
    Run(Run),
    /// Run a program on every picture of a dataset and write what scorers read
    Evaluate(Evaluate),
    /// Measure what speed costs in accuracy, over settings and cases with known answers
    Tradeoff(Tradeoff),
    /// Draw scenes from the prior and show them on one sheet
    Sample(Sample),
    /// Draw scenes from the prior into a bank, from which the kernel `knn` proposes
    Learn(Learn),
    /// Check programs: without running them, or whether their plans draw from the posterior
    Check(Check),
    /// Draw what would be observed again, and compare with what is
    Predict(Predict),
    /// Find the contours of a photograph
    Contours(Contours),
    /// Find the people in a photograph
    Detect(Detect),
    /// Explain a built-in, search for some, or list all of them
    Doc(Doc),
    /// Explore a program at a prompt: `:help` there lists what can be done
    Repl(Repl),
    /// Format programs: spaces and line ends; comments stay
    Fmt(Fmt),
    /// Print a script that completes commands in a shell
    Completions(Completions),
    /// Show a state of a run that has ended: a picture, a mesh, or its choices
    Show(Show),
    /// Compare two runs: what was set differently, their quantities, their pictures
    Compare(Compare),
    /// Make the page of a run anew, `report.html`, from what its folder holds
    Report(Report),
    /// Print the manual page, or write one for every command
    Man(Man),
}

/// What a program is given.
#[derive(Args, Clone, Debug)]
pub struct Given {
    /// The program: a file, or the name of a shipped one such as lathe.pcad
    #[arg(value_name = "PROG", value_hint = ValueHint::FilePath, value_parser = program_name)]
    pub program: String,
    /// Set a `param`, its value as in a program; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = pair)]
    pub sets: Vec<(String, String)>,
    /// The camera, as a JSON file; without one the default view (4.4 units across at distance 8)
    #[arg(long, value_name = "FILE")]
    pub camera: Option<PathBuf>,
    /// What finds contours in photographs, in place of gradients of colour: a structured forest (model.yml.gz) or, if this
    /// build has them, a network (.onnx). Options are written behind it as in `detector` of a program:
    /// 'net.onnx, colours = "bgr", white = 255'
    #[arg(long, value_name = "FILE[,OPTION=VALUE…]")]
    pub edges: Option<String>,
    /// Whom it is about
    #[command(flatten)]
    pub who: Who,
    /// What it may read and build
    #[command(flatten)]
    pub allowed: Allowed,
}

/// What a program may read and build.
#[derive(Args, Clone, Debug, Default)]
pub struct Allowed {
    /// A folder below which the program may read files, besides its own folder; may be repeated
    #[arg(long, value_name = "DIR")]
    pub allow_read: Vec<PathBuf>,
    /// Another limit on what the program builds: depth, nodes, elements or operations; may be repeated
    #[arg(long = "limit", value_name = "NAME=N", value_parser = limit)]
    pub limits: Vec<(String, u64)>,
}

/// `--quality`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QualityArg {
    /// A place on the front of speed and accuracy.
    Known(Quality),
    /// The program as it is.
    Own,
}

impl QualityArg {
    fn parser() -> impl TypedValueParser<Value = QualityArg> {
        PossibleValuesParser::new(super::quality::names()).map(|name| {
            let known = Quality::ALL.into_iter().find(|q| q.name() == name);
            known.map_or(QualityArg::Own, QualityArg::Known)
        })
    }
}

/// How a program is sampled.
#[derive(Args, Clone, Debug, Default)]
pub struct Sampling {
    /// The seed: same seed, same draws
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// The number of chains; 4 if left out
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub chains: Option<u32>,
    /// The number of threads; as many as the machine has, if left out
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub threads: Option<u32>,
    /// Kernel applications per chain after warm-up, in place of what the program says
    #[arg(long)]
    pub steps: Option<u64>,
    /// Kernel applications per chain in warm-up, in place of what the program says
    #[arg(long)]
    pub warmup: Option<u64>,
    /// Measured presets of speed against accuracy, where the program has them; `own` runs the program as it is
    #[arg(long, value_parser = QualityArg::parser())]
    pub quality: Option<QualityArg>,
    /// Time in all (of a dataset: each case), such as 10s, 2m or 500ms; at most half of it is warm-up. The measured preset for
    /// that time is used, unless there is --quality
    #[arg(long, value_parser = duration)]
    pub time: Option<Duration>,
    /// Re-run the whole program at each step: slow, and the same draws; for checking the engine
    #[arg(long)]
    pub no_incremental: bool,
}

impl Sampling {
    /// The number of chains where nobody says.
    pub const CHAINS: u32 = 4;

    /// The number of chains.
    pub fn chains(&self) -> u32 {
        self.chains.unwrap_or(Self::CHAINS)
    }
}

/// One run: a program, what it observes, how it is sampled.
#[derive(Args, Clone, Debug)]
pub struct Job {
    /// Program, parameters, camera
    #[command(flatten)]
    pub given: Given,
    /// A file for a `data` item, or FILE#ID for one entry of a JSON file; the name may be left out if there is only
    /// one that fits
    #[arg(long, value_name = "[NAME=]FILE")]
    pub observe: Vec<String>,
    /// A ready contour map (bright is contour) in place of the photograph's own contours
    #[arg(long, value_name = "FILE")]
    pub observe_contours: Option<PathBuf>,
    /// What a pose detector found: a file for the only `data` item of keypoints. `#ID` chooses one of several people;
    /// without it the one called like the photograph's file
    #[arg(long, value_name = "FILE[#ID]")]
    pub keypoints: Option<String>,
    /// The command that finds the features of the photograph, for a bank that was learnt with it
    #[arg(long, value_name = "CMD")]
    pub features_from: Option<String>,
    /// Seed, chains, steps, time
    #[command(flatten)]
    pub sampling: Sampling,
}

impl Job {
    /// A run that observes nothing.
    pub fn of(given: Given, sampling: Sampling) -> Job {
        Job { given, observe: Vec::new(), observe_contours: None, keypoints: None, features_from: None, sampling }
    }
}

/// `run`.
#[derive(Args, Debug)]
pub struct Run {
    /// What is run
    #[command(flatten)]
    pub job: Job,
    /// The folder for results; runs/PROG if left out
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Go on with the run that the same command began in this folder; begin it if there is none. `--steps` and `--time` may be
    /// more than before
    #[arg(long)]
    pub resume: bool,
    /// The time between checkpoints, which are what a run goes on from
    #[arg(long, value_parser = duration, default_value = "10s", value_name = "TIME")]
    pub checkpoint: Duration,
    /// How many whole states are kept for `show`, of all chains together, at even distances
    #[arg(long, default_value_t = 100, value_name = "N", value_parser = clap::value_parser!(u32).range(..=100_000))]
    pub keep: u32,
    /// Also say what was modelled, proposed, redrawn and skipped, and why
    #[arg(long)]
    pub explain: bool,
    /// List everything that is approximate in the run
    #[arg(long, short)]
    pub verbose: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
}

/// `evaluate`.
#[derive(Args, Debug)]
#[command(after_help = LAYOUTS)]
pub struct Evaluate {
    /// Program, parameters, the camera of cases that have none of their own
    #[command(flatten)]
    pub given: Given,
    /// The folder of the dataset
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// The folder for results: a run's folder for each case, and summaries
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Detected keypoints, JSON by case: each case observes its own; one without any runs on its picture alone
    #[arg(long, value_name = "FILE")]
    pub keypoints: Option<PathBuf>,
    /// Only these cases
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Seed, chains, steps, time
    #[command(flatten)]
    pub sampling: Sampling,
    /// Do all cases anew; without it, those that are complete are kept, and other settings are an error
    #[arg(long)]
    pub fresh: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
}

/// What a dataset may look like.
const LAYOUTS: &str = "\
The dataset is one of
  * a folder for each case, with image.png (or .jpg) and, if its camera is known, camera.json
  * a file annotations.json = {\"people\": [{\"id\": …, \"image\": FILE}, …]} with the pictures beside it
Nothing else in it is read: neither other files nor other fields.

DIR gets, besides a folder for each case, evaluation.json, table.md and, for people, predictions.json. Run again to go on
after an interruption. Exit code 1 if a case failed, 3 if interrupted.";

/// `tradeoff`.
#[derive(Args, Debug)]
#[command(after_help = ANSWERS)]
pub struct Tradeoff {
    /// Program, parameters, camera
    #[command(flatten)]
    pub given: Given,
    /// The cases: a folder for each, with what is observed and the known answer
    #[arg(long, value_name = "DIR")]
    pub cases: PathBuf,
    /// The settings to try, as JSON, also several times; PROG with the ending .settings.json if left out
    #[arg(long, value_name = "FILE")]
    pub settings: Vec<PathBuf>,
    /// Detected keypoints of the cases: {CASE: {"keypoints": {NAME: [x, y, …], …}}, …}
    #[arg(long, value_name = "FILE")]
    pub keypoints: Option<PathBuf>,
    /// The folder for results; one that has some of the same kind is taken up
    #[arg(long, value_name = "DIR", default_value = "tradeoff")]
    pub out: PathBuf,
    /// Time for everything, earlier sittings in the folder included; if it is short, settings that fall behind on a few cases are left out
    /// on the others
    #[arg(long, value_parser = duration, default_value = "1h")]
    pub budget: Duration,
    /// Runs of each setting on each case
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub seeds: u32,
    /// Some of the cases, separated by commas
    #[arg(long, value_name = "CASES", value_delimiter = ',')]
    pub only: Vec<String>,
    /// The number of threads of each run; 2 if left out
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub threads: Option<u32>,
    /// How many runs at once; as many as there are threads for, if left out
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub jobs: Option<u32>,
    /// Write the front here too: as PROG with the ending .quality.json, --quality and --time of `run` find it
    #[arg(long, value_name = "FILE")]
    pub presets: Option<PathBuf>,
    /// Measure everything anew
    #[arg(long)]
    pub fresh: bool,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
}

/// What a known answer is.
const ANSWERS: &str = "\
A case is a folder with image.png (or .jpg), camera.json if its camera is known, and the answer: depth.npy (and normals.npy), or
gt.npz with arrays of these names; or one of the people of annotations.json, its `keypoints` the answer. Without pictures: a folder
with reference.json, {QUANTITY: {\"mean\": …, \"sd\": …}, …}, and a file called like each `data` item, such as y.csv.

Settings: {\"base\": {\"chains\": 4, \"size\": 128}, \"cross\": {\"time\": [1, 3]}, \"vary\": {\"size\": [64], \"chains\": [1, 2]}}
Each value of `cross` with each change of `vary`, one at a time; `also` is a list of more, `random` a number of random ones; with `compare: true` none becomes a preset. Names other
than program, chains, time, steps and warmup are parameters of the program.";

/// `sample`.
#[derive(Args, Debug)]
pub struct Sample {
    /// Program, parameters, camera
    #[command(flatten)]
    pub given: Given,
    /// How many
    #[arg(short, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub n: u32,
    /// The seed
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
    pub given: Given,
    /// How many scenes
    #[arg(short, default_value_t = 10_000, value_parser = clap::value_parser!(u32).range(1..))]
    pub n: u32,
    /// The bank to write
    #[arg(short, long, value_name = "BANK")]
    pub out: PathBuf,
    /// The seed: same seed, same bank
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// The number of threads; as many as the machine has, if left out
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub threads: Option<u32>,
    /// What tells pictures apart
    #[arg(long, value_enum, default_value_t = FeatureKind::Contours)]
    pub features: FeatureKind,
    /// A command that prints features of a picture, in place of the built-in ones: numbers, as many for every picture. {png}
    /// stands for the picture's file; no shell reads it
    #[arg(long, value_name = "CMD", conflicts_with = "features")]
    pub features_from: Option<String>,
    /// The longer side of the pictures that features are found in, in pixels
    #[arg(long, default_value_t = 128, value_parser = clap::value_parser!(u32).range(16..=2048))]
    pub features_size: u32,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
}

/// The built-in features.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FeatureKind {
    /// Distances to contours and histograms of their directions
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
    /// Check again whenever a file of a program changes, until interrupted
    #[arg(long, conflicts_with_all = ["sbc", "geweke"])]
    pub watch: bool,
    /// Run the plan on data simulated from the program and rank the true values among the draws
    #[arg(long)]
    pub sbc: bool,
    /// Let the plan and fresh data take turns and compare with the prior
    #[arg(long)]
    pub geweke: bool,
    /// Data sets of --sbc (200 if left out), chains of --geweke (100)
    #[arg(long, value_parser = clap::value_parser!(u32).range(20..=1_000_000))]
    pub replicates: Option<u32>,
    /// The seed: same seed, same result
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// The number of threads; as many as the machine has, if left out
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub threads: Option<u32>,
    /// Kernel applications per chain after warm-up, in place of what the program says
    #[arg(long)]
    pub steps: Option<u64>,
    /// Set a `param`, its value as in a program; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = pair)]
    pub sets: Vec<(String, String)>,
    /// A file for a `data` item: simulated data take its form
    #[arg(long, value_name = "[NAME=]FILE")]
    pub observe: Vec<String>,
    /// What the programs may read and build
    #[command(flatten)]
    pub allowed: Allowed,
}

/// What the two checks are.
const CHECKS: &str = "\
With --sbc or --geweke data are simulated from the program itself, so every observation needs a sampler: distributions have
one, and scene.mask, scene.depth, scene.keypoints and scene.region (one power of 1, the other 0). Exit code 1 if a quantity
fails, or if the program cannot be simulated. A right plan fails by chance once in 1000.";

/// `predict`.
#[derive(Args, Debug)]
pub struct Predict {
    /// What is run
    #[command(flatten)]
    pub job: Job,
    /// Draw from the prior in place of the posterior
    #[arg(long)]
    pub prior: bool,
    /// Draws from the prior
    #[arg(short, default_value_t = 1000, requires = "prior", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub n: u32,
    /// The folder for results; runs/PROG-predictive if left out
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
    /// The longer side at which contours are looked for, in pixels; 256 if left out, 512 with --edges, at most 2048 then
    #[arg(long, value_parser = clap::value_parser!(u32).range(8..=8192))]
    pub size: Option<u32>,
    /// What finds them, in place of gradients of colour: a structured forest (model.yml.gz) or, if this build has them, a
    /// network (.onnx). Options are written behind it as in `detector` of a program: 'net.onnx, colours = "bgr", white = 255'
    #[arg(long, value_name = "FILE[,OPTION=VALUE…]")]
    pub edges: Option<String>,
}

/// `doc`.
#[derive(Args, Debug)]
pub struct Doc {
    /// The name of a built-in; all of them, as Markdown, if left out
    pub name: Option<String>,
    /// Find built-ins by words in their names, sections and descriptions
    #[arg(long, value_name = "WORDS", num_args = 1.., conflicts_with = "name")]
    pub search: Option<Vec<String>>,
}

/// `fmt`.
#[derive(Args, Debug)]
pub struct Fmt {
    /// Programs, and folders with programs in them
    #[arg(value_name = "FILE", value_hint = ValueHint::AnyPath, required_unless_present = "stdin")]
    pub paths: Vec<PathBuf>,
    /// Change nothing; name the files that would change, and exit with 1 if there are any
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
    /// The program to begin with: a file, the name of a shipped one, or the folder of a run, whose program, data, settings and best
    /// state are taken up; an empty one if left out
    #[arg(value_name = "PROG|RUN", value_parser = program_name)]
    pub program: Option<String>,
    /// Set a `param`, its value as in a program; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = pair, requires = "program")]
    pub sets: Vec<(String, String)>,
    /// The camera, as a JSON file
    #[arg(long, value_name = "FILE", requires = "program")]
    pub camera: Option<PathBuf>,
    /// A file for a `data` item; the name may be left out if there is only one that fits
    #[arg(long, value_name = "[NAME=]FILE", requires = "program")]
    pub observe: Vec<String>,
    /// What a pose detector found: a file for the only `data` item of keypoints
    #[arg(long, value_name = "FILE[#ID]", requires = "program")]
    pub keypoints: Option<String>,
    /// What the program may read and build
    #[command(flatten)]
    pub allowed: Allowed,
    /// The seed: the same lines with the same seed give the same session
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// How pictures are shown; told from the environment if left out
    #[arg(long, value_enum)]
    pub graphics: Option<Graphics>,
    /// Show what is read with its prompt, and go on after errors: a recording of a session
    #[arg(long)]
    pub transcript: bool,
}

/// What `repl` does with its input.
const PROMPT: &str = "\
On a terminal there are editing, history and completion (Tab). What is piped in runs as a script: exit code 1 at the first
error. Ctrl-C clears the line, or ends what is under way and leaves everything as it was; Ctrl-D leaves.";

/// Ways to show a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Graphics {
    /// The protocol of kitty and ghostty
    Kitty,
    /// That of iTerm2 and WezTerm
    Iterm,
    /// Sixels: xterm, foot, mlterm, mintty
    Sixel,
    /// Half blocks in 24-bit colours
    Blocks,
    /// Half blocks in 256 colours
    Blocks256,
    /// A file
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
