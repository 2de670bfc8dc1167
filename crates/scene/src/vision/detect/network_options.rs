//! The settings of a network that its file does not contain: its input normalisation,
//! which output is the map, and what the map shows.

use crate::vision::detect::soft_map::Shows;

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
    /// What the map shows.
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
    pub(in crate::vision) fn wrong(&self) -> Option<&'static str> {
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
