//! Every function of numbers, over sizes and values from 1e-300 to 1e300, 0, infinities
//! and NaN. `docs/reference/numerics.md` has the subjects, the bounds and the numbers of points;
//! the tests check its table.

mod comparators;
mod covariances;
mod densities;
mod diagnostics;
mod kernels;
mod points;
mod rendering;
mod samplers;
mod table;
mod transforms;
