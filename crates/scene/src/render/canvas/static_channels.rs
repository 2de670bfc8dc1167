//! What the stationary meshes of a picture show: parts, normals, and which mesh.

use super::layer::Layer;
use super::meshes::Member;
use crate::render::Camera;
use crate::render::pixels::area::Area;
use crate::render::pixels::frame::{ChannelPixels, part_number};

/// No mesh, and no moving mesh.
pub const NOBODY: u32 = u32::MAX;

/// What the stationary meshes show at each pixel.
#[derive(Default)]
pub struct StaticChannels {
    pub pixels: ChannelPixels,
    /// The index of the mesh shown.
    pub mesh: Vec<u32>,
}

impl StaticChannels {
    /// Nothing is shown.
    pub fn clear(&mut self, camera: &Camera) {
        self.pixels.clear(camera, &Area::whole(camera));
        self.mesh.clear();
        self.mesh.resize(camera.pixels(), NOBODY);
    }

    /// Adds a mesh after all those before it in the solid.
    pub fn put(&mut self, member: &Member<'_>, layer: &Layer, width: usize) {
        let StaticChannels { pixels: ChannelPixels { nearness, part, normal }, mesh } = self;
        let (area, own) = (&layer.area, &layer.channels);
        let positions = (area.top..area.bottom)
            .flat_map(|row| row * width + area.left..row * width + area.right);
        for (at, i) in positions.zip(0..own.nearness.len()) {
            if own.nearness[i] > nearness[at] {
                (nearness[at], mesh[at]) = (own.nearness[i], member.index as u32);
                (part[at], normal[at]) =
                    (part_number(own.part[i], member.first_part), own.normal[i]);
            }
        }
    }
}
