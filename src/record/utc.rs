//! Calendar text of a UTC instant given in nanoseconds since 1970. Pure: the caller passes the time.

/// Year, month, day, hour, minute, second and nanosecond of a UTC instant.
fn civil(utc_ns: u64) -> (u64, u64, u64, u64, u64, u64, u64) {
    let (seconds, ns) = (utc_ns / 1_000_000_000, utc_ns % 1_000_000_000);
    let (days, rest) = (seconds / 86_400, seconds % 86_400);
    // Days to civil date in the proleptic Gregorian calendar (H. Hinnant, "chrono-compatible low-level date
    // algorithms"), for days after 1970 only: years begin in March, eras of 400 years have 146 097 days.
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted / 146_097, shifted % 146_097);
    let year_of_era =
        (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * march_month + 2) / 5 + 1;
    let month = if march_month < 10 {
        march_month + 3
    } else {
        march_month - 9
    };
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    (year, month, day, rest / 3600, rest / 60 % 60, rest % 60, ns)
}

/// RFC 3339 with nanoseconds: `2026-03-01T12:00:00.000000001Z`.
#[must_use]
pub fn rfc3339(utc_ns: u64) -> String {
    let (year, month, day, hour, minute, second, ns) = civil(utc_ns);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{ns:09}Z")
}

/// Nanoseconds since 1970 of such a text, with any number of decimals; none if it is no such text.
#[must_use]
pub fn instant(text: &str) -> Option<u64> {
    let (date, time) = text.strip_suffix('Z')?.split_once('T')?;
    let [year, month, day] = numbers(date, '-')?;
    let (whole, decimals) = time.split_once('.').unwrap_or((time, "0"));
    let [hour, minute, second] = numbers(whole, ':')?;
    let is_date = year >= 1970 && (1..=12).contains(&month) && (1..=31).contains(&day);
    // 60 is a leap second.
    if !(is_date && hour < 24 && minute < 60 && second <= 60) {
        return None;
    }
    let ns: u64 = format!("{decimals:0<9}").get(..9)?.parse().ok()?;
    // The inverse of `civil`, from its source.
    let (year, march_month) = if month > 2 {
        (year, month - 3)
    } else {
        (year - 1, month + 9)
    };
    let (era, year_of_era) = (year / 400, year % 400);
    let day_of_year = (153 * march_month + 2) / 5 + day - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    let days = (era * 146_097 + day_of_era).checked_sub(719_468)?;
    let seconds = ((days * 24 + hour) * 60 + minute) * 60 + second;
    seconds.checked_mul(1_000_000_000)?.checked_add(ns)
}

/// Three whole numbers of at most four digits.
fn numbers(text: &str, between: char) -> Option<[u64; 3]> {
    let is_short = |part: &&str| part.len() <= 4 && part.bytes().all(|b| b.is_ascii_digit());
    let mut parts = text.split(between).filter(is_short);
    let found = [(); 3].map(|()| parts.next().and_then(|part| part.parse().ok()));
    let [Some(first), Some(second), Some(third)] = found else {
        return None;
    };
    parts.next().is_none().then_some([first, second, third])
}

/// For file names: `20260301-120000`.
#[must_use]
pub(crate) fn stamp(utc_ns: u64) -> String {
    let (year, month, day, hour, minute, second, _) = civil(utc_ns);
    format!("{year:04}{month:02}{day:02}-{hour:02}{minute:02}{second:02}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_instants_have_their_known_dates() {
        // From `date -u -d @…`: the epoch, a leap day, the day after it, the end of a century that is a leap year.
        for (seconds, text) in [
            (0, "1970-01-01T00:00:00.000000007Z"),
            (951_782_400, "2000-02-29T00:00:00.000000007Z"),
            (951_868_800, "2000-03-01T00:00:00.000000007Z"),
            (1_709_251_199, "2024-02-29T23:59:59.000000007Z"),
            (1_735_689_599, "2024-12-31T23:59:59.000000007Z"),
            (1_772_366_400, "2026-03-01T12:00:00.000000007Z"),
            (4_107_542_400, "2100-03-01T00:00:00.000000007Z"),
        ] {
            assert_eq!(rfc3339(seconds * 1_000_000_000 + 7), text);
            assert_eq!(instant(text), Some(seconds * 1_000_000_000 + 7));
        }
        assert_eq!(instant("1970-01-02T00:00:00.5Z"), Some(86_400_500_000_000));
        for none in [
            "",
            "soon",
            "2026-13-01T00:00:00Z",
            "2026-03-01T12:00Z",
            "1969-12-31T23:59:59Z",
        ] {
            assert_eq!(instant(none), None, "{none}");
        }
        assert_eq!(stamp(1_772_366_400_999_999_999), "20260301-120000");
    }

    #[test]
    fn days_are_consecutive_for_four_centuries() {
        // Independent of the algorithm: count the calendar forward by the rule of leap years.
        let (mut year, mut month, mut day) = (1970u64, 1u64, 1u64);
        for days in 0..146_097u64 {
            let found = civil(days * 86_400 * 1_000_000_000);
            assert_eq!((found.0, found.1, found.2), (year, month, day));
            let at = days * 86_400 * 1_000_000_000;
            assert_eq!(instant(&rfc3339(at)), Some(at));
            let leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
            let length = match month {
                2 => 28 + u64::from(leap),
                4 | 6 | 9 | 11 => 30,
                _ => 31,
            };
            day += 1;
            if day > length {
                (day, month) = (1, month + 1);
            }
            if month > 12 {
                (month, year) = (1, year + 1);
            }
        }
    }
}
