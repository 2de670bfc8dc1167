//! Arrays of numbers in numpy's `.npy` format, version 1.0: little-endian float32, C
//! order (numpy.lib.format).

/// Returns the bytes of a `.npy` file. The number of `values` must be the product of
/// `shape`; otherwise numpy rejects the file, but this function does not panic.
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

#[cfg(test)]
mod tests {
    use super::*;

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
