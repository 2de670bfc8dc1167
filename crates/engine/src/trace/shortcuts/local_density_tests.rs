//! Local densities against updates: the same weights to the last bit, or no answer.

use crate::trace::{Change, Draws, Selector};

/// Counts the weights that local densities gave, over the states of a random walk through
/// the prior; all are compared with updates.
fn compared(text: &str) -> usize {
    let mut trace = crate::testing::trace(text, 1);
    let every = Selector::Tag { name: "d".into(), value: None };
    let mut weights = 0;
    for step in 0..60 {
        let all = trace.all_targets();
        let one = all[step as usize % all.len()];
        trace.regenerate(&[one], Draws { step, ..Draws::default() }).unwrap();
        trace.commit();
        let selection = trace.select(&every);
        for t in trace.targets(selection).to_vec() {
            let dist = trace.dist(t).unwrap();
            let mut values = Vec::new();
            assert!(dist.support().list_values(&mut values));
            let current = trace.stored(t);
            for value in values.into_iter().filter(|v| Some(v) != current.as_ref()) {
                let by_formula = {
                    let local_densities = trace.graph.local_densities(&trace.code, t.node);
                    let mut evaluation = trace.graph.evaluation(&trace.code);
                    let mut weight = |power| {
                        local_densities
                            .as_ref()
                            .and_then(|f| evaluation.weigh(t.node, f, &dist, &value, power))
                    };
                    weight(1.0).zip(weight(0.3))
                };
                let by_update =
                    trace.propose(&[(t, Change::Set(value.clone()))], Draws::default()).unwrap();
                if let Some((whole, tempered)) = by_formula {
                    weights += 1;
                    let found = [whole, tempered].map(f64::to_bits);
                    let expected = [1.0, 0.3].map(|power| by_update.tempered(power).to_bits());
                    assert_eq!(found, expected, "{} = {value:?}", trace.address(t));
                    assert_eq!(by_update.appeared + by_update.vanished, 0);
                }
                trace.rollback();
            }
        }
    }
    weights
}

#[test]
fn flags_of_a_regression() {
    let weights = compared(
        "let x = [-1, 0.5, 2]; assume a ~ normal(0, 1); assume s ~ gamma(2, 2);
         for i in 0 .. 3 {
           f[i] ~ flip(0.3) #d;
           observe normal(if f[i] { 0 } else { a * x[i] + 1 }, if f[i] { 10 } else { s }) = x[i] ** 2;
         }",
    );
    assert!(weights > 150, "{weights}");
}

#[test]
fn states_of_a_chain() {
    let weights = compared(
        "let trans = [[0.8, 0.1, 0.1], [0.2, 0.7, 0.1], [0.3, 0.3, 0.4]]; let mu = [-1, 0, 2];
         for t in 0 .. 6 {
           z[t] ~ categorical(if t == 0 { [1, 2, 1] } else { trans[z[t - 1]] }) #d;
           observe normal(mu[z[t]], 1) = t - 2;
         }",
    );
    assert_eq!(weights, 60 * 6 * 2);
}

#[test]
fn conditions_and_arithmetic() {
    let weights = compared(
        "let w = [0.2, 0.5, 0.3]; assume k ~ categorical(w) #d; assume b ~ flip(0.4) #d;
         let u = if k * 2 > 1 { sqrt(k + 3) } else { -k }; let v = if not b { 1 } else { 2 };
         factor(log(1 + k ** 2)); observe normal(u, v) = 0.7; assume n ~ binomial(4, 0.3 + k / 10) #d; observe poisson(n + 1) = 3;",
    );
    assert!(weights > 300, "{weights}");
}

#[test]
fn families_that_take_arrays_and_bounds() {
    let weights = compared(
        "assume k ~ categorical([1, 2, 1]) #d; assume m ~ normal(0, 1);
         observe truncated_normal(k + m, 1, -5, 5) = 0.7; observe von_mises(k, 2) = 1;",
    );
    assert!(weights > 100, "{weights}");
}

#[test]
fn arrays_and_records() {
    for text in [
        "factor(-sum([k, 1])); observe normal(sum([k, 0.5]), 1) = 1;",
        "let parts = [{ mean: [0, 1], sd: 1 }, { mean: [2, -1], sd: 3 }, { mean: [1, 1], sd: 0.5 }];
         let part = parts[k]; observe normal(part.mean[1], part.sd) = 0.3;",
        "let both = [k, 2] * 3; factor(-0.1 * both[0] - max(both)); factor(sqrt(both)[1]);",
        "let r = { at: [k, 1], of: 2 }; factor(r.at[1] - r[\"at\"][0] / r.of);",
    ] {
        let text = format!("assume k ~ categorical([1, 2, 3]) #d; {text}");
        assert_eq!(compared(&text), 120, "{text}");
    }
}

#[test]
fn distributions_as_values() {
    let weights = compared(
        "assume f ~ flip(0.4) #d; assume m ~ normal(0, 1); let d = if f { normal(m, 2) } else { student_t(3, 0, 1) };
         observe d = 0.7; observe d = [0.1, 0.2]; assume k ~ uniform_discrete(0, 3) #d;
         observe mv_normal([k, m], cov = [[2, 0.5], [0.5, 1 + k]]) = [0.5, 1];",
    );
    assert!(weights > 150, "{weights}");
}

#[test]
fn choices_that_would_vanish_are_left_to_updates() {
    let once = "assume a ~ normal(0, 1); assume f ~ flip(0.5) #d; observe normal(if f { a } else { 0 }, 1) = 1;";
    assert_eq!(compared(once), 0);
    let twice = "assume a ~ normal(0, 1); assume f ~ flip(0.5) #d;
        observe normal(if f { a } else { 0 }, 1) = 1; observe normal(if f { 2 * a } else { 1 }, 1) = 2;";
    assert_eq!(compared(twice), 0);
    let element = "for i in 0 .. 3 { b[i] ~ normal(i, 1); } assume f ~ flip(0.5) #d;
        observe normal(if f { b[1] } else { 0 }, 1) = 1;";
    assert_eq!(compared(element), 0);
    let held = format!("{twice} observe normal(a, 1) = 0;");
    assert_eq!(compared(&held), 60);
}

#[test]
fn impossible_states_are_left_to_updates() {
    // With one of two impossible terms gone, the state is still impossible.
    let weights = compared(
        "assume k ~ flip(0.5) #d; assume j ~ flip(0.5) #d;
         observe uniform(if k { 1 } else { 0 }, 2) = 0.5; observe uniform(if j { 1 } else { 0 }, 2) = 0.5;",
    );
    assert!(weights > 0);
}

#[test]
fn choices_read_twice_from_one_frame_are_left_to_updates() {
    let text = "for t in 0 .. 4 {
           z[t] ~ flip(0.4) #d;
           observe normal(if t > 0 { if z[t - 1] == z[0] { 1 } else { 2 } } else { 0 }, 1) = t;
         }";
    compared(text);
}

#[test]
fn scores_of_numbers_are_those_of_their_distributions() {
    let families = "normal(0.3, 1.2) normal(1, 1) gamma(2, 0.5) beta(2, 3) poisson(3) binomial(4, 0.2) \
        student_t(3, 0, 1) cauchy(0, 2) uniform(0, 0.5) flip(0.2) lognormal(0, 1) geometric(0.3)";
    for family in families.split(") ").map(|f| format!("{})", f.trim_end_matches(')'))) {
        for x in ["0", "1", "0.25", "3", "-2", "1e300"] {
            let score = |text: String| crate::testing::trace(&text, 1).log_likelihood().to_bits();
            let found = score(format!("observe {family} = {x};"));
            let expected = score(format!("let d = {family}; observe d = {x};"));
            assert_eq!(found, expected, "{family} {x}");
        }
    }
}
