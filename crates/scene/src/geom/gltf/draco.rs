//! Primitives that are compressed with Draco (`KHR_draco_mesh_compression`), and those that
//! are not, alike.

use super::access::{Data, Elements, F32, MOST_DECOMPRESSED, most_of};
use super::json::{Draco, Primitive};
use crate::geom::GeomError;
use crate::geom::mesh::MOST_TRIANGLES;
use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};

/// The attributes and corners of a primitive.
pub(super) struct Contents<'a> {
    data: &'a Data<'a>,
    primitive: &'a Primitive,
    compressed: Option<(&'a Draco, Mesh)>,
}

impl<'a> Contents<'a> {
    pub fn of(data: &'a Data, primitive: &'a Primitive, what: &str) -> Result<Self, GeomError> {
        let decode = |d: &'a Draco| -> Result<(&'a Draco, Mesh), String> {
            let bytes = data.view(d.buffer_view)?;
            let limits = DecodeLimits::default()
                .with_max_faces(MOST_TRIANGLES as u64)
                .with_max_decoded_bytes(MOST_DECOMPRESSED as u64);
            let mut source = DecoderBuffer::new(bytes).with_limits(limits);
            let mut mesh = Mesh::new();
            MeshDecoder::new().decode(&mut source, &mut mesh).map_err(|e| e.to_string())?;
            Ok((d, mesh))
        };
        let compressed = primitive.extensions.draco.as_ref().map(decode).transpose();
        let compressed = compressed.map_err(|e| {
            GeomError::invalid(format!("{what} is compressed with Draco and cannot be read: {e}"))
        })?;
        Ok(Contents { data, primitive, compressed })
    }

    /// Returns an attribute; `None` if there is none of this name.
    pub fn attribute(
        &self,
        name: &str,
        shape: &str,
        components: &[u32],
    ) -> Result<Option<Elements<'_>>, GeomError> {
        let Some(index) = self.primitive.attributes.get(name).copied() else { return Ok(None) };
        let found = self.compressed.as_ref().and_then(|(d, mesh)| {
            Some((mesh.attribute_by_unique_id(*d.attributes.get(name)?)?, mesh.num_points()))
        });
        let Some((found, points)) = found else {
            return self.data.elements(index, shape, components).map(Some);
        };
        let width = if shape == "VEC3" { 3 } else { 4 };
        let mut values = found.read_f32s(points, width);
        let normalized = self.data.normalized(index)?;
        if let Some(component) = normalized.filter(|c| *c != F32) {
            let most = most_of(component) as f32;
            values.iter_mut().for_each(|x| *x = (*x / most).max(-1.0));
        }
        Ok(Some(Elements::of_floats(&values, width)))
    }

    /// Returns the corners of a compressed primitive.
    pub fn corners(&self) -> Option<Vec<u32>> {
        let (_, mesh) = self.compressed.as_ref()?;
        Some(mesh.faces().iter().flatten().map(|p| p.0).collect())
    }
}
