//! Forms: built-ins that are lowered to dedicated operations, because they call functions
//! or depend on the whole trace.

use super::{Arg, Form, Kind, Row, Type, arg};

const SECTION: &str = "Forms";

const fn form(
    name: &'static str,
    args: &'static [Arg],
    returns: Type,
    doc: &'static str,
    form: Form,
) -> Row {
    Row::new(Kind::Form(form), name, SECTION, args, returns, doc)
}

pub(super) const TABLE: &[Row] = &[
    form(
        "map",
        &[
            arg("f", Type::Function, "A function of one argument; it may draw."),
            arg("xs", Type::Any, "An array or record."),
        ],
        Type::Any,
        "The results of `f` for each element, in the shape of `xs`; the position or name becomes \
         a key in addresses.",
        Form::Map,
    ),
    form(
        "fold",
        &[
            arg(
                "f",
                Type::Function,
                "A function of the running value and an element; it may draw.",
            ),
            arg("init", Type::Any, "The initial value."),
            arg("xs", Type::Any, "An array or record."),
        ],
        Type::Any,
        "The final running value, after all elements from left to right.",
        Form::Fold,
    ),
    form(
        "mem",
        &[arg(
            "f",
            Type::Function,
            "A function; its arguments must be numbers, strings, bools or arrays of them.",
        )],
        Type::Function,
        "A function that calls `f` once per distinct argument and remembers its result \
         (stochastic memoisation).",
        Form::Mem,
    ),
    form(
        "log_joint",
        &[],
        Type::Num,
        "The log joint density of all choices and observations.",
        Form::LogJoint,
    ),
    form(
        "log_prior",
        &[],
        Type::Num,
        "The log prior density of the unobserved choices.",
        Form::LogPrior,
    ),
    form(
        "log_likelihood",
        &[],
        Type::Num,
        "The log likelihood of the observations, factors included.",
        Form::LogLikelihood,
    ),
];
