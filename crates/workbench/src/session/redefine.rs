//! The names that a program's items bind, for replacing items when a name is bound again,
//! and for removing them.

use crate::failure::{Failure, plain};
use pcadlang_syntax::ast::{Item, ItemKind, StmtKind};
use pcadlang_syntax::diag::{SourceMap, nearest};
use pcadlang_syntax::{Class, classes, parse, print_expr};
use std::ops::Range;
use std::sync::Arc;

/// The namespace of an item's name; the same word may be used in several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Space {
    /// Values and functions.
    Value,
    /// Observations and factors.
    Label,
    /// Kernels.
    Kernel,
    /// Inference plans.
    Plan,
}

/// A name and its namespace.
pub(super) type Key = (Space, Arc<str>);

/// Returns the name that an item binds.
pub(super) fn key(item: &Item) -> Option<Key> {
    let value = |n: &Arc<str>| Some((Space::Value, Arc::clone(n)));
    match &item.kind {
        ItemKind::Param(d) | ItemKind::Data(d) => value(&d.name.node),
        ItemKind::Fn(f) => value(&f.name.node),
        ItemKind::Kernel(k) => Some((Space::Kernel, Arc::clone(&k.name.node))),
        ItemKind::Infer { name, .. } => name.as_ref().map(|n| (Space::Plan, Arc::clone(&n.node))),
        ItemKind::Stmt(s) => match &s.kind {
            StmtKind::Assume { name, .. }
            | StmtKind::Let { name, .. }
            | StmtKind::Predict { name, .. } => value(&name.node),
            // `z[0] ~ d` and `z[1] ~ d` are two elements of one container.
            StmtKind::Draw { target, .. } => value(&Arc::from(print_expr(target))),
            StmtKind::Observe { name, .. } | StmtKind::Factor { name, .. } => {
                name.as_ref().map(|n| (Space::Label, Arc::clone(&n.node)))
            }
            _ => None,
        },
        _ => None,
    }
}

/// Returns the items of a text: the names that they bind, and their ranges in bytes.
pub(super) fn items(text: &str) -> Vec<(Option<Key>, Range<usize>)> {
    let (program, _) = parse(text, SourceMap::new().add("", text));
    let place = |i: &Item| i.span.start as usize..i.span.end as usize;
    program.items.iter().map(|i| (key(i), place(i))).collect()
}

/// Replaces the item that binds a name; `None` if no item does.
pub(super) fn with_item(text: &str, name: &Key, item: &str) -> Option<String> {
    let (_, place) = items(text).into_iter().find(|(k, _)| k.as_ref() == Some(name))?;
    Some(format!("{}{}{}", &text[..place.start], item.trim_end(), &text[place.end..]))
}

/// Removes the item that binds a name, and the line if it becomes empty; `None` if no
/// item does.
pub(super) fn without_item(text: &str, name: &Key) -> Option<String> {
    let (_, place) = items(text).into_iter().find(|(k, _)| k.as_ref() == Some(name))?;
    let (before, after) = (&text[..place.start], &text[place.end..]);
    let alone = before.is_empty() || before.ends_with('\n');
    let after = if alone { after.strip_prefix('\n').unwrap_or(after) } else { after };
    Some(format!("{before}{after}"))
}

/// Returns the names that use a name, directly or through others, in the order of the
/// text.
pub(super) fn users(text: &str, name: &str) -> Vec<Key> {
    let mut known = vec![name.to_owned()];
    let mut found = Vec::new();
    for (key, place) in items(text) {
        let slice = &text[place];
        let own = (Space::Value, Arc::from(name));
        let Some(key) = key.filter(|k| *k != own && uses(slice, &known)) else { continue };
        if key.0 == Space::Value {
            let base = key.1.split('[').next().unwrap_or_default();
            known.push(base.to_owned());
        }
        found.push(key);
    }
    found
}

/// Returns whether a text uses one of the names, other than as a field or as the name of
/// an observation.
fn uses(text: &str, names: &[String]) -> bool {
    classes(text).into_iter().any(|(place, class)| {
        let before = text[..place.start].trim_end();
        class == Class::Name
            && names.iter().any(|n| *n == text[place.clone()])
            && !before.ends_with('.')
            && !before.ends_with(" as")
    })
}

/// Returns the name in `forget name`, or `None` if a text is something else; `@name` is
/// accepted too.
pub(super) fn forgotten(text: &str) -> Option<&str> {
    let rest = text.strip_prefix("forget")?;
    let name = rest.trim().trim_end_matches(';').trim_end();
    let is_one = rest.starts_with(char::is_whitespace) && !name.is_empty();
    (is_one && !name.contains([';', ' ', '\n'])).then(|| name.trim_start_matches('@'))
}

/// Returns the key of a name to forget; the error suggests an existing name.
pub(super) fn to_forget(text: &str, name: &str) -> Result<Key, Failure> {
    let all: Vec<Key> = items(text).into_iter().filter_map(|(k, _)| k).collect();
    // The last item is preferred, since it was typed last.
    if let Some(k) = all.iter().rev().find(|k| *k.1 == *name) {
        return Ok(k.clone());
    }
    let failure = plain(format!("the program has no `{name}` to forget"));
    Err(match nearest(name, all.iter().map(|k| &*k.1)) {
        Some(n) => failure.hint(format!("did you mean `{n}`?")),
        None if name.starts_with("obs#") => {
            failure.hint("an observation is forgotten by its name: observe … as name; or :edit")
        }
        None => failure.hint("`:list` shows the program"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "let a = 1;\nassume b ~ normal(a, 1);\nlet c = r.a + 1;\n\
        observe normal(b, 1) = 2 as a;\nlet d = b + 1; // kept\nz[0] ~ normal(d, 1);\n";

    fn value(name: &str) -> Key {
        (Space::Value, Arc::from(name))
    }

    #[test]
    fn items_are_replaced_and_taken_out() {
        let new = with_item(TEXT, &value("a"), "let a = 5;\n").unwrap();
        assert!(new.starts_with("let a = 5;\nassume b"), "{new}");
        let new = with_item(TEXT, &(Space::Label, "a".into()), "observe normal(b, 2) = 3 as a;");
        assert!(new.unwrap().contains("observe normal(b, 2) = 3 as a;\nlet d"));
        let new = without_item(TEXT, &value("d")).unwrap();
        assert!(new.contains("as a;\n // kept\nz[0]"), "{new}");
        assert_eq!(with_item(TEXT, &value("q"), ""), None);
        assert!(items(TEXT).iter().any(|(k, _)| *k == Some(value("z[0]"))));
    }

    #[test]
    fn users_are_found_through_others() {
        let names: Vec<String> = users(TEXT, "a").iter().map(|k| k.1.to_string()).collect();
        // `r.a` is a field, and `as a` names the observation.
        assert_eq!(names, ["b", "a", "d", "z[0]"], "the observation has the same name");
        assert_eq!(users(TEXT, "c"), []);
    }

    #[test]
    fn what_is_forgotten_is_one_name() {
        assert_eq!(forgotten("forget seen;"), Some("seen"));
        assert_eq!(forgotten("forget @seen"), Some("seen"));
        for text in ["forget", "forgetful = 1", "forget a; forget b", "forget a b"] {
            assert_eq!(forgotten(text), None, "{text}");
        }
    }
}
