//! The day of an export.

use std::time::{SystemTime, UNIX_EPOCH};

/// The day of `SOURCE_DATE_EPOCH`, as reproducible builds set it, or of the clock, `YYYY-MM-DD` in UTC.
pub(super) fn today() -> String {
    let given = std::env::var("SOURCE_DATE_EPOCH").ok().and_then(|text| text.parse::<u64>().ok());
    let clock = || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
    day(given.unwrap_or_else(clock))
}

/// The day of a time in seconds since 1970, UTC.
fn day(seconds: u64) -> String {
    /// Days of four hundred years, after which the calendar repeats, and days from March of the year 0 to 1970.
    const ERA: u64 = 146_097;
    const TO_1970: u64 = 719_468;
    let days = seconds / 86_400 + TO_1970;
    let (era, of_era) = (days / ERA, days % ERA);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    // Months from March on have 31, 30, 31, 30, 31 days in turn.
    let from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
    format!("{:04}-{month:02}-{day:02}", 400 * era + year_of_era + u64::from(month < 3))
}

#[cfg(test)]
mod tests {
    use super::day;

    #[test]
    fn days_of_known_times() {
        let known = [
            (0, "1970-01-01"),
            (951_782_400, "2000-02-29"),
            (1_709_251_199, "2024-02-29"),
            (4_107_542_400, "2100-03-01"),
        ];
        for (seconds, wanted) in known {
            assert_eq!(day(seconds), wanted);
        }
    }
}
