//! Names of built-ins in other systems (Stan, PyMC, WebPPL, BUGS, numpy), for the search of the
//! reference.

/// Built-ins with their other names. Underscores and dots separate words, as in queries.
pub(in crate::lang::builtins) const ALIASES: &[(&str, &str)] = &[
    (
        "log_density",
        "normal_lpdf poisson_lpmf bernoulli_logit_lpmf lpdf lpmf logp logpdf logpmf log_prob target score pointwise likelihood",
    ),
    ("log_joint", "lp__ target logp"),
    ("factor", "target potential"),
    ("truncated", "t[ truncate truncation bounded bounds censored lower upper cut i("),
    ("truncated_normal", "t[ truncate truncation bounded bounds"),
    ("flat", "improper uninformative half line halfflat half_flat positive lower upper"),
    ("half_normal", "positive"),
    ("ordered", "sorted ascending increasing positive_ordered"),
    ("cholesky", "cholesky_decompose decomposition chol factor cov matrix"),
    ("solve", "mdivide mdivide_left mdivide_left_spd inverse linear system backslash linalg"),
    ("logdet", "log_determinant determinant log_determinant_spd slogdet det linalg"),
    ("gp", "gaussian process jitter nugget"),
    ("mv_normal", "multi_normal multi_normal_cholesky mvnormal multivariate"),
    ("lkj", "lkj_corr_cholesky correlation"),
    ("neg_binomial", "negative binomial nb overdispersed"),
    ("flip", "bernoulli coin bernoulli_logit bernoulli_lpmf logit_p invlogit logistic regression"),
    ("binomial", "binomial_logit logit_p trials"),
    ("categorical", "categorical_logit softmax logit_p discrete"),
    ("poisson", "poisson_log log_rate counts"),
    ("matmul", "matrix multiply multiplication times mm"),
    ("fold", "scan recurrence recursion accumulate reduce cumulative time series autoregressive"),
    ("log_sum_exp", "logsumexp mixture softmax"),
    ("expit", "inv_logit invlogit sigmoid logistic"),
    ("normal_cdf", "phi std_normal_cdf pnorm norm cdf probit"),
    ("log_normal_cdf", "normal_lcdf std_normal_lcdf log_phi logcdf log_ndtr lcdf probit"),
    ("log1m_exp", "log1mexp log1m"),
    ("iid", "independent plate shape replicate"),
    ("von_mises", "circular angle"),
    (
        "is_missing",
        "na is.na isna isnan isnull is_nan nan null dropna complete.cases impute imputation",
    ),
    ("half_cauchy", "halfcauchy positive"),
];
