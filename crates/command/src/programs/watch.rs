//! `pcadlang check --watch`.

use crate::args::Check;
use crate::programs::check;
use pcadlang_engine::lang::load::{Loader, Shipped, load};
use pcadlang_engine::lang::reach::Reach;
use pcadlang_library::shipped;
use pcadlang_runs::failure::Failure;
use pcadlang_runs::job::Interrupt;
use pcadlang_runs::term;
use pcadlang_syntax::diag::SourceMap;
use std::collections::BTreeMap;
use std::io::{self, IsTerminal};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};

/// The polling interval for files.
const EVERY: Duration = Duration::from_millis(200);

/// Checks programs, and again when one of their files changes, until interrupted.
pub fn watch(a: &Check) -> Result<(), Failure> {
    let interrupt = Interrupt::listen();
    loop {
        let stamps = FileStamps::of(&a.programs, &a.allowed.allow_read);
        clear();
        if let Err(failure) = check::check(a) {
            term::fail(failure);
        }
        print_line!("\nWatching {}; press Ctrl-C to stop.", files(stamps.0.len()));
        loop {
            if interrupt.asked() {
                return Ok(());
            }
            std::thread::sleep(EVERY);
            let changed = stamps.changed();
            if !changed.is_empty() {
                print_line!("Changed: {}", changed.join(", "));
                break;
            }
        }
    }
}

fn files(n: usize) -> String {
    if n == 1 { "1 file".into() } else { format!("{n} files") }
}

/// Clears the screen if the output is a terminal.
fn clear() {
    if io::stdout().is_terminal() {
        print_text!("\x1b[2J\x1b[3J\x1b[H");
    }
}

/// The modification time and length of a file; `None` if the file does not exist.
type Stamp = Option<(SystemTime, u64)>;

/// The files of programs at one time, including files that are referred to but missing.
struct FileStamps(BTreeMap<String, Stamp>);

impl FileStamps {
    fn of(programs: &[String], folders: &[PathBuf]) -> FileStamps {
        // Stamps are taken before a file is read, so that changes during a check are
        // noticed.
        let mut stamps = BTreeMap::new();
        for program in programs {
            let own = shipped::reach().of(program);
            let reach =
                folders.iter().fold(own, |reach, f| reach.clone().allow(f).unwrap_or(reach));
            let asked = RecordingLoader { reach, stamps: Mutex::new(stamps) };
            let _ = load(program, &asked, &mut SourceMap::new());
            stamps = asked.stamps.into_inner().unwrap_or_else(PoisonError::into_inner);
        }
        FileStamps(stamps)
    }

    /// Returns the files that have changed.
    fn changed(&self) -> Vec<&str> {
        self.0
            .iter()
            .filter(|(path, was)| stamp(path) != **was)
            .map(|(path, _)| path.as_str())
            .collect()
    }
}

/// Reads what a program may read, and records the requested files.
struct RecordingLoader {
    reach: Reach,
    stamps: Mutex<BTreeMap<String, Stamp>>,
}

impl Loader for RecordingLoader {
    fn read(&self, path: &str) -> io::Result<Vec<u8>> {
        let mut stamps = self.stamps.lock().unwrap_or_else(PoisonError::into_inner);
        stamps.entry(path.to_owned()).or_insert_with(|| stamp(path));
        self.reach.read(path)
    }

    fn shipped(&self) -> Shipped {
        self.reach.shipped()
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
        std::fs::write(&main, "include \"part.pcad\"; include \"missing.pcad\"; let a = 1;")
            .unwrap();
        std::fs::write(&part, "let b = ;").unwrap();
        let stamps = FileStamps::of(std::slice::from_ref(&main), &[]);
        assert!(stamps.changed().is_empty(), "{:?}", stamps.changed());
        // A file that is included although nothing parses, and a file that does not exist
        // yet.
        std::fs::write(&part, "let b = 10;").unwrap();
        assert_eq!(stamps.changed(), [part.as_str()]);
        std::fs::write(&missing, "").unwrap();
        assert_eq!(stamps.changed(), [missing.as_str(), part.as_str()]);
        let stamps = FileStamps::of(&[main], &[]);
        assert!(stamps.changed().is_empty(), "{:?}", stamps.changed());
        std::fs::remove_file(&part).unwrap();
        assert_eq!(stamps.changed(), [part.as_str()]);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
