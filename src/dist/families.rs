//! The families' reference: names, parameters, densities. Constant data, from which the language makes its table of built-ins.

/// A parameter of a family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParamDoc {
    /// Its name in the language.
    pub name: &'static str,
    /// What it is, in one sentence.
    pub doc: &'static str,
}

/// A family of distributions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Family {
    /// Its name in the language.
    pub name: &'static str,
    /// What it is, in one sentence.
    pub doc: &'static str,
    /// Its parameters, in order.
    pub params: &'static [ParamDoc],
    /// Where its values lie.
    pub support: &'static str,
    /// Its density or probability.
    pub formula: &'static str,
}

const fn family(
    name: &'static str,
    doc: &'static str,
    params: &'static [ParamDoc],
    support: &'static str,
    formula: &'static str,
) -> Family {
    Family { name, doc, params, support, formula }
}

const fn p(name: &'static str, doc: &'static str) -> ParamDoc {
    ParamDoc { name, doc }
}

/// All families, but for products of others.
pub const FAMILIES: &[Family] = &[
    family(
        "normal",
        "The normal distribution.",
        &[p("mean", "The mean."), p("sd", "The standard deviation, positive.")],
        "all numbers",
        "exp(-((x - mean) / sd)^2 / 2) / (sd sqrt(2 pi))",
    ),
    family(
        "lognormal",
        "The exponential of a normal number.",
        &[p("mu", "The mean of the logarithm."), p("sigma", "The standard deviation of the logarithm, positive.")],
        "x > 0",
        "exp(-((ln x - mu) / sigma)^2 / 2) / (x sigma sqrt(2 pi))",
    ),
    family(
        "uniform",
        "The uniform distribution on an interval.",
        &[p("lo", "The lower end."), p("hi", "The upper end, above `lo`.")],
        "lo <= x <= hi",
        "1 / (hi - lo)",
    ),
    family(
        "beta",
        "The beta distribution: a share.",
        &[p("a", "The first shape, positive."), p("b", "The second shape, positive.")],
        "0 <= x <= 1; a pole at 0 if a < 1 and at 1 if b < 1",
        "x^(a - 1) (1 - x)^(b - 1) / B(a, b)",
    ),
    family(
        "gamma",
        "The gamma distribution.",
        &[p("shape", "The shape, positive."), p("rate", "The rate, positive: the inverse of the scale.")],
        "x > 0",
        "rate^shape x^(shape - 1) exp(-rate x) / Gamma(shape)",
    ),
    family(
        "exponential",
        "The exponential distribution: a waiting time.",
        &[p("rate", "The rate, positive: the inverse of the mean.")],
        "x >= 0",
        "rate exp(-rate x)",
    ),
    family(
        "half_normal",
        "The absolute value of a normal number with mean 0.",
        &[p("sd", "The standard deviation of that number, positive.")],
        "x >= 0",
        "2 exp(-(x / sd)^2 / 2) / (sd sqrt(2 pi))",
    ),
    family(
        "half_cauchy",
        "The upper half of a Cauchy distribution.",
        &[p("location", "Where it begins."), p("scale", "The median distance from there, positive.")],
        "x >= location",
        "2 / (pi scale (1 + ((x - location) / scale)^2))",
    ),
    family(
        "student_t",
        "Student's t distribution.",
        &[
            p("df", "The degrees of freedom, positive."),
            p("location", "The centre."),
            p("scale", "The scale, positive."),
        ],
        "all numbers",
        "(1 + z^2 / df)^(-(df + 1) / 2) / (scale sqrt(df) B(df / 2, 1/2)), z = (x - location) / scale",
    ),
    family(
        "flip",
        "The toss of a coin: true or false.",
        &[p("p", "The probability of true, from 0 to 1.")],
        "false, true",
        "p if x else 1 - p",
    ),
    family(
        "categorical",
        "An index drawn in proportion to weights.",
        &[p("weights", "One weight for each of 0, 1, …; they need not sum to 1.")],
        "0, 1, …, len(weights) - 1",
        "weights[x] / sum(weights)",
    ),
    family(
        "uniform_discrete",
        "The uniform distribution on a range of integers.",
        &[p("lo", "The least."), p("hi", "The greatest, itself included.")],
        "lo, lo + 1, …, hi",
        "1 / (hi - lo + 1)",
    ),
    family(
        "binomial",
        "The number of successes in independent trials.",
        &[p("n", "How many trials, an integer."), p("p", "The probability of success, from 0 to 1.")],
        "0, 1, …, n",
        "n! / (x! (n - x)!) p^x (1 - p)^(n - x)",
    ),
    family(
        "poisson",
        "The number of events at a constant rate.",
        &[p("rate", "The mean, not negative.")],
        "0, 1, 2, …",
        "rate^x exp(-rate) / x!",
    ),
    family(
        "dirichlet",
        "Shares that sum to 1.",
        &[p("alpha", "One positive concentration for each share.")],
        "arrays of shares x[i] >= 0 with sum 1",
        "Gamma(sum(alpha)) product(x[i]^(alpha[i] - 1) / Gamma(alpha[i]))",
    ),
    family(
        "mv_normal",
        "The multivariate normal distribution.",
        &[
            p("mean", "The mean vector."),
            p("cov", "The covariance matrix, an array of rows; or `chol`, one of them."),
            p("chol", "The lower triangular Cholesky factor of the covariance."),
        ],
        "arrays as long as the mean",
        "exp(-(x - mean)' cov^-1 (x - mean) / 2) / sqrt(det(2 pi cov))",
    ),
    family(
        "gp",
        "A Gaussian process at given points: a random function's values there.",
        &[
            p("mean", "The mean: one number, or one for each point."),
            p("cov", "The covariance function."),
            p("at", "The points."),
            p("centred", "Stores the values, instead of the white noise that makes them."),
        ],
        "arrays as long as `at`",
        "mv_normal(mean, K) with K[i][j] = cov(at[i], at[j]), and 1e-6 of the variance more on the diagonal",
    ),
    family(
        "iid",
        "Independent values of one distribution.",
        &[p("d", "A distribution."), p("n", "How many.")],
        "arrays of n values of d",
        "the product of the densities of d",
    ),
];
