//! A distribution of the host program that is sampled, observed and used with `hmc`:
//! `cargo run --release --example embed_distribution`.

use pcadlang::host::{Datum, Distribution, Entry, Fault, Gradient, Host, Support, Type};
use pcadlang::rng::Stream;
use pcadlang::{Error, Program, RunOptions};

/// Kumaraswamy's distribution on (0, 1), with distribution function 1 - (1 - x^a)^b.
#[derive(Debug)]
struct Kumaraswamy {
    a: f64,
    b: f64,
}

impl Distribution for Kumaraswamy {
    fn name(&self) -> &str {
        "kumaraswamy"
    }

    /// The support determines the transform to unconstrained space.
    fn support(&self) -> Support {
        Support::Interval { lo: 0.0, hi: 1.0 }
    }

    /// The bounds are the same for all parameters.
    fn has_moving_support(&self) -> bool {
        false
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        let u = rng.open_uniform();
        Datum::Num((1.0 - u.powf(1.0 / self.b)).powf(1.0 / self.a))
    }

    fn log_density(&self, x: &Datum) -> f64 {
        match x.num() {
            Some(x) if x > 0.0 && x < 1.0 => {
                (self.a * self.b).ln()
                    + (self.a - 1.0) * x.ln()
                    + (self.b - 1.0) * (-x.powf(self.a)).ln_1p()
            }
            _ => f64::NEG_INFINITY,
        }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let (a, b, x) = (self.a, self.b, x.num().filter(|x| *x > 0.0 && *x < 1.0)?);
        let power = x.powf(a);
        let rest = (b - 1.0) * power / (1.0 - power);
        let by_x = (a - 1.0) / x - rest * a / x;
        Some(Gradient {
            x: vec![by_x],
            params: vec![1.0 / a + x.ln() - rest * x.ln(), 1.0 / b + (-power).ln_1p()],
        })
    }
}

/// Returns the host with this distribution.
pub fn host() -> Host {
    let family = Entry::distribution("kumaraswamy", |args| {
        let (a, b) = (args.num(0)?, args.num(1)?);
        if a > 0.0 && b > 0.0 {
            Ok(Kumaraswamy { a, b })
        } else {
            Err(Fault::domain("`a` and `b` must be positive"))
        }
    })
    .argument("a", Type::Num, "The first shape, positive.")
    .argument("b", Type::Num, "The second shape, positive.")
    .about("A distribution on (0, 1) much like beta, with a distribution function in closed form.");
    Host::new().with(family)
}

/// Returns the posterior means of a proportion with this prior and of its unknown shape,
/// after 14 successes in 20 trials, inferred by the given kernel.
///
/// # Errors
/// Returns the errors of the program.
pub fn share(kernel: &str) -> Result<(f64, f64), Error> {
    let text = format!(
        "assume b ~ lognormal(0.5, 0.3); assume p ~ kumaraswamy(2, b);
         observe binomial(20, p) = 14; observe kumaraswamy(b, 2) = [0.5, 0.6];
         infer {{ warmup 500 {{ {kernel}; }} repeat 20000 {{ {kernel}; }} }}"
    );
    let model = Program::parse(&text)?.host(&host())?.compile()?;
    let posterior = model.run(&RunOptions { seed: 1, ..RunOptions::default() }, 1, 1)?;
    let mean = |name| posterior.quantity(name).map_or(f64::NAN, |q| q.summary.mean);
    Ok((mean("p"), mean("b")))
}

fn main() -> Result<(), Error> {
    for kernel in ["hmc(@**, steps = 5)", "drift(one(@**))"] {
        let (p, b) = share(kernel)?;
        println!("{kernel}: p {p:.3}, b {b:.3}");
    }
    Ok(())
}
