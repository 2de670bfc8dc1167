//! Reads and writes files, with error messages that name them.

use crate::failure::{Failure, plain};
use pcadlang_engine::lang::load::reason;
use pcadlang_engine::lang::reach::read_file;
use pcadlang_library::shipped;
use pcadlang_numerics::platform::threads::map_side_by_side;
use pcadlang_report::RunDir;
use std::path::Path;

/// Reads a file.
pub fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    read_file(path).map_err(|e| plain(format!("cannot read {}: {}", path.display(), reason(&e))))
}

/// Writes a file.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    std::fs::write(path, bytes)
        .map_err(|e| plain(format!("cannot write {}: {}", path.display(), reason(&e))))
}

/// Writes a file of a run.
pub fn write_in(dir: &RunDir, name: &str, bytes: &[u8]) -> Result<(), Failure> {
    dir.write(name, bytes).map_err(|e| plain(format!("{e}; earlier output is kept")))
}

/// Something that is done for a run, and may fail.
pub type Task<'a> = &'a (dyn Fn() -> Result<(), Failure> + Sync);

/// Does things side by side; returns the first failure in their order.
pub fn do_all(tasks: &[Task]) -> Result<(), Failure> {
    map_side_by_side(tasks, |task| task()).into_iter().collect()
}

/// Resolves the name of a program on the command line: `lathe` means `lathe.pcad`, unless
/// a file named `lathe` exists.
pub fn program_name(text: &str) -> Result<String, std::convert::Infallible> {
    let path = Path::new(text);
    let full = format!("{text}.pcad");
    let is_short = path.extension().is_none() && !path.exists();
    let there = Path::new(&full).exists() || shipped::file(&full).is_some();
    Ok(if is_short && there { full } else { text.to_owned() })
}
