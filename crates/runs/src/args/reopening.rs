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

/// `film`.
#[derive(Args, Debug)]
pub struct Film {
    /// The folder of the run
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// The file to write: an animated picture (.png), or meshes with their animation (.glb;
    /// a body keeps its skin). A name without an ending is a folder for one PNG file per
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
