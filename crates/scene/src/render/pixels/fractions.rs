//! The fraction of every pixel that a solid covers.
//!
//! Pixels are sampled in rows of [`COLUMNS`]. From the left end of a row, the sides of faces that
//! are crossed tell how many faces there are at each sample: a side that enters its face adds
//! one, a side that leaves it takes one away. A side between two faces that are both drawn does
//! neither, so only the sides where drawn faces end are followed. Faces that share a side find
//! the same place for it in each row, so no sample is lost between them. What hides what does
//! not matter.

use crate::geom::{Affine, Instance, Mesh, Solid};
use crate::render::pixels::place::Point;
use crate::render::pixels::project::{Lens, Placement, Projected, Vertices};
use crate::render::pixels::raster::{back_of, cut_triangles};
use crate::render::simd::vectorised;
use crate::render::{Camera, Frame};
use std::cell::RefCell;
use std::ops::Range;
use std::sync::Arc;

/// Samples in a row of a pixel, and rows of them.
pub(in crate::render) const COLUMNS: usize = 64;
pub(in crate::render) const ROWS: usize = 4;

/// Columns and rows of finer pixels in one, where there are no samples.
const FINER: u32 = 8;
/// The most pixels of a finer picture, and the most of samples' rows within a pixel.
const MOST: usize = 1 << 22;

/// The coverage of each pixel by a solid.
pub(in crate::render) struct Fractions {
    /// The fraction of every pixel, 0 to 1, row by row.
    pub values: Arc<[f32]>,
    /// `None` if the values are from a finer picture, or if the near plane cuts a mesh.
    pub outline: Option<Outline>,
}

/// Where covered samples begin and end.
pub(in crate::render) struct Outline {
    camera: Camera,
    meshes: Vec<Followed>,
    /// The sides where faces end, in samples.
    pub edges: Vec<Edge>,
    /// The crossings between a sample that is covered and one that is not, row by row.
    pub crossings: Vec<Crossing>,
}

/// A mesh whose sides were followed.
struct Followed {
    mesh: Arc<Mesh>,
    affine: Affine,
    /// The index of its first vertex among all, and of its sides.
    first: u32,
    edges: Range<usize>,
}

impl Outline {
    /// The sides of mesh `i`, if it was the same at the same place.
    fn same(&self, i: usize, item: &Instance, first: u32) -> Option<&[Edge]> {
        let was = self.meshes.get(i)?;
        let bits = |a: &Affine| a.0.to_cols_array().map(f64::to_bits);
        let same = Arc::ptr_eq(&was.mesh, &item.mesh) && was.first == first;
        let same = same && bits(&was.affine) == bits(&item.affine);
        self.edges.get(was.edges.clone()).filter(|_| same)
    }
}

/// A side that separates a sample from the one to the left of it.
pub(in crate::render) struct Crossing {
    pub row: u32,
    pub column: u32,
    /// The index of the side.
    pub edge: u32,
    /// True if the sample to the right is the covered one.
    pub enters: bool,
}

impl Fractions {
    /// Those of the meshes of a solid, unless the picture is too large. The sides of meshes that
    /// are where they were `before` are taken from there.
    pub fn of(solid: &Solid, camera: &Camera, before: Option<&Fractions>) -> Option<Fractions> {
        if camera.pixels().saturating_mul(ROWS) > MOST {
            return None;
        }
        let before = before.and_then(|b| b.outline.as_ref()).filter(|b| b.camera == *camera);
        let mut samples = Samples::none(camera.width as usize, camera.height as usize);
        let (lens, mut whole, mut first) = (Lens::new(camera), true, 0);
        let mut meshes = Vec::with_capacity(solid.instances().len());
        SCRATCH.with_borrow_mut(|Scratch { projected, rows, drawn }| {
            for (i, item) in solid.instances().iter().enumerate() {
                let begin = samples.edges.len();
                match before.and_then(|b| b.same(i, item, first)) {
                    Some(edges) => samples.edges.extend_from_slice(edges),
                    None => {
                        let placement = Placement::new(camera, &item.affine);
                        projected.clear();
                        projected.add(&item.mesh, &placement, &lens);
                        let vertices = projected.mesh(0);
                        whole &= vertices.whole;
                        if vertices.outside(camera) {
                        } else if vertices.whole {
                            let back = back_of(&item.mesh, &placement, true);
                            samples.add_mesh(&item.mesh, &vertices, back, first, drawn);
                        } else {
                            samples.add_cut(&item.mesh, &placement, camera, &vertices);
                        }
                    }
                }
                let (mesh, affine) = (Arc::clone(&item.mesh), item.affine);
                let edges = begin..samples.edges.len();
                meshes.push(Followed { mesh, affine, first, edges });
                first += item.mesh.positions.len() as u32;
            }
            let (values, crossings) = samples.count(rows);
            let Samples { edges, .. } = samples;
            let outline = whole.then_some(Outline { camera: *camera, meshes, edges, crossings });
            Some(Fractions { values, outline })
        })
    }

    /// Those in a finer picture, drawn by `draw`: for what has no mesh, and for pictures so
    /// large that samples would take too much memory.
    pub fn by_pixels(camera: &Camera, draw: impl FnOnce(&Camera) -> Frame) -> Fractions {
        let side = camera.width.max(camera.height);
        let fits = |by: &u32| {
            let pixels = camera.pixels().saturating_mul((by * by) as usize);
            side.saturating_mul(*by) <= Camera::MAX_SIDE && pixels <= MOST
        };
        let by = (1..=FINER).rev().find(fits).unwrap_or(1);
        let frame = draw(&camera.finer(by));
        let (width, by) = (camera.width as usize, by as usize);
        let mut counts = vec![0u32; camera.pixels()];
        for (at, _) in frame.mask().enumerate().filter(|(_, shown)| *shown) {
            let (i, j) = (at % (width * by), at / (width * by));
            if let Some(count) = counts.get_mut(j / by * width + i / by) {
                *count += 1;
            }
        }
        let values = counts.into_iter().map(|count| count as f32 / (by * by) as f32).collect();
        Fractions { values, outline: None }
    }
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// Buffers that are reused.
#[derive(Default)]
struct Scratch {
    projected: Projected,
    rows: RowLists,
    /// For each face of a mesh how it is drawn; see [`faces`].
    drawn: Vec<i8>,
}

/// What is crossed in each row of samples.
#[derive(Default)]
struct RowLists {
    /// Where each row's crossings begin among all of them.
    begins: Vec<u32>,
    all: Vec<u64>,
}

/// A side from its upper to its lower end, in samples: whole numbers are their places.
#[derive(Clone, Copy)]
pub(in crate::render) struct Edge {
    pub from: [f64; 2],
    pub to: [f64; 2],
    /// Of x by y.
    pub slope: f64,
    /// Those that are entered less those that are left, from left to right.
    faces: i32,
    /// The indices of the ends among the vertices of all meshes; 0 if the near plane cut.
    pub vertices: [u32; 2],
    /// The first of the rows that it crosses, and one past the last.
    rows: [u32; 2],
}

impl Edge {
    /// From a side that enters so many faces, from left to right, if it leads downwards, in a
    /// picture with so many rows.
    #[inline(always)]
    fn new(ends: [[f64; 2]; 2], [v, w]: [u32; 2], faces: i32, rows: usize) -> Edge {
        let ([from, to], vertices, faces) = match ends[0][1] > ends[1][1] {
            true => ([ends[1], ends[0]], [w, v], -faces),
            false => (ends, [v, w], faces),
        };
        let slope = (to[0] - from[0]) / (to[1] - from[1]);
        let rows = [from, to].map(|[_, y]| first(y, rows as f64));
        Edge { from, to, slope, faces, vertices, rows }
    }

    /// Where it crosses a row.
    #[inline(always)]
    fn at(&self, row: u32) -> f64 {
        self.from[0] + (f64::from(row) - self.from[1]) * self.slope
    }
}

/// The first whole number from `v` on, at least 0 and at most `most`; 0 for NaN.
#[inline(always)]
fn first(v: f64, most: f64) -> u32 {
    v.ceil().max(0.0).min(most) as u32
}

/// A position in the picture, in samples.
#[inline(always)]
fn in_samples(p: &Point) -> [f64; 2] {
    [p.x * COLUMNS as f64 - 0.5, p.y * ROWS as f64 - 0.5]
}

/// The double area of a triangle in the picture, above 0 where the corners follow each other
/// clockwise.
#[inline(always)]
fn clockwise([a, b, c]: &[Point; 3]) -> f64 {
    (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
}

/// How the faces of a mesh are drawn: 1 counter-clockwise, -1 clockwise, 0 not, as it has the
/// orientation `back` of [`back_of`]. After the last there is a 0, for no face.
#[inline(always)]
fn faces(mesh: &Mesh, vertices: &Vertices<'_>, back: f64, drawn: &mut Vec<i8>) {
    let triangles = &mesh.topology.triangles;
    drawn.resize(triangles.len() + 1, 0);
    for (drawn, corners) in drawn.iter_mut().zip(triangles) {
        let turn = clockwise(&corners.map(|v| vertices.point(v)));
        *drawn = match back == 0.0 {
            true => 1 - 2 * i8::from(turn > 0.0),
            false => i8::from(turn * back <= 0.0) * if back > 0.0 { 1 } else { -1 },
        };
    }
    drawn[triangles.len()] = 0;
}

/// A picture's rows of samples, and the sides that cross them.
struct Samples {
    /// In pixels.
    width: usize,
    /// Of samples.
    rows: usize,
    edges: Vec<Edge>,
}

/// Bits of the number of faces in a crossing, of which this is none, and of the side's index.
const FACES_BITS: u32 = 4;
const NO_FACES: i32 = 1 << (FACES_BITS - 1);
const EDGE_BITS: u32 = 32;

impl Samples {
    fn none(width: usize, height: usize) -> Samples {
        Samples { width, rows: height * ROWS, edges: Vec::with_capacity(512) }
    }

    /// Adds the sides where faces of a mesh that is beyond the near plane end, save those of
    /// faces with the orientation `back`. `first` is the index of its first vertex among all.
    fn add_mesh(
        &mut self,
        mesh: &Mesh,
        vertices: &Vertices<'_>,
        back: f64,
        first: u32,
        drawn: &mut Vec<i8>,
    ) {
        let sides = mesh.topology.sides.of(&mesh.topology.triangles);
        vectorised(
            #[inline(always)]
            || {
                faces(mesh, vertices, back, drawn);
                for side in sides {
                    let [own, other] = side.faces.map(|f| drawn.get(f as usize).copied());
                    let faces = own.unwrap_or(0) - other.unwrap_or(0);
                    if faces != 0 {
                        let ends = side.vertices.map(|v| in_samples(&vertices.point(v)));
                        let places = side.vertices.map(|v| first + v);
                        self.push(Edge::new(ends, places, i32::from(faces), self.rows));
                    }
                }
            },
        );
    }

    /// Adds a triangle in the picture, whichever way it turns.
    fn add(&mut self, points: &[Point; 3]) {
        let turn = clockwise(points);
        let places = points.each_ref().map(in_samples);
        // Written so that it is true for NaN.
        if !(turn.abs() < f64::INFINITY) {
            return;
        }
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let faces = if turn > 0.0 { -1 } else { 1 };
            self.push(Edge::new([places[i], places[j]], [0; 2], faces, self.rows));
        }
    }

    /// Adds those of a mesh that is not wholly beyond the near plane.
    fn add_cut(
        &mut self,
        mesh: &Mesh,
        placement: &Placement,
        camera: &Camera,
        vertices: &Vertices<'_>,
    ) {
        // Triangles that cover no pixel are left out; so in much smaller pixels.
        let finer = camera.finer(COLUMNS as u32);
        let smaller = |v: f64| v / COLUMNS as f64;
        cut_triangles(mesh, placement, &finer, vertices, |triangle, _, _| {
            let points = triangle.points.each_ref();
            self.add(&points.map(|p| Point { x: smaller(p.x), y: smaller(p.y), ..*p }));
        });
    }

    #[inline(always)]
    fn push(&mut self, edge: Edge) {
        if edge.rows[0] < edge.rows[1] {
            self.edges.push(edge);
        }
    }

    /// Puts in order what is crossed in each row.
    #[inline(always)]
    fn sort(&self, RowLists { begins, all }: &mut RowLists) {
        // How many more are crossed in a row than in the one before it, then the sums.
        begins.clear();
        begins.resize(self.rows + 2, 0);
        for edge in &self.edges {
            let [begin, end] = edge.rows.map(|row| row as usize + 1);
            begins[begin] = begins[begin].wrapping_add(1);
            begins[end] = begins[end].wrapping_sub(1);
        }
        let (mut here, mut sum) = (0u32, 0u32);
        for begin in begins.iter_mut() {
            here = here.wrapping_add(*begin);
            // Where the row before this one ends, if nothing is in it yet.
            (*begin, sum) = (sum, sum + here);
        }
        all.clear();
        all.resize(sum as usize, 0);
        let most = (self.width * COLUMNS) as f64;
        for (i, edge) in (0u64..).zip(&self.edges) {
            let [begin, end] = edge.rows;
            let own = i << FACES_BITS | (edge.faces + NO_FACES) as u64;
            for (row, next) in (begin..end).zip(&mut begins[begin as usize + 1..]) {
                let column = u64::from(first(edge.at(row), most));
                all[*next as usize] = column << (EDGE_BITS + FACES_BITS) | own;
                *next += 1;
            }
        }
        for row in begins.windows(2) {
            all[row[0] as usize..row[1] as usize].sort_unstable();
        }
    }

    /// The fraction of each pixel, and where covered samples begin and end.
    fn count(&self, lists: &mut RowLists) -> (Arc<[f32]>, Vec<Crossing>) {
        let mut counts = vec![0u16; self.width * self.rows / ROWS];
        let mut crossings = Vec::with_capacity(4 * self.rows);
        vectorised(
            #[inline(always)]
            || {
                self.sort(lists);
                for row in 0..self.rows {
                    let [begin, end] = [row, row + 1].map(|row| lists.begins[row] as usize);
                    let pixels = row / ROWS * self.width..(row / ROWS + 1) * self.width;
                    let list = &lists.all[begin..end];
                    row_of(list, row as u32, &mut counts[pixels], &mut crossings);
                }
            },
        );
        let fraction = |count: u16| f32::from(count) / (COLUMNS * ROWS) as f32;
        (counts.into_iter().map(fraction).collect(), crossings)
    }
}

/// Counts the covered samples of a row by pixel, from what is crossed in it, in order.
#[inline(always)]
fn row_of(list: &[u64], row: u32, counts: &mut [u16], crossings: &mut Vec<Crossing>) {
    let (mut faces, mut begin, mut rest) = (0, 0, list);
    while let Some(next) = rest.first() {
        let column = next >> (FACES_BITS + EDGE_BITS);
        let before = faces;
        let change = |key: &u64| (key & ((1 << FACES_BITS) - 1)) as i32 - NO_FACES;
        let here = rest.iter().take_while(|key| *key >> (FACES_BITS + EDGE_BITS) == column);
        faces += here.clone().map(change).sum::<i32>();
        let enters = faces > 0;
        if enters != (before > 0) {
            // Of those in one place, the first that goes the way of all.
            let edge = here.clone().find(|key| (change(key) > 0) == enters).unwrap_or(next);
            let edge = (edge >> FACES_BITS) as u32;
            crossings.push(Crossing { row, column: column as u32, edge, enters });
            match enters {
                true => begin = column as usize,
                false => add_between(counts, begin, column as usize),
            }
        }
        rest = &rest[here.count()..];
    }
}

/// Adds the samples between two columns to those of their pixels.
#[inline(always)]
fn add_between(counts: &mut [u16], begin: usize, end: usize) {
    if begin >= end {
        return;
    }
    let (from, to) = (begin / COLUMNS, (end - 1) / COLUMNS);
    if let Some(counts) = counts.get_mut(from..=to) {
        counts.iter_mut().for_each(|count| *count += COLUMNS as u16);
        let within = [begin % COLUMNS, (to + 1) * COLUMNS - end];
        for (at, less) in [0, to - from].into_iter().zip(within) {
            counts[at] -= less as u16;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::pixels::project::project;
    use crate::render::testing::{cuboid, sphere};
    use crate::render::{Channels, View};
    use glam::{DVec3, Vec3};
    use proptest::prelude::*;

    /// Fractions from a picture with `by` times as many pixels in both directions.
    fn by_pixels(solid: &Solid, camera: &Camera, by: u32) -> Vec<f64> {
        let finer = camera.finer(by);
        let frame = Frame::render(solid, &finer, Channels::Depth);
        let mask: Vec<bool> = frame.mask().collect();
        let (width, by) = (camera.width as usize, by as usize);
        let count = |p: usize| {
            let (i, j) = (p % width * by, p / width * by);
            let row = |j: usize| (i..i + by).filter(|i| mask[j * width * by + i]).count();
            (j..j + by).map(row).sum::<usize>() as f64 / (by * by) as f64
        };
        (0..camera.pixels()).map(count).collect()
    }

    fn values(samples: &Samples) -> Arc<[f32]> {
        samples.count(&mut RowLists::default()).0
    }

    /// Fractions from all sides of all faces that are drawn.
    fn by_faces(solid: &Solid, camera: &Camera) -> Arc<[f32]> {
        let mut samples = Samples::none(camera.width as usize, camera.height as usize);
        let mut projected = Projected::default();
        project(solid, camera, &mut projected);
        for (i, item) in solid.instances().iter().enumerate() {
            let back = back_of(&item.mesh, &Placement::new(camera, &item.affine), true);
            for corners in &item.mesh.topology.triangles {
                let points = corners.map(|v| projected.mesh(i).point(v));
                if clockwise(&points) * back <= 0.0 {
                    samples.add(&points);
                }
            }
        }
        values(&samples)
    }

    #[test]
    fn triangles_that_share_edges_lose_no_sample_between_them() {
        let mut samples = Samples::none(7, 5);
        let point = |x: f64, y: f64| Point { x, y, nearness: 1.0 };
        let middle = point(3.137, 2.211);
        let around = [(-1.0, -2.0), (3.3, -2.5), (9.0, -1.0), (8.0, 6.5), (2.1, 7.0), (-3.0, 5.5)];
        let around = around.map(|(x, y)| point(x, y));
        for i in 0..6 {
            samples.add(&[around[i], middle, around[(i + 1) % 6]]);
        }
        assert!(values(&samples).iter().all(|f| *f == 1.0));
        let mut nothing = Samples::none(7, 5);
        nothing.add(&[point(f64::NAN, 1.0), point(2.0, 2.0), point(1.0, 4.0)]);
        nothing.add(&[point(1.0, 1.0), point(2.0, 1.0), point(5.0, 1.0)]);
        nothing.add(&[point(1e300, 1.0), point(1e300, 3.0), point(2e300, 2.0)]);
        assert!(values(&nothing).iter().all(|f| *f == 0.0));
    }

    #[test]
    fn what_stays_is_taken_from_before() {
        let camera = Camera::default_for(40, 30);
        let at = |x: f64| Affine::new(DVec3::new(x, 0.1, 0.2), DVec3::splat(0.3), DVec3::ONE);
        let (ball, block) = (sphere(24, 12), cuboid(Vec3::new(1.4, 1.0, 0.8)).placed(at(0.4)));
        let scene = |x: f64| Solid::group(&[ball.placed(at(x)), block.clone()]);
        let before = Fractions::of(&scene(-0.5), &camera, None).unwrap();
        let gain: Vec<f64> = (0..camera.pixels()).map(|i| (i % 7) as f64 - 2.0).collect();
        for x in [-0.5, -0.3, 3.0, 90.0] {
            let solid = scene(x);
            let [fresh, next] = [None, Some(&before)].map(|b| Fractions::of(&solid, &camera, b));
            let (fresh, next) = (fresh.unwrap(), next.unwrap());
            assert_eq!(fresh.values, next.values);
            assert_eq!(fresh.vjp(&solid, &camera, &gain), next.vjp(&solid, &camera, &gain));
            let outline = before.outline.as_ref().unwrap();
            let kept: Vec<bool> = solid
                .instances()
                .iter()
                .enumerate()
                .map(|(i, item)| {
                    let first = next.outline.as_ref().unwrap().meshes[i].first;
                    outline.same(i, item, first).is_some()
                })
                .collect();
            assert_eq!(kept, [x == -0.5, true]);
        }
        let other = Camera::default_for(40, 40);
        let [fresh, next] =
            [None, Some(&before)].map(|b| Fractions::of(&scene(-0.5), &other, b).unwrap().values);
        assert_eq!(fresh, next);
    }

    #[test]
    fn large_pictures_take_bounded_memory() {
        let camera = Camera::default_for(1200, 1200);
        assert!(Fractions::of(&sphere(24, 12), &camera, None).is_none());
        let view = View::new(sphere(24, 12), camera);
        let mask: Vec<f32> = view.depth(1200).mask().map(|m| f32::from(u8::from(m))).collect();
        assert_eq!(view.fractions(1200)[..], mask[..]);
        assert!(view.vjp_fractions(1200, &vec![1.0; 1200 * 1200]).iter().any(|g| g.x != 0.0));
    }

    proptest! {
        #[test]
        fn fractions_are_those_of_a_finer_picture(
            place in prop::array::uniform3(-1.2f64..1.2),
            turn in prop::array::uniform3(-3.0f64..3.0),
            distance in prop_oneof![Just(0.0), Just(6.9), Just(7.6)],
        ) {
            let camera = Camera::default_for(20, 15);
            let by = Affine::new(
                DVec3::from(place) + distance * DVec3::Z, DVec3::from(turn), DVec3::ONE);
            for solid in [sphere(24, 12), cuboid(Vec3::new(1.4, 1.0, 0.8))] {
                let solid = solid.placed(by);
                let own = View::new(solid.clone(), camera).fractions(20);
                if distance == 0.0 {
                    prop_assert_eq!(&own, &by_faces(&solid, &camera));
                    let mirror = Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::new(-1.0, 1.0, 1.0));
                    let mirrored = solid.placed(mirror);
                    let other = View::new(mirrored.clone(), camera).fractions(20);
                    prop_assert_eq!(&other, &by_faces(&mirrored, &camera));
                    let far = other.chunks(20).flat_map(|row| row.iter().rev()).zip(own.iter());
                    let far = far.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    prop_assert!(far < 0.02, "{far}");
                }
                let finer = by_pixels(&solid, &camera, 32);
                let far = own.iter().zip(&finer).map(|(a, b)| (f64::from(*a) - b).abs());
                let worst = far.fold(0.0, f64::max);
                // Rows of samples are a quarter of a pixel high. Along a straight edge all differences
                // may have one sign, so those of whole pictures have no lower bound.
                prop_assert!(worst <= 0.13, "{worst}");
            }
        }
    }
}
