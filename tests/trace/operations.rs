//! Traces by address: updates and their reversal, choices that appear and vanish compared
//! with enumeration, projections, errors.

use crate::common::{mean, normal_pdf, variance};
use pcadlang::Model;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Address, Draws, Given, Selector, Trace};
use pcadlang_numerics::rng::{Purpose, StreamKey};

fn trace(text: &str) -> Trace {
    let model = Model::from_text(text).unwrap_or_else(|e| panic!("{e}"));
    model.simulate(4, 0).unwrap_or_else(|e| panic!("{e}"))
}

fn draws(step: u64) -> Draws {
    Draws { key: StreamKey::new(7, 0, Purpose::VALUES), step, substream: 0 }
}

fn given(values: &[(&str, Value)]) -> Vec<(Address, Given)> {
    values.iter().map(|(a, v)| (a.parse().unwrap(), Given::Value(v.clone()))).collect()
}

/// Returns everything visible of a trace, to the last bit.
fn bits(t: &Trace) -> Vec<String> {
    let choices = t.choices().into_iter().map(|(a, v, s)| format!("{a} {v:?} {:x}", s.to_bits()));
    let observed = t.observed().into_iter().map(|o| format!("{} {:?}", o.address, o.value));
    let stored = t.constraints().into_iter().map(|c| format!("{c:?}"));
    choices
        .chain(observed)
        .chain(stored)
        .chain([format!("{:x}", t.log_joint().to_bits())])
        .collect()
}

const MANY: &str = "assume c ~ flip(0.4); assume n ~ categorical([0.2, 0.3, 0.5]);
    assume m ~ normal(0, 1); assume length ~ gamma(3, 3);
    assume f ~ gp(mean = m, cov = sq_exp(length, 1), at = [0, 0.5, 1]);
    assume z ~ iid(gamma(2, 1), n + 1);
    assume x = if c { a ~ normal(m, 1); a } else { b ~ beta(2, 2); d ~ normal(b, 1); d };
    w[n] ~ normal(0, 1);
    if c { observe normal(x, 2) = 0.3 as extra; }
    for i in 0 .. 3 { observe normal(f[i], 0.5) = i as point; }
    observe normal(x + sum(z) + w[n], 1) = [1, 2] as y;";

/// An update with the values that another update discarded restores the trace, bit for
/// bit, whatever appeared and vanished.
#[test]
fn what_was_discarded_leads_back() {
    let updates = [
        given(&[("@c", true.into())]),
        given(&[("@c", false.into())]),
        given(&[("@n", 0.0.into())]),
        given(&[("@n", 2.0.into()), ("@z[1]", 0.7.into()), ("@w[2]", 1.0.into())]),
        given(&[("@c", true.into()), ("@x/a", 0.5.into()), ("@extra", 9.0.into())]),
        given(&[("@f", Value::array(vec![0.1, 0.2, 0.3])), ("@length", 0.3.into())]),
        given(&[
            ("@point[1]", (-4.0).into()),
            ("@y", Value::array(vec![0.0, 5.0])),
            ("@m", 1.0.into()),
        ]),
    ];
    let mut t = trace(MANY);
    let mut moved = 0;
    for step in 0..200u64 {
        let update = &updates[step as usize * 5 % updates.len()];
        let before = bits(&t);
        let fresh = t.rerun().unwrap();
        assert_eq!(fresh.log_joint().to_bits(), t.log_joint().to_bits());
        let there = match t.update(update, draws(step)) {
            Ok(there) => there,
            Err(e) => {
                // A choice or observation of the branch that is not taken.
                assert!(e.to_string().contains("the trace has no choice or observation"), "{e}");
                assert_eq!(bits(&t), before);
                continue;
            }
        };
        t.commit();
        for (address, value) in update {
            let Given::Value(value) = value else { continue };
            let text = format!("{:?}", t.get(&address.to_string()).unwrap());
            assert!(
                address.to_string() == "@f" || text == format!("{value:?}"),
                "{address}: {text}"
            );
        }
        let back = t.update(&there.discarded, draws(1000 + step)).unwrap();
        assert_eq!(back.weight.log_joint, -there.weight.log_joint, "step {step}");
        if there.weight.appeared == 0 {
            assert_eq!(back.log_weight, -there.log_weight, "step {step}");
        }
        let after = bits(&t);
        assert_eq!(after, before, "step {step}");
        if step % 3 == 0 {
            t.rollback();
            moved += 1;
        } else {
            t.commit();
        }
    }
    assert!(moved > 40);
}

/// The weight of an update is the ratio of the new density to the old one, without the
/// density of newly drawn choices, term by term.
#[test]
fn weights_are_those_of_enumeration() {
    let mut t = trace(
        "assume c ~ flip(0.3); assume x = if c { a ~ normal(1, 2); a } else { k ~ categorical([1, 3]); k };
         observe normal(x, 0.5) = 0.8 as y;",
    );
    t.set("@c", false, draws(0)).unwrap();
    for k in [0.0, 1.0] {
        t.set("@x/k", k, draws(1)).unwrap();
        let old = 0.7 * [0.25, 0.75][k as usize] * normal_pdf(0.8, k, 0.5);
        assert!((t.log_joint() - old.ln()).abs() < 1e-12);
        for a in [-1.0, 0.4, 3.0] {
            let one =
                t.update(&given(&[("@c", true.into()), ("@x/a", a.into())]), draws(2)).unwrap();
            let new = 0.3 * normal_pdf(a, 1.0, 2.0) * normal_pdf(0.8, a, 0.5);
            assert!(
                (one.log_weight - (new / old).ln()).abs() < 1e-12,
                "given: {} for {}",
                one.log_weight,
                new / old
            );
            assert_eq!((one.weight.appeared, one.weight.vanished), (1, 1));
            assert_eq!(
                one.discarded.iter().map(|d| d.0.to_string()).collect::<Vec<_>>(),
                ["@c", "@x/k"]
            );
        }
        let other = t.update(&given(&[("@c", true.into()), ("@y", 2.0.into())]), draws(3)).unwrap();
        let Value::Num(a) = t.get("@x/a").unwrap() else { panic!("not a number") };
        let new = 0.3 * normal_pdf(2.0, a, 0.5);
        assert!(
            (other.log_weight - (new / old).ln()).abs() < 1e-12,
            "drawn: {} for {}",
            other.log_weight,
            new / old
        );
        t.rollback();
    }
}

/// If an update draws the choices of a branch, the mean of its exponentiated weight is
/// the ratio of the evidences.
#[test]
fn drawn_branches_are_importance_weighted() {
    let mut t = trace(
        "assume c ~ flip(0.3); assume x = if c { a ~ normal(1, 2); a } else { 0.5 };
         observe normal(x, 1) = 0.8 as y;",
    );
    t.set("@c", false, draws(0)).unwrap();
    let n = 20_000;
    let weights: Vec<f64> = (0..n)
        .map(|step| t.update(&given(&[("@c", true.into())]), draws(step)).unwrap().log_weight.exp())
        .collect();
    let expected = 0.3 * normal_pdf(0.8, 1.0, 5f64.sqrt()) / (0.7 * normal_pdf(0.8, 0.5, 1.0));
    let (mean, sd) = (mean(&weights), variance(&weights).sqrt());
    assert!(
        (mean - expected).abs() < 5.0 * sd / (n as f64).sqrt() && sd < expected,
        "{mean} for {expected}"
    );
}

/// The projections sum to the log joint density.
#[test]
fn projections_sum_to_the_joint() {
    let mut t = trace(&format!("{MANY} factor(-m * m);"));
    let address = |text: &str| {
        let a: Address = text.parse().unwrap();
        Selector::Address(pcadlang_engine::trace::Pattern::exact(&a))
    };
    for step in 0..20 {
        let all = t.select(&Selector::All);
        let targets = t.targets(all).to_vec();
        t.regenerate(&targets, draws(step)).unwrap();
        t.commit();
        assert_eq!(t.project(&Selector::All).to_bits(), t.log_joint().to_bits());
        assert_eq!(t.project(&Selector::Nothing), 0.0);
        let choices = t.choices().into_iter().map(|(a, _, score)| (a, score));
        let (mut sum, parts) = (0.0, choices.chain(t.observations()).collect::<Vec<_>>());
        for (a, score) in &parts {
            let one = t.project(&address(&a.to_string()));
            assert!((one - score).abs() < 1e-12, "{a}");
            sum += one;
        }
        assert!((sum - t.log_joint()).abs() < 1e-9);
        let kinds = [
            pcadlang_engine::trace::ChoiceKind::Continuous,
            pcadlang_engine::trace::ChoiceKind::Discrete,
        ];
        let prior: f64 = kinds.map(|k| t.project(&Selector::Kind(k))).iter().sum();
        assert!((prior - t.log_prior()).abs() < 1e-9, "observations have no kinds");
    }
}

/// Changes of a fork do not affect the original trace.
#[test]
fn forks_are_independent() {
    let mut t = trace(MANY);
    let before = bits(&t);
    let mut fork = t.clone();
    fork.set("@m", 2.0, draws(0)).unwrap();
    fork.set("@y", Value::array(vec![7.0, 7.0]), draws(0)).unwrap();
    assert_eq!(bits(&t), before);
    t.set("@m", 2.0, draws(0)).unwrap();
    t.set("@y", Value::array(vec![7.0, 7.0]), draws(0)).unwrap();
    assert_eq!(bits(&t), bits(&fork));
}

/// Invalid addresses and values are errors, and do not change the trace.
#[test]
fn wrong_addresses_and_values_are_told() {
    let mut t = trace(
        r#"assume slope ~ normal(0, 1); assume on ~ flip(0.5); assume w ~ dirichlet([1, 1, 1]); assume z ~ iid(normal(0, 1), 2);
           fn bone(name) { r ~ normal(0, 1); r } assume pose = map(bone, ["arm", "leg"]);
           observe normal(slope + w[0] + sum(z) + (if on { 1 } else { 0 }) + pose.arm + pose.leg, 1) = 0 as seen;"#,
    );
    let before = bits(&t);
    for (address, value, said) in [
        (
            "@slpe",
            Value::Num(1.0),
            "the trace has no choice or observation `@slpe`; did you mean `@slope`?",
        ),
        ("@sen", Value::Num(1.0), "did you mean `@seen`?"),
        ("@pose[arn]/bone/r", Value::Num(1.0), "did you mean `@pose[arm]/bone/r`?"),
        ("@z[2]", Value::Num(1.0), "did you mean `@z["),
        ("@quite/another", Value::Num(1.0), "no choice or observation `@quite/another`"),
        ("@a b", Value::Num(1.0), "is not an address"),
        ("@slope", Value::Bool(true), "true does not fit `@slope`, which is drawn from `normal`"),
        ("@on", Value::Num(1.0), "1 does not fit `@on`, which is drawn from `flip`"),
        ("@w", Value::array(vec![0.5, 0.5]), "does not fit `@w`, which is drawn from `dirichlet`"),
        ("@slope", Value::Num(f64::NAN), "not a number"),
        ("@seen", Value::Bool(true), ""),
        ("@slope", Value::str("x"), "does not fit `@slope`"),
    ] {
        let e = match t.set(address, value.clone(), draws(0)) {
            Err(e) => e.to_string(),
            // A density over numbers is zero for other values.
            Ok(_) if address == "@seen" => {
                assert_eq!(t.log_joint(), f64::NEG_INFINITY);
                t.set("@seen", 0.0, draws(0)).unwrap();
                continue;
            }
            Ok(_) => panic!("{address} takes {value}"),
        };
        assert!(e.contains(said), "{address}: {e}");
        assert_eq!(bits(&t), before, "{address}");
    }
    assert!(t.get("@slpe").unwrap_err().to_string().contains("did you mean `@slope`?"));
    assert!(matches!(t.get("@seen"), Ok(Value::Num(0.0))));
}
