//! The time that a command has for its motion, which its speed is judged by: wall time, whatever test time the controller
//! says.
//!
//! A controller that announced its rate has one period for each command, lost ones included, but no more than has really
//! passed: what moves is led by nobody who runs ahead of the wall. Frames need not arrive evenly, so that a command may
//! come [`BURST_S`] early, or a period where that is longer. It begins with that burst and no period: its first command goes
//! no farther than where the Arm said, and uses nothing up. One that announced no rate has the wall time since its last
//! command, and no more than the test time that it says: it may pause without being allowed a leap for it. A formula is not
//! hurt by haste: it has at least what was announced, or the test time that was said.

use super::USUAL_TICK_S;
use crate::link::rig::Visitor;
use crate::time::Nanos;

/// Commands may run ahead of the wall by so much, or by one period where that is longer.
const BURST_S: f64 = 0.02;
/// A speed has a time, however short.
const SHORTEST_S: f64 = 1e-9;

/// What one controller has announced of its commands, and how much of it is left.
#[derive(Debug)]
pub(super) struct Allowed {
    /// Wall time from one command to the next, if it was announced.
    period_s: Option<f64>,
    /// What is commanded moves.
    moves: bool,
    /// The first command since it was armed, and the one that is due.
    first: u64,
    next: u64,
    at: Option<Nanos>,
    /// Wall time that has passed and was not used for motion.
    credit_s: f64,
}

impl Allowed {
    pub fn by(visitor: &Visitor, moves: bool) -> Self {
        Self {
            period_s: visitor
                .rate
                .map(|(commands, seconds)| seconds as f64 / commands as f64),
            moves,
            first: 0,
            next: 0,
            at: None,
            credit_s: BURST_S,
        }
    }

    /// From here commands come, and this is the first.
    pub fn begin(&mut self, first: u64) {
        (self.first, self.next) = (first, first);
        (self.at, self.credit_s) = (None, BURST_S);
    }

    /// Commands may come from now on.
    pub fn starts(&mut self, now: Nanos) {
        self.at.get_or_insert(now);
    }

    fn burst(&self) -> f64 {
        BURST_S.max(self.period_s.unwrap_or(0.0))
    }

    /// The time of command `sequence`, which comes now and says that it is `elapsed` of test time after the last; none if
    /// nothing is known. Real-time: yes.
    pub fn time_of(&mut self, sequence: u64, elapsed: f64, now: Nanos) -> Option<f64> {
        let passed = now.since(*self.at.get_or_insert(now)) as f64 * 1e-9;
        self.at = Some(now);
        self.credit_s += passed;
        let goes_nowhere = self.period_s.is_some() && sequence == self.first;
        let commands = sequence.saturating_sub(self.next).saturating_add(1);
        self.next = sequence.saturating_add(1);
        let said = Some(elapsed).filter(|said| *said > 0.0);
        let time = match self.period_s {
            Some(period) => {
                let time = (period * commands as f64).min(self.credit_s);
                if self.moves { time } else { time.max(period) }
            }
            None if self.moves => said
                .unwrap_or(USUAL_TICK_S)
                .min(passed.max(USUAL_TICK_S))
                .min(self.credit_s),
            None => return said.map(|said| said.max(SHORTEST_S)),
        };
        let used = if goes_nowhere { 0.0 } else { time };
        self.credit_s = (self.credit_s - used).clamp(0.0, self.burst());
        Some(time.max(SHORTEST_S))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 1e-3;

    fn allowed(rate: Option<(u64, u64)>, moves: bool) -> Allowed {
        let visitor = Visitor {
            rate,
            ..Visitor::unnamed(([127, 0, 0, 1], 1).into())
        };
        let mut allowed = Allowed::by(&visitor, moves);
        allowed.begin(0);
        allowed
    }

    /// The times that are allowed to commands (number, test time since the last, wall time in ms).
    fn times(
        mut allowed: Allowed,
        commands: impl IntoIterator<Item = (u64, f64, f64)>,
    ) -> Vec<f64> {
        times_of(&mut allowed, commands)
    }

    fn times_of(
        allowed: &mut Allowed,
        commands: impl IntoIterator<Item = (u64, f64, f64)>,
    ) -> Vec<f64> {
        let commands = commands.into_iter();
        commands
            .map(|(number, elapsed, ms)| {
                let now = Nanos((1e6 * ms) as u64);
                allowed.time_of(number, elapsed, now).unwrap()
            })
            .collect()
    }

    #[test]
    fn a_controller_at_its_rate_has_its_period_however_unevenly_its_frames_arrive() {
        let mut chance = 1_u32;
        let mut arrived: f64 = 0.0;
        let commands: Vec<_> = (0..5000)
            .map(|k| {
                chance = chance.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                // Up to 18 ms late, and then all at once.
                arrived = arrived.max(k as f64 + f64::from(chance >> 24) * 18.0 / 255.0);
                (k, 1e3, arrived)
            })
            .collect();
        for moves in [true, false] {
            let found = times(allowed(Some((1000, 1)), moves), commands.clone());
            // Sums of 5000 differences of whole nanoseconds.
            assert!(found.iter().all(|time| (time - PERIOD).abs() < 1e-12));
        }
    }

    #[test]
    fn who_runs_ahead_of_the_wall_has_the_burst_and_then_the_wall() {
        let commands = || (0..1000).map(|k| (k, 1e3, 0.1 * k as f64));
        let found = times(allowed(Some((1000, 1)), true), commands());
        assert_eq!(found[..20], [PERIOD; 20]);
        assert!(found[30..].iter().all(|time| (time - 1e-4).abs() < 1e-9));
        // A pause is no licence for a race.
        let paused = (0..100).map(|k| (k, 1e3, if k == 0 { 0.0 } else { 1e4 }));
        let found = times(allowed(Some((1000, 1)), true), paused);
        assert!(found.iter().sum::<f64>() < BURST_S + 3.0 * PERIOD);
        let found = times(allowed(Some((1000, 1)), false), commands());
        assert!(found.iter().all(|time| *time == PERIOD), "a formula");
    }

    #[test]
    fn a_slow_rate_begins_with_the_burst_and_no_period() {
        let slow = || {
            let mut one = allowed(Some((1, 10)), true);
            one.begin(0);
            one.starts(Nanos(0));
            one
        };
        let is = |found: f64, wanted: f64| (found - wanted).abs() < 1e-9;
        // At once, and then as it announced.
        let found = times(slow(), [(0, 10.0, 0.0), (1, 10.0, 9_990.0), (2, 10.0, 2e4)]);
        assert!(is(found[0], BURST_S), "{found:?}");
        assert!(found[1..].iter().all(|time| is(*time, 10.0)), "{found:?}");
        // The first is lost, or left out: as much as has passed.
        for (at_ms, wanted) in [(0.0, BURST_S), (1e3, 1.02), (1e4, 10.02)] {
            let found = times(slow(), [(1, 10.0, at_ms)]);
            assert!(is(found[0], wanted), "{at_ms}: {found:?}");
        }
        // So it is after another Arm.
        let mut again = slow();
        let _ = times_of(&mut again, [(0, 10.0, 0.0), (1, 10.0, 1e4)]);
        again.begin(5);
        let found = times_of(&mut again, [(6, 10.0, 3e4)]);
        assert!(is(found[0], BURST_S), "{found:?}");
    }

    #[test]
    fn lost_commands_give_time_as_far_as_it_has_passed() {
        let mut one = allowed(Some((1000, 1)), false);
        one.starts(Nanos(0));
        let commands = [
            (3, 0.0, 3.0),
            (4, 0.0, 4.0),
            (504, 0.0, 504.0),
            (1 << 60, 0.0, 505.0),
        ];
        let found = times(one, commands);
        assert_eq!(found[..3], [4e-3, PERIOD, 0.5], "the first was number 3");
        assert!(found[3] < BURST_S + 2.0 * PERIOD);
    }

    #[test]
    fn without_a_rate_the_shorter_of_test_time_and_wall_time_holds() {
        let fast = (0..1000).map(|k| (k, 0.02, 0.1 * k as f64));
        let found = times(allowed(None, true), fast);
        assert!(found[10..].iter().all(|time| (time - 1e-4).abs() < 1e-9));
        let slow = (0..10).map(|k| (k, 0.02, 1e3 * k as f64));
        assert_eq!(times(allowed(None, true), slow)[1..], [0.02; 9]);
        let steady = (0..1000).map(|k| (k, 0.02, 20.0 * k as f64));
        let found = times(allowed(None, true), steady);
        assert!(found[1..].iter().all(|time| (time - 0.02).abs() < 1e-12));
        assert_eq!(times(allowed(None, false), [(0, 0.02, 0.0); 9]), [0.02; 9]);
    }
}
