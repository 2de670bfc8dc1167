//! The programs in `tests/syntax`, and the shipped programs.

use super::{bare, program};
use crate::common::snapshots;
use pcadlang_syntax::print;

#[test]
fn samples_parse_as_printed() {
    snapshots::settings("").bind(|| {
        insta::glob!("../../syntax", "*.pcad", |path| {
            let text = std::fs::read_to_string(path).unwrap();
            insta::assert_snapshot!("sample", print(&program(&text)));
        });
    });
}

#[test]
fn programs_survive_printing() {
    let mut count = 0;
    for folder in ["tests/syntax", "programs"] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "pcad") {
                let tree = program(&std::fs::read_to_string(&path).unwrap());
                let printed = print(&tree);
                let again = program(&printed);
                assert_eq!(bare(&tree), bare(&again), "{}", path.display());
                assert_eq!(printed, print(&again), "{}", path.display());
                count += 1;
            }
        }
    }
    assert!(count >= 5);
}
