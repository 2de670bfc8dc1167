//! Compares the tape of a trace's density with proposals in the trace and with reverse
//! passes through it.

use pcadlang_engine::trace::{Change, Draws, Recording, Target, Trace};
use pcadlang_numerics::rng::{Purpose, StreamKey};

/// The outcome of a comparison.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TapeReport {
    /// Whether a tape was recorded.
    pub recorded: bool,
    /// The number of points at which the tape gave a density that was compared.
    pub points: u32,
    /// The number of points at which the tape gave no density, so that a proposal is
    /// needed.
    pub asked: u32,
    /// The number of points to which the trace was moved in place.
    pub moved: u32,
}

/// Compares at the present state and at some points around it: densities to the last bit,
/// gradients up to rounding.
pub fn compare_tape(trace: &mut Trace, what: &str) -> TapeReport {
    let mut told = TapeReport::default();
    let mut places: Vec<(Target, Vec<f64>)> = Vec::new();
    for t in trace.all_targets().to_vec() {
        if let Some((y, _)) = trace.free(t).filter(|(y, _)| !y.is_empty()) {
            places.push((t, y));
        }
    }
    let targets: Vec<Target> = places.iter().map(|p| p.0).collect();
    let Some(mut tape) = trace.record(&targets) else { return told };
    told.recorded = true;
    let mut here = Vec::new();
    if !tape.begin(trace, &mut here) {
        return told;
    }
    let flat: Vec<f64> = places.iter().flat_map(|p| p.1.iter().copied()).collect();
    assert_eq!(here, flat, "{what}: the coordinates of the state");
    let (mut by_tape, mut by_trace) = (Vec::new(), Vec::new());
    if tape.gradient(&here, 0.7, &mut by_tape)
        && trace.gradient(&targets, 0.7, &mut by_trace).is_ok()
    {
        close(&by_tape, &by_trace, what);
    }
    let mut rng = StreamKey::new(3, 0, Purpose::KERNEL).stream(0, 0, 0);
    for round in 0..12 {
        let wide = [0.01, 0.3, 2.0][round % 3];
        let y: Vec<f64> = here.iter().map(|y| y + wide * rng.standard_normal()).collect();
        let (mut from, mut changes) = (0, Vec::new());
        for (t, own) in &places {
            changes.push((*t, Change::Free(y[from..from + own.len()].to_vec())));
            from += own.len();
        }
        let proposed = trace.propose(&changes, Draws::default());
        let Some(w) = tape.weigh(&y) else {
            told.asked += 1;
            trace.rollback();
            continue;
        };
        let proposed = proposed
            .unwrap_or_else(|e| panic!("{what}\na tape has a density where there is none: {e}"));
        assert_eq!(
            (proposed.appeared, proposed.vanished),
            (0, 0),
            "{what}\nstructure changes unnoticed"
        );
        for (found, expected, part) in [
            (w.log_weight, proposed.log_weight, "weight"),
            (w.log_likelihood, proposed.log_likelihood, "likelihood"),
            (w.log_jacobian, proposed.log_jacobian, "Jacobian"),
        ] {
            assert!(
                found.to_bits() == expected.to_bits(),
                "{what}\n{part} {found}, by a proposal {expected}"
            );
        }
        by_trace.clear();
        let known =
            w.log_weight.is_finite() && trace.gradient(&targets, 0.7, &mut by_trace).is_ok();
        if known && tape.gradient(&y, 0.7, &mut by_tape) {
            close(&by_tape, &by_trace, what);
        }
        trace.rollback();
        told.points += 1;
        if w.log_weight.is_finite() && round % 3 != 2 {
            told.moved += u32::from(move_in_place(trace, &mut tape, &y, what));
            assert!(tape.begin(trace, &mut here), "{what}: the tape does not hold where it moved");
        }
    }
    told
}

/// Moves the trace to a point and compares every node with a trace that a proposal moved
/// there. False if the tape cannot move it in place.
fn move_in_place(trace: &mut Trace, tape: &mut Recording, y: &[f64], what: &str) -> bool {
    let mut proposed = trace.clone();
    let mut changes = Vec::new();
    tape.changes(y, &mut changes);
    proposed.propose(&changes, Draws::default()).unwrap_or_else(|e| panic!("{what}\n{e}"));
    proposed.commit();
    let mut here = Vec::new();
    if !tape.move_to(trace, y, &mut here) {
        trace.propose(&changes, Draws::default()).unwrap_or_else(|e| panic!("{what}\n{e}"));
        trace.commit();
        tape.moved(trace);
        return false;
    }
    assert!(tape.holds(trace), "{what}");
    trace.same_nodes(&proposed).unwrap_or_else(|e| panic!("{what}\n{e}"));
    let mut anew = Vec::new();
    assert!(tape.begin(trace, &mut anew) && anew == here, "{what}: {here:?}, {anew:?}");
    true
}

fn close(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let size = expected.iter().filter(|g| g.is_finite()).fold(1.0, |m: f64, g| m.max(g.abs()));
    for (i, (f, e)) in found.iter().zip(expected).enumerate() {
        let same = (f - e).abs() <= 1e-12 * size || f == e || !(f.is_finite() || e.is_finite());
        assert!(same, "{what}\ncoordinate {i}: {f} by tape, {e} by the trace");
    }
}
