//! The first half of an update: invalidation of everything that may change.
//!
//! Invalidation follows users regardless of values, and stops at choices: an absorbing
//! choice keeps its value whatever its distribution becomes, so only its density may
//! change (except for choices that may have to be resampled). The second half
//! ([`super::propagate`]) re-runs stale nodes on demand and stops where values come out
//! equal.

use crate::lang::code::{Callee, Code, DistSpec, Op, Operand};
use crate::lang::value::Value;
use crate::trace::graph::Graph;
use crate::trace::node::*;

impl Graph {
    /// Invalidates a choice or observation that is about to change, and everything that
    /// reads it.
    pub fn invalidate_target(&mut self, code: &Code, n: NodeId) {
        self.make_stale(code, n);
        self.invalidate_users(code, n);
        self.invalidate_pending(code);
    }

    /// Invalidates every evaluated node (full re-execution).
    pub fn invalidate_everything(&mut self, code: &Code) {
        for n in 0..self.nodes.len() as NodeId {
            if self.nodes[n as usize].state == State::Clean {
                self.make_stale(code, n);
            }
        }
    }

    fn invalidate_each_outside(&mut self, code: &Code, n: NodeId) {
        let list = self.nodes[n as usize].outside as usize;
        for i in 0..self.outside[list].users.len() {
            let user = self.outside[list].users[i];
            self.invalidate(code, user);
        }
    }

    /// Invalidates the users of all nodes on the stack.
    fn invalidate_pending(&mut self, code: &Code) {
        while let Some(n) = self.stack.pop() {
            self.invalidate_users(code, n);
        }
    }

    /// Invalidates the users of a node; those that may propagate a change go onto the
    /// stack.
    fn invalidate_users(&mut self, code: &Code, n: NodeId) {
        let facts = self.slot_facts(code, n);
        for user in &facts.users {
            self.invalidate_static_user(code, n, n - facts.slot + user);
        }
        self.invalidate_each_outside(code, n);
        if !facts.is_result {
            return;
        }
        let frame = self.nodes[n as usize].frame;
        let owner = self.frames[frame as usize].owner;
        if owner != NONE {
            match self.op(code, owner) {
                Op::Call { .. } | Op::If { .. } => self.invalidate(code, owner),
                Op::Fold { .. } => self.invalidate_next_pass(code, owner, frame),
                _ => {}
            }
        }
    }

    /// Invalidates a user in the same frame. The change of an argument goes to the
    /// parameter it feeds, past the call itself.
    fn invalidate_static_user(&mut self, code: &Code, n: NodeId, user: NodeId) {
        let (callee, args) = match self.op(code, user) {
            Op::Call { callee, args, .. } => (callee, args),
            Op::Select { cond, then, otherwise } => {
                let node = &self.nodes[user as usize];
                let taken = if node.flags & OTHERWISE == 0 { then } else { otherwise };
                if [cond, taken].iter().any(|o| self.resolve(node.frame, **o) == Some(n)) {
                    self.invalidate(code, user);
                }
                return;
            }
            _ => return self.invalidate(code, user),
        };
        let Some(Side::Child(child)) = self.nodes[user as usize].side.as_deref() else {
            return self.invalidate(code, user);
        };
        let child = *child;
        let frame = self.nodes[user as usize].frame;
        if let Callee::Value(v) = callee
            && self.resolve(frame, *v) == Some(n)
        {
            self.invalidate(code, user);
        }
        let base = self.frames[child.frame as usize].base;
        for (i, (_, a)) in args.iter().enumerate() {
            if !matches!(a, Operand::Local(_)) || self.resolve(frame, *a) != Some(n) {
                continue;
            }
            let param = match &self.frames[child.frame as usize].args {
                Arguments::Positional(_) => Some(i),
                Arguments::Mapped(map) => map.iter().position(|m| *m == Some(i as u16)),
                _ => None,
            };
            if let Some(p) = param {
                self.invalidate(code, base + p as u32);
            }
        }
    }

    /// Invalidates the reader of the result of a pass of a `fold`: the next pass, or the
    /// fold itself.
    fn invalidate_next_pass(&mut self, code: &Code, owner: NodeId, frame: FrameId) {
        let pass = self.frames[frame as usize].pass as usize;
        let Some(Side::Loop(l)) = self.nodes[owner as usize].side.as_deref() else { return };
        match l.frames.get(pass + 1) {
            Some(next) if *next != NONE => {
                let accumulator = self.frames[*next as usize].base;
                self.invalidate(code, accumulator);
            }
            _ => self.invalidate(code, owner),
        }
    }

    /// Invalidates one node, if it is evaluated and not yet stale.
    fn invalidate(&mut self, code: &Code, n: NodeId) {
        let state = self.nodes[n as usize].state;
        if state != State::Clean {
            // The choice became stale before its key did.
            if matches!(state, State::Stale)
                && matches!(self.op(code, n), Op::Draw { keys, .. } if !keys.is_empty())
                && self.may_be_redrawn(code, n)
            {
                self.stack.push(n);
            }
            return;
        }
        self.make_stale(code, n);
        match self.op(code, n) {
            Op::Draw { .. } => {
                if self.may_be_redrawn(code, n) {
                    self.stack.push(n);
                }
            }
            Op::Observe { .. } | Op::Factor { .. } => {}
            Op::For { .. } | Op::Map { .. } | Op::Fold { .. } => {
                self.invalidate_items(code, n);
                self.stack.push(n);
            }
            _ => self.stack.push(n),
        }
    }

    /// Whether a stale choice may get another value without being a target: a whitened
    /// one moves with its distribution, and one whose key, length or kind changes is
    /// resampled.
    pub fn may_be_redrawn(&self, code: &Code, n: NodeId) -> bool {
        let node = &self.nodes[n as usize];
        let Op::Draw { dist, keys, .. } = self.op(code, n) else { return false };
        let stale = |o: &Operand| {
            self.resolve(node.frame, *o)
                .is_some_and(|k| matches!(self.nodes[k as usize].state, State::Stale))
        };
        let whole = matches!(node.side.as_deref(), Some(Side::Choice(c)) if c.stored.is_some() || c.elements != NONE);
        whole
            || matches!(dist, DistSpec::Value(_))
            || !matches!(node.value, Value::Num(_) | Value::Bool(_))
            || keys.iter().any(stale)
    }

    /// Invalidates the elements of a loop's passes: what the loop runs over may have
    /// changed.
    fn invalidate_items(&mut self, code: &Code, n: NodeId) {
        let Some(Side::Loop(l)) = self.nodes[n as usize].side.as_deref() else { return };
        let item = u32::from(matches!(self.op(code, n), Op::Fold { .. }));
        let passes = l.frames.len();
        for i in 0..passes {
            let Some(Side::Loop(l)) = self.nodes[n as usize].side.as_deref() else { return };
            let f = l.frames[i];
            if f != NONE {
                let base = self.frames[f as usize].base;
                self.invalidate(code, base + item);
                if item == 1 && i == 0 {
                    self.invalidate(code, base);
                }
            }
        }
    }

    pub fn make_stale(&mut self, code: &Code, n: NodeId) {
        self.save(n);
        self.nodes[n as usize].state = State::Stale;
        let facts = self.slot_facts(code, n);
        if facts.is_effect {
            self.stale_effects.push(n);
        } else if facts.is_draw {
            self.stale_choices.push(n);
        }
    }
}
