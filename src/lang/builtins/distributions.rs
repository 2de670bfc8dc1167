//! The distributions: one built-in per family of [`crate::dist`], which implements and
//! documents it.
//!
//! This module reads the parameters from values. An array as a parameter makes a product
//! of independent elements, each with its own address. A parameter outside its domain is
//! a recoverable fault: a proposal that leads to it is rejected.

use super::compounds::{mixture, ordered, truncated};
use super::covariance::CovarianceValue;
use super::elementwise::array_len;
use super::linear::matrix::Matrix;
use super::{Arg, Args, Kind, Row, Scalar, Type, arg, opt};
use crate::dist::{self, Dist, FAMILIES, Family, ParamError};
use crate::lang::error::Fault;
use crate::lang::value::Value;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::sync::Arc;

const SECTION: &str = "Distributions";

/// The row of a family whose parameters are all numbers, with the documentation in
/// `dist`.
macro_rules! scalar {
    ($name:literal, [$($p:ident),+], $made:expr) => {
        other(
            $name,
            &const { params::<{ [$(stringify!($p)),+].len() }>($name) },
            |a| elementwise(a, &[], |[$($p),+]| $made),
        )
        .scalar(Scalar::Family {
            make: |parameters| match *parameters {
                [$($p),+] => $made.ok(),
                _ => None,
            },
            log_density: |parameters, x| match *parameters {
                [$($p),+] => $made.ok().map(|d| d.log_density_num(x)),
                _ => None,
            },
        })
    };
}

/// The row of any other family.
const fn other(
    name: &'static str,
    args: &'static [Arg],
    make: fn(&Args) -> Result<Dist, Fault>,
) -> Row {
    Row::new(Kind::Distribution(make), name, SECTION, args, Type::Dist, family(name).doc)
}

pub(super) const TABLE: &[Row] = &[
    scalar!("normal", [mean, sd], dist::Normal::new(mean, sd).map(Dist::Normal)),
    scalar!("lognormal", [mu, sigma], dist::LogNormal::new(mu, sigma).map(Dist::LogNormal)),
    scalar!("uniform", [lo, hi], dist::Uniform::new(lo, hi).map(Dist::Uniform)),
    scalar!("beta", [a, b], dist::Beta::new(a, b).map(Dist::Beta)),
    scalar!("gamma", [shape, rate], dist::Gamma::new(shape, rate).map(Dist::Gamma)),
    scalar!("exponential", [rate], dist::Exponential::new(rate).map(Dist::Exponential)),
    scalar!("half_normal", [sd], dist::HalfNormal::new(sd).map(Dist::HalfNormal)),
    scalar!(
        "half_cauchy",
        [location, scale],
        dist::HalfCauchy::new(location, scale).map(Dist::HalfCauchy)
    ),
    scalar!(
        "student_t",
        [df, location, scale],
        dist::StudentT::new(df, location, scale).map(Dist::StudentT)
    ),
    other(
        "truncated_normal",
        &[
            arg("mean", Type::Nums, "The mean before truncation."),
            arg("sd", Type::Nums, "The standard deviation before truncation, positive."),
            opt("lo", Type::Nums, "-inf", "The lower bound."),
            opt("hi", Type::Nums, "inf", "The upper bound, above `lo`."),
        ],
        |a| {
            elementwise(a, &[0.0, 1.0, f64::NEG_INFINITY, f64::INFINITY], |[mean, sd, lo, hi]| {
                dist::TruncatedNormal::new(mean, sd, lo, hi)
                    .map(|d| Dist::TruncatedNormal(Arc::new(d)))
            })
        },
    ),
    other(
        "truncated",
        &[
            arg("d", Type::Dist, "A distribution of numbers."),
            opt("lo", Type::Nums, "-inf", "The lower bound."),
            opt(
                "hi",
                Type::Nums,
                "inf",
                "The upper bound, above `lo`; of integers it may be `lo`.",
            ),
        ],
        truncated,
    ),
    scalar!("inv_gamma", [shape, scale], dist::InvGamma::new(shape, scale).map(Dist::InvGamma)),
    scalar!("cauchy", [location, scale], dist::Cauchy::new(location, scale).map(Dist::Cauchy)),
    scalar!("laplace", [location, scale], dist::Laplace::new(location, scale).map(Dist::Laplace)),
    other(
        "von_mises",
        &[
            arg("mean", Type::Nums, "The mean direction: any finite number.").unit("radians"),
            arg("concentration", Type::Nums, "The concentration, not negative; 0 is uniform."),
        ],
        |a| elementwise(a, &[], |[mean, k]| dist::VonMises::new(mean, k).map(Dist::VonMises)),
    ),
    scalar!("weibull", [shape, scale], dist::Weibull::new(shape, scale).map(Dist::Weibull)),
    scalar!("neg_binomial", [r, p], dist::NegBinomial::new(r, p).map(Dist::NegBinomial)),
    scalar!("geometric", [p], dist::Geometric::new(p).map(Dist::Geometric)),
    other(
        "flat",
        &[
            opt("lo", Type::Nums, "-inf", "The lower bound."),
            opt("hi", Type::Nums, "inf", "The upper bound; at most one of them is finite."),
        ],
        |a| elementwise(a, &UNBOUNDED, |[lo, hi]| dist::Flat::new(lo, hi).map(Dist::Flat)),
    ),
    scalar!("flip", [p], dist::Flip::new(p).map(Dist::Flip)),
    scalar!(
        "uniform_discrete",
        [lo, hi],
        dist::UniformDiscrete::new(lo, hi).map(Dist::UniformDiscrete)
    ),
    scalar!("binomial", [n, p], dist::Binomial::new(n, p).map(Dist::Binomial)),
    scalar!("poisson", [rate], dist::Poisson::new(rate).map(Dist::Poisson)),
    other(
        "categorical",
        &[arg("weights", Type::Array, "One weight for each of 0, 1, …; they need not sum to 1.")],
        |a| dist::Categorical::new(a.array(0)?).map(Dist::Categorical).map_err(fault),
    )
    .scalar(Scalar::Weights {
        make: |weights| dist::Categorical::new(Arc::clone(weights)).map(Dist::Categorical).ok(),
        log_probability: |weights, x| dist::Categorical::log_probability(weights, x).ok(),
    }),
    other(
        "dirichlet",
        &[arg("alpha", Type::Array, "One positive concentration per component.")],
        |a| dist::Dirichlet::new(&a.array(0)?).map(|d| Dist::Dirichlet(Arc::new(d))).map_err(fault),
    ),
    other(
        "multinomial",
        &[
            arg("n", Type::Int, "The number of draws."),
            arg("weights", Type::Array, "One weight per category; they need not sum to 1."),
        ],
        |a| {
            dist::Multinomial::new(a.num(0)?, &a.array(1)?)
                .map(|d| Dist::Multinomial(Arc::new(d)))
                .map_err(fault)
        },
    ),
    other(
        "lkj",
        &[
            arg("n", Type::Int, "The number of rows, from 1 to 1000."),
            arg(
                "eta",
                Type::Num,
                "The shape, positive: 1 is uniform over correlation matrices, larger values favour independence.",
            ),
        ],
        |a| dist::Lkj::new(a.num(0)?, a.num(1)?).map(|d| Dist::Lkj(Arc::new(d))).map_err(fault),
    ),
    other(
        "wishart",
        &[
            arg("df", Type::Num, "The degrees of freedom, above the number of rows minus 1."),
            arg(
                "scale_chol",
                Type::Array,
                "The lower triangular Cholesky factor of the scale matrix, an array of rows.",
            ),
        ],
        wishart,
    ),
    other(
        "mv_normal",
        &[
            arg("mean", Type::Array, "The mean vector."),
            opt(
                "cov",
                Type::Array,
                "none",
                "The covariance matrix, an array of rows; give either `cov` or `chol`.",
            ),
            opt(
                "chol",
                Type::Array,
                "none",
                "The lower triangular Cholesky factor of the covariance.",
            ),
            opt(
                "whitened",
                Type::Bool,
                "false",
                "Non-centred: stores the white noise z of mean + chol z, so that the value \
                 follows changes of the mean and covariance.",
            ),
        ],
        mv_normal,
    ),
    other(
        "gp",
        &[
            arg("mean", Type::Nums, "The mean: one number, or one per point."),
            arg("cov", Type::Covariance, "The covariance function, such as `sq_exp(length)`."),
            arg("at", Type::Array, "The points."),
            opt(
                "centred",
                Type::Bool,
                "false",
                "Centred: stores the values instead of the underlying white noise.",
            ),
            opt("jitter", Type::Num, "1e-6", "Added to the diagonal of the covariance matrix.")
                .unit("fraction of the variance"),
        ],
        gp,
    ),
    other(
        "iid",
        &[arg("d", Type::Dist, "A distribution."), arg("n", Type::Int, "The number of values.")],
        |a| {
            let Value::Dist(d) = a.get(0) else { return Err(a.wrong(0, "a distribution")) };
            dist::Iid::new(Dist::clone(d), a.count(1)?)
                .map(|d| Dist::Iid(Arc::new(d)))
                .map_err(fault)
        },
    ),
    other(
        "ordered",
        &[
            arg("d", Type::Any, "A distribution of continuous numbers, or an array of them."),
            opt(
                "n",
                Type::Int,
                "none",
                "The number of values from a single distribution; an array gives one of each.",
            ),
        ],
        ordered,
    ),
    other(
        "mixture",
        &[
            arg("weights", Type::Array, "One weight per component; they need not sum to 1."),
            arg("components", Type::Array, "Distributions over the same kind of values."),
        ],
        mixture,
    ),
];

/// The bounds of the whole real line.
pub(super) const UNBOUNDED: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// The support and density of a family, for the reference.
pub(super) fn notes(name: &str) -> Vec<(&'static str, String)> {
    let found = FAMILIES.iter().find(|f| f.name == name);
    found.map_or(Vec::new(), |f| {
        vec![("Support", f.support.to_owned()), ("Density", f.formula.to_owned())]
    })
}

/// The fault of a parameter outside its domain, with a hint if there is one.
pub(super) fn fault(e: ParamError) -> Fault {
    let fault = Fault::domain(e.to_string());
    match e.rule {
        rule if rule.starts_with("must be positive") => {
            fault.with_hint("for a positive parameter use half_normal, gamma or lognormal as prior, or exp of a number")
        }
        "must make a positive definite matrix" => fault.with_hint("use a larger `jitter`, or add `+ white(sd)`"),
        _ => fault,
    }
}

/// A distribution of a number, or a product of them if a parameter is an array. Omitted
/// parameters take their defaults.
fn elementwise<const N: usize>(
    a: &Args,
    defaults: &[f64],
    make: fn([f64; N]) -> Result<Dist, ParamError>,
) -> Result<Dist, Fault> {
    let mut parameters = [0.0; N];
    for (i, p) in parameters.iter_mut().enumerate() {
        match (a.get(i), defaults.get(i)) {
            (Value::Num(x), _) => *p = *x,
            (Value::Unit, Some(default)) => *p = *default,
            _ => return product(a, defaults, make),
        }
    }
    make(parameters).map_err(fault)
}

fn product<const N: usize>(
    a: &Args,
    defaults: &[f64],
    make: fn([f64; N]) -> Result<Dist, ParamError>,
) -> Result<Dist, Fault> {
    let mut parameters = [0.0; N];
    let mut columns: [Option<Arc<[f64]>>; N] = [const { None }; N];
    // The argument index of the first array, and its length.
    let mut first: Option<(usize, usize)> = None;
    for i in 0..N {
        match a.get(i) {
            Value::Num(x) => parameters[i] = *x,
            Value::Unit if i < defaults.len() => parameters[i] = defaults[i],
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
        let made = match (elements.last(), &parameters[..]) {
            // All elements are of one family; an equal standard deviation reuses the
            // logarithm.
            (Some(Dist::Normal(d)), [mean, sd]) => d.near(*mean, *sd).map(Dist::Normal),
            _ => make(parameters),
        };
        elements.push(made.map_err(|e| Fault::domain(format!("{e} (element {k})")))?);
    }
    dist::Product::new(elements).map(|d| Dist::Product(Arc::new(d))).map_err(fault)
}

/// The maximum number of multivariate normals cached per thread.
const REMEMBERED: usize = 64;

thread_local! {
    /// Recent multivariate normals, by the identity of the arrays for mean and matrix: a
    /// factorisation is expensive, and a trace requests the same ones repeatedly.
    static NORMALS: RefCell<VecDeque<([Value; 3], bool, Dist)>> = const { RefCell::new(VecDeque::new()) };
}

/// Whether two values are the same array in memory, not merely equal.
fn is_same_array(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Array(a), Value::Array(b)) => Arc::ptr_eq(a, b),
        (Value::List(a), Value::List(b)) => Arc::ptr_eq(a, b),
        (Value::Unit, Value::Unit) => true,
        _ => false,
    }
}

fn mv_normal(a: &Args) -> Result<Dist, Fault> {
    let whitened = a.bool_or(3, false)?;
    let given = [0, 1, 2].map(|i| a.get(i));
    NORMALS.with_borrow_mut(|known| {
        let same = |(of, white, _): &([Value; 3], bool, Dist)| {
            *white == whitened && of.iter().zip(given).all(|(a, b)| is_same_array(a, b))
        };
        if let Some(at) = known.iter().position(same) {
            return Ok(known[at].2.clone());
        }
        let made = new_mv_normal(a, whitened)?;
        if known.len() == REMEMBERED {
            known.pop_front();
        }
        known.push_back((given.map(Value::clone), whitened, made.clone()));
        Ok(made)
    })
}

fn new_mv_normal(a: &Args, whitened: bool) -> Result<Dist, Fault> {
    let mean = a.array(0)?;
    let made = match (a.given(1), a.given(2)) {
        (true, false) => dist::MvNormal::from_cov(&mean, &square(a, 1, mean.len())?),
        (false, true) => dist::MvNormal::from_chol(&mean, &square(a, 2, mean.len())?),
        _ => return Err(Fault::type_error("mv_normal: give either `cov` or `chol`")),
    };
    let stored = |d: dist::MvNormal| if whitened { d.to_whitened() } else { d };
    made.map(|d| Dist::MvNormal(Arc::new(stored(d)))).map_err(fault)
}

fn wishart(a: &Args) -> Result<Dist, Fault> {
    let m = Matrix::read(a, 1)?;
    let scale = nalgebra::DMatrix::from_fn(m.rows.len(), m.width, |i, j| m.rows[i][j]);
    dist::Wishart::new(a.num(0)?, &scale).map(|d| Dist::Wishart(Arc::new(d))).map_err(fault)
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
    Ok(nalgebra::DMatrix::from_fn(n, n, |i, j| m.rows[i][j]))
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
    let centred = a.bool_or(3, false)?;
    let jitter = a.num_or(4, dist::JITTER)?;
    dist::Gp::with_jitter(mean, cov, &at, centred, jitter)
        .map(|d| Dist::Gp(Arc::new(d)))
        .map_err(fault)
}

/// Finds a family by name at compile time.
const fn family(name: &str) -> &'static Family {
    let mut i = 0;
    while i < FAMILIES.len() {
        if same_text(FAMILIES[i].name, name) {
            return &FAMILIES[i];
        }
        i += 1;
    }
    panic!("no such distribution")
}

const fn same_text(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    let mut i = 0;
    while i < a.len() && i < b.len() && a[i] == b[i] {
        i += 1;
    }
    i == a.len() && i == b.len()
}

/// The parameters of a family as arguments.
const fn params<const N: usize>(name: &str) -> [Arg; N] {
    let family = family(name);
    assert!(family.params.len() == N, "the distribution has a different number of parameters");
    let mut args = [arg("", Type::Nums, ""); N];
    let mut i = 0;
    while i < N {
        args[i] = arg(family.params[i].name, Type::Nums, family.params[i].doc);
        i += 1;
    }
    args
}
