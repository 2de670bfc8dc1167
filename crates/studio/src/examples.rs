//! Photographs that come with the program, for shipped programs that need one.

use pcadlang_runs::failure::{Failure, plain};

/// A photograph and the programs that can be tried with it.
struct Example {
    name: &'static str,
    bytes: &'static [u8],
    programs: &'static [&'static str],
}

/// Their authors and licences are in the README, and in the page's help.
static EXAMPLES: [Example; 2] = [
    Example {
        name: "coffee_cup.png",
        bytes: include_bytes!("../../../examples/images/coffee_cup.png"),
        programs: &[
            "lathe.pcad",
            "lathe_parts.pcad",
            "lathe_paper.pcad",
            "scene.pcad",
            "table.pcad",
        ],
    },
    Example {
        name: "skier.jpg",
        bytes: include_bytes!("../../../examples/images/skier.jpg"),
        programs: &["human.pcad", "human_kth.pcad", "human_paper.pcad", "people.pcad"],
    },
];

/// Returns the names of all examples.
pub fn names() -> impl Iterator<Item = &'static str> {
    EXAMPLES.iter().map(|e| e.name)
}

/// Returns the name of the example for a shipped program.
pub fn of_program(program: &str) -> Option<&'static str> {
    EXAMPLES.iter().find(|e| e.programs.contains(&program)).map(|e| e.name)
}

/// Returns the file of an example.
pub fn bytes(name: &str) -> Result<&'static [u8], Failure> {
    let found = EXAMPLES.iter().find(|e| e.name == name).map(|e| e.bytes);
    found.ok_or_else(|| {
        let all: Vec<&str> = names().collect();
        plain(format!("there is no example `{name}`")).hint(format!("one of {}", all.join(", ")))
    })
}
