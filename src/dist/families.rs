//! The families as the table of built-ins and the reference document them.

/// A parameter.
#[derive(Clone, Copy, Debug)]
pub struct ParamDoc {
    /// Its name.
    pub name: &'static str,
    /// One line about it.
    pub doc: &'static str,
}

/// A family of distributions.
#[derive(Clone, Copy, Debug)]
pub struct Family {
    /// Its name.
    pub name: &'static str,
    /// Its parameters in order.
    pub params: &'static [ParamDoc],
    /// One line about it.
    pub doc: &'static str,
    /// Its support.
    pub support: &'static str,
    /// Its density, or probability.
    pub formula: &'static str,
}

const fn p(name: &'static str, doc: &'static str) -> ParamDoc {
    ParamDoc { name, doc }
}

const fn family(
    name: &'static str,
    params: &'static [ParamDoc],
    doc: &'static str,
    support: &'static str,
    formula: &'static str,
) -> Family {
    Family { name, params, doc, support, formula }
}

/// Every family.
pub const FAMILIES: &[Family] = &[
    family(
        "normal",
        &[p("mean", "The mean."), p("sd", "The standard deviation, positive.")],
        "The normal distribution.",
        "all numbers",
        "exp(-((x - mean) / sd)^2 / 2) / (sd sqrt(2 pi))",
    ),
    family(
        "lognormal",
        &[p("mu", "The mean of the logarithm."), p("sigma", "The standard deviation of the logarithm, positive.")],
        "e to the power of a normal number.",
        "x > 0",
        "exp(-((ln x - mu) / sigma)^2 / 2) / (x sigma sqrt(2 pi))",
    ),
    family(
        "uniform",
        &[p("lo", "The lower end."), p("hi", "The upper end, greater than `lo`.")],
        "All numbers between two ends alike.",
        "lo <= x <= hi",
        "1 / (hi - lo)",
    ),
    family(
        "beta",
        &[p("a", "The first shape, positive."), p("b", "The second shape, positive.")],
        "A number between 0 and 1, its mean a / (a + b).",
        "0 <= x <= 1",
        "x^(a - 1) (1 - x)^(b - 1) / B(a, b)",
    ),
    family(
        "gamma",
        &[p("shape", "The shape, positive."), p("rate", "The rate, positive: the mean is shape / rate.")],
        "The gamma distribution.",
        "x > 0",
        "rate^shape x^(shape - 1) exp(-rate x) / Gamma(shape)",
    ),
    family(
        "exponential",
        &[p("rate", "The rate, positive: the mean is 1 / rate.")],
        "The waiting time for an event of constant rate.",
        "x >= 0",
        "rate exp(-rate x)",
    ),
    family(
        "half_normal",
        &[p("sd", "The standard deviation of the whole normal distribution, positive.")],
        "The size of a normal number of mean 0.",
        "x >= 0",
        "2 exp(-(x / sd)^2 / 2) / (sd sqrt(2 pi))",
    ),
    family(
        "half_cauchy",
        &[p("location", "Where it begins."), p("scale", "The distance of the median from there, positive.")],
        "The upper half of a Cauchy distribution: a spread that may be very large.",
        "x >= location",
        "2 / (pi scale (1 + ((x - location) / scale)^2))",
    ),
    family(
        "student_t",
        &[
            p("df", "The degrees of freedom, positive; few mean heavy tails."),
            p("location", "The centre."),
            p("scale", "The scale, positive."),
        ],
        "Student's t: like the normal, with heavier tails.",
        "all numbers",
        "Gamma((df + 1) / 2) / (Gamma(df / 2) sqrt(pi df) scale) (1 + z^2 / df)^(-(df + 1) / 2), z = (x - location) / scale",
    ),
    family(
        "flip",
        &[p("p", "The probability of `true`.")],
        "A coin: `true` or `false`.",
        "true, false",
        "p if x else 1 - p",
    ),
    family(
        "categorical",
        &[p("weights", "One weight for each of 0, 1, …; they need not sum to 1.")],
        "A whole number from 0 with the given weights.",
        "0, 1, …, len(weights) - 1",
        "weights[x] / sum(weights)",
    ),
    family(
        "uniform_discrete",
        &[p("lo", "The least."), p("hi", "The greatest.")],
        "All whole numbers of a range alike, both ends included.",
        "lo, lo + 1, …, hi",
        "1 / (hi - lo + 1)",
    ),
    family(
        "binomial",
        &[p("n", "The number of trials."), p("p", "The probability of success in each.")],
        "The number of successes in independent trials.",
        "0, 1, …, n",
        "n! / (x! (n - x)!) p^x (1 - p)^(n - x)",
    ),
    family(
        "poisson",
        &[p("rate", "The mean, at least 0.")],
        "The number of events of constant rate.",
        "0, 1, …",
        "rate^x exp(-rate) / x!",
    ),
    family(
        "dirichlet",
        &[p("alpha", "One positive concentration for each share.")],
        "Shares of a whole.",
        "arrays of numbers from 0 to 1 that sum to 1",
        "Gamma(sum alpha) / prod Gamma(alpha_i) prod x_i^(alpha_i - 1), by the first n - 1 shares",
    ),
    family(
        "mv_normal",
        &[
            p("mean", "The mean vector."),
            p("cov", "The covariance matrix, an array of rows; or `chol`, its Cholesky factor."),
        ],
        "The normal distribution of vectors.",
        "all arrays as long as the mean",
        "exp(-(x - mean)^T cov^-1 (x - mean) / 2) / sqrt(det(2 pi cov))",
    ),
    family(
        "gp",
        &[p("mean", "The mean."), p("cov", "The covariance function."), p("at", "The points.")],
        "A Gaussian process at some points, kept as the white noise behind it unless `centred`.",
        "all arrays as long as `at`",
        "mv_normal with covariance cov(at_i, at_j) + 1e-6 variance on the diagonal",
    ),
    family(
        "iid",
        &[p("d", "A distribution."), p("n", "How many.")],
        "Independent draws from one distribution: an array with an address for each element.",
        "arrays of n values of d",
        "the product of the densities",
    ),
];
