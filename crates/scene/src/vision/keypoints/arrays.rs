//! Arrays of joints in numpy's files, as RTMLib's users save them: `.npy`, or `.npz` with the
//! confidences beside the positions.

use super::KeypointsError;
use crate::vision::npy::{self, NpyArray};
use serde_json::{Map, Value};
use std::io::{Cursor, Read as _};
use zip::ZipArchive;

/// The maximum number of numbers of an array.
const MOST: usize = 1_000_000;

/// The maximum size of a file in an archive, its header included.
const MOST_BYTES: u64 = 8 * MOST as u64 + (1 << 16);

/// Names of positions and confidences, and those of arrays that were saved without names.
const NAMES: [(&str, [&str; 2]); 2] =
    [("keypoints", ["keypoints", "arr_0"]), ("scores", ["scores", "arr_1"])];

/// Reads the bytes of a `.npy` or `.npz` file as the lists that JSON would have.
pub(super) fn read(bytes: &[u8]) -> Result<Value, KeypointsError> {
    if npy::is_npy(bytes) {
        return array(bytes);
    }
    let invalid = |e: &dyn std::fmt::Display| KeypointsError::new(format!("not a .npz file: {e}"));
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|e| invalid(&e))?;
    let mut found = Map::new();
    for (field, names) in NAMES {
        let Some(name) =
            names.iter().map(|n| format!("{n}.npy")).find(|n| archive.index_for_name(n).is_some())
        else {
            continue;
        };
        let file = archive.by_name(&name).map_err(|e| invalid(&e))?;
        let mut inside = Vec::new();
        file.take(MOST_BYTES + 1).read_to_end(&mut inside).map_err(|e| invalid(&e))?;
        if inside.len() as u64 > MOST_BYTES {
            return Err(too_large());
        }
        found.insert(field.to_owned(), array(&inside)?);
    }
    if !found.contains_key("keypoints") {
        let names = archive.file_names().filter_map(Result::ok);
        let has: Vec<String> = names.take(8).map(|name| format!("`{name}`")).collect();
        let message = format!("the archive has no array `keypoints`, but {}", has.join(", "));
        return Err(KeypointsError::new(message)
            .hint("numpy.savez(file, keypoints = …, scores = …) writes one"));
    }
    Ok(Value::Object(found))
}

fn too_large() -> KeypointsError {
    KeypointsError::new(format!("an array has more than {MOST} numbers"))
}

/// Reads an array as nested lists; numbers that are not finite are null.
fn array(bytes: &[u8]) -> Result<Value, KeypointsError> {
    let read = npy::parse(bytes).map_err(|e| KeypointsError::new(e.to_string()))?;
    let NpyArray { shape, data } = read;
    let count: usize = shape.iter().fold(1, |n, k| n.saturating_mul(*k));
    if count > MOST || shape.len() > 8 || shape.contains(&0) && shape.iter().any(|k| *k > MOST) {
        return Err(too_large());
    }
    let numbers = NpyArray { shape: shape.clone(), data }.into_f64();
    let mut values: Vec<Value> = numbers.into_iter().map(Value::from).collect();
    for side in shape.iter().skip(1).rev() {
        if *side == 0 {
            return Ok(Value::Array(Vec::new()));
        }
        values = values.chunks(*side).map(|c| Value::Array(c.to_vec())).collect();
    }
    Ok(Value::Array(values))
}
