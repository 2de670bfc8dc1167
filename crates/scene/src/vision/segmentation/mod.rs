//! Where an object of revolution is in a photograph, given what a user pointed out: guesses
//! of its outline in two dimensions, by three methods that err in different ways. All are
//! functions of their input alone, with the same bits on any machine.

mod colours;
mod ellipse;
mod frame;
mod graph_cut;
mod max_flow;
mod outline;
mod symmetric;
#[cfg(test)]
mod tests;
mod window;

use crate::vision::candidates::Axis;
use crate::vision::candidates::area::Area;
use crate::vision::candidates::mirror::{mirror_at, mirrors};
use crate::vision::candidates::pixels::Pixels;
use crate::vision::{Hint, Mask, Photo};
use colours::Known;
use frame::Frame;
use pcadlang_numerics::platform::threads::map_side_by_side;
use window::Window;

/// Pixels along the longer side of an object, for guesses and for masks.
const LONGER: f64 = 96.0;
const DRAWN: f64 = 128.0;
/// Of two outlines with a larger intersection over union than this, only the better one is
/// kept, and no more than this many.
const OVERLAP: f64 = 0.85;
const OUTLINES: usize = 3;
/// Axes farther than this from one that was pointed out are not it, radians.
const APART: f64 = std::f64::consts::FRAC_PI_4;

/// How an outline was guessed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// An ellipse that fills the box.
    Ellipse,
    /// The smallest cut of a graph of pixels.
    Cut,
    /// The best symmetric outline.
    Symmetric,
}

impl Method {
    /// All methods.
    pub const ALL: [Method; 3] = [Method::Ellipse, Method::Cut, Method::Symmetric];
}

/// A guess of an object's outline.
#[derive(Clone, Debug, PartialEq)]
pub struct Guess {
    /// How it was guessed.
    pub method: Method,
    /// Its pixels in the whole photograph, at a working resolution.
    pub mask: Mask,
    /// Its axes, in pixels of the photograph; the likelier one first.
    pub axes: Vec<Axis>,
    /// Its mean intersection over union with the first guesses of the other methods; 0
    /// without any.
    pub score: f64,
}

/// Returns guesses of the outline of the object that a hint points out by a box or an axis:
/// by some methods, in their order and the likelier ones first. None if neither is
/// given, or if they are not in the photograph.
pub fn guesses(photo: &Photo, hint: &Hint, methods: &[Method]) -> Vec<Guess> {
    let Some(frame) = Frame::of(hint, photo.width(), photo.height()) else { return Vec::new() };
    let window = Window::new(photo, &frame, LONGER);
    let known = Known::new(&window, hint);
    let found = map_side_by_side(methods, |method| match method {
        Method::Ellipse => ellipses(&window),
        Method::Cut => {
            let area = graph_cut::cut(&window, &known);
            area.map(|area| cut_guess(&window, area)).into_iter().collect()
        }
        Method::Symmetric => symmetric_guesses(&window, &known),
    });
    let found: Vec<Found> = found.into_iter().flatten().collect();
    let first = |method: Method| found.iter().find(|f| f.method == method).map(|f| &f.area);
    let score = |found: &Found| {
        let others: Vec<f64> = Method::ALL
            .into_iter()
            .filter(|m| *m != found.method)
            .filter_map(first)
            .map(|area| area.iou(&found.area))
            .collect();
        others.iter().sum::<f64>() / others.len().max(1) as f64
    };
    let guess = |f: &Found| {
        let (mask, score) = (window.mask(&f.area)?, score(f));
        Some(Guess { method: f.method, mask, axes: f.axes.clone(), score })
    };
    found.iter().filter_map(guess).collect()
}

/// A guess in a window.
struct Found {
    method: Method,
    area: Area,
    axes: Vec<Axis>,
}

/// The axis of an area about that of a frame.
fn own_axis(window: &Window, area: &Area, frame: &Frame) -> Axis {
    window.axis(area, &mirror_at(area, frame.lean, frame.centre))
}

fn ellipses(window: &Window) -> Vec<Found> {
    let (w, h) = (window.picture.width, window.picture.height);
    let found = |frame: Frame| {
        let at = |p: usize| [(p % w) as f64 + 0.5, (p / w) as f64 + 0.5];
        let area = Area::of(Pixels::new(w, h, |p| ellipse::contains(&frame, at(p))))?;
        let mut axes = vec![own_axis(window, &area, &frame)];
        if !frame.axis {
            let lean = frame.lean + std::f64::consts::FRAC_PI_2;
            axes.push(own_axis(window, &area, &Frame { lean, ..frame }));
        }
        Some(Found { method: Method::Ellipse, area, axes })
    };
    ellipse::ellipses(&window.frame).into_iter().filter_map(found).collect()
}

fn cut_guess(window: &Window, area: Area) -> Found {
    let frame = &window.frame;
    let near = |angle: f64| {
        let d = (angle - frame.lean).rem_euclid(std::f64::consts::PI);
        d.min(std::f64::consts::PI - d) < APART
    };
    let mut mirrors = mirrors(&area);
    if frame.axis {
        mirrors.retain(|m| near(m.angle));
        if mirrors.is_empty() {
            mirrors.push(mirror_at(&area, frame.lean, frame.centre));
        }
    }
    let axes = mirrors.iter().map(|m| window.axis(&area, m)).collect();
    Found { method: Method::Cut, area, axes }
}

fn symmetric_guesses(window: &Window, known: &Known) -> Vec<Found> {
    let mut kept: Vec<Found> = Vec::new();
    for found in symmetric::outlines(window, known) {
        let Some(area) = found.area(window) else { continue };
        if kept.len() < OUTLINES && !kept.iter().any(|k| k.area.overlaps(&area, OVERLAP)) {
            let axes = vec![own_axis(window, &area, &found.frame)];
            kept.push(Found { method: Method::Symmetric, area, axes });
        }
    }
    kept
}

/// Returns the axes of a mask of any resolution that a user drew, in pixels of the
/// photograph: its best mirror, and the best one at least 30 degrees from it, with the
/// evidence of rims in the photograph. None if it is empty.
pub fn from_mask(photo: &Photo, mask: &Mask) -> Vec<Axis> {
    let (w, h) = (mask.width() as usize, mask.height() as usize);
    let Some(whole) = Area::of(Pixels::new(w, h, |p| mask.data()[p])) else { return Vec::new() };
    let scale = [f64::from(photo.width()) / w as f64, f64::from(photo.height()) / h as f64];
    let side = |k: usize| whole.bounds[k] as f64 * scale[k % 2];
    let frame = Frame::upright([side(0), side(1), side(2), side(3)]);
    let window = Window::new(photo, &frame, DRAWN);
    let on = |at: [f64; 2]| {
        let [x, y] = window.outside(at);
        whole.at(x / scale[0], y / scale[1])
    };
    let on: Vec<bool> = window.centres().map(on).collect();
    let (w, h) = (window.picture.width, window.picture.height);
    let Some(area) = Area::of(Pixels::new(w, h, |p| on[p])) else { return Vec::new() };
    mirrors(&area).iter().map(|m| window.axis(&area, m)).collect()
}
