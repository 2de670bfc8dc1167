//! Tests across families: samplers, gradients, transforms, normalisation, edges. Values
//! of log densities are checked in `tests/numbers/dist_reference.rs`.

mod batches;
mod edges;
mod gaussian;
mod gradients;
mod matrices;
mod mixtures;
mod normalisation;
mod poles;
mod samplers;
mod transforms;
mod truncated;

use super::*;
use crate::rng::{Purpose, Stream, StreamKey};
use std::sync::Arc;

/// Returns a separate random stream for each test.
fn stream(site: u64) -> Stream {
    StreamKey::new(20, 0, Purpose::VALUES).stream(0, site, 0)
}

const INF: f64 = f64::INFINITY;

/// Returns a square matrix from its entries by rows.
fn square(n: usize, entries: &[f64]) -> nalgebra::DMatrix<f64> {
    nalgebra::DMatrix::from_row_slice(n, n, entries)
}

/// Creates a distribution by name.
fn make(family: &str, p: &[f64]) -> Dist {
    try_make(family, p).unwrap()
}

fn try_make(family: &str, p: &[f64]) -> Result<Dist, ParamError> {
    Ok(match family {
        "flat" if p.is_empty() => Flat::default().into(),
        "multinomial" => Multinomial::new(p[0], &p[1..])?.into(),
        "lkj" => Lkj::new(p[0], p[1])?.into(),
        "categorical" => Categorical::new(p)?.into(),
        "categorical_logits" => CategoricalLogits::new(p)?.into(),
        "dirichlet" => Dirichlet::new(p)?.into(),
        _ => {
            let family = FAMILIES.iter().find(|f| f.name == family).unwrap();
            (family.numbers.unwrap().make)(p)?
        }
    })
}

/// Returns all numbers in a value, in order.
fn numbers(x: &Datum) -> Vec<f64> {
    match x {
        Datum::Num(x) => vec![*x],
        Datum::Vec(xs) => xs.to_vec(),
        Datum::List(xs) => xs.iter().flat_map(numbers).collect(),
        Datum::Bool(_) => Vec::new(),
    }
}
