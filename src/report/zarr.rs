//! A run in ArviZ's format: `inference.zarr`, a folder in the Zarr format (version 2),
//! which can be opened by `xarray.open_datatree(…, engine="zarr")` and, with version 2 of
//! the Zarr library, by `arviz.from_zarr`. Its groups are `posterior`, `sample_stats`,
//! `log_likelihood` and `observed_data`.
//!
//! Arrays have one chunk and no compression; numbers are 8 bytes, little-endian. A vector
//! has a dimension `NAME_dim_0`; observed values have one dimension `observation`, with
//! their names as its coordinate. `/` in names becomes `.`, as in programs.

use super::ChainDraws;
use crate::infer::draws::{Column, DrawRow, POINTWISE, Shape};
use serde_json::{Map, Value, json};
use std::collections::HashSet;
use std::io;
use std::path::{Path, PathBuf};

/// The name of the folder inside a run's folder.
pub const ZARR: &str = "inference.zarr";

/// The name of an observed value, and the value; NaN if it is not a number.
pub type Point = (String, f64);

/// The elements of an array.
enum Numbers {
    Floats(Vec<f64>),
    Integers(Vec<i64>),
    Truths(Vec<bool>),
    Texts(Vec<String>),
}

/// An array of a group, with the names and lengths of its dimensions.
struct Array {
    name: String,
    dims: Vec<(String, usize)>,
    numbers: Numbers,
}

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
    let known = step_sizes.iter().copied().chain(std::iter::repeat(None));
    let (chains, step_sizes): (Vec<&ChainDraws>, Vec<Option<f64>>) =
        chains.iter().zip(known).filter(|(c, _)| !c.rows.is_empty()).unzip();
    let draws = chains.iter().map(|c| c.rows.len()).min().unwrap_or(0);
    let rows: Vec<&DrawRow> = chains.iter().flat_map(|c| &c.rows[..draws]).collect();
    let dims = vec![("chain".to_owned(), chains.len()), ("draw".to_owned(), draws)];
    let columns = chains.first().map_or(&[][..], |c| &c.columns);
    store.group("posterior", posterior(columns, &rows, &dims))?;
    let mut stats = sample_stats(&rows, &dims);
    if step_sizes.iter().any(Option::is_some) {
        let each =
            step_sizes.iter().flat_map(|s| std::iter::repeat_n(s.unwrap_or(f64::NAN), draws));
        let numbers = Numbers::Floats(each.collect());
        stats.push(Array { name: "step_size".into(), dims: dims.clone(), numbers });
    }
    store.group("sample_stats", stats)?;
    if let Some((at, n)) = place_of(columns, POINTWISE).filter(|(_, n)| *n == points.len()) {
        let observation = vec![("observation".to_owned(), n)];
        let all = |d: &[(String, usize)]| d.iter().chain(&observation).cloned().collect::<Vec<_>>();
        let scores = rows.iter().flat_map(|r| r.values[at..at + n].to_vec()).collect();
        let names = Numbers::Texts(points.iter().map(|p| p.0.clone()).collect());
        let array = |dims, numbers| Array {
            name: "observed".into(),
            dims,
            numbers: Numbers::Floats(numbers),
        };
        let coordinate =
            Array { name: "observation".into(), dims: observation.clone(), numbers: names };
        store.group("log_likelihood", vec![array(all(&dims), scores)])?;
        store.save("log_likelihood", &coordinate)?;
        store.group(
            "observed_data",
            vec![array(observation.clone(), points.iter().map(|p| p.1).collect())],
        )?;
        store.save("observed_data", &coordinate)?;
    }
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

/// Returns the position of a column's numbers in a row, and how many there are.
fn place_of(columns: &[Column], name: &str) -> Option<(usize, usize)> {
    let before = columns.iter().position(|c| c.name == name)?;
    Some((columns[..before].iter().map(|c| c.shape.len()).sum(), columns[before].shape.len()))
}

fn posterior(columns: &[Column], rows: &[&DrawRow], dims: &[(String, usize)]) -> Vec<Array> {
    let (mut at, mut taken, mut all) = (0, HashSet::new(), Vec::new());
    for c in columns {
        let (begin, n) = (at, c.shape.len());
        at += n;
        if c.name == POINTWISE || n == 0 {
            continue;
        }
        let name = name_of(&c.name, &mut taken);
        let mut dims = dims.to_vec();
        if let Shape::Vector(n) = c.shape {
            dims.push((format!("{name}_dim_0"), n));
        }
        let numbers = rows.iter().flat_map(|r| r.values[begin..begin + n].to_vec()).collect();
        all.push(Array { name, dims, numbers: Numbers::Floats(numbers) });
    }
    all
}

fn sample_stats(rows: &[&DrawRow], dims: &[(String, usize)]) -> Vec<Array> {
    let array = |name: &str, numbers| Array { name: name.into(), dims: dims.to_vec(), numbers };
    let floats = |f: fn(&DrawRow) -> f64| Numbers::Floats(rows.iter().map(|r| f(r)).collect());
    vec![
        array("lp", floats(|r| r.log_joint)),
        array("log_prior", floats(|r| r.log_prior)),
        array("log_likelihood_sum", floats(|r| r.log_likelihood)),
        array("acceptance_rate", floats(|r| r.acceptance)),
        array("diverging", Numbers::Truths(rows.iter().map(|r| r.divergent > 0).collect())),
        array("step", Numbers::Integers(rows.iter().map(|r| r.step as i64).collect())),
    ]
}

/// Converts a name to one that is valid for a folder and differs from all names taken.
fn name_of(name: &str, taken: &mut HashSet<String>) -> String {
    let fits = |c: char| c.is_alphanumeric() || "_.-+[]()".contains(c);
    let plain: String = name
        .chars()
        .map(|c| {
            if c == '/' {
                '.'
            } else if fits(c) {
                c
            } else {
                '_'
            }
        })
        .collect();
    let plain =
        if plain.is_empty() || plain.starts_with('.') { format!("_{plain}") } else { plain };
    let mut all = std::iter::once(plain.clone()).chain((2..).map(|i| format!("{plain}_{i}")));
    all.find(|name| taken.insert(name.to_lowercase())).unwrap_or(plain)
}

/// A folder that is being written.
struct Store {
    dir: PathBuf,
    /// The contents of all metadata files, which readers expect in one file.
    metadata: Map<String, Value>,
}

impl Store {
    /// Writes a group with its arrays and, for each dimension, a coordinate that counts
    /// from 0.
    fn group(&mut self, name: &str, arrays: Vec<Array>) -> io::Result<()> {
        self.put(&format!("{name}/.zgroup"), json!({ "zarr_format": 2 }))?;
        let by = json!({ "inference_library": "pcadlang", "inference_library_version": env!("CARGO_PKG_VERSION") });
        self.put(&format!("{name}/.zattrs"), by)?;
        let dims: indexmap::IndexSet<&(String, usize)> =
            arrays.iter().flat_map(|a| &a.dims).collect();
        for (dim, n) in dims {
            let counts = Numbers::Integers((0..*n as i64).collect());
            self.save(
                name,
                &Array { name: dim.clone(), dims: vec![(dim.clone(), *n)], numbers: counts },
            )?;
        }
        arrays.iter().try_for_each(|a| self.save(name, a))
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
