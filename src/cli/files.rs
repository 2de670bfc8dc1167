//! Reading and writing files with messages that name them.

use super::{Failure, plain};
use pcadlang::lang::load::reason;
use pcadlang::lang::reach::read_file;
use pcadlang::vision::{Limits, Photo, photo};
use std::path::Path;

/// The bytes of a file.
pub fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    read_file(path).map_err(|e| plain(format!("cannot read {}: {}", path.display(), reason(&e))))
}

/// Writes a file.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    std::fs::write(path, bytes).map_err(|e| plain(format!("cannot write {}: {}", path.display(), reason(&e))))
}

/// A photograph.
pub fn photo(path: &Path) -> Result<Photo, Failure> {
    let bytes = read(path)?;
    photo::decode(&bytes, &Limits::default()).map_err(|e| plain(format!("{}: {e}", path.display())))
}
