//! Saved traces: versioned JSON that is exact to the last bit when loaded.

use super::{Constraint, Draws, Limits, Trace, TraceResult};
use crate::lang::code::Code;
use pcadlang_numerics::dist::Datum;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The version this code writes, and the only one it reads.
const VERSION: u32 = 1;

/// A trace as it is written to a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedTrace {
    /// The version of the format.
    pub version: u32,
    /// A hash of the program.
    pub program: String,
    /// The log joint density, for human readers.
    pub log_joint: Number,
    /// The choices in stored form, by address.
    pub choices: Vec<SavedChoice>,
}

/// One choice of a [`SavedTrace`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedChoice {
    /// Its address, for human readers.
    pub address: String,
    /// The hash of its address, in hexadecimal.
    pub hash: String,
    /// Its stored value.
    pub value: SavedDatum,
}

/// A number that may be infinite or NaN, which JSON does not support.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Number {
    /// A finite number.
    Finite(f64),
    /// "inf", "-inf", "nan".
    Other(#[serde(with = "text")] f64),
}

impl Number {
    fn new(x: f64) -> Self {
        if x.is_finite() { Number::Finite(x) } else { Number::Other(x) }
    }

    fn get(self) -> f64 {
        match self {
            Number::Finite(x) | Number::Other(x) => x,
        }
    }
}

mod text {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub fn serialize<S: Serializer>(x: &f64, s: S) -> Result<S::Ok, S::Error> {
        s.serialize_str(if *x == f64::INFINITY {
            "inf"
        } else if *x == f64::NEG_INFINITY {
            "-inf"
        } else {
            "nan"
        })
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
        match String::deserialize(d)?.as_str() {
            "inf" => Ok(f64::INFINITY),
            "-inf" => Ok(f64::NEG_INFINITY),
            "nan" => Ok(f64::NAN),
            other => Err(D::Error::custom(format!("{other:?} is not a number"))),
        }
    }
}

/// The value of a choice in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum SavedDatum {
    /// A boolean.
    Bool(bool),
    /// A number.
    Num(Number),
    /// An array.
    Array(Vec<SavedDatum>),
}

impl SavedDatum {
    fn new(d: &Datum) -> Self {
        match d {
            Datum::Num(x) => SavedDatum::Num(Number::new(*x)),
            Datum::Bool(b) => SavedDatum::Bool(*b),
            Datum::Vec(xs) => {
                SavedDatum::Array(xs.iter().map(|x| SavedDatum::Num(Number::new(*x))).collect())
            }
            Datum::List(xs) => SavedDatum::Array(xs.iter().map(SavedDatum::new).collect()),
        }
    }

    fn datum(&self) -> Datum {
        match self {
            SavedDatum::Bool(b) => Datum::Bool(*b),
            SavedDatum::Num(x) => Datum::Num(x.get()),
            SavedDatum::Array(xs) => {
                let numbers: Option<Vec<f64>> = xs
                    .iter()
                    .map(|x| if let SavedDatum::Num(x) = x { Some(x.get()) } else { None })
                    .collect();
                match numbers {
                    Some(v) => Datum::Vec(v.into()),
                    None => Datum::List(xs.iter().map(SavedDatum::datum).collect()),
                }
            }
        }
    }
}

/// Why a saved trace cannot be loaded.
#[derive(Debug, thiserror::Error)]
pub enum SaveError {
    /// The file is not a saved trace.
    #[error("not a saved trace: {0}")]
    Format(#[from] serde_json::Error),
    /// It was written by another version.
    #[error("the trace has version {found} of the format; this program reads version {VERSION}")]
    Version {
        /// The version found.
        found: u32,
    },
    /// It belongs to another program.
    #[error("the trace belongs to another program, or to another version of this one")]
    Program,
    /// A choice of the file does not occur in the program.
    #[error("the trace has a choice {0} that the program does not make")]
    Unknown(String),
    /// The program fails with these choices.
    #[error("{0}")]
    Run(Box<crate::lang::error::RunError>),
}

impl Trace {
    /// Returns the trace in the form written to a file; `program` identifies the program.
    pub fn save(&self, program: &str) -> SavedTrace {
        let mut choices: Vec<_> = self
            .all_targets()
            .iter()
            .filter_map(|t| {
                let value = SavedDatum::new(&self.stored(*t)?);
                Some((self.address(*t), format!("{:016x}", self.address_hash(*t)), value))
            })
            .collect();
        choices.sort_by(|a, b| a.0.cmp(&b.0));
        SavedTrace {
            version: VERSION,
            program: program.to_owned(),
            log_joint: Number::new(self.log_joint()),
            choices: choices
                .into_iter()
                .map(|(a, hash, value)| SavedChoice { address: a.to_string(), hash, value })
                .collect(),
        }
    }

    /// Runs a program with the choices of a saved trace.
    ///
    /// # Errors
    /// If the trace has another version or belongs to another program, or has choices
    /// that this program does not make.
    pub fn load(
        code: Arc<Code>,
        program: &str,
        saved: &SavedTrace,
        limits: Limits,
    ) -> Result<Self, SaveError> {
        if saved.version != VERSION {
            return Err(SaveError::Version { found: saved.version });
        }
        if saved.program != program {
            return Err(SaveError::Program);
        }
        let mut constraints = Vec::with_capacity(saved.choices.len());
        for c in &saved.choices {
            let hash = u64::from_str_radix(&c.hash, 16)
                .map_err(|_| SaveError::Unknown(c.address.clone()))?;
            constraints.push((hash, Constraint::Stored(c.value.datum())));
        }
        let trace: TraceResult<_> = Trace::generate(code, constraints, Draws::default(), limits);
        let (trace, _) = trace.map_err(SaveError::Run)?;
        for c in &saved.choices {
            let hash = u64::from_str_radix(&c.hash, 16).unwrap_or_default();
            let known = trace.all_targets().iter().any(|t| trace.address_hash(*t) == hash);
            if !known {
                return Err(SaveError::Unknown(c.address.clone()));
            }
        }
        Ok(trace)
    }
}
