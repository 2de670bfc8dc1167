//! Twenty published models as everybody writes them, vague priors included: the default
//! plan must start, and find the posterior means of `published/moments.csv`, or come near
//! and warn.
//!
//! `cargo test --release --test inference published_models:: -- --include-ignored --nocapture`
//! prints every comparison.

use pcadlang::{Model, RunOptions};
use pcadlang_inference::diagnostics::mcse_mean;
use pcadlang_inference::draws::KernelStats;
use pcadlang_report::{modes, warnings};
use std::collections::BTreeSet;

/// The folder of the models and their moments.
const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/published");

/// Returns the means, standard deviations and standard errors of the means, by JAGS, each with the
/// name of its model.
pub fn moments() -> Vec<(String, String)> {
    let text = std::fs::read_to_string(format!("{FOLDER}/moments.csv")).unwrap();
    let lines = text.lines().filter(|l| !l.starts_with('#')).skip(1);
    lines.filter_map(|l| l.split_once(',')).map(|(n, l)| (n.to_owned(), l.to_owned())).collect()
}

/// The chains of a run.
const CHAINS: usize = 4;

/// Runs the default plan of a model and compares means: within four standard errors of both
/// together, ours being at most a quarter of the standard deviation. A run that warns may be
/// further off, but by no more than one standard deviation.
fn right_or_warned(name: &str) {
    let text = std::fs::read_to_string(format!("{FOLDER}/{name}.pcad")).unwrap();
    assert!(!text.contains("infer"), "{name} should leave the plan to the engine");
    let model = Model::from_text(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
    let begun = std::time::Instant::now();
    let options = RunOptions { seed: 1, ..RunOptions::default() };
    let posterior = model.run(&options, CHAINS, 2).unwrap_or_else(|e| panic!("{name}: {e}"));
    let seconds = begun.elapsed().as_secs_f64();
    let quantities = posterior.quantities();
    let (mut compared, mut wrong, mut far) = (0, Vec::new(), Vec::new());
    for (_, line) in moments().iter().filter(|(n, _)| n == name) {
        let fields: Vec<&str> = line.split(',').collect();
        let [mean, sd, error] = [1, 2, 3].map(|i| fields[i].parse::<f64>().unwrap());
        let q = quantities.iter().find(|q| q.name == fields[0]);
        let q = q.unwrap_or_else(|| panic!("{name}: no {}", fields[0]));
        let ours = mcse_mean(&q.chains);
        let z = (q.summary.mean - mean) / ours.hypot(error);
        let said = format!(
            "{name}: {} {} ± {}, {mean} ± {sd} by JAGS, z = {z:.2}",
            q.name, q.summary.mean, q.summary.sd
        );
        println!("{said}");
        compared += 1;
        let is_near = (q.summary.mean - mean).abs() <= sd;
        far.extend((!is_near).then(|| said.clone()));
        // A large error excuses nothing, and a quantity that did not move has none.
        if !(z.abs() <= 4.0 && ours < 0.25 * sd) {
            wrong.push(said);
        }
    }
    assert!(compared > 0, "no moments of {name}");
    let kernels = KernelStats::total(posterior.chains.iter().flat_map(|c| &c.kernels));
    let warned = warnings(&quantities, &modes(&quantities, None), &kernels, CHAINS);
    println!("{name}: {seconds:.1} s, warnings: {warned:?}");
    assert!(far.is_empty(), "far off:\n{}", far.join("\n"));
    assert!(wrong.is_empty() || !warned.is_empty(), "without a warning:\n{}", wrong.join("\n"));
}

/// One test for each model.
macro_rules! models {
    ($($(#[$more:meta])* $name:ident,)*) => {
        $(#[test] $(#[$more])* fn $name() { right_or_warned(stringify!($name)) })*

        #[test]
        fn every_model_of_the_table_has_a_test() {
            let named: BTreeSet<String> = moments().into_iter().map(|(name, _)| name).collect();
            assert_eq!(named, BTreeSet::from([$(stringify!($name).to_owned()),*]));
        }
    };
}

models! {
    #[ignore = "minutes"]
    blocker,
    coal,
    dugongs,
    dyes,
    #[ignore = "minutes"]
    epil,
    equiv,
    eyes,
    #[ignore = "minutes"]
    kidney,
    line,
    #[ignore = "minutes"]
    logistic,
    mice,
    #[ignore = "minutes"]
    probit,
    pumps,
    quakes,
    #[ignore = "minutes"]
    rats,
    salm,
    schools,
    seeds,
    stacks,
    surgical,
}
