//! A run in ArviZ's format: `inference.zarr`, a folder in the Zarr format (version 2),
//! which can be opened by `xarray.open_datatree(…, engine="zarr")` and, with version 2 of
//! the Zarr library, by `arviz.from_zarr`. Its groups are `posterior`, `sample_stats`,
//! `log_likelihood` and `observed_data`.
//!
//! Arrays have one chunk and no compression; numbers are 8 bytes, little-endian. What they
//! are named, and their dimensions, is in [`super::inference`].

use super::ChainDraws;
use super::inference::{Array, Group, Numbers, Point, groups};
use serde_json::{Map, Value, json};
use std::io;
use std::path::{Path, PathBuf};

/// The name of the folder inside a run's folder.
pub const ZARR: &str = "inference.zarr";

/// Writes the draws of a run's chains, which must have the same columns, with the step
/// size of each chain's Hamiltonian kernel if it has one. Chains without draws are left
/// out, and the others are cut to the length of the shortest. An older folder is replaced
/// when the new one is complete.
///
/// # Errors
/// Returns an error if it cannot be written.
pub fn write(
    dir: &Path,
    chains: &[ChainDraws],
    step_sizes: &[Option<f64>],
    points: &[Point],
) -> io::Result<()> {
    let (place, partial) = (dir.join(ZARR), dir.join(format!(".{ZARR}.partial")));
    remove(&partial)?;
    std::fs::create_dir_all(&partial)?;
    let mut store = Store { dir: partial.clone(), metadata: Map::new() };
    store.put(".zgroup", json!({ "zarr_format": 2 }))?;
    groups(chains, step_sizes, points).iter().try_for_each(|g| store.group(g))?;
    store.end()?;
    remove(&place)?;
    std::fs::rename(&partial, &place)
}

/// Removes a folder with its contents, if it exists.
fn remove(path: &Path) -> io::Result<()> {
    match std::fs::remove_dir_all(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(e),
        _ => Ok(()),
    }
}

/// A folder that is being written.
struct Store {
    dir: PathBuf,
    /// The contents of all metadata files, which readers expect in one file.
    metadata: Map<String, Value>,
}

impl Store {
    /// Writes a group with its arrays.
    fn group(&mut self, group: &Group) -> io::Result<()> {
        self.put(&format!("{}/.zgroup", group.name), json!({ "zarr_format": 2 }))?;
        let by = json!({ "inference_library": "pcadlang", "inference_library_version": env!("CARGO_PKG_VERSION") });
        self.put(&format!("{}/.zattrs", group.name), by)?;
        group.arrays.iter().try_for_each(|a| self.save(&group.name, a))
    }

    /// Writes an array into its group.
    fn save(&mut self, group: &str, array: &Array) -> io::Result<()> {
        let place = format!("{group}/{}", array.name);
        // The fill value is null; otherwise readers would take zeros for missing values.
        let (kind, bytes): (String, Vec<u8>) = match &array.numbers {
            Numbers::Floats(xs) => {
                ("<f8".into(), xs.iter().flat_map(|x| x.to_le_bytes()).collect())
            }
            Numbers::Integers(xs) => {
                ("<i8".into(), xs.iter().flat_map(|x| x.to_le_bytes()).collect())
            }
            Numbers::Truths(xs) => ("|b1".into(), xs.iter().map(|x| u8::from(*x)).collect()),
            Numbers::Texts(xs) => texts(xs),
        };
        let shape: Vec<usize> = array.dims.iter().map(|(_, n)| *n).collect();
        let chunks: Vec<usize> = shape.iter().map(|n| (*n).max(1)).collect();
        let about = json!({
            "zarr_format": 2, "shape": shape, "chunks": chunks, "dtype": kind, "fill_value": null, "order": "C",
            "compressor": null, "filters": null,
        });
        self.put(&format!("{place}/.zarray"), about)?;
        let dims: Vec<&String> = array.dims.iter().map(|(name, _)| name).collect();
        self.put(&format!("{place}/.zattrs"), json!({ "_ARRAY_DIMENSIONS": dims }))?;
        let chunk = vec!["0"; shape.len()].join(".");
        if bytes.is_empty() {
            Ok(())
        } else {
            std::fs::write(self.dir.join(place).join(chunk), bytes)
        }
    }

    fn put(&mut self, name: &str, value: Value) -> io::Result<()> {
        let path = self.dir.join(name);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        std::fs::write(path, serde_json::to_vec_pretty(&value).unwrap_or_default())?;
        self.metadata.insert(name.to_owned(), value);
        Ok(())
    }

    /// Writes the consolidated metadata.
    fn end(self) -> io::Result<()> {
        let all = json!({ "zarr_consolidated_format": 1, "metadata": self.metadata });
        std::fs::write(
            self.dir.join(".zmetadata"),
            serde_json::to_vec_pretty(&all).unwrap_or_default(),
        )
    }
}

/// Encodes texts as numpy does: four bytes per character, all padded to one length.
fn texts(all: &[String]) -> (String, Vec<u8>) {
    let length = all.iter().map(|s| s.chars().count()).max().unwrap_or(0).max(1);
    let letters = |s: &String| {
        s.chars().map(u32::from).chain(std::iter::repeat(0)).take(length).collect::<Vec<_>>()
    };
    let bytes = all.iter().flat_map(letters).flat_map(u32::to_le_bytes).collect();
    (format!("<U{length}"), bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_inference::draws::{Column, DrawRow, POINTWISE};

    #[test]
    fn arrays_are_as_the_format_has_them() {
        let dir = std::env::temp_dir().join(format!("pcadlang-zarr-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&dir);
        std::fs::create_dir_all(&dir).unwrap();
        let row = |x: f64| DrawRow {
            log_joint: -x,
            values: vec![x, 2.0 * x, 3.0 * x, -0.5],
            ..DrawRow::default()
        };
        let columns =
            vec![Column::scalar("S/x"), Column::vector("w", 2), Column::vector(POINTWISE, 1)];
        let chain = |rows| ChainDraws { columns: columns.clone(), rows, ..ChainDraws::default() };
        let chains = [
            chain(vec![row(1.0), row(2.0), row(3.0)]),
            chain(vec![]),
            chain(vec![row(4.0), row(5.0)]),
        ];
        for _ in 0..2 {
            write(&dir, &chains, &[Some(0.25), None, Some(0.5)], &[("y[\u{e4}]".into(), 7.0)])
                .unwrap();
        }
        let read = |name: &str| {
            std::fs::read(dir.join(ZARR).join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
        };
        let floats = |name: &str| {
            read(name)
                .chunks(8)
                .map(|b| f64::from_le_bytes(b.try_into().unwrap()))
                .collect::<Vec<f64>>()
        };
        let json = |name: &str| serde_json::from_slice::<Value>(&read(name)).unwrap();
        assert_eq!(floats("posterior/S.x/0.0"), [1.0, 2.0, 4.0, 5.0]);
        assert_eq!(floats("posterior/w/0.0.0"), [2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 10.0, 15.0]);
        assert_eq!(json("posterior/w/.zarray")["shape"], json!([2, 2, 2]));
        assert_eq!(
            json("posterior/w/.zattrs")["_ARRAY_DIMENSIONS"],
            json!(["chain", "draw", "w_dim_0"])
        );
        assert_eq!(floats("sample_stats/lp/0.0"), [-1.0, -2.0, -4.0, -5.0]);
        // Each chain has its step size, and the one without draws is left out.
        assert_eq!(floats("sample_stats/step_size/0.0"), [0.25, 0.25, 0.5, 0.5]);
        assert_eq!(floats("log_likelihood/observed/0.0.0"), [-0.5; 4]);
        assert_eq!(floats("observed_data/observed/0"), [7.0]);
        assert_eq!(json("log_likelihood/observation/.zarray")["dtype"], "<U4");
        assert_eq!(read("log_likelihood/observation/0")[8..12], 0xe4u32.to_le_bytes());
        assert!(!dir.join(ZARR).join("posterior").join(POINTWISE).exists());
        // Without draws the folder is empty, which is not an error.
        write(&dir, &[], &[], &[]).unwrap();
        assert!(!dir.join(ZARR).join("log_likelihood").exists());
        std::fs::remove_dir_all(&dir).unwrap();
    }
}
