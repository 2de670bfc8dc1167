//! What a host stands behind a built-in: closures, with what they have captured.
//!
//! The entry of the table has plain functions as any other ([`Foreign::entry`]); they
//! find the closures at the built-in that their arguments name. So nothing that calls
//! built-ins needs to know of hosts.

use super::{Args, Builtin, Derivative, Kind, Pulled};
use crate::dist::Dist;
use crate::lang::adjoint::Adjoint;
use crate::lang::error::Fault;
use crate::lang::value::Value;
use std::any::Any;
use std::fmt;
use std::sync::Arc;

/// What a function keeps between evaluations.
pub type State = Arc<dyn Any + Send + Sync>;

type Function = dyn Fn(&Args) -> Result<Value, Fault> + Send + Sync;
type Incremental = dyn Fn(&Args, Option<&Before>) -> Result<(Value, State), Fault> + Send + Sync;
type Make = dyn Fn(&Args) -> Result<Dist, Fault> + Send + Sync;
type Product = dyn Fn(&Args, &Value, &Adjoint) -> Option<Vec<Adjoint>> + Send + Sync;

/// An evaluation that a later one may start from. It is kept with what it is the value of
/// (a node of a trace, an operation of a tape) and never changed: whatever goes back to
/// an earlier state has that state's.
pub struct Before {
    /// The arguments.
    pub args: Vec<Value>,
    /// The result.
    pub value: Value,
    /// What the function kept.
    pub state: State,
}

impl fmt::Debug for Before {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Before")
            .field("args", &self.args)
            .field("value", &self.value)
            .finish_non_exhaustive()
    }
}

/// A host's part of a built-in.
#[derive(Clone)]
pub enum Foreign {
    /// A function.
    Function {
        /// The function.
        call: Arc<Function>,
        /// Its vector-Jacobian product.
        pull: Option<Arc<Product>>,
    },
    /// One that may start from an earlier evaluation.
    Incremental {
        /// The function.
        call: Arc<Incremental>,
        /// Its vector-Jacobian product.
        pull: Option<Arc<Product>>,
    },
    /// A family of distributions.
    Family(Arc<Make>),
    /// A family of likelihoods.
    Likelihood(Arc<Function>),
    /// What makes a kernel; inference knows its type.
    Kernel(State),
}

impl Foreign {
    /// What the entry of the table is.
    pub fn entry(&self) -> (Kind, Derivative) {
        let product = |pull: &Option<_>| match pull {
            Some(_) => Derivative::Product(pull_foreign),
            None => Derivative::Unknown,
        };
        match self {
            Foreign::Function { pull, .. } => (Kind::Function(call_foreign), product(pull)),
            Foreign::Incremental { pull, .. } => (Kind::Function(call_foreign), product(pull)),
            Foreign::Family(_) => (Kind::Distribution(make_foreign), Derivative::Unknown),
            Foreign::Likelihood(_) => {
                (Kind::Function(call_foreign), Derivative::Product(pull_foreign))
            }
            Foreign::Kernel(_) => (Kind::Inference, Derivative::Unknown),
        }
    }
}

impl Builtin {
    /// Calls an incremental function of a host, from an earlier evaluation if there is
    /// one; `None` for any other built-in.
    #[inline]
    pub(crate) fn resume(
        &self,
        values: &[&Value],
        before: Option<&Before>,
    ) -> Option<Result<Before, Fault>> {
        match &self.foreign {
            Some(Foreign::Incremental { call, .. }) => {
                Some(self.resume_with(&**call, values, before))
            }
            _ => None,
        }
    }

    fn resume_with(
        &self,
        call: &Incremental,
        values: &[&Value],
        before: Option<&Before>,
    ) -> Result<Before, Fault> {
        let a = Args { builtin: self, values };
        let args: Vec<Value> = (0..values.len()).map(|i| a.get(i).clone()).collect();
        match before {
            Some(b)
                if b.args.len() == args.len()
                    && b.args.iter().zip(&args).all(|(x, y)| x.same(y)) =>
            {
                Ok(Before { args, value: b.value.clone(), state: Arc::clone(&b.state) })
            }
            _ => call(&a, before).map(|(value, state)| Before { args, value, state }),
        }
    }
}

fn no_such(a: &Args) -> Fault {
    Fault::type_error(format!("`{}` cannot be called here", a.builtin.full_name()))
}

fn call_foreign(a: &Args) -> Result<Value, Fault> {
    match &a.builtin.foreign {
        Some(Foreign::Function { call, .. } | Foreign::Likelihood(call)) => call(a),
        Some(Foreign::Incremental { call, .. }) => call(a, None).map(|(value, _)| value),
        _ => Err(no_such(a)),
    }
}

fn make_foreign(a: &Args) -> Result<Dist, Fault> {
    match &a.builtin.foreign {
        Some(Foreign::Family(make)) => make(a),
        _ => Err(no_such(a)),
    }
}

fn pull_foreign(a: &Args, value: &Value, by: &Adjoint) -> Option<Pulled> {
    match &a.builtin.foreign {
        Some(Foreign::Function { pull, .. } | Foreign::Incremental { pull, .. }) => {
            pull.as_ref()?(a, value, by).map(Pulled::from_vec)
        }
        // Its gradient is by its arguments already.
        Some(Foreign::Likelihood(_)) => Some((0..a.values.len()).map(|i| by.element(i)).collect()),
        _ => None,
    }
}
