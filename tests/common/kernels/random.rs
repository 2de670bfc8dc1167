//! The kernels that random programs run, as statements of a plan; `%` stands for the
//! selection that is summed out.

/// Kernels for all choices.
pub const ANY: &[&str] = &[
    "mh(one(@**));",
    "mh(each(@**));",
    "block(@**);",
    "block(one(@**));",
    "drift(one(@**), 0.8);",
    "drift(@**, 0.5);",
    "drift(one(@**));",
    "drift(each(@**), 0.8);",
    "knn(@**, bank = \"b\");",
    "knn(one(@**), bank = \"b\", k = 2);",
    "temper(mh(one(@**)), levels = 3);",
];
/// Kernels for finite choices.
pub const DISCRETE: &[&str] = &["gibbs(one($finite));", "gibbs(each($finite));"];
/// Kernels for numeric choices.
pub const CONTINUOUS: &[&str] = &[
    "slice(one($continuous));",
    "slice(each($continuous));",
    "drift(each($continuous), 0.8);",
    "slice($continuous, width = 0.3, doubling = true);",
    "elliptical($gaussian);",
    "elliptical(one($gaussian));",
    "hmc($continuous, steps = 3);",
    "mala($continuous);",
    "nuts($continuous, max_depth = 4);",
    "nuts(one($continuous), max_depth = 3);",
    "modes($continuous, tries = 10, keep = 3, steps = 10);",
];
/// Kernels that are run inside of `delayed`.
pub const REVERSIBLE: &[&str] =
    &["mh(one(@**))", "gibbs(one($finite))", "block(@**)", "drift(one(@**), 0.7)"];
/// Kernels that can sum out other choices.
pub const SUMMING: &[&str] = &[
    "hmc($continuous, steps = 2, marginal = %);",
    "mala($continuous, marginal = %);",
    "nuts($continuous, max_depth = 2, marginal = %);",
];
/// Joint draws of finite choices, given the rest.
pub const EXACT: &[&str] = &["exact($finite);", "exact(%);"];
/// All of them.
pub const ALL: &[&[&str]] =
    &[ANY, DISCRETE, CONTINUOUS, REVERSIBLE, SUMMING, EXACT, &["delayed(mh(one(@**)), @y);"]];
