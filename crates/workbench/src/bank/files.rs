//! The bank files of a run, each opened and searched once.

use super::{Bank, BankError, Observed};
use pcadlang_engine::lang::load::reason;
use pcadlang_engine::lang::reach::{Outside, Reach};
use pcadlang_inference::{Banks, Neighbours};
use pcadlang_library::Model;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

type Found = Result<Arc<Neighbours>, String>;

/// Provides a run's kernels with neighbours from bank files. A path is resolved as given,
/// then relative to the program's folder, in both cases only where the program may read.
#[derive(Debug)]
pub struct BankFiles {
    program: String,
    reach: Reach,
    folder: PathBuf,
    observed: Observed,
    detector: Option<String>,
    found: Mutex<BTreeMap<(String, usize), Found>>,
}

impl BankFiles {
    /// Creates the banks for runs of a program with its data. `folder` is the program's
    /// folder. `detector` is the command that may be run for banks whose features come
    /// from a command; commands that the user has not named are never run.
    pub fn new(model: &Model, folder: &Path, detector: Option<String>) -> BankFiles {
        BankFiles {
            program: model.hash().to_owned(),
            reach: model.reach().clone(),
            folder: folder.to_owned(),
            observed: Observed::of(model),
            detector,
            found: Mutex::default(),
        }
    }

    fn search(&self, path: &str, k: usize) -> Result<Neighbours, BankError> {
        let as_given = self.reach.resolve(Path::new(path));
        let bank = Bank::open(&as_given.or_else(|_| self.reach.resolve(&self.folder.join(path)))?)?;
        bank.check(&self.program)?;
        bank.neighbours(&self.observed.query(&bank.header().features, self.detector.as_deref())?, k)
    }
}

impl Banks for BankFiles {
    fn neighbours(&self, bank: &str, k: usize) -> Found {
        let mut found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        let search = || match self.search(bank, k) {
            Ok(n) => Ok(Arc::new(n)),
            Err(BankError::Io(e)) => {
                let hint = Outside::hint(&e).map_or(String::new(), |h| format!("; {h}"));
                Err(format!("cannot read the bank {bank}: {}{hint}", reason(&e)))
            }
            Err(e) => Err(format!("cannot use the bank {bank}: {e}")),
        };
        found.entry((bank.to_owned(), k)).or_insert_with(search).clone()
    }
}
