//! Wall time: UTC, read in one place.
//!
//! Wall time may be set back or slewed in mid-test, so nothing is ever scheduled by it: it dates folders, events and
//! histograms. Its calendar text is made where files are written. Leap seconds are not shown (POSIX time has none).
#![expect(
    clippy::disallowed_methods,
    reason = "the one reader of SystemTime, as clippy.toml says"
)]

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// An instant of UTC: nanoseconds since 1970-01-01T00:00:00Z. Good until the year 2554.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Wall(pub u64);

impl Wall {
    /// The present.
    #[must_use]
    pub fn now() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        // A clock set before 1970 reads as 1970.
        Self(since.map_or(0, |since| {
            u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
        }))
    }

    /// This instant for libraries that want the standard type.
    #[must_use]
    pub fn system_time(self) -> SystemTime {
        UNIX_EPOCH + Duration::from_nanos(self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instant_equals_the_standard_type() {
        let now = Wall::now();
        let since = now.system_time().duration_since(UNIX_EPOCH).unwrap();
        assert_eq!(u128::from(now.0), since.as_nanos());
        assert!(Wall::now() >= now || now.0 == 0);
    }
}
