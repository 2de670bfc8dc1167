//! A likelihood of the host program with a gradient but without a sampler:
//! `cargo run --release --example embed_likelihood`.
//!
//! For a comparator, which scores a rendered view, see the example of
//! `pcadlang::host::Seen`.

use pcadlang::host::{Adjoint, Domain, Entry, Fault, Host, Likelihood, Type};
use pcadlang::{Error, Program, RunOptions, Value};

/// Huber's loss of numbers about their means: quadratic for small deviations and linear
/// for large ones, so that outliers have less influence.
#[derive(Debug)]
struct Huber {
    mean: Vec<f64>,
    scale: f64,
}

impl Huber {
    /// Returns the deviation of each observed number, in units of the scale.
    fn off(&self, observed: &Value) -> Result<Vec<f64>, Fault> {
        let xs = observed.numbers();
        if xs.len() != self.mean.len() {
            return Err(Fault::type_error(format!(
                "huber: {} numbers are observed, and there are {} means",
                xs.len(),
                self.mean.len()
            )));
        }
        Ok(xs.iter().zip(&self.mean).map(|(x, m)| (x - m) / self.scale).collect())
    }
}

impl Likelihood for Huber {
    fn name(&self) -> &str {
        "huber"
    }

    fn log_density(&self, observed: &Value) -> Result<f64, Fault> {
        let loss = |z: f64| if z.abs() < 1.0 { 0.5 * z * z } else { z.abs() - 0.5 };
        Ok(-self.off(observed)?.into_iter().map(loss).sum::<f64>())
    }

    /// Returns the adjoints of the arguments of `huber`: the means, and the scale, whose
    /// adjoint is unknown.
    fn gradient(&self, observed: &Value) -> Option<Adjoint> {
        let by_mean =
            self.off(observed).ok()?.into_iter().map(|z| z.clamp(-1.0, 1.0) / self.scale).collect();
        Some(Adjoint::List(vec![Adjoint::Array(by_mean), Adjoint::Unknown]))
    }

    /// It does not integrate to 1, so a run reports that its posterior is a
    /// pseudo-posterior.
    fn is_proper(&self) -> bool {
        false
    }
}

/// Returns the host with this likelihood.
pub fn host() -> Host {
    let huber = Entry::likelihood("huber", |a| {
        Ok(Huber { mean: a.array(0)?.to_vec(), scale: a.num("scale")? })
    })
    .argument("mean", Type::Array, "What is expected.")
    .optional("scale", Type::Num, 1.0, "From how far off on the loss is linear.")
    .within(Domain::Positive)
    .about("Huber's loss as a log likelihood: no density over the data.");
    Host::new().with(huber)
}

/// Returns the slope of a line through points with one outlier.
///
/// # Errors
/// Returns the errors of the program.
pub fn slope() -> Result<f64, Error> {
    let text = "let x = [0, 1, 2, 3, 4];
                assume a ~ normal(0, 10); assume b ~ normal(0, 10);
                observe huber(a + b * x, scale = 0.1) = [1, 3, 5, 7, 40] as y;
                infer { warmup 1000 { hmc(@**); } repeat 4000 { hmc(@**); } }";
    let model = Program::parse(text)?.host(&host())?.compile()?;
    let posterior = model.run(&RunOptions { seed: 1, ..RunOptions::default() }, 2, 2)?;
    Ok(posterior.quantity("b").map_or(f64::NAN, |q| q.summary.mean))
}

fn main() -> Result<(), Error> {
    println!("slope: {:.2} (2 without the outlier, 8.6 by least squares)", slope()?);
    Ok(())
}
