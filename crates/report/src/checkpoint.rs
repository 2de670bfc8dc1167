//! The file format of checkpoints: the state from which a chain resumes, and data to
//! verify that the file is complete and belongs to this run.
//!
//! It begins with a line of text that identifies the format and its version, followed by
//! a hash of the rest. The rest (CBOR) holds the version of pcadlang, the identity of the
//! run, the length of its file of draws, and the chain. A checkpoint can only be resumed
//! by the version that wrote it, because another version may draw different numbers.

use pcadlang_inference::{Checkpoint, StateError, pack, unpack};
use pcadlang_numerics::num::fnv1a;
use serde::{Deserialize, Serialize};

const HEAD: &[u8] = b"pcadlang checkpoint 1\n";
const VERSION: &str = env!("CARGO_PKG_VERSION");
/// The length of a hash in characters.
const HASH: usize = 16;

/// The reasons why a checkpoint cannot be resumed.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// It does not begin with the identifying line.
    #[error("this is not a chain checkpoint, or has another format")]
    Format,
    /// Its contents have changed since it was written.
    #[error("the checkpoint is damaged")]
    Damaged,
    /// It was written by another version.
    #[error(
        "the checkpoint was written by pcadlang {0}; chains may differ under this version, {VERSION}"
    )]
    Version(String),
    /// It belongs to another program, data or settings.
    #[error("the checkpoint belongs to another run: the program, its data or its settings differ")]
    Run,
    /// Its contents are inconsistent.
    #[error("the checkpoint cannot be read: {0}")]
    State(#[from] StateError),
}

/// The contents of a checkpoint file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedChain {
    version: String,
    run: String,
    /// The length of the file of draws up to this checkpoint, in bytes.
    pub draws_end: u64,
    chain: Vec<u8>,
}

impl SavedChain {
    /// Creates a checkpoint of a run, preceded by `draws_end` bytes of draws.
    pub fn new(run: &str, draws_end: u64, checkpoint: &Checkpoint) -> SavedChain {
        SavedChain {
            version: VERSION.into(),
            run: run.into(),
            draws_end,
            chain: checkpoint.to_bytes(),
        }
    }

    /// Returns the contents of the file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let body = pack(self);
        [HEAD, bytes_hash(&body).as_bytes(), &body].concat()
    }

    /// Reads the file of a checkpoint of a run.
    ///
    /// # Errors
    /// Returns an error if it is not a checkpoint, is damaged, or is from another version
    /// or run.
    pub fn read(bytes: &[u8], run: &str) -> Result<(SavedChain, Checkpoint), CheckpointError> {
        let rest = bytes.strip_prefix(HEAD).ok_or(CheckpointError::Format)?;
        let (hash, body) = rest.split_at_checked(HASH).ok_or(CheckpointError::Damaged)?;
        if bytes_hash(body).as_bytes() != hash {
            return Err(CheckpointError::Damaged);
        }
        let saved: SavedChain = unpack(body)?;
        if saved.version != VERSION {
            return Err(CheckpointError::Version(saved.version));
        }
        if saved.run != run {
            return Err(CheckpointError::Run);
        }
        let checkpoint = Checkpoint::from_bytes(&saved.chain)?;
        Ok((saved, checkpoint))
    }
}

/// Returns the 64-bit FNV-1a hash of a text as 16 hexadecimal digits. It distinguishes
/// programs, but is not cryptographic.
pub fn text_hash(text: &str) -> String {
    bytes_hash(text.as_bytes())
}

/// Does the same as [`text_hash`] for arbitrary bytes.
pub fn bytes_hash(bytes: &[u8]) -> String {
    format!("{:016x}", fnv1a(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_told() {
        let saved = SavedChain {
            version: VERSION.into(),
            run: "a".into(),
            draws_end: 7,
            chain: vec![0xff],
        };
        let whole = saved.to_bytes();
        let error = |bytes: &[u8], run: &str| SavedChain::read(bytes, run).unwrap_err();
        assert!(matches!(error(b"lp__,x\n", "a"), CheckpointError::Format));
        assert!(matches!(error(&[], "a"), CheckpointError::Format));
        for cut in HEAD.len()..whole.len() {
            assert!(matches!(error(&whole[..cut], "a"), CheckpointError::Damaged), "{cut}");
        }
        for i in HEAD.len()..whole.len() {
            let mut changed = whole.clone();
            changed[i] ^= 1;
            assert!(matches!(error(&changed, "a"), CheckpointError::Damaged), "{i}");
        }
        assert!(matches!(error(&whole, "b"), CheckpointError::Run));
        assert!(matches!(error(&whole, "a"), CheckpointError::State(_)));
        let other = SavedChain { version: "0.0.1".into(), ..saved }.to_bytes();
        assert_eq!(
            error(&other, "a").to_string(),
            format!(
                "the checkpoint was written by pcadlang 0.0.1; chains may differ under this version, {VERSION}"
            )
        );
    }

    #[test]
    fn sixteen_digits() {
        assert_eq!(text_hash("foobar"), "85944171f73967e8");
        assert!((0..200u8).all(|b| bytes_hash(&[b]).len() == 16));
    }
}
