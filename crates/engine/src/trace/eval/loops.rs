//! `for`, `map` and `fold`: one frame per pass, created on demand.

use crate::lang::code::{BlockKind, Op, Operand};
use crate::lang::error::{Fault, FaultKind};
use crate::lang::key::Key;
use crate::lang::value::Value;
use crate::trace::graph::Graph;
use crate::trace::journal::Entry;
use crate::trace::node::*;
use crate::trace::update::{Failure, Step};
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use std::sync::Arc;

impl Graph {
    /// Evaluates the element of a pass.
    pub(super) fn evaluate_item(&mut self, n: NodeId) -> Step {
        let frame = &self.store[self.store[n].frame];
        let (owner, pass) = (frame.owner, frame.pass as usize);
        if self.store[owner].state == State::Stale {
            return self.need(owner);
        }
        let value = self.loop_of(owner).and_then(|l| l.items.element(pass)).unwrap_or_default();
        Ok(self.finish(n, value))
    }

    /// Evaluates the running value of a `fold` before a pass.
    pub(super) fn evaluate_accumulator(&mut self, n: NodeId) -> Step {
        let frame = &self.store[self.store[n].frame];
        let (owner, pass) = (frame.owner, frame.pass as usize);
        let home = self.store[owner].frame;
        let (from, operand) = if pass == 0 {
            let Op::Fold { init, .. } = self.op(owner) else {
                return Ok(self.finish(n, Value::Unit));
            };
            (home, *init)
        } else {
            let previous = self.pass_frame(owner, pass - 1)?;
            match self.code.blocks[self.store[previous].block].result {
                Some(r) => (previous, r),
                None => return Ok(self.finish(n, Value::Unit)),
            }
        };
        if let Some(m) = self.unready(from, operand) {
            return self.need(m);
        }
        let value = self.value(from, operand).clone();
        self.set_deps(n, self.resolve(from, operand).into_iter().collect());
        Ok(self.finish(n, value))
    }

    pub(super) fn evaluate_for(&mut self, n: NodeId, iter: Operand, body: BlockId) -> Step {
        let frame = self.store[n].frame;
        if let Some(step) = self.await_plain(frame, &[iter])? {
            return Ok(step);
        }
        let mut deps = Deps::new();
        let over = self.plain(frame, iter, &mut deps);
        let (items, keys) = match over {
            Value::Record(r) => {
                let names: Vec<Value> = r.keys().map(|k| Value::Str(Arc::clone(k))).collect();
                let items = Value::List(names.into());
                let keys = for_keys(&items);
                (items, keys)
            }
            v @ (Value::Array(_) | Value::List(_)) => (v.clone(), for_keys(v)),
            v => {
                let message = format!(
                    "`for` iterates over an array, a range or a record, not over {}",
                    v.type_name()
                );
                return Err(self.type_error(n, message));
            }
        };
        let keys = keys.map_err(|e| self.fault(n, e))?;
        self.set_loop(n, keys, items, body, frame, deps)?;
        if self.slot_facts(n).is_effect {
            self.make_all_passes(n)?;
        }
        Ok(self.finish_unchanged(n))
    }

    pub(super) fn evaluate_map(&mut self, n: NodeId, f: Operand, over: Operand) -> Step {
        let frame = self.store[n].frame;
        if let Some(step) = self.await_plain(frame, &[f, over])? {
            return Ok(step);
        }
        let mut deps = Deps::new();
        let xs = self.plain(frame, over, &mut deps);
        let (items, keys) = match map_keys(xs) {
            Ok(pair) => pair,
            Err(e) => return Err(self.fault(n, e)),
        };
        let (block, parent) = match self.value(frame, f) {
            Value::Closure(c) => (c.block, c.frame),
            Value::Builtin(i) => {
                let builtin = self.code.builtins.get(*i);
                let results: Result<Vec<Value>, Fault> = (0..keys.len())
                    .map(|i| builtin.apply(&[&items.element(i).unwrap_or_default()]))
                    .collect();
                let results = results.map_err(|e| self.fault(n, e))?;
                let value = match keys {
                    Keys::Listed { ref keys, .. } if matches!(xs, Value::Record(_)) => {
                        let names = keys.iter().map(|k| Arc::from(k.to_string()));
                        Value::Record(Arc::new(names.zip(results).collect()))
                    }
                    _ => Value::from_elements(results),
                };
                if matches!(self.store[n].side.as_deref(), Some(Side::Loop(_))) {
                    self.let_side_go(n);
                }
                self.set_deps(n, deps);
                return self.finish_made(n, value);
            }
            v => {
                let message = format!("map: needs a function, got {}", v.type_name());
                let hint =
                    matches!(v, Value::Memo(_)).then(|| "wrap it: fn(x) { f(x) }".to_owned());
                return Err(self.fail(n, FaultKind::Type, message, hint));
            }
        };
        self.check_callback(n, "map", block, 1)?;
        self.set_loop(n, keys, items, block, parent, deps)?;
        if self.slot_facts(n).is_effect {
            self.make_all_passes(n)?;
        }
        Ok(self.finish_unchanged(n))
    }

    pub(super) fn evaluate_fold(
        &mut self,
        n: NodeId,
        f: Operand,
        init: Operand,
        over: Operand,
    ) -> Step {
        let frame = self.store[n].frame;
        if let Some(step) = self.await_plain(frame, &[f, over])? {
            return Ok(step);
        }
        let mut deps = Deps::new();
        let (items, keys) = match map_keys(self.plain(frame, over, &mut deps)) {
            Ok(pair) => pair,
            Err(e) => return Err(self.fault(n, e)),
        };
        let (block, parent) = match self.value(frame, f) {
            Value::Closure(c) => (c.block, c.frame),
            v => {
                let message =
                    format!("fold: needs a function defined in the program, got {}", v.type_name());
                return Err(self.type_error(n, message));
            }
        };
        self.check_callback(n, "fold", block, 2)?;
        self.set_loop(n, keys, items, block, parent, deps)?;
        let passes = self.loop_of(n).map_or(0, |l| l.frames.len());
        let Some(last) = passes.checked_sub(1) else {
            return self.take_operand(n, frame, init);
        };
        // All passes must exist, so that a change propagates from each to the next.
        self.make_all_passes(n)?;
        let last = self.pass_frame(n, last)?;
        self.take_result(n, last)
    }

    fn check_callback(
        &self,
        n: NodeId,
        what: &str,
        block: BlockId,
        takes: usize,
    ) -> Result<(), Failure> {
        match self.code.blocks[block].signature() {
            Some((_, params, required)) if params.len() >= takes && required <= takes => Ok(()),
            Some((name, params, _)) => {
                let message = format!(
                    "{what}: calls its function with {}, but `{name}` takes {}",
                    super::call::count(takes, "argument"),
                    params.len()
                );
                Err(self.type_error(n, message))
            }
            None => Err(self.type_error(n, format!("{what}: needs a function"))),
        }
    }

    /// Sets or updates the passes of a loop; passes whose key persists keep their frame.
    #[allow(clippy::too_many_arguments)]
    fn set_loop(
        &mut self,
        n: NodeId,
        keys: Keys,
        items: Value,
        block: BlockId,
        parent: FrameId,
        deps: Deps,
    ) -> Result<(), Failure> {
        let held = self.store[n].flags & HELD != 0;
        let old = match self.store[n].side.as_deref() {
            Some(Side::Loop(l)) => Some(l.clone()),
            _ => {
                self.let_side_go(n);
                None
            }
        };
        if let Some(old) = &old
            && old.keys == keys
            && (old.block, old.parent) == (block, parent)
        {
            if !old.items.same(&items) || old.deps != deps {
                if held {
                    deps.iter().for_each(|d| self.acquire(*d, n, true));
                    old.deps.iter().for_each(|d| self.release(*d, true));
                }
                self.set_side(n, Some(Side::Loop(Loop { items, deps, ..old.clone() })));
            }
            return Ok(());
        }
        let mut frames = vec![FrameId::NONE; keys.len()];
        let mut result = NodeId::NONE;
        if held {
            deps.iter().for_each(|d| self.acquire(*d, n, true));
        }
        if let Some(old) = old {
            let same = (old.block, old.parent) == (block, parent);
            for (i, f) in old.frames.iter().enumerate().filter(|(_, f)| **f != FrameId::NONE) {
                match keys.find(&old.keys.get(i)).filter(|_| same) {
                    Some(j) => {
                        frames[j] = *f;
                        let before = std::mem::replace(&mut self.store[*f].pass, j as u32);
                        self.update.note(Entry::PassMoved(*f, before));
                    }
                    None => self.detach(*f),
                }
            }
            if held {
                old.deps.iter().for_each(|d| self.release(*d, true));
            }
            result = old.result;
        }
        self.set_side(
            n,
            Some(Side::Loop(Loop { keys, items, frames, block, parent, result, deps })),
        );
        let made = self.store.new_version(n);
        if let Some(Side::Loop(_)) = self.store[n].side.as_deref()
            && !matches!(self.op(n), Op::Fold { .. })
        {
            // The value is a reference with the new version, so that users see that the
            // structure changed.
            let node = &mut self.store[n];
            node.value = Value::Container(made);
            node.changed = self.update.epoch;
        }
        Ok(())
    }

    fn make_all_passes(&mut self, n: NodeId) -> Result<(), Failure> {
        let passes = self.loop_of(n).map_or(0, |l| l.frames.len());
        for i in 0..passes {
            self.pass_frame(n, i)?;
        }
        Ok(())
    }

    /// Returns the frame of a pass, which is created on first use.
    pub(crate) fn pass_frame(&mut self, owner: NodeId, pass: usize) -> Result<FrameId, Failure> {
        let Some(Side::Loop(l)) = self.store[owner].side.as_deref() else {
            return Err(self.fail(
                owner,
                FaultKind::Index,
                "this loop has no iterations".into(),
                None,
            ));
        };
        if l.frames[pass] != FrameId::NONE {
            return Ok(l.frames[pass]);
        }
        let (block, parent, key) = (l.block, l.parent, l.keys.get(pass));
        let home = self.store[owner].frame;
        let here = &self.store[home];
        let (path, depth, args) = match self.op(owner) {
            Op::Map { site, .. } => {
                (self.keyed_site_hash(home, *site, &key), here.depth + 1, Arguments::Item)
            }
            Op::Fold { site, .. } => {
                (self.keyed_site_hash(home, *site, &key), here.depth + 1, Arguments::Fold)
            }
            _ => (here.path, here.depth, Arguments::None),
        };
        debug_assert!(!matches!(self.code.blocks[block].kind, BlockKind::Root));
        let frame = Frame {
            block,
            parent,
            owner,
            path,
            depth,
            pass: pass as u32,
            key: Some(key),
            args,
            ..Frame::default()
        };
        let f = self.make_frame(frame)?;
        if let Some(Side::Loop(l)) = self.store[owner].side.as_deref_mut() {
            l.frames[pass] = f;
        }
        self.update.note(Entry::PassMade(owner, pass as u32));
        Ok(f)
    }
}

/// Returns the keys for `for`: the elements themselves if they are numbers, strings or
/// bools, otherwise the index.
fn for_keys(items: &Value) -> Result<Keys, Fault> {
    match items {
        Value::Array(xs) => {
            let start = xs.first().copied().unwrap_or(0.0);
            if start == libm::trunc(start)
                && start.abs() < 9e15
                && xs.iter().enumerate().all(|(i, x)| *x == start + i as f64)
            {
                return Ok(Keys::Range { start: start as i64, len: xs.len() });
            }
            listed(xs.iter().map(|x| Key::num(*x)))
        }
        Value::List(xs)
            if xs.iter().all(|x| matches!(x, Value::Str(_) | Value::Bool(_) | Value::Num(_))) =>
        {
            listed(xs.iter().map(Key::from_value))
        }
        v => Ok(Keys::Range { start: 0, len: v.len().unwrap_or(0) }),
    }
}

/// Returns the items and keys for `map` and `fold`: the elements if they are distinct
/// strings, a record's names, otherwise the index.
fn map_keys(xs: &Value) -> Result<(Value, Keys), Fault> {
    match xs {
        Value::Array(v) => Ok((xs.clone(), Keys::Range { start: 0, len: v.len() })),
        Value::List(v) => {
            let strings = !v.is_empty() && v.iter().all(|x| matches!(x, Value::Str(_)));
            let keys = if strings { listed(v.iter().map(Key::from_value)).ok() } else { None };
            Ok((xs.clone(), keys.unwrap_or(Keys::Range { start: 0, len: v.len() })))
        }
        Value::Record(r) => {
            let keys = listed(r.keys().map(|k| Some(Key::Str(Arc::clone(k)))))?;
            Ok((Value::List(r.values().cloned().collect()), keys))
        }
        v => Err(Fault::type_error(format!(
            "needs an array or record to run over, got {}",
            v.type_name()
        ))),
    }
}

fn listed(keys: impl Iterator<Item = Option<Key>>) -> Result<Keys, Fault> {
    let mut list: SmallVec<[Key; 8]> = SmallVec::new();
    let mut index = FxHashMap::default();
    for k in keys {
        let k = k.ok_or_else(|| Fault::type_error("NaN cannot be used as a key"))?;
        if index.insert(k.clone(), list.len() as u32).is_some() {
            return Err(Fault::new(FaultKind::Duplicate, format!("the key {k} occurs twice"))
                .with_hint("loop over the indices instead: for i in 0 .. len(xs)"));
        }
        list.push(k);
    }
    Ok(Keys::Listed { keys: list.to_vec().into(), index: Arc::new(index) })
}
