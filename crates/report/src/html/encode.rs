//! Escapes text for a page.

/// Escapes a text for use inside an element or a quoted attribute.
pub(crate) fn escaped(text: &str) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;

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
