//! Tests of Gaussian vectors and processes: comparison with dense linear algebra,
//! whitening, extreme covariances.

use super::*;
use nalgebra::{DMatrix, DVector};

fn dense(mean: &[f64], cov: &DMatrix<f64>, x: &[f64]) -> f64 {
    let r = DVector::from_iterator(x.len(), x.iter().zip(mean).map(|(x, m)| x - m));
    let lu = cov.clone().lu();
    let n = x.len() as f64;
    -0.5 * (r.dot(&lu.solve(&r).unwrap())
        + lu.determinant().ln()
        + n * (2.0 * std::f64::consts::PI).ln())
}

fn grid(n: usize, step: f64) -> Vec<f64> {
    (0..n).map(|i| i as f64 * step).collect()
}

#[test]
fn vectors_agree_with_dense_algebra() {
    let cov = square(3, &[2.0, 0.6, 0.1, 0.6, 1.0, -0.3, 0.1, -0.3, 0.7]);
    let (mean, x) = ([1.0, -1.0, 0.5], [0.3, 1.7, -0.4]);
    let expected = dense(&mean, &cov, &x);
    let from_cov = MvNormal::from_cov(&mean, &cov).unwrap();
    let chol = cov.clone().cholesky().unwrap().l();
    let from_chol = MvNormal::from_chol(&mean, &chol).unwrap();
    for d in [&from_cov, &from_chol] {
        assert!((d.log_density(&x.to_vec().into()) - expected).abs() < 1e-12);
    }
    let bad = |m| MvNormal::from_cov(&mean, &m).unwrap_err().to_string();
    assert!(
        bad(square(3, &[1.0, 2.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0]))
            .contains("positive definite")
    );
    assert!(bad(square(3, &[1.0, 0.5, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0, 1.0])).contains("symmetric"));
    assert!(bad(DMatrix::identity(2, 2)).contains("2 x 2"));
    assert!(bad(DMatrix::from_element(3, 3, f64::NAN)).contains("must be finite"));
    assert!(MvNormal::from_chol(&mean, &cov).unwrap_err().to_string().contains("lower triangular"));
}

#[test]
fn draws_have_the_covariance() {
    let cov = square(2, &[2.0, 0.6, 0.6, 1.0]);
    let d = MvNormal::from_cov(&[1.0, -3.0], &cov).unwrap();
    let mut rng = stream(700);
    let n = 40_000;
    let mut sum = DMatrix::zeros(2, 2);
    for _ in 0..n {
        let Datum::Vec(x) = d.sample(&mut rng) else { panic!() };
        let r = DVector::from_vec(vec![x[0] - 1.0, x[1] + 3.0]);
        sum += &r * r.transpose();
    }
    assert!((sum / f64::from(n) - cov).abs().max() < 0.06);
}

#[test]
fn processes_agree_with_dense_algebra() {
    let at = [0.0, 0.4, 0.5, 2.0, 1.1];
    let mean = vec![0.5; 5];
    let kernels = [
        Covariance::sq_exp(0.7, 1.3).unwrap(),
        Covariance::matern32(0.7, 1.3).unwrap(),
        Covariance::matern52(2.0, 0.3).unwrap(),
        Covariance::periodic(1.5, 0.8, 2.0).unwrap(),
        Covariance::sq_exp(1.0, 1.0).unwrap() * Covariance::periodic(1.0, 1.0, 2.0).unwrap()
            + Covariance::white(0.5).unwrap(),
    ];
    for k in kernels {
        let mut cov = k.matrix(&at);
        assert_eq!(cov, cov.transpose());
        for i in 0..5 {
            assert_eq!(cov[(i, i)], k.variance());
            cov[(i, i)] += 1e-6 * k.variance();
        }
        let d = Gp::new(mean.clone(), &k, &at, true).unwrap();
        let Datum::Vec(x) = d.sample(&mut stream(701)) else { panic!() };
        let (got, expected) = (d.log_density(&Datum::Vec(Arc::clone(&x))), dense(&mean, &cov, &x));
        assert!(
            (got - expected).abs() < 1e-7 * (1.0 + expected.abs()),
            "{k}: {got} against {expected}"
        );
    }
}

#[test]
fn covariance_functions_have_their_formulas() {
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-14, "{a} against {b}");
    let d: f64 = 0.8;
    close(Covariance::sq_exp(0.5, 2.0).unwrap().at_distance(d), 4.0 * (-d * d / 0.5).exp());
    let r = 3f64.sqrt() * d / 0.5;
    close(Covariance::matern32(0.5, 2.0).unwrap().at_distance(d), 4.0 * (1.0 + r) * (-r).exp());
    let r = 5f64.sqrt() * d / 0.5;
    close(
        Covariance::matern52(0.5, 2.0).unwrap().at_distance(d),
        4.0 * (1.0 + r + r * r / 3.0) * (-r).exp(),
    );
    let periodic = Covariance::periodic(0.3, 0.5, 2.0).unwrap();
    let s = (std::f64::consts::PI * d / 0.3).sin() / 0.5;
    close(periodic.at_distance(d), 4.0 * (-2.0 * s * s).exp());
    let periodic = Covariance::periodic(0.5, 0.5, 2.0).unwrap();
    assert_eq!(periodic.at_distance(0.125), periodic.at_distance(0.125 + 3e4));
    assert_eq!(Covariance::white(2.0).unwrap().at_distance(0.0), 0.0);
    let text = (Covariance::sq_exp(0.5, 2.0).unwrap() + Covariance::white(0.1).unwrap())
        * Covariance::matern32(1.0, 1.0).unwrap();
    assert_eq!(
        text.to_string(),
        "(sq_exp(length = 0.5, sd = 2) + white(sd = 0.1)) * matern32(length = 1, sd = 1)"
    );
    assert_eq!(
        Covariance::sq_exp(0.0, 1.0).unwrap_err().to_string(),
        "sq_exp: length must be positive and finite, got 0"
    );
}

#[test]
fn values_and_noise_map_onto_each_other() {
    let k = Covariance::sq_exp(0.3, 2.0).unwrap();
    let at = grid(30, 0.1);
    let gp = Gp::new(at.clone(), &k, &at, false).unwrap();
    assert!(gp.is_stored_whitened() && gp.is_gaussian());
    let mut rng = stream(702);
    let z = gp.sample_stored(&mut rng);
    let x = gp.from_noncentred(&z);
    let Some(Datum::Vec(back)) = gp.to_noncentred(&x) else { panic!() };
    let Datum::Vec(z) = z else { panic!() };
    assert!(z.iter().zip(back.iter()).all(|(a, b)| (a - b).abs() < 1e-6));
    let normal = Normal::new(0.0, 1.0).unwrap();
    let expected: f64 = z.iter().map(|z| normal.log_density_num(*z)).sum();
    assert!((gp.log_density_stored(&Datum::Vec(Arc::clone(&z))) - expected).abs() < 1e-11);
    // The log densities of the two forms differ by the log determinant of the map.
    let slope = gp.log_density(&x) - expected;
    let packed = gp.to_centred();
    assert!((packed.log_density_stored(&x) - expected - slope).abs() < 1e-6);
    let g = gp.gradient_stored(&Datum::Vec(Arc::clone(&z))).unwrap();
    assert!(g.x.iter().zip(z.iter()).all(|(g, z)| *g == -z));
    // The noise fits this number of points only.
    assert_eq!(gp.log_density_stored(&vec![0.0; 3].into()), f64::NEG_INFINITY);
    assert!(gp.to_noncentred(&vec![0.0; 3].into()).is_none());
    // Only Gaussian families whiten.
    let n = make("normal", &[3.0, 2.0]);
    assert_eq!(n.colour(&[0.5]), Some(Datum::Num(4.0)));
    assert_eq!(n.whiten(&Datum::Num(4.0)), Some(vec![0.5]));
    let iid = Dist::from(Iid::new(n, 2).unwrap());
    assert_eq!(iid.colour(&[0.5, 0.0]), Some(vec![4.0, 3.0].into()));
    assert_eq!(iid.colour(&[0.5]), None);
    let half = make("half_normal", &[1.0]);
    assert!(!half.is_gaussian() && half.whiten(&Datum::Num(1.0)).is_none());
}

#[test]
fn extreme_covariances_factor() {
    for n in [2, 500] {
        for length in [1e-6, 1.0, 1e6] {
            for k in [Covariance::sq_exp(length, 3.0), Covariance::matern52(length, 3.0)] {
                let gp = Gp::new(vec![0.0; n], &k.unwrap(), &grid(n, 1.0), true).unwrap();
                let x = gp.sample(&mut stream(703));
                assert!(gp.log_density(&x).is_finite());
            }
        }
    }
    let k = Covariance::sq_exp(1.0, 1.0).unwrap();
    let coincident = Gp::new(vec![0.0; 20], &k, &[0.5; 20], true).unwrap();
    assert!(coincident.log_density(&vec![0.3; 20].into()).is_finite());
    assert!(Gp::new(vec![], &k, &[], false).is_ok());
    let huge = Covariance::sq_exp(1.0, 1e200).unwrap();
    let e = Gp::new(vec![0.0; 3], &huge, &grid(3, 1.0), false).unwrap_err().to_string();
    assert!(
        e.starts_with(
            "gp: cov must make a positive definite matrix, got sq_exp(length = 1, sd = 1"
        ),
        "{e}"
    );
    assert!(e.ends_with("at 3 points"), "{e}");
    assert!(Gp::new(vec![0.0; 2], &k, &[0.0, f64::NAN], false).is_err());
    assert!(Gp::new(vec![0.0; 2], &k, &[0.0], false).is_err());
}

#[test]
fn jitter_is_a_share_of_the_variance() {
    let k = Covariance::sq_exp(1.0, 3.0).unwrap();
    let with = |jitter: f64| Gp::with_jitter(vec![0.5], &k, &[0.0], true, jitter);
    for jitter in [0.0f64, 1e-6, 0.2] {
        let sd = 3.0 * (1.0 + jitter).sqrt();
        let wanted = make("normal", &[0.5, sd]).log_density_num(1.3);
        let found = with(jitter).unwrap().log_density(&vec![1.3].into());
        assert!((found - wanted).abs() < 1e-14, "{jitter}: {found} {wanted}");
    }
    assert_eq!(with(JITTER).unwrap(), Gp::new(vec![0.5], &k, &[0.0], true).unwrap());
    assert!([-1e-9, f64::NAN, INF].into_iter().all(|jitter| with(jitter).is_err()));
    // Coincident points, without jitter.
    assert!(Gp::with_jitter(vec![0.0; 2], &k, &[0.0, 0.0], true, 0.0).is_err());
}
