//! Finding the triangles of a mesh that may show in a picture, or at its marked pixels,
//! and drawing them.
//!
//! Unpredictable branches are avoided: lists are written branch-free, and triangles are
//! set up many at a time.

use crate::geom::{Patches, Topology};
use crate::render::pixels::area::Area;
use crate::render::pixels::coverage::is_turned;
use crate::render::pixels::pixel_bitmap::PixelBitmap;
use crate::render::pixels::place::Extent;
use crate::render::pixels::project::Vertices;
use crate::render::pixels::simd_raster::{Batch, Kind, LANES};
use crate::render::pixels::triangle::{Plane, put_face};
use glam::Vec4;

/// The triangles of a mesh whose bounding boxes contain pixel centres, with these boxes.
/// Reused from picture to picture.
#[derive(Default)]
pub(in crate::render) struct Candidates {
    faces: Vec<u32>,
    extents: Vec<Extent>,
    count: usize,
    batch: Batch,
}

impl Candidates {
    /// Finds the candidates of a mesh whose vertices are all beyond the near plane,
    /// without back faces that need not be drawn; with a set of marked pixels, only those
    /// whose bounding boxes contain some.
    #[inline(always)]
    fn find(
        &mut self,
        topology: &Topology,
        vertices: &Vertices<'_>,
        size: Vec4,
        back: f64,
        bitmap: Option<&PixelBitmap>,
    ) {
        let triangles = &topology.triangles;
        if self.faces.len() < triangles.len() {
            self.faces.resize(triangles.len(), 0);
            self.extents.resize(triangles.len(), Extent::default());
        }
        self.count = 0;
        let Some(bitmap) = bitmap else {
            return self.add(0, triangles, vertices, size, back, |_| true);
        };
        for (i, (patch, triangles)) in
            topology.patches.of(triangles).zip(triangles.chunks(Patches::FACES)).enumerate()
        {
            let extent = Extent::between(vertices.least(patch), size);
            if !extent.is_empty() && bitmap.intersects(extent.ends()) {
                self.add(i * Patches::FACES, triangles, vertices, size, back, |ends| {
                    bitmap.may_hold(ends)
                });
            }
        }
        let found = std::mem::take(&mut self.count);
        for i in 0..found {
            let (Some(&face), Some(&extent)) = (self.faces.get(i), self.extents.get(i)) else {
                continue;
            };
            self.put(face, extent, bitmap.intersects(extent.ends()));
        }
    }

    /// Adds the candidates among some triangles, the first of which is face `first`.
    #[inline(always)]
    fn add(
        &mut self,
        first: usize,
        triangles: &[[u32; 3]],
        vertices: &Vertices<'_>,
        size: Vec4,
        back: f64,
        wanted: impl Fn([[usize; 2]; 2]) -> bool,
    ) {
        for (i, corners) in triangles.iter().enumerate() {
            let Some(places) = vertices.places(corners) else { continue };
            let extent = Extent::around(places, size);
            let turned = back != 0.0 && is_turned(places, back);
            self.put(
                (first + i) as u32,
                extent,
                !extent.is_empty() & !turned & wanted(extent.ends()),
            );
        }
    }

    /// Writes an entry that the next one overwrites unless it counts: a branch would be
    /// unpredictable.
    #[inline(always)]
    fn put(&mut self, face: u32, extent: Extent, counts: bool) {
        if let (Some(f), Some(e)) =
            (self.faces.get_mut(self.count), self.extents.get_mut(self.count))
        {
            (*f, *e) = (face, extent);
        }
        self.count += usize::from(counts);
    }

    /// Merges a mesh's triangles into the rows of an area, keeping the nearer value. With
    /// `FACES`, all pixels must be wanted, and `seen` gets the face at each pixel where a
    /// triangle is nearer.
    #[inline(always)]
    pub fn fill<const FACES: bool>(
        &mut self,
        topology: &Topology,
        vertices: &Vertices<'_>,
        (size, back): (Vec4, f64),
        (area, bitmap): (&Area, Option<&PixelBitmap>),
        buffer: &mut [f32],
        seen: &mut [u32],
    ) {
        self.find(topology, vertices, size, back, bitmap);
        let width = area.right - area.left;
        let large = |face: u32, extent: Extent, buffer: &mut [f32], seen: &mut [u32]| match vertices
            .triangle(topology, face, extent, back)
        {
            Some(triangle) if FACES => triangle.fill_faces(buffer, (seen, face), area),
            Some(triangle) => triangle.keep(buffer, area, bitmap),
            None => {}
        };
        let Candidates { faces, extents, count, batch } = self;
        let list = faces[..*count].iter().copied().zip(extents[..*count].iter().copied());
        if width < LANES {
            return list.for_each(|(face, extent)| large(face, extent, buffer, seen));
        }
        let places = |face: u32| vertices.places(topology.triangles.get(face as usize)?);
        let back = back as i32;
        batch.each(
            list,
            places,
            area.right,
            back,
            #[inline(always)]
            |batch, i, face, extent, kind| {
                if kind == Kind::Large {
                    return large(face, *extent, buffer, seen);
                }
                let mut plane = None;
                batch.rows(
                    i,
                    extent,
                    area.right,
                    #[inline(always)]
                    |row, from, outside| {
                        let at = (row - area.top) * width + from - area.left;
                        let wanted = bitmap.map_or(u32::MAX, |b| b.window(at, LANES) as u32);
                        // Many small triangles lie between the centres of pixels.
                        if wanted & !outside.to_bitmask() & ((1 << LANES) - 1) == 0 {
                            return;
                        }
                        let corners =
                            || Plane::new(&vertices.corners(topology, face), extent.ends()[0][0]);
                        if let Some(plane) = plane.get_or_insert_with(corners) {
                            let nearer = plane.keep(buffer, at, row, from, outside);
                            if FACES {
                                put_face(seen, at, face, nearer);
                            }
                        }
                    },
                );
            },
        );
    }
}
