//! The loop follows the bus clock: its edges keep their phase to the system time of the bus.
//!
//! [`BusTime`] is shared by the cycle, which reads the system time that comes back with each exchange, and [`FollowingClock`], on
//! which the loop runs. A PI controller turns the deviation into an offset: the least of 16 readings counts, because a frame can
//! only be late. Invariant: time never runs backwards, and an edge moves by at most 1 % of the period a tick.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};

use gusset_quantity::time::{Clock, Nanos};

/// Readings of which the least counts.
const READINGS: u32 = 16;
/// Gains of the controller, per decision.
const PROPORTIONAL: f64 = 0.3;
const INTEGRAL: f64 = 0.05;
/// Largest change of the offset in a tick, as a share of the period.
const MOST: f64 = 0.01;
/// Largest deviation of a clock, as a share.
const MOST_DRIFT: f64 = 500e-6;

/// Relation between the clock of this machine and that of the bus.
#[derive(Debug, Default)]
pub struct BusTime {
    /// Bus time less the time of this machine at the first exchange, in ns: the loop's clock begins like that of this machine.
    base: AtomicI64,
    /// Change of this difference since then, in ns.
    offset: AtomicI64,
    /// Deviation of the bus clock in ppm, as bits.
    ppm: AtomicU64,
}

impl BusTime {
    fn offset(&self) -> i64 {
        self.offset.load(Ordering::Acquire)
    }

    /// Deviation of the bus clock from the clock of this machine in ppm; NaN before it is known. Real-time: yes.
    #[must_use]
    pub fn ppm(&self) -> f64 {
        match self.ppm.load(Ordering::Relaxed) {
            0 => f64::NAN,
            bits => f64::from_bits(bits),
        }
    }
}

/// The controller, in the cycle.
#[derive(Debug)]
pub(crate) struct Follower {
    time: Arc<BusTime>,
    period_ns: f64,
    /// First deviation in ns; offset from it, with its fraction; and the change of the offset per tick.
    base: i64,
    offset: f64,
    drift: f64,
    /// Rest of the last correction, in ns.
    correction: f64,
    least: f64,
    readings: u32,
    /// Readings in a row that were far from the expected one.
    far: u32,
    is_set: bool,
}

impl Follower {
    pub(crate) fn new(time: Arc<BusTime>, period_ns: u64) -> Self {
        Self {
            time,
            period_ns: period_ns as f64,
            base: 0,
            offset: 0.0,
            drift: 0.0,
            correction: 0.0,
            least: f64::INFINITY,
            readings: 0,
            far: 0,
            is_set: false,
        }
    }

    /// Takes the system time in ns that a frame brought back, which left at `sent` on the clock of this machine. False if it was
    /// far from the expected one for many ticks in a row: the clock of the bus has jumped. Real-time: yes.
    pub(crate) fn read(&mut self, bus_ns: u64, sent: Nanos) -> bool {
        let deviation = bus_ns.wrapping_sub(sent.0) as i64;
        if !self.is_set {
            self.is_set = true;
            self.base = deviation;
            self.time.base.store(deviation, Ordering::Release);
            return true;
        }
        let error = deviation.wrapping_sub(self.base) as f64 - self.offset;
        if error.abs() > 0.5 * self.period_ns {
            // One late frame says nothing.
            self.far = self.far.saturating_add(1);
            return self.far < READINGS;
        }
        self.far = 0;
        if error < self.least {
            self.least = error;
        }
        self.readings += 1;
        if self.readings == READINGS {
            let ticks = f64::from(READINGS);
            let most = MOST_DRIFT * self.period_ns;
            self.drift = (self.drift + INTEGRAL * self.least / ticks).clamp(-most, most);
            self.correction = PROPORTIONAL * self.least;
            (self.readings, self.least) = (0, f64::INFINITY);
            self.time.ppm.store(
                (1e6 * self.drift / self.period_ns).to_bits(),
                Ordering::Relaxed,
            );
        }
        let most = MOST * self.period_ns;
        let step = self.correction.clamp(-most, most);
        self.correction -= step;
        self.offset += (self.drift + step).clamp(-most, most);
        self.publish();
        true
    }

    /// Bus time less the time of this machine, in ns. Real-time: yes.
    pub(crate) const fn offset_ns(&self) -> i64 {
        self.base.wrapping_add(self.lead_ns())
    }

    /// Time of the loop's clock less the time of this machine, in ns. Real-time: yes.
    pub(crate) const fn lead_ns(&self) -> i64 {
        self.offset as i64
    }

    fn publish(&self) {
        self.time
            .offset
            .store(self.offset.round() as i64, Ordering::Release);
    }
}

/// A clock that runs like that of the bus, and began like that of this machine.
pub struct FollowingClock {
    below: Box<dyn Clock>,
    time: Arc<BusTime>,
    period_ns: u64,
    /// The latest reading: it never runs backwards.
    latest: AtomicU64,
}

impl std::fmt::Debug for FollowingClock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FollowingClock")
            .field("time", &self.time)
            .finish_non_exhaustive()
    }
}

impl FollowingClock {
    /// The clock of this machine, corrected to that of the bus, whose ticks are `period_ns` apart.
    #[must_use]
    pub fn new(below: Box<dyn Clock>, time: Arc<BusTime>, period_ns: u64) -> Self {
        Self {
            below,
            time,
            period_ns: period_ns.max(1),
            latest: AtomicU64::new(0),
        }
    }
}

impl Clock for FollowingClock {
    fn now(&self) -> Nanos {
        let bus = self.below.now().0.wrapping_add_signed(self.time.offset());
        Nanos(self.latest.fetch_max(bus, Ordering::Relaxed).max(bus))
    }

    fn sleep_until(&self, at: Nanos) {
        let offset = self.time.offset();
        self.below
            .sleep_until(Nanos(at.0.wrapping_add_signed(offset.wrapping_neg())));
        // The offset may have changed meanwhile: the edge comes by the clock of the bus.
        while self.now() < at {
            if self.is_simulated() {
                let missing = at.since(self.now());
                self.below.sleep_until(self.below.now().plus(missing));
            }
            std::hint::spin_loop();
        }
    }

    fn is_simulated(&self) -> bool {
        self.below.is_simulated()
    }

    fn grid_start(&self, earliest: Nanos) -> Nanos {
        let base = self.time.base.load(Ordering::Acquire);
        let phase = earliest.0.wrapping_add_signed(base) % self.period_ns;
        earliest.plus((self.period_ns - phase) % self.period_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::time::SimClock;

    /// Reading noise: frames are late by up to 20 µs, and every 50th by 700 µs more.
    fn late(k: u64) -> u64 {
        let dice = k.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(99) >> 40;
        dice % 20_000 + if k.is_multiple_of(50) { 700_000 } else { 0 }
    }

    #[test]
    fn the_phase_is_held_at_100_ppm() {
        const PERIOD: u64 = 1_000_000;
        for ppm in [-100.0, 0.0, 100.0f64] {
            let time = Arc::new(BusTime::default());
            let sim = SimClock::new();
            let clock = FollowingClock::new(Box::new(sim.clone()), Arc::clone(&time), PERIOD);
            let mut follower = Follower::new(Arc::clone(&time), PERIOD);
            let bus = |mono: u64| 77_000_000_123 + (mono as f64 * (1.0 + 1e-6 * ppm)) as u64;
            follower.read(bus(0), Nanos(0));
            let start = clock.grid_start(clock.now().plus(PERIOD));
            let base = time.base.load(Ordering::Acquire) as u64;
            assert_eq!((start.0 + base) % PERIOD, 0);
            assert!(clock.now().0 < PERIOD);
            let (mut before, mut worst, mut jump) = (0, 0.0f64, 0.0f64);
            for k in 0..20_000 {
                clock.sleep_until(start.plus(k * PERIOD));
                let sent = sim.now();
                follower.read(bus(sent.0) + late(k), sent);
                let edge = start.plus(k * PERIOD + base);
                let phase = (bus(sent.0) as f64 - edge.0 as f64).abs();
                if k > 2_000 {
                    worst = worst.max(phase);
                }
                if k > 0 {
                    let step = (sent.0 - before) as f64;
                    jump = jump.max((step - PERIOD as f64).abs());
                }
                before = sent.0;
            }
            assert!(worst < 5_000.0, "{ppm} ppm: {worst} ns");
            assert!(jump <= 0.0101 * PERIOD as f64, "{jump} ns");
            assert!((time.ppm() - ppm).abs() < 5.0, "{} ppm", time.ppm());
        }
    }

    #[test]
    fn a_jump_of_the_bus_clock_is_noticed() {
        let mut follower = Follower::new(Arc::default(), 1000);
        let read =
            |follower: &mut Follower, k: u64, jump| follower.read(k * 1000 + jump, Nanos(k * 1000));
        assert!((0..50).all(|k| read(&mut follower, k, 0)));
        assert!(read(&mut follower, 50, 700) && read(&mut follower, 51, 0));
        let noticed = (52..99).position(|k| !read(&mut follower, k, 700));
        assert_eq!(noticed, Some(READINGS as usize - 1));
    }

    #[test]
    fn time_never_runs_backwards() {
        let time = Arc::new(BusTime::default());
        let clock = FollowingClock::new(Box::new(SimClock::new()), Arc::clone(&time), 1000);
        time.offset.store(5_000, Ordering::Release);
        let before = clock.now();
        time.offset.store(4_000, Ordering::Release);
        assert_eq!(clock.now(), before);
    }
}
