//! The table of families. From a row follow the family's variant of [`Dist`], its
//! constructor with the checks of its parameters, its batch, and what the language
//! documents; its density and sampler are in its own file.

use super::batch::{Component, Members};
use super::family::{families, family};
use super::*;
use std::sync::Arc;

const _: () = assert!(size_of::<Dist>() <= 48);

families! { $
    normal: inline numbers Normal {
        mean: finite, "The mean.";
        sd: positive, "The standard deviation, positive.";
    }
    doc "The normal distribution."
    on "all numbers"
    density "exp(-((x - mean) / sd)^2 / 2) / (sd sqrt(2 pi))";

    lognormal: inline numbers LogNormal {
        mu: finite, "The mean of the logarithm.";
        sigma: positive, "The standard deviation of the logarithm, positive.";
    }
    doc "The distribution of the exponential of a normal variable."
    on "x > 0"
    density "exp(-((ln x - mu) / sigma)^2 / 2) / (x sigma sqrt(2 pi))";

    uniform: inline numbers Uniform {
        lo: finite, "The lower bound.";
        hi: finite, "The upper bound, above `lo`.";
    }
    doc "The uniform distribution on an interval."
    on "lo <= x <= hi"
    density "1 / (hi - lo)";

    beta: inline numbers Beta {
        a: positive, "The first shape, positive.";
        b: positive, "The second shape, positive.";
    }
    doc "The beta distribution: a proportion between 0 and 1."
    on "0 <= x <= 1; a pole at 0 if a < 1 and at 1 if b < 1"
    density "x^(a - 1) (1 - x)^(b - 1) / B(a, b)";

    gamma: inline numbers Gamma {
        shape: positive, "The shape, positive.";
        rate: positive, "The rate, positive: the inverse of the scale.";
    }
    doc "The gamma distribution."
    on "x > 0"
    density "rate^shape x^(shape - 1) exp(-rate x) / Gamma(shape)";

    exponential: inline numbers Exponential {
        rate: positive, "The rate, positive: the inverse of the mean.";
    }
    doc "The exponential distribution: a waiting time."
    on "x >= 0"
    density "rate exp(-rate x)";

    half_normal: inline numbers HalfNormal {
        sd: positive, "The standard deviation of the normal variable, positive.";
    }
    doc "The distribution of the absolute value of a normal variable with mean 0."
    on "x >= 0"
    density "2 exp(-(x / sd)^2 / 2) / (sd sqrt(2 pi))";

    half_cauchy: inline numbers HalfCauchy {
        location: finite, "The lower end of the support.";
        scale: positive, "The scale, positive: the median distance from the location.";
    }
    doc "The upper half of a Cauchy distribution."
    on "x >= location"
    density "2 / (pi scale (1 + ((x - location) / scale)^2))";

    student_t: inline numbers StudentT {
        df: positive, "The degrees of freedom, positive.";
        location: finite, "The centre.";
        scale: positive, "The scale, positive.";
    }
    doc "Student's t distribution."
    on "all numbers"
    density "(1 + z^2 / df)^(-(df + 1) / 2) / (scale sqrt(df) B(df / 2, 1/2)), \
             z = (x - location) / scale";

    truncated_normal: shared numbers TruncatedNormal {
        mean: finite, "The mean before truncation.";
        sd: positive, "The standard deviation before truncation, positive.";
        lo: any, "The lower bound.", default "-inf";
        hi: any, "The upper bound, above `lo`.", default "inf";
    }
    doc "The normal distribution between two bounds."
    on "lo <= x <= hi"
    density "normal(mean, sd) at x / (Phi((hi - mean) / sd) - Phi((lo - mean) / sd))";

    truncated: shared other Truncated {
        d: Distribution, "A distribution of numbers.";
        lo: Numbers, "The lower bound.", default "-inf";
        hi: Numbers, "The upper bound, above `lo`; of integers it may be `lo`.", default "inf";
    }
    doc "Any distribution of numbers truncated to an interval; for integers, the bounds are \
         included."
    on "lo <= x <= hi, within the support of `d`"
    density "that of d divided by P(lo <= X <= hi), computed in log space";

    inv_gamma: inline numbers InvGamma {
        shape: positive, "The shape, positive.";
        scale: positive, "The scale, positive.";
    }
    doc "The inverse gamma distribution: 1 / x is gamma(shape, rate = scale)."
    on "x > 0"
    density "scale^shape x^(-shape - 1) exp(-scale / x) / Gamma(shape)";

    cauchy: inline numbers Cauchy {
        location: finite, "The centre.";
        scale: positive, "The scale, positive: the median distance from the location.";
    }
    doc "The Cauchy distribution, which has no mean."
    on "all numbers"
    density "1 / (pi scale (1 + ((x - location) / scale)^2))";

    laplace: inline numbers Laplace {
        location: finite, "The centre.";
        scale: positive, "The scale, positive: the mean distance from the location.";
    }
    doc "The Laplace (double exponential) distribution."
    on "all numbers"
    density "exp(-|x - location| / scale) / (2 scale)";

    von_mises: inline numbers VonMises {
        mean: finite, "The mean direction: any finite number.", unit "radians";
        concentration: not_negative, "The concentration, not negative; 0 is uniform.";
    }
    doc "The von Mises distribution of an angle, in radians; proposals wrap around the circle."
    on "-pi < x <= pi"
    density "exp(concentration cos(x - mean)) / (2 pi I0(concentration))";

    weibull: inline numbers Weibull {
        shape: positive, "The shape, positive.";
        scale: positive, "The scale, positive.";
    }
    doc "The Weibull distribution: (x / scale)^shape is exponential."
    on "x > 0"
    density "shape / scale (x / scale)^(shape - 1) exp(-(x / scale)^shape)";

    neg_binomial: inline numbers NegBinomial {
        r: positive, "The number of successes, positive; it need not be whole.";
        p: success, "The probability of success, above 0 and at most 1.";
    }
    doc "The number of failures before the r-th success, as in scipy; Stan's \
         neg_binomial(alpha, beta) is r = alpha, p = beta / (1 + beta)."
    on "0, 1, 2, …"
    density "Gamma(x + r) / (x! Gamma(r)) p^r (1 - p)^x";

    geometric: inline numbers Geometric {
        p: success, "The probability of success, above 0 and at most 1.";
    }
    doc "The number of failures before the first success, from 0."
    on "0, 1, 2, …"
    density "p (1 - p)^x";

    flat: inline numbers Flat {
        lo: any, "The lower bound.", default "-inf";
        hi: any, "The upper bound; at most one of them is finite.", default "inf";
    }
    doc "The improper flat prior, on all numbers or on one side of a bound: flat(lo = 0) for \
         positive numbers. It cannot be sampled, so kernels that propose from the prior reject; a \
         chain starts at uniform(-2, 2) in the unconstrained space, or at the value set by \
         `force`."
    on "lo <= x <= hi"
    density "1, which is not integrable";

    flip: inline numbers Flip {
        p: probability, "The probability of true, from 0 to 1.";
    }
    doc "The Bernoulli distribution: true or false."
    on "false, true"
    density "p if x else 1 - p"
    drawn Unknown;

    flip_logit: inline numbers FlipLogit {
        logit: finite, "The log odds of true, log(p / (1 - p)).";
    }
    doc "A truth value, by its log odds."
    on "false, true"
    density "1 / (1 + exp(-logit)) if x else 1 / (1 + exp(logit))"
    drawn Unknown
    form of flip;

    uniform_discrete: inline numbers UniformDiscrete {
        lo: integer, "The minimum.";
        hi: integer, "The maximum, included.";
    }
    doc "The uniform distribution on a range of integers."
    on "lo, lo + 1, …, hi"
    density "1 / (hi - lo + 1)";

    binomial: inline numbers Binomial {
        n: integer, "The number of trials, an integer.";
        p: probability, "The probability of success, from 0 to 1.";
    }
    doc "The binomial distribution: the number of successes in independent trials."
    on "0, 1, …, n"
    density "n! / (x! (n - x)!) p^x (1 - p)^(n - x)";

    binomial_logit: inline numbers BinomialLogit {
        n: integer, "The number of trials, an integer.";
        logit: finite, "The log odds of success, log(p / (1 - p)).";
    }
    doc "The number of successes in independent trials, by their log odds."
    on "0, 1, …, n"
    density "n! / (x! (n - x)!) exp(logit x) / (1 + exp(logit))^n"
    form of binomial;

    poisson: inline numbers Poisson {
        rate: rate, "The mean, not negative.";
    }
    doc "The Poisson distribution: the number of events at a constant rate."
    on "0, 1, 2, …"
    density "rate^x exp(-rate) / x!";

    poisson_log: inline numbers PoissonLog {
        log: finite, "The logarithm of the mean, at most that of 2^53.";
    }
    doc "The number of events at a constant rate, by the logarithm of the rate."
    on "0, 1, 2, …"
    density "exp(log x - exp(log)) / x!"
    form of poisson;

    categorical: inline other Categorical {
        weights: Array, "One weight for each of 0, 1, …; they need not sum to 1.";
    }
    doc "The categorical distribution: an index drawn in proportion to weights."
    on "0, 1, …, len(weights) - 1"
    density "weights[x] / sum(weights)";

    categorical_logits: inline other CategoricalLogits {
        logits: Array, "The logarithm of each weight; a constant added to all changes nothing.";
    }
    doc "An index drawn in proportion to weights, by their logarithms."
    on "0, 1, …, len(logits) - 1"
    density "exp(logits[x] - log_sum_exp(logits))"
    form of categorical;

    dirichlet: shared other Dirichlet {
        alpha: Array, "One positive concentration per component.";
    }
    doc "The Dirichlet distribution: proportions that sum to 1."
    on "arrays of proportions x[i] >= 0 with sum 1"
    density "Gamma(sum(alpha)) product(x[i]^(alpha[i] - 1) / Gamma(alpha[i]))"
    drawn Array;

    multinomial: shared other Multinomial {
        n: Integer, "The number of draws.";
        weights: Array, "One weight per category; they need not sum to 1.";
    }
    doc "The multinomial distribution: the counts of each category among n draws."
    on "arrays of len(weights) counts with sum n"
    density "n! product((weights[i] / sum(weights))^x[i] / x[i]!)"
    drawn Array;

    lkj: shared other Lkj {
        n: Integer, "The number of rows, from 1 to 1000.";
        eta: Number, "The shape, positive: 1 is uniform over correlation matrices, larger values \
                      favour independence.";
    }
    doc "The LKJ distribution: the Cholesky factor of a correlation matrix, as rows, which \
         `mv_normal` takes as `chol`."
    on "lower triangular arrays of n rows L, each of norm 1, with a non-negative diagonal"
    density "proportional to det(L L')^(eta - 1) with respect to the correlations: \
             product(L[i][i]^(n - 1 - i + 2 (eta - 1))) with respect to the numbers below the \
             diagonal"
    drawn Array;

    wishart: shared other Wishart {
        df: Number, "The degrees of freedom, above the number of rows minus 1.";
        scale_chol: Array, "The lower triangular Cholesky factor of the scale matrix, an array of \
                            rows.";
    }
    doc "The Wishart distribution: the Cholesky factor of a random covariance matrix W, as rows, \
         which `mv_normal` takes as `chol`; the mean of W is df scale_chol scale_chol'."
    on "lower triangular arrays of rows L with a positive diagonal, W = L L'"
    density "L = scale_chol A: A[i][i]^2 is chi-squared with df - i degrees of freedom, A[i][j] \
             normal(0, 1) below the diagonal"
    drawn Array;

    mv_normal: shared other MvNormal {
        mean: Array, "The mean vector.";
        cov: Array, "The covariance matrix, an array of rows; give either `cov` or `chol`.",
            default "none";
        chol: Array, "The lower triangular Cholesky factor of the covariance.", default "none";
        whitened: Bool, "Non-centred: stores the white noise z of mean + chol z, so that the value \
                         follows changes of the mean and covariance.", default "false";
    }
    doc "The multivariate normal distribution."
    on "arrays as long as the mean"
    density "exp(-(x - mean)' cov^-1 (x - mean) / 2) / sqrt(det(2 pi cov))"
    drawn Correlated;

    gp: shared other Gp {
        mean: Numbers, "The mean: one number, or one per point.";
        cov: Covariance, "The covariance function, such as `sq_exp(length)`.";
        at: Array, "The points.";
        centred: Bool, "Centred: stores the values instead of the underlying white noise.",
            default "false";
        jitter: Number, "Added to the diagonal of the covariance matrix.",
            default "1e-6", unit "fraction of the variance";
    }
    doc "A Gaussian process at given points: the values of a random function there."
    on "arrays as long as `at`"
    density "mv_normal(mean, K) with K[i][j] = cov(at[i], at[j]), plus jitter times the variance \
             on the diagonal"
    drawn Correlated;

    iid: shared other Iid {
        d: Distribution, "A distribution.";
        n: Integer, "The number of values.";
    }
    doc "Independent, identically distributed values."
    on "arrays of n values of d"
    density "the product of the densities of d"
    drawn Unknown;

    ordered: shared other Ordered {
        d: Any, "A distribution of continuous numbers, or an array of them.";
        n: Integer, "The number of values from a single distribution; an array gives one of each.",
            default "none";
    }
    doc "Independent numbers in ascending order, as one choice: n from one distribution, or one \
         from each in a list. A list of different distributions is not normalised, so like `flat` \
         it cannot be sampled: kernels that propose from the prior reject."
    on "ascending arrays of n values of d"
    density "n! times the product of the densities of d; for an array, the product of their \
             densities, not divided by the probability of that order (which is constant only if \
             their parameters are)"
    drawn Array;

    mixture: shared other Mixture {
        weights: Array, "One weight per component; they need not sum to 1.";
        components: Array, "Distributions over the same kind of values.";
    }
    doc "A mixture: a value from one of several distributions, with the component summed out."
    on "that of the components, or the smallest interval containing theirs"
    density "sum(weights[k] / sum(weights) density of components[k])"
    drawn Unknown;
}
