//! The API that `docs/reference/api.md` promises to hosts: every public item is used by a
//! doc-test of the guides in `src/guides`, and is in that page's table.

use std::collections::BTreeSet;
use std::path::Path;

/// The promised API: a source file, and its promised types (all public items if the list is
/// empty).
const PROMISED: &[(&str, &[&str])] = &[
    ("crates/library/src/model.rs", &[]),
    ("crates/library/src/model/program.rs", &[]),
    ("crates/library/src/scene/inputs.rs", &[]),
    ("crates/syntax/src/diag/error.rs", &[]),
    ("crates/inference/src/host/mod.rs", &[]),
    ("crates/inference/src/host/entry.rs", &[]),
    ("crates/inference/src/host/previous.rs", &[]),
    ("crates/library/src/scene/scene_view.rs", &[]),
    ("crates/inference/src/calls/host_kernel.rs", &["KernelCall"]),
    ("crates/engine/src/lang/builtins/builtin.rs", &["Type", "Args"]),
    ("crates/engine/src/lang/builtins/args.rs", &[]),
    ("crates/engine/src/lang/adjoint.rs", &["Adjoint"]),
    ("crates/engine/src/lang/fault.rs", &["Fault", "FaultKind"]),
    ("crates/engine/src/lang/error.rs", &["RunError"]),
    ("crates/engine/src/lang/value.rs", &["Value", "Object", "Likelihood", "Located"]),
    ("crates/numerics/src/dist/distribution.rs", &["Distribution", "Gradient"]),
    ("crates/numerics/src/dist/datum.rs", &["Datum"]),
    ("crates/numerics/src/dist/support.rs", &["Support"]),
    ("crates/engine/src/trace/mod.rs", &["Trace", "TraceResult"]),
    ("crates/engine/src/trace/inspect.rs", &["Trace"]),
    ("crates/engine/src/trace/operations.rs", &[]),
    ("crates/engine/src/trace/observed.rs", &[]),
    ("crates/engine/src/trace/query.rs", &[]),
    ("crates/engine/src/trace/save.rs", &["SavedTrace", "SaveError", "Trace"]),
    ("crates/engine/src/trace/choices.rs", &["Target", "Selection"]),
    ("crates/engine/src/trace/propose.rs", &["Change", "Constraint", "Draws", "Weight"]),
    ("crates/engine/src/trace/select.rs", &["Selector", "ChoiceKind", "Pattern", "PatternSegment"]),
    ("crates/engine/src/trace/limits.rs", &["Limits"]),
    ("crates/engine/src/lang/address.rs", &["Address", "AddressSegment"]),
    (
        "crates/inference/src/kernel.rs",
        &["StepContext", "Kernel", "Outcome", "SiteSelection", "decide", "recoverable"],
    ),
    ("crates/engine/src/lang/plan.rs", &["Pick"]),
    ("crates/inference/src/callback.rs", &[]),
    ("crates/inference/src/run.rs", &["RunOptions", "Progress", "ChainResult", "ChainError"]),
    ("crates/inference/src/plan/checkpoint.rs", &["Checkpoint"]),
    ("crates/inference/src/state.rs", &["StateError"]),
    ("crates/inference/src/draws.rs", &["Sink", "DrawRow", "Column"]),
    ("crates/inference/src/stats.rs", &["KernelStats"]),
    ("crates/inference/src/kernels/mh.rs", &[]),
    ("crates/inference/src/kernels/block.rs", &[]),
    ("crates/inference/src/kernels/gibbs.rs", &["Gibbs"]),
    ("crates/inference/src/kernels/drift.rs", &["Drift"]),
    ("crates/inference/src/kernels/slice.rs", &["Slice"]),
    ("crates/inference/src/kernels/elliptical.rs", &["Elliptical"]),
    ("crates/report/src/rundir.rs", &["RunDir", "RunDirError"]),
    ("crates/report/src/sinks.rs", &["Memory", "Tee"]),
    ("crates/report/src/draws.rs", &["ChainDraws", "Quantity", "quantities"]),
    ("crates/report/src/csv/mod.rs", &["CsvSink"]),
    ("crates/syntax/src/diag/diagnostic.rs", &["Diagnostic", "Label", "Severity"]),
    ("crates/syntax/src/diag/source.rs", &["SourceMap", "SourceFile"]),
    ("crates/syntax/src/diag/render.rs", &["render"]),
    ("crates/numerics/src/rng.rs", &["Stream", "StreamKey", "Purpose"]),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Returns the code of the guides' doc-tests that run.
fn doc_tests() -> String {
    let (mut code, mut inside) = (String::new(), false);
    let guides = std::fs::read_dir(root().join("src/guides")).unwrap();
    for guide in guides {
        for line in read(&guide.unwrap().path()).lines() {
            match line.trim_start().strip_prefix("```") {
                Some(kind) => inside = !inside && ["", "rust"].contains(&kind.trim()),
                None if inside => code += &format!("{}\n", line.split("// ").next().unwrap_or("")),
                None => {}
            }
        }
    }
    code
}

/// Returns the public items of a file: types and functions by name, methods as
/// `Type::name`.
fn items(text: &str, only: &[&str]) -> Vec<String> {
    let text = text.split("#[cfg(test)]\nmod tests").next().unwrap_or(text);
    let word =
        |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let (mut found, mut owner, mut is_trait, mut hidden) =
        (Vec::new(), String::new(), false, false);
    for line in text.lines() {
        if line.trim() == "#[doc(hidden)]" {
            hidden = true;
            continue;
        }
        if line.trim_start().starts_with("///") || line.trim_start().starts_with("#[") {
            continue;
        }
        let skipped = std::mem::take(&mut hidden);
        if let Some(rest) = line.strip_prefix("impl") {
            let of = rest.rsplit(" for ").next().unwrap_or(rest);
            let of = if of.starts_with('<') { of.split_once("> ").map_or("", |p| p.1) } else { of };
            // Items of a trait are documented at the trait, not at its implementations.
            owner = if rest.contains(" for ") { String::new() } else { word(of.trim_start()) };
            is_trait = false;
        }
        for kind in ["struct", "enum", "trait", "fn", "type"] {
            let Some(rest) = line.strip_prefix(&format!("pub {kind} ")) else { continue };
            let name = word(rest);
            (owner, is_trait) =
                (if kind == "trait" { name.clone() } else { String::new() }, kind == "trait");
            if !skipped && (only.is_empty() || only.contains(&&*name)) {
                found.push(name);
            }
        }
        let method = line.strip_prefix("    pub fn ").or(line.strip_prefix("    pub const fn "));
        let method = method.or(line.strip_prefix("    fn ").filter(|_| is_trait));
        if let Some(rest) = method
            && !owner.is_empty()
            && !skipped
            && (only.is_empty() || only.contains(&&*owner))
        {
            found.push(format!("{owner}::{}", word(rest)));
        }
    }
    found
}

/// Whether code uses an item: a type as a word, a method as `.name` or `::name` or by
/// implementing it.
fn uses(code: &str, item: &str) -> bool {
    let name = item.rsplit("::").next().unwrap_or(item);
    let is_word = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
    code.match_indices(name).any(|(i, _)| {
        let (before, after) = (&code[..i], &code[i + name.len()..]);
        let whole = !is_word(before.chars().next_back()) && !is_word(after.chars().next());
        whole && (!item.contains("::") || before.ends_with(['.', ':']) || before.ends_with("fn "))
    })
}

#[test]
fn every_promised_item_is_used_by_a_doc_test() {
    let (code, mut missing, mut count) = (doc_tests(), Vec::new(), 0);
    for (file, only) in PROMISED {
        let text = read(&root().join(file));
        let found = items(&text, only);
        for name in *only {
            assert!(
                *name == "Trace" || found.iter().any(|f| f == name),
                "{file} has no public {name}"
            );
        }
        assert!(!found.is_empty(), "{file} has nothing public");
        count += found.len();
        missing.extend(
            found
                .into_iter()
                .filter(|item| !uses(&code, item))
                .map(|item| format!("{file}: {item}")),
        );
    }
    assert!(missing.is_empty(), "no doc-test uses\n{}", missing.join("\n"));
    assert!(count > 200, "{count}");
}

#[test]
fn the_page_for_hosts_lists_what_is_promised() {
    let page = read(&root().join("docs/reference/api.md"));
    let types: BTreeSet<String> = PROMISED
        .iter()
        .flat_map(|(file, only)| items(&read(&root().join(file)), only))
        .filter(|item| !item.contains("::"))
        .collect();
    let missing: Vec<&String> = types.iter().filter(|t| !uses(&page, t)).collect();
    assert!(missing.is_empty(), "docs/reference/api.md does not name {missing:?}");
}
