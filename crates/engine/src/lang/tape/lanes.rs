//! Operations on single numbers that differ only in the numbers they read, made one
//! operation on arrays.
//!
//! A loop over data is recorded pass by pass, as separate operations. Each is given a
//! level, above those of everything it reads; operations of one kind and level do not
//! depend on each other, and are run side by side. Their results get consecutive places,
//! so that what reads them in the same order finds an array.

use super::form::Form;
use super::log_sum_exp::{LogSumExp, Term, Terms};
use super::op::{Op, Scored, runs};
use super::{Tape, summed};
use pcadlang_numerics::dist::{Batch, Dist, Product, batch};
use pcadlang_numerics::num::Column;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use std::ops::Range;

/// The properties that operations share if they can be run side by side.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Kind {
    Unary(usize, usize),
    Binary(usize),
    /// The family, the number of columns of parameters, and to which sum the density is
    /// added, if it is.
    Density(std::mem::Discriminant<Dist>, usize, Option<bool>),
    /// By value: which of the terms are observations.
    LogSumExp(Vec<SmallVec<[bool; 4]>>),
}

/// Reads the places of an operation's arguments; for all operations of one kind, there
/// are equally many.
fn arguments(op: &Op) -> Option<(Kind, SmallVec<[Column; 6]>, Option<usize>)> {
    let alone = |at: &usize| Column { at: *at, step: 0, live: true };
    Some(match op {
        Op::Unary { f, slope, x, out, n: 1 } => {
            let kind = Kind::Unary(*f as usize, *slope as usize);
            (kind, SmallVec::from_slice(&[alone(x)]), Some(*out))
        }
        Op::Binary { f, x, y, out, n: 1 } => {
            let kind = Kind::Binary(std::ptr::from_ref(*f) as usize);
            (kind, SmallVec::from_slice(&[*x, *y]), Some(*out))
        }
        Op::Density { x, params, n: 1, observed, out, dist: Some(d), .. } => {
            let added = out.is_none().then_some(*observed);
            let kind = Kind::Density(std::mem::discriminant(d), params.len(), added);
            (kind, std::iter::once(*x).chain(params.iter().copied()).collect(), *out)
        }
        Op::LogSumExp(l) if l.n == 1 => {
            let observed = l.values.iter().map(|ts| ts.iter().map(|t| t.observed).collect());
            let kind = Kind::LogSumExp(observed.collect());
            (kind, l.values.iter().flatten().map(|t| t.column).collect(), Some(l.out))
        }
        _ => return None,
    })
}

/// Calls `f` with each run of numbers that any operation reads or writes: its start, its
/// length, and whether it is written.
fn each_run(op: &Op, f: &mut dyn FnMut(usize, usize, bool)) {
    let column = |c: &Column, n: usize, f: &mut dyn FnMut(usize, usize, bool)| {
        f(c.at, if c.step == 0 { 1 } else { n }, false);
    };
    let form = |form: &Form, written: bool, f: &mut dyn FnMut(usize, usize, bool)| {
        form.each_number(&mut |at| f(at, 1, written));
    };
    match op {
        Op::Unary { x, out, n, .. } => {
            f(*x, *n, false);
            f(*out, *n, true);
        }
        Op::Binary { x, y, out, n, .. } => {
            column(x, *n, f);
            column(y, *n, f);
            f(*out, *n, true);
        }
        Op::Reduce { x, n, out, .. } => {
            f(*x, *n, false);
            f(*out, 1, true);
        }
        Op::Matrix { rows, x, width, out, n } => {
            f(*rows, width * n, false);
            f(*x, *width, false);
            f(*out, *n, true);
        }
        Op::Gather { from, out } => {
            from.iter().for_each(|at| f(*at, 1, false));
            f(*out, from.len(), true);
        }
        Op::Call { args, out, .. } => {
            args.iter().for_each(|a| form(a, false, f));
            form(out, true, f);
        }
        Op::Coloured { dist, noise, out, n, .. } => {
            form(dist, false, f);
            form(noise, false, f);
            f(*out, *n, true);
        }
        Op::Guard { form: g, .. } => form(g, false, f),
        Op::Density { x, params, out, n, .. } => {
            std::iter::once(x).chain(params).for_each(|c| column(c, *n, f));
            if let Some(out) = out {
                f(*out, *n, true);
            }
        }
        Op::Score { dist, x, out, .. } => {
            form(dist, false, f);
            form(x, false, f);
            if let Some(out) = out {
                f(*out, 1, true);
            }
        }
        Op::Factor { x } => f(*x, 1, false),
        Op::LogSumExp(l) => {
            l.values.iter().flatten().for_each(|t| column(&t.column, l.n, f));
            f(l.out, l.n, true);
        }
        Op::Total { from } => from.iter().for_each(|run| f(run.start, run.len(), false)),
    }
}

/// Operations that are run side by side, at one level.
struct Group {
    level: u32,
    members: Vec<usize>,
}

/// Puts the operations of a tape into groups, in an order in which they can run.
fn groups(ops: &[Op], size: usize) -> Vec<Group> {
    // Arrays that an operation reads as such stay where they are.
    let mut pinned = vec![false; size];
    for op in ops.iter().rev().filter(|op| !matches!(op, Op::Total { .. })) {
        let stays = match arguments(op) {
            Some((_, _, out)) => out.is_some_and(|out| pinned[out]),
            None => true,
        };
        if stays {
            each_run(op, &mut |at, n, _| pinned[at..at + n].fill(true));
        }
    }
    let mut levels = vec![0; size];
    let mut groups: Vec<Group> = Vec::new();
    let mut places: FxHashMap<(u32, Kind), usize> = FxHashMap::default();
    for (k, op) in ops.iter().enumerate() {
        let mut level = 0;
        each_run(op, &mut |at, n, written| {
            if !written {
                level = levels[at..at + n].iter().fold(level, |l: u32, own| l.max(*own));
            }
        });
        level += 1;
        each_run(op, &mut |at, n, written| {
            if written {
                levels[at..at + n].fill(level);
            }
        });
        let kind = arguments(op).filter(|(_, _, out)| out.is_none_or(|out| !pinned[out]));
        let place = kind.map(|(kind, ..)| *places.entry((level, kind)).or_insert(groups.len()));
        match place.and_then(|p| groups.get_mut(p)) {
            Some(group) => group.members.push(k),
            None => groups.push(Group { level, members: vec![k] }),
        }
    }
    groups.sort_by_key(|g| g.level);
    groups
}

/// Where merging put the results and operations that were elsewhere before.
#[derive(Debug, Default)]
pub(super) struct Moved {
    numbers: FxHashMap<usize, usize>,
    /// By old operation: where its scores are.
    scores: Vec<Scored>,
}

impl Moved {
    fn number(&self, at: usize) -> usize {
        self.numbers.get(&at).copied().unwrap_or(at)
    }

    /// Where the numbers of a form are now.
    pub fn form(&self, form: &Form) -> Form {
        form.with_places(&|at| self.number(at))
    }

    /// Where a score is now.
    pub fn scored(&self, scored: &Scored) -> Scored {
        match scored {
            Scored::Operation(op) => self.scores.get(*op).unwrap_or(scored).clone(),
            // Only results of one number are moved.
            Scored::Numbers(at, is_array) => {
                let first = self.number(at.start);
                Scored::Numbers(first..first + at.len(), *is_array)
            }
            Scored::Member(..) => scored.clone(),
        }
    }
}

/// Merges the operations of a tape.
pub(super) fn merge(tape: &mut Tape) {
    let ops = std::mem::take(&mut tape.ops);
    let groups = groups(&ops, tape.values.numbers.len());
    let mut old: Vec<Option<Op>> = ops.into_iter().map(Some).collect();
    let mut merger = Merger {
        values: &mut tape.values.numbers,
        moved: FxHashMap::default(),
        ops: Vec::new(),
        scores: vec![Scored::Operation(0); old.len()],
    };
    for group in groups {
        let members: Vec<(usize, Op)> =
            group.members.iter().filter_map(|k| Some((*k, old[*k].take()?))).collect();
        merger.add(members);
    }
    tape.ops = merger.ops;
    tape.moved = Moved { numbers: merger.moved, scores: merger.scores };
    summed::move_sums(&mut tape.summed, |at| tape.moved.number(at));
    summed::find_sums(&mut tape.summed, &tape.ops);
    tape.used = used(tape);
}

/// Up to how many numbers without use are filled with the others around them: a call for
/// each short run costs more.
const GAP: usize = 128;

/// Returns the columns that an operation reads and adds no derivatives to.
fn given_columns(op: &Op) -> impl Iterator<Item = &Column> {
    let (pair, params, values): (_, &[Column], &[Terms]) = match op {
        Op::Binary { x, y, .. } => ([Some(x), Some(y)], &[], &[]),
        Op::Density { x, params, .. } => ([Some(x), None], params, &[]),
        Op::LogSumExp(l) => ([None; 2], &[], &l.values),
        _ => ([None; 2], &[], &[]),
    };
    let terms = values.iter().flatten().map(|t| &t.column);
    pair.into_iter().flatten().chain(params).chain(terms).filter(|c| !c.live)
}

/// Returns the runs of numbers whose adjoints are used, and of few others.
fn used(tape: &Tape) -> Vec<Range<usize>> {
    let mut is_used = vec![false; tape.values.numbers.len()];
    for op in &tape.ops {
        // Nothing is added to the adjoints of numbers that are given, like data.
        let given: SmallVec<[usize; 8]> = given_columns(op).map(|c| c.at).collect();
        each_run(op, &mut |at, n, written| {
            if written || !given.contains(&at) {
                is_used[at..at + n].fill(true);
            }
        });
    }
    tape.inputs.iter().for_each(|i| i.form.each_place(&mut |at| is_used[at] = true));
    let mut runs: Vec<Range<usize>> = Vec::new();
    for at in (0..is_used.len()).filter(|at| is_used[*at]) {
        match runs.last_mut() {
            Some(run) if at - run.end <= GAP => run.end = at + 1,
            _ => runs.push(at..at + 1),
        }
    }
    runs
}

struct Merger<'a> {
    values: &'a mut Vec<f64>,
    /// Where results are that were elsewhere before.
    moved: FxHashMap<usize, usize>,
    ops: Vec<Op>,
    /// By old operation: where its scores are.
    scores: Vec<Scored>,
}

impl Merger<'_> {
    fn reserve(&mut self, n: usize) -> usize {
        let at = self.values.len();
        self.values.resize(at + n, f64::NAN);
        at
    }

    /// Adds the operations of one group.
    fn add(&mut self, members: Vec<(usize, Op)>) {
        let (old, members): (Vec<usize>, Vec<Op>) = members.into_iter().unzip();
        if members.len() > 1 && self.side_by_side(&members) {
            let op = self.ops.len() - 1;
            for (place, (k, member)) in old.iter().zip(&members).enumerate() {
                let is_array = matches!(member, Op::Density { x, .. } if x.step != 0);
                self.scores[*k] = Scored::Member(op, place, is_array);
            }
            return;
        }
        for (k, mut op) in old.into_iter().zip(members) {
            self.redirect(&mut op);
            self.scores[k] = Scored::Operation(self.ops.len());
            self.ops.push(op);
        }
    }

    /// Makes an operation read results where they are now, and moves its own result behind
    /// them if it can be anywhere.
    fn redirect(&mut self, op: &mut Op) {
        let mut reads = SmallVec::<[usize; 8]>::new();
        each_run(op, &mut |at, _, written| reads.extend((!written).then_some(at)));
        let moves = reads.iter().any(|at| self.moved.contains_key(at));
        if let (true, Some((_, _, Some(before)))) = (moves, arguments(op)) {
            let after = self.reserve(1);
            self.moved.insert(before, after);
            match op {
                Op::Unary { out, .. }
                | Op::Binary { out, .. }
                | Op::Density { out: Some(out), .. }
                | Op::LogSumExp(LogSumExp { out, .. }) => *out = after,
                _ => {}
            }
        }
        let to = |at: &mut usize| *at = self.moved.get(at).copied().unwrap_or(*at);
        if let Op::Total { from } = op {
            let places = from.iter().flat_map(Range::clone);
            *from = runs(places.map(|at| self.moved.get(&at).copied().unwrap_or(at)));
        }
        if arguments(op).is_none() {
            return;
        }
        match op {
            Op::Unary { x, .. } => to(x),
            Op::Binary { x, y, .. } => [x, y].into_iter().for_each(|c| to(&mut c.at)),
            Op::Density { x, params, .. } => {
                std::iter::once(x).chain(params).for_each(|c| to(&mut c.at));
            }
            Op::LogSumExp(l) => {
                l.values.iter_mut().flatten().for_each(|t| to(&mut t.column.at));
            }
            _ => {}
        }
    }

    /// Adds operations of one kind as one; false if that is not possible.
    fn side_by_side(&mut self, members: &[Op]) -> bool {
        let n = members.len();
        let all: Option<Vec<_>> = members.iter().map(arguments).collect();
        let Some(all) = all else { return false };
        let Some((_, first, has_result)) = all.first() else { return false };
        let mut columns: SmallVec<[Column; 6]> =
            (0..first.len()).map(|i| self.column(all.iter().map(|(_, a, _)| a[i]))).collect();
        if let Op::Unary { .. } = members[0] {
            columns[0] = self.spread(columns[0], n);
        }
        let out = if has_result.is_some() { self.reserve(n) } else { 0 };
        let op = match &members[0] {
            Op::Unary { f, slope, .. } => {
                Op::Unary { f: *f, slope: *slope, x: columns[0].at, out, n }
            }
            Op::Binary { f, .. } => Op::Binary { f, x: columns[0], y: columns[1], out, n },
            Op::Density { observed, .. } => {
                let params: SmallVec<[Column; 3]> = SmallVec::from_slice(&columns[1..]);
                let Some(batch) = side_by_side(members, &params) else { return false };
                let (x, observed, out) = (columns[0], *observed, has_result.map(|_| out));
                Op::Density { batch, x, params, n, observed, out, dist: None }
            }
            Op::LogSumExp(l) => {
                let mut columns = columns.into_iter();
                let mut values = l.values.clone();
                for t in values.iter_mut().flatten() {
                    if let Some(column) = columns.next() {
                        *t = Term { column, ..*t };
                    }
                }
                Op::LogSumExp(LogSumExp { values, out, n, shares: Vec::new() })
            }
            _ => return false,
        };
        self.ops.push(op);
        for (i, (_, _, before)) in all.iter().enumerate() {
            if let Some(before) = before {
                self.moved.insert(*before, out + i);
            }
        }
        true
    }

    /// Returns single numbers as a column.
    fn column(&mut self, all: impl Iterator<Item = Column>) -> Column {
        let to = |c: Column| Column { at: self.moved.get(&c.at).copied().unwrap_or(c.at), ..c };
        let all: Vec<Column> = all.map(to).collect();
        let (first, live) = (all[0].at, all.iter().any(|c| c.live));
        if all.iter().all(|c| c.at == first) {
            return Column { at: first, step: 0, live };
        }
        if all.iter().enumerate().all(|(i, c)| c.at == first + i) {
            return Column { at: first, step: 1, live };
        }
        let out = self.reserve(all.len());
        if live {
            let from = all.iter().map(|c| c.at).collect();
            self.ops.push(Op::Gather { from, out });
        } else {
            (0..all.len()).for_each(|i| self.values[out + i] = self.values[all[i].at]);
            let alike = |i: usize| self.values[out + i].to_bits() == self.values[out].to_bits();
            if (0..all.len()).all(alike) {
                return Column { at: out, step: 0, live };
            }
        }
        Column { at: out, step: 1, live }
    }

    /// Returns a column without repetition.
    fn spread(&mut self, c: Column, n: usize) -> Column {
        if c.step == 1 {
            return c;
        }
        let out = self.reserve(n);
        self.ops.push(Op::Gather { from: vec![c.at; n].into(), out });
        Column { at: out, step: 1, ..c }
    }
}

/// Returns the batch of densities that were recorded one by one.
fn side_by_side(members: &[Op], params: &[Column]) -> Option<Box<dyn Batch>> {
    let of = |op: &Op| match op {
        Op::Density { dist, .. } => dist.clone(),
        _ => None,
    };
    let parts = members.iter().map(of).collect::<Option<Vec<Dist>>>()?;
    let shared = !params.is_empty() && params.iter().all(|c| c.step == 0);
    match parts.first() {
        Some(one) if shared => batch(one, params),
        _ => batch(&Dist::from(Product::new(parts).ok()?), params),
    }
}
