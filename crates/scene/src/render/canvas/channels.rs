//! Parts and normals of a picture: which mesh each pixel shows.
//!
//! Invariant: a pixel shows the nearest mesh, the first one among equally near ones, as in
//! a full drawing, which draws mesh after mesh where each is nearer. Nearness decides, not
//! depth: different numbers of the first may be rounded to the same of the second.

use super::dynamic_mesh::DynamicMesh;
use super::static_channels::{NOBODY, StaticChannels};
use crate::render::Camera;
use crate::render::pixels::area::Area;
use crate::render::pixels::frame::part_number;
use crate::render::pixels::raster::empty;
use crate::render::simd::vectorised;

/// What a picture shows at each pixel.
#[derive(Default)]
pub struct ShownChannels {
    /// As in [`Frame`](crate::render::Frame).
    pub part: Vec<u16>,
    pub normal: Vec<[f32; 3]>,
    /// The pixels that differ from those of the drawing before.
    pub changed: Vec<u32>,
    /// The index of the mesh shown.
    mesh: Vec<u32>,
    /// Scratch memory, by pixel of an area: the greatest nearness, and which of the moving
    /// meshes has it.
    nearness: Vec<f32>,
    by: Vec<u32>,
}

impl ShownChannels {
    /// Nothing is shown.
    pub fn begin(&mut self, camera: &Camera) {
        let pixels = camera.pixels();
        self.mesh.clear();
        self.mesh.resize(pixels, NOBODY);
        self.part.clear();
        self.part.resize(pixels, u16::MAX);
        self.normal.clear();
        self.normal.resize(pixels, [0.0; 3]);
    }

    /// Recomposes an area of the picture. The meshes that moved did so in the drawing
    /// `clock`.
    pub fn compose(
        &mut self,
        (camera, area): (&Camera, &Area),
        still: &StaticChannels,
        dynamic: &[DynamicMesh],
        clock: u64,
    ) {
        let (width, columns) = (camera.width as usize, area.right - area.left);
        let nothing = empty(camera);
        let span = |row: usize| row * width + area.left..row * width + area.right;
        self.nearness.clear();
        for row in area.top..area.bottom {
            self.nearness.extend_from_slice(&still.pixels.nearness[span(row)]);
        }
        self.by.clear();
        self.by.resize(area.pixels(), NOBODY);
        for (number, mesh) in (0..).zip(dynamic) {
            let (layer, index) = (&mesh.now.layer, mesh.index as u32);
            let common = layer.area.common(area);
            if common.pixels() == 0 {
                continue;
            }
            let own_columns = layer.area.right - layer.area.left;
            vectorised(
                #[inline(always)]
                || {
                    for row in common.top..common.bottom {
                        let count = common.right - common.left;
                        let from =
                            (row - layer.area.top) * own_columns + common.left - layer.area.left;
                        let to = (row - area.top) * columns + common.left - area.left;
                        let there = row * width + common.left;
                        let own = &layer.channels.nearness[from..from + count];
                        let nearness = &mut self.nearness[to..to + count];
                        let by = &mut self.by[to..to + count];
                        let still = &still.mesh[there..there + count];
                        for (((q, by), own), still) in
                            nearness.iter_mut().zip(by).zip(own).zip(still)
                        {
                            // The moving meshes come in order, so only one of the others
                            // can be equally near and come after this one.
                            let before = (*own == *q)
                                & (*own > nothing)
                                & (*by == NOBODY)
                                & (index < *still);
                            let nearer = (*own > *q) | before;
                            *q = if nearer { *own } else { *q };
                            *by = if nearer { number } else { *by };
                        }
                    }
                },
            );
        }
        for (row, by) in (area.top..area.bottom).zip(self.by.chunks_exact(columns)) {
            for (at, by) in span(row).zip(by) {
                let (index, part, normal) = match dynamic.get(*by as usize) {
                    None => {
                        let index = still.mesh[at];
                        if index == self.mesh[at] {
                            continue;
                        }
                        (index, still.pixels.part[at], still.pixels.normal[at])
                    }
                    Some(mesh) => {
                        let index = mesh.index as u32;
                        if index == self.mesh[at] && mesh.moved != clock {
                            continue;
                        }
                        let layer = &mesh.now.layer;
                        let own_columns = layer.area.right - layer.area.left;
                        let i = (row - layer.area.top) * own_columns + at % width - layer.area.left;
                        let own = layer.channels.part[i];
                        (index, part_number(own, mesh.first_part), layer.channels.normal[i])
                    }
                };
                self.mesh[at] = index;
                let bits = |normal: [f32; 3]| normal.map(f32::to_bits);
                if part != self.part[at] || bits(normal) != bits(self.normal[at]) {
                    (self.part[at], self.normal[at]) = (part, normal);
                    self.changed.push(at as u32);
                }
            }
        }
    }
}
