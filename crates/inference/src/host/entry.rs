//! One item that a host registers.

use super::Previous;
use super::checked::Checked;
use crate::calls::build::KernelMaker;
use crate::calls::call::Call;
use crate::calls::host_kernel::build_host_kernel;
use crate::{Kernel, KernelCall};
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::builtins::data::{self, DataFormat};
use pcadlang_engine::lang::builtins::{
    Args, Argument, Builtin, Derivative, Domain, HostItem, Kind, PreviousEvaluation, Row, State,
    Type,
};
use pcadlang_engine::lang::error::Fault;
use pcadlang_engine::lang::value::{Likelihood, Value};
use pcadlang_numerics::dist::{Dist, Distribution, Drawn};
use pcadlang_syntax::{is_keyword, is_name};
use std::borrow::Cow;
use std::sync::Arc;

/// One item that a host registers: a function, a family of distributions or likelihoods,
/// or a kernel. Arguments are declared in order.
///
/// Closures are called from several threads at once, and must return bit-identical
/// results for the same arguments.
#[derive(Clone)]
pub struct Entry {
    pub(super) builtin: Builtin,
    pub(super) replaces: bool,
    /// A mistake in its declaration, reported by `Host::table`.
    pub(super) wrong: Option<String>,
}

impl Entry {
    fn new(
        name: impl Into<Cow<'static, str>>,
        section: &'static str,
        returns: Type,
        host: HostItem,
    ) -> Entry {
        let (kind, derivative) = host.entry();
        let mut entry = Entry::bare(name, section, returns, kind);
        (entry.builtin.derivative, entry.builtin.host) = (derivative, Some(host));
        entry
    }

    /// An entry without arguments, with nothing of the host's behind it yet.
    fn bare(
        name: impl Into<Cow<'static, str>>,
        section: &'static str,
        returns: Type,
        kind: Kind,
    ) -> Entry {
        let builtin = Builtin {
            name: name.into(),
            module: "".into(),
            section: section.into(),
            args: [].into(),
            variadic: false,
            returns,
            doc: "Of the host.".into(),
            kind,
            scalar: None,
            drawn: Drawn::Unknown,
            derivative: Derivative::Unknown,
            host: None,
            format: None,
            example: None,
        };
        Entry { builtin, replaces: false, wrong: None }
    }

    /// Creates a function.
    pub fn function(
        name: impl Into<Cow<'static, str>>,
        call: impl Fn(&Args) -> Result<Value, Fault> + Send + Sync + 'static,
    ) -> Entry {
        Entry::new(name, HOST, Type::Any, HostItem::Function { call: Arc::new(call), vjp: None })
    }

    /// Creates a function that can resume from an earlier evaluation, and that returns
    /// the state to resume from next time.
    ///
    /// The result must equal that from scratch (`None`), bit for bit: an earlier
    /// evaluation only saves work. The state belongs to a call site in the program and to
    /// a state of the trace: a rejected proposal restores the previous one, and forks of
    /// a trace share it. It is never modified in place, so a large state should share its
    /// unchanged parts.
    pub fn incremental<S: Send + Sync + 'static>(
        name: impl Into<Cow<'static, str>>,
        call: impl Fn(&Args, Option<Previous<'_, S>>) -> Result<(Value, S), Fault>
        + Send
        + Sync
        + 'static,
    ) -> Entry {
        let call = move |a: &Args, before: Option<&PreviousEvaluation>| {
            let previous = before.and_then(Previous::new);
            call(a, previous).map(|(value, state)| (value, Arc::new(state) as State))
        };
        Entry::new(name, HOST, Type::Any, HostItem::Incremental { call: Arc::new(call), vjp: None })
    }

    /// Creates a family of distributions; `make` maps the parameters to a distribution. A
    /// parameter outside its domain is a [`Fault::domain`].
    ///
    /// A value whose log density is NaN counts as impossible.
    /// [`Gradient::params`](crate::host::Gradient) has one derivative for each number in
    /// the arguments, in order.
    pub fn distribution<D: Distribution + 'static>(
        name: impl Into<Cow<'static, str>>,
        make: impl Fn(&Args) -> Result<D, Fault> + Send + Sync + 'static,
    ) -> Entry {
        let make = move |a: &Args| make(a).map(|d| Dist::Custom(Arc::new(Checked(d))));
        Entry::new(name, "Distributions", Type::Dist, HostItem::Family(Arc::new(make)))
    }

    /// Creates a family of likelihoods; `make` maps the arguments to a likelihood, which
    /// scores the observed value. A comparator is a likelihood with a view as an argument
    /// (see `SceneView` of the module `scene`).
    ///
    /// [`Likelihood::gradient`] is a list: the adjoint of each argument in turn.
    pub fn likelihood<L: Likelihood + 'static>(
        name: impl Into<Cow<'static, str>>,
        make: impl Fn(&Args) -> Result<L, Fault> + Send + Sync + 'static,
    ) -> Entry {
        let make = move |a: &Args| make(a).map(|l| Value::Likelihood(Arc::new(l)));
        Entry::new(name, "Comparing", Type::Likelihood, HostItem::Likelihood(Arc::new(make)))
    }

    /// A kind of data files: what may stand after the colon of `data d: kind;`. Its first
    /// argument is the file; further ones are options of the format.
    pub fn data(
        name: impl Into<Cow<'static, str>>,
        returns: Type,
        format: Arc<dyn DataFormat>,
    ) -> Entry {
        let kind = Kind::Function(data::not_an_expression);
        let mut entry = Entry::bare(name, data::SECTION, returns, kind);
        entry.builtin.format = Some(format);
        entry.argument("file", Type::Str, "The path, relative to the program's folder.")
    }

    /// Creates a kernel for `infer` blocks; `make` maps the call as written to a kernel.
    /// Each chain makes its own.
    pub fn kernel<K: Kernel + 'static>(
        name: impl Into<Cow<'static, str>>,
        make: impl Fn(&mut KernelCall) -> Result<K, Fault> + Send + Sync + 'static,
    ) -> Entry {
        let make = Box::new(move |call: &mut Call| build_host_kernel(call, &make));
        let maker = KernelMaker { make, check: None };
        Entry::new(name, "Kernels", Type::Kernel, HostItem::Kernel(Arc::new(maker)))
    }

    /// Appends a required argument.
    #[must_use]
    pub fn argument(
        self,
        name: impl Into<Cow<'static, str>>,
        ty: Type,
        about: impl Into<Cow<'static, str>>,
    ) -> Entry {
        let (name, doc) = (name.into(), about.into());
        self.push(Argument {
            name,
            ty,
            unit: "".into(),
            domain: Domain::Any,
            default: None,
            value: Value::Unit,
            doc,
        })
    }

    /// Appends an optional argument with its default.
    #[must_use]
    pub fn optional(
        self,
        name: impl Into<Cow<'static, str>>,
        ty: Type,
        default: impl Into<Value>,
        about: impl Into<Cow<'static, str>>,
    ) -> Entry {
        let (name, doc, value) = (name.into(), about.into(), default.into());
        self.push(Argument {
            name,
            ty,
            domain: Domain::Any,
            unit: "".into(),
            default: Some(value.to_string().into()),
            value,
            doc,
        })
    }

    /// Sets the unit of the argument declared last.
    #[must_use]
    pub fn unit(self, unit: impl Into<Cow<'static, str>>) -> Entry {
        self.of_last("a unit", |a| a.unit = unit.into())
    }

    /// Restricts the values of the argument declared last: [`Args`] reads no others.
    #[must_use]
    pub fn within(self, domain: Domain) -> Entry {
        self.of_last("a domain", |a| a.domain = domain)
    }

    fn of_last(mut self, what: &str, set: impl FnOnce(&mut Argument)) -> Entry {
        let mut args = self.builtin.args.to_vec();
        match args.last_mut() {
            Some(a) => set(a),
            None => self.wrong = Some(format!("{what} must belong to an argument")),
        }
        self.builtin.args = args.into();
        self
    }

    /// Sets the type of the result, for static checks and `doc`.
    #[must_use]
    pub fn returns(mut self, ty: Type) -> Entry {
        self.builtin.returns = ty;
        self
    }

    /// Sets the one-line description.
    #[must_use]
    pub fn about(mut self, line: impl Into<Cow<'static, str>>) -> Entry {
        self.builtin.doc = line.into();
        self
    }

    /// Sets the heading of its section in the reference.
    #[must_use]
    pub fn section(mut self, heading: impl Into<Cow<'static, str>>) -> Entry {
        self.builtin.section = heading.into();
        self
    }

    /// Sets the vector-Jacobian product of a function: it maps the arguments, the result
    /// and the adjoint of the result to the adjoints of the arguments, in order; `None`
    /// where they are unknown. Omitted trailing adjoints are zero.
    #[must_use]
    pub fn gradient(
        mut self,
        product: impl Fn(&Args, &Value, &Adjoint) -> Option<Vec<Adjoint>> + Send + Sync + 'static,
    ) -> Entry {
        match &mut self.builtin.host {
            Some(HostItem::Function { vjp, .. } | HostItem::Incremental { vjp, .. }) => {
                *vjp = Some(Arc::new(product))
            }
            _ => self.wrong = Some(
                "only functions take a gradient; distributions and likelihoods define their own"
                    .into(),
            ),
        }
        if let Some(f) = &self.builtin.host {
            self.builtin.derivative = f.entry().1;
        }
        self
    }

    /// Declares that the derivative is zero wherever it exists, as for counting,
    /// comparing and rounding.
    #[must_use]
    pub fn flat(mut self) -> Entry {
        match &self.builtin.host {
            Some(HostItem::Function { .. } | HostItem::Incremental { .. }) => {
                self.builtin.derivative = Derivative::Zero
            }
            _ => self.wrong = Some("only functions can be flat".into()),
        }
        self
    }

    /// An example of its use, for `doc`: an expression with its value behind `//`, or a
    /// program.
    #[must_use]
    pub fn example(mut self, text: impl Into<Cow<'static, str>>) -> Entry {
        self.builtin.example = Some(text.into());
        self
    }

    /// It takes the place of the language's own of that name.
    #[must_use]
    pub fn replacing(mut self) -> Entry {
        self.replaces = true;
        self
    }

    fn push(mut self, argument: Argument) -> Entry {
        self.builtin.args = self.builtin.args.iter().cloned().chain([argument]).collect();
        self
    }

    /// Returns the mistakes in the declaration of the arguments.
    pub(super) fn check_arguments(&self) -> Vec<String> {
        let (name, args) = (&self.builtin.name, &self.builtin.args);
        let mut wrong = Vec::new();
        for (i, a) in args.iter().enumerate() {
            let (own, before) = (&a.name, &args[..i]);
            if !is_name(own) || is_keyword(own) {
                wrong.push(format!("`{own}`, an argument of `{name}`, is not a valid name"));
            }
            if before.iter().any(|b| b.name == *own) {
                wrong.push(format!("`{name}` has two arguments `{own}`"));
            }
            if a.default.is_none() && before.iter().any(|b| b.default.is_some()) {
                wrong.push(format!(
                    "`{name}`: the required argument `{own}` must come before the optional ones"
                ));
            }
        }
        wrong
    }
}

/// A built-in of plain functions, which capture nothing.
impl From<&Row> for Entry {
    fn from(row: &Row) -> Entry {
        Entry { builtin: row.into(), replaces: false, wrong: None }
    }
}

const HOST: &str = "Of the host";
