//! The modes of chains that disagree, reported separately in addition to the means over
//! all chains.

use super::{Frequent, Quantity, number, table};
use indexmap::IndexMap;
use pcadlang_inference::diagnostics;
use pcadlang_inference::{Evidence, Weighed};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt::Write;

/// Chains whose worst R-hat exceeds this are grouped into modes.
pub const DISAGREE: f64 = 1.1;
/// The number of quantities by which chains are compared: those with the largest R-hat.
const COMPARED: usize = 20;
/// The numbers of columns and rows of the table.
const SHOWN: (usize, usize) = (5, 8);

/// Chains that agree with each other but not with the others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mode {
    /// The numbers of the chains, counted from 1.
    pub chains: Vec<usize>,
    /// The fraction of all chains in this mode. It depends on where chains start and is
    /// not a probability.
    pub share: f64,
    /// Its probability among the modes ([`Weighed::probabilities`]), if it can be
    /// estimated.
    pub probability: Option<f64>,
    /// True if the probability is based on estimates of the evidence, rather than on the
    /// assumption that all modes are equally wide.
    pub by_evidence: bool,
    /// The logarithm of its evidence and its standard error, if there is an estimate
    /// ([`diagnostics::log_evidence()`]).
    pub log_evidence: Option<[f64; 2]>,
    /// The mean log joint density of its draws.
    #[serde(deserialize_with = "number_or_null")]
    pub log_joint: f64,
    /// The mean and standard deviation of each quantity over its draws.
    #[serde(deserialize_with = "numbers_or_null")]
    pub quantities: IndexMap<String, [f64; 2]>,
}

/// Reads null as NaN, because JSON cannot represent numbers that are not finite.
fn number_or_null<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

fn numbers_or_null<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<IndexMap<String, [f64; 2]>, D::Error> {
    let read: IndexMap<String, [Option<f64>; 2]> = IndexMap::deserialize(from)?;
    Ok(read.into_iter().map(|(name, m)| (name, m.map(|x| x.unwrap_or(f64::NAN)))).collect())
}

/// Returns the modes of a run, the most probable first, or the one with most chains if
/// probabilities are not known; empty if the chains agree or cannot be separated.
/// `evidence` holds the estimates made during the run.
pub fn modes(quantities: &[Quantity], evidence: Option<&Evidence>) -> Vec<Mode> {
    let worst = apart(quantities);
    let compared: Vec<&[Vec<f64>]> = worst.iter().take(COMPARED).map(|q| &q.chains[..]).collect();
    let groups = diagnostics::modes(&compared);
    if groups.len() < 2 {
        return Vec::new();
    }
    let count: usize = groups.iter().map(Vec::len).sum();
    let mut all: Vec<Mode> =
        groups.iter().map(|members| mode(quantities, members, count)).collect();
    let weighed: Vec<Option<Weighed>> =
        groups.iter().map(|members| evidence.and_then(|e| e.of(members))).collect();
    let known = |w: &Option<Weighed>| w.and_then(|w| w.evidence).map(|e| [e.value, e.error]);
    all.iter_mut().zip(&weighed).for_each(|(m, w)| m.log_evidence = known(w));
    if let Some(each) = weighed.into_iter().collect::<Option<Vec<Weighed>>>() {
        let (probabilities, by_evidence) = Weighed::probabilities(&each);
        all.iter_mut()
            .zip(probabilities)
            .for_each(|(m, p)| (m.probability, m.by_evidence) = (Some(p), by_evidence));
        all.sort_by(|a, b| b.probability.unwrap_or(0.0).total_cmp(&a.probability.unwrap_or(0.0)));
    }
    all
}

/// Returns the quantities on which chains may disagree, the worst first. Those that never
/// moved in any chain have no R-hat, but may differ between chains. One that is missing from some
/// draws, or infinite in some, has none either, and is ignored.
fn apart(quantities: &[Quantity]) -> Vec<&Quantity> {
    let rank = |q: &Quantity| match q.summary.r_hat {
        r if !r.is_nan() => r,
        _ if q.is_stuck() => f64::INFINITY,
        _ => f64::NEG_INFINITY,
    };
    let disagree = |q: &&Quantity| rank(q) > DISAGREE && !q.is_constant();
    let mut worst: Vec<&Quantity> = quantities.iter().filter(disagree).collect();
    worst.sort_by(|a, b| rank(b).total_cmp(&rank(a)));
    worst
}

fn mode(quantities: &[Quantity], members: &[usize], count: usize) -> Mode {
    let moments = |q: &Quantity| {
        let own: Vec<&Vec<f64>> = members.iter().filter_map(|c| q.chains.get(*c)).collect();
        let s = diagnostics::summary(&own);
        [s.mean, s.sd]
    };
    let all: IndexMap<String, [f64; 2]> =
        quantities.iter().map(|q| (q.name.clone(), moments(q))).collect();
    Mode {
        chains: members.iter().map(|c| c + 1).collect(),
        share: members.len() as f64 / count as f64,
        probability: None,
        by_evidence: false,
        log_evidence: None,
        log_joint: all.first().map_or(f64::NAN, |(_, m)| m[0]),
        quantities: all,
    }
}

/// Formats the means of the quantities that differ most, with a column for each mode;
/// empty without modes.
pub fn modes_table(modes: &[Mode], quantities: &[Quantity]) -> String {
    let rows = modes_rows(modes, quantities);
    if rows.is_empty() {
        return String::new();
    }
    let mut s =
        format!("the chains are in {} different modes:\n{}", modes.len(), table::aligned(&rows));
    if let Some(more) = modes.len().checked_sub(SHOWN.0 + 1) {
        let _ = writeln!(s, "… and {} more modes, in summary.json", more + 1);
    }
    s
}

/// Returns the cells of [`modes_table`].
pub(super) fn modes_rows(modes: &[Mode], quantities: &[Quantity]) -> Vec<Vec<String>> {
    if modes.is_empty() {
        return Vec::new();
    }
    let shown = &modes[..modes.len().min(SHOWN.0)];
    let row = |name: &str, all: String, each: &dyn Fn(&Mode) -> String| {
        [name.to_owned(), all].into_iter().chain(shown.iter().map(each)).collect::<Vec<String>>()
    };
    let mut head = vec!["mean of".to_owned(), "all chains".to_owned()];
    head.extend((1..=shown.len()).map(|i| format!("mode {i}")));
    let count: usize = modes.iter().map(|m| m.chains.len()).sum();
    let mut rows = vec![head, row("chains", count.to_string(), &|m| m.chains.len().to_string())];
    if shown.iter().all(|m| m.probability.is_some()) {
        rows.push(row("probability", String::new(), &|m| {
            number(m.probability.unwrap_or(f64::NAN))
        }));
    }
    let mean = |q: &Quantity, m: &Mode| m.quantities.get(&q.name).map_or(f64::NAN, |x| x[0]);
    let differs =
        |q: &Quantity| modes.iter().any(|m| mean(q, m).to_bits() != mean(q, &modes[0]).to_bits());
    let mut differ = apart(quantities);
    differ.retain(|q| differs(q));
    differ.truncate(SHOWN.1);
    let first = quantities.first().filter(|f| !differ.iter().any(|q| q.name == f.name));
    for q in first.into_iter().chain(differ) {
        rows.push(match &q.frequent {
            Some(all) => row(&q.name, all.to_string(), &|m| {
                let own = m.chains.iter().filter_map(|c| q.chains.get(c.checked_sub(1)?));
                Frequent::of(own.flatten(), &q.levels).map_or("-".into(), |f| f.to_string())
            }),
            None => row(&q.name, q.number(q.summary.mean), &|m| q.number(mean(q, m))),
        });
    }
    table::narrowed(rows)
}

/// Returns a sentence for the user, if there are several modes.
pub(super) fn warning(modes: &[Mode]) -> Option<String> {
    let chains: usize = modes.iter().map(|m| m.chains.len()).sum();
    let (n, each) = (modes.len(), modes.iter().all(|m| m.chains.len() == 1));
    if n < 2 {
        return None;
    }
    let what = match each {
        true => format!("the {chains} chains are each in a different mode"),
        false => format!("the {chains} chains are in {n} different modes"),
    };
    let probable = match (modes[0].probability.map(number), modes[0].by_evidence) {
        (Some(p), true) => {
            format!("the first has estimated probability {p}, from the evidence of the modes")
        }
        (Some(p), false) => {
            format!(
                "the first has probability {p} judged by log density alone, that is, if all modes are equally wide"
            )
        }
        (None, _) => "the fraction of chains in a mode does not estimate its probability".into(),
    };
    Some(format!(
        "{what} and do not mix, so means over all chains are not meaningful: look at each mode; a \
         longer warm-up, `temper` or `knn` may let chains move between modes ({probable})"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: u64, centre: f64) -> Vec<f64> {
        (0..400u64)
            .map(|i| {
                centre + ((i + 1) * (i + seed) * 2_654_435_761 % 1_000_003) as f64 / 1_000_003.0
            })
            .collect()
    }

    fn quantity(name: &str, centres: [f64; 4]) -> Quantity {
        let chains: Vec<Vec<f64>> =
            centres.iter().zip(0..).map(|(c, s)| noise(13 + 977 * s, *c)).collect();
        Quantity::new(name, None, chains)
    }

    /// What is missing from some draws, or infinite in some, has no R-hat: no sign of modes.
    #[test]
    fn missing_draws_make_no_modes() {
        for odd in [f64::NAN, f64::INFINITY] {
            let mut chains: Vec<Vec<f64>> = (0..4).map(|s| noise(13 + 977 * s, 0.0)).collect();
            chains.iter_mut().enumerate().for_each(|(i, c)| c[7 * i] = odd);
            let all = [quantity("log_joint", [0.0; 4]), Quantity::new("q", None, chains)];
            assert!(all[1].summary.r_hat.is_nan());
            assert_eq!(modes(&all, None), []);
        }
    }

    #[test]
    fn modes_have_their_own_means_and_a_table() {
        let all = [
            quantity("log_joint", [-1.0, -9.0, -1.0, -1.0]),
            quantity("x", [0.0, 30.0, 0.0, 0.0]),
            quantity("y", [7.0; 4]),
        ];
        let found = modes(&all, None);
        assert_eq!(
            found.iter().map(|m| m.chains.clone()).collect::<Vec<_>>(),
            [vec![1, 3, 4], vec![2]]
        );
        assert_eq!((found[0].share, found[1].share), (0.75, 0.25));
        assert!(
            (found[1].quantities["x"][0] - 30.5).abs() < 0.1
                && (found[1].log_joint + 8.5).abs() < 0.1
        );
        let text = modes_table(&found, &all);
        let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split_whitespace().collect()).collect();
        assert_eq!(lines[0].join(" "), "the chains are in 2 different modes:");
        assert_eq!(lines[2], ["chains", "4", "3", "1"]);
        assert!(lines.iter().any(|l| l[0] == "x") && !lines.iter().any(|l| l[0] == "y"), "{text}");
        assert!(text.lines().all(|l| l.chars().count() <= table::COLUMNS));
        assert!(
            warning(&found).is_some_and(|w| w.starts_with("the 4 chains are in 2 different modes"))
        );
        assert!(serde_json::to_string(&found).is_ok_and(|j| j.contains("\"chains\":[1,3,4]")));
    }

    #[test]
    fn chains_that_agree_have_none() {
        let all = [quantity("log_joint", [0.0; 4]), quantity("x", [3.0; 4])];
        assert!(
            modes(&all, None).is_empty()
                && modes_table(&[], &all).is_empty()
                && warning(&[]).is_none()
        );
    }
}
