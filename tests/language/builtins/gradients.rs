//! Every function in the table declares its derivative: a vector-Jacobian product, zero,
//! or, for a few, unknown. Every product is compared with finite differences, alone or
//! composed with others, for random adjoints of the result.

use super::*;
use glam::DVec3;
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::builtins::Derivative;
use pcadlang_engine::lang::value::Value;
use pcadlang_library::scene::{AffineValue, ArmatureValue, SolidValue};
use pcadlang_scene::geom::Affine;
use std::collections::HashSet;

/// Functions without a derivative, and the reason.
const NONE: &[(&str, &str)] = &[
    ("scene.autorig", "joints are found by search"),
    ("scene.bounds", "they jump from vertex to vertex"),
    ("scene.camera", "cameras are not differentiated"),
    ("scene.candidates", "regions are found in a photograph, which nothing moves"),
    ("scene.edges", "contours are found in a photograph, which nothing moves"),
    ("scene.hint", "what a user points out, which nothing moves"),
    ("scene.objects", "objects are found in a photograph, which nothing moves"),
    ("scene.people", "people are found in a photograph, which nothing moves"),
];

/// Functions that are compared with finite differences elsewhere: in
/// `tests/trace/gradient`, and next to the comparators and renderers.
const ELSEWHERE: &[&str] = &[
    "sq_exp",
    "matern32",
    "matern52",
    "periodic",
    "white",
    "log_density",
    "cholesky",
    "solve",
    "logdet",
    "scene.render",
    "scene.keypoints",
    "scene.relative_depth",
    "scene.chamfer",
    "scene.contour",
    "scene.depth",
    "scene.mask",
    "scene.region",
];

/// An expression.
enum E {
    /// A value with respect to which derivatives are taken.
    By(Value),
    Fixed(Value),
    Call(&'static str, Vec<E>),
}
use E::{By, Call, Fixed};

/// Maps each number of a value, in order.
fn mapped(v: &Value, f: &mut dyn FnMut(f64) -> f64) -> Value {
    match v {
        Value::Num(x) => num(f(*x)),
        Value::Array(xs) => Value::array(xs.iter().map(|x| f(*x)).collect::<Vec<_>>()),
        Value::List(xs) => Value::List(xs.iter().map(|x| mapped(x, f)).collect()),
        Value::Record(r) => Value::Record(std::sync::Arc::new(
            r.iter().map(|(k, x)| (std::sync::Arc::clone(k), mapped(x, f))).collect(),
        )),
        v => v.clone(),
    }
}

/// Appends the numbers of an adjoint in the order of [`mapped`].
fn flat(v: &Value, by: &Adjoint, out: &mut Vec<f64>) {
    match v {
        Value::Num(_) => out.push(by.number()),
        Value::Array(xs) => out.extend(by.numbers(xs.len())),
        Value::List(xs) => xs.iter().enumerate().for_each(|(i, x)| flat(x, &by.element(i), out)),
        Value::Record(r) => r.iter().for_each(|(k, x)| flat(x, &by.field(k), out)),
        _ => {}
    }
}

impl E {
    fn value(&self, f: &mut dyn FnMut(f64) -> f64) -> Value {
        match self {
            By(v) => mapped(v, f),
            Fixed(v) => v.clone(),
            Call(name, args) => call(name, &args.iter().map(|a| a.value(f)).collect::<Vec<_>>()),
        }
    }

    fn vjp(&self, by: &Adjoint, out: &mut Vec<f64>) {
        match self {
            By(v) => flat(v, by, out),
            Fixed(_) => {}
            Call(name, args) => {
                let values: Vec<Value> = args.iter().map(|a| a.value(&mut |x| x)).collect();
                let made = call(name, &values);
                let builtin = find(name);
                let values: Vec<&Value> = values.iter().collect();
                let pulled = builtin
                    .derivative
                    .vjp(&Args { builtin, values: &values }, &made, by)
                    .expect(name);
                let zero = Adjoint::Zero;
                args.iter()
                    .enumerate()
                    .for_each(|(i, a)| a.vjp(pulled.get(i).unwrap_or(&zero), out));
            }
        }
    }

    fn names(&self, out: &mut HashSet<&'static str>) {
        if let Call(name, args) = self {
            out.insert(name);
            args.iter().for_each(|a| a.names(out));
        }
    }
}

/// Returns a result as lists of numbers, and whether it has single precision.
fn numbers(v: &Value) -> (Vec<Vec<f64>>, bool) {
    let points =
        |ps: &mut dyn Iterator<Item = DVec3>| ps.flat_map(|p| p.to_array()).collect::<Vec<f64>>();
    if let Some(s) = v.downcast::<SolidValue>() {
        let s = &s.0;
        return (
            vec![points(&mut s.landmarks().iter().map(|l| l.position)), points(&mut s.vertices())],
            true,
        );
    }
    if let Some(b) = v.downcast::<ArmatureValue>() {
        let b = &b.0;
        let rig = b.rig();
        let heads = points(&mut rig.joints().iter().map(|j| j.head));
        let tails = points(&mut rig.joints().iter().map(|j| j.tail));
        let keypoints = points(&mut rig.keypoints().iter().map(|k| k.rest));
        return (
            vec![heads, tails, keypoints, points(&mut b.positions().iter().map(|p| p.as_dvec3()))],
            true,
        );
    }
    if let Some(AffineValue(Affine(a))) = v.downcast() {
        return (vec![a.to_cols_array().to_vec()], false);
    }
    let mut all = Vec::new();
    mapped(v, &mut |x| {
        all.push(x);
        x
    });
    (vec![all], false)
}

/// A random adjoint of a result, in its shape.
fn shaped(v: &Value, next: &mut dyn FnMut() -> f64) -> Adjoint {
    match v {
        Value::Num(_) => Adjoint::Num(next()),
        Value::Array(xs) => Adjoint::Array(xs.iter().map(|_| next()).collect()),
        Value::List(xs) => Adjoint::List(xs.iter().map(|x| shaped(x, next)).collect()),
        Value::Object(_) => {
            let lists: Vec<Adjoint> = numbers(v)
                .0
                .iter()
                .map(|xs| Adjoint::Array(xs.iter().map(|_| next()).collect()))
                .collect();
            if v.downcast::<AffineValue>().is_some() {
                lists[0].clone()
            } else {
                Adjoint::List(lists)
            }
        }
        _ => panic!("{v} has no derivatives"),
    }
}

fn weights(v: &Value, by: &Adjoint) -> Vec<f64> {
    let lists = numbers(v).0;
    match (v, by) {
        (Value::Object(_), Adjoint::List(all)) => {
            all.iter().zip(&lists).flat_map(|(a, xs)| a.numbers(xs.len())).collect()
        }
        (Value::Object(_), by) => by.numbers(lists[0].len()),
        _ => {
            let mut out = Vec::new();
            flat(v, by, &mut out);
            out
        }
    }
}

fn check(what: &str, e: &E) {
    let mut seed = 7u64;
    let mut next = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 40) as f64 / (1u64 << 24) as f64 - 0.5
    };
    let made = e.value(&mut |x| x);
    let by = shaped(&made, &mut next);
    let weights = weights(&made, &by);
    let single = numbers(&made).1;
    let mut found = Vec::new();
    e.vjp(&by, &mut found);
    let at = |k: usize, h: f64| -> f64 {
        let mut i = 0;
        let moved = e.value(&mut |x| {
            i += 1;
            if i - 1 == k { x + h } else { x }
        });
        numbers(&moved).0.iter().flatten().zip(&weights).map(|(x, w)| x * w).sum()
    };
    let (h, tolerance) = if single { (3e-3, 1e-4) } else { (1e-3, 1e-6) };
    let scale = weights.iter().map(|w| w * w).sum::<f64>().sqrt().max(1.0);
    assert!(!found.is_empty(), "{what}");
    for (k, found) in found.iter().enumerate() {
        // A fourth-order difference: its step can be wide enough for single precision.
        let slope =
            (8.0 * (at(k, h) - at(k, -h)) - (at(k, 2.0 * h) - at(k, -2.0 * h))) / (12.0 * h);
        assert!(
            (found - slope).abs() < tolerance * scale,
            "{what}, number {k}: {found} is not {slope}"
        );
    }
}

fn by(x: f64) -> E {
    By(num(x))
}

fn vector(xs: &[f64]) -> E {
    By(arr(xs))
}

fn record(fields: &[(&str, Value)]) -> Value {
    Value::record(fields.iter().cloned())
}

/// The shipped body.
fn body() -> Value {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/programs/std/human/");
    let read = |name: &str| std::fs::read(format!("{folder}{name}")).map_err(|e| e.to_string());
    let name = "human.lod2.rig.json";
    pcadlang_library::standard::table()
        .load("armature", name, &read(name).unwrap(), &Default::default(), &read)
        .unwrap()
}

/// Expressions that contain each function at least once.
fn cases() -> Vec<E> {
    let mut all = Vec::new();
    for name in [
        "exp",
        "expm1",
        "log",
        "log1p",
        "sqrt",
        "abs",
        "sin",
        "cos",
        "tan",
        "asin",
        "acos",
        "atan",
        "sinh",
        "cosh",
        "tanh",
        "deg",
        "logit",
        "expit",
        "erf",
        "erfc",
        "normal_cdf",
        "log_normal_cdf",
        "lgamma",
        "neg",
    ] {
        all.push(Call(name, vec![by(0.4)]));
        all.push(Call(name, vec![By(list(&[arr(&[0.3, 0.7]), num(0.2)]))]));
    }
    all.push(Call("log1m_exp", vec![by(-0.4)]));
    all.push(Call("log1m_exp", vec![Call("neg", vec![vector(&[0.1, 0.9, 30.0])])]));
    for name in ["+", "-", "*", "/", "%", "**", "pow", "atan2", "min", "max"] {
        all.push(Call(name, vec![by(1.3), by(0.7)]));
        all.push(Call(name, vec![vector(&[1.3, 0.4, 2.2]), vector(&[0.7, 0.6, 0.9])]));
        all.push(Call(name, vec![vector(&[1.3, 0.4]), by(0.6)]));
    }
    let xs = || vector(&[0.7, -0.4, 1.9, 0.2]);
    for name in [
        "sum",
        "prod",
        "mean",
        "var",
        "sd",
        "norm",
        "log_sum_exp",
        "cumsum",
        "reverse",
        "sort",
        "min",
        "max",
        "diag",
        "values",
    ] {
        all.push(Call(name, vec![xs()]));
    }
    let matrix = || By(list(&[arr(&[0.3, -0.8]), arr(&[1.2, 0.5]), arr(&[0.1, 0.9])]));
    let two = || By(list(&[arr(&[0.3, -0.8, 0.4]), arr(&[1.2, 0.5, 2.0])]));
    let whole = |n: f64| Fixed(num(n));
    let bools = Fixed(bools(&[true, false, true, false]));
    all.extend([
        Call("clamp", vec![vector(&[-0.3, 0.4, 2.0]), by(0.1), by(0.9)]),
        Call("require", vec![by(0.4), Fixed(Value::Bool(true)), Fixed(Value::str("never"))]),
        Call("dot", vec![xs(), vector(&[1.0, 0.3, -0.2, 0.6])]),
        Call("linspace", vec![by(0.3), by(1.7), whole(5.0)]),
        Call("range", vec![by(0.3), Fixed(num(2.1)), by(0.5)]),
        Call("fill", vec![by(0.3), whole(3.0)]),
        Call("concat", vec![xs(), vector(&[0.5]), By(list(&[num(0.4), num(2.0)]))]),
        Call("append", vec![xs(), by(0.8)]),
        Call("zip", vec![xs(), vector(&[1.0, 0.3, -0.2, 0.6])]),
        Call("select", vec![bools, xs(), by(0.4)]),
        Call(
            "interp",
            vec![
                vector(&[-1.0, 0.4, 1.7, 9.0]),
                vector(&[0.0, 1.0, 2.0]),
                vector(&[0.2, 0.9, -0.3]),
            ],
        ),
        Call("values", vec![By(record(&[("a", num(0.3)), ("b", num(0.7))]))]),
        Call("matmul", vec![matrix(), two()]),
        Call("matmul", vec![matrix(), vector(&[0.4, 0.2])]),
        Call("matmul", vec![vector(&[0.4, 0.2]), two()]),
        Call("transpose", vec![matrix()]),
        Call("diag", vec![matrix()]),
        Call("outer", vec![xs(), vector(&[0.4, 0.2])]),
    ]);
    let at = |x: f64| {
        Call(
            "scene.affine",
            vec![vector(&[x, 0.2, -0.4]), vector(&[0.3, -0.5, 0.8]), vector(&[0.9, 1.1, 1.3])],
        )
    };
    let ball = || Call("scene.sphere", vec![by(0.8), whole(8.0)]);
    let block = || Call("scene.box", vec![vector(&[0.6, 0.9, 1.4])]);
    let profile = |y: &[f64], r: Value| record(&[("y", arr(y)), ("r", r)]);
    let lower = || profile(&[-1.0, -0.4, 0.3], arr(&[0.5, 0.8, 0.6]));
    let upper = || profile(&[0.4, 1.2], num(0.3));
    let lathe = |parts: Value, thickness: f64, caps: &str| {
        Call("scene.lathe", vec![By(parts), whole(7.0), by(thickness), Fixed(caps.into())])
    };
    let tips = || By(record(&[("tip", arr(&[0.2, 1.0, 0.3])), ("toe", arr(&[0.1, -1.0, 0.4]))]));
    all.extend([
        at(0.1),
        Call("scene.affine", vec![vector(&[0.1, 0.2, 0.3]), by(0.4), by(1.2)]),
        Call("*", vec![at(0.1), at(0.5)]),
        Call(
            "*",
            vec![at(0.1), Call("*", vec![at(0.5), Call("scene.landmarks", vec![block(), tips()])])],
        ),
        ball(),
        block(),
        Call("scene.box", vec![by(0.7)]),
        lathe(lower(), 0.1, "bottom"),
        lathe(list(&[lower(), upper()]), 0.12, "both"),
        lathe(list(&[lower(), upper()]), 0.15, "none"),
        Call("scene.lathe", vec![By(lower()), whole(7.0), by(0.1), Fixed("both".into()), by(0.45)]),
        Call("scene.centred", vec![Call("*", vec![at(0.3), block()]), Fixed(false.into())]),
        Call("scene.centred", vec![Call("*", vec![at(0.3), ball()]), Fixed(true.into())]),
    ]);
    let pair = Call(
        "concat",
        vec![
            Call("fill", vec![ball(), whole(1.0)]),
            Call("fill", vec![Call("*", vec![at(0.4), block()]), whole(1.0)]),
        ],
    );
    all.push(Call("scene.group", vec![pair]));
    // Bodies: all ways of posing, and shapes and proportions together with poses.
    let rig = || Fixed(body());
    let turns: Vec<f64> = (0..66).map(|i| 0.5 * libm::sin(f64::from(i) * 1.3)).collect();
    let morphs = || By(record(&[("heavy", num(0.4)), ("thin", num(0.2))]));
    let factors = || {
        By(record(&[
            ("thigh_l", num(1.2)),
            ("calf_l", num(0.9)),
            ("upperarm_r", arr(&[1.1, 0.9, 1.3])),
        ]))
    };
    let reshaped =
        || Call("scene.stretched", vec![Call("scene.shaped", vec![rig(), morphs()]), factors()]);
    let joints = record(&[
        ("thigh_l", arr(&[0.3, -0.2, 0.5])),
        ("calf_l", record(&[("rotate", arr(&[0.4, 0.1, 0.2])), ("scale", num(1.1))])),
        ("hand_r", record(&[("location", arr(&[0.05, -0.03, 0.02]))])),
    ]);
    all.extend([
        Call("scene.shaped", vec![rig(), morphs()]),
        Call("scene.shaped", vec![rig(), morphs(), By(num(0.03))]),
        reshaped(),
        Call("scene.skin", vec![reshaped(), vector(&turns)]),
        Call("scene.skin", vec![rig(), By(joints)]),
    ]);
    all
}

#[test]
fn derivatives_are_those_of_differences() {
    let mut seen = HashSet::new();
    for e in cases() {
        let mut own = HashSet::new();
        e.names(&mut own);
        check(&format!("{own:?}"), &e);
        seen.extend(own);
    }
    let products = TABLE.iter().filter(|b| {
        matches!(b.kind, Kind::Function(_))
            && !matches!(b.derivative, Derivative::Unknown | Derivative::Zero)
    });
    for name in products.map(|b| b.full_name()).filter(|n| !ELSEWHERE.contains(&&**n)) {
        assert!(seen.contains(&*name), "the derivative of {name} is compared with nothing");
    }
}

#[test]
fn a_placed_joint_passes_its_derivative_to_its_placement() {
    let joint = |x: f64| {
        Call(
            "scene.affine",
            vec![vector(&[0.02, x, 0.01]), vector(&[0.3, -0.4, 0.2]), vector(&[1.1, 0.9, 1.2])],
        )
    };
    let pose = |n: usize| {
        Call(
            "concat",
            (0..n).map(|i| Call("fill", vec![joint(0.01 * i as f64), Fixed(num(1.0))])).collect(),
        )
    };
    check("placements", &Call("scene.skin", vec![Fixed(body()), pose(22)]));
}

#[test]
fn every_function_has_a_derivative_is_flat_or_is_listed() {
    let mut without: Vec<String> = Vec::new();
    for b in TABLE.iter().filter(|b| matches!(b.kind, Kind::Function(_))) {
        // Loaders of files are not used in expressions.
        if matches!(b.derivative, Derivative::Unknown) && b.section != "Data files" {
            without.push(b.full_name());
        }
    }
    without.sort();
    let listed: Vec<&str> = NONE.iter().map(|(name, _)| *name).collect();
    assert_eq!(without, listed);
}
