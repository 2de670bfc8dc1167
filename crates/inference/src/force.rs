//! `force @a = v`: sets a choice at the start of a chain, before the search for a state
//! of positive probability. Its prior score is kept, and kernels may change it.

use super::calls::error::fail;
use super::init::RETRIES;
use pcadlang_engine::lang::code::{Code, Force};
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::key::Key;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{
    Address, AddressSegment, Change, Constraint, Draws, Limits, Target, Trace, TraceResult,
};
use pcadlang_numerics::rng::StreamKey;
use pcadlang_syntax::ast;
use std::sync::Arc;

/// The `force` statements of a program.
#[derive(Clone, Debug, Default)]
pub(crate) struct Forced {
    statements: Arc<[(Force, Address)]>,
    /// The values that depend on no choice, by the hash of the address: states are drawn with
    /// them. The others are set in each state that was drawn.
    given: Vec<(u64, Constraint)>,
}

/// The knowledge of a statement, from the states that were drawn so far.
enum Known {
    /// No state had its choice.
    Nothing,
    /// This value of the choice had prior density zero in all states that had it.
    Zero(Value),
}

impl Forced {
    /// The statements of a program after the first `known`, checked by draws of its states.
    ///
    /// # Errors
    /// If an address does not name a single choice, no state has its choice, or the value does
    /// not fit it in any state.
    pub fn of(
        code: &Arc<Code>,
        known: usize,
        key: StreamKey,
        limits: &Limits,
    ) -> Result<Forced, Box<RunError>> {
        let all = code.forces.get(known..).unwrap_or_default();
        if all.is_empty() {
            return Ok(Forced::default());
        }
        let mut forced = Forced::default();
        let mut statements = Vec::with_capacity(all.len());
        let mut nothing = Trace::prior(Arc::clone(code), limits.clone());
        let draws = Draws { key, step: u64::MAX, substream: 0 };
        for f in all {
            let Some(address) = literal(&f.target) else {
                return Err(fail(
                    f.span,
                    "`force` needs the address of one choice, without wildcards".into(),
                ));
            };
            let value = nothing.imagine(&[f.value], draws, |t, mut values| {
                t.all_targets().is_empty().then(|| values.pop()).flatten()
            });
            // A value that needs a choice may fail here and be right in a state.
            if let Some(datum) = value.ok().flatten().and_then(|v| v.to_datum()) {
                forced.given.push((address.hash64(), Constraint::Value(datum)));
            }
            statements.push((f.clone(), address));
        }
        forced.statements = statements.into();
        forced.check(code, key, limits)?;
        Ok(forced)
    }

    /// True if there are no statements.
    pub fn is_empty(&self) -> bool {
        self.statements.is_empty()
    }

    /// Checks that some state has the choice of each statement, and that its value fits there.
    fn check(
        &self,
        code: &Arc<Code>,
        key: StreamKey,
        limits: &Limits,
    ) -> Result<(), Box<RunError>> {
        let mut open: Vec<_> = self.statements.iter().map(|s| (s, Known::Nothing)).collect();
        let mut last = None;
        for step in 0..RETRIES {
            let draws = Draws { key, step, substream: 1 };
            let state = match self.draw(code, (Vec::new(), None), draws, limits) {
                Ok(state) => state,
                Err(e) if e.is_recoverable() => continue,
                Err(e) => return Err(e),
            };
            open.retain_mut(|((_, address), known)| match state.find(address) {
                Some(t) if score(&state, address, t) == f64::NEG_INFINITY => {
                    *known = Known::Zero(state.value(t));
                    true
                }
                found => found.is_none(),
            });
            last = Some(state);
            if open.is_empty() {
                break;
            }
        }
        // Without any state the start says why.
        let (Some(state), Some(((f, address), known))) = (last, open.first()) else {
            return Ok(());
        };
        Err(match known {
            Known::Nothing => missing(f, address, &state),
            Known::Zero(value) => fail(
                f.span,
                format!("{address} cannot be {value}: its prior density is zero there"),
            ),
        })
    }

    /// Values that choices take in a draw: these, but for the choices that are forced.
    pub fn over(&self, mut given: Vec<(u64, Constraint)>) -> Vec<(u64, Constraint)> {
        given.retain(|(hash, _)| self.given.iter().all(|(forced, _)| forced != hash));
        given.extend(self.given.iter().cloned());
        given
    }

    /// Draws a state, in which some more choices have given values; with a spread others are
    /// uniform ([`Trace::started`]).
    ///
    /// # Errors
    /// If the program fails there, or a value does not fit its choice.
    pub fn draw(
        &self,
        code: &Arc<Code>,
        (given, spread): (Vec<(u64, Constraint)>, Option<f64>),
        draws: Draws,
        limits: &Limits,
    ) -> TraceResult<Trace> {
        let (code, given) = (Arc::clone(code), self.over(given));
        let mut state = Trace::started(code, given, spread, draws, limits.clone())?.0;
        self.put(&mut state, draws)?;
        Ok(state)
    }

    /// Sets the choices that a state has. One that does not exist there stays away, unless an
    /// earlier statement makes it appear.
    ///
    /// # Errors
    /// If the program fails there, or a value does not fit its choice.
    pub fn put(&self, state: &mut Trace, draws: Draws) -> Result<(), Box<RunError>> {
        for (f, address) in &*self.statements {
            let Some(target) = state.find(address) else { continue };
            let value = state.query(&[f.value], draws)?.swap_remove(0);
            let dist = state.dist(target);
            let datum = value.to_datum().and_then(|d| match &dist {
                Some(dist) if dist.is_stored_whitened() => dist.to_noncentred(&d),
                _ => Some(d),
            });
            let Some(datum) = datum else {
                return Err(fail(f.span, format!("{address} cannot be {}", value.type_name())));
            };
            if state.stored(target).as_ref() != Some(&datum) {
                state.propose(&[(target, Change::Set(datum.clone()))], draws)?;
                state.commit();
                // Such as an array of another length, in whose place a draw was made.
                if state.find(address).and_then(|t| state.stored(t)).as_ref() != Some(&datum) {
                    let message = format!("{address} cannot be {value}: it does not fit");
                    return Err(fail(f.span, message));
                }
            }
        }
        Ok(())
    }
}

/// Applies the `force` statements of the trace's program after the first `known`.
///
/// # Errors
/// If an address names no choice of any state, or the value does not fit it.
pub fn force(
    code: &Arc<Code>,
    known: usize,
    trace: &mut Trace,
    draws: Draws,
) -> Result<(), Box<RunError>> {
    let limits = trace.limits().clone();
    Forced::of(code, known, draws.key, &limits)?.put(trace, draws)
}

/// The log prior of a choice, or of all elements of one that is an array of them.
fn score(state: &Trace, address: &Address, t: Target) -> f64 {
    let Some(n) = state.elements(t) else { return state.score_of(t) };
    let element = |i: usize| {
        let mut one = address.clone();
        one.segments.last_mut()?.keys.push(Key::num(i as f64)?);
        Some(state.score_of(state.find(&one)?))
    };
    (0..n).filter_map(element).sum()
}

/// The error of an address at which no state has a choice.
fn missing(f: &Force, address: &Address, state: &Trace) -> Box<RunError> {
    let known: Vec<String> = state.choices().iter().map(|(a, _, _)| a.to_string()).collect();
    let mut e = fail(f.span, format!("no observation depends on a choice {address}"));
    let near =
        pcadlang_syntax::diag::nearest(&address.to_string(), known.iter().map(String::as_str));
    let all = || format!("the choices are {}", known[..known.len().min(8)].join(", "));
    e.hint = Some(near.map_or_else(all, |n| format!("did you mean {n}?")));
    e
}

/// The address that an address literal denotes; `None` if it has wildcards or computed
/// keys.
pub(crate) fn literal(a: &ast::Address) -> Option<Address> {
    let mut segments = Vec::with_capacity(a.segments.len());
    for s in &a.segments {
        let ast::SegmentName::Name(name) = &s.name else { return None };
        let keys: Option<Vec<_>> = s
            .keys
            .iter()
            .map(|k| match k {
                ast::Key::Str(s) => Some(Key::Str(Arc::clone(s))),
                ast::Key::Num(x) => Key::num(*x),
                _ => None,
            })
            .collect();
        segments.push(AddressSegment {
            name: Arc::clone(name),
            occurrence: s.occurrence.max(1),
            keys: keys?,
        });
    }
    Some(Address { segments })
}
