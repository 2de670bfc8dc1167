//! `:edit`: the program in the user's own editor.

use pcadlang_runs::failure::{Failure, plain};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Returns a text after the user has edited it.
///
/// # Errors
/// If the draft cannot be written or read back, or the editor cannot be started or fails.
pub fn edited(text: &str) -> Result<String, Failure> {
    let draft = Draft::new(text)?;
    let editor = editor();
    // The editor may include arguments: `code --wait`.
    let mut words = editor.split_whitespace();
    let program = words.next().unwrap_or("vi");
    let wrong = |why: String| {
        let hint = "set VISUAL or EDITOR to one: export EDITOR=nano";
        Failure::Plain(format!("the editor `{editor}` {why}"), Some(hint.into()))
    };
    match Command::new(program).args(words).arg(&draft.0).status() {
        Ok(status) if status.success() => {}
        Ok(status) => return Err(wrong(format!("ended with {status}; nothing has changed"))),
        Err(e) => return Err(wrong(format!("cannot be started: {e}"))),
    }
    std::fs::read_to_string(&draft.0)
        .map_err(|e| plain(format!("the edited text cannot be read: {e}")))
}

/// Returns the command of the user's editor.
fn editor() -> String {
    let set = |name: &str| std::env::var(name).ok().filter(|v| !v.trim().is_empty());
    let usual = if cfg!(windows) { "notepad" } else { "vi" };
    set("VISUAL").or_else(|| set("EDITOR")).unwrap_or_else(|| usual.into())
}

/// A draft for the editor, in a folder that only the user can access (on Unix); both are
/// removed on drop.
struct Draft(PathBuf);

impl Draft {
    fn new(text: &str) -> Result<Draft, Failure> {
        let folder = std::env::temp_dir().join(format!("pcadlang-{}", std::process::id()));
        let wrong =
            |e: std::io::Error| plain(format!("cannot write below {}: {e}", folder.display()));
        folder_of_ones_own(&folder).map_err(wrong)?;
        let draft = Draft(folder.join("session.pcad"));
        std::fs::write(&draft.0, text).map_err(wrong)?;
        Ok(draft)
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        // A draft that cannot be removed stays in the folder for temporary files.
        let _ = std::fs::remove_file(&self.0);
        let _ = self.0.parent().map(std::fs::remove_dir);
    }
}

#[cfg(unix)]
fn folder_of_ones_own(path: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::DirBuilderExt;
    std::fs::DirBuilder::new().mode(0o700).create(path)
}

#[cfg(not(unix))]
fn folder_of_ones_own(path: &Path) -> std::io::Result<()> {
    std::fs::create_dir(path)
}
