//! Two traces with the same choices under different scores: one is the trace of a
//! program, the other that of the same program with surrogates in place of some
//! observations. What delayed acceptance is made of.

use super::propose::{Change, Constraint, Draws, Weight};
use super::{Selector, Target, Trace, TraceResult};
use crate::lang::code::Op;
use rustc_hash::FxHashMap;
use std::cmp::Ordering;
use std::sync::Arc;

impl Trace {
    /// The same choices with the coarse surrogates of the selected observations in their
    /// place, also of those that are not there now; `None` if none of them has one. An
    /// operation in a loop or function changes as a whole.
    ///
    /// # Errors
    /// What goes wrong while the surrogates are evaluated.
    pub(crate) fn under_surrogates(&self, at: &Selector) -> TraceResult<Option<Trace>> {
        let mut present: FxHashMap<u32, bool> = FxHashMap::default();
        for n in self.scored_nodes() {
            *present.entry(self.graph.nodes[n as usize].op).or_default() |=
                at.names(&self.graph.address(&self.code, n));
        }
        let named = |op: &u32| match &self.code.ops[*op as usize] {
            Op::Observe { coarse: Some(_), site, .. } => {
                let segments = self.code.sites[*site as usize].segments.iter().map(|s| &*s.name);
                present
                    .get(op)
                    .copied()
                    .unwrap_or_else(|| at.may_name(&segments.collect::<Vec<_>>()))
            }
            _ => false,
        };
        let ops: Vec<u32> = (0..self.code.ops.len() as u32).filter(named).collect();
        if ops.is_empty() {
            return Ok(None);
        }
        let code = Arc::new(self.present_code().with_surrogates(&ops));
        let (mut surrogate, _) =
            Trace::generate(code, self.constraints(), Draws::default(), self.graph.limits.clone())?;
        surrogate.graph.observed = Arc::clone(&self.graph.observed);
        surrogate.graph.incremental = self.graph.incremental;
        Ok(Some(surrogate))
    }

    /// Proposes the values that another trace's choices have. Choices that the other one
    /// has not stay as they are.
    ///
    /// # Errors
    /// As [`Trace::propose`].
    pub(crate) fn propose_choices_of(&mut self, other: &Trace) -> TraceResult<Weight> {
        self.rollback();
        let (mut changes, mut constraints) = (Vec::new(), Vec::new());
        pairs(self, other, |here, there| {
            let Some((t, value)) = there.and_then(|t| Some((t, other.stored(t)?))) else { return };
            match here {
                Some(h) if self.stored(h).as_ref() == Some(&value) => {}
                Some(h) => changes.push((h, Change::Set(value))),
                None => constraints.push((other.address_hash(t), Constraint::Stored(value))),
            }
        });
        self.propose_constrained(&changes, &constraints, Draws::default())
    }

    /// Hashes of the addresses of the choices that another trace has not.
    pub(crate) fn beyond(&self, other: &Trace) -> Vec<u64> {
        let mut own = Vec::new();
        pairs(self, other, |here, there| {
            if let (Some(t), None) = (here, there) {
                own.push(self.graph.choice_hash(&self.code, t.node));
            }
        });
        own
    }

    /// Whether the pending proposal takes away a choice at one of these addresses, also
    /// if another one comes in its place.
    pub(crate) fn takes_away(&self, addresses: &[u64]) -> bool {
        self.graph.removed.iter().any(|(_, hash, _)| addresses.contains(hash))
    }

    /// The first choice of another trace that this one has not.
    pub(crate) fn lacks(&self, other: &Trace) -> Option<Target> {
        let mut found = None;
        pairs(self, other, |here, there| {
            if here.is_none() {
                found = found.or(there);
            }
        });
        found
    }
}

/// Goes through the choices of two traces side by side, by the hashes of their addresses.
fn pairs(a: &Trace, b: &Trace, mut f: impl FnMut(Option<Target>, Option<Target>)) {
    let (mut left, mut right) =
        (a.all_targets().iter().copied().peekable(), b.all_targets().iter().copied().peekable());
    loop {
        let order = match (left.peek(), right.peek()) {
            (None, None) => return,
            (Some(_), None) => Ordering::Less,
            (None, Some(_)) => Ordering::Greater,
            (Some(l), Some(r)) => a.address_hash(*l).cmp(&b.address_hash(*r)),
        };
        let l = if order == Ordering::Greater { None } else { left.next() };
        let r = if order == Ordering::Less { None } else { right.next() };
        f(l, r);
    }
}
