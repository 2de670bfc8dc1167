//! Names known to inference blocks, user kernels and reports only: kernels, starts, monitors.
//!
//! This is their documentation and their arguments; what they do is the business of the engine. They are not values of
//! the model.

use super::{Arg, Kind, Row, Type, arg, opt};

const KERNELS: &str = "Kernels";
const CHOICES: &str = "Selections and starts";
const MONITORS: &str = "Monitors and reports";

/// What this version checks and documents but cannot run.
pub(super) const PLANNED: &[&str] = &["acceptance", "rhat", "ess", "snapshot"];

const fn name(
    name: &'static str,
    section: &'static str,
    args: &'static [Arg],
    returns: Type,
    doc: &'static str,
) -> Row {
    Row::new(Kind::Inference, name, section, args, returns, doc)
}

const SEL: Arg = arg("sel", Type::Selection, "The choices it moves.");
const MARGINAL: Arg = opt(
    "marginal",
    Type::Selection,
    "none",
    "Finite discrete choices that are summed out of the density it sees, then drawn given the rest. Those that no score \
     can read together are summed one by one, others jointly (at most 1000 joint values). What cannot be summed out is refused.",
);
const INNER: Arg = arg("move", Type::Kernel, "The kernel inside.");
const X: Arg = arg("x", Type::Any, "A number of the model, as in `collect`.");

pub(super) const TABLE: &[Row] = &[
    name(
        "mh",
        KERNELS,
        &[SEL],
        Type::Kernel,
        "Metropolis-Hastings that draws one of the selected choices anew from its prior.",
    ),
    name(
        "block",
        KERNELS,
        &[SEL],
        Type::Kernel,
        "Metropolis-Hastings that draws all selected choices together anew from their prior.",
    ),
    name(
        "drift",
        KERNELS,
        &[
            SEL,
            opt(
                "scale",
                Type::Num,
                "learnt",
                "A fixed step size in the unconstrained space, instead of one learnt in warm-up.",
            ),
        ],
        Type::Kernel,
        "Gaussian random walk in the unconstrained space of the support; discrete choices step to another value.",
    ),
    name(
        "gibbs",
        KERNELS,
        &[SEL],
        Type::Kernel,
        "Draws a selected finite discrete choice from its exact conditional, by enumeration of its values.",
    ),
    name(
        "elliptical",
        KERNELS,
        &[SEL],
        Type::Kernel,
        "Elliptical slice sampling of choices with a Gaussian prior: normal, mv_normal, gp (Murray et al. 2010).",
    ),
    name(
        "slice",
        KERNELS,
        &[
            SEL,
            opt(
                "width",
                Type::Num,
                "learnt",
                "The width of a step out, in the unconstrained space; without it, 1, and warm-up adapts it.",
            ),
            opt(
                "doubling",
                Type::Bool,
                "false",
                "The interval doubles instead of growing by steps: for slices much wider than `width`.",
            ),
        ],
        Type::Kernel,
        "Slice sampling of one number at a time with stepping out or doubling (Neal 2003).",
    ),
    name(
        "hmc",
        KERNELS,
        &[SEL, opt("steps", Type::Int, "10", "The leapfrog steps of one proposal."), MARGINAL],
        Type::Kernel,
        "Hamiltonian Monte Carlo; step size and metric are adapted in warm-up (Neal 2011).",
    ),
    name(
        "nuts",
        KERNELS,
        &[SEL, opt("max_depth", Type::Int, "10", "At most 2 to this power leapfrog steps."), MARGINAL],
        Type::Kernel,
        "The No-U-Turn sampler (Hoffman and Gelman 2014).",
    ),
    name(
        "mala",
        KERNELS,
        &[SEL, MARGINAL],
        Type::Kernel,
        "The Metropolis-adjusted Langevin algorithm: one gradient a proposal.",
    ),
    name(
        "knn",
        KERNELS,
        &[
            SEL,
            arg("bank", Type::Str, "A file made by `pcadlang learn`."),
            opt("k", Type::Int, "10", "How many neighbours."),
        ],
        Type::Kernel,
        "Independence proposal from the latents of the pictures in a bank that look most like the observed one.",
    ),
    name(
        "delayed",
        KERNELS,
        &[INNER, arg("at", Type::Selection, "The observation with a coarse surrogate.")],
        Type::Kernel,
        "Delayed acceptance: the surrogate of `observe … with coarse = …` decides first; only what passes is judged by the observation \
         itself (Christen and Fox 2005). Exact whatever the surrogate says, if it is possible wherever the observation is.",
    ),
    name(
        "temper",
        KERNELS,
        &[
            INNER,
            opt("levels", Type::Int, "6", "The number of temperatures."),
            opt("hottest", Type::Num, "0.01", "The lowest power of the likelihood; warm-up spaces the ladder."),
        ],
        Type::Kernel,
        "Replica exchange over powers of the likelihood: each step moves every replica, then neighbours swap (Geyer 1991).",
    ),
    name(
        "smc",
        KERNELS,
        &[INNER, opt("particles", Type::Int, "100", "The number of particles.")],
        Type::Kernel,
        "Whole states by annealed sequential Monte Carlo, moved by the kernel inside, accepted by their estimates of the evidence \
         (particle independent Metropolis-Hastings, Andrieu et al. 2010). No other kernel may move the state in between.",
    ),
    name(
        "abc",
        KERNELS,
        &[
            INNER,
            arg("eps", Type::Num, "The largest distance that is accepted."),
            opt(
                "particles",
                Type::Int,
                "none",
                "Each step draws a whole state by so many particles, as `smc` does, with tolerances that fall to `eps` (Del Moral \
                 et al. 2012).",
            ),
            opt("moves", Type::Int, "1", "How often each particle moves at each tolerance."),
        ],
        Type::Kernel,
        "Likelihood-free: the kernel inside proposes from the prior, and what it proposes stays if data drawn from it are near those \
         observed, in root mean square (Marjoram et al. 2003).",
    ),
    name(
        "modes",
        KERNELS,
        &[
            SEL,
            opt("tries", Type::Int, "200", "Draws from the prior among which starts are looked for."),
            opt("keep", Type::Int, "16", "How many of them, the likeliest, climb to a mode."),
            opt("steps", Type::Int, "60", "The most steps of a climb."),
            opt(
                "first",
                Type::Selection,
                "none",
                "Choices that climb alone in each draw, some steps, before draws are compared.",
            ),
            opt(
                "at",
                Type::Selection,
                "none",
                "Observations in whose place their coarse surrogates stand while modes are looked for.",
            ),
        ],
        Type::Kernel,
        "Jumps between modes. Its first step looks for them: the likeliest of some draws of the selected choices climb by L-BFGS, of \
         which half, and half again, go on to the top; in warm-up the state then becomes one of the modes, drawn by the Laplace estimates \
         of their evidence, and with `at` climbs on under the observations themselves (what no surrogate asks for is not among the modes). From then on all selected choices are proposed together from the Laplace approximations of all modes \
         (independent Metropolis-Hastings, Tierney 1994).",
    ),
    name(
        "optimize",
        KERNELS,
        &[SEL, opt("steps", Type::Int, "100", "The number of gradient steps.")],
        Type::Kernel,
        "Climbs to a mode of the posterior; for a start, or an answer in a hurry. Not a sampler.",
    ),
    name(
        "one",
        CHOICES,
        &[SEL],
        Type::Selection,
        "One of the selected choices, picked uniformly at each step; the ratio of their numbers is paid for.",
    ),
    name(
        "each",
        CHOICES,
        &[SEL],
        Type::Selection,
        "Each of the selected choices in turn, in the program's order: a sweep of as many steps. For mh, gibbs and drift.",
    ),
    name(
        "init",
        CHOICES,
        &[arg("start", Type::Kernel, "`prior()` or `best_of(n)`.")],
        Type::Kernel,
        "How a chain starts; without it, from the prior.",
    ),
    name(
        "anneal",
        CHOICES,
        &[arg("from", Type::Num, "The temperature at the start, at least 1.")],
        Type::Kernel,
        "In `warmup` only: raises the power of the likelihood from `1 / from` to 1 over the warm-up. With several starts kept, \
         population annealing: they move in turn, and the likelier have more offspring.",
    ),
    name("prior", CHOICES, &[], Type::Kernel, "A start drawn from the prior."),
    name(
        "best_of",
        CHOICES,
        &[
            arg("n", Type::Int, "How many draws from the prior."),
            opt(
                "keep",
                Type::Int,
                "1",
                "How many of the best begin a population that `anneal` thins out to one state.",
            ),
            opt(
                "from",
                Type::Kernel,
                "none",
                "A kernel of the program, by whose proposals each draw is moved before they are compared, whatever their densities say.",
            ),
        ],
        Type::Kernel,
        "A start: the draw from the prior with the highest log joint density.",
    ),
    name(
        "value",
        CHOICES,
        &[arg("at", Type::Selection, "The address of one choice.")],
        Type::Any,
        "The present value of a choice, in user kernels and conditions.",
    ),
    name("elapsed", MONITORS, &[], Type::Num, "The time since the chain began, in seconds."),
    name("steps", MONITORS, &[], Type::Int, "The number of kernel applications of this chain so far."),
    name("acceptance", MONITORS, &[], Type::Num, "The fraction of proposals that this chain accepted after warm-up."),
    name(
        "rhat",
        MONITORS,
        &[X],
        Type::Num,
        "Rank-normalised split R-hat over all chains, evaluated at step barriers (Vehtari et al. 2021).",
    ),
    name("ess", MONITORS, &[X], Type::Num, "The bulk effective sample size over all chains (Vehtari et al. 2021)."),
    name(
        "snapshot",
        MONITORS,
        &[arg("view", Type::Object("view"), "What is drawn.")],
        Type::Kernel,
        "Writes a picture of the view as it is now to the run's folder.",
    ),
    name(
        "summary",
        MONITORS,
        &[opt("sel", Type::Selection, "@**", "The choices summarised.")],
        Type::Any,
        "Mean, sd, interval, effective sample size and R-hat of each selected choice.",
    ),
    name(
        "best",
        MONITORS,
        &[arg("x", Type::Any, "An expression of the model.")],
        Type::Any,
        "Its value in the state with the highest log joint density.",
    ),
];
