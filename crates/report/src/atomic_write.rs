//! Files that readers never see half-written: written under a temporary name, then
//! renamed.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The suffix of files that are being written.
const PARTIAL: &str = ".partial";

/// Writes a file in a folder. If that fails, an older file of the same name is kept;
/// otherwise the new file gets the permissions of the older one. Only with `lasting` it survives
/// a power failure just after, for which the disk is waited for.
///
/// # Errors
/// Returns the error of the file system.
pub fn write_atomically(folder: &Path, name: &str, bytes: &[u8], lasting: bool) -> io::Result<()> {
    let partial = begin(folder, name, lasting, |f| f.write_all(bytes))?;
    partial.end().inspect_err(|_| {
        // Report the first error, not one of the clean-up.
        let _ = std::fs::remove_file(&partial.0);
    })
}

/// A file under its temporary name, and its final path.
pub(super) struct PartialFile(PathBuf, PathBuf);

/// Writes a file in a folder under a temporary name; [`PartialFile::end`] gives it its final
/// name.
///
/// # Errors
/// Returns an error if it cannot be written; the temporary file is then removed.
pub(super) fn begin(
    folder: &Path,
    name: &str,
    lasting: bool,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> io::Result<PartialFile> {
    let (path, partial) = (folder.join(name), folder.join(format!(".{name}{PARTIAL}")));
    let written = File::create(&partial).and_then(|mut f| {
        write(&mut f)?;
        // The final name must not reach the disk before the contents.
        if lasting { f.sync_data() } else { Ok(()) }
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
    /// Gives the file its final name, with the permissions of an older file of that name.
    ///
    /// # Errors
    /// Returns an error if the permissions cannot be set or the file cannot be renamed.
    pub fn end(&self) -> io::Result<()> {
        if let Ok(older) = std::fs::metadata(&self.1) {
            std::fs::set_permissions(&self.0, older.permissions())?;
        }
        std::fs::rename(&self.0, &self.1)
    }
}

/// Writes a file; if that fails, an older file at the path is kept.
///
/// # Errors
/// Returns an error if it cannot be written, or the path does not name a file.
pub fn write_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let name = path.file_name().and_then(|n| n.to_str()).ok_or(io::ErrorKind::InvalidInput)?;
    write_atomically(path.parent().unwrap_or(Path::new("")), name, bytes, true)
}

/// Returns whether a file is partially written, by the name that [`begin`] gives.
pub(super) fn is_partial(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(PARTIAL)
}
