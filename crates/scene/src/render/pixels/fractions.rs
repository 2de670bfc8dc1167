//! The fraction of every pixel that a solid covers.
//!
//! Pixels are sampled in rows of [`COLUMNS`]. From the left end of a row, the sides of faces that
//! are crossed tell how many faces there are at each sample: a side that enters its face adds
//! one, a side that leaves it takes one away. A side between two faces that are both drawn does
//! neither, so only the sides where drawn faces end are followed. Faces that share a side find
//! the same place for it in each row, so no sample is lost between them. What hides what does
//! not matter.

use crate::geom::{Affine, Instance, Mesh, Solid};
use crate::render::canvas::{affine_bits, camera_bits};
use crate::render::pixels::body_outline::FollowedBody;
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
    /// By its bits.
    camera: [u64; 17],
    meshes: Vec<Followed>,
    /// The body that the solid is, if it is one; then there are no meshes.
    pub body: Option<FollowedBody>,
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
        let same = Arc::ptr_eq(&was.mesh, &item.mesh) && was.first == first;
        let same = same && affine_bits(&was.affine) == affine_bits(&item.affine);
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
        let before =
            before.and_then(|b| b.outline.as_ref()).filter(|b| b.camera == camera_bits(camera));
        let mut samples = Samples::none(camera.width as usize, camera.height as usize);
        if let Some(body) = solid.body() {
            let before = before.and_then(|b| Some((b.body.as_ref()?, &b.edges[..])));
            if let Some(body) = samples.add_body(body, camera, before) {
                return Some(samples.into_fractions(camera, Vec::new(), Some(body), true));
            }
        }
        let (lens, mut whole, mut first) = (Lens::new(camera), true, 0);
        let mut meshes = Vec::with_capacity(solid.instances().len());
        SCRATCH.with_borrow_mut(|Scratch { projected, drawn, .. }| {
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
        });
        Some(samples.into_fractions(camera, meshes, None, whole))
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
    /// For a row of pixels, the covered samples of each less those of the one before it.
    steps: Vec<i32>,
    /// The fraction of each pixel.
    values: Vec<f32>,
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
    /// From a side that enters this number of faces, from left to right, if it leads downwards, in a
    /// picture with this number of rows.
    #[inline(always)]
    pub fn new(ends: [[f64; 2]; 2], [v, w]: [u32; 2], faces: i32, rows: usize) -> Edge {
        let ([from, to], vertices, faces) = match ends[0][1] > ends[1][1] {
            true => ([ends[1], ends[0]], [w, v], -faces),
            false => (ends, [v, w], faces),
        };
        let slope = (to[0] - from[0]) / (to[1] - from[1]);
        let rows = [from, to].map(|[_, y]| first(y, rows as f64));
        Edge { from, to, slope, faces, vertices, rows }
    }

    /// True if it crosses a row.
    #[inline(always)]
    pub fn counts(&self) -> bool {
        self.rows[0] < self.rows[1]
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
pub(super) fn in_samples([x, y]: [f64; 2]) -> [f64; 2] {
    [x * COLUMNS as f64 - 0.5, y * ROWS as f64 - 0.5]
}

/// The double area of a triangle in the picture, above 0 where the corners follow each other
/// clockwise.
#[inline(always)]
pub(super) fn clockwise([a, b, c]: [[f64; 2]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The place of a point in the picture.
#[inline(always)]
fn place(p: &Point) -> [f64; 2] {
    [p.x, p.y]
}

/// How the faces of a mesh are drawn: 1 counter-clockwise, -1 clockwise, 0 not, as it has the
/// orientation `back` of [`back_of`]. After the last there is a 0, for no face.
#[inline(always)]
fn faces(mesh: &Mesh, vertices: &Vertices<'_>, back: f64, drawn: &mut Vec<i8>) {
    let triangles = &mesh.topology.triangles;
    drawn.resize(triangles.len() + 1, 0);
    for (drawn, corners) in drawn.iter_mut().zip(triangles) {
        let turn = clockwise(corners.map(|v| place(&vertices.point(v))));
        *drawn = match back == 0.0 {
            true => 1 - 2 * i8::from(turn > 0.0),
            false => i8::from(turn * back <= 0.0) * if back > 0.0 { 1 } else { -1 },
        };
    }
    drawn[triangles.len()] = 0;
}

/// A picture's rows of samples, and the sides that cross them.
pub(super) struct Samples {
    /// In pixels.
    width: usize,
    /// Of samples.
    pub rows: usize,
    pub edges: Vec<Edge>,
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
    /// Finds how faces are drawn.
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
                        let ends = side.vertices.map(|v| in_samples(place(&vertices.point(v))));
                        let places = side.vertices.map(|v| first + v);
                        let edge = Edge::new(ends, places, i32::from(faces), self.rows);
                        if edge.counts() {
                            self.edges.push(edge);
                        }
                    }
                }
            },
        );
    }

    /// Adds a triangle in the picture, whichever way it turns.
    fn add(&mut self, points: &[Point; 3]) {
        let places = points.each_ref().map(place);
        let (turn, places) = (clockwise(places), places.map(in_samples));
        if !turn.is_finite() {
            return;
        }
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let faces = if turn > 0.0 { -1 } else { 1 };
            let edge = Edge::new([places[i], places[j]], [0; 2], faces, self.rows);
            if edge.counts() {
                self.edges.push(edge);
            }
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

    /// Puts in order what is crossed in each row.
    #[inline(always)]
    fn sort(&self, RowLists { begins, all, .. }: &mut RowLists) {
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
        // Every place is written.
        all.resize((sum as usize).max(all.len()), 0);
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

    /// Those of what was followed; with the outline if all of it is beyond the near plane.
    fn into_fractions(
        self,
        camera: &Camera,
        meshes: Vec<Followed>,
        body: Option<FollowedBody>,
        whole: bool,
    ) -> Fractions {
        let (values, crossings) = SCRATCH.with_borrow_mut(|scratch| self.count(&mut scratch.rows));
        let (camera, edges) = (camera_bits(camera), self.edges);
        let outline = Outline { camera, meshes, body, edges, crossings };
        Fractions { values, outline: whole.then_some(outline) }
    }

    /// The fraction of each pixel, and where covered samples begin and end.
    fn count(&self, lists: &mut RowLists) -> (Arc<[f32]>, Vec<Crossing>) {
        let mut crossings = Vec::with_capacity(8 * self.rows);
        vectorised(
            #[inline(always)]
            || {
                self.sort(lists);
                let RowLists { begins, all, steps, values } = &mut *lists;
                values.clear();
                for pixels in 0..self.rows / ROWS {
                    steps.clear();
                    steps.resize(self.width + 2, 0);
                    for row in pixels * ROWS..(pixels + 1) * ROWS {
                        let [begin, end] = [row, row + 1].map(|row| begins[row] as usize);
                        row_of(&all[begin..end], row as u32, steps, &mut crossings);
                    }
                    let mut count = 0;
                    values.extend(steps[..self.width].iter().map(|step| {
                        count += step;
                        count as f32 / (COLUMNS * ROWS) as f32
                    }));
                }
            },
        );
        (lists.values.as_slice().into(), crossings)
    }
}

/// Follows a row of samples by what is crossed in it, in order, and adds to the covered samples of
/// each pixel less those of the pixel before it.
#[inline(always)]
fn row_of(list: &[u64], row: u32, steps: &mut [i32], crossings: &mut Vec<Crossing>) {
    const COLUMN: u32 = FACES_BITS + EDGE_BITS;
    let change = |key: u64| (key & ((1 << FACES_BITS) - 1)) as i32 - NO_FACES;
    let mut step = |column: usize, by: i32| {
        let within = (column % COLUMNS) as i32;
        if let Some([here, next]) = steps.get_mut(column / COLUMNS..column / COLUMNS + 2) {
            (*here, *next) = (*here + by * (COLUMNS as i32 - within), *next + by * within);
        }
    };
    let (mut faces, mut at, mut begin) = (0, 0, 0);
    while at < list.len() {
        let (from, column, before) = (at, list[at] >> COLUMN, faces);
        while at < list.len() && list[at] >> COLUMN == column {
            faces += change(list[at]);
            at += 1;
        }
        let enters = faces > 0;
        if enters == (before > 0) {
            continue;
        }
        // Of those in one place, the first that goes the way of all.
        let here = &list[from..at];
        let edge = here.iter().find(|key| (change(**key) > 0) == enters).unwrap_or(&here[0]);
        let edge = (edge >> FACES_BITS) as u32;
        crossings.push(Crossing { row, column: column as u32, edge, enters });
        begin = column as usize;
        step(begin, if enters { 1 } else { -1 });
    }
    // What is not left covers nothing.
    if faces > 0 {
        step(begin, -1);
    }
}

#[cfg(test)]
#[path = "fractions_tests.rs"]
mod tests;
