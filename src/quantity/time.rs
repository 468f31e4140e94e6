//! Time as a value: nanoseconds, exact rates, the tick grid, and the clock the loop sees.
//!
//! The grid never adds up sleeps. The release time of tick `k` is computed from the start and the integer `k` in
//! rationals, so 1024 Hz (976 562.5 ns) does not drift, however long the test. The real clock is in
//! `gusset_record::rt`; its simulated counterpart is [`SimClock`].

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use thiserror::Error;

/// Nanoseconds since an arbitrary origin (CLOCK_MONOTONIC under the real clock).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Nanos(pub u64);

impl Nanos {
    /// Nanoseconds from `earlier` to `self`, zero if `earlier` is in fact later.
    #[must_use]
    pub const fn since(self, earlier: Nanos) -> u64 {
        self.0.saturating_sub(earlier.0)
    }

    /// This instant moved later by `ns` nanoseconds.
    #[must_use]
    pub const fn plus(self, ns: u64) -> Nanos {
        Nanos(self.0.saturating_add(ns))
    }

    /// This instant moved earlier by `ns` nanoseconds, not before the origin.
    #[must_use]
    pub const fn minus(self, ns: u64) -> Nanos {
        Nanos(self.0.saturating_sub(ns))
    }
}

/// Why a number cannot be a rate, a step or a scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum RateError {
    /// Zero, negative, infinite or not a number.
    #[error("must be finite and greater than zero")]
    NotPositive,
    /// More digits than exact arithmetic on the grid can carry.
    #[error("has too many digits for an exact time grid (numerator and denominator up to 10^12)")]
    TooFine,
    /// Text that is neither an integer, a decimal nor "a/b".
    #[error("is not a number or a fraction \"a/b\"")]
    NotANumber,
}

/// A positive ratio of two integers, in lowest terms: hertz when it is a rate, seconds when it is a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ratio {
    numerator: u64,
    denominator: u64,
}

/// Largest numerator and denominator: keeps `k · denominator · 10^9` inside 128 bits for every `k`.
const LARGEST_TERM: u64 = 1_000_000_000_000;

impl Ratio {
    /// The number one.
    pub const ONE: Ratio = Ratio {
        numerator: 1,
        denominator: 1,
    };

    /// `numerator / denominator`, reduced.
    ///
    /// # Errors
    /// [`RateError::NotPositive`] if either is zero, [`RateError::TooFine`] if either is beyond 10^12.
    pub fn new(numerator: u64, denominator: u64) -> Result<Self, RateError> {
        Self::reduced(u128::from(numerator), u128::from(denominator))
    }

    fn reduced(numerator: u128, denominator: u128) -> Result<Self, RateError> {
        if numerator == 0 || denominator == 0 {
            return Err(RateError::NotPositive);
        }
        let divisor = gcd(numerator, denominator);
        let limit = u128::from(LARGEST_TERM);
        match (numerator / divisor, denominator / divisor) {
            (n, d) if n <= limit && d <= limit => Ok(Self {
                numerator: n as u64,
                denominator: d as u64,
            }),
            _ => Err(RateError::TooFine),
        }
    }

    /// Reads "1024", "0.01", "1e-3" or "4096/3" exactly, digit by digit: no rounding to binary.
    ///
    /// # Errors
    /// See [`RateError`].
    pub fn parse(text: &str) -> Result<Self, RateError> {
        if let Some((above, below)) = text.split_once('/') {
            let above = above.trim().parse().map_err(|_| RateError::NotANumber)?;
            let below = below.trim().parse().map_err(|_| RateError::NotANumber)?;
            return Self::new(above, below);
        }
        let value: f64 = text.trim().parse().map_err(|_| RateError::NotANumber)?;
        Self::from_decimal(value)
    }

    /// The decimal number a person wrote: 0.05 gives 1/20, not the binary fraction nearest to it.
    ///
    /// # Errors
    /// See [`RateError`].
    pub fn from_decimal(value: f64) -> Result<Self, RateError> {
        if !(value > 0.0 && value.is_finite()) {
            return Err(RateError::NotPositive);
        }
        // `{:e}` prints the shortest digits that read back as `value`: "d.ddde±x".
        let text = format!("{value:e}");
        let (mantissa, exponent) = text.split_once('e').ok_or(RateError::NotANumber)?;
        let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let digits: u128 = format!("{whole}{fraction}")
            .parse()
            .map_err(|_| RateError::NotANumber)?;
        let exponent: i32 = exponent.parse().map_err(|_| RateError::NotANumber)?;
        let shift = exponent - fraction.len() as i32;
        let power = 10u128
            .checked_pow(shift.unsigned_abs())
            .ok_or(RateError::TooFine)?;
        if shift >= 0 {
            Self::reduced(digits.checked_mul(power).ok_or(RateError::TooFine)?, 1)
        } else {
            Self::reduced(digits, power)
        }
    }

    /// The reciprocal: a step from a rate and back.
    #[must_use]
    pub const fn inverse(self) -> Self {
        Self {
            numerator: self.denominator,
            denominator: self.numerator,
        }
    }

    /// The product of two ratios.
    ///
    /// # Errors
    /// [`RateError::TooFine`] when the product does not fit.
    pub fn times(self, other: Self) -> Result<Self, RateError> {
        Self::reduced(
            u128::from(self.numerator) * u128::from(other.numerator),
            u128::from(self.denominator) * u128::from(other.denominator),
        )
    }

    /// The nearest double, correctly rounded for terms below 2^53.
    #[must_use]
    pub fn value(self) -> f64 {
        self.numerator as f64 / self.denominator as f64
    }

    /// Numerator and denominator in lowest terms.
    #[must_use]
    pub const fn terms(self) -> (u64, u64) {
        (self.numerator, self.denominator)
    }
}

impl std::fmt::Display for Ratio {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.denominator == 1 {
            write!(f, "{}", self.numerator)
        } else {
            write!(f, "{}/{}", self.numerator, self.denominator)
        }
    }
}

fn gcd(mut a: u128, mut b: u128) -> u128 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// The tick grid: release times of tick 0, 1, 2 …, exact for every `k`.
///
/// A stretch moves the grid by whole ticks; the moved grid is the same lattice, so it still never drifts.
#[derive(Debug, Clone, Copy)]
pub struct Schedule {
    start: Nanos,
    period: Ratio,
    /// Rounded down.
    period_ns: u64,
    stretched: u64,
}

/// Nanoseconds in a second.
const SECOND: u64 = 1_000_000_000;

impl Schedule {
    /// A grid that starts at `start` with one tick every `period` seconds.
    #[must_use]
    pub const fn new(start: Nanos, period: Ratio) -> Self {
        let (numerator, denominator) = period.terms();
        let ns = numerator as u128 * SECOND as u128 / denominator as u128;
        Self {
            start,
            period,
            period_ns: if ns > u64::MAX as u128 {
                u64::MAX
            } else {
                ns as u64
            },
            stretched: 0,
        }
    }

    /// Release time of tick `k`, rounded down to the nanosecond. Real-time: yes.
    #[inline]
    #[must_use]
    pub fn tick(&self, k: u64) -> Nanos {
        let (numerator, denominator) = self.period.terms();
        // Half a year at 1024 Hz goes into one word, which is divided several times as fast as two.
        let short = k.checked_add(self.stretched);
        let short = short.and_then(|cell| cell.checked_mul(numerator));
        if let Some(ns) = short.and_then(|cells| cells.checked_mul(SECOND)) {
            return self.start.plus(ns / denominator);
        }
        let cell = u128::from(k) + u128::from(self.stretched);
        // cell < 2^65, numerator and 10^9 < 2^40 and 2^30: the product may reach 2^135 only after
        // 10^12-second periods; saturate there rather than wrap.
        let ns = cell
            .saturating_mul(u128::from(numerator))
            .saturating_mul(u128::from(SECOND))
            / u128::from(denominator);
        self.start.plus(u64::try_from(ns).unwrap_or(u64::MAX))
    }

    /// The period in nanoseconds, rounded down.
    #[must_use]
    pub const fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Moves every tick from now on by `ticks` whole periods: the specimen sees slower time. Real-time: yes.
    pub fn stretch(&mut self, ticks: u64) {
        self.stretched = self.stretched.saturating_add(ticks);
    }

    /// Whole periods by which the grid has been moved so far.
    #[must_use]
    pub const fn stretched(&self) -> u64 {
        self.stretched
    }
}

/// Clock of the loop. There is one clock everywhere: the loop, its links and its tests agree on it.
pub trait Clock: Send {
    /// The present. Real-time: yes.
    fn now(&self) -> Nanos;

    /// Returns at or after `at`; at once if `at` has passed. Real-time: yes.
    fn sleep_until(&self, at: Nanos);

    /// Where a grid of edges may begin that begins at `earliest` or later: a clock that follows a bus has a phase.
    fn grid_start(&self, earliest: Nanos) -> Nanos {
        earliest
    }

    /// True when time passes only because somebody sleeps: then nothing is ever late.
    fn is_simulated(&self) -> bool {
        false
    }
}

/// A clock that advances only when a caller sleeps on it. Clones share one time.
#[derive(Debug, Clone, Default)]
pub struct SimClock {
    now_ns: Arc<AtomicU64>,
}

impl SimClock {
    /// A clock that starts at zero.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Lets `ns` nanoseconds pass.
    pub fn advance(&self, ns: u64) {
        self.now_ns.fetch_add(ns, Ordering::Relaxed);
    }
}

impl Clock for SimClock {
    fn now(&self) -> Nanos {
        Nanos(self.now_ns.load(Ordering::Relaxed))
    }

    fn sleep_until(&self, at: Nanos) {
        self.now_ns.fetch_max(at.0, Ordering::Relaxed);
    }

    fn is_simulated(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn decimal_steps_are_exact_fractions() {
        let fraction = |v: f64| Ratio::from_decimal(v).unwrap().terms();
        assert_eq!(fraction(0.05), (1, 20));
        assert_eq!(fraction(0.02), (1, 50));
        assert_eq!(fraction(1024.0), (1024, 1));
        assert_eq!(fraction(1e-4), (1, 10_000));
        assert_eq!(Ratio::parse("4096/3").unwrap().terms(), (4096, 3));
        assert_eq!(Ratio::parse("0.0009765625").unwrap().terms(), (1, 1024));
    }

    #[test]
    fn nonpositive_values_are_refused() {
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(Ratio::from_decimal(value), Err(RateError::NotPositive));
        }
        assert_eq!(Ratio::parse("fast"), Err(RateError::NotANumber));
        assert_eq!(Ratio::parse("1/0"), Err(RateError::NotPositive));
        assert_eq!(Ratio::parse("1e300"), Err(RateError::TooFine));
    }

    #[test]
    fn grid_at_1024_hz_does_not_drift_in_a_day() {
        let schedule = Schedule::new(Nanos(7), Ratio::new(1, 1024).unwrap());
        let day = 86_400 * 1024;
        assert_eq!(schedule.tick(day), Nanos(7 + 86_400 * 1_000_000_000));
        assert_eq!(schedule.tick(1), Nanos(7 + 976_562));
        assert_eq!(schedule.tick(2), Nanos(7 + 1_953_125));
    }

    #[test]
    fn far_ticks_are_exact_beyond_one_word() {
        let schedule = Schedule::new(Nanos(0), Ratio::new(3, 4096).unwrap());
        // 3 · 10⁹ k passes 2⁶⁴ at k = 6 148 914 691.2.
        for k in [
            6_148_914_690u64,
            6_148_914_691,
            6_148_914_692,
            9_000_000_000,
        ] {
            let exact = u128::from(k) * 3 * 1_000_000_000 / 4096;
            assert_eq!(u128::from(schedule.tick(k).0), exact);
        }
        assert_eq!(schedule.period_ns(), 732_421);
    }

    #[test]
    fn stretched_grid_is_the_same_lattice() {
        let mut schedule = Schedule::new(Nanos(0), Ratio::new(1, 1024).unwrap());
        let before = schedule.tick(13);
        schedule.stretch(3);
        assert_eq!(schedule.tick(10), before);
        assert_eq!(schedule.stretched(), 3);
    }

    #[test]
    fn simulated_clock_clones_share_one_time() {
        let clock = SimClock::new();
        let other = clock.clone();
        clock.sleep_until(Nanos(500));
        other.advance(20);
        clock.sleep_until(Nanos(100));
        assert_eq!(other.now(), Nanos(520));
    }

    proptest! {
        #[test]
        fn ticks_never_run_backwards(num in 1u64..5000, den in 1u64..100_000, k in 0u64..u64::MAX / 2) {
            let schedule = Schedule::new(Nanos(1), Ratio::new(num, den).unwrap());
            prop_assert!(schedule.tick(k) <= schedule.tick(k + 1));
        }
    }
}
