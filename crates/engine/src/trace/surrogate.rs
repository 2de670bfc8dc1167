//! Surrogate traces, for delayed acceptance: a trace with the same choices as that of the
//! program, in which surrogates replace some observations.

use super::propose::{Change, Constraint, Draws, Weight};
use super::{Selector, Target, Trace, TraceResult};
use crate::lang::code::{Op, OpId};
use rustc_hash::FxHashMap;
use std::cmp::Ordering;
use std::sync::Arc;

impl Trace {
    /// Returns a trace with the same choices in which the selected observations are
    /// replaced by their coarse surrogates, including observations that do not exist in
    /// this state; `None` if none of them has a surrogate. An observation in a loop or
    /// function is replaced in all its instances.
    ///
    /// # Errors
    /// If the evaluation of the surrogates fails.
    pub fn under_surrogates(&self, at: &Selector) -> TraceResult<Option<Trace>> {
        let ops = self.coarse_observations(at);
        if ops.is_empty() {
            return Ok(None);
        }
        let code = Arc::new(self.present_code().with_surrogates(&ops));
        let (mut surrogate, _) = Trace::generate(
            code,
            self.constraints(),
            Draws::default(),
            self.graph.budget.limits.clone(),
        )?;
        surrogate.graph.store.observed = Arc::clone(&self.graph.store.observed);
        surrogate.graph.store.incremental = self.graph.incremental;
        Ok(Some(surrogate))
    }

    /// Returns the selected observations that have a coarse surrogate, also those that do not exist
    /// in this state.
    pub(super) fn coarse_observations(&self, at: &Selector) -> Vec<OpId> {
        let mut present: FxHashMap<OpId, bool> = FxHashMap::default();
        for n in self.scored_nodes() {
            *present.entry(self.graph.store[n].op).or_default() |= at.names(&self.graph.address(n));
        }
        let named = |op: &OpId| match &self.code.ops[*op] {
            Op::Observe { coarse: Some(_), site, .. } => {
                let segments = self.code.sites[*site].segments.iter().map(|s| &*s.name);
                present
                    .get(op)
                    .copied()
                    .unwrap_or_else(|| at.may_name(&segments.collect::<Vec<_>>()))
            }
            _ => false,
        };
        (0..self.code.ops.len()).map(OpId::new).filter(named).collect()
    }

    /// Proposes the values of another trace's choices. Choices that the other trace does
    /// not have keep their values.
    ///
    /// # Errors
    /// As [`Trace::propose`].
    pub fn propose_choices_of(&mut self, other: &Trace) -> TraceResult<Weight> {
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

    /// Returns the address hashes of the choices that another trace does not have.
    pub fn beyond(&self, other: &Trace) -> Vec<u64> {
        let mut own = Vec::new();
        pairs(self, other, |here, there| {
            if let (Some(t), None) = (here, there) {
                own.push(self.graph.choice_hash(t.node));
            }
        });
        own
    }

    /// True if the pending proposal removes a choice at one of these addresses, even if
    /// another one replaces it.
    pub fn takes_away(&self, addresses: &[u64]) -> bool {
        self.graph.update.removed.iter().any(|(_, hash, _)| addresses.contains(hash))
    }

    /// Returns the first choice of another trace that this one does not have.
    pub fn lacks(&self, other: &Trace) -> Option<Target> {
        let mut found = None;
        pairs(self, other, |here, there| {
            if here.is_none() {
                found = found.or(there);
            }
        });
        found
    }
}

/// Iterates over the choices of two traces in parallel, by the hashes of their addresses.
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
