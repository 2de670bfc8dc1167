//! The arguments of `repl`.

use super::Allowed;
use clap::Args;
use pcadlang_runs::args::pair;
use pcadlang_runs::files::program_name;
use std::path::PathBuf;

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
    /// The camera, a JSON file
    #[arg(long, value_name = "FILE", requires = "program")]
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
