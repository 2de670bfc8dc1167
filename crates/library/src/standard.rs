//! The built-ins that every program sees: those of the language, and those of the scene.

use pcadlang_engine::lang::builtins::Table;
use std::sync::{Arc, LazyLock};

static TABLE: LazyLock<Arc<Table>> = LazyLock::new(|| {
    let language = pcadlang_inference::table();
    Arc::new(crate::scene::host().added_to(&language))
});

/// The table of all built-ins, without those of hosts.
pub fn table() -> Arc<Table> {
    Arc::clone(&TABLE)
}
