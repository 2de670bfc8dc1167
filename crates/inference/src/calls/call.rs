//! The arguments of a call of a kernel, evaluated as they are asked for.

use crate::calls::build::{Built, Setting, build};
use crate::calls::error::fail;
use crate::calls::formula::{PlanEnv, evaluate};
use crate::calls::selection::{scope, selector};
use crate::kernel::{Kernel, SiteSelection};
use pcadlang_engine::lang::builtins::{Builtin, Which};
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::plan::{Argument, KernelCall};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Selector;
use pcadlang_syntax::span::Span;

/// A call of a kernel in a plan; its arguments are known by their places.
pub(crate) struct Call<'a, 'e> {
    pub call: &'a KernelCall,
    pub builtin: &'a Builtin,
    pub setting: Setting<'a>,
    pub env: &'a mut PlanEnv<'e>,
}

impl<'a> Call<'a, '_> {
    pub fn span(&self) -> Span {
        self.call.span
    }

    /// The choices that the program froze.
    pub fn frozen(&self) -> Selector {
        self.setting.frozen.clone()
    }

    pub fn not_a_kernel(&self) -> Box<RunError> {
        fail(self.call.span, format!("`{}` is not a kernel", self.builtin.name))
    }

    fn place(&self, which: impl Which) -> usize {
        which.position(&self.builtin.args)
    }

    /// The kernel that this one applies.
    pub fn inner(&mut self) -> Result<Built, Box<RunError>> {
        match self.call.args.first() {
            Some(Argument::Kernel(call)) => build(call, self.setting, self.env),
            _ => Err(self.not_a_kernel()),
        }
    }

    /// Makes a kernel that moves the choices of the first argument. Calls with the same
    /// text, choices and values share one.
    pub fn moving<K: Kernel + 'static>(
        &mut self,
        make: impl FnOnce(SiteSelection, &mut Self) -> Result<K, Box<RunError>>,
    ) -> Result<Built, Box<RunError>> {
        let scope = self.scope(0)?.ok_or_else(|| self.not_a_kernel())?;
        let value = |arg: &Argument| match arg {
            Argument::Value(f) => evaluate(f, self.env).ok(),
            _ => None,
        };
        let given: Vec<Value> = self.call.args.iter().filter_map(value).collect();
        let signature = format!("{} {scope:?} {given:?}", self.call.text);
        Ok(Built::new(make(scope, self)?, signature))
    }

    /// The choices that an argument selects, without frozen ones.
    pub fn scope(&mut self, which: impl Which) -> Result<Option<SiteSelection>, Box<RunError>> {
        let Some(Argument::Choices(c)) = self.call.args.get(self.place(which)) else {
            return Ok(None);
        };
        let SiteSelection { selector, pick } = scope(c, self.env)?;
        let selector = match self.setting.frozen {
            Selector::Nothing => selector,
            frozen => Selector::Minus(Box::new(selector), Box::new(frozen.clone())),
        };
        Ok(Some(SiteSelection { selector, pick }))
    }

    /// The finite choices that a kernel sums out; none unless given.
    pub fn marginal(&mut self) -> Result<Selector, Box<RunError>> {
        Ok(self.scope("marginal")?.map_or(Selector::Nothing, |s| s.selector))
    }

    /// The observations that surrogates replace; none unless given.
    pub fn selector(&mut self, which: impl Which) -> Result<Selector, Box<RunError>> {
        match self.call.args.get(self.place(which)) {
            Some(Argument::Choices(c)) => selector(&c.selection, self.env),
            _ => Ok(Selector::Nothing),
        }
    }

    /// The value of an argument, or its default, and where it is written.
    pub fn value(&mut self, which: impl Which) -> Result<(Value, Span), Box<RunError>> {
        let place = self.place(which);
        match self.call.args.get(place) {
            Some(Argument::Value(f)) => Ok((evaluate(f, self.env)?, f.span)),
            _ => Ok((self.builtin.args[place].value.clone(), self.call.span)),
        }
    }

    /// A positive number; `None` if it is left to the kernel.
    pub fn positive_if_given(&mut self, name: &str) -> Result<Option<f64>, Box<RunError>> {
        match self.value(name)? {
            (Value::Unit, _) => Ok(None),
            (Value::Num(x), _) if x > 0.0 => Ok(Some(x)),
            (v, span) => {
                let kernel = &self.builtin.name;
                Err(fail(span, format!("{kernel}: `{name}` must be positive, got {v}")))
            }
        }
    }

    /// A truth value.
    pub fn truth(&mut self, name: &str) -> Result<bool, Box<RunError>> {
        match self.value(name)? {
            (Value::Bool(b), _) => Ok(b),
            (v, span) => Err(fail(span, format!("`{name}` must be true or false, got {v}"))),
        }
    }

    /// A whole number within the declared bounds.
    pub fn whole(&mut self, name: &str) -> Result<u32, Box<RunError>> {
        let domain = self.builtin.args[self.place(name)].domain;
        match self.value(name)? {
            (Value::Num(x), _) if domain.holds(x) => Ok(x as u32),
            (v, span) => Err(fail(span, format!("`{name}` must be {domain}, got {v}"))),
        }
    }
}
