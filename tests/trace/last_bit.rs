//! Updates stop where a value is unchanged to the last bit: numbers one unit in the last
//! place apart, 0 and -0, and a number and NaN are different. For each path of a value
//! from a choice to a score, incremental updates are compared with running the whole
//! program.

use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Draws, Trace};
use pcadlang_inference::RunOptions;
use pcadlang_inference::host::{Entry, Host, Previous, Type};

/// Amplifies a unit in the last place at 0.3, and the sign of 0.
const FAR: &str = "fn far(v) { clamp((v - 0.3) * 1e17, -40, 40) + atan2(0, v) }
    fn odd(v) { let q = log(v - 0.3); if q == q { clamp(q, -50, 50) } else { 7 } }
    assume x ~ normal(0, 5);";

/// The paths: the computation between `x` and the score.
const WAYS: &[(&str, &str)] = &[
    ("a number", "let o = x;"),
    ("arithmetic", "let o = (x * 4) / 4 + 0 * x;"),
    ("a negation", "let o = -(-x);"),
    ("an array", "let a = [x, 1, 2]; let o = a[0];"),
    ("an array of results", "let a = 1 * [x, 1]; let b = reverse(a); let o = b[1];"),
    ("a list of arrays", "let a = [[1, x], [2, 3]]; let o = a[0][1];"),
    ("a list of other things", "let a = [\"s\", x, true]; let o = a[1];"),
    ("a record", "let r = { p: x, q: \"s\" }; let o = r.p;"),
    ("a record in a record", "let r = { p: { q: [x, 2] }, s: 1 }; let u = r.p; let o = u.q[0];"),
    ("a function", "fn f(a) { let b = a * 1; b } let o = f(x);"),
    ("a function without a name", "let f = fn(a) { [a] }; let o = f(x)[0];"),
    ("what a function sees", "let y = x * 1; let f = fn(a) { y }; let o = f(1);"),
    ("map", "let a = map(fn(a) { a * 1 }, [1, x]); let o = a[1];"),
    ("map of what map sees", "let y = x * 1; let a = map(fn(a) { y }, [1, 2]); let o = a[1];"),
    ("fold", "let o = fold(fn(s, a) { if a == 1 { s } else { a } }, 0, [x, 1]);"),
    ("fold from", "let o = fold(fn(s, a) { s }, x, [1, 2]);"),
    ("mem", "let f = mem(fn(a) { z ~ flip(0.5); if z { a } else { a } }); let o = f(x);"),
    ("mem of an array", "let f = mem(fn(a) { a[0] }); let o = f([x, 1]);"),
    ("mem of two", "let f = mem(fn(a, b) { b }); let o = f(1, x);"),
    ("a branch", "assume c ~ flip(0.5); let o = if c { [x][0] } else { x * 1 };"),
    (
        "a condition on the number",
        "let o = if x > 0.3 { 0.30000000000000004 } else { if x == 0 { x } else { 0.3 } };",
    ),
    (
        "a container",
        "for i in 0 .. 3 { let t = x * i; if i == 1 { observe normal(far(t), 3) = 1; } } let o = x;",
    ),
    ("what a loop goes over", "for k in [x] { observe normal(far(k), 3) = 1; } let o = 1;"),
    ("a parameter of a choice", "assume y ~ normal(far(x), 9); let o = y;"),
    ("a parameter of elements", "assume y ~ iid(normal(far(x), 9), 3); let o = y[1];"),
    ("a vector's mean", "assume y ~ mv_normal([far(x), 0], [[9, 1], [1, 9]]); let o = y[1];"),
    ("a distribution as a value", "let d = normal(far(x), 3); observe d = 1; let o = 1;"),
    ("a bound of a choice", "assume y ~ uniform(0.1 * far(x) - 200, 100); let o = y * 1;"),
    ("a factor", "factor(far(x) * 0.1); let o = 1;"),
];

/// The successive values of `x`.
const VALUES: &[f64] = &[
    0.3,
    0.30000000000000004,
    0.3,
    0.29999999999999993,
    0.3,
    0.30000000000000004,
    0.0,
    -0.0,
    0.0,
    5e-324,
    0.0,
    -5e-324,
    -0.0,
    0.3,
    -0.0,
    0.0,
];

fn put(t: &mut Trace, address: &str, v: Value) -> String {
    match t.set(address, v, Draws::default()) {
        Ok(_) => format!("{:x}", t.log_joint().to_bits()),
        Err(e) => format!("{e}"),
    }
}

/// Sets an address to successive values: incrementally, by full re-execution, and from
/// scratch.
fn compare(what: &str, model: &Model, address: &str, values: &[Value]) {
    let start = || model.simulate(1, 0).unwrap_or_else(|e| panic!("{what}: {e}"));
    let (mut some, mut all) = (start(), start());
    all.set_incremental(false);
    let mut seen = Vec::new();
    for (i, v) in values.iter().enumerate() {
        let (by_some, by_all) =
            (put(&mut some, address, v.clone()), put(&mut all, address, v.clone()));
        assert_eq!(by_some, by_all, "{what}: {address} = {v:?}, the value number {i}");
        let again = some.rerun().unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!(
            by_some,
            format!("{:x}", again.log_joint().to_bits()),
            "{what}: {address} = {v:?}, from scratch"
        );
        seen.push(by_some);
    }
    seen.sort();
    seen.dedup();
    // 0.3, its neighbours, 0 and -0 must be distinguished; -0 and the largest number
    // below it need not be.
    assert!(seen.len() >= 4, "{what}: scores do not tell the values apart: {seen:?}");
}

fn numbers() -> Vec<Value> {
    VALUES.iter().map(|x| Value::Num(*x)).collect()
}

#[test]
fn equal_means_to_the_last_bit() {
    for (what, way) in WAYS {
        let text =
            format!("{FAR} {way} observe normal(far(o), 3) = 1; observe normal(odd(o), 3) = 2;");
        let model = Model::from_text(&text).unwrap_or_else(|e| panic!("{what}: {e}"));
        compare(what, &model, "@x", &numbers());
    }
}

/// Elements of choices, whole vectors, and observed values.
#[test]
fn elements_and_observed_values_too() {
    let text =
        format!("{FAR} assume v ~ iid(normal(0, 5), 3); observe normal(far(v[1]) + x, 3) = 1;");
    compare("an element", &Model::from_text(&text).unwrap(), "@v[1]", &numbers());
    let text = format!(
        "{FAR} assume v ~ mv_normal([0, 0], [[9, 1], [1, 9]]); observe normal(far(v[1]) + x, 3) = 1;"
    );
    let vectors: Vec<Value> = VALUES.iter().map(|x| Value::array(vec![1.0, *x])).collect();
    compare("a vector", &Model::from_text(&text).unwrap(), "@v", &vectors);
    // The density is so narrow that a unit in the last place is visible.
    let text = "assume x ~ normal(0, 5); observe normal(0.3 + 0 * x, 1e-17) = 0.3 as y;";
    let values: Vec<Value> = VALUES.iter().filter(|x| **x > 0.2).map(|x| Value::Num(*x)).collect();
    let mut t = Model::from_text(text).unwrap().simulate(1, 0).unwrap();
    let scores: Vec<u64> = values
        .iter()
        .map(|v| {
            put(&mut t, "@y", v.clone());
            assert_eq!(
                t.log_joint().to_bits(),
                t.rerun().unwrap().log_joint().to_bits(),
                "observed {v:?}"
            );
            t.log_joint().to_bits()
        })
        .collect();
    assert!(
        scores[0] != scores[1] && scores[0] == scores[2] && scores[0] != scores[3],
        "{scores:?}"
    );
}

/// Values of finite choices that lead to numbers one unit apart, weighed without changing
/// the trace, by updates, and from scratch.
#[test]
fn short_ways_tell_them_apart() {
    let ways = [
        "let o = table[k];",
        "let o = if k == 0 { table[k] } else { [table[k]][0] };",
        "let g = mem(fn(a) { a }); let o = g(table[k]);",
        "let o = if f { table[k] } else { table[k] * 1 };",
    ];
    for way in ways {
        for kernel in [
            "gibbs(one($finite))",
            "mh(one($finite))",
            "gibbs(@k); mh(@f)",
            "drift(@k); mh(one(@**))",
        ] {
            let text = format!(
                "{FAR} let table = [0.3, 0.30000000000000004, 0.29999999999999993, 0, -0];
                 assume k ~ categorical([1, 1, 1, 1, 1]); assume f ~ flip(0.5); {way}
                 observe normal(far(o) + x, 5) = if f {{ 1 }} else {{ 2 }};
                 infer {{ repeat 300 {{ {kernel}; collect k, f; }} }}"
            );
            let model = Model::from_text(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
            let chain = |incremental| {
                let options = RunOptions { seed: 5, incremental, ..RunOptions::default() };
                let done = model.run(&options, 1, 1).unwrap_or_else(|e| panic!("{e}\n{text}"));
                let rows = done.draws.iter().flat_map(|d| d.rows.clone());
                rows.map(|r| {
                    (r.log_joint.to_bits(), r.values.iter().map(|x| x.to_bits()).collect())
                })
                .collect()
            };
            let (some, all): (Vec<(u64, Vec<u64>)>, _) = (chain(true), chain(false));
            assert!(some == all, "{text}");
            let mut seen: Vec<u64> = some.iter().map(|r| r.0).collect();
            seen.sort_unstable();
            seen.dedup();
            assert!(seen.len() > 2, "{text}: nothing moves");
        }
    }
}

/// A host's incremental function is notified of changes of a single last bit.
#[test]
fn functions_of_a_host_see_the_last_bit() {
    let kept = Entry::incremental("kept", |a, previous: Option<Previous<f64>>| {
        let prepared = match previous {
            Some(p) if !p.changed(a, 0) => *p.state(),
            _ => a.num(0)?,
        };
        Ok((Value::Num(prepared), prepared))
    })
    .argument("x", Type::Num, "What is kept.")
    .argument("y", Type::Num, "The rest.");
    let text = format!("{FAR} observe normal(far(kept(x, 2)), 3) = 1;");
    let model = Program::parse(&text)
        .and_then(|p| p.host(&Host::new().with(kept)))
        .and_then(Program::compile);
    compare("a function of a host", &model.unwrap_or_else(|e| panic!("{e}")), "@x", &numbers());
}
