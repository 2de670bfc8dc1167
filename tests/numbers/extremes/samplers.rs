//! Draws at extreme parameters compared with the distribution functions of the table
//! (Kolmogorov-Smirnov distance at its points).

use super::points::Points;
use super::table::{Row, rows};
use crate::common::families::made;
use pcadlang_numerics::rng::{Purpose, StreamKey};

const DRAWS: usize = 20_000;

#[test]
fn draws_follow_their_distribution_functions() {
    let mut points = Points::of("samplers");
    let rows = rows("cdf");
    let same = |a: &Row, b: &Row| a.name == b.name && a.parameters == b.parameters;
    for (site, group) in rows.chunk_by(same).enumerate() {
        let d = made(group[0].name, &group[0].parameters);
        let mut rng = StreamKey::new(31, 0, Purpose::VALUES).stream(0, site as u64, 0);
        let mut draws: Vec<f64> = (0..DRAWS).map(|_| d.sample(&mut rng).num().unwrap()).collect();
        draws.sort_by(f64::total_cmp);
        for r in group {
            let below = draws.partition_point(|x| *x <= r.point[0]) as f64 / DRAWS as f64;
            let distance = (below - r.values[0]).abs() * (DRAWS as f64).sqrt();
            // The greatest distance over all points exceeds 2.2 with probability 1e-4.
            points.check(distance < 2.2, || format!("{}: {below} of the draws are below", r.line));
        }
    }
    points.finish();
}

#[test]
fn draws_stay_inside_and_can_be_scored() {
    let mut points = Points::of("draws in their support");
    let rows = rows("density");
    for (site, group) in
        rows.chunk_by(|a, b| a.name == b.name && a.parameters == b.parameters).enumerate()
    {
        let d = made(group[0].name, &group[0].parameters);
        let mut rng = StreamKey::new(32, 0, Purpose::VALUES).stream(0, site as u64, 0);
        let bad = (0..200).map(|_| d.sample(&mut rng)).find(|x| {
            let p = d.log_density(x);
            !d.support().contains(x) || p.is_nan() || p == f64::NEG_INFINITY
        });
        points.check(bad.is_none(), || {
            format!("{d:?} drew {bad:?}: {}", d.log_density(bad.as_ref().unwrap()))
        });
    }
    points.finish();
}
