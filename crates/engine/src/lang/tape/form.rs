//! Forms: where a value is on a tape, or how it is computed.

use super::values::{Adjoints, Values};
use crate::lang::adjoint::Adjoint;
use crate::lang::builtins::{Args, Builtin, Kind, PreviousEvaluation};
use crate::lang::density;
use crate::lang::value::Value;
use pcadlang_numerics::dist::Dist;
use smallvec::SmallVec;
use std::sync::Arc;

/// A value on a tape.
#[derive(Clone, Debug)]
pub enum Form {
    /// A value that does not depend on the inputs of the tape.
    Fixed(Value),
    /// The number at an index of the buffer.
    Num(usize),
    /// An array of numbers in the buffer: its start and length.
    Array(usize, usize),
    /// An array of other forms.
    List(Arc<[Form]>),
    /// A record.
    Record(Arc<[(Arc<str>, Form)]>),
    /// A value of another kind (an object, a likelihood) in the list of them: its index,
    /// and the index of a number that stands for it where operations are ordered by the
    /// numbers they read.
    Object(usize, usize),
    /// The result of a call that is not stored in the buffer (a boolean, a distribution,
    /// a covariance) and is computed when it is needed.
    Made(Arc<Made>),
}

/// A call and the forms of its arguments.
#[derive(Debug)]
pub struct Made {
    pub(super) builtin: Builtin,
    pub(super) args: Box<[Form]>,
}

impl Form {
    /// True if it does not depend on the inputs of the tape.
    pub fn is_fixed(&self) -> bool {
        match self {
            Form::Fixed(_) => true,
            Form::List(all) => all.iter().all(Form::is_fixed),
            Form::Record(all) => all.iter().all(|(_, f)| f.is_fixed()),
            _ => false,
        }
    }

    /// Returns the value, if it is fixed.
    pub fn fixed(&self) -> Option<Value> {
        self.is_fixed().then(|| self.value(&Values::default())).flatten()
    }

    /// Returns the number of elements, for arrays.
    pub(super) fn len(&self) -> Option<usize> {
        match self {
            Form::Fixed(v @ (Value::Array(_) | Value::List(_))) => v.len(),
            Form::Array(_, n) => Some(*n),
            Form::List(all) => Some(all.len()),
            _ => None,
        }
    }

    /// Returns element `i` of an array.
    pub fn element(&self, i: usize) -> Option<Form> {
        match self {
            Form::Fixed(v) => v.element(i).map(Form::Fixed),
            Form::Array(at, n) => (i < *n).then_some(Form::Num(at + i)),
            Form::List(all) => all.get(i).cloned(),
            _ => None,
        }
    }

    /// Returns element `i` of an array, or field `i` of a record.
    pub fn position(&self, i: usize) -> Option<Form> {
        match self {
            Form::Fixed(Value::Record(r)) => r.get_index(i).map(|(_, v)| Form::Fixed(v.clone())),
            Form::Record(all) => all.get(i).map(|(_, f)| f.clone()),
            other => other.element(i),
        }
    }

    /// Returns a field of a record.
    pub(super) fn field(&self, name: &str) -> Option<Form> {
        match self {
            Form::Fixed(Value::Record(r)) => r.get(name).cloned().map(Form::Fixed),
            Form::Record(all) => all.iter().find(|(n, _)| **n == *name).map(|(_, f)| f.clone()),
            _ => None,
        }
    }

    /// Returns the value, from the numbers in the buffer; `None` if a call fails.
    pub(super) fn value(&self, at: &Values) -> Option<Value> {
        Some(match self {
            Form::Fixed(v) => v.clone(),
            Form::Num(i) => Value::Num(at.numbers[*i]),
            Form::Array(i, n) => Value::Array(at.numbers[*i..i + n].into()),
            Form::List(all) => {
                Value::from_elements(all.iter().map(|f| f.value(at)).collect::<Option<_>>()?)
            }
            Form::Record(all) => {
                let fields = all.iter().map(|(name, f)| Some((Arc::clone(name), f.value(at)?)));
                Value::Record(Arc::new(fields.collect::<Option<_>>()?))
            }
            Form::Object(i, _) => at.objects[*i].clone(),
            Form::Made(m) => call(&m.builtin, &m.args, at)?.1,
        })
    }

    /// Writes a value of this form to its place; false if it has another form.
    pub(super) fn write(&self, to: &mut Values, value: &Value) -> bool {
        match (self, value) {
            (Form::Num(at), Value::Num(x)) => {
                to.numbers[*at] = *x;
                true
            }
            (Form::Array(at, n), Value::Array(xs)) if xs.len() == *n => {
                to.numbers[*at..at + n].copy_from_slice(xs);
                true
            }
            (Form::List(all), Value::List(xs)) if xs.len() == all.len() => {
                all.iter().zip(xs.iter()).all(|(f, x)| f.write(to, x))
            }
            (Form::Record(all), Value::Record(r)) if r.len() == all.len() => all
                .iter()
                .zip(r.iter())
                .all(|((name, f), (other, x))| name == other && f.write(to, x)),
            (Form::Object(i, _), x) => {
                to.objects[*i] = x.clone();
                true
            }
            (Form::Fixed(v), x) => v.same(x),
            _ => false,
        }
    }

    /// The same form with its numbers at other places.
    pub(super) fn with_places(&self, to: &dyn Fn(usize) -> usize) -> Form {
        match self {
            Form::Num(at) => Form::Num(to(*at)),
            Form::List(all) => Form::List(all.iter().map(|f| f.with_places(to)).collect()),
            Form::Record(all) => Form::Record(
                all.iter().map(|(name, f)| (Arc::clone(name), f.with_places(to))).collect(),
            ),
            Form::Made(m) => Form::Made(Arc::new(Made {
                builtin: m.builtin.clone(),
                args: m.args.iter().map(|f| f.with_places(to)).collect(),
            })),
            Form::Fixed(_) | Form::Array(..) | Form::Object(..) => self.clone(),
        }
    }

    /// Calls `f` with the index of each number, in order.
    pub(super) fn each_place(&self, f: &mut impl FnMut(usize)) {
        match self {
            Form::Num(at) => f(*at),
            Form::Array(at, n) => (*at..at + n).for_each(f),
            Form::List(all) => all.iter().for_each(|one| one.each_place(f)),
            Form::Record(all) => all.iter().for_each(|(_, one)| one.each_place(f)),
            _ => {}
        }
    }

    /// Calls `f` with the index of each number that the value is computed from.
    pub(super) fn each_number(&self, f: &mut impl FnMut(usize)) {
        match self {
            Form::Made(m) => m.args.iter().for_each(|a| a.each_number(f)),
            Form::Object(_, at) => f(*at),
            Form::List(all) => all.iter().for_each(|one| one.each_number(f)),
            Form::Record(all) => all.iter().for_each(|(_, one)| one.each_number(f)),
            plain => plain.each_place(f),
        }
    }

    /// Takes the adjoint of a value that has a place.
    pub(super) fn take_adjoint(&self, adjoints: &mut Adjoints) -> Adjoint {
        match self {
            Form::Num(at) => Adjoint::Num(adjoints.numbers[*at]),
            Form::Array(at, n) => Adjoint::Array(adjoints.numbers[*at..at + n].to_vec()),
            Form::List(all) => {
                Adjoint::List(all.iter().map(|f| f.take_adjoint(adjoints)).collect())
            }
            Form::Record(all) => Adjoint::Record(
                all.iter().map(|(n, f)| (Arc::clone(n), f.take_adjoint(adjoints))).collect(),
            ),
            Form::Object(i, _) => std::mem::take(&mut adjoints.objects[*i]),
            _ => Adjoint::Zero,
        }
    }

    /// Adds an adjoint to those of the values that this is computed from; false if a
    /// derivative is not known.
    pub(super) fn vjp(&self, by: Adjoint, values: &Values, adjoints: &mut Adjoints) -> bool {
        if by.is_zero() || self.is_fixed() {
            return true;
        }
        if let Form::Object(i, _) = self {
            // Unknown parts matter only if the argument that they belong to moves.
            adjoints.objects[*i].add(by);
            return true;
        }
        if by.is_unknown() {
            return false;
        }
        match self {
            Form::Fixed(_) | Form::Object(..) => true,
            Form::Num(at) => {
                adjoints.numbers[*at] += by.number();
                true
            }
            Form::Array(at, n) => {
                let own = &mut adjoints.numbers[*at..at + n];
                match &by {
                    Adjoint::Array(gs) if gs.len() == *n => {
                        own.iter_mut().zip(gs).for_each(|(a, g)| *a += g);
                    }
                    _ => {
                        own.iter_mut().enumerate().for_each(|(i, a)| *a += by.element(i).number());
                    }
                }
                true
            }
            Form::List(all) => {
                all.iter().enumerate().all(|(i, f)| f.vjp(by.element(i), values, adjoints))
            }
            Form::Record(all) => {
                all.iter().all(|(name, f)| f.vjp(by.field(name), values, adjoints))
            }
            Form::Made(m) => match call(&m.builtin, &m.args, values) {
                Some((_, value)) => vjp_call(&m.builtin, &m.args, value, &by, values, adjoints),
                None => false,
            },
        }
    }

    /// Propagates the derivatives with respect to the parameters of a distribution, and
    /// to a covariance among its arguments, to the values it is computed from.
    pub(super) fn vjp_dist(
        &self,
        dist: &Dist,
        params: Vec<f64>,
        by_matrix: impl FnOnce(&Args) -> Option<Adjoint>,
        values: &Values,
        adjoints: &mut Adjoints,
    ) -> bool {
        let Form::Made(m) = self else {
            return self.vjp(Adjoint::Array(params), values, adjoints);
        };
        let args: Option<SmallVec<[Value; 4]>> = m.args.iter().map(|f| f.value(values)).collect();
        let Some(args) = args else { return false };
        let args: SmallVec<[&Value; 4]> = args.iter().collect();
        let a = Args { builtin: &m.builtin, values: &args };
        let mut pulled = density::by_arguments(&a, dist, &params);
        if let Some(i) = density::matrix(dist, a.values)
            && let Some(p) = pulled.get_mut(i)
        {
            *p = Adjoint::Zero;
            if m.args.get(i).is_some_and(|f| !f.is_fixed()) {
                match by_matrix(&a) {
                    Some(by) => *p = by,
                    None => return false,
                }
            }
        }
        m.args.iter().zip(pulled).all(|(f, by)| f.vjp(by, values, adjoints))
    }
}

/// Returns the arguments of a call and its result.
pub(super) fn call(
    builtin: &Builtin,
    args: &[Form],
    at: &Values,
) -> Option<(SmallVec<[Value; 4]>, Value)> {
    let values: SmallVec<[Value; 4]> = args.iter().map(|f| f.value(at)).collect::<Option<_>>()?;
    let value = builtin.apply(&values.iter().collect::<SmallVec<[&Value; 4]>>()).ok()?;
    Some((values, value))
}

/// Returns the result of a call; an incremental function starts from its evaluation in
/// the last run, if the tape keeps that.
pub(super) fn call_from(
    builtin: &Builtin,
    args: &[Form],
    at: &Values,
    before: &mut Option<Arc<PreviousEvaluation>>,
    keeps: bool,
) -> Option<Value> {
    let values: SmallVec<[Value; 4]> = args.iter().map(|f| f.value(at)).collect::<Option<_>>()?;
    let values: SmallVec<[&Value; 4]> = values.iter().collect();
    match builtin.resume(&values, before.as_deref().filter(|_| keeps)) {
        None => builtin.apply(&values).ok(),
        Some(made) => {
            let made = before.insert(Arc::new(made.ok()?));
            Some(made.value.clone())
        }
    }
}

/// Propagates the adjoint of a call's result, which is `value`, to its arguments.
pub(super) fn vjp_call(
    builtin: &Builtin,
    args: &[Form],
    value: Value,
    by: &Adjoint,
    at: &Values,
    adjoints: &mut Adjoints,
) -> bool {
    let values: Option<SmallVec<[Value; 4]>> = args.iter().map(|f| f.value(at)).collect();
    let Some(values) = values else { return false };
    let refs: SmallVec<[&Value; 4]> = values.iter().collect();
    let a = Args { builtin, values: &refs };
    let pulled = match (builtin.kind, &value) {
        (Kind::Distribution(_), Value::Dist(d)) => {
            let params = by.numbers(if let Adjoint::Array(gs) = by { gs.len() } else { 0 });
            density::by_arguments(&a, d, &params)
        }
        _ => match builtin.derivative.vjp(&a, &value, by) {
            Some(pulled) => pulled,
            None => return false,
        },
    };
    args.iter().zip(pulled).all(|(f, by)| f.vjp(by, at, adjoints))
}
