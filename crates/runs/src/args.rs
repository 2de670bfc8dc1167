//! Arguments of commands: what a run is given, and what is asked of its folder.

// Comments of arguments are the help that the command prints, not Markdown.
#![allow(rustdoc::broken_intra_doc_links, rustdoc::invalid_html_tags, rustdoc::bare_urls)]

use crate::files::program_name;
use crate::hint::HintArgs;
use crate::people::PersonArgs;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueHint};
use pcadlang_inference::Search;
use pcadlang_workbench::tradeoff::Quality;
use std::path::PathBuf;
use std::str::FromStr;
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
    /// The camera: a file of OpenCV, COLMAP, NeRF, BOP, Open3D and others, see `pcadlang camera`
    /// [default: 4.4 units across, at distance 8 or by the lens that the photograph states]
    #[arg(long, value_name = "FILE[#PICTURE]")]
    pub camera: Option<PathBuf>,
    /// A contour detector to replace colour gradients, in builds with the feature
    /// contour_detectors: a structured forest (model.yml.gz) or a network (.onnx). Options
    /// follow, as in a program's `detector`: 'net.onnx, colours = "bgr", white = 255'
    #[arg(long, value_name = "FILE[,OPTION=VALUE…]")]
    pub edges: Option<String>,
    /// Whom it is about
    #[command(flatten)]
    pub who: PersonArgs,
    /// The files it may read, and its limits
    #[command(flatten)]
    pub allowed: Allowed,
    /// Where the object is in the photograph
    #[command(flatten)]
    pub hint: HintArgs,
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
    /// A measured preset of speed and accuracy, or 10, 30 or 120 seconds for a program
    /// without; `own` uses the program's own settings
    #[arg(long, value_parser = QualityArg::parser())]
    pub quality: Option<QualityArg>,
    /// The total time (of a dataset: per case), such as 10s, 2m or 500ms; at most half is
    /// warm-up, unless --warmup gives its steps, which are all made. Selects the measured
    /// preset for that time, unless --quality is given
    #[arg(long, value_parser = duration)]
    pub time: Option<Duration>,
    /// What the start and the warm-up make in any case, by a preset.
    #[arg(skip)]
    pub search: Search,
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

/// What the results for COCO's tools say of the picture.
#[derive(Args, Clone, Debug, Default)]
pub struct CocoArgs {
    /// The picture's number in a dataset of COCO's layout, for keypoints.coco.json and
    /// mask.coco.json [default: the number that the photograph's file is named by, or else
    /// that name]
    #[arg(long, value_name = "N")]
    pub image_id: Option<u64>,
    /// The number of the object's category, for mask.coco.json [default: 1]
    #[arg(long, value_name = "N")]
    pub category_id: Option<u64>,
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
    /// Write pictures, mask, depth and normals at the size of the photograph, however large
    /// [default: at most 1600 pixels along the longer side]
    #[arg(long)]
    pub full_size: bool,
    /// COCO's numbers
    #[command(flatten)]
    pub coco: CocoArgs,
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
            full_size: false,
            coco: CocoArgs::default(),
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
    /// Replace the run in the folder of --out, also that of another program
    #[arg(long, requires = "out", conflicts_with = "resume")]
    pub overwrite: bool,
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

/// Where states are sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Live {
    /// A folder.
    Folder(PathBuf),
    /// A server, `HOST:PORT`, and a path on it.
    Server(String, String),
}

impl FromStr for Live {
    type Err = String;

    fn from_str(text: &str) -> Result<Live, String> {
        if text.starts_with("https://") {
            return Err("only http:// addresses can be reached".to_owned());
        }
        let Some(rest) = text.strip_prefix("http://") else {
            return Ok(Live::Folder(PathBuf::from(text)));
        };
        let (host, path) = rest.split_once('/').unwrap_or((rest, ""));
        if host.is_empty() || host.contains(|c: char| c.is_whitespace() || c == '@') {
            return Err(format!("`{text}` has no host"));
        }
        let port = host.rsplit_once(':').is_some_and(|(_, p)| p.parse::<u16>().is_ok());
        let host = if port { host.to_owned() } else { format!("{host}:80") };
        let path = path.trim_end_matches('/');
        let path = if path.is_empty() { String::new() } else { format!("/{path}") };
        Ok(Live::Server(host, path))
    }
}

/// `show`.
#[derive(Args, Debug)]
pub struct Show {
    /// The folder of the run
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// Which kept state, numbered from 1 as listed by `show RUN` [default: the best
    /// state]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub draw: Option<u32>,
    /// The file to write: the picture over the photograph (.png) or the mesh (.obj,
    /// .glb). Without it, the choices are printed
    #[arg(short, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

/// `compare`.
#[derive(Args, Debug)]
pub struct Compare {
    /// The folder of a run
    #[arg(value_name = "A")]
    pub a: PathBuf,
    /// The folder of another run
    #[arg(value_name = "B")]
    pub b: PathBuf,
    /// A file to write their overlays to, side by side (.png)
    #[arg(short, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

/// `film`.
#[derive(Args, Debug)]
pub struct Film {
    /// The folder of the run
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// The file to write: an animated picture (.png), or meshes with their animation (.glb). A
    /// program that does not play it shows the best state. A name without an ending is a folder for one PNG file per
    /// picture
    #[arg(short, value_name = "FILE|DIR", default_value = "film.png")]
    pub out: PathBuf,
    /// The longer side of the pictures in pixels
    #[arg(long, default_value_t = 480, value_parser = clap::value_parser!(u32).range(16..=2048))]
    pub size: u32,
    /// Maximum states on the way from the prior
    #[arg(long, default_value_t = 60, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub states: u32,
    /// End with the best state over the photograph, without a turn around it
    #[arg(long)]
    pub no_turn: bool,
}

/// `report`.
#[derive(Args, Debug)]
pub struct Report {
    /// The folder of the run
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
}

/// Parses `NAME=VALUE`.
pub fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => {
            Ok((name.trim().to_owned(), value.trim().to_owned()))
        }
        _ => Err("expected NAME=VALUE".into()),
    }
}

/// Parses a limit on evaluation, `NAME=N`.
pub fn limit(text: &str) -> Result<(String, u64), String> {
    let (name, number) = pair(text)?;
    let number = number.parse().map_err(|_| format!("expected a whole number, got {number}"))?;
    pcadlang_engine::trace::Limits::default().with(&name, number)?;
    Ok((name, number))
}

/// Parses a duration; without a unit, it is in seconds.
pub fn duration(text: &str) -> Result<Duration, String> {
    let wrong = || "expected a time such as 10s, 2m, 1h or 500ms".to_owned();
    let at = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(at);
    let x: f64 = number.trim().parse().map_err(|_| wrong())?;
    let scale = match unit.trim() {
        "ms" => 1e-3,
        "s" | "" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => return Err(wrong()),
    };
    let seconds = x * scale;
    if seconds.is_finite() && (0.0..1e9).contains(&seconds) {
        Ok(Duration::from_secs_f64(seconds))
    } else {
        Err(wrong())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_or_an_address() {
        let of = |text: &str| text.parse::<Live>();
        let server = |host: &str, path: &str| Ok(Live::Server(host.into(), path.into()));
        assert_eq!(of("out/live"), Ok(Live::Folder("out/live".into())));
        assert_eq!(of("http://127.0.0.1:9000"), server("127.0.0.1:9000", ""));
        assert_eq!(of("http://viewer/a/b/"), server("viewer:80", "/a/b"));
        assert!(
            of("https://viewer").is_err() && of("http:///x").is_err() && of("http://a b").is_err()
        );
    }

    #[test]
    fn values_are_read() {
        assert_eq!(duration("500ms"), Ok(Duration::from_millis(500)));
        assert_eq!(duration("1.5m"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("7"), Ok(Duration::from_secs(7)));
        assert!(
            duration("soon").is_err()
                && duration("-1s").is_err()
                && duration("1d").is_err()
                && duration("1e300h").is_err()
        );
        assert_eq!(pair("a = 1"), Ok(("a".into(), "1".into())));
        assert!(pair("a").is_err() && pair("=1").is_err());
    }
}
