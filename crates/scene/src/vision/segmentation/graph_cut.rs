//! An object cut out of its window along edges: the smallest cut of the graph of its pixels
//! (Boykov & Jolly 2001, "Interactive graph cuts for optimal boundary & region segmentation of
//! objects in N-D images", ICCV, 105-112), with colours learned from the last cut as in
//! GrabCut (Rother et al. 2004, ACM Trans. Graphics 23, 309-314). What is known about a pixel
//! is averaged with its mirror image about the axis.

use super::colours::Known;
use super::max_flow::Grid;
use super::window::Window;
use crate::vision::candidates::area::{Area, largest};
use crate::vision::candidates::components::components;
use crate::vision::candidates::pixels::Pixels;

/// Number of times that colours are learned.
const ESTIMATES: usize = 3;
/// Weights of the log odds of a pixel's colour and of those of its position, and the cost of
/// parting two neighbours of the same colour, nats.
const COLOUR: f32 = 0.5;
const POSITION: f32 = 1.0;
const COUPLING: f32 = 4.0;
/// Beyond this multiple of the frame's size nothing is of the object.
const OUTSIDE: f32 = 1.06;
/// Weights of a pixel cannot be above this many nats; what was pointed out is above them.
const MOST: f32 = 100.0;
/// Units of cost per nat.
const UNITS: f32 = 256.0;

/// Returns the object's pixels without holes; `None` if nothing stands out.
pub fn cut(window: &Window, known: &Known) -> Option<Area> {
    let width = window.picture.width;
    let mirrored = mirrored(window);
    let grid = Grid::new(width, window.picture.height, similarities(window));
    let mut on: Option<Vec<bool>> = None;
    for _ in 0..ESTIMATES {
        let colours = known.colours(&known.belief(on.as_deref()));
        let own: Vec<f32> = colours
            .iter()
            .zip(&known.prior)
            .map(|(c, prior)| COLOUR * c + POSITION * prior)
            .collect();
        let terminal: Vec<i32> = (0..own.len())
            .map(|p| {
                let both = mirrored[p].map_or(own[p], |q| 0.5 * (own[p] + own[q]));
                let odds = match (known.pointed[p], known.out[p] < OUTSIDE) {
                    (1.0, _) => 4.0 * MOST,
                    (-1.0, _) => -4.0 * MOST,
                    (_, false) => -MOST,
                    _ => both.clamp(-MOST, MOST),
                };
                (UNITS * odds) as i32
            })
            .collect();
        on = Some(grid.object(&terminal));
    }
    let whole = connected(width, &on?, &known.pointed)?;
    let filled = whole.clone().filled();
    let beside = |(i, j): (usize, usize)| known.pointed[j * width + i] < 0.0;
    Some(if filled.points().any(beside) { whole } else { filled })
}

/// Returns the largest part of the object and those that were pointed out.
fn connected(width: usize, on: &[bool], pointed: &[f32]) -> Option<Area> {
    let mut area = largest(width, on)?;
    let (of, sizes) = components(width, on);
    let mut wanted = vec![false; sizes.len()];
    of.iter().zip(pointed).for_each(|(number, sign)| wanted[*number as usize] |= *sign > 0.0);
    let parts = Pixels::new(width, on.len() / width, |p| on[p] && wanted[of[p] as usize]);
    area.pixels.add(&parts);
    Area::of(area.pixels)
}

/// Returns for each pixel the one at its mirror image about the frame's axis, if that is in
/// the window.
fn mirrored(window: &Window) -> Vec<Option<usize>> {
    let (w, h) = (window.picture.width, window.picture.height);
    let image = |at: [f64; 2]| {
        let [u, v] = window.frame.within(at);
        let [x, y] = window.frame.outside([-u, v]);
        let inside = x >= 0.0 && y >= 0.0 && x < w as f64 && y < h as f64;
        inside.then(|| y as usize * w + x as usize)
    };
    window.centres().map(image).collect()
}

/// Returns what it costs to part two neighbours: less where their colours differ.
fn similarities(window: &Window) -> impl Fn(usize, usize) -> i32 {
    let (w, lab) = (window.picture.width, &window.picture.lab);
    let squared = move |p: usize, q: usize| {
        let (a, b) = (lab[p], lab[q]);
        (0..3).map(|c| (a[c] - b[c]) * (a[c] - b[c])).sum::<f32>()
    };
    let steps = (0..lab.len()).filter(|p| p % w + 1 < w).map(|p| squared(p, p + 1));
    let mean = steps.map(f64::from).sum::<f64>() / lab.len() as f64;
    let beta = 0.5 / mean.max(1e-3) as f32;
    move |p: usize, q: usize| {
        let slanted = p % w != q % w && p / w != q / w;
        let near = if slanted { std::f32::consts::FRAC_1_SQRT_2 } else { 1.0 };
        (UNITS * near * COUPLING * libm::expf(-beta * squared(p, q))) as i32
    }
}
