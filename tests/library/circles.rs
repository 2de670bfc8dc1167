//! No file imports, directly or through others, a file that imports it.

use crate::architecture::{is_test, sources, without_tests};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The circles that still exist: the sources, the module that they lie in, and their files
/// there. No file may be added.
const KNOWN: &[(&str, &str, &str)] = &[
    // A distribution may be made of others, of any family.
    ("crates/numerics/src", "dist", "distribution families family"),
];

/// The names of a path, from the root of the crate.
type Names = Vec<String>;

/// A file: what each name that it imports stands for, and the paths that it depends on.
#[derive(Default)]
struct File {
    names: BTreeMap<String, Names>,
    uses: Vec<Names>,
}

/// Adds the paths of a tree of imports, each with the name that it binds.
fn expand(before: &[&str], tree: &str, out: &mut Vec<(String, Names)>) {
    let parts = |text: &str| -> Names {
        let parts = text.split("::").map(str::trim).filter(|part| !part.is_empty());
        before.iter().copied().chain(parts).map(str::to_owned).collect()
    };
    let tree = tree.trim();
    let Some((head, inner)) = tree.split_once('{') else {
        let (path, name) = tree.split_once(" as ").unwrap_or((tree, ""));
        let mut path = parts(path);
        if path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        let name = if name.is_empty() { path.last().map_or("", |n| n) } else { name.trim() };
        return out.push((name.to_owned(), path.clone()));
    };
    let head = parts(head);
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let (mut depth, mut from) = (0, 0);
    let inner = inner.strip_suffix('}').unwrap_or(inner);
    for (i, c) in inner.char_indices().chain([(inner.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let part = inner[from..i].trim();
                if !part.is_empty() {
                    expand(&head, part, out);
                }
                from = i + 1;
            }
            _ => {}
        }
    }
}

/// Reads what a file imports; `own` is its module.
fn read(text: &str, own: &Names, modules: &BTreeSet<Names>) -> File {
    let code: Vec<&str> =
        without_tests(text).lines().map(|l| l.split("//").next().unwrap()).collect();
    let absolute = |path: &Names| -> Option<Names> {
        let ups = path.iter().take_while(|part| *part == "super").count();
        let rest = |n: usize| path[n..].iter().cloned();
        match path.first().map(String::as_str)? {
            "crate" => Some(rest(1).collect()),
            "self" => Some(own.iter().cloned().chain(rest(1)).collect()),
            "super" => {
                Some(own[..own.len().checked_sub(ups)?].iter().cloned().chain(rest(ups)).collect())
            }
            child => {
                let child: Names = own.iter().cloned().chain([child.to_owned()]).collect();
                modules.contains(&child).then(|| own.iter().cloned().chain(rest(0)).collect())
            }
        }
    };
    let (mut file, mut rest) = (File::default(), String::new());
    let mut lines = code.into_iter();
    while let Some(line) = lines.next() {
        let (before, tree) = line.split_once("use ").unwrap_or((line, ""));
        let is_public = before.trim_start().starts_with("pub");
        if tree.is_empty() || !(before.trim().is_empty() || is_public) {
            rest += line;
            rest.push('\n');
            continue;
        }
        let mut tree = tree.to_owned();
        while !tree.contains(';') {
            tree += lines.next().unwrap_or(";");
        }
        let mut found = Vec::new();
        expand(&[], tree.split(';').next().unwrap_or_default(), &mut found);
        for (name, path) in found {
            let Some(path) = absolute(&path) else { continue };
            if !(is_public && path.starts_with(own)) {
                file.uses.push(path.clone());
            }
            file.names.insert(name, path);
        }
    }
    for start in ["crate::", "super::"] {
        for (at, _) in rest.match_indices(start) {
            let is_start = !rest[..at].ends_with(|c: char| c.is_alphanumeric() || "_:".contains(c));
            let end = |c: char| !(c.is_alphanumeric() || c == '_' || c == ':');
            let path = rest[at..].split(end).next().unwrap_or_default();
            let path: Names =
                path.split("::").filter(|p| !p.is_empty()).map(str::to_owned).collect();
            file.uses.extend(Some(path).filter(|_| is_start).as_ref().and_then(absolute));
        }
    }
    file
}

/// Returns the module in which a path ends, by way of re-exports, and whether it names an
/// item there.
fn home(path: &Names, files: &BTreeMap<Names, File>, depth: u32) -> (Names, bool) {
    let is_module = |n: &usize| files.contains_key(&path[..*n]);
    let own = (0..=path.len()).rev().find(is_module).unwrap_or(0);
    let next = files.get(&path[..own]).zip(path.get(own)).and_then(|(f, name)| f.names.get(name));
    match next {
        Some(to) if depth < 8 && to[..] != path[..=own] => {
            home(&[&to[..], &path[own + 1..]].concat(), files, depth + 1)
        }
        _ => (path[..own].to_vec(), own < path.len()),
    }
}

/// Returns the files that each file of a crate imports.
fn imports(root: &Path) -> BTreeMap<Names, BTreeSet<Names>> {
    let mut paths = Vec::new();
    sources(root, &mut paths);
    paths.retain(|p| !is_test(p) && !p.ends_with("testing.rs") && !p.ends_with("src/main.rs"));
    let module = |path: &Path| -> Names {
        let path = path.strip_prefix(root).unwrap().with_extension("");
        let names = path.iter().map(|n| n.to_string_lossy().into_owned());
        names.filter(|n| !["mod", "lib"].contains(&&**n)).collect()
    };
    let modules: BTreeSet<Names> = paths.iter().map(|p| module(p)).collect();
    let file = |path: &std::path::PathBuf| {
        let own = module(path);
        (own.clone(), read(&std::fs::read_to_string(path).unwrap(), &own, &modules))
    };
    let files: BTreeMap<Names, File> = paths.iter().map(file).collect();
    let of = |(own, file): (&Names, &File)| {
        let homes = file.uses.iter().map(|path| home(path, &files, 0));
        // A folder's module is above its files; what is defined in it is imported from it.
        let all = homes
            .filter(|(to, item)| to != own && !to.is_empty() && (*item || !own.starts_with(to)));
        (own.clone(), all.map(|(to, _)| to).collect())
    };
    files.iter().map(of).collect()
}

/// Returns the files that a file imports, directly or through others.
fn reached<'a>(
    imports: &'a BTreeMap<Names, BTreeSet<Names>>,
    from: &'a Names,
) -> BTreeSet<&'a Names> {
    let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(file) = open.pop() {
        open.extend(imports.get(file).into_iter().flatten().filter(|to| seen.insert(*to)));
    }
    seen
}

#[test]
fn no_two_files_import_each_other() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut circles = BTreeSet::new();
    for member in ["src", "crates/numerics/src", "crates/scene/src", "crates/detectors/src"] {
        let imports = imports(&root.join(member));
        let count = imports.values().flatten().count();
        assert!(count > imports.len(), "only {count} imports were found in {member}");
        let all: BTreeMap<_, _> = imports.keys().map(|f| (f, reached(&imports, f))).collect();
        for (file, reached) in &all {
            let back = |to: &&&Names| all.get(*to).is_some_and(|of| of.contains(file));
            let circle: Vec<String> = reached.iter().filter(back).map(|to| to.join("::")).collect();
            let known = |&(of, module, files): &(&str, &str, &str)| {
                let is_of = |f: &String| {
                    let rest = f.strip_prefix(module).and_then(|f| f.strip_prefix("::"));
                    rest.is_some_and(|rest| files.split_whitespace().any(|file| file == rest))
                };
                of == member && circle.iter().all(is_of)
            };
            if !circle.is_empty() && !KNOWN.iter().any(known) {
                circles.insert(format!("{member}: {}", circle.join(", ")));
            }
        }
    }
    assert!(circles.is_empty(), "files that import each other: {circles:#?}");
}
