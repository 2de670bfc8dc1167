//! The API that `docs/reference/api.md` promises to hosts: every public item is used by a
//! doc-test of its module, and is in that page's table.

use std::collections::BTreeSet;
use std::path::Path;

/// The promised API: a source file, its promised types (all public items if the list is
/// empty), and where else its doc-tests are.
const PROMISED: &[(&str, &[&str], &[&str])] = &[
    ("src/model.rs", &[], &["src/guide.md", "src/host"]),
    ("src/model/program.rs", &[], &["src/guide.md", "src/host"]),
    ("src/model/camera.rs", &[], &["src/guide.md", "src/host"]),
    ("src/model/hosted.rs", &[], &["src/guide.md", "src/host"]),
    ("src/diag/error.rs", &[], &["src/guide.md", "src/host"]),
    ("src/host/mod.rs", &[], &["src/host"]),
    ("src/host/entry.rs", &[], &["src/host"]),
    ("src/host/previous.rs", &[], &["src/host"]),
    ("src/scene/scene_view.rs", &[], &["src/host"]),
    ("src/infer/calls/host_kernel.rs", &["KernelCall"], &["src/host", "src/infer"]),
    ("src/lang/builtins/builtin.rs", &["Type", "Args"], &["src/host"]),
    ("src/lang/builtins/args.rs", &[], &["src/host"]),
    ("src/lang/adjoint.rs", &["Adjoint"], &["src/host"]),
    ("src/lang/fault.rs", &["Fault", "FaultKind"], &["src/host"]),
    ("src/lang/error.rs", &["RunError"], &["src/host", "src/trace"]),
    ("src/lang/value.rs", &["Value", "Object", "Likelihood", "Located"], &["src/host"]),
    ("crates/numerics/src/dist/distribution.rs", &["Distribution", "Gradient"], &["src/host"]),
    ("crates/numerics/src/dist/datum.rs", &["Datum"], &["src/host"]),
    ("crates/numerics/src/dist/support.rs", &["Support"], &["src/host"]),
    ("src/trace/mod.rs", &["Trace", "TraceResult"], &["src/trace"]),
    ("src/trace/inspect.rs", &["Trace"], &["src/trace"]),
    ("src/trace/operations.rs", &[], &["src/trace"]),
    ("src/trace/observed.rs", &[], &["src/trace"]),
    ("src/trace/query.rs", &[], &["src/trace"]),
    ("src/trace/save.rs", &["SavedTrace", "SaveError", "Trace"], &["src/trace"]),
    ("src/trace/choices.rs", &["Target", "Selection"], &["src/trace"]),
    ("src/trace/propose.rs", &["Change", "Constraint", "Draws", "Weight"], &["src/trace"]),
    (
        "src/trace/select.rs",
        &["Selector", "ChoiceKind", "Pattern", "PatternSegment"],
        &["src/trace"],
    ),
    ("src/trace/limits.rs", &["Limits"], &["src/trace", "src/guide.md"]),
    ("src/lang/address.rs", &["Address", "AddressSegment"], &["src/trace"]),
    (
        "src/infer/kernel.rs",
        &["StepContext", "Kernel", "Outcome", "SiteSelection", "decide", "recoverable"],
        &["src/infer"],
    ),
    ("src/lang/plan.rs", &["Pick"], &["src/infer"]),
    ("src/infer/callback.rs", &[], &["src/infer"]),
    ("src/infer/run.rs", &["RunOptions", "Progress", "ChainResult", "ChainError"], &["src/infer"]),
    ("src/infer/plan/checkpoint.rs", &["Checkpoint"], &["src/infer"]),
    ("src/infer/state.rs", &["StateError"], &["src/infer"]),
    ("src/infer/draws.rs", &["Sink", "DrawRow"], &["src/infer"]),
    ("src/infer/stats.rs", &["KernelStats"], &["src/infer"]),
    ("src/infer/columns.rs", &["Column"], &["src/infer"]),
    ("src/infer/kernels/mh.rs", &[], &["src/infer"]),
    ("src/infer/kernels/block.rs", &[], &["src/infer"]),
    ("src/infer/kernels/gibbs.rs", &["Gibbs"], &["src/infer"]),
    ("src/infer/kernels/drift.rs", &["Drift"], &["src/infer"]),
    ("src/infer/kernels/slice.rs", &["Slice"], &["src/infer"]),
    ("src/infer/kernels/elliptical.rs", &["Elliptical"], &["src/infer"]),
    ("src/report/rundir.rs", &["RunDir", "RunDirError"], &["src/report"]),
    ("src/report/sinks.rs", &[], &["src/report"]),
    ("src/report/draws.rs", &["ChainDraws", "Quantity", "quantities"], &["src/report"]),
    ("src/report/csv/write.rs", &["CsvSink"], &["src/report"]),
    ("src/diag/diagnostic.rs", &["Diagnostic", "Label", "Severity"], &["src/diag"]),
    ("src/diag/source.rs", &["SourceMap", "SourceFile"], &["src/diag"]),
    ("src/diag/render.rs", &["render"], &["src/diag"]),
    ("crates/numerics/src/rng.rs", &["Stream", "StreamKey", "Purpose"], &[]),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Returns the code of a file's doc-tests that run.
fn doc_tests(text: &str, is_markdown: bool) -> String {
    let (mut code, mut inside) = (String::new(), false);
    for line in text.lines() {
        let line = line.trim_start();
        let doc = if is_markdown {
            Some(line)
        } else {
            line.strip_prefix("///").or(line.strip_prefix("//!"))
        };
        let Some(doc) = doc.map(str::trim_start) else {
            inside = false;
            continue;
        };
        match doc.strip_prefix("```") {
            Some(kind) => inside = !inside && ["", "rust"].contains(&kind.trim()),
            None if inside => code += &format!("{}\n", doc.split("// ").next().unwrap_or("")),
            None => {}
        }
    }
    code
}

fn tests_under(path: &Path) -> String {
    if path.is_file() {
        return doc_tests(&read(path), path.extension().is_some_and(|e| e == "md"));
    }
    let entries = std::fs::read_dir(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    entries.map(|e| tests_under(&e.unwrap().path())).collect()
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
fn every_promised_item_is_used_by_a_doc_test_of_its_module() {
    let (mut missing, mut count) = (Vec::new(), 0);
    for (file, only, besides) in PROMISED {
        let path = root().join(file);
        let text = read(&path);
        let code: String = std::iter::once(tests_under(&path))
            .chain(besides.iter().map(|p| tests_under(&root().join(p))))
            .collect();
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
        .flat_map(|(file, only, _)| items(&read(&root().join(file)), only))
        .filter(|item| !item.contains("::"))
        .collect();
    let missing: Vec<&String> = types.iter().filter(|t| !uses(&page, t)).collect();
    assert!(missing.is_empty(), "docs/reference/api.md does not name {missing:?}");
}
