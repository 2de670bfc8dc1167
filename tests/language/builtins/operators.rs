//! Operators: values, broadcasting, edge cases, error messages.

use super::*;

#[test]
fn numbers_and_arrays_combine_element_by_element() {
    same(call("+", &[num(1.0), num(2.0)]), num(3.0));
    same(call("-", &[arr(&[1.0, 2.0]), num(1.0)]), arr(&[0.0, 1.0]));
    same(call("-", &[num(1.0), arr(&[1.0, 2.0])]), arr(&[0.0, -1.0]));
    same(call("*", &[arr(&[1.0, 2.0]), arr(&[3.0, 4.0])]), arr(&[3.0, 8.0]));
    same(call("/", &[arr(&[]), num(2.0)]), arr(&[]));
    same(call("**", &[num(2.0), arr(&[0.0, 3.0, -1.0])]), arr(&[1.0, 8.0, 0.5]));
    same(call("neg", &[arr(&[1.0, -2.0])]), arr(&[-1.0, 2.0]));
    same(call("neg", &[num(0.0)]), num(-0.0));
}

#[test]
fn arrays_of_arrays_combine_through_and_through() {
    let m = list(&[arr(&[1.0, 2.0]), arr(&[3.0, 4.0])]);
    same(call("*", &[num(2.0), m.clone()]), list(&[arr(&[2.0, 4.0]), arr(&[6.0, 8.0])]));
    same(call("+", &[m.clone(), m.clone()]), list(&[arr(&[2.0, 4.0]), arr(&[6.0, 8.0])]));
    same(
        call("+", &[m.clone(), arr(&[10.0, 20.0])]),
        list(&[arr(&[11.0, 12.0]), arr(&[23.0, 24.0])]),
    );
    same(call("neg", &[m]), list(&[arr(&[-1.0, -2.0]), arr(&[-3.0, -4.0])]));
}

#[test]
fn plain_numbers_and_arrays_of_one_agree() {
    let values = [0.0, -0.0, 1.5, -2.25, 1e300, -1e-300, f64::INFINITY, f64::NAN];
    for op in ["+", "-", "*", "/", "%", "**", "==", "!=", "<", "<=", ">", ">="] {
        for x in values {
            for y in values {
                let plain = call(op, &[num(x), num(y)]);
                for (a, b) in [(arr(&[x]), num(y)), (num(x), arr(&[y])), (arr(&[x]), arr(&[y]))] {
                    same(call(op, &[a, b]).element(0).unwrap(), plain.clone());
                }
                same(
                    call(op, &[list(&[list(&[num(x)])]), num(y)])
                        .element(0)
                        .unwrap()
                        .element(0)
                        .unwrap(),
                    plain,
                );
            }
        }
    }
}

#[test]
fn division_follows_ieee() {
    same(call("/", &[num(1.0), num(0.0)]), num(f64::INFINITY));
    same(call("/", &[num(-1.0), num(0.0)]), num(f64::NEG_INFINITY));
    assert!(matches!(call("/", &[num(0.0), num(0.0)]), Value::Num(x) if x.is_nan()));
    assert!(matches!(call("%", &[num(1.0), num(0.0)]), Value::Num(x) if x.is_nan()));
}

#[test]
fn remainder_has_the_sign_of_the_divisor() {
    for (x, y, wanted) in
        [(7.0, 3.0, 1.0), (-1.0, 3.0, 2.0), (1.0, -3.0, -2.0), (-7.0, -3.0, -1.0), (6.0, 3.0, 0.0)]
    {
        same(call("%", &[num(x), num(y)]), num(wanted));
    }
    same(call("%", &[num(5.5), num(f64::INFINITY)]), num(5.5));
}

#[test]
fn strings_join_and_compare() {
    same(call("+", &["a".into(), "b".into()]), "ab".into());
    same(
        call("+", &[list(&["a".into(), "b".into()]), "c".into()]),
        list(&["ac".into(), "bc".into()]),
    );
    same(call("<", &["a".into(), "b".into()]), true.into());
    same(call(">=", &[list(&["a".into(), "c".into()]), "b".into()]), bools(&[false, true]));
}

#[test]
fn equality_takes_any_values() {
    let r = |x: f64| Value::record([("a", num(x)), ("b", arr(&[1.0, x]))]);
    let s = Value::record([("b", arr(&[1.0, 2.0])), ("a", num(2.0))]);
    same(call("==", &[r(2.0), r(2.0)]), true.into());
    same(call("==", &[r(2.0), s]), true.into());
    same(call("==", &[r(2.0), r(3.0)]), false.into());
    same(call("!=", &["a".into(), num(1.0)]), true.into());
    same(call("==", &[num(f64::NAN), num(f64::NAN)]), false.into());
    same(call("==", &[num(0.0), num(-0.0)]), true.into());
    same(call("==", &[arr(&[1.0, 2.0]), arr(&[1.0, 3.0])]), bools(&[true, false]));
    same(call("==", &[list(&["a".into(), "b".into()]), "b".into()]), bools(&[false, true]));
    same(call("==", &[Value::record([]), list(&[])]), arr(&[]));
}

#[test]
fn order_of_nan_holds_never() {
    for op in ["<", "<=", ">", ">="] {
        same(call(op, &[num(f64::NAN), num(1.0)]), false.into());
        same(call(op, &[arr(&[f64::NAN]), num(1.0)]), bools(&[false]));
    }
    same(call("not", &[bools(&[true, false])]), bools(&[false, true]));
    same(call("not", &[false.into()]), true.into());
}

#[test]
fn ranges_leave_out_their_end() {
    same(call("..", &[num(2.0), num(5.0)]), arr(&[2.0, 3.0, 4.0]));
    same(call("..", &[num(-1.0), num(1.0)]), arr(&[-1.0, 0.0]));
    same(call("..", &[num(3.0), num(3.0)]), arr(&[]));
    same(call("..", &[num(3.0), num(-3.0)]), arr(&[]));
    assert_eq!(fails("..", &[num(0.5), num(3.0)]), "`..` needs whole numbers, got 0.5");
    assert_eq!(fails("..", &[num(0.0), num(f64::NAN)]), "`..` needs whole numbers, got NaN");
    assert_eq!(fails("..", &[num(0.0), "a".into()]), "`..` needs whole numbers, got a string");
    assert_eq!(
        fails("..", &[num(0.0), num(1e9)]),
        "..: an array of 1000000000 elements is too long (at most 10000000 can be made in one call)"
    );
}

#[test]
fn errors_name_what_stands_at_the_sides() {
    assert_eq!(
        fails("+", &[arr(&[1.0; 3]), arr(&[1.0; 4])]),
        "+: arrays of lengths 3 and 4 do not match"
    );
    assert_eq!(
        fails("+", &["a".into(), num(1.0)]),
        "`+` needs numbers or strings, got a string and a number (`str(x)` makes a string of a number)"
    );
    assert_eq!(
        fails("*", &[true.into(), num(1.0)]),
        "`*` needs numbers, got a bool and a number (`if b { 1 } else { 0 }` makes a number of a bool)"
    );
    assert_eq!(
        fails("-", &[Value::record([]), num(1.0)]),
        "`-` needs numbers, got a record and a number"
    );
    assert_eq!(
        fails("<", &[num(1.0), "a".into()]),
        "`<` needs two numbers or two strings, got a number and a string"
    );
    assert_eq!(fails("not", &[num(1.0)]), "`not` needs a bool, got a number");
    assert_eq!(
        fails("neg", &[list(&[num(1.0), "x".into()])]),
        "neg: `a` must be a number or an array of numbers, got an array with a string (\"x\") in it"
    );
}
