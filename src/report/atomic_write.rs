//! Files that no reader ever sees half of: written under another name, then renamed.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The ending of files that are being written.
const PARTIAL: &str = ".partial";

/// Writes a file of a folder; an older one of the name is kept if that fails, and lends
/// the new one its permissions.
///
/// # Errors
/// As the file system has it.
pub fn write_atomically(folder: &Path, name: &str, bytes: &[u8]) -> io::Result<()> {
    let partial = begin(folder, name, |f| f.write_all(bytes))?;
    partial.end().inspect_err(|_| {
        // The error that is told is the first one.
        let _ = std::fs::remove_file(&partial.0);
    })
}

/// A file under its other name.
pub(super) struct PartialFile(PathBuf, PathBuf);

/// Writes a file of a folder under another name: it is at its place when it is
/// [ended](PartialFile::end).
///
/// # Errors
/// If it cannot be written; nothing is left of it then.
pub(super) fn begin(
    folder: &Path,
    name: &str,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> io::Result<PartialFile> {
    let (path, partial) = (folder.join(name), folder.join(format!(".{name}{PARTIAL}")));
    let written = File::create(&partial).and_then(|mut f| {
        write(&mut f)?;
        // The new name must not reach the disk before what it is of.
        f.sync_data()
    });
    match written {
        Ok(()) => Ok(PartialFile(partial, path)),
        Err(e) => {
            let _ = std::fs::remove_file(&partial);
            Err(e)
        }
    }
}

impl PartialFile {
    /// Puts it at its place, with the permissions of an older file there.
    ///
    /// # Errors
    /// If the system cannot.
    pub fn end(&self) -> io::Result<()> {
        if let Ok(older) = std::fs::metadata(&self.1) {
            std::fs::set_permissions(&self.0, older.permissions())?;
        }
        std::fs::rename(&self.0, &self.1)
    }
}

/// Writes a file; an older one of the path is kept if that fails.
///
/// # Errors
/// If it cannot be written, or the path names no file.
pub fn write_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let name = path.file_name().and_then(|n| n.to_str()).ok_or(io::ErrorKind::InvalidInput)?;
    write_atomically(path.parent().unwrap_or(Path::new("")), name, bytes)
}

/// Whether a file is half of one, as [`write_atomically`] names them.
pub(super) fn is_partial(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(PARTIAL)
}
