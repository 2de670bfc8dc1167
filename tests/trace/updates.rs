//! Traces: what is re-executed, equality of incremental and full updates, saving and
//! loading, changing structure.

use crate::common::*;
use pcadlang::Model;
use pcadlang_engine::trace::{Change, Draws as Streams, Limits, Selector, Trace};
use pcadlang_inference::RunOptions;
use pcadlang_numerics::rng::{Purpose, StreamKey};

fn trace(text: &str, seed: u64) -> (Model, Trace) {
    let model = Model::from_text(text).unwrap_or_else(|e| panic!("{e}"));
    let draws = Streams { key: StreamKey::new(seed, 0, Purpose::START), step: 0, substream: 0 };
    let t = Trace::simulate(model.code().clone(), draws, Limits::default())
        .unwrap_or_else(|e| panic!("{e}"));
    (model, t)
}

fn at(step: u64) -> Streams {
    Streams { key: StreamKey::new(99, 0, Purpose::VALUES), step, substream: 0 }
}

/// Returns the addresses of all active choices.
fn addresses(t: &Trace) -> Vec<String> {
    t.choices().into_iter().map(|(a, _, _)| a.to_string()).collect()
}

const PROGRAMS: &[(&str, &str)] = &[
    ("straight", "assume a ~ normal(0, 1); assume b ~ normal(a, 1); observe normal(a * b, 1) = 0.5;"),
    (
        "branch",
        "assume c ~ flip(0.4);
         assume x = if c { a ~ normal(0, 1); a } else { b ~ gamma(2, 1); let d = b * 2; d };
         assume s ~ half_cauchy(0, 1);
         observe normal(x, s) = [1, 2, 3] as y;",
    ),
    (
        "recursion",
        "fn geom(p) { s ~ flip(p); if s { 1 + geom(p) } else { 0 } }
         assume p ~ beta(2, 2); assume a = geom(p) + geom(p); observe normal(a, 1) = 3;",
    ),
    (
        "loops",
        "assume m ~ normal(0, 1); assume n ~ poisson(3);
         for i in 0 .. n { w[i] ~ normal(m, 1); observe normal(w[i], 1) = i; }
         assume total = fold(fn(acc, x) { acc + x }, 0, map(fn(i) { w[i] * w[i] }, 0 .. n));
         observe normal(total, 5) = 4;",
    ),
    (
        "mem",
        "assume stick = mem(fn(k) { v ~ beta(1, 1); v });
         assume centre = mem(fn(k) { m ~ normal(0, 2); m });
         fn pick(k) { here ~ flip(stick(k)); if here { k } else { pick(k + 1) } }
         let y = [-1, -0.5, 2];
         for i in 0 .. 3 { let z = pick(0); observe normal(centre(z), 1) = y[i]; }",
    ),
    (
        "chain",
        "let trans = [[0.8, 0.2], [0.3, 0.7]];
         for t in 0 .. 6 { s[t] ~ categorical(if t == 0 { [1, 1] } else { trans[s[t - 1]] }); observe normal(s[t], 1) = t; }",
    ),
    (
        "arrays",
        "assume mu ~ normal(0, 1); assume z ~ iid(normal(mu, 1), 4); assume f ~ gp(mean = mu, cov = sq_exp(0.5, 1), at = [0, 0.3, 1]);
         assume w ~ dirichlet([1, 2, 3]); assume k ~ categorical(w);
         observe normal(z + f[0] + w[k], 0.5) = [1, 2, 0, 1];",
    ),
    (
        "lengths",
        "assume n ~ categorical([0.5, 0.3, 0.2]); assume z ~ iid(gamma(1, 1), n + 1); assume t = sum(z) * 2;
         assume v ~ dirichlet(map(fn(i) { 1 + n }, 0 .. n + 2)); assume d = if n == 1 { flip(0.3) } else { poisson(2) };
         assume k ~ d; w[n] ~ normal(0, 1);
         observe normal(t + v[0] + (if k == 1 { 1 } else { 0 }) + w[n], 0.8) = 1.5;",
    ),
    (
        "closures",
        "fn make(a) { b ~ normal(a, 1); fn(x) { c ~ normal(0, 1); x + b + c } }
         assume g = make(1); assume h = if k { make(2) } else { g };
         assume k ~ flip(0.5); observe normal(g(1) + h(2), 1) = 3;"
    ),
];

/// Reorders the definitions of a program so that they are valid.
fn program(text: &str) -> String {
    text.replace(
        "assume g = make(1); assume h = if k { make(2) } else { g };\n         assume k ~ flip(0.5);",
        "assume k ~ flip(0.5); assume g = make(1); assume h = if k { make(2) } else { g };",
    )
}

/// After any sequence of proposals, commits and rollbacks, a run from scratch with the
/// same choices has the same score to the last bit and the same set of choices.
#[test]
fn increments_equal_a_run_from_scratch() {
    for (name, text) in PROGRAMS {
        let text = program(text);
        for seed in 0..4 {
            let (_, mut t) = trace(&text, seed);
            let all = t.select(&Selector::All);
            for step in 0..300u64 {
                let targets = t.targets(all).to_vec();
                if targets.is_empty() {
                    break;
                }
                let n = 1 + (step % 3) as usize;
                let mut chosen: Vec<_> = (0..n)
                    .map(|i| targets[(step as usize * 7 + i * 3 + seed as usize) % targets.len()])
                    .collect();
                chosen.sort();
                chosen.dedup();
                let before = (t.log_joint().to_bits(), addresses(&t));
                match t.regenerate(&chosen, at(step)) {
                    Ok(w) => {
                        assert!(!w.log_weight.is_nan(), "{name}: NaN weight");
                        if step % 2 == 0 || w.log_weight > -1.0 {
                            t.commit();
                        } else {
                            t.rollback();
                            assert_eq!(
                                before,
                                (t.log_joint().to_bits(), addresses(&t)),
                                "{name}: roll-back restores, step {step}"
                            );
                        }
                    }
                    Err(e) => assert!(e.is_recoverable(), "{name}: {e}"),
                }
                if step % 5 == 0 {
                    let fresh = t.rerun().unwrap_or_else(|e| panic!("{name}: {e}"));
                    assert_eq!(
                        addresses(&fresh),
                        addresses(&t),
                        "{name}: choices, seed {seed} step {step}"
                    );
                    assert_eq!(
                        fresh.log_joint().to_bits(),
                        t.log_joint().to_bits(),
                        "{name}: joint, seed {seed} step {step}"
                    );
                    assert_eq!(
                        fresh.log_likelihood().to_bits(),
                        t.log_likelihood().to_bits(),
                        "{name}: likelihood"
                    );
                }
            }
        }
    }
}

/// The same seed gives the same draws on one thread and on two, incrementally and by full
/// re-execution, bit for bit.
#[test]
fn draws_do_not_depend_on_threads_or_increments() {
    for (name, text) in PROGRAMS {
        let text = format!(
            "{} infer {{ init(best_of(5)); warmup 100 {{ mix {{ 0.4 => mh(one(@**)); 0.2 => gibbs(one($finite)); 0.4 => drift(one(@**)); }} }}
               repeat 150 {{ {} collect log_joint(); }} }}",
            program(text),
            kernels::INCREMENTAL
        );
        let options = RunOptions { seed: 4, ..RunOptions::default() };
        let bits = |options: &RunOptions, threads| -> Vec<u64> {
            run_with(&text, options, 2, threads)["log_joint"].iter().map(|x| x.to_bits()).collect()
        };
        let reference = bits(&options, 1);
        assert!(reference.iter().any(|b| *b != reference[0]), "{name}: the chain moves");
        assert_eq!(reference, bits(&options, 2), "{name}: two threads");
        let full = RunOptions { incremental: false, ..options };
        assert_eq!(reference, bits(&full, 2), "{name}: full re-execution");
    }
}

/// A saved trace loads to the same score to the last bit, and is refused by another
/// program.
#[test]
fn saved_traces_load_bit_for_bit() {
    for (name, text) in PROGRAMS {
        let (model, t) = trace(&program(text), 2);
        let json = serde_json::to_string(&t.save(model.hash())).unwrap();
        let saved = serde_json::from_str(&json).unwrap();
        let loaded = Trace::load(model.code().clone(), model.hash(), &saved, Limits::default());
        let loaded = loaded.unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(loaded.log_joint().to_bits(), t.log_joint().to_bits(), "{name}");
        assert_eq!(addresses(&loaded), addresses(&t), "{name}");
        assert!(Trace::load(model.code().clone(), "another", &saved, Limits::default()).is_err());
    }
}

/// A saved choice that does not occur in the program is refused, and its address
/// reported.
#[test]
fn saved_choices_occur_in_the_program() {
    for text in ["assume a ~ normal(0, 1); observe normal(a, 1) = 0.5;", PROGRAMS[0].1] {
        let (model, t) = trace(text, 2);
        let load = |saved: &serde_json::Value| {
            let saved = serde_json::from_value(saved.clone()).unwrap();
            Trace::load(model.code().clone(), model.hash(), &saved, Limits::default())
                .map_err(|e| e.to_string())
        };
        let mut saved = serde_json::to_value(t.save(model.hash())).unwrap();
        assert!(load(&saved).is_ok(), "{text}");
        saved["choices"][0]["hash"] = "0000000000000001".into();
        let e = load(&saved).expect_err(text);
        assert_eq!(e, "the trace has a choice @a that the program does not make");
    }
}

/// Addresses are exactly as the language specifies.
#[test]
fn addresses_are_paths() {
    let (_, t) = trace(
        r#"fn bone(name) { for k in ["x", "z"] { rot[k] ~ normal(0, 1) #rot #bone:name; } rot.x + rot.z }
           assume pose = map(bone, ["arm_l", "leg"]);
           fn geom(p) { s ~ flip(p); if s { 1 + geom(p) } else { 0 } }
           assume a = geom(0) + geom(0);
           assume y ~ iid(normal(0, 1), 2);
           for i in 0 .. 2 { x ~ normal(0, 1); observe normal(x, 1) = 0; }
           observe normal(sum(y) + a + pose.arm_l + pose["leg"], 1) = 0;
           observe normal(a, 1) = 0 as named;"#,
        1,
    );
    let expected = [
        "@a/geom#2/s",
        "@a/geom/s",
        "@pose[arm_l]/bone/rot[x]",
        "@pose[arm_l]/bone/rot[z]",
        "@pose[leg]/bone/rot[x]",
        "@pose[leg]/bone/rot[z]",
        "@x[0]",
        "@x[1]",
        "@y[0]",
        "@y[1]",
    ];
    let mut got = addresses(&t);
    got.sort();
    assert_eq!(got, expected);
    let mut observed: Vec<String> =
        t.observations().into_iter().map(|(a, _)| a.to_string()).collect();
    observed.sort();
    assert_eq!(observed, ["@named", "@obs#1[0]", "@obs#1[1]", "@obs#2"]);
}

/// Selections by address, tag and kind follow the structure.
#[test]
fn selections_are_kept_up_to_date() {
    let (_, mut t) = trace(
        "assume c ~ flip(0.5) #root; assume x = if c { a ~ normal(0, 1) #leaf; a } else { b ~ gamma(1, 1) #leaf; b }; observe normal(x, 1) = 0;",
        5,
    );
    let leaf = t.select(&Selector::Tag { name: "leaf".into(), value: None });
    let all = t.select(&Selector::All);
    let c = t.find(&t.choices().iter().find(|c| c.0.to_string() == "@c").unwrap().0).unwrap();
    for step in 0..20 {
        t.regenerate(&[c], at(step)).unwrap();
        t.commit();
        assert_eq!(t.targets(leaf).len(), 1);
        assert_eq!(t.targets(all).len(), 2);
        let name = t.address(t.targets(leaf)[0]).to_string();
        let c_value = format!("{}", t.value(c));
        assert_eq!(name, if c_value == "true" { "@x/a" } else { "@x/b" });
    }
}

/// A change re-executes only what depends on it.
#[test]
fn a_change_reruns_only_what_depends_on_it() {
    let text = "assume a ~ normal(0, 1); assume b ~ normal(0, 1);
                let left = a * 2; let right = b * 3; let sign = left > 1000;
                let gate = if sign { 1 } else { 2 };
                observe normal(left, 1) = 0; observe normal(right, 1) = 0; observe normal(gate, 1) = 0;";
    let (_, mut t) = trace(text, 1);
    let a = t.find(&t.choices()[0].0).unwrap();
    t.record_execution();
    t.propose(&[(a, Change::Set(pcadlang_numerics::dist::Datum::Num(0.25)))], at(1)).unwrap();
    let ran: Vec<&str> =
        t.executed().iter().map(|s| &text[s.start as usize..s.end as usize]).collect();
    t.commit();
    for expected in ["a * 2", "left > 1000", "normal(left, 1)"] {
        assert_eq!(ran.iter().filter(|r| **r == expected).count(), 1, "{expected} in {ran:?}");
    }
    // The comparison gave an equal value, so its dependents were not executed; nor was
    // anything that depends on b.
    assert!(
        !ran.iter().any(|r| r.contains("right") || r.contains("b * 3") || r.contains("gate")),
        "{ran:?}"
    );
}

/// Watching a trace records what a move executes, even if the kernel could make the move
/// without executing anything.
#[test]
fn moves_are_seen_by_who_watches() {
    use pcadlang_inference::{Gibbs, Kernel, Pick, SiteSelection, StepContext};
    let (_, mut t) =
        trace("assume f ~ flip(0.5); observe normal(if f { 1 } else { 0 }, 1) = 0.5;", 1);
    let mut kernel = Gibbs::new(SiteSelection { selector: Selector::All, pick: Pick::One });
    let mut moves = 0;
    for step in 0..40 {
        let before = format!("{:?}", t.choices());
        t.record_execution();
        kernel.step(&mut t, &StepContext::new(1, 0, step)).unwrap_or_else(|e| panic!("{e}"));
        let ran = t.executed();
        if format!("{:?}", t.choices()) != before {
            moves += 1;
            assert!(!ran.is_empty(), "step {step}");
        }
    }
    assert!(moves > 5, "{moves}");
}

/// What no choice affects is computed once for all traces of a program; what a choice affects, by
/// however many functions, is drawn in each.
#[test]
fn settled_values_are_computed_once() {
    let few = Limits { operations: 200, ..Limits::default() };
    let text = "fn grown(k) { fold(fn(sum, i) { sum + k * i }, 0, 0 .. 100) }
                fn adder(k) { fn(x) { x + k } }
                let table = map(grown, [1, 2]);
                let total = sum(concat(table, [grown(3)]));
                let shift = adder(2);
                assume x ~ normal(total, 1); observe normal(shift(x), 1) = 0;";
    let (model, first) = trace(text, 1);
    let next = |code, seed| {
        let draws = Streams { key: StreamKey::new(seed, 0, Purpose::START), step: 0, substream: 0 };
        Trace::simulate(code, draws, few.clone())
    };
    let second = next(model.code().clone(), 1).unwrap();
    assert_eq!(second.log_joint().to_bits(), first.log_joint().to_bits());
    let fresh = Model::from_text(text).unwrap();
    assert!(next(fresh.code().clone(), 1).is_err(), "the first trace computes them");
    for text in [
        "fn noisy() { z ~ normal(0, 1); z } let y = noisy();",
        "fn noisy(i) { z ~ normal(i, 1); z } let y = sum(map(noisy, [1, 2]));",
        "fn noisy(i) { z ~ normal(i, 1); z } fn apply(f) { f(1) } let y = apply(noisy);",
        "fn noisy(i) { z ~ normal(i, 1); z } let all = { f: noisy }; let y = [all][0].f(1);",
        "assume a ~ normal(0, 1); fn of(k) { fn() { a + k } } let f = of(1); let y = f();",
        "let y = if true { z ~ normal(0, 1); z } else { 0 };",
        "let f = mem(fn(k) { z ~ normal(0, 1); z + k }); let y = f(1);",
        "for i in 0 .. 3 { z[i] ~ normal(0, 1); } let y = sum(z);",
    ] {
        let (model, first) = trace(&format!("{text} observe normal(y, 1) = 0;"), 1);
        let second = next(model.code().clone(), 2).unwrap();
        assert_ne!(second.log_likelihood().to_bits(), first.log_likelihood().to_bits(), "{text}");
    }
}

/// With n conditionally independent observations, changing one local choice executes the
/// same few operations at any n.
#[test]
fn work_does_not_grow_with_the_trace() {
    let executed = |n: usize| {
        let text = format!(
            "assume m ~ normal(0, 1); for i in 0 .. {n} {{ z[i] ~ flip(0.3); observe normal(if z[i] {{ m }} else {{ 0 }}, 1) = 1; }}"
        );
        let (_, mut t) = trace(&text, 1);
        let all = t.select(&Selector::Kind(pcadlang_engine::trace::ChoiceKind::Discrete));
        let target = t.targets(all)[n / 2];
        let set = |v| [(target, Change::Set(pcadlang_numerics::dist::Datum::Bool(v)))];
        t.propose(&set(true), at(3)).unwrap();
        t.commit();
        t.record_execution();
        t.propose(&set(false), at(4)).unwrap();
        t.executed().len()
    };
    let few = executed(10);
    assert!(few < 12);
    assert_eq!(few, executed(1000));
}

/// The storage of abandoned branches is reused: a chain may change its structure any
/// number of times.
#[test]
fn storage_of_branches_is_used_again() {
    let model = Model::from_text(
        "assume c ~ flip(0.5); assume x = if c { a ~ normal(0, 1); a } else { b ~ gamma(2, 1); b };
         observe normal(x, 1) = 0.5;",
    )
    .unwrap_or_else(|e| panic!("{e}"));
    let limits = Limits { nodes: 100, ..Limits::default() };
    let mut t =
        Trace::simulate(model.code().clone(), at(0), limits).unwrap_or_else(|e| panic!("{e}"));
    let c = t.find(&"@c".parse().unwrap()).unwrap();
    for step in 0..1000u64 {
        let set = [(c, Change::Set(pcadlang_numerics::dist::Datum::Bool(step % 2 == 0)))];
        t.propose(&set, at(step + 1)).unwrap_or_else(|e| panic!("step {step}: {e}"));
        if step % 5 == 0 {
            t.rollback();
        } else {
            t.commit();
        }
    }
    assert_eq!(t.choices().len(), 2);
}

/// The computations of a map are dropped with the map, even if its elements changed in
/// the meantime.
#[test]
fn what_a_map_ran_over_is_let_go() {
    use pcadlang_numerics::dist::Datum::{Bool, Num};
    let (_, mut t) = trace(
        "assume c ~ flip(0.5); for i in 0 .. 3 { w[i] ~ normal(0, 1); }
         assume y = if c { sum(map(fn(x) { x * 2 }, w)) } else { 0 }; observe normal(y, 1) = 1;",
        1,
    );
    let moves = [
        ("@c", Bool(true), 4),
        ("@w[0]", Num(0.7), 4),
        ("@w[1]", Num(-0.2), 4),
        ("@c", Bool(false), 1),
    ];
    for (step, (name, value, choices)) in (0..).zip(moves) {
        let target = t.find(&name.parse().unwrap()).unwrap();
        t.propose(&[(target, Change::Set(value))], at(step)).unwrap_or_else(|e| panic!("{e}"));
        t.commit();
        assert_eq!(t.choice_count(), choices, "{name}: {:?}", addresses(&t));
    }
}

/// Gradients depend only on the state, to the last bit, not on what was created and
/// dropped before.
#[test]
fn gradients_do_not_depend_on_the_past() {
    let (_, mut t) = trace(
        "assume m ~ normal(0, 1); assume n ~ poisson(8);
         for i in 0 .. n + 1 { w[i] ~ normal(m, 1); observe normal(0.7 * w[i] + m, 0.3) = 0.37 * i; }",
        1,
    );
    let by_m = |t: &Trace| {
        let (m, mut slope) = (t.find(&"@m".parse().unwrap()).unwrap(), Vec::new());
        t.gradient(&[m], 1.0, &mut slope).unwrap_or_else(|e| panic!("{e}"));
        slope[0].to_bits()
    };
    let n = t.find(&"@n".parse().unwrap()).unwrap();
    for step in 0..40u64 {
        let set = Change::Set(pcadlang_numerics::dist::Datum::Num((step * 7 % 19) as f64));
        t.propose(&[(n, set)], at(step)).unwrap_or_else(|e| panic!("{e}"));
        t.commit();
        let fresh = t.rerun().unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(by_m(&t), by_m(&fresh), "step {step}");
    }
}

/// The surrogate of an observation is scored on demand and is not part of the joint
/// density.
#[test]
fn surrogates_are_not_part_of_the_joint() {
    let (_, mut t) = trace(
        "assume x ~ normal(0, 1); observe normal(x, 1) = 2 with coarse = normal(x, 3) as y;",
        1,
    );
    let (_, plain) = trace("assume x ~ normal(0, 1); observe normal(x, 1) = 2 as y;", 1);
    assert_eq!(t.log_joint().to_bits(), plain.log_joint().to_bits());
    let y = t.observations()[0].0.clone();
    let x: f64 = match t.choices()[0].1 {
        pcadlang_engine::lang::value::Value::Num(x) => x,
        _ => unreachable!(),
    };
    let expected = normal_pdf(2.0, x, 3.0).ln();
    let got = t.surrogate(&y, at(0)).unwrap().unwrap();
    assert!((got - expected).abs() < 1e-12, "{got} {expected}");
}

/// Runaway recursion and values that depend on themselves are errors, not crashes.
#[test]
fn runaway_programs_are_stopped() {
    let fails = |text: &str| {
        let model = Model::from_text(text).unwrap_or_else(|e| panic!("{e}"));
        let e = Trace::simulate(model.code().clone(), at(0), Limits::default()).err();
        e.unwrap_or_else(|| panic!("{text} runs")).to_string()
    };
    assert!(
        fails("fn f(x) { 1 + f(x) } observe normal(f(0), 1) = 0;").contains("nested more than")
    );
    assert!(
        fails("for t in 0 .. 3 { s[t] ~ normal(s[t], 1); observe normal(s[t], 1) = 0; }")
            .contains("depends on itself")
    );
    assert!(
        fails("for i in 0 .. 3 { t[1] ~ normal(0, 1); } observe normal(t[1], 1) = 0;")
            .contains("twice")
    );
}

/// Restoring a saved state is equivalent to building it, whatever structures are in
/// between.
#[test]
fn restored_states_are_the_saved_ones() {
    for (name, text) in PROGRAMS {
        let (_, mut t) = trace(&program(text), 3);
        let all = t.select(&Selector::All);
        let mut saved = Vec::new();
        for step in 0..60 {
            t.rollback();
            let targets = t.targets(all).to_vec();
            let changes: Vec<_> = targets.iter().map(|x| (*x, Change::Resample)).collect();
            if t.propose(&changes, at(step)).is_ok_and(|w| w.log_weight > -40.0) {
                t.commit();
                saved.push((t.constraints(), t.log_joint(), addresses(&t)));
            }
        }
        assert!(saved.len() > 5, "{name}");
        for i in (0..saved.len()).rev().chain([saved.len() / 2, 0]) {
            let (state, log_joint, names) = &saved[i];
            t.restore(state, at(1000)).unwrap_or_else(|e| panic!("{name}: {e:?}"));
            assert_eq!(t.log_joint().to_bits(), log_joint.to_bits(), "{name}, state {i}");
            assert_eq!(&addresses(&t), names, "{name}, state {i}");
        }
    }
}

/// Two functions called at one place draw at the same address, `@x/f/z[0]`: it always
/// refers to the existing choice, after accepted and rejected moves.
#[test]
fn choices_are_found_by_their_addresses_as_branches_change() {
    use pcadlang_inference::{Kernel, Mh, Pick, SiteSelection, StepContext};
    let model = Model::from_text(
        "assume c ~ flip(0.4);
         let f = if c { fn() { z[0] ~ normal(1, 1); z[0] } }
                 else { fn() { z[0] ~ normal(-1, 1); z[1] ~ normal(0, 1); z[0] + z[1] } };
         assume x = f(); observe normal(x, 1) = 0.5;",
    )
    .unwrap_or_else(|e| panic!("{e}"));
    let mut trace = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"));
    let mut kernel = Mh::new(SiteSelection { selector: Selector::All, pick: Pick::One });
    for step in 0..200 {
        let accepted = kernel
            .step(&mut trace, &StepContext::new(1, 0, step))
            .unwrap_or_else(|e| panic!("{e}"))
            .accepted;
        let draws = Streams { key: StreamKey::new(1, 0, Purpose::PREDICT), step, substream: 0 };
        assert!(trace.global("x", draws).is_some_and(|x| x.is_ok()));
        for t in trace.all_targets().to_vec() {
            let address = trace.address(t);
            assert_eq!(
                trace.find(&address),
                Some(t),
                "step {step} (accepted {accepted}): {address}"
            );
        }
    }
}

/// The reader of a number cannot follow its change to another type: this is an error, and
/// never a stale value.
#[test]
fn a_number_that_turns_into_an_array_is_an_error() {
    let text = "assume k ~ flip(0.5); assume x ~ normal(if k { [0, 1] } else { 0 }, 1);
        observe normal(x * [1, 1], 1) = [0.5, 0.7];";
    let model = Model::from_text(text).unwrap();
    let is = |t: &Trace, k: bool| t.get("@k").unwrap().same(&pcadlang::Value::Bool(k));
    let mut number = (0..20).map(|i| model.simulate(1, i).unwrap()).find(|t| is(t, false)).unwrap();
    let before = number.log_joint();
    let error = number.set("@k", true, Streams::default()).unwrap_err().to_string();
    assert!(error.contains("its parameters became arrays"), "{error}");
    assert!(is(&number, false) && number.log_joint() == before);
    // A change in the opposite direction is followed.
    let mut array = (0..20).map(|i| model.simulate(1, i).unwrap()).find(|t| is(t, true)).unwrap();
    array.set("@k", false, Streams::default()).unwrap();
    assert_eq!(array.rerun().unwrap().log_joint(), array.log_joint());
}
