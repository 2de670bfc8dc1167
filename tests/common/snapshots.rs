//! Where the expected outputs are: `tests/snapshots`, by name, whichever module they are
//! compared in.

use std::path::Path;

/// Returns settings for snapshots in this folder below `tests/snapshots`; an empty name is
/// the folder itself.
pub fn settings(folder: &str) -> insta::Settings {
    let all = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots");
    let mut settings = insta::Settings::clone_current();
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.set_snapshot_path(all.join(folder));
    settings
}

/// Compares a text with the snapshot of this name in `tests/snapshots/cli`.
pub fn assert_session(name: &str, text: &str) {
    settings("cli").bind(|| insta::assert_snapshot!(name, text));
}
