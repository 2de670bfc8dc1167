//! A plot of error against time.
//!
//! Invariant: only finite numbers are written, for any rows.

use super::rows::Row;
use pcadlang_report::svg::Svg;

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 460.0;
/// Margins: wide enough for the labels on the left and at the bottom.
const LEFT: f64 = 58.0;
const BOTTOM: f64 = 40.0;
const EDGE: f64 = 16.0;
/// The style of the labels of the axes.
const GREY: &str = "fill=\"#555\"";

/// Maps times and errors to positions in the picture.
struct Axes {
    /// The range, as powers of ten.
    time: (f64, f64),
    top: f64,
}

impl Axes {
    fn x(&self, seconds: f64) -> f64 {
        let share = (seconds.log10() - self.time.0) / (self.time.1 - self.time.0);
        LEFT + share.clamp(0.0, 1.0) * (WIDTH - LEFT - EDGE)
    }

    fn y(&self, error: f64) -> f64 {
        HEIGHT - BOTTOM - (error / self.top).clamp(0.0, 1.0) * (HEIGHT - BOTTOM - EDGE)
    }
}

/// Plots the rows as SVG: for each setting a thin line over time and a dot with its
/// interval at the end, and the front in colour. `error` names the error measure; `named`
/// are settings to label, such as presets, with their labels.
pub fn plot(rows: &[Row], error: &str, named: &[(String, String)]) -> String {
    let shown: Vec<&Row> = rows
        .iter()
        .filter(|r| r.seconds > 0.0 && [r.seconds, r.error].iter().all(|x| x.is_finite()))
        .collect();
    let seconds = || shown.iter().map(|r| r.seconds.log10());
    let (low, high) =
        (seconds().fold(f64::INFINITY, f64::min), seconds().fold(f64::NEG_INFINITY, f64::max));
    let (low, high) = if low < high { (low - 0.05, high + 0.05) } else { (-1.0, 1.0) };
    let most = shown
        .iter()
        .map(|r| if r.high.is_finite() { r.high } else { r.error })
        .fold(1e-9, f64::max);
    let top = (most * 1.02).min(f64::MAX);
    let axes = Axes { time: (low, high), top };
    let mut s = Svg::file(WIDTH, HEIGHT);
    grid(&mut s, &axes, error);
    let names = || {
        let mut names: Vec<&str> = shown.iter().map(|r| r.setting.as_str()).collect();
        names.dedup();
        names
    };
    for name in names() {
        let line = shown.iter().filter(|r| r.setting == name);
        let line = line.map(|r| (axes.x(r.seconds), axes.y(r.error)));
        s.line(line, "stroke=\"#bbb\" stroke-width=\"0.8\"", name);
    }
    let ends: Vec<&&Row> = shown.iter().filter(|r| r.end).collect();
    for r in &ends {
        let (colour, width) = if r.front { ("#d55e00", 1.6) } else { ("#999", 0.6) };
        let (x, y) = (axes.x(r.seconds), axes.y(r.error));
        if r.low.is_finite() && r.high.is_finite() {
            let (low, high) = (axes.y(r.low), axes.y(r.high));
            let style = format!("stroke=\"{colour}\" stroke-width=\"{width}\"");
            s.path(&format!("M{x:.1},{low:.1}V{high:.1}"), &style);
        }
        let radius = if r.front { 4.0 } else { 2.0 };
        let title = format!(
            "{}: {:.3} ({:.3} to {:.3}) after {:.2} s",
            r.setting, r.error, r.low, r.high, r.seconds
        );
        s.dot((x, y), radius, &format!("fill=\"{colour}\""), &title);
    }
    let mut front: Vec<(f64, f64)> =
        ends.iter().filter(|r| r.front).map(|r| (r.seconds, r.error)).collect();
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    let front = front.iter().map(|(t, e)| (axes.x(*t), axes.y(*e)));
    s.line(front, "stroke=\"#d55e00\" stroke-width=\"1.6\"", "");
    for (setting, label) in named {
        if let Some(r) = ends.iter().find(|r| r.setting == *setting) {
            let (x, y) = (axes.x(r.seconds), axes.y(r.error));
            // Labels near the right edge are placed to the left of their dots.
            let (x, anchor) = if x > WIDTH - 90.0 { (x - 8.0, "end") } else { (x + 8.0, "start") };
            s.text((x, y - 6.0), anchor, "", label);
        }
    }
    s.end()
}

/// Draws the grid lines and labels of both axes.
fn grid(s: &mut Svg, axes: &Axes, error: &str) {
    let (low, high) = axes.time;
    for power in low.floor() as i32..=high.ceil() as i32 {
        for (i, digit) in [1.0, 2.0, 5.0].into_iter().enumerate() {
            let t = digit * 10f64.powi(power);
            if t.log10() < low || t.log10() > high {
                continue;
            }
            let x = axes.x(t);
            let colour = if i == 0 { "#ddd" } else { "#eee" };
            let line = format!("M{x:.1},{EDGE}V{}", HEIGHT - BOTTOM);
            s.path(&line, &format!("stroke=\"{colour}\""));
            s.text((x, HEIGHT - BOTTOM + 15.0), "middle", GREY, &t.to_string());
        }
    }
    let step = step(axes.top);
    for i in 0..=(axes.top / step) as u32 {
        let e = f64::from(i) * step;
        let y = axes.y(e);
        s.path(&format!("M{LEFT},{y:.1}H{}", WIDTH - EDGE), "stroke=\"#eee\"");
        // Avoids labels such as 0.30000000000000004.
        let e = if e < 1e6 { (e * 1e9).round() / 1e9 } else { e };
        s.text((LEFT - 6.0, y + 4.0), "end", GREY, &e.to_string());
    }
    s.text(((LEFT + WIDTH) / 2.0, HEIGHT - 6.0), "middle", "", "seconds");
    let middle = (HEIGHT - BOTTOM) / 2.0;
    let turned = format!("transform=\"rotate(-90 14 {middle})\"");
    s.text((14.0, middle), "middle", &turned, error);
}

/// Returns a round step for the grid lines, of which about five to ten fit.
fn step(top: f64) -> f64 {
    let rough = top / 8.0;
    let power = 10f64.powf(rough.log10().floor());
    let digit = [1.0, 2.0, 5.0, 10.0].into_iter().find(|d| d * power >= rough).unwrap_or(10.0);
    digit * power
}

#[cfg(test)]
mod tests {
    use super::*;
    use indexmap::IndexMap;

    fn row(setting: &str, seconds: f64, error: f64, front: bool) -> Row {
        let scores = IndexMap::new();
        let (low, high) = (error * 0.8, error * 1.2);
        let (setting, ess_per_second) = (setting.into(), None);
        Row {
            setting,
            end: true,
            seconds,
            error,
            low,
            high,
            cases: 1,
            runs: 1,
            failed: 0,
            scores,
            ess_per_second,
            front,
        }
    }

    #[test]
    fn only_finite_numbers_are_written() {
        let some =
            [row("a<b", 1.0, 0.3, true), row("c", 10.0, 0.1, true), row("d", 3.0, f64::NAN, false)];
        for rows in [
            &some[..],
            &some[..1],
            &[],
            &[row("z", 0.0, 0.0, true)],
            &[row("h", 1e300, 1e300, true)],
        ] {
            let s = plot(rows, "error", &[("c".into(), "accurate".into())]);
            assert!(!s.contains("NaN") && !s.contains("inf"), "{s}");
            assert!(s.starts_with("<svg") && s.ends_with("</svg>\n"));
        }
        let s = plot(&some, "error", &[("c".into(), "accurate".into())]);
        assert!(s.contains("a&lt;b") && s.contains(">accurate<"));
    }
}
