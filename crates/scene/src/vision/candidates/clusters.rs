//! Clusters of pixels by k-means from a deterministic start. The clusters' components are
//! regions, and a codebook assigns every pixel a letter for histograms.

use super::area::Area;
use super::components::components;
use super::features::PictureFeatures;
use super::pixels::Pixels;
use pcadlang_numerics::num::simd::vectorised;

/// Number of coordinates of a pixel: L*, a*, b*, the local deviation of L*, and its
/// position.
const COORDINATES: usize = 6;
type Point = [f32; COORDINATES];

/// The maximum number of clusters that regions are made from.
const MOST: usize = 12;
/// Weights of position (along the longer side of the picture, in units of L*) and of the
/// local deviation.
pub const WEIGHTS: [[f32; 2]; 4] = [[0.0, 0.0], [0.0, 1.0], [40.0, 0.5], [80.0, 1.0]];
/// The maximum number of letters of a codebook.
pub const LETTERS: usize = 48;
/// Approximate maximum number of pixels that clusters are fitted to.
const FITTED: usize = 1 << 12;
/// Rounds of k-means after each new centre.
const ROUNDS: usize = 4;
/// Number of points that are compared with a centre at a time.
const BLOCK: usize = 8;

/// Points as a list per coordinate, padded with zeros to whole blocks.
struct Points {
    count: usize,
    lists: [Vec<f32>; COORDINATES],
}

impl Points {
    fn new(points: &[Point]) -> Points {
        let list = |c: usize| {
            let mut list: Vec<f32> = points.iter().map(|p| p[c]).collect();
            list.resize(points.len().next_multiple_of(BLOCK), 0.0);
            list
        };
        Points { count: points.len(), lists: std::array::from_fn(list) }
    }

    fn at(&self, i: usize) -> Point {
        std::array::from_fn(|c| self.lists[c][i])
    }

    /// Returns the nearest centre of every point, the first one among equals.
    fn nearest(&self, centres: &[Point]) -> Vec<u32> {
        let lists = self.lists.each_ref().map(|list| list.as_chunks::<BLOCK>().0);
        let mut labels = vec![0u32; self.lists[0].len()];
        vectorised(
            #[inline(always)]
            || {
                for (block, labels) in labels.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
                    let lists = lists.map(|list| list[block]);
                    *labels = nearest(&lists, centres);
                }
            },
        );
        labels.truncate(self.count);
        labels
    }
}

/// Returns the nearest centre of each point of a block.
#[inline(always)]
fn nearest(lists: &[[f32; BLOCK]; COORDINATES], centres: &[Point]) -> [u32; BLOCK] {
    let (mut labels, mut least) = ([0u32; BLOCK], [f32::INFINITY; BLOCK]);
    for (k, centre) in centres.iter().enumerate() {
        for i in 0..BLOCK {
            let mut d = 0.0;
            for c in 0..COORDINATES {
                d += (lists[c][i] - centre[c]) * (lists[c][i] - centre[c]);
            }
            labels[i] = if d < least[i] { k as u32 } else { labels[i] };
            least[i] = if d < least[i] { d } else { least[i] };
        }
    }
    labels
}

/// Returns the coordinates, scaled by weights, of all pixels and of the pixels on a grid
/// that clusters are fitted to.
fn points(picture: &PictureFeatures, [place, texture]: [f32; 2]) -> (Points, Points) {
    let (w, h) = (picture.width, picture.height);
    let unit = place / w.max(h) as f32;
    let point = |p: usize| {
        let [l, a, b] = picture.lab[p];
        [l, a, b, texture * picture.deviation[p], unit * (p % w) as f32, unit * (p / w) as f32]
    };
    let all: Vec<Point> = (0..w * h).map(point).collect();
    let step = (1..).find(|s| w.div_ceil(*s) * h.div_ceil(*s) <= FITTED).unwrap_or(1);
    let some = (0..h).step_by(step).flat_map(|j| (0..w).step_by(step).map(move |i| j * w + i));
    (Points::new(&all), Points::new(&some.map(point).collect::<Vec<_>>()))
}

/// Number, sums and sums of squares of a cluster's points, by coordinate.
#[derive(Clone, Copy, Default)]
struct Moments {
    count: f64,
    sums: [f64; COORDINATES],
    squares: [f64; COORDINATES],
}

impl Moments {
    fn mean(&self) -> Point {
        self.sums.map(|s| (s / self.count) as f32)
    }

    /// Returns the sum of squares about the mean.
    fn spread(&self, c: usize) -> f64 {
        self.squares[c] - self.sums[c] * self.sums[c] / self.count.max(1.0)
    }
}

/// A growing set of clusters: the cluster with the largest sum of squares is split along
/// its widest coordinate.
struct Means {
    points: Points,
    labels: Vec<u32>,
    centres: Vec<Point>,
}

impl Means {
    fn new(points: Points) -> Means {
        let labels = vec![0; points.count];
        let mut means = Means { points, labels, centres: vec![[0.0; COORDINATES]] };
        means.round();
        means
    }

    fn moments(&self) -> Vec<Moments> {
        let mut all = vec![Moments::default(); self.centres.len()];
        for (i, l) in self.labels.iter().enumerate() {
            let (m, p) = (&mut all[*l as usize], self.points.at(i).map(f64::from));
            m.count += 1.0;
            for c in 0..COORDINATES {
                m.sums[c] += p[c];
                m.squares[c] += p[c] * p[c];
            }
        }
        all
    }

    /// Runs some rounds of k-means; stops when nothing changes any more.
    fn rounds(&mut self, most: usize) {
        for _ in 0..most {
            let last = self.round();
            if self.labels == last {
                break;
            }
        }
    }

    /// Moves centres to the means of their points, and assigns points to their nearest
    /// centres. A centre without points stays. Returns the labels that points had.
    fn round(&mut self) -> Vec<u32> {
        let all = self.moments();
        let pairs = self.centres.iter_mut().zip(&all).filter(|(_, m)| m.count > 0.0);
        pairs.for_each(|(centre, m)| *centre = m.mean());
        let labels = self.points.nearest(&self.centres);
        std::mem::replace(&mut self.labels, labels)
    }

    /// Adds a cluster by splitting one; returns false if all points in it are equal.
    fn split(&mut self) -> bool {
        let all = self.moments();
        let spread = |k: usize| (0..COORDINATES).map(|c| all[k].spread(c)).sum::<f64>();
        let widest =
            (0..all.len()).fold(0, |best, k| if spread(k) > spread(best) { k } else { best });
        let cluster = all[widest];
        let wider = |best, c| if cluster.spread(c) > cluster.spread(best) { c } else { best };
        let axis = (0..COORDINATES).fold(0, wider);
        // Less is rounding error.
        if cluster.spread(axis) < 1e-3 * cluster.count {
            return false;
        }
        let step = (cluster.spread(axis) / cluster.count).sqrt() as f32;
        let middle = cluster.mean();
        let (mut low, mut high) = (middle, middle);
        low[axis] -= step;
        high[axis] += step;
        let new = self.centres.len() as u32;
        for i in (0..self.points.count)
            .filter(|i| self.labels[*i] as usize == widest)
            .collect::<Vec<_>>()
        {
            if self.points.lists[axis][i] > middle[axis] {
                self.labels[i] = new;
            }
        }
        self.centres[widest] = low;
        self.centres.push(high);
        true
    }
}

/// Returns the components of clusters that have at least `least` pixels, with weights of
/// position and variation.
pub fn regions(picture: &PictureFeatures, weights: [f32; 2], least: usize) -> Vec<Area> {
    let (w, h) = (picture.width, picture.height);
    let mut out = Vec::new();
    let (all, some) = points(picture, weights);
    let mut means = Means::new(some);
    while means.centres.len() < MOST && means.split() {
        means.rounds(ROUNDS);
        let (of, sizes) = components(w, &all.nearest(&means.centres));
        let large = |size: &usize| (*size >= least).then(|| Pixels::none(w, h));
        let mut large: Vec<Option<Pixels>> = sizes.iter().map(large).collect();
        for (p, number) in of.iter().enumerate() {
            if let Some(pixels) = &mut large[*number as usize] {
                pixels.insert(p % w, p / w);
            }
        }
        out.extend(large.into_iter().flatten().filter_map(Area::of));
    }
    out
}

/// Assigns every pixel a letter below [`LETTERS`] by colour and texture.
pub fn codebook(picture: &PictureFeatures) -> Vec<u8> {
    let (all, some) = points(picture, [0.0, 1.0]);
    let mut means = Means::new(some);
    while means.centres.len() < LETTERS && means.split() {}
    means.rounds(ROUNDS);
    all.nearest(&means.centres).into_iter().map(|l| l as u8).collect()
}
