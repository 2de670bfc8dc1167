//! Tests of distributions of Cholesky factors, against those of the corresponding
//! matrices.

use super::*;
use nalgebra::DMatrix;

fn matrix(n: usize, x: &Datum) -> DMatrix<f64> {
    square(n, &numbers(x))
}

fn wishart(df: f64, scale: &[f64]) -> Wishart {
    let n = (scale.len() as f64).sqrt() as usize;
    Wishart::new(df, &square(n, scale)).unwrap()
}

/// Returns sqrt(n) times the Kolmogorov-Smirnov distance.
fn distance(mut xs: Vec<f64>, cdf: impl Fn(f64) -> f64) -> f64 {
    xs.sort_by(f64::total_cmp);
    let n = xs.len() as f64;
    xs.iter().enumerate().map(|(i, x)| ((i as f64 + 0.5) / n - cdf(*x)).abs()).fold(0.0, f64::max)
        * n.sqrt()
}

#[test]
fn correlations_have_beta_marginals() {
    use statrs::distribution::{Beta, ContinuousCDF};
    for (n, eta) in [(2usize, 0.5), (3, 1.0), (4, 3.0)] {
        let d = make("lkj", &[n as f64, eta]);
        let mut rng = stream(800);
        let draws: Vec<DMatrix<f64>> = (0..8000)
            .map(|_| {
                let x = d.sample(&mut rng);
                assert!(d.support().contains(&x) && d.log_density(&x).is_finite(), "{x:?}");
                let l = matrix(n, &x);
                &l * l.transpose()
            })
            .collect();
        // Every correlation is distributed as 2 beta(a, a) - 1 with a = eta + n / 2 - 1
        // (Lewandowski et al. 2009).
        let a = eta + 0.5 * n as f64 - 1.0;
        let marginal = Beta::new(a, a).unwrap();
        for i in 0..n {
            for j in 0..i {
                let share = draws.iter().map(|r| 0.5 * (r[(i, j)] + 1.0)).collect();
                let k = distance(share, |x| marginal.cdf(x));
                assert!(k < 2.2, "lkj({n}, {eta}) at ({i}, {j}): {k}");
            }
        }
    }
}

#[test]
fn correlation_factors_integrate_to_one() {
    let line = |d: &Dist, reach: f64| {
        let (s, h) = (d.support(), 0.01);
        let n = (reach / h) as i32;
        (-n..=n)
            .map(|i| {
                let (x, jacobian) = s.from_free(&[h * f64::from(i)]);
                (d.log_density(&x) + jacobian).exp() * h
            })
            .sum::<f64>()
    };
    for eta in [0.3, 1.0, 20.0] {
        let total = line(&make("lkj", &[2.0, eta]), 60.0);
        assert!((total - 1.0).abs() < 1e-9, "{eta}: {total}");
    }
    // Three rows: integrates over a cube.
    let d = make("lkj", &[3.0, 1.7]);
    let (s, h) = (d.support(), 0.2);
    let mut total = 0.0;
    for i in -40..=40 {
        for j in -40..=40 {
            for k in -40..=40 {
                let (x, jacobian) =
                    s.from_free(&[h * f64::from(i), h * f64::from(j), h * f64::from(k)]);
                total += (d.log_density(&x) + jacobian).exp() * h * h * h;
            }
        }
    }
    assert!((total - 1.0).abs() < 1e-6, "{total}");
}

#[test]
fn covariance_factors_integrate_to_one() {
    let d = wishart(3.5, &[1.5, 0.0, 0.4, 0.8]);
    let (s, h) = (d.support(), 0.2);
    let mut total = 0.0;
    for i in -60..=20 {
        for j in -75..=75 {
            for k in -60..=20 {
                let (x, jacobian) =
                    s.from_free(&[h * f64::from(i), h * f64::from(j), h * f64::from(k)]);
                total += (d.log_density(&x) + jacobian).exp() * h * h * h;
            }
        }
    }
    assert!((total - 1.0).abs() < 1e-6, "{total}");
}

#[test]
fn wishart_draws_have_their_moments() {
    let scale = [1.5, 0.0, 0.0, 0.4, 0.8, 0.0, -1.0, 0.5, 2.0];
    let (df, d) = (6.5, wishart(6.5, &scale));
    let s = square(3, &scale);
    let v = &s * s.transpose();
    let mut rng = stream(801);
    let n = 40_000;
    let (mut sum, mut squares) = (DMatrix::zeros(3, 3), DMatrix::zeros(3, 3));
    let mut least: Vec<f64> = Vec::new();
    for _ in 0..n {
        let x = d.sample(&mut rng);
        assert!(d.support().contains(&x) && d.log_density(&x).is_finite());
        let l = matrix(3, &x);
        let w = &l * l.transpose();
        least.push(w[(0, 0)] / v[(0, 0)]);
        squares += w.component_mul(&w);
        sum += w;
    }
    let (mean, squares) = (sum / f64::from(n), squares / f64::from(n));
    for i in 0..3 {
        for j in 0..3 {
            let expected = df * v[(i, j)];
            let variance = df * (v[(i, j)] * v[(i, j)] + v[(i, i)] * v[(j, j)]);
            assert!(
                (mean[(i, j)] - expected).abs() < 5.0 * (variance / f64::from(n)).sqrt(),
                "mean at ({i}, {j})"
            );
            let got = squares[(i, j)] - mean[(i, j)] * mean[(i, j)];
            assert!(
                (got / variance - 1.0).abs() < 0.06,
                "variance at ({i}, {j}): {got} against {variance}"
            );
        }
    }
    // A diagonal entry is chi-squared.
    use statrs::distribution::{ChiSquared, ContinuousCDF};
    let chi = ChiSquared::new(df).unwrap();
    let k = distance(least, |x| chi.cdf(x));
    assert!(k < 2.2, "{k}");
}

/// Checks the gradients of log p(x(y)) + log |dx/dy| through the transform, and the
/// derivative with respect to parameter `which`.
fn check_gradient(
    d: &dyn Distribution,
    moved: &dyn Fn(f64) -> f64,
    at: f64,
    y: &[f64],
    which: usize,
) {
    let s = d.support();
    let (x, _) = s.from_free(y);
    let g = d.gradient(&x).unwrap();
    assert_eq!(g.x.len(), s.gradient_dim());
    let mut got = Vec::new();
    s.free_gradient(y, &g.x, &mut got);
    let h = 1e-5;
    for j in 0..y.len() {
        let total = |h: f64| {
            let mut y = y.to_vec();
            y[j] += h;
            let (x, jacobian) = s.from_free(&y);
            d.log_density(&x) + jacobian
        };
        let expected = (total(h) - total(-h)) / (2.0 * h);
        assert!(
            (got[j] - expected).abs() < 1e-6 * (1.0 + expected.abs()),
            "{j}: {} against {expected}",
            got[j]
        );
    }
    let expected = (moved(at + h) - moved(at - h)) / (2.0 * h);
    assert!(
        (g.params[which] - expected).abs() < 1e-6 * (1.0 + expected.abs()),
        "{:?} against {expected}",
        g.params
    );
}

#[test]
fn gradients_are_those_of_differences() {
    let y = [0.3, -0.8, 0.1, 1.2, 0.4, -0.2];
    let d = Lkj::new(4.0, 2.5).unwrap();
    let x = d.support().from_free(&y).0;
    check_gradient(&d, &|eta| Lkj::new(4.0, eta).unwrap().log_density(&x), 2.5, &y, 1);
    let scale = [1.5, 0.0, 0.0, 0.4, 0.8, 0.0, -1.0, 0.5, 2.0];
    let d = wishart(6.5, &scale);
    let x = d.support().from_free(&y).0;
    check_gradient(&d, &|df| wishart(df, &scale).log_density(&x), 6.5, &y, 0);
}

#[test]
fn what_is_no_factor_is_impossible() {
    let d = make("lkj", &[2.0, 1.0]);
    let rows = |xs: [f64; 4]| {
        Datum::List(vec![vec![xs[0], xs[1]].into(), vec![xs[2], xs[3]].into()].into())
    };
    assert_eq!(d.log_density(&rows([1.0, 0.0, 0.6, 0.8])), (0.5f64).ln());
    for bad in
        [[1.0, 0.1, 0.6, 0.8], [1.0, 0.0, 0.6, 0.9], [1.0, 0.0, 0.6, -0.8], [-1.0, 0.0, 0.6, 0.8]]
    {
        assert_eq!(d.log_density(&rows(bad)), f64::NEG_INFINITY, "{bad:?}");
    }
    let w = wishart(2.0, &[1.0, 0.0, 0.0, 1.0]);
    for bad in [[1.0, 0.1, 0.6, 0.8], [1.0, 0.0, 0.6, 0.0], [-1.0, 0.0, 0.6, 1.0]] {
        assert_eq!(w.log_density(&rows(bad)), f64::NEG_INFINITY, "{bad:?}");
    }
    let message = |df: f64, s: &[f64]| Wishart::new(df, &square(2, s)).unwrap_err().to_string();
    assert_eq!(
        message(1.0, &[1.0, 0.0, 0.0, 1.0]),
        "wishart: df must be above the number of rows minus 1, got 1"
    );
    assert!(message(3.0, &[1.0, 0.5, 0.0, 1.0]).contains("lower triangular"));
    assert!(message(3.0, &[1.0, 0.0, 0.0, 0.0]).contains("positive diagonal"));
    assert!(Wishart::new(3.0, &DMatrix::zeros(0, 0)).is_err());
}

#[test]
fn whitened_vectors_follow_their_parameters() {
    let cov = square(2, &[2.0, 0.6, 0.6, 1.0]);
    let d = |m: f64| Dist::from(MvNormal::from_cov(&[m, 0.0], &cov).unwrap().to_whitened());
    let z = d(1.0).sample_stored(&mut stream(802));
    let (near, far) = (numbers(&d(1.0).from_noncentred(&z)), numbers(&d(5.0).from_noncentred(&z)));
    assert!((far[0] - near[0] - 4.0).abs() < 1e-12 && (far[1] - near[1]).abs() < 1e-12);
    assert_eq!(d(1.0).log_density_stored(&z), d(5.0).log_density_stored(&z));
    let back = d(1.0).to_noncentred(&d(1.0).from_noncentred(&z)).unwrap();
    assert!(numbers(&back).iter().zip(numbers(&z)).all(|(a, b)| (a - b).abs() < 1e-12));
    // The log densities of the two forms differ by the map's log Jacobian, the log
    // determinant of the factor.
    let x = d(1.0).from_noncentred(&z);
    let jacobian = 0.5 * cov.determinant().ln();
    assert!((d(1.0).log_density_stored(&z) - d(1.0).log_density(&x) - jacobian).abs() < 1e-12);
    // Elements of a product store values.
    let two = Dist::from(Iid::new(d(1.0), 2).unwrap());
    assert!(!two.element(0).is_stored_whitened());
}
