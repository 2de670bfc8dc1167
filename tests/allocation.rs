//! A transition of fixed structure does not allocate once the trace has warmed up.
//!
//! Allocations are counted by a global allocator, whose trait is unsafe; it only counts,
//! and forwards to the system allocator. It would do so for every test of its program, so
//! this file is a program of its own.

use pcadlang::Model;
use pcadlang_engine::trace::{Selector, Trace};
use pcadlang_inference::{Gibbs, Hmc, Kernel, Mh, Nuts, Pick, SiteSelection, StepContext};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is forwarded unchanged to the system allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = COUNT.try_with(|c| c.set(c.get() + 1));
        // SAFETY: as above.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, p: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(p, layout) }
    }

    unsafe fn realloc(&self, p: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        let _ = COUNT.try_with(|c| c.set(c.get() + 1));
        // SAFETY: as above.
        unsafe { System.realloc(p, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Counts the allocations of `steps` steps, after the same number of warm-up steps.
fn allocations(kernel: &mut dyn Kernel, trace: &mut Trace, steps: u64) -> u64 {
    let mut run = |first: u64| {
        for step in first..first + steps {
            kernel.step(trace, &StepContext::new(1, 0, step)).unwrap_or_else(|e| panic!("{e}"));
        }
    };
    run(0);
    let before = COUNT.with(Cell::get);
    run(steps);
    COUNT.with(Cell::get) - before
}

fn scope(tag: &str) -> SiteSelection {
    SiteSelection { selector: Selector::Tag { name: tag.into(), value: None }, pick: Pick::One }
}

const REGRESSION: &str = "let n = 50;
    assume slope ~ normal(0, 2) #coef; assume intercept ~ normal(0, 2) #coef; assume log_noise ~ normal(0, 1) #coef;
    let noise = exp(log_noise);
    for i in 0 .. n {
      outlier[i] ~ flip(0.1) #flag;
      observe normal(if outlier[i] { 0 } else { slope * i / n + intercept }, if outlier[i] { 10 } else { noise }) = i % 7;
    }";

const CHAIN: &str = "let move = [[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]];
    for t in 0 .. 50 {
      z[t] ~ categorical(if t == 0 { [1, 1, 1] } else { move[z[t - 1]] }) #state;
      observe normal(2 * z[t], 1) = t % 5;
    }";

#[test]
fn transitions_of_fixed_structure_allocate_nothing() {
    let kernels: [fn(SiteSelection) -> Box<dyn Kernel>; 2] =
        [|s| Box::new(Gibbs::new(s)), |s| Box::new(Mh::new(s))];
    for make in kernels {
        for (text, tag) in [(REGRESSION, "flag"), (CHAIN, "state")] {
            let model = Model::from_text(text).unwrap_or_else(|e| panic!("{e}"));
            let mut trace = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"));
            let mut kernel = make(scope(tag));
            let count = allocations(&mut *kernel, &mut trace, 20_000);
            assert_eq!(
                count,
                0,
                "{} of ${tag}: {count} allocations in 20,000 steps",
                kernel.name()
            );
        }
    }
}

#[test]
fn redrawing_a_coefficient_that_all_points_read_allocates_nothing() {
    let model = Model::from_text(REGRESSION).unwrap_or_else(|e| panic!("{e}"));
    let mut trace = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"));
    let count = allocations(&mut Mh::new(scope("coef")), &mut trace, 2000);
    assert_eq!(count, 0, "{count} allocations in 2,000 steps");
}

const SCHOOLS: &str =
    "let y = [28, 8, -3, 7, -1, 1, 18, 12]; let sigma = [15, 10, 16, 11, 9, 11, 10, 18];
    assume mu ~ normal(0, 5); assume tau ~ half_normal(5); assume e ~ iid(normal(0, 1), 8);
    observe normal(mu + tau * e, sigma) = y;";

fn schools(kernel: &mut dyn Kernel, steps: u64) -> u64 {
    let model = Model::from_text(SCHOOLS).unwrap_or_else(|e| panic!("{e}"));
    let mut trace = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"));
    allocations(kernel, &mut trace, steps)
}

#[test]
fn leapfrog_steps_allocate_nothing() {
    let all = || SiteSelection { selector: Selector::All, pick: Pick::All };
    let steps = 200;
    // The steps are so short that every proposal is accepted, so the allocations of a
    // transition are those of its one proposal.
    let of = |leaps: u32| schools(&mut Hmc::new(all(), leaps, Some(1e-3)), steps);
    let (few, many) = (of(2), of(40));
    assert_eq!(
        few, many,
        "{few} allocations in {steps} transitions of 2 leapfrog steps, {many} in those of 40"
    );
    assert!(few <= 40 * steps, "{few} allocations in {steps} transitions");
    let walk = schools(&mut Nuts::new(all(), 10), steps);
    assert!(walk <= 40 * steps, "{walk} allocations in {steps} transitions of nuts");
}
