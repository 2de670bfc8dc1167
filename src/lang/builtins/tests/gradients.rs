//! Every function of the table says what its derivative is: a vector-Jacobian product, zero, or one of a few that have none.

use super::*;
use crate::lang::builtins::Derivative;

/// Functions without a derivative, and why.
const NONE: &[(&str, &str)] = &[
    ("scene.autorig", "joints are found by search"),
    ("scene.camera", "cameras are not differentiated"),
    ("scene.mask", "pixels are inside or outside"),
    ("scene.region", "pixels are inside or outside"),
];

#[test]
fn every_function_has_a_derivative_is_flat_or_is_listed() {
    let mut without: Vec<String> = Vec::new();
    for b in TABLE.iter().filter(|b| matches!(b.kind, Kind::Function(_))) {
        let name = b.full_name();
        // What stands for files is no expression.
        if matches!(b.derivative, Derivative::Unknown) && b.section != "Data files" {
            without.push(name);
        }
    }
    without.sort();
    let listed: Vec<&str> = NONE.iter().map(|(name, _)| *name).collect();
    assert_eq!(without, listed);
}
