//! Truncated families under kernels that follow gradients, from states where hardly any of
//! the probability is left.

use crate::common::*;

/// Every family that can be truncated, with parameters that priors over many orders of
/// magnitude move, and the bound.
const CUT: &[(&str, f64)] = &[
    ("weibull(k, s)", 5.0),
    ("gamma(k, s)", 5.0),
    ("lognormal(log(k), s)", 5.0),
    ("student_t(k, s, 1)", 5.0),
    ("normal(k, s)", 5.0),
    ("cauchy(k, s)", 5.0),
    ("laplace(k, s)", 5.0),
    ("half_normal(s)", 5.0),
    ("half_cauchy(0, s)", 5.0),
    ("exponential(s)", 5.0),
    ("inv_gamma(k, s)", 5.0),
    ("beta(k, s)", 0.95),
    ("uniform(0, 5 + k)", 5.0),
    ("mixture([0.5, 0.5], [gamma(k, s), normal(k, s)])", 5.0),
    ("mixture([k, s], [exponential(1), normal(0, 1)])", 5.0),
];

/// A leapfrog step may lead to a state in which nothing of the distribution is left within
/// its bounds: it is rejected.
#[test]
fn states_without_probability_are_rejected() {
    for (family, lo) in CUT {
        for kernel in ["hmc(@**, steps = 10)", "mala(@**)", "nuts(@**)"] {
            for seed in [1, 2] {
                run(
                    &format!(
                        "assume k ~ lognormal(0, 3); assume s ~ lognormal(0, 3);
                         assume x ~ truncated({family}, lo = {lo});
                         observe normal(x, 1) = 6;
                         infer {{ warmup 200 {{ {kernel}; }} repeat 200 {{ {kernel}; collect k; }} }}"
                    ),
                    seed,
                    2,
                );
            }
        }
    }
}

/// The same for observations: their own density is 0 in most states of the prior.
#[test]
fn observations_without_probability_are_rejected() {
    for kernel in ["hmc(@**, steps = 10)", "mala(@**)", "nuts(@**)"] {
        let draws = run(
            &format!(
                "assume k ~ lognormal(0, 1); assume s ~ lognormal(0, 1);
                 observe truncated(weibull(k, s), lo = 5) = 5.5;
                 infer {{ warmup 2000 {{ {kernel}; }} repeat 20000 {{ {kernel}; collect k; }} }}"
            ),
            3,
            2,
        );
        // By quadrature over log k and log s of the density in closed form.
        let (mut mass, mut sum) = (0.0, 0.0);
        for i in -800..800 {
            for j in -800..800 {
                let (u, v) = (f64::from(i) * 0.01, f64::from(j) * 0.01);
                let (k, s) = (u.exp(), v.exp());
                let fall = |x: f64| (k * (x / s).ln()).exp();
                let score = -0.5 * (u * u + v * v) + k.ln() - s.ln() + (k - 1.0) * (5.5 / s).ln()
                    - (fall(5.5) - fall(5.0));
                let p = if score.is_finite() { score.exp() } else { 0.0 };
                mass += p;
                sum += p * k;
            }
        }
        assert_mean(kernel, &draws["k"], sum / mass, 0.2);
    }
}
