//! `pcadlang doc`.

use crate::args::Doc;
use pcadlang_engine::lang::builtins::search::search;
use pcadlang_engine::lang::builtins::{Table, doc as docs};
use pcadlang_library::standard;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_syntax::elsewhere::called_here;

/// Prints documentation from the table of built-ins.
pub fn doc(a: &Doc) -> Result<(), Failure> {
    let table = standard::table();
    if let Some(words) = &a.search {
        return find(&table, &words.join(" "));
    }
    let Some(name) = &a.name else {
        print_text!("{}", docs::reference(&table));
        return Ok(());
    };
    match docs::doc(&table, name) {
        Some(text) => {
            print_text!("{text}");
            Ok(())
        }
        None => {
            let names: Vec<String> = table.iter().map(|b| b.full_name()).collect();
            let near = pcadlang_syntax::diag::nearest(name, names.iter().map(String::as_str));
            let here = called_here(name).map(|here| format!("write `{here}`"));
            let near = here.or_else(|| near.map(|n| format!("did you mean `{n}`?")));
            let search =
                || format!("`pcadlang doc --search {name}` also searches the descriptions");
            let hint = near.unwrap_or_else(search);
            match name.as_str() {
                "" => Err(plain("a name is needed")),
                _ => Err(Failure::Plain(format!("there is no built-in `{name}`"), Some(hint))),
            }
        }
    }
}

/// The maximum number of built-ins listed.
const LISTED: usize = 20;

/// Lists the built-ins that match some words, the best first.
fn find(table: &Table, words: &str) -> Result<(), Failure> {
    let found = search(table, words);
    for (word, near) in &found.instead {
        print_line!("No match for \"{word}\"; searching for \"{near}\".\n");
    }
    for word in found.unknown.iter().filter(|_| !found.entries.is_empty()) {
        print_line!("No match for \"{word}\".\n");
    }
    for b in found.entries.iter().take(LISTED) {
        print_line!("{}\n    {}", b.signature(), b.doc);
    }
    match found.entries.len() {
        0 => Err(Failure::Plain(
            format!("no built-in matches {words:?}"),
            Some("`pcadlang doc` lists all of them".into()),
        )),
        n if n > LISTED => {
            print_line!("… and {} more; another word narrows it down", n - LISTED);
            Ok(())
        }
        _ => Ok(()),
    }
}
