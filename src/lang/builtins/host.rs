//! The host's part of a built-in: closures with their captured state.
//!
//! The table has plain functions for them, as for other built-ins ([`HostItem::entry`]);
//! these find the closure through the built-in in their [`Args`]. Callers of built-ins
//! therefore need not know about hosts.

use super::{ArgAdjoints, Args, Builtin, Derivative, Inference, Kind};
use crate::dist::Dist;
use crate::lang::adjoint::Adjoint;
use crate::lang::error::Fault;
use crate::lang::value::Value;
use std::any::Any;
use std::fmt;
use std::sync::Arc;

/// The state that a function keeps between evaluations.
pub type State = Arc<dyn Any + Send + Sync>;

type Function = dyn Fn(&Args) -> Result<Value, Fault> + Send + Sync;
type Incremental =
    dyn Fn(&Args, Option<&PreviousEvaluation>) -> Result<(Value, State), Fault> + Send + Sync;
type Make = dyn Fn(&Args) -> Result<Dist, Fault> + Send + Sync;
type Product = dyn Fn(&Args, &Value, &Adjoint) -> Option<Vec<Adjoint>> + Send + Sync;

/// An evaluation from which a later one may resume. It is stored with its result (in a
/// node of a trace or an operation of a tape) and immutable, so that restoring an earlier
/// state of the trace restores it as well.
pub struct PreviousEvaluation {
    /// The arguments.
    pub args: Vec<Value>,
    /// The result.
    pub value: Value,
    /// The state that the function kept.
    pub state: State,
}

impl fmt::Debug for PreviousEvaluation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Before")
            .field("args", &self.args)
            .field("value", &self.value)
            .finish_non_exhaustive()
    }
}

/// A host's part of a built-in.
#[derive(Clone)]
pub enum HostItem {
    /// A function.
    Function {
        /// The function.
        call: Arc<Function>,
        /// Its vector-Jacobian product.
        vjp: Option<Arc<Product>>,
    },
    /// A function that may resume from an earlier evaluation.
    Incremental {
        /// The function.
        call: Arc<Incremental>,
        /// Its vector-Jacobian product.
        vjp: Option<Arc<Product>>,
    },
    /// A family of distributions.
    Family(Arc<Make>),
    /// A family of likelihoods.
    Likelihood(Arc<Function>),
    /// A maker of kernels; only `infer` knows its type.
    Kernel(State),
}

impl HostItem {
    /// Returns the kind and derivative for the table.
    pub fn entry(&self) -> (Kind, Derivative) {
        let product = |vjp: &Option<_>| match vjp {
            Some(_) => Derivative::Product(vjp_host),
            None => Derivative::Unknown,
        };
        match self {
            HostItem::Function { vjp, .. } => (Kind::Function(call_host), product(vjp)),
            HostItem::Incremental { vjp, .. } => (Kind::Function(call_host), product(vjp)),
            HostItem::Family(_) => (Kind::Distribution(make_host_dist), Derivative::Unknown),
            HostItem::Likelihood(_) => (Kind::Function(call_host), Derivative::Product(vjp_host)),
            HostItem::Kernel(_) => (Kind::Inference(Inference::Host), Derivative::Unknown),
        }
    }
}

impl Builtin {
    /// Calls an incremental host function, from an earlier evaluation if given; returns
    /// `None` for any other built-in.
    #[inline]
    pub(crate) fn resume(
        &self,
        values: &[&Value],
        before: Option<&PreviousEvaluation>,
    ) -> Option<Result<PreviousEvaluation, Fault>> {
        match &self.host {
            Some(HostItem::Incremental { call, .. }) => {
                Some(self.resume_with(&**call, values, before))
            }
            _ => None,
        }
    }

    fn resume_with(
        &self,
        call: &Incremental,
        values: &[&Value],
        before: Option<&PreviousEvaluation>,
    ) -> Result<PreviousEvaluation, Fault> {
        let a = Args { builtin: self, values };
        let args: Vec<Value> = (0..values.len()).map(|i| a.get(i).clone()).collect();
        match before {
            Some(b)
                if b.args.len() == args.len()
                    && b.args.iter().zip(&args).all(|(x, y)| x.same(y)) =>
            {
                Ok(PreviousEvaluation { args, value: b.value.clone(), state: Arc::clone(&b.state) })
            }
            _ => call(&a, before).map(|(value, state)| PreviousEvaluation { args, value, state }),
        }
    }
}

fn no_such(a: &Args) -> Fault {
    Fault::type_error(format!("`{}` cannot be called here", a.builtin.full_name()))
}

fn call_host(a: &Args) -> Result<Value, Fault> {
    match &a.builtin.host {
        Some(HostItem::Function { call, .. } | HostItem::Likelihood(call)) => call(a),
        Some(HostItem::Incremental { call, .. }) => call(a, None).map(|(value, _)| value),
        _ => Err(no_such(a)),
    }
}

fn make_host_dist(a: &Args) -> Result<Dist, Fault> {
    match &a.builtin.host {
        Some(HostItem::Family(make)) => make(a),
        _ => Err(no_such(a)),
    }
}

fn vjp_host(a: &Args, value: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    match &a.builtin.host {
        Some(HostItem::Function { vjp, .. } | HostItem::Incremental { vjp, .. }) => {
            vjp.as_ref()?(a, value, by).map(ArgAdjoints::from_vec)
        }
        // The gradient of a likelihood is already a list of the adjoints of its
        // arguments.
        Some(HostItem::Likelihood(_)) => Some((0..a.values.len()).map(|i| by.element(i)).collect()),
        _ => None,
    }
}
