//! Tests of the checks by simulation: correct kernels pass, planted errors are detected,
//! and programs that cannot be simulated are refused with the reason.

use pcadlang::Model;
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Change, Draws, Limits, Selector, Trace, TraceResult};
use pcadlang_inference::calibration::{
    CalibrationError, PlanSampler, Sampler, Settings, geweke, sbc,
};
use pcadlang_inference::{
    Callback, ChainError, Kernel, Mh, Outcome, Pick, Progress, RunOptions, SiteSelection, Start,
    StepContext, starts,
};
use pcadlang_numerics::dist::Datum;
use pcadlang_numerics::rng::{Purpose, Stream, StreamKey};
use std::sync::Arc;

const GAMMA: &str = "assume s ~ gamma(3, 3); observe poisson(4 * s) = [2, 3] as n;";

fn model(text: &str) -> Model {
    Model::from_text(text).unwrap_or_else(|e| panic!("{e}"))
}

/// The Metropolis-Hastings acceptance test.
fn decide(trace: &mut Trace, log_ratio: f64, rng: &mut Stream) -> Outcome {
    let accepted = libm::log(rng.open_uniform()) < log_ratio;
    if accepted {
        trace.commit()
    } else {
        trace.rollback()
    }
    Outcome::one(accepted)
}

/// A random walk on the logarithm, with or without its Hastings correction.
struct LogWalk {
    hastings: bool,
}

impl Kernel for LogWalk {
    fn name(&self) -> String {
        "log walk".into()
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let mut rng = at.stream();
        let all = trace.select(&Selector::All);
        let target = trace.targets(all)[0];
        let Value::Num(x) = trace.value(target) else { return Ok(Outcome::default()) };
        let step = rng.standard_normal();
        let weight = trace
            .propose(&[(target, Change::Set(Datum::Num(x * libm::exp(step))))], at.draws(0))?;
        let hastings = if self.hastings { step } else { 0.0 };
        Ok(decide(trace, weight.log_weight + hastings, &mut rng))
    }
}

/// Resimulation from the prior that accepts too often: the ratio is raised to the power
/// of a quarter, as if the data were less informative.
struct Eager;

impl Kernel for Eager {
    fn name(&self) -> String {
        "eager".into()
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let mut rng = at.stream();
        let all = trace.select(&Selector::All);
        let target = trace.targets(all)[0];
        let weight = trace.propose(&[(target, Change::Resample)], at.draws(0))?;
        Ok(decide(trace, 0.25 * weight.log_weight, &mut rng))
    }
}

/// A sampler that applies one kernel in a loop from a draw from the prior, for custom
/// kernels.
struct KernelSampler {
    /// Constructs the kernel of a chain.
    kernel: fn() -> Box<dyn Kernel>,
    /// The seed.
    seed: u64,
    /// Applications before the first draw, in which the kernel may adapt.
    warmup: u64,
    /// Applications between draws; at least 1.
    every: u64,
    /// The number of draws, if the check does not set the number of steps.
    draws: u64,
}

impl Sampler for KernelSampler {
    fn run(
        &self,
        code: &Arc<Code>,
        chain: u32,
        steps: Option<u64>,
        callback: Arc<dyn Callback>,
    ) -> Result<u64, ChainError> {
        let begun = starts(code, self.seed, chain, Start::default(), Limits::default())
            .map_err(ChainError::Start)?;
        let Some(mut trace) = begun.into_iter().next() else { return Ok(0) };
        let mut kernel = (self.kernel)();
        let every = self.every.max(1);
        let steps = steps.unwrap_or(self.draws * every);
        let predict = StreamKey::new(self.seed, chain, Purpose::PREDICT);
        for step in 0..self.warmup + steps {
            let adapting = step < self.warmup;
            kernel.step(
                &mut trace,
                &StepContext { adapting, ..StepContext::new(self.seed, chain, step) },
            )?;
            if !adapting && (step - self.warmup + 1).is_multiple_of(every) {
                callback.draw(chain, &mut trace, Draws { key: predict, step, substream: 0 });
            }
        }
        Ok(steps)
    }
}

fn looped(kernel: fn() -> Box<dyn Kernel>, every: u64) -> KernelSampler {
    KernelSampler { kernel, seed: 5, warmup: 50, every, draws: 40 }
}

const RIGHT: fn() -> Box<dyn Kernel> = || Box::new(LogWalk { hastings: true });
const WRONG: fn() -> Box<dyn Kernel> = || Box::new(LogWalk { hastings: false });
const EAGER: fn() -> Box<dyn Kernel> = || Box::new(Eager);
const MH: fn() -> Box<dyn Kernel> =
    || Box::new(Mh::new(SiteSelection { selector: Selector::All, pick: Pick::One }));

fn settings(replicates: usize) -> Settings {
    Settings { replicates, seed: 11, threads: 2, ..Settings::default() }
}

#[test]
fn sbc_tells_right_kernels_from_planted_errors() {
    let m = model(GAMMA);
    for (kernel, right) in [(RIGHT, true), (MH, true), (WRONG, false), (EAGER, false)] {
        let said =
            sbc(m.code(), &looped(kernel, 12), &Settings { steps: Some(480), ..settings(300) })
                .unwrap();
        assert_eq!(said.rows.iter().map(|r| &*r.name).collect::<Vec<_>>(), ["@s", "log joint"]);
        assert_eq!(said.passes(), right, "{}: {said:?}", kernel().name());
        assert_eq!(said.rows[0].counts.iter().sum::<u32>(), 300);
    }
}

#[test]
fn geweke_tells_right_kernels_from_planted_errors() {
    let m = model(GAMMA);
    for (kernel, right) in [(RIGHT, true), (MH, true), (WRONG, false), (EAGER, false)] {
        let said = geweke(m.code(), &looped(kernel, 3), &settings(100)).unwrap();
        assert_eq!(said.rows.len(), 4);
        assert_eq!(said.passes(), right, "{}: {said:?}", kernel().name());
    }
}

/// Changing structure, discrete choices, arrays: the plan of a program passes both
/// checks.
#[test]
fn plans_with_changing_structure_pass() {
    let m = model(
        "assume c ~ flip(0.4);
         assume x = if c { a ~ categorical([1, 2, 1]); a } else { b ~ gamma(2, 1); d ~ flip(0.3); if d { b } else { b + 1 } };
         assume v ~ mv_normal([0, 0], [[1, 0.5], [0.5, 1]]);
         observe normal(x, 1) = [2, 1]; observe normal(v[0] - v[1], 1) = 0; observe flip(0.2 + 0.6 * (if c { 1 } else { 0 })) = true;
         infer { repeat 80 { repeat 20 { mix { 0.6 => mh(one(@**)); 0.2 => block(@**); 0.2 => elliptical($gaussian); } } } }",
    );
    let (plan, _) = m.plan().unwrap();
    let progress = Progress::default();
    let sampler = PlanSampler {
        plan: &plan,
        options: RunOptions { seed: 2, ..RunOptions::default() },
        progress: &progress,
    };
    let ranks = sbc(m.code(), &sampler, &Settings { steps: Some(1600), ..settings(50) }).unwrap();
    assert!(
        ranks.passes() && ranks.rows.iter().any(|r| r.name == "@x/b") && ranks.rows.len() == 7,
        "{ranks:?}"
    );
    let joint = geweke(m.code(), &sampler, &settings(40)).unwrap();
    assert!(joint.passes() && joint.turns == 79, "{joint:?}");
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let m = model(GAMMA);
    let on = |threads| {
        let s = Settings { threads, ..settings(24) };
        let (a, b) = (
            sbc(m.code(), &looped(MH, 2), &s).unwrap(),
            geweke(m.code(), &looped(MH, 2), &s).unwrap(),
        );
        format!("{a:?} {b:?}")
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn programs_that_are_no_joint_distribution_are_refused_with_the_reason() {
    for (text, says) in [
        ("assume x ~ normal(0, 1); factor(-x * x) as soft;", "@soft is a factor"),
        ("assume x ~ flat(); observe normal(x, 1) = 0;", "the prior of @x is improper"),
        ("assume x ~ normal(0, 1); freeze @x; observe normal(x, 1) = 0;", "`freeze`"),
        ("assume x ~ normal(0, 1);", "has no observations"),
        (
            "assume c ~ flip(0.5); assume x ~ normal(0, 1); if c { observe normal(x, 1) = 0 as y; } observe normal(x, 1) = 1;",
            "whether the observation",
        ),
        (
            "assume x ~ normal(0, 1); observe normal(0, 1) = x as y;",
            "the value observed by @y depends on random choices",
        ),
    ] {
        let m = model(text);
        let said = match sbc(m.code(), &looped(MH, 1), &settings(20)) {
            Err(CalibrationError::NotSimulable(reason)) => reason,
            other => panic!("{text}: {other:?}"),
        };
        assert!(said.contains(says), "{text}: {said}");
        assert!(matches!(
            geweke(m.code(), &looped(MH, 1), &settings(20)),
            Err(CalibrationError::NotSimulable(r)) if r == said
        ));
    }
    let few = sbc(model(GAMMA).code(), &looped(MH, 1), &settings(5));
    assert!(matches!(few, Err(CalibrationError::TooFew(_))));
}
