//! Warnings about the reliability of a run's results, and possible remedies.
//!
//! The thresholds are those of Vehtari, Gelman, Simpson, Carpenter & Bürkner (2021):
//! R-hat of at most 1.01 and 100 effective draws per chain.

use super::Quantity;
use super::modes::{self, DISAGREE, Mode};
use pcadlang_inference::draws::KernelStats;

/// The minimum number of proposals for a kernel to be judged.
const JUDGED: u64 = 200;
/// The minimum number of draws for a chain to count as stuck.
const STUCK: usize = 50;

/// Returns sentences for the user, the most serious first; the list is empty if there is
/// nothing to warn about. `chains` is the number of chains that were run.
pub fn warnings(
    quantities: &[Quantity],
    modes: &[Mode],
    kernels: &[KernelStats],
    chains: usize,
) -> Vec<String> {
    let mut out = Vec::new();
    if let Some(q) = quantities.iter().find(|q| q.is_stuck() && q.drawn().all(|c| c.len() >= STUCK))
    {
        out.push(format!(
            "the chains disagree: {} never moved in any chain, and the chains have different \
             values; use a kernel that updates it, or smaller steps",
            q.name
        ));
    }
    if let Some((r, name)) = worst(quantities, |q| q.summary.r_hat).filter(|(r, _)| *r > 1.01) {
        let what =
            if r > DISAGREE { "the chains disagree" } else { "the chains may not have mixed" };
        let r = if r > 100.0 { "above 100".to_owned() } else { above(r, 1.01) };
        out.push(format!(
            "{what}: R-hat of {name} is {r} (it should be at most 1.01); run longer with --time or --steps"
        ));
    }
    out.extend(modes::warning(modes));
    let wanted = 100 * chains;
    if let Some((e, name)) =
        worst(quantities, |q| -q.summary.ess_bulk).filter(|(e, _)| -e < wanted as f64)
    {
        let e = -e;
        out.push(format!(
            "low effective sample size: {e:.0} for {name} (at least {wanted} recommended); run \
             longer with --time or --steps"
        ));
    }
    if quantities
        .first()
        .is_some_and(|q| q.chains.iter().map(Vec::len).sum::<usize>() > 0 && too_short(q))
    {
        out.push(
            "too few draws to assess convergence: at least 4 per chain are needed; run longer"
                .into(),
        );
    }
    for k in kernels.iter().filter(|k| k.proposals >= JUDGED) {
        if 2 * k.failed > k.proposals {
            out.push(format!(
                "{}: {} of {} proposals had no log density (for example, a scale that is not \
                 positive); use a narrower prior, or smaller steps",
                k.name, k.failed, k.proposals
            ));
        } else if k.divergent > 0 {
            out.push(format!(
                "{}: {} of {} trajectories diverged, so parts of the posterior may be unexplored; \
                 the usual remedy is a non-centred parameterisation (normal(0, 1) times a scale); \
                 a longer warm-up, or adding `drift` to the mix, may also help",
                k.name, k.divergent, k.proposals
            ));
        } else if k.accepted == 0 && k.possible > 0 {
            out.push(format!(
                "{} accepted none of {} proposals, although other values are possible: it only \
                 costs time, or the chains cannot leave the modes in which they began; choices \
                 that depend on each other are drawn together by exact($finite) or block(…)",
                k.name, k.proposals
            ));
        } else if k.accepted == 0 {
            out.push(format!(
                "{} accepted none of {} proposals, so it only costs time",
                k.name, k.proposals
            ));
        }
    }
    out
}

/// Formats a number above a bound, to two decimals or as many more as still show that it is.
fn above(x: f64, bound: f64) -> String {
    let texts = (2..17).map(|decimals| format!("{x:.decimals$}"));
    let shows = |text: &String| text.parse().is_ok_and(|shown: f64| shown > bound);
    texts.into_iter().find(shows).unwrap_or_else(|| x.to_string())
}

/// Returns the largest value of `f` that is not NaN, and the name of its quantity.
fn worst(quantities: &[Quantity], f: impl Fn(&Quantity) -> f64) -> Option<(f64, &str)> {
    let known = quantities.iter().map(|q| (f(q), &*q.name)).filter(|(x, _)| !x.is_nan());
    known.max_by(|a, b| a.0.total_cmp(&b.0))
}

/// Returns whether some chain with draws is too short to be split and compared.
fn too_short(q: &Quantity) -> bool {
    q.drawn().any(|c| c.len() < 4)
}

#[cfg(test)]
mod tests {
    use super::super::modes;
    use super::*;

    fn quantity(name: &str, chains: Vec<Vec<f64>>) -> Quantity {
        Quantity::new(name, None, chains)
    }

    /// Returns numbers between 0 and 1 without any order.
    fn noise(seed: u64, n: u64) -> Vec<f64> {
        (0..n)
            .map(|i| (((i + 1) * (i + seed) * 2_654_435_761) % 1_000_003) as f64 / 1_000_003.0)
            .collect()
    }

    fn kernel(proposals: u64, accepted: u64, failed: u64) -> KernelStats {
        KernelStats {
            name: "mh(@x)".into(),
            proposals,
            accepted,
            seconds: 0.1,
            failed,
            ..Default::default()
        }
    }

    #[test]
    fn a_good_run_has_none() {
        let q = quantity("x", (0..4).map(|c| noise(c * 977 + 13, 2000)).collect());
        assert!(q.summary.r_hat < 1.01 && q.summary.ess_bulk > 400.0, "{:?}", q.summary);
        assert_eq!(warnings(&[q], &[], &[kernel(1000, 300, 10), kernel(0, 0, 0)], 4), [""; 0]);
    }

    #[test]
    fn disagreement_is_said_with_the_worst_quantity() {
        let apart = |by: f64| {
            (0..2).map(|c| noise(c + 13, 500).iter().map(|x| x + by * c as f64).collect()).collect()
        };
        let w = {
            let all = [quantity("near", apart(0.2)), quantity("far", apart(5.0))];
            warnings(&all, &modes(&all, None), &[], 2)
        };
        assert!(w[0].starts_with("the chains disagree: R-hat of far is"), "{w:?}");
        assert!(w[1].starts_with("the 2 chains are each in a different mode"), "{w:?}");
        assert!(
            w[2].starts_with("low effective sample size: ")
                && w[2].contains("for far (at least 200 recommended)"),
            "{w:?}"
        );
    }

    /// R-hat never reads "1.01 (it should be at most 1.01)".
    #[test]
    fn numbers_above_a_bound_show_that_they_are() {
        let texts = [1.0104, 1.010_000_2, 1.0151, 1.3, 2.0].map(|x| above(x, 1.01));
        assert_eq!(texts, ["1.0104", "1.0100002", "1.02", "1.30", "2.00"]);
    }

    #[test]
    fn stuck_chains_are_told_from_constants() {
        let constant = quantity("c", vec![vec![1.0; 100]; 2]);
        assert_eq!(warnings(&[constant], &[], &[], 0), [""; 0]);
        let stuck = quantity("s", vec![vec![1.0; 100], vec![2.0; 100]]);
        assert!(warnings(&[stuck], &[], &[], 0)[0].contains("s never moved"));
    }

    #[test]
    fn kernels_that_do_nothing_and_short_runs() {
        assert!(warnings(&[], &[], &[kernel(500, 0, 0)], 2)[0].contains("only costs time"));
        let stuck = KernelStats { possible: 3, ..kernel(500, 0, 0) };
        assert!(warnings(&[], &[], &[stuck], 2)[0].contains("other values are possible"));
        assert!(warnings(&[], &[], &[kernel(500, 0, 400)], 2)[0].contains("400 of 500"));
        assert_eq!(warnings(&[], &[], &[kernel(100, 0, 100)], 2), [""; 0], "too few to judge");
        assert!(
            warnings(&[quantity("x", vec![vec![1.0, 2.0]])], &[], &[], 1)[0]
                .starts_with("too few draws")
        );
        assert_eq!(
            warnings(&[quantity("x", vec![vec![]])], &[], &[], 1),
            [""; 0],
            "a run without draws has nothing to judge"
        );
    }
}
