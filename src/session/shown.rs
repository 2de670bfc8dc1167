//! Values in bounded text: the largest costs no more than its first letters.

use crate::lang::value::Value;
use crate::report::number;
use std::fmt::{self, Write};

/// Letters of a value that is shown by itself.
const WHOLE: usize = 2000;
/// Letters of a value in a table.
const CELL: usize = 48;

/// A text that takes no more than so many letters.
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

/// A value by itself, numbers in full.
pub(super) fn whole(v: &Value) -> String {
    bounded(WHOLE, |out| write(out, v, &exact))
}

/// A value in a few letters, numbers to four digits.
pub fn short(v: &Value) -> String {
    bounded(CELL, |out| write(out, v, &number))
}

fn bounded(most: usize, f: impl FnOnce(&mut Bounded) -> fmt::Result) -> String {
    let mut out = Bounded { text: String::new(), left: most };
    // The error is that there was no room.
    let _ = f(&mut out);
    out.text
}

/// All digits, and few letters for the largest and smallest.
fn exact(x: f64) -> String {
    let plain = x == 0.0 || !x.is_finite() || (1e-5..1e15).contains(&x.abs());
    if plain { format!("{x}") } else { format!("{x:e}") }
}

/// At most this many elements are shown.
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
        // A list of itself, thirty deep: a billion letters if it were written out.
        let mut v = Value::Str("x".into());
        for _ in 0..30 {
            v = Value::List(vec![v.clone(), v].into());
        }
        let text = whole(&v);
        assert!(text.chars().count() == WHOLE + 1 && text.ends_with('…'));
        assert!(short(&v).chars().count() <= CELL + 1);
    }
}
