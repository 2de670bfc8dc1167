//! The kernels that the tests of kernels run. Both the tests and the table of
//! `docs/reference/kernels.md` (`tests/inference/kernels.rs`) read these lists: to add a kernel to
//! a proof, add a line here; the row of the table follows automatically.

/// A mixture of a kernel with one that reaches every state.
macro_rules! with_mh {
    ($k:literal) => {
        concat!("mix { 0.6 => ", $k, "; 0.4 => mh(one(@**)); }")
    };
}

pub mod random;

/// Kernels compared with exact answers (`tests/inference/exact.rs`): one or several
/// statements each.
pub mod exact {
    pub const CONJUGATE: &[&str] = &[
        "mh(one(@**))",
        "block(@**)",
        "drift(@x)",
        "elliptical(@x)",
        "hmc(@x, steps = 4)",
        "mala(@x)",
        "nuts(@x)",
        "slice(@x)",
        "slice(@x, width = 0.3)",
        "slice(@x, doubling = true)",
        "slice(@x, width = 0.05, doubling = true)",
        "temper(drift(@x), levels = 3)",
        "smc(drift(@x, scale = 1), particles = 8)",
        "mix { 0.3 => mh(@x); 0.3 => drift(@x); 0.4 => elliptical(@x); }",
    ];
    /// Compared by the whole distribution, which has two modes of different widths.
    pub const SLICES: &[&str] = &[
        "slice(@x, width = 1.5)",
        "slice(@x, width = 0.1, doubling = true)",
        "slice(@x, width = 1.5, doubling = true)",
        "slice(@x, width = 30, doubling = true)",
        "modes(@x, tries = 30, keep = 8, steps = 20)",
    ];
    /// With a surrogate that disagrees with the likelihood.
    pub const DELAYED: &[&str] = &[
        "delayed(mh(@x), @y)",
        "delayed(drift(@x), @y)",
        "delayed(slice(@x), @y)",
        "delayed(nuts(@x), @y)",
        "delayed(pull(0.8), @y)",
    ];
    /// Labels summed out: of a mixture, and of a chain of labels that depend on each
    /// other.
    pub const SUMMED_OUT: &[&str] = &[
        "nuts(@m, marginal = @z)",
        "hmc(@m, steps = 5, marginal = @z)",
        "mala(@m, marginal = @z)",
        "nuts(@m, marginal = @z[0] + @z[1]); gibbs(one(@z));",
    ];
    pub const BETA_BINOMIAL: &[&str] = &["mh(@p)", "drift(@p)"];
    /// Evidence and changing structure by particles; likelihood-free inference.
    pub const SIMULATED: &[&str] = &[
        "smc(drift(@x, scale = 1), particles = 40)",
        "smc(mh(one(@**)), particles = 20)",
        "abc(mh(@p), eps = 0.5)",
    ];
    pub const DEPENDENT_SUPPORT: &[&str] =
        &["mh(one(@**))", "block(@**)", "drift(@**)", "drift(one(@**))"];
    pub const RECURSION: &[&str] = &[
        "mh(one(@**))",
        "gibbs(one(@**))",
        "block(@**)",
        "drift(one(@**))",
        "mh(one(@a/geom#2))",
        "mix { 0.5 => mh(one(@**)); 0.5 => gibbs(each(@**)); }",
        "temper(mh(one(@**)), levels = 3)",
    ];
    pub const BRANCHES: &[&str] = &[
        "mh(one(@**));",
        "gibbs(@c); drift(@x);",
        "modes($continuous, tries = 20, keep = 4, steps = 10); mh(one(@**));",
        "block(@**);",
        "mh(@c); elliptical(one($gaussian));",
        "temper(mh(one(@**)), levels = 3);",
    ];
    pub const HIDDEN_MARKOV: &[&str] = &[
        "gibbs(one(@s))",
        "mh(one(@s))",
        "drift(one(@s))",
        "gibbs(each(@s))",
        "mh(each(@s))",
        "drift(each(@s))",
        "exact(@s)",
    ];
    pub const OPEN_UNIVERSE: &[&str] = &[
        "mh(one($discrete)); drift(one($continuous));",
        "gibbs(one($discrete)); mh(one($continuous)); mh(one($discrete));",
    ];
    pub const ALL: &[&[&str]] = &[
        CONJUGATE,
        SLICES,
        DELAYED,
        SUMMED_OUT,
        BETA_BINOMIAL,
        SIMULATED,
        DEPENDENT_SUPPORT,
        RECURSION,
        BRANCHES,
        HIDDEN_MARKOV,
        OPEN_UNIVERSE,
    ];
}

/// Reversible, with the right marginal (`tests/inference/balance.rs`).
pub mod balance {
    pub const DISCRETE: &[&str] = &[
        "mh(one(@**))",
        "block(@**)",
        "block(one(@**))",
        "gibbs(one(@**))",
        "drift(one(@**), 1)",
        "drift(@**, 1)",
        with_mh!("gibbs(@a)"),
        with_mh!("mh(@b)"),
        with_mh!("drift(@a, 1)"),
        with_mh!("exact(@a)"),
    ];
    pub const SUPPORT: &[&str] = &[
        "mh(one(@**))",
        "block(@**)",
        "drift(one(@**), 1)",
        "drift(@**, 0.8)",
        with_mh!("drift(@p1, 1)"),
        with_mh!("mh(@p2)"),
        "hmc(@**, steps = 3)",
        "mala(@**)",
        "nuts(@**)",
        with_mh!("modes(@**, tries = 20, keep = 4, steps = 10)"),
        "slice(one(@**))",
        with_mh!("slice(@p1, width = 2)"),
        "slice(one(@**), width = 0.2, doubling = true)",
    ];
    /// With labels summed out; without `mh`, these move everything by themselves.
    pub const MIXTURE: &[&str] = &[
        "nuts($continuous, marginal = $finite)",
        "hmc($continuous, steps = 3, marginal = $finite)",
        "mala($continuous, marginal = $finite)",
        with_mh!("nuts(@s, marginal = @a)"),
    ];
    /// Maps that are their own inverses, declared in the program.
    pub const MAPS: &[&str] = &["mix { 0.5 => scaled(); 0.5 => split(); }", with_mh!("swap()")];
    pub const FINITE_SUPPORT: &[&str] = &[
        "mix { 0.5 => mh(one(@**)); 0.5 => block(@**); }",
        "block(@**)",
        "mix { 0.5 => drift(@**, 1); 0.5 => block(@**); }",
        "mix { 0.5 => drift(one(@**), 1); 0.5 => block(@**); }",
        "mix { 0.5 => gibbs(one(@**)); 0.5 => block(@**); }",
    ];
    pub const COUNTS: &[&str] = &[
        "mh(one(@**))",
        "block(@**)",
        "drift(one(@**), 1)",
        with_mh!("drift(@**, 1)"),
        "mix { 0.5 => gibbs(@k); 0.5 => drift(@n, 2); }",
    ];
    pub const GAUSSIAN: &[&str] = &[
        "elliptical(@**)",
        "elliptical(one(@**))",
        with_mh!("elliptical(@a)"),
        with_mh!("elliptical(@b)"),
        "drift(@**, 0.9)",
        "drift(one(@**), 1.2)",
        "mh(one(@**))",
        "block(@**)",
    ];
    pub const STRUCTURE: &[&str] = &[
        "mh(one(@**))",
        "block(@**)",
        "block(one(@**))",
        "drift(one(@**), 0.7)",
        "drift(@**, 0.7)",
        with_mh!("gibbs(@c)"),
        with_mh!("gibbs(one($finite))"),
        with_mh!("drift($continuous, 0.8)"),
        with_mh!("hmc($continuous, steps = 3)"),
        with_mh!("mala($continuous)"),
        with_mh!("nuts($continuous)"),
        with_mh!("slice($continuous)"),
        with_mh!("slice($continuous, width = 0.1, doubling = true)"),
        with_mh!("block(@x/**)"),
    ];
    pub const SAME_NAME: &[&str] = &[
        "mh(one(@**))",
        "block(@**)",
        "drift(one(@**), 0.7)",
        "drift(@**, 0.7)",
        with_mh!("gibbs(@c)"),
        with_mh!("drift(@x/a, 0.8)"),
    ];
    pub const SHARED: &[&str] = &[
        "mh(one(@**))",
        "block(@**)",
        "drift(one(@**), 0.7)",
        "drift(@**, 0.7)",
        with_mh!("gibbs(@c)"),
        with_mh!("drift(@x/**, 0.8)"),
        with_mh!("slice(@x/**)"),
        with_mh!("hmc($continuous, steps = 3)"),
    ];
    pub const MOVING: &[&str] = &[
        "mh(one(@**))",
        "block(@**)",
        "drift(one(@**), 0.7)",
        "drift(@**, 0.7)",
        with_mh!("gibbs(@c)"),
        with_mh!("slice(@x)"),
        with_mh!("hmc(@x, steps = 3)"),
    ];
    pub const ELEMENTS: &[&str] = &[
        "mh(one(@**))",
        "block(@**)",
        "drift(one(@**), 0.8)",
        "drift(@**, 0.6)",
        "mix { 0.5 => gibbs(@n); 0.5 => drift(@z, 0.7); }",
        with_mh!("drift(one(@z), 0.7)"),
    ];
    pub const SHARED_GROUPS: &[&str] = &[
        "mh(one(@**))",
        "block(@**)",
        "drift(one(@**), 0.8)",
        with_mh!("drift(@**, 0.6)"),
        "mix { 0.5 => gibbs(one($finite)); 0.5 => drift($continuous, 0.8); }",
        "mix { 0.5 => block(one($finite)); 0.5 => mh(one($continuous)); }",
    ];
    /// With a surrogate that disagrees with the likelihood.
    pub const SURROGATE: &[&str] = &[
        "delayed(mh(one(@**)), @y)",
        "delayed(block(@**), @y)",
        "delayed(drift(one(@**), 0.7), @y)",
        with_mh!("delayed(gibbs(one($finite)), @y)"),
        with_mh!("delayed(knn($continuous, bank = \"b\"), @y)"),
    ];
    /// With an observation that the first stage leaves out; no move between branches is accepted.
    pub const WAITING: &[&str] = &[
        "delayed(mh(one(@**)), @y)",
        "delayed(block(@**), @y, then = @z)",
        with_mh!("delayed(drift(one(@**), 0.7), @y, then = @z)"),
    ];
    /// Proposals from a few neighbours that are unrelated to the data.
    pub const NEIGHBOURS: &[&str] = &[
        "knn(@**, bank = \"b\")",
        "mix { 0.6 => knn(one(@**), bank = \"b\", k = 2); 0.4 => block(@**); }",
        "mix { 0.6 => knn(@**, bank = \"b\", k = 1); 0.4 => block(@**); }",
    ];
    pub const NEIGHBOURS_OF_SOME: &[&str] =
        &[with_mh!("knn($continuous, bank = \"b\")"), with_mh!("knn(@c, bank = \"b\")")];
    /// Models of fixed structure.
    pub const FIXED: &[&[&str]] =
        &[DISCRETE, SUPPORT, MIXTURE, MAPS, FINITE_SUPPORT, COUNTS, GAUSSIAN, NEIGHBOURS];
    /// Models whose choices appear, vanish, change their support or are shared.
    pub const CHANGING: &[&[&str]] = &[
        STRUCTURE,
        SURROGATE,
        SAME_NAME,
        SHARED,
        MOVING,
        ELEMENTS,
        SHARED_GROUPS,
        NEIGHBOURS,
        NEIGHBOURS_OF_SOME,
    ];
}

/// Parameters and data moved alternately, with the data as choices
/// (`tests/inference/balance.rs`); `%` is the selection.
pub const BY_TURNS: &[&str] = &["mh(one(%))", "block(%)", "drift(%, 0.7)", "drift(one(%), 1)"];

/// Simulation-based calibration and Geweke's test (`tests/inference/calibration.rs`).
pub const CALIBRATED: &[&str] = &[
    "mh(one(@**))",
    "block(@**)",
    "drift(one(@**))",
    "mh(@c); drift(@m + @s);",
    "gibbs(@c); drift(@m); drift(@s);",
    "gibbs(@c); slice(@s); elliptical(@m);",
    "mh(@c); hmc($continuous, steps = 5);",
    "mh(@c); mala($continuous);",
    "mh(@c); nuts($continuous, max_depth = 5);",
    "temper(mh(one(@**)), levels = 3);",
    "gibbs(each($finite)); drift(each($continuous));",
    "knn(@**, bank = \"b\"); mh(one(@**));",
    "knn(one(@**), bank = \"b\", k = 2); block(@**);",
];

/// Simulation-based calibration only: `smc` and `abc` keep an estimate made under the
/// data of the previous step, which Geweke's test replaces.
pub const RANKED: &[&str] =
    &["smc(drift(one(@**)), particles = 20)", "smc(mh(one(@**)), particles = 10)"];
/// The same on counts: simulated data are within `eps` only if they are equal, so `abc`
/// is exact.
pub const RANKED_ON_COUNTS: &[&str] =
    &["abc(mh(one(@**)), eps = 0.5)", "abc(block(@**), eps = 0.5)"];

/// Chains that are bit-identical with and without incremental updates, on any number of
/// threads (`tests/trace/updates.rs`).
pub const INCREMENTAL: &str = "mix { 0.3 => mh(one(@**)); 0.2 => gibbs(one($finite)); 0.2 => drift(one(@**)); 0.2 => elliptical(one($gaussian)); 0.1 => block(@**); 0.1 => slice(one($continuous)); }";

/// A column of the table: its name, what the test shows, its file, and the statements
/// that it runs.
pub struct Proof {
    pub name: &'static str,
    pub shows: &'static str,
    pub file: &'static str,
    pub statements: &'static [&'static [&'static str]],
}

/// The columns of the table.
pub const PROOFS: &[Proof] = &[
    Proof {
        name: "exact answers",
        shows: "posterior means against conjugate, enumerated or integrated ones, within five standard errors",
        file: "tests/inference/exact.rs",
        statements: exact::ALL,
    },
    Proof {
        name: "balance",
        shows: "counts of moves there and back are symmetric, and the marginal is the posterior",
        file: "tests/inference/balance.rs",
        statements: balance::FIXED,
    },
    Proof {
        name: "changing structure",
        shows: "the same where choices appear, vanish, change form or are shared",
        file: "tests/inference/balance.rs",
        statements: balance::CHANGING,
    },
    Proof {
        name: "random programs",
        shows: "exact draws remain exact draws, in random programs with enumerated posteriors",
        file: "tests/inference/enumeration",
        statements: random::ALL,
    },
    Proof {
        name: "by turns",
        shows: "parameters and data, sampled alternately as choices, keep the moments of their joint prior",
        file: "tests/inference/balance.rs",
        statements: &[BY_TURNS],
    },
    Proof {
        name: "SBC",
        shows: "true values have uniform ranks among draws given data simulated from them",
        file: "tests/inference/calibration.rs",
        statements: &[CALIBRATED, RANKED, RANKED_ON_COUNTS],
    },
    Proof {
        name: "Geweke",
        shows: "alternating the kernel with simulating data leaves the joint distribution invariant",
        file: "tests/inference/calibration.rs",
        statements: &[CALIBRATED],
    },
    Proof {
        name: "posteriordb",
        shows: "with the default plan, means and mean squares of six reference posteriors: |z| < 4 at more than 400 effective draws",
        file: "tests/inference/posteriordb.rs",
        statements: &[&["nuts($continuous)"]],
    },
    Proof {
        name: "incremental = full",
        shows: "the same chain, bit for bit, whether updates are incremental or re-run the whole program",
        file: "tests/trace/updates.rs",
        statements: &[&[INCREMENTAL]],
    },
];

impl Proof {
    /// Whether a kernel is among the statements.
    pub fn runs(&self, kernel: &str) -> bool {
        let call = format!("{kernel}(");
        let begins = |text: &str, i: usize| {
            !text[..i].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == '@')
        };
        let named = |text: &&str| text.match_indices(&call).any(|(i, _)| begins(text, i));
        self.statements.iter().copied().flatten().any(named)
    }
}
