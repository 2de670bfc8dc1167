//! Programs that call what a host brings.

use super::{Error, Program};
use crate::host::Host;
use crate::lang::builtins::doc;
use crate::standard;

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

impl Host {
    /// What `pcadlang doc` says of a name: the host's own, or the language's. `None` also
    /// where an entry is not valid.
    pub fn doc(&self, name: &str) -> Option<String> {
        doc::doc(&*self.table(&standard::table()).ok()?, name)
    }
}
