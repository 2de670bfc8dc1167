//! The one piece of metadata in a picture that helps to place the camera: the 35 mm
//! equivalent focal length (Exif 2.3, tag 0xA405). This is not a general Exif reader.
//! Damaged metadata count as missing: they never make a picture unreadable.

/// TIFF bytes with a byte order.
struct Tiff<'a> {
    bytes: &'a [u8],
    big: bool,
}

impl Tiff<'_> {
    fn u16(&self, at: usize) -> Option<u16> {
        let b: [u8; 2] = self.bytes.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if self.big { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) })
    }

    fn u32(&self, at: usize) -> Option<u32> {
        let b: [u8; 4] = self.bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if self.big { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) })
    }

    /// Returns the value of a one-number entry (SHORT or LONG) of the directory at `at`.
    fn entry(&self, at: usize, tag: u16) -> Option<u32> {
        let count = usize::from(self.u16(at)?);
        let found = (0..count).map(|i| at + 2 + 12 * i).find(|&e| self.u16(e) == Some(tag))?;
        match self.u16(found + 2)? {
            3 => self.u16(found + 8).map(u32::from),
            4 => self.u32(found + 8),
            _ => None,
        }
    }
}

/// Returns the 35 mm equivalent focal length in mm of an Exif chunk (a TIFF structure),
/// if present.
pub fn focal_35mm(chunk: &[u8]) -> Option<f64> {
    let chunk = chunk.strip_prefix(b"Exif\0\0").unwrap_or(chunk);
    let big = match chunk.get(..4)? {
        b"MM\0\x2a" => true,
        b"II\x2a\0" => false,
        _ => return None,
    };
    let tiff = Tiff { bytes: chunk, big };
    let exif = tiff.entry(tiff.u32(4)? as usize, 0x8769)?;
    match tiff.entry(exif as usize, 0xA405)? {
        0 => None,
        mm => Some(f64::from(mm)),
    }
}

/// A little-endian Exif chunk with an orientation and a focal length, for tests.
#[cfg(test)]
pub(crate) fn chunk(orientation: u16, focal: u16) -> Vec<u8> {
    let mut out = b"II\x2a\0\x08\0\0\0".to_vec();
    let entry = |out: &mut Vec<u8>, tag: u16, kind: u16, value: u32| {
        out.extend(tag.to_le_bytes());
        out.extend(kind.to_le_bytes());
        out.extend(1u32.to_le_bytes());
        out.extend(value.to_le_bytes());
    };
    out.extend(2u16.to_le_bytes());
    entry(&mut out, 0x0112, 3, u32::from(orientation));
    entry(&mut out, 0x8769, 4, 38);
    out.extend([0; 4]);
    out.extend(1u16.to_le_bytes());
    entry(&mut out, 0xA405, 3, u32::from(focal));
    out.extend([0; 4]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn focal_length_is_found() {
        assert_eq!(focal_35mm(&chunk(1, 28)), Some(28.0));
        assert_eq!(focal_35mm(&[b"Exif\0\0".as_slice(), &chunk(1, 50)].concat()), Some(50.0));
        assert_eq!(focal_35mm(&chunk(1, 0)), None);
    }

    #[test]
    fn damaged_chunks_are_none() {
        let good = chunk(6, 35);
        for n in 0..good.len() - 4 {
            // The last four bytes (next directory) are not needed; the value ends right
            // before them.
            let cut = focal_35mm(&good[..n]);
            assert!(cut.is_none() || n >= good.len() - 6, "{n}");
        }
        let mut wild = good;
        wild[4..8].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(focal_35mm(&wild), None);
    }
}
