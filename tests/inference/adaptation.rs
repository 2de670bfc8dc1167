//! Kernels adapt during warm-up only: from its end on, the adapted part of each kernel's
//! state in a checkpoint keeps the same bytes. `Of` says which part that is, and why
//! the rest of the state is not adaptation.

use ciborium::Value;
use pcadlang::{Model, Program};
use pcadlang_inference::draws::{Column, DrawRow, KernelStats, Sink};
use pcadlang_inference::{Banks, Checkpoint, Latent, Neighbours, Progress, RunOptions};
use pcadlang_library::standard;
use std::io;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

/// Real-valued and Boolean choices, a surrogate, kernels that are deterministic maps, and
/// data that can be simulated.
const MODEL: &str = "
    assume a ~ normal(0, 1); assume b ~ gamma(2, 2); assume c ~ flip(0.4);
    observe normal(a + (if c { b } else { -b }), 0.7) = 1.2 with coarse = normal(a + b, 1) as y;
    kernel shift(s) { propose @a ~ normal(a, s); }
    kernel mirror() { propose u ~ normal(0, 1); propose @a = u - value(@a); propose u = u; }
";

/// Choices that appear and vanish.
const BRANCHES: &str = "
    assume c ~ flip(0.5);
    assume x = if c { n ~ normal(0, 1); n } else { m ~ normal(1, 2); w ~ normal(0, 0.1); m + w };
    assume z ~ normal(0, 3);
    observe normal(x + z, 1) = 0.5 as y;
";

const COUNTS: &str =
    "assume p ~ beta(2, 2); observe iid(flip(p), 6) = [true, true, false, true, true, true] as y;";

/// The part of a kernel's state that is adaptation, and why the rest is not.
#[derive(Clone, Copy, Debug)]
enum Of {
    /// All of the state, which may be empty.
    All,
    /// `hmc`, `mala`, `nuts`: all except how often tapes are recorded
    /// (`hamiltonian/memory.rs`), which affects how a density is computed, not which
    /// density.
    Trajectory,
    /// `temper`: all except the replicas, which are states of the larger chain, and the
    /// count of steps, which determines the pairs whose turn it is.
    Ladder(&'static Of),
    /// `smc`: all except the log density and estimate of the
    /// accepted state, which belong to that state, and the sum of estimates, which is a
    /// result.
    Particles(&'static Of),
    /// `abc`: all except the distance of the present state, which belongs to that state.
    Distance(&'static Of),
}

/// For each kernel: its name, a model, the statements to run, and the part of its state
/// that must not change after warm-up.
const CASES: &[(&str, &str, &str, Of)] = &[
    ("mh", MODEL, "mh(one(@**));", Of::All),
    ("block", MODEL, "block(@**);", Of::All),
    ("drift", MODEL, "drift(@**);", Of::All),
    ("drift", MODEL, "drift(one(@**));", Of::All),
    ("drift", BRANCHES, "drift(@**); drift(each(@**)); mh(@c);", Of::All),
    ("gibbs", MODEL, "gibbs(each($finite));", Of::All),
    ("exact", MODEL, "exact($finite);", Of::All),
    ("elliptical", MODEL, "elliptical(@a); mh(@b);", Of::All),
    ("slice", MODEL, "slice(one($continuous));", Of::All),
    ("slice", BRANCHES, "slice($continuous, doubling = true); mh(@c);", Of::All),
    ("hmc", MODEL, "hmc($continuous, steps = 3);", Of::Trajectory),
    ("mala", MODEL, "mala($continuous);", Of::Trajectory),
    ("nuts", MODEL, "nuts($continuous, max_depth = 4);", Of::Trajectory),
    ("nuts", MODEL, "nuts($continuous, max_depth = 4, marginal = @c);", Of::Trajectory),
    ("knn", MODEL, "knn(@**, bank = \"b\");", Of::All),
    ("delayed", MODEL, "delayed(drift(@a), @y);", Of::All),
    ("delayed", MODEL, "delayed(nuts(@a + @b), @y);", Of::Trajectory),
    ("temper", MODEL, "temper(drift(one(@**)), levels = 3);", Of::Ladder(&Of::All)),
    (
        "temper",
        MODEL,
        "temper(nuts(@a + @b, max_depth = 3), levels = 3);",
        Of::Ladder(&Of::Trajectory),
    ),
    ("smc", MODEL, "smc(drift(one(@**)), particles = 5);", Of::Particles(&Of::All)),
    ("abc", COUNTS, "abc(drift(@p), eps = 0.5);", Of::Distance(&Of::All)),
    ("modes", MODEL, "modes(@**, tries = 20, keep = 4, steps = 10); mh(one(@**));", Of::All),
    ("shift", MODEL, "shift(0.5);", Of::All),
    ("mirror", MODEL, "mirror();", Of::All),
];

fn bytes(v: &Value) -> Vec<u8> {
    match v {
        Value::Bytes(b) => b.clone(),
        Value::Array(xs) => {
            xs.iter().map(|x| u8::try_from(x.as_integer().unwrap()).unwrap()).collect()
        }
        _ => panic!("no bytes: {v:?}"),
    }
}

fn read(bytes: &[u8]) -> Value {
    ciborium::from_reader(bytes).unwrap_or_else(|e| panic!("{e}"))
}

/// Returns a field of a structure.
fn field<'a>(v: &'a Value, name: &str) -> &'a Value {
    let fields = v.as_map().unwrap_or_else(|| panic!("no structure: {v:?}"));
    let found = fields.iter().find(|(k, _)| k.as_text() == Some(name));
    &found.unwrap_or_else(|| panic!("no field {name}: {v:?}")).1
}

/// Returns the adapted parts of a kernel's state, serialised.
fn learnt(of: Of, state: &[u8]) -> Vec<Vec<u8>> {
    let parts = |n: usize| {
        let read = read(state);
        let parts = read.as_array().unwrap_or_else(|| panic!("no tuple: {read:?}")).clone();
        assert_eq!(parts.len(), n, "{of:?}: say of the part that is new whether it is learnt");
        parts
    };
    let whole = |v: &Value| {
        let mut out = Vec::new();
        ciborium::into_writer(v, &mut out).unwrap();
        out
    };
    match of {
        Of::All => vec![state.to_vec()],
        Of::Trajectory => vec![whole(&parts(2)[0])],
        Of::Ladder(inner) => {
            let [kernels, _replicas, gaps, _rounds] = &parts(4)[..] else { unreachable!() };
            let kernels =
                kernels.as_array().unwrap().iter().flat_map(|k| learnt(*inner, &bytes(k)));
            kernels.chain([whole(gaps)]).collect()
        }
        Of::Particles(inner) => {
            let way = read(&bytes(&parts(4)[0]));
            let [kernel, ladder] = &way.as_array().unwrap()[..] else { panic!("{way:?}") };
            learnt(*inner, &bytes(kernel)).into_iter().chain([whole(ladder)]).collect()
        }
        Of::Distance(inner) => learnt(*inner, &bytes(&parts(3)[0])),
    }
}

/// Keeps the checkpoint of every step.
struct Keep {
    kept: Arc<Mutex<Vec<Checkpoint>>>,
    progress: Arc<Progress>,
}

impl Sink for Keep {
    fn columns(&mut self, _: &[Column]) -> io::Result<()> {
        Ok(())
    }

    fn draw(&mut self, _: &DrawRow) -> io::Result<()> {
        Ok(())
    }

    fn chain_done(&mut self, _: u32, _: u64, _: u64, _: f64) -> io::Result<()> {
        Ok(())
    }

    fn takes_checkpoints(&self) -> bool {
        true
    }

    fn checkpoint(&mut self, checkpoint: &Checkpoint) -> io::Result<()> {
        self.kept.lock().unwrap().push(checkpoint.clone());
        self.progress.checkpoints.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }
}

/// Neighbours that are unrelated to the data.
fn neighbours(model: &Model) -> Arc<dyn Banks> {
    let all: Vec<_> =
        (0..12).filter_map(|i| model.simulate(9, i).ok()).map(|t| Latent::all(&t)).collect();
    Arc::new(Neighbours::new(all.iter().take(3).cloned().collect(), &all))
}

/// Returns the states of all kernels at each step, warm-up included.
fn states(model: &Model, seed: u64, warmup: u64, steps: u64) -> Vec<(u64, Vec<Vec<u8>>)> {
    let (kept, progress) = (Arc::new(Mutex::default()), Arc::new(Progress::default()));
    progress.checkpoints.store(1, Ordering::Relaxed);
    let sink = Keep { kept: Arc::clone(&kept), progress: Arc::clone(&progress) };
    let options = RunOptions {
        seed,
        steps: Some(steps),
        warmup: Some(warmup),
        banks: Some(neighbours(model)),
        ..RunOptions::default()
    };
    let done = model
        .run_into(&options, 1, &progress, vec![Box::new(sink)])
        .unwrap_or_else(|e| panic!("{e}"));
    done.into_iter().for_each(|c| drop(c.unwrap_or_else(|e| panic!("{}", model.chain_error(e)))));
    let of = |c: &Checkpoint| {
        let all = read(&c.to_bytes());
        let kernels = field(&all, "kernels").as_array().unwrap();
        (c.steps(), kernels.iter().map(|k| bytes(field(k, "state"))).collect())
    };
    kept.lock().unwrap().iter().map(of).collect()
}

fn model(text: &str, kernel: &str) -> Model {
    let text = format!(
        "{text} infer {{ warmup 200 {{ {kernel} }} repeat 200 {{ {kernel} collect 1; }} }}"
    );
    Program::parse(&text).and_then(Program::compile).unwrap_or_else(|e| panic!("{kernel}: {e}"))
}

/// A case is about the first kernel of its statements.
#[test]
fn nothing_is_learnt_after_warm_up() {
    for (name, text, kernel, of) in CASES {
        let (warmup, steps) = (if *text == COUNTS { 60 } else { 200 }, 150);
        let all = states(&model(text, kernel), 3, warmup, steps);
        let after: Vec<_> = all
            .iter()
            .filter(|(step, _)| *step >= warmup)
            .map(|(_, s)| learnt(*of, &s[0]))
            .collect();
        assert!(after.len() as u64 > steps / 2, "{name}: {} checkpoints", after.len());
        let other = after.iter().position(|s| *s != after[0]);
        assert_eq!(other, None, "{kernel} goes on learning after warm-up; steps until then");
        // A kernel that adapts must have changed during warm-up; otherwise this test
        // shows nothing.
        let before: Vec<_> =
            all.iter().filter(|(_, s)| !s.is_empty()).map(|(_, s)| learnt(*of, &s[0])).collect();
        let learns = ["drift", "slice", "hmc", "mala", "nuts", "delayed", "temper", "smc", "abc"]
            .contains(name);
        assert_eq!(learns, before.iter().any(|s| *s != after[0]), "{kernel}");
    }
}

/// Without warm-up, a step size or ladder is determined once and then fixed.
#[test]
fn what_was_not_warmed_up_is_found_once() {
    for (name, text, kernel, of) in CASES.iter().filter(|(_, text, _, _)| *text != BRANCHES) {
        let all = states(&model(text, kernel), 3, 0, 60);
        // `abc` with particles determines its ladder once a particle is close enough to
        // the data.
        let mut states: Vec<_> =
            all.iter().filter(|(step, _)| *step >= 1).map(|(_, s)| learnt(*of, &s[0])).collect();
        let (count, most) =
            (states.len(), if kernel.contains("moves") || *name == "abc" { 2 } else { 1 });
        states.dedup();
        assert!(count > 30 && states.len() <= most, "{name}: {kernel} goes on learning");
    }
}

/// Where choices appear and vanish, the metric is a function of the choices that exist,
/// regardless of the structures visited in between.
#[test]
fn a_metric_depends_on_nothing_but_the_choices_there_are() {
    let kernels =
        ["hmc($continuous, steps = 3); mh(@c);", "nuts($continuous, max_depth = 4); mh(@c);"];
    // Over several seeds, since a branch may change exactly at the end of a window, which
    // leaves a single state to estimate a variance from.
    for (kernel, seed) in kernels.iter().flat_map(|k| (0..6).map(move |seed| (*k, seed))) {
        let all = states(&model(BRANCHES, kernel), seed, 400, 150);
        let of = |step: u64| {
            let (_, states) = all.iter().rfind(|(s, _)| *s <= step).unwrap();
            let adaptation = read(&states[0]).as_array().unwrap()[0].clone();
            field(&adaptation, "learnt").as_map().unwrap().len()
        };
        // Metrics are kept by address, and are not discarded while their choices are
        // missing.
        assert!(
            (1..550).all(|step| of(step) <= of(step + 1)) && of(400) > 1,
            "{kernel}: a metric is forgotten"
        );
        let mut seen: Vec<(Value, Vec<Value>)> = Vec::new();
        for (_, states) in all.iter().filter(|(step, _)| *step >= 400) {
            let adaptation = read(&states[0]).as_array().unwrap()[0].clone();
            let learnt = ["metric", "learnt", "mixing", "step", "averaged"]
                .map(|f| field(&adaptation, f).clone())
                .to_vec();
            let scales = field(&learnt[0], "scales").as_array().unwrap();
            let scales: Vec<f64> = scales.iter().map(|x| x.as_float().unwrap()).collect();
            assert!(scales.iter().all(|m| m.is_finite() && *m > 0.0), "{kernel}: {scales:?}");
            let choices = field(&adaptation, "signature").clone();
            match seen.iter().find(|(other, _)| *other == choices) {
                Some((_, before)) => assert_eq!(*before, learnt, "{kernel}"),
                None => seen.push((choices, learnt)),
            }
        }
        assert_eq!(seen.len(), 2, "{kernel}: both branches are visited");
    }
}

#[test]
fn every_kernel_of_the_table_has_a_case() {
    let table = standard::table();
    for b in table.iter().filter(|b| b.section == "Kernels") {
        let name = b.full_name();
        assert!(CASES.iter().any(|c| c.0 == name), "`{name}`: add a case, or several");
    }
    for (name, _, kernel, _) in CASES {
        assert!(
            kernel.starts_with(&format!("{name}(")),
            "the first kernel of `{kernel}` is no {name}"
        );
    }
}

/// Under a structure that changes every few steps, the step size is learnt across all
/// structures. When every change restarted its adaptation, it stayed near the first
/// guess, a fifth of the proposals were accepted, and two in five trajectories diverged.
#[test]
fn step_sizes_are_learnt_through_changes_of_structure() {
    let text = "let y = [-2.1, -1.9, -2.4, 1.8, 2.2, 2.5, 1.9, -2.2, 2.1, -1.8];
        assume k ~ uniform_discrete(1, 4);
        assume mu = map(fn(i) { m ~ normal(0, 3); m }, 0 .. k);
        observe mixture(map(fn(m) { 1 / k }, mu), map(fn(m) { normal(m, 0.5) }, mu)) = y as y;
        infer {
          warmup 1000 { nuts($continuous); mh(one($continuous)); repeat 2 { gibbs(@k); } }
          repeat 1000 { nuts($continuous); mh(one($continuous)); repeat 2 { gibbs(@k); } }
        }";
    let model = Model::from_text(text).unwrap_or_else(|e| panic!("{e}"));
    let options = RunOptions { seed: 1, ..RunOptions::default() };
    let posterior = model.run(&options, 4, 2).unwrap_or_else(|e| panic!("{e}"));
    let all = KernelStats::total(posterior.chains.iter().flat_map(|c| &c.kernels));
    let nuts = all.iter().find(|k| k.name.starts_with("nuts")).expect("its counts");
    assert!(nuts.acceptance().is_some_and(|a| a > 0.7), "{nuts:?}");
    assert!(nuts.divergent * 20 < nuts.proposals, "{nuts:?}");
    assert!(nuts.step_size.is_some_and(|s| s > 0.0 && s < 2.0), "{nuts:?}");
}
