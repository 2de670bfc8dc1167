//! The built-ins that every program sees: those of the language, those of the scene, and those
//! of the crates apart that a command was built with.

use pcadlang_engine::lang::builtins::Table;
use pcadlang_inference::host::Host;
use pcadlang_syntax::diag::Error;
use std::sync::{Arc, LazyLock, PoisonError, RwLock};

static TABLE: LazyLock<RwLock<Arc<Table>>> = LazyLock::new(|| {
    let language = pcadlang_inference::table();
    RwLock::new(Arc::new(crate::scene::host().added_to(&language)))
});

/// The table of all built-ins, without those of a program's own host.
pub fn table() -> Arc<Table> {
    Arc::clone(&TABLE.read().unwrap_or_else(PoisonError::into_inner))
}

/// Adds a host's built-ins to those of every program that is opened from now on.
///
/// # Errors
/// As [`Program::host`](crate::Program::host).
pub fn register(host: &Host) -> Result<(), Error> {
    let mut table = TABLE.write().unwrap_or_else(PoisonError::into_inner);
    *table = host.table(&table)?;
    Ok(())
}
