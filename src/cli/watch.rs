//! `pcadlang check --watch`.

use super::args::Check;
use super::job::Interrupt;
use super::{Failure, check, term};
use pcadlang::diag::SourceMap;
use pcadlang::lang::load::{Disk, Loader, load};
use std::collections::BTreeMap;
use std::io::{self, IsTerminal};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};

/// How often files are looked at.
const EVERY: Duration = Duration::from_millis(200);

/// Checks programs, and again when one of their files changes, until the user ends it.
pub fn watch(a: &Check) -> Result<(), Failure> {
    let interrupt = Interrupt::listen();
    loop {
        let seen = Seen::of(&a.programs);
        clear();
        if let Err(failure) = check::check(a) {
            term::fail(failure);
        }
        println!("\nWatching {}; Ctrl-C ends.", files(seen.0.len()));
        loop {
            if interrupt.asked() {
                return Ok(());
            }
            std::thread::sleep(EVERY);
            let changed = seen.changed();
            if !changed.is_empty() {
                println!("Changed: {}", changed.join(", "));
                break;
            }
        }
    }
}

fn files(n: usize) -> String {
    if n == 1 { "1 file".into() } else { format!("{n} files") }
}

/// Clears the screen, where there is one.
fn clear() {
    if io::stdout().is_terminal() {
        print!("\x1b[2J\x1b[3J\x1b[H");
    }
}

/// When a file was written, and how long it is; nothing if it is not there.
type Stamp = Option<(SystemTime, u64)>;

/// The files of programs, those that are looked for and missing too, as they are at one time.
struct Seen(BTreeMap<String, Stamp>);

impl Seen {
    fn of(programs: &[String]) -> Seen {
        // What the text was read before is seen: a change that comes while it is checked counts.
        let asked = Asked::default();
        for program in programs {
            let _ = load(program, &asked, &mut SourceMap::new());
        }
        Seen(asked.0.into_inner().unwrap_or_else(PoisonError::into_inner))
    }

    /// The files that are not as they were.
    fn changed(&self) -> Vec<&str> {
        self.0.iter().filter(|(path, was)| stamp(path) != **was).map(|(path, _)| path.as_str()).collect()
    }
}

/// Reads from the file system and remembers what it was asked for.
#[derive(Default)]
struct Asked(Mutex<BTreeMap<String, Stamp>>);

impl Loader for Asked {
    fn read(&self, path: &str) -> io::Result<Vec<u8>> {
        let mut asked = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        asked.entry(path.to_owned()).or_insert_with(|| stamp(path));
        Disk.read(path)
    }
}

fn stamp(path: &str) -> Stamp {
    let about = std::fs::metadata(path).ok()?;
    Some((about.modified().ok()?, about.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_of_every_file_are_seen() {
        let folder = std::env::temp_dir().join(format!("pcadlang-watch-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
        let (main, part, missing) = (path("main.pcad"), path("part.pcad"), path("missing.pcad"));
        std::fs::write(&main, "include \"part.pcad\"; include \"missing.pcad\"; let a = 1;").unwrap();
        std::fs::write(&part, "let b = ;").unwrap();
        let seen = Seen::of(std::slice::from_ref(&main));
        assert!(seen.changed().is_empty(), "{:?}", seen.changed());
        // A file that is included, though nothing parses, and one that is not there yet.
        std::fs::write(&part, "let b = 10;").unwrap();
        assert_eq!(seen.changed(), [part.as_str()]);
        std::fs::write(&missing, "").unwrap();
        assert_eq!(seen.changed(), [missing.as_str(), part.as_str()]);
        let seen = Seen::of(&[main]);
        assert!(seen.changed().is_empty(), "{:?}", seen.changed());
        std::fs::remove_file(&part).unwrap();
        assert_eq!(seen.changed(), [part.as_str()]);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
