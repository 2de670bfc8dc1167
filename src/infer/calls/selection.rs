//! Reads selections from program text into [`Selector`]s.

use crate::infer::calls::expr::{PlanEnv, evaluate};
use crate::infer::kernel::{self, Pick};
use crate::lang::error::{Fault, FaultKind, RunError};
use crate::lang::key::Key;
use crate::syntax::ast::{self, BinaryOp, Expr, ExprKind, SegmentName};
use crate::syntax::span::Span;
use crate::trace::{
    Address, AddressSegment, ChoiceKind, Draws, Pattern, PatternSegment, Selector, Trace,
};
use std::sync::Arc;

/// Reads a selection, optionally inside `one(…)` or `each(…)`.
///
/// # Errors
/// If the expression is not a selection, or a computed key fails.
pub(crate) fn scope(e: &Expr, env: &mut PlanEnv) -> Result<kernel::SiteSelection, Box<RunError>> {
    if let Some((name, [arg])) = crate::infer::plan::call(e)
        && let Some(pick) = pick(name)
    {
        return Ok(kernel::SiteSelection { selector: selector(&arg.value, env)?, pick });
    }
    Ok(kernel::SiteSelection { selector: selector(e, env)?, pick: Pick::All })
}

/// Whether an argument is a selection, optionally inside `one(…)` or `each(…)`.
pub(in crate::infer) fn target(e: &Expr) -> bool {
    match &e.kind {
        ExprKind::Address(_) | ExprKind::TagSel { .. } => true,
        ExprKind::Binary { left, .. } => target(left),
        _ => crate::infer::plan::call(e).is_some_and(|(name, args)| {
            pick(name).is_some() && args.first().is_some_and(|a| target(&a.value))
        }),
    }
}

fn pick(name: &str) -> Option<Pick> {
    match name {
        "one" => Some(Pick::One),
        "each" => Some(Pick::Each),
        _ => None,
    }
}

/// Reads a selection outside of inference blocks; computed keys are evaluated in `trace`.
///
/// # Errors
/// If the expression is not a selection, or a computed key fails.
pub fn selected(e: &Expr, trace: &mut Trace, draws: Draws) -> Result<Selector, Box<RunError>> {
    let code = Arc::clone(trace.code());
    let started = crate::platform::clock::Instant::now();
    selector(
        e,
        &mut PlanEnv { code: &code, trace, variables: &[], draws, started, steps: 0, moved: None },
    )
}

/// Reads a selection.
///
/// # Errors
/// As [`scope`].
pub(crate) fn selector(e: &Expr, env: &mut PlanEnv) -> Result<Selector, Box<RunError>> {
    match &e.kind {
        ExprKind::Address(a) => pattern(a, env).map(|p| match &p.segments[..] {
            [PatternSegment::Deep] => Selector::All,
            _ => Selector::Address(p),
        }),
        ExprKind::TagSel { name, value } => Ok(tag(name, value.as_ref())),
        ExprKind::Binary { op, left, right } => {
            let (a, b) = (Box::new(selector(left, env)?), Box::new(selector(right, env)?));
            match op {
                BinaryOp::Add => Ok(Selector::Union(a, b)),
                BinaryOp::Sub => Ok(Selector::Minus(a, b)),
                BinaryOp::Intersect => Ok(Selector::Both(a, b)),
                _ => Err(not_a_selection(e.span)),
            }
        }
        _ => Err(not_a_selection(e.span)),
    }
}

fn tag(name: &Arc<str>, value: Option<&Arc<str>>) -> Selector {
    let kind = match &**name {
        "continuous" => Some(ChoiceKind::Continuous),
        "discrete" => Some(ChoiceKind::Discrete),
        "gaussian" => Some(ChoiceKind::Gaussian),
        "finite" => Some(ChoiceKind::Finite),
        _ => None,
    };
    match (kind, value) {
        (Some(k), None) => Selector::Kind(k),
        _ => Selector::Tag { name: Arc::clone(name), value: value.map(|v| literal_key(v)) },
    }
}

/// The key denoted by a tag's value: a number if it parses as one.
fn literal_key(text: &str) -> Key {
    match text.parse::<f64>().ok().and_then(Key::num) {
        Some(k) => k,
        None => Key::Str(Arc::from(text.trim_matches('"'))),
    }
}

/// Reads an address pattern.
///
/// # Errors
/// If a computed key fails or is not a key.
pub(crate) fn pattern(a: &ast::Address, env: &mut PlanEnv) -> Result<Pattern, Box<RunError>> {
    let mut segments = Vec::with_capacity(a.segments.len());
    for s in &a.segments {
        let name = match &s.name {
            SegmentName::Deep => {
                segments.push(PatternSegment::Deep);
                continue;
            }
            SegmentName::Any => None,
            SegmentName::Name(n) => Some(Arc::clone(n)),
        };
        let mut keys = Vec::with_capacity(s.keys.len());
        for k in &s.keys {
            keys.push(match k {
                ast::Key::Str(s) => Some(Key::Str(Arc::clone(s))),
                ast::Key::Num(x) => Key::num(*x),
                ast::Key::Any => None,
                ast::Key::Expr(e) => {
                    let v = evaluate(e, env)?;
                    let key = Key::from_value(&v);
                    Some(key.ok_or_else(|| {
                        fail(e.span, format!("{} cannot be used as a key", v.type_name()))
                    })?)
                }
            });
        }
        segments.push(PatternSegment::Segment { name, occurrence: s.occurrence, keys });
    }
    Ok(Pattern { segments })
}

/// Reads the address of a single choice; keys may be computed.
///
/// # Errors
/// If it has wildcards, or a computed key fails or is not a key.
pub(crate) fn address(e: &Expr, env: &mut PlanEnv) -> Result<Address, Box<RunError>> {
    let one = || fail(e.span, "expected the address of a single choice, without wildcards".into());
    let ExprKind::Address(a) = &e.kind else { return Err(one()) };
    let mut segments = Vec::with_capacity(a.segments.len());
    for s in pattern(a, env)?.segments {
        let PatternSegment::Segment { name: Some(name), occurrence, keys } = s else {
            return Err(one());
        };
        let keys = keys.into_iter().collect::<Option<Vec<Key>>>().ok_or_else(one)?;
        segments.push(AddressSegment { name, occurrence: occurrence.max(1), keys });
    }
    Ok(Address { segments })
}

fn not_a_selection(span: Span) -> Box<RunError> {
    let mut e = fail(span, "expected a selection of choices".into());
    e.hint = Some(
        "an address such as @**, a tag such as $affine, or a combination of these with +, - or &"
            .into(),
    );
    e
}

/// The error of a built-in, with its position in a plan.
pub(in crate::infer) fn fault(span: Span, f: Fault) -> Box<RunError> {
    Box::new(RunError { hint: f.hint, ..*fail(span, f.message) })
}

/// An error in an inference block.
pub(crate) fn fail(span: Span, message: String) -> Box<RunError> {
    Box::new(RunError {
        kind: FaultKind::Type,
        message,
        span,
        address: Default::default(),
        calls: Vec::new(),
        hint: None,
    })
}
