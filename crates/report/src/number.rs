//! Formats numbers for people.

/// Formats a number with about four significant digits and without unneeded trailing
/// zeros; `-` for NaN.
pub fn number(x: f64) -> String {
    if x.is_nan() {
        return "-".into();
    }
    if x.is_infinite() {
        return if x > 0.0 { "inf" } else { "-inf" }.into();
    }
    let size = x.abs();
    if size != 0.0 && !(1e-4..1e6).contains(&size) {
        return format!("{x:.2e}");
    }
    let digits =
        if size == 0.0 { 0 } else { (3 - size.log10().floor() as i32).clamp(0, 6) as usize };
    let s = format!("{x:.digits$}");
    if s.contains('.') { s.trim_end_matches('0').trim_end_matches('.').to_owned() } else { s }
}

/// Formats a time: `0.42 s`, `12 s`, `3 min 5 s`.
pub fn seconds(s: f64) -> String {
    if s < 10.0 {
        format!("{s:.2} s")
    } else if s < 120.0 {
        format!("{s:.0} s")
    } else {
        format!("{} min {} s", s as u64 / 60, s as u64 % 60)
    }
}

/// Formats an R-hat for people; that of chains in different modes can be arbitrarily
/// large.
pub fn r_hat_text(r: f64) -> String {
    match r {
        r if r.is_nan() => "-".into(),
        r if r > 100.0 => ">100".into(),
        r if r >= 10.0 => format!("{r:.1}"),
        r => format!("{r:.3}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_digits_are_enough() {
        for (x, text) in [
            (0.0, "0"),
            (1.0, "1"),
            (1.60042, "1.6"),
            (0.012345, "0.01235"),
            (-123.456, "-123.5"),
            (123456.0, "123456"),
            (1e-9, "1.00e-9"),
            (f64::NAN, "-"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(number(x), text);
        }
        assert_eq!(
            (seconds(0.5), seconds(61.0), seconds(125.0)),
            ("0.50 s".into(), "61 s".into(), "2 min 5 s".into())
        );
    }

    #[test]
    fn r_hat_reads_well() {
        let texts = [f64::NAN, 1.0042, 12.345, 3e6, f64::INFINITY].map(r_hat_text);
        assert_eq!(texts, ["-", "1.004", "12.3", ">100", ">100"]);
    }
}
