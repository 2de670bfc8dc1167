//! Parsers of option values other than plain numbers and strings.

use std::time::Duration;

/// Parses `NAME=VALUE`.
pub fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => {
            Ok((name.trim().to_owned(), value.trim().to_owned()))
        }
        _ => Err("expected NAME=VALUE".into()),
    }
}

/// Parses a limit on evaluation, `NAME=N`.
pub fn limit(text: &str) -> Result<(String, u64), String> {
    let (name, number) = pair(text)?;
    let number = number.parse().map_err(|_| format!("expected a whole number, got {number}"))?;
    pcadlang_engine::trace::Limits::default().with(&name, number)?;
    Ok((name, number))
}

/// Parses a duration; without a unit, it is in seconds.
pub fn duration(text: &str) -> Result<Duration, String> {
    let wrong = || "expected a time such as 10s, 2m, 1h or 500ms".to_owned();
    let at = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(at);
    let x: f64 = number.trim().parse().map_err(|_| wrong())?;
    let scale = match unit.trim() {
        "ms" => 1e-3,
        "s" | "" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => return Err(wrong()),
    };
    let seconds = x * scale;
    if seconds.is_finite() && (0.0..1e9).contains(&seconds) {
        Ok(Duration::from_secs_f64(seconds))
    } else {
        Err(wrong())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read() {
        assert_eq!(duration("500ms"), Ok(Duration::from_millis(500)));
        assert_eq!(duration("1.5m"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("7"), Ok(Duration::from_secs(7)));
        assert!(
            duration("soon").is_err()
                && duration("-1s").is_err()
                && duration("1d").is_err()
                && duration("1e300h").is_err()
        );
        assert_eq!(pair("a = 1"), Ok(("a".into(), "1".into())));
        assert!(pair("a").is_err() && pair("=1").is_err());
    }
}
