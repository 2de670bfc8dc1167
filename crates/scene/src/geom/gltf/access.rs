//! Accessors: typed views into buffers. Invariant: [`Elements`] lie entirely within their
//! buffer.

use super::container::{self, Read};
use super::json::Document;
use crate::geom::GeomError;
use crate::geom::mesh::MOST_TRIANGLES;
use std::borrow::Cow;

/// Component types, by glTF's codes.
pub(super) const I8: u32 = 5120;
pub(super) const U8: u32 = 5121;
pub(super) const I16: u32 = 5122;
pub(super) const U16: u32 = 5123;
pub(super) const U32: u32 = 5125;
pub(super) const F32: u32 = 5126;

/// The maximum number of elements of an accessor.
pub(super) const MOST_ELEMENTS: usize = 3 * MOST_TRIANGLES;

/// A document with its buffers.
pub(super) struct Data<'a> {
    pub document: &'a Document,
    buffers: Vec<Cow<'a, [u8]>>,
}

/// The elements of an accessor.
pub(super) struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    component: u32,
    size: usize,
    normalized: bool,
    /// The number of elements.
    pub count: usize,
}

impl<'a> Data<'a> {
    pub fn new(
        document: &'a Document,
        bin: Option<&'a [u8]>,
        read: &Read,
    ) -> Result<Data<'a>, GeomError> {
        Ok(Data { document, buffers: container::buffers(document, bin, read)? })
    }

    /// Returns the elements of an accessor, which must have this shape (`SCALAR`, `VEC3`,
    /// …) and one of these component types.
    pub fn elements(
        &self,
        index: usize,
        shape: &str,
        components: &[u32],
    ) -> Result<Elements<'_>, GeomError> {
        let wrong =
            |what: String| GeomError::invalid(format!("accessor {index} of the glTF file {what}"));
        let a = self.document.accessors.get(index).ok_or_else(|| wrong("does not exist".into()))?;
        if a.sparse.is_some() {
            return Err(wrong(
                "is sparse, which is not supported; export without sparse accessors".into(),
            ));
        }
        if a.shape != shape {
            return Err(wrong(format!("must be of type {shape}, not {}", a.shape)));
        }
        if !components.contains(&a.component_type) {
            return Err(wrong(format!(
                "has components of type {}, expected one of {components:?}",
                a.component_type
            )));
        }
        if a.count > MOST_ELEMENTS {
            return Err(wrong(format!("has {} elements; at most {MOST_ELEMENTS}", a.count)));
        }
        let width = match shape {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let size = match a.component_type {
            I8 | U8 => 1,
            I16 | U16 => 2,
            _ => 4,
        };
        let view = a.buffer_view.ok_or_else(|| wrong("has no bytes (no bufferView)".into()))?;
        let view = self
            .document
            .buffer_views
            .get(view)
            .ok_or_else(|| wrong(format!("uses a missing view {view}")))?;
        let buffer = self
            .buffers
            .get(view.buffer)
            .ok_or_else(|| wrong("uses a buffer that does not exist".into()))?;
        let stride = view.byte_stride.filter(|s| *s > 0).unwrap_or(width * size);
        let bytes = || {
            let view =
                buffer.get(view.byte_offset..view.byte_offset.checked_add(view.byte_length)?)?;
            let length = match a.count.checked_sub(1) {
                None => 0,
                Some(before) => before.checked_mul(stride)?.checked_add(width * size)?,
            };
            view.get(a.byte_offset..a.byte_offset.checked_add(length)?)
        };
        let bytes = bytes().ok_or_else(|| wrong("extends beyond its buffer".into()))?;
        let (component, normalized) = (a.component_type, a.normalized);
        Ok(Elements { bytes, stride, component, size, normalized, count: a.count })
    }
}

impl Elements<'_> {
    /// Returns component `k` of element `i`, scaled to [-1, 1] if the accessor is
    /// normalised.
    pub fn get(&self, i: usize, k: usize) -> f64 {
        let at = i * self.stride + k * self.size;
        let byte = |k: usize| self.bytes.get(at + k).copied().unwrap_or_default();
        let two = || [byte(0), byte(1)];
        let four = || [byte(0), byte(1), byte(2), byte(3)];
        let (x, most) = match self.component {
            I8 => (f64::from(byte(0) as i8), f64::from(i8::MAX)),
            U8 => (f64::from(byte(0)), f64::from(u8::MAX)),
            I16 => (f64::from(i16::from_le_bytes(two())), f64::from(i16::MAX)),
            U16 => (f64::from(u16::from_le_bytes(two())), f64::from(u16::MAX)),
            U32 => return f64::from(u32::from_le_bytes(four())),
            _ => return f64::from(f32::from_le_bytes(four())),
        };
        if self.normalized { (x / most).max(-1.0) } else { x }
    }

    /// Returns component `k` of element `i` as an unsigned integer, without
    /// normalisation.
    pub fn whole(&self, i: usize, k: usize) -> usize {
        let plain = Elements { normalized: false, ..*self };
        plain.get(i, k) as usize
    }
}
