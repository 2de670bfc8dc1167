//! Gradients through traces compared with central differences of the log joint density in
//! unconstrained space: built-ins, distributions and their transforms, structure, scenes.

mod distributions;
mod scenes;

use crate::common::tape;
use pcadlang::Program;
use pcadlang_engine::trace::{Change, Draws, Selector, Target, Trace};
use pcadlang_numerics::rng::{Purpose, StreamKey};

fn draws() -> Draws {
    Draws { key: StreamKey::new(9, 0, Purpose::VALUES), step: 0, substream: 0 }
}

/// Returns the continuous choices with their unconstrained coordinates.
fn places(trace: &mut Trace) -> Vec<(Target, Vec<f64>)> {
    let selection = trace.select(&Selector::All);
    let all = trace.targets(selection).to_vec();
    let one = |t: Target| {
        let support = trace.dist(t)?.stored_support();
        let mut y = Vec::new();
        support.to_free(&trace.stored(t)?, &mut y);
        (!support.is_discrete() && !y.is_empty()).then_some((t, y))
    };
    all.into_iter().filter_map(one).collect()
}

/// Compares at several draws from the prior, slightly offset in case a draw is at a kink.
fn check(text: &str) {
    let model = Program::parse(text).unwrap().compile().unwrap_or_else(|e| panic!("{text}\n{e}"));
    for seed in 0..4 {
        let mut trace = model.simulate(seed, 0).unwrap_or_else(|e| panic!("{text}\n{e}"));
        compare(&mut trace, text);
        // White noise that moves with its prior, and supports that move with their
        // bounds, are not on the tape: these are left to the trace.
        let stays =
            ["whitened", "f ~ gp(", "uniform(a", "uniform(u", "half_cauchy(a", "a - s", "lo = a"];
        let noise =
            text.contains("gp(") && !text.contains("centred") && text.contains("assume x ~ ");
        let told = tape::compare_tape(&mut trace, text);
        assert!(
            told.points > 0 || noise || stays.iter().any(|s| text.contains(s)),
            "{text}: {told:?}"
        );
    }
}

fn compare(trace: &mut Trace, text: &str) {
    let places = places(trace);
    assert!(!places.is_empty(), "{text}: nothing to differentiate by");
    let targets: Vec<Target> = places.iter().map(|p| p.0).collect();
    let mut found = Vec::new();
    trace.gradient(&targets, 1.0, &mut found).unwrap_or_else(|e| panic!("{text}\n{e}"));
    let flat: Vec<f64> = places.iter().flat_map(|p| p.1.iter().copied()).collect();
    assert_eq!(found.len(), flat.len(), "{text}");
    let mut at = |y: &[f64]| {
        let mut from = 0;
        let mut changes = Vec::new();
        for (t, own) in &places {
            changes.push((*t, Change::Free(y[from..from + own.len()].to_vec())));
            from += own.len();
        }
        let w = trace.propose(&changes, draws()).unwrap_or_else(|e| panic!("{text}\n{e}"));
        trace.rollback();
        w.log_joint + w.log_jacobian
    };
    for i in 0..flat.len() {
        let mut slope = |h: f64| {
            let (mut up, mut down) = (flat.clone(), flat.clone());
            up[i] += h;
            down[i] -= h;
            (at(&up) - at(&down)) / (2.0 * h)
        };
        // Two step widths: rounding errors affect the small one, curvature the large one.
        let slopes = [slope(1e-5), slope(1e-4)];
        let scale = 1.0 + found[i].abs();
        let off = slopes.iter().map(|s| (s - found[i]).abs()).fold(f64::INFINITY, f64::min);
        assert!(off < 2e-5 * scale, "{text}\ncoordinate {i}: {} is not {slopes:?}", found[i]);
    }
}

#[test]
fn functions_of_numbers() {
    for f in [
        "exp(x)",
        "expm1(x)",
        "log(2 + x * x)",
        "log1p(x * x)",
        "sqrt(1 + x * x)",
        "pow(2 + abs(x), y)",
        "(3 + abs(x)) ** y",
        "abs(x) * y",
        "sign(x) + y",
        "floor(x) + y",
        "x % 3.7",
        "sin(x) * y",
        "cos(x)",
        "tan(x / 4)",
        "asin(tanh(x))",
        "acos(tanh(x) / 2)",
        "atan(x)",
        "atan2(y, x)",
        "sinh(x)",
        "cosh(x)",
        "tanh(x)",
        "deg(x)",
        "logit(expit(x) / 2 + 0.2)",
        "expit(x)",
        "erf(x)",
        "lgamma(2 + abs(x))",
        "min(x, y)",
        "max(x, y, 0.3)",
        "clamp(x, -0.5, y + 2)",
        "-x / (4 + y * y)",
        "x - y",
        "step(x) * y + x",
    ] {
        check(&format!(
            "assume x ~ normal(0.3, 1); assume y ~ normal(-0.2, 1); factor(-(({f}) - 0.5) ** 2);"
        ));
    }
}

#[test]
fn functions_of_arrays() {
    for f in [
        "sum(z)",
        "prod(z)",
        "mean(z * z)",
        "var(z)",
        "sd(z)",
        "norm(z)",
        "log_sum_exp(z)",
        "sum(cumsum(z) ** 2)",
        "dot(z, [1, 2, 3, 4])",
        "dot(z, z)",
        "sum(linspace(z[0], z[1], 5) ** 2)",
        "sum(range(z[0], z[0] + 2.05, 0.5) ** 2)",
        "sum(fill(z[0], 3) ** 2)",
        "sum(concat(z, [x], z) ** 3)",
        "sum(append(z, x) ** 2 * [1, 2, 3, 4, 5])",
        "dot(reverse(z), [1, 2, 3, 4])",
        "dot(sort(z), [1, 2, 3, 4])",
        "sum(sum_pairs(zip(z, reverse(z))))",
        "sum(values({ a: x, b: x * 2 }) ** 2)",
        "sum(select(z > 0, z ** 2, x))",
        "interp(x, [-9, 0, 9], [1, 4, 2])",
        "sum(interp([0.2, 0.7], [0, 0.5, 1], [x, z[0], z[1]]) ** 2)",
        "min(z)",
        "max(z)",
        "z[argmax(z)]",
        "len(z) * x",
        "sum(z[[0, 0, 3]] ** 2)",
        "sum(matmul([[1, 2], [3, 4]], [z[0], x]) ** 2)",
        "sum(matmul([[z[0], x], [3, z[1]]], [z[2], x]) ** 2)",
        "matmul([z[0], x], [z[1], 2])",
        "sum(rows(matmul([[z[0], x], [1, 2]], [[2, z[1]], [x, 1]])))",
        "sum(matmul([x, z[1]], [[1, z[0]], [2, 1]]) ** 2)",
        "sum(transpose([[z[0], 2], [x, 3]])[0] ** 2)",
        "sum(diag([x, z[0]])[1])",
        "sum(diag([[x, 1], [2, z[0]]]) ** 2)",
        "sum(outer(z, [1, x])[2] ** 2)",
        "sum(-z / 3 + z * x)",
    ] {
        check(&format!(
            "fn rows(m) {{ [sum(m[0]), 2 * sum(m[1])] }}
             fn sum_pairs(ps) {{ let a = ps[0]; let b = ps[1]; [a[0] * a[1], b[0] * b[1] ** 2] }}
             assume x ~ normal(0.3, 1); assume z ~ iid(normal(0.1, 1), 4); factor(-(({f}) - 0.5) ** 2 / 8);"
        ));
    }
}

#[test]
fn structure_passes_derivatives_through() {
    for p in [
        "fn line(a, b = 2) { a * 3 + b } assume x ~ normal(0, 1); factor(-line(x) ** 2 / 9 + line(b = x, a = 1));",
        "assume x ~ normal(0, 1); assume c ~ flip(0.5); let y = if c { x ** 2 } else { x ** 3 }; observe normal(y, 1) = 0.3;",
        "assume x ~ normal(0, 1); for i in 0 .. 3 { e[i] ~ normal(x * i, 1); } observe normal(e[0] + e[2] ** 2, 1) = 0.5;",
        "assume x ~ normal(0, 1); for i in 0 .. 3 { e[i] ~ normal(x, 1); } observe normal(sum(e), 1) = 0.5; factor(-norm(e));",
        "assume x ~ iid(normal(0, 1), 3); let y = map(fn(a) { a ** 2 + x[0] }, x); observe normal(y, 1) = [0.5, 1, 2];",
        "assume x ~ iid(normal(0, 1), 3); let y = fold(fn(s, a) { s * 0.5 + sin(a) }, x[1], x); observe normal(y, 0.5) = 1;",
        "assume x ~ normal(0, 1); let r = { a: x, b: [x * 2, 1] }; observe normal(r.a * r.b[0], 1) = 0.5;",
        "let f = mem(fn(i) { z ~ normal(i, 1); z }); observe normal(f(1) * f(2) + f(1), 1) = 2;",
        "fn walk(n) { if n == 0 { 0.5 } else { s ~ normal(walk(n - 1), 1); s } } observe normal(walk(4), 0.5) = 2;",
        "assume x ~ normal(0, 1); for i in 0 .. 3 { observe normal(x * i, 1 + x ** 2) = i; }",
        "assume u ~ uniform(0, 2); assume v ~ uniform(u, u + 3); assume w ~ uniform(0, v); observe normal(w, 0.3) = 1;",
        "assume x ~ iid(normal(0, 1), 3); factor(sum(map(exp, x)) * -0.2);",
        "assume x ~ normal(0, 1); let r = map(sin, { a: x, b: x ** 2 }); observe normal(r.a * r.b, 1) = 0.5;",
        "for i in 0 .. 3 { x[i] ~ normal(0, 1); } observe normal(sum(map(cos, x)), 1) = 0.5;",
        "assume x ~ normal(0, 1); fn twice(f, a, b) { f(f(a, b), y = b) } factor(-twice(pow, 1.2 + x * x, 0.3 + x));",
        "assume x ~ normal(0, 1); let ds = map(exponential, [1 + x ** 2, 2]); observe ds[0] = 0.4; observe ds[1] = 0.3;",
    ] {
        check(p);
    }
}

/// Several elements of a loop's choices at once.
#[test]
fn elements_picked_by_an_array() {
    let text = "for i in 0 .. 3 { w[i] ~ normal(i, 1); } observe normal(w[[2, 0]], 0.5) = [1, -2];";
    let model = Program::parse(text).unwrap().compile().unwrap_or_else(|e| panic!("{text}\n{e}"));
    compare(&mut model.simulate(1, 0).unwrap(), text);
}

#[test]
fn what_has_no_derivative_says_so() {
    let text = "assume l ~ gamma(3, 2); let d = iid(gp(mean = 0, cov = sq_exp(l), at = [0, 1]), 2); observe d = [[0.3, 0.4], [0, 1]];";
    let model = Program::parse(text).unwrap().compile().unwrap();
    let mut trace = model.simulate(1, 0).unwrap();
    let selection = trace.select(&Selector::All);
    let targets = trace.targets(selection).to_vec();
    let e = trace.gradient(&targets, 1.0, &mut Vec::new()).unwrap_err();
    assert!(e.message.contains("`gp`, as a function of its argument `cov`,"), "{}", e.message);
}

#[test]
fn definite_matrices() {
    let m = "[[2 + s, a, 0.3 * a], [a, 2 + a * a, s / 3], [0.3 * a, s / 3, 1.5 + s]]";
    for f in [
        "logdet(m)",
        "sum(cholesky(m)[2] * [1, 2, 3]) + cholesky(m)[1][0]",
        "dot(solve(m, [s, 1, a]), [1, 2, 3])",
        "sum(solve(m, [[s, 1], [1, a], [0.3, 2]])[1] * [2, -1])",
        "log_density(mv_normal([a, 0, 1], chol = cholesky(m)), [0.3, 0.4, s])",
        "dot([a, s, 1], solve(m, [a, s, 1])) + logdet(m)",
    ] {
        check(&format!(
            "assume a ~ normal(0.1, 0.3); assume s ~ gamma(9, 9); let m = {m}; factor(-(({f}) - 0.5) ** 2 / 8);"
        ));
    }
}
