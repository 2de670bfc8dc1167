//! Reference data of the families: names, parameters and densities, from which the
//! language builds its table of built-ins.

/// A parameter of a family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParamDoc {
    /// The name in the language.
    pub name: &'static str,
    /// A description in one sentence.
    pub doc: &'static str,
}

/// A family of distributions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Family {
    /// The name in the language.
    pub name: &'static str,
    /// A description in one sentence.
    pub doc: &'static str,
    /// The parameters, in order.
    pub params: &'static [ParamDoc],
    /// The support, in words.
    pub support: &'static str,
    /// The density or probability.
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

/// All families, except products of distributions.
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
        "The distribution of the exponential of a normal variable.",
        &[
            p("mu", "The mean of the logarithm."),
            p("sigma", "The standard deviation of the logarithm, positive."),
        ],
        "x > 0",
        "exp(-((ln x - mu) / sigma)^2 / 2) / (x sigma sqrt(2 pi))",
    ),
    family(
        "uniform",
        "The uniform distribution on an interval.",
        &[p("lo", "The lower bound."), p("hi", "The upper bound, above `lo`.")],
        "lo <= x <= hi",
        "1 / (hi - lo)",
    ),
    family(
        "beta",
        "The beta distribution: a proportion between 0 and 1.",
        &[p("a", "The first shape, positive."), p("b", "The second shape, positive.")],
        "0 <= x <= 1; a pole at 0 if a < 1 and at 1 if b < 1",
        "x^(a - 1) (1 - x)^(b - 1) / B(a, b)",
    ),
    family(
        "gamma",
        "The gamma distribution.",
        &[
            p("shape", "The shape, positive."),
            p("rate", "The rate, positive: the inverse of the scale."),
        ],
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
        "The distribution of the absolute value of a normal variable with mean 0.",
        &[p("sd", "The standard deviation of the normal variable, positive.")],
        "x >= 0",
        "2 exp(-(x / sd)^2 / 2) / (sd sqrt(2 pi))",
    ),
    family(
        "half_cauchy",
        "The upper half of a Cauchy distribution.",
        &[
            p("location", "The lower end of the support."),
            p("scale", "The scale, positive: the median distance from the location."),
        ],
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
        "Any distribution of numbers truncated to an interval; for integers, the bounds are included.",
        &[
            p(
                "d",
                "A distribution of numbers, or of arrays of numbers if a parameter is an array.",
            ),
            p("lo", "The lower bound."),
            p("hi", "The upper bound, above `lo`; for integers it may equal `lo`."),
        ],
        "lo <= x <= hi, within the support of `d`",
        "that of d divided by P(lo <= X <= hi), computed in log space",
    ),
    family(
        "inv_gamma",
        "The inverse gamma distribution: 1 / x is gamma(shape, rate = scale).",
        &[p("shape", "The shape, positive."), p("scale", "The scale, positive.")],
        "x > 0",
        "scale^shape x^(-shape - 1) exp(-scale / x) / Gamma(shape)",
    ),
    family(
        "cauchy",
        "The Cauchy distribution, which has no mean.",
        &[
            p("location", "The centre."),
            p("scale", "The scale, positive: the median distance from the location."),
        ],
        "all numbers",
        "1 / (pi scale (1 + ((x - location) / scale)^2))",
    ),
    family(
        "laplace",
        "The Laplace (double exponential) distribution.",
        &[
            p("location", "The centre."),
            p("scale", "The scale, positive: the mean distance from the location."),
        ],
        "all numbers",
        "exp(-|x - location| / scale) / (2 scale)",
    ),
    family(
        "von_mises",
        "The von Mises distribution of an angle, in radians; proposals wrap around the circle.",
        &[
            p("mean", "The mean direction, in radians: any finite number."),
            p(
                "concentration",
                "The concentration, not negative; 0 is uniform; if large, 1 / concentration is about the variance.",
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
        "The improper flat prior, on all numbers or on one side of a bound: flat(lo = 0) for \
         positive numbers. It cannot be sampled, so kernels that propose from the prior reject; a \
         chain starts at uniform(-2, 2) in the unconstrained space, or at the value set by \
         `force`.",
        &[p("lo", "The lower bound."), p("hi", "The upper bound; at most one of them is finite.")],
        "lo <= x <= hi",
        "1, which is not integrable",
    ),
    family(
        "flip",
        "The Bernoulli distribution: true or false.",
        &[p("p", "The probability of true, from 0 to 1.")],
        "false, true",
        "p if x else 1 - p",
    ),
    family(
        "categorical",
        "The categorical distribution: an index drawn in proportion to weights.",
        &[p("weights", "One weight for each of 0, 1, …; they need not sum to 1.")],
        "0, 1, …, len(weights) - 1",
        "weights[x] / sum(weights)",
    ),
    family(
        "uniform_discrete",
        "The uniform distribution on a range of integers.",
        &[p("lo", "The minimum."), p("hi", "The maximum, included.")],
        "lo, lo + 1, …, hi",
        "1 / (hi - lo + 1)",
    ),
    family(
        "binomial",
        "The binomial distribution: the number of successes in independent trials.",
        &[
            p("n", "The number of trials, an integer."),
            p("p", "The probability of success, from 0 to 1."),
        ],
        "0, 1, …, n",
        "n! / (x! (n - x)!) p^x (1 - p)^(n - x)",
    ),
    family(
        "poisson",
        "The Poisson distribution: the number of events at a constant rate.",
        &[p("rate", "The mean, not negative.")],
        "0, 1, 2, …",
        "rate^x exp(-rate) / x!",
    ),
    family(
        "dirichlet",
        "The Dirichlet distribution: proportions that sum to 1.",
        &[p("alpha", "One positive concentration per component.")],
        "arrays of proportions x[i] >= 0 with sum 1",
        "Gamma(sum(alpha)) product(x[i]^(alpha[i] - 1) / Gamma(alpha[i]))",
    ),
    family(
        "multinomial",
        "The multinomial distribution: the counts of each category among n draws.",
        &[
            p("n", "The number of draws, an integer."),
            p("weights", "One weight per category; they need not sum to 1."),
        ],
        "arrays of len(weights) counts with sum n",
        "n! product((weights[i] / sum(weights))^x[i] / x[i]!)",
    ),
    family(
        "lkj",
        "The LKJ distribution: the Cholesky factor of a correlation matrix, as rows, which `mv_normal` takes as `chol`.",
        &[
            p("n", "The number of rows, from 1 to 1000."),
            p(
                "eta",
                "The shape, positive: 1 is uniform over correlation matrices, larger values favour independence.",
            ),
        ],
        "lower triangular arrays of n rows L, each of norm 1, with a non-negative diagonal",
        "proportional to det(L L')^(eta - 1) with respect to the correlations: product(L[i][i]^(n \
         - 1 - i + 2 (eta - 1))) with respect to the numbers below the diagonal",
    ),
    family(
        "wishart",
        "The Wishart distribution: the Cholesky factor of a random covariance matrix W, as rows, which `mv_normal` takes as `chol`; the mean of W is df scale_chol scale_chol'.",
        &[
            p("df", "The degrees of freedom, above the number of rows minus 1."),
            p(
                "scale_chol",
                "The lower triangular Cholesky factor of the scale matrix, an array of rows.",
            ),
        ],
        "lower triangular arrays of rows L with a positive diagonal, W = L L'",
        "L = scale_chol A: A[i][i]^2 is chi-squared with df - i degrees of freedom, A[i][j] normal(0, 1) below the diagonal",
    ),
    family(
        "mv_normal",
        "The multivariate normal distribution.",
        &[
            p("mean", "The mean vector."),
            p("cov", "The covariance matrix, an array of rows; give either `cov` or `chol`."),
            p("chol", "The lower triangular Cholesky factor of the covariance."),
            p(
                "whitened",
                "Non-centred: stores the white noise z of mean + chol z instead of the value.",
            ),
        ],
        "arrays as long as the mean",
        "exp(-(x - mean)' cov^-1 (x - mean) / 2) / sqrt(det(2 pi cov))",
    ),
    family(
        "gp",
        "A Gaussian process at given points: the values of a random function there.",
        &[
            p("mean", "The mean: one number, or one per point."),
            p("cov", "The covariance function."),
            p("at", "The points."),
            p("centred", "Centred: stores the values instead of the underlying white noise."),
            p(
                "jitter",
                "Added to the diagonal of the covariance matrix, as a fraction of the variance.",
            ),
        ],
        "arrays as long as `at`",
        "mv_normal(mean, K) with K[i][j] = cov(at[i], at[j]), plus jitter times the variance on the diagonal",
    ),
    family(
        "iid",
        "Independent, identically distributed values.",
        &[p("d", "A distribution."), p("n", "The number of values.")],
        "arrays of n values of d",
        "the product of the densities of d",
    ),
    family(
        "ordered",
        "Independent numbers in ascending order, as one choice: n from one distribution, or one \
         from each in a list. A list of different distributions is not normalised, so like `flat` \
         it cannot be sampled: kernels that propose from the prior reject.",
        &[
            p("d", "A distribution of continuous numbers, or an array of them."),
            p("n", "The number of values; omitted for an array of distributions."),
        ],
        "ascending arrays of n values of d",
        "n! times the product of the densities of d; for an array, the product of their \
         densities, not divided by the probability of that order (which is constant only if their \
         parameters are)",
    ),
    family(
        "mixture",
        "A mixture: a value from one of several distributions, with the component summed out.",
        &[
            p("weights", "One weight per component; they need not sum to 1."),
            p("components", "An array of distributions over the same kind of values."),
        ],
        "that of the components, or the smallest interval containing theirs",
        "sum(weights[k] / sum(weights) density of components[k])",
    ),
];
