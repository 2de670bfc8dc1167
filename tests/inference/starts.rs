//! How chains start: what `force` sets, and chains that find no state.

use pcadlang::{Model, Posterior, RunOptions};

fn run(text: &str, seed: u64, chains: usize) -> Result<Posterior, String> {
    let options = RunOptions { seed, ..RunOptions::default() };
    Model::from_text(text).unwrap().run(&options, chains, 2).map_err(|e| e.to_string())
}

/// The first recorded value of a quantity, in each chain.
fn first(text: &str, seed: u64, chains: usize, name: &str) -> Vec<f64> {
    let done = run(text, seed, chains).unwrap();
    done.quantity(name).unwrap().chains.iter().map(|c| c[0]).collect()
}

/// Some of these chains find the state that one draw in a thousand has, and some do not.
const RARE: &str = "assume x ~ normal(0, 1); assume y ~ normal(0, 1);
     observe flip(if x > 3.09 { 1 } else { 0 }) = true as seen; observe normal(y, 1) = 1;
     infer { repeat 200 { drift(@y); collect x, y; } }";

#[test]
fn a_chain_that_cannot_start_leaves_the_others_their_draws() {
    let done = run(RARE, 1, 12).unwrap();
    let ran = done.chains.len();
    assert!(ran > 1 && ran < 12, "{ran} of 12 chains started");
    assert_eq!((done.draws.len(), done.warnings.len()), (ran, 1));
    let y = done.quantity("y").unwrap();
    assert!(y.chains.iter().all(|c| c.len() == 200) && y.summary.r_hat > 0.9);
    let said = &done.warnings[0];
    for part in
        ["chains ", " of 12 could not start and are left out: all 1000 draws", "@seen", ":2:14)"]
    {
        assert!(said.contains(part), "{said} has no {part}");
    }
}

#[test]
fn without_any_chain_it_is_an_error() {
    let never = RARE.replace("3.09", "300");
    let e = run(&never, 1, 3).unwrap_err();
    assert!(e.starts_with("error: cannot start any chain") && e.contains("@seen is -inf"), "{e}");
}

#[test]
fn what_is_forced_is_set_before_a_state_is_looked_for() {
    let text = "assume x ~ normal(0, 1); factor(if x > 9 { 0 } else { log(0) }); force @x = 9.5;
         infer { repeat 2 { collect x; } }";
    assert_eq!(first(text, 3, 2, "x"), [9.5, 9.5]);
    // Draws that fail without it, too.
    let text = "assume s ~ normal(0, 1); observe normal(0, s - 9) = 1; force @s = 9.5;
         infer { init(best_of(5)); repeat 2 { collect s; } }";
    assert_eq!(first(text, 3, 2, "s"), [9.5, 9.5]);
    // Where a kernel proposes the states, whether it reads the present one or not.
    for centre in ["3", "x"] {
        let text = format!(
            "assume x ~ normal(0, 1); assume y ~ normal(0, 1); observe normal(x + y, 1) = 2;
             force @x = 9.5; kernel near() {{ propose @x ~ normal({centre}, 0.1); }}
             infer {{ init(best_of(5, from = near())); repeat 2 {{ collect x; }} }}"
        );
        assert_eq!(first(&text, 3, 2, "x"), [9.5, 9.5], "{centre}");
    }
}

#[test]
fn parts_of_arrays_and_values_that_depend_on_choices_are_forced() {
    let text = "assume z ~ iid(normal(0, 1), 3); assume y ~ normal(5, 1); force @z[1] = y + 1;
         force @z[2] = 7; observe normal(sum(z) + y, 1) = 2;
         infer { repeat 2 { collect y, z; } }";
    let (y, z) = (first(text, 3, 1, "y")[0], first(text, 3, 1, "z[1]")[0]);
    assert_eq!((z, first(text, 3, 1, "z[2]")[0]), (y + 1.0, 7.0));
    let whole = "assume z ~ iid(normal(0, 1), 2); force @z = [4, 5]; observe normal(sum(z), 1) = 2;
         infer { repeat 2 { collect z; } }";
    assert_eq!(first(whole, 3, 1, "z[1]"), [5.0]);
    let e = run(&whole.replace("[4, 5]", "[4]"), 1, 1).unwrap_err();
    assert!(e.contains("@z cannot be [4]: it does not fit"), "{e}");
}

#[test]
fn choices_of_some_states_are_forced_there() {
    let text = "assume k ~ flip(0.5); assume x ~ normal(0, 1); let y = if k { x } else { 0 };
         observe normal(y, 1) = 1; force @x = 3; infer { repeat 2 { collect k, y; } }";
    let mut both = [0, 0];
    for seed in 0..12 {
        let (k, y) = (first(text, seed, 1, "k")[0], first(text, seed, 1, "y")[0]);
        assert_eq!(y, 3.0 * k, "seed {seed}");
        both[k as usize] += 1;
    }
    assert!(both[0] > 0 && both[1] > 0, "{both:?}");
    let e = run(&text.replace("if k { x }", "if k and false { x }"), 1, 1).unwrap_err();
    assert!(e.contains("no observation depends on a choice @x"), "{e}");
}

/// With k one of the two is seen, and without it the other; neither can be true.
#[test]
fn a_chain_starts_without_what_contradicts_the_observations() {
    let text = "assume x1 ~ flip(0.5); assume x2 ~ flip(0.5); assume k ~ flip(0.5);
         force @x1 = true; force @x2 = true;
         observe flip(if k and x1 or not k and x2 { 1 } else { 0 }) = false as f;";
    let options = RunOptions { steps: Some(20_000), ..RunOptions::default() };
    for seed in 0..3 {
        let options = RunOptions { seed, ..options.clone() };
        let done = Model::from_text(text).unwrap().run(&options, 2, 2).unwrap();
        for (name, exact) in [("k", 0.5), ("x1", 0.25), ("x2", 0.25)] {
            let s = done.quantity(name).unwrap().summary;
            assert!(
                (s.mean - exact).abs() < 5.0 * s.mcse_mean + 0.005,
                "seed {seed}: {name} {s:?}"
            );
        }
        let said = &done.warnings[0];
        assert!(
            said.contains("started without what `force` sets") && said.contains("@f"),
            "{said}"
        );
    }
}
