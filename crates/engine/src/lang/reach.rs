//! The files that a program may read: those below some folders, and those named from
//! outside. Symbolic links and `..` are resolved before paths are compared. A file that
//! is replaced between the comparison and the reading is not detected.

use std::fmt;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// A source of files.
pub trait Loader: Send + Sync {
    /// Returns the bytes of a file.
    ///
    /// # Errors
    /// If the file cannot be read.
    fn read(&self, path: &str) -> io::Result<Vec<u8>>;

    /// Returns the files that are found where [`read`](Loader::read) finds none.
    fn shipped(&self) -> Shipped {
        &[]
    }
}

/// Files that come with a program that embeds the language: names and contents.
pub type Shipped = &'static [(&'static str, &'static str)];

/// Returns the contents of a shipped file.
pub fn shipped_file(files: Shipped, path: &str) -> Option<&'static str> {
    files.iter().find(|(name, _)| *name == path).map(|(_, text)| *text)
}

/// The folders and files that a program may read; by default none.
#[derive(Clone, Debug, Default)]
pub struct Reach {
    /// The program's own folder; like all folders here, without links and `..`.
    own: Option<PathBuf>,
    /// The program's file as it was named, and with links resolved.
    program: Option<(PathBuf, PathBuf)>,
    /// Other folders that it may read.
    folders: Vec<PathBuf>,
    /// The files that are found in any folder.
    shipped: Shipped,
}

/// The error for a file, existing or not, in a place that a program may not read.
#[derive(Debug)]
pub struct Outside {
    /// The folder to allow.
    folder: PathBuf,
}

impl fmt::Display for Outside {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "it is outside the folders that the program may read")
    }
}

impl std::error::Error for Outside {}

impl Outside {
    /// Returns a hint, if an error is such a refusal.
    pub fn hint(e: &io::Error) -> Option<String> {
        let refused = e.get_ref()?.downcast_ref::<Outside>()?;
        Some(format!(
            "a program may read only files in its own folder and below; --allow-read {} allows this folder too",
            refused.folder.display()
        ))
    }
}

impl Reach {
    /// Returns a reach of these files alone, which are found in any folder.
    pub fn shipping(shipped: Shipped) -> Reach {
        Reach { shipped, ..Reach::default() }
    }

    /// Returns the reach of another program with the same additional folders: its file,
    /// wherever links lead, and everything below its folder. If that folder does not
    /// exist, nothing can be read.
    #[must_use]
    pub fn of(&self, program: &str) -> Reach {
        let path = Path::new(program);
        let own = folder_of(path).canonicalize().ok();
        let program = path.canonicalize().ok().map(|real| (path.to_owned(), real));
        Reach { own, program, folders: self.folders.clone(), shipped: self.shipped }
    }

    /// Also allows everything below a folder.
    ///
    /// # Errors
    /// If the folder does not exist.
    pub fn allow(mut self, folder: &Path) -> io::Result<Reach> {
        let real = folder.canonicalize()?;
        if !real.is_dir() {
            return Err(io::ErrorKind::NotADirectory.into());
        }
        self.folders.push(real);
        Ok(self)
    }

    /// Returns the file to read for a path.
    ///
    /// # Errors
    /// If the file does not exist or may not be read. Outside of the allowed folders the
    /// error does not tell whether it exists.
    pub fn resolve(&self, path: &Path) -> io::Result<PathBuf> {
        let outside = |folder: &Path| Err(io::Error::other(Outside { folder: folder.to_owned() }));
        match path.canonicalize() {
            Ok(real) => {
                let named =
                    self.program.as_ref().is_some_and(|(name, file)| name == path && *file == real);
                if named || self.holds(&real) { Ok(real) } else { outside(folder_of(&real)) }
            }
            Err(e) => {
                match path.ancestors().skip(1).find_map(|p| existing(p).canonicalize().ok()) {
                    Some(nearest) if !self.holds(&nearest) => outside(&nearest),
                    _ => Err(e),
                }
            }
        }
    }

    fn holds(&self, real: &Path) -> bool {
        self.own.iter().chain(&self.folders).any(|f| real.starts_with(f))
    }
}

impl Loader for Reach {
    fn read(&self, path: &str) -> io::Result<Vec<u8>> {
        let real = self.resolve(Path::new(path))?;
        let found = real.metadata()?;
        // Reading a pipe could block forever.
        if !found.is_file() && !found.is_dir() {
            return Err(io::Error::other("it is not a regular file"));
        }
        read_file(&real)
    }

    fn shipped(&self) -> Shipped {
        self.shipped
    }
}

/// The maximum size in bytes of a file that is read as a whole.
pub const MOST_BYTES: u64 = 1 << 29;

/// Returns the bytes of a file that is not too large.
///
/// # Errors
/// If the file cannot be read, or is larger than [`MOST_BYTES`].
pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    std::fs::File::open(path)?.take(MOST_BYTES + 1).read_to_end(&mut bytes)?;
    match bytes.len() as u64 > MOST_BYTES {
        true => {
            Err(io::Error::other(format!("it is too large; at most {MOST_BYTES} bytes are read")))
        }
        false => Ok(bytes),
    }
}

/// Returns the folder of a file.
pub fn folder_of(file: &Path) -> &Path {
    existing(file.parent().unwrap_or(file))
}

/// Replaces the empty path by the current folder.
fn existing(path: &Path) -> &Path {
    if path.as_os_str().is_empty() { Path::new(".") } else { path }
}

/// Returns a path within a folder. Neither `..` nor a link leads out of it.
///
/// # Errors
/// If it leads out of the folder, or names nothing.
pub fn path_within(folder: &Path, asked: &str) -> Result<PathBuf, String> {
    let out = || format!("{asked}: only files of the opened folder can be used");
    let asked_path = Path::new(asked);
    let is_plain = |c: Component| matches!(c, Component::Normal(_) | Component::CurDir);
    if asked.is_empty() || asked.contains('\0') || !asked_path.components().all(is_plain) {
        return Err(out());
    }
    let path = folder.join(asked_path);
    // A file that does not exist yet is judged by the nearest folder that does.
    let there = path.ancestors().find(|p| p.exists()).unwrap_or(folder);
    let real = |p: &Path| p.canonicalize().map_err(|e| format!("{asked}: {e}"));
    match real(there)?.starts_with(real(folder)?) {
        true => Ok(path),
        false => Err(out()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_path_leads_out_of_the_folder() {
        let folder = std::env::temp_dir().join(format!("pcadlang-guard-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("sub")).unwrap();
        std::fs::write(folder.join("sub/a.png"), b"a").unwrap();
        let ok = |p: &str| path_within(&folder, p).is_ok();
        assert!(ok("sub/a.png") && ok("./sub/a.png") && ok("new/b.png"));
        for out in ["..", "../x", "sub/../../x", "/etc/passwd", "", "sub/\0", "sub/../.."] {
            assert!(!ok(out), "{out:?}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("/etc", folder.join("link")).unwrap();
            assert!(!ok("link/passwd") && !ok("link/new"));
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
