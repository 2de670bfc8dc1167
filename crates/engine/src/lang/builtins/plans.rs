//! Names that exist only in inference blocks, user kernels and reports: selections, starts,
//! monitors. They are not values of the model.

use super::{Arg, Default, Kind, PlanForm, Row, Type, arg, opt};

const CHOICES: &str = "Selections and starts";
const MONITORS: &str = "Monitors and reports";

const fn name(
    what: PlanForm,
    name: &'static str,
    section: &'static str,
    args: &'static [Arg],
    returns: Type,
    doc: &'static str,
) -> Row {
    Row::new(Kind::Plan(what), name, section, args, returns, doc)
}

const SEL: Arg = arg("sel", Type::Selection, "The choices it moves.");

pub(super) const TABLE: &[Row] = &[
    name(
        PlanForm::One,
        "one",
        CHOICES,
        &[SEL],
        Type::Selection,
        "One of the selected choices, picked uniformly at each step; the acceptance ratio \
         corrects for changes in their number.",
    ),
    name(
        PlanForm::Each,
        "each",
        CHOICES,
        &[SEL],
        Type::Selection,
        "Each of the selected choices in turn, in program order: a sweep with one step per \
         choice. The choices may change \
         from one step to the next.",
    ),
    name(
        PlanForm::Init,
        "init",
        CHOICES,
        &[arg("start", Type::Kernel, "`prior()`, `best_of(n)` or `unconstrained()`.")],
        Type::Kernel,
        "Sets how a chain starts; by default, from the prior.",
    ),
    name(
        PlanForm::Anneal,
        "anneal",
        CHOICES,
        &[arg("from", Type::Num, "The initial temperature, at least 1.")],
        Type::Kernel,
        "In `warmup` only: raises the power of the likelihood from `1 / from` to 1 over the \
         warm-up. If several starts are kept, this is population annealing: they move in turn, \
         and are resampled by their weights.",
    ),
    name(
        PlanForm::Prior,
        "prior",
        CHOICES,
        &[arg("n", Type::Int, "The number of draws.").or(Default::Num(1.0))],
        Type::Kernel,
        "A start drawn from the prior: one of `n` draws, with probability proportional to its \
         likelihood, so that chains start apart.",
    ),
    name(
        PlanForm::Unconstrained,
        "unconstrained",
        CHOICES,
        &[arg("n", Type::Int, "The number of restarts.").or(Default::Num(4.0))],
        Type::Kernel,
        "A start for vague priors, as in Stan: continuous choices are uniform on (-2, 2) in the \
         unconstrained space, others are drawn from the prior; where that is impossible the \
         interval shrinks. A few steps of L-BFGS follow \
         while they gain much. One of `n` such states is taken, with probability proportional \
         to its density in that space.",
    ),
    name(
        PlanForm::BestOf,
        "best_of",
        CHOICES,
        &[
            arg("n", Type::Int, "The number of draws from the prior."),
            arg("keep", Type::Int, "The number of best draws to start a population, which `anneal` reduces to one state.").or(Default::Num(1.0)),
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
        PlanForm::Value,
        "value",
        CHOICES,
        &[arg("at", Type::Selection, "The address of one choice.")],
        Type::Any,
        "The current value of a choice, in user kernels and conditions.",
    ),
    name(
        PlanForm::Elapsed,
        "elapsed",
        MONITORS,
        &[],
        Type::Num,
        "The time since the chain started, in seconds.",
    ),
    name(
        PlanForm::Steps,
        "steps",
        MONITORS,
        &[],
        Type::Int,
        "The number of kernel applications in this chain so far.",
    ),
    name(
        PlanForm::Reported,
        "summary",
        MONITORS,
        &[opt("sel", Type::Selection, "@**", "The choices to summarise.")],
        Type::Any,
        "Mean, sd, interval, effective sample size and R-hat of each selected choice.",
    ),
    name(
        PlanForm::Reported,
        "best",
        MONITORS,
        &[arg("x", Type::Any, "An expression of the model.")],
        Type::Any,
        "Its value in the state with the highest log joint density.",
    ),
];
