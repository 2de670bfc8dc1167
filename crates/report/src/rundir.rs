//! The folder of a run: readable at any moment, and never mixed with other files.
//!
//! Invariant: a file written through [`RunDir::write`] is complete or absent; only files
//! of draws grow. The folder holds one run: the files of an earlier run are removed
//! before the next one starts.

use super::atomic_write::{is_partial, write_atomically};
use std::io;
use std::path::{Path, PathBuf};

/// The file that marks the folder of a run.
pub const MARK: &str = "run.json";
/// Its contents while the files of an earlier run are being removed.
const CLEARED: &[u8] = b"{}";
/// The files that a run writes besides `run.json`, numbered files, and the exports of its
/// program.
const WRITTEN: [&str; 27] = [
    "program.pcad",
    "traces.jsonl",
    "trajectory.jsonl",
    "scene.json",
    "film.png",
    "film.glb",
    super::zarr::ZARR,
    "summary.json",
    "best.trace.json",
    "photo.jpg",
    "photo_contours.png",
    "joints.png",
    "overlay.png",
    "contours.png",
    "uncertainty.png",
    "modes.png",
    "mask.png",
    "depth.npy",
    "normals.npy",
    "best.obj",
    "best.glb",
    "keypoints.json",
    "keypoints.coco.json",
    "mask.coco.json",
    "pose.json",
    "pose.bvh",
    "report.html",
];

/// The reasons why a folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RunDirError {
    /// It holds other files.
    #[error("{0} is not empty and is not the folder of a run; choose another with --out")]
    Occupied(PathBuf),
    /// It holds files, but no evaluation.
    #[error("{0} is not empty and is not the folder of an evaluation; choose another with --out")]
    NoEvaluation(PathBuf),
    /// It does not hold a run.
    #[error("{0} is not the folder of a run")]
    NoRun(PathBuf),
    /// It cannot be created or written.
    #[error("{path}: {error}")]
    Io {
        /// The path.
        path: PathBuf,
        /// The error.
        error: io::Error,
    },
}

/// The folder of a run, or of an evaluation.
#[derive(Clone, Debug)]
pub struct RunDir {
    path: PathBuf,
}

impl RunDir {
    pub(super) fn of(path: &Path) -> RunDir {
        RunDir { path: path.to_owned() }
    }

    /// Creates the folder. If it holds an earlier run, the files of that run are removed
    /// first, so that draws and pictures of two runs are never mixed.
    ///
    /// # Errors
    /// Returns an error if it cannot be created, or holds files that do not belong to a
    /// run.
    pub fn create(path: &Path) -> Result<RunDir, RunDirError> {
        let io = |error| RunDirError::Io { path: path.to_owned(), error };
        std::fs::create_dir_all(path).map_err(io)?;
        let names: Vec<_> = std::fs::read_dir(path)
            .map_err(io)?
            .map(|e| Ok(e?.file_name()))
            .collect::<Result<_, _>>()
            .map_err(io)?;
        let names: Vec<&str> = names.iter().map(|n| n.to_str().unwrap_or("")).collect();
        // A run that was killed before its first file was complete leaves only a partial
        // file.
        if !names.contains(&MARK) && names.iter().any(|n| !is_partial(n)) {
            return Err(RunDirError::Occupied(path.to_owned()));
        }
        // If this is interrupted, the mark must not stand for a complete run.
        if names.contains(&MARK) {
            write_atomically(path, MARK, CLEARED, true).map_err(io)?;
        }
        for name in
            names.into_iter().filter(|n| is_partial(n) || is_numbered(n) || WRITTEN.contains(n))
        {
            let path = path.join(name);
            if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) }
                .map_err(io)?;
        }
        Ok(RunDir::of(path))
    }

    /// Creates the first of the folders `name`, `name-2`, `name-3`, … that does not exist
    /// yet.
    ///
    /// # Errors
    /// Returns an error if it cannot be created.
    pub fn fresh(parent: &Path, name: &str) -> Result<RunDir, RunDirError> {
        let free = (1..MOST).map(|n| numbered(parent, name, n)).find(|p| !p.exists());
        let free = free.unwrap_or_else(|| numbered(parent, name, MOST));
        RunDir::create(&free)
    }

    /// Opens a folder that holds a run, and keeps its files.
    ///
    /// # Errors
    /// Returns an error if it does not hold a run.
    pub fn open(path: &Path) -> Result<RunDir, RunDirError> {
        match path.join(MARK).is_file() {
            true => Ok(RunDir::of(path)),
            false => Err(RunDirError::NoRun(path.to_owned())),
        }
    }

    /// Returns the last folder that [`RunDir::fresh`] created, or the first that it would
    /// create.
    pub fn latest(parent: &Path, name: &str) -> PathBuf {
        let made = (1..MOST).map(|n| numbered(parent, name, n)).take_while(|p| p.exists()).last();
        made.unwrap_or_else(|| numbered(parent, name, 1))
    }

    /// Returns the path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the path of a file in the folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Writes a file under a temporary name first, so that readers never see half of it. What a
    /// run is resumed from survives a power failure too.
    ///
    /// # Errors
    /// Returns an error if it cannot be written; an older file of the same name is then
    /// kept.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), RunDirError> {
        let resumed = name == MARK || name == "program.pcad" || name.ends_with(".checkpoint");
        write_atomically(&self.path, name, bytes, resumed)
            .map_err(|error| RunDirError::Io { path: self.file(name), error })
    }
}

/// The maximum number of run folders with the same name.
const MOST: u32 = 10_000;

/// Returns the path `name`, `name-2`, `name-3`, ….
fn numbered(parent: &Path, name: &str, n: u32) -> PathBuf {
    parent.join(if n == 1 { name.to_owned() } else { format!("{name}-{n}") })
}

/// Returns whether a file holds draws of a chain, its checkpoint, or the picture of a
/// mode.
fn is_numbered(name: &str) -> bool {
    let forms = [
        ("chain-", ".csv"),
        ("draws-", ".csv"),
        ("chain-", ".checkpoint"),
        ("mode-", ".png"),
        ("pose-", ".bvh"),
    ];
    let number =
        forms.iter().find_map(|(before, after)| name.strip_prefix(before)?.strip_suffix(after));
    number.is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the path of a folder for one test, which does not exist yet.
    fn base(name: &str) -> PathBuf {
        let base =
            std::env::temp_dir().join(format!("pcadlang-rundir-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&base);
        base
    }

    fn names(dir: &Path) -> Vec<String> {
        let mut all: Vec<_> = std::fs::read_dir(dir)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        all.sort();
        all
    }

    #[test]
    fn a_folder_of_something_else_is_left_alone() {
        let base = base("else");
        let dir = RunDir::fresh(&base, "a").unwrap();
        dir.write(MARK, b"{}").unwrap();
        assert!(RunDir::create(dir.path()).is_ok(), "a run's folder may be used again");
        assert_eq!(RunDir::fresh(&base, "a").unwrap().path(), base.join("a-2"));
        std::fs::create_dir_all(base.join("b")).unwrap();
        std::fs::write(base.join("b/overlay.png"), b"x").unwrap();
        assert!(matches!(RunDir::create(&base.join("b")), Err(RunDirError::Occupied(_))));
        assert_eq!(names(&base.join("b")), ["overlay.png"], "nothing of it is removed");
        std::fs::write(base.join("c"), b"x").unwrap();
        assert!(
            matches!(RunDir::create(&base.join("c")), Err(RunDirError::Io { .. })),
            "a file is no folder"
        );
        std::fs::remove_dir_all(&base).unwrap();
    }

    #[test]
    fn an_earlier_run_is_cleared_away_and_nothing_else() {
        let base = base("earlier");
        let dir = RunDir::create(&base).unwrap();
        for name in [
            MARK,
            "chain-1.csv",
            "chain-12.csv",
            "draws-2.csv",
            "best.obj",
            "mode-2.png",
            "mode-x.png",
            ".report.html.partial",
            "notes.txt",
            "chain-x.csv",
        ] {
            std::fs::write(dir.file(name), b"old").unwrap();
        }
        RunDir::create(&base).unwrap();
        assert_eq!(names(&base), ["chain-x.csv", "mode-x.png", "notes.txt", MARK]);
        std::fs::remove_dir_all(&base).unwrap();
    }

    #[test]
    fn a_run_killed_at_its_start_does_not_block_the_folder() {
        let base = base("killed");
        std::fs::create_dir_all(&base).unwrap();
        std::fs::write(base.join(".run.json.partial"), b"{").unwrap();
        assert!(RunDir::create(&base).is_ok());
        assert_eq!(names(&base), [""; 0]);
        std::fs::remove_dir_all(&base).unwrap();
    }

    #[test]
    fn writing_replaces_whole_files_and_leaves_no_parts() {
        let base = base("writing");
        let dir = RunDir::create(&base).unwrap();
        dir.write("a.json", b"first").unwrap();
        dir.write("a.json", b"second").unwrap();
        assert_eq!(std::fs::read(dir.file("a.json")).unwrap(), b"second");
        std::fs::create_dir_all(dir.file("folder/inside")).unwrap();
        assert!(dir.write("folder", b"x").is_err(), "a folder is not replaced by a file");
        assert_eq!(names(&base), ["a.json", "folder"]);
        std::fs::remove_dir_all(&base).unwrap();
    }
}
