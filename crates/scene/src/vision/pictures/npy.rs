//! Numpy's `.npy` arrays (numpy.lib.format, versions 1.0 to 3.0): little-endian floats, integers
//! and bool, in C order. `.npz` archives, other types and Fortran order are rejected with a
//! message that says what to do; float32 is written too.

use crate::vision::error::VisionError;

/// The numbers of an array.
#[derive(Clone, Debug, PartialEq)]
pub enum NpyData {
    /// `<f4`
    F32(Vec<f32>),
    /// `<f8`, `<f2`
    F64(Vec<f64>),
    /// Whole numbers of more than 8 bits or with a sign; those beyond 2^53 are rounded.
    Whole(Vec<f64>),
    /// `|u1`
    U8(Vec<u8>),
    /// `|b1`
    Bool(Vec<bool>),
}

/// An array in C order: the last index varies fastest. The number of elements is the
/// product of `shape`.
#[derive(Clone, Debug, PartialEq)]
pub struct NpyArray {
    /// Length of every axis.
    pub shape: Vec<usize>,
    /// The numbers.
    pub data: NpyData,
}

impl NpyArray {
    /// Converts the numbers to float32 (float64 is rounded to nearest; false is 0, true
    /// is 1).
    pub fn into_f32(self) -> Vec<f32> {
        match self.data {
            NpyData::F32(v) => v,
            NpyData::F64(v) | NpyData::Whole(v) => v.into_iter().map(|x| x as f32).collect(),
            NpyData::U8(v) => v.into_iter().map(f32::from).collect(),
            NpyData::Bool(v) => v.into_iter().map(|x| f32::from(u8::from(x))).collect(),
        }
    }

    /// Converts the numbers to float64 (false is 0, true is 1).
    pub fn into_f64(self) -> Vec<f64> {
        match self.data {
            NpyData::F32(v) => v.into_iter().map(f64::from).collect(),
            NpyData::F64(v) | NpyData::Whole(v) => v,
            NpyData::U8(v) => v.into_iter().map(f64::from).collect(),
            NpyData::Bool(v) => v.into_iter().map(|x| f64::from(u8::from(x))).collect(),
        }
    }

    /// Returns width and height of an array of rows (also of shape height x width x 1).
    pub fn picture_size(&self) -> Result<(u32, u32), VisionError> {
        match self.shape[..] {
            [h, w] | [h, w, 1] if h > 0 && w > 0 => u32::try_from(w)
                .ok()
                .zip(u32::try_from(h).ok())
                .ok_or_else(|| bad("it is too large")),
            _ => Err(bad(format!(
                "its shape is {:?}; it must have two axes, height and width",
                self.shape
            ))),
        }
    }
}

fn bad(text: impl Into<String>) -> VisionError {
    VisionError::Npy(text.into())
}

/// True if bytes begin with the magic number of a `.npy` file.
pub fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x93NUMPY")
}

/// Reads the bytes of a `.npy` file.
pub fn parse(bytes: &[u8]) -> Result<NpyArray, VisionError> {
    if bytes.is_empty() {
        return Err(VisionError::Empty);
    }
    if !is_npy(bytes) {
        return Err(bad(match bytes {
            [b'P', b'K', 3, 4, ..] => "it is a .npz archive; save the array with numpy.save",
            _ => "it does not start like a .npy file",
        }));
    }
    let cut = || bad("it is truncated");
    let byte = |i: usize| bytes.get(i).map(|&b| usize::from(b)).ok_or_else(cut);
    let (start, length) = match byte(6)? {
        1 => (10, byte(8)? | byte(9)? << 8),
        2 | 3 => (12, byte(8)? | byte(9)? << 8 | byte(10)? << 16 | byte(11)? << 24),
        v => return Err(bad(format!("its format version {v} is not known"))),
    };
    let end = start + length;
    let header = std::str::from_utf8(bytes.get(start..end).ok_or_else(cut)?)
        .map_err(|_| bad("its header is not text"))?;
    let descr = quoted(field(header, "descr")?)
        .ok_or_else(|| bad("its elements are records; only plain numbers are supported"))?;
    if !field(header, "fortran_order")?.starts_with("False") {
        return Err(bad("it is in Fortran order; save numpy.ascontiguousarray(a)"));
    }
    let shape = shape(field(header, "shape")?)?;
    let count = shape
        .iter()
        .try_fold(1usize, |n, &k| n.checked_mul(k))
        .ok_or_else(|| bad("its shape is too large"))?;
    let body = bytes.get(end..).ok_or_else(cut)?;
    let take = |size: usize| -> Result<&[u8], VisionError> {
        let need = count.checked_mul(size).ok_or_else(|| bad("its shape is too large"))?;
        if body.len() > need {
            return Err(bad(format!(
                "it has {} bytes of numbers, but its shape needs {need}",
                body.len()
            )));
        }
        body.get(..need).ok_or_else(cut)
    };
    let data = match descr {
        "<f4" => {
            NpyData::F32(take(4)?.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect())
        }
        "<f8" => {
            NpyData::F64(take(8)?.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect())
        }
        "|u1" | "<u1" | "u1" => NpyData::U8(take(1)?.to_vec()),
        "|b1" | "<b1" | "?" => NpyData::Bool(take(1)?.iter().map(|&b| b != 0).collect()),
        "<f2" => NpyData::F64(
            take(2)?.as_chunks().0.iter().map(|b| half::f16::from_le_bytes(*b).to_f64()).collect(),
        ),
        "|i1" | "<i1" => whole(take(1)?, |b| f64::from(i8::from_le_bytes(b))),
        "<u2" => whole(take(2)?, |b| f64::from(u16::from_le_bytes(b))),
        "<i2" => whole(take(2)?, |b| f64::from(i16::from_le_bytes(b))),
        "<u4" => whole(take(4)?, |b| f64::from(u32::from_le_bytes(b))),
        "<i4" => whole(take(4)?, |b| f64::from(i32::from_le_bytes(b))),
        "<u8" => whole(take(8)?, |b| u64::from_le_bytes(b) as f64),
        "<i8" => whole(take(8)?, |b| i64::from_le_bytes(b) as f64),
        other => {
            return Err(bad(format!(
                "its elements are '{other}'; floats, whole numbers and bool (little-endian) are \
                 supported"
            )));
        }
    };
    Ok(NpyArray { shape, data })
}

/// Reads whole numbers of `N` bytes each.
fn whole<const N: usize>(bytes: &[u8], number: impl Fn([u8; N]) -> f64) -> NpyData {
    NpyData::Whole(bytes.as_chunks().0.iter().map(|b| number(*b)).collect())
}

/// Returns the text after `'name':` in the header, without leading blanks.
fn field<'a>(header: &'a str, name: &str) -> Result<&'a str, VisionError> {
    ['\'', '"']
        .iter()
        .find_map(|q| header.split_once(&format!("{q}{name}{q}")))
        .and_then(|(_, rest)| rest.trim_start().strip_prefix(':'))
        .map(str::trim_start)
        .ok_or_else(|| bad(format!("its header has no '{name}'")))
}

fn quoted(text: &str) -> Option<&str> {
    let quote = text.chars().next().filter(|c| ['\'', '"'].contains(c))?;
    text[1..].split_once(quote).map(|(inside, _)| inside)
}

fn shape(text: &str) -> Result<Vec<usize>, VisionError> {
    let wrong = || bad("its header has no valid shape");
    let inside = text.strip_prefix('(').and_then(|t| t.split_once(')')).ok_or_else(wrong)?.0;
    inside
        .split(',')
        .map(|n| n.trim().trim_end_matches('L'))
        .filter(|n| !n.is_empty())
        .map(|n| n.parse().map_err(|_| wrong()))
        .collect()
}

/// Returns the bytes of a `.npy` file of float32 (version 1.0). The number of `values`
/// must be the product of `shape`; otherwise numpy rejects the file, but this function
/// does not panic.
pub fn f32_array(shape: &[usize], values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    let dims: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let mut header =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}), }}", dims.trim_end());
    // The data start at a multiple of 64 bytes; the header ends with a line break.
    let unpadded = 10 + header.len() + 1;
    header.push_str(&" ".repeat(unpadded.next_multiple_of(64) - unpadded));
    header.push('\n');
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out.extend(values.into_iter().flat_map(f32::to_le_bytes));
    out
}

/// The bytes of a `.npy` file, for tests.
#[cfg(test)]
pub(crate) fn bytes_of(version: u8, descr: &str, order: &str, shape: &str, body: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
    let mut out = b"\x93NUMPY".to_vec();
    out.extend([version, 0]);
    match version {
        1 => out.extend((header.len() as u16).to_le_bytes()),
        _ => out.extend((header.len() as u32).to_le_bytes()),
    }
    out.extend(header.as_bytes());
    out.extend(body);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(bytes: &[u8]) -> String {
        parse(bytes).unwrap_err().to_string()
    }

    #[test]
    fn every_kind_in_both_versions() {
        for version in [1, 2] {
            let f4: Vec<u8> = [1.5f32, f32::INFINITY, -0.0, 7.0, 8.0, 9.0]
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect();
            let a = parse(&bytes_of(version, "<f4", "False", "(2, 3)", &f4)).unwrap();
            assert_eq!(a.shape, [2, 3]);
            assert_eq!(a.picture_size().unwrap(), (3, 2));
            assert_eq!(a.into_f32(), [1.5, f32::INFINITY, -0.0, 7.0, 8.0, 9.0]);
            let f8: Vec<u8> = [0.1f64, -3.0].iter().flat_map(|v| v.to_le_bytes()).collect();
            let a = parse(&bytes_of(version, "<f8", "False", "(2,)", &f8)).unwrap();
            assert_eq!(a.data, NpyData::F64(vec![0.1, -3.0]));
            let a = parse(&bytes_of(version, "|u1", "False", "(1, 1, 2)", &[3, 255])).unwrap();
            assert_eq!(
                (a.shape.as_slice(), &a.data),
                ([1, 1, 2].as_slice(), &NpyData::U8(vec![3, 255]))
            );
            let a = parse(&bytes_of(version, "|b1", "False", "()", &[1])).unwrap();
            assert_eq!((a.shape.len(), a.into_f32()), (0, vec![1.0]));
        }
    }

    #[test]
    fn pictures_have_two_axes_and_at_least_one_pixel() {
        let size = |shape: &[usize]| {
            NpyArray { shape: shape.to_vec(), data: NpyData::U8(Vec::new()) }.picture_size()
        };
        assert_eq!(size(&[1, 1]).unwrap(), (1, 1));
        assert_eq!(size(&[2, 3, 1]).unwrap(), (3, 2));
        for shape in [&[0, 3][..], &[3, 0], &[0, 0], &[3, 0, 1], &[2, 3, 2], &[2], &[]] {
            assert!(size(shape).unwrap_err().to_string().contains("two axes"), "{shape:?}");
        }
    }

    #[test]
    fn the_report_writer_is_read_back() {
        let bytes = f32_array(&[2, 2], [1.0, 2.0, 3.0, 4.0]);
        let a = parse(&bytes).unwrap();
        assert_eq!((a.shape.clone(), a.into_f32()), (vec![2, 2], vec![1.0, 2.0, 3.0, 4.0]));
    }

    #[test]
    fn errors_say_what_is_wrong() {
        let good = bytes_of(1, "<f4", "False", "(2,)", &[0; 8]);
        assert!(parse(&good).is_ok());
        for n in 0..good.len() {
            assert!(parse(&good[..n]).is_err(), "{n}");
        }
        assert!(message(&good[..good.len() - 1]).contains("truncated"));
        assert!(message(&[&good[..], &[0]].concat()).contains("9 bytes"));
        assert!(message(b"hello, world").contains("does not start"));
        assert!(message(b"PK\x03\x04....").contains(".npz"));
        assert!(message(&bytes_of(1, ">f4", "False", "(2,)", &[0; 8])).contains(">f4"));
        assert!(message(&bytes_of(1, "<f4", "True", "(2,)", &[0; 8])).contains("Fortran"));
        assert!(message(&bytes_of(1, "<f4", "False", "(2", &[0; 8])).contains("shape"));
        assert!(message(&bytes_of(1, "<f4", "False", "(-2,)", &[0; 8])).contains("shape"));
        assert!(
            message(&bytes_of(2, "<f8", "False", "(99999999999, 99999999999)", &[0; 8]))
                .contains("too large")
        );
        assert!(message(&bytes_of(9, "<f4", "False", "(2,)", &[0; 8])).contains("version 9"));
        let flat = parse(&good).unwrap();
        assert!(flat.picture_size().unwrap_err().to_string().contains("two axes"));
    }

    #[test]
    fn the_bytes_numpy_writes() {
        let bytes = f32_array(&[2, 3], [1.0, f32::INFINITY, -2.5, 0.0, 1e-3, 7.0]);
        // The output of numpy.save for the same array, except for the position of the
        // padding.
        assert_eq!(&bytes[..10], b"\x93NUMPY\x01\x00\x76\x00");
        let header = std::str::from_utf8(&bytes[10..128]).unwrap();
        assert_eq!(
            header.trim_end(),
            "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3,), }"
        );
        assert!(header.ends_with(" \n"));
        assert_eq!(bytes.len(), 128 + 24);
        assert_eq!(&bytes[132..136], [0, 0, 0x80, 0x7f]);
    }
}
