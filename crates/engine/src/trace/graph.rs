//! The graph behind a trace: nodes, frames, and references between nodes.
//!
//! Invariants between updates: an evaluated node holds each operand it reads, once per
//! reading; a node that nothing holds is empty; every evaluated node that reads a node of
//! another frame is in that node's list of outside users.

use super::choices::Choices;
use super::journal::{Before, Entry};
use super::limits::{Limits, Spent, raise};
use super::node::*;
use super::propose::{Constraint, Draws, Pending};

use crate::lang::address::ROOT_HASH;
use crate::lang::code::{BlockKind, Callee, Code, Op, Operand, SlotFacts};
use crate::lang::error::{Fault, FaultKind, RunError};
use crate::lang::key::Key;
use crate::lang::missing::Missing;
use crate::lang::value::Value;
use pcadlang_numerics::dist::Datum;
use pcadlang_numerics::num::ExactSum;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

/// The dependency graph of one execution.
#[derive(Clone, Debug)]
pub(crate) struct Graph {
    pub nodes: Vec<Node>,
    pub frames: Vec<Frame>,
    pub free_frames: Vec<FrameId>,
    /// By block: the first nodes of freed frames.
    pub free_bases: Vec<Vec<NodeId>>,
    pub outside: Vec<Outside>,
    pub free_outside: Vec<u32>,
    pub journal: Vec<Entry>,
    /// The number of the current update.
    pub epoch: u32,
    /// Counts structural versions.
    pub version: u32,
    /// Counts committed updates.
    pub revision: u64,
    /// The stack of nodes being evaluated.
    pub stack: Vec<NodeId>,
    /// The contents of the stack when an evaluation failed.
    pub failed: Vec<NodeId>,
    /// Effects of new frames that are still to be run.
    pub effects: Vec<NodeId>,
    /// Effects and choices that became stale.
    pub stale_effects: Vec<NodeId>,
    pub stale_choices: Vec<NodeId>,
    /// Nodes whose last reference was released in this update.
    pub unheld: Vec<NodeId>,
    /// Entries of `mem` functions whose last call was released in this update.
    pub idle: Vec<(NodeId, Key)>,
    /// Frames that their owners released in this update.
    pub detached: Vec<FrameId>,
    /// Nodes whose lists of outside users need compaction.
    pub untidy: Vec<NodeId>,
    /// The changes that this update applies.
    pub pending: Vec<Pending>,
    /// The log prior of the choices, and the log density of observations and factors.
    pub prior: ExactSum,
    pub likelihood: ExactSum,
    /// The log prior of what this update drew from the prior, and of what an update back
    /// would have to draw.
    pub drawn: ExactSum,
    pub undrawn: ExactSum,
    /// Elements of choices that this update resampled: their previous prior density is in
    /// `undrawn`.
    pub redrawn: Vec<(NodeId, u32)>,
    /// The choices that vanished, with their scores at that time. Choices may have been
    /// re-scored under other parameters before they vanished.
    pub retired: Vec<(NodeId, f64)>,
    /// The choices this update removed: node, address hash and stored value.
    pub removed: Vec<(NodeId, u64, Datum)>,
    /// The log Jacobians of choices set through the unconstrained space.
    pub jacobian: ExactSum,
    /// How many choices appeared and vanished in this update.
    pub appeared: u32,
    pub vanished: u32,
    pub choices: Choices,
    pub draws: Draws,
    /// Set while a program runs for the first time: improper choices may then take a
    /// value to start from.
    pub starting: bool,
    /// If set, continuous choices of the first run are uniform between minus this and this in
    /// the unconstrained space, instead of drawn from the prior.
    pub spread: Option<f64>,
    /// Values that choices take when they are first drawn.
    pub constraints: FxHashMap<u64, Constraint>,
    /// Values that replace the program's observed values, by the hash of the
    /// observation's address.
    pub observed: std::sync::Arc<FxHashMap<u64, Value>>,
    /// The sums before a query, for probes; `None` outside of queries.
    pub before: Option<Before>,
    /// If false, every update re-runs everything.
    pub incremental: bool,
    pub limits: Limits,
    pub spent: Spent,
    /// Block and slot of everything executed, while execution is recorded.
    pub execution_log: Option<Vec<(u32, u32)>>,
}

impl Graph {
    /// Creates the graph of a program that has not run.
    pub fn new(code: &Code, limits: Limits) -> Self {
        let mut g = Graph {
            nodes: Vec::new(),
            frames: Vec::new(),
            free_frames: Vec::new(),
            free_bases: vec![Vec::new(); code.blocks.len()],
            outside: vec![Outside::default()],
            free_outside: Vec::new(),
            journal: Vec::new(),
            epoch: 1,
            version: 0,
            revision: 0,
            stack: Vec::new(),
            failed: Vec::new(),
            effects: Vec::new(),
            stale_effects: Vec::new(),
            stale_choices: Vec::new(),
            unheld: Vec::new(),
            idle: Vec::new(),
            detached: Vec::new(),
            untidy: Vec::new(),
            pending: Vec::new(),
            prior: ExactSum::default(),
            likelihood: ExactSum::default(),
            drawn: ExactSum::default(),
            undrawn: ExactSum::default(),
            redrawn: Vec::new(),
            retired: Vec::new(),
            removed: Vec::new(),
            jacobian: ExactSum::default(),
            appeared: 0,
            vanished: 0,
            choices: Choices::default(),
            draws: Draws::default(),
            starting: false,
            spread: None,
            constraints: FxHashMap::default(),
            observed: std::sync::Arc::clone(&code.observed),
            before: None,
            incremental: true,
            limits,
            spent: Spent::default(),
            execution_log: None,
        };
        let root = Frame {
            block: 0,
            parent: NONE,
            owner: NONE,
            base: 0,
            path: ROOT_HASH,
            depth: 0,
            pass: 0,
            key: None,
            args: Arguments::None,
            attached: true,
        };
        g.place_frame(code, root);
        g
    }

    /// Allocates a frame and its nodes, re-using freed storage.
    pub fn place_frame(&mut self, code: &Code, mut frame: Frame) -> FrameId {
        let block = &code.blocks[frame.block as usize];
        let (len, first) = (block.len(), block.first);
        let id = self.free_frames.pop().unwrap_or(self.frames.len() as FrameId);
        frame.base = match self.free_bases[frame.block as usize].pop() {
            Some(base) => base,
            None => {
                let base = self.nodes.len() as NodeId;
                self.nodes.resize_with(base as usize + len, Node::default);
                base
            }
        };
        for (n, op) in
            self.nodes[frame.base as usize..frame.base as usize + len].iter_mut().zip(first..)
        {
            n.frame = id;
            n.op = op;
        }
        if id as usize == self.frames.len() {
            self.frames.push(frame);
        } else {
            self.frames[id as usize] = frame;
        }
        id
    }

    /// Creates a frame for `owner` as part of the current update, and queues its effects.
    pub fn make_frame(&mut self, code: &Code, frame: Frame) -> Result<FrameId, Box<RunError>> {
        let len = code.blocks[frame.block as usize].len();
        if frame.depth > self.limits.depth {
            return Err(self.fail(
                code,
                frame.owner,
                FaultKind::Limit,
                format!("calls are nested more than {} deep", self.limits.depth),
                Some(format!("does the recursion reach a base case? If so, {}", raise("depth"))),
            ));
        }
        if self.nodes.len() + len > self.limits.nodes as usize {
            return Err(self.fail(
                code,
                frame.owner,
                FaultKind::Limit,
                format!("the trace grew beyond {} nodes", self.limits.nodes),
                Some(format!(
                    "does the program loop or recurse forever? If not, {}",
                    raise("nodes")
                )),
            ));
        }
        self.count_operation(code, frame.owner)?;
        let block = frame.block as usize;
        let id = self.place_frame(code, frame);
        self.note(Entry::FrameMade(id));
        let base = self.frames[id as usize].base;
        for s in &code.blocks[block].effects {
            self.nodes[(base + s) as usize].refs = 1;
            self.effects.push(base + s);
        }
        Ok(id)
    }

    /// Returns the slot of a node in its block.
    pub fn slot(&self, n: NodeId) -> u32 {
        n - self.frames[self.nodes[n as usize].frame as usize].base
    }

    /// Returns the operation that a node evaluates.
    #[inline]
    pub fn op<'c>(&self, code: &'c Code, n: NodeId) -> &'c Op {
        &code.ops[self.nodes[n as usize].op as usize]
    }

    /// Returns the static facts about a node's slot.
    #[inline]
    pub fn slot_facts<'c>(&self, code: &'c Code, n: NodeId) -> &'c SlotFacts {
        &code.slots[self.nodes[n as usize].op as usize]
    }

    /// Returns the node that an operand of a frame's block refers to; `None` for
    /// constants.
    pub fn resolve(&self, frame: FrameId, o: Operand) -> Option<NodeId> {
        match o {
            Operand::Const(_) => None,
            Operand::Local(slot) => Some(self.frames[frame as usize].base + slot),
            Operand::Outer { up, slot } => Some(self.outer(frame, up, slot)),
        }
    }

    /// Returns the node in a slot of an enclosing frame, `up` levels out.
    fn outer(&self, frame: FrameId, up: u16, slot: u32) -> NodeId {
        let mut f = frame;
        for _ in 0..up {
            f = self.frames[f as usize].parent;
        }
        self.frames[f as usize].base + slot
    }

    /// Returns the value of an evaluated operand.
    pub fn value<'a>(&'a self, code: &'a Code, frame: FrameId, o: Operand) -> &'a Value {
        match o {
            Operand::Const(i) => code.const_value(i),
            _ => match self.resolve(frame, o) {
                Some(n) => &self.nodes[n as usize].value,
                None => &Value::Unit,
            },
        }
    }

    /// Returns the operand that feeds a parameter, with the caller's frame to which it
    /// belongs.
    pub fn argument(&self, code: &Code, n: NodeId) -> Option<(FrameId, Operand)> {
        let frame = &self.frames[self.nodes[n as usize].frame as usize];
        let Op::Param { index, .. } = self.op(code, n) else { return None };
        let i = match &frame.args {
            Arguments::Positional(count) => (index < count).then_some(*index),
            Arguments::Mapped(map) => map.get(*index as usize).copied().flatten(),
            _ => None,
        }?;
        match self.op(code, frame.owner) {
            Op::Call { args, .. } => {
                Some((self.nodes[frame.owner as usize].frame, args[i as usize].1))
            }
            _ => None,
        }
    }

    /// Calls `f` with every node that `n` holds, structure first, and whether the link is
    /// an outside one. The order matters: a change of an earlier node may make later ones
    /// irrelevant.
    pub fn each_dep(&self, code: &Code, n: NodeId, mut f: impl FnMut(NodeId, bool)) {
        let facts = self.slot_facts(code, n);
        if let Some(reads) = &facts.reads {
            for (up, slot) in reads {
                match up {
                    0 => f(n - facts.slot + slot, false),
                    _ => f(self.outer(self.nodes[n as usize].frame, *up, *slot), true),
                }
            }
        } else {
            self.each_changing_dep(code, n, &mut f);
        }
        if self.nodes[n as usize].side.is_some() {
            self.each_side_dep(code, n, f);
        }
    }

    /// Calls `f` with the operands that a node holds, if they depend on the state.
    fn each_changing_dep(&self, code: &Code, n: NodeId, f: &mut impl FnMut(NodeId, bool)) {
        let frame = self.nodes[n as usize].frame;
        let mut operand = |o: Operand| {
            if let Some(d) = self.resolve(frame, o) {
                f(d, !matches!(o, Operand::Local(_)));
            }
        };
        match self.op(code, n) {
            Op::Param { default, .. } => match self.argument(code, n) {
                Some((af, o)) => {
                    if let Some(d) = self.resolve(af, o) {
                        f(d, !matches!(o, Operand::Local(_)));
                    }
                }
                None if self.has_own_value(n) => {}
                None => default.iter().copied().for_each(operand),
            },
            Op::Select { cond, then, otherwise } => {
                operand(*cond);
                operand(if self.nodes[n as usize].flags & OTHERWISE == 0 {
                    *then
                } else {
                    *otherwise
                });
            }
            // Arguments are held by the parameters that read them.
            Op::Call { callee: Callee::Value(v), .. } => operand(*v),
            // The first running value is held by the accumulator of the first pass, if
            // there is one.
            Op::Fold { f: g, over, .. } => {
                operand(*g);
                operand(*over);
            }
            Op::Gather => f(n - 1, false),
            _ => {}
        }
    }

    /// The part of [`Graph::each_dep`] that is not operands.
    pub fn each_side_dep(&self, code: &Code, n: NodeId, mut f: impl FnMut(NodeId, bool)) {
        match self.nodes[n as usize].side.as_deref() {
            Some(Side::Deps(deps) | Side::Kept(Kept { deps, .. })) => {
                deps.iter().for_each(|d| f(*d, true))
            }
            Some(Side::Child(c)) if c.result != NONE => {
                f(c.result, !self.is_owned_result(code, c.result, n))
            }
            Some(Side::MemoCall(c)) => {
                c.deps.iter().for_each(|d| f(*d, true));
                if c.result != NONE {
                    f(c.result, true);
                }
            }
            Some(Side::Choice(c)) => c.deps.iter().for_each(|d| f(*d, true)),
            Some(Side::Total(t)) => t.deps.iter().for_each(|d| f(*d, true)),
            Some(Side::Loop(l)) => {
                l.deps.iter().for_each(|d| f(*d, true));
                if l.result != NONE {
                    f(l.result, true);
                }
            }
            Some(Side::Table(t)) => t.deps.iter().for_each(|d| f(*d, true)),
            _ => {}
        }
    }

    /// Whether a parameter's value comes with its frame rather than from an argument.
    fn has_own_value(&self, n: NodeId) -> bool {
        let frame = &self.frames[self.nodes[n as usize].frame as usize];
        let i = (n - frame.base) as usize;
        match &frame.args {
            Arguments::Values(vs) => i < vs.len(),
            Arguments::Item => i < 1,
            Arguments::Fold => i < 2,
            _ => false,
        }
    }

    /// Whether the link from a frame's result to the frame's owner can be derived from
    /// the block.
    pub fn is_owned_result(&self, code: &Code, result: NodeId, owner: NodeId) -> bool {
        let f = &self.frames[self.nodes[result as usize].frame as usize];
        f.owner == owner
            && code.blocks[f.block as usize].result == Some(Operand::Local(result - f.base))
    }

    /// Adds a reference to a node.
    pub fn acquire(&mut self, dep: NodeId, user: NodeId, outside: bool) {
        self.note(Entry::Acquired(dep, outside));
        self.nodes[dep as usize].refs += 1;
        if outside {
            let list = match self.nodes[dep as usize].outside {
                0 => self.new_outside(dep),
                list => list,
            };
            self.outside[list as usize].users.push(user);
        }
    }

    /// Allocates a list of users for a node without one.
    fn new_outside(&mut self, n: NodeId) -> u32 {
        let list = self.free_outside.pop().unwrap_or_else(|| {
            self.outside.push(Outside::default());
            self.outside.len() as u32 - 1
        });
        self.nodes[n as usize].outside = list;
        list
    }

    /// Releases a reference to a node; nodes without references are emptied at the end of
    /// the update.
    pub fn release(&mut self, dep: NodeId, outside: bool) {
        self.note(Entry::Released(dep, outside));
        let node = &mut self.nodes[dep as usize];
        node.refs -= 1;
        if node.refs == 0 {
            self.unheld.push(dep);
        }
        if outside {
            let list = &mut self.outside[node.outside as usize];
            list.gone += 1;
            if list.gone as usize * 2 > list.users.len() && list.gone > 8 {
                self.untidy.push(dep);
            }
        }
    }

    /// Detaches a frame: its effects are released, together with what only they hold.
    pub fn detach(&mut self, code: &Code, id: FrameId) {
        let frame = &mut self.frames[id as usize];
        if !frame.attached {
            return;
        }
        frame.attached = false;
        let (block, base) = (frame.block as usize, frame.base);
        self.note(Entry::FrameDetached(id));
        self.detached.push(id);
        for s in &code.blocks[block].effects {
            self.release(base + s, false);
        }
    }

    /// Empties every node that nothing holds.
    pub fn sweep(&mut self, code: &Code) {
        loop {
            if let Some(n) = self.unheld.pop() {
                let node = &self.nodes[n as usize];
                if node.refs == 0 && node.state != State::Empty {
                    self.retire(code, n);
                }
            } else if let Some((memo, key)) = self.idle.pop() {
                self.drop_idle(code, memo, &key);
            } else {
                return;
            }
        }
    }

    /// Empties a node: removes its contribution to the score and releases what it holds.
    fn retire(&mut self, code: &Code, n: NodeId) {
        self.save(n);
        let op = self.op(code, n);
        match op {
            Op::Draw { .. } => self.retire_choice(code, n),
            Op::Observe { .. } | Op::Factor { .. } => self.retire_score(n),
            _ => {}
        }
        if self.nodes[n as usize].flags & HELD != 0 {
            let mut deps: SmallVec<[(NodeId, bool); 8]> = SmallVec::new();
            self.each_dep(code, n, |d, outside| deps.push((d, outside)));
            for (d, outside) in deps {
                self.release(d, outside);
            }
        }
        self.drop_structure(code, n);
        let node = &mut self.nodes[n as usize];
        node.state = State::Empty;
        node.flags &= SAVED;
        node.value = Value::Unit;
        node.score = 0.0;
    }

    /// Releases everything that a node holds besides its operands, before its form
    /// changes.
    pub fn let_side_go(&mut self, code: &Code, n: NodeId) {
        if self.nodes[n as usize].flags & HELD != 0 {
            let mut deps: SmallVec<[(NodeId, bool); 4]> = SmallVec::new();
            self.each_side_dep(code, n, |d, outside| deps.push((d, outside)));
            for (d, outside) in deps {
                self.release(d, outside);
            }
        }
        self.drop_structure(code, n);
    }

    /// Releases the frames and table entries that a node owns, and its side.
    pub fn drop_structure(&mut self, code: &Code, n: NodeId) {
        let Some(side) = self.swap_side(n, None) else { return };
        match &side {
            Side::Child(c) => self.detach(code, c.frame),
            Side::MemoCall(c) => self.leave_memo(c.memo, &c.key),
            Side::Loop(l) => {
                l.frames.iter().filter(|f| **f != NONE).for_each(|f| self.detach(code, *f))
            }
            Side::Memo(m) => m.entries.values().for_each(|(f, _)| self.detach(code, *f)),
            _ => {}
        }
        self.note(Entry::Side(n, Some(Box::new(side))));
    }

    /// Replaces a node's side without a journal entry.
    pub fn swap_side(&mut self, n: NodeId, side: Option<Side>) -> Option<Side> {
        std::mem::replace(&mut self.nodes[n as usize].side, side.map(Box::new)).map(|b| *b)
    }

    /// Replaces a node's side, and records the old one for a roll-back.
    pub fn set_side(&mut self, n: NodeId, side: Option<Side>) {
        let old = std::mem::replace(&mut self.nodes[n as usize].side, side.map(Box::new));
        self.note(Entry::Side(n, old));
    }

    /// The error of an entry without a value among what a node reads.
    fn entry_without_value(&self, code: &Code, n: NodeId) -> Option<Fault> {
        let node = self.nodes.get(n as usize)?;
        let (mut found, op) = (None, self.op(code, n));
        if matches!(op, Op::Index { .. } | Op::Call { .. }) {
            return None;
        }
        op.operands(|o| {
            let entry = Missing::first_in(self.value(code, node.frame, o));
            found = found.take().or(entry.map(Missing::fault));
        });
        found
    }

    /// Builds an error at a node.
    pub fn fail(
        &self,
        code: &Code,
        n: NodeId,
        kind: FaultKind,
        message: String,
        hint: Option<String>,
    ) -> Box<RunError> {
        let mut calls = Vec::new();
        let (span, address) = if n == NONE {
            Default::default()
        } else {
            let mut f = self.nodes[n as usize].frame;
            loop {
                let frame = &self.frames[f as usize];
                if frame.owner == NONE {
                    break;
                }
                let of = &self.frames[self.nodes[frame.owner as usize].frame as usize];
                if let BlockKind::Function { name, .. } = &code.blocks[frame.block as usize].kind {
                    let span =
                        code.blocks[of.block as usize].spans[(frame.owner - of.base) as usize];
                    calls.push((name.clone(), span));
                }
                f = self.nodes[frame.owner as usize].frame;
            }
            calls.reverse();
            let frame = &self.frames[self.nodes[n as usize].frame as usize];
            (
                code.blocks[frame.block as usize].spans[(n - frame.base) as usize],
                self.address_near(code, n),
            )
        };
        // A choice outside of its support, such as a label beyond the number of groups,
        // gives the state density zero, whatever it indexes. A choice is scored before
        // anything that depends on it is evaluated.
        let is_impossible = kind == FaultKind::Index && self.prior.value() == f64::NEG_INFINITY;
        let kind = if is_impossible { FaultKind::Domain } else { kind };
        // A type error of a missing entry says where the entry is.
        let missing =
            if kind == FaultKind::Type { self.entry_without_value(code, n) } else { None };
        let Fault { kind, message, hint } = missing.unwrap_or(Fault { kind, message, hint });
        Box::new(RunError { kind, message, span, address, calls, hint })
    }
}
