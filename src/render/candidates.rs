//! Which triangles of a mesh may show in a picture, or at its marked pixels, and drawing
//! those.
//!
//! Nothing is decided by branches that could not be foretold: lists are written
//! branch-free, and triangles set up many at a time.

use super::coverage::is_turned;
use super::pixel_bitmap::PixelBitmap;
use super::place::Extent;
use super::project::Vertices;
use super::raster::{Area, Wanted};
use super::simd_raster::{Batch, Kind, LANES};
use super::triangle::{Plane, is_flat, keep_all, put_face};
use crate::geom::{Patches, Topology};
use glam::Vec4;

/// The triangles of meshes that have pixels' centres between their corners, with where.
/// Reused from picture to picture.
#[derive(Default)]
pub(super) struct Candidates {
    faces: Vec<u32>,
    extents: Vec<Extent>,
    count: usize,
    batch: Batch,
}

impl Candidates {
    /// Those of one mesh all of whose vertices are in view, but for backs that need not
    /// be drawn; with bitmap, those that reach some.
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
            if !extent.is_empty() && bitmap.hold(extent.ends()) {
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
            self.put(face, extent, bitmap.hold(extent.ends()));
        }
    }

    /// Adds the candidates among some triangles, of which the first one is face `first`.
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

    /// Each is written down, and written over unless it counts: a branch could not be
    /// foretold.
    #[inline(always)]
    fn put(&mut self, face: u32, extent: Extent, counts: bool) {
        if let (Some(f), Some(e)) =
            (self.faces.get_mut(self.count), self.extents.get_mut(self.count))
        {
            (*f, *e) = (face, extent);
        }
        self.count += usize::from(counts);
    }

    /// Keeps the nearer of a mesh's triangles and what is there, in the rows of an area.
    /// With `FACES`, `seen` gets the face of each pixel where a triangle was nearer, and
    /// everything is wanted.
    #[inline(always)]
    pub fn fill<const FACES: bool>(
        &mut self,
        topology: &Topology,
        vertices: &Vertices<'_>,
        (size, back): (Vec4, f64),
        (area, wanted): (&Area, Wanted<'_>),
        buffer: &mut [f32],
        seen: &mut [u32],
    ) {
        let bitmap = wanted.bitmap();
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
                let (mut plane, mut flat) = (None, None);
                batch.rows(
                    i,
                    extent,
                    area.right,
                    #[inline(always)]
                    |row, from, outside| {
                        let at = (row - area.top) * width + from - area.left;
                        if bitmap.is_some_and(|bitmap| {
                            bitmap.window(at, LANES) as u32 & !outside.to_bitmask() == 0
                        }) {
                            return;
                        }
                        if let Some(least) = wanted.least(at) {
                            // A triangle without area covers nothing, whatever its rounded
                            // corners say.
                            if *flat
                                .get_or_insert_with(|| is_flat(&vertices.corners(topology, face)))
                            {
                                return;
                            }
                            return keep_all(buffer, at, least, outside);
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
