//! Files that no reader ever sees half of: written under another name, then renamed.

use std::io::{self, Write};
use std::path::Path;

/// The ending of files that are being written.
const PARTIAL: &str = ".partial";

/// Writes a file of a folder; an older one of the name is kept if that fails, and lends the new one its permissions.
///
/// # Errors
/// As the file system has it.
pub fn write_whole(folder: &Path, name: &str, bytes: &[u8]) -> io::Result<()> {
    let (path, partial) = (folder.join(name), folder.join(format!(".{name}{PARTIAL}")));
    let mut written = std::fs::File::create(&partial).and_then(|mut f| {
        f.write_all(bytes)?;
        // The new name must not reach the disk before what it is of.
        f.sync_data()
    });
    if let (Ok(()), Ok(older)) = (&written, std::fs::metadata(&path)) {
        written = std::fs::set_permissions(&partial, older.permissions());
    }
    if written.is_ok() {
        written = std::fs::rename(&partial, &path);
    }
    written.inspect_err(|_| {
        // The error that is told is the first one.
        let _ = std::fs::remove_file(&partial);
    })
}

/// Writes a file; an older one of the path is kept if that fails.
///
/// # Errors
/// If it cannot be written, or the path names no file.
pub fn write_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let name = path.file_name().and_then(|n| n.to_str()).ok_or(io::ErrorKind::InvalidInput)?;
    write_whole(path.parent().unwrap_or(Path::new("")), name, bytes)
}

/// Whether a file is half of one, as [`write_whole`] names them.
pub(super) fn is_partial(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(PARTIAL)
}
