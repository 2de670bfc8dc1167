//! Kernels declared in programs, compared with exact answers: their proposals, auxiliary
//! variables and maps.

use crate::common::*;

/// A kernel declared in the program: the reverse density of its asymmetric proposal is
/// computed by replay.
#[test]
fn proposals_of_the_program_are_paid_for() {
    let d = run(
        "assume x ~ normal(0, 1); observe normal(x, 0.5) = 2;
         kernel pull(s) { let here = value(@x); propose @x ~ normal(0.7 * here + 1, s); }
         infer { warmup 1000 { pull(0.8); } repeat 60000 { pull(0.8); collect x; } }",
        1,
        2,
    );
    assert_mean("own kernel", &d["x"], 1.6, 0.06);
    let squares: Vec<f64> = d["x"].iter().map(|x| (x - 1.6) * (x - 1.6)).collect();
    assert_mean("own kernel, variance", &squares, 0.2, 0.03);
}

/// The same for proposals that read a parameter or call a function of the program.
#[test]
fn proposals_of_the_program_read_its_names() {
    for proposal in ["normal(0.7 * value(@x) + 1, s)", "normal(pulled(value(@x)), s)"] {
        let text = format!(
            "param s = 0.8; fn pulled(x) {{ 0.7 * x + 1 }}
             assume x ~ normal(0, 1); observe normal(x, 0.5) = 2;
             kernel pull() {{ propose @x ~ {proposal}; }}
             infer {{ warmup 1000 {{ pull(); }} repeat 60000 {{ pull(); collect x; }} }}"
        );
        assert_mean(proposal, &run(&text, 1, 2)["x"], 1.6, 0.06);
    }
}

/// The same while observations wait, also where the way back reads the new state: it is then
/// made, and undone with what waits.
#[test]
fn proposals_of_the_program_are_paid_for_in_stages() {
    for here in ["value(@x)", "value(@x) + none", "x"] {
        let text = format!(
            "let none = sum([1, -1]); assume x ~ normal(0, 1); observe normal(x, sqrt(0.75)) = 2;
             observe normal(x, sqrt(0.75)) = 2 with coarse = flat() as y;
             observe normal(x, sqrt(0.75)) = 2 with coarse = flat() as z;
             kernel pull() {{ let here = {here}; propose @x ~ normal(0.7 * here + 1, 0.8); }}
             kernel moves() {{ delayed(pull(), at = @y, then = @z); }}
             infer {{ warmup 1000 {{ moves(); }} repeat 60000 {{ moves(); collect x; }} }}"
        );
        let d = run(&text, 1, 2);
        assert_mean(here, &d["x"], 1.6, 0.06);
        let squares: Vec<f64> = d["x"].iter().map(|x| (x - 1.6) * (x - 1.6)).collect();
        assert_mean(&format!("{here}, variance"), &squares, 0.2, 0.03);
    }
}

/// The same for a choice with which others appear and vanish, and for several choices at
/// computed addresses.
#[test]
fn proposals_of_the_program_change_structure() {
    let d = run(
        "assume c ~ flip(0.4); assume a ~ normal(0, 1);
         assume x = if c { a + 1 } else { d ~ normal(0, 1); a + d - 1 };
         for i in 0 .. 2 { w[i] ~ normal(0, 1); }
         observe normal(x + w[0] + w[1], 1) = 0.5;
         kernel turn() { propose @c ~ flip(0.5); }
         kernel shift() { let here = value(@a); propose @a ~ normal(0.5 * here, 1); }
         kernel both() { for i in 0 .. 2 { let here = value(@w[{i}]); propose @w[{i}] ~ normal(0.5 * here, 0.8); } }
         infer { repeat 60000 { turn(); shift(); both(); mh(one($continuous)); collect c; } }",
        1,
        2,
    );
    let (yes, no) = (0.4 * normal_pdf(0.5, 1.0, 2.0), 0.6 * normal_pdf(0.5, -1.0, 5f64.sqrt()));
    assert_mean("c", &d["c"], yes / (yes + no), 0.03);
}

/// Deterministic maps of choices: with a Jacobian that is not 1, of a switch with which
/// choices appear, and of a randomly selected element.
#[test]
fn maps_of_the_program_are_paid_for() {
    // All at once, and in three stages, of which the last one has the Jacobian.
    for scaled in ["scaled()", "delayed(scaled(), at = @y, then = @z)"] {
        let text = format!(
            "assume x ~ normal(0, 1); observe normal(x, sqrt(0.75)) = 2;
             observe normal(x, sqrt(0.75)) = 2 with coarse = flat() as y;
             observe normal(x, sqrt(0.75)) = 2 with coarse = flat() as z;
             kernel scaled() {{ propose u ~ lognormal(0, 0.5); propose @x = value(@x) * u; propose u = 1 / u; }}
             kernel shifted(s) {{ propose u ~ normal(0, s); propose @x = value(@x) + u; propose u = -u; }}
             infer {{ warmup 500 {{ shifted(0.5); }} repeat 40000 {{ {scaled}; shifted(0.5); collect x; }} }}"
        );
        let d = run(&text, 1, 2);
        assert_mean(scaled, &d["x"], 1.6, 0.06);
        let squares: Vec<f64> = d["x"].iter().map(|x| (x - 1.6) * (x - 1.6)).collect();
        assert_mean(&format!("{scaled}, variance"), &squares, 0.2, 0.03);
    }
    let d = run(
        "assume c ~ flip(0.4); assume a ~ normal(0, 1);
         assume x = if c { a + 1 } else { d ~ normal(0, 1); a + d - 1 };
         for i in 0 .. 2 { w[i] ~ normal(0, 1); }
         observe normal(x + w[0] + w[1], 1) = 0.5;
         kernel turn() { propose @c = not value(@c); }
         kernel mirror() { propose i ~ uniform_discrete(0, 1); propose @w[{i}] = 0.5 - value(@w[{i}]); }
         infer { repeat 60000 { turn(); mirror(); drift(one($continuous), scale = 1); collect c; } }",
        1,
        2,
    );
    let (yes, no) = (0.4 * normal_pdf(0.5, 1.0, 2.0), 0.6 * normal_pdf(0.5, -1.0, 5f64.sqrt()));
    assert_mean("c by maps", &d["c"], yes / (yes + no), 0.03);
}

/// Choices that are proposed together with a map, including a whitened vector, compared
/// with the exact posterior of a linear model.
#[test]
fn proposals_beside_a_map_are_paid_for() {
    let d = run(
        "assume s ~ normal(0, 1); assume f ~ gp(mean = 0, cov = sq_exp(1, 1), at = [0, 1]) #f;
         observe normal(s + f[0], 0.5) = 2; observe normal(s - f[1], 0.5) = 0.3;
         kernel swapped() {
           propose u ~ normal(0, 0.8);
           propose @s = value(@s) + u;
           propose @f ~ mv_normal(0.5 * value(@f) - u, cov = 0.3 * identity(2));
           propose u = -u;
         }
         infer { warmup 1000 { swapped(); drift(one(@**)); } repeat 90000 { swapped(); drift(one(@**)); collect s, f; } }",
        1,
        2,
    );
    // The prior covariance of (s, f0, f1), and two linear observations.
    let c = (-0.5f64).exp();
    let k = [[1.0, 0.0, 0.0], [0.0, 1.0, c], [0.0, c, 1.0]];
    let (h, y) = ([[1.0, 1.0, 0.0], [1.0, 0.0, -1.0]], [2.0, 0.3]);
    let kh = |i: usize, o: usize| (0..3).map(|j| k[i][j] * h[o][j]).sum::<f64>();
    let g = |o: usize, p: usize| {
        (0..3).map(|i| h[o][i] * kh(i, p)).sum::<f64>() + if o == p { 0.25 } else { 0.0 }
    };
    let det = g(0, 0) * g(1, 1) - g(0, 1) * g(1, 0);
    let w = [(g(1, 1) * y[0] - g(0, 1) * y[1]) / det, (g(0, 0) * y[1] - g(1, 0) * y[0]) / det];
    for (i, name) in ["s", "f[0]", "f[1]"].iter().enumerate() {
        assert_mean(name, &d[*name], kh(i, 0) * w[0] + kh(i, 1) * w[1], 0.06);
    }
    let v = |i: usize| {
        let [a, b] = [kh(i, 0), kh(i, 1)];
        k[i][i] - (a * a * g(1, 1) - 2.0 * a * b * g(0, 1) + b * b * g(0, 0)) / det
    };
    let mean = kh(0, 0) * w[0] + kh(0, 1) * w[1];
    let squares: Vec<f64> = d["s"].iter().map(|x| (x - mean) * (x - mean)).collect();
    assert_mean("variance of s", &squares, v(0), 0.06);
}

/// A map that is not an involution, or whose derivatives are unknown, ends the run with
/// the reason.
#[test]
fn maps_that_are_no_involutions_are_caught() {
    let wrong = [
        (
            "propose u ~ lognormal(0, 0.5); propose @x = value(@x) * u;",
            "applied twice, it takes @x from",
        ),
        (
            "propose u ~ normal(0, 1); propose @x = value(@x) + u; propose u = -2 * u;",
            "applied twice, it takes @x from",
        ),
        ("propose @x = 1;", "applied twice, it takes @x from"),
        (
            "propose u ~ normal(0, 1); propose @x = twice - value(@x);",
            "use only choices and constants",
        ),
        ("propose @x ~ normal(0, 1); propose @x = 1;", "gets a new value twice"),
        ("propose @x = -value(@x); propose @x ~ normal(0, 1);", "proposed twice"),
    ];
    for (body, expected) in wrong {
        let text = format!(
            "assume x ~ normal(1, 1); assume twice = 2 * x; observe normal(x, 1) = 1;
             kernel bad() {{ {body} }} infer {{ repeat 50 {{ bad(); }} }}"
        );
        let run = pcadlang::Model::from_text(&text).unwrap_or_else(|e| panic!("{e}")).run(
            &Default::default(),
            1,
            1,
        );
        let said = run.err().map(|e| e.to_string()).unwrap_or_default();
        assert!(said.contains(expected), "{body}: {said}");
    }
}

/// A vector stored as white noise, proposed by its value together with the scale of its
/// prior: the volume of the noise changes.
#[test]
fn proposals_of_whitened_vectors_are_paid_for() {
    let text = |moves: &str| {
        format!(
            "assume s ~ lognormal(0, 0.6);
             f ~ gp(mean = s, cov = sq_exp(0.7, s), at = [0, 0.5, 1]) #f;
             observe normal(f[0] + f[1], 0.4) = 1.5; observe normal(f[2], 0.3) = 0.2;
             kernel jump() {{
               propose k ~ categorical([0.3, 0.7]);
               let c = [{{ s: 0.8, f: [0.6, 0.6, 0.4] }}, {{ s: 1.3, f: [1, 0.8, 0.1] }}][k];
               propose @s ~ lognormal(log(c.s), 0.5);
               propose @f ~ mv_normal(c.f, chol = [[0.5, 0, 0], [0.1, 0.4, 0], [0, 0.1, 0.4]]);
             }}
             infer {{ warmup 2000 {{ {moves} }} repeat 60000 {{ {moves} collect s, f[0], f[1]; }} }}"
        )
    };
    // f given s is normal, so s has a density in closed form; f's mean is an integral
    // over it.
    let expected = |of: &dyn Fn(f64, [f64; 2]) -> f64| -> f64 {
        let at = |s: f64| {
            let cov = |a: f64, b: f64| s * s * (-0.5 * ((a - b) / 0.7).powi(2)).exp();
            // The two observations: the sum of the first two components, and the third.
            let cross = |t: f64| [cov(t, 0.0) + cov(t, 0.5), cov(t, 1.0)];
            let v00 = cross(0.0)[0] + cross(0.5)[0] + 0.16;
            let v01 = cross(0.0)[1] + cross(0.5)[1];
            let v11 = cov(1.0, 1.0) + 0.09;
            let det = v00 * v11 - v01 * v01;
            let r = [1.5 - 2.0 * s, 0.2 - s];
            let solved = [(v11 * r[0] - v01 * r[1]) / det, (v00 * r[1] - v01 * r[0]) / det];
            let like = (-0.5 * (r[0] * solved[0] + r[1] * solved[1])).exp() / det.sqrt();
            let f = [0.0, 0.5].map(|t| s + cross(t)[0] * solved[0] + cross(t)[1] * solved[1]);
            (normal_pdf(s.ln(), 0.0, 0.6) / s * like, f)
        };
        let sum = |g: &dyn Fn(f64) -> f64| integrate(g, 0.02, 12.0, 6000);
        sum(&|s| at(s).0 * of(s, at(s).1)) / sum(&|s| at(s).0)
    };
    let (s, f0, f1) = (expected(&|s, _| s), expected(&|_, f| f[0]), expected(&|_, f| f[1]));
    for moves in ["jump();", "mix { 0.5 => jump(); 0.5 => drift(one(@**)); }", "nuts(@**);"] {
        let d = run(&text(moves), 1, 2);
        assert_mean(&format!("{moves} s"), &d["s"], s, 0.05);
        assert_mean(&format!("{moves} f[0]"), &d["f[0]"], f0, 0.05);
        assert_mean(&format!("{moves} f[1]"), &d["f[1]"], f1, 0.05);
    }
}

/// An auxiliary variable whose distribution depends on the state is accounted for in the
/// acceptance ratio, too: each of its values is a separate proposal.
#[test]
fn auxiliary_variables_of_proposals_are_paid_for() {
    let d = run(
        "assume x ~ normal(0, 1); observe normal(x, 0.5) = 2;
         kernel step() {
           propose far ~ flip(if value(@x) > 1.5 { 0.9 } else { 0.2 });
           propose @x ~ normal(if far { 0.5 } else { value(@x) }, if far { 1.5 } else { 0.4 });
         }
         infer { repeat 80000 { step(); collect x; } }",
        1,
        2,
    );
    assert_mean("x", &d["x"], 1.6, 0.06);
    let squares: Vec<f64> = d["x"].iter().map(|x| (x - 1.6) * (x - 1.6)).collect();
    assert_mean("variance", &squares, 0.2, 0.03);
}

/// Starts proposed by a kernel of the program: the best of them is used, wherever the
/// prior has its mass; other kernels are refused.
#[test]
fn starts_are_proposed_by_a_kernel() {
    let text = |from: &str| {
        format!(
            "assume x ~ normal(0, 1000); let f = if x > 0 {{ y ~ normal(x, 1); y }} else {{ 0 }};
             observe normal(x, 0.1) = 42; observe normal(f, 1) = 42;
             kernel near(m) {{ propose k ~ categorical([1, 1]); propose @x ~ normal([-50, m][k], 1); }}
             kernel turned() {{ propose u ~ flip(0.5); propose @x = -value(@x); }}
             kernel moves() {{ drift(@x); }}
             infer {{ init(best_of(200, from = {from})); repeat 1 {{ collect x; }} }}"
        )
    };
    let d = run(&text("near(41.5)"), 1, 2);
    assert!(d["x"].iter().all(|x| (x - 42.0).abs() < 0.3), "{:?}", d["x"]);
    assert_ne!(d["x"][0], d["x"][1], "chains start apart");
    for (from, said) in [
        ("turned()", "the kernel of a start must propose choices from distributions, not by a map"),
        ("moves()", "`from` takes a kernel declared in the program"),
        ("drift(@x)", "`from` takes a kernel declared in the program"),
    ] {
        let model = pcadlang::Model::from_text(&text(from)).unwrap_or_else(|e| panic!("{e}"));
        let e =
            model.run(&Default::default(), 1, 1).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(e.contains(said), "{from}: {e}");
    }
}

/// A kernel body that reads only choices is replayed while the new state is pending, any
/// other body after the new state is in place: both give the same draws.
#[test]
fn ways_back_are_the_same_however_they_are_found() {
    let draws = |here: &str| {
        let text = format!(
            "assume x ~ normal(0, 1); f ~ gp(mean = 0, cov = sq_exp(1, exp(x)), at = [0, 1]);
             observe normal(x + f[0], 0.5) = 2;
             let twice = 2 * x; let values = f + 0;
             kernel step() {{
               propose s ~ lognormal(-1, if {here} > 1 {{ 0.5 }} else {{ 1 }});
               propose @x ~ normal(0.7 * {here} + 0.3, s);
               propose @f ~ mv_normal({here} * 0.2 + 0.5 * values, cov = s * identity(2));
             }}
             infer {{ repeat 2000 {{ step(); collect x, f[1]; }} }}"
        );
        let text = if here == "value(@x)" {
            text.replace("0.5 * values", "0.5 * value(@f)")
        } else {
            text
        };
        run(&text, 1, 2)
    };
    assert_eq!(draws("value(@x)"), draws("(0.5 * twice)"));
}
