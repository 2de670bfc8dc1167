//! Names that exist only in inference blocks, user kernels and reports: kernels, starts,
//! monitors.
//!
//! This module declares and documents them; the engine implements them. They are not
//! values of the model.

use super::{Arg, Builtin, Inference, Kind, Row, Type, arg, opt};

const KERNELS: &str = "Kernels";
const CHOICES: &str = "Selections and starts";
const MONITORS: &str = "Monitors and reports";

impl Builtin {
    /// Whether this version only checks and documents it but cannot run it.
    pub fn is_planned(&self) -> bool {
        matches!(self.kind, Kind::Inference(Inference::Planned))
    }
}

const fn name(
    what: Inference,
    name: &'static str,
    section: &'static str,
    args: &'static [Arg],
    returns: Type,
    doc: &'static str,
) -> Row {
    Row::new(Kind::Inference(what), name, section, args, returns, doc)
}

const fn kernel(
    what: Inference,
    name: &'static str,
    args: &'static [Arg],
    doc: &'static str,
) -> Row {
    self::name(what, name, KERNELS, args, Type::Kernel, doc)
}

const SEL: Arg = arg("sel", Type::Selection, "The choices it moves.");
const MARGINAL: Arg = opt(
    "marginal",
    Type::Selection,
    "none",
    "Finite discrete choices to marginalise: they are summed out of the density and then drawn \
     given the rest. Choices that no score depends on together are summed one by one, others \
     jointly: at most 1000 joint values, or chains and trees of any length where their density \
     can be recorded. Choices that cannot be summed out are an error.",
);
const INNER: Arg = arg("move", Type::Kernel, "The inner kernel.");
const X: Arg = arg("x", Type::Any, "A numeric quantity of the model, as in `collect`.");

pub(super) const TABLE: &[Row] = &[
    kernel(
        Inference::Mh,
        "mh",
        &[SEL],
        "Metropolis-Hastings that proposes a single selected choice from its prior.",
    ),
    kernel(
        Inference::Block,
        "block",
        &[SEL],
        "Metropolis-Hastings that proposes all selected choices jointly from their prior.",
    ),
    kernel(
        Inference::Drift,
        "drift",
        &[
            SEL,
            opt(
                "scale",
                Type::Num,
                "learnt",
                "A fixed step size in the unconstrained space, instead of one adapted in warm-up.",
            ),
        ],
        "Gaussian random walk in the unconstrained space; discrete choices move to another value.",
    ),
    kernel(
        Inference::Gibbs,
        "gibbs",
        &[SEL],
        "Draws a selected finite discrete choice from its full conditional, by enumeration of its values.",
    ),
    kernel(
        Inference::Elliptical,
        "elliptical",
        &[SEL],
        "Elliptical slice sampling of choices with a Gaussian prior: normal, mv_normal, gp (Murray et al. 2010).",
    ),
    kernel(
        Inference::Slice,
        "slice",
        &[
            SEL,
            opt(
                "width",
                Type::Num,
                "learnt",
                "The width of the initial interval, in the unconstrained space; by default 1, adapted in warm-up.",
            ),
            opt(
                "doubling",
                Type::Bool,
                "false",
                "Expands the interval by doubling instead of stepping out: for slices much wider than `width`.",
            ),
        ],
        "Slice sampling of one number at a time with stepping out or doubling (Neal 2003).",
    ),
    kernel(
        Inference::Hmc,
        "hmc",
        &[
            SEL,
            opt("steps", Type::Int, "10", "The number of leapfrog steps per proposal."),
            MARGINAL,
        ],
        "Hamiltonian Monte Carlo; step size and metric are adapted in warm-up (Neal 2011).",
    ),
    kernel(
        Inference::Nuts,
        "nuts",
        &[
            SEL,
            opt(
                "max_depth",
                Type::Int,
                "10",
                "The maximum tree depth: at most 2^max_depth leapfrog steps.",
            ),
            MARGINAL,
        ],
        "The No-U-Turn sampler (Hoffman and Gelman 2014).",
    ),
    kernel(
        Inference::Mala,
        "mala",
        &[SEL, MARGINAL],
        "The Metropolis-adjusted Langevin algorithm: one gradient per proposal.",
    ),
    kernel(
        Inference::Knn,
        "knn",
        &[
            SEL,
            arg("bank", Type::Str, "A file made by `pcadlang learn`."),
            opt("k", Type::Int, "10", "The number of neighbours."),
        ],
        "Data-driven independence proposal: a kernel density estimate over the latents of the \
         bank's pictures nearest to the observed one.",
    ),
    kernel(
        Inference::Delayed,
        "delayed",
        &[INNER, arg("at", Type::Selection, "The observation with a coarse surrogate.")],
        "Delayed acceptance: proposals are screened by the surrogate of `observe … with coarse = \
         …`; only those that pass are evaluated under the observation itself (Christen and Fox \
         2005). Exact for any surrogate that is positive wherever the likelihood is.",
    ),
    kernel(
        Inference::Temper,
        "temper",
        &[
            INNER,
            opt("levels", Type::Int, "6", "The number of temperatures."),
            opt(
                "hottest",
                Type::Num,
                "0.01",
                "The lowest power of the likelihood; warm-up adapts the ladder of temperatures.",
            ),
        ],
        "Replica exchange (parallel tempering) over powers of the likelihood: each step updates \
         every replica, then proposes swaps of neighbours (Geyer 1991).",
    ),
    kernel(
        Inference::Smc,
        "smc",
        &[INNER, opt("particles", Type::Int, "100", "The number of particles.")],
        "Proposes complete states by annealed sequential Monte Carlo with the inner kernel, \
         accepted by their evidence estimates (particle independent Metropolis-Hastings, Andrieu \
         et al. 2010). No other kernel may change the state in between.",
    ),
    kernel(
        Inference::Abc,
        "abc",
        &[
            INNER,
            arg("eps", Type::Num, "The tolerance: the largest accepted distance."),
            opt(
                "particles",
                Type::Int,
                "none",
                "With this many particles, each step draws a complete state as `smc` does, with \
                 tolerances decreasing to `eps` (Del Moral et al. 2012).",
            ),
            opt("moves", Type::Int, "1", "The number of moves of each particle at each tolerance."),
        ],
        "Approximate Bayesian computation (likelihood-free): the inner kernel targets the prior, \
         and a proposal is accepted if data simulated from it are within `eps` of the observed \
         data in root mean square (Marjoram et al. 2003).",
    ),
    kernel(
        Inference::Modes,
        "modes",
        &[
            SEL,
            opt(
                "tries",
                Type::Int,
                "200",
                "The number of draws from the prior, from which starting points are chosen.",
            ),
            opt(
                "keep",
                Type::Int,
                "16",
                "The number of these, the most probable, that climb to a mode.",
            ),
            opt("steps", Type::Int, "60", "The maximum number of optimisation steps per climb."),
            opt(
                "first",
                Type::Selection,
                "none",
                "Choices that are optimised alone for some steps in each draw, before draws are compared.",
            ),
            opt(
                "at",
                Type::Selection,
                "none",
                "Observations that are replaced by their coarse surrogates during the search for modes.",
            ),
        ],
        "Jumps between modes. The first step searches for them: the most probable draws of the \
         selected choices climb by L-BFGS, in rounds that each keep the better half; in warm-up \
         the state then moves to one of the modes, drawn by the Laplace estimates of their \
         evidence, and with `at` it climbs further under the observations themselves (choices \
         that no surrogate depends on are left out). After that, all selected choices are \
         proposed jointly from a mixture of Laplace approximations at the modes (independent \
         Metropolis-Hastings, Tierney 1994).",
    ),
    kernel(
        Inference::Optimize,
        "optimize",
        &[SEL, opt("steps", Type::Int, "100", "The number of gradient steps.")],
        "Climbs to a mode of the posterior: for starting points or quick answers. Not a sampler.",
    ),
    name(
        Inference::One,
        "one",
        CHOICES,
        &[SEL],
        Type::Selection,
        "One of the selected choices, picked uniformly at each step; the acceptance ratio \
         corrects for changes in their number.",
    ),
    name(
        Inference::Each,
        "each",
        CHOICES,
        &[SEL],
        Type::Selection,
        "Each of the selected choices in turn, in program order: a sweep with one step per \
         choice. For mh, gibbs and drift.",
    ),
    name(
        Inference::Init,
        "init",
        CHOICES,
        &[arg("start", Type::Kernel, "`prior()` or `best_of(n)`.")],
        Type::Kernel,
        "Sets how a chain starts; by default, from the prior.",
    ),
    name(
        Inference::Anneal,
        "anneal",
        CHOICES,
        &[arg("from", Type::Num, "The initial temperature, at least 1.")],
        Type::Kernel,
        "In `warmup` only: raises the power of the likelihood from `1 / from` to 1 over the \
         warm-up. If several starts are kept, this is population annealing: they move in turn, \
         and are resampled by their weights.",
    ),
    name(Inference::Prior, "prior", CHOICES, &[], Type::Kernel, "A start drawn from the prior."),
    name(
        Inference::BestOf,
        "best_of",
        CHOICES,
        &[
            arg("n", Type::Int, "The number of draws from the prior."),
            opt(
                "keep",
                Type::Int,
                "1",
                "The number of best draws to start a population, which `anneal` reduces to one state.",
            ),
            opt(
                "from",
                Type::Kernel,
                "none",
                "A kernel declared in the program: its proposals, always accepted, move each draw \
                 before the draws are compared.",
            ),
        ],
        Type::Kernel,
        "A start: the draw from the prior with the highest log joint density.",
    ),
    name(
        Inference::Value,
        "value",
        CHOICES,
        &[arg("at", Type::Selection, "The address of one choice.")],
        Type::Any,
        "The current value of a choice, in user kernels and conditions.",
    ),
    name(
        Inference::Elapsed,
        "elapsed",
        MONITORS,
        &[],
        Type::Num,
        "The time since the chain started, in seconds.",
    ),
    name(
        Inference::Steps,
        "steps",
        MONITORS,
        &[],
        Type::Int,
        "The number of kernel applications in this chain so far.",
    ),
    name(
        Inference::Planned,
        "acceptance",
        MONITORS,
        &[],
        Type::Num,
        "The acceptance rate of this chain after warm-up.",
    ),
    name(
        Inference::Planned,
        "rhat",
        MONITORS,
        &[X],
        Type::Num,
        "Rank-normalised split R-hat over all chains, evaluated at step barriers (Vehtari et al. 2021).",
    ),
    name(
        Inference::Planned,
        "ess",
        MONITORS,
        &[X],
        Type::Num,
        "The bulk effective sample size over all chains (Vehtari et al. 2021).",
    ),
    name(
        Inference::Planned,
        "snapshot",
        MONITORS,
        &[arg("view", Type::Object("view"), "The view to draw.")],
        Type::Kernel,
        "Writes a picture of the current view to the run's folder.",
    ),
    name(
        Inference::Reported,
        "summary",
        MONITORS,
        &[opt("sel", Type::Selection, "@**", "The choices to summarise.")],
        Type::Any,
        "Mean, sd, interval, effective sample size and R-hat of each selected choice.",
    ),
    name(
        Inference::Reported,
        "best",
        MONITORS,
        &[arg("x", Type::Any, "An expression of the model.")],
        Type::Any,
        "Its value in the state with the highest log joint density.",
    ),
];
