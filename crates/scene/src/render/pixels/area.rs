//! Rectangles of pixels.

use crate::render::Camera;

/// A rectangle of pixels inside an image: columns `left..right`, rows `top..bottom`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::render) struct Area {
    pub left: usize,
    pub right: usize,
    pub top: usize,
    pub bottom: usize,
}

impl Area {
    /// The whole image.
    pub fn whole(camera: &Camera) -> Area {
        Area { left: 0, right: camera.width as usize, top: 0, bottom: camera.height as usize }
    }

    /// The smallest rectangle around both; one without pixels is ignored.
    pub fn with(&self, other: &Area) -> Area {
        match (self.pixels(), other.pixels()) {
            (_, 0) => *self,
            (0, _) => *other,
            _ => Area {
                left: self.left.min(other.left),
                right: self.right.max(other.right),
                top: self.top.min(other.top),
                bottom: self.bottom.max(other.bottom),
            },
        }
    }

    /// The intersection of two rectangles.
    #[inline]
    pub fn common(&self, other: &Area) -> Area {
        let (left, top) = (self.left.max(other.left), self.top.max(other.top));
        let (right, bottom) =
            (self.right.min(other.right).max(left), self.bottom.min(other.bottom).max(top));
        Area { left, right, top, bottom }
    }

    /// True if two rectangles have pixels in common.
    #[inline]
    pub fn meets(&self, other: &Area) -> bool {
        self.common(other).pixels() > 0
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        (self.right - self.left) * (self.bottom - self.top)
    }

    /// Removes areas without pixels. If the areas overlap so much that a single one
    /// around all of them has fewer pixels than their sum, replaces them by that one.
    pub fn join(areas: &mut Vec<Area>) {
        areas.retain(|area| area.pixels() > 0);
        let around = areas.iter().fold(Area::default(), |all, area| all.with(area));
        if areas.iter().map(Area::pixels).sum::<usize>() > around.pixels() {
            areas.clear();
            areas.push(around);
        }
    }
}
