//! The arguments of `studio`.

// Comments of arguments are the help that the command prints, not Markdown.
#![allow(rustdoc::broken_intra_doc_links, rustdoc::invalid_html_tags, rustdoc::bare_urls)]

use clap::Args;
use pcadlang_runs::args::{Allowed, pair};
use pcadlang_runs::files::program_name;
use std::net::IpAddr;
use std::path::PathBuf;

/// `studio`.
#[derive(Args, Debug)]
#[command(after_help = FOLDER)]
pub struct Studio {
    /// The program to start with: a file, the name of a shipped program, or the folder of a
    /// run
    #[arg(value_name = "PROG|RUN", value_parser = program_name)]
    pub program: Option<String>,
    /// A file for a `data` item; the name may be omitted if only one item fits
    #[arg(long, value_name = "[NAME=]FILE", requires = "program")]
    pub observe: Vec<String>,
    /// Set a `param`; the value is written as in a program; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = pair, requires = "program")]
    pub sets: Vec<(String, String)>,
    /// The files that the program may read, and its limits
    #[command(flatten)]
    pub allowed: Allowed,
    /// The port; 0 takes any that is free
    #[arg(long, default_value_t = 7878)]
    pub port: u16,
    /// Serve other machines, at this address of this one (0.0.0.0: all). Whoever has the
    /// printed address can run programs and write files in this folder
    #[arg(long, value_name = "ADDRESS")]
    pub listen: Option<IpAddr>,
    /// Read the files of the page from a folder: for those who work on it
    #[arg(long, value_name = "DIR", hide = true)]
    pub page: Option<PathBuf>,
    /// How many runs work at a time; others wait [default: all hardware threads, at least 4]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub jobs: Option<u32>,
}

/// The help text on the folder and on what is safe.
const FOLDER: &str = "\
The studio works in the current folder: it reads programs and pictures there, and writes runs to runs/. It
serves this machine only, and only pages that know the random token in the address it prints. Ctrl-C ends it;
`pcadlang run --resume`, or the studio started again, goes on with runs that had not ended.";
