//! Moving a trace to a point of a tape in place: the nodes take their values and scores
//! from the tape, with the same bits that an update would give them. Nothing is
//! invalidated, evaluated or journaled.

use crate::lang::builtins::CovarianceValue;
use crate::lang::code::{Op, Operand};
use crate::lang::tape::{Form, ScoreSums, ScoreTerms, Scored, Tape};
use crate::lang::value::Value;
use crate::trace::Trace;
use crate::trace::graph::Graph;
use crate::trace::node::*;
use crate::trace::store::Store;
use pcadlang_numerics::num::ExactSum;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use std::sync::Arc;

/// The values of choices summed out, by number, for which something holds; without any it
/// always does.
pub(in crate::trace) type Given = SmallVec<[(u32, u32); 2]>;

/// The nodes that a tape gives values and scores. Of those that depend on choices summed
/// out, it gives them to the nodes that exist at the values of these choices.
#[derive(Debug, Default)]
pub(in crate::trace) struct InPlace {
    values: Vec<(Given, NodeId, Form)>,
    /// The other parts of nodes that move.
    besides: Vec<(Given, NodeId, Besides)>,
    /// Nodes that contribute to the score, and where their terms are on the tape.
    scores: Vec<(Given, NodeId, Scored)>,
    /// Those of the values, and of the scores, that are one number on the tape. Apart from
    /// the others because there are thousands where choices are summed out of a loop.
    number_values: Numbers,
    /// Of the prior, and of the likelihood.
    number_scores: [Numbers; 2],
    /// Their terms that change.
    old: Vec<f64>,
    new: Vec<f64>,
    each: Vec<f64>,
    made: Vec<Value>,
    columns: FxHashMap<usize, Vec<f64>>,
}

/// Nodes and the indices of their numbers, in runs of those that exist at the same value of one
/// choice that is summed out, or always ([`NONE`]).
#[derive(Debug, Default)]
struct Numbers {
    all: Vec<(NodeId, u32)>,
    runs: Vec<Run>,
}

#[derive(Clone, Copy, Debug)]
struct Run {
    choice: u32,
    value: u32,
    /// Where it ends in the list.
    end: u32,
}

impl Numbers {
    /// Takes those that `number` finds out of a list, unless they depend on several choices.
    fn taken_from<T>(
        list: &mut Vec<(Given, NodeId, T)>,
        number: impl Fn(NodeId, &T) -> Option<usize>,
    ) -> Numbers {
        let mut found = Vec::new();
        list.retain(|(given, n, place)| {
            let at = number(*n, place).and_then(|at| u32::try_from(at).ok());
            let given = match given[..] {
                [] => Some((NONE, 0)),
                [one] => Some(one),
                _ => None,
            };
            let one = given.zip(at).map(|(given, at)| (given, (*n, at)));
            found.extend(one);
            one.is_none()
        });
        found.sort_by_key(|(given, _)| *given);
        let mut numbers = Numbers::default();
        for same in found.chunk_by(|a, b| a.0 == b.0) {
            let (choice, value) = same[0].0;
            numbers.all.extend(same.iter().map(|(_, one)| *one));
            numbers.runs.push(Run { choice, value, end: numbers.all.len() as u32 });
        }
        numbers
    }

    /// The parts of the list with nodes that exist when the choices have these values.
    fn at<'a>(&'a self, values: &'a [usize]) -> impl Iterator<Item = &'a [(NodeId, u32)]> {
        let mut begin = 0;
        self.runs.iter().filter_map(move |run| {
            let all = begin..run.end as usize;
            begin = all.end;
            let applies = run.choice == NONE
                || values.get(run.choice as usize) == Some(&(run.value as usize));
            applies.then(|| &self.all[all])
        })
    }
}

/// A thing that a node keeps besides its value, and its place on a tape.
#[derive(Clone, Debug)]
pub(in crate::trace) enum Besides {
    /// The last evaluation of an incremental function.
    Evaluation(Scored),
    /// The white noise that a choice is stored as.
    Noise(Form),
}

impl InPlace {
    /// Adds the value of a node whose inputs move, and what moves besides it; false if the
    /// node keeps anything else that moves.
    pub fn add_value(
        &mut self,
        graph: &Store,
        n: NodeId,
        given: Given,
        form: Form,
        besides: Option<&Besides>,
        is_fixed: impl Fn(FrameId, Operand) -> bool,
    ) -> bool {
        let node = &graph[n];
        let op = graph.op(n);
        let fits = match node.side.as_deref() {
            None | Some(Side::Deps(_) | Side::Child(_) | Side::MemoCall(_)) => true,
            // Noise that is not given stays.
            Some(Side::Choice(_)) => true,
            Some(Side::Total(_)) => matches!(op, Op::Observe { .. }),
            Some(Side::Loop(_)) => match op {
                Op::Map { over, .. } | Op::Fold { over, .. } => is_fixed(node.frame, *over),
                _ => false,
            },
            Some(Side::Kept(_)) => matches!(besides, Some(Besides::Evaluation(_))),
            Some(Side::Table(_) | Side::Memo(_)) => false,
        };
        if let Some(besides) = besides.filter(|_| fits) {
            self.besides.push((given.clone(), n, besides.clone()));
        }
        if fits && !form.is_fixed() {
            self.values.push((given, n, form));
        }
        fits
    }

    /// Adds the score of a node.
    pub fn add_score(&mut self, n: NodeId, given: Given, scored: Scored) {
        self.scores.push((given, n, scored));
    }

    /// Everything where the complete tape has it.
    pub fn on(mut self, tape: &Tape, graph: &Store) -> InPlace {
        self.values.iter_mut().for_each(|(_, _, form)| *form = tape.place_of(form));
        self.scores.iter_mut().for_each(|(_, _, at)| *at = tape.place_of_score(at));
        self.besides.iter_mut().for_each(|(_, _, besides)| match besides {
            Besides::Evaluation(call) => *call = tape.place_of_score(call),
            Besides::Noise(form) => *form = tape.place_of(form),
        });
        self.number_values = Numbers::taken_from(&mut self.values, |_, form| match form {
            Form::Num(at) => Some(*at),
            _ => None,
        });
        self.number_scores = [true, false].map(|of_choices| {
            Numbers::taken_from(&mut self.scores, |n, scored| match scored {
                Scored::Numbers(run, false) => {
                    (matches!(graph.op(n), Op::Draw { .. }) == of_choices).then_some(run.start)
                }
                _ => None,
            })
        });
        self
    }

    /// True if [`InPlace::apply`] can move the trace to the point of the tape's last run,
    /// with choices that are summed out at these values.
    pub fn fits(&mut self, graph: &Graph, tape: &Tape, values: &[usize]) -> bool {
        self.made.clear();
        self.columns.clear();
        for (given, n, form) in &self.values {
            if tape.numbers(form).is_none() && holds(graph, given, *n, values) {
                let Some(value) = tape.value(form) else { return false };
                self.made.push(value);
            }
        }
        let is_plain = |(n, _): &(NodeId, u32)| graph.store[*n].side.is_none();
        let one = |(n, _): &(NodeId, u32)| {
            let node = &graph.store[*n];
            node.state != State::Clean || takes_one(graph.op(*n), node.side.as_deref())
        };
        self.number_scores
            .iter()
            .all(|s| s.all.iter().all(is_plain) || s.at(values).all(|same| same.iter().all(one)))
            && self.scores.iter().filter(|(given, n, _)| holds(graph, given, *n, values)).all(
                |(_, n, scored)| {
                    let terms = tape.terms(scored, &mut self.each, &mut self.columns);
                    let node = &graph.store[*n];
                    match (graph.op(*n), node.side.as_deref(), terms) {
                        (Op::Draw { .. }, Some(Side::Choice(c)), Some(ScoreTerms::Each)) => {
                            c.scores.len() == self.each.len() && c.elements != NONE
                        }
                        (Op::Observe { .. }, Some(Side::Total(_)), Some(_)) => true,
                        (op, side, Some(ScoreTerms::One(_))) => takes_one(op, side),
                        _ => false,
                    }
                },
            )
    }

    /// Moves the trace to the point of the tape's last run, after [`InPlace::fits`]. The
    /// sums of its scores where the trace is are `before`, if that is known.
    pub fn apply(
        &mut self,
        graph: &mut Graph,
        tape: &Tape,
        values: &[usize],
        before: Option<&ScoreSums>,
    ) {
        let (nodes, numbers) = (graph.store.nodes_mut(), tape.all_numbers());
        for same in self.number_values.at(values) {
            for (n, at) in same {
                let node = &mut nodes[*n];
                if node.state != State::Clean {
                    continue;
                }
                let now = numbers[*at as usize];
                match &mut node.value {
                    Value::Num(x) => *x = now,
                    other => *other = Value::Num(now),
                }
            }
        }
        let mut made = self.made.drain(..);
        for (given, n, form) in &self.values {
            if !holds(graph, given, *n, values) {
                continue;
            }
            let value = &mut graph.store[*n].value;
            match (tape.numbers(form), form) {
                (Some([x]), Form::Num(_)) => *value = Value::Num(*x),
                (Some(xs), _) => put(value, xs),
                (None, _) => *value = made.next().unwrap_or_default(),
            }
        }
        for (given, n, besides) in &self.besides {
            if !holds(graph, given, *n, values) {
                continue;
            }
            match (graph.store[*n].side.as_deref_mut(), besides) {
                (Some(Side::Kept(kept)), Besides::Evaluation(call)) => {
                    if let Some(evaluation) = tape.evaluation(call) {
                        kept.before = Arc::clone(evaluation);
                    }
                }
                (Some(Side::Choice(c)), Besides::Noise(form)) => {
                    c.stored = tape.value(form).and_then(|noise| noise.to_datum());
                }
                _ => {}
            }
        }
        let (mut old, mut new) = (ScoreSums::default(), ScoreSums::default());
        for (given, n, scored) in &self.scores {
            if !holds(graph, given, *n, values) {
                continue;
            }
            if before.is_none() {
                graph.put_scored(*n, &mut old.prior, &mut old.likelihood);
            }
            let terms = tape.terms(scored, &mut self.each, &mut self.columns);
            let node = &mut graph.store[*n];
            match (node.side.as_deref_mut(), terms) {
                (Some(Side::Choice(c)), Some(ScoreTerms::Each)) => {
                    c.scores.copy_from_slice(&self.each)
                }
                (Some(Side::Total(t)), Some(ScoreTerms::Each)) => {
                    node.score = 0.0;
                    t.sum = ExactSum::default();
                    self.each.iter().for_each(|s| t.sum.add(*s));
                }
                (Some(Side::Total(t)), Some(ScoreTerms::Sum(sum))) => {
                    node.score = 0.0;
                    t.sum = sum;
                }
                (Some(Side::Total(t)), Some(ScoreTerms::One(score))) => {
                    node.score = score;
                    t.sum = ExactSum::default();
                }
                (_, Some(ScoreTerms::One(score))) => node.score = score,
                _ => {}
            }
            if before.is_none() {
                graph.put_scored(*n, &mut new.prior, &mut new.likelihood);
            }
        }
        drop(made);
        self.put_number_scores(graph, tape.all_numbers(), values, [&mut old, &mut new]);
        let (new, old) = match before {
            Some(before) => (tape.sums(), before),
            None => (&new, &old),
        };
        new.replace(old, &mut graph.score.prior, &mut graph.score.likelihood);
        graph.revision += 1;
    }

    /// Gives nodes the scores that are one number on the tape, and adds the former and the
    /// present ones, where they differ, to the sums.
    fn put_number_scores(
        &mut self,
        graph: &mut Graph,
        numbers: &[f64],
        values: &[usize],
        [before, after]: [&mut ScoreSums; 2],
    ) {
        let nodes = graph.store.nodes_mut();
        let most = self.number_scores.iter().map(|s| s.all.len()).max().unwrap_or(0);
        self.old.resize(most, 0.0);
        self.new.resize(most, 0.0);
        for (scores, observed) in self.number_scores.iter().zip([false, true]) {
            let (old, new) = (&mut self.old[..], &mut self.new[..]);
            let mut changed = 0;
            for same in scores.at(values) {
                for (n, at) in same {
                    let (node, score) = (&mut nodes[*n], numbers[*at as usize]);
                    if node.state != State::Clean {
                        continue;
                    }
                    if let Some(Side::Total(t)) = node.side.as_deref_mut() {
                        if node.score == 0.0 {
                            before.likelihood.merge(&t.sum);
                        }
                        t.sum = ExactSum::default();
                    }
                    (old[changed], new[changed]) = (node.score, score);
                    node.score = score;
                    changed += 1;
                }
            }
            before.of(observed).add_all(&old[..changed]);
            after.of(observed).add_all(&new[..changed]);
        }
    }
}

/// True if a node with this operation and side can take a score that is one term.
fn takes_one(op: &Op, side: Option<&Side>) -> bool {
    match (op, side) {
        (Op::Draw { .. }, Some(Side::Choice(c))) => c.elements == NONE,
        (Op::Draw { .. } | Op::Observe { .. } | Op::Factor { .. }, None) => true,
        (Op::Observe { .. }, Some(Side::Total(_))) => true,
        _ => false,
    }
}

/// True if a node exists, and depends on choices that are summed out through these values.
fn holds(graph: &Graph, given: &Given, n: NodeId, values: &[usize]) -> bool {
    let same = |(x, value): &(u32, u32)| values.get(*x as usize) == Some(&(*value as usize));
    given.iter().all(same) && graph.store[n].state == State::Clean
}

/// Replaces an array, in its own memory if nothing else holds it.
fn put(value: &mut Value, xs: &[f64]) {
    if let Value::Array(old) = value
        && let Some(old) = Arc::get_mut(old)
        && old.len() == xs.len()
    {
        old.copy_from_slice(xs);
        return;
    }
    *value = Value::Array(xs.into());
}

impl Trace {
    /// True if every node of a trace of the same history is the same to the last bit; else
    /// says how one differs.
    pub fn same_nodes(&self, other: &Trace) -> Result<(), String> {
        let (mine, theirs) = (&self.graph, &other.graph);
        let all = |g: &Graph| (g.store.len(), g.score.prior.clone(), g.score.likelihood.clone());
        if all(mine) != all(theirs) {
            return Err(format!("sums {:?}, {:?}", all(mine), all(theirs)));
        }
        for ((i, a), (_, b)) in mine.nodes().zip(theirs.nodes()) {
            // Distributions and objects are the same only if they are one.
            let same_value = match (a.value.downcast(), b.value.downcast()) {
                (Some(CovarianceValue(a)), Some(CovarianceValue(b))) => a == b,
                _ => a.value.same(&b.value) || format!("{:?}", a.value) == format!("{:?}", b.value),
            };
            let rest =
                |n: &Node| (n.score.to_bits(), n.state, n.refs, n.flags, format!("{:?}", n.side));
            if !same_value || rest(a) != rest(b) {
                return Err(format!("node {i:?}: {a:?}, {b:?}"));
            }
        }
        Ok(())
    }
}
