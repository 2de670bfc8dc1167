//! Joining parts of a bank that were drawn apart, for example on several machines.

use super::write::BankWriter;
use super::{Bank, BankError, Entry};
use std::path::{Path, PathBuf};

/// The number of entries that are read before they are written.
const BLOCK: usize = 256;

/// Writes the entries of several banks, in this order, as one bank. Parts that were drawn with
/// the same seed and one after the other ([`Learn::first`](super::Learn::first)) give the bank
/// that is drawn at once, bit for bit.
///
/// # Errors
/// If there is none, they differ in program, seed or features, or a file cannot be read or
/// written.
pub fn join(parts: &[PathBuf], path: &Path) -> Result<(), BankError> {
    let told = |part: &Path, e: BankError| BankError::Parts(format!("{}: {e}", part.display()));
    let banks = parts.iter().map(|p| Bank::open(p).map_err(|e| told(p, e)));
    let banks = banks.collect::<Result<Vec<_>, _>>()?;
    let Some(first) = banks.first() else {
        return Err(BankError::Parts("no banks to join".into()));
    };
    let of = |b: &Bank| (b.header().program.clone(), b.header().seed, b.header().features.clone());
    for (bank, part) in banks.iter().zip(parts) {
        if of(bank) != of(first) {
            let message = "another program, seed or features than the first part";
            return Err(BankError::Parts(format!("{}: {message}", part.display())));
        }
    }
    let count = banks.iter().map(|b| b.len() as u64).sum();
    let width = first.features(0)?.len();
    let mut writer = BankWriter::create(path, count, width)?;
    for (bank, part) in banks.iter().zip(parts) {
        for from in (0..bank.len()).step_by(BLOCK) {
            let entry = |i| Ok(Entry { latents: bank.latents(i)?, features: bank.features(i)? });
            let entries: Result<Vec<Entry>, BankError> =
                (from..(from + BLOCK).min(bank.len())).map(entry).collect();
            writer.add(&entries.map_err(|e| told(part, e))?)?;
        }
    }
    let (program, seed, features) = of(first);
    writer.finish(&first.header().name, &program, seed, features)
}

#[cfg(test)]
mod tests {
    use super::super::{Features, Learn, learn};
    use super::*;
    use pcadlang_library::Model;
    use std::sync::atomic::AtomicU64;

    #[test]
    fn parts_give_the_bank_that_is_drawn_at_once() {
        let model = Model::from_text(
            "include \"std/scene.pcad\" as scene;
             assume size ~ uniform(0.5, 1.5);
             assume ball = scene.affine(scale = size) * scene.sphere(1);",
        )
        .unwrap();
        let dir = std::env::temp_dir().join(format!("pcadlang-join-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        let drawn = |first, count, seed, name: &str| {
            let features = Features::Contours { size: 32 };
            let how = Learn { name: "ball", first, count, seed, threads: 1, features };
            let path = dir.join(name);
            learn(&model, &how, &path, &AtomicU64::new(0)).unwrap();
            path
        };
        let whole = drawn(0, 7, 1, "whole");
        let parts = [drawn(0, 3, 1, "a"), drawn(3, 4, 1, "b")];
        let joined = dir.join("joined");
        join(&parts, &joined).unwrap();
        assert_eq!(std::fs::read(&joined).unwrap(), std::fs::read(&whole).unwrap());
        let other = [parts[0].clone(), drawn(3, 4, 2, "c")];
        assert!(
            join(&other, &joined).unwrap_err().to_string().contains("c: another program, seed")
        );
        assert!(join(&[], &joined).is_err() && join(&[dir.join("none")], &joined).is_err());
        std::fs::remove_dir_all(&dir).unwrap();
    }
}
