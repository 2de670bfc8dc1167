//! The contents of a TFLite file: the shapes of its tensors, and its constants.

use super::NetworkError;
use super::flatbuffer::Table;
use super::network::MOST_NUMBERS;
use super::schema::field;
use super::sparse;
use super::weights::{Kind, Numbers, Sparse, Weights};
use std::collections::HashMap;

type Result<T> = core::result::Result<T, NetworkError>;

/// The contents of a file, before its operators are built.
pub(super) struct File<'a> {
    tensors: Vec<Table<'a>>,
    buffers: Vec<Table<'a>>,
    pub shapes: Vec<Vec<usize>>,
    /// Tensors that are other tensors in another form: made dense, or with more bits.
    pub same: HashMap<usize, usize>,
    /// The number of constant elements that may still be read.
    left: usize,
}

pub(super) fn format(why: &str) -> NetworkError {
    NetworkError::Format(why.into())
}

fn wrong_length() -> NetworkError {
    format("the number of values of a constant does not match its shape")
}

fn shape(tensor: &Table) -> Result<Vec<usize>> {
    let shape = tensor.indices(field::tensor::SHAPE)?;
    let size = shape.iter().try_fold(1usize, |n, s| n.checked_mul(*s));
    match size {
        Some(1..=MOST_NUMBERS) if shape.len() <= 8 => Ok(shape),
        _ => Err(NetworkError::TooLarge(format!("a tensor of shape {shape:?}"))),
    }
}

impl<'a> File<'a> {
    /// The tensors of a graph, of which nothing has been read.
    pub fn new(tensors: Vec<Table<'a>>, buffers: Vec<Table<'a>>) -> Result<Self> {
        let shapes = tensors.iter().map(shape).collect::<Result<_>>()?;
        Ok(File { tensors, buffers, shapes, same: HashMap::new(), left: MOST_NUMBERS })
    }

    pub fn check(&self, tensor: usize) -> Result<()> {
        if tensor < self.shapes.len() { Ok(()) } else { Err(format("a tensor is missing")) }
    }

    /// Returns a constant's stored tensor, and its bytes in the file's form.
    fn constant(&self, mut tensor: usize) -> Result<(usize, &'a [u8])> {
        for _ in 0..=self.same.len() {
            match self.same.get(&tensor) {
                Some(from) => tensor = *from,
                None => {
                    let buffer = self.tensors[tensor].index(field::tensor::BUFFER)?;
                    let buffer =
                        self.buffers.get(buffer).ok_or_else(|| format("a buffer is missing"))?;
                    return Ok((tensor, buffer.bytes(0)?));
                }
            }
        }
        Err(format("a constant is stored indirectly"))
    }

    /// Returns a constant's elements.
    pub fn numbers(&mut self, tensor: usize) -> Result<Vec<f32>> {
        let (numbers, sparsity) = self.stored(tensor)?;
        let values = match sparsity {
            Some(sparsity) => sparse::dense(&self.shapes[tensor], &sparsity, &numbers.all())?,
            None => numbers.all(),
        };
        match values.len() == self.size(tensor) {
            true => Ok(values),
            false => Err(wrong_length()),
        }
    }

    /// Returns the weights of a convolution, those of each output channel together.
    pub fn weights(&mut self, tensor: usize, channels: usize) -> Result<Weights<'a>> {
        let (numbers, sparsity) = self.stored(tensor)?;
        if let Some(sparsity) = sparsity {
            let dense = sparse::dense(&self.shapes[tensor], &sparsity, &numbers.all())?;
            let sparse = Sparse::new(&dense, channels).map(Weights::Sparse);
            return sparse.ok_or_else(|| NetworkError::TooLarge("a window's weights".into()));
        }
        match numbers.len() == self.size(tensor) {
            true => Ok(Weights::ByOutput(numbers)),
            false => Err(wrong_length()),
        }
    }

    fn size(&self, tensor: usize) -> usize {
        self.shapes[tensor].iter().product()
    }

    /// Returns a constant's numbers as they are stored, all of them finite, and how they are laid
    /// out if they are sparse.
    fn stored(&mut self, tensor: usize) -> Result<(Numbers<'a>, Option<Table<'a>>)> {
        let (from, bytes) = self.constant(tensor)?;
        let table = self.tensors[from];
        let kind = match table.u8(field::tensor::KIND)? {
            0 => Kind::Float,
            1 => Kind::Half,
            _ => return Err(format("a constant is not of 32- or 16-bit floats")),
        };
        let (size, numbers) = (self.size(from), Numbers::new(kind, bytes));
        self.left = self
            .left
            .checked_sub(size)
            .ok_or_else(|| NetworkError::TooLarge("its constants".into()))?;
        if size != self.size(tensor) {
            return Err(wrong_length());
        }
        if !numbers.are_finite() {
            return Err(format("a constant is not finite"));
        }
        Ok((numbers, table.table(field::tensor::SPARSITY)?))
    }

    /// Returns a constant's integer elements.
    pub fn integers(&self, tensor: usize) -> Result<Vec<i32>> {
        let (from, bytes) = self.constant(tensor)?;
        match self.tensors[from].u8(field::tensor::KIND)? {
            2 => Ok(bytes
                .chunks_exact(4)
                .map(|b| i32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                .collect()),
            _ => Err(format("a constant is not of integers")),
        }
    }
}
