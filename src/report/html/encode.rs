//! Encodes the contents of a page as text: escaped text, coordinates.

/// Escapes a text for use inside an element or a quoted attribute.
pub(in crate::report) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// Escapes the name of a quantity or a kernel, and allows line breaks at the ends of its
/// parts only.
pub(super) fn breakable(name: &str) -> String {
    let mut out = String::with_capacity(2 * name.len());
    let mut parts = name.split_inclusive(['.', '_', '/', '[', '(', ',', ';', ':', '-']).peekable();
    while let Some(part) = parts.next() {
        out.push_str(&escaped(part));
        if parts.peek().is_some() {
            out.push_str("<wbr>");
        }
    }
    out
}

/// Formats coordinates separated by commas, to a ten-thousandth of the largest, which
/// keeps the page small. Every number is valid in JSON.
pub(super) fn coordinates(positions: &[[f32; 3]]) -> String {
    let all =
        || positions.iter().flatten().map(|x| if x.is_finite() { f64::from(*x) } else { 0.0 });
    let largest = all().fold(0.0, |m: f64, x| m.max(x.abs()));
    // The largest number has four digits after its first.
    let digits =
        if largest > 0.0 { (4 - largest.log10().floor() as i32).clamp(0, 40) as usize } else { 0 };
    let numbers = all().map(|x| {
        let s = format!("{x:.digits$}");
        let s = if s.contains('.') { s.trim_end_matches('0').trim_end_matches('.') } else { &s };
        if s == "-0" { "0".to_owned() } else { s.to_owned() }
    });
    numbers.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_keep_four_digits_of_the_largest() {
        assert_eq!(coordinates(&[[1.234_567, -0.000_01, 0.5]]), "1.2346,0,0.5");
        assert_eq!(coordinates(&[[123.456_7, f32::INFINITY, -7.0]]), "123.46,0,-7");
        assert_eq!(coordinates(&[[1.234_567e-6, 0.0, -5e-7]]), "0.0000012346,0,-0.0000005");
        assert_eq!(coordinates(&[[3e30, 1e-30, f32::NAN]]).split(',').count(), 3);
        assert_eq!((coordinates(&[]), coordinates(&[[0.0; 3]])), (String::new(), "0,0,0".into()));
    }

    #[test]
    fn names_break_between_their_parts() {
        assert_eq!(breakable("drift(one(@**))"), "drift(<wbr>one(<wbr>@**))");
        assert_eq!(breakable("a_<b>."), "a_<wbr>&lt;b&gt;.");
        assert_eq!((breakable("slope"), breakable("")), ("slope".into(), String::new()));
    }

    #[test]
    fn quotes_are_escaped() {
        assert_eq!(
            escaped("<a b=\"c\" d='e'> & é"),
            "&lt;a b=&quot;c&quot; d=&#39;e&#39;&gt; &amp; é"
        );
    }
}
