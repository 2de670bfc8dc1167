//! The date and time of a run in the standard form.

use humantime::format_rfc3339_seconds;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Returns the present time in UTC, to the second: `2014-06-24T09:30:00Z` (RFC 3339). A
/// clock before 1970 counts as 1970, one after 9999 as its end.
pub fn now() -> String {
    written(SystemTime::now())
}

/// Formats a time; `humantime` has no other years than those from 1970 to 9999.
fn written(time: SystemTime) -> String {
    let end = UNIX_EPOCH + Duration::from_secs(253_402_300_799);
    format_rfc3339_seconds(time.clamp(UNIX_EPOCH, end)).to_string()
}

/// Formats a date for people, without its seconds; a text of another form is unchanged.
pub fn readable(date: &str) -> String {
    match (date.split_once('T'), date.ends_with('Z')) {
        (Some((day, time)), true) if time.len() == 9 => format!("{day} {} UTC", &time[..5]),
        _ => date.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, date) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_399, "2000-02-28T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (951_868_800, "2000-03-01T00:00:00Z"),
            (1_403_602_200, "2014-06-24T09:30:00Z"),
            (1_735_689_599, "2024-12-31T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(written(UNIX_EPOCH + Duration::from_secs(seconds)), date);
        }
        let far = Duration::from_secs(300_000_000_000);
        assert_eq!(written(UNIX_EPOCH - far), "1970-01-01T00:00:00Z");
        assert_eq!(written(UNIX_EPOCH + far), "9999-12-31T23:59:59Z");
        assert!(*now() > *"2025-01-01T00:00:00Z" && now().len() == 20);
        assert_eq!(readable("2014-06-24T09:30:00Z"), "2014-06-24 09:30 UTC");
        assert_eq!((readable("yesterday"), readable("TéTZ")), ("yesterday".into(), "TéTZ".into()));
    }
}
