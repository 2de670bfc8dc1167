//! The date and time of a run in the standard form.

use std::time::{SystemTime, UNIX_EPOCH};

/// Returns the present time in UTC, to the second: `2014-06-24T09:30:00Z` (RFC 3339). A
/// clock before 1970 counts as 1970.
pub fn now() -> String {
    written(SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |t| t.as_secs()))
}

/// Formats seconds since 1970 as a date of the Gregorian calendar. Years are counted from
/// March, so that the leap day is the last day of a year; any 400 years have the same
/// number of days.
fn written(seconds: u64) -> String {
    const OF_400_YEARS: u64 = 146_097;
    // Days since 1 March of the year 0.
    let days = seconds / 86_400 + 719_468;
    let (era, day) = (days / OF_400_YEARS, days % OF_400_YEARS);
    let year = (day - day / 1460 + day / 36_524 - day / (OF_400_YEARS - 1)) / 365;
    let of_year = day - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let of_month = of_year - (153 * month + 2) / 5 + 1;
    let (month, next) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    let (h, m, s) = (seconds / 3600 % 24, seconds / 60 % 60, seconds % 60);
    format!("{:04}-{month:02}-{of_month:02}T{h:02}:{m:02}:{s:02}Z", 400 * era + year + next)
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
            assert_eq!(written(seconds), date);
        }
        assert!(*now() > *"2025-01-01T00:00:00Z" && now().len() == 20);
        assert_eq!(readable("2014-06-24T09:30:00Z"), "2014-06-24 09:30 UTC");
        assert_eq!((readable("yesterday"), readable("TéTZ")), ("yesterday".into(), "TéTZ".into()));
    }
}
