//! Builds the copy with all mutants in it; those that do not compile are left out.

use crate::{CRATES, Failure};
use crate::find::Mutant;
use crate::rewrite::rewritten;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// An executable with tests.
#[derive(Clone, Debug)]
pub struct TestProgram {
    pub name: String,
    pub path: PathBuf,
}

/// The names that are not copied.
const LEFT_OUT: [&str; 3] = ["target", ".git", "mutants"];

/// Copies the project except some files, which are rewritten elsewhere; unchanged files
/// are not touched.
pub fn copy(from: &Path, to: &Path, without: &[PathBuf]) -> Result<(), Failure> {
    std::fs::create_dir_all(to)?;
    for entry in std::fs::read_dir(from)? {
        let (path, name) = {
            let e = entry?;
            (e.path(), e.file_name())
        };
        if LEFT_OUT.iter().any(|l| name == *l) {
            continue;
        }
        let target = to.join(&name);
        if path.is_dir() {
            copy(&path, &target, without)?;
        } else if path.is_file() && !without.contains(&path) {
            put(&target, &std::fs::read(&path)?)?;
        }
    }
    Ok(())
}

fn put(file: &Path, content: &[u8]) -> Result<(), Failure> {
    if std::fs::read(file).is_ok_and(|old| old == content) {
        return Ok(());
    }
    Ok(std::fs::write(file, content)?)
}

/// The ranges of mutants in the rewritten files.
type Places = BTreeMap<PathBuf, Vec<(Range<usize>, usize)>>;

fn write(root: &Path, copy: &Path, mutants: &[Mutant]) -> Result<Places, Failure> {
    let mut by_file: BTreeMap<&Path, Vec<(usize, &Mutant)>> = BTreeMap::new();
    mutants
        .iter()
        .enumerate()
        .for_each(|(id, m)| by_file.entry(&m.file).or_default().push((id, m)));
    let mut places = Places::new();
    for (file, own) in by_file {
        let (text, at) = rewritten(&std::fs::read_to_string(file)?, &own);
        let relative = file.strip_prefix(root)?;
        put(&copy.join(relative), text.as_bytes())?;
        places.insert(relative.to_path_buf(), at);
    }
    for of in CRATES {
        let lib = std::fs::read_to_string(root.join(of).join("lib.rs"))?;
        let with = format!("{lib}\nmod mutation;\n");
        put(&copy.join(of).join("lib.rs"), with.as_bytes())?;
        put(&copy.join(of).join("mutation.rs"), include_str!("mutation.rs.txt").as_bytes())?;
    }
    Ok(places)
}

/// Runs cargo. Returns whether it succeeded, and its messages.
fn cargo(copy: &Path, args: &[&str]) -> Result<(bool, Vec<Value>), Failure> {
    let out = Command::new("cargo")
        .args(args)
        .arg("--message-format=json")
        .current_dir(copy)
        .env("RUSTFLAGS", "--cap-lints=allow")
        .env("CARGO_TARGET_DIR", copy.join("target"))
        .stderr(Stdio::inherit())
        .output()?;
    let lines = String::from_utf8_lossy(&out.stdout)
        .lines()
        .filter_map(|l| serde_json::from_str(l).ok())
        .collect();
    Ok((out.status.success(), lines))
}

/// Returns the mutants to which compiler errors belong, and the text of all other errors.
fn blamed(messages: &[Value], places: &Places) -> (BTreeSet<usize>, Vec<String>) {
    let (mut out, mut others) = (BTreeSet::new(), Vec::new());
    for m in messages.iter().map(|m| &m["message"]).filter(|m| m["level"] == "error") {
        let mut found = false;
        for span in m["spans"].as_array().into_iter().flatten() {
            let (Some(file), Some(at)) = (span["file_name"].as_str(), span["byte_start"].as_u64())
            else {
                continue;
            };
            let inside = |(range, _): &&(Range<usize>, usize)| range.contains(&(at as usize));
            let all = places.get(Path::new(file)).into_iter().flatten().filter(inside);
            // Choose the innermost mutant.
            if let Some((_, id)) = all.min_by_key(|(range, _)| range.len()) {
                out.insert(*id);
                found = true;
            }
        }
        if !found && m["spans"].as_array().is_some_and(|s| !s.is_empty()) {
            others.push(m["rendered"].as_str().unwrap_or_default().to_owned());
        }
    }
    (out, others)
}

/// Builds the tests and removes mutants that do not compile. These are listed in a file,
/// so that another run does not try them again.
pub fn build(
    root: &Path,
    copy: &Path,
    mutants: &mut Vec<Mutant>,
) -> Result<Vec<TestProgram>, Failure> {
    let list = copy.join("do-not-compile.txt");
    let mut known = std::fs::read_to_string(&list).unwrap_or_default();
    loop {
        mutants.retain(|m| !known.lines().any(|key| key == m.key));
        let places = write(root, copy, mutants)?;
        let (ok, messages) = cargo(copy, &["check", "--lib"])?;
        if ok {
            break;
        }
        let (out, others) = blamed(&messages, &places);
        if out.is_empty() {
            return Err(others.join("\n").into());
        }
        println!("{} do not compile", out.len());
        out.iter().for_each(|id| known = format!("{known}{}\n", mutants[*id].key));
        std::fs::write(&list, &known)?;
    }
    let (ok, messages) = cargo(copy, &["test", "--release", "--no-run"])?;
    if !ok {
        return Err("the tests do not compile".into());
    }
    let tests = messages.iter().filter(|m| m["profile"]["test"] == true).filter_map(|m| {
        let name = m["target"]["name"].as_str()?.to_owned();
        Some(TestProgram { name, path: m["executable"].as_str()?.into() })
    });
    Ok(tests.collect())
}
