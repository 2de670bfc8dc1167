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
        let _ = write!(s, "\n## {section}\n\n");
        for b in table.iter().filter(|b| b.section == section) {
            let _ = write!(s, "- **`{}`**", b.signature());
            if let Some(what) = result_type(b) {
                let _ = write!(s, " → {what}");
            }
            let _ = writeln!(s, ". {}", b.doc);
            for a in b.args.iter() {
                let _ = writeln!(s, "  - `{}`: {} {}", a.name, traits(a), a.doc);
            }
            for (what, text) in notes(b) {
                let _ = writeln!(s, "  - *{what}*: {text}");
            }
            if let Some(example) = b.example.as_deref() {
                let _ = writeln!(s, "  ```pcad\n{}  ```", indented(example, "  "));
            }
        }
    }
    s
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
        Domain::Words(words) => {
            let quoted: Vec<String> = words.iter().map(|w| format!("\"{w}\"")).collect();
            let _ = write!(s, ", {}", quoted.join(" or "));
        }
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
