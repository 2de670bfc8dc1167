//! What runs gather besides draws: the best state, evidence of modes, kept states, the way
//! from the prior, statistics of sites; all of it comes back from checkpoints.

use pcadlang::{Model, RunOptions};
use pcadlang_engine::trace::Trace;
use pcadlang_inference::draws::SiteStats;
use pcadlang_inference::{
    BestSoFar, Callback, Evidence, KeptTraces, Progress, Trajectory, TrajectoryState, Weighed,
};
use std::sync::Arc;
use std::sync::atomic::Ordering;

#[test]
fn the_best_state_is_the_best_that_steps_saw() {
    let model = Model::from_text(
        "assume x ~ normal(0, 1); observe normal(x, 0.1) = 1;
         infer { warmup 400 { drift(@x); } repeat 400 { drift(@x); collect x; } }",
    )
    .unwrap();
    let progress: Arc<Progress> = Arc::default();
    let best = Arc::new(BestSoFar::new(2, &progress));
    let options = RunOptions { callback: Some(best.clone()), seed: 3, ..RunOptions::default() };
    let posterior = model.run(&options, 2, 1).unwrap();
    let drawn = posterior.scalars().into_iter().find(|q| q.0 == "log_joint").unwrap().1;
    let state = best.state().unwrap();
    // The density is greatest at 100/101; one of hundreds of states is near it.
    let greatest = model_density(100.0 / 101.0);
    assert!(state.log_joint <= greatest && state.log_joint > greatest - 0.01, "{state:?}");
    assert!(drawn.iter().all(|l| *l <= state.log_joint), "no draw is better");
    assert_eq!(f64::from_bits(progress.best.load(Ordering::Relaxed)), state.log_joint);
    let again = BestSoFar::new(2, &Arc::default());
    (0..2).for_each(|c| again.load(c, &best.save(c)).unwrap());
    assert_eq!(again.state(), Some(state));
    assert!(again.load(0, b"no state").is_err());
}

fn model_density(x: f64) -> f64 {
    let normal =
        |z: f64, sd: f64| -0.5 * (z / sd) * (z / sd) - sd.ln() - 0.5 * std::f64::consts::TAU.ln();
    normal(x, 1.0) + normal(1.0 - x, 0.1)
}

/// Chains that start in either of two modes and cannot leave: the modes'
/// probabilities are proportional to their masses, 0.3 and 0.7 times the likelihood
/// of the observation, whatever the number of chains in each.
#[test]
fn modes_that_chains_cannot_leave_have_their_shares() {
    let model = Model::from_text(
        "assume far ~ flip(0.7);
         assume x ~ gamma(3, if far { 4 } else { 2 });
         assume y ~ mv_normal([x, 0], [[1, 0.5], [0.5, 2]]);
         assume k ~ flip(0.25);
         observe normal(y[0] - x, 1) = 0.3;
         infer { warmup 500 { nuts(@x + @y); mh(@k); } repeat 4000 { nuts(@x + @y); mh(@k); collect x, far; } }",
    )
    .unwrap();
    let evidence = Arc::new(Evidence::new(6));
    let options = RunOptions { callback: Some(evidence.clone()), seed: 5, ..RunOptions::default() };
    let posterior = model.run(&options, 6, 2).unwrap();
    let far = posterior.quantity("far").unwrap();
    let of = |v: f64| (0..6).filter(|c| far.chains[*c][0] == v).collect::<Vec<_>>();
    let (near, far) = (of(0.0), of(1.0));
    assert!(!near.is_empty() && !far.is_empty(), "{near:?} {far:?}");
    let weighed = [&near, &far].map(|m| evidence.of(m).unwrap());
    let each = weighed.map(|w| w.evidence.unwrap());
    // Of all distributions with a given covariance, a Gaussian has the greatest
    // entropy: other distributions are given a little too much evidence.
    let truth = libm::log(0.5 / std::f64::consts::PI.sqrt()) - 0.25 * 0.09;
    let over = each[0].value - truth - libm::log(0.3);
    assert!(over > 0.0 && over < 0.2, "{each:?} {truth}");
    let (s, known) = Weighed::probabilities(&weighed);
    assert!((s[1] - 0.7).abs() < 0.03 && known, "{s:?}");
    let unknown = weighed.map(|w| Weighed { evidence: None, ..w });
    assert!(!Weighed::probabilities(&unknown).1);

    let again = Evidence::new(6);
    (0..6).for_each(|c| again.load(c, &evidence.save(c)).unwrap());
    assert_eq!(again.of(&near), evidence.of(&near));
    assert!(again.load(0, b"no state").is_err());
    assert!(evidence.of(&[]).is_none() && evidence.of(&[17]).is_none());
}

#[test]
fn draws_are_kept_at_even_distances_and_come_back() {
    let model = Model::from_text(
        "assume x ~ normal(0, 1); observe normal(x, 1) = 1; infer { repeat 1000 { drift(@x); collect x; } }",
    )
    .unwrap();
    let kept = Arc::new(KeptTraces::new(2, 20, model.hash()));
    let options = RunOptions { callback: Some(kept.clone()), seed: 3, ..RunOptions::default() };
    let posterior = model.run(&options, 2, 1).unwrap();
    let all = kept.all();
    assert!((10..=20).contains(&all.len()) && all.iter().filter(|k| k.chain == 2).count() >= 5);
    for k in &all {
        let row = &posterior.draws[k.chain as usize - 1].rows[k.draw as usize - 1];
        assert_eq!(row.log_joint.to_bits(), k.log_joint.to_bits());
        let back =
            Trace::load(Arc::clone(model.code()), model.hash(), &k.trace, model.limits().clone())
                .unwrap();
        assert_eq!(back.log_joint().to_bits(), k.log_joint.to_bits());
    }
    let again = KeptTraces::new(2, 20, model.hash());
    (0..2).for_each(|c| again.load(c, &kept.save(c)).unwrap());
    assert_eq!(again.all(), all);
    assert!(again.load(0, b"no state").is_err());
    assert!(KeptTraces::new(2, 0, "").all().is_empty());
}

#[test]
fn the_first_steps_are_kept_densely_and_later_ones_rarely() {
    let model = Model::from_text(
        "assume x ~ normal(0, 1); observe normal(x, 0.01) = 3;
         infer { warmup 1000 { drift(@x); } repeat 3000 { drift(@x); collect x; } }",
    )
    .unwrap();
    let way = Arc::new(Trajectory::new(2, model.hash()));
    let options = RunOptions { callback: Some(way.clone()), seed: 3, ..RunOptions::default() };
    model.run(&options, 2, 1).unwrap();
    let one = way.of_chain(1);
    assert!((40..90).contains(&one.len()), "{}", one.len());
    assert!(one.iter().all(|s| s.chain == 2) && one[0].step <= 1);
    assert!(one.windows(2).all(|w| w[1].step > w[0].step));
    assert!(one[0].log_joint < one[one.len() - 1].log_joint - 100.0, "from prior to posterior");
    // A run that went on after its last checkpoint is resumed from there.
    let again = Trajectory::new(2, model.hash());
    let saved = [0, 1].map(|c| way.save(c));
    let later = TrajectoryState { step: 1_000_000, ..one[0].clone() };
    again.restore(way.all().into_iter().chain([later]).collect());
    assert_eq!(again.count(), way.count() + 1);
    (0..2).for_each(|c| again.load(c, &saved[c as usize]).unwrap());
    assert_eq!(again.all(), way.all());
    assert!(again.load(0, b"no state").is_err());
}

#[test]
fn single_site_kernels_are_counted_by_address() {
    let model = Model::from_text(
        "assume c ~ flip(0.5); assume x = if c { a ~ normal(0, 1); a } else { b ~ normal(1, 1); b };
         assume z ~ iid(normal(0, 1), 2);
         observe normal(x + z[0] - z[1], 1) = 0;
         infer { warmup 100 { mh(one(@**)); } repeat 3000 { mh(one(@**)); gibbs(@c); drift(one($continuous)); } }",
    )
    .unwrap();
    let done = model.run(&RunOptions { sites: true, ..RunOptions::default() }, 2, 1).unwrap();
    let all = SiteStats::total(done.chains.iter().flat_map(|c| &c.sites));
    let names: Vec<&str> = all.iter().map(|s| &*s.address).collect();
    assert_eq!(names, ["@c", "@x/a", "@x/b", "@z[0]", "@z[1]"]);
    // Every choice still exists after a step that picks it, so every proposal counts
    // at some address.
    let proposals: u64 = done.chains.iter().flat_map(|c| &c.kernels).map(|k| k.proposals).sum();
    assert_eq!(all.iter().map(|s| s.proposals).sum::<u64>(), proposals);
    assert!(all.iter().all(|s| s.acceptance().is_some_and(|a| a > 0.05 && a < 1.0)), "{all:?}");
    let silent = model.run(&RunOptions::default(), 1, 1).unwrap();
    assert!(silent.chains[0].sites.is_empty());
}
