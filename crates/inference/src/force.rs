//! `force @a = v`: sets a choice at the start of a chain. Its prior score is kept, and
//! kernels may change it.

use super::calls::error::fail;
use pcadlang_engine::lang::code::{Code, Force};
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::trace::{Address, AddressSegment, Change, Draws, Trace};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_syntax::ast;
use std::sync::Arc;

/// Applies the program's `force` statements in order.
///
/// # Errors
/// If an address does not name exactly one choice, or the value does not fit it.
pub(crate) fn apply(
    code: &Arc<Code>,
    trace: &mut Trace,
    (seed, chain): (u64, u32),
) -> Result<(), Box<RunError>> {
    let draws =
        Draws { key: StreamKey::new(seed, chain, Purpose::START), step: u64::MAX, substream: 0 };
    put(&code.forces, trace, draws)
}

/// Applies `force` statements of the trace's program.
///
/// # Errors
/// As [`apply`].
pub fn put(forces: &[Force], trace: &mut Trace, draws: Draws) -> Result<(), Box<RunError>> {
    for f in forces {
        let value = trace.query(&[f.value], draws)?.swap_remove(0);
        let Some(address) = literal(&f.target) else {
            return Err(fail(
                f.span,
                "`force` needs the address of one choice, without wildcards".into(),
            ));
        };
        let Some(target) = trace.find(&address) else {
            let known: Vec<String> =
                trace.choices().iter().map(|(a, _, _)| a.to_string()).collect();
            let mut e = fail(f.span, format!("no observation depends on a choice {address}"));
            let near = pcadlang_syntax::diag::nearest(
                &address.to_string(),
                known.iter().map(String::as_str),
            );
            let all = || format!("the choices are {}", known[..known.len().min(8)].join(", "));
            e.hint = Some(near.map_or_else(all, |n| format!("did you mean {n}?")));
            return Err(e);
        };
        let dist = trace.dist(target);
        let datum = value.to_datum().and_then(|d| match &dist {
            Some(dist) if dist.is_stored_whitened() => dist.to_noncentred(&d),
            _ => Some(d),
        });
        let Some(datum) = datum else {
            return Err(fail(f.span, format!("{address} cannot be {}", value.type_name())));
        };
        trace.propose(&[(target, Change::Set(datum))], draws)?;
        trace.commit();
        if trace.log_prior() == f64::NEG_INFINITY {
            return Err(fail(
                f.span,
                format!("{address} cannot be {value}: its prior density is zero there"),
            ));
        }
    }
    Ok(())
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
                ast::Key::Str(s) => Some(pcadlang_engine::lang::key::Key::Str(Arc::clone(s))),
                ast::Key::Num(x) => pcadlang_engine::lang::key::Key::num(*x),
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
