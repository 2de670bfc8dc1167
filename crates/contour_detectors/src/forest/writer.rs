//! Small forests in OpenCV's format, for tests.

use std::fmt::Write;
use std::io::Write as _;

/// The parts of a forest's text: options by name, and lists of numbers.
pub struct Text {
    pub options: Vec<(&'static str, usize)>,
    pub children: Vec<u32>,
    pub features: Vec<u32>,
    pub thresholds: Vec<f32>,
    pub boundaries: Vec<u32>,
    pub pixels: Vec<u32>,
}

/// The options of the paper's forest, with the given numbers of trees.
pub fn options(trees: usize, evaluated: usize) -> Vec<(&'static str, usize)> {
    vec![
        ("stride", 2),
        ("shrinkNumber", 2),
        ("patchSize", 32),
        ("patchInnerSize", 16),
        ("numberOfGradientOrientations", 4),
        ("gradientSmoothingRadius", 0),
        ("regFeatureSmoothingRadius", 2),
        ("ssFeatureSmoothingRadius", 8),
        ("gradientNormalizationRadius", 4),
        ("selfsimilarityGridSize", 5),
        ("numberOfTrees", trees),
        ("numberOfTreesToEvaluate", evaluated),
    ]
}

/// Returns the index of the feature that is the difference of L* between two of the 25
/// positions of the grid.
pub fn difference(a: u32, b: u32) -> u32 {
    let before: u32 = (0..a).map(|k| 24 - k).sum();
    16 * 16 * 13 + before + b - a - 1
}

/// Two trees that detect a gradient from left to right, and from top to bottom.
pub fn small() -> Text {
    // No such gradient in the middle cell: leaf 1. Otherwise node 2, where a difference
    // of lightness distinguishes the sign: leaves 3 and 4, which predict the same edges.
    // Nodes 5 and 6 are padding.
    let children = [2, 0, 4, 0, 0, 0, 0];
    let features = |bin: u32, a, b| [(4 + bin) * 256 + 7 * 16 + 7, 0, difference(a, b), 0, 0, 0, 0];
    let thresholds = [0.7, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let column: Vec<u32> = (0..16).flat_map(|r| [7 * 16 + r, 8 * 16 + r]).collect();
    let row: Vec<u32> = (0..16).flat_map(|c| [c * 16 + 7, c * 16 + 8]).collect();
    Text {
        options: options(2, 2),
        children: [children, children].concat(),
        // Positions of the grid are counted downwards first.
        features: [features(0, 7, 17), features(2, 11, 13)].concat(),
        thresholds: [thresholds, thresholds].concat(),
        boundaries: vec![0, 0, 0, 0, 32, 64, 64, 64, 64, 64, 64, 96, 128, 128, 128],
        pixels: [&column[..], &column, &row, &row].concat(),
    }
}

impl Text {
    /// Returns the text.
    pub fn yaml(&self) -> String {
        let mut s = "%YAML:1.0\n---\noptions:\n".to_owned();
        for (name, value) in &self.options {
            let _ = writeln!(s, "   {name}: {value}");
        }
        let trees = self
            .options
            .iter()
            .find(|(n, _)| *n == "numberOfTrees")
            .map_or(1, |(_, n)| (*n).max(1));
        let mut list = |name: &str, numbers: Vec<String>| {
            let _ = writeln!(s, "{name}:");
            for part in numbers.chunks((numbers.len() / trees).max(1)) {
                let lines: Vec<String> = part.chunks(12).map(|l| l.join(", ")).collect();
                let _ = writeln!(s, "   - [ {} ]", lines.join(",\n       "));
            }
        };
        let texts = |n: &[u32]| n.iter().map(u32::to_string).collect();
        list("childs", texts(&self.children));
        list("featureIds", texts(&self.features));
        list("thresholds", self.thresholds.iter().map(|x| format!("{x:.9e}")).collect());
        list("edgeBoundaries", texts(&self.boundaries));
        list("edgeBins", texts(&self.pixels));
        s
    }
}

/// Compresses bytes by gzip.
pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    out.write_all(bytes).unwrap();
    out.finish().unwrap()
}
