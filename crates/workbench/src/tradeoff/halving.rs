//! Successive halving (Jamieson and Talwalkar 2016): all settings run on a few cases, the
//! better half of them on more, until the remaining ones have run on all cases.

use super::runs::RunRecord;
use indexmap::IndexMap;

/// One round: some settings on some cases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Round {
    /// The number of settings.
    pub settings: usize,
    /// The number of cases, including those of earlier rounds.
    pub cases: usize,
}

/// Plans the rounds for a budget: a single round of all settings on all cases if it fits,
/// otherwise as few rounds as possible, or as many as possible if nothing fits. `each` is
/// the mean time of one setting on one case. Times are in seconds of the whole machine.
pub fn rounds(settings: usize, cases: usize, each: f64, budget: f64) -> Vec<Round> {
    let most = cases.max(1).ilog2() as usize + 1;
    let of = |n: usize| -> Vec<Round> {
        (0..n)
            .map(|i| Round {
                settings: settings.div_ceil(1 << i),
                // At least three cases if there are as many: one or two are not
                // informative enough.
                cases: if i + 1 == n {
                    cases
                } else {
                    cases.div_ceil(1 << (n - 1 - i)).max(cases.min(3))
                },
            })
            .collect()
    };
    (1..=most).map(of).find(|r| runs_of(r) as f64 * each <= budget).unwrap_or_else(|| of(most))
}

/// Returns the number of runs; those of earlier rounds are not repeated.
fn runs_of(rounds: &[Round]) -> usize {
    let before = |i: usize| if i == 0 { 0 } else { rounds[i - 1].cases };
    rounds.iter().enumerate().map(|(i, r)| r.settings * (r.cases.saturating_sub(before(i)))).sum()
}

/// Returns the settings for the next round: those that are best at some time. A setting
/// is as good as its best rank over all times at which it was measured together with
/// others; ties are broken by the mean rank. Settings with a failed run come last. `runs`
/// must be on the same cases for all settings.
pub fn survivors(settings: &[String], runs: &[RunRecord], keep: usize) -> Vec<String> {
    // Errors by time and setting.
    let mut errors: IndexMap<i64, IndexMap<&str, Vec<f64>>> = IndexMap::new();
    let failed = |setting: &str| runs.iter().any(|r| r.setting == setting && r.failed.is_some());
    for run in runs.iter().filter(|r| settings.contains(&r.setting) && !failed(&r.setting)) {
        for mark in &run.marks {
            // The end of a run counts at the nearest time at which others are measured.
            let at = mark.at.unwrap_or(mark.seconds);
            let time = (at.max(1e-3).log10() * 4.0).round() as i64;
            let errors = errors.entry(time).or_default().entry(&run.setting).or_default();
            errors.extend(mark.error);
        }
    }
    let mut ranks: IndexMap<&str, Vec<usize>> =
        settings.iter().map(|s| (s.as_str(), Vec::new())).collect();
    for at in errors.values().filter(|at| at.len() > 1) {
        let mean = |xs: &Vec<f64>| {
            if xs.is_empty() { f64::INFINITY } else { xs.iter().sum::<f64>() / xs.len() as f64 }
        };
        let mut order: Vec<(&str, f64)> = at.iter().map(|(s, xs)| (*s, mean(xs))).collect();
        order.sort_by(|a, b| a.1.total_cmp(&b.1));
        for (rank, (setting, error)) in order.iter().enumerate() {
            // Ties all get the last rank among them: before there are any answers, no
            // setting is first.
            let last = order.iter().rposition(|o| o.1 == *error).unwrap_or(rank);
            if let Some(all) = ranks.get_mut(setting) {
                all.push(last);
            }
        }
    }
    let value = |all: &Vec<usize>| {
        let mean = all.iter().sum::<usize>() as f64 / all.len().max(1) as f64;
        (all.iter().copied().min().unwrap_or(usize::MAX), mean)
    };
    let mut order: Vec<(&str, (usize, f64))> =
        ranks.iter().map(|(s, all)| (*s, value(all))).collect();
    order.sort_by(|a, b| a.1.0.cmp(&b.1.0).then(a.1.1.total_cmp(&b.1.1)));
    let kept: Vec<&str> = order.into_iter().take(keep).map(|o| o.0).collect();
    settings.iter().filter(|s| kept.contains(&s.as_str())).cloned().collect()
}

#[cfg(test)]
mod tests {
    use super::super::runs::Mark;
    use super::*;

    #[test]
    fn rounds_fit_the_budget() {
        assert_eq!(rounds(40, 10, 1.0, 400.0), [Round { settings: 40, cases: 10 }]);
        let r = rounds(40, 10, 1.0, 320.0);
        assert_eq!(r, [Round { settings: 40, cases: 5 }, Round { settings: 20, cases: 10 }]);
        assert_eq!(runs_of(&r), 300);
        let three = [
            Round { settings: 40, cases: 3 },
            Round { settings: 20, cases: 5 },
            Round { settings: 10, cases: 10 },
        ];
        assert_eq!(rounds(40, 10, 1.0, 250.0), three);
        assert_eq!(
            rounds(3, 1, 1.0, 0.1),
            [Round { settings: 3, cases: 1 }],
            "what does not fit is left to the clock"
        );
    }

    #[test]
    fn whoever_is_first_at_some_time_goes_on() {
        let run = |setting: &str, errors: &[(f64, f64)]| RunRecord {
            setting: setting.into(),
            marks: errors
                .iter()
                .map(|(t, e)| Mark { at: Some(*t), seconds: *t, error: Some(*e) })
                .collect(),
            ..RunRecord::default()
        };
        let runs = [
            run("early", &[(0.1, 0.5), (1.0, 0.5)]),
            run("late", &[(0.1, 0.9), (1.0, 0.1)]),
            run("never", &[(0.1, 0.6), (1.0, 0.4)]),
            run("worst", &[(0.1, 1.0), (1.0, 1.0)]),
        ];
        let all: Vec<String> = ["worst", "never", "early", "late"].map(String::from).to_vec();
        assert_eq!(survivors(&all, &runs, 2), ["early", "late"]);
        assert_eq!(survivors(&all, &runs, 3), ["never", "early", "late"]);
        assert_eq!(survivors(&all, &[], 4), all);

        // Before there are answers all settings are tied, and a setting that is measured
        // alone is not first; a failed run counts against its setting.
        let runs = [
            run("early", &[(0.1, 1.0), (1.0, 0.5)]),
            run("late", &[(0.1, 1.0), (1.0, 0.1)]),
            run("never", &[(0.1, 1.0), (1.0, 0.6)]),
            run("worst", &[(0.1, 1.0), (1.0, 0.9), (10.0, 0.8)]),
        ];
        assert_eq!(survivors(&all, &runs, 1), ["late"]);
        assert_eq!(survivors(&all, &runs, 3), ["never", "early", "late"]);
        let failed =
            RunRecord { setting: "late".into(), failed: Some("no".into()), ..RunRecord::default() };
        assert_eq!(survivors(&all, &[&runs[..], &[failed]].concat(), 1), ["early"]);
    }
}
