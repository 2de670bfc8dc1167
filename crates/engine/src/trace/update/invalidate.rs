//! The first half of an update: invalidation of everything that may change.
//!
//! Invalidation follows users regardless of values, and stops at choices: an absorbing
//! choice keeps its value whatever its distribution becomes, so only its density may
//! change (except for choices that may have to be resampled). The second half
//! ([`super::propagate`]) re-runs stale nodes on demand and stops where values come out
//! equal.
//!
//! A comparison of a choice is looked at first: of a hundred tests `i < t`, another `t` turns
//! few, and only these are invalidated.

use super::Update;
use crate::lang::builtins::Scalar;
use crate::lang::code::{Callee, Code, Op, Operand};
use crate::lang::value::Value;
use crate::trace::choices::Target;
use crate::trace::node::*;
use crate::trace::propose::{Change, Pending};
use crate::trace::store::Store;
use pcadlang_numerics::dist::Datum;

impl Update {
    /// Queues changes and invalidates what depends on them.
    pub fn queue(&mut self, store: &mut Store, code: &Code, changes: &[(Target, Change)]) {
        self.pending.extend(changes.iter().map(|(t, c)| Pending {
            node: t.node,
            element: t.element,
            change: c.clone(),
        }));
        self.pending.sort_by_key(|p| p.node);
        if !store.incremental {
            self.invalidate_everything(store);
        }
        for (t, _) in changes {
            self.save(store, t.node);
            if store[t.node].flags & TARGET == 0 {
                store[t.node].flags |= TARGET;
                self.invalidate_target(store, code, t.node);
            }
        }
    }

    /// Invalidates a choice or observation that is about to change, and everything that
    /// reads it.
    pub fn invalidate_target(&mut self, store: &mut Store, code: &Code, n: NodeId) {
        self.make_stale(store, n);
        let next = self.next_number(store, n);
        self.invalidate_users(store, code, n, next);
        self.invalidate_pending(store, code);
    }

    /// Returns the number that a choice is about to become, if that is certain: it is the only
    /// change, so that the choice's distribution stays.
    fn next_number(&self, store: &Store, n: NodeId) -> Option<f64> {
        let [Pending { node, element: NONE, change }] = &self.pending[..] else { return None };
        let is_number = matches!(store[n].value, Value::Num(_)) && store.is_plain_choice(n);
        match change {
            Change::Set(Datum::Num(x)) | Change::Value(Datum::Num(x)) => {
                (is_number && *node == n).then_some(*x)
            }
            _ => None,
        }
    }

    /// Invalidates every evaluated node (full re-execution).
    pub fn invalidate_everything(&mut self, store: &mut Store) {
        for n in store.clean().collect::<Vec<_>>() {
            self.make_stale(store, n);
        }
    }

    fn invalidate_each_outside(
        &mut self,
        store: &mut Store,
        code: &Code,
        n: NodeId,
        next: Option<f64>,
    ) {
        for i in 0..store.outside(n).users.len() {
            let user = store.outside(n).users[i];
            if !next.is_some_and(|x| holds_as_before(store, code, user, (n, x))) {
                self.invalidate(store, code, user);
            }
        }
    }

    /// Invalidates the users of all nodes on the stack.
    fn invalidate_pending(&mut self, store: &mut Store, code: &Code) {
        while let Some(n) = self.stack.pop() {
            self.invalidate_users(store, code, n, None);
        }
    }

    /// Invalidates the users of a node, of which the `next` number may be known; those that may
    /// propagate a change go onto the stack.
    fn invalidate_users(&mut self, store: &mut Store, code: &Code, n: NodeId, next: Option<f64>) {
        let facts = &code.slots[store[n].op];
        for user in &facts.users {
            let user = n - facts.slot + *user;
            if !next.is_some_and(|x| holds_as_before(store, code, user, (n, x))) {
                self.invalidate_static_user(store, code, n, user);
            }
        }
        self.invalidate_each_outside(store, code, n, next);
        if !facts.is_result {
            return;
        }
        let frame = store[n].frame;
        let owner = store[frame].owner;
        if owner != NodeId::NONE {
            match store.op(owner) {
                Op::Call { .. } | Op::If { .. } => self.invalidate(store, code, owner),
                Op::Fold { .. } => self.invalidate_next_pass(store, code, owner, frame),
                _ => {}
            }
        }
    }

    /// Invalidates a user in the same frame. The change of an argument goes to the
    /// parameter it feeds, past the call itself.
    fn invalidate_static_user(&mut self, store: &mut Store, code: &Code, n: NodeId, user: NodeId) {
        let (callee, args) = match &code.ops[store[user].op] {
            Op::Call { callee, args, .. } => (callee, args),
            Op::Select { cond, then, otherwise } => {
                let node = &store[user];
                let taken = if node.flags & OTHERWISE == 0 { then } else { otherwise };
                if [cond, taken].iter().any(|o| store.resolve(node.frame, **o) == Some(n)) {
                    self.invalidate(store, code, user);
                }
                return;
            }
            _ => return self.invalidate(store, code, user),
        };
        let Some(Side::Child(child)) = store[user].side.as_deref() else {
            return self.invalidate(store, code, user);
        };
        let child = *child;
        let frame = store[user].frame;
        if let Callee::Value(v) = callee
            && store.resolve(frame, *v) == Some(n)
        {
            self.invalidate(store, code, user);
        }
        let base = store[child.frame].base;
        for (i, (_, a)) in args.iter().enumerate() {
            if !matches!(a, Operand::Local(_)) || store.resolve(frame, *a) != Some(n) {
                continue;
            }
            let param = match &store[child.frame].args {
                Arguments::Positional(_) => Some(i),
                Arguments::Mapped(map) => map.iter().position(|m| *m == Some(i as u16)),
                _ => None,
            };
            if let Some(p) = param {
                self.invalidate(store, code, base + Slot::new(p));
            }
        }
    }

    /// Invalidates the reader of the result of a pass of a `fold`: the next pass, or the
    /// fold itself.
    fn invalidate_next_pass(
        &mut self,
        store: &mut Store,
        code: &Code,
        owner: NodeId,
        frame: FrameId,
    ) {
        let pass = store[frame].pass as usize;
        let Some(Side::Loop(l)) = store[owner].side.as_deref() else { return };
        match l.frames.get(pass + 1) {
            Some(next) if *next != FrameId::NONE => {
                let accumulator = store[*next].base;
                self.invalidate(store, code, accumulator);
            }
            _ => self.invalidate(store, code, owner),
        }
    }

    /// Invalidates one node, if it is evaluated and not yet stale.
    fn invalidate(&mut self, store: &mut Store, code: &Code, n: NodeId) {
        let state = store[n].state;
        if state != State::Clean {
            // The choice became stale before its key did.
            if matches!(state, State::Stale)
                && matches!(store.op(n), Op::Draw { keys, .. } if !keys.is_empty())
                && store.may_be_redrawn(n)
            {
                self.stack.push(n);
            }
            return;
        }
        self.make_stale(store, n);
        match store.op(n) {
            Op::Draw { .. } => {
                if store.may_be_redrawn(n) {
                    self.stack.push(n);
                }
            }
            Op::Observe { .. } | Op::Factor { .. } => {}
            Op::For { .. } | Op::Map { .. } | Op::Fold { .. } => {
                self.invalidate_items(store, code, n);
                self.stack.push(n);
            }
            _ => self.stack.push(n),
        }
    }

    /// Invalidates the elements of a loop's passes: what the loop runs over may have
    /// changed.
    fn invalidate_items(&mut self, store: &mut Store, code: &Code, n: NodeId) {
        let Some(Side::Loop(l)) = store[n].side.as_deref() else { return };
        let item = usize::from(matches!(store.op(n), Op::Fold { .. }));
        let passes = l.frames.len();
        for i in 0..passes {
            let Some(Side::Loop(l)) = store[n].side.as_deref() else { return };
            let f = l.frames[i];
            if f != FrameId::NONE {
                let base = store[f].base;
                self.invalidate(store, code, base + Slot::new(item));
                if item == 1 && i == 0 {
                    self.invalidate(store, code, base);
                }
            }
        }
    }

    pub fn make_stale(&mut self, store: &mut Store, n: NodeId) {
        self.save(store, n);
        store[n].state = State::Stale;
        let facts = store.slot_facts(n);
        if facts.is_effect {
            self.stale_effects.push(n);
        } else if facts.is_draw {
            self.stale_choices.push(n);
        }
    }
}

/// True if a node is a comparison of numbers that comes out as it is when a choice becomes this
/// number. If what it is compared with changes too, that invalidates the comparison by itself.
fn holds_as_before(store: &Store, code: &Code, user: NodeId, (n, x): (NodeId, f64)) -> bool {
    let node = &store[user];
    let (Op::Prim { builtin, args }, Value::Bool(now)) = (store.op(user), &node.value) else {
        return false;
    };
    let (Some(Scalar::Test(test)), [a, b]) = (code.builtins.get(*builtin).scalar, &args[..]) else {
        return false;
    };
    let number = |o: &Operand| match store.resolve(node.frame, *o) {
        Some(d) if d == n => Some(x),
        Some(d) if store[d].state != State::Clean => None,
        _ => match store.value(node.frame, *o) {
            Value::Num(x) => Some(*x),
            _ => None,
        },
    };
    match (node.state, number(a), number(b)) {
        (State::Clean, Some(a), Some(b)) => test(a, b) == *now,
        _ => false,
    }
}
