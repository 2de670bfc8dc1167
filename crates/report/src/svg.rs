//! Writes SVG: the plots of `pcadlang tradeoff` and of the examples.
//!
//! Points are in pixels from the left and from the top, written to a tenth. A `style` is
//! the attributes of an element as they are written. Texts are escaped.

use super::html::escaped;
use std::fmt::Write;

/// A picture that is being written.
#[derive(Clone, Debug)]
pub struct Svg(String);

/// Returns points as the attribute of a line or an area.
fn list(points: impl IntoIterator<Item = (f64, f64)>) -> String {
    let each: Vec<String> = points.into_iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    format!("points=\"{}\"", each.join(" "))
}

impl Svg {
    /// Starts a file of its own: black on white.
    pub fn file(width: f64, height: f64) -> Svg {
        Svg(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             width=\"{width}\" height=\"{height}\" font-family=\"system-ui, sans-serif\" \
             font-size=\"12\"><rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n",
        ))
    }

    /// Adds an element with a title that is shown at the pointer; no title if it is empty.
    fn element(&mut self, name: &str, attributes: &str, style: &str, title: &str) {
        // Writing to a string cannot fail.
        let _ = match title {
            "" => writeln!(self.0, "<{name} {attributes} {style}/>"),
            _ => writeln!(
                self.0,
                "<{name} {attributes} {style}><title>{}</title></{name}>",
                escaped(title)
            ),
        };
    }

    /// Adds a line through points.
    pub fn line(&mut self, points: impl IntoIterator<Item = (f64, f64)>, style: &str, title: &str) {
        self.element("polyline", &format!("{} fill=\"none\"", list(points)), style, title);
    }

    /// Adds an area within points.
    pub fn area(&mut self, points: impl IntoIterator<Item = (f64, f64)>, style: &str) {
        self.element("polygon", &list(points), style, "");
    }

    /// Adds a path in SVG's language.
    pub fn path(&mut self, path: &str, style: &str) {
        self.element("path", &format!("d=\"{path}\""), style, "");
    }

    /// Adds a disc.
    pub fn dot(&mut self, (x, y): (f64, f64), radius: f64, style: &str, title: &str) {
        let attributes = format!("cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\"");
        self.element("circle", &attributes, style, title);
    }

    /// Adds a text of which the `anchor` (`start`, `middle` or `end`) is at a point.
    pub fn text(&mut self, (x, y): (f64, f64), anchor: &str, style: &str, text: &str) {
        let text = escaped(text);
        // Writing to a string cannot fail.
        let _ = writeln!(
            self.0,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" {style}>{text}</text>"
        );
    }

    /// Returns the whole picture.
    pub fn end(self) -> String {
        self.0 + "</svg>\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_are_written_and_texts_escaped() {
        let mut s = Svg::file(20.0, 10.5);
        s.line([(0.0, 1.25), (2.0, -3.0)], "stroke=\"red\"", "a<b");
        s.area([], "");
        s.dot((1.0, 2.0), 4.0, "fill=\"#999\"", "");
        s.text((3.0, 4.0), "end", "fill=\"#555\"", "x & y");
        s.path("M0,0", "stroke=\"#ddd\"");
        let text = s.end();
        let (head, rest) = text.split_once('\n').unwrap();
        assert!(head.starts_with("<svg xmlns=") && head.contains("viewBox=\"0 0 20 10.5\""));
        let lines = [
            "<polyline points=\"0.0,1.2 2.0,-3.0\" fill=\"none\" stroke=\"red\"><title>a&lt;b</title></polyline>",
            "<polygon points=\"\" />",
            "<circle cx=\"1.0\" cy=\"2.0\" r=\"4\" fill=\"#999\"/>",
            "<text x=\"3.0\" y=\"4.0\" text-anchor=\"end\" fill=\"#555\">x &amp; y</text>",
            "<path d=\"M0,0\" stroke=\"#ddd\"/>",
            "</svg>\n",
        ];
        assert_eq!(rest, lines.join("\n"));
    }
}
