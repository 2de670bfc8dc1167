//! The settings of a network that its file does not contain: its input normalisation,
//! which output is the map, and what the map shows.

use pcadlang_inference::host::{DataOptions, Literal};
use pcadlang_scene::vision::Shows;

/// Which output of a network is the map.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Output {
    /// The last one, where networks with several outputs usually put the fused one.
    #[default]
    Last,
    /// The output with this number, from 1.
    Number(usize),
    /// The output with this name.
    Named(String),
}

/// Input and output conventions of a network. Its input is the picture's values, from 0
/// to `white`, minus `mean`, divided by `spread`.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkOptions {
    /// The order of channels is blue, green, red.
    pub bgr: bool,
    /// The value of white.
    pub white: f32,
    /// The value subtracted from each channel, in the network's order.
    pub mean: [f32; 3],
    /// The value that each channel is then divided by.
    pub spread: [f32; 3],
    /// Which output is the map.
    pub output: Output,
    /// The map holds log odds, not probabilities.
    pub logits: bool,
    /// The content of the map.
    pub shows: Shows,
}

impl Default for NetworkOptions {
    fn default() -> Self {
        NetworkOptions {
            bgr: false,
            white: 1.0,
            mean: [0.0; 3],
            spread: [1.0; 3],
            output: Output::Last,
            logits: false,
            shows: Shows::Contours,
        }
    }
}

impl NetworkOptions {
    /// Returns why the options are invalid, if they are.
    pub(crate) fn wrong(&self) -> Option<&'static str> {
        let all = || self.mean.iter().chain(&self.spread);
        let white = self.white > 0.0 && self.white <= 65535.0;
        if !(white && all().all(|v| v.is_finite())) {
            return Some(
                "`white` must be above 0 and at most 65535, `mean` and `spread` finite numbers",
            );
        }
        if self.spread.iter().any(|s| *s <= 0.0) {
            return Some("`spread` must be above 0");
        }
        (self.output == Output::Number(0)).then_some("outputs are counted from 1")
    }
}

/// How a network takes its picture and gives its map.
///
/// # Errors
/// A value that does not fit: a message for the user.
pub(crate) fn network(options: &DataOptions) -> Result<NetworkOptions, String> {
    let mut network = NetworkOptions::default();
    for (name, value) in options.iter() {
        let word = |ways: [&str; 2]| match value {
            Literal::Str(s) if **s == *ways[0] => Ok(false),
            Literal::Str(s) if **s == *ways[1] => Ok(true),
            _ => Err(format!("`{name}` must be \"{}\" or \"{}\"", ways[0], ways[1])),
        };
        let channels = || match value {
            Literal::Num(x) => Ok([*x as f32; 3]),
            Literal::Nums(xs) if xs.len() == 3 => Ok([xs[0], xs[1], xs[2]].map(|x| x as f32)),
            _ => Err(format!("`{name}` must be a literal number or a list of three")),
        };
        match (name, value) {
            ("colours", _) => network.bgr = word(["rgb", "bgr"])?,
            ("shows", _) => {
                network.shows = match word(["contours", "objects"])? {
                    true => Shows::Objects,
                    false => Shows::Contours,
                }
            }
            ("white", Literal::Num(x)) => network.white = *x as f32,
            ("white", _) => return Err("`white` must be a literal number".into()),
            ("mean", _) => network.mean = channels()?,
            ("spread", _) => network.spread = channels()?,
            ("logits", Literal::Bool(b)) => network.logits = *b,
            ("logits", _) => return Err("`logits` must be true or false".into()),
            ("output", Literal::Str(name)) => network.output = Output::Named(name.to_string()),
            ("output", Literal::Num(n)) if *n >= 1.0 && *n <= 1e6 && n.fract() == 0.0 => {
                network.output = Output::Number(*n as usize)
            }
            ("output", _) => {
                return Err("`output` must be a name in quotes or a number from 1".into());
            }
            _ => {}
        }
    }
    Ok(network)
}
