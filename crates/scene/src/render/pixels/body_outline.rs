//! The sides where the faces of a posed body end in a picture. Its surface is followed as one
//! mesh, so no part ends where another goes on, and no mesh is made. What is of parts that stay is
//! taken from before.

use crate::geom::armature::{Pose, PosedBody, SurfaceStretch, Whole};
use crate::render::Camera;
use crate::render::canvas::affine_bits;
use crate::render::pixels::fractions::{Edge, Samples, clockwise, in_samples};
use crate::render::pixels::project::{Lens, Placement, places_of};
use crate::render::simd::vectorised;
use smallvec::SmallVec;
use std::ops::Range;
use std::sync::Arc;

/// A body that was followed. Edges have their vertices as numbered in its surface.
pub(in crate::render) struct FollowedBody {
    pose: Arc<Pose>,
    /// The bits of its placement.
    place: [u64; 12],
    /// Each vertex in the picture, in pixels.
    places: Vec<[f64; 2]>,
    /// How faces are drawn: 1 counter-clockwise, -1 clockwise, 0 not; after the last there is a
    /// 0, for no face.
    drawn: Vec<i8>,
    /// Where the sides of each part are among the edges.
    edges: Vec<Range<usize>>,
}

impl FollowedBody {
    /// The number of a vertex of the surface among those of the parts' meshes.
    pub fn number(&self, v: u32) -> u32 {
        self.pose.body.whole().numbers.get(v as usize).copied().unwrap_or(u32::MAX)
    }
}

impl Samples {
    /// Adds the sides of a body; what stays is taken from the one that was followed `before` by
    /// the same camera, and from its edges. `None`, and adds none, if a vertex is unusable or not
    /// beyond the near plane.
    pub(super) fn add_body(
        &mut self,
        body: &PosedBody,
        camera: &Camera,
        before: Option<(&FollowedBody, &[Edge])>,
    ) -> Option<FollowedBody> {
        let (pose, place) = (&body.pose, affine_bits(&body.place));
        let whole = pose.body.whole();
        let positions = pose.positions(before.map(|(b, _)| &*b.pose));
        let before = before.filter(|(b, _)| b.place == place);
        let stays = pose.stays(before.map(|(b, _)| &*b.pose));
        let moving = runs(&stays, &whole.stretches);
        let (mut places, mut drawn) = match before {
            Some((b, _)) if stays.contains(&true) => (b.places.clone(), b.drawn.clone()),
            _ => (vec![[0.0; 2]; positions.len()], vec![0; whole.triangles.len() + 1]),
        };
        let (placement, lens) = (Placement::new(camera, &body.place), Lens::new(camera));
        let sign = if placement.mirrored { -1 } else { 1 };
        let mut edges = Vec::with_capacity(stays.len());
        let usable = vectorised(
            #[inline(always)]
            || {
                for (vertices, _) in &moving {
                    let (own, out) = (&positions[vertices.clone()], &mut places[vertices.clone()]);
                    if !places_of(own, &placement, &lens, out) {
                        return false;
                    }
                }
                for (_, faces) in &moving {
                    let own = drawn[faces.clone()].iter_mut().zip(&whole.triangles[faces.clone()]);
                    for (drawn, corners) in own {
                        let turn = clockwise(corners.map(|v| places[v as usize]));
                        *drawn = i8::from(turn * f64::from(sign) <= 0.0) * sign;
                    }
                }
                for (k, stretch) in whole.stretches.iter().enumerate() {
                    let begin = self.edges.len();
                    let same = stays[k] && stretch.beside.iter().all(|p| stays[*p]);
                    match before.filter(|_| same) {
                        Some((b, known)) => {
                            self.edges.extend_from_slice(&known[b.edges[k].clone()]);
                        }
                        None => self.follow(whole, stretch, &places, &drawn),
                    }
                    edges.push(begin..self.edges.len());
                }
                true
            },
        );
        usable.then(|| FollowedBody { pose: Arc::clone(pose), place, places, drawn, edges })
    }

    /// Adds the sides of a part at which drawn faces end.
    #[inline(always)]
    fn follow(
        &mut self,
        whole: &Whole,
        stretch: &SurfaceStretch,
        places: &[[f64; 2]],
        drawn: &[i8],
    ) {
        for side in &whole.sides()[stretch.sides.clone()] {
            let [own, other] = side.faces.map(|f| drawn[f as usize]);
            if own != other {
                let ends = side.vertices.map(|v| in_samples(places[v as usize]));
                let edge = Edge::new(ends, side.vertices, i32::from(own - other), self.rows);
                if edge.counts() {
                    self.edges.push(edge);
                }
            }
        }
    }
}

/// The vertices and the faces of consecutive parts that move.
fn runs(
    stays: &[bool],
    stretches: &[SurfaceStretch],
) -> SmallVec<[(Range<usize>, Range<usize>); 8]> {
    let mut runs: SmallVec<[(Range<usize>, Range<usize>); 8]> = SmallVec::new();
    for (stretch, _) in stretches.iter().zip(stays).filter(|(_, stays)| !**stays) {
        match runs.last_mut() {
            Some((vertices, faces)) if faces.end == stretch.faces.start => {
                (vertices.end, faces.end) = (stretch.vertices.end, stretch.faces.end);
            }
            _ => runs.push((stretch.vertices.clone(), stretch.faces.clone())),
        }
    }
    runs
}
