//! `mala(sel)`: a trajectory of one leapfrog step.

use super::hmc::Hmc;
use crate::kernels::row::{KernelRow, MARGINAL, SEL, number};

pub(crate) const ROW: KernelRow = KernelRow::new(
    "mala",
    &[SEL, MARGINAL],
    "The Metropolis-adjusted Langevin algorithm: one gradient per proposal.",
    number!("infer { warmup 200 { mala(@x); } repeat 100 { mala(@x); collect x; } }"),
    |call| call.moving(|scope, call| Ok(Hmc::new(scope, 1, None).summing_out(call.marginal()?))),
);
