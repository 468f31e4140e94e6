//! Wall time: UTC, its RFC 3339 text, and the way from the loop's clock to it.
//!
//! The one place that reads the system's wall clock. Wall time may be set back or slewed in mid-test, so
//! nothing is ever scheduled by it: one paired reading at the start ties it to CLOCK_MONOTONIC, and every instant of a
//! run is converted through that pair. Leap seconds are not shown (POSIX time has none).
#![expect(
    clippy::disallowed_methods,
    reason = "the one reader of SystemTime, as clippy.toml says"
)]

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use crate::time::Nanos;

use super::os;

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

    /// "2026-11-21T06:35:27.000123456Z": RFC 3339, UTC, nanoseconds always shown.
    #[must_use]
    pub fn rfc3339(self) -> String {
        let (date, second, ns) = self.parts();
        let (year, month, day) = civil(date);
        let (hour, minute, second) = clock_face(second);
        format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{ns:09}Z")
    }

    /// "20261121T063527Z": sorts as text, and every file system takes it as part of a name.
    #[must_use]
    pub fn file_stamp(self) -> String {
        let (date, second, _) = self.parts();
        let (year, month, day) = civil(date);
        let (hour, minute, second) = clock_face(second);
        format!("{year:04}{month:02}{day:02}T{hour:02}{minute:02}{second:02}Z")
    }

    /// The same instant for libraries that want the standard type.
    #[must_use]
    pub fn system_time(self) -> SystemTime {
        UNIX_EPOCH + Duration::from_nanos(self.0)
    }

    const fn parts(self) -> (u64, u64, u64) {
        let seconds = self.0 / 1_000_000_000;
        (seconds / 86_400, seconds % 86_400, self.0 % 1_000_000_000)
    }
}

const fn clock_face(second_of_day: u64) -> (u64, u64, u64) {
    (
        second_of_day / 3600,
        second_of_day / 60 % 60,
        second_of_day % 60,
    )
}

/// Year, month and day of a number of days since 1970-01-01, proleptic Gregorian.
///
/// Counts from 1 March of year 0, so that the leap day is the last of its year; 146 097 days are 400 years.
const fn civil(days_since_1970: u64) -> (u64, u64, u64) {
    let days = days_since_1970 + 719_468;
    let era = days / 146_097;
    let day_of_era = days % 146_097;
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
    let january = if month <= 2 { 1 } else { 0 };
    (year_of_era + era * 400 + january, month, day)
}

/// One instant read on both clocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WallAnchor {
    /// On CLOCK_MONOTONIC.
    pub clock: Nanos,
    /// On the wall.
    pub wall: Wall,
    /// Half the width of the reading: the pair is true to ± this many nanoseconds.
    pub uncertainty_ns: u64,
}

impl WallAnchor {
    /// Reads wall time between two readings of the clock, several times, and keeps the tightest pair.
    #[must_use]
    pub fn read() -> Self {
        let mut best = Self::read_once();
        for _ in 0..7 {
            let next = Self::read_once();
            if next.uncertainty_ns < best.uncertainty_ns {
                best = next;
            }
        }
        best
    }

    fn read_once() -> Self {
        let before = os::monotonic_ns();
        let wall = Wall::now();
        let after = os::monotonic_ns();
        let half = after.saturating_sub(before).div_ceil(2);
        Self {
            clock: Nanos(before).plus(half),
            wall,
            uncertainty_ns: half,
        }
    }

    /// Wall time of an instant of the loop's clock.
    #[must_use]
    pub const fn wall(&self, at: Nanos) -> Wall {
        if at.0 >= self.clock.0 {
            Wall(self.wall.0.saturating_add(at.since(self.clock)))
        } else {
            Wall(self.wall.0.saturating_sub(self.clock.since(at)))
        }
    }

    /// Instant of the loop's clock of a wall time.
    #[must_use]
    pub const fn clock(&self, wall: Wall) -> Nanos {
        if wall.0 >= self.wall.0 {
            self.clock.plus(wall.0 - self.wall.0)
        } else {
            self.clock.minus(self.wall.0 - wall.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn known_instants_are_written_as_the_calendar_has_them() {
        let text = |seconds: u64, ns: u64| Wall(seconds * 1_000_000_000 + ns).rfc3339();
        assert_eq!(text(0, 0), "1970-01-01T00:00:00.000000000Z");
        assert_eq!(text(951_782_400, 0), "2000-02-29T00:00:00.000000000Z");
        assert_eq!(text(1_000_000_000, 5), "2001-09-09T01:46:40.000000005Z");
        assert_eq!(
            text(1_709_251_199, 999_999_999),
            "2024-02-29T23:59:59.999999999Z"
        );
        assert_eq!(text(4_107_542_400, 0), "2100-03-01T00:00:00.000000000Z");
        assert_eq!(
            Wall(1_000_000_000_000_000_000).file_stamp(),
            "20010909T014640Z"
        );
    }

    #[test]
    fn every_day_of_eight_centuries_follows_the_one_before() {
        let leap =
            |y: u64| y.is_multiple_of(4) && (!y.is_multiple_of(100) || y.is_multiple_of(400));
        let (mut year, mut month, mut day) = (1970, 1, 1);
        for days in 0..292_194 {
            assert_eq!(civil(days), (year, month, day));
            let length = match month {
                2 if leap(year) => 29,
                2 => 28,
                4 | 6 | 9 | 11 => 30,
                _ => 31,
            };
            day += 1;
            if day > length {
                (month, day) = (month + 1, 1);
            }
            if month > 12 {
                (year, month) = (year + 1, 1);
            }
        }
    }

    #[test]
    fn a_paired_reading_lies_between_its_neighbours() {
        let before = Wall::now();
        let anchor = WallAnchor::read();
        assert!(anchor.wall >= before && anchor.wall <= Wall::now());
        assert_eq!(anchor.wall(anchor.clock), anchor.wall);
    }

    proptest! {
        #[test]
        fn there_and_back_is_the_same_instant(clock in 0u64..1 << 60, wall in 0u64..1 << 60, at in 0u64..1 << 60) {
            let anchor = WallAnchor { clock: Nanos(clock), wall: Wall(wall), uncertainty_ns: 0 };
            // Before 1970 there is nothing to come back from.
            prop_assume!(at + wall >= clock);
            prop_assert_eq!(anchor.clock(anchor.wall(Nanos(at))), Nanos(at));
        }
    }
}
