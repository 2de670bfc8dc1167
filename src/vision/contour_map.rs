//! The contours of a picture: points between pixels, with their direction.

use image::{GrayImage, Luma};

/// Contour points of a picture of `width` x `height` pixels; pixel (0, 0) has its centre at (0.5, 0.5). All lists have one
/// entry for each point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContourMap {
    /// The picture's width in pixels.
    pub width: u32,
    /// The picture's height in pixels.
    pub height: u32,
    /// Positions, in pixels from the left edge.
    pub x: Vec<f32>,
    /// Positions, in pixels from the top edge.
    pub y: Vec<f32>,
    /// Unit tangents.
    pub tx: Vec<f32>,
    /// Unit tangents.
    pub ty: Vec<f32>,
    /// How marked the contour is there, 0 to 1.
    pub strength: Vec<f32>,
}

impl ContourMap {
    /// Reads a ready map: bright is contour. Lines thicker than a pixel are thinned (Zhang and Suen 1984); directions are
    /// those of the line around each point.
    pub fn from_image(image: &GrayImage) -> ContourMap {
        let (width, height) = image.dimensions();
        let (w, h) = (width as usize, height as usize);
        let mut on: Vec<bool> = image.pixels().map(|p| p.0[0] >= 128).collect();
        thin(&mut on, w, h);
        let mut map = ContourMap { width, height, ..ContourMap::default() };
        for i in (0..w * h).filter(|i| on[*i]) {
            let (x, y) = (i % w, i / w);
            let (tx, ty) = direction(&on, w, h, x, y);
            map.x.push(x as f32 + 0.5);
            map.y.push(y as f32 + 0.5);
            map.tx.push(tx);
            map.ty.push(ty);
            map.strength.push(f32::from(image.get_pixel(x as u32, y as u32).0[0]) / 255.0);
        }
        map
    }

    /// A picture of it: the strength at each point's pixel, black elsewhere.
    pub fn to_image(&self) -> GrayImage {
        let mut image = GrayImage::new(self.width, self.height);
        for ((x, y), s) in self.x.iter().zip(&self.y).zip(&self.strength) {
            if *x >= 0.0 && *y >= 0.0 && *x < self.width as f32 && *y < self.height as f32 {
                let Luma([old]) = *image.get_pixel(*x as u32, *y as u32);
                let new = (s.clamp(0.0, 1.0) * 255.0).round() as u8;
                image.put_pixel(*x as u32, *y as u32, Luma([old.max(new)]));
            }
        }
        image
    }

    /// The number of points.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }
}

/// Wears lines down to one pixel.
fn thin(on: &mut [bool], w: usize, h: usize) {
    // Neighbours clockwise from the one above.
    const AROUND: [(isize, isize); 8] = [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1)];
    loop {
        let mut changed = false;
        for pass in 0..2 {
            let mut gone = Vec::new();
            for i in (0..w * h).filter(|i| on[*i]) {
                let n = AROUND.map(|(dx, dy)| {
                    let (x, y) = ((i % w) as isize + dx, (i / w) as isize + dy);
                    x >= 0 && y >= 0 && x < w as isize && y < h as isize && on[y as usize * w + x as usize]
                });
                let count = n.iter().filter(|n| **n).count();
                let starts = (0..8).filter(|k| !n[*k] && n[(k + 1) % 8]).count();
                let open = if pass == 0 {
                    !(n[0] && n[2] && n[4]) && !(n[2] && n[4] && n[6])
                } else {
                    !(n[0] && n[2] && n[6]) && !(n[0] && n[4] && n[6])
                };
                if (2..=6).contains(&count) && starts == 1 && open {
                    gone.push(i);
                }
            }
            changed |= !gone.is_empty();
            gone.into_iter().for_each(|i| on[i] = false);
        }
        if !changed {
            return;
        }
    }
}

/// The main axis of the points within 3 pixels.
fn direction(on: &[bool], w: usize, h: usize, x: usize, y: usize) -> (f32, f32) {
    let (mut n, mut sx, mut sy, mut xx, mut xy, mut yy) = (0.0f32, 0.0, 0.0, 0.0, 0.0, 0.0);
    for v in y.saturating_sub(3)..(y + 4).min(h) {
        for u in x.saturating_sub(3)..(x + 4).min(w) {
            if on[v * w + u] {
                let (dx, dy) = (u as f32 - x as f32, v as f32 - y as f32);
                n += 1.0;
                sx += dx;
                sy += dy;
                xx += dx * dx;
                xy += dx * dy;
                yy += dy * dy;
            }
        }
    }
    let (xx, xy, yy) = (xx - sx * sx / n, xy - sx * sy / n, yy - sy * sy / n);
    let half = 0.5 * (xx - yy);
    let root = (half * half + xy * xy).sqrt();
    let (vx, vy) = if half >= 0.0 { (half + root, xy) } else { (xy, root - half) };
    let length = (vx * vx + vy * vy).sqrt();
    if length > 0.0 { (vx / length, vy / length) } else { (1.0, 0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thick_lines_become_thin_and_know_their_direction() {
        // A diagonal band three pixels wide.
        let image = GrayImage::from_fn(40, 40, |x, y| Luma([if x.abs_diff(y) <= 1 { 255 } else { 0 }]));
        let map = ContourMap::from_image(&image);
        assert!((30..=45).contains(&map.len()), "{} points", map.len());
        for i in 0..map.len() {
            assert!((map.x[i] - map.y[i]).abs() <= 1.0);
            if (5.0..35.0).contains(&map.x[i]) {
                assert!((map.tx[i] * map.ty[i] - 0.5).abs() < 0.1, "{} {}", map.tx[i], map.ty[i]);
            }
        }
    }

    #[test]
    fn there_and_back() {
        let mut image = GrayImage::new(9, 5);
        (1..8).for_each(|x| image.put_pixel(x, 2, Luma([200])));
        let map = ContourMap::from_image(&image);
        assert_eq!((map.len(), map.tx[3].abs(), map.ty[3]), (7, 1.0, 0.0));
        assert_eq!(map.to_image(), image);
        assert!(ContourMap::from_image(&GrayImage::new(0, 0)).is_empty());
        assert!(ContourMap::from_image(&GrayImage::new(3, 3)).is_empty());
        assert_eq!(ContourMap::from_image(&GrayImage::from_pixel(1, 1, Luma([255]))).len(), 1);
    }
}
