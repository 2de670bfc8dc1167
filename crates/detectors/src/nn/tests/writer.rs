//! Writes FlatBuffers for tests, and a small network as one.

/// The contents of a table's field.
#[derive(Clone)]
pub enum Field {
    Absent,
    U8(u8),
    I32(i32),
    Bytes(Vec<u8>),
    U16s(Vec<u16>),
    I32s(Vec<i32>),
    Table(Vec<Field>),
    Tables(Vec<Vec<Field>>),
}

/// Returns a file with this identifier and root table.
pub fn file(identifier: &[u8; 4], root: &[Field]) -> Vec<u8> {
    let mut out = vec![0; 4];
    out.extend(identifier);
    let at = table(&mut out, root);
    out[..4].copy_from_slice(&(at as u32).to_le_bytes());
    out
}

/// Appends a table and everything it refers to; returns its position.
fn table(out: &mut Vec<u8>, fields: &[Field]) -> usize {
    // The vtable, then the table with eight bytes per field.
    let vtable = out.len();
    out.extend((4 + 2 * fields.len() as u16).to_le_bytes());
    out.extend((4 + 8 * fields.len() as u16).to_le_bytes());
    for (i, f) in fields.iter().enumerate() {
        let offset = if matches!(f, Field::Absent) { 0 } else { 4 + 8 * i as u16 };
        out.extend(offset.to_le_bytes());
    }
    let at = out.len();
    out.extend(((at - vtable) as i32).to_le_bytes());
    out.resize(at + 4 + 8 * fields.len(), 0);
    for (i, f) in fields.iter().enumerate() {
        let place = at + 4 + 8 * i;
        let target = match f {
            Field::Absent => continue,
            Field::U8(x) => {
                out[place] = *x;
                continue;
            }
            Field::I32(x) => {
                out[place..place + 4].copy_from_slice(&x.to_le_bytes());
                continue;
            }
            Field::Bytes(b) => vector(out, b.len(), b),
            Field::U16s(v) => {
                vector(out, v.len(), &v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>())
            }
            Field::I32s(v) => {
                vector(out, v.len(), &v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>())
            }
            Field::Table(fields) => table(out, fields),
            Field::Tables(all) => {
                let start = vector(out, all.len(), &vec![0; 4 * all.len()]);
                for (k, fields) in all.iter().enumerate() {
                    let element = start + 4 + 4 * k;
                    let target = table(out, fields);
                    refer(out, element, target);
                }
                start
            }
        };
        refer(out, place, target);
    }
    at
}

fn vector(out: &mut Vec<u8>, len: usize, bytes: &[u8]) -> usize {
    let at = out.len();
    out.extend((len as u32).to_le_bytes());
    out.extend(bytes);
    at
}

fn refer(out: &mut [u8], from: usize, to: usize) {
    out[from..from + 4].copy_from_slice(&((to - from) as u32).to_le_bytes());
}

/// A tensor of a file: shape, type (0: 32-bit float, 1: 16-bit float, 2: integer),
/// buffer.
fn tensor(shape: &[i32], kind: u8, buffer: i32) -> Vec<Field> {
    vec![Field::I32s(shape.to_vec()), Field::U8(kind), Field::I32(buffer)]
}

fn operator(code: i32, inputs: &[i32], output: i32, options: Vec<Field>) -> Vec<Field> {
    let io = [Field::I32s(inputs.to_vec()), Field::I32s(vec![output])];
    let [i, o] = io;
    vec![Field::I32(code), i, o, Field::U8(0), Field::Table(options)]
}

/// A convolution of one row of three pixels with the 16-bit weights 1 and -2, then a
/// ReLU.
pub fn small() -> Vec<Field> {
    let bytes = |v: &[f32]| v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let halves: Vec<u8> =
        [1.0f32, -2.0].iter().flat_map(|x| half::f16::from_f32(*x).to_le_bytes()).collect();
    let buffer = |b: Vec<u8>| vec![Field::Bytes(b)];
    let code = |n: u8| vec![Field::U8(n), Field::Absent, Field::Absent, Field::I32(i32::from(n))];
    let graph = vec![
        Field::Tables(vec![
            tensor(&[1, 1, 3, 1], 0, 0),
            tensor(&[1, 1, 2, 1], 1, 1),
            tensor(&[1, 1, 2, 1], 0, 0),
            tensor(&[1], 0, 2),
            tensor(&[1, 1, 2, 1], 0, 0),
            tensor(&[1, 1, 2, 1], 0, 0),
        ]),
        Field::I32s(vec![0]),
        Field::I32s(vec![5]),
        Field::Tables(vec![
            operator(0, &[1], 2, vec![]),
            operator(
                1,
                &[0, 2, 3],
                4,
                vec![Field::U8(1), Field::I32(1), Field::I32(1), Field::U8(0)],
            ),
            operator(2, &[4], 5, vec![]),
        ]),
    ];
    vec![
        Field::I32(3),
        Field::Tables(vec![code(6), code(3), code(19)]),
        Field::Tables(vec![graph]),
        Field::Absent,
        Field::Tables(vec![buffer(vec![]), buffer(halves), buffer(bytes(&[0.5]))]),
    ]
}
