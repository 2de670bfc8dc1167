//! Features from a user's own detector: a command that reads a picture and prints
//! numbers.

use super::BankError;
use image::RgbImage;
use pcadlang_report::pictures::png;
use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering};

/// The placeholder for the picture's file.
const PICTURE: &str = "{png}";
/// Numbers the temporary files of this process, so that their names are unique.
static NEXT: AtomicU64 = AtomicU64::new(0);

/// A file that is removed on drop.
struct Temporary(PathBuf);

impl Drop for Temporary {
    fn drop(&mut self) {
        // A failure to remove it is ignored: it lies in the system's temporary folder.
        let _ = std::fs::remove_file(&self.0);
    }
}

/// Runs a command on a picture and reads the numbers that it prints, separated by white
/// space or commas. The words of the command are its program and arguments; no shell is
/// involved. In each word, `{png}` is replaced by the path of the picture's file.
///
/// # Errors
/// If the command cannot be run, fails, or prints anything but finite numbers.
pub(super) fn features(command: &str, picture: &RgbImage) -> Result<Vec<f32>, BankError> {
    let wrong = |what: String| BankError::Command(format!("`{command}`: {what}"));
    if !command.contains(PICTURE) {
        return Err(wrong(format!(
            "the command must contain `{PICTURE}` where the picture's file goes"
        )));
    }
    if cfg!(target_family = "wasm") {
        return Err(wrong("commands cannot be run on this platform".into()));
    }
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let file = Temporary(
        std::env::temp_dir().join(format!("pcadlang-{}-{number}.png", std::process::id())),
    );
    let bytes = png(picture).map_err(|e| wrong(e.to_string()))?;
    std::fs::write(&file.0, bytes)
        .map_err(|e| wrong(format!("cannot write {}: {e}", file.0.display())))?;
    let path = file.0.to_string_lossy();
    let mut words = command.split_whitespace().map(|w| w.replace(PICTURE, &path));
    let program = words.next().unwrap_or_default();
    let done = Command::new(&program)
        .args(words)
        .output()
        .map_err(|e| wrong(format!("cannot run {program}: {e}")))?;
    if !done.status.success() {
        let said = String::from_utf8_lossy(&done.stderr);
        let last = said.lines().last().unwrap_or_default();
        return Err(wrong(format!("it failed ({}) {last}", done.status)));
    }
    let text = String::from_utf8_lossy(&done.stdout);
    let words = text.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty());
    let number = |w: &str| {
        let x = w.parse::<f32>().ok().filter(|x| x.is_finite());
        x.ok_or_else(|| wrong(format!("it must print finite numbers, got {w:?}")))
    };
    let numbers = words.map(number).collect::<Result<Vec<f32>, _>>()?;
    if numbers.is_empty() { Err(wrong("it printed no numbers".into())) } else { Ok(numbers) }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_and_anything_else_is_an_error() {
        let picture = RgbImage::new(3, 2);
        let said = |c: &str| features(c, &picture).map_err(|e| e.to_string());
        // The bytes of a picture are not numbers.
        assert!(said("cat {png}").unwrap_err().contains("must print finite numbers"));
        assert!(said("false {png}").unwrap_err().contains("it failed"));
        assert!(said("true {png}").unwrap_err().contains("no numbers"));
        assert!(said("true").unwrap_err().contains("{png}"));
        assert!(said("no-such-program {png}").unwrap_err().contains("cannot run no-such-program"));
        let length = said("expr length {png}").unwrap();
        assert!(length.len() == 1 && length[0] > 10.0, "{length:?}");
    }
}
