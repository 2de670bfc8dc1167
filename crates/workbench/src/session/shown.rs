//! Values as bounded text: even the largest value costs no more than its first
//! characters.

use pcadlang_engine::lang::value::Value;
use pcadlang_report::number;
use std::fmt::{self, Write};

/// The maximum length of a value shown by itself, in characters.
const WHOLE: usize = 2000;
/// The maximum length of a value in a table, in characters.
const CELL: usize = 48;

/// A text of bounded length.
struct Bounded {
    text: String,
    left: usize,
}

impl Write for Bounded {
    fn write_str(&mut self, s: &str) -> fmt::Result {
        for c in s.chars() {
            if self.left == 0 {
                self.text.push('…');
                return Err(fmt::Error);
            }
            self.left -= 1;
            self.text.push(c);
        }
        Ok(())
    }
}

/// Formats a value by itself, with numbers in full precision.
pub(super) fn whole(v: &Value) -> String {
    bounded(WHOLE, |out| write(out, v, &exact))
}

/// Formats a value briefly, with numbers to four digits.
pub fn short(v: &Value) -> String {
    bounded(CELL, |out| write(out, v, &number))
}

fn bounded(most: usize, f: impl FnOnce(&mut Bounded) -> fmt::Result) -> String {
    let mut out = Bounded { text: String::new(), left: most };
    // An error means that the text was cut off.
    let _ = f(&mut out);
    out.text
}

/// Formats all digits of a number, in scientific notation if it is very large or small.
fn exact(x: f64) -> String {
    let plain = x == 0.0 || !x.is_finite() || (1e-5..1e15).contains(&x.abs());
    if plain { format!("{x}") } else { format!("{x:e}") }
}

/// The maximum number of elements shown.
const ELEMENTS: usize = 8;

fn write(out: &mut Bounded, v: &Value, number: &dyn Fn(f64) -> String) -> fmt::Result {
    match v {
        Value::Num(x) => out.write_str(&number(*x)),
        Value::Array(_) | Value::List(_) => {
            let n = v.len().unwrap_or(0);
            out.write_char('[')?;
            for i in 0..n.min(ELEMENTS) {
                out.write_str(if i > 0 { ", " } else { "" })?;
                write(out, &v.element(i).unwrap_or_default(), number)?;
            }
            if n > ELEMENTS {
                write!(out, ", … {n} in all")?;
            }
            out.write_char(']')
        }
        Value::Record(r) => {
            out.write_str("{ ")?;
            for (i, (k, v)) in r.iter().enumerate() {
                write!(out, "{}{k}: ", if i > 0 { ", " } else { "" })?;
                write(out, v, number)?;
            }
            out.write_str(" }")
        }
        v => write!(out, "{v}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_values_are_a_few_letters() {
        assert_eq!(whole(&Value::Num(1.0 / 3.0)), "0.3333333333333333");
        assert_eq!(
            (whole(&Value::Num(1e300)), whole(&Value::Num(-1e-300))),
            ("1e300".into(), "-1e-300".into())
        );
        assert_eq!(short(&Value::array(vec![1.0 / 3.0; 3])), "[0.3333, 0.3333, 0.3333]");
        // A list of itself, nested thirty deep: a billion characters if written out.
        let mut v = Value::Str("x".into());
        for _ in 0..30 {
            v = Value::List(vec![v.clone(), v].into());
        }
        let text = whole(&v);
        assert!(text.chars().count() == WHOLE + 1 && text.ends_with('…'));
        assert!(short(&v).chars().count() <= CELL + 1);
    }
}
