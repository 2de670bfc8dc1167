//! A temporary folder for each test, and the command run in it.

use assert_cmd::Command;
use image::{DynamicImage, GrayImage, ImageFormat};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// A folder that is empty at first and is removed at the end, unless the test fails.
pub struct Folder(PathBuf);

/// The exit code and output of a command.
pub struct Done {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl Folder {
    /// Makes a folder with this name and a number, so that no two tests share one.
    pub fn new(name: &str) -> Folder {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let (process, number) = (std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
        let path =
            Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{process}-{number}"));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    pub fn path(&self) -> &Path {
        &self.0
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> &Self {
        std::fs::write(self.0.join(name), bytes).unwrap();
        self
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.0.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn exists(&self, name: &str) -> bool {
        self.0.join(name).exists()
    }

    /// Returns every file and folder inside, sorted; folders have a trailing slash.
    pub fn files(&self) -> Vec<String> {
        fn walk(dir: &Path, prefix: &str, into: &mut Vec<String>) {
            for e in std::fs::read_dir(dir).unwrap() {
                let e = e.unwrap();
                let name = format!("{prefix}{}", e.file_name().to_string_lossy());
                if e.path().is_dir() {
                    into.push(format!("{name}/"));
                    walk(&e.path(), &format!("{name}/"), into);
                } else {
                    into.push(name);
                }
            }
        }
        let mut all = Vec::new();
        walk(&self.0, "", &mut all);
        all.sort();
        all
    }

    /// Runs the command in this folder, with a limit of two minutes.
    pub fn run(&self, args: &[&str]) -> Done {
        self.run_given("", args)
    }

    /// [`Folder::run`] with a text on its standard input.
    fn run_given(&self, stdin: &str, args: &[&str]) -> Done {
        let mut c = Command::cargo_bin("pcadlang").unwrap();
        c.current_dir(&self.0)
            .env("NO_COLOR", "1")
            .env_remove("RUST_BACKTRACE")
            .env_remove("COLUMNS")
            .write_stdin(stdin)
            .timeout(Duration::from_secs(120));
        let o = c.args(args).output().unwrap();
        let text = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
        let (out, err) = (text(&o.stdout), text(&o.stderr));
        let code =
            o.status.code().unwrap_or_else(|| panic!("{args:?} was killed: {:?}\n{err}", o.status));
        assert!(!err.contains("panicked") && !out.contains("panicked"), "{args:?} panics:\n{err}");
        Done { code, out, err }
    }

    /// Returns everything that a command shows: its exit code, output and messages.
    pub fn session(&self, args: &[&str]) -> String {
        let d = self.run(args);
        let mut s = format!("$ pcadlang {}\nexit {}\n", args.join(" "), d.code);
        for (name, text) in [("stdout", d.out), ("stderr", d.err)] {
            if !text.is_empty() {
                s.push_str(&format!("--- {name}\n{}", text.trim_end()));
                s.push('\n');
            }
        }
        s
    }

    /// Runs a command that must fail with a program or data error: exit code 1, a first
    /// line that contains `says`, and no change to the files in the folder.
    pub fn refuses(&self, args: &[&str], says: &str) {
        let before = self.files();
        let d = self.run(args);
        assert_eq!(d.code, 1, "{args:?}: {}{}", d.out, d.err);
        let first = d.err.lines().find(|l| !l.starts_with("note:")).unwrap_or_default();
        assert!(first.starts_with("error"), "{args:?}: the first line is no error: {}", d.err);
        assert!(first.contains(says), "{args:?}: {says:?} is not in the first line of\n{}", d.err);
        assert!(
            first.chars().count() < 400,
            "{args:?}: the first line is {} letters long",
            first.chars().count()
        );
        assert_eq!(self.files(), before, "{args:?} leaves something");
    }

    /// Runs a command that must succeed.
    pub fn succeeds(&self, args: &[&str]) -> Done {
        self.given("", args)
    }

    /// Runs a command that must succeed, with a text on its standard input.
    pub fn given(&self, stdin: &str, args: &[&str]) -> Done {
        let d = self.run_given(stdin, args);
        assert_eq!(d.code, 0, "{args:?}: {}{}", d.out, d.err);
        d
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }
}

/// Returns a picture as a PNG file.
pub fn png(image: impl Into<DynamicImage>) -> Vec<u8> {
    let mut bytes = Vec::new();
    image.into().write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).unwrap();
    bytes
}

/// Draws a dark disc on a bright background, with an antialiased edge.
pub fn disc(width: u32, height: u32, x: f64, y: f64, r: f64) -> GrayImage {
    GrayImage::from_fn(width, height, |i, j| {
        let d = (f64::from(i) + 0.5 - x).hypot(f64::from(j) + 0.5 - y);
        let inside = (r - d + 0.5).clamp(0.0, 1.0);
        image::Luma([(230.0 - 190.0 * inside).round() as u8])
    })
}
