//! Tests of mixtures and improper distributions.

use super::*;

fn mixed(weights: &[f64], parts: Vec<Dist>) -> Mixture {
    Mixture::new(weights, parts).unwrap()
}

fn pair(mean: [f64; 2], cov: f64) -> Dist {
    Dist::from(MvNormal::from_cov(&mean, &square(2, &[1.0, cov, cov, 1.0])).unwrap())
}

#[test]
fn densities_are_weighted_means() {
    let parts = vec![
        make("normal", &[0.0, 1.0]),
        make("normal", &[3.0, 0.5]),
        make("uniform", &[-1.0, 1.0]),
    ];
    let d = mixed(&[1.0, 2.0, 5.0], parts.clone());
    for x in [-0.5, 0.0, 2.9, -1.5] {
        let p: f64 = parts
            .iter()
            .zip([1.0, 2.0, 5.0])
            .map(|(d, w)| w / 8.0 * d.log_density_num(x).exp())
            .sum();
        assert!((d.log_density(&Datum::Num(x)) - p.ln()).abs() < 1e-12);
        let shares = d.responsibilities(&Datum::Num(x)).unwrap();
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-14);
    }
    // In the tail, where every density underflows.
    let far = d.log_density(&Datum::Num(-100.0));
    assert!((far - (1f64 / 8.0).ln() - parts[0].log_density_num(-100.0)).abs() < 1e-9, "{far}");
    assert_eq!(d.log_density(&vec![0.0].into()), f64::NEG_INFINITY);
    // A component with zero weight is ignored, including its poles.
    let none = mixed(&[0.0, 1.0], vec![make("beta", &[0.1, 0.1]), make("uniform", &[0.0, 2.0])]);
    assert_eq!(none.log_density(&Datum::Num(0.0)), -(2f64.ln()));
}

#[test]
fn gradients_go_by_responsibilities() {
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-7 * (1.0 + b.abs()), "{a} against {b}");
    let make_it = |p: [f64; 6]| {
        mixed(
            &p[..2],
            vec![make("normal", &p[2..4]), make("truncated_normal", &[p[4], p[5], -0.5, INF])],
        )
    };
    let p = [1.0, 2.5, 0.3, 1.2, 1.0, 0.7];
    for x in [0.2, 1.5, -1.0] {
        let g = make_it(p).gradient(&Datum::Num(x)).unwrap();
        assert_eq!(g.params.len(), 8);
        let h = 1e-6;
        let at = |x: f64| make_it(p).log_density(&Datum::Num(x));
        close(g.x[0], (at(x + h) - at(x - h)) / (2.0 * h));
        for i in 0..6 {
            let moved = |h: f64| {
                let mut p = p;
                p[i] += h;
                make_it(p).log_density(&Datum::Num(x))
            };
            close(g.params[i], (moved(h) - moved(-h)) / (2.0 * h));
        }
    }
    let d = mixed(&[1.0, 1.0], vec![pair([0.0, 0.0], 0.5), pair([1.0, 2.0], -0.3)]);
    let x = [0.4, 0.9];
    let g = d.gradient(&x.to_vec().into()).unwrap();
    for i in 0..2 {
        let moved = |h: f64| {
            let mut x = x;
            x[i] += h;
            d.log_density(&x.to_vec().into())
        };
        close(g.x[i], (moved(1e-6) - moved(-1e-6)) / 2e-6);
    }
}

#[test]
fn draws_are_of_the_components() {
    let d = mixed(&[1.0, 3.0], vec![make("normal", &[-2.0, 0.5]), make("normal", &[1.0, 1.0])]);
    let mut rng = stream(810);
    let n = 20_000;
    // Twenty cells of equal probability, from a fine sum.
    let (from, h) = (-6.0, 1e-3);
    let mut sums = vec![0.0];
    (0..13_000).for_each(|k| {
        let p = d.log_density(&Datum::Num(from + h * (f64::from(k) + 0.5))).exp() * h;
        sums.push(sums[k as usize] + p);
    });
    let mut cells = [0.0; 20];
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..n {
        let x = d.sample(&mut rng).num().unwrap();
        let k = (((x - from) / h).max(0.0) as usize).min(sums.len() - 1);
        cells[((sums[k] * 20.0) as usize).min(19)] += 1.0;
        sum += x;
        squares += x * x;
    }
    let expected = f64::from(n) / 20.0;
    let statistic: f64 = cells.iter().map(|c| (c - expected) * (c - expected) / expected).sum();
    assert!(statistic < 50.0, "{statistic}");
    let (mean, n) = (sum / f64::from(n), f64::from(n));
    assert!((mean - d.mean().unwrap()).abs() < 4.0 * d.sd().unwrap() / n.sqrt());
    assert!(((squares / n - mean * mean).sqrt() / d.sd().unwrap() - 1.0).abs() < 0.03);
}

#[test]
fn components_must_have_the_same_kind_of_values() {
    let message = |w: &[f64], parts| Mixture::new(w, parts).unwrap_err().to_string();
    let (number, flip) = (make("normal", &[0.0, 1.0]), make("flip", &[0.5]));
    assert_eq!(
        message(&[1.0, 1.0], vec![number.clone(), flip.clone()]),
        "mixture: components must have the same kind of values, got normal, flip"
    );
    assert!(
        message(&[1.0, 1.0], vec![number.clone(), pair([0.0; 2], 0.0)]).contains("the same kind")
    );
    assert!(
        message(&[1.0, 1.0], vec![number.clone(), make("poisson", &[1.0])])
            .contains("the same kind")
    );
    assert!(
        message(&[1.0], vec![number.clone(), number.clone()]).contains("one number per component")
    );
    assert!(message(&[], vec![]).contains("weights"));
    assert!(
        message(&[-1.0, 2.0], vec![number.clone(), number.clone()]).starts_with("mixture: weights")
    );
    assert!(message(&[1.0], vec![make("flat", &[])]).contains("proper"));
    let supports = |a: &str, p: &[f64], b: &str, q: &[f64]| {
        mixed(&[1.0, 1.0], vec![make(a, p), make(b, q)]).support()
    };
    assert_eq!(supports("gamma", &[1.0, 1.0], "weibull", &[1.0, 1.0]), Support::Positive);
    assert_eq!(
        supports("gamma", &[1.0, 1.0], "uniform", &[-3.0, 1.0]),
        Support::AtLeast { lo: -3.0 }
    );
    assert_eq!(
        supports("beta", &[1.0, 1.0], "uniform", &[-3.0, 0.5]),
        Support::Interval { lo: -3.0, hi: 1.0 }
    );
    assert_eq!(
        supports("poisson", &[1.0], "binomial", &[4.0, 0.5]),
        Support::Integers { lo: 0, hi: None }
    );
    let vectors = Dist::from(Iid::new(number.clone(), 2).unwrap());
    assert_eq!(
        mixed(&[1.0, 1.0], vec![vectors, pair([0.0; 2], 0.3)]).support(),
        Support::Vector(2)
    );
    assert_eq!(mixed(&[1.0, 2.0], vec![flip.clone(), flip]).support(), Support::Boolean);
}

#[test]
fn improper_distributions_say_so() {
    assert!(make("flat", &[]).is_improper() && !make("normal", &[0.0, 1.0]).is_improper());
    assert!(Iid::new(make("flat", &[]), 2).unwrap().is_improper());
    assert!(
        Product::new(vec![make("normal", &[0.0, 1.0]), make("flat", &[])]).unwrap().is_improper()
    );
    assert!(Ordered::new(make("flat", &[]), 2).unwrap().is_improper());
    let message = |d: Dist| Ordered::new(d, 2).unwrap_err().to_string();
    assert_eq!(
        message(make("poisson", &[1.0])),
        "ordered: d must be a distribution of continuous numbers, got poisson"
    );
    assert!(message(pair([0.0; 2], 0.0)).contains("continuous numbers"));
}
