//! Tapes: a straight-line program from some numbers to a log density, recorded once and
//! run many times.
//!
//! A tape keeps all numbers in one buffer and all derivatives in another of the same
//! layout. Running it forwards or backwards allocates nothing if all operations are
//! arithmetic on numbers and arrays, and densities of numbers. Other operations call the
//! built-in itself, and its vector-Jacobian product. A tape is independent of traces: a
//! [`Builder`] receives the operations in order.
//!
//! Invariant: it applies the same functions to the same numbers as the program, and sums
//! scores exactly, so that a density equals that of the program to the last bit. If it
//! cannot evaluate a point (a parameter outside its domain, a condition with another
//! outcome), it reports that, and the program itself must be run.

mod build;
mod form;
mod lanes;
mod log_sum_exp;
mod op;
mod sum_out;
mod summed;
mod values;

pub use build::Builder;
pub use form::Form;
pub use op::{ScoreSums, ScoreTerms, Scored};
pub use sum_out::{Entry, Factor};

use crate::lang::adjoint::Adjoint;
use crate::lang::builtins::PreviousEvaluation;
use crate::lang::value::Value;
use op::Op;
use pcadlang_numerics::dist::{Datum, Support};
use pcadlang_numerics::num::ExactSum;
use pcadlang_numerics::rng::Stream;
use rustc_hash::FxHashMap;
use std::ops::Range;
use std::sync::Arc;
use summed::Summed;
use values::{Adjoints, Values};

/// An input of a tape: a value that is the image of unconstrained coordinates under its
/// support.
#[derive(Debug)]
struct Input {
    support: Support,
    form: Form,
    dimension: usize,
}

/// A recorded log density.
#[derive(Debug, Default)]
pub struct Tape {
    values: Values,
    adjoints: Adjoints,
    inputs: Vec<Input>,
    ops: Vec<Op>,
    sums: ScoreSums,
    scratch: Vec<f64>,
    /// The choices summed out, in the order of elimination.
    summed: Vec<Summed>,
    /// Where the end of the recording moved results and operations.
    moved: lanes::Moved,
    /// The power of the likelihood within sums over choices.
    power: Power,
    /// The runs of numbers that operations use; empty if they use all.
    used: Vec<Range<usize>>,
    /// The coordinates at which it was last run; empty if they are not known.
    last: Vec<f64>,
    /// The power with which the adjoints are those of the values; `None` if they are not.
    reversed: Option<f64>,
}

/// A power of the likelihood.
#[derive(Clone, Copy, Debug)]
struct Power(f64);

impl Default for Power {
    fn default() -> Self {
        Power(1.0)
    }
}

impl Tape {
    /// Returns the sums of the scores at its last run.
    pub fn sums(&self) -> &ScoreSums {
        &self.sums
    }

    /// Runs it with these values of its inputs, given by their number, and returns the
    /// coordinates in `y`: `coarse` gives those that values do not tell. False if it cannot
    /// evaluate the program there.
    pub fn run_at_values(
        &mut self,
        mut value: impl FnMut(usize) -> Value,
        coarse: impl Fn(usize, &Support, f64) -> Option<f64>,
        y: &mut Vec<f64>,
    ) -> bool {
        self.sums = ScoreSums::default();
        self.forget();
        y.clear();
        for (i, input) in self.inputs.iter().enumerate() {
            let (x, from) = (value(i), y.len());
            let Some(datum) = x.to_datum() else { return false };
            input.support.to_free(&datum, y);
            if let (Support::Pole { .. }, Datum::Num(x), [y]) =
                (&input.support, &datum, &mut y[from..])
            {
                *y = coarse(i, &input.support, *x).unwrap_or(*y);
            }
            let jacobian = match y[from..] {
                [y] if matches!(input.form, Form::Num(_)) => input.support.from_free_scalar(y).1,
                ref own => input.support.from_free(own).1,
            };
            self.sums.jacobian.add(jacobian);
            if !input.form.write(&mut self.values, &x) {
                return false;
            }
        }
        self.forward()
    }

    /// Runs it with the images of a point of unconstrained space as values of its inputs:
    /// as [`Tape::run_at_values`], with their coordinates in `here`, which need not be the same to
    /// the last bit. If it was last run at that point, it has these values.
    pub fn run_at_images(&mut self, y: &[f64], here: &mut Vec<f64>) -> bool {
        here.clear();
        let has_values = !y.is_empty() && self.last == y;
        if has_values {
            self.sums.jacobian = ExactSum::default();
            self.last.clear();
        } else {
            self.sums = ScoreSums::default();
            self.forget();
        }
        let mut rest = y;
        for input in &self.inputs {
            let Some((own, after)) = rest.split_at_checked(input.dimension) else { return false };
            rest = after;
            let jacobian = match (&input.form, own) {
                (Form::Num(at), [y]) => {
                    let x = input.support.from_free_scalar(*y).0;
                    let back = input.support.settled(*y, input.support.to_free_scalar(x));
                    self.values.numbers[*at] = x;
                    here.push(back);
                    input.support.from_free_scalar(back).1
                }
                (form, own) => {
                    let (x, from) = (input.support.from_free(own).0, here.len());
                    input.support.to_free(&x, here);
                    if let ([y], [back]) = (own, &mut here[from..]) {
                        *back = input.support.settled(*y, *back);
                    }
                    if !form.write(&mut self.values, &Value::from_datum(&x)) {
                        return false;
                    }
                    input.support.from_free(&here[from..]).1
                }
            };
            self.sums.jacobian.add(jacobian);
        }
        has_values || self.forward()
    }

    /// Runs it at a point of unconstrained space. False if it cannot evaluate the program
    /// there.
    pub fn run(&mut self, y: &[f64]) -> bool {
        self.forget();
        let there = self.run_there(y);
        if there {
            self.last.extend_from_slice(y);
        }
        there
    }

    fn run_there(&mut self, y: &[f64]) -> bool {
        self.sums = ScoreSums::default();
        let mut rest = y;
        for input in &self.inputs {
            let Some((own, after)) = rest.split_at_checked(input.dimension) else { return false };
            rest = after;
            let jacobian = match (&input.form, own) {
                (Form::Num(at), [y]) if matches!(input.support, Support::Real) => {
                    // Its Jacobian is 1: there is nothing to add.
                    self.values.numbers[*at] = input.support.from_free_scalar(*y).0;
                    continue;
                }
                (Form::Num(at), [y]) => {
                    let (x, jacobian) = input.support.from_free_scalar(*y);
                    self.values.numbers[*at] = x;
                    jacobian
                }
                (form, own) => {
                    let (x, jacobian) = input.support.from_free(own);
                    if !form.write(&mut self.values, &Value::from_datum(&x)) {
                        return false;
                    }
                    jacobian
                }
            };
            self.sums.jacobian.add(jacobian);
        }
        self.forward()
    }

    /// Returns the values of the inputs at a point of unconstrained space, in order.
    pub fn images(&self, y: &[f64]) -> impl Iterator<Item = Datum> {
        let mut rest = y;
        self.inputs.iter().map(move |input| {
            let (own, after) = rest.split_at(input.dimension.min(rest.len()));
            rest = after;
            input.support.from_free(own).0
        })
    }

    /// Returns, for each input, its coordinate if its value need not tell it.
    pub fn coarse(&self, y: &[f64]) -> impl Iterator<Item = Option<f64>> {
        let mut rest = y;
        self.inputs.iter().map(move |input| {
            let (own, after) = rest.split_at(input.dimension.min(rest.len()));
            rest = after;
            match (&input.support, own) {
                (Support::Pole { .. }, [y]) if Support::COARSE.contains(y) => Some(*y),
                _ => None,
            }
        })
    }

    /// Returns the value of a form at the last run; `None` if a call fails.
    pub fn value(&self, form: &Form) -> Option<Value> {
        form.value(&self.values)
    }

    /// Returns the numbers of the buffer at the last run.
    pub fn all_numbers(&self) -> &[f64] {
        &self.values.numbers
    }

    /// Returns the numbers of a form in the buffer at the last run; `None` for others.
    pub fn numbers(&self, form: &Form) -> Option<&[f64]> {
        match form {
            Form::Num(at) => self.values.numbers.get(*at..*at + 1),
            Form::Array(at, n) => self.values.numbers.get(*at..at + n),
            _ => None,
        }
    }

    /// Where a form is that was recorded.
    pub fn place_of(&self, form: &Form) -> Form {
        self.moved.form(form)
    }

    /// Where a score is that was recorded.
    pub fn place_of_score(&self, scored: &Scored) -> Scored {
        self.moved.scored(scored)
    }

    /// Returns the terms of a score in the last run, and puts them into `each` if they are
    /// separate; `None` if there are none. `columns` keeps the terms of operations for
    /// several scores, of one run.
    pub fn terms(
        &self,
        scored: &Scored,
        each: &mut Vec<f64>,
        columns: &mut FxHashMap<usize, Vec<f64>>,
    ) -> Option<ScoreTerms> {
        each.clear();
        match scored {
            Scored::Operation(op) => self.ops.get(*op)?.terms(&self.values.numbers, each),
            Scored::Member(op, place, is_array) => {
                let column = columns.entry(*op).or_insert_with(|| {
                    let mut column = Vec::new();
                    self.ops.get(*op).and_then(|op| op.terms(&self.values.numbers, &mut column));
                    column
                });
                let term = column.get(*place).copied()?;
                if !is_array {
                    return Some(ScoreTerms::One(term));
                }
                each.push(term);
                Some(ScoreTerms::Each)
            }
            Scored::Numbers(at, false) => {
                self.values.numbers.get(at.start).copied().map(ScoreTerms::One)
            }
            Scored::Numbers(at, true) => {
                each.extend_from_slice(self.values.numbers.get(at.clone())?);
                Some(ScoreTerms::Each)
            }
        }
    }

    /// Returns the evaluation of an incremental function in the last run, from which its
    /// next one may start.
    pub fn evaluation(&self, call: &Scored) -> Option<&Arc<PreviousEvaluation>> {
        match call {
            Scored::Operation(op) => self.ops.get(*op)?.evaluation(),
            _ => None,
        }
    }

    /// What is known of the last run no longer holds.
    fn forget(&mut self) {
        self.last.clear();
        self.reversed = None;
    }

    fn forward(&mut self) -> bool {
        let (values, sums, Power(power)) = (&mut self.values, &mut self.sums, self.power);
        self.ops.iter_mut().all(|op| op.forward(values, sums, power))
    }

    /// Draws the choices that are summed out from their conditional at the point of the
    /// last run. Returns the index of each one's value.
    pub fn draw(&self, rng: &mut Stream) -> Vec<usize> {
        summed::draw(&self.summed, &self.ops, rng)
    }

    /// Sets the power of the likelihood within sums over choices: there, scores cannot be
    /// told apart afterwards. The sum is the log prior of [`Tape::sums`], tempered. Returns
    /// whether the last run was for another power.
    pub fn set_power(&mut self, power: f64) -> bool {
        let changes = self.power.0 != power && !self.summed.is_empty();
        if changes {
            self.forget();
        }
        self.power = Power(power);
        changes
    }

    /// Computes the derivatives, with respect to the coordinates `y` at which it was last
    /// run, of the log prior plus `power` times the log likelihood plus the log
    /// Jacobians. False if one is not known.
    pub fn gradient(&mut self, y: &[f64], power: f64, out: &mut Vec<f64>) -> bool {
        out.clear();
        if self.reversed != Some(power) && !self.reverse(power) {
            return false;
        }
        let (adjoints, scratch) = (&self.adjoints.numbers, &mut self.scratch);
        let mut rest = y;
        for input in &self.inputs {
            let Some((own, after)) = rest.split_at_checked(input.dimension) else { return false };
            rest = after;
            match &input.form {
                Form::Num(at) if matches!(input.support, Support::Real) => out.push(adjoints[*at]),
                Form::Num(at) => input.support.free_gradient(own, &adjoints[*at..=*at], out),
                form => {
                    scratch.clear();
                    form.each_place(&mut |at| scratch.push(adjoints[at]));
                    input.support.free_gradient(own, scratch, out);
                }
            }
        }
        true
    }

    /// Computes the adjoints at the last run. False if a derivative is not known.
    fn reverse(&mut self, power: f64) -> bool {
        if self.used.is_empty() {
            self.adjoints.numbers.fill(0.0);
        }
        self.adjoints.objects.fill(Adjoint::Zero);
        self.used.iter().for_each(|run| self.adjoints.numbers[run.clone()].fill(0.0));
        let (values, adjoints, scratch) = (&self.values, &mut self.adjoints, &mut self.scratch);
        let known = self.ops.iter().rev().all(|op| op.reverse(values, adjoints, power, scratch));
        self.reversed = known.then_some(power);
        known
    }
}

#[cfg(test)]
mod tests;
