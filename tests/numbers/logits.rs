//! Families by log odds and logarithms, in programs.

use crate::common::*;
use pcadlang::Model;

fn value(expression: &str) -> f64 {
    let text = format!(
        "assume x ~ normal(0, 1); predict v = {expression}; infer {{ repeat 1 {{ mh(@x); collect v; }} }}"
    );
    run(&text, 1, 1)["v"][0]
}

#[test]
fn densities_do_not_underflow() {
    assert_eq!(value("log_density(flip(logit = 40), false)"), -40.0);
    assert_eq!(value("log_density(flip(logit = -800), [true, false])"), -800.0);
    assert_eq!(value("log_density(binomial(3, logit = -800), 3)"), -2400.0);
    assert_eq!(value("log_density(categorical(logits = [0, 1000]), 0)"), -1000.0);
    assert!((value("log_density(poisson(log = -800), 1)") + 800.0).abs() < 1e-12);
    // As function values too, where arguments are known only during the run.
    assert_eq!(value("fold(fn(s, f) { s + log_density(f(logit = 40), false) }, 0, [flip])"), -40.0);
    assert_eq!(value("fold(fn(s, f) { s + log_density(f(0.5), false) }, 0, [flip])"), 0.5f64.ln());
}

/// Finite families are enumerated and drawn; the posterior is that of the other form.
#[test]
fn finite_choices_are_enumerated() {
    for kernel in ["gibbs(@z)", "mh(@z)"] {
        for (choice, wanted) in [
            // P(z | y = 0.8) of a flip with p = 0.3, z moves a mean from 0 to 1.
            ("z0 ~ flip(logit = logit(0.3)); let z = if z0 { 1 } else { 0 };", None),
            ("z ~ categorical(logits = [log(0.2), log(0.3), log(0.5)]);", Some([0.2, 0.3, 0.5])),
            ("z ~ binomial(2, logit = logit(0.4));", Some([0.36, 0.48, 0.16])),
        ] {
            let prior = wanted.unwrap_or([0.7, 0.3, 0.0]);
            let kernel =
                if choice.starts_with("z0") { kernel.replace('z', "z0") } else { kernel.into() };
            let draws = run(
                &format!(
                    "assume {choice} observe normal(z, 1) = 0.8; assume m = 1 * z;
                     infer {{ warmup 100 {{ {kernel}; }} repeat 20000 {{ {kernel}; collect m; }} }}"
                ),
                3,
                2,
            );
            let each = |k: usize| prior[k] * normal_pdf(0.8, k as f64, 1.0);
            let total: f64 = (0..3).map(each).sum();
            let mean = (0..3).map(|k| k as f64 * each(k)).sum::<f64>() / total;
            assert_mean(choice, &draws["m"], mean, 0.05);
        }
    }
}

/// A logistic regression by nuts, against quadrature.
#[test]
fn regressions_follow_gradients() {
    let draws = run(
        "assume b ~ normal(0, 2);
         observe flip(logit = b * [1, -2, 3]) = [true, false, true];
         observe binomial(9, logit = b) = 6;
         observe poisson(log = b) = 3;
         observe categorical(logits = [b, 0, -b]) = 1;
         infer { warmup 500 { nuts(@b); } repeat 20000 { nuts(@b); collect b; } }",
        4,
        2,
    );
    let density = |b: f64| {
        let log_sigmoid = |x: f64| -(-x).exp().ln_1p();
        let bits = log_sigmoid(b) + log_sigmoid(2.0 * b) + log_sigmoid(3.0 * b);
        let counts = 6.0 * log_sigmoid(b) + 3.0 * log_sigmoid(-b) + 3.0 * b - b.exp();
        let kinds = -(b.exp() + 1.0 + (-b).exp()).ln();
        (bits + counts + kinds - b * b / 8.0).exp()
    };
    let z = integrate(density, -8.0, 8.0, 20_000);
    let mean = integrate(|b| b * density(b), -8.0, 8.0, 20_000) / z;
    assert_mean("b", &draws["b"], mean, 0.02);
}

#[test]
fn exactly_one_parameter_is_to_be_given() {
    let message = |text: &str| match Model::from_text(text) {
        Ok(_) => panic!("{text}"),
        Err(e) => e.to_string(),
    };
    let said = message("observe flip(0.3, logit = 0.4) = true;");
    assert!(said.contains("`flip` takes `p` or `logit`, not both"), "{said}");
    let said = message("observe binomial(4) = 2;");
    assert!(said.contains("`binomial` needs `p` or `logit`"), "{said}");
    assert!(said.contains("1:9") && said.contains("binomial(n, p = none, logit = none)"), "{said}");
}
