//! Gradients through traces compared with central differences of the log joint density in
//! unconstrained space: built-ins, distributions and their transforms, structure, scenes.

#[path = "common/tape.rs"]
mod tape;

use pcadlang::Program;
use pcadlang::dist::Datum;
use pcadlang::lang::value::Value;
use pcadlang::render::Camera;
use pcadlang::rng::{Purpose, StreamKey};
use pcadlang::scene::{DepthValue, ImageValue, MaskValue};
use pcadlang::trace::{Change, Draws, Selector, Target, Trace};
use pcadlang::vision::{ContourMap, DepthMap, Mask, Photo};

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
fn distributions_by_value_and_parameters() {
    for d in [
        "normal(a, s)",
        "lognormal(a, s)",
        "student_t(3 + s, a, s)",
        "cauchy(a, s)",
        "laplace(a, s)",
        "von_mises(a, s)",
        "gamma(s, s + 1)",
        "inv_gamma(s, s)",
        "beta(s, s + 1)",
        "exponential(s)",
        "half_normal(s)",
        "half_cauchy(a, s)",
        "weibull(s, s + 1)",
        "uniform(a, a + s)",
        "truncated_normal(a, s, -1, 2)",
        "truncated_normal(a, s, a - s, a + 2 * s)",
        "truncated_normal(a, s, lo = a)",
        "mixture([0.3, s], [normal(a, 1), normal(0, s)])",
    ] {
        check(&format!(
            "assume a ~ normal(0.3, 1); assume s ~ gamma(3, 2); assume v ~ {d}; observe normal(v, 0.7) = 0.4;"
        ));
    }
    for (d, seen) in [
        ("normal(a, s)", "0.7"),
        ("normal(a, s)", "[0.7, 1.1, -0.4]"),
        ("normal([a, 2 * a, s], s)", "[0.7, 1.1, -0.4]"),
        ("iid(normal(a, s), 3)", "[0.7, 1.1, -0.4]"),
        ("student_t(4, a, s)", "[1, 2]"),
        ("poisson(s)", "3"),
        ("binomial(7, expit(a))", "3"),
        ("flip(expit(a))", "true"),
        ("neg_binomial(s, expit(a))", "2"),
        ("geometric(expit(a))", "4"),
        ("categorical([s, 1, s * s])", "2"),
        ("multinomial(4, [s, 1, 2])", "[1, 2, 1]"),
        ("mv_normal([a, s], cov = [[2, 0.3], [0.3, 1]])", "[0.2, 0.4]"),
        ("dirichlet([s, 1, 2])", "[0.2, 0.3, 0.5]"),
        ("mixture([s, 1], [normal(a, s), normal(2, 1)])", "[0.3, 0.9]"),
        ("normal(0, s)", "a * 2 + 1"),
    ] {
        check(&format!("assume a ~ normal(0.3, 1); assume s ~ gamma(3, 2); observe {d} = {seen};"));
    }
}

#[test]
fn vectors_and_constrained_choices() {
    for p in [
        "assume v ~ mv_normal([0, 1], chol = [[1, 0], [0.5, 2]]); factor(-(v[0] * v[1]) ** 2);",
        "assume v ~ mv_normal([0, 1], chol = [[1, 0], [0.5, 2]], whitened = true); factor(-(v[0] * v[1]) ** 2);",
        "assume m ~ normal(0, 1); assume v ~ mv_normal([m, m ** 2], chol = [[1, 0], [0.5, 2]], whitened = true);
         observe normal(v, 0.5) = [0.3, 0.8];",
        "assume m ~ normal(0, 1); assume f ~ gp(mean = m, cov = sq_exp(1), at = [0, 0.5, 2]); observe normal(f, 0.3) = [1, 2, 0];",
        "assume f ~ gp(mean = 0, cov = matern32(1), at = [0, 1, 2], centred = true); observe normal(f, 0.3) = [1, 2, 0];",
        "assume p ~ dirichlet([2, 1, 3]); observe categorical(p) = 1; factor(-p[0] ** 2);",
        "assume c ~ ordered(normal(0, 2), 3); observe normal(c, 1) = [0, 1, 1];",
        "assume l ~ lkj(2, 1.5); factor(-l[1][0] ** 2);",
        "assume w ~ iid(gamma(2, 1), 3); observe poisson(w) = [2, 0, 4];",
    ] {
        check(p);
    }
}

#[test]
fn covariances() {
    let at = "[0, 0.4, 1.1, 2, 2.3]";
    for cov in [
        "sq_exp(l, s)",
        "matern32(l, s)",
        "matern52(l, s)",
        "periodic(1.7 + l, 1, s)",
        "sq_exp(l, s) + white(0.3 + s)",
        "sq_exp(2, s) * periodic(1.3, l)",
    ] {
        for choice in [
            format!(
                "assume f ~ gp(mean = m, cov = {cov}, at = {at}); observe normal(f, 0.3) = [1, 2, 0, 1, 1];"
            ),
            format!("observe gp(mean = m, cov = {cov} + white(0.2), at = {at}) = [1, 2, 0, 1, 1];"),
            format!(
                "assume f ~ gp(mean = m, cov = {cov} + white(0.2), at = {at}, centred = true); observe normal(f, 0.3) = [1, 2, 0, 1, 1];"
            ),
        ] {
            check(&format!(
                "assume l ~ gamma(9, 9); assume s ~ gamma(9, 9); assume m ~ normal(0, 1); {choice}"
            ));
        }
    }
    for p in [
        "assume r ~ uniform(-0.8, 0.8); observe mv_normal([0, 1], cov = [[1, r], [r, 2]]) = [0.3, 0.2];",
        "assume r ~ gamma(5, 5); assume q ~ normal(0, 1); observe mv_normal([q, 1], chol = [[r, 0], [q, 2]]) = [0.3, 0.2];",
        "assume l ~ lkj(3, 2); observe mv_normal([0, 1, 0], chol = l) = [0.3, 0.2, 1];",
        "assume r ~ gamma(5, 5); assume v ~ mv_normal([0, 1], chol = [[r, 0], [0.3, r * r]], whitened = true);
         observe normal(v, 0.4) = [1, 0];",
    ] {
        check(p);
    }
}

/// Distributions that are values, both drawn from and observed, by the parameters of
/// their covariance.
#[test]
fn covariances_of_distributions_as_values() {
    let of = "assume l ~ gamma(9, 9); assume s ~ gamma(9, 9); assume m ~ normal(0, 1); assume r ~ uniform(-0.8, 0.8);";
    let gp = "gp(mean = m, cov = sq_exp(l, s) + white(0.3), at = [0, 0.4, 1.1])";
    let chol = "mv_normal([m, 1, 0], chol = [[s, 0, 0], [r, l, 0], [m, 0.2, 1]])";
    let cov = "mv_normal([m, 1, 0], cov = [[2, r, 0], [r, 1 + s, m / 9], [0, m / 9, 1 + l]])";
    for d in [gp, chol, cov, "gp(0, sq_exp(l), [0, 1, 2])"] {
        for p in [
            format!("let d = {d}; observe d = [0.3, 0.4, 1];"),
            format!("let d = {d}; assume x ~ d; observe normal(x, 0.5) = [1, 2, 0];"),
            format!(
                "assume c ~ flip(0.5); let d = if c {{ {d} }} else {{ iid(normal(m, s), 3) }}; observe d = [1, 2, 0];"
            ),
            format!(
                "fn make(a) {{ a }} let d = make({d}); assume x ~ d; observe d = [1, 2, 0]; observe normal(x, 1) = [1, 1, 0];"
            ),
        ] {
            check(&format!("{of} {p}"));
        }
    }
    for d in [chol, cov] {
        let whitened = d.replace("mv_normal(", "mv_normal(whitened = true, mean = ");
        check(&format!(
            "{of} let d = {whitened}; assume x ~ d; observe normal(x, 0.5) = [1, 2, 0];"
        ));
    }
    check(&format!(
        "{of} assume x ~ {}; observe normal(x, 0.5) = [1, 2, 0];",
        gp.replace("gp(", "gp(centred = true, ")
    ));
    check(&format!(
        "{of} let ds = [{gp}, {chol}]; observe ds[1] = [1, 2, 0]; observe ds[0] = [0.1, 0.2, 1.1];"
    ));
}

#[test]
fn wishart_by_its_scale() {
    let of = "assume a ~ gamma(9, 9); assume b ~ normal(0, 1);";
    let scale = "[[a, 0, 0], [b, 1 + a, 0], [0.3 * b, a * b, 0.7]]";
    for p in [
        format!("assume w ~ wishart(4.5, {scale}); observe normal(w[1][0] + w[2][2], 1) = 0.5;"),
        format!(
            "let d = wishart(3 + a, {scale}); assume w ~ d; observe mv_normal([0, b, 1], chol = w) = [0.3, 0.1, 1];"
        ),
        format!("observe wishart(4 + a, {scale}) = [[1, 0, 0], [0.4, 1.2, 0], [-0.3, 0.1, 0.5]];"),
        "observe wishart(2 + a, [[a]]) = [[0.8]];".to_owned(),
    ] {
        check(&format!("{of} {p}"));
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
fn bodies_with_detected_joints() {
    let keypoints = r#"{ "nose": [120, 40, 0.9], "l_shoulder": [150, 90, 1], "r_elbow": [80, 130, 0.7], "l_knee": [140, 190],
                        "r_ankle": [100, 240, 0.8], "l_wrist": [180, 120, 0.9] }"#;
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    let file = folder.join("gradient-keypoints.json");
    std::fs::write(&file, keypoints).unwrap();
    let text = r#"
        include "std/scene.pcad" as scene;
        data body = armature("std/human/human.lod2.rig.json");
        data points = keypoints();
        assume pose ~ iid(normal(0, 0.3), 66);
        assume build ~ normal(0, 1);
        assume person = scene.shaped(body, { heavy: max(build, 0), thin: max(-build, 0) });
        assume x ~ normal(0, 0.5);
        assume s ~ lognormal(0.7, 0.2);
        assume turn ~ iid(normal(0, 0.4), 3);
        let place = scene.affine(translate = [x, 0.1, 0], rotate = turn, scale = s) * scene.affine(translate = [0, -0.9, 0]);
        let view = scene.render(place * scene.skin(person, pose));
        observe scene.keypoints(view, sd = 4, outlier = 0.1) = points as joints;
        observe scene.relative_depth(view, s, share = 0.7, sd = 0.2, outlier = 0.2)
          = { nose: [0, 0, -0.2], l_wrist: [0.1, 0.4, 0.3], l_knee: [0, 0, -0.3], r_hip: [0, 0, 0.1] } as depths;"#;
    let model = Program::parse(text)
        .unwrap()
        .observe_file("points", file.to_str().unwrap())
        .unwrap()
        .compile()
        .unwrap();
    for seed in 0..3 {
        let mut trace = model.simulate(seed, 0).unwrap();
        compare(&mut trace, "a body");
    }
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

fn find(trace: &Trace, name: &str) -> Option<Target> {
    trace
        .choices()
        .iter()
        .find(|c| c.0.to_string() == format!("@{name}"))
        .and_then(|c| trace.find(&c.0))
}

/// A contour map of a disc, 64 pixels wide.
fn disc() -> ImageValue {
    let mut map = ContourMap::new(64, 64);
    for i in 0..150 {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 150.0).sin_cos();
        map.x.push((34.0 + 15.0 * cos) as f32);
        map.y.push((30.0 + 15.0 * sin) as f32);
        map.tx.push(-sin as f32);
        map.ty.push(cos as f32);
        map.strength.push(1.0);
    }
    ImageValue::contours(map, None)
}

/// Whether a pixel of a picture 256 pixels wide is in the disc.
fn inside(i: u32) -> bool {
    let (x, y) = (f64::from(i % 256) + 0.5, f64::from(i / 256) + 0.5);
    (x / 4.0 - 34.0).hypot(y / 4.0 - 30.0) < 15.0
}

fn mask() -> Value {
    let mask = Mask::new(256, 256, (0..256 * 256).map(inside).collect()).unwrap();
    Value::object(MaskValue::new(mask))
}

fn depth() -> Value {
    let depth = (0..256 * 256)
        .map(|i| if inside(i) { 7.0 + i as f32 * 1e-5 } else { f32::INFINITY })
        .collect();
    Value::object(DepthValue::new(DepthMap::new(256, 256, depth).unwrap()))
}

fn photo() -> Value {
    let colour = |x: u32, y: u32| {
        let noise = (x * 7919 + y * 104_729 + x * y) % 97;
        let base = if inside(y * 256 + x) { [150, 60, 50] } else { [70, 110, 140] };
        image::Rgb(base.map(|b: u32| (b + noise) as u8))
    };
    Value::object(ImageValue::photo(
        Photo::from_rgb(image::RgbImage::from_fn(256, 256, colour)).unwrap(),
    ))
}

#[test]
fn pictures_pull_where_their_score_rises() {
    // Differences over half a pixel, since sums over pieces and pixels change in small
    // steps.
    let half = 0.5 * 4.4 / 64.0;
    for (likelihood, seen) in [
        ("scene.chamfer(view, sigma = s, size = 64)", Value::object(disc())),
        ("scene.chamfer(rough, sigma = s, size = 64)", Value::object(disc())),
        (
            "scene.chamfer(view, sigma = s, size = 64, mode = \"sum\", symmetric = true)",
            Value::object(disc()),
        ),
        ("scene.contour(view, size = 64, sd = 2, truncate = 9)", Value::object(disc())),
        ("scene.mask(view, size = 256)", mask()),
        ("scene.depth(view, size = 256, sd = 0.5)", depth()),
        ("scene.region(view, size = 256)", photo()),
    ] {
        let kind = match likelihood {
            l if l.starts_with("scene.mask") => "mask",
            l if l.starts_with("scene.depth") => "depth",
            _ => "image",
        };
        let text = format!(
            "include \"std/scene.pcad\" as scene; data photo: {kind};
             assume x ~ uniform(-1, 1); assume y ~ uniform(-1, 1); assume t ~ uniform(-3, 3); assume r ~ uniform(0, 2);
             assume s ~ uniform(0, 20);
             let h = linspace(-1, 1, 12);
             let vase = scene.lathe({{ y: r * h, r: r * (0.6 + 0.25 * sin(2.5 * h)) }});
             let solid = scene.centred(scene.group([vase, scene.affine(translate = [0, 2 * r, 0]) * scene.sphere(0.2)]));
             let placed = scene.affine(translate = [x, y, 0], rotate = [t, 0.2, 0.4]) * solid;
             let view = scene.render(placed); let rough = scene.render(placed, detail = 0.3);
             observe {likelihood} = photo as picture;"
        );
        let program = Program::parse(&text).unwrap().observe("photo", seen);
        let model =
            program.camera(Camera::default_for(64, 64)).compile().unwrap_or_else(|e| panic!("{e}"));
        let mut trace = model.simulate(1, 0).unwrap();
        let at = |trace: &mut Trace, values: &[(&str, f64)]| {
            let set =
                |(name, v): &(&str, f64)| Some((find(trace, name)?, Change::Set(Datum::Num(*v))));
            let changes: Vec<(Target, Change)> = values.iter().filter_map(set).collect();
            trace.propose(&changes, draws()).unwrap();
            trace.commit();
            trace.log_likelihood()
        };
        let mut here = [("x", 0.2), ("y", -0.1), ("t", 0.5), ("r", 0.8), ("s", 4.0)];
        at(&mut trace, &here);
        // If no observation depends on it, s does not exist.
        let targets: Vec<Target> = here.iter().filter_map(|(name, _)| find(&trace, name)).collect();
        let (mut all, mut prior) = (Vec::new(), Vec::new());
        trace
            .gradient(&targets, 1.0, &mut all)
            .unwrap_or_else(|e| panic!("{likelihood}: {}", e.message));
        trace.gradient(&targets, 0.0, &mut prior).unwrap();
        let (mut dot, mut found, mut slopes) = (0.0, 0.0, 0.0);
        for k in 0..targets.len() {
            let mut score = |h: f64| {
                here[k].1 += h;
                let score = at(&mut trace, &here);
                here[k].1 -= h;
                score
            };
            let slope = score(half) - score(-half);
            at(&mut trace, &here);
            // Differentiates by the coordinate itself, not the unconstrained one: x = lo
            // + (hi - lo) expit(y).
            let (lo, hi) = match here[k].0 {
                "t" => (-3.0, 3.0),
                "r" => (0.0, 2.0),
                "s" => (0.0, 20.0),
                _ => (-1.0, 1.0),
            };
            let share = (here[k].1 - lo) / (hi - lo);
            let g = (all[k] - prior[k]) / ((hi - lo) * share * (1.0 - share)) * 2.0 * half;
            dot += g * slope;
            found += g * g;
            slopes += slope * slope;
        }
        let cosine = dot / (found * slopes).sqrt();
        let ratio = (found / slopes).sqrt();
        // Pixels are either inside or outside, so their sums change in steps.
        let least = if likelihood.contains("256") { 0.95 } else { 0.98 };
        assert!(
            cosine > least && (0.8..1.25).contains(&ratio),
            "{likelihood}: cosine {cosine}, length {ratio}"
        );
    }
}

/// Densities as values, differentiated by their argument and by the distribution's
/// parameters.
#[test]
fn log_densities() {
    let of = "assume a ~ normal(0.3, 1); assume s ~ gamma(9, 9); assume m ~ normal(0, 1);";
    for f in [
        "log_density(normal(a, s), m)",
        "log_density(normal(a, s), [0.3, m, 2 * a])",
        "log_density(normal([a, m], s), [0.3, 1])",
        "log_density(iid(gamma(2, s), 2), [0.3, s])",
        "log_density(poisson(s), 3)",
        "log_density(flip(expit(a)), true)",
        "log_density(mixture([s, 1], [normal(a, 1), normal(0, s)]), m)",
        "log_density(mv_normal([a, m], cov = [[1 + s, 0.3], [0.3, 1]]), [m, 0.5])",
        "log_density(gp(m, sq_exp(s) + white(0.3), [0, 0.5, 2]), [a, 1, 0.2])",
        "log_density(truncated(gamma(2, s), lo = 0.2), 0.9 + s)",
        "log_sum_exp([log(0.3) + log_density(normal(a, s), m), log(0.7) + log_density(cauchy(0, s), m)])",
        "log_sum_exp([log_density(gamma(2, s), -1), log_density(normal(a, s), m)])",
    ] {
        check(&format!("{of} factor({f} / 4);"));
    }
}

#[test]
fn truncated_and_flat() {
    let of = "assume a ~ normal(0.3, 1); assume s ~ gamma(9, 9);";
    for d in [
        "truncated(normal(a, s), lo = 0)",
        "truncated(normal(a, s), hi = 1)",
        "truncated(normal(a, s), -1, 2)",
        "truncated(student_t(4, a, s), hi = 1)",
        "truncated(gamma(2, s), 0.3, 2)",
        "truncated(lognormal(a, s), lo = 0.4)",
        "truncated(exponential(s), lo = 0)",
        "truncated(mixture([s, 1], [normal(a, 1), normal(0, s)]), lo = 0.4)",
        "flat(lo = 0)",
        "flat(hi = 3)",
    ] {
        check(&format!("{of} assume v ~ {d}; observe normal(v, 0.7) = 0.4;"));
    }
    for (d, seen) in [
        ("truncated(poisson(s), lo = 1)", "[3, 1]"),
        ("truncated(poisson(s), lo = 1, hi = 200)", "[3, 1]"),
        ("truncated(binomial(9, expit(a)), 1, 7)", "2"),
        ("truncated(normal([a, 0, s], s), hi = 1.5)", "[0.3, 0.8, 1]"),
        ("truncated(gamma([2, s, 3], s), [0.1, 0.2, 0.3], 5)", "[0.3, 0.8, 1]"),
        ("truncated(gamma(2, s), lo = [0.1, 0.2, 0.3])", "[0.3, 0.8, 1]"),
        ("truncated(iid(weibull(1.4, s), 3), lo = 0.1)", "[0.3, 0.8, 1]"),
    ] {
        check(&format!("{of} observe {d} = {seen};"));
    }
    // Values move with their bounds.
    for d in [
        "truncated_normal(0.3, s, hi = a)",
        "truncated(normal(0.3, s), hi = a)",
        "truncated(cauchy(0.3, s), lo = a)",
        "flat(lo = a)",
        "flat(hi = a)",
    ] {
        let told = format!(
            "{of} assume v ~ {d}; observe normal(v, 0.7) = 0.4; factor(-(a - s * 0) ** 2);"
        );
        check(&told);
    }
    check(&format!(
        "{of} assume c ~ ordered([normal(a, s), gamma(2, s), normal(3, 1)]); observe normal(c, 1) = [0, 1, 3];"
    ));
    check(&format!("{of} assume c ~ ordered(normal(a, s), 3); observe normal(c, 1) = [0, 1, 3];"));
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
