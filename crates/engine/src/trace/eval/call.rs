//! Parameters, calls, branches and `mem`.

use crate::lang::code::{Block, BlockKind, Callee, Op, Operand};
use crate::lang::key::Key;
use crate::lang::value::{Closure, Value};
use crate::trace::graph::Graph;
use crate::trace::journal::Entry;
use crate::trace::node::*;
use crate::trace::update::{Failure, Step};
use smallvec::SmallVec;
use std::sync::Arc;

/// Arguments as written: keyword and operand.
type WrittenArgs = [(Option<Arc<str>>, Operand)];

impl Graph {
    pub(super) fn evaluate_param(
        &mut self,
        n: NodeId,
        index: u16,
        default: Option<Operand>,
    ) -> Step {
        let frame = self.store[n].frame;
        if let Some((af, o)) = self.argument(n) {
            if let Some(m) = self.unready(af, o) {
                return self.need(m);
            }
            let v = self.value(af, o).clone();
            return Ok(self.finish(n, v));
        }
        match (&self.store[frame].args, index) {
            (Arguments::Values(vs), i) if (i as usize) < vs.len() => {
                let v = vs[i as usize].clone();
                Ok(self.finish(n, v))
            }
            (Arguments::Supplied(vs), i) if (i as usize) < vs.len() => {
                let v = vs[i as usize].clone()?;
                Ok(self.finish(n, v))
            }
            (Arguments::Item, 0) | (Arguments::Fold, 1) => self.evaluate_item(n),
            (Arguments::Fold, 0) => self.evaluate_accumulator(n),
            _ => match default {
                Some(o) => {
                    if let Some(m) = self.unready(frame, o) {
                        return self.need(m);
                    }
                    let v = self.value(frame, o).clone();
                    Ok(self.finish(n, v))
                }
                None => Err(self.type_error(n, "an argument is missing".into())),
            },
        }
    }

    pub(super) fn evaluate_if(
        &mut self,
        n: NodeId,
        cond: Operand,
        then: BlockId,
        otherwise: BlockId,
    ) -> Step {
        let frame = self.store[n].frame;
        if let Some(m) = self.unready(frame, cond) {
            return self.need(m);
        }
        let block = if self.holds(n, cond)? { then } else { otherwise };
        let keep = match self.store[n].side.as_deref() {
            Some(Side::Child(c)) => self.store[c.frame].block == block,
            _ => false,
        };
        if !keep {
            let here = &self.store[frame];
            let child = Frame {
                block,
                parent: frame,
                owner: n,
                path: here.path,
                depth: here.depth,
                ..Frame::default()
            };
            self.replace_child(n, child)?;
        }
        self.finish_child(n)
    }

    /// True if an evaluated condition holds.
    fn holds(&self, n: NodeId, cond: Operand) -> Result<bool, Failure> {
        match self.value(self.store[n].frame, cond) {
            Value::Bool(b) => Ok(*b),
            v => Err(self.type_error(n, format!("`if` needs a bool, got {}", v.type_name()))),
        }
    }

    pub(super) fn evaluate_select(
        &mut self,
        n: NodeId,
        cond: Operand,
        then: Operand,
        otherwise: Operand,
    ) -> Step {
        let frame = self.store[n].frame;
        if let Some(m) = self.unready(frame, cond) {
            return self.need(m);
        }
        let holds = self.holds(n, cond)?;
        let (chosen, other) = if holds { (then, otherwise) } else { (otherwise, then) };
        if let Some(m) = self.unready(frame, chosen) {
            return self.need(m);
        }
        let flags = self.store[n].flags;
        if holds != (flags & OTHERWISE == 0) {
            self.store[n].flags ^= OTHERWISE;
            if flags & HELD != 0 {
                let outside = |o| !matches!(o, Operand::Local(_));
                if let Some(d) = self.resolve(frame, chosen) {
                    self.acquire(d, n, outside(chosen));
                }
                if let Some(d) = self.resolve(frame, other) {
                    self.release(d, outside(other));
                }
            }
        }
        let value = self.value(frame, chosen).clone();
        Ok(self.finish(n, value))
    }

    pub(super) fn evaluate_call(
        &mut self,
        n: NodeId,
        callee: Callee,
        args: &WrittenArgs,
        site: SiteId,
    ) -> Step {
        let frame = self.store[n].frame;
        let closure = match callee {
            Callee::Static(block) => Closure { block, frame: FrameId::ROOT },
            Callee::Value(o) => {
                if let Some(m) = self.unready(frame, o) {
                    return self.need(m);
                }
                match self.value(frame, o) {
                    Value::Closure(c) => *c,
                    Value::Memo(r) => {
                        let memo = r.node;
                        return self.call_memo(n, memo, args);
                    }
                    Value::Builtin(i) => {
                        let i = *i;
                        return self.call_builtin(n, i, args);
                    }
                    v => {
                        let message =
                            format!("only functions can be called; this is {}", v.type_name());
                        return Err(self.type_error(n, message));
                    }
                }
            }
        };
        let keep = match self.store[n].side.as_deref() {
            Some(Side::Child(c)) => {
                let f = &self.store[c.frame];
                f.block == closure.block && f.parent == closure.frame
            }
            _ => false,
        };
        if !keep {
            let arguments = self.match_arguments(n, closure.block, args)?;
            let here = &self.store[frame];
            let child = Frame {
                block: closure.block,
                parent: closure.frame,
                owner: n,
                path: self.site_hash(frame, site),
                depth: here.depth + 1,
                args: arguments,
                ..Frame::default()
            };
            self.replace_child(n, child)?;
        }
        self.finish_child(n)
    }

    /// Detaches the old child frame and creates a new one, whose result is not held yet.
    fn replace_child(&mut self, n: NodeId, child: Frame) -> Result<(), Failure> {
        self.let_side_go(n);
        let frame = self.make_frame(child)?;
        self.set_side(n, Some(Side::Child(Child { frame, result: NodeId::NONE })));
        Ok(())
    }

    /// Takes the value of a call or branch from its child frame.
    fn finish_child(&mut self, n: NodeId) -> Step {
        match self.store[n].side.as_deref() {
            Some(Side::Child(Child { frame, .. })) => self.take_result(n, *frame),
            _ => Ok(self.finish(n, Value::Unit)),
        }
    }

    /// Takes the value of a node from the result of a frame.
    pub(super) fn take_result(&mut self, n: NodeId, from: FrameId) -> Step {
        match self.code.blocks[self.store[from].block].result {
            Some(result) => self.take_operand(n, from, result),
            None => Ok(self.finish(n, Value::Unit)),
        }
    }

    /// Takes the value of a node from an operand of a frame, which it holds as its result.
    pub(super) fn take_operand(&mut self, n: NodeId, from: FrameId, operand: Operand) -> Step {
        if let Some(m) = self.unready(from, operand) {
            return self.need(m);
        }
        let value = self.value(from, operand).clone();
        let new = self.resolve(from, operand).unwrap_or(NodeId::NONE);
        let Node { side, flags, .. } = &mut self.store[n];
        if let Some(old) = side.as_deref_mut().and_then(Side::result).map(|r| *r)
            && old != new
        {
            let mut side = side.as_deref().cloned();
            if *flags & HELD != 0 {
                if new != NodeId::NONE {
                    let owned =
                        matches!(side, Some(Side::Child(_))) && self.is_owned_result(new, n);
                    self.acquire(new, n, !owned);
                }
                if old != NodeId::NONE {
                    self.release(old, true);
                }
            }
            side.as_mut().and_then(Side::result).into_iter().for_each(|r| *r = new);
            self.set_side(n, side);
        }
        Ok(self.finish(n, value))
    }

    /// Matches arguments to parameters by position and name.
    fn match_arguments(
        &self,
        n: NodeId,
        block: BlockId,
        args: &WrittenArgs,
    ) -> Result<Arguments, Failure> {
        let BlockKind::Function { name, params, required } = &self.code.blocks[block].kind else {
            return Ok(Arguments::None);
        };
        match match_names(name, params, *required, args.iter().map(|(k, _)| k.as_deref())) {
            Ok(None) => Ok(Arguments::Positional(args.len() as u16)),
            Ok(Some(map)) => Ok(Arguments::Mapped(map)),
            Err(message) => Err(self.type_error(n, message)),
        }
    }

    fn call_builtin(&mut self, n: NodeId, builtin: u32, args: &WrittenArgs) -> Step {
        if !matches!(self.store[n].side.as_deref(), None | Some(Side::Deps(_) | Side::Kept(_))) {
            self.let_side_go(n);
        }
        let frame = self.store[n].frame;
        let order =
            self.code.builtins.get(builtin).match_names(args.iter().map(|(k, _)| k.as_deref()));
        let order = order.map_err(|message| self.type_error(n, message))?;
        let operands: SmallVec<[Operand; 8]> = args.iter().map(|(_, o)| *o).collect();
        if let Some(step) = self.await_plain(frame, &operands)? {
            return Ok(step);
        }
        let mut deps: Deps = operands.iter().filter_map(|o| self.resolve(frame, *o)).collect();
        let made = {
            let mut gathered = Deps::new();
            let values: SmallVec<[&Value; 8]> = order
                .iter()
                .map(|i| match i {
                    Some(i) => self.plain(frame, operands[*i], &mut gathered),
                    None => &Value::Unit,
                })
                .collect();
            deps.extend(gathered);
            self.apply_at(n, self.code.builtins.get(builtin), &values)
        };
        let made = made.map_err(|e| self.fault(n, e))?;
        self.finish_call(n, deps, made)
    }

    pub(super) fn evaluate_mem(&mut self, n: NodeId, f: Operand) -> Step {
        let frame = self.store[n].frame;
        if let Some(m) = self.unready(frame, f) {
            return self.need(m);
        }
        let closure = match self.value(frame, f) {
            Value::Closure(c) => *c,
            v => {
                let message =
                    format!("mem: needs a function defined in the program, got {}", v.type_name());
                return Err(self.type_error(n, message));
            }
        };
        if let (Some(Side::Memo(m)), Value::Memo(_)) =
            (self.store[n].side.as_deref(), &self.store[n].value)
            && (m.block, m.parent) == (closure.block, closure.frame)
        {
            return Ok(self.finish_unchanged(n));
        }
        self.drop_structure(n);
        let memo =
            Memo { block: closure.block, parent: closure.frame, entries: Default::default() };
        self.set_side(n, Some(Side::Memo(memo)));
        let made = self.store.new_version(n);
        Ok(self.finish(n, Value::Memo(made)))
    }

    /// Evaluates a call through `mem`: finds or creates the entry for its arguments.
    fn call_memo(&mut self, n: NodeId, memo: NodeId, args: &WrittenArgs) -> Step {
        let frame = self.store[n].frame;
        let operands: SmallVec<[Operand; 4]> = args.iter().map(|(_, o)| *o).collect();
        if let Some(step) = self.await_plain(frame, &operands)? {
            return Ok(step);
        }
        let mut deps: Deps = operands.iter().filter_map(|o| self.resolve(frame, *o)).collect();
        let mut gathered = Deps::new();
        let values: SmallVec<[Value; 4]> =
            operands.iter().map(|o| self.plain(frame, *o, &mut gathered).clone()).collect();
        deps.extend(gathered);
        let keys: Option<Vec<Key>> = values.iter().map(Key::from_value).collect();
        let Some(keys) = keys else {
            let message = "the arguments of a `mem` function must be numbers, strings, bools, or arrays of them";
            return Err(self.type_error(n, message.into()));
        };
        let key = if keys.len() == 1 { keys[0].clone() } else { Key::List(keys.into()) };
        let same = match self.store[n].side.as_deref() {
            Some(Side::MemoCall(c)) => c.memo == memo && c.key == key,
            _ => false,
        };
        if !same {
            let entry = self.enter_memo(n, memo, &key, &values, args)?;
            self.let_side_go(n);
            if self.store[n].flags & HELD != 0 {
                deps.iter().for_each(|d| self.acquire(*d, n, true));
            }
            self.set_side(
                n,
                Some(Side::MemoCall(MemoCall { memo, key, result: NodeId::NONE, deps })),
            );
            debug_assert!(self.store[entry].attached);
        }
        self.finish_memo(n)
    }

    fn finish_memo(&mut self, n: NodeId) -> Step {
        let side = |n: NodeId| self.store[n].side.as_deref();
        let Some(Side::MemoCall(call)) = side(n) else {
            return Ok(self.finish(n, Value::Unit));
        };
        match side(call.memo) {
            Some(Side::Memo(m)) if m.entries.contains_key(&call.key) => {
                let entry = m.entries[&call.key].0;
                self.take_result(n, entry)
            }
            _ => Ok(self.finish(n, Value::Unit)),
        }
    }

    /// Adds a call to an entry, which is created if it is new.
    fn enter_memo(
        &mut self,
        n: NodeId,
        memo: NodeId,
        key: &Key,
        values: &[Value],
        args: &WrittenArgs,
    ) -> Result<FrameId, Failure> {
        let Some(Side::Memo(m)) = self.store[memo].side.as_deref() else {
            return Err(self.type_error(n, "this `mem` function no longer exists".into()));
        };
        let (block, parent) = (m.block, m.parent);
        let old = m.entries.get(key).copied();
        let new = match old {
            Some((frame, calls)) => (frame, calls + 1),
            None => {
                match self.match_arguments(n, block, args)? {
                    Arguments::Positional(_) => {}
                    _ => {
                        let message = "give the arguments of a `mem` function by position".into();
                        return Err(self.type_error(n, message));
                    }
                }
                let Op::Mem { site, .. } = self.op(memo) else {
                    return Err(self.type_error(n, "not a `mem` function".into()));
                };
                let home = self.store[memo].frame;
                // The values that the key stands for: calls with 0 and -0 share one
                // entry, and the result must not depend on which came first.
                let values: Arc<[Value]> = match key {
                    Key::List(keys) if values.len() != 1 => {
                        keys.iter().map(Key::to_value).collect()
                    }
                    key => [key.to_value()].into(),
                };
                let frame = Frame {
                    block,
                    parent,
                    owner: memo,
                    path: self.keyed_site_hash(home, *site, key),
                    depth: self.store[self.store[n].frame].depth + 1,
                    key: Some(key.clone()),
                    args: Arguments::Values(values),
                    ..Frame::default()
                };
                (self.make_frame(frame)?, 1)
            }
        };
        if let Some(Side::Memo(m)) = self.store[memo].side.as_deref_mut() {
            m.entries.insert(key.clone(), new);
        }
        self.update.note(Entry::Memo(memo, key.clone(), old));
        Ok(new.0)
    }

    /// Removes a call from an entry; an entry without calls is dropped at the end of the
    /// update.
    pub(crate) fn leave_memo(&mut self, memo: NodeId, key: &Key) {
        let Some(Side::Memo(m)) = self.store[memo].side.as_deref_mut() else { return };
        let Some(entry) = m.entries.get_mut(key) else { return };
        let old = *entry;
        entry.1 -= 1;
        if entry.1 == 0 {
            self.update.idle.push((memo, key.clone()));
        }
        self.update.note(Entry::Memo(memo, key.clone(), Some(old)));
    }

    /// Drops an entry that still has no calls.
    pub(crate) fn drop_idle(&mut self, memo: NodeId, key: &Key) {
        let Some(Side::Memo(m)) = self.store[memo].side.as_deref_mut() else { return };
        let Some(&(frame, 0)) = m.entries.get(key) else { return };
        m.entries.remove(key);
        self.update.note(Entry::Memo(memo, key.clone(), Some((frame, 0))));
        self.detach(frame);
    }
}

/// Returns the argument that each parameter takes; `None` if that is the written order,
/// without gaps.
///
/// # Errors
/// A message for the user if there are too many or too few arguments, one is given twice,
/// or a keyword is unknown.
pub(crate) fn match_names<'a>(
    name: &str,
    params: &[Arc<str>],
    required: usize,
    args: impl Iterator<Item = Option<&'a str>>,
) -> Result<Option<Box<[Option<u16>]>>, String> {
    let mut map: Box<[Option<u16>]> = vec![None; params.len()].into();
    let mut in_order = true;
    for (i, keyword) in args.enumerate() {
        let p = match keyword {
            None if i < params.len() => i,
            None => {
                return Err(format!(
                    "`{name}` takes {}, got more",
                    count(params.len(), "argument")
                ));
            }
            Some(k) => params.iter().position(|p| **p == *k).ok_or_else(|| {
                let near = pcadlang_syntax::diag::nearest(k, params.iter().map(|p| &**p));
                let hint = near.map(|n| format!("; did you mean `{n}`?")).unwrap_or_default();
                format!("`{name}` has no parameter `{k}`{hint}")
            })?,
        };
        in_order &= p == i;
        if map[p].replace(i as u16).is_some() {
            return Err(format!("`{name}` got its argument `{}` twice", params[p]));
        }
    }
    if let Some(p) = map[..required].iter().position(Option::is_none) {
        return Err(format!("`{name}` needs its argument `{}`", params[p]));
    }
    Ok(if in_order { None } else { Some(map) })
}

/// "1 argument", "2 arguments".
pub(crate) fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

impl Block {
    /// Returns the name, parameters and number of required parameters, for functions.
    pub fn signature(&self) -> Option<(&str, &[Arc<str>], usize)> {
        match &self.kind {
            BlockKind::Function { name, params, required } => Some((name, params, *required)),
            _ => None,
        }
    }
}
