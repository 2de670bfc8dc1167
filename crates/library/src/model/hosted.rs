//! Programs that call what a host brings.

use super::{Error, Program};
use crate::standard;
use pcadlang_inference::host::Host;

impl Program {
    /// Lets the program call what a host brings.
    ///
    /// # Errors
    /// If the host brings a name of the language without saying that it replaces it, or
    /// something is wrong with what it brings.
    pub fn host(mut self, host: &Host) -> Result<Program, Error> {
        self.builtins = host.table(&standard::table())?;
        Ok(self)
    }
}
