//! Converts sparse tensors of TFLite files to dense ones.
//!
//! A tensor of rank n may be cut into blocks. Its n outer dimensions and the blocks'
//! inner ones are traversed in some order, each densely or by a list of the indices
//! present (compressed sparse rows), down to the values (TFLite's `SparsityParameters`).

use super::NetworkError;
use super::flatbuffer::Table;

/// Field indices of `SparsityParameters` and `DimensionMetadata`. For vectors of indices,
/// the field of their type; the vector is the next field.
const ORDER: usize = 0;
const BLOCK_MAP: usize = 1;
const DIMENSIONS: usize = 2;
const FORMAT: usize = 0;
const DENSE_SIZE: usize = 1;
const SEGMENTS: usize = 2;
const INDICES: usize = 4;

fn bad(what: &str) -> NetworkError {
    NetworkError::Format(format!("a sparse tensor {what}"))
}

enum Level {
    Dense(usize),
    /// The indices of row r are `indices[segments[r]..segments[r + 1]]`.
    Rows {
        segments: Vec<usize>,
        indices: Vec<usize>,
    },
}

struct Layout<'a> {
    shape: &'a [usize],
    /// For each level, the dimension it traverses and the step along it.
    along: Vec<(usize, usize)>,
    levels: Vec<Level>,
}

/// Returns the values of a sparse tensor as a dense one of this shape.
pub(super) fn dense(
    shape: &[usize],
    sparsity: &Table,
    values: &[f32],
) -> Result<Vec<f32>, NetworkError> {
    let layout = Layout::read(shape, sparsity)?;
    let mut out = vec![0.0; shape.iter().product()];
    let mut rest = values;
    layout.walk(0, 0, &mut vec![0; shape.len()], &mut rest, &mut out)?;
    Ok(out)
}

impl<'a> Layout<'a> {
    fn read(shape: &'a [usize], sparsity: &Table) -> Result<Layout<'a>, NetworkError> {
        let (order, map) = (sparsity.indices(ORDER)?, sparsity.indices(BLOCK_MAP)?);
        let dimensions = sparsity.tables(DIMENSIONS)?;
        let mut sorted = order.clone();
        sorted.sort_unstable();
        if sorted != (0..shape.len() + map.len()).collect::<Vec<_>>()
            || dimensions.len() != order.len()
        {
            return Err(bad("has an invalid traversal order"));
        }
        // The size of blocks along each dimension; a block's own dimensions are dense.
        let mut block = vec![1; shape.len()];
        for (level, which) in order.iter().enumerate().filter(|(_, which)| **which >= shape.len()) {
            let d = *map
                .get(which - shape.len())
                .filter(|d| **d < shape.len())
                .ok_or_else(|| bad("has wrong blocks"))?;
            let size = dimensions[level].index(DENSE_SIZE)?;
            if dimensions[level].u8(FORMAT)? != 0
                || block[d] != 1
                || size == 0
                || !shape[d].is_multiple_of(size)
            {
                return Err(bad("has wrong blocks"));
            }
            block[d] = size;
        }
        let (mut along, mut levels) = (Vec::new(), Vec::new());
        for (which, table) in order.iter().zip(&dimensions) {
            let (d, step, size) = match which.checked_sub(shape.len()) {
                None => (*which, block[*which], shape[*which] / block[*which]),
                Some(b) => (map[b], 1, block[map[b]]),
            };
            along.push((d, step));
            levels.push(match table.u8(FORMAT)? {
                0 if table.index(DENSE_SIZE)? == size => Level::Dense(size),
                0 => return Err(bad("has a dimension that does not match its shape")),
                1 => {
                    let (segments, indices) = (numbers(table, SEGMENTS)?, numbers(table, INDICES)?);
                    let in_order = segments.windows(2).all(|w| w[0] <= w[1]);
                    if !in_order
                        || segments.last().is_none_or(|l| *l > indices.len())
                        || indices.iter().any(|i| *i >= size)
                    {
                        return Err(bad("has indices out of range"));
                    }
                    Level::Rows { segments, indices }
                }
                _ => return Err(bad("has a dimension of an unknown format")),
            });
        }
        Ok(Layout { shape, along, levels })
    }

    /// Traverses the levels from this one on, in its row `row`.
    fn walk(
        &self,
        level: usize,
        row: usize,
        at: &mut Vec<usize>,
        values: &mut &[f32],
        out: &mut [f32],
    ) -> Result<(), NetworkError> {
        let Some(kind) = self.levels.get(level) else {
            let place = at.iter().zip(self.shape).fold(0, |place, (i, n)| place * n + i);
            let (first, rest) = values.split_first().ok_or_else(|| bad("has too few values"))?;
            out[place] = *first;
            *values = rest;
            return Ok(());
        };
        let (d, step) = self.along[level];
        let mut enter = |i: usize, row: usize| {
            at[d] += i * step;
            let done = self.walk(level + 1, row, at, values, out);
            at[d] -= i * step;
            done
        };
        match kind {
            Level::Dense(n) => (0..*n).try_for_each(|i| enter(i, row * n + i)),
            Level::Rows { segments, indices } => {
                let ends = segments.get(row).zip(segments.get(row + 1));
                let (start, end) = ends.ok_or_else(|| bad("has too few rows"))?;
                (*start..*end).try_for_each(|k| enter(indices[k], k))
            }
        }
    }
}

/// Reads indices of 32, 16 or 8 bits.
fn numbers(table: &Table, field: usize) -> Result<Vec<usize>, NetworkError> {
    let vector = table.table(field + 1)?.ok_or_else(|| bad("has missing indices"))?;
    match table.u8(field)? {
        1 => vector.indices(0),
        2 => Ok(vector.u16s(0)?.into_iter().map(usize::from).collect()),
        3 => Ok(vector.bytes(0)?.iter().map(|b| usize::from(*b)).collect()),
        _ => Err(bad("has indices of an unknown kind")),
    }
}
