//! Scenes for the comparators' tests: circles and random strokes, as rendered pieces and
//! as observed maps. Positions are fractions of the frame, so that the same scene exists
//! at every resolution.

use super::pictures::contour_map::ContourMap;
use crate::contours::{ContourChange, ContourSlice, Contours};

impl Contours {
    /// Adds a piece in the direction of an angle.
    pub(in crate::vision) fn stroke(&mut self, x: f32, y: f32, angle: f32, length: f32) {
        self.x.push(x);
        self.y.push(y);
        self.tx.push(libm::cosf(angle));
        self.ty.push(libm::sinf(angle));
        self.length.push(length);
    }

    /// A circle of pieces about a pixel long; the centre and radius are fractions of the
    /// width.
    pub(in crate::vision) fn circle(mut self, cx: f32, cy: f32, r: f32) -> Self {
        let w = self.width as f32;
        let n = (std::f32::consts::TAU * r * w).ceil().max(8.0);
        let step = std::f32::consts::TAU / n;
        for i in 0..n as usize {
            let a = (i as f32 + 0.5) * step;
            let (x, y) = (cx + r * libm::cosf(a), cy + r * libm::sinf(a));
            self.stroke(x * w, y * w, a + std::f32::consts::FRAC_PI_2, step * r * w);
        }
        self
    }

    /// Returns an observed map of the same size.
    pub(in crate::vision) fn map(&self) -> ContourMap {
        ContourMap {
            width: self.width,
            height: self.height,
            x: self.x.clone(),
            y: self.y.clone(),
            tx: self.tx.clone(),
            ty: self.ty.clone(),
            strength: vec![1.0; self.x.len()],
        }
    }

    /// Returns the pieces in the opposite order.
    pub(in crate::vision) fn reversed(&self) -> Self {
        let mut r = self.clone();
        for list in [&mut r.x, &mut r.y, &mut r.tx, &mut r.ty, &mut r.length] {
            list.reverse();
        }
        r
    }

    /// Returns a copy with the x, y, length or angle (`k` = 0 to 3) of piece `i` changed
    /// by `by`.
    pub(in crate::vision) fn nudged(&self, i: usize, k: usize, by: f32) -> Self {
        let mut r = self.clone();
        match k {
            0 => r.x[i] += by,
            1 => r.y[i] += by,
            2 => r.length[i] += by,
            _ => {
                let (sin, cos) = (libm::sinf(by), libm::cosf(by));
                let (tx, ty) = (r.tx[i], r.ty[i]);
                (r.tx[i], r.ty[i]) = (tx * cos - ty * sin, tx * sin + ty * cos);
            }
        }
        r
    }

    /// Counts the derivatives with respect to x, y, length and angle that differ from
    /// central differences of a score. Some may differ where a difference straddles a
    /// kink.
    pub(in crate::vision) fn differing(
        &self,
        found: &[[f64; 4]],
        score: impl Fn(&ContourSlice<'_>) -> f64,
    ) -> usize {
        let h = 1.0f32 / 128.0;
        let differs = |i: usize, k: usize| {
            let at = |by: f32| score(&self.nudged(i, k, by).slice());
            let numeric = (at(h) - at(-h)) / f64::from(2.0 * h);
            (numeric - found[i][k]).abs() > 2e-3 * (numeric.abs() + 1e-2)
        };
        (0..found.len())
            .flat_map(|i| (0..4).map(move |k| (i, k)))
            .filter(|(i, k)| differs(*i, *k))
            .count()
    }

    /// Returns a copy moved by some pixels.
    pub(in crate::vision) fn moved(&self, dx: f32, dy: f32) -> Self {
        let mut r = self.clone();
        r.x.iter_mut().for_each(|x| *x += dx);
        r.y.iter_mut().for_each(|y| *y += dy);
        r
    }
}

/// Returns a generator of numbers in 0..1.
pub(super) fn numbers(mut seed: u64) -> impl FnMut() -> f32 {
    move || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// An observed map of `n` random strokes.
pub(super) fn clutter(width: u32, height: u32, n: usize, seed: u64) -> Contours {
    let mut next = numbers(seed);
    let mut pieces = Contours::new(width, height);
    for _ in 0..n {
        let (x, y, angle) = (next() * width as f32, next() * height as f32, next() * 3.1);
        for i in 0..12 {
            pieces.stroke(
                x + i as f32 * libm::cosf(angle),
                y + i as f32 * libm::sinf(angle),
                angle,
                1.0,
            );
        }
    }
    pieces
}

/// Calls `each` with steps in which some of the pieces appear, disappear or move, and
/// with all pieces that are there after the step.
pub(super) fn comings_and_goings(all: &Contours, mut each: impl FnMut(&ContourChange, &Contours)) {
    let only = |keep: &dyn Fn(usize) -> bool| {
        let mut some = Contours::new(all.width, all.height);
        for i in (0..all.x.len()).filter(|i| keep(*i)) {
            some.stroke(all.x[i], all.y[i], libm::atan2f(all.ty[i], all.tx[i]), all.length[i]);
        }
        some
    };
    // A few of them or most of them, in turn.
    let there = |step: usize, i: usize| {
        (i * 7919 + step * [1, 31, 977][step % 3]) % 100 > [20, 25, 90][step % 3]
    };
    let mut from = std::sync::Arc::new(());
    for step in 1..40 {
        let (whole, moves) = (only(&|i| there(step, i)), |i: usize| i % 5 == 2);
        let removed = only(&|i| !moves(i) && there(step - 1, i) && !there(step, i));
        let added = only(&|i| !moves(i) && !there(step - 1, i) && there(step, i));
        let moving = only(&|i| moves(i) && there(step, i));
        let to = std::sync::Arc::new(());
        let ([removed, added, moving], count) = ([removed, added, moving], whole.x.len());
        let moving = std::sync::Arc::new(moving);
        each(&ContourChange { from, to: to.clone(), removed, added, moving, count }, &whole);
        from = to;
    }
}
