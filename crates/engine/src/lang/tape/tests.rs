//! Tapes recorded by hand against closed forms.

use super::*;
use crate::lang::builtins::{Builtin, Table};
use crate::lang::value::Value;
use pcadlang_numerics::dist::Dist;

fn builtin(table: &Table, name: &str) -> Builtin {
    table.get(table.find("", name).unwrap()).clone()
}

fn normal(mean: f64, sd: f64) -> Dist {
    Dist::Normal(pcadlang_numerics::dist::Normal::new(mean, sd).unwrap())
}

/// `s ~ gamma-like positive number; observe normal([1, 2] * s, s) = [0.5, 0.7]`, recorded
/// with the values for s = 2.
fn recorded(guarded: bool) -> Tape {
    let (table, mut b) = (Table::default(), Builder::default());
    let s = b.place(&Value::Num(2.0)).unwrap();
    b.input(Support::Positive, s.clone());
    let weights = Form::Fixed(Value::array(vec![1.0, 2.0]));
    let mean = b
        .call(&builtin(&table, "*"), vec![weights, s.clone()], &Value::array(vec![2.0, 4.0]))
        .unwrap();
    if guarded {
        let above = b.call(
            &builtin(&table, ">"),
            vec![s.clone(), Form::Fixed(Value::Num(1.0))],
            &Value::Bool(true),
        );
        b.guard(&above.unwrap(), &Value::Bool(true)).unwrap();
    }
    let product =
        pcadlang_numerics::dist::Product::new(vec![normal(2.0, 2.0), normal(4.0, 2.0)]).unwrap();
    let seen = Form::Fixed(Value::array(vec![0.5, 0.7]));
    let dist = Dist::from(product);
    b.family(&builtin(&table, "normal"), vec![mean, s], &dist, &seen, true).unwrap();
    b.finish()
}

fn density(y: f64) -> f64 {
    let s = y.exp();
    let one = |w: f64, x: f64| {
        -0.5 * ((x - w * s) / s).powi(2) - s.ln() - 0.5 * std::f64::consts::TAU.ln()
    };
    one(1.0, 0.5) + one(2.0, 0.7) + y
}

#[test]
fn densities_and_gradients_are_those_of_the_formula() {
    let mut tape = recorded(false);
    let mut g = Vec::new();
    for y in [-1.0, 0.2, 1.3] {
        assert!(tape.run(&[y]));
        let sums = tape.sums();
        let found = sums.prior.value() + sums.likelihood.value() + sums.jacobian.value();
        assert!((found - density(y)).abs() < 1e-12, "{found} at {y}");
        assert!(tape.gradient(&[y], 1.0, &mut g));
        let slope = (density(y + 1e-6) - density(y - 1e-6)) / 2e-6;
        assert!((g[0] - slope).abs() < 1e-6, "{g:?} at {y}, by differences {slope}");
    }
    // The coordinates of a given value are returned.
    let mut y = Vec::new();
    assert!(tape.run_at_values(|_| Value::Num(1.5), |_, _, _| None, &mut y));
    assert_eq!(y, [libm::log(1.5)]);
}

/// The images of a point have coordinates that may differ from it in the last bit.
#[test]
fn what_is_known_at_a_point_is_what_its_images_have() {
    let (mut tape, mut fresh) = (recorded(false), recorded(false));
    let mut moved = 0;
    for i in 0..50 {
        let y = [0.1 + 0.07 * f64::from(i)];
        let [mut here, mut expected] = [Vec::new(), Vec::new()];
        let [mut g, mut by] = [Vec::new(), Vec::new()];
        assert!(tape.run(&y) && tape.gradient(&y, 0.5, &mut g));
        assert!(tape.run_at_images(&y, &mut here) && fresh.run_at_images(&y, &mut expected));
        assert_eq!((&here, tape.sums()), (&expected, fresh.sums()));
        for power in [0.5, 2.0] {
            assert!(tape.gradient(&here, power, &mut g) && fresh.gradient(&here, power, &mut by));
            assert_eq!(g, by);
        }
        moved += i32::from(here != y);
        assert!(tape.run(&[-0.3]) && tape.gradient(&[-0.3], 2.0, &mut g));
        assert!(fresh.run(&[-0.3]) && fresh.gradient(&[-0.3], 2.0, &mut by));
        assert_eq!((g, tape.sums()), (by, fresh.sums()));
    }
    assert!(moved > 0);
}

#[test]
fn a_guard_says_where_the_tape_ends() {
    let mut tape = recorded(true);
    assert!(tape.run(&[0.4]) && !tape.run(&[-0.4]) && tape.run(&[0.1]));
    assert!(!tape.run(&[]), "too few coordinates");
}

#[test]
fn what_has_no_derivative_makes_no_tape() {
    let (table, mut b) = (Table::default(), Builder::default());
    let x = b.place(&Value::Num(2.0)).unwrap();
    let strings = Value::str("2");
    assert!(b.call(&builtin(&table, "str"), vec![x], &strings).is_none_or(|f| !f.is_fixed()));
    assert!(b.place(&strings).is_none());
}
