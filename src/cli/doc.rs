//! `pcadlang doc`.

use super::args::Doc;
use super::{Failure, plain};
use pcadlang::lang::builtins::{Table, doc as docs};

/// Prints what the table of built-ins says.
pub fn doc(a: &Doc) -> Result<(), Failure> {
    let table = Table::default();
    let Some(name) = &a.name else {
        print!("{}", docs::reference(&table));
        return Ok(());
    };
    match docs::doc(&table, name) {
        Some(text) => {
            print!("{text}");
            Ok(())
        }
        None => {
            let names: Vec<String> = table.iter().map(|b| b.full_name()).collect();
            let near = pcadlang::diag::nearest(name, names.iter().map(String::as_str));
            let hint = near.map_or("`pcadlang doc` lists all of them".into(), |n| format!("did you mean `{n}`?"));
            match name.as_str() {
                "" => Err(plain("a name is needed")),
                _ => Err(Failure::Plain(format!("there is no built-in `{name}`"), Some(hint))),
            }
        }
    }
}
