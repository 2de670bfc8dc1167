//! The pieces of contour of a mesh that keeps its shape.

pub(in crate::render) use super::crossed::Found;

use super::Posed;
use crate::render::Camera;
use crate::render::lines::extraction::{Extractor, Origin};
use crate::render::lines::silhouette::Crossed;
use crate::render::lines::visibility::Piece;
use crate::render::simd::vectorised;

/// As [`extract_mesh`](crate::render::lines::extraction::extract_mesh).
pub(in crate::render) fn extract_posed(
    posed: &Posed<'_>,
    camera: &Camera,
    (found, crossed): (&mut Found, &mut Crossed),
    out: impl FnMut(Piece, &Origin),
) {
    let Posed { mesh, placement, lens, .. } = posed;
    let Some(mut extractor) = Extractor::new(mesh, placement, camera, posed, out) else { return };
    found.find(posed);
    vectorised(
        #[inline(always)]
        || {
            crossed.each_of(
                &found.corners,
                mesh,
                placement,
                lens,
                #[inline(always)]
                |batch, count| extractor.silhouettes(batch, count),
            )
        },
    );
    extractor.edges();
}
