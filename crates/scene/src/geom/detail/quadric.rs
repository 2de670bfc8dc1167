//! Quadric error metrics (Garland and Heckbert 1997): sums of squared distances from a
//! point to the planes of the faces it stands for.

use glam::DVec3;

/// A sum of squared distances to planes, as a function of the point: p' A p + 2 b' p + c
/// with a symmetric A.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quadric {
    /// xx, yy, zz.
    diagonal: DVec3,
    /// yz, zx, xy.
    mixed: DVec3,
    b: DVec3,
    c: f64,
}

impl Quadric {
    /// The quadric of the plane through a point with this unit normal.
    pub fn plane(normal: DVec3, through: DVec3) -> Quadric {
        let (n, d) = (normal, -normal.dot(through));
        let mixed = DVec3::new(n.y * n.z, n.z * n.x, n.x * n.y);
        Quadric { diagonal: n * n, mixed, b: n * d, c: d * d }
    }

    /// The sum at a point, never negative.
    pub fn at(&self, p: DVec3) -> f64 {
        let mixed = DVec3::new(p.y * p.z, p.z * p.x, p.x * p.y);
        (self.diagonal.dot(p * p) + 2.0 * (self.mixed.dot(mixed) + self.b.dot(p)) + self.c).max(0.0)
    }
}

impl std::ops::AddAssign for Quadric {
    fn add_assign(&mut self, other: Quadric) {
        self.diagonal += other.diagonal;
        self.mixed += other.mixed;
        self.b += other.b;
        self.c += other.c;
    }
}

impl std::ops::Add for Quadric {
    type Output = Quadric;

    fn add(mut self, other: Quadric) -> Quadric {
        self += other;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_squared_distances() {
        let planes = [
            (DVec3::new(2.0, -1.0, 0.5), DVec3::X),
            (DVec3::new(0.1, 0.7, 3.0), DVec3::new(1.0, 2.0, 3.0)),
        ];
        let p = DVec3::new(-0.4, 1.3, 0.8);
        let (mut sum, mut plain) = (Quadric::default(), 0.0);
        for (n, through) in planes.map(|(n, q)| (n.normalize(), q)) {
            sum += Quadric::plane(n, through);
            plain += (p - through).dot(n).powi(2);
        }
        assert!((sum.at(p) - plain).abs() < 1e-12 && (sum + sum).at(planes[0].1) >= 0.0);
    }
}
