//! Reading NumPy's array files (NEP 1, formats 1.0 and 2.0): little-endian numbers in C order.

use super::VisionError;

/// An array of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Its lengths along each axis.
    pub shape: Vec<usize>,
    /// Its elements, the last axis fastest.
    pub values: Vec<f64>,
}

/// Reads `float32`, `float64`, `uint8`, `uint16`, `int32`, `int64` and `bool` arrays.
///
/// # Errors
/// If it is not such a file, has another type or order, or is cut off.
pub fn read(bytes: &[u8]) -> Result<Array, VisionError> {
    let wrong = |what: &str| VisionError::Array(format!("not a .npy file that can be read: {what}"));
    if bytes.get(..6) != Some(b"\x93NUMPY") {
        return Err(wrong("it does not begin like one"));
    }
    let byte = |i: usize| bytes.get(i).copied().map(usize::from);
    let header = match (byte(6), byte(8), byte(9), byte(10), byte(11)) {
        (Some(1), Some(a), Some(b), ..) => Some((10, a | b << 8)),
        (Some(2 | 3), Some(a), Some(b), Some(c), Some(d)) => Some((12, a | b << 8 | c << 16 | d << 24)),
        _ => None,
    };
    let (start, length) = header.ok_or_else(|| wrong("an unknown version"))?;
    let text = bytes.get(start..start + length).and_then(|t| std::str::from_utf8(t).ok());
    let text = text.ok_or_else(|| wrong("its header is cut off"))?;
    let field = |name: &str| text.split_once(&format!("'{name}':")).map(|(_, rest)| rest.trim_start());
    if field("fortran_order").is_none_or(|v| !v.starts_with("False")) {
        return Err(wrong("only C order is supported"));
    }
    let kind = field("descr").and_then(|v| v.split('\'').nth(1)).ok_or_else(|| wrong("its type is missing"))?;
    let shape: Option<Vec<usize>> = field("shape")
        .and_then(|v| v.strip_prefix('('))
        .and_then(|v| v.split(')').next())
        .map(|v| v.split(',').map(str::trim).filter(|n| !n.is_empty()).map(|n| n.parse().ok()).collect::<Option<_>>())
        .unwrap_or(None);
    let shape = shape.ok_or_else(|| wrong("its shape is missing"))?;
    let count = shape.iter().try_fold(1usize, |n, d| n.checked_mul(*d)).ok_or_else(|| wrong("it is too large"))?;
    let width = match kind {
        "<f4" | "<i4" => 4,
        "<f8" | "<i8" => 8,
        "<u2" => 2,
        "|u1" | "|b1" => 1,
        other => return Err(wrong(&format!("numbers of type {other}"))),
    };
    let data = count.checked_mul(width).and_then(|n| bytes.get(start + length..)?.get(..n));
    let data = data.ok_or_else(|| wrong("its numbers are cut off"))?;
    let number = |c: &[u8]| match (kind, c) {
        ("<f4", [a, b, c, d]) => f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
        ("<i4", [a, b, c, d]) => f64::from(i32::from_le_bytes([*a, *b, *c, *d])),
        ("<f8", c) => f64::from_le_bytes(c.try_into().unwrap_or_default()),
        ("<i8", c) => i64::from_le_bytes(c.try_into().unwrap_or_default()) as f64,
        ("<u2", [a, b]) => f64::from(u16::from_le_bytes([*a, *b])),
        (_, c) => c.first().map_or(0.0, |b| f64::from(*b)),
    };
    Ok(Array { shape, values: data.chunks_exact(width).map(number).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(version: u8, descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY".to_vec();
        bytes.extend([version, 0]);
        match version {
            1 => bytes.extend((header.len() as u16).to_le_bytes()),
            _ => bytes.extend((header.len() as u32).to_le_bytes()),
        }
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn arrays_of_each_type() {
        let floats: Vec<u8> = [1.5f32, -2.0, f32::INFINITY, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let a = read(&file(1, "<f4", "(2, 2)", &floats)).unwrap();
        assert_eq!((a.shape, a.values), (vec![2, 2], vec![1.5, -2.0, f64::INFINITY, 0.0]));
        let doubles: Vec<u8> = [0.1f64].iter().flat_map(|x| x.to_le_bytes()).collect();
        assert_eq!(read(&file(2, "<f8", "(1,)", &doubles)).unwrap().values, [0.1]);
        assert_eq!(read(&file(1, "|b1", "(3,)", &[1, 0, 1])).unwrap().values, [1.0, 0.0, 1.0]);
        assert_eq!(read(&file(1, "<u2", "(1,)", &[1, 2])).unwrap().values, [513.0]);
    }

    #[test]
    fn other_files_are_errors() {
        for (bytes, what) in [
            (b"hello".to_vec(), "begin"),
            (file(1, ">f4", "(1,)", &[0; 4]), "type"),
            (file(1, "<f4", "(2,)", &[0; 4]), "cut off"),
            (file(9, "<f4", "(1,)", &[0; 4]), "version"),
            (file(1, "<f4", "(99999999999, 99999999999)", &[0; 4]), "too large"),
            (file(1, "<f4", "(1,)", &[0; 4])[..20].to_vec(), "cut off"),
        ] {
            let e = read(&bytes).unwrap_err().to_string();
            assert!(e.contains(what), "{e}");
        }
    }
}
