//! Kernels that keep a state, a distance or a second trace between steps adopt new data,
//! and a surrogate avoids evaluations of its observation.

use pcadlang::Model;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Change, Draws, Pattern, Selector, Trace};
use pcadlang_inference::host::Datum;
use pcadlang_inference::{
    Abc, Delayed, Drift, Kernel, Mh, Pick, SiteSelection, Smc, StepContext, Temper,
};
use pcadlang_syntax::span::Span;

fn scope() -> SiteSelection {
    SiteSelection { selector: Selector::All, pick: Pick::All }
}

/// Returns the mean of `x` after the data have been set to 2, following steps under the
/// program's own data.
fn under_new_data(kernel: &mut dyn Kernel, steps: u64) -> f64 {
    let model = Model::from_text("assume x ~ normal(0, 1); observe normal(x, 1) = -3;").unwrap();
    let mut trace: Trace = model.simulate(1, 0).unwrap();
    for i in 0..50 {
        kernel.step(&mut trace, &StepContext::new(1, 0, i)).unwrap();
    }
    let hash = trace.observed()[0].hash;
    trace.set_observed(&[(hash, Value::Num(2.0))]).unwrap();
    trace.commit();
    let (mut sum, skip) = (0.0, steps / 10);
    for i in 0..skip + steps {
        kernel.step(&mut trace, &StepContext::new(1, 0, 50 + i)).unwrap();
        assert!(trace.observed()[0].value.same(&Value::Num(2.0)));
        if i >= skip {
            let Value::Num(x) = trace.value(trace.all_targets()[0]) else { panic!("no number") };
            sum += x;
        }
    }
    sum / steps as f64
}

/// Kernels that keep states or distances between steps adopt the new data of the trace.
#[test]
fn other_data_reach_what_is_kept() {
    let walk = || -> Box<dyn Kernel> { Box::new(Drift::new(scope(), Some(1.0))) };
    let mean = under_new_data(&mut Temper::new((0..3).map(|_| walk()).collect(), 0.1), 20_000);
    assert!((mean - 1.0).abs() < 0.1, "temper: {mean}");
    let mean = under_new_data(&mut Smc::new(walk(), 10, Selector::Nothing, Span::default()), 2000);
    assert!((mean - 1.0).abs() < 0.1, "smc: {mean}");
    let mean =
        under_new_data(&mut Abc::new(Box::new(Mh::new(scope())), 0.5, Span::default()), 60_000);
    // The mean of data simulated within 0.5 of 2 is 2 - 1 / 12; the posterior mean of `x`
    // is half of that.
    assert!((mean - 0.96).abs() < 0.08, "abc: {mean}");
}

/// The observation is evaluated once for each proposal that the surrogate accepts, and
/// not at all for the others; the chain is the same with and without incremental updates.
#[test]
fn the_observation_is_evaluated_for_what_the_surrogate_accepts() {
    let surrogate = "observe normal(far, 0.3) = 2 with coarse = normal(x, 0.6) as y;";
    let waiting =
        "observe normal(x, 0.6) = 2; observe normal(far, 0.3) = 2 with coarse = flat() as y;";
    [surrogate, waiting].into_iter().for_each(evaluated_for_what_passes);
}

fn evaluated_for_what_passes(observed: &str) {
    let text = format!("assume x ~ normal(0, 3); let far = 1000 * sin(x / 1000); {observed}");
    let model = Model::from_text(&text).unwrap();
    let run = |incremental: bool| {
        let mut trace = model.simulate(1, 0).unwrap();
        trace.set_incremental(incremental);
        let y = trace.observations().pop().unwrap().0;
        let at = Selector::Address(Pattern::exact(&y));
        let inner = Box::new(Mh::new(scope()));
        let mut kernel = Delayed::new(inner, at, Span::default());
        kernel.step(&mut trace, &StepContext::new(1, 0, 0)).unwrap();
        trace.record_execution();
        let (mut states, mut accepted) = (Vec::new(), 0);
        for i in 1..2000 {
            accepted += kernel.step(&mut trace, &StepContext::new(1, 0, i)).unwrap().accepted;
            states.push(trace.log_joint().to_bits());
        }
        let fine = &text[text.find("normal(far").unwrap()..];
        let spans = trace.executed();
        let evaluated = spans.iter().filter(|s| text[s.start as usize..].starts_with(fine)).count();
        (states, accepted, evaluated)
    };
    let (states, accepted, evaluated) = run(true);
    assert!(
        accepted > 100 && (accepted as usize..1000).contains(&evaluated),
        "{accepted}, {evaluated}"
    );
    assert_eq!(states, run(false).0);
}

/// A proposal that is neither committed nor rolled back does not affect a step.
#[test]
fn the_surrogate_does_not_follow_what_is_pending() {
    let text =
        "assume x ~ normal(0, 1); observe normal(x, 0.5) = 1 with coarse = normal(x, 1) as y;";
    let mut trace: Trace = Model::from_text(text).unwrap().simulate(1, 0).unwrap();
    let at = Selector::Address(Pattern::exact(&trace.observations()[0].0));
    let kernel = || Delayed::new(Box::new(Mh::new(scope())), at.clone(), Span::default());
    let (mut one, mut other, mut disturbed) = (kernel(), kernel(), trace.clone());
    let value = |t: &Trace| t.value(t.all_targets()[0]);
    for i in 0..100 {
        let x = disturbed.all_targets()[0];
        disturbed.propose(&[(x, Change::Set(Datum::Num(3.0)))], Draws::default()).unwrap();
        one.step(&mut trace, &StepContext::new(1, 0, i)).unwrap();
        other.step(&mut disturbed, &StepContext::new(1, 0, i)).unwrap();
        assert!(value(&disturbed).same(&value(&trace)), "step {i}");
    }
}

/// While the likelihood is annealed, both stages raise it to the same power.
#[test]
fn both_stages_take_the_likelihood_at_its_power() {
    let text =
        "assume x ~ normal(0, 1); observe normal(x, 0.5) = 2 with coarse = normal(x, 0.8) as y;";
    let mut trace: Trace = Model::from_text(text).unwrap().simulate(1, 0).unwrap();
    let at = Selector::Address(Pattern::exact(&trace.observations()[0].0));
    let mut kernel = Delayed::new(Box::new(Drift::new(scope(), Some(1.0))), at, Span::default());
    let (mut sum, steps) = (0.0, 20_000);
    for i in 0..steps {
        kernel.step(&mut trace, &StepContext { power: 0.5, ..StepContext::new(1, 0, i) }).unwrap();
        let Value::Num(x) = trace.value(trace.all_targets()[0]) else { panic!("no number") };
        sum += x;
    }
    // A product of Gaussians: precision 1 around 0, and precision 0.5 * 4 around 2.
    let mean = sum / steps as f64;
    assert!((mean - 4.0 / 3.0).abs() < 0.08, "{mean}");
}
