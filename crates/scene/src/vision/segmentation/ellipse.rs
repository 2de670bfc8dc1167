//! Ellipses that fill a box: the upright one, and for each sign those that lean so that
//! their bounding box is the same.

use super::frame::Frame;

/// How much more slender a leaning ellipse is than the upright one.
const SLENDER: [f64; 3] = [1.4, 2.0, 3.0];
/// Bound on the ratio of an ellipse's axes, and on its lean, radians.
const MOST_SLENDER: f64 = 6.0;
const MOST_LEAN: f64 = 0.85;

/// Returns the ellipses as frames: the one whose axes are those of the frame first, then
/// those that lean. About an axis that was pointed out there is only the first.
pub fn ellipses(frame: &Frame) -> Vec<Frame> {
    let mut all = vec![*frame];
    if frame.axis {
        return all;
    }
    let [w, h] = frame.half;
    for factor in SLENDER {
        // The axis may be the longer or the shorter of the two.
        let ratios = if h >= w { vec![h / w * factor] } else { vec![] };
        let ratios = ratios.into_iter().chain((w >= h).then(|| h / w / factor));
        for ratio in ratios {
            let slender = ratio.max(1.0 / ratio);
            let Some((lean, half)) = leaning(w, h, ratio) else { continue };
            if slender <= MOST_SLENDER && lean <= MOST_LEAN {
                let ellipse = Frame { half, lean, ..*frame };
                all.extend([Frame { lean: -lean, ..ellipse }, ellipse]);
            }
        }
    }
    all
}

/// Returns the lean, above 0, and half the axes (across and along) of the ellipse whose axes
/// have a ratio (along to across) and whose bounding box has half the sizes `w` and `h`; `None`
/// if there is none. With axes `a` and `b` at a lean `t` the box satisfies
/// `w^2 = a^2 cos^2 t + b^2 sin^2 t` and `h^2 = a^2 sin^2 t + b^2 cos^2 t`.
fn leaning(w: f64, h: f64, ratio: f64) -> Option<(f64, [f64; 2])> {
    let (sum, square) = (w * w + h * h, ratio * ratio);
    let twice = (h * h - w * w) / sum * (square + 1.0) / (square - 1.0);
    let across = (sum / (square + 1.0)).sqrt();
    (twice.abs() < 1.0).then(|| (0.5 * libm::acos(twice), [across, ratio * across]))
}

/// True if a position is within an ellipse.
pub fn contains(ellipse: &Frame, position: [f64; 2]) -> bool {
    let [u, v] = ellipse.within(position);
    let (x, y) = (u / ellipse.half[0], v / ellipse.half[1]);
    x * x + y * y <= 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaning_ellipses_fill_the_box() {
        for (w, h) in [(100.0, 100.0), (40.0, 90.0), (100.0, 60.0), (300.0, 20.0)] {
            let frame = Frame::upright([10.0, 20.0, 10.0 + w, 20.0 + h]);
            let all = ellipses(&frame);
            assert_eq!(all[0], frame);
            assert!(all.len() % 2 == 1 && all.len() > 1 || w == 300.0, "{w} x {h}");
            for e in &all {
                // The farthest of many positions of the ellipse.
                let (mut least, mut most) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
                for i in 0..3600 {
                    let angle = f64::from(i) / 3600.0 * std::f64::consts::TAU;
                    let at =
                        e.outside([e.half[0] * libm::cos(angle), e.half[1] * libm::sin(angle)]);
                    for c in 0..2 {
                        (least[c], most[c]) = (least[c].min(at[c]), most[c].max(at[c]));
                    }
                }
                let expected = [10.0, 20.0, 10.0 + w, 20.0 + h];
                for (found, expected) in least.iter().chain(&most).zip(expected) {
                    assert!((found - expected).abs() < 0.01, "{found} instead of {expected}");
                }
            }
        }
    }

    #[test]
    fn an_axis_has_one_ellipse() {
        let frame = Frame { axis: true, lean: 0.3, ..Frame::upright([0.0, 0.0, 20.0, 50.0]) };
        assert_eq!(ellipses(&frame), [frame]);
        assert!(contains(&frame, frame.outside([0.0, 24.9])));
        assert!(!contains(&frame, frame.outside([0.0, 25.1])));
        assert!(!contains(&frame, frame.outside([9.0, 20.0])));
    }
}
