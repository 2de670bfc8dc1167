//! The table: look-up, matching of arguments, and invariants of every entry.

use super::*;
use pcadlang_engine::lang::builtins::Scalar;
use pcadlang_numerics::dist::{Dist, Numbers};
use std::collections::HashSet;
use std::sync::Arc;

fn matched(name: &str, args: &[Option<&str>]) -> Result<Vec<Option<usize>>, String> {
    let index = TABLE.find("", name).unwrap();
    TABLE.get(index).match_names(args.iter().copied()).map(|o| o.to_vec())
}

#[test]
fn arguments_are_matched_by_position_and_name() {
    assert_eq!(matched("clamp", &[None, None, None]).unwrap(), [Some(0), Some(1), Some(2)]);
    assert_eq!(
        matched("clamp", &[None, Some("hi"), Some("lo")]).unwrap(),
        [Some(0), Some(2), Some(1)]
    );
    assert_eq!(matched("range", &[None, None]).unwrap(), [Some(0), Some(1), None]);
    assert_eq!(matched("min", &[None, None, None]).unwrap(), [Some(0), Some(1), Some(2)]);
}

#[test]
fn mistakes_in_arguments_are_explained() {
    let wrong = |name, args: &[Option<&str>]| matched(name, args).unwrap_err();
    assert_eq!(wrong("sqrt", &[None, None]), "`sqrt` takes 1 argument, got 2: sqrt(x)");
    assert_eq!(wrong("log_joint", &[None]), "`log_joint` takes no arguments, got 1: log_joint()");
    assert_eq!(
        wrong("range", &[None]),
        "`range` needs its argument `end`: range(start, end, step = 1)"
    );
    assert_eq!(
        wrong("range", &[None, None, Some("stepp")]),
        "`range` has no argument `stepp`; did you mean `step`?"
    );
    assert_eq!(wrong("clamp", &[Some("q")]), "`clamp` has no argument `q`; it takes x, lo, hi");
    assert_eq!(wrong("steps", &[Some("q")]), "`steps` has no argument `q`; it takes none");
    assert_eq!(wrong("clamp", &[None, Some("x"), None]), "`clamp` got its argument `x` twice");
    assert_eq!(wrong("min", &[]), "`min` needs its argument `x`: min(x, …)");
}

#[test]
fn names_are_found_by_module() {
    assert!(TABLE.find("", "sqrt").is_some());
    assert!(TABLE.find("", "..").is_some());
    assert!(TABLE.find("nowhere", "sqrt").is_none());
    for (i, b) in TABLE.iter().enumerate() {
        assert_eq!(TABLE.find(&b.module, &b.name), Some(i as u32));
    }
}

#[test]
fn every_entry_is_well_formed() {
    let mut seen = HashSet::new();
    let is_new = |name: &str| name == "not" || !pcadlang_syntax::is_keyword(name);
    for b in pcadlang_inference::table().iter() {
        let name = b.full_name();
        assert!(seen.insert(name.clone()), "{name} is there twice");
        assert!(is_new(&b.name), "{name} is a keyword");
        assert!(TABLE.constant(&b.name).is_none(), "{name} is a constant too");
        assert!(b.doc.ends_with('.') && !b.section.is_empty(), "{name}: {}", b.doc);
        let mut names = HashSet::new();
        let mut optional = false;
        for a in b.args.iter() {
            assert!(names.insert(&*a.name), "{name}: {} is there twice", a.name);
            assert!(is_new(&a.name), "{name}: {} is a keyword", a.name);
            assert!(a.doc.ends_with('.'), "{name}: {}", a.doc);
            assert!(
                a.default.is_some() || !optional,
                "{name}: {} must be given after one that need not be",
                a.name
            );
            optional |= a.default.is_some();
        }
        assert!(!b.variadic || !b.args.is_empty(), "{name}");
    }
}

#[test]
fn no_function_panics_on_values_of_any_type() {
    let values = [
        Value::Unit,
        num(2.0),
        num(f64::NAN),
        num(-1e308),
        true.into(),
        "x".into(),
        arr(&[]),
        arr(&[1.0, 2.0]),
        bools(&[true]),
        list(&[arr(&[1.0]), "x".into()]),
        Value::record([("x", num(1.0))]),
    ];
    let mut calls = 0;
    for b in TABLE.iter() {
        let f = |values: &[&Value]| match b.kind {
            Kind::Function(f) => f(&Args { builtin: b, values }).map(|_| ()),
            Kind::Distribution(f) => f(&Args { builtin: b, values }).map(|_| ()),
            _ => Ok(()),
        };
        let _ = f(&[]);
        for x in &values {
            let _ = f(&[x]);
            for y in &values {
                let _ = f(&[x, y]);
                for z in &values {
                    let _ = f(&[x, y, z]);
                    calls += 1;
                }
            }
        }
    }
    assert!(calls > 50_000);
}

#[test]
fn forms_for_single_numbers_are_the_functions_themselves() {
    let numbers = [-2.5, -1.0, -0.0, 0.0, 0.3, 1.0, 7.0, f64::INFINITY, f64::NAN];
    let mut seen = 0;
    for b in Table::default().iter() {
        let Some(scalar) = b.scalar else { continue };
        let call = |values: &[Value]| {
            let values: Vec<&Value> = values.iter().collect();
            let args = Args { builtin: b, values: &values };
            match b.kind {
                Kind::Function(f) => f(&args).unwrap(),
                Kind::Distribution(f) => {
                    f(&args).map_or(Value::Unit, |d| Value::str(&format!("{d:?}")))
                }
                _ => panic!("{} is no function", b.name),
            }
        };
        seen += 1;
        for x in numbers {
            for y in numbers {
                let (found, wanted) = match scalar {
                    Scalar::Unary(f) => (Value::Num(f(x)), call(&[Value::Num(x)])),
                    Scalar::Binary(f) => {
                        (Value::Num(f(x, y)), call(&[Value::Num(x), Value::Num(y)]))
                    }
                    Scalar::Test(f) => {
                        (Value::Bool(f(x, y)), call(&[Value::Num(x), Value::Num(y)]))
                    }
                    Scalar::Logic(f) => (Value::Bool(f(x > 0.0)), call(&[Value::Bool(x > 0.0)])),
                    Scalar::Family(Numbers { make, log_density }) => {
                        let make = |p: &[f64]| make(p).ok();
                        let parameters: Vec<f64> =
                            [x, y, x, y].into_iter().take(b.args.len()).collect();
                        let values: Vec<Value> =
                            parameters.iter().map(|x| Value::Num(*x)).collect();
                        let (found, wanted) = (
                            log_density(&parameters, 0.5),
                            make(&parameters).map(|d| d.log_density_num(0.5)),
                        );
                        assert_eq!(
                            found.map(f64::to_bits),
                            wanted.map(f64::to_bits),
                            "{}({parameters:?})",
                            b.name
                        );
                        let found = make(&parameters)
                            .map_or(Value::Unit, |d| Value::str(&format!("{d:?}")));
                        (found, call(&values))
                    }
                    Scalar::Weights { make, log_probability } => {
                        let weights: Arc<[f64]> = [x, 1.0, y].into();
                        let (dist, made) =
                            (make(&weights), call(&[Value::Array(Arc::clone(&weights))]));
                        let density = |d: &Dist| Value::Num(d.log_density_num(x));
                        let (a, b) = (
                            log_probability(&weights, x).map(Value::Num),
                            dist.as_ref().map(density),
                        );
                        assert!(a.unwrap_or_default().same(&b.unwrap_or_default()), "{weights:?}");
                        (dist.map_or(Value::Unit, |d| Value::str(&format!("{d:?}"))), made)
                    }
                };
                assert!(found.same(&wanted), "{}({x}, {y}): {found} or {wanted}", b.name);
            }
        }
    }
    assert!(seen > 30, "{seen}");
}
