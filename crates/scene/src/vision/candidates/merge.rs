//! Hierarchies of regions: the two most similar neighbours are merged until one region is
//! left, and every region on the way is a proposal (Uijlings et al. 2013, "Selective
//! search for object recognition", IJCV 104, 154-171, section 3).

use super::area::Area;
use super::features::PictureFeatures;
use super::pixels::Pixels;

/// Number of bins of each of L*, a* and b*.
const BINS: usize = 20;
/// Number of directions and of strengths of the gradient of L*.
const DIRECTIONS: usize = 8;
const STRENGTHS: usize = 4;

/// The similarity measure of neighbours.
#[derive(Clone, Copy, PartialEq)]
pub enum Rule {
    /// Colour, texture, small size of both, and how well they fill their common bounding
    /// box.
    Likeness,
    /// Colour, and the absence of an edge between them.
    Edges,
}

/// A region of the hierarchy.
#[derive(Clone)]
struct Region {
    size: f32,
    bounds: [usize; 4],
    /// Fractions of the pixels by colour; each coordinate sums to a third.
    colour: [f32; 3 * BINS],
    /// Fractions of the pixels by gradient.
    texture: [f32; DIRECTIONS * STRENGTHS],
    pixels: Pixels,
}

/// Two neighbours, with the sum of the gradient along their border, its length, and their
/// similarity.
#[derive(Clone, Copy)]
struct Pair {
    a: usize,
    b: usize,
    edge: f32,
    length: f32,
    alike: f32,
}

/// Returns the intersection of two normalised histograms.
fn common(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.min(*b)).sum()
}

/// Returns the weighted mean of two histograms.
fn mixed<const N: usize>(a: &[f32; N], b: &[f32; N], (wa, wb): (f32, f32)) -> [f32; N] {
    std::array::from_fn(|i| (wa * a[i] + wb * b[i]) / (wa + wb))
}

impl Region {
    fn joined(&self, other: &Region) -> Region {
        let mut pixels = self.pixels.clone();
        pixels.add(&other.pixels);
        let (a, b, weights) = (self.bounds, other.bounds, (self.size, other.size));
        Region {
            size: self.size + other.size,
            bounds: [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])],
            colour: mixed(&self.colour, &other.colour, weights),
            texture: mixed(&self.texture, &other.texture, weights),
            pixels,
        }
    }
}

/// Returns the segments of a picture as regions.
fn regions(picture: &PictureFeatures, labels: &[u32], count: usize) -> Vec<Region> {
    let empty = Region {
        size: 0.0,
        bounds: [picture.width, picture.height, 0, 0],
        colour: [0.0; 3 * BINS],
        texture: [0.0; DIRECTIONS * STRENGTHS],
        pixels: Pixels::none(picture.width, picture.height),
    };
    let mut all = vec![empty; count];
    for (p, label) in labels.iter().enumerate() {
        let r = &mut all[*label as usize];
        let (i, j, b) = (p % picture.width, p / picture.width, r.bounds);
        r.bounds = [b[0].min(i), b[1].min(j), b[2].max(i + 1), b[3].max(j + 1)];
        r.size += 1.0;
        r.pixels.insert(i, j);
        let [l, u, v] = picture.lab[p];
        for (c, part) in [l / 100.0, (u + 60.0) / 120.0, (v + 60.0) / 120.0].into_iter().enumerate()
        {
            r.colour[c * BINS + ((part * BINS as f32) as usize).min(BINS - 1)] += 1.0 / 3.0;
        }
        r.texture[texture(picture.slope.0[p], picture.slope.1[p])] += 1.0;
    }
    for r in &mut all {
        r.colour.iter_mut().chain(&mut r.texture).for_each(|v| *v /= r.size.max(1.0));
    }
    all
}

/// Returns the bin of a gradient.
fn texture(x: f32, y: f32) -> usize {
    let turn = libm::atan2f(y, x) / std::f32::consts::TAU + 0.5;
    let direction = ((turn * DIRECTIONS as f32) as usize).min(DIRECTIONS - 1);
    let strength = [1.0, 3.0, 8.0].iter().filter(|s| libm::hypotf(x, y) > **s).count();
    direction * STRENGTHS + strength
}

/// Returns neighbouring segments, in the order of their numbers.
fn pairs(picture: &PictureFeatures, labels: &[u32]) -> Vec<Pair> {
    let (w, h) = (picture.width, picture.height);
    let mut borders = Vec::new();
    for p in 0..w * h {
        let next = [(p % w + 1 < w, p + 1), (p / w + 1 < h, p + w)];
        for (_, q) in next.into_iter().filter(|(there, q)| *there && labels[*q] != labels[p]) {
            let edge = picture.gradient.magnitude[p].max(picture.gradient.magnitude[q]);
            borders.push((
                labels[p].min(labels[q]) as usize,
                labels[p].max(labels[q]) as usize,
                edge,
            ));
        }
    }
    borders.sort_by_key(|b| (b.0, b.1));
    let same = borders.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1));
    let pair = |same: &[(usize, usize, f32)]| {
        let edge = same.iter().map(|e| e.2).sum();
        Pair { a: same[0].0, b: same[0].1, edge, length: same.len() as f32, alike: 0.0 }
    };
    same.map(pair).collect()
}

/// Returns the similarity of two neighbours.
fn alike(picture: &PictureFeatures, rule: Rule, all: &[Region], pair: &Pair) -> f32 {
    let (a, b) = (&all[pair.a], &all[pair.b]);
    let colour = common(&a.colour, &b.colour);
    let pixels = picture.pixels() as f32;
    match rule {
        Rule::Edges => {
            // Small regions are preferred here too; otherwise specks would be left to the
            // end.
            let edge = (pair.edge / pair.length / picture.strong).min(1.0);
            colour - 2.0 * edge - (a.size.min(b.size) / pixels).sqrt()
        }
        Rule::Likeness => {
            let both = [a.bounds, b.bounds];
            let low = |c: usize| both[0][c].min(both[1][c]);
            let high = |c: usize| both[0][c].max(both[1][c]);
            let around = ((high(2) - low(0)) * (high(3) - low(1))) as f32;
            let size = (a.size + b.size) / pixels;
            colour
                + common(&a.texture, &b.texture)
                + (1.0 - size)
                + (1.0 - (around / pixels - size))
        }
    }
}

/// Returns every region of the hierarchy over some segments that has `least` to `most`
/// pixels.
pub fn merge(
    picture: &PictureFeatures,
    (labels, count): &(Vec<u32>, usize),
    rule: Rule,
    least: usize,
    most: usize,
) -> Vec<Area> {
    let mut all = regions(picture, labels, *count);
    let mut pairs = pairs(picture, labels);
    for i in 0..pairs.len() {
        pairs[i].alike = alike(picture, rule, &all, &pairs[i]);
    }
    let better = |best: Pair, p: Pair| if p.alike > best.alike { p } else { best };
    while let Some(best) = pairs.iter().copied().reduce(better) {
        let new = all.len();
        all.push(all[best.a].joined(&all[best.b]));
        pairs = renamed(&pairs, best, new);
        for i in (0..pairs.len()).filter(|i| pairs[*i].b == new).collect::<Vec<_>>() {
            pairs[i].alike = alike(picture, rule, &all, &pairs[i]);
        }
    }
    let fits = |r: &Region| (least..=most).contains(&(r.size as usize));
    all.into_iter().filter(fits).filter_map(|r| Area::of(r.pixels)).collect()
}

/// Updates the pairs after `joined` has become region `new`, so that each of its
/// neighbours occurs once.
fn renamed(pairs: &[Pair], joined: Pair, new: usize) -> Vec<Pair> {
    let gone = |r: usize| r == joined.a || r == joined.b;
    let (touched, mut out): (Vec<Pair>, Vec<Pair>) =
        pairs.iter().partition(|p| gone(p.a) || gone(p.b));
    let mut renamed: Vec<Pair> = touched
        .into_iter()
        .filter(|p| !(gone(p.a) && gone(p.b)))
        .map(|p| Pair { a: if gone(p.a) { p.b } else { p.a }, b: new, ..p })
        .collect();
    renamed.sort_by_key(|p| p.a);
    for p in renamed {
        match out.last_mut() {
            Some(last) if (last.a, last.b) == (p.a, new) => {
                last.edge += p.edge;
                last.length += p.length;
            }
            _ => out.push(p),
        }
    }
    out
}
