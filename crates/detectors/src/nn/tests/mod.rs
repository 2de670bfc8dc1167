//! Tests of operators against their definitions, of small generated files, and of broken
//! files.

pub mod graph;
mod graph_model;
mod operators;
mod writer;

use super::flatbuffer::Table;
use super::{Network, NetworkError, sparse};
use writer::{Field, file, small};

#[test]
fn a_file_is_read_and_run() {
    let bytes = file(b"TFL3", &small());
    let network = Network::read(&bytes).unwrap();
    assert_eq!(network.input_shape(), [1, 1, 3, 1]);
    assert_eq!(network.output_shapes().collect::<Vec<_>>(), [[1, 1, 2, 1]]);
    // 3 - 2 * 1 + 0.5, and 1 - 2 * 4 + 0.5, which the ReLU clips to 0.
    assert_eq!(network.run(vec![3.0, 1.0, 4.0]).unwrap(), [[1.5, 0.0]]);
    let short = network.run(vec![3.0]).unwrap_err();
    assert_eq!(short, NetworkError::Input { expected: 3, got: 1 });
}

#[test]
fn broken_files_are_errors_or_other_networks() {
    let good = file(b"TFL3", &small());
    for n in 0..good.len() {
        // May succeed: the part cut off may be unreferenced.
        let _ = Network::read(&good[..n]);
    }
    let mut read = 0;
    for i in 0..good.len() {
        for value in [0, 1, 2, 0x7f, 0x80, 0xff, good[i] ^ 4] {
            let mut bad = good.clone();
            bad[i] = value;
            if let Ok(network) = Network::read(&bad) {
                let n = network.input_shape().iter().product();
                assert!(network.run(vec![1.0; n]).is_ok());
                read += 1;
            }
        }
    }
    assert!(read > 100, "{read}");
    assert!(matches!(Network::read(b""), Err(NetworkError::Format(_))));
    assert!(matches!(Network::read(b"\x08\0\0\0TFL2\0\0\0\0"), Err(NetworkError::Format(_))));
}

#[test]
fn operators_that_do_not_fit_are_named() {
    let with = |change: &dyn Fn(&mut Vec<Field>)| {
        let mut all = small();
        let Field::Tables(graphs) = &mut all[2] else { panic!() };
        change(&mut graphs[0]);
        Network::read(&file(b"TFL3", &all)).unwrap_err().to_string()
    };
    let tensors = |t: usize, shape: &'static [i32]| {
        move |graph: &mut Vec<Field>| {
            let Field::Tables(all) = &mut graph[0] else { panic!() };
            all[t][0] = Field::I32s(shape.to_vec());
        }
    };
    assert!(
        with(&tensors(0, &[1, 1, 4, 1]))
            .contains("operator 1 of the network, builtin 3: the shapes of its tensors")
    );
    assert!(with(&tensors(5, &[1, 1, 3, 1])).contains("operator 2 of the network, builtin 19"));
    assert!(with(&tensors(3, &[2])).contains("the number of values of a constant"));
    assert!(with(&tensors(0, &[1, 1 << 20, 1 << 20, 1])).contains("too large"));
    assert!(with(&|g| g[2] = Field::I32s(vec![3])).contains("an output is never computed"));
    assert!(with(&|g| g[1] = Field::I32s(vec![9])).contains("a tensor is missing"));
}

/// Returns the dense form of a sparse tensor with these values; each dimension is a
/// `DimensionMetadata` table.
fn dense(
    shape: &[usize],
    order: &[i32],
    blocks: &[i32],
    dimensions: Vec<Vec<Field>>,
    values: &[f32],
) -> Result<Vec<f32>, NetworkError> {
    let fields =
        [Field::I32s(order.to_vec()), Field::I32s(blocks.to_vec()), Field::Tables(dimensions)];
    let bytes = file(b"TEST", &fields);
    sparse::dense(shape, &Table::root(&bytes, *b"TEST")?, values)
}

fn all_of(n: i32) -> Vec<Field> {
    vec![Field::U8(0), Field::I32(n)]
}

fn rows(segments: &[u16], indices: &[u8]) -> Vec<Field> {
    let segments = Field::Table(vec![Field::U16s(segments.to_vec())]);
    let indices = Field::Table(vec![Field::Bytes(indices.to_vec())]);
    vec![Field::U8(1), Field::Absent, Field::U8(2), segments, Field::U8(3), indices]
}

#[test]
fn sparse_tensors_are_laid_out() {
    // Compressed rows: 1 0 2 / 0 0 0 / 0 3 0.
    let by_rows = dense(
        &[3, 3],
        &[0, 1],
        &[],
        vec![all_of(3), rows(&[0, 2, 2, 3], &[0, 2, 1])],
        &[1.0, 2.0, 3.0],
    );
    assert_eq!(by_rows.unwrap(), [1.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0]);
    // The same by columns.
    let by_columns = dense(
        &[3, 3],
        &[1, 0],
        &[],
        vec![all_of(3), rows(&[0, 1, 2, 3], &[0, 2, 0])],
        &[1.0, 3.0, 2.0],
    );
    assert_eq!(by_columns.unwrap(), [1.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0]);
    // Blocks of two columns, two per row: the second block of the first row, and the
    // first block of the second row.
    let blocks = vec![all_of(2), rows(&[0, 1, 2], &[1, 0]), all_of(2)];
    let by_blocks = dense(&[2, 4], &[0, 1, 2], &[1], blocks, &[1.0, 2.0, 3.0, 4.0]);
    assert_eq!(by_blocks.unwrap(), [0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 0.0, 0.0]);
}

#[test]
fn sparse_tensors_that_lead_nowhere_are_errors() {
    let of = |order: &[i32], dimensions: Vec<Vec<Field>>| {
        dense(&[2, 2], order, &[], dimensions, &[1.0]).is_err()
    };
    assert!(of(&[0, 1], vec![all_of(2), all_of(2)]), "too few values");
    assert!(of(&[0, 0], vec![all_of(2), all_of(2)]));
    assert!(of(&[0, 1], vec![all_of(2), all_of(3)]));
    assert!(of(&[0, 1], vec![all_of(2)]));
    assert!(of(&[0, 1], vec![all_of(2), rows(&[0, 1], &[0])]), "too few rows");
    assert!(of(&[0, 1], vec![all_of(2), rows(&[0, 1, 1], &[2])]), "an index outside");
    assert!(
        of(&[0, 1], vec![all_of(2), rows(&[0, 2, 1], &[0, 0])]),
        "rows that end before they begin"
    );
    assert!(!of(&[0, 1], vec![all_of(2), rows(&[0, 1, 1], &[1])]));
}
