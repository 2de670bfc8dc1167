//! Everything that takes numbers, through sizes and values from 1e-300 to 1e300, 0,
//! infinities and NaN. What is driven through what, with which bounds, and the number of
//! points by subject: `docs/extremes.md`, whose table the tests hold to.

mod common;

mod extremes {
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
}
