//! From the bytes of a TFLite file to a network: constants, operators with their weights,
//! and checks that they fit together.

use super::NetworkError;
use super::assemble::{Entry, Unfit};
use super::flatbuffer::Table;
use super::network::{Layer, Network};
use super::schema::{code, field};
use super::sparse;
use half::slice::HalfFloatSliceExt;
use std::collections::{HashMap, HashSet};

type Result<T> = core::result::Result<T, NetworkError>;

/// The maximum number of elements in one tensor, and in all constants together.
const MOST_NUMBERS: usize = 1 << 26;
/// The maximum number of elements in all computed tensors, and of multiplications: about
/// ten times those of the largest person detector.
const MOST_COMPUTED: usize = 1 << 29;
const MOST_WORK: usize = 1 << 36;

/// The contents of a file, before its operators are built.
pub(super) struct File<'a> {
    tensors: Vec<Table<'a>>,
    buffers: Vec<Table<'a>>,
    pub shapes: Vec<Vec<usize>>,
    /// Tensors that are other tensors in another form: made dense, or with more bits.
    same: HashMap<usize, usize>,
    /// The number of constant elements that may still be read.
    left: usize,
}

pub(super) fn read(bytes: &[u8]) -> Result<Network> {
    let model = Table::root(bytes, *b"TFL3")?;
    let codes = model.tables(field::CODES)?;
    let graphs = model.tables(field::GRAPHS)?;
    let [graph] = &graphs[..] else { return Err(format("expected exactly one graph")) };
    let tensors = graph.tables(field::graph::TENSORS)?;
    let shapes: Vec<Vec<usize>> = tensors.iter().map(shape).collect::<Result<_>>()?;
    let buffers = model.tables(field::BUFFERS)?;
    let mut file = File { tensors, buffers, shapes, same: HashMap::new(), left: MOST_NUMBERS };
    let [input] = graph.indices(field::graph::INPUTS)?[..] else {
        return Err(format("expected exactly one input"));
    };
    file.check(input)?;

    let (mut layers, mut filled, mut constants) =
        (Vec::<Layer>::new(), HashSet::from([input]), HashMap::new());
    let (mut computed, mut work) = (0usize, 0usize);
    for (index, table) in graph.tables(field::graph::OPERATORS)?.iter().enumerate() {
        let entry = file.entry(&codes, table)?;
        let wrong =
            |why: &str| NetworkError::Operator { index, name: name(&entry), why: why.into() };
        // A constant in another form is still a constant.
        if matches!(entry.code, code::DEQUANTIZE | code::DENSIFY) {
            let from = *entry.inputs.first().ok_or_else(|| wrong("it has no input"))?;
            if filled.contains(&from)
                || file.same.insert(entry.output, from).is_some()
                || entry.output == from
            {
                return Err(wrong("its input is not a constant"));
            }
            continue;
        }
        let (operator, inputs) = file.operator(&entry).map_err(|e| match e {
            Unfit::File(e) => e,
            Unfit::Operator(why) => wrong(&why),
        })?;
        for t in inputs.iter().filter(|t| !filled.contains(t)) {
            if !constants.contains_key(t) {
                constants.insert(*t, file.numbers(*t)?);
            }
        }
        if !filled.insert(entry.output) {
            return Err(wrong("it overwrites an existing tensor"));
        }
        let read: Vec<&[usize]> = inputs.iter().map(|t| &file.shapes[*t][..]).collect();
        let size: usize = file.shapes[entry.output].iter().product();
        computed = computed.saturating_add(size);
        work = work.saturating_add(operator.work(&read, size));
        if computed > MOST_COMPUTED || work > MOST_WORK {
            return Err(NetworkError::TooLarge("it needs too many operations".into()));
        }
        layers.push(Layer { operator, inputs, output: entry.output });
    }
    let outputs = graph.indices(field::graph::OUTPUTS)?;
    if outputs.is_empty() || outputs.iter().any(|o| !filled.contains(o)) {
        return Err(format("an output is never computed"));
    }
    let mut last = vec![0; file.shapes.len()];
    layers.iter().enumerate().for_each(|(i, s)| s.inputs.iter().for_each(|t| last[*t] = i));
    outputs.iter().for_each(|o| last[*o] = usize::MAX);
    Ok(Network { layers, shapes: file.shapes, constants, input, outputs, last, work })
}

fn format(why: &str) -> NetworkError {
    NetworkError::Format(why.into())
}

fn shape(tensor: &Table) -> Result<Vec<usize>> {
    let shape = tensor.indices(field::tensor::SHAPE)?;
    let size = shape.iter().try_fold(1usize, |n, s| n.checked_mul(*s));
    match size {
        Some(1..=MOST_NUMBERS) if shape.len() <= 8 => Ok(shape),
        _ => Err(NetworkError::TooLarge(format!("a tensor of shape {shape:?}"))),
    }
}

fn name(entry: &Entry) -> String {
    match entry.code {
        code::CUSTOM => String::from_utf8_lossy(entry.custom).into_owned(),
        code => format!("builtin {code}"),
    }
}

impl File<'_> {
    fn entry<'t>(&self, codes: &[Table<'t>], table: &Table<'t>) -> Result<Entry<'t>> {
        let absent = || format("an operator has an undefined code");
        let kind = codes.get(table.index(field::operator::CODE)?).ok_or_else(absent)?;
        // Older files have the code in a byte.
        let code =
            kind.i32(field::code::LONG, 0)?.max(i32::from(kind.u8(field::code::SHORT)? as i8));
        let inputs = table.i32s(field::operator::INPUTS)?.into_iter();
        // An omitted input is -1.
        let inputs: Vec<usize> = inputs.filter_map(|i| usize::try_from(i).ok()).collect();
        let outputs = table.indices(field::operator::OUTPUTS)?;
        let [output] = outputs[..] else {
            return Err(format("an operator does not have exactly one output"));
        };
        inputs.iter().chain([&output]).try_for_each(|t| self.check(*t))?;
        let custom = kind.bytes(field::code::CUSTOM)?;
        Ok(Entry { code, custom, options: table.table(field::operator::OPTIONS)?, inputs, output })
    }

    fn check(&self, tensor: usize) -> Result<()> {
        if tensor < self.shapes.len() { Ok(()) } else { Err(format("a tensor is missing")) }
    }

    /// Returns a constant's stored tensor, and its bytes in the file's form.
    fn constant(&self, mut tensor: usize) -> Result<(usize, &[u8])> {
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
        let (from, bytes) = self.constant(tensor)?;
        let (table, shape) = (self.tensors[from], &self.shapes[from]);
        let values: Vec<f32> = match table.u8(field::tensor::KIND)? {
            0 => bytes
                .chunks_exact(4)
                .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                .collect(),
            1 => {
                let halves = bytes.chunks_exact(2).map(|b| half::f16::from_le_bytes([b[0], b[1]]));
                let halves: Vec<half::f16> = halves.collect();
                halves.to_f32_vec()
            }
            _ => return Err(format("a constant is not of 32- or 16-bit floats")),
        };
        let size: usize = shape.iter().product();
        self.left = self
            .left
            .checked_sub(size)
            .ok_or_else(|| NetworkError::TooLarge("its constants".into()))?;
        let values = match table.table(field::tensor::SPARSITY)? {
            Some(sparsity) => sparse::dense(shape, &sparsity, &values)?,
            None => values,
        };
        let is_whole =
            values.len() == size && size == self.shapes[tensor].iter().product::<usize>();
        if !is_whole {
            return Err(format("the number of values of a constant does not match its shape"));
        }
        if values.iter().any(|v| !v.is_finite()) {
            return Err(format("a constant is not finite"));
        }
        Ok(values)
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
