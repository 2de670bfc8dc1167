//! Errors are values with source locations: `cargo run --release --example embed_errors`.

use pcadlang::{Model, Program};

/// Returns the line, column, message and hint of each mistake in a program, as an editor
/// would show them.
pub fn mistakes(text: &str) -> Vec<(usize, usize, String, Option<String>)> {
    let Err(e) = Model::from_text(text) else { return Vec::new() };
    let one = |d: &pcadlang::diag::Diagnostic| {
        let label = d.labels.iter().find(|l| l.primary)?;
        let (line, column) = e.sources.get(label.span.file)?.location(label.span.start as usize);
        Some((line, column, d.message.clone(), d.hints.first().cloned()))
    };
    e.diagnostics.iter().filter_map(one).collect()
}

/// Returns an error at run time: it is also a value, and its text shows the line in
/// question.
pub fn while_running() -> Option<String> {
    let program = Program::parse(
        "let xs = [1, 2, 3];\nassume i ~ uniform_discrete(3, 5);\nobserve normal(xs[i], 1) = 2;",
    );
    program.and_then(Program::compile).and_then(|m| m.simulate(1, 0)).err().map(|e| e.to_string())
}

fn main() {
    for (line, column, message, hint) in mistakes("assume x ~ nromal(0, 1);\nlet y = sqrt(x, 2);") {
        println!("{line}:{column}: {message} ({})", hint.unwrap_or_default());
    }
    println!("{}", while_running().unwrap_or_default());
}
