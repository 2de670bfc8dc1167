//! The distributions: one built-in per row of the table of families in [`pcadlang_numerics::dist`],
//! which documents it.
//!
//! This module reads the parameters from values. An array as a parameter makes a product
//! of independent elements, each with its own address. A parameter outside its domain is
//! a recoverable fault: a proposal that leads to it is rejected.

mod compounds;
mod parameter_fault;

use self::compounds::{mixture, ordered, truncated};
use self::parameter_fault::{fault, made};
use super::covariance::CovarianceValue;
use super::elementwise::array_len;
use super::linear::matrix::Matrix;
use super::{Args, Argument, Builtin, Domain, Kind, Row, Scalar, Type};
use crate::lang::error::Fault;
use crate::lang::value::Value;
use pcadlang_numerics::dist::{self, Dist, FAMILIES, Family, ParamDoc, ParamError, ParamKind};
use smallvec::{SmallVec, smallvec};
use std::sync::Arc;

/// The built-ins of all families. One with several forms takes the arguments of all, and
/// serves as a function value; calls are those of a form.
pub(super) fn all() -> impl Iterator<Item = Builtin> {
    FAMILIES.iter().filter(|f| f.form_of.is_none()).map(|f| match other_form(f) {
        Some(other) => with_both(f, other),
        None => builtin(f),
    })
}

/// The forms of families that have two.
pub(super) fn forms() -> impl Iterator<Item = Builtin> {
    let both = |f: &'static Family| other_form(f).map(|other| [builtin(f), builtin(other)]);
    FAMILIES.iter().filter_map(both).flatten()
}

/// The family that is another parametrisation of this one, by its last parameter.
fn other_form(f: &Family) -> Option<&'static Family> {
    FAMILIES.iter().find(|other| other.form_of == Some(f.name))
}

fn with_both(f: &Family, other: &Family) -> Builtin {
    let mut args: Vec<Argument> = f.params.iter().map(argument).collect();
    args.extend(other.params.last().map(argument));
    let first = args.len().saturating_sub(2);
    args[first..].iter_mut().for_each(|a| a.default = Some("none".into()));
    Builtin { args: args.into(), kind: Kind::Distribution(by_form), scalar: None, ..builtin(f) }
}

/// A distribution of a family with two forms, from the arguments of both.
fn by_form(a: &Args) -> Result<Dist, Fault> {
    let name = &*a.builtin.name;
    let family = FAMILIES.iter().find(|f| f.name == name);
    let Some((family, other)) = family.and_then(|f| Some((f, other_form(f)?))) else {
        return Err(Fault::type_error(format!("{name} has one form")));
    };
    let last = a.builtin.args.len().saturating_sub(2);
    let (form, by) = match (a.given(last), a.given(last + 1)) {
        (true, false) => (family, last),
        (false, true) => (other, last + 1),
        _ => {
            let [p, q] = [last, last + 1].map(|i| a.builtin.args.get(i).map_or("", |p| &*p.name));
            return Err(Fault::type_error(format!("{name}: give either `{p}` or `{q}`")));
        }
    };
    let values: SmallVec<[&Value; 4]> = (0..last).chain([by]).map(|i| a.get(i)).collect();
    reader(form.name)(&Args { builtin: &builtin(form), values: &values })
}

fn builtin(f: &Family) -> Builtin {
    let kind = Kind::Distribution(reader(f.name));
    Builtin {
        args: f.params.iter().map(argument).collect(),
        scalar: scalar(f),
        drawn: f.drawn,
        ..Builtin::from(&Row::new(
            kind,
            f.form_of.unwrap_or(f.name),
            "Distributions",
            &[],
            Type::Dist,
            f.doc,
        ))
    }
}

fn argument(p: &ParamDoc) -> Argument {
    let ty = match p.kind {
        ParamKind::Numbers => Type::Nums,
        ParamKind::Number => Type::Num,
        ParamKind::Integer => Type::Int,
        ParamKind::Bool => Type::Bool,
        ParamKind::Array => Type::Array,
        ParamKind::Distribution => Type::Dist,
        ParamKind::Covariance => Type::Covariance,
        ParamKind::Any => Type::Any,
    };
    let value = |text: &str| match ty {
        Type::Bool => Value::Bool(text == "true"),
        Type::Nums | Type::Num => text.parse().map_or(Value::Unit, Value::Num),
        _ => Value::Unit,
    };
    Argument {
        name: p.name.into(),
        ty,
        domain: Domain::Any,
        unit: p.unit.into(),
        default: p.default.map(Into::into),
        value: p.default.map(value).unwrap_or_default(),
        doc: p.doc.into(),
    }
}

fn scalar(f: &Family) -> Option<Scalar> {
    match f.name {
        "categorical" => Some(Scalar::Weights {
            make: |weights| dist::Categorical::new(Arc::clone(weights)).map(Dist::from).ok(),
            log_probability: |weights, x| dist::Categorical::log_probability(weights, x).ok(),
        }),
        "categorical_logits" => Some(Scalar::Weights {
            make: |logits| dist::CategoricalLogits::new(Arc::clone(logits)).map(Dist::from).ok(),
            log_probability: |logits, x| dist::CategoricalLogits::log_probability(logits, x).ok(),
        }),
        _ => f.numbers.map(Scalar::Family),
    }
}

/// Returns what makes a distribution from values: for families whose parameters are not
/// all numbers, a function of their own.
fn reader(family: &str) -> fn(&Args) -> Result<Dist, Fault> {
    match family {
        "truncated" => truncated,
        "categorical" => |a| made(dist::Categorical::new(a.array(0)?)),
        "categorical_logits" => |a| made(dist::CategoricalLogits::new(a.array(0)?)),
        "dirichlet" => |a| made(dist::Dirichlet::new(&a.array(0)?)),
        "multinomial" => |a| made(dist::Multinomial::new(a.num(0)?, &a.array(1)?)),
        "lkj" => |a| made(dist::Lkj::new(a.num(0)?, a.num(1)?)),
        "wishart" => |a| {
            let scale = Matrix::read(a, 1)?.dense();
            made(dist::Wishart::new(a.num(0)?, &scale))
        },
        "mv_normal" => mv_normal,
        "gp" => gp,
        "iid" => |a| {
            let Value::Dist(d) = a.get(0) else { return Err(a.wrong(0, "a distribution")) };
            made(dist::Iid::new(Dist::clone(d), a.count(1)?))
        },
        "ordered" => ordered,
        "mixture" => mixture,
        _ => elementwise,
    }
}

/// The support and density of a family, for the reference.
pub(super) fn notes(name: &str) -> Vec<(&'static str, String)> {
    let found = FAMILIES.iter().find(|f| f.name == name);
    found.map_or(Vec::new(), |f| {
        let other = other_form(f).and_then(|o| Some((o.params.last()?.name, o.formula)));
        let density = match other {
            Some((by, formula)) => format!("{}; by `{by}`, {formula}", f.formula),
            None => f.formula.to_owned(),
        };
        vec![("Support", f.support.to_owned()), ("Density", density)]
    })
}

/// A distribution of a number, or a product of them if a parameter is an array.
fn elementwise(a: &Args) -> Result<Dist, Fault> {
    let Some(Scalar::Family(family)) = a.builtin.scalar else {
        return Err(Fault::type_error(format!("{}: made of more than numbers", a.builtin.name)));
    };
    let count = a.builtin.args.len();
    let mut parameters: SmallVec<[f64; 4]> = SmallVec::new();
    for i in 0..count {
        match a.get(i) {
            Value::Num(x) => parameters.push(*x),
            _ => return product(a, count, family.make),
        }
    }
    (family.make)(&parameters).map_err(fault)
}

fn product(
    a: &Args,
    count: usize,
    make: fn(&[f64]) -> Result<Dist, ParamError>,
) -> Result<Dist, Fault> {
    let mut parameters: SmallVec<[f64; 4]> = smallvec![0.0; count];
    let mut columns: SmallVec<[Option<Arc<[f64]>>; 4]> = smallvec![None; count];
    // The argument index of the first array, and its length.
    let mut first: Option<(usize, usize)> = None;
    for i in 0..count {
        match a.get(i) {
            Value::Num(x) => parameters[i] = *x,
            v if array_len(v).is_some() => {
                let xs = a.array(i)?;
                let (k, n) = *first.get_or_insert((i, xs.len()));
                if xs.len() != n {
                    return Err(a.wrong_length(
                        i,
                        &format!("as many elements as `{}`, {n}", a.builtin.args[k].name),
                    ));
                }
                columns[i] = Some(xs);
            }
            _ => return Err(a.wrong(i, "a number or an array of numbers")),
        }
    }
    let n = first.map_or(0, |(_, n)| n);
    let mut elements: Vec<Dist> = Vec::with_capacity(n);
    for k in 0..n {
        for (p, column) in parameters.iter_mut().zip(&columns) {
            if let Some(xs) = column {
                *p = xs[k];
            }
        }
        let one = match (elements.last(), &parameters[..]) {
            // All elements are of one family; an equal standard deviation reuses the
            // logarithm.
            (Some(Dist::Normal(d)), [mean, sd]) => d.near(*mean, *sd).map(Dist::from),
            _ => make(&parameters),
        };
        elements.push(one.map_err(|e| Fault::domain(format!("{e} (element {k})")))?);
    }
    made(dist::Product::new(elements))
}

fn mv_normal(a: &Args) -> Result<Dist, Fault> {
    let whitened = a.bool(3)?;
    let mean = a.array(0)?;
    let d = match (a.given(1), a.given(2)) {
        (true, false) => dist::MvNormal::from_cov(&mean, &square(a, 1, mean.len())?),
        (false, true) => dist::MvNormal::from_chol(&mean, &square(a, 2, mean.len())?),
        _ => return Err(Fault::type_error("mv_normal: give either `cov` or `chol`")),
    };
    made(d.map(|d| if whitened { d.to_whitened() } else { d }))
}

/// Reads a square matrix of size `n`, the length of the mean.
fn square(a: &Args, i: usize, n: usize) -> Result<nalgebra::DMatrix<f64>, Fault> {
    let m = Matrix::read(a, i)?;
    if m.rows.len() != n || m.width != n {
        let (name, rows, columns) = (&a.builtin.args[i].name, m.rows.len(), m.width);
        return Err(Fault::type_error(format!(
            "mv_normal: `{name}` must be {n} x {n} like the mean, got {rows} x {columns}"
        )));
    }
    Ok(m.dense())
}

fn gp(a: &Args) -> Result<Dist, Fault> {
    let cov = &a.object::<CovarianceValue>(1, "a covariance such as sq_exp(1)")?.0;
    let at = a.array(2)?;
    let mean = match a.get(0) {
        Value::Num(m) => vec![*m; at.len()],
        _ => a.array(0)?.to_vec(),
    };
    if mean.len() != at.len() {
        return Err(
            a.wrong_length(0, &format!("as many elements as there are points, {}", at.len()))
        );
    }
    let centred = a.bool(3)?;
    let jitter = a.num(4)?;
    made(dist::Gp::with_jitter(mean, cov, &at, centred, jitter))
}
