//! Describes what the parser expected, in words that a user knows.

use std::collections::BTreeSet;

/// Tokens that begin expressions (some of them also begin other things).
#[rustfmt::skip]
const EXPRESSION: [&str; 17] = [
    "a name", "a number", "a string", "an address", "a tag selection", "true", "false", "not", "-", "(", "[", "{", "if", "fn",
    "to", "when", "coarse",
];
/// Tokens that continue an expression.
const OPERATOR: [&str; 16] =
    ["or", "and", "==", "!=", "<", "<=", ">", ">=", "..", "+", "-", "*", "/", "%", "&", "**"];
/// Tokens that continue a name or call.
const SUFFIX: [&str; 3] = ["(", "[", "."];

/// Returns the names of the tokens that the parser lists, without their quotes and
/// without the placeholder of bad statements.
pub(super) fn names(expected: &[String]) -> BTreeSet<&str> {
    expected.iter().map(|e| e.trim_matches('"')).filter(|e| *e != "a bad statement").collect()
}

/// Returns whether a statement could begin. (The keywords of statements are also expected
/// wherever any word may be a field's name; `in` is then one of them.)
pub(super) fn is_statement(names: &BTreeSet<&str>) -> bool {
    names.contains("let") && names.contains("for") && !names.contains("in")
}

/// Returns whether an expression could begin.
pub(super) fn is_expression(names: &BTreeSet<&str>) -> bool {
    names.contains("a number") && names.contains("(")
}

/// Returns whether an expression could continue with an operator.
pub(super) fn is_operator(names: &BTreeSet<&str>) -> bool {
    !is_expression(names) && !names.contains("in") && OPERATOR.iter().any(|op| names.contains(op))
}

/// Returns a list in words, such as "`)`, `,` or an operator".
pub(super) fn describe(expected: &[String]) -> String {
    let mut names = names(expected);
    let mut words: Vec<String> = Vec::new();
    if is_statement(&names) {
        words.push(
            if names.contains("include") { "a statement or declaration" } else { "a statement" }
                .to_owned(),
        );
        let close = names.contains("}");
        names.clear();
        if close {
            names.insert("}");
        }
    }
    if is_expression(&names) {
        words.push("an expression".to_owned());
        names.retain(|name| !EXPRESSION.contains(name));
    }
    if names.contains("a name") {
        // Keywords that may also be names.
        names.retain(|name| {
            !name.starts_with(|c: char| c.is_ascii_lowercase()) || name.contains(' ')
        });
    }
    let operator = is_operator(&names);
    if operator {
        names.retain(|name| !OPERATOR.contains(name) && !SUFFIX.contains(name));
    }
    let quoted =
        |name: &&str| if name.contains(' ') { (*name).to_owned() } else { format!("`{name}`") };
    // Closing tokens come first: they are the most likely to be missing.
    let (ends, others): (Vec<&str>, Vec<&str>) =
        names.iter().partition(|name| [";", ")", "]", "}"].contains(*name));
    let mut all: Vec<String> = ends.iter().chain(&others).map(quoted).collect();
    all.extend(words);
    if operator {
        all.push("an operator".to_owned());
    }
    match all.split_last() {
        None => "the end of the text".to_owned(),
        Some((last, [])) => last.clone(),
        Some((last, before)) => format!("{} or {last}", before.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(names: &[&str]) -> String {
        describe(&names.iter().map(|n| format!("\"{n}\"")).collect::<Vec<_>>())
    }

    #[test]
    fn lists_are_in_words() {
        assert_eq!(of(&[";"]), "`;`");
        assert_eq!(of(&[",", ")"]), "`)` or `,`");
        assert_eq!(of(&EXPRESSION), "an expression");
        assert_eq!(
            of(&[&OPERATOR[..], &SUFFIX, &[";", "~", "a bad statement"]].concat()),
            "`;`, `~` or an operator"
        );
        assert_eq!(of(&["let", "for", "a number", "(", "}"]), "`}` or a statement");
        assert_eq!(of(&["a name", "to", "when", "{"]), "a name or `{`");
        assert_eq!(of(&[]), "the end of the text");
    }
}
