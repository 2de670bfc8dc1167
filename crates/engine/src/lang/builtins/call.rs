//! Calls of built-ins, those of hosts included.
//!
//! A host's part of a built-in is a closure with its captured state. The table has plain
//! functions for them, as for other built-ins ([`HostItem::entry`]); these find the
//! closure through the built-in in their [`Args`]. Callers need not know about hosts.

use super::builtin::{
    ArgAdjoints, Args, Builtin, Derivative, HostItem, Incremental, KernelTraits, Kind, PlanForm,
    PreviousEvaluation,
};
use crate::lang::adjoint::Adjoint;
use crate::lang::fault::Fault;
use crate::lang::value::{MOST_ELEMENTS, MOST_NESTED, Value};
use pcadlang_numerics::dist::Dist;
use std::sync::Arc;

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
            HostItem::Kernel(_) => {
                (Kind::Plan(PlanForm::Kernel(KernelTraits::default())), Derivative::Unknown)
            }
        }
    }
}

impl Builtin {
    /// Calls it with one value per argument.
    ///
    /// # Errors
    /// If the arguments are invalid, or it is a form or a name for inference.
    pub fn apply(&self, values: &[&Value]) -> Result<Value, Fault> {
        let args = Args { builtin: self, values };
        match self.kind {
            Kind::Function(f) => f(&args),
            Kind::Distribution(_) => self.distribution(values).map(|d| Value::Dist(Arc::new(d))),
            Kind::Form(_) | Kind::Plan(_) => Err(Fault::type_error(format!(
                "`{}` cannot be used as a function value",
                self.name
            ))),
        }
    }

    /// Makes a distribution of this family from values.
    ///
    /// # Errors
    /// If the arguments are invalid, or the distribution has too many parts or is nested
    /// too deeply.
    pub(crate) fn distribution(&self, values: &[&Value]) -> Result<Dist, Fault> {
        let args = Args { builtin: self, values };
        let Kind::Distribution(make) = self.kind else {
            return Err(Fault::type_error(format!("`{}` is not a distribution", self.name)));
        };
        let d = make(&args)?;
        match d.parts(MOST_NESTED, MOST_ELEMENTS) {
            Some(n) if n <= MOST_ELEMENTS => Ok(d),
            Some(_) => Err(args.too_large("parts", MOST_ELEMENTS)),
            None => Err(args.too_large("nested distributions", MOST_NESTED as usize)),
        }
    }

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

pub(super) fn call_host(a: &Args) -> Result<Value, Fault> {
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
