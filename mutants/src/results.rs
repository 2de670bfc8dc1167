//! The results of the mutants, one line of JSON each.

use crate::Failure;
use crate::find::Mutant;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Line {
    pub mutant: String,
    pub line: usize,
    /// The test that failed, or `time` if it did not end in time; `None` for a survivor.
    pub caught_by: Option<String>,
}

pub struct Results {
    path: PathBuf,
    lines: Mutex<BTreeMap<String, Line>>,
}

impl Results {
    pub fn open(path: &Path) -> Result<Results, Failure> {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let lines = text.lines().filter_map(|l| serde_json::from_str::<Line>(l).ok());
        let lines = lines.map(|l| (l.mutant.clone(), l)).collect();
        Ok(Results { path: path.to_path_buf(), lines: Mutex::new(lines) })
    }

    pub fn knows(&self, m: &Mutant) -> bool {
        self.lines.lock().is_ok_and(|l| l.contains_key(&m.key))
    }

    pub fn put(&self, m: &Mutant, caught_by: Option<String>) -> Result<(), Failure> {
        let line = Line { mutant: m.key.clone(), line: m.line, caught_by };
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(&self.path)?;
        writeln!(file, "{}", serde_json::to_string(&line)?)?;
        if let Ok(mut lines) = self.lines.lock() {
            lines.insert(m.key.clone(), line);
        }
        Ok(())
    }

    /// Prints how many of these mutants were caught, and which were not.
    pub fn report(&self, mutants: &[Mutant]) {
        let Ok(lines) = self.lines.lock() else { return };
        let known: Vec<&Line> = mutants.iter().filter_map(|m| lines.get(&m.key)).collect();
        let survivors: Vec<_> = known.iter().filter(|l| l.caught_by.is_none()).collect();
        for l in &survivors {
            println!("not caught, line {}: {}", l.line, l.mutant);
        }
        let caught = known.len() - survivors.len();
        println!("{caught} of {} caught, {} not run yet", known.len(), mutants.len() - known.len());
    }
}
