//! The store of a trace: nodes, frames, and references between nodes.
//!
//! Invariants between updates: an evaluated node holds each operand it reads, once per
//! reading; a node that nothing holds is empty; every evaluated node that reads a node of
//! another frame is in that node's list of outside users.

use super::node::*;
use super::update::Failure;
use crate::lang::address::ROOT_HASH;
use crate::lang::builtins::PreviousEvaluation;
use crate::lang::code::{BlockKind, Callee, Code, Observed, Op, Operand, SlotFacts};
use crate::lang::error::{Fault, FaultKind, RunError};
use crate::lang::missing::Missing;
use crate::lang::value::{NodeRef, Value};
use smallvec::SmallVec;
use std::ops::{Index, IndexMut};
use std::sync::Arc;

/// The nodes and frames of one execution.
#[derive(Clone, Debug)]
pub(crate) struct Store {
    /// The program.
    pub code: Arc<Code>,
    nodes: Vec<Node>,
    frames: Vec<Frame>,
    free_frames: Vec<FrameId>,
    /// By block: the first nodes of freed frames.
    free_bases: Vec<Vec<NodeId>>,
    outside: Vec<Outside>,
    free_outside: Vec<u32>,
    /// Counts structural versions.
    version: u32,
    /// Values that replace the program's observed values, by the hash of the
    /// observation's address.
    pub observed: Arc<Observed>,
    /// If false, every update re-runs everything.
    pub incremental: bool,
}

macro_rules! table {
    ($id:ty, $item:ty, $table:ident) => {
        impl Index<$id> for Store {
            type Output = $item;

            #[inline]
            fn index(&self, id: $id) -> &$item {
                &self.$table[id]
            }
        }

        impl IndexMut<$id> for Store {
            #[inline]
            fn index_mut(&mut self, id: $id) -> &mut $item {
                &mut self.$table[id]
            }
        }
    };
}

table!(NodeId, Node, nodes);
table!(FrameId, Frame, frames);

impl Store {
    /// Creates the store of a program that has not run: the frame of the top level.
    pub fn new(code: Arc<Code>) -> Self {
        let mut store = Store {
            nodes: Vec::new(),
            frames: Vec::new(),
            free_frames: Vec::new(),
            free_bases: vec![Vec::new(); code.blocks.len()],
            outside: vec![Outside::default()],
            free_outside: Vec::new(),
            version: 0,
            observed: Arc::clone(&code.observed),
            incremental: true,
            code,
        };
        store.place_frame(Frame { path: ROOT_HASH, ..Frame::default() });
        store
    }

    /// Returns the number of nodes.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Returns a node, if it exists.
    pub fn get(&self, n: NodeId) -> Option<&Node> {
        self.nodes.get(n.index())
    }

    /// Iterates over the nodes.
    pub fn nodes(&self) -> impl Iterator<Item = (NodeId, &Node)> {
        self.nodes.iter().enumerate().map(|(i, node)| (NodeId::new(i), node))
    }

    /// Returns the nodes, by id.
    pub fn nodes_mut(&mut self) -> &mut [Node] {
        &mut self.nodes
    }

    /// Iterates over the nodes that are up to date.
    pub fn clean(&self) -> impl Iterator<Item = NodeId> {
        self.nodes().filter(|(_, node)| node.state == State::Clean).map(|(n, _)| n)
    }

    /// Forgets when the nodes changed.
    pub fn forget_changes(&mut self) {
        self.nodes.iter_mut().for_each(|node| node.changed = 0);
    }

    /// Returns a reference to a node with a new structural version.
    pub fn new_version(&mut self, node: NodeId) -> NodeRef {
        self.version += 1;
        NodeRef { node, version: self.version }
    }

    /// Allocates a frame and its nodes, re-using freed storage.
    pub fn place_frame(&mut self, mut frame: Frame) -> FrameId {
        let block = &self.code.blocks[frame.block];
        let id = self.free_frames.pop().unwrap_or(FrameId::new(self.frames.len()));
        frame.base = self.free_bases[frame.block].pop().unwrap_or_else(|| {
            let base = NodeId::new(self.nodes.len());
            self.nodes.resize_with(base.index() + block.len(), Node::default);
            base
        });
        let nodes = &mut self.nodes[frame.base.index()..][..block.len()];
        for (node, slot) in nodes.iter_mut().zip(block.slots()) {
            (node.frame, node.op) = (id, block.first + slot);
        }
        if id.index() == self.frames.len() {
            self.frames.push(frame);
        } else {
            self[id] = frame;
        }
        id
    }

    /// Frees a frame's storage.
    pub fn free_frame(&mut self, f: FrameId) {
        let (block, base) = (self[f].block, self[f].base);
        for slot in self.code.blocks[block].slots() {
            let outside = self[base + slot].outside;
            if outside != 0 {
                let list = self.outside_mut(base + slot);
                list.users.clear();
                list.gone = 0;
                self.free_outside.push(outside);
            }
            self[base + slot] = Node::default();
        }
        self.free_bases[block].push(base);
        self.free_frames.push(f);
    }

    /// Returns the slot of a node in its block.
    pub fn slot(&self, n: NodeId) -> Slot {
        n - self[self[n].frame].base
    }

    /// Returns the operation that a node evaluates.
    #[inline]
    pub fn op(&self, n: NodeId) -> &Op {
        &self.code.ops[self[n].op]
    }

    /// Returns the static facts about a node's slot.
    #[inline]
    pub fn slot_facts(&self, n: NodeId) -> &SlotFacts {
        &self.code.slots[self[n].op]
    }

    /// Returns the node that an operand of a frame's block refers to; `None` for
    /// constants.
    pub fn resolve(&self, frame: FrameId, o: Operand) -> Option<NodeId> {
        match o {
            Operand::Const(_) => None,
            Operand::Local(slot) => Some(self[frame].base + slot),
            Operand::Outer { up, slot } => Some(self.outer(frame, up, slot)),
        }
    }

    /// Returns the node in a slot of an enclosing frame, `up` levels out.
    pub(super) fn outer(&self, frame: FrameId, up: u16, slot: Slot) -> NodeId {
        let mut f = frame;
        for _ in 0..up {
            f = self[f].parent;
        }
        self[f].base + slot
    }

    /// Returns the value of an evaluated operand.
    pub fn value(&self, frame: FrameId, o: Operand) -> &Value {
        match o {
            Operand::Const(i) => self.code.const_value(i),
            _ => match self.resolve(frame, o) {
                Some(n) => &self[n].value,
                None => &Value::Unit,
            },
        }
    }

    /// Returns the node to wait for before an operand can be read.
    pub(super) fn unready(&self, frame: FrameId, o: Operand) -> Option<NodeId> {
        self.resolve(frame, o).filter(|n| self[*n].state != State::Clean)
    }

    /// Returns the values of operands, with containers read as arrays or records, or else
    /// the node to wait for.
    pub(crate) fn inputs<'a>(
        &'a self,
        frame: FrameId,
        operands: &[Operand],
        deps: &mut Deps,
    ) -> Result<SmallVec<[&'a Value; 4]>, NodeId> {
        let mut values = SmallVec::new();
        for o in operands {
            values.push(self.input(frame, *o, deps)?);
        }
        Ok(values)
    }

    /// Returns the value of one operand, as [`Store::inputs`] does.
    #[inline]
    pub(crate) fn input(
        &self,
        frame: FrameId,
        o: Operand,
        deps: &mut Deps,
    ) -> Result<&Value, NodeId> {
        let clean = |m: NodeId| match &self[m] {
            node if node.state == State::Clean => Ok(&node.value),
            _ => Err(m),
        };
        let value = match o {
            Operand::Const(i) => return Ok(self.code.const_value(i)),
            Operand::Local(slot) => clean(self[frame].base + slot)?,
            Operand::Outer { up, slot } => clean(self.outer(frame, up, slot))?,
        };
        let Value::Container(r) = value else { return Ok(value) };
        deps.push(r.node.gather());
        clean(r.node.gather())
    }

    /// Returns the value of an operand, with a container read as an array or record;
    /// nodes read for that are added to `deps`.
    pub(super) fn plain<'a>(&'a self, frame: FrameId, o: Operand, deps: &mut Deps) -> &'a Value {
        match self.value(frame, o) {
            Value::Container(r) => {
                deps.push(r.node.gather());
                &self[r.node.gather()].value
            }
            v => v,
        }
    }

    /// Returns the previous evaluation that an incremental function may start from.
    pub fn kept(&self, n: NodeId) -> Option<&Arc<PreviousEvaluation>> {
        match self[n].side.as_deref() {
            Some(Side::Kept(k)) if self.incremental => Some(&k.before),
            _ => None,
        }
    }

    /// Returns the number of keys of an element of a container.
    pub fn key_width(&self, container: NodeId) -> usize {
        match self.op(container) {
            Op::Container { sources, .. } => sources[0].keys.len(),
            _ => 1,
        }
    }

    /// Returns the operand that feeds a parameter, with the caller's frame to which it
    /// belongs.
    pub fn argument(&self, n: NodeId) -> Option<(FrameId, Operand)> {
        let frame = &self[self[n].frame];
        let Op::Param { index, .. } = self.op(n) else { return None };
        let i = match &frame.args {
            Arguments::Positional(count) => (index < count).then_some(*index),
            Arguments::Mapped(map) => map.get(*index as usize).copied().flatten(),
            _ => None,
        }?;
        match self.op(frame.owner) {
            Op::Call { args, .. } => Some((self[frame.owner].frame, args[i as usize].1)),
            _ => None,
        }
    }

    /// Calls `f` with every node that `n` holds, structure first, and whether the link is
    /// an outside one. The order matters: a change of an earlier node may make later ones
    /// irrelevant.
    pub fn each_dep(&self, n: NodeId, mut f: impl FnMut(NodeId, bool)) {
        let facts = self.slot_facts(n);
        if let Some(reads) = &facts.reads {
            for (up, slot) in reads {
                match up {
                    0 => f(n - facts.slot + *slot, false),
                    _ => f(self.outer(self[n].frame, *up, *slot), true),
                }
            }
        } else {
            self.each_changing_dep(n, &mut f);
        }
        if self[n].side.is_some() {
            self.each_side_dep(n, f);
        }
    }

    /// Calls `f` with the operands that a node holds, if they depend on the state.
    fn each_changing_dep(&self, n: NodeId, f: &mut impl FnMut(NodeId, bool)) {
        let frame = self[n].frame;
        let mut operand = |o: Operand| {
            if let Some(d) = self.resolve(frame, o) {
                f(d, !matches!(o, Operand::Local(_)));
            }
        };
        match self.op(n) {
            Op::Param { default, .. } => match self.argument(n) {
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
                operand(if self[n].flags & OTHERWISE == 0 { *then } else { *otherwise });
            }
            // Arguments are held by the parameters that read them.
            Op::Call { callee: Callee::Value(v), .. } => operand(*v),
            // The first running value is held by the accumulator of the first pass, if
            // there is one.
            Op::Fold { f: g, over, .. } => {
                operand(*g);
                operand(*over);
            }
            Op::Gather => f(n.container(), false),
            _ => {}
        }
    }

    /// The part of [`Graph::each_dep`] that is not operands.
    pub fn each_side_dep(&self, n: NodeId, mut f: impl FnMut(NodeId, bool)) {
        let Some(side) = self[n].side.as_deref() else { return };
        side.deps().iter().for_each(|d| f(*d, true));
        match side {
            Side::Child(c) if c.result != NodeId::NONE => {
                f(c.result, !self.is_owned_result(c.result, n))
            }
            Side::MemoCall(MemoCall { result, .. }) | Side::Loop(Loop { result, .. })
                if *result != NodeId::NONE =>
            {
                f(*result, true)
            }
            _ => {}
        }
    }

    /// Calls `f` with the nodes whose values decide which other nodes a node reads, and
    /// which frames it has.
    pub fn deciders(&self, n: NodeId, mut f: impl FnMut(NodeId)) {
        let node = &self[n];
        let mut operand = |o: &Operand| {
            if let Some(d) = self.resolve(node.frame, *o) {
                f(d);
            }
        };
        match self.op(n) {
            Op::If { cond, .. } | Op::Select { cond, .. } => operand(cond),
            Op::For { iter, .. } => operand(iter),
            Op::Map { f, over, .. } | Op::Fold { f, over, .. } => {
                [f, over].into_iter().for_each(operand)
            }
            Op::Mem { f, .. } => operand(f),
            Op::Draw { keys, .. } => keys.iter().for_each(operand),
            // The elements of arrays are not nodes; those of containers are.
            Op::Index { keys, .. } if node.side.is_some() => keys.iter().for_each(operand),
            Op::Call { callee: Callee::Value(v), .. } => operand(v),
            _ => {}
        }
        if let Some(side @ (Side::MemoCall(_) | Side::Table(_) | Side::Loop(_))) =
            node.side.as_deref()
        {
            side.deps().iter().for_each(|d| f(*d));
        }
    }

    /// Iterates over the nodes around a node, from the inside out: those that made the frames
    /// that it is in.
    pub fn owners(&self, n: NodeId) -> impl Iterator<Item = NodeId> {
        let owner = |n: NodeId| Some(self[self[n].frame].owner).filter(|o| *o != NodeId::NONE);
        std::iter::successors(owner(n), move |n| owner(*n))
    }

    /// True if a parameter's value comes with its frame rather than from an argument.
    fn has_own_value(&self, n: NodeId) -> bool {
        let frame = &self[self[n].frame];
        let i = (n - frame.base).index();
        match &frame.args {
            Arguments::Values(vs) => i < vs.len(),
            Arguments::Item => i < 1,
            Arguments::Fold => i < 2,
            _ => false,
        }
    }

    /// True if the link from a frame's result to the frame's owner can be derived from
    /// the block.
    pub fn is_owned_result(&self, result: NodeId, owner: NodeId) -> bool {
        let f = &self[self[result].frame];
        f.owner == owner
            && self.code.blocks[f.block].result == Some(Operand::Local(result - f.base))
    }

    /// Returns the loop that a node runs.
    pub fn loop_of(&self, n: NodeId) -> Option<&Loop> {
        if let Some(Side::Loop(l)) = self[n].side.as_deref() { Some(l) } else { None }
    }

    /// Returns what a choice keeps besides its value.
    pub fn choice_of(&self, n: NodeId) -> Option<&ChoiceSide> {
        if let Some(Side::Choice(c)) = self[n].side.as_deref() { Some(c) } else { None }
    }

    /// Returns the users of a node in other frames, and how many of them have released it.
    pub fn outside(&self, n: NodeId) -> &Outside {
        &self.outside[self[n].outside as usize]
    }

    /// Returns the list of outside users of a node that has some.
    pub fn outside_mut(&mut self, n: NodeId) -> &mut Outside {
        let list = self[n].outside;
        &mut self.outside[list as usize]
    }

    /// True if nodes of other frames read this one.
    pub fn is_read_outside(&self, n: NodeId) -> bool {
        let Outside { users, gone } = self.outside(n);
        users.len() > *gone as usize
    }

    /// Adds a user of another frame to a node.
    pub fn add_outside(&mut self, n: NodeId, user: NodeId) {
        if self[n].outside == 0 {
            self[n].outside = self.free_outside.pop().unwrap_or_else(|| {
                self.outside.push(Outside::default());
                self.outside.len() as u32 - 1
            });
        }
        self.outside_mut(n).users.push(user);
    }

    /// Removes the users that have released a node from its list of outside users.
    pub fn tidy(&mut self, n: NodeId) {
        if !self.outside(n).is_untidy() {
            return;
        }
        let mut users = std::mem::take(&mut self.outside_mut(n).users);
        users.sort_unstable();
        // Keeps one entry per reading, since each is released on its own.
        let (mut user, mut readings) = (NodeId::NONE, 0);
        users.retain(|u| {
            if *u != user {
                (user, readings) = (*u, 0);
                if self[user].state != State::Empty {
                    self.each_dep(user, |d, outside| readings += u32::from(outside && d == n));
                }
            }
            let kept = readings > 0;
            readings = readings.saturating_sub(1);
            kept
        });
        *self.outside_mut(n) = Outside { users, gone: 0 };
    }

    /// The error of an entry without a value among what a node reads.
    fn entry_without_value(&self, n: NodeId) -> Option<Fault> {
        let node = self.get(n)?;
        let (mut found, op) = (None, self.op(n));
        if matches!(op, Op::Index { .. } | Op::Call { .. }) {
            return None;
        }
        op.operands(|o| {
            let entry = Missing::first_in(self.value(node.frame, o));
            found = found.take().or(entry.map(Missing::fault));
        });
        found
    }

    /// Builds an error at a node.
    pub fn fail(
        &self,
        n: NodeId,
        kind: FaultKind,
        message: String,
        hint: Option<String>,
    ) -> Box<RunError> {
        let mut calls = Vec::new();
        let (span, address) = if n == NodeId::NONE {
            Default::default()
        } else {
            let mut f = self[n].frame;
            loop {
                let frame = &self[f];
                if frame.owner == NodeId::NONE {
                    break;
                }
                let of = &self[self[frame.owner].frame];
                if let BlockKind::Function { name, .. } = &self.code.blocks[frame.block].kind {
                    let span = self.code.blocks[of.block].spans[frame.owner - of.base];
                    calls.push((name.clone(), span));
                }
                f = self[frame.owner].frame;
            }
            calls.reverse();
            let frame = &self[self[n].frame];
            (self.code.blocks[frame.block].spans[n - frame.base], self.address_near(n))
        };
        // A type error of a missing entry says where the entry is.
        let missing = if kind == FaultKind::Type { self.entry_without_value(n) } else { None };
        let Fault { kind, message, hint } = missing.unwrap_or(Fault { kind, message, hint });
        Box::new(RunError { kind, message, span, address, calls, hint })
    }

    /// Turns a fault of a built-in into an error at a node.
    pub(super) fn fault(&self, n: NodeId, f: Fault) -> Failure {
        self.fail(n, f.kind, f.message, f.hint)
    }

    /// Builds a type error at a node.
    pub(super) fn type_error(&self, n: NodeId, message: String) -> Failure {
        self.fail(n, FaultKind::Type, message, None)
    }
}
