//! Accessors: typed views into buffers. Invariant: [`Elements`] lie entirely within their
//! buffer.

use super::container::{self, Read};
use super::json::{Accessor, Document, Sparse};
use super::meshopt;
use crate::geom::GeomError;
use crate::geom::mesh::MOST_TRIANGLES;
use std::borrow::Cow;
use std::cell::{Cell, OnceCell};

/// Component types, by glTF's codes.
pub(super) const I8: u32 = 5120;
pub(super) const U8: u32 = 5121;
pub(super) const I16: u32 = 5122;
pub(super) const U16: u32 = 5123;
pub(super) const U32: u32 = 5125;
pub(super) const F32: u32 = 5126;

/// The maximum number of elements of an accessor.
pub(super) const MOST_ELEMENTS: usize = 3 * MOST_TRIANGLES;
/// The maximum number of bytes of all decompressed views, and of a mesh compressed with Draco.
pub(super) const MOST_DECOMPRESSED: usize = 512 << 20;

/// A document with its buffers.
pub(super) struct Data<'a> {
    pub document: &'a Document,
    buffers: Vec<Cow<'a, [u8]>>,
    /// The compressed views that were needed so far, or what is wrong with them.
    views: Vec<OnceCell<Result<Vec<u8>, String>>>,
    decompressed: Cell<usize>,
}

/// The elements of an accessor.
pub(super) struct Elements<'a> {
    bytes: Cow<'a, [u8]>,
    stride: usize,
    component: u32,
    size: usize,
    normalized: bool,
    /// The number of elements.
    pub count: usize,
    /// The elements that are elsewhere: their indices, in increasing order, and values.
    replaced: Option<Box<[Elements<'a>; 2]>>,
}

fn size_of(component: u32) -> usize {
    match component {
        I8 | U8 => 1,
        I16 | U16 => 2,
        _ => 4,
    }
}

/// The number that a normalised component of this type is divided by; 1 of others.
pub(super) fn most_of(component: u32) -> f64 {
    match component {
        I8 => f64::from(i8::MAX),
        U8 => f64::from(u8::MAX),
        I16 => f64::from(i16::MAX),
        U16 => f64::from(u16::MAX),
        _ => 1.0,
    }
}

fn wrong(index: usize, what: impl Into<String>) -> GeomError {
    GeomError::invalid(format!("accessor {index} of the glTF file {}", what.into()))
}

impl<'a> Data<'a> {
    pub fn new(
        document: &'a Document,
        bin: Option<&'a [u8]>,
        read: &Read,
    ) -> Result<Data<'a>, GeomError> {
        let buffers = container::buffers(document, bin, read)?;
        let views = document.buffer_views.iter().map(|_| OnceCell::new()).collect();
        Ok(Data { document, buffers, views, decompressed: Cell::new(0) })
    }

    fn accessor(&self, index: usize) -> Result<&'a Accessor, GeomError> {
        self.document.accessors.get(index).ok_or_else(|| wrong(index, "does not exist"))
    }

    /// True if an accessor's components are normalised, and their type.
    pub fn normalized(&self, index: usize) -> Result<Option<u32>, GeomError> {
        let a = self.accessor(index)?;
        Ok(a.normalized.then_some(a.component_type))
    }

    /// Returns the elements of an accessor, which must have this shape (`SCALAR`, `VEC3`,
    /// …) and one of these component types.
    pub fn elements(
        &self,
        index: usize,
        shape: &str,
        components: &[u32],
    ) -> Result<Elements<'_>, GeomError> {
        let e = self.elements_or_zeros(index, shape, components)?;
        let a = self.accessor(index)?;
        if a.buffer_view.is_none() {
            // Zeros take no room in the file, so the file's size must bound their number.
            let bytes: usize = self.buffers.iter().map(|b| b.len()).sum();
            if a.sparse.is_none() {
                return Err(wrong(index, "has no bytes (no bufferView)"));
            } else if e.count > bytes {
                return Err(wrong(index, format!("has {} elements, but no bufferView", e.count)));
            }
        }
        Ok(e)
    }

    /// As [`Data::elements`]; those of an accessor without a view are zeros.
    pub fn elements_or_zeros(
        &self,
        index: usize,
        shape: &str,
        components: &[u32],
    ) -> Result<Elements<'_>, GeomError> {
        let wrong = |what: String| wrong(index, what);
        let a = self.accessor(index)?;
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
        let mut all = match a.buffer_view {
            Some(view) => {
                self.within(view, a.byte_offset, a.component_type, width, a.count).map_err(wrong)?
            }
            None => Elements {
                bytes: Cow::Borrowed(&[]),
                stride: 0,
                component: a.component_type,
                size: 0,
                normalized: false,
                count: a.count,
                replaced: None,
            },
        };
        all.normalized = a.normalized;
        if let Some(s) = &a.sparse {
            all.replaced = Some(self.replaced(s, a, width).map_err(wrong)?);
        }
        Ok(all)
    }

    fn replaced(
        &self,
        s: &Sparse,
        a: &Accessor,
        width: usize,
    ) -> Result<Box<[Elements<'_>; 2]>, String> {
        let component = s.indices.component_type.unwrap_or_default();
        if ![U8, U16, U32].contains(&component) {
            return Err(format!("has sparse indices of type {component}"));
        }
        let at = &s.indices;
        let indices = self.within(at.buffer_view, at.byte_offset, component, 1, s.count)?;
        let mut before = None;
        for i in 0..s.count {
            let index = indices.whole(i, 0);
            if index >= a.count || before.is_some_and(|b| b >= index) {
                return Err(format!("has the sparse index {index} out of order or range"));
            }
            before = Some(index);
        }
        let at = &s.values;
        let values =
            self.within(at.buffer_view, at.byte_offset, a.component_type, width, s.count)?;
        Ok(Box::new([indices, Elements { normalized: a.normalized, ..values }]))
    }

    /// Returns elements of `width` components that lie in a view.
    fn within(
        &self,
        view: usize,
        offset: usize,
        component: u32,
        width: usize,
        count: usize,
    ) -> Result<Elements<'_>, String> {
        let v =
            self.document.buffer_views.get(view).ok_or(format!("uses a missing view {view}"))?;
        let size = size_of(component);
        let stride = v.byte_stride.filter(|s| *s > 0).unwrap_or(width * size);
        let all = self.view(view)?;
        let bytes = || {
            let length = match count.checked_sub(1) {
                None => 0,
                Some(before) => before.checked_mul(stride)?.checked_add(width * size)?,
            };
            all.get(offset..offset.checked_add(length)?)
        };
        let bytes = Cow::Borrowed(bytes().ok_or("extends beyond its buffer")?);
        Ok(Elements { bytes, stride, component, size, normalized: false, count, replaced: None })
    }

    /// Returns the bytes of a view, decompressed.
    pub fn view(&self, view: usize) -> Result<&[u8], String> {
        let v =
            self.document.buffer_views.get(view).ok_or(format!("uses a missing view {view}"))?;
        let part = |buffer: usize, offset: usize, length: usize| {
            let buffer = self.buffers.get(buffer).ok_or("uses a buffer that does not exist")?;
            let part = offset.checked_add(length).and_then(|end| buffer.get(offset..end));
            part.ok_or_else(|| "extends beyond its buffer".to_owned())
        };
        let Some(m) = &v.extensions.meshopt else {
            return part(v.buffer, v.byte_offset, v.byte_length);
        };
        let decompress = || {
            let (bytes, most) = (
                part(m.buffer, m.byte_offset, m.byte_length)?,
                MOST_DECOMPRESSED - self.decompressed.get(),
            );
            let out = meshopt::decompress(m, bytes, most)?;
            self.decompressed.set(self.decompressed.get() + out.len());
            Ok(out)
        };
        let cell = self.views.get(view).ok_or("uses a missing view")?;
        let bytes = cell.get_or_init(decompress).as_deref();
        bytes.map_err(|e| format!("lies in a compressed view that cannot be read: {e}"))
    }
}

impl Elements<'_> {
    /// Creates elements of `width` floats each.
    pub fn of_floats(values: &[f32], width: usize) -> Elements<'static> {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        Elements {
            bytes: Cow::Owned(bytes),
            stride: 4 * width,
            component: F32,
            size: 4,
            normalized: false,
            count: values.len() / width,
            replaced: None,
        }
    }

    /// Returns component `k` of element `i`, scaled to [-1, 1] if the accessor is
    /// normalised.
    pub fn get(&self, i: usize, k: usize) -> f64 {
        let x = self.plain(i, k);
        if self.normalized && self.component != F32 && self.component != U32 {
            (x / most_of(self.component)).max(-1.0)
        } else {
            x
        }
    }

    /// Returns component `k` of element `i` as an unsigned integer, without
    /// normalisation.
    pub fn whole(&self, i: usize, k: usize) -> usize {
        self.plain(i, k) as usize
    }

    /// The elements that may differ from 0: of a sparse accessor without a view, only some.
    pub fn written(&self) -> Box<dyn Iterator<Item = usize> + '_> {
        match &self.replaced {
            Some(r) if self.size == 0 => Box::new((0..r[0].count).map(|i| r[0].whole(i, 0))),
            None if self.size == 0 => Box::new(std::iter::empty()),
            _ => Box::new(0..self.count),
        }
    }

    fn plain(&self, i: usize, k: usize) -> f64 {
        if let Some(replaced) = &self.replaced {
            let [indices, values] = &**replaced;
            let (mut low, mut high) = (0, indices.count);
            while low < high {
                let middle = usize::midpoint(low, high);
                match indices.whole(middle, 0).cmp(&i) {
                    std::cmp::Ordering::Equal => return values.plain(middle, k),
                    std::cmp::Ordering::Less => low = middle + 1,
                    std::cmp::Ordering::Greater => high = middle,
                }
            }
        }
        let at = i * self.stride + k * self.size;
        let byte = |k: usize| self.bytes.get(at + k).copied().unwrap_or_default();
        let two = || [byte(0), byte(1)];
        let four = || [byte(0), byte(1), byte(2), byte(3)];
        match self.component {
            I8 => f64::from(byte(0) as i8),
            U8 => f64::from(byte(0)),
            I16 => f64::from(i16::from_le_bytes(two())),
            U16 => f64::from(u16::from_le_bytes(two())),
            U32 => f64::from(u32::from_le_bytes(four())),
            _ => f64::from(f32::from_le_bytes(four())),
        }
    }
}
