//! The subset of FlatBuffers that TFLite files need: tables, vectors, numbers. Every
//! offset is checked against the file.

use super::NetworkError;

type Result<T> = core::result::Result<T, NetworkError>;

/// A table in a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Table<'a> {
    file: &'a [u8],
    at: usize,
    /// The position of the vtable, which has the offsets of the fields, and its length.
    vtable: usize,
    vtable_len: usize,
}

fn cut() -> NetworkError {
    NetworkError::Format("an offset points outside the file".into())
}

fn bytes_at<const N: usize>(file: &[u8], at: usize) -> Result<[u8; N]> {
    let end = at.checked_add(N).ok_or_else(cut)?;
    file.get(at..end).and_then(|b| b.try_into().ok()).ok_or_else(cut)
}

fn u16_at(file: &[u8], at: usize) -> Result<usize> {
    Ok(usize::from(u16::from_le_bytes(bytes_at(file, at)?)))
}

fn i32_at(file: &[u8], at: usize) -> Result<i32> {
    Ok(i32::from_le_bytes(bytes_at(file, at)?))
}

/// Follows the offset stored at a position.
fn follow(file: &[u8], at: usize) -> Result<usize> {
    let offset = u32::from_le_bytes(bytes_at(file, at)?) as usize;
    at.checked_add(offset).ok_or_else(cut)
}

impl<'a> Table<'a> {
    /// Returns the root table of a file, which must have this identifier.
    pub fn root(file: &'a [u8], identifier: [u8; 4]) -> Result<Table<'a>> {
        if bytes_at(file, 4).ok() != Some(identifier) {
            let name = String::from_utf8_lossy(&identifier);
            return Err(NetworkError::Format(format!("bytes 5 to 8 are not {name}")));
        }
        Table::new(file, follow(file, 0)?)
    }

    fn new(file: &'a [u8], at: usize) -> Result<Table<'a>> {
        let vtable = (at as i64)
            .checked_sub(i64::from(i32_at(file, at)?))
            .and_then(|v| usize::try_from(v).ok());
        let vtable = vtable.ok_or_else(cut)?;
        Ok(Table { file, at, vtable, vtable_len: u16_at(file, vtable)? })
    }

    /// Returns the position of a field; `None` if it has its default.
    fn field(&self, i: usize) -> Result<Option<usize>> {
        let at = 4 + 2 * i;
        if at + 2 > self.vtable_len {
            return Ok(None);
        }
        let offset = u16_at(self.file, self.vtable + at)?;
        Ok((offset != 0).then(|| self.at + offset))
    }

    pub fn u8(&self, i: usize) -> Result<u8> {
        let at = self.field(i)?;
        at.map_or(Ok(0), |at| self.file.get(at).copied().ok_or_else(cut))
    }

    pub fn i32(&self, i: usize, default: i32) -> Result<i32> {
        self.field(i)?.map_or(Ok(default), |at| i32_at(self.file, at))
    }

    /// Reads a count or index.
    pub fn index(&self, i: usize) -> Result<usize> {
        usize::try_from(self.i32(i, 0)?).map_err(|_| cut())
    }

    pub fn table(&self, i: usize) -> Result<Option<Table<'a>>> {
        self.field(i)?.map(|at| Table::new(self.file, follow(self.file, at)?)).transpose()
    }

    /// Returns the position and bytes of a vector's elements, each of `size` bytes.
    fn vector(&self, i: usize, size: usize) -> Result<(usize, &'a [u8])> {
        let Some(at) = self.field(i)? else { return Ok((0, &[])) };
        let start = follow(self.file, at)?;
        let len = u32::from_le_bytes(bytes_at(self.file, start)?) as usize;
        let end = len.checked_mul(size).and_then(|n| n.checked_add(start + 4)).ok_or_else(cut)?;
        Ok((start + 4, self.file.get(start + 4..end).ok_or_else(cut)?))
    }

    pub fn bytes(&self, i: usize) -> Result<&'a [u8]> {
        Ok(self.vector(i, 1)?.1)
    }

    pub fn u16s(&self, i: usize) -> Result<Vec<u16>> {
        Ok(self.vector(i, 2)?.1.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect())
    }

    pub fn i32s(&self, i: usize) -> Result<Vec<i32>> {
        Ok(self
            .vector(i, 4)?
            .1
            .chunks_exact(4)
            .map(|b| i32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect())
    }

    /// Reads counts or indices.
    pub fn indices(&self, i: usize) -> Result<Vec<usize>> {
        self.i32s(i)?.into_iter().map(|n| usize::try_from(n).map_err(|_| cut())).collect()
    }

    pub fn tables(&self, i: usize) -> Result<Vec<Table<'a>>> {
        let (start, all) = self.vector(i, 4)?;
        (0..all.len() / 4)
            .map(|k| Table::new(self.file, follow(self.file, start + 4 * k)?))
            .collect()
    }
}
