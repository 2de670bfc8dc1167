//! Names and words of other languages and libraries (Stan, PyMC, WebPPL, BUGS, numpy), and
//! what they are called here: for messages, and for the search of the reference.

/// Where a foreign word counts as the beginning of a statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Before {
    /// Before anything.
    Anything,
    /// Before a name.
    Name,
    /// Before a block, or before a name and a block.
    Block,
}

/// Words that begin statements of other languages, and the hint for each.
pub const FOREIGN_STATEMENTS: &[(&str, Before, &str)] = &[
    (
        "def function func fun defun define",
        Before::Name,
        "a function is declared by `fn f(x) { … }`; its value is the last expression, without `;`",
    ),
    ("return yield", Before::Anything, "the value of a body is its last expression, without `;`"),
    (
        "var const val auto mut set",
        Before::Name,
        "a value is bound by `let x = e;`, a random choice made by `x ~ d;`",
    ),
    (
        "int real float double bool string vector matrix array",
        Before::Name,
        "names are not declared: `let x = e;` binds a value, `x ~ d;` makes a random choice",
    ),
    (
        "import from using use require load",
        Before::Anything,
        "another file is read by `include \"file.pcad\" as name;`",
    ),
    (
        "model parameters transformed generated program module begin",
        Before::Block,
        "the statements of a model are written at the top level, one after another",
    ),
    (
        "while loop do until",
        Before::Anything,
        "write `for i in a .. b { … }`, or a function that calls itself",
    ),
    ("elif elseif elsif", Before::Anything, "write `else if`"),
    ("switch match case cond", Before::Anything, "write `if … { } else if … { } else { }`"),
    ("class struct type enum", Before::Name, "a record is written `{ x: 1, y: 2 }`"),
    ("print echo show", Before::Anything, "write `report e;`"),
    (
        "query condition constrain",
        Before::Anything,
        "`observe d = v;` observes data, `factor(logw);` adds a soft constraint",
    ),
    ("del delete", Before::Anything, "`forget name;` removes an observation"),
    (
        "global local static public private",
        Before::Anything,
        "a name is visible after the statement that binds it",
    ),
];

/// What is written here, the names by which other systems call it, and further words by
/// which the reference is searched. Underscores and dots separate words, as in queries.
pub const FOREIGN_NAMES: &[(&str, &str, &str)] = &[
    (
        "log_density",
        "normal_lpdf poisson_lpmf bernoulli_logit_lpmf lpdf lpmf logpdf logpmf log_prob",
        "logp target score pointwise likelihood",
    ),
    ("log_joint", "lp__", "target logp"),
    ("factor", "potential", "target"),
    ("truncated", "truncate", "t[ truncation bounded bounds censored lower upper cut i("),
    ("truncated_normal", "", "t[ truncate truncation bounded bounds"),
    ("flat", "halfflat half_flat", "improper uninformative half line positive lower upper"),
    ("normal", "gaussian Normal gauss randn", ""),
    ("uniform", "rand", ""),
    ("half_normal", "", "positive"),
    ("ordered", "positive_ordered", "sorted ascending increasing"),
    ("cholesky", "cholesky_decompose chol", "decomposition factor cov matrix"),
    ("solve", "mdivide_left mdivide_left_spd", "mdivide inverse linear system backslash linalg"),
    ("logdet", "log_determinant log_determinant_spd slogdet det", "determinant linalg"),
    ("gp", "", "gaussian process jitter nugget"),
    ("mv_normal", "multi_normal multi_normal_cholesky mvnormal", "multivariate"),
    ("lkj", "lkj_corr_cholesky", "correlation"),
    ("neg_binomial", "", "negative binomial nb overdispersed"),
    (
        "flip",
        "bernoulli bernoulli_logit bernoulli_lpmf",
        "coin logit_p invlogit logistic regression",
    ),
    ("binomial", "binomial_logit", "logit_p trials"),
    ("categorical", "categorical_logit", "softmax logit_p discrete"),
    ("poisson", "poisson_log", "log_rate counts"),
    ("matmul", "mm", "matrix multiply multiplication times"),
    (
        "fold",
        "scan accumulate reduce",
        "recurrence recursion cumulative time series autoregressive",
    ),
    ("log_sum_exp", "logsumexp", "mixture softmax"),
    ("expit", "inv_logit invlogit sigmoid", "logistic"),
    ("normal_cdf", "std_normal_cdf pnorm cdf Phi", "phi norm cdf probit"),
    ("factor(log_normal_cdf((mean - limit) / sd))", "censored Censored censor right_censored", ""),
    ("delayed", "kalman kalman_filter Kalman", "state space linear gaussian filter smoother"),
    ("log_normal_cdf", "normal_lcdf std_normal_lcdf log_ndtr", "log_phi logcdf lcdf probit"),
    ("log1m_exp", "log1mexp", "log1m"),
    ("iid", "", "independent plate shape replicate"),
    ("von_mises", "", "circular angle"),
    (
        "is_missing",
        "isna is_na isnan is_nan isnull",
        "na is.na nan null dropna complete.cases impute imputation",
    ),
    ("half_cauchy", "halfcauchy", "positive"),
    ("log", "ln", ""),
    ("len", "length size", ""),
    ("**", "power", ""),
    ("a .. b", "range", ""),
    ("report", "print", ""),
    ("an array, empty or not", "null None", ""),
    ("true", "True", ""),
    ("false", "False", ""),
];

/// Returns what is written here for a name of another system.
pub fn called_here(name: &str) -> Option<&'static str> {
    let row = FOREIGN_NAMES.iter().find(|(_, names, _)| names.split(' ').any(|n| n == name));
    row.filter(|_| !name.is_empty()).map(|(here, ..)| *here)
}
