//! Segments by minimum spanning forests (Felzenszwalb & Huttenlocher 2004, "Efficient
//! graph-based image segmentation", IJCV 59, 167-181).

use super::features::PictureFeatures;

/// Pairs of 8-connected pixels with the distance of their colours, nearest first.
pub struct Edges {
    pixels: usize,
    edges: Vec<(f32, u32, u32)>,
}

impl Edges {
    /// Returns the pairs of a picture, with smoothed colours.
    pub fn of(picture: &PictureFeatures) -> Edges {
        let (w, h) = (picture.width, picture.height);
        let mut edges = Vec::with_capacity(4 * w * h);
        for p in 0..w * h {
            let (i, j) = (p % w, p / w);
            let (right, below) = (i + 1 < w, j + 1 < h);
            let falling = (right && below, p + w + 1);
            let rising = (i > 0 && below, p + w - 1);
            let next = [(right, p + 1), (below, p + w), falling, rising];
            for (_, q) in next.into_iter().filter(|(there, _)| *there) {
                edges.push((distance(picture.smooth[p], picture.smooth[q]), p as u32, q as u32));
            }
        }
        // A stable sort: equal distances stay in raster order.
        edges.sort_by(|a, b| a.0.total_cmp(&b.0));
        Edges { pixels: w * h, edges }
    }
}

/// Returns the distance of two colours.
pub fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
}

/// Trees of pixels: the root represents its segment.
struct Forest {
    parent: Vec<u32>,
    size: Vec<u32>,
    /// The longest edge of a root's tree.
    inner: Vec<f32>,
}

impl Forest {
    fn root(&mut self, mut p: u32) -> u32 {
        while self.parent[p as usize] != p {
            let above = self.parent[self.parent[p as usize] as usize];
            self.parent[p as usize] = above;
            p = above;
        }
        p
    }

    fn join(&mut self, a: u32, b: u32, length: f32) {
        let (a, b) = if self.size[a as usize] < self.size[b as usize] { (b, a) } else { (a, b) };
        self.parent[b as usize] = a;
        self.size[a as usize] += self.size[b as usize];
        self.inner[a as usize] = length;
    }
}

/// Returns the segment number of every pixel, and the number of segments. `k` is by how
/// much an edge to another segment must exceed the longest edge within, for a segment of
/// one pixel; it decreases with size. Segments of fewer than `least` pixels are joined to
/// their nearest neighbour.
pub fn felzenszwalb(edges: &Edges, k: f32, least: u32) -> (Vec<u32>, usize) {
    let n = edges.pixels;
    let mut forest =
        Forest { parent: (0..n as u32).collect(), size: vec![1; n], inner: vec![0.0; n] };
    for &(length, p, q) in &edges.edges {
        let (a, b) = (forest.root(p), forest.root(q));
        let allowed = |r: u32| forest.inner[r as usize] + k / forest.size[r as usize] as f32;
        if a != b && length <= allowed(a).min(allowed(b)) {
            forest.join(a, b, length);
        }
    }
    for &(length, p, q) in &edges.edges {
        let (a, b) = (forest.root(p), forest.root(q));
        if a != b && forest.size[a as usize].min(forest.size[b as usize]) < least {
            forest.join(a, b, length);
        }
    }
    let mut number = vec![u32::MAX; n];
    let mut count = 0;
    let labels = (0..n as u32)
        .map(|p| {
            let root = forest.root(p) as usize;
            if number[root] == u32::MAX {
                number[root] = count;
                count += 1;
            }
            number[root]
        })
        .collect();
    (labels, count as usize)
}
