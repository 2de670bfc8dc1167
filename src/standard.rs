//! The built-ins that every program sees: those of the language, and those of the scene.

use crate::lang::builtins::Table;
use std::sync::{Arc, LazyLock};

static TABLE: LazyLock<Arc<Table>> = LazyLock::new(|| {
    let language = Table::default();
    #[cfg(feature = "scene")]
    let table = crate::scene::host().table(&language).unwrap_or_else(|_| Arc::new(language));
    #[cfg(not(feature = "scene"))]
    let table = Arc::new(language);
    table
});

/// The table of all built-ins, without those of hosts.
pub fn table() -> Arc<Table> {
    Arc::clone(&TABLE)
}
