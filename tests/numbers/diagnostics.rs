//! The diagnostics compared with ArviZ's numbers on stored draws (made by
//! `data/arviz_summary.py`).

use pcadlang_inference::diagnostics::{
    ess_bulk, ess_mean, ess_quantile, ess_tail, mcse_mean, mcse_sd, r_hat, summary,
};
use serde::Deserialize;

#[derive(Deserialize)]
struct Fixture {
    arviz: String,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    name: String,
    chains: Vec<Vec<Option<f64>>>,
    mean: Option<f64>,
    sd: Option<f64>,
    q05: Option<f64>,
    q50: Option<f64>,
    q95: Option<f64>,
    mcse_mean: Option<f64>,
    mcse_sd: Option<f64>,
    ess_bulk: Option<f64>,
    ess_tail: Option<f64>,
    r_hat: Option<f64>,
    r_hat_split: Option<f64>,
    ess_mean: Option<f64>,
    ess_q25: Option<f64>,
}

fn fixture() -> Vec<Case> {
    let f: Fixture = serde_json::from_str(include_str!("../data/arviz_summary.json")).unwrap();
    assert_eq!(f.arviz, "0.23.4");
    assert_eq!(f.cases.len(), 30);
    f.cases
}

impl Case {
    fn draws(&self) -> Vec<Vec<f64>> {
        self.chains.iter().map(|c| c.iter().map(|x| x.unwrap_or(f64::NAN)).collect()).collect()
    }
}

/// Checks equality to a relative error of 1e-9, with NaN equal to NaN.
fn check(case: &str, what: &str, ours: f64, theirs: Option<f64>) {
    match theirs {
        None => assert!(ours.is_nan(), "{case}: {what} is {ours}, not NaN"),
        Some(t) => {
            assert!((ours - t).abs() <= 1e-9 * t.abs(), "{case}: {what} is {ours}, ArviZ has {t}")
        }
    }
}

#[test]
fn summary_equals_arviz() {
    for c in fixture() {
        let s = summary(&c.draws());
        check(&c.name, "mean", s.mean, c.mean);
        check(&c.name, "sd", s.sd, c.sd);
        check(&c.name, "q05", s.q05, c.q05);
        check(&c.name, "q50", s.q50, c.q50);
        check(&c.name, "q95", s.q95, c.q95);
        check(&c.name, "mcse_mean", s.mcse_mean, c.mcse_mean);
        if c.name == "tiny scale" {
            // ArviZ treats squares below 1e-15 as constant; ours is that of the same
            // draws in another unit.
            let unit = 2f64.powi(40);
            let large: Vec<Vec<f64>> =
                c.draws().iter().map(|d| d.iter().map(|x| x * unit).collect()).collect();
            check(&c.name, "mcse_sd", s.mcse_sd * unit, Some(summary(&large).mcse_sd));
        } else {
            check(&c.name, "mcse_sd", s.mcse_sd, c.mcse_sd);
        }
        check(&c.name, "ess_bulk", s.ess_bulk, c.ess_bulk);
        check(&c.name, "ess_tail", s.ess_tail, c.ess_tail);
        if c.name == "each chain constant" {
            // The draws do not vary within chains: ArviZ's number is the reciprocal of a
            // rounding error, ours is undefined.
            assert!(s.r_hat.is_nan(), "{}", s.r_hat);
        } else {
            check(&c.name, "r_hat", s.r_hat, c.r_hat);
        }
    }
}

#[test]
fn single_diagnostics_equal_arviz_and_the_summary() {
    for c in fixture() {
        let x = c.draws();
        check(&c.name, "ess_mean", ess_mean(&x), c.ess_mean);
        check(&c.name, "ess_quantile", ess_quantile(&x, 0.25), c.ess_q25);
        let s = summary(&x);
        for (what, single, whole) in [
            ("ess_bulk", ess_bulk(&x), s.ess_bulk),
            ("ess_tail", ess_tail(&x), s.ess_tail),
            ("mcse_mean", mcse_mean(&x), s.mcse_mean),
            ("mcse_sd", mcse_sd(&x), s.mcse_sd),
            ("r_hat", r_hat(&x), s.r_hat),
        ] {
            assert_eq!(single.to_bits(), whole.to_bits(), "{}: {what}", c.name);
        }
        // arviz.rhat splits before it folds, which is the same if no middle draw is
        // dropped.
        if x[0].len().is_multiple_of(2) && c.name != "each chain constant" {
            check(&c.name, "r_hat", s.r_hat, c.r_hat_split);
        }
    }
}

#[test]
fn only_ranks_matter_to_the_bulk() {
    let x: Vec<Vec<f64>> =
        fixture().into_iter().find(|c| c.name.starts_with("autocorrelated, 4")).unwrap().draws();
    let y: Vec<Vec<f64>> = x.iter().map(|c| c.iter().map(|v| (3.0 * v).exp()).collect()).collect();
    assert_eq!(ess_bulk(&x), ess_bulk(&y));
    assert_ne!(ess_mean(&x), ess_mean(&y));
}

#[test]
fn the_order_of_chains_does_not_matter() {
    for c in fixture() {
        let mut x = c.draws();
        let s = summary(&x);
        x.reverse();
        let r = summary(&x);
        for (a, b) in [(s.ess_bulk, r.ess_bulk), (s.ess_tail, r.ess_tail), (s.mcse_sd, r.mcse_sd)] {
            assert!(
                (a - b).abs() <= 1e-9 * a.abs() || a.is_nan() && b.is_nan(),
                "{}: {a} {b}",
                c.name
            );
        }
    }
}
