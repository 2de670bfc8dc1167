//! Follows the guide like a newcomer: writes every file of its chapters and types every
//! command, in the order of the text, in a folder that initially contains only the lamp's
//! picture. The output of each command must match the guide.
//!
//! In the guide, `title=NAME` after a block's language is the name of the file that the
//! block contains; a `diff` block is an edit of the file `from`. Below a command is its
//! output: `...` stands for any lines, `[..]` for any text within a line, `? N` for exit
//! code N.
#![cfg(unix)]

use crate::common::folder::Folder;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A block of a page: the text after the opening fence, and the block's own text.
struct Block<'a> {
    info: &'a str,
    text: String,
    line: usize,
}

impl Block<'_> {
    fn option(&self, key: &str) -> Option<&str> {
        self.info.split(' ').find_map(|word| word.strip_prefix(key)?.strip_prefix('='))
    }
}

fn blocks(page: &str) -> Vec<Block<'_>> {
    let (mut all, mut open): (Vec<Block>, bool) = (Vec::new(), false);
    for (i, line) in page.lines().enumerate() {
        match line.strip_prefix("```") {
            Some(info) if !open => all.push(Block { info, text: String::new(), line: i + 1 }),
            None if open => all.last_mut().unwrap().text += &format!("{line}\n"),
            _ => {}
        }
        open ^= line.starts_with("```");
    }
    all
}

/// Whether the output matches the lines shown.
fn agree(shown: &[&str], said: &[&str]) -> bool {
    match shown.split_first() {
        None => said.is_empty(),
        Some((&"...", rest)) => (0..=said.len()).any(|skip| agree(rest, &said[skip..])),
        Some((line, rest)) => said
            .split_first()
            .is_some_and(|(s, more)| fits(line, s.trim_end()) && agree(rest, more)),
    }
}

/// Whether a line matches the line shown, which may have gaps.
fn fits(shown: &str, said: &str) -> bool {
    let Some((head, tail)) = shown.split_once("[..]") else { return shown == said };
    let Some(rest) = said.strip_prefix(head) else { return false };
    let ends = rest.char_indices().map(|(i, _)| i).chain([rest.len()]);
    ends.into_iter().any(|i| fits(tail, &rest[i..]))
}

#[test]
fn gaps_fit() {
    assert!(agree(&["a", "...", "b[..]d"], &["a", "x", "y", "b c d"]) && agree(&["..."], &[]));
    assert!(!agree(&["a", "...", "b"], &["a", "b", "c"]) && !fits("a[..]b", "a b c"));
}

/// Types the commands of a block.
fn type_in(block: &Block, folder: &Path, place: &str) {
    let path =
        format!("{}:{}", folder.join("bin").display(), std::env::var("PATH").unwrap_or_default());
    let typed = format!("\n{}", block.text);
    for session in typed.split("\n$ ").skip(1) {
        let mut lines: Vec<&str> = session.trim_end().lines().collect();
        let command = lines.remove(0);
        let code = lines.pop_if(|l| l.starts_with("? ")).map_or(0, |l| l[2..].parse().unwrap());
        let done = Command::new("sh")
            .args(["-c", &format!("{{ {command}\n}} 2>&1")])
            .current_dir(folder)
            .env("PATH", &path)
            .output()
            .unwrap();
        let said = String::from_utf8(done.stdout).unwrap();
        // On a busy machine, a run may take long enough to print its progress.
        let phases = ["starts, ", "warm-up, ", "sampling, ", "finishing, "];
        let is_progress = |l: &&str| phases.iter().any(|p| l.starts_with(p));
        let right =
            agree(&lines, &said.trim_end().lines().filter(|l| !is_progress(l)).collect::<Vec<_>>());
        assert!(right, "{place}: `{command}` says\n{said}\nthe guide shows\n{}", lines.join("\n"));
        assert_eq!(done.status.code(), Some(code), "{place}: `{command}`\n{said}");
    }
}

/// Applies an edit: lines with `-` are removed, lines with `+` inserted, the others
/// locate the edit.
fn edit(text: &str, diff: &str, place: &str) -> String {
    let mut text = text.to_owned();
    for hunk in diff.split("@@\n").skip(1) {
        let lines = |sign: char| -> String {
            hunk.lines()
                .filter(|l| l.starts_with([' ', sign]))
                .map(|l| format!("{}\n", &l[1..]))
                .collect()
        };
        let (old, new) = (lines('-'), lines('+'));
        assert_eq!(text.matches(&old).count(), 1, "{place}: the file has not this once:\n{old}");
        text = text.replace(&old, &new);
    }
    text
}

#[test]
fn every_chapter() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = Folder::new("guide");
    let at = folder.path();
    std::fs::create_dir(at.join("bin")).unwrap();
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_pcadlang"), at.join("bin/pcadlang")).unwrap();
    std::fs::copy(root.join("examples/images/table_lamp.png"), at.join("table_lamp.png")).unwrap();
    let pages = std::fs::read_dir(root.join("docs/guide")).unwrap().map(|f| f.unwrap().path());
    let mut chapters: Vec<PathBuf> =
        pages.filter(|p| p.file_name().unwrap() != "README.md").collect();
    chapters.sort();
    assert_eq!(chapters.len(), 10);
    for chapter in chapters {
        let page = std::fs::read_to_string(&chapter).unwrap();
        let name = chapter.file_name().unwrap().to_string_lossy();
        for block in blocks(&page) {
            let place = format!("docs/guide/{name}:{}", block.line);
            let language = block.info.split(' ').next().unwrap_or_default();
            match (language, block.option("title")) {
                ("console", _) => type_in(&block, at, &place),
                ("diff", Some(title)) => {
                    let from =
                        std::fs::read_to_string(at.join(block.option("from").unwrap())).unwrap();
                    std::fs::write(at.join(title), edit(&from, &block.text, &place)).unwrap();
                }
                (_, Some(title)) => std::fs::write(at.join(title), &block.text).unwrap(),
                // All blocks are tested.
                _ => panic!("{place}: a block that is neither a file nor a session"),
            }
        }
    }
}
