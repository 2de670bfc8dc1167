//! Kernels compared with exact answers: conjugate, enumerable, recursive,
//! changing-structure and open-universe models.

use crate::common::*;

/// x ~ normal(0, 1), observe normal(x, 0.5) = 2: mean 1.600, variance 0.200. (Leaving the
/// prior out of the ratio, as an early engine did, gives 1.333 and 0.167.)
fn conjugate_normal(kernel: &str) {
    let stmt = if kernel.ends_with('}') { kernel.to_owned() } else { format!("{kernel};") };
    let text = format!(
        "assume x ~ normal(0, 1); observe normal(x, 0.5) = 2;
         infer {{ warmup 2000 {{ {stmt} }} repeat 60000 {{ {stmt} collect x; }} }}"
    );
    assert_conjugate(kernel, &text);
}

/// Asserts that draws of x have the mean and variance of that posterior.
fn assert_conjugate(kernel: &str, text: &str) {
    let d = run(text, 1, 2);
    assert_mean(kernel, &d["x"], 1.6, 0.06);
    let squares: Vec<f64> = d["x"].iter().map(|x| (x - 1.6) * (x - 1.6)).collect();
    assert_mean(&format!("{kernel}, variance"), &squares, 0.2, 0.03);
}

#[test]
fn conjugate_normal_by_every_kernel() {
    kernels::exact::CONJUGATE.iter().for_each(|k| conjugate_normal(k));
}

/// The mean of a component and the labels of three points: of a mixture, and of a Markov
/// chain of labels.
#[test]
fn labels_are_summed_out() {
    let y = [0.3, 1.6, 2.4];
    let follow = |a: usize, b: usize| if a == b { 0.8 } else { 0.2 };
    for chain in [false, true] {
        let prior = |z: [usize; 3]| match chain {
            false => z.iter().map(|z| [0.6, 0.4][*z]).product::<f64>(),
            true => [0.6, 0.4][z[0]] * follow(z[0], z[1]) * follow(z[1], z[2]),
        };
        let like = |z: [usize; 3], m: f64| {
            let one = |i: usize| normal_pdf(y[i], if z[i] == 1 { m } else { 0.0 }, 0.7);
            prior(z) * normal_pdf(m, 1.0, 2.0) * one(0) * one(1) * one(2)
        };
        let all = (0..8).map(|i| [i & 1, (i >> 1) & 1, i >> 2]);
        let sum = |f: &dyn Fn([usize; 3], f64) -> f64| -> f64 {
            all.clone().map(|z| integrate(|m| f(z, m) * like(z, m), -12.0, 14.0, 2000)).sum()
        };
        let total = sum(&|_, _| 1.0);
        for kernel in kernels::exact::SUMMED_OUT {
            let prior = if chain {
                "if i == 0 { 0.4 } else { if z[i - 1] { 0.8 } else { 0.2 } }"
            } else {
                "0.4"
            };
            let k = if kernel.ends_with(';') { (*kernel).to_owned() } else { format!("{kernel};") };
            let text = format!(
                "let y = {y:?}; assume m ~ normal(1, 2);
                 for i in 0 .. 3 {{ z[i] ~ flip({prior}); observe normal(if z[i] {{ m }} else {{ 0 }}, 0.7) = y[i]; }}
                 infer {{ warmup 500 {{ {k} }} repeat 6000 {{ {k} collect m, z; }} }}"
            );
            let d = run(&text, 1, 2);
            assert_mean(&format!("{kernel}: m"), &d["m"], sum(&|_, m| m) / total, 0.4);
            for i in 0..3 {
                let expected = sum(&|z, _| z[i] as f64) / total;
                assert_mean(&format!("{kernel}: z[{i}]"), &d[&format!("z[{i}]")], expected, 0.1);
            }
        }
    }
}

/// Two-stage acceptance, first by a surrogate with another mean and width; with built-in
/// kernels and with one declared in the program.
#[test]
fn surrogates_leave_the_posterior_as_it_is() {
    let surrogate = "observe normal(x, 0.5) = 2 with coarse = normal(x + 0.4, 0.8) as y;";
    // The same likelihood in two parts, of which the first stage leaves one out.
    let waiting = "observe normal(x, sqrt(0.5)) = 2;
                   observe normal(x, sqrt(0.5)) = 2 with coarse = flat() as y;";
    let each = |observed| kernels::exact::DELAYED.iter().map(move |kernel| (observed, kernel));
    for (observed, kernel) in each(surrogate).chain(each(waiting)) {
        let text = format!(
            "assume x ~ normal(0, 1); {observed}
             kernel pull(s) {{ let here = value(@x); propose @x ~ normal(0.7 * here + 1, s); }}
             infer {{ warmup 2000 {{ {kernel}; }} repeat 60000 {{ {kernel}; collect x; }} }}"
        );
        assert_conjugate(kernel, &text);
    }
}

/// 20,000 draws by slice sampling from two modes, one of them narrow, have the right
/// distribution as a whole.
#[test]
fn slices_have_the_right_distribution() {
    let density = |x: f64| {
        normal_pdf(x, 0.0, 3.0) * (0.4 * normal_pdf(x, -2.0, 0.3) + 0.6 * normal_pdf(x, 2.0, 1.0))
    };
    let (low, cells) = (-5.0, 3000);
    let width = 13.0 / cells as f64;
    let mut reached = vec![0.0];
    for i in 0..cells {
        let a = low + i as f64 * width;
        reached.push(reached[i] + integrate(density, a, a + width, 4));
    }
    let cdf = |x: f64| {
        let at = ((x - low) / width).clamp(0.0, cells as f64 - 1e-9);
        let (i, rest) = (at as usize, at.fract());
        (reached[i] + rest * (reached[i + 1] - reached[i])) / reached[cells]
    };
    for kernel in kernels::exact::SLICES {
        let text = format!(
            "assume x ~ normal(0, 3); observe mixture([0.4, 0.6], [normal(-2, 0.3), normal(2, 1)]) = x;
             infer {{ repeat 10000 {{ repeat 8 {{ {kernel}; }} collect x; }} }}"
        );
        let d = run(&text, 3, 2);
        let distance = kolmogorov_smirnov(&d["x"], cdf);
        assert!(d["x"].len() == 20_000 && distance < 2.5, "{kernel}: {distance}");
    }
}

/// The default plan, without an `infer` block.
#[test]
fn conjugate_normal_by_the_default_plan() {
    let d = run("assume x ~ normal(0, 1); observe normal(x, 0.5) = 2;", 3, 8);
    assert_mean("default plan", &d["x"], 1.6, 0.1);
}

#[test]
fn beta_binomial() {
    for kernel in kernels::exact::BETA_BINOMIAL {
        let text = format!(
            "assume p ~ beta(1, 1); observe binomial(20, p) = 14;
             infer {{ warmup 1000 {{ {kernel}; }} repeat 40000 {{ {kernel}; collect p; }} }}"
        );
        assert_mean(kernel, &run(&text, 5, 2)["p"], 15.0 / 22.0, 0.02);
    }
}

/// The support of p2 depends on p1: p1 ~ uniform(.5, 1), p2 ~ uniform(0, p1), observe
/// flip(p2) = false.
#[test]
fn support_that_depends_on_another_choice() {
    let z = integrate(|p1| 1.0 - p1 / 2.0, 0.5, 1.0, 200);
    let m1 = integrate(|p1| p1 * (1.0 - p1 / 2.0), 0.5, 1.0, 200) / z;
    let m2 = integrate(|p1| p1 / 2.0 - p1 * p1 / 3.0, 0.5, 1.0, 200) / z;
    for kernel in kernels::exact::DEPENDENT_SUPPORT {
        let text = format!(
            "assume p1 ~ uniform(0.5, 1); assume p2 ~ uniform(0, p1); observe flip(p2) = false;
             infer {{ warmup 2000 {{ {kernel}; }} repeat 60000 {{ {kernel}; collect p1, p2; }} }}"
        );
        let d = run(&text, 7, 2);
        assert_mean(&format!("{kernel}: p1"), &d["p1"], m1, 0.03);
        assert_mean(&format!("{kernel}: p2"), &d["p2"], m2, 0.03);
    }
}

/// Geometric recursion: two calls, with an unbounded number of choices.
#[test]
fn recursion_against_enumeration() {
    let weight = |a: f64| (a + 1.0) * 0.25 * 0.5f64.powf(a) * normal_pdf(3.0, a, 0.8);
    let z: f64 = (0..60).map(|a| weight(f64::from(a))).sum();
    let expected = (0..60).map(|a| f64::from(a) * weight(f64::from(a))).sum::<f64>() / z;
    for kernel in kernels::exact::RECURSION.iter().copied() {
        let kernel = if kernel.contains('#') {
            "mix { 0.5 => mh(one(@a/geom#2)); 0.5 => mh(one(@a/geom)); }"
        } else {
            kernel
        };
        let k = if kernel.starts_with("mix") { kernel.to_owned() } else { format!("{kernel};") };
        let text = format!(
            "fn geom(p) {{ s ~ flip(p); if s {{ 1 + geom(p) }} else {{ 0 }} }}
             assume a = geom(0.5) + geom(0.5); observe normal(a, 0.8) = 3;
             infer {{ repeat 60000 {{ {k} collect a; }} }}"
        );
        let d = run(&text, 11, 2);
        if !kernel.starts_with("mix") {
            assert_mean(kernel, &d["a"], expected, 0.15);
        }
    }
}

/// Which choices exist depends on a choice, and both branches draw a choice of the same
/// name.
#[test]
fn branches_with_choices_of_their_own() {
    let w1 = 0.3 * normal_pdf(3.0, 0.0, 2f64.sqrt());
    let w2 = 0.7 * normal_pdf(3.0, 5.0, 5f64.sqrt());
    let p = w1 / (w1 + w2);
    let mean_x = p * 1.5 + (1.0 - p) * (5.0 + 4.0 / 5.0 * (3.0 - 5.0));
    for kernel in kernels::exact::BRANCHES {
        let text = format!(
            "assume c ~ flip(0.3);
             assume x = if c {{ a ~ normal(0, 1); a }} else {{ a ~ normal(5, 2); a }};
             observe normal(x, 1) = 3;
             infer {{ warmup 500 {{ {kernel} }} repeat 60000 {{ {kernel} collect c, x; }} }}"
        );
        let d = run(&text, 13, 2);
        assert_mean(&format!("{kernel} c"), &d["c"], p, 0.03);
        assert_mean(&format!("{kernel} x"), &d["x"], mean_x, 0.15);
    }
}

/// A hidden Markov model as a loop that reads its own container, compared with the
/// forward-backward algorithm.
#[test]
#[ignore = "half a minute"]
fn hidden_markov_model() {
    let obs = [0.2, 1.1, 2.3, 1.9, 0.4];
    let trans = [[0.8, 0.15, 0.05], [0.2, 0.6, 0.2], [0.1, 0.3, 0.6]];
    let like = |s: usize, y: f64| normal_pdf(y, s as f64, 0.7);
    let n = obs.len();
    let mut forward = vec![[0.0; 3]; n];
    for s in 0..3 {
        forward[0][s] = like(s, obs[0]) / 3.0;
    }
    for t in 1..n {
        for s in 0..3 {
            forward[t][s] =
                (0..3).map(|r| forward[t - 1][r] * trans[r][s]).sum::<f64>() * like(s, obs[t]);
        }
    }
    let mut backward = vec![[1.0; 3]; n];
    for t in (0..n - 1).rev() {
        for r in 0..3 {
            backward[t][r] =
                (0..3).map(|s| trans[r][s] * like(s, obs[t + 1]) * backward[t + 1][s]).sum();
        }
    }
    let exact: Vec<f64> = (0..n)
        .map(|t| {
            let z: f64 = (0..3).map(|s| forward[t][s] * backward[t][s]).sum();
            (0..3).map(|s| s as f64 * forward[t][s] * backward[t][s]).sum::<f64>() / z
        })
        .collect();
    for kernel in kernels::exact::HIDDEN_MARKOV {
        let text = format!(
            "let y = [0.2, 1.1, 2.3, 1.9, 0.4];
             let trans = [[0.8, 0.15, 0.05], [0.2, 0.6, 0.2], [0.1, 0.3, 0.6]];
             for t in 0 .. 5 {{
               s[t] ~ categorical(if t == 0 {{ [1, 1, 1] }} else {{ trans[s[t - 1]] }});
               observe normal(s[t], 0.7) = y[t];
             }}
             infer {{ repeat 80000 {{ {kernel}; collect s; }} }}"
        );
        let d = run(&text, 17, 2);
        for (t, e) in exact.iter().enumerate() {
            assert_mean(&format!("{kernel} s[{t}]"), &d[&format!("s[{t}]")], *e, 0.1);
        }
    }
}

/// Partitions of three points under a Dirichlet process (stick-breaking with `mem`),
/// compared with the enumeration of all five partitions.
#[test]
#[ignore = "half a minute"]
fn open_universe_with_mem() {
    let y = [-1.0, -0.5, 2.0];
    // The marginal density of a group of points with a centre ~ normal(0, 2) and noise 1.
    let group = |points: &[f64]| {
        integrate(
            |m| {
                normal_pdf(m, 0.0, 2.0)
                    * points.iter().map(|p| normal_pdf(*p, m, 1.0)).product::<f64>()
            },
            -15.0,
            15.0,
            3000,
        )
    };
    // A Chinese restaurant process with alpha = 1 over 3 points: the denominators are n!.
    let together = group(&y) * 2.0 / 6.0;
    let first_two = group(&y[..2]) * group(&y[2..]) / 6.0;
    let outer = group(&[y[0], y[2]]) * group(&y[1..2]) / 6.0;
    let last_two = group(&y[1..]) * group(&y[..1]) / 6.0;
    let apart = group(&y[..1]) * group(&y[1..2]) * group(&y[2..]) / 6.0;
    let z = together + first_two + outer + last_two + apart;
    let p01 = (together + first_two) / z;
    let p12 = (together + last_two) / z;
    for kernel in kernels::exact::OPEN_UNIVERSE {
        let text = format!(
            "let y = [-1, -0.5, 2];
             assume stick = mem(fn(k) {{ v ~ beta(1, 1); v }});
             assume centre = mem(fn(k) {{ m ~ normal(0, 2); m }});
             fn pick(k) {{ here ~ flip(stick(k)); if here {{ k }} else {{ pick(k + 1) }} }}
             assume z = map(fn(i) {{ pick(0) }}, 0 .. 3);
             for i in 0 .. 3 {{ observe normal(centre(z[i]), 1) = y[i]; }}
             infer {{ warmup 1000 {{ {kernel} }} repeat 150000 {{ {kernel} collect z[0] == z[1], z[1] == z[2]; }} }}"
        );
        let d = run(&text, 19, 2);
        assert_mean(&format!("{kernel} together 0 1"), &d["z[0] == z[1]"], p01, 0.05);
        assert_mean(&format!("{kernel} together 1 2"), &d["z[1] == z[2]"], p12, 0.05);
    }
}

/// Elliptical slice sampling with a non-zero mean and full covariance, and with a mean
/// that depends on a choice of the same block.
#[test]
fn elliptical_slice_with_full_covariance() {
    // Prior N([1, -1], [[2, .9], [.9, 1]]), observe x0 + x1 = 1.5 with sd 0.5.
    let (s00, s01, s11) = (2.0, 0.9, 1.0);
    let v = s00 + 2.0 * s01 + s11 + 0.25;
    let gain = [(s00 + s01) / v, (s01 + s11) / v];
    let expected = [1.0 + gain[0] * 1.5, -1.0 + gain[1] * 1.5];
    let d = run(
        "assume x ~ mv_normal([1, -1], [[2, 0.9], [0.9, 1]]);
         observe normal(x[0] + x[1], 0.5) = 1.5;
         infer { repeat 40000 { elliptical(@x); collect x; } }",
        23,
        2,
    );
    assert_mean("x0", &d["x[0]"], expected[0], 0.05);
    assert_mean("x1", &d["x[1]"], expected[1], 0.05);
    // a ~ N(0,1), b ~ N(a,1), observe N(b, .5) = 2: b ~ N(0, 2) a priori.
    let d = run(
        "assume a ~ normal(0, 1); assume b ~ normal(a, 1); observe normal(b, 0.5) = 2;
         infer { repeat 40000 { elliptical(@a + @b); collect a, b; } }",
        29,
        2,
    );
    assert_mean("b", &d["b"], 2.0 * 2.0 / 2.25, 0.05);
    assert_mean("a", &d["a"], 2.0 / 2.25, 0.05);
}

/// A Gaussian process over three points with unknown bandwidth: the whitened and centred
/// forms agree with quadrature over the bandwidth.
#[test]
fn gaussian_process_with_unknown_bandwidth() {
    let text = |centred: bool, kernel: &str| {
        format!(
            "assume l ~ uniform(0.2, 2);
             assume f ~ gp(mean = 0, cov = sq_exp(l, 1), at = [0, 0.5, 1], centred = {centred});
             observe normal(f, 0.3) = [0.5, 0.9, 0.2];
             infer {{ warmup 2000 {{ {kernel} }} repeat 60000 {{ {kernel} collect l, f; }} }}"
        )
    };
    let white = run(&text(false, "elliptical(@f); drift(@l);"), 31, 2);
    let centred = run(&text(true, "elliptical(@f); drift(@l);"), 37, 2);
    let (mw, mc) = (mean(&white["l"]), mean(&centred["l"]));
    let se = (standard_error(&white["l"]).powi(2) + standard_error(&centred["l"]).powi(2)).sqrt();
    assert!(
        se < 0.02 && (mw - mc).abs() < 5.0 * se,
        "bandwidth: whitened {mw}, centred {mc}, se {se}"
    );
    // Quadrature over l of the three-dimensional Gaussian marginal.
    let y = [0.5, 0.9, 0.2];
    let at = [0.0, 0.5, 1.0];
    let marginal = |l: f64| {
        let mut m = [[0.0; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                let d: f64 = at[i] - at[j];
                m[i][j] = (-d * d / (2.0 * l * l)).exp() + if i == j { 0.09 + 1e-6 } else { 0.0 };
            }
        }
        let det = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
            - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
        let minor = |r: usize, c: usize| {
            let (a, b) = ((r + 1) % 3, (r + 2) % 3);
            let (p, q) = ((c + 1) % 3, (c + 2) % 3);
            m[a][p] * m[b][q] - m[a][q] * m[b][p]
        };
        let quad: f64 =
            (0..3).map(|i| (0..3).map(|j| y[i] * minor(j, i) / det * y[j]).sum::<f64>()).sum();
        (-0.5 * quad).exp() / det.sqrt()
    };
    let z = integrate(marginal, 0.2, 2.0, 2000);
    let expected = integrate(|l| l * marginal(l), 0.2, 2.0, 2000) / z;
    assert_mean("bandwidth", &white["l"], expected, 0.1);
}

/// Predictions, and choices that no observation depends on, are drawn from the prior
/// given the rest, and never proposed.
#[test]
fn predictions_are_drawn_anew_and_not_proposed() {
    let d = run(
        "assume x ~ normal(0, 1); observe normal(x, 0.5) = 2;
         assume unused ~ normal(10, 2);
         predict y ~ normal(x, 0.5);
         infer { warmup 500 { drift(@x); } repeat 40000 { drift(@x); collect x, unused; } }",
        41,
        2,
    );
    assert_mean("y", &d["y"], 1.6, 0.06);
    assert_mean("unused", &d["unused"], 10.0, 0.1);
    let lag: f64 = d["unused"].windows(2).map(|w| (w[0] - 10.0) * (w[1] - 10.0)).sum::<f64>()
        / d["unused"].iter().map(|x| (x - 10.0) * (x - 10.0)).sum::<f64>();
    assert!(
        lag.abs() < 0.03,
        "draws of what nothing asks for are independent, lag-1 correlation {lag}"
    );
}

/// Two distant modes: an annealed population ends in each in proportion to its mass,
/// which a chain of small steps does not achieve.
#[test]
fn a_population_settles_by_mass() {
    let draws = run(
        "assume x ~ normal(0, 5);
         factor(log_sum_exp([log(0.7) - (x - 6) ** 2 / 0.5, log(0.3) - (x + 6) ** 2 / 0.5]));
         infer {
           init(best_of(40, keep = 40));
           warmup 12000 { anneal(200); drift(one(@**)); }
           repeat 1 { collect x; }
         }",
        5,
        300,
    );
    let x = &draws["x"];
    assert_eq!(x.len(), 300);
    // Three standard errors of a proportion of 0.7 in 300 chains are 0.08.
    let right = x.iter().filter(|x| **x > 0.0).count() as f64 / 300.0;
    assert!((right - 0.7).abs() < 0.08, "{right}");
}

/// Two distant modes, 0.3 N(-4, 0.5) + 0.7 N(4, 0.5): replica exchange moves between
/// them, a plain chain does not.
#[test]
fn replica_exchange_weighs_modes_that_are_far_apart() {
    let text = |kernel: &str| {
        format!(
            "assume x ~ uniform(-20, 20);
             factor(log(0.3 * exp(-2 * (x + 4) ** 2) + 0.7 * exp(-2 * (x - 4) ** 2) + 1e-300));
             infer {{ warmup 5000 {{ {kernel}; }} repeat 40000 {{ {kernel}; collect x < 0; }} }}"
        )
    };
    let tempered = run(&text("temper(drift(@x, scale = 0.5), levels = 6)"), 1, 2);
    assert_mean("share of the lower mode", &tempered["x < 0"], 0.3, 0.05);
    let plain = run(&text("mala(@x)"), 1, 2);
    assert!((mean(&plain["x < 0"]) - 0.3).abs() > 0.1, "a plain chain stays where it is");
}

/// Two modes of different weights: a search finds both, and jumps between them leave the
/// posterior invariant. So does a search by a surrogate that sees neither mode (it has to
/// depend on the choice, since a choice that nothing depends on does not exist).
#[test]
#[ignore = "half a minute"]
fn jumps_between_modes_keep_their_weights() {
    let density = |x: f64| normal_pdf(x, 0.5, 2.0) * normal_pdf(9.0, x * x, 1.0);
    let (all, right) = (integrate(density, -9.0, 9.0, 4000), integrate(density, 0.0, 9.0, 4000));
    for (kernel, steps, accepted) in [
        ("modes(@x, tries = 40, keep = 8, steps = 20)", 40_000, 0.6),
        ("modes(@x, tries = 8, keep = 8, steps = 20, first = @x)", 40_000, 0.6),
        ("modes(@x, tries = 40, keep = 8, steps = 20, at = @seen)", 600_000, 0.05),
    ] {
        let text = format!(
            "assume x ~ normal(0.5, 2); observe normal(x * x, 1) = 9 with coarse = normal(x, 60) as seen;
             infer {{ warmup 1 {{ {kernel}; }} repeat {steps} {{ {kernel}; collect x; }} }}"
        );
        let x = &run(&text, 1, 2)["x"];
        let positive: Vec<f64> = x.iter().map(|x| f64::from(u8::from(*x > 0.0))).collect();
        assert_mean(kernel, &positive, right / all, 0.02);
        let squares: Vec<f64> = x.iter().map(|x| x * x).collect();
        assert_mean(
            kernel,
            &squares,
            integrate(|x| x * x * density(x), -9.0, 9.0, 4000) / all,
            0.05,
        );
        let moved = x.windows(2).filter(|w| w[0] != w[1]).count() as f64 / x.len() as f64;
        assert!(moved > accepted, "{kernel}: {moved} of its proposals are accepted");
    }
}

/// Mirrored modes have equal densities, but are still recognised as two.
#[test]
fn modes_that_mirror_each_other_are_both_visited() {
    let d = run(
        "assume x ~ normal(0, 2); observe normal(x * x, 1) = 9;
         kernel jump() { modes(@x, tries = 40, keep = 8, steps = 40); }
         infer { warmup 1 { jump(); } repeat 40000 { jump(); collect x; } }",
        1,
        2,
    );
    let positive: Vec<f64> = d["x"].iter().map(|x| f64::from(u8::from(*x > 0.0))).collect();
    assert_mean("mirrored modes", &positive, 0.5, 0.02);
}

/// The search uses surrogates, whose mode is 1; the chain then climbs to the mode of the
/// observation itself.
#[test]
fn a_search_by_surrogates_ends_at_the_mode_of_the_observations() {
    let d = run(
        "assume x ~ normal(0, 1); observe normal(x, 0.1) = 2 with coarse = normal(x, 1) as y;
         infer { warmup 1 { modes(@x, tries = 8, keep = 4, steps = 40, at = @y); } repeat 1 { collect x; } }",
        1,
        1,
    );
    assert!((d["x"][0] - 200.0 / 101.0).abs() < 1e-5, "{}", d["x"][0]);
}

/// Annealed particles estimate the evidence, which is known here, and their states are
/// draws from the posterior.
#[test]
fn particles_give_the_evidence() {
    let kernel = kernels::exact::SIMULATED[0];
    let model = pcadlang::Model::from_text(&format!(
        "assume x ~ normal(0, 1); observe normal(x, 0.5) = 2; infer {{ repeat 1500 {{ {kernel}; collect x; }} }}"
    ))
    .unwrap_or_else(|e| panic!("{e}"));
    let options = pcadlang_inference::RunOptions { seed: 2, ..Default::default() };
    let posterior = model.run(&options, 2, 2).unwrap_or_else(|e| panic!("{e}"));
    let x =
        posterior.scalars().into_iter().find(|(n, _)| n == "x").map(|(_, x)| x).unwrap_or_default();
    assert_mean("x by smc", &x, 1.6, 0.1);
    let expected = normal_pdf(2.0, 0.0, 1.25f64.sqrt()).ln();
    for chain in &posterior.chains {
        let log = chain.kernels[0].log_evidence.unwrap_or(f64::NAN);
        assert!((log - expected).abs() < 0.03, "log evidence {log}, expected {expected}");
    }
}

#[test]
fn particles_find_both_modes() {
    let text = "assume c ~ flip(0.4);
         assume x = if c { a ~ normal(1, 1); a } else { b ~ normal(-1, 1); d ~ normal(0, 1); b + d };
         observe normal(x, 1) = 0.5; ";
    let d = run(
        &format!(
            "{text} infer {{ repeat 3000 {{ {}; collect c; }} }}",
            kernels::exact::SIMULATED[1]
        ),
        1,
        2,
    );
    let (yes, no) =
        (0.4 * normal_pdf(0.5, 1.0, 2f64.sqrt()), 0.6 * normal_pdf(0.5, -1.0, 3f64.sqrt()));
    assert_mean("c by smc", &d["c"], yes / (yes + no), 0.06);
}

/// Without a likelihood: a coin's number of heads in ten flips, by simulation. The count
/// itself is observed and `eps` is below one, so the posterior is exact.
#[test]
fn simulated_data_stand_in_for_the_likelihood() {
    let text = "assume p ~ beta(1, 1); observe binomial(10, p) = 7;";
    let kernel = kernels::exact::SIMULATED[2];
    let infer =
        format!("infer {{ warmup 500 {{ {kernel}; }} repeat 120000 {{ {kernel}; collect p; }} }}");
    let d = run(&format!("{text} {infer}"), 1, 2);
    assert_mean(&format!("p by {kernel}"), &d["p"], 8.0 / 12.0, 0.03);
    let squares: Vec<f64> = d["p"].iter().map(|p| p * p).collect();
    assert_mean(&format!("p^2 by {kernel}"), &squares, 8.0 * 9.0 / (12.0 * 13.0), 0.04);
}

/// A choice that vanishes together with the value on which its own mean depends.
#[test]
fn choices_vanish_with_the_density_that_they_had() {
    let there = integrate(|x| normal_pdf(x, 0.0, 1.0) * normal_pdf(1.0, x, 1.0), -12.0, 12.0, 2000);
    let gone = normal_pdf(1.0, 0.5, 1.0);
    for kernel in ["mh(one(@**))", "gibbs(one(@k))", "block(@**)"] {
        let text = format!(
            "assume k ~ categorical([1, 1, 1]); x ~ normal(2 * k, 1); observe normal(if k == 0 {{ x }} else {{ 0.5 }}, 1) = 1;
             infer {{ warmup 500 {{ {kernel}; }} repeat 60000 {{ {kernel}; mh(one(@x)); collect k; }} }}"
        );
        let first: Vec<f64> =
            run(&text, 1, 2)["k"].iter().map(|k| f64::from(u8::from(*k == 0.0))).collect();
        assert_mean(kernel, &first, there / (there + 2.0 * gone), 0.02);
    }
}
