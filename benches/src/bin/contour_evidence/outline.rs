//! Silhouettes as sub-pixel outlines: the level 0.5 of a blurred mask, by marching
//! squares.

use pcadlang_scene::vision::ContourSlice;

/// The elements of an outline.
#[derive(Default)]
pub struct Outline {
    x: Vec<f32>,
    y: Vec<f32>,
    tx: Vec<f32>,
    ty: Vec<f32>,
    length: Vec<f32>,
    size: usize,
}

impl Outline {
    /// Returns the outline of a square mask.
    pub fn of(mask: &[bool], size: usize) -> Self {
        let field = blur(mask, size);
        let mut out = Outline { size, ..Outline::default() };
        for y in 0..size - 1 {
            for x in 0..size - 1 {
                let corner = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)];
                let value = corner.map(|(u, v)| field[v * size + u] - 0.5);
                let mut cuts = Vec::with_capacity(4);
                for i in 0..4 {
                    let j = (i + 1) % 4;
                    if (value[i] < 0.0) != (value[j] < 0.0) {
                        let t = value[i] / (value[i] - value[j]);
                        let at = |a: usize, b: usize| a as f32 + t * (b as f32 - a as f32) + 0.5;
                        cuts.push((at(corner[i].0, corner[j].0), at(corner[i].1, corner[j].1)));
                    }
                }
                for pair in cuts.chunks_exact(2) {
                    let (dx, dy) = (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
                    let length = dx.hypot(dy);
                    if length > 1e-4 {
                        out.x.push(0.5 * (pair[0].0 + pair[1].0));
                        out.y.push(0.5 * (pair[0].1 + pair[1].1));
                        out.tx.push(dx / length);
                        out.ty.push(dy / length);
                        out.length.push(length);
                    }
                }
            }
        }
        out
    }

    /// Returns the elements in the form that comparators take.
    pub fn elements(&self) -> ContourSlice<'_> {
        let (width, height) = (self.size as u32, self.size as u32);
        ContourSlice {
            x: &self.x,
            y: &self.y,
            tx: &self.tx,
            ty: &self.ty,
            length: &self.length,
            width,
            height,
        }
    }
}

fn blur(mask: &[bool], size: usize) -> Vec<f32> {
    let kernel = [0.06, 0.24, 0.4, 0.24, 0.06];
    let mut a: Vec<f32> = mask.iter().map(|&m| f32::from(u8::from(m))).collect();
    for stride in [1, size] {
        let mut b = a.clone();
        for y in 2..size - 2 {
            for x in 2..size - 2 {
                let i = y * size + x;
                b[i] = (0..5).map(|k| kernel[k] * a[i + k * stride - 2 * stride]).sum();
            }
        }
        a = b;
    }
    a
}

/// Returns the intersection over union of two masks.
pub fn overlap(a: &[bool], b: &[bool]) -> f64 {
    let both = a.iter().zip(b).filter(|(a, b)| **a && **b).count();
    let any = a.iter().zip(b).filter(|(a, b)| **a || **b).count();
    both as f64 / any.max(1) as f64
}
