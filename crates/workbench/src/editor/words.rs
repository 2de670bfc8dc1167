//! The words around a cursor, from the text alone: shared by the prompt and by editors.

use pcadlang_syntax::{Class, classes};
use std::path::Path;

/// Tags that choices get from their distributions.
pub const KINDS: &[&str] = &["$continuous", "$discrete", "$finite", "$gaussian"];

/// Built-ins that read files.
const READERS: &[&str] = &[
    "image",
    "csv",
    "json",
    "mesh",
    "armature",
    "keypoints",
    "mask",
    "depth",
    "contours",
    "detector",
];

/// Returns the endings of the files whose names belong into a string that is opened after
/// this text (any file for none); `None` if it is not the name of a file.
pub fn files_wanted(before: &str) -> Option<&'static [&'static str]> {
    let before = before.trim_end();
    if before.ends_with("include") {
        return Some(&[".pcad"]);
    }
    let call = before.trim_end_matches('(');
    READERS.iter().any(|name| call.ends_with(name)).then_some(&[])
}

/// Returns where the piece of such characters begins that ends a text.
pub fn start_of(before: &str, part: impl Fn(char) -> bool) -> usize {
    before
        .rfind(|c: char| !part(c))
        .map_or(0, |i| i + before[i..].chars().next().map_or(1, char::len_utf8))
}

/// Returns where the text of an unclosed string begins.
pub fn open_string(before: &str) -> Option<usize> {
    let mut open = None;
    let mut chars = before.char_indices();
    while let Some((i, c)) = chars.next() {
        match c {
            '\\' if open.is_some() => {
                chars.next();
            }
            '"' => open = if open.is_some() { None } else { Some(i + 1) },
            _ => {}
        }
    }
    open
}

/// Returns the name of the call whose arguments are open at the end of a text.
pub fn enclosing_call(before: &str) -> Option<String> {
    open_call(before).map(|(name, _)| name)
}

/// Returns the characters of a text, with their places, that are not in strings, comments or
/// addresses.
fn code(text: &str) -> impl DoubleEndedIterator<Item = (usize, char)> {
    let is_code = |c: &Class| !matches!(c, Class::String | Class::Comment | Class::Address);
    let hidden: Vec<_> = classes(text).into_iter().filter(|(_, c)| !is_code(c)).collect();
    text.char_indices().filter(move |(i, _)| hidden.iter().all(|(r, _)| !r.contains(i)))
}

/// Returns the name of the call whose arguments are open at the end of a text, and where they
/// begin.
pub fn open_call(before: &str) -> Option<(String, usize)> {
    let mut depth = 0;
    for (i, c) in code(before).rev() {
        match c {
            ')' | ']' | '}' => depth += 1,
            '(' if depth == 0 => {
                let head = before[..i].trim_end();
                let start = start_of(head, |c| c.is_alphanumeric() || c == '_' || c == '.');
                // Parentheses without a name are around a part of an argument.
                if start < head.len() {
                    return Some((head[start..].to_owned(), i + 1));
                }
            }
            '(' | '[' | '{' => depth -= 1,
            ';' if depth == 0 => return None,
            _ => {}
        }
        if depth < 0 {
            // Inside an array or record among the arguments.
            depth = 0;
        }
    }
    None
}

/// Returns where each argument of a call begins, from the text of its arguments so far.
pub fn arguments(text: &str) -> Vec<usize> {
    let mut depth = 0;
    let mut all = vec![0];
    for (i, c) in code(text) {
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            ',' if depth == 0 => all.push(i + 1),
            _ => {}
        }
    }
    all
}

/// Lists the files and subfolders of the folder that a path names, relative to `base`;
/// files only with one of the endings, if any are given. Hidden names are left out.
pub fn files<'e>(
    base: &Path,
    word: &str,
    endings: &'e [&'e str],
) -> impl Iterator<Item = String> + use<'e> {
    let folder = word.rfind('/').map_or("", |i| &word[..=i]).to_owned();
    let listed = std::fs::read_dir(base.join(if folder.is_empty() { "." } else { &folder }));
    listed.into_iter().flatten().flatten().filter_map(move |e| {
        let name = e.file_name().into_string().ok().filter(|n| !n.starts_with('.'))?;
        let is_folder = e.path().is_dir();
        let fits = is_folder || endings.is_empty() || endings.iter().any(|x| name.ends_with(x));
        fits.then(|| format!("{folder}{name}{}", if is_folder { "/" } else { "" }))
    })
}
