//! Hints as they apply to the page, where nobody types options of the command line.

/// What a hint speaks of, and what is to be done on the page instead.
const INSTEAD: [(&str, &str); 4] = [
    ("--set ", "give it a default in the program: param n = 10;"),
    ("--observe ", "choose a photograph, or the example, at the top of the page"),
    ("--allow-read ", "move the file into the folder of the program"),
    ("--limit ", "make the program smaller: limits are set where the studio is started"),
];

/// Returns a hint without options of the command line.
pub fn on_page(hint: &str) -> &str {
    INSTEAD.iter().find(|(option, _)| hint.contains(option)).map_or(hint, |(_, instead)| instead)
}
