//! Arrays and records: creating, joining, searching.

use super::*;

#[test]
fn spaced_numbers_keep_their_ends() {
    same(call("linspace", &[num(0.0), num(1.0), num(5.0)]), arr(&[0.0, 0.25, 0.5, 0.75, 1.0]));
    same(call("linspace", &[num(3.0), num(7.0), num(1.0)]), arr(&[3.0]));
    same(call("linspace", &[num(3.0), num(7.0), num(0.0)]), arr(&[]));
    let Value::Array(xs) = call("linspace", &[num(0.1), num(0.7), num(12.0)]) else { panic!() };
    assert_eq!((xs[0], xs[11]), (0.1, 0.7));
    assert!(xs.windows(2).all(|w| w[0] < w[1]));
    same(call("range", &[num(0.0), num(1.0), num(0.25)]), arr(&[0.0, 0.25, 0.5, 0.75]));
    same(call("range", &[num(2.0), num(0.0), num(-1.0)]), arr(&[2.0, 1.0]));
    same(call("range", &[num(2.0), num(0.0)]), arr(&[]));
    assert_eq!(
        fails("range", &[num(0.0), num(1.0), num(0.0)]),
        "range: steps of 0 do not lead from 0 to 1"
    );
    assert!(fails("linspace", &[num(0.0), num(1.0), num(1e8)]).contains("too long"));
    assert_eq!(
        fails("linspace", &[num(0.0), num(1.0), num(-1.0)]),
        "linspace: `n` must be a whole number, at least 0, got -1"
    );
}

#[test]
fn arrays_are_made_and_joined() {
    same(call("zeros", &[num(2.0)]), arr(&[0.0, 0.0]));
    same(call("ones", &[num(2.0)]), arr(&[1.0, 1.0]));
    same(call("fill", &[num(3.0), num(2.0)]), arr(&[3.0, 3.0]));
    same(call("fill", &["a".into(), num(2.0)]), list(&["a".into(), "a".into()]));
    same(call("concat", &[arr(&[1.0]), arr(&[]), arr(&[2.0, 3.0])]), arr(&[1.0, 2.0, 3.0]));
    same(call("concat", &["a".into(), "bc".into()]), "abc".into());
    same(call("append", &[arr(&[1.0]), num(2.0)]), arr(&[1.0, 2.0]));
    same(call("append", &[arr(&[1.0]), "a".into()]), list(&[num(1.0), "a".into()]));
    same(call("reverse", &[arr(&[1.0, 2.0])]), arr(&[2.0, 1.0]));
    same(call("zip", &[arr(&[1.0]), list(&["a".into()])]), list(&[list(&[num(1.0), "a".into()])]));
    assert_eq!(
        fails("zip", &[arr(&[1.0]), arr(&[])]),
        "zip: `ys` must have as many elements as `xs`, 1, got 0"
    );
    for (x, n) in
        [(arr(&[1.0, 2.0]), 2.0), ("häuser".into(), 6.0), (Value::record([("a", num(1.0))]), 1.0)]
    {
        same(call("len", &[x]), num(n));
    }
    assert_eq!(
        fails("len", &[num(1.0)]),
        "len: `x` must be an array, record or string, got a number (1)"
    );
}

#[test]
fn sorting_is_stable_and_total() {
    same(call("sort", &[arr(&[3.0, -1.0, 2.0])]), arr(&[-1.0, 2.0, 3.0]));
    same(call("argsort", &[arr(&[2.0, 1.0, 2.0, 0.0])]), arr(&[3.0, 1.0, 0.0, 2.0]));
    same(call("argsort", &[arr(&[0.0, -0.0, 0.0])]), arr(&[0.0, 1.0, 2.0]));
    same(
        call("argsort", &[arr(&[-f64::NAN, 1.0, f64::NAN, f64::INFINITY])]),
        arr(&[1.0, 3.0, 0.0, 2.0]),
    );
    same(call("sort", &[list(&["b".into(), "a".into()])]), list(&["a".into(), "b".into()]));
    same(call("argmax", &[arr(&[1.0, 3.0, 3.0, f64::NAN])]), num(1.0));
    same(call("argmin", &[arr(&[f64::NAN, 3.0, 3.0])]), num(1.0));
    assert_eq!(fails("argmax", &[arr(&[])]), "argmax: `xs` must have at least 1 element, got 0");
    assert_eq!(fails("argmin", &[arr(&[f64::NAN])]), "argmin: every element is NaN");
    assert!(
        fails("sort", &[list(&["b".into(), num(1.0)])])
            .contains("array of numbers, or one of strings")
    );
}

#[test]
fn records_are_taken_apart() {
    let r = Value::record([("b", num(1.0)), ("a", num(2.0))]);
    same(call("keys", std::slice::from_ref(&r)), list(&["b".into(), "a".into()]));
    same(call("values", std::slice::from_ref(&r)), arr(&[1.0, 2.0]));
    same(call("has", &[r.clone(), "a".into()]), true.into());
    same(call("has", &[r.clone(), "c".into()]), false.into());
    same(call("has", &[arr(&[5.0]), num(0.0)]), true.into());
    same(call("has", &[arr(&[5.0]), num(1.0)]), false.into());
    same(call("has", &[arr(&[5.0]), num(-1.0)]), false.into());
    same(call("keys", &[arr(&[5.0, 6.0])]), arr(&[0.0, 1.0]));
    assert_eq!(fails("has", &[r, num(1.0)]), "has: `key` must be a string, got a number (1)");
    assert_eq!(fails("keys", &[num(1.0)]), "keys: `r` must be a record or array, got a number (1)");
}

#[test]
fn truth_is_tested_and_selected_by() {
    same(call("any", &[bools(&[false, true])]), true.into());
    same(call("all", &[bools(&[false, true])]), false.into());
    same(call("any", &[arr(&[])]), false.into());
    same(call("all", &[arr(&[])]), true.into());
    same(call("select", &[true.into(), num(1.0), "a".into()]), num(1.0));
    same(call("select", &[bools(&[true, false]), arr(&[1.0, 2.0]), num(9.0)]), arr(&[1.0, 9.0]));
    assert_eq!(
        fails("select", &[bools(&[true, false]), arr(&[1.0, 2.0, 3.0]), num(9.0)]),
        "select: arrays of lengths 2 and 3 do not match"
    );
    assert_eq!(
        fails("all", &[arr(&[1.0])]),
        "all: `xs` must be an array of bools, got an array with a number (1) in it"
    );
}

#[test]
fn values_become_text() {
    same(call("str", &[num(1.5)]), "1.5".into());
    same(call("str", &["a".into()]), "a".into());
    same(call("str", &[arr(&[1.0, 2.0])]), "[1, 2]".into());
}

#[test]
fn tables_are_read_along_straight_lines() {
    let (xs, ys) = (arr(&[0.0, 1.0, 3.0]), arr(&[10.0, 20.0, 0.0]));
    let at = |x: f64| call("interp", &[num(x), xs.clone(), ys.clone()]);
    for (x, y) in
        [(-5.0, 10.0), (0.0, 10.0), (0.5, 15.0), (1.0, 20.0), (2.0, 10.0), (3.0, 0.0), (9.0, 0.0)]
    {
        same(at(x), num(y));
    }
    same(call("interp", &[arr(&[0.5, 2.5]), xs.clone(), ys.clone()]), arr(&[15.0, 5.0]));
    same(call("interp", &[num(1.0), arr(&[1.0, 1.0]), arr(&[2.0, 3.0])]), num(3.0));
    assert_eq!(
        fails("interp", &[num(0.0), arr(&[1.0, 0.0]), arr(&[0.0, 0.0])]),
        "interp: `xs` must be ascending"
    );
    assert!(fails("interp", &[num(0.0), xs.clone(), arr(&[0.0])]).contains("3 numbers, as many"));
    assert!(fails("interp", &[num(0.0), arr(&[]), arr(&[])]).contains("interp"));
}
