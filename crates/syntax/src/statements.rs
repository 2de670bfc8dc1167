//! Descriptions of the statements of the language, for `pcadlang doc`, the prompt and the
//! reference.

/// A statement, under the word by which it is looked up.
#[derive(Clone, Copy, Debug)]
pub struct Statement {
    /// Its keyword.
    pub name: &'static str,
    /// Its syntax; alternatives are separated by three spaces.
    form: &'static str,
    /// A one-line description.
    pub doc: &'static str,
    /// An example: a program, or part of an inference plan.
    pub example: &'static str,
    /// Where it is allowed.
    pub place: Place,
}

impl Statement {
    /// Returns the alternative forms of its syntax.
    pub fn forms(&self) -> impl Iterator<Item = &'static str> {
        self.form.split("   ")
    }
}

/// Where a statement is allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// In the model; `param`, `data`, `include`, `fn`, … only at its top level.
    Model,
    /// In an `infer` block or a kernel.
    Plan,
    /// In an expression.
    Expression,
}

const fn model(
    name: &'static str,
    form: &'static str,
    doc: &'static str,
    example: &'static str,
) -> Statement {
    Statement { name, form, doc, example, place: Place::Model }
}

const fn plan(
    name: &'static str,
    form: &'static str,
    doc: &'static str,
    example: &'static str,
) -> Statement {
    Statement { name, form, doc, example, place: Place::Plan }
}

/// All statements: first those of models, then those of inference plans.
pub const STATEMENTS: &[Statement] = &[
    model(
        "assume",
        "assume x ~ d #tag;   assume x = e;",
        "A random choice of the model, or a value made of others. Its draws are recorded.",
        "assume r ~ gamma(2, 1) #size; assume area = pi * r * r;",
    ),
    model(
        "let",
        "let x = e;",
        "A name for a value: inside a function, or for a constant. Its draws are not recorded.",
        "let xs = [1, 2, 3];",
    ),
    model(
        "observe",
        "observe d = v as name;",
        "Condition on a distribution or likelihood having given a value; arrays go element by element.",
        "assume m ~ normal(0, 1); observe normal(m, 1) = [0.5, 1.2] as y;",
    ),
    model(
        "predict",
        "predict x ~ d;   predict x = e;",
        "A quantity to draw anew with every recorded draw: a posterior prediction.",
        "assume m ~ normal(0, 1); predict next ~ normal(m, 1);",
    ),
    model(
        "factor",
        "factor(logw) as name;",
        "Add a log weight to the log joint density: a soft constraint.",
        "assume a ~ normal(0, 1); factor(-abs(a));",
    ),
    model(
        "force",
        "force @a = v;",
        "Set a choice where a chain starts, in the states that have it. It keeps its prior density and may move later.",
        "assume a ~ normal(0, 1); force @a = 2;",
    ),
    model(
        "freeze",
        "freeze sel;",
        "Take choices out of every proposal: they keep the value that they start with.",
        "assume a ~ normal(0, 1) #shape; freeze $shape;",
    ),
    model(
        "forget",
        "forget name;",
        "Remove an earlier observation, or an assumption that nothing depends on.",
        "assume a ~ normal(0, 1); observe normal(a, 1) = 3 as seen; forget seen;",
    ),
    model(
        "sample",
        "sample e;",
        "Evaluate an expression once, without recording it.",
        "assume a ~ normal(0, 1); sample a + 1;",
    ),
    model(
        "param",
        "param name: type = default \"help\";",
        "A setting of the program, given by `--set name=value`: number, int, bool, string or array.",
        "param n: int = 3 \"how many\"; assume xs ~ iid(normal(0, 1), n);",
    ),
    model(
        "data",
        "data name: type \"help\";   data name = csv(\"file\");",
        "What is read from a file, given by `--observe name=FILE` or by default from a file.",
        "data photo: image \"the photograph\";",
    ),
    model(
        "include",
        "include \"file\" as ns;",
        "Read another program; its names are written `ns.name`. `std/` is built in.",
        "include \"std/scene.pcad\" as scene; let ball = scene.sphere(radius = 1);",
    ),
    model(
        "fn",
        "fn name(x, y = 1) { …; value }",
        "A function: the last expression is its value. `fn(x) { … }` is a value itself.",
        "fn area(r) { pi * r * r } let a = area(2);",
    ),
    model(
        "for",
        "for i in xs { … }",
        "Do statements for each element of an array or range, or each name of a record.",
        "for i in 0 .. 3 { z[i] ~ normal(0, 1); observe normal(z[i], 1) = i; }",
    ),
    Statement {
        name: "if",
        form: "if c { a } else { b }",
        doc: "An expression: the value of one of two branches. Both need braces.",
        example: "assume up ~ flip(0.5); assume m = if up { 1 } else { -1 };",
        place: Place::Expression,
    },
    model(
        "report",
        "report e, … as \"file\";",
        "Write tables or pictures into the run's folder when the run ends.",
        "assume a ~ normal(0, 1); report summary() as \"summary.json\";",
    ),
    model(
        "export",
        "export e to \"file\";",
        "Write a value of the best state into the run's folder: a mesh, a picture, numbers.",
        "assume a ~ normal(0, 1); export a to \"a.json\";",
    ),
    model(
        "kernel",
        "kernel name(x) { propose @x ~ d; }",
        "A proposal of your own. The engine finds the reverse move and the acceptance ratio.",
        "assume x ~ gamma(2, 1); kernel pull(s) { propose @x ~ lognormal(log(value(@x)), s); }",
    ),
    model(
        "infer",
        "infer name { … }",
        "The inference plan: kernels in turn, in `warmup`, `repeat` and `mix`. Without one a default is chosen.",
        "assume x ~ normal(0, 1); infer { warmup 200 { drift(@x); } repeat 500 { drift(@x); collect x; } }",
    ),
    plan(
        "warmup",
        "warmup n { … }",
        "Apply kernels n times while step sizes adapt; these draws are thrown away.",
        "warmup 200 { drift(@x); }",
    ),
    plan(
        "repeat",
        "repeat n { … }",
        "Apply kernels n times. Without `collect` each pass records a draw.",
        "repeat 500 { drift(@x); }",
    ),
    plan(
        "mix",
        "mix { w => kernel; … }",
        "Apply one of several kernels, chosen at random by weight.",
        "mix { 0.7 => drift(@x); 0.3 => mh(@x); }",
    ),
    plan(
        "every",
        "every n { … }",
        "Apply kernels in every n-th pass of the loop around them.",
        "repeat 100 { drift(@x); every 10 { mh(@x); } }",
    ),
    plan(
        "collect",
        "collect e, …;",
        "Record a draw of these quantities.",
        "repeat 100 { drift(@x); collect x, log_joint(); }",
    ),
    plan(
        "stop",
        "stop when c;",
        "End the loop around it as soon as a condition holds.",
        "repeat 100 { drift(@x); stop when elapsed() > 60; }",
    ),
    plan(
        "propose",
        "propose @x ~ d;   propose @x = e;",
        "In a kernel: the value that it proposes for a choice, or for an auxiliary variable.",
        "propose @x ~ normal(value(@x), 0.1);",
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::SourceMap;
    use crate::{is_keyword, parse};

    #[test]
    fn examples_parse_and_show_their_statement() {
        for s in STATEMENTS {
            assert!(is_keyword(s.name), "{} is no word of the language", s.name);
            let model = "assume x ~ normal(0, 1);";
            let text = match (s.place, s.name) {
                (Place::Plan, "propose") => format!("{model} kernel k() {{ {} }}", s.example),
                (Place::Plan, _) => format!("{model} infer {{ {} }}", s.example),
                _ => s.example.to_owned(),
            };
            let (_, errors) = parse(&text, SourceMap::new().add("", &text));
            assert!(errors.is_empty(), "{}: {errors:?}", s.name);
            assert!(s.example.contains(s.name), "{}", s.name);
        }
    }
}
