//! Math, sums and matrices: exact values, edge cases, error messages.

use super::*;
use std::f64::consts::{LN_2, PI};

#[test]
fn functions_have_their_known_values() {
    near(call("exp", &[num(1.0)]), std::f64::consts::E);
    near(call("log", &[num(2.0)]), LN_2);
    near(call("log1p", &[num(1e-20)]), 1e-20);
    near(call("expm1", &[num(1e-20)]), 1e-20);
    near(call("sqrt", &[num(2.25)]), 1.5);
    near(call("pow", &[num(2.0), num(10.0)]), 1024.0);
    near(call("sin", &[num(PI / 6.0)]), 0.5);
    near(call("cos", &[num(PI / 3.0)]), 0.5);
    near(call("tan", &[num(PI / 4.0)]), 1.0);
    near(call("asin", &[num(1.0)]), PI / 2.0);
    near(call("acos", &[num(-1.0)]), PI);
    near(call("atan", &[num(1.0)]), PI / 4.0);
    near(call("atan2", &[num(1.0), num(-1.0)]), 0.75 * PI);
    near(call("sinh", &[num(LN_2)]), 0.75);
    near(call("cosh", &[num(LN_2)]), 1.25);
    near(call("tanh", &[num(LN_2)]), 0.6);
    near(call("deg", &[num(180.0)]), PI);
    near(call("expit", &[num(0.0)]), 0.5);
    near(call("expit", &[num(libm::log(3.0))]), 0.75);
    near(call("logit", &[num(0.75)]), libm::log(3.0));
    near(call("erf", &[num(0.5)]), 0.520_499_877_813_046_5);
    near(call("lgamma", &[num(5.0)]), libm::log(24.0));
    // mpmath, 40 digits.
    for (f, x, wanted) in [
        ("erfc", 10.0, 2.088_487_583_762_545e-45),
        ("normal_cdf", -20.3, 6.429_244_467_698_346e-92),
        ("log1m_exp", -50.0, -1.928_749_847_963_918e-22),
    ] {
        let Value::Num(got) = call(f, &[num(x)]) else { panic!("{f}") };
        assert!((got / wanted - 1.0).abs() < 1e-15, "{f}({x}) is {got}");
    }
    near(call("log_normal_cdf", &[num(-40.0)]), -804.608_442_013_753_8);
    near(call("log1m_exp", &[num(-1e-20)]), -46.051_701_859_880_914);
    same(call("log1m_exp", &[num(0.0)]), num(f64::NEG_INFINITY));
    same(call("abs", &[arr(&[-1.5, 2.0])]), arr(&[1.5, 2.0]));
    same(call("sign", &[arr(&[-1.5, 2.0, 0.0])]), arr(&[-1.0, 1.0, 0.0]));
    same(call("step", &[arr(&[-1e-300, 0.0, 2.0])]), arr(&[0.0, 1.0, 1.0]));
    same(call("floor", &[arr(&[-1.5, 1.5])]), arr(&[-2.0, 1.0]));
    same(call("ceil", &[arr(&[-1.5, 1.5])]), arr(&[-1.0, 2.0]));
    same(call("round", &[arr(&[-1.5, 0.5, 1.4])]), arr(&[-2.0, 1.0, 1.0]));
}

#[test]
fn tails_do_not_overflow() {
    same(call("expit", &[arr(&[-1000.0, 1000.0, f64::INFINITY])]), arr(&[0.0, 1.0, 1.0]));
    same(call("logit", &[arr(&[0.0, 1.0])]), arr(&[f64::NEG_INFINITY, f64::INFINITY]));
    near(call("log_sum_exp", &[arr(&[1000.0, 1000.0])]), 1000.0 + LN_2);
    near(call("log_sum_exp", &[arr(&[-1000.0, -1000.0])]), -1000.0 + LN_2);
    same(call("log_sum_exp", &[arr(&[])]), num(f64::NEG_INFINITY));
    same(call("log_sum_exp", &[arr(&[f64::NEG_INFINITY; 2])]), num(f64::NEG_INFINITY));
    same(call("log_sum_exp", &[arr(&[f64::INFINITY, 1.0])]), num(f64::INFINITY));
    near(call("norm", &[arr(&[3e200, 4e200])]), 5e200);
    near(call("norm", &[arr(&[3e-200, 4e-200])]), 5e-200);
    same(call("norm", &[arr(&[])]), num(0.0));
    same(call("norm", &[arr(&[f64::INFINITY, 1.0])]), num(f64::INFINITY));
}

#[test]
fn extremes_reduce_one_array_or_compare_several() {
    same(call("min", &[arr(&[3.0, 1.0, 2.0])]), num(1.0));
    same(call("max", &[arr(&[3.0, 1.0, 2.0])]), num(3.0));
    same(call("max", &[num(3.0)]), num(3.0));
    same(call("min", &[num(3.0), num(1.0), num(2.0)]), num(1.0));
    same(call("max", &[arr(&[1.0, 5.0]), num(2.0)]), arr(&[2.0, 5.0]));
    same(call("clamp", &[arr(&[-1.0, 0.5, 9.0]), num(0.0), num(1.0)]), arr(&[0.0, 0.5, 1.0]));
    for order in [[f64::NAN, 1.0], [1.0, f64::NAN]] {
        for f in ["min", "max"] {
            assert!(
                matches!(call(f, &[arr(&order)]), Value::Num(x) if x.is_nan()),
                "NaN is not hidden"
            );
        }
    }
    assert_eq!(fails("min", &[arr(&[])]), "min: `x` must have at least 1 element, got 0");
    assert_eq!(
        fails("clamp", &[num(1.0), "a".into(), num(2.0)]),
        "clamp: `lo` must be a number or an array of numbers, got a string (\"a\")"
    );
}

#[test]
fn statistics_match_hand_calculation() {
    let xs = arr(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]);
    near(call("sum", std::slice::from_ref(&xs)), 40.0);
    near(call("mean", std::slice::from_ref(&xs)), 5.0);
    near(call("var", std::slice::from_ref(&xs)), 32.0 / 7.0);
    near(call("sd", &[xs]), (32.0f64 / 7.0).sqrt());
    near(call("prod", &[arr(&[2.0, 3.0, 4.0])]), 24.0);
    same(call("cumsum", &[arr(&[1.0, 2.0, 3.0])]), arr(&[1.0, 3.0, 6.0]));
    near(call("dot", &[arr(&[1.0, 2.0]), arr(&[3.0, 4.0])]), 11.0);
    near(call("norm", &[arr(&[3.0, 4.0])]), 5.0);
    same(call("sum", &[arr(&[])]), num(0.0));
    same(call("prod", &[arr(&[])]), num(1.0));
    same(call("sum", &[bools(&[true, false, true])]), num(2.0));
    near(call("var", &[arr(&[1e9, 1e9 + 1.0, 1e9 + 2.0])]), 1.0);
    assert_eq!(fails("mean", &[arr(&[])]), "mean: `xs` must have at least 1 element, got 0");
    assert_eq!(fails("sd", &[arr(&[1.0])]), "sd: `xs` must have at least 2 elements, got 1");
    assert_eq!(
        fails("sum", &[num(1.0)]),
        "sum: `xs` must be an array of numbers, got a number (1)"
    );
    assert_eq!(
        fails("dot", &[arr(&[1.0]), arr(&[1.0, 2.0])]),
        "dot: `ys` must have as many elements as `xs`, 1, got 2"
    );
}

#[test]
fn matrices_multiply_and_turn() {
    let m = list(&[arr(&[1.0, 2.0, 3.0]), arr(&[4.0, 5.0, 6.0])]);
    let t = list(&[arr(&[1.0, 4.0]), arr(&[2.0, 5.0]), arr(&[3.0, 6.0])]);
    same(call("transpose", std::slice::from_ref(&m)), t.clone());
    same(call("matmul", &[m.clone(), t.clone()]), list(&[arr(&[14.0, 32.0]), arr(&[32.0, 77.0])]));
    same(call("matmul", &[m.clone(), arr(&[1.0, 0.0, -1.0])]), arr(&[-2.0, -2.0]));
    same(call("matmul", &[arr(&[1.0, -1.0]), m.clone()]), arr(&[-3.0, -3.0, -3.0]));
    same(call("matmul", &[arr(&[1.0, 2.0]), arr(&[3.0, 4.0])]), num(11.0));
    same(call("matmul", &[call("identity", &[num(2.0)]), m.clone()]), m.clone());
    same(call("diag", &[arr(&[1.0, 2.0])]), list(&[arr(&[1.0, 0.0]), arr(&[0.0, 2.0])]));
    same(call("diag", std::slice::from_ref(&m)), arr(&[1.0, 5.0]));
    same(
        call("outer", &[arr(&[1.0, 2.0]), arr(&[3.0, 4.0])]),
        list(&[arr(&[3.0, 4.0]), arr(&[6.0, 8.0])]),
    );
    assert_eq!(fails("matmul", &[m.clone(), m]), "matmul: `a` has 3 columns, `b` has 2 rows");
    assert_eq!(
        fails("transpose", &[list(&[arr(&[1.0]), arr(&[1.0, 2.0])])]),
        "transpose: a matrix has rows of one length; row 0 has 1 numbers, row 1 has 2"
    );
    assert_eq!(
        fails("transpose", &[arr(&[1.0])]),
        "transpose: `a` must be a matrix, an array of rows of numbers, got an array"
    );
}
