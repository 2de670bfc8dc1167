//! The values of a plan's expressions and addresses: what the plan supplies is collected,
//! and the trace evaluates the function.

use crate::calls::error::fail;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::key::Key;
use pcadlang_engine::lang::plan::{Formula, FormulaKind, Given, Path, PathKey, PathSegment};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Address, AddressSegment, Draws, Pattern, PatternSegment, Trace};
use pcadlang_numerics::platform::clock::Instant;
use pcadlang_syntax::span::Span;

/// The environment in which an expression is evaluated.
pub(crate) struct PlanEnv<'a> {
    pub trace: &'a mut Trace,
    /// The variables of the block, innermost last.
    pub variables: &'a [Value],
    pub draws: Draws,
    pub started: Instant,
    pub steps: u64,
    pub moved: Option<Moved<'a>>,
}

/// In a map of a kernel: values of choices in place of their present ones. Nothing else
/// of the state may be read then, so that functions are evaluated in another trace, and a
/// pending proposal stays.
pub(crate) struct Moved<'a> {
    pub choices: &'a [(Address, Value)],
    pub aside: &'a mut Trace,
}

impl<'a> PlanEnv<'a> {
    /// The environment before a chain begins.
    pub fn before(trace: &'a mut Trace, draws: Draws) -> PlanEnv<'a> {
        let started = Instant::now();
        PlanEnv { trace, variables: &[], draws, started, steps: 0, moved: None }
    }

    fn supplied(&mut self, given: &Given, span: Span) -> Result<Value, Box<RunError>> {
        match given {
            Given::Variable(i) => {
                let known = self.variables.get(*i).cloned();
                known.ok_or_else(|| fail(span, "this variable has no value here".into()))
            }
            Given::Steps => Ok(Value::Num(self.steps as f64)),
            Given::Elapsed => Ok(Value::Num(self.started.elapsed().as_secs_f64())),
            Given::Choice(path) => {
                let at = address(path, self)?;
                let moved = self.moved.as_ref().map_or(&[][..], |m| m.choices);
                if let Some((_, v)) = moved.iter().find(|(a, _)| *a == at) {
                    return Ok(v.clone());
                }
                let found = self.trace.find(&at).map(|t| self.trace.value(t));
                found.ok_or_else(|| fail(path.span, format!("this state has no choice {at}")))
            }
            Given::Unavailable(name, span) => {
                Err(fail(*span, format!("`{name}` is not available here")))
            }
        }
    }
}

/// Evaluates an expression.
///
/// # Errors
/// The fault, with its position.
pub(crate) fn evaluate(f: &Formula, env: &mut PlanEnv) -> Result<Value, Box<RunError>> {
    match &f.kind {
        FormulaKind::Const(v) => Ok(v.clone()),
        FormulaKind::Given(given) => env.supplied(given, f.span),
        FormulaKind::Function { block, given, is_closed, is_settled } => {
            let args = given.iter().map(|g| env.supplied(g, f.span)).collect();
            let trace = match &mut env.moved {
                None => &mut *env.trace,
                Some(moved) if *is_closed || *is_settled => &mut *moved.aside,
                Some(_) => return Err(unmapped(f.span)),
            };
            trace.call(*block, args, env.draws)
        }
    }
}

/// The addresses that a path denotes.
///
/// # Errors
/// If a computed key fails or is not a key.
pub(crate) fn pattern(path: &Path, env: &mut PlanEnv) -> Result<Pattern, Box<RunError>> {
    let mut key = |k: &PathKey| -> Result<Option<Key>, Box<RunError>> {
        let e = match k {
            PathKey::Any => return Ok(None),
            PathKey::Fixed(key) => return Ok(Some(key.clone())),
            PathKey::Computed(e) => e,
        };
        let v = evaluate(e, env)?;
        let not = || fail(e.span, format!("{} cannot be used as a key", v.type_name()));
        Key::from_value(&v).map(Some).ok_or_else(not)
    };
    let segment = |s: &PathSegment| match s {
        PathSegment::Deep => Ok(PatternSegment::Deep),
        PathSegment::Named(name, occurrence, keys) => {
            let keys = keys.iter().map(&mut key).collect::<Result<_, Box<RunError>>>()?;
            Ok(PatternSegment::Segment { name: name.clone(), occurrence: *occurrence, keys })
        }
    };
    Ok(Pattern {
        segments: path.segments.iter().map(segment).collect::<Result<_, Box<RunError>>>()?,
    })
}

/// The address of a single choice.
///
/// # Errors
/// If the path has wildcards, or a computed key fails or is not a key.
pub(crate) fn address(path: &Path, env: &mut PlanEnv) -> Result<Address, Box<RunError>> {
    let one =
        || fail(path.span, "expected the address of a single choice, without wildcards".into());
    let single = |s| match s {
        PatternSegment::Segment { name: Some(name), occurrence, keys } => {
            let keys = keys.into_iter().collect::<Option<Vec<Key>>>().ok_or_else(one)?;
            Ok(AddressSegment { name, occurrence: occurrence.max(1), keys })
        }
        _ => Err(one()),
    };
    let segments = pattern(path, env)?.segments.into_iter().map(single);
    Ok(Address { segments: segments.collect::<Result<_, Box<RunError>>>()? })
}

fn unmapped(span: Span) -> Box<RunError> {
    let mut error = fail(
        span,
        "a map may use only choices and constants, so that its derivatives are known".into(),
    );
    error.hint = Some("write it in terms of value(@x) of the choices it depends on".into());
    error
}
