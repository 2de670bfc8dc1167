//! The embedding examples, each checked for what it promises, and other properties that a
//! host relies on.

#![allow(dead_code)]

use crate::common::folder::Folder;
use pcadlang::{Error, Model, Posterior, Program, RunOptions, Value};
use pcadlang_engine::trace::{Change, Draws, Selector, Trace};
use pcadlang_inference::host::{Entry, Host, Previous, Type};
use pcadlang_inference::{
    Callbacks, Drift, Kernel, Mh, Pick, Progress, SiteSelection, Slice, StepContext,
};
use pcadlang_report::{Memory, RunDir};
use std::sync::atomic::Ordering;

#[path = "../../examples/embed_distribution.rs"]
mod embed_distribution;
#[path = "../../examples/embed_errors.rs"]
mod embed_errors;
#[path = "../../examples/embed_function.rs"]
mod embed_function;
#[path = "../../examples/embed_kernel.rs"]
mod embed_kernel;
#[path = "../../examples/embed_likelihood.rs"]
mod embed_likelihood;
#[path = "../../examples/embed_run_dir.rs"]
mod embed_run_dir;
#[path = "../../examples/embed_trace.rs"]
mod embed_trace;

/// A host's primitive under `hmc` and kernels that reject: with its saved state and from
/// scratch, all draws are the same to the last bit, and the saved state avoids most of
/// the work.
#[test]
fn a_primitive_with_state_gives_the_same_draws_as_without() {
    let (host, cells) = embed_function::host();
    let model = embed_function::model(&host).unwrap();
    let run = |incremental| {
        cells.store(0, Ordering::Relaxed);
        let options = RunOptions { seed: 3, incremental, ..RunOptions::default() };
        let posterior = model.run(&options, 2, 2).unwrap();
        let accepted: u64 =
            posterior.chains.iter().flat_map(|c| &c.kernels).map(|k| k.accepted).sum();
        let proposed: u64 =
            posterior.chains.iter().flat_map(|c| &c.kernels).map(|k| k.proposals).sum();
        assert!(accepted > 500 && accepted < proposed - 500, "{accepted} of {proposed}");
        let rows: Vec<_> = posterior.draws.iter().flat_map(|d| d.rows.clone()).collect();
        let bits: Vec<u64> = rows
            .iter()
            .flat_map(|r| r.values.iter().chain([&r.log_joint]).map(|x| x.to_bits()))
            .collect();
        let end = posterior.quantity("end").unwrap().summary.mean;
        assert!((end - 53.0).abs() < 0.3, "{end}");
        (bits, cells.load(Ordering::Relaxed))
    };
    let ((with, few), (without, many)) = (run(true), run(false));
    assert!(with.len() > 50_000 && with == without);
    assert!(few * 4 < many, "{few} cells of {many}");
}

/// The gradient that `hmc` follows agrees with finite differences, and the tape's density
/// with the trace's.
#[test]
fn the_gradient_of_a_primitive_is_that_of_differences() {
    let (host, _) = embed_function::host();
    let model = embed_function::model(&host).unwrap();
    let mut trace = model.simulate(5, 0).unwrap();
    let all = trace.select(&Selector::All);
    let targets = trace.targets(all).to_vec();
    let mut gradient = Vec::new();
    trace.gradient(&targets, 1.0, &mut gradient).unwrap();
    let mut place = 0;
    for t in targets {
        let (y, _) = trace.free(t).unwrap();
        for i in 0..y.len() {
            let mut density = |h: f64| {
                let mut y = y.clone();
                y[i] += h;
                let w = trace.propose(&[(t, Change::Free(y))], Draws::default()).unwrap();
                w.log_joint + w.log_jacobian
            };
            let slope = (density(1e-5) - density(-1e-5)) / 2e-5;
            assert!(
                (slope - gradient[place]).abs() < 1e-5 * (1.0 + slope.abs()),
                "{slope} {}",
                gradient[place]
            );
            place += 1;
        }
    }
    assert_eq!(place, gradient.len());
    assert!(place >= 44);
}

/// The saved state belongs to the trace's state: after a rejection it is the previous
/// one, and a fork has its own. If the wrong one were kept, the sum below, which trusts
/// it, would be wrong.
#[test]
fn state_goes_back_with_a_rejected_proposal_and_along_with_a_fork() {
    let trusting = Entry::incremental("trusting", |a, previous: Option<Previous<f64>>| {
        let x = a.num(0)?;
        let steps = match previous {
            // The previous value, minus the previous argument, plus the present one:
            // exact for whole numbers, if both belong to the same state.
            Some(p) => p.state() - p.argument(0).numbers()[0] + x,
            None => x,
        };
        Ok((Value::Num(steps), steps))
    })
    .argument("x", Type::Num, "A whole number.");
    let text = "assume x ~ poisson(20); assume y ~ poisson(20);
                observe normal(trusting(x) - trusting(y), 3) = 4; let apply = trusting; observe normal(apply(x), 9) = 20;";
    let model =
        Program::parse(text).unwrap().host(&Host::new().with(trusting)).unwrap().compile().unwrap();
    let mut trace = model.simulate(1, 0).unwrap();
    let mut fork = trace.clone();
    let mut kernel = Mh::new(SiteSelection { selector: Selector::All, pick: Pick::One });
    let (mut accepted, mut twin) =
        (0, Mh::new(SiteSelection { selector: Selector::All, pick: Pick::One }));
    let from_scratch = |trace: &Trace| {
        let again = Trace::generate(
            model.code().clone(),
            trace.constraints(),
            Draws::default(),
            Default::default(),
        );
        again.unwrap().0.log_joint()
    };
    for step in 0..2000 {
        accepted += kernel.step(&mut trace, &StepContext::new(1, 0, step)).unwrap().accepted;
        twin.step(&mut fork, &StepContext::new(2, 0, step)).unwrap();
        assert_eq!(
            trace.log_joint().to_bits(),
            from_scratch(&trace).to_bits(),
            "after step {step}"
        );
        assert_eq!(
            fork.log_joint().to_bits(),
            from_scratch(&fork).to_bits(),
            "after step {step} of the fork"
        );
    }
    assert!((300..1700).contains(&accepted), "{accepted}");
}

#[test]
fn a_chain_written_by_hand_samples_the_posterior() {
    let draws = embed_trace::chain(20_000).unwrap();
    let mean = draws.iter().sum::<f64>() / draws.len() as f64;
    assert!((mean - 2.0 / 3.0).abs() < 0.01, "{mean}");
}

#[test]
fn a_kernel_of_the_host_runs_by_name_and_is_checked_like_any_other() {
    let share = embed_kernel::share_on_the_right().unwrap();
    assert!((share - 0.8).abs() < 0.02, "{share}");
    let compile = |kernel: &str| {
        let text = format!(
            "assume x ~ normal(0, 1); observe normal(x, 1) = 1; infer {{ repeat 9 {{ {kernel}; }} }}"
        );
        let program = Program::parse(&text).unwrap().host(&embed_kernel::host()).unwrap();
        program.compile().and_then(|m| m.run(&RunOptions::default(), 1, 1))
    };
    assert!(compile("reflect(@x, about = 2)").is_ok());
    let message = |kernel| compile(kernel).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(
        message("reflekt(@x)").contains("did you mean `reflect`?"),
        "{}",
        message("reflekt(@x)")
    );
    assert!(message("reflect(@x, abuot = 2)").contains("did you mean `about`?"));
    assert!(message("reflect(@x, about = true)").contains("`about` must be a number"));
}

#[test]
fn a_kernel_of_the_host_applies_another() {
    struct Twice(Box<dyn Kernel>);
    impl Kernel for Twice {
        fn name(&self) -> String {
            "twice".into()
        }
        fn step(
            &mut self,
            trace: &mut Trace,
            at: &StepContext,
        ) -> pcadlang_engine::trace::TraceResult<pcadlang_inference::Outcome> {
            let mut all = self.0.step(trace, &at.within(0))?;
            all.add(self.0.step(trace, &at.within(1))?);
            Ok(all)
        }
    }
    let twice = Entry::kernel("twice", |call: &mut pcadlang_inference::host::KernelCall| {
        Ok(Twice(call.kernel(0)?))
    });
    let host = Host::new().with(twice.argument("move", Type::Kernel, "The inner kernel."));
    let text = "assume x ~ normal(0, 1); observe normal(x, 1) = 1; infer { repeat 100 { twice(mh(@x)); } }";
    let model = Program::parse(text).unwrap().host(&host).unwrap().compile().unwrap();
    assert_eq!(
        model.run(&RunOptions::default(), 1, 1).unwrap().chains[0].kernels[0].proposals,
        200
    );
}

#[test]
fn a_distribution_of_the_host_gives_the_same_posterior_with_and_without_its_gradient() {
    let (with, without) = (
        embed_distribution::share("hmc(@**, steps = 5)"),
        embed_distribution::share("drift(one(@**))"),
    );
    let ((p, b), (q, c)) = (with.unwrap(), without.unwrap());
    assert!((p - q).abs() < 0.01 && (b - c).abs() < 0.05, "p {p} {q}, b {b} {c}");
    let text = "assume xs ~ iid(kumaraswamy(2, 5), 3); observe normal(sum(xs), 1) = 1; infer { repeat 9 { drift(@xs); } }";
    let program = Program::parse(text).unwrap().host(&embed_distribution::host()).unwrap();
    assert!(program.compile().unwrap().run(&RunOptions::default(), 1, 1).is_ok());
    let text = "assume x ~ kumaraswamy(-1, 5); observe normal(x, 1) = 1;";
    let program = Program::parse(text).unwrap().host(&embed_distribution::host()).unwrap();
    let e =
        program.compile().unwrap().simulate(1, 0).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(e.contains("must be positive") && e.contains("1:12"), "{e}");
}

#[test]
fn a_likelihood_of_the_host_is_followed_by_hmc() {
    let slope = embed_likelihood::slope().unwrap();
    assert!((slope - 2.0).abs() < 0.15, "{slope}");
}

#[test]
fn a_run_is_watched_ended_and_left_in_its_folder() {
    let all = Folder::new("embedded");
    let folder = all.path().join("run");
    let draws = embed_run_dir::run(&folder, 500).unwrap();
    // The other chain is stopped where it is.
    assert!((500..=1000).contains(&draws), "{draws}");
    for name in ["run.json", "summary.json", "chain-1.csv", "chain-2.csv"] {
        assert!(folder.join(name).is_file(), "{name}");
    }
}

#[test]
fn errors_are_values_with_places() {
    let found = embed_errors::mistakes("assume x ~ nromal(0, 1);\nlet y = sqrt(x, 2);");
    assert_eq!(found.len(), 2);
    assert_eq!((found[0].0, found[0].1), (1, 12));
    assert_eq!(found[0].3.as_deref(), Some("did you mean `normal`?"));
    assert_eq!(found[1].0, 2);
    let e = embed_errors::while_running().unwrap();
    assert!(e.contains("<program>:3:"), "{e}");
}

/// All errors in a host's entries are reported at once.
#[test]
fn names_that_clash_or_are_none_are_errors() {
    let one = |name: &'static str| Entry::function(name, |_| Ok(Value::Num(1.0)));
    let host = Host::new()
        .with(one("normal"))
        .with(one("if"))
        .with(one("two words"))
        .with(one("mine"))
        .with(one("mine"))
        .with(one("pi").replacing())
        .with(one("f").optional("a", Type::Num, 1.0, "One.").argument("b", Type::Num, "Two."))
        .with(embedded_distribution().gradient(|_, _, _| None));
    let e = Program::parse("").unwrap().host(&host).err().unwrap();
    let text = e.to_string();
    for part in [
        "`normal` is a built-in of the language",
        "`if` is not a valid name",
        "`two words` is not a valid name",
        "the host registers `mine` twice",
        "`pi` is a built-in of the language",
        "`f`: the required argument `b` must come before",
        "`d`: only functions take a gradient",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert_eq!(e.diagnostics.len(), 7, "{text}");
}

fn embedded_distribution() -> Entry {
    Entry::distribution("d", |_| {
        Err::<pcadlang_numerics::dist::Normal, _>(pcadlang_inference::host::Fault::domain("none"))
    })
}

/// A density of NaN means an impossible value, and a host's family may sample any value:
/// its type is not guessed.
#[test]
fn what_a_host_s_distribution_does_wrong_reaches_no_accept_test() {
    use pcadlang_inference::host::{Datum, Distribution, Gradient, Support};
    #[derive(Debug)]
    struct Odd;
    impl Distribution for Odd {
        fn name(&self) -> &str {
            "odd"
        }
        fn support(&self) -> Support {
            Support::Vector(2)
        }
        fn sample(&self, rng: &mut pcadlang_numerics::rng::Stream) -> Datum {
            vec![rng.uniform() - 0.5, rng.uniform()].into()
        }
        /// The square root of a number that may be negative.
        fn log_density(&self, x: &Datum) -> f64 {
            x.element(0).and_then(|x| x.num()).map_or(f64::NEG_INFINITY, |x| -x.sqrt())
        }
        fn gradient(&self, _: &Datum) -> Option<Gradient> {
            None
        }
    }
    let host = Host::new().with(Entry::distribution("odd", |_| Ok(Odd)).argument(
        "n",
        Type::Num,
        "Anything.",
    ));
    let text = "assume x ~ odd(1); observe normal(x[0] + x[1], 1) = 1; infer { init(best_of(20)); repeat 500 { drift(@x); } }";
    let model = Program::parse(text).unwrap().host(&host).unwrap().compile().unwrap();
    let posterior = model.run(&RunOptions::default(), 1, 1).unwrap();
    let x = posterior.quantity("x[0]").unwrap().chains.concat();
    assert!(x.iter().all(|x| *x >= 0.0) && x.iter().any(|a| *a != x[0]));
}

/// A point in unconstrained space does not determine the discrete part of a value, so
/// `knn` draws such a value from its prior.
#[test]
fn neighbours_do_not_move_what_is_in_part_discrete() {
    use pcadlang_inference::host::{Datum, Distribution, Gradient, Support};
    use pcadlang_inference::{Knn, Latent, Neighbours};
    /// A standard normal number, and 0 or 1.
    #[derive(Debug)]
    struct Toss;
    impl Distribution for Toss {
        fn name(&self) -> &str {
            "toss"
        }
        fn support(&self) -> Support {
            Support::Each([Support::Real, Support::Integers { lo: 0, hi: Some(1) }].into())
        }
        fn sample(&self, rng: &mut pcadlang_numerics::rng::Stream) -> Datum {
            vec![rng.standard_normal(), rng.index(2) as f64].into()
        }
        fn log_density(&self, x: &Datum) -> f64 {
            match x {
                Datum::Vec(xs) if self.support().contains(x) => {
                    -0.5 * (xs[0] * xs[0] + std::f64::consts::TAU.ln()) - 2f64.ln()
                }
                _ => f64::NEG_INFINITY,
            }
        }
        fn gradient(&self, _: &Datum) -> Option<Gradient> {
            None
        }
    }
    let host = Host::new().with(Entry::distribution("toss", |_| Ok(Toss)).argument(
        "n",
        Type::Num,
        "Anything.",
    ));
    let text = "assume x ~ toss(1); observe normal(x[0], 1) = 0.5;";
    let model = Program::parse(text).unwrap().host(&host).unwrap().compile().unwrap();
    let scenes: Vec<_> = (0..5).map(|i| Latent::all(&model.simulate(2, i).unwrap())).collect();
    let scope = SiteSelection { selector: Selector::All, pick: Pick::All };
    let mut kernel = Knn::new(scope, std::sync::Arc::new(Neighbours::new(scenes, &[])));
    let mut trace = model.simulate(1, 0).unwrap();
    let (mut ones, mut accepted) = (0, 0);
    for step in 0..4000 {
        accepted += kernel.step(&mut trace, &StepContext::new(1, 0, step)).unwrap().accepted;
        let side = trace.value(trace.all_targets()[0]).element(1);
        ones += u32::from(side.is_some_and(|side| side.same(&Value::Num(1.0))));
    }
    assert!(accepted > 1000 && (1700..2300).contains(&ones), "{accepted} accepted, {ones} ones");

    // Kernels that move along unconstrained coordinates leave the value alone:
    // coordinates do not determine its discrete part, so there is no way back.
    let x = |t: &Trace| format!("{:?}", t.value(t.all_targets()[0]));
    let is_one = |t: &Trace| {
        t.value(t.all_targets()[0]).element(1).is_some_and(|v| v.same(&Value::Num(1.0)))
    };
    let mut trace = (0..50).map(|i| model.simulate(1, i).unwrap()).find(is_one).unwrap();
    let before = x(&trace);
    let all = || SiteSelection { selector: Selector::All, pick: Pick::All };
    let mut kernels: [Box<dyn Kernel>; 2] =
        [Box::new(Drift::new(all(), None)), Box::new(Slice::new(all(), None, true))];
    for kernel in &mut kernels {
        (0..50)
            .for_each(|step| _ = kernel.step(&mut trace, &StepContext::new(1, 0, step)).unwrap());
        assert_eq!(x(&trace), before, "{}", kernel.name());
    }
}

/// Names made at run time are not leaked: an entry owns them, and is dropped with its
/// host.
#[test]
fn names_made_at_run_time_are_the_entry_s_own() {
    let host = (0..3).fold(Host::new(), |h, i| {
        h.with(
            Entry::function(format!("f{i}"), move |a| Ok(Value::Num(a.num(0)? + f64::from(i))))
                .argument(format!("x{i}"), Type::Num, format!("Number {i}.")),
        )
    });
    let model = Program::parse("let y = f2(x2 = 3); observe normal(y, 1) = 5;")
        .unwrap()
        .host(&host)
        .unwrap()
        .compile();
    let trace = model.unwrap().simulate(0, 0).unwrap();
    assert_eq!(trace.observed().len(), 1);
    assert!(host.doc("f1").unwrap().contains("Number 1."));
}

/// A host may compile on one thread, run on others, and send the results back.
#[test]
fn what_a_host_passes_between_threads_can_be() {
    fn sent<T: Send>() {}
    fn shared<T: Send + Sync>() {}
    sent::<Trace>();
    sent::<Posterior>();
    sent::<Program>();
    shared::<Model>();
    shared::<Error>();
    shared::<Host>();
    shared::<Value>();
    shared::<RunOptions>();
    shared::<Progress>();
    shared::<Callbacks>();
    shared::<Memory>();
    shared::<RunDir>();
}
