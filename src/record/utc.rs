//! Calendar text of an instant given in nanoseconds since 1970. Pure but for [`local`]: the caller passes the time.

use jiff::Timestamp;
use jiff::tz::TimeZone;

/// The instant; the last one that there is for a time beyond it (the year 9999).
fn instant_of(utc_ns: u64) -> Timestamp {
    Timestamp::from_nanosecond(utc_ns.into()).unwrap_or(Timestamp::MAX)
}

/// RFC 3339 with nanoseconds: `2026-03-01T12:00:00.000000001Z`.
#[must_use]
pub fn rfc3339(utc_ns: u64) -> String {
    format!("{:.9}", instant_of(utc_ns))
}

/// Nanoseconds since 1970 of such a text, with any number of decimals; none if it is no such text.
#[must_use]
pub fn instant(text: &str) -> Option<u64> {
    let found: Timestamp = text.parse().ok()?;
    found.as_nanosecond().try_into().ok()
}

/// For file names: `20260301-120000`.
#[must_use]
pub(crate) fn stamp(utc_ns: u64) -> String {
    instant_of(utc_ns).strftime("%Y%m%d-%H%M%S").to_string()
}

/// Where this machine is, to the second: `2026-03-01 13:00:00 +01:00 Europe/Berlin`. Reads the time zone of the system.
#[must_use]
pub(crate) fn local(utc_ns: u64) -> String {
    let zoned = instant_of(utc_ns).to_zoned(TimeZone::system());
    zoned.strftime("%Y-%m-%d %H:%M:%S %:z %:Q").to_string()
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
            "2026-03-01T12:00:00",
            "1969-12-31T23:59:59Z",
        ] {
            assert_eq!(instant(none), None, "{none}");
        }
        assert_eq!(stamp(1_772_366_400_999_999_999), "20260301-120000");
    }
}
