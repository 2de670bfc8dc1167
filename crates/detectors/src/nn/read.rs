//! From the bytes of a TFLite file to a network: constants, operators with their weights,
//! and checks that they fit together.

use super::NetworkError;
use super::assemble::{Entry, Rejection};
use super::file::{File, format};
use super::flatbuffer::Table;
use super::fuse::fuse;
use super::network::{Effort, Layer, Network};
use super::schema::{code, field};
use std::collections::{HashMap, HashSet};

impl<'a> Network<'a> {
    /// Reads the network in a `.tflite` file.
    ///
    /// # Errors
    /// If the file is not of the format, or the network has unsupported operators or is
    /// too large.
    pub fn read(bytes: &'a [u8]) -> Result<Network<'a>, NetworkError> {
        let model = Table::root(bytes, *b"TFL3")?;
        let codes = model.tables(field::CODES)?;
        let graphs = model.tables(field::GRAPHS)?;
        let [graph] = &graphs[..] else { return Err(format("expected exactly one graph")) };
        let buffers = model.tables(field::BUFFERS)?;
        let mut file = File::new(graph.tables(field::graph::TENSORS)?, buffers)?;
        let [input] = graph.indices(field::graph::INPUTS)?[..] else {
            return Err(format("expected exactly one input"));
        };
        file.check(input)?;

        let (mut layers, mut filled, mut constants) =
            (Vec::<Layer>::new(), HashSet::from([input]), HashMap::new());
        let mut effort = Effort::default();
        for (index, table) in graph.tables(field::graph::OPERATORS)?.iter().enumerate() {
            let entry = entry(&file, &codes, table)?;
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
                Rejection::File(e) => e,
                Rejection::Operator(why) => wrong(&why),
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
            effort.add(&operator, &read, size)?;
            layers.push(Layer { operator, inputs, output: entry.output });
        }
        let outputs = graph.indices(field::graph::OUTPUTS)?;
        if outputs.is_empty() || outputs.iter().any(|o| !filled.contains(o)) {
            return Err(format("an output is never computed"));
        }
        let mut shapes = file.shapes;
        let layers = fuse(layers, &mut shapes, &constants, &outputs);
        Ok(effort.network(layers, shapes, constants, input, outputs))
    }
}

fn name(entry: &Entry) -> String {
    match entry.code {
        code::CUSTOM => String::from_utf8_lossy(entry.custom).into_owned(),
        code => format!("builtin {code}"),
    }
}

fn entry<'a>(
    file: &File,
    codes: &[Table<'a>],
    table: &Table<'a>,
) -> Result<Entry<'a>, NetworkError> {
    let absent = || format("an operator has an undefined code");
    let kind = codes.get(table.index(field::operator::CODE)?).ok_or_else(absent)?;
    // Older files have the code in a byte.
    let code = kind.i32(field::code::LONG, 0)?.max(i32::from(kind.u8(field::code::SHORT)? as i8));
    let inputs = table.i32s(field::operator::INPUTS)?.into_iter();
    // An omitted input is -1.
    let inputs: Vec<usize> = inputs.filter_map(|i| usize::try_from(i).ok()).collect();
    let outputs = table.indices(field::operator::OUTPUTS)?;
    let [output] = outputs[..] else {
        return Err(format("an operator does not have exactly one output"));
    };
    inputs.iter().chain([&output]).try_for_each(|t| file.check(*t))?;
    let custom = kind.bytes(field::code::CUSTOM)?;
    Ok(Entry { code, custom, options: table.table(field::operator::OPTIONS)?, inputs, output })
}
