//! A kernel of the host program, called by name in `infer`:
//! `cargo run --release --example embed_kernel`.
//!
//! It reflects one number about a point, which preserves volume and is its own inverse: a
//! jump between two modes that random walks rarely make.

use pcadlang::host::{Datum, Entry, Host, Type};
use pcadlang::infer::{Kernel, Outcome, SiteSelection, StepContext, decide, recoverable};
use pcadlang::trace::{Change, Trace, TraceResult};
use pcadlang::{Error, Program, RunOptions};

/// The kernel `reflect(sel, about)`.
struct Reflect {
    scope: SiteSelection,
    about: f64,
}

impl Kernel for Reflect {
    fn name(&self) -> String {
        "reflect".into()
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let mut rng = at.stream();
        let selection = trace.select(&self.scope.selector);
        let targets = trace.targets(selection);
        if targets.is_empty() {
            return Ok(Outcome::default());
        }
        let target = targets[rng.index(targets.len())];
        let Some(x) = trace.stored(target).and_then(|x| x.num()) else {
            return Ok(Outcome::default());
        };
        let change = Change::Set(Datum::Num(2.0 * self.about - x));
        // A proposal at which the program is undefined is rejected and does not end the
        // run.
        let Some(weight) = recoverable(trace.propose(&[(target, change)], at.draws(0)))? else {
            return Ok(Outcome::failed().at(target));
        };
        Ok(decide(trace, at.tempered(&weight), &mut rng).at(target))
    }
}

/// Returns the host with this kernel.
pub fn host() -> Host {
    let reflect = Entry::kernel("reflect", |call| {
        Ok(Reflect { scope: call.scope(0)?, about: call.args().num(1)? })
    })
    .argument("sel", Type::Selection, "Numbers; one of them moves.")
    .optional("about", Type::Num, 0.0, "The point that it is reflected about.")
    .about("Metropolis-Hastings by reflection of one number.");
    Host::new().with(reflect)
}

/// Returns the fraction of draws in the right-hand mode, whose probability is 0.8.
///
/// # Errors
/// Returns the errors of the program.
pub fn share_on_the_right() -> Result<f64, Error> {
    let text = "assume x ~ mixture([0.2, 0.8], [normal(-4, 0.5), normal(4, 0.5)]);
                observe normal(x, 100) = 0;
                infer { repeat 20000 { drift(@x, scale = 0.5); reflect(@x); } }";
    let model = Program::parse(text)?.host(&host())?.compile()?;
    let posterior = model.run(&RunOptions { seed: 1, ..RunOptions::default() }, 1, 1)?;
    let x = posterior.quantity("x").map_or(Vec::new(), |q| q.chains.concat());
    Ok(x.iter().filter(|x| **x > 0.0).count() as f64 / x.len() as f64)
}

fn main() -> Result<(), Error> {
    println!("on the right: {:.3} (0.8)", share_on_the_right()?);
    Ok(())
}
