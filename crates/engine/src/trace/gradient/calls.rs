//! Vector-Jacobian products of calls of built-ins: direct calls, calls of function
//! values, and maps over elements.

use super::Reverse;
use crate::lang::adjoint::Adjoint;
use crate::lang::builtins::{ArgAdjoints, Args, Builtin, Kind};
use crate::lang::code::{Callee, Op, Operand};
use crate::lang::value::Value;
use crate::trace::node::*;
use crate::trace::update::Failure;
use smallvec::SmallVec;

impl Reverse<'_> {
    /// Propagates an adjoint through a direct call.
    pub(super) fn vjp_builtin(
        &mut self,
        n: NodeId,
        builtin: &Builtin,
        args: &[Operand],
        by: &Adjoint,
    ) -> Result<(), Failure> {
        let values = self.values(self.graph[n].frame, args);
        let a = Args { builtin, values: &values };
        let operand = |i: usize| args.get(i).copied();
        let argument_adjoints = self.by_call(n, &a, &self.graph[n].value, by, operand)?;
        self.give_arguments(n, builtin, args.iter().map(|o| Some(*o)), argument_adjoints)
    }

    /// Propagates an adjoint through a call of a built-in function value; false if the
    /// node is not such a call.
    pub(super) fn vjp_called(&mut self, n: NodeId, by: &Adjoint) -> Result<bool, Failure> {
        let g = self.graph;
        let frame = g[n].frame;
        let Op::Call { callee: Callee::Value(f), args, .. } = g.op(n) else {
            return Ok(false);
        };
        let Value::Builtin(i) = g.value(frame, *f) else { return Ok(false) };
        let builtin = self.graph.code.builtins.get(*i);
        // The names were matched before, when it was called.
        let Ok(order) = builtin.match_names(args.iter().map(|(k, _)| k.as_deref())) else {
            return Ok(false);
        };
        let operands: SmallVec<[Option<Operand>; 8]> =
            order.iter().map(|i| i.and_then(|i| args.get(i)).map(|a| a.1)).collect();
        let mut deps = Deps::new();
        let value = |o: &Option<Operand>| o.map_or(&Value::Unit, |o| g.plain(frame, o, &mut deps));
        let values: SmallVec<[&Value; 8]> = operands.iter().map(value).collect();
        let operand = |i: usize| operands.get(i).copied().flatten();
        let argument_adjoints =
            self.by_call(n, &Args { builtin, values: &values }, &g[n].value, by, operand)?;
        self.give_arguments(n, builtin, operands, argument_adjoints)?;
        Ok(true)
    }

    /// Propagates an adjoint through a built-in applied to each element.
    pub(super) fn vjp_mapped(&mut self, n: NodeId, by: &Adjoint) -> Result<(), Failure> {
        let g = self.graph;
        let frame = g[n].frame;
        let Op::Map { f, over, .. } = g.op(n) else { return Ok(()) };
        let Value::Builtin(i) = g.value(frame, *f) else {
            return Err(self.no_derivative(n, "the result of this map"));
        };
        let builtin = self.graph.code.builtins.get(*i);
        let (xs, ys) = (g.plain(frame, *over, &mut Deps::new()), &g[n].value);
        let mut whole = Adjoint::Zero;
        for i in 0..xs.len().unwrap_or(0) {
            let (x, y, by) = match (xs, ys) {
                (Value::Record(x), Value::Record(y)) => match (x.get_index(i), y.get_index(i)) {
                    (Some((_, x)), Some((name, y))) => (x.clone(), y.clone(), by.field(name)),
                    _ => continue,
                },
                _ => (
                    xs.element(i).unwrap_or_default(),
                    ys.element(i).unwrap_or_default(),
                    by.element(i),
                ),
            };
            if by.is_zero() {
                continue;
            }
            let argument_adjoints =
                self.by_call(n, &Args { builtin, values: &[&x] }, &y, &by, |_| None)?;
            whole.add_position(xs, i, argument_adjoints.into_iter().next().unwrap_or_default());
        }
        self.give(frame, *over, whole);
        Ok(())
    }

    /// Returns the adjoints of a call's arguments, which come from these operands.
    fn by_call(
        &self,
        n: NodeId,
        a: &Args,
        value: &Value,
        by: &Adjoint,
        operand: impl Fn(usize) -> Option<Operand>,
    ) -> Result<ArgAdjoints, Failure> {
        let unknown = || self.no_derivative(n, &format!("`{}`", a.builtin.full_name()));
        match (a.builtin.kind, a.builtin.derivative, value) {
            (Kind::Distribution(_), _, Value::Dist(d)) => {
                let frame = self.graph[n].frame;
                let source = |i: usize| operand(i).and_then(|o| self.source(frame, o));
                self.by_distribution(n, a, d, by, |i| source(i).is_some_and(|s| self.is_active(s)))
            }
            (_, derivative, value) => derivative.vjp(a, value, by).ok_or_else(unknown),
        }
    }

    /// Adds the adjoints of a call's arguments to the nodes they come from.
    pub(super) fn give_arguments(
        &mut self,
        n: NodeId,
        builtin: &Builtin,
        args: impl IntoIterator<Item = Option<Operand>>,
        argument_adjoints: impl IntoIterator<Item = Adjoint>,
    ) -> Result<(), Failure> {
        let frame = self.graph[n].frame;
        for (i, (o, part)) in args.into_iter().zip(argument_adjoints).enumerate() {
            let Some(source) = o.and_then(|o| self.source(frame, o)) else { continue };
            if !self.is_active(source) {
                continue;
            }
            if part.is_unknown() {
                let name = builtin.args.get(i).or(builtin.args.last()).map_or("", |a| &*a.name);
                return Err(self.no_derivative(
                    n,
                    &format!("`{}`, as a function of its argument `{name}`,", builtin.full_name()),
                ));
            }
            self.give_node(source, part);
        }
        Ok(())
    }
}
