//! From a photograph to a posterior in a few lines:
//! `cargo run --release --example quickstart`.

use pcadlang::{Program, RunOptions};
use std::time::Duration;

fn main() -> Result<(), pcadlang::Error> {
    // A model without pictures: a conjugate normal with a known posterior (mean 1.6,
    // variance 0.2).
    let model =
        Program::parse("assume x ~ normal(0, 1); observe normal(x, 0.5) = 2;")?.compile()?;
    let posterior = model.run(&RunOptions { seed: 1, ..RunOptions::default() }, 4, 2)?;
    if let Some(x) = posterior.quantity("x") {
        println!(
            "x: mean {:.2}, sd {:.2}, R-hat {:.3}",
            x.summary.mean, x.summary.sd, x.summary.r_hat
        );
    }

    // A shipped program on a photograph, for ten seconds.
    let photograph = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/images/coffee_cup.png");
    let model = Program::open("lathe.pcad")?
        .set("size", "96")
        .observe_file("photo", photograph)?
        .compile()?;
    let options =
        RunOptions { seed: 1, time: Some(Duration::from_secs(10)), ..RunOptions::default() };
    let posterior = model.run(&options, 2, 2)?;
    for q in posterior.quantities().iter().take(4) {
        println!("{}: {:.2} (sd {:.2})", q.name, q.summary.mean, q.summary.sd);
    }
    Ok(())
}
