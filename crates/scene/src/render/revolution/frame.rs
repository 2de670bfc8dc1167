//! Depth, parts and normals of a surface of revolution: a line of sight for each pixel
//! against the cones and level spans that may show there.

use super::cover::Cover;
use super::lanes::LANES;
use super::rays::Spans;
use super::scan::{MOST, Scan, centres};
use super::shading::{Shading, Shown};
use super::sight::Sight;
use crate::geom::{Affine, Revolution};
use crate::render::simd::vectorised;
use crate::render::{Camera, Channels, Frame};
use std::cell::RefCell;
use wide::f32x8;

/// Buffers reused from call to call.
#[derive(Default)]
struct Scratch {
    tracer: Tracer,
    shading: Shading,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

impl Frame {
    /// Draws a placed surface of revolution without a mesh; nothing if the placement is
    /// not invertible.
    pub fn of_revolution(
        surface: &Revolution,
        affine: &Affine,
        camera: &Camera,
        channels: Channels,
    ) -> Frame {
        let count = camera.pixels();
        let (width, height, depth) = (camera.width, camera.height, vec![f32::INFINITY; count]);
        let mut frame = Frame { width, height, depth, part: Vec::new(), normal: Vec::new() };
        if channels == Channels::All {
            frame.part.resize(count, u16::MAX);
            frame.normal.resize(count, [0.0; 3]);
        }
        if let Some(sight) = Sight::new(camera, affine) {
            SCRATCH.with(|scratch| match scratch.try_borrow_mut() {
                Ok(mut scratch) => scratch.draw(surface, &sight, camera, &mut frame),
                Err(_) => Scratch::default().draw(surface, &sight, camera, &mut frame),
            });
        }
        frame
    }
}

impl Scratch {
    fn draw(&mut self, surface: &Revolution, sight: &Sight, camera: &Camera, frame: &mut Frame) {
        let Scratch { tracer, shading } = self;
        vectorised(
            #[inline(always)]
            || {
                if !frame.part.is_empty() {
                    shading.set(surface, sight);
                }
                tracer.rows(
                    surface,
                    sight,
                    camera,
                    #[inline(always)]
                    |scan, row| match sight.lens.pinhole {
                        true => finish::<true>(scan, shading, sight, row, frame),
                        false => finish::<false>(scan, shading, sight, row, frame),
                    },
                );
            },
        );
    }
}

/// Follows lines of sight, row by row.
#[derive(Default)]
struct Tracer {
    cover: Cover,
    spans: Spans,
    scan: Scan,
    /// The numbers of the patches of a row, and their columns there.
    here: Vec<(usize, [usize; 4])>,
}

impl Tracer {
    /// Calls `done` for each part of a row that may show a surface.
    #[inline(always)]
    fn rows(
        &mut self,
        surface: &Revolution,
        sight: &Sight,
        camera: &Camera,
        done: impl FnMut(&Scan, usize),
    ) {
        let range = sight.range(surface);
        if range.near > Camera::NEAR && range.far.is_finite() {
            self.cover.set(surface, sight, camera);
            match sight.lens.pinhole {
                true => self.covered::<true>(sight, done),
                false => self.covered::<false>(sight, done),
            }
        } else {
            self.spans.set(surface);
            self.everywhere(surface, sight, camera, done);
        }
    }

    /// Only where spans may show.
    #[inline(always)]
    fn covered<const PINHOLE: bool>(&mut self, sight: &Sight, mut done: impl FnMut(&Scan, usize)) {
        let Tracer { cover, scan, here, .. } = self;
        let top = cover.patches.iter().map(|p| p.rows[0]).min().unwrap_or(0);
        let bottom = cover.patches.iter().map(|p| p.rows[1]).max().unwrap_or(0);
        for row in top..bottom {
            here.clear();
            let (mut first, mut end) = (usize::MAX, 0);
            for (number, patch) in cover.patches.iter().enumerate() {
                if (patch.rows[0] <= row) & (row < patch.rows[1]) {
                    let columns = cover.columns(patch, row);
                    if columns[0] < columns[3] {
                        (first, end) = (first.min(columns[0]), end.max(columns[3]));
                        here.push((number, columns));
                    }
                }
            }
            while first < end {
                scan.begin::<PINHOLE>(sight, row, [first, end]);
                for (number, [from, left, right, past]) in here.iter() {
                    let Some(patch) = cover.patches.get(*number) else { continue };
                    scan.test::<PINHOLE>(patch, [[*from, *left], [*right, *past]]);
                }
                done(scan, row);
                first += MOST;
            }
        }
    }

    /// Of a surface that may reach behind the near plane.
    #[inline(always)]
    fn everywhere(
        &mut self,
        surface: &Revolution,
        sight: &Sight,
        camera: &Camera,
        mut done: impl FnMut(&Scan, usize),
    ) {
        let [columns, rows] = sight.window(surface, camera);
        for row in rows[0]..rows[1] {
            let mut from = columns[0];
            while from < columns[1] {
                match sight.lens.pinhole {
                    true => self.scan.begin::<true>(sight, row, [from, columns[1]]),
                    false => self.scan.begin::<false>(sight, row, [from, columns[1]]),
                }
                for at in (0..self.scan.window()[1] - from).step_by(LANES) {
                    let rays = sight.rays(centres(from + at, row).each_ref());
                    self.scan.note(at, &self.spans.nearest(&rays));
                }
                done(&self.scan, row);
                from += MOST;
            }
        }
    }
}

/// Writes what a part of a row shows.
#[inline(always)]
fn finish<const PINHOLE: bool>(
    scan: &Scan,
    shading: &Shading,
    sight: &Sight,
    row: usize,
    frame: &mut Frame,
) {
    let ([from, past], mut at) = (scan.window(), 0);
    while from + at < past {
        let (seen, count) = (scan.seen(at), (past - from - at).min(LANES));
        let first = row * frame.width as usize + from + at;
        let mut depth = [0.0; LANES];
        for i in 0..LANES {
            depth[i] = seen.depth[i] as f32;
        }
        write(&mut frame.depth, [first, count], &depth);
        let there = f32x8::from(depth).simd_lt(f32x8::splat(f32::INFINITY)).to_bitmask();
        if there != 0 && !frame.part.is_empty() {
            let mut shown = Shown::NOTHING;
            shading.show(sight, &scan.lines::<PINHOLE>(sight, at), &seen, there, &mut shown);
            write(&mut frame.part, [first, count], &shown.part);
            write(&mut frame.normal, [first, count], &shown.normal);
        }
        at += LANES;
    }
}

/// Writes the first of some values.
#[inline(always)]
fn write<T: Copy>(list: &mut [T], [first, count]: [usize; 2], values: &[T; LANES]) {
    let Some((_, list)) = list.split_at_mut_checked(first) else { return };
    match list.first_chunk_mut() {
        Some(list) if count == LANES => *list = *values,
        _ => list.iter_mut().zip(values).take(count).for_each(|(place, v)| *place = *v),
    }
}

#[cfg(test)]
#[path = "frame_tests.rs"]
mod tests;
