//! The enumerated posterior of a program: draws from it, and the cells of draws.

use super::execute::{CELLS, Execution, Extent, Integration, POINT, REACH, WIDTH, executions};
use super::gaussian::Gaussian;
use super::program::Program;
use super::steps::Steps;
use pcadlang::Value;
use pcadlang_engine::trace::{Address, Constraint, Trace};
use pcadlang_numerics::dist::Datum;
use pcadlang_numerics::rng::Stream;
use std::collections::BTreeMap;

/// The values of the existing discrete choices, by address.
pub type Key = Vec<(String, String)>;

/// The continuous choices of a state given the discrete ones.
enum Continuous {
    None,
    Gaussian(Vec<String>, Gaussian),
    Grid(String, Grid),
    Quarters(String, Steps),
}

/// A density that is log-linear within each cell.
struct Grid {
    /// The log density at the two points of each cell.
    points: Vec<[f64; 2]>,
    /// By cell: the cumulative probability, and the slope of the log density per cell
    /// width.
    sums: Vec<f64>,
    slopes: Vec<f64>,
}

impl Grid {
    fn new() -> Grid {
        Grid { points: vec![[f64::NEG_INFINITY; 2]; CELLS], sums: Vec::new(), slopes: Vec::new() }
    }

    /// Computes the cells from the points, and returns the log of the integral.
    fn add_up(&mut self) -> f64 {
        let top = self.points.iter().flatten().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut total = 0.0;
        for [a, b] in &self.points {
            let slope = if a.is_finite() && b.is_finite() { (b - a) / (2.0 * POINT) } else { 0.0 };
            let mass = (0.5 * (a + b) - top).exp()
                * if slope.abs() < 1e-9 { 1.0 } else { 2.0 * (slope / 2.0).sinh() / slope };
            total += if mass.is_finite() { mass } else { 0.0 };
            self.sums.push(total);
            self.slopes.push(slope);
        }
        self.sums.iter_mut().for_each(|s| *s /= total);
        top + total.ln()
    }

    /// Whether the density is negligible near both ends of the grid; otherwise, a correct
    /// kernel would appear wrong, because it moves beyond the grid.
    fn ends_within(&self) -> bool {
        let margin = CELLS / 40;
        self.sums[margin] < 1e-5 && self.sums[CELLS - margin] > 1.0 - 1e-5
    }

    /// Returns the point below which the probability is `u`.
    fn quantile(&self, u: f64) -> f64 {
        let cell = self.sums.partition_point(|s| *s <= u).min(CELLS - 1);
        let before = if cell == 0 { 0.0 } else { self.sums[cell - 1] };
        let share = ((u - before) / (self.sums[cell] - before)).clamp(0.0, 1.0);
        let slope = self.slopes[cell];
        let within =
            if slope.abs() < 1e-9 { share } else { (share * slope.exp_m1()).ln_1p() / slope };
        (cell as f64 + within) * WIDTH - REACH
    }

    /// Returns the probability below a point.
    fn below(&self, x: f64) -> f64 {
        let at = ((x + REACH) / WIDTH).clamp(0.0, CELLS as f64);
        let cell = (at as usize).min(CELLS - 1);
        let before = if cell == 0 { 0.0 } else { self.sums[cell - 1] };
        let (slope, within) = (self.slopes[cell], at - cell as f64);
        let share =
            if slope.abs() < 1e-9 { within } else { (within * slope).exp_m1() / slope.exp_m1() };
        before + (self.sums[cell] - before) * share
    }
}

/// A kind of state: everything about it except for the values of its continuous choices.
struct Kind {
    probability: f64,
    discrete: Vec<(String, f64, bool)>,
    continuous: Continuous,
    /// The log weight of everything except for the continuous choices and what depends on
    /// them, and the log weight of everything.
    log_weight: f64,
    log_total: f64,
}

/// An enumerated posterior.
pub struct Posterior {
    kinds: Vec<Kind>,
    by_key: BTreeMap<Key, usize>,
    /// The addresses of all discrete choices that occur in any state, with their largest
    /// number of values.
    pub discrete: BTreeMap<String, usize>,
    pub has_continuous: bool,
}

fn key(discrete: &[(String, f64, bool)]) -> Key {
    discrete.iter().map(|(a, v, _)| (a.clone(), format!("{v}"))).collect()
}

fn phi(z: f64) -> f64 {
    0.5 * statrs::function::erf::erfc(-z / 2.0f64.sqrt())
}

impl Posterior {
    /// Enumerates the posterior of a program's states; `None` if that is impossible, or if its mass
    /// is zero.
    pub fn of(program: &Program, integration: Integration) -> Option<Posterior> {
        Posterior::over(program, integration, Extent::State)
    }

    /// The same, over all choices of this extent.
    pub fn over(program: &Program, integration: Integration, extent: Extent) -> Option<Posterior> {
        let most = if integration == Integration::Gaussian { 400 } else { 100 };
        let most = if extent == Extent::Records { 4 * most } else { most };
        let mut p = Posterior {
            kinds: Vec::new(),
            by_key: BTreeMap::new(),
            discrete: BTreeMap::new(),
            has_continuous: false,
        };
        executions(program, integration, extent, most, |e| p.enter(e, integration)).ok()?;
        for kind in &mut p.kinds {
            kind.log_total = match &mut kind.continuous {
                Continuous::None => kind.log_weight,
                Continuous::Gaussian(_, g) => kind.log_weight + g.log_evidence,
                Continuous::Grid(_, grid) => grid.add_up(),
                Continuous::Quarters(_, steps) => steps.add_up(),
            };
        }
        let most = p.kinds.iter().map(|k| k.log_total).fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = p.kinds.iter().map(|k| (k.log_total - most).exp()).sum();
        p.kinds.iter_mut().for_each(|k| k.probability = (k.log_total - most).exp() / total);
        let ends = |k: &Kind| match &k.continuous {
            Continuous::Grid(_, grid) => k.log_total == f64::NEG_INFINITY || grid.ends_within(),
            _ => true,
        };
        (most.is_finite() && p.kinds.iter().all(ends)).then_some(p)
    }

    fn enter(&mut self, e: Execution, integration: Integration) {
        self.has_continuous |= !e.continuous.is_empty();
        for (a, v, _) in &e.discrete {
            let values = self.discrete.entry(a.clone()).or_default();
            *values = (*values).max(*v as usize + 1);
        }
        let i = *self.by_key.entry(key(&e.discrete)).or_insert(self.kinds.len());
        if i == self.kinds.len() {
            let continuous = match (integration, e.continuous.first()) {
                (_, None) => Continuous::None,
                (Integration::Grid, Some(x)) => Continuous::Grid(x.clone(), Grid::new()),
                (Integration::Quarters, Some(x)) => {
                    Continuous::Quarters(x.clone(), Steps::new(e.shapes.unwrap_or_default()))
                }
                (Integration::Gaussian, _) => {
                    Continuous::Gaussian(e.continuous.clone(), e.gaussian())
                }
            };
            let (discrete, log_weight) = (e.discrete.clone(), e.log_weight);
            self.kinds.push(Kind {
                probability: 0.0,
                discrete,
                continuous,
                log_weight,
                log_total: 0.0,
            });
        }
        match (&mut self.kinds[i].continuous, e.point) {
            (Continuous::Grid(_, grid), Some(at)) => grid.points[at / 2][at % 2] = e.log_weight,
            (Continuous::Quarters(_, steps), Some(at)) => steps.set(at, e.log_weight),
            _ => {}
        }
    }

    /// Whether a choice with this address exists in every state.
    pub fn is_always_there(&self, address: &str) -> bool {
        self.kinds.iter().all(|k| {
            let continuous = match &k.continuous {
                Continuous::None => false,
                Continuous::Gaussian(all, _) => all.iter().any(|a| a == address),
                Continuous::Grid(a, _) | Continuous::Quarters(a, _) => a == address,
            };
            continuous || k.discrete.iter().any(|d| d.0 == address)
        })
    }

    /// Returns the probability of the most probable kind of state.
    pub fn likeliest(&self) -> f64 {
        self.kinds.iter().map(|k| k.probability).fold(0.0, f64::max)
    }

    /// Returns a draw, as constraints for a trace, and its log joint density if known
    /// exactly.
    pub fn draw(&self, rng: &mut Stream) -> (Vec<(u64, Constraint)>, Option<f64>) {
        let weights: Vec<f64> = self.kinds.iter().map(|k| k.probability).collect();
        let kind = &self.kinds[rng.weighted(&weights, weights.iter().sum())];
        let hash = |a: &str| a.parse::<Address>().unwrap_or_else(|e| panic!("{a}: {e}")).hash64();
        let number = |a: &str, x: f64| (hash(a), Constraint::Stored(Datum::Num(x)));
        let mut state: Vec<(u64, Constraint)> = Vec::new();
        for (a, v, truth) in &kind.discrete {
            let datum = if *truth { Datum::Bool(*v != 0.0) } else { Datum::Num(*v) };
            state.push((hash(a), Constraint::Stored(datum)));
        }
        let mut log_joint = Some(kind.log_weight);
        match &kind.continuous {
            Continuous::None => {}
            Continuous::Gaussian(addresses, g) => {
                let white: Vec<f64> = addresses.iter().map(|_| rng.standard_normal()).collect();
                let x = g.draw(&white);
                state.extend(addresses.iter().zip(&x).map(|(a, x)| number(a, *x)));
                // The posterior density times the evidence.
                let volume = g.log_density(&white);
                log_joint = Some(kind.log_weight + g.log_evidence + volume);
            }
            Continuous::Grid(address, grid) => {
                state.push(number(address, grid.quantile(rng.uniform())));
                log_joint = None;
            }
            Continuous::Quarters(address, steps) => {
                state.push(number(address, steps.quantile(rng.uniform())));
                log_joint = None;
            }
        }
        (state, log_joint)
    }

    /// Returns the kind of a trace's state, and the positions of its continuous choices
    /// as conditional probabilities: independent and uniform in 0 to 1. `None` for an
    /// impossible state.
    pub fn place(&self, trace: &Trace) -> Option<(usize, Vec<f64>)> {
        let (mut discrete, mut numbers) = (Key::new(), BTreeMap::new());
        for (address, value, _) in trace.choices() {
            let a = address.to_string();
            match value {
                Value::Bool(b) => discrete.push((a, format!("{}", u8::from(b)))),
                Value::Num(x) if self.discrete.contains_key(&a) => {
                    discrete.push((a, format!("{x}")))
                }
                Value::Num(x) => drop(numbers.insert(a, x)),
                _ => return None,
            }
        }
        discrete.sort();
        let i = *self.by_key.get(&discrete)?;
        let places = match &self.kinds[i].continuous {
            Continuous::None => numbers.is_empty().then(Vec::new)?,
            Continuous::Gaussian(addresses, g) => {
                let x: Option<Vec<f64>> =
                    addresses.iter().map(|a| numbers.get(a).copied()).collect();
                let x = x.filter(|x| x.len() == numbers.len())?;
                g.whitened(&x).iter().map(|z| phi(*z)).collect()
            }
            Continuous::Grid(address, grid) => {
                vec![grid.below(*numbers.get(address).filter(|_| numbers.len() == 1)?)]
            }
            Continuous::Quarters(address, steps) => {
                vec![steps.below(*numbers.get(address).filter(|_| numbers.len() == 1)?)]
            }
        };
        Some((i, places))
    }

    /// Returns the probability of each kind of state, and its number of continuous
    /// choices.
    pub fn kinds(&self) -> impl Iterator<Item = (f64, usize)> {
        self.kinds.iter().map(|k| {
            let n = match &k.continuous {
                Continuous::None => 0,
                Continuous::Gaussian(all, _) => all.len(),
                Continuous::Grid(..) | Continuous::Quarters(..) => 1,
            };
            (k.probability, n)
        })
    }

    /// Returns the probability of each combination of values of some discrete choices; those that
    /// are not among the discrete ones are left out.
    pub fn joint(&self, addresses: &[String]) -> BTreeMap<Vec<String>, f64> {
        let mut all = BTreeMap::new();
        for k in &self.kinds {
            let value =
                |a: &String| k.discrete.iter().find(|d| d.0 == *a).map(|d| format!("{}", d.1));
            *all.entry(addresses.iter().filter_map(value).collect()).or_default() += k.probability;
        }
        all
    }

    /// Returns the probability that a continuous choice is below `x`.
    pub fn below(&self, address: &str, x: f64) -> f64 {
        let below = |k: &Kind| match &k.continuous {
            Continuous::Gaussian(all, g) => {
                let i = all.iter().position(|a| a == address);
                i.map_or(0.0, |i| phi((x - g.mean[i]) / g.sd(i)))
            }
            Continuous::Grid(_, grid) => grid.below(x),
            Continuous::Quarters(_, steps) => steps.below(x),
            Continuous::None => 0.0,
        };
        let possible = self.kinds.iter().filter(|k| k.probability > 0.0);
        possible.map(|k| k.probability * below(k)).sum()
    }

    pub fn probabilities(&self) -> Vec<f64> {
        self.kinds.iter().map(|k| k.probability).collect()
    }
}
