//! The language reference, generated from the table of built-ins: single entries for
//! `pcadlang doc`, and all of it as Markdown.

use crate::lang::builtins::examples::INCLUDE;
use crate::lang::builtins::{Argument, Builtin, Domain, Kind, Table, Type};
use pcadlang_syntax::{Place, STATEMENTS, Statement};
use std::fmt::Write;

/// Returns the plain-text entry of a built-in, constant or statement: `normal`,
/// `scene.lathe`, `observe`, or `lathe` without its module.
pub fn doc(table: &Table, name: &str) -> Option<String> {
    if let Some(c) = table.constants().iter().find(|c| c.name == name) {
        return Some(format!("{} = {}\n\n{}\n", c.name, c.value, c.doc));
    }
    let exact = table.iter().find(|b| b.full_name() == name);
    let entries: Vec<&Builtin> = match exact {
        Some(b) => vec![b],
        None => table.iter().filter(|b| b.name == name).collect(),
    };
    let statement = STATEMENTS.iter().find(|s| s.name == name).map(statement);
    let texts: Vec<String> = statement.into_iter().chain(entries.into_iter().map(entry)).collect();
    (!texts.is_empty()).then(|| texts.join("\n"))
}

/// The entry of a statement.
fn statement(s: &Statement) -> String {
    let forms: Vec<&str> = s.forms().collect();
    let place = match s.place {
        Place::Model => "",
        Place::Plan => "It stands in an `infer` block or a kernel.\n\n",
        Place::Expression => "It is an expression.\n\n",
    };
    format!("{}\n\n{}\n\n{place}Example:\n\n  {}\n", forms.join("\n"), s.doc, s.example)
}

/// The entry of a built-in.
fn entry(b: &Builtin) -> String {
    let mut s = b.signature();
    if let Some(what) = result_type(b) {
        let _ = write!(s, " -> {what}");
    }
    let _ = write!(s, "\n\n{}\n", b.doc);
    if !b.args.is_empty() {
        s.push('\n');
    }
    let width = b.args.iter().map(|a| a.name.len()).max().unwrap_or(0);
    for a in b.args.iter() {
        let _ = writeln!(s, "  {:width$}  {} {}", a.name, traits(a), a.doc);
    }
    for (what, text) in notes(b) {
        let _ = write!(s, "\n{what}: {text}\n");
    }
    if let Some(example) = b.example.as_deref() {
        // Only programs, which contain `;`, need the include line; expressions do not.
        let include = if example.contains("scene.") && example.contains(';') {
            format!("  {INCLUDE}\n")
        } else {
            String::new()
        };
        let _ = write!(s, "\nExample:\n\n{include}{}", indented(example, "  "));
    }
    s
}

/// Indents the lines of a text.
fn indented(text: &str, by: &str) -> String {
    text.lines().map(|line| format!("{by}{line}\n")).collect()
}

/// Returns the reference of all built-ins by section, as Markdown.
pub fn reference(table: &Table) -> String {
    let mut s = String::new();
    let _ = write!(s, "## Statements\n\n");
    for x in STATEMENTS {
        let forms: Vec<String> = x.forms().map(|f| format!("`{f}`")).collect();
        let _ = writeln!(s, "- **{}**. {}", forms.join(", "), x.doc);
    }
    let _ = write!(s, "\n## Constants\n\n");
    for c in table.constants() {
        let _ = writeln!(s, "- **`{}`** = {}. {}", c.name, c.value, c.doc);
    }
    let mut sections: Vec<&str> = Vec::new();
    for b in table.iter() {
        if !sections.contains(&&*b.section) {
            sections.push(&b.section);
        }
    }
    for section in sections {
        let built_ins: Vec<&Builtin> = table.iter().filter(|b| b.section == section).collect();
        let shared = shared(&built_ins);
        let _ = write!(s, "\n## {section}\n\n");
        if !shared.is_empty() {
            let _ = write!(s, "Unless described otherwise: {}\n\n", shared.join(" "));
        }
        for b in built_ins {
            let _ = write!(s, "- **`{}`**", b.signature());
            if let Some(what) = result_type(b) {
                let _ = write!(s, " → {what}");
            }
            let _ = write!(s, ". {}", b.doc);
            let arguments = b.args.iter().map(described).filter(|a| !shared.contains(a));
            let notes = notes(b).into_iter().map(|(what, text)| format!("*{what}*: {text}."));
            let rest: Vec<String> = arguments.chain(notes).collect();
            if !rest.is_empty() {
                let _ = write!(s, "\\\n  {}", rest.join(" "));
            }
            s.push('\n');
        }
    }
    s
}

/// The description of an argument; its default is in the signature.
fn described(a: &Argument) -> String {
    let unit = if a.unit.is_empty() { String::new() } else { format!(", {}", a.unit) };
    format!("`{}`: {}{unit}. {}", a.name, a.ty, a.doc)
}

/// The descriptions that several built-ins of a section have, at most one of each name.
fn shared(built_ins: &[&Builtin]) -> Vec<String> {
    let all: Vec<&Argument> = built_ins.iter().flat_map(|b| b.args.iter()).collect();
    let times = |a: &Argument| all.iter().filter(|b| described(b) == described(a)).count();
    let mut found: Vec<&Argument> = Vec::new();
    for &a in all.iter().filter(|a| times(a) > 1) {
        match found.iter_mut().find(|b| b.name == a.name) {
            Some(b) if times(a) > times(b) => *b = a,
            Some(_) => {}
            None => found.push(a),
        }
    }
    found.into_iter().map(described).collect()
}

/// The type of the result, unless it is `any`.
fn result_type(b: &Builtin) -> Option<String> {
    match b.returns {
        Type::Any => None,
        _ => Some(b.returns.to_string()),
    }
}

/// The type, domain, unit and default of an argument, such as "number, radians, default 0."
fn traits(a: &Argument) -> String {
    let mut s = a.ty.to_string();
    match a.domain {
        Domain::Any => {}
        Domain::Positive => s.push_str(" above 0"),
        Domain::NotNegative => s.push_str(" of at least 0"),
        Domain::From([low, high]) => drop(write!(s, " from {low} to {high}")),
        Domain::Between01 => s.push_str(" between 0 and 1"),
        Domain::Below1 => s.push_str(" from 0 to below 1"),
        Domain::Whole([low, high]) => drop(write!(s, " from {low} to {high}")),
        words @ Domain::Words(_) => drop(write!(s, ", {words}")),
    }
    if !a.unit.is_empty() {
        let _ = write!(s, ", {}", a.unit);
    }
    if let Some(d) = &a.default {
        let _ = write!(s, ", default {d}");
    }
    s.push('.');
    s
}

/// Further notes: support and density.
fn notes(b: &Builtin) -> Vec<(&'static str, String)> {
    match b.kind {
        Kind::Distribution(_) => crate::lang::builtins::distributions::notes(&b.name),
        _ => Vec::new(),
    }
}
