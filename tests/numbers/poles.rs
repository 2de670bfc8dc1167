//! Densities with a pole at an end that is not 0, near which doubles are coarse: the mass
//! that rounds to the last double, by every kernel that moves in coordinates.

use crate::common::*;

const KERNELS: &[&str] = &[
    "drift(@p)",
    "slice(@p)",
    "mala(@p)",
    "hmc(@p, steps = 10)",
    "nuts(@p)",
    "mix { 0.3 => mh(@p); 0.7 => drift(@p); }",
];

/// Checks the probability that `near` holds, by every kernel.
fn check(model: &str, near: &str, wanted: f64) {
    for kernel in KERNELS {
        let kernel =
            if kernel.ends_with('}') { (*kernel).to_owned() } else { format!("{kernel};") };
        let text = format!(
            "{model} assume near = if {near} {{ 1 }} else {{ 0 }};
             infer {{ warmup 2000 {{ {kernel} }} repeat 40000 {{ {kernel} collect near; }} }}"
        );
        assert_mean(&format!("{kernel} on {model}"), &run(&text, 5, 2)["near"], wanted, 0.06);
    }
}

// The probabilities are by mpmath: betainc(b, a, 0, distance, regularized = True), with the
// posterior's a and b.
#[test]
fn beta_at_one() {
    let model = "assume p ~ beta(9999, 0.1); observe flip(p) = true;";
    check(model, "p > 1 - 1e-12", 0.166_593_238_700_360_86);
}

#[test]
fn beta_with_two_poles() {
    let model = "assume p ~ beta(0.3, 0.05); observe flip(p) = true;";
    check(model, "p > 1 - 1e-14", 0.203_513_572_612_679_38);
}

#[test]
fn beta_at_zero() {
    let model = "assume p ~ beta(0.1, 9999); observe flip(p) = false;";
    check(model, "p < 1e-12", 0.166_593_238_700_360_86);
}

#[test]
fn truncated_beta() {
    let model = "assume p ~ truncated(beta(0.3, 0.05), lo = 0.5); observe flip(p) = true;";
    check(model, "p > 1 - 1e-14", 0.208_217_819_197_325_9);
}

#[test]
fn elements() {
    let model = "assume p ~ iid(beta(9999, 0.1), 2); observe flip(p[1]) = true;";
    check(model, "p[1] > 1 - 1e-12", 0.166_593_238_700_360_86);
}
