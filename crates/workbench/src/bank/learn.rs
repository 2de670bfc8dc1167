//! Making a bank: scenes from the prior, drawn on several threads. Each scene depends
//! only on the seed and its index.

use super::write::BankWriter;
use super::{BankError, Entry, Features, Named};
use crate::session::{as_view, picture_operand};
use pcadlang_engine::lang::code::Operand;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Draws, Trace};
pub use pcadlang_inference::{attempts, in_parallel};
use pcadlang_library::Model;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_scene::render::View;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The number of entries that are drawn before they are written.
const BLOCK: u64 = 256;
/// The number of draws per entry that may fail because a value is undefined; after that,
/// the failure is an error.
const RETRIES: u64 = 100;

/// The options for making a bank.
#[derive(Clone, Debug)]
pub struct Learn<'a> {
    /// The program's name, for the error messages of later runs.
    pub name: &'a str,
    /// The number of the first entry; above 0 for a part of a bank that [`join`](super::join)
    /// completes.
    pub first: u64,
    /// The number of entries.
    pub count: u64,
    /// The seed, which determines the bank.
    pub seed: u64,
    /// The number of threads.
    pub threads: usize,
    /// The features to compute.
    pub features: Features,
}

/// Draws scenes from the prior and writes their latents and features to a file; `done`
/// counts the drawn scenes. The program's data may be missing, because observations are
/// not evaluated.
///
/// # Errors
/// If the program fails or has no picture, a detector fails, or the file cannot be
/// written.
pub fn learn(model: &Model, how: &Learn, path: &Path, done: &AtomicU64) -> Result<(), BankError> {
    let prior = Trace::prior(Arc::clone(model.code()), model.limits().clone());
    let operand = picture_operand(&mut prior.clone(), draws(how.seed, 0, 0)).ok_or_else(|| {
        BankError::Observed(
            "the program has nothing to draw: no top-level name is a view or a solid".into(),
        )
    })?;
    let (_, first) = one(&prior, operand, how, 0)?;
    let features = how.features.clone().named(&first);
    let mut writer = BankWriter::create(path, how.count, how.features.of(&first)?.len())?;
    let (mut from, end) = (how.first, how.first + how.count);
    while from < end {
        let to = (from + BLOCK).min(end);
        let draw = |i: u64| {
            let scene = one(&prior, operand, how, i);
            done.fetch_add(1, Ordering::Relaxed);
            scene
        };
        let scenes: Result<Vec<_>, BankError> =
            in_parallel(how.threads, (from..to).collect(), draw).into_iter().collect();
        let (latents, views): (Vec<_>, Vec<_>) = scenes?.into_iter().unzip();
        let found = in_parallel(how.threads, views, |view| how.features.of(&view));
        let entries: Result<Vec<Entry>, BankError> = latents
            .into_iter()
            .zip(found)
            .map(|(latents, features)| Ok(Entry { latents, features: features? }))
            .collect();
        writer.add(&entries?)?;
        from = to;
    }
    writer.finish(how.name, model.hash(), how.seed, features)
}

fn draws(seed: u64, i: u64, attempt: u64) -> Draws {
    Draws { key: StreamKey::new(seed, u32::MAX, Purpose::START), step: i, substream: attempt }
}

/// Draws the latents and the scene of entry `i`.
fn one(
    prior: &Trace,
    operand: Operand,
    how: &Learn,
    i: u64,
) -> Result<(Vec<Named>, Arc<View>), BankError> {
    let (latents, value) = attempts(RETRIES, |attempt| {
        prior.clone().imagine(&[operand], draws(how.seed, i, attempt), drawn)
    })
    .map_err(BankError::Run)?;
    let view = value.as_ref().and_then(|v| as_view(v, None)).ok_or_else(|| {
        BankError::Observed(format!(
            "entry {i}: the picture is neither a view nor a solid in this scene"
        ))
    })?;
    Ok((latents, view))
}

/// Returns the choices of a trace with their address hashes, and the value of the query.
fn drawn(trace: &Trace, mut values: Vec<Value>) -> (Vec<Named>, Option<Value>) {
    let named = |t: &pcadlang_engine::trace::Target| {
        let free = trace.free(*t).map(|(y, _)| y).filter(|y| !y.is_empty());
        let (hash, address) = (trace.address_hash(*t), trace.address(*t).to_string());
        Some(Named { hash, address, stored: trace.stored(*t)?, free })
    };
    (trace.all_targets().iter().filter_map(named).collect(), values.pop())
}
