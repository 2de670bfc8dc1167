//! Tests that batches equal one number at a time.

use super::*;
use crate::num::{Column, ExactSum};

#[test]
fn many_at_once_are_as_one_at_a_time() {
    for (family, width, seen) in [
        ("normal", 2, [0.3, 1.2, 2.0]),
        ("student_t", 3, [0.3, 1.2, 2.0]),
        ("gamma", 2, [0.3, 1.2, 2.0]),
        ("poisson", 1, [0.0, 2.0, 3.0]),
        ("flip", 1, [0.0, 1.0, 1.0]),
        ("flip_logit", 1, [0.0, 1.0, 1.0]),
        ("poisson_log", 1, [0.0, 2.0, 3.0]),
    ] {
        // Bit k of `shape` says whether parameter k has a value for each element.
        for shape in 0..1 << width {
            // The buffer holds one column per parameter, then the observed values.
            let at = |shift: f64, k: usize, i: usize| {
                0.4 + 0.1 * k as f64
                    + shift
                    + if shape >> k & 1 == 1 { 0.07 * i as f64 } else { 0.0 }
            };
            let n = 3;
            let fill = |shift: f64| {
                let mut v: Vec<f64> =
                    (0..width).flat_map(|k| (0..n).map(move |i| at(shift, k, i))).collect();
                v.extend(seen);
                v
            };
            let columns: Vec<Column> = (0..width)
                .map(|k| Column { at: k * n, step: shape >> k & 1, live: true })
                .collect();
            let x = Column { at: width * n, step: 1, live: true };
            let one = |v: &[f64], i: usize| {
                let p: Vec<f64> = columns.iter().map(|c| c.get(v, i)).collect();
                make(family, &p)
            };
            let first = fill(0.0);
            let dist = match shape {
                0 => one(&first, 0),
                _ => Dist::from(Product::new((0..n).map(|i| one(&first, i)).collect()).unwrap()),
            };
            let mut b = batch(&dist, &columns).unwrap();
            for shift in [0.0, 0.05, 0.05, 0.1] {
                let mut v = fill(shift);
                let (mut sum, mut expected) = (ExactSum::default(), ExactSum::default());
                assert!(b.score(&mut v, x, &columns, n, To::Sum(&mut sum)));
                let mut by = vec![0.0; v.len()];
                b.vjp(&v, &mut by, x, &columns, n, Weights::All(2.0));
                let mut slopes = vec![0.0; v.len()];
                for (i, s) in seen.iter().enumerate() {
                    let datum = if family.starts_with("flip") {
                        Datum::Bool(*s != 0.0)
                    } else {
                        Datum::Num(*s)
                    };
                    let d = one(&v, i);
                    expected.add(d.log_density(&datum));
                    let g = d.gradient(&datum).unwrap();
                    slopes[x.at + i] += 2.0 * g.x.first().copied().unwrap_or(0.0);
                    columns
                        .iter()
                        .zip(&g.params)
                        .for_each(|(c, p)| slopes[c.at + i * c.step] += 2.0 * p);
                }
                assert_eq!(sum, expected, "{family} {shape}");
                let off = by.iter().zip(&slopes).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(off < 1e-12, "{family} {shape}: {by:?}, one at a time {slopes:?}");
            }
            // Parameters outside the domain.
            let mut v = fill(if family.ends_with("_logit") || family.ends_with("_log") {
                INF
            } else {
                -9.0
            });
            let to = To::Sum(&mut ExactSum::default());
            assert!(!b.score(&mut v, x, &columns, n, to), "{family}");
        }
    }
}

#[test]
fn families_do_not_mix() {
    let parts = vec![make("normal", &[0.0, 1.0]), make("gamma", &[1.0, 1.0])];
    assert!(batch(&Dist::from(Product::new(parts).unwrap()), &[]).is_none());
}
