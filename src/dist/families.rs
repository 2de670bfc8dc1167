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
        "truncated_normal",
        "The normal distribution between two bounds.",
        &[
            p("mean", "The mean before truncation."),
            p("sd", "The standard deviation before truncation, positive."),
            p("lo", "The lower bound."),
            p("hi", "The upper bound, above `lo`."),
        ],
        "lo <= x <= hi",
        "normal(mean, sd) at x / (Phi((hi - mean) / sd) - Phi((lo - mean) / sd))",
    ),
    family(
        "truncated",
        "Any distribution of numbers between two bounds; of integers, the bounds are inside.",
        &[
            p("d", "A distribution of numbers, or an array of such made by an array parameter."),
            p("lo", "The lower bound."),
            p("hi", "The upper bound, above `lo`; of integers it may be `lo`."),
        ],
        "lo <= x <= hi, as far as `d` draws numbers there",
        "that of d over P(lo <= X <= hi), computed in log space",
    ),
    family(
        "inv_gamma",
        "The inverse of a gamma number: 1 / x is gamma(shape, rate = scale).",
        &[p("shape", "The shape, positive."), p("scale", "The scale, positive.")],
        "x > 0",
        "scale^shape x^(-shape - 1) exp(-scale / x) / Gamma(shape)",
    ),
    family(
        "cauchy",
        "The Cauchy distribution, which has no mean.",
        &[p("location", "The centre."), p("scale", "The median distance from there, positive.")],
        "all numbers",
        "1 / (pi scale (1 + ((x - location) / scale)^2))",
    ),
    family(
        "laplace",
        "The Laplace distribution: exponential on both sides.",
        &[p("location", "The centre."), p("scale", "The mean distance from there, positive.")],
        "all numbers",
        "exp(-|x - location| / scale) / (2 scale)",
    ),
    family(
        "von_mises",
        "The von Mises distribution of an angle, in radians; moves go around the circle.",
        &[
            p("mean", "The mean direction, in radians: any finite number."),
            p(
                "concentration",
                "How narrow it is, not negative; 0 is uniform, 1 / concentration about the variance if large.",
            ),
        ],
        "-pi < x <= pi",
        "exp(concentration cos(x - mean)) / (2 pi I0(concentration))",
    ),
    family(
        "weibull",
        "The Weibull distribution: (x / scale)^shape is exponential.",
        &[p("shape", "The shape, positive."), p("scale", "The scale, positive.")],
        "x > 0",
        "shape / scale (x / scale)^(shape - 1) exp(-(x / scale)^shape)",
    ),
    family(
        "neg_binomial",
        "The number of failures before the r-th success, as in scipy; Stan's neg_binomial(alpha, beta) is r = alpha, p = beta / (1 + beta).",
        &[
            p("r", "The number of successes, positive; it need not be whole."),
            p("p", "The probability of success, above 0 and at most 1."),
        ],
        "0, 1, 2, …",
        "Gamma(x + r) / (x! Gamma(r)) p^r (1 - p)^x",
    ),
    family(
        "geometric",
        "The number of failures before the first success, from 0.",
        &[p("p", "The probability of success, above 0 and at most 1.")],
        "0, 1, 2, …",
        "p (1 - p)^x",
    ),
    family(
        "flat",
        "The improper flat prior, on all numbers or on one side of a bound: flat(lo = 0) for what is positive. It cannot be drawn from, so kernels that redraw choices reject; a chain starts at uniform(-2, 2) in the unconstrained space, or where `force` says.",
        &[p("lo", "The lower bound."), p("hi", "The upper bound; at most one of them is finite.")],
        "lo <= x <= hi",
        "1, which has no integral",
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
        "multinomial",
        "How many of n draws are of each kind.",
        &[p("n", "How many draws, an integer."), p("weights", "One weight for each kind; they need not sum to 1.")],
        "arrays of len(weights) counts with sum n",
        "n! product((weights[i] / sum(weights))^x[i] / x[i]!)",
    ),
    family(
        "lkj",
        "The LKJ distribution: the Cholesky factor of a correlation matrix, as rows, which `mv_normal` takes as `chol`.",
        &[
            p("n", "How many rows, from 1 to 1000."),
            p("eta", "The shape, positive: 1 is uniform over correlation matrices, more is closer to independence."),
        ],
        "lower triangular arrays of n rows L of length 1, with a diagonal that is not negative",
        "proportional to det(L L')^(eta - 1) by the correlations: product(L[i][i]^(n - 1 - i + 2 (eta - 1))) by the numbers below the diagonal",
    ),
    family(
        "wishart",
        "The Wishart distribution: the Cholesky factor of a random covariance matrix W, as rows, which `mv_normal` takes as `chol`; the mean of W is df scale_chol scale_chol'.",
        &[
            p("df", "The degrees of freedom, above the number of rows less 1."),
            p("scale_chol", "The lower triangular Cholesky factor of the scale matrix, an array of rows."),
        ],
        "lower triangular arrays of rows L with a positive diagonal, W = L L'",
        "L = scale_chol A: A[i][i]^2 is chi-squared with df - i degrees of freedom, A[i][j] normal(0, 1) below the diagonal",
    ),
    family(
        "mv_normal",
        "The multivariate normal distribution.",
        &[
            p("mean", "The mean vector."),
            p("cov", "The covariance matrix, an array of rows; or `chol`, one of them."),
            p("chol", "The lower triangular Cholesky factor of the covariance."),
            p("whitened", "Stores the white noise z of mean + chol z, instead of the value."),
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
            p("jitter", "What is added to the diagonal of the covariance matrix, as a share of the variance."),
        ],
        "arrays as long as `at`",
        "mv_normal(mean, K) with K[i][j] = cov(at[i], at[j]), and jitter times the variance more on the diagonal",
    ),
    family(
        "iid",
        "Independent values of one distribution.",
        &[p("d", "A distribution."), p("n", "How many.")],
        "arrays of n values of d",
        "the product of the densities of d",
    ),
    family(
        "ordered",
        "Independent numbers in ascending order, one choice: n of one distribution, or one of each in a list. A list of unlike ones is not normalised, so like `flat` it cannot be drawn from: kernels that redraw choices reject.",
        &[
            p("d", "A distribution of continuous numbers, or an array of them."),
            p("n", "How many; left out for an array of distributions."),
        ],
        "ascending arrays of n values of d",
        "n! times the product of the densities of d; of an array, the product of theirs, not divided by the probability of that order (a constant only while their parameters stay)",
    ),
    family(
        "mixture",
        "A value of one of several distributions, it is not known which.",
        &[
            p("weights", "One weight for each component; they need not sum to 1."),
            p("components", "Distributions with the same kind of values, an array."),
        ],
        "that of the components, or the least interval around theirs",
        "sum(weights[k] / sum(weights) density of components[k])",
    ),
];
