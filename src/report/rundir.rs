//! The folder of a run: readable at any moment, never mixed with anything else.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The file every run folder has.
pub const MARK: &str = "run.json";

/// A folder that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RunDirError {
    /// It holds something else.
    #[error("{0} is not empty and no folder of a run; choose another with --out")]
    Occupied(PathBuf),
    /// It cannot be made or written.
    #[error("{path}: {error}")]
    Io {
        /// Where.
        path: PathBuf,
        /// What.
        error: io::Error,
    },
}

/// The folder of a run.
#[derive(Clone, Debug)]
pub struct RunDir {
    path: PathBuf,
}

impl RunDir {
    /// Makes the folder; one that holds an earlier run is used again and its files are replaced.
    ///
    /// # Errors
    /// If it cannot be made, or holds files that are none of a run's.
    pub fn create(path: &Path) -> Result<RunDir, RunDirError> {
        let io = |error| RunDirError::Io { path: path.to_owned(), error };
        if path.exists() {
            let mut entries = std::fs::read_dir(path).map_err(io)?.peekable();
            if entries.peek().is_some() && !path.join(MARK).exists() {
                return Err(RunDirError::Occupied(path.to_owned()));
            }
        }
        std::fs::create_dir_all(path).map_err(io)?;
        Ok(RunDir { path: path.to_owned() })
    }

    /// The first of `name`, `name-2`, `name-3`, … that does not exist yet.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn fresh(parent: &Path, name: &str) -> Result<RunDir, RunDirError> {
        let candidate = |n: u32| parent.join(if n == 1 { name.to_owned() } else { format!("{name}-{n}") });
        let free = (1..10_000).map(candidate).find(|p| !p.exists()).unwrap_or_else(|| candidate(10_000));
        RunDir::create(&free)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The path of a file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Writes a file: under another name first, so that no reader sees half of it.
    ///
    /// # Errors
    /// If it cannot be written; an older file of the name is kept then.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), RunDirError> {
        let (path, partial) = (self.file(name), self.file(&format!(".{name}.partial")));
        let io = |error| RunDirError::Io { path: path.clone(), error };
        let written = std::fs::File::create(&partial).and_then(|mut f| f.write_all(bytes));
        if let Err(e) = written {
            let _ = std::fs::remove_file(&partial);
            return Err(io(e));
        }
        std::fs::rename(&partial, &path).map_err(io)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_of_something_else_is_left_alone() {
        let base = std::env::temp_dir().join(format!("pcadlang-rundir-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&base);
        let dir = RunDir::fresh(&base, "a").unwrap();
        dir.write(MARK, b"{}").unwrap();
        assert!(RunDir::create(dir.path()).is_ok(), "a run's folder may be used again");
        assert_eq!(RunDir::fresh(&base, "a").unwrap().path(), base.join("a-2"));
        std::fs::create_dir_all(base.join("b")).unwrap();
        std::fs::write(base.join("b/photo.jpg"), b"x").unwrap();
        assert!(matches!(RunDir::create(&base.join("b")), Err(RunDirError::Occupied(_))));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "no partial file is left");
        std::fs::remove_dir_all(&base).unwrap();
    }
}
