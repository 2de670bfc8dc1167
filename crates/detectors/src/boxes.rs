//! Boxes in pictures: left, top, right, bottom.

/// Returns the intersection over union of two boxes; 0 if both are empty.
pub fn overlap(a: [f64; 4], b: [f64; 4]) -> f64 {
    let area = |[l, t, r, b]: [f64; 4]| (r - l).max(0.0) * (b - t).max(0.0);
    let both = area([a[0].max(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].min(b[3])]);
    both / (area(a) + area(b) - both).max(1e-12)
}

/// True if a position is in a box, its sides included.
pub fn contains([left, top, right, bottom]: [f64; 4], [x, y]: [f64; 2]) -> bool {
    (left..=right).contains(&x) && (top..=bottom).contains(&y)
}

/// Returns the box of left, top, width and height.
pub fn sides([x, y, w, h]: [f64; 4]) -> [f64; 4] {
    [x, y, x + w, y + h]
}

/// Returns the smallest box around points; without any, an infinite one inside out.
pub fn around(points: impl Iterator<Item = [f64; 2]>) -> [f64; 4] {
    let none = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    points.fold(none, |[l, t, r, b], [x, y]| [l.min(x), t.min(y), r.max(x), b.max(y)])
}

#[cfg(test)]
mod tests {
    use super::overlap;

    #[test]
    fn overlap_is_intersection_over_union() {
        let of = |a: [f64; 4], b: [f64; 4]| {
            assert_eq!(overlap(a, b), overlap(b, a));
            overlap(a, b)
        };
        let unit = [0.0, 0.0, 1.0, 1.0];
        assert_eq!(of(unit, unit), 1.0);
        assert_eq!(of(unit, [0.5, 0.0, 1.5, 1.0]), 0.5 / 1.5);
        assert_eq!(of(unit, [0.0, 0.5, 1.0, 1.5]), 0.5 / 1.5);
        assert_eq!(of(unit, [0.5, 0.5, 1.5, 2.5]), 0.25 / 2.75);
        assert_eq!(of([-1.0, -1.0, 1.0, 1.0], [-0.5, -0.5, 0.5, 0.0]), 0.5 / 4.0);
        // Beside it, above it, and without an area.
        assert_eq!(of(unit, [2.0, 0.0, 3.0, 1.0]), 0.0);
        assert_eq!(of(unit, [0.0, -2.0, 1.0, -1.0]), 0.0);
        assert_eq!(of([0.5; 4], [0.5; 4]), 0.0);
    }
}
