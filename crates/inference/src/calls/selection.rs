//! The choices that a plan selects: its selections with their computed keys evaluated.

use crate::calls::error::fail;
use crate::calls::formula::{PlanEnv, pattern};
use crate::kernel::SiteSelection;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::key::Key;
use pcadlang_engine::lang::plan::{Choices, Selection};
use pcadlang_engine::trace::{ChoiceKind, Draws, PatternSegment, Selector, Trace};
use pcadlang_syntax::span::Span;
use std::sync::Arc;

/// The choices of a selection outside of plans, whose keys are constants.
///
/// # Errors
/// If a key is not one.
pub fn selected(s: &Selection, trace: &mut Trace) -> Result<Selector, Box<RunError>> {
    selector(s, &mut PlanEnv::before(trace, Draws::default()))
}

/// The choices that a kernel applies to.
///
/// # Errors
/// If a computed key fails.
pub(crate) fn scope(c: &Choices, env: &mut PlanEnv) -> Result<SiteSelection, Box<RunError>> {
    Ok(SiteSelection { selector: selector(&c.selection, env)?, pick: c.pick })
}

/// The choices of a selection.
///
/// # Errors
/// If a computed key fails.
pub(crate) fn selector(s: &Selection, env: &mut PlanEnv) -> Result<Selector, Box<RunError>> {
    let mut both = |a: &Selection, b: &Selection| -> Result<_, Box<RunError>> {
        Ok((Box::new(selector(a, env)?), Box::new(selector(b, env)?)))
    };
    Ok(match s {
        Selection::Union(a, b) => both(a, b).map(|(a, b)| Selector::Union(a, b))?,
        Selection::Both(a, b) => both(a, b).map(|(a, b)| Selector::Both(a, b))?,
        Selection::Minus(a, b) => both(a, b).map(|(a, b)| Selector::Minus(a, b))?,
        Selection::Tag(name, value) => tag(name, value.as_ref()),
        Selection::Path(path) => match pattern(path, env)? {
            p if p.segments == [PatternSegment::Deep] => Selector::All,
            p => Selector::Address(p),
        },
    })
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

/// The error of an expression that is not a selection.
pub fn not_a_selection(span: Span) -> Box<RunError> {
    let mut e = fail(span, "expected a selection of choices".into());
    e.hint = Some(
        "an address such as @**, a tag such as $affine, or a combination of these with +, - or &"
            .into(),
    );
    e
}
