//! Kernels, selections, starts and monitors.

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

/// A program with a ball and a photograph of it, followed by a plan.
macro_rules! ball {
    ($plan:literal) => {
        concat!(
            "data photo = image(\"ball.png\");\nassume r ~ uniform(0.5, 1.5);\nlet view = scene.render(scene.sphere(r));\n",
            "observe scene.chamfer(view, size = 32) = photo as picture;\n",
            $plan
        )
    };
}

pub(super) const EXAMPLES: Examples = &[
    ("mh", number!("infer { repeat 100 { mh(@x); collect x; } }")),
    (
        "block",
        "\
assume x ~ normal(0, 1) #pair;
assume y ~ normal(0, 1) #pair;
observe normal(x + y, 1) = 2 as sum;
infer { repeat 100 { block($pair); collect x, y; } }",
    ),
    ("drift", number!("infer { warmup 200 { drift(@x); } repeat 100 { drift(@x); collect x; } }")),
    ("gibbs", switches!("infer { repeat 100 { gibbs(@z[0]); collect z[0]; } }")),
    ("elliptical", number!("infer { repeat 100 { elliptical(@x); collect x; } }")),
    ("slice", number!("infer { repeat 100 { slice(@x, width = 2); collect x; } }")),
    (
        "hmc",
        number!(
            "infer { warmup 200 { hmc(@x, steps = 5); } repeat 100 { hmc(@x, steps = 5); collect x; } }"
        ),
    ),
    ("nuts", number!("infer { warmup 200 { nuts(@x); } repeat 100 { nuts(@x); collect x; } }")),
    ("mala", number!("infer { warmup 200 { mala(@x); } repeat 100 { mala(@x); collect x; } }")),
    ("knn", ball!("infer { repeat 100 { knn(@**, bank = \"balls.bank\", k = 5); collect r; } }")),
    (
        "delayed",
        "\
assume x ~ normal(0, 1);
observe normal(x, 1) = 2 with coarse = normal(x, 1.5) as y;
infer { repeat 100 { delayed(mh(@x), at = @y); collect x; } }",
    ),
    (
        "temper",
        number!(
            "infer {\n  warmup 200 { temper(drift(@x), levels = 3); }\n  repeat 100 { temper(drift(@x), levels = 3); collect x; }\n}"
        ),
    ),
    ("smc", number!("infer { repeat 20 { smc(drift(@x), particles = 20); collect x; } }")),
    ("abc", number!("infer { repeat 100 { abc(block(@**), eps = 0.5); collect x; } }")),
    ("modes", number!("infer { warmup 20 { modes(@x); } repeat 100 { modes(@x); collect x; } }")),
    ("optimize", number!("infer { repeat 10 { optimize(@x, steps = 20); collect x; } }")),
    ("one", switches!("infer { repeat 100 { gibbs(one(@z)); collect z[0]; } }")),
    ("each", switches!("infer { repeat 100 { gibbs(each(@z)); collect z[0]; } }")),
    ("init", number!("infer { init(best_of(20)); repeat 100 { drift(@x); collect x; } }")),
    (
        "anneal",
        number!(
            "infer { warmup 200 { anneal(10); drift(@x); } repeat 100 { drift(@x); collect x; } }"
        ),
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
    (
        "acceptance",
        number!("infer { repeat 1000 { drift(@x); collect x; stop when acceptance() > 0.9; } }"),
    ),
    ("rhat", number!("infer { repeat 1000 { drift(@x); collect x; stop when rhat(x) < 1.01; } }")),
    ("ess", number!("infer { repeat 1000 { drift(@x); collect x; stop when ess(x) > 400; } }")),
    (
        "snapshot",
        ball!("infer { repeat 100 { drift(@r); every 10 { snapshot(view); } collect r; } }"),
    ),
    ("summary", number!("infer { repeat 100 { drift(@x); collect x; } }\nreport summary(@x);")),
    ("best", number!("infer { repeat 100 { drift(@x); collect x; } }\nreport best(x);")),
];
