//! Distributions and covariances.

use super::Examples;

pub(super) const EXAMPLES: Examples = &[
    ("normal", "assume x ~ normal(0, 1);\nobserve normal(x, 0.5) = [0.7, 1.2] as y;"),
    ("lognormal", "assume size ~ lognormal(0, 0.5);"),
    ("uniform", "assume turn ~ uniform(-pi, pi);"),
    ("beta", "assume share ~ beta(2, 5);\nobserve binomial(10, share) = 3 as heads;"),
    ("gamma", "assume rate ~ gamma(2, 1);\nobserve poisson(rate) = [3, 1, 4] as counts;"),
    ("exponential", "assume wait ~ exponential(0.1);"),
    ("half_normal", "assume noise ~ half_normal(1);\nobserve normal(0, noise) = [0.7, -1.2] as y;"),
    (
        "half_cauchy",
        "assume noise ~ half_cauchy(0, 1);\nobserve normal(0, noise) = [0.7, -1.2] as y;",
    ),
    (
        "student_t",
        "assume centre ~ normal(0, 10);\nobserve student_t(4, centre, 1) = [0.3, 0.1, 25] as y;",
    ),
    ("truncated_normal", "assume age ~ truncated_normal(30, 20, lo = 0);"),
    (
        "truncated",
        "assume rate ~ truncated(gamma(2, 1), lo = 0.5);\nobserve truncated(poisson(rate), lo = 1) = [3, 1, 4] as counts;",
    ),
    (
        "inv_gamma",
        "assume variance ~ inv_gamma(3, 2);\nobserve normal(0, sqrt(variance)) = [0.7, -1.2] as y;",
    ),
    ("cauchy", "assume x ~ cauchy(0, 1);"),
    ("laplace", "assume x ~ laplace(0, 1);"),
    ("von_mises", "assume heading ~ von_mises(0, 4);"),
    ("weibull", "assume life ~ weibull(1.5, 10);"),
    ("neg_binomial", "observe neg_binomial(5, 0.5) = [3, 8, 4] as counts;"),
    ("geometric", "assume tries ~ geometric(0.3);"),
    (
        "flat",
        "assume mean ~ flat();\nassume sd ~ flat(lo = 0);\nobserve normal(mean, sd) = [4.2, 5.1, 4.4] as y;",
    ),
    ("flip", "assume rain ~ flip(0.3);\nobserve flip(if rain { 0.9 } else { 0.1 }) = true as wet;"),
    ("uniform_discrete", "assume die ~ uniform_discrete(1, 6);"),
    ("binomial", "assume p ~ uniform(0, 1);\nobserve binomial(10, p) = 7 as heads;"),
    ("poisson", "assume rate ~ gamma(2, 1);\nobserve poisson(rate) = 4 as count;"),
    ("categorical", "assume kind ~ categorical([0.5, 0.3, 0.2]);"),
    (
        "dirichlet",
        "assume shares ~ dirichlet([1, 1, 1]);\nobserve multinomial(10, shares) = [5, 3, 2] as votes;",
    ),
    ("multinomial", "observe multinomial(10, [0.5, 0.3, 0.2]) = [6, 3, 1] as votes;"),
    (
        "lkj",
        "\
assume L ~ lkj(2, 1);
observe mv_normal([0, 0], chol = L) = [0.5, 0.4] as y;",
    ),
    (
        "wishart",
        "\
assume L ~ wishart(4, identity(2));
observe mv_normal([0, 0], chol = L) = [0.5, 0.4] as y;",
    ),
    ("mv_normal", "assume xy ~ mv_normal([0, 0], cov = [[1, 0.8], [0.8, 1]]);"),
    ("gp", "assume f ~ gp(mean = 0, cov = sq_exp(1), at = linspace(0, 4, 9));"),
    ("log_density", "log_density(normal(0, 1), 0) // -0.9189385332046728"),
    ("iid", "assume z ~ iid(normal(0, 1), 5);"),
    ("ordered", "assume cuts ~ ordered(normal(0, 1), 3);"),
    (
        "mixture",
        "\
assume far ~ normal(5, 1);
observe mixture([0.7, 0.3], [normal(0, 1), normal(far, 1)]) = 4.8 as y;",
    ),
    ("sq_exp", "assume smooth ~ gp(mean = 0, cov = sq_exp(1, sd = 2), at = [0, 0.5, 1]);"),
    ("matern32", "assume rough ~ gp(mean = 0, cov = matern32(1), at = [0, 0.5, 1]);"),
    ("matern52", "assume less_rough ~ gp(mean = 0, cov = matern52(1), at = [0, 0.5, 1]);"),
    ("periodic", "assume seasons ~ gp(mean = 0, cov = periodic(12, 1), at = range(0, 24));"),
    ("white", "assume noisy ~ gp(mean = 0, cov = sq_exp(2) + white(0.1), at = [0, 0.5, 1]);"),
];
