//! Densities by values and parameters, transforms of constrained choices, covariances.

use super::check;

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
        ("flip(logit = a)", "true"),
        ("flip(logit = [a, 2 * a, s])", "[true, false, true]"),
        ("flip(logit = a)", "[1, 0, 0]"),
        ("binomial(7, logit = a)", "[3, 0, 7]"),
        ("binomial([7, 4], logit = [a, s])", "[3, 4]"),
        ("poisson(log = a)", "[3, 0]"),
        ("poisson(log = [a, s])", "[3, 0]"),
        ("categorical(logits = [s, 1, a])", "2"),
        ("truncated(poisson(log = a), lo = 1)", "[3, 1]"),
        ("truncated(binomial(9, logit = a), 1, 7)", "2"),
        ("truncated(categorical(logits = [s, 1, a, 0]), 1, 2)", "2"),
        ("iid(flip(logit = a), 2)", "[true, false]"),
        ("mixture([s, 1], [poisson(log = a), binomial(9, logit = a)])", "[3, 1]"),
        ("normal(normal_cdf(a), s)", "0.7"),
        ("normal(log_normal_cdf(30 * a - 20), s)", "0.7"),
        ("normal(erf(a) + erfc(s) + log1m_exp(-s), s)", "0.7"),
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
        "log_density(flip(logit = a), true)",
        "log_density(categorical(logits = [a, m, s]), 1)",
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
