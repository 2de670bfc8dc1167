//! The arguments of the commands on finished runs.

use clap::Args;
use std::path::PathBuf;

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

/// `report`.
#[derive(Args, Debug)]
pub struct Report {
    /// The folder of the run
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
}
