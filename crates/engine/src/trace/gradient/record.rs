//! Recording the log density as a function of some choices on a tape
//! ([`crate::lang::tape`]).
//!
//! The nodes that an update of the choices may reach are found by invalidation, as in an
//! update, and recorded on the tape, operands first. Structure is held fixed: where it
//! depends on something that moves, the tape has a guard that detects a change, or the
//! tape is missing. Nothing is evaluated, and the trace does not change.

use super::in_place::{Besides, Given, InPlace};
use super::{Inputs, Reverse};
use crate::lang::code::{Callee, DistSpec, Op, Operand};
use crate::lang::tape::{Builder, Form, Scored, Tape};
use crate::lang::value::Value;
use crate::trace::Trace;
use crate::trace::choices::Target;
use crate::trace::journal::Entry;
use crate::trace::node::*;
use pcadlang_numerics::dist::Dist;
use rustc_hash::{FxHashMap, FxHashSet};
use std::sync::Arc;

impl Trace {
    /// Returns the nodes that an update of these choices may run.
    fn reached(&mut self, targets: &[Target]) -> Vec<NodeId> {
        let g = &mut self.graph;
        let before = g.begin();
        for (i, t) in targets.iter().enumerate() {
            // Elements of one choice are adjacent.
            if i == 0 || targets[i - 1].node != t.node {
                g.update.invalidate_target(&mut g.store, &self.code, t.node);
            }
        }
        let mut all: Vec<NodeId> = g
            .update
            .journal()
            .iter()
            .filter_map(|e| if let Entry::Node { id, .. } = e { Some(*id) } else { None })
            .collect();
        g.rollback(before);
        g.sort_by_place(&mut all);
        all
    }

    /// Records the log density as a function of the unconstrained coordinates of the
    /// targets, one after the other; `None` if it is not a straight-line program. With it
    /// comes how the trace can be moved in place, if it can.
    pub(super) fn record_tape(&mut self, targets: &[Target]) -> Option<(Tape, Option<InPlace>)> {
        let reached = self.reached(targets);
        let mut r = self.recorder(&reached, Recorded::new(self.graph.incremental), true);
        for t in targets {
            r.place(*t)?;
        }
        for n in reached {
            r.visit(n)?;
        }
        r.put_scores(&Given::new());
        r.put_values(|_| Some(Given::new()));
        let tape = r.recorded.tape.finish();
        let in_place = r.recorded.in_place.map(|in_place| in_place.on(&tape, &self.graph));
        Some((tape, in_place))
    }

    /// Records scores that `work` asks for, in one of several states of the trace that
    /// share a tape, and what else moves. `given` tells through which values of choices
    /// that are summed out a node has its value; `None` if it exists for some only.
    pub(in crate::trace) fn record_scores(
        &mut self,
        targets: &[Target],
        recorded: Recorded,
        given: &FxHashMap<NodeId, Option<Given>>,
        work: impl FnOnce(&mut Recorder) -> Option<()>,
    ) -> Option<Recorded> {
        let reached = self.reached(targets);
        let mut r = self.recorder(&reached, recorded, false);
        if r.recorded.placed.is_empty() {
            for t in targets {
                r.place(*t)?;
            }
        }
        work(&mut r)?;
        let known = |r: &Recorder, n: &NodeId| match given.get(n) {
            Some(Some(given)) => r.recorded.known.contains(&(*n, given.clone())),
            _ => false,
        };
        for n in reached {
            if r.recorded.in_place.is_some() && !known(&r, &n) && r.visit(n).is_none() {
                r.recorded.in_place = None;
            }
        }
        r.put_values(|n| given.get(&n).cloned().flatten());
        Some(r.recorded)
    }

    fn recorder<'a>(
        &'a self,
        reached: &[NodeId],
        recorded: Recorded,
        scores: bool,
    ) -> Recorder<'a> {
        let view = Reverse {
            graph: &self.graph.store,
            marks: Vec::new(),
            order: Vec::new(),
            adjoints: FxHashMap::default(),
            weight: 1.0,
            power: 1.0,
        };
        Recorder {
            view,
            reached: reached.iter().copied().collect(),
            recorded,
            scores,
            moving: Vec::new(),
            scored: Vec::new(),
            besides: FxHashMap::default(),
        }
    }
}

/// The part recorded so far.
pub(in crate::trace) struct Recorded {
    /// The choices that move: their values, or the noise that is stored.
    placed: FxHashMap<NodeId, Form>,
    /// The forms of the nodes recorded so far.
    pub forms: FxHashMap<NodeId, Form>,
    pub tape: Builder,
    /// How the trace can be moved in place, if it can.
    pub in_place: Option<InPlace>,
    /// The nodes whose values are in `in_place`, with what they are given.
    known: FxHashSet<(NodeId, Given)>,
}

impl Recorded {
    /// Nothing yet; `keeps` as in [`Builder::new`].
    pub fn new(keeps: bool) -> Recorded {
        Recorded {
            placed: FxHashMap::default(),
            forms: FxHashMap::default(),
            tape: Builder::new(keeps),
            in_place: keeps.then(InPlace::default),
            known: FxHashSet::default(),
        }
    }
}

pub(in crate::trace) struct Recorder<'a> {
    view: Reverse<'a>,
    reached: FxHashSet<NodeId>,
    pub recorded: Recorded,
    /// True if scores are recorded with the nodes that have them.
    scores: bool,
    /// The nodes whose inputs move.
    moving: Vec<NodeId>,
    /// Where the scores are that have been recorded.
    scored: Vec<(NodeId, Scored)>,
    /// The parts of nodes that move, besides values.
    besides: FxHashMap<NodeId, Besides>,
}

impl Recorder<'_> {
    fn place(&mut self, t: Target) -> Option<()> {
        let graph = self.view.graph;
        let dist = graph.dist_of(t.node)?;
        let whole = match self.recorded.placed.get(&t.node) {
            Some(form) => form.clone(),
            None => {
                let form = self.recorded.tape.place(&graph.stored_value(t.node))?;
                self.recorded.placed.insert(t.node, form.clone());
                form
            }
        };
        let (dist, form) = match t.element {
            NONE if dist.elements().is_some() => return None,
            NONE => (dist, whole),
            i => (dist.element(i as usize), whole.element(i as usize)?),
        };
        self.recorded.tape.input(dist.stored_support(), form);
        Some(())
    }

    /// Records a node, after everything it reads.
    fn visit(&mut self, root: NodeId) -> Option<()> {
        if self.recorded.forms.contains_key(&root) {
            return Some(());
        }
        let mut stack: Vec<(NodeId, Inputs, usize)> = vec![(root, self.reads(root), 0)];
        while let Some((n, reads, next)) = stack.last_mut() {
            if let Some(read) = reads.get(*next).copied() {
                *next += 1;
                if self.reached.contains(&read) && !self.recorded.forms.contains_key(&read) {
                    let inner = self.reads(read);
                    stack.push((read, inner, 0));
                }
                continue;
            }
            let n = *n;
            let fixed = !self.recorded.placed.contains_key(&n)
                && reads.iter().all(|r| self.form(*r).is_fixed());
            stack.pop();
            let form = match fixed {
                true => Form::Fixed(self.value(n).clone()),
                false => {
                    self.moving.push(n);
                    self.record_op(n)?
                }
            };
            self.recorded.forms.insert(n, form);
        }
        Some(())
    }

    /// Lets the trace's values be moved in place too, if that is possible: of the nodes
    /// recorded since the last call.
    fn put_values(&mut self, given: impl Fn(NodeId) -> Option<Given>) {
        let Some(mut in_place) = self.recorded.in_place.take() else { return };
        let mut known = std::mem::take(&mut self.recorded.known);
        let is_fixed = |frame, o| self.operand(frame, o).is_fixed();
        let fits = self.moving.iter().all(|n| {
            let Some(given) = given(*n) else { return false };
            let of = self.view.graph;
            !known.insert((*n, given.clone()))
                || in_place.add_value(of, *n, given, self.form(*n), self.besides.get(n), is_fixed)
        });
        self.moving.clear();
        self.recorded.known = known;
        self.recorded.in_place = fits.then_some(in_place);
    }

    /// Does the same with the scores recorded since the last call, which are these for
    /// some values of choices that are summed out.
    pub fn put_scores(&mut self, given: &Given) {
        let scored = self.scored.drain(..);
        if let Some(in_place) = &mut self.recorded.in_place {
            scored.for_each(|(n, scored)| in_place.add_score(n, given.clone(), scored));
        }
    }

    /// Notes where the score of a node is: what was recorded since `mark`.
    fn note_score(&mut self, n: NodeId, mark: (usize, usize)) {
        match self.recorded.tape.scored(mark) {
            Some(Some(scored)) => self.scored.push((n, scored)),
            Some(None) => {}
            None => self.recorded.in_place = None,
        }
    }

    /// Records the score of a node; false if it is fixed.
    pub fn score(&mut self, n: NodeId) -> Option<bool> {
        let mut fixed = !self.recorded.placed.contains_key(&n);
        for read in self.reads(n) {
            if self.reached.contains(&read) {
                self.visit(read)?;
            }
            fixed &= self.form(read).is_fixed();
        }
        if !fixed {
            self.scores = true;
            let recorded = self.record_op(n);
            self.scores = false;
            recorded?;
        }
        Some(!fixed)
    }

    /// Returns all nodes from which a node's value, score or structure is derived.
    fn reads(&self, n: NodeId) -> Inputs {
        let mut all = self.view.inputs(n, true);
        self.view.graph.each_dep(n, |d, _| all.push(d));
        all
    }

    fn value(&self, n: NodeId) -> &Value {
        &self.view.graph[n].value
    }

    fn form(&self, n: NodeId) -> Form {
        self.recorded.forms.get(&n).cloned().unwrap_or_else(|| Form::Fixed(self.value(n).clone()))
    }

    fn operand(&self, frame: FrameId, o: Operand) -> Form {
        match self.view.source(frame, o) {
            Some(n) => self.form(n),
            None => Form::Fixed(self.view.graph.value(frame, o).clone()),
        }
    }

    fn operands(&self, frame: FrameId, all: &[Operand]) -> Vec<Form> {
        all.iter().map(|o| self.operand(frame, *o)).collect()
    }

    /// Returns the form of the single node whose value is passed through.
    fn handed_on(&self, n: NodeId) -> Option<Form> {
        match &self.view.inputs(n, false)[..] {
            [] => Some(Form::Fixed(self.value(n).clone())),
            [one] => Some(self.form(*one)),
            _ => None,
        }
    }

    /// Records the operation of a node; `None` if that is not possible.
    fn record_op(&mut self, n: NodeId) -> Option<Form> {
        let graph = self.view.graph;
        let frame = graph[n].frame;
        let side = graph[n].side.as_deref();
        let now = graph[n].value.clone();
        match graph.op(n) {
            Op::Prim { builtin, args } => {
                let args = self.operands(frame, args);
                let form =
                    self.recorded.tape.call(graph.code.builtins.get(*builtin), args, &now)?;
                self.start_from_kept(n, &form);
                Some(form)
            }
            Op::Array(items) => {
                let all = self.operands(frame, items);
                self.recorded.tape.array(all)
            }
            Op::Record { names, values } => {
                let values = self.operands(frame, values);
                Some(Form::Record(names.iter().cloned().zip(values).collect()))
            }
            Op::Index { base, keys } => {
                for (form, k) in self.operands(frame, keys).iter().zip(keys.iter()) {
                    let now = graph.plain(frame, *k, &mut Deps::new()).clone();
                    self.recorded.tape.guard(form, &now)?;
                }
                match graph.resolve(frame, *base) {
                    Some(_) => {
                        let (source, keys) = self.view.indexed(n)?;
                        self.recorded.tape.index(&self.form(source), &keys)
                    }
                    // An element of a constant at fixed keys.
                    None => Some(Form::Fixed(now)),
                }
            }
            Op::Param { default, .. } => match (graph.argument(n), self.view.passed(n)) {
                (Some((from, o)), _) => Some(self.operand(from, o)),
                (None, Some((source, Some(i)))) => self.form(source).position(i),
                (None, Some((source, None))) => Some(self.form(source)),
                (None, None) => default.map(|o| self.operand(frame, o)),
            },
            Op::Item => {
                let (source, i) = self.view.passed(n)?;
                self.form(source).position(i?)
            }
            Op::Accumulator => self.handed_on(n),
            Op::Gather => self.record_gather(n, &now),
            Op::Call { callee: Callee::Value(f), args, .. } => {
                if !self.operand(frame, *f).is_fixed() {
                    return None;
                }
                let Value::Builtin(i) = graph.value(frame, *f) else {
                    return self.record_call(n);
                };
                let builtin = graph.code.builtins.get(*i);
                let order = builtin.match_names(args.iter().map(|(k, _)| k.as_deref())).ok()?;
                let argument = |i: &Option<usize>| match i.and_then(|i| args.get(i)) {
                    Some((_, o)) => self.operand(frame, *o),
                    None => Form::Fixed(Value::Unit),
                };
                let args = order.iter().map(argument).collect();
                let form = self.recorded.tape.call(builtin, args, &now)?;
                self.start_from_kept(n, &form);
                Some(form)
            }
            Op::Call { .. } => self.record_call(n),
            Op::If { cond, .. } => {
                self.guard(frame, *cond)?;
                self.handed_on(n)
            }
            Op::Select { cond, .. } => {
                self.guard(frame, *cond)?;
                self.view.taken(n).map(|o| self.operand(frame, o))
            }
            Op::Fold { f, .. } => match self.operand(frame, *f).is_fixed() {
                true => self.handed_on(n),
                false => None,
            },
            Op::Map { f, .. } if !self.operand(frame, *f).is_fixed() => None,
            // Its passes are recorded one by one.
            Op::Map { .. } if matches!(side, Some(Side::Loop(_))) => Some(Form::Fixed(now)),
            Op::Map { f, over, .. } => {
                let Value::Builtin(i) = graph.value(frame, *f) else { return None };
                let (over, builtin) = (self.operand(frame, *over), graph.code.builtins.get(*i));
                let one = |(i, now): (usize, Value)| {
                    self.recorded.tape.call(builtin, vec![over.position(i)?], &now)
                };
                match &now {
                    Value::Record(r) => {
                        let all =
                            r.values().cloned().enumerate().map(one).collect::<Option<Vec<_>>>()?;
                        Some(Form::Record(r.keys().cloned().zip(all).collect()))
                    }
                    v => {
                        let all = v
                            .passes()
                            .into_iter()
                            .enumerate()
                            .map(one)
                            .collect::<Option<Vec<_>>>()?;
                        self.recorded.tape.array(all)
                    }
                }
            }
            Op::Draw { dist, keys, .. } => self.record_draw(n, dist, keys),
            Op::Observe { .. } | Op::Factor { .. } if !self.scores => Some(Form::Fixed(now)),
            Op::Observe { dist, value, .. } => {
                let x = match graph.replaced(n) {
                    Some(v) => Form::Fixed(v.clone()),
                    None => self.operand(frame, *value),
                };
                self.record_score(n, dist, &x, true)?;
                Some(Form::Fixed(now))
            }
            Op::Factor { weight, .. } => {
                let weight = self.operand(frame, *weight);
                let mark = self.recorded.tape.mark();
                self.recorded.tape.factor(&weight)?;
                self.note_score(n, mark);
                Some(Form::Fixed(now))
            }
            // Loops over values that move, and functions and containers whose structure
            // depends on them.
            _ => None,
        }
    }

    /// Lets the call of an incremental function start from its evaluation in the trace.
    fn start_from_kept(&mut self, n: NodeId, form: &Form) {
        if matches!(form, Form::Fixed(_) | Form::Made(_)) {
            return;
        }
        if let Some(before) = self.view.graph.kept(n)
            && let Some(call) = self.recorded.tape.start_from(before)
        {
            self.besides.insert(n, Besides::Evaluation(call));
        }
    }

    fn guard(&mut self, frame: FrameId, o: Operand) -> Option<()> {
        let form = self.operand(frame, o);
        self.recorded.tape.guard(&form, self.view.graph.value(frame, o))
    }

    /// A call of a function of the program, whose frame is fixed.
    fn record_call(&mut self, n: NodeId) -> Option<Form> {
        match self.view.graph[n].side.as_deref() {
            Some(Side::MemoCall(c)) if c.deps.iter().any(|d| !self.form(*d).is_fixed()) => None,
            _ => self.handed_on(n),
        }
    }

    fn record_gather(&mut self, n: NodeId, now: &Value) -> Option<Form> {
        let all: Vec<Form> = self.view.gathered(n)?.iter().map(|d| self.form(*d)).collect();
        match now {
            Value::Record(r) => Some(Form::Record(r.keys().cloned().zip(all).collect())),
            _ => self.recorded.tape.array(all),
        }
    }

    fn record_draw(&mut self, n: NodeId, spec: &DistSpec, keys: &[Operand]) -> Option<Form> {
        let graph = self.view.graph;
        let frame = graph[n].frame;
        let dist = graph.dist_of(n)?;
        if dist.is_stored_whitened() != graph.is_whitened(n)
            || !self.operands(frame, keys).iter().all(Form::is_fixed)
        {
            return None;
        }
        let params = self.operands(frame, spec.operands());
        let moves = params.iter().any(|p| !p.is_fixed());
        // If the support moves, values move with it or end up outside.
        if moves && !has_fixed_support(&dist, &params) {
            return None;
        }
        let x = match self.recorded.placed.get(&n) {
            Some(form) => form.clone(),
            None => Form::Fixed(graph.stored_value(n)),
        };
        if !dist.is_stored_whitened() {
            if self.scores {
                self.record_score(n, spec, &x, false)?;
            }
            return Some(x);
        }
        // White noise is scored itself, whatever the parameters; the value moves with them.
        let now = Value::Dist(Arc::new(dist.clone()));
        if self.scores {
            let mark = self.recorded.tape.mark();
            self.recorded.tape.distribution(&Form::Fixed(now.clone()), &now, &x, false)?;
            self.note_score(n, mark);
        }
        let made = match spec {
            DistSpec::Value(o) => self.operand(frame, *o),
            DistSpec::Family { builtin, args } => {
                let args = self.operands(frame, args);
                Builder::made_dist(graph.code.builtins.get(*builtin), args, &dist)
            }
        };
        let value = self.recorded.tape.coloured(made, &dist, &x)?;
        if self.recorded.placed.contains_key(&n) {
            self.besides.insert(n, Besides::Noise(x));
        }
        Some(value)
    }

    fn record_score(&mut self, n: NodeId, spec: &DistSpec, x: &Form, observed: bool) -> Option<()> {
        let graph = self.view.graph;
        let frame = graph[n].frame;
        let mark = self.recorded.tape.mark();
        match spec {
            DistSpec::Family { builtin, args } => {
                let dist = graph.make_dist(n, spec).ok()?;
                let args = self.operands(frame, args);
                self.recorded.tape.family(
                    graph.code.builtins.get(*builtin),
                    args,
                    &dist,
                    x,
                    observed,
                )?;
            }
            DistSpec::Value(o) => {
                let form = self.operand(frame, *o);
                self.recorded.tape.distribution(&form, graph.value(frame, *o), x, observed)?;
            }
        }
        self.note_score(n, mark);
        Some(())
    }
}

/// True if a distribution whose parameters move has a fixed support.
fn has_fixed_support(dist: &Dist, params: &[Form]) -> bool {
    match dist {
        d if !d.has_moving_support() => true,
        Dist::HalfCauchy(_) => params.first().is_some_and(Form::is_fixed),
        // The bounds are the last parameters, also in `truncated(normal(m, s), lo, hi)`.
        Dist::TruncatedNormal(_) => params.iter().rev().take(2).all(Form::is_fixed),
        Dist::Truncated(d) => {
            let (bounds, base) = (params.iter().rev().take(2).all(Form::is_fixed), params.first());
            bounds && (base.is_some_and(Form::is_fixed) || !d.base().has_moving_support())
        }
        Dist::Product(d) => d.parts().iter().all(|one| has_fixed_support(one, params)),
        _ => false,
    }
}
