//! Kernels of a program that map choices deterministically: involutive
//! Metropolis-Hastings (Tierney 1998; Neklyudov et al. 2020; Cusumano-Towner, Lew &
//! Mansinghka 2020).
//!
//! The body of the kernel draws auxiliary variables (`propose u ~ d;`) and assigns new
//! values to choices and auxiliary variables (`propose @x = e; propose u = e;`; an
//! auxiliary variable without an assignment keeps its value). The map must be its own
//! inverse: at each move it is evaluated again at its result, and must return to the
//! original values. The log ratio includes the log absolute determinant of its Jacobian
//! over the numbers among choices and auxiliary variables, computed by central finite
//! differences, for a move that passes all tests but the last. For these to capture all
//! dependencies, the body must read choices by `value(@x)` only.
//!
//! Beside the map, choices may be proposed from distributions (`propose @y ~ d`), which
//! read the state before the move: this is equivalent to an auxiliary variable that is
//! swapped with the old value, with a Jacobian of one. The density of the reverse move is
//! that of the old value when the body is executed in the new state. The map must not
//! read choices that are proposed beside it, or it is not an involution.

use super::program_kernel::{
    AuxiliaryValues, Image, Played, ProgramKernel, log_density, log_volume, sampled, values,
};
use crate::calls::error::fail;
use crate::calls::formula::Moved;
use crate::kernel::{Outcome, StepContext, accept_or_reject_last, recoverable};
use nalgebra::DMatrix;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Address, Change, Target, Trace, TraceResult};
use pcadlang_numerics::dist::Datum;

/// The largest deviation from the original values that the map may return with, relative
/// to the values.
const TOLERANCE: f64 = 1e-6;

/// A choice or an auxiliary variable, with its value and its image.
struct Mapped {
    choice: Option<(Address, Target)>,
    old: Value,
    new: Value,
    is_continuous: bool,
}

/// The coordinates of an execution's map: choices in the order of the body, then all auxiliary
/// variables.
fn mapped(played: &Played, trace: &Trace) -> Vec<Mapped> {
    let mut all = Vec::new();
    for (image, new) in &played.images {
        let Image::Choice(address, target) = image else { continue };
        let is_continuous = trace.dist(*target).is_some_and(|d| !d.support().is_discrete());
        all.push(Mapped {
            choice: Some((address.clone(), *target)),
            old: trace.value(*target),
            new: new.clone(),
            is_continuous,
        });
    }
    for (i, drawn) in played.drawn.iter().enumerate() {
        let image =
            played.images.iter().find(|(image, _)| matches!(image, Image::Auxiliary(j) if *j == i));
        let new = image.map_or(&drawn.value, |(_, v)| v).clone();
        let is_continuous = !drawn.dist.support().is_discrete();
        all.push(Mapped { choice: None, old: drawn.value.clone(), new, is_continuous });
    }
    all
}

/// The numbers in a value, concatenated.
fn numbers(v: &Value) -> Vec<f64> {
    match v {
        Value::Num(x) => vec![*x],
        Value::Array(xs) => xs.to_vec(),
        _ => Vec::new(),
    }
}

/// The same value with other numbers.
fn with_numbers(v: &Value, numbers: &mut impl Iterator<Item = f64>) -> Value {
    match v {
        Value::Num(x) => Value::Num(numbers.next().unwrap_or(*x)),
        Value::Array(xs) => Value::from_elements(
            xs.iter().map(|x| Value::Num(numbers.next().unwrap_or(*x))).collect(),
        ),
        v => v.clone(),
    }
}

/// True if two values are equal up to rounding.
fn near(a: &Value, b: &Value) -> bool {
    let close = |a: f64, b: f64| (a - b).abs() <= TOLERANCE * (1.0 + a.abs().max(b.abs()));
    match (a, b) {
        (Value::Num(a), Value::Num(b)) => close(*a, *b),
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b.iter()).all(|(a, b)| close(*a, *b))
        }
        (a, b) => a.same(b),
    }
}

impl ProgramKernel {
    /// Makes one step by a map.
    pub(super) fn involve(
        &self,
        trace: &mut Trace,
        aside: &mut Trace,
        at: &StepContext,
    ) -> TraceResult<Outcome> {
        trace.rollback();
        let mut rng = at.stream();
        let forth = self.play(trace, at, AuxiliaryValues::Drawn(&mut rng), none(aside))?;
        let forth_map = mapped(&forth, trace);
        let mut changes = Vec::new();
        for m in &forth_map {
            let Some((address, t)) = &m.choice else { continue };
            let Some(new) = m.new.to_datum() else {
                return Err(self.fault(format!("{address} cannot become {}", m.new.type_name())));
            };
            if has_nan(&new) {
                return Err(self.fault(format!("the new value of {address} is not a number")));
            }
            changes.push((*t, Change::Set(new)));
        }
        let (old, volume) = (values(trace, &forth.all), log_volume(trace, &forth.all));
        let (new, proposed) = sampled(&forth.all, &mut rng);
        changes.extend(proposed);
        let Some(w) = recoverable(trace.propose(&changes, at.draws(0)))? else {
            return Ok(Outcome::failed());
        };
        if changes.iter().any(|(t, _)| trace.was_removed(*t)) || w.log_weight == f64::NEG_INFINITY {
            trace.rollback();
            return Ok(Outcome::one(false));
        }
        let auxiliaries: Vec<Value> =
            forth_map.iter().filter(|m| m.choice.is_none()).map(|m| m.new.clone()).collect();
        let back =
            recoverable(self.play(trace, at, AuxiliaryValues::Given(&auxiliaries), none(aside)));
        let (log_back, wrong) = match &back {
            Ok(Some(back))
                if back.all.iter().map(|p| p.target).eq(forth.all.iter().map(|p| p.target)) =>
            {
                let density = back.log_density_of(&auxiliaries) + log_density(&back.all, &old);
                (density, self.does_not_return(&forth_map, &mapped(back, trace)))
            }
            _ => (f64::NEG_INFINITY, None),
        };
        let drawn: Vec<Value> = forth.drawn.iter().map(|d| d.value.clone()).collect();
        let log_forth = forth.log_density_of(&drawn) + log_density(&forth.all, &new);
        let ratio = at.tempered(&w) + log_back - log_forth + volume - log_volume(trace, &forth.all);
        // If the reverse density is zero, the move is rejected whatever the map does
        // there.
        let wrong = wrong.filter(|_| log_back > f64::NEG_INFINITY);
        match (wrong, back) {
            (Some(e), _) | (None, Err(e)) => {
                trace.rollback();
                Err(e)
            }
            _ => accept_or_reject_last(trace, at, ratio, &mut rng, |trace| {
                self.log_jacobian((trace, aside), at, &forth, &forth_map)
            }),
        }
    }

    /// The error if the map does not return to the original values.
    fn does_not_return(&self, forth: &[Mapped], back: &[Mapped]) -> Option<Box<RunError>> {
        let same = |(f, b): (&Mapped, &Mapped)| {
            f.choice.as_ref().map(|c| c.1) == b.choice.as_ref().map(|c| c.1)
        };
        let hint = "an involution is its own inverse: applied twice, it must return to the original values";
        let wrong = if forth.len() != back.len() || !forth.iter().zip(back).all(same) {
            self.fault("at the new state it maps different choices".into())
        } else {
            let (f, b) = forth.iter().zip(back).find(|(f, b)| !near(&f.old, &b.new))?;
            let name = f
                .choice
                .as_ref()
                .map_or("an auxiliary variable".to_owned(), |(a, _)| a.to_string());
            self.fault(format!("applied twice, it takes {name} from {} to {}", f.old, b.new))
        };
        Some(Box::new(RunError { hint: Some(hint.into()), ..*wrong }))
    }

    fn fault(&self, what: String) -> Box<RunError> {
        let name = &self.declared().name;
        fail(
            name.span,
            format!("the map of the kernel `{}` is not an involution: {what}", name.node),
        )
    }

    /// The log of the absolute determinant of the map's Jacobian.
    fn log_jacobian(
        &self,
        (trace, aside): (&mut Trace, &mut Trace),
        at: &StepContext,
        played: &Played,
        map: &[Mapped],
    ) -> TraceResult<f64> {
        let at_new = |map: &[Mapped], f: fn(&Mapped) -> &Value| -> Vec<f64> {
            map.iter().filter(|m| m.is_continuous).flat_map(|m| numbers(f(m))).collect()
        };
        let (from, to) = (at_new(map, |m| &m.old), at_new(map, |m| &m.new));
        if from.len() != to.len() {
            return Err(self.fault("its result has a different number of coordinates".into()));
        }
        let n = from.len();
        let mut matrix = DMatrix::<f64>::zeros(n, n);
        for j in 0..n {
            // Errors by curvature and by rounding are alike: some 1e-10.
            let h = (6e-6 * from[j].abs()).max(5e-7);
            for way in [-1.0, 1.0] {
                let mut moved = from.clone();
                moved[j] += way * h;
                let mut moved = moved.into_iter();
                let place = |m: &Mapped| {
                    if m.is_continuous { with_numbers(&m.old, &mut moved) } else { m.old.clone() }
                };
                let values: Vec<Value> = map.iter().map(place).collect();
                let choices: Vec<(Address, Value)> = map
                    .iter()
                    .zip(&values)
                    .filter_map(|(m, v)| Some((m.choice.as_ref()?.0.clone(), v.clone())))
                    .collect();
                let auxiliaries = &values[choices.len()..];
                let moved = Moved { choices: &choices, aside };
                let there =
                    self.play(trace, at, AuxiliaryValues::Moved(auxiliaries), Some(moved))?;
                let image = at_new(&mapped(&there, trace), |m| &m.new);
                if image.len() != n || there.drawn.len() != played.drawn.len() {
                    return Err(
                        self.fault("the choices it maps depend on values that it changes".into())
                    );
                }
                for i in 0..n {
                    matrix[(i, j)] += way * image[i] / (2.0 * h);
                }
            }
        }
        let log = libm::log(matrix.determinant().abs());
        if log.is_finite() {
            Ok(log)
        } else {
            Err(self.fault("its Jacobian is singular or not finite".into()))
        }
    }
}

/// No moved choices.
fn none(aside: &mut Trace) -> Option<Moved<'_>> {
    Some(Moved { choices: &[], aside })
}

/// True if a value contains a NaN.
fn has_nan(x: &Datum) -> bool {
    match x {
        Datum::Num(x) => x.is_nan(),
        Datum::Vec(xs) => xs.iter().any(|x| x.is_nan()),
        Datum::List(xs) => xs.iter().any(has_nan),
        Datum::Bool(_) => false,
    }
}
