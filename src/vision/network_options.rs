//! What a network has to be told besides its file: how it likes its picture, which of its
//! outputs is the map, and what that shows.

use super::soft_map::Shows;

/// Which output of a network is the map.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Output {
    /// The last one: networks that give several put what they fused there.
    #[default]
    Last,
    /// The one of a number, from 1.
    Number(usize),
    /// The one of a name.
    Named(String),
}

/// How a network takes a picture and gives a map. The picture's values go from 0 to
/// `white`; what the network gets is that less `mean`, by `spread`.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkOptions {
    /// Blue before green before red.
    pub bgr: bool,
    /// The value of white.
    pub white: f32,
    /// What is taken from each channel, in the network's order.
    pub mean: [f32; 3],
    /// By what each channel is divided then.
    pub spread: [f32; 3],
    /// Which output is the map.
    pub output: Output,
    /// The map is of log odds, not of probabilities.
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
    /// Why they make no sense, if they do not.
    pub(super) fn wrong(&self) -> Option<&'static str> {
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
