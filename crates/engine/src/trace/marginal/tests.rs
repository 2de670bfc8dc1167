//! Densities with choices summed out by a tape against sums over all of their values, each
//! proposed in the trace.

use crate::trace::{Change, ChoiceKind, Draws, Selector, Target, Trace};
use pcadlang_numerics::num::log_sum_exp;
use pcadlang_numerics::rng::{Purpose, StreamKey};

/// The log density relative to the present state, and its gradient, by the enumeration of
/// all values of the choices.
fn enumerated(
    trace: &mut Trace,
    sites: &[Target],
    moving: &[Target],
    (y, power): (&[f64], f64),
) -> (f64, Vec<f64>) {
    let values: Vec<Vec<_>> = sites
        .iter()
        .map(|t| trace.dist(*t).unwrap().stored_support().finite_values().unwrap())
        .collect();
    let count: usize = values.iter().map(Vec::len).product();
    let (mut logs, mut gradients) = (Vec::new(), Vec::new());
    for k in 0..count {
        let mut rest = k;
        let mut changes = Vec::new();
        for (t, all) in sites.iter().zip(&values) {
            changes.push((*t, Change::Set(all[rest % all.len()].clone())));
            rest /= all.len();
        }
        changes.extend(moving.iter().zip(y).map(|(t, y)| (*t, Change::Free(vec![*y]))));
        let Ok(w) = trace.propose(&changes, Draws::default()) else { continue };
        let log = w.tempered(power) + w.log_jacobian;
        if log.is_finite() {
            logs.push(log);
            let mut g = Vec::new();
            trace.gradient(moving, power, &mut g).unwrap();
            gradients.push(g);
        }
        trace.rollback();
    }
    let total = log_sum_exp(&logs);
    let mut gradient = vec![0.0; y.len()];
    for (l, g) in logs.iter().zip(&gradients) {
        gradient.iter_mut().zip(g).for_each(|(a, b)| *a += (l - total).exp() * b);
    }
    (total, gradient)
}

fn selected(trace: &mut Trace, kind: ChoiceKind) -> Vec<Target> {
    let s = trace.select(&Selector::Kind(kind));
    trace.targets(s).to_vec()
}

/// A state of a program that keeps all its choices, those to sum out, and those that move.
fn begun(text: &str, seed: u64) -> (Trace, Vec<Target>, Vec<Target>) {
    let mut trace = crate::testing::trace(text, seed);
    let _held = trace.hold_choices().unwrap();
    let sites = selected(&mut trace, ChoiceKind::Finite);
    let moving = selected(&mut trace, ChoiceKind::Continuous);
    (trace, sites, moving)
}

/// Compares at some points; false if nothing was recorded.
fn agrees(text: &str) -> bool {
    let (mut trace, sites, moving) = begun(text, 4);
    let before = trace.log_joint();
    let Some(mut tape) = trace.record_summed(&moving, &sites, Draws::default()).unwrap() else {
        return false;
    };
    assert_eq!(trace.log_joint().to_bits(), before.to_bits(), "the state has changed: {text}");
    let mut rng = StreamKey::new(5, 0, Purpose::KERNEL).stream(0, 0, 0);
    for power in [1.0, 0.4] {
        tape.set_power(power);
        let mut here = Vec::new();
        assert!(tape.begin(&trace, &mut here));
        let jacobian = tape.log_jacobian();
        let (origin, _) = enumerated(&mut trace, &sites, &moving, (&here, power));
        for round in 0..12 {
            let wide = [0.0, 0.1, 0.7][round % 3];
            let y: Vec<f64> = here.iter().map(|y| y + wide * rng.standard_normal()).collect();
            let (expected, slope) = enumerated(&mut trace, &sites, &moving, (&y, power));
            let w = tape.weigh(&y).expect("a density");
            let found = w.tempered(power) + w.log_jacobian - jacobian;
            let size = 1.0 + expected.abs().max(origin.abs());
            assert!(
                (found - (expected - origin)).abs() < 1e-10 * size,
                "{text}\n{found}, by enumeration {}",
                expected - origin
            );
            let mut g = Vec::new();
            assert!(tape.gradient(&y, power, &mut g), "{text}");
            let largest = slope.iter().fold(1.0, |m: f64, g| m.max(g.abs()));
            for (a, b) in g.iter().zip(&slope) {
                assert!((a - b).abs() < 1e-10 * largest, "{text}\n{g:?}, by enumeration {slope:?}");
            }
        }
    }
    true
}

const FLAGS: &str = "assume slope ~ normal(0, 2); assume base ~ normal(0, 2); assume noise ~ gamma(2, 2);
    let x = [0.1, -1, 2, 1.5]; let y = [0.3, -0.7, 8, 1.2];
    for i in 0 .. len(x) { z[i] ~ flip(0.1);
      observe normal(if z[i] { 0 } else { slope * x[i] + base }, if z[i] { 10 } else { noise }) = y[i]; }";

const CHAIN: &str = "assume m ~ iid(normal(0, 2), 3); assume s ~ gamma(2, 2); assume stay ~ beta(2, 1);
    let y = [0.3, -0.7, 1.9, 1.2];
    for t in 0 .. len(y) {
      z[t] ~ categorical(if t == 0 { [1, 2, 1] } else { [[stay, 1, 1], [0.5, stay, 1], [1, 0.1, stay]][z[t - 1]] });
      observe normal(m[z[t]], s) = y[t]; }";

#[test]
fn sums_on_tapes_are_those_of_enumeration() {
    for text in [
        FLAGS,
        CHAIN,
        // The weights move, and some labels have several observations.
        "assume w ~ beta(2, 2); assume m ~ iid(normal(0, 3), 2); let y = [[1, 2, 3, 1, 2, 2], [0, 1, 1, 2, 0, 0]];
         for i in 0 .. 2 { z[i] ~ flip(w); for j in 0 .. 6 { observe normal(if z[i] { m[0] } else { m[1] * j }, 1) = y[i][j]; } }
         observe normal(m[0], 1) = 0.4;",
        // A moving choice under a summed one, a factor, and an observation of an array.
        "assume z ~ uniform_discrete(0, 2); assume x ~ normal(z, 1); assume s ~ exponential(1);
         factor(if z == 1 { x } else { -x * s }); observe normal(x * z, s) = [1, 2, 3, 4, 5, 6, 7];",
        // Observations that exist for some values only.
        "for i in 0 .. 3 { z[i] ~ flip(0.4); } assume x ~ normal(0, 1);
         for i in 0 .. 3 { if z[i] { observe normal(x, 0.5) = 1; }
           else { observe normal(x, 0.5) = -1; observe normal(0, exp(x)) = i; } }",
        // Two choices in one score, and a tree.
        "assume e ~ normal(0, 2); for i in 0 .. 2 { a[i] ~ categorical([1, 2, 1]); b[i] ~ categorical([1, 1, 3]);
           observe normal(if a[i] + b[i] == 2 { e } else { 0 }, 0.5) = [2.1, 0.1][i]; } observe normal(e, 3) = 1;",
        "assume e ~ normal(0, 1); z[0] ~ flip(0.5);
         for i in 1 .. 7 { z[i] ~ flip(if z[floor((i - 1) / 2)] { expit(e) } else { 0.3 }); }
         for i in 3 .. 7 { observe normal(if z[i] { e } else { 1 }, 1) = i; }",
        // A table of three choices.
        "assume effect ~ normal(0, 2); for i in 0 .. 3 { c[i] ~ flip(0.5); }
         let k = (if c[0] { 1 } else { 0 }) + (if c[1] { 2 } else { 0 }) + (if c[2] { 4 } else { 0 });
         observe normal([0, 0, 0, 0, 0, 1, 0, 0][k] * effect, 0.5) = 2;",
        // A mixture, a distribution that is a value, and a call without an array form.
        "assume m ~ normal(0, 1); z ~ flip(0.3); let d = normal(m, 2);
         observe mixture([1, 2], [normal(if z { m } else { 2 }, 1), normal(3, 1)]) = 0.7;
         observe d = if z { 1 } else { 3 }; observe student_t(3, max([m, if z { 0.1 } else { -0.1 }]), 1) = 1;",
    ] {
        assert!(agrees(text), "not recorded: {text}");
    }
}

/// At one value of the choice, the density is undefined where x is not positive: there,
/// only proposals show which values there are.
#[test]
fn values_that_the_program_does_not_have_everywhere() {
    let text = "assume z ~ flip(0.5); assume x ~ normal(1, 0.1); observe normal(0, if z { 1 } else { x }) = 0.5;";
    let (mut trace, sites, moving) = begun(text, 1);
    let mut tape = trace.record_summed(&moving, &sites, Draws::default()).unwrap().unwrap();
    let mut here = Vec::new();
    assert!(tape.begin(&trace, &mut here));
    let (origin, _) = enumerated(&mut trace, &sites, &moving, (&here, 1.0));
    assert!(tape.weigh(&[-0.5]).is_none());
    for y in [0.5, 0.2, 0.7] {
        let (expected, slope) = enumerated(&mut trace, &sites, &moving, (&[y], 1.0));
        let w = tape.weigh(&[y]).unwrap();
        assert!((w.log_weight - (expected - origin)).abs() < 1e-10, "{y}");
        let mut g = Vec::new();
        assert!(tape.gradient(&[y], 1.0, &mut g));
        assert!((g[0] - slope[0]).abs() < 1e-10, "{g:?}, expected {slope:?}");
    }
}

/// Ends moves in place and by proposals; returns how many ended in place.
fn ended_in_place(text: &str, power: f64) -> usize {
    let record = |seed| {
        let (mut trace, sites, moving) = begun(text, seed);
        let tape = trace.record_summed(&moving, &sites, Draws::default()).unwrap();
        let mut tape = tape.unwrap_or_else(|| panic!("not recorded: {text}"));
        tape.set_power(power);
        assert!(tape.begin(&trace, &mut Vec::new()));
        (trace, tape)
    };
    let ((mut trace, mut tape), (mut proposed, mut other)) = (record(4), record(4));
    let mut rng = StreamKey::new(6, 0, Purpose::KERNEL).stream(0, 0, 0);
    let (mut here, mut ended) = (Vec::new(), 0);
    assert!(other.begin(&proposed, &mut here));
    for round in 0..30 {
        let wide = [0.0, 0.1, 0.7][round % 3];
        let y: Vec<f64> = here.iter().map(|y| y + wide * rng.standard_normal()).collect();
        let to = (round % 5 != 0).then_some(&y[..]);
        let mut draws = rng.clone();
        let now = &mut here;
        let there = tape.draw_and_move_to(&mut trace, to, now, &mut draws, Draws::default());
        let mut changes = Vec::new();
        if let Some(y) = to {
            other.changes(y, &mut changes);
        }
        assert!(other.draw(to.unwrap_or(&here), &mut rng, &mut changes), "{text}");
        changes.retain(
            |(t, c)| !matches!(c, Change::Set(x) if proposed.stored(*t).as_ref() == Some(x)),
        );
        if !there {
            trace.propose(&changes, Draws::default()).unwrap();
            trace.commit();
            tape.moved(&trace);
        }
        proposed.propose(&changes, Draws::default()).unwrap();
        proposed.commit();
        other.moved(&proposed);
        // What was run for one power does not serve another.
        let other_power = power * [1.0, 0.5][round % 2];
        tape.set_power(other_power);
        other.set_power(other_power);
        assert!(other.begin(&proposed, &mut here) && tape.begin(&trace, &mut Vec::new()));
        trace.same_nodes(&proposed).unwrap_or_else(|e| panic!("round {round} of {text}\n{e}"));
        assert_eq!(tape.log_jacobian(), other.log_jacobian());
        assert_eq!(tape.weigh(&y), other.weigh(&y), "{text}");
        ended += usize::from(there);
    }
    ended
}

#[test]
fn moves_that_end_in_place_are_those_of_proposals() {
    for text in [
        FLAGS,
        CHAIN,
        // Values that nothing scores, scores of arrays, and weights that move.
        "assume w ~ beta(2, 2); assume m ~ iid(normal(0, 3), 2); assume r ~ gamma(2, 1);
         let y = [[1, 2, 3, 1, 2, 2], [0, 1, 1, 2, 0, 0]];
         for i in 0 .. 2 { z[i] ~ flip(w); let mean = if z[i] { m[0] } else { m[1] * r };
           let twice = 2 * mean; observe normal(mean, r) = y[i]; observe normal(mean + 1, 2) = [y[i][0]]; }
         observe normal(m[0], r) = [0.4, 0.5]; factor(-r); let more = exp(m[1] - w);",
        "assume z ~ uniform_discrete(0, 2); assume x ~ normal(z, 1); assume s ~ exponential(1);
         factor(if z == 1 { x } else { -x * s }); observe normal(x * z, s) = [1, 2, 3, 4, 5, 6, 7];
         observe normal(x, s) = 1; observe normal(s, 1) = 1;",
        "assume m ~ normal(0, 1); z ~ flip(0.3); let d = normal(m, 2);
         observe mixture([1, 2], [normal(if z { m } else { 2 }, 1), normal(3, 1)]) = 0.7;
         observe d = if z { 1 } else { 3 }; observe student_t(3, max([m, if z { 0.1 } else { -0.1 }]), 1) = 1;",
    ] {
        for power in [1.0, 0.4] {
            let ended = ended_in_place(text, power);
            assert!(ended == 30, "{ended} in place: {text}");
        }
    }
    // Frames that come and go with a choice are not the same nodes.
    let text = "for i in 0 .. 3 { z[i] ~ flip(0.4); } assume x ~ normal(0, 1);
        for i in 0 .. 3 { if z[i] { observe normal(x, 0.5) = 1; } else { observe normal(x, 0.5) = -1; } }";
    assert_eq!(ended_in_place(text, 1.0), 0);
}

#[test]
fn what_a_tape_cannot_sum_out() {
    for text in [
        // The structure depends on what moves.
        "assume p ~ flip(0.3); assume x ~ normal(0, 1); observe normal(if x > 0.5 { if p { 2 } else { 0 } } else { 1 }, 1) = 1;",
        // Other choices come with it.
        "assume z ~ flip(0.4); assume x ~ normal(0, 1); let m = if z { a ~ normal(0, 1); a } else { 0 }; observe normal(m + x, 1) = 1;",
        // A score reads too many of them.
        "assume x ~ normal(0, 1); for i in 0 .. 14 { z[i] ~ flip(0.5); }
         observe normal(x + sum(map(fn(i) { if z[i] { 1 } else { 0 } }, 0 .. 14)), 1) = 4;",
    ] {
        assert!(!agrees(text), "{text}");
    }
}

/// The frequencies of draws are the conditional probabilities.
#[test]
fn choices_are_drawn_from_their_conditional() {
    for text in [FLAGS, CHAIN] {
        let (mut trace, sites, moving) = begun(text, 4);
        let mut tape = trace.record_summed(&moving, &sites, Draws::default()).unwrap().unwrap();
        let mut here = Vec::new();
        assert!(tape.begin(&trace, &mut here));
        let (total, _) = enumerated(&mut trace, &sites, &moving, (&here, 1.0));
        let mut counts = std::collections::BTreeMap::new();
        let mut rng = StreamKey::new(8, 0, Purpose::KERNEL).stream(0, 0, 0);
        for _ in 0..20_000 {
            let mut drawn = Vec::new();
            assert!(tape.draw(&here, &mut rng, &mut drawn));
            counts.entry(format!("{drawn:?}")).or_insert((0.0, drawn)).0 += 1.0;
        }
        for (n, drawn) in counts.values().filter(|c| c.0 > 200.0) {
            let w = trace.propose(drawn, Draws::default()).unwrap();
            trace.rollback();
            let p = (w.log_weight + tape.log_jacobian() - total).exp();
            let error = (p * (1.0 - p) / 20_000.0).sqrt();
            assert!((n / 20_000.0 - p).abs() < 5.0 * error, "{text}: {} of {p}", n / 20_000.0);
        }
    }
}
