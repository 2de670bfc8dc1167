//! Selections, starts and monitors.

use super::Examples;

/// A program with one number and one observation, followed by a plan.
macro_rules! number {
    ($plan:literal) => {
        concat!("assume x ~ normal(0, 1);\nobserve normal(x, 1) = 2 as y;\n", $plan)
    };
}

/// A program with switches and an observation of each, followed by a plan.
macro_rules! switches {
    ($plan:literal) => {
        concat!(
            "for i in 0 .. 4 {\n  z[i] ~ flip(0.3);\n  observe normal(if z[i] { 1 } else { 0 }, 0.5) = 0.8 as y;\n}\n",
            $plan
        )
    };
}

pub(super) const EXAMPLES: Examples = &[
    ("one", switches!("infer { repeat 100 { gibbs(one(@z)); collect z[0]; } }")),
    ("each", switches!("infer { repeat 100 { gibbs(each(@z)); collect z[0]; } }")),
    ("init", number!("infer { init(best_of(20)); repeat 100 { drift(@x); collect x; } }")),
    (
        "anneal",
        number!(
            "infer { warmup 200 { anneal(10); drift(@x); } repeat 100 { drift(@x); collect x; } }"
        ),
    ),
    (
        "unconstrained",
        number!("infer { init(unconstrained()); repeat 100 { drift(@x); collect x; } }"),
    ),
    ("prior", number!("infer { init(prior()); repeat 100 { drift(@x); collect x; } }")),
    (
        "best_of",
        number!(
            "infer {\n  init(best_of(100, keep = 4));\n  warmup 200 { anneal(10); drift(@x); }\n  repeat 100 { drift(@x); collect x; }\n}"
        ),
    ),
    (
        "value",
        "\
assume x ~ normal(0, 1);
observe normal(x ** 2, 0.1) = 1 as y;
kernel mirror() { propose @x = -value(@x); }
infer { repeat 100 { drift(@x); mirror(); collect x; } }",
    ),
    (
        "elapsed",
        number!("infer { repeat 1000000 { drift(@x); collect x; stop when elapsed() > 0.1; } }"),
    ),
    ("steps", number!("infer { repeat 1000 { drift(@x); collect x; stop when steps() >= 200; } }")),
    ("summary", number!("infer { repeat 100 { drift(@x); collect x; } }\nreport summary(@x);")),
    ("best", number!("infer { repeat 100 { drift(@x); collect x; } }\nreport best(x);")),
];
