//! Tapes of densities compared with the traces from which they were recorded: the
//! programs of the benchmarks and the posteriors of posteriordb, and changes of
//! conditions, structure or other choices.

use crate::common::tape;
use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Change, Draws, Trace};
use pcadlang_numerics::dist::Datum;
use serde_json::Value as Json;
use std::path::Path;
use tape::compare_tape;

fn value(j: &Json) -> Value {
    match j {
        Json::Number(x) => Value::Num(x.as_f64().unwrap()),
        Json::Array(xs) => Value::from_elements(xs.iter().map(value).collect()),
        other => panic!("{other}"),
    }
}

fn model(path: &str, data: &Json) -> Model {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap();
    let mut program = Program::parse(&text).unwrap_or_else(|e| panic!("{e}"));
    for item in program.interface().data {
        program = program.observe(&item.name, value(&data[&item.name]));
    }
    program.compile().unwrap_or_else(|e| panic!("{e}"))
}

/// Compares tape and trace at draws from the prior.
fn check(model: &Model, what: &str) {
    for seed in 0..3 {
        let mut trace = model.simulate(seed, 0).unwrap_or_else(|e| panic!("{what}\n{e}"));
        let told = compare_tape(&mut trace, what);
        assert!(told.recorded && told.points >= 8, "{what}: {told:?}");
    }
}

fn text(text: &str) -> Model {
    Model::from_text(text).unwrap_or_else(|e| panic!("{text}\n{e}"))
}

#[test]
fn posteriors_of_posteriordb() {
    for name in ["eight_schools", "kidscore_momiq", "gp_regr", "gauss_mix", "arK", "blr"] {
        let json = std::fs::read_to_string(format!(
            "{}/tests/posteriordb/{name}.json",
            env!("CARGO_MANIFEST_DIR")
        ));
        let json: Json = serde_json::from_str(&json.unwrap()).unwrap();
        check(&model(&format!("tests/posteriordb/{name}.pcad"), &json["data"]), name);
    }
}

#[test]
fn programs_of_the_benchmarks() {
    let points = serde_json::json!({ "x": [0.1, 0.5, 1.2, 1.9], "y": [0.3, -0.2, 1.4, 2.2], "sigma": [1, 2, 1, 3],
        "flips": [1, 0, 1, 1] });
    for name in ["coin", "schools", "gp", "linreg", "gmm"] {
        let mut data = points.clone();
        if name == "schools" {
            for key in ["y", "sigma"] {
                data[key] = serde_json::json!([28, 8, 3, 7, 1, 9, 18, 12]);
            }
        }
        check(&model(&format!("benches/peers/{name}.pcad"), &data), name);
    }
}

#[test]
fn a_condition_that_turns_out_otherwise_is_noticed() {
    for program in [
        "assume x ~ normal(0, 1); observe normal(if x > 0 { x } else { 3 * x }, 1) = 0.5;",
        "assume x ~ normal(0, 1); if x > 0 { observe normal(x, 1) = 0.5; }",
        "assume x ~ normal(0, 1); let y = if x > 0 { a ~ normal(x, 1); a } else { x }; observe normal(y, 1) = 0.5;",
        "assume x ~ iid(normal(0, 1), 3); observe normal([5, 6, 7][argmax(x)] * x[0], 1) = 0.5;",
    ] {
        let model = text(program);
        let mut told = (0, 0);
        for seed in 0..8 {
            let one = compare_tape(&mut model.simulate(seed, 0).unwrap(), program);
            assert!(one.recorded, "{program}");
            told = (told.0 + one.points, told.1 + one.asked);
        }
        assert!(told.0 > 20 && told.1 > 10, "{program}: {told:?}");
    }
}

#[test]
fn a_parameter_outside_its_domain_is_for_a_proposal_to_tell() {
    let program = "assume s ~ normal(0.2, 1); observe normal(0, s) = 0.5;";
    // The start is within the domain.
    let model = text(program);
    let mut trace = (0..50).find_map(|seed| model.simulate(seed, 0).ok()).unwrap();
    let told = compare_tape(&mut trace, program);
    assert!(told.recorded && told.points > 0 && told.asked > 0, "{told:?}");
}

#[test]
fn a_tape_holds_until_something_else_is_committed() {
    let model =
        text("assume x ~ normal(0, 1); assume y ~ normal(x, 1); observe normal(y, 1) = 0.5;");
    let mut trace = model.simulate(1, 0).unwrap();
    let all = trace.all_targets().to_vec();
    let set = |trace: &mut Trace, i: usize, x: f64| {
        trace.propose(&[(all[i], Change::Set(Datum::Num(x)))], Draws::default()).unwrap();
    };
    let mut tape = trace.record(&all[..1]).unwrap();
    assert!(tape.holds(&trace));
    set(&mut trace, 1, 0.25);
    trace.rollback();
    assert!(tape.holds(&trace), "an undone proposal changes nothing");
    set(&mut trace, 0, 0.75);
    trace.commit();
    assert!(!tape.holds(&trace));
    // A move of the kernel itself.
    tape.moved(&trace);
    let mut y = Vec::new();
    assert!(tape.holds(&trace) && tape.begin(&trace, &mut y));
    assert_eq!(y, [0.75]);
    set(&mut trace, 1, 0.5);
    trace.commit();
    assert!(!tape.holds(&trace) && !tape.holds(&trace.clone()));
}
