//! Recording of a tape: each step is recorded in the order of evaluation, as one
//! operation or a few.
//!
//! A method returns `None` if a tape cannot represent the step; the caller then has to
//! run the program itself.

use super::form::{Form, Made};
use super::log_sum_exp::{Term, Terms};
use super::op::{Op, Scored};
use super::summed::Summed;
use super::values::{Adjoints, Values};
use super::{Input, Tape, lanes};
use crate::lang::adjoint::Adjoint;
use crate::lang::builtins::{
    Binary, Builtin, CovarianceValue, Derivative, Kind, PreviousEvaluation, Reduction, Scalar,
};
use crate::lang::value::Value;
use pcadlang_numerics::dist::{Batch, Dist, Support, batch, batch_of_mixture};
use pcadlang_numerics::num::Column;
use smallvec::SmallVec;
use std::sync::Arc;

/// A tape under construction.
#[derive(Debug, Default)]
pub struct Builder {
    pub(super) values: Values,
    inputs: Vec<Input>,
    pub(super) ops: Vec<Op>,
    /// The choices summed out.
    pub(super) summed: Vec<Summed>,
    /// The scores recorded since [`Builder::begin_terms`]; if there are none, scores are
    /// added to the sums of the tape.
    terms: Option<Terms>,
    /// True if incremental functions start from their evaluation in the last run.
    keeps: bool,
}

impl Builder {
    /// Creates an empty tape.
    pub fn new(keeps: bool) -> Builder {
        Builder { keeps, ..Builder::default() }
    }

    /// Returns the tape of everything recorded.
    pub fn finish(self) -> Tape {
        let mut tape = Tape {
            values: self.values,
            inputs: self.inputs,
            ops: self.ops,
            summed: self.summed,
            ..Tape::default()
        };
        if !tape.summed.is_empty() {
            lanes::merge(&mut tape);
        }
        let (numbers, objects) = (tape.values.numbers.len(), tape.values.objects.len());
        tape.adjoints =
            Adjoints { numbers: vec![0.0; numbers], objects: vec![Adjoint::Zero; objects] };
        tape
    }

    /// Returns the numbers of operations and of terms recorded so far.
    pub fn mark(&self) -> (usize, usize) {
        (self.ops.len(), self.terms.as_ref().map_or(0, Terms::len))
    }

    /// Returns where the score recorded since `mark` is, if any was recorded; `None` if it is in
    /// several places.
    pub fn scored(&self, mark: (usize, usize)) -> Option<Option<Scored>> {
        let terms = self.terms.as_ref().map(|terms| &terms[mark.1..]);
        Some(match (&self.ops[mark.0..], terms) {
            ([], None | Some([])) => None,
            ([], Some([t])) => Some(Scored::Numbers(t.column.at..t.column.at + 1, false)),
            ([Op::Density { x, n, out: Some(at), .. }], Some(_)) => {
                Some(Scored::Numbers(*at..at + n, *n != 1 || x.step != 0))
            }
            ([_], _) => Some(Scored::Operation(mark.0)),
            _ => return None,
        })
    }

    /// From here on, scores are numbers in the buffer, which `end_terms`
    /// returns, and are not added to the sums of the tape.
    pub fn begin_terms(&mut self) {
        self.terms = Some(Terms::new());
    }

    /// Returns the scores recorded since [`Builder::begin_terms`].
    pub(super) fn end_terms(&mut self) -> Terms {
        self.terms.take().unwrap_or_default()
    }

    fn term(&mut self, at: usize, observed: bool) {
        if let Some(terms) = &mut self.terms {
            terms.push(Term { column: Column { at, step: 0, live: true }, observed });
        }
    }

    /// Records log densities.
    fn densities(
        &mut self,
        (batch, dist): (Box<dyn Batch>, Option<Dist>),
        x: Column,
        params: SmallVec<[Column; 3]>,
        n: usize,
        observed: bool,
    ) {
        let out = self.terms.is_some().then(|| self.reserve(n));
        self.ops.push(Op::Density { batch, x, params, n, observed, out, dist });
        if let Some(out) = out {
            (out..out + n).for_each(|at| self.term(at, observed));
        }
    }

    pub(super) fn reserve(&mut self, n: usize) -> usize {
        self.values.reserve(n)
    }

    /// Allocates a value in the buffer, initialised with these numbers; `None` if it
    /// contains anything but numbers.
    pub fn place(&mut self, now: &Value) -> Option<Form> {
        Some(match now {
            Value::Num(x) => {
                self.values.numbers.push(*x);
                Form::Num(self.values.numbers.len() - 1)
            }
            Value::Array(xs) => {
                let at = self.values.numbers.len();
                self.values.numbers.extend(xs.iter());
                Form::Array(at, xs.len())
            }
            Value::List(xs) => Form::List(xs.iter().map(|x| self.place(x)).collect::<Option<_>>()?),
            Value::Record(r) => {
                let fields = r.iter().map(|(name, x)| Some((Arc::clone(name), self.place(x)?)));
                Form::Record(fields.collect::<Option<_>>()?)
            }
            _ => return None,
        })
    }

    /// Declares that a placed value, or a part of it, is the image of the next
    /// coordinates under a support.
    pub fn input(&mut self, support: Support, form: Form) {
        let dimension = support.free_dim();
        self.inputs.push(Input { support, form, dimension });
    }

    /// Returns the numbers of a form: a single one, or several in a row.
    fn column(&mut self, form: &Form) -> Option<Column> {
        match form {
            Form::Num(at) => Some(Column { at: *at, step: 0, live: true }),
            Form::Array(at, _) => Some(Column { at: *at, step: 1, live: true }),
            Form::Fixed(v @ (Value::Num(_) | Value::Bool(_))) => {
                let at = self.values.numbers.len();
                self.values.numbers.extend(v.numbers());
                Some(Column { at, step: 0, live: false })
            }
            Form::Fixed(v @ (Value::Array(_) | Value::List(_))) => {
                let (at, n) = (self.values.numbers.len(), v.len()?);
                let plain = |x: Value| matches!(x, Value::Num(_) | Value::Bool(_));
                if !(0..n).all(|i| v.element(i).is_some_and(plain)) {
                    return None;
                }
                self.values.numbers.extend(v.numbers());
                Some(Column { at, step: 1, live: false })
            }
            _ => None,
        }
    }

    /// Records a call of a built-in, whose current result is `now`.
    pub fn call(&mut self, builtin: &Builtin, args: Vec<Form>, now: &Value) -> Option<Form> {
        if args.iter().all(Form::is_fixed) {
            return Some(Form::Fixed(now.clone()));
        }
        let special = match (&builtin.derivative, &args[..]) {
            (Derivative::Unary(slope), [x]) => match builtin.scalar {
                Some(Scalar::Unary(f)) => self.unary(f, *slope, x),
                _ => None,
            },
            (Derivative::Binary(f), [x, y]) if numeric(now) => self.binary(f, x, y, now),
            (Derivative::Reduction(f), [x]) => self.reduce(f, x),
            _ if builtin.host.is_none() && builtin.full_name() == "matmul" => self.matrix(&args),
            _ => None,
        };
        if special.is_some() {
            return special;
        }
        if matches!(builtin.derivative, Derivative::Unknown)
            && !matches!(builtin.kind, Kind::Distribution(_))
        {
            return None;
        }
        // Cheap values that are not numbers are made where they are needed.
        let cheap = match now {
            Value::Object(_) => now.downcast::<CovarianceValue>().is_some(),
            Value::Bool(_) | Value::Dist(_) | Value::Str(_) => true,
            Value::List(xs) => xs.iter().all(|x| matches!(x, Value::Bool(_) | Value::Dist(_))),
            _ => false,
        };
        if cheap {
            return Some(Form::Made(Arc::new(Made {
                builtin: builtin.clone(),
                args: args.into(),
            })));
        }
        let out = match now {
            Value::Object(_) | Value::Likelihood(_) => self.object(now),
            _ => self.place(now)?,
        };
        self.ops.push(Op::Call {
            builtin: builtin.clone(),
            args: args.into(),
            out: out.clone(),
            before: None,
            keeps: self.keeps,
        });
        Some(out)
    }

    /// Allocates an object or a likelihood.
    fn object(&mut self, now: &Value) -> Form {
        self.values.objects.push(now.clone());
        Form::Object(self.values.objects.len() - 1, self.reserve(1))
    }

    /// Records the value of a choice that is stored as white noise, whose distribution
    /// currently is `now`; `None` if the noise is not an array.
    pub fn coloured(&mut self, dist: Form, now: &Dist, noise: &Form) -> Option<Form> {
        let (n, last) = (noise.len()?, Some(now.clone()));
        if dist.is_fixed() && noise.is_fixed() {
            return None;
        }
        let out = self.reserve(n);
        self.ops.push(Op::Coloured { dist, noise: noise.clone(), out, n, last });
        Some(Form::Array(out, n))
    }

    /// Records a family with these arguments, which currently gives `now`.
    pub fn made_dist(builtin: &Builtin, args: Vec<Form>, now: &Dist) -> Form {
        match args.iter().all(Form::is_fixed) {
            true => Form::Fixed(Value::Dist(Arc::new(now.clone()))),
            false => Form::Made(Arc::new(Made { builtin: builtin.clone(), args: args.into() })),
        }
    }

    /// The last recorded call, of an incremental function, may start from this evaluation.
    /// Returns where [`Tape::evaluation`] finds its later ones.
    pub fn start_from(&mut self, evaluation: &Arc<PreviousEvaluation>) -> Option<Scored> {
        let place = self.ops.len().checked_sub(1)?;
        let Some(Op::Call { before, .. }) = self.ops.last_mut() else { return None };
        *before = Some(Arc::clone(evaluation));
        Some(Scored::Operation(place))
    }

    fn unary(&mut self, f: fn(f64) -> f64, slope: fn(f64, f64) -> f64, x: &Form) -> Option<Form> {
        match x {
            Form::Fixed(Value::Num(x)) => Some(Form::Fixed(Value::Num(f(*x)))),
            Form::List(all) => Some(Form::List(
                all.iter().map(|x| self.unary(f, slope, x)).collect::<Option<_>>()?,
            )),
            Form::Num(x) => {
                let out = self.reserve(1);
                self.ops.push(Op::Unary { f, slope, x: *x, out, n: 1 });
                Some(Form::Num(out))
            }
            Form::Array(x, n) => {
                let out = self.reserve(*n);
                self.ops.push(Op::Unary { f, slope, x: *x, out, n: *n });
                Some(Form::Array(out, *n))
            }
            _ => None,
        }
    }

    /// Pairs elements as the built-ins do: two arrays need equal lengths, and anything
    /// else is paired with every element.
    fn binary(&mut self, f: &'static Binary, x: &Form, y: &Form, now: &Value) -> Option<Form> {
        let flat = |form: &Form| {
            matches!(
                form,
                Form::Num(_) | Form::Array(..) | Form::Fixed(Value::Num(_) | Value::Array(_))
            )
        };
        if x.is_fixed() && y.is_fixed() {
            return Some(Form::Fixed(now.clone()));
        }
        if flat(x) && flat(y) {
            let n = x.len().or(y.len());
            let (x, y) = (self.column(x)?, self.column(y)?);
            let out = self.reserve(n.unwrap_or(1));
            self.ops.push(Op::Binary { f, x, y, out, n: n.unwrap_or(1) });
            return Some(n.map_or(Form::Num(out), |n| Form::Array(out, n)));
        }
        let n = x.len().or(y.len())?;
        let part = |form: &Form, i: usize| {
            if form.len().is_some() { form.element(i) } else { Some(form.clone()) }
        };
        let one = |i: usize| self.binary(f, &part(x, i)?, &part(y, i)?, &now.element(i)?);
        let all = (0..n).map(one).collect::<Option<Vec<_>>>()?;
        self.array(all)
    }

    fn reduce(&mut self, f: &'static Reduction, x: &Form) -> Option<Form> {
        let Form::Array(x, n) = *x else { return None };
        let out = self.reserve(1);
        self.ops.push(Op::Reduce { f, x, n, out });
        Some(Form::Num(out))
    }

    /// The product of a fixed matrix and a vector, or of a vector and a fixed matrix.
    fn matrix(&mut self, args: &[Form]) -> Option<Form> {
        let (list, x, width, by_columns) = match args {
            [Form::Fixed(Value::List(list)), Form::Array(x, n)] => (list, *x, *n, false),
            [Form::Array(x, n), Form::Fixed(Value::List(list))] => (list, *x, *n, true),
            _ => return None,
        };
        let row = |row: &Value| if let Value::Array(xs) = row { Some(xs.to_vec()) } else { None };
        let mut all: Vec<Vec<f64>> = list.iter().map(row).collect::<Option<_>>()?;
        let columns = all.first().map_or(0, Vec::len);
        if all.iter().any(|row| row.len() != columns) {
            return None;
        }
        if by_columns {
            all = (0..columns).map(|j| all.iter().map(|row| row[j]).collect()).collect();
        }
        if all.iter().any(|row| row.len() != width) {
            return None;
        }
        let (rows, n) = (self.values.numbers.len(), all.len());
        all.iter().for_each(|row| self.values.numbers.extend(row));
        let out = self.reserve(n);
        self.ops.push(Op::Matrix { rows, x, width, out, n });
        Some(Form::Array(out, n))
    }

    /// Records an array of these elements.
    pub fn array(&mut self, all: Vec<Form>) -> Option<Form> {
        if all.iter().all(Form::is_fixed) {
            return Some(Form::Fixed(Value::from_elements(
                all.iter().map(Form::fixed).collect::<Option<_>>()?,
            )));
        }
        if !all.iter().all(|f| matches!(f, Form::Num(_) | Form::Fixed(Value::Num(_)))) {
            return Some(Form::List(all.into()));
        }
        let from = all.iter().map(|f| Some(self.column(f)?.at)).collect::<Option<_>>()?;
        Some(self.gather(from))
    }

    fn gather(&mut self, from: Box<[usize]>) -> Form {
        let n = from.len();
        if n > 0 && from.iter().enumerate().all(|(i, at)| *at == from[0] + i) {
            return Form::Array(from[0], n);
        }
        let out = self.reserve(n);
        self.ops.push(Op::Gather { from, out });
        Form::Array(out, n)
    }

    /// Records indexing with these keys.
    pub fn index(&mut self, base: &Form, keys: &[Value]) -> Option<Form> {
        let Some((key, rest)) = keys.split_first() else { return Some(base.clone()) };
        let within = |x: f64| (x >= 0.0 && x == libm::trunc(x)).then_some(x as usize);
        let picked = match (base, key) {
            (Form::Fixed(v), key) => Form::Fixed(crate::lang::index::index_value(v, key).ok()?),
            (_, Value::Num(i)) => base.element(within(*i)?)?,
            (_, Value::Str(name)) => base.field(name)?,
            (Form::Array(at, n), Value::Array(keys)) => {
                let places = keys.iter().map(|i| within(*i).filter(|i| i < n).map(|i| at + i));
                self.gather(places.collect::<Option<_>>()?)
            }
            (Form::List(_), Value::Array(keys)) => {
                let all = keys.iter().map(|i| base.element(within(*i)?)).collect::<Option<_>>()?;
                self.array(all)?
            }
            _ => return None,
        };
        self.index(&picked, rest)
    }

    /// From here on, the tape is valid only while this value equals its current one.
    pub fn guard(&mut self, form: &Form, now: &Value) -> Option<()> {
        if !form.is_fixed() {
            self.ops.push(Op::Guard { form: form.clone(), value: now.clone() });
        }
        Some(())
    }

    /// Records a log weight.
    pub fn factor(&mut self, weight: &Form) -> Option<()> {
        match *weight {
            Form::Num(x) if self.terms.is_some() => self.term(x, true),
            Form::Num(x) => self.ops.push(Op::Factor { x }),
            _ if weight.is_fixed() => {}
            _ => return None,
        }
        Some(())
    }

    /// Records the log density of a value under the distribution that a family gives for
    /// these arguments, which currently is `dist`.
    pub fn family(
        &mut self,
        builtin: &Builtin,
        args: Vec<Form>,
        dist: &Dist,
        x: &Form,
        observed: bool,
    ) -> Option<()> {
        if x.is_fixed() && args.iter().all(Form::is_fixed) {
            return Some(());
        }
        // In `iid(d, n)`, only d varies.
        let inner = match (dist, args.first()) {
            (Dist::Iid(_), Some(Form::Made(m))) if args[1..].iter().all(Form::is_fixed) => {
                Some(Arc::clone(m))
            }
            _ => None,
        };
        let params = inner.as_ref().map_or(&args[..], |m| &m.args);
        if self.mixture(dist, params, x, observed).is_some()
            || self.density(dist, params, x, observed).is_some()
        {
            return Some(());
        }
        self.score(Builder::made_dist(builtin, args, dist), x.clone(), observed)
    }

    /// Records the log density of a value under a distribution or likelihood, which
    /// currently is `now`.
    pub fn distribution(
        &mut self,
        dist: &Form,
        now: &Value,
        x: &Form,
        observed: bool,
    ) -> Option<()> {
        if x.is_fixed() && dist.is_fixed() {
            return Some(());
        }
        match (dist, now) {
            (Form::Made(m), Value::Dist(d)) => {
                let m = Arc::clone(m);
                self.family(&m.builtin, m.args.to_vec(), d, x, observed)
            }
            (Form::Fixed(_), Value::Dist(d)) if self.density(d, &[], x, observed).is_some() => {
                Some(())
            }
            _ => self.score(dist.clone(), x.clone(), observed),
        }
    }

    fn score(&mut self, dist: Form, x: Form, observed: bool) -> Option<()> {
        let out = self.terms.is_some().then(|| self.reserve(1));
        self.ops.push(Op::Score { dist, x, observed, out, last: None });
        if let Some(out) = out {
            self.term(out, observed);
        }
        Some(())
    }

    /// Records the log density of numbers under a mixture.
    fn mixture(&mut self, dist: &Dist, params: &[Form], x: &Form, observed: bool) -> Option<()> {
        let (Dist::Mixture(d), [weights, components]) = (dist, params) else { return None };
        // As with other distributions of a number, several observed values are
        // independent.
        if !observed && x.len().is_some() {
            return None;
        }
        let mut columns = Vec::new();
        for i in 0..components.len()? {
            columns.push(match components.element(i)? {
                Form::Made(m) => m.args.iter().map(|f| self.column(f)).collect::<Option<_>>()?,
                Form::Fixed(_) => SmallVec::new(),
                _ => return None,
            });
        }
        let weights = if weights.is_fixed() { None } else { Some(self.column(weights)?) };
        let batch = batch_of_mixture(d, weights, columns)?;
        let x_column = self.column(x)?;
        let n = x.len().unwrap_or(1);
        self.densities((batch, None), x_column, SmallVec::new(), n, observed);
        Some(())
    }

    /// Records the log density of numbers under one family.
    fn density(&mut self, dist: &Dist, params: &[Form], x: &Form, observed: bool) -> Option<()> {
        let n = x.len().unwrap_or(1);
        let fits = match (dist.elements(), x.len()) {
            (Some(elements), Some(n)) => elements == n,
            (Some(_), None) => false,
            // Several observed values under one distribution of a number are independent.
            (None, len) => observed || len.is_none(),
        };
        let fixed = params.iter().all(Form::is_fixed);
        let own_columns = params
            .iter()
            .all(|p| p.len().is_none_or(|len| len == n && matches!(dist, Dist::Product(_))));
        // Only `flip` takes booleans; other families take numbers, and `flip` takes the
        // numbers 0 and 1 only.
        let kind = match one_of(dist) {
            Dist::Flip(_) | Dist::FlipLogit(_) => {
                matches!(x, Form::Fixed(v) if is_bools(v) || is_zeros_and_ones(v))
            }
            _ => !matches!(x, Form::Fixed(v) if is_bools(v)),
        };
        if !fits || !(fixed || own_columns) || !kind {
            return None;
        }
        let columns: SmallVec<[Column; 3]> = match fixed {
            true => SmallVec::new(),
            false => params.iter().map(|p| self.column(p)).collect::<Option<_>>()?,
        };
        let batch = batch(dist, &columns)?;
        let x = self.column(x)?;
        let alone = (n == 1 && dist.elements().is_none()).then(|| dist.clone());
        self.densities((batch, alone), x, columns, n, observed);
        Some(())
    }
}

/// Returns the distribution of the first element.
fn one_of(dist: &Dist) -> Dist {
    dist.element(0)
}

/// True if a value is a boolean, or an array of booleans.
fn is_bools(v: &Value) -> bool {
    match v {
        Value::Bool(_) => true,
        Value::List(xs) => !xs.is_empty() && xs.iter().all(|x| matches!(x, Value::Bool(_))),
        _ => false,
    }
}

/// True if a value is 1 or 0, or an array of these.
fn is_zeros_and_ones(v: &Value) -> bool {
    let truth = |x: &f64| *x == 0.0 || *x == 1.0;
    match v {
        Value::Num(x) => truth(x),
        Value::Array(xs) => xs.iter().all(truth),
        _ => false,
    }
}

/// True if a value contains only numbers.
fn numeric(v: &Value) -> bool {
    match v {
        Value::Num(_) | Value::Array(_) => true,
        Value::List(xs) => xs.iter().all(numeric),
        Value::Record(r) => r.values().all(numeric),
        _ => false,
    }
}
