//! The speed allowance of a specimen: the time that each command has for its motion, which its speed is judged by.
//!
//! For a specimen that moves, this is wall time, whatever test time the client sends. The allowance is the specimen's: it fills
//! with the time that passes, up to the burst, and each command that moves the specimen uses its share. An Arm and a new session
//! fill nothing, and a silence or a hold fills no more than the burst. The burst is [`BURST_S`], or two periods of the announced
//! rate where that is longer, and [`MOST_S`] at most. So with a velocity limit v no commands move the specimen by more
//! than v·(T + burst) in T seconds. The client does not choose the burst: a single command has at most [`MOST_S`] for its
//! motion, however seldom commands come. The limits that the client announced are judged by its own period instead.
//!
//! A client that announced its rate has one period for each command, lost ones included, as far as the allowance lasts. Before
//! its first command the allowance holds [`BURST_S`] at most. A client without a rate has the shorter of the wall time since its
//! last command (0.01 s at least) and the test time that it sends. A formula needs no such protection: it has at least one
//! announced period, or the test time of the client.

use super::USUAL_TICK_S;
use gusset_quantity::time::Nanos;

/// The burst in s, where two announced periods are not longer.
const BURST_S: f64 = 0.02;
/// The longest burst in s of a specimen that moves, and the longest time that one command has for its motion.
const MOST_S: f64 = 0.1;
/// A speed has a time, however short.
const SHORTEST_S: f64 = 1e-9;

/// A command as the allowance sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Request {
    /// Its number.
    pub sequence: u64,
    /// Test time in s since the last commit, as the client sent it.
    pub elapsed: f64,
    /// It repeats the last command.
    pub stays: bool,
}

/// The seconds that a command has for its motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Times {
    /// By the limits of the specimen.
    pub own: f64,
    /// By the limits that the client announced.
    pub announced: f64,
}

impl Times {
    /// One time by both.
    pub(crate) const fn both(time: f64) -> Self {
        Self {
            own: time,
            announced: time,
        }
    }
}

/// The speed allowance of one specimen.
#[derive(Debug, Clone)]
pub(super) struct SpeedAllowance {
    /// Wall time from one command to the next, if it was announced.
    period_s: Option<f64>,
    /// True if a command moves the specimen.
    moves: bool,
    /// The command that is due.
    next: u64,
    /// Commands may come, and none has come yet.
    waits: bool,
    /// Up to when time was counted, and when the last command came.
    at: Option<Nanos>,
    commanded: Option<Nanos>,
    /// Wall time that has passed and was not used for motion.
    credit_s: f64,
    /// That time for the limits that the client announced, with a burst of two of its periods however long.
    announced_credit_s: f64,
    /// The last command had less than the client's own period, for [`MOST_S`] is shorter.
    is_cut: bool,
}

impl SpeedAllowance {
    /// The full burst, for a specimen that `moves` or a formula.
    pub(crate) fn new(moves: bool) -> Self {
        Self {
            period_s: None,
            moves,
            next: 0,
            waits: true,
            at: None,
            commanded: None,
            credit_s: BURST_S,
            announced_credit_s: BURST_S,
            is_cut: false,
        }
    }

    /// The client of a session announced this rate: commands and the seconds that they take.
    pub(crate) fn announced(&mut self, rate: Option<(u64, u64)>) {
        self.is_cut = false;
        self.period_s = rate.map(|(commands, seconds)| seconds as f64 / commands as f64);
    }

    /// Restores the full burst and keeps the rate, for a formula that starts again.
    pub(crate) fn forget(&mut self) {
        *self = Self {
            period_s: self.period_s,
            ..Self::new(self.moves)
        };
    }

    /// From here commands come, and this is the first.
    pub(crate) fn begin(&mut self, first: u64) {
        (self.next, self.waits) = (first, true);
    }

    /// Commands may come from now on. The time before counts as a burst. Real-time: yes.
    pub(crate) fn starts(&mut self, now: Nanos) {
        if std::mem::take(&mut self.waits) {
            let passed = now.since(*self.at.get_or_insert(now)) as f64 * 1e-9;
            for credit in [&mut self.credit_s, &mut self.announced_credit_s] {
                *credit = (*credit + passed).min(BURST_S);
            }
            self.at = Some(now);
        }
    }

    /// Two periods of the client: its commands come at least so often.
    fn two_periods(&self) -> f64 {
        BURST_S.max(2.0 * self.period_s.unwrap_or(0.0))
    }

    fn burst(&self) -> f64 {
        let longest = if self.moves { MOST_S } else { f64::INFINITY };
        self.two_periods().min(longest)
    }

    /// Why the last command was judged by less time than its client has for it, if it was.
    pub(crate) fn says_cut(&self) -> Option<String> {
        self.is_cut.then(|| {
            format!(
                "at a specimen that moves a command has at most {MOST_S} s for its motion: send smaller steps more often"
            )
        })
    }

    /// True if no command came for longer than two periods, so that the specimen has come to rest. After an Arm this applies
    /// to every specimen, else only to one that moves: a formula, or a client without a rate, may pause between steps.
    /// Real-time: yes.
    pub(crate) fn has_rested(&self, now: Nanos) -> bool {
        let silent = |last: Nanos| now.since(last) as f64 * 1e-9 > self.two_periods();
        let is_due = self.waits || (self.moves && self.period_s.is_some());
        is_due && self.commanded.is_some_and(silent)
    }

    /// The times of a command that comes now; none if nothing is known. Real-time: yes.
    pub(crate) fn time_of(&mut self, request: Request, now: Nanos) -> Option<Times> {
        self.starts(now);
        let Request {
            sequence,
            elapsed,
            stays,
        } = request;
        let passed = now.since(*self.at.get_or_insert(now)) as f64 * 1e-9;
        (self.at, self.commanded) = (Some(now), Some(now));
        self.credit_s += passed;
        self.announced_credit_s += passed;
        let commands = sequence.saturating_sub(self.next).saturating_add(1);
        self.next = sequence.saturating_add(1);
        let said = Some(elapsed).filter(|said| *said > 0.0);
        let Times { own, announced } = match self.period_s {
            Some(period) if self.moves => {
                let wanted = period * commands as f64;
                self.credit_s = self.credit_s.min(self.burst());
                self.announced_credit_s = self.announced_credit_s.min(self.two_periods());
                Times {
                    own: wanted.min(self.credit_s),
                    announced: wanted.min(self.announced_credit_s),
                }
            }
            Some(period) => {
                let wanted = period * commands as f64;
                Times::both(wanted.min(self.credit_s).max(period))
            }
            None if self.moves => {
                let time = said
                    .unwrap_or(USUAL_TICK_S)
                    .min(passed.max(USUAL_TICK_S))
                    .min(self.credit_s);
                self.credit_s = self.credit_s.min(MOST_S);
                Times {
                    own: time.min(MOST_S),
                    announced: time,
                }
            }
            None => return said.map(|said| Times::both(said.max(SHORTEST_S))),
        };
        self.is_cut = own < announced && own >= MOST_S;
        let used = |time: f64| if stays { 0.0 } else { time };
        self.credit_s = (self.credit_s - used(own)).clamp(0.0, self.burst());
        let left = self.announced_credit_s - used(announced);
        self.announced_credit_s = left.clamp(0.0, self.two_periods());
        Some(Times {
            own: own.max(SHORTEST_S),
            announced: announced.max(SHORTEST_S),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 1e-3;

    fn allowed(rate: Option<(u64, u64)>, moves: bool) -> SpeedAllowance {
        let mut allowed = SpeedAllowance::new(moves);
        allowed.announced(rate);
        allowed.begin(0);
        allowed
    }

    /// The times that are allowed to commands (number, test time since the last, wall time in ms) that all move.
    fn times(
        mut allowed: SpeedAllowance,
        commands: impl IntoIterator<Item = (u64, f64, f64)>,
    ) -> Vec<f64> {
        times_of(&mut allowed, commands)
    }

    fn times_of(
        allowed: &mut SpeedAllowance,
        commands: impl IntoIterator<Item = (u64, f64, f64)>,
    ) -> Vec<f64> {
        let commands = commands.into_iter();
        commands
            .map(|(number, elapsed, ms)| {
                let now = Nanos((1e6 * ms) as u64);
                let request = Request {
                    sequence: number,
                    elapsed,
                    stays: false,
                };
                allowed.time_of(request, now).unwrap().own
            })
            .collect()
    }

    #[test]
    fn uneven_frames_keep_their_period() {
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
    fn fast_client_gets_the_burst_then_the_wall() {
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
    fn slow_rate_starts_with_the_burst() {
        let slow = || {
            let mut one = allowed(Some((1, 10)), true);
            one.begin(0);
            one.starts(Nanos(0));
            one
        };
        let is = |found: f64, wanted: f64| (found - wanted).abs() < 1e-9;
        let request = |sequence, stays| Request {
            sequence,
            elapsed: 10.0,
            stays,
        };
        // At once, at the place of the Arm, and then as it announced. Its own limits know its period.
        let mut one = slow();
        let first = one.time_of(request(0, true), Nanos(0)).unwrap();
        assert!(is(first.own, BURST_S) && is(first.announced, BURST_S));
        for (sequence, at) in [(1, 9_990_000_000), (2, 20_000_000_000)] {
            let found = one.time_of(request(sequence, false), Nanos(at)).unwrap();
            assert!(is(found.own, MOST_S), "{found:?}");
            assert!(is(found.announced, 10.0), "{found:?}");
            assert!(one.says_cut().is_some());
        }
        // The first is lost, or omitted: the elapsed time, up to the burst.
        for (at_ns, own, announced) in [
            (0, BURST_S, BURST_S),
            (50_000_000, 0.07, 0.07),
            (1_000_000_000, MOST_S, 1.02),
            (10_000_000_000, MOST_S, 10.02),
        ] {
            let found = slow().time_of(request(1, false), Nanos(at_ns)).unwrap();
            assert!(is(found.own, own), "{at_ns}: {found:?}");
            assert!(is(found.announced, announced), "{at_ns}: {found:?}");
        }
        // So it is after another Arm.
        let mut again = slow();
        let _ = times_of(&mut again, [(0, 10.0, 0.0), (1, 10.0, 1e4)]);
        again.begin(5);
        let found = times_of(&mut again, [(6, 10.0, 3e4)]);
        assert!(is(found[0], BURST_S), "{found:?}");
    }

    #[test]
    fn one_command_gets_a_tenth_of_a_second() {
        for rate in [Some((1, 4)), Some((2, 1)), Some((1000, 1)), None] {
            let mut one = allowed(rate, true);
            let commands = (0..20).map(|k| (100_000 * k, 1e3, 1e4 * k as f64));
            let found = times_of(&mut one, commands);
            assert!(found.iter().all(|time| *time <= MOST_S), "{rate:?}");
        }
        // A formula takes the time of its client.
        let commands = (0..3).map(|k| (k, 4.0, 4e3 * k as f64));
        let found = times(allowed(Some((1, 4)), false), commands);
        assert_eq!(found[1..], [4.0; 2]);
    }

    #[test]
    fn lost_commands_earn_elapsed_time() {
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
    fn silence_leaves_only_the_burst() {
        for (rate, period, burst) in [((1000, 1), PERIOD, BURST_S), ((10, 1), 0.1, MOST_S)] {
            let mut one = allowed(Some(rate), true);
            let last = (10.0 / period) as u64;
            let commands = [
                (0, 0.0, 0.0),
                (last, 0.0, 1e4),
                (last + 1, 0.0, 1e4 + 0.001),
            ];
            let found = times_of(&mut one, commands);
            let sum = found[1] + found[2];
            assert!(found[1] <= burst && sum < burst + 2e-6, "{found:?}");
            // One period where the numbers continue, as after a hold.
            let found = times_of(
                &mut one,
                [(last + 2, 0.0, 2e4), (last + 3, 0.0, 2e4 + 1e3 * period)],
            );
            assert!(found.iter().all(|time| (time - period).abs() < 1e-9));
        }
    }

    #[test]
    fn specimen_rests_after_a_silence() {
        for (rate, moves, in_session) in [
            (Some((1000, 1)), true, true),
            (Some((1000, 1)), false, false),
            (None, true, false),
            (None, false, false),
        ] {
            let mut one = allowed(rate, moves);
            let _ = times_of(&mut one, [(0, 0.02, 0.0)]);
            let [soon, later] = [10, 30].map(|ms| Nanos(ms * 1_000_000));
            assert!(!one.has_rested(soon));
            assert_eq!(one.has_rested(later), in_session, "{rate:?} {moves}");
            one.begin(5);
            assert!(!one.has_rested(soon));
            assert!(one.has_rested(later), "{rate:?} {moves}");
        }
    }

    #[test]
    fn arm_does_not_renew_the_allowance() {
        for rates in [[Some((1000, 1)); 2], [None; 2], [Some((1000, 1)), None]] {
            let mut one = allowed(rates[0], true);
            let mut sum = 0.0;
            for (k, rate) in (0..200_u64).zip(rates.into_iter().cycle()) {
                let at = 0.1 * k as f64;
                if k % 3 == 0 {
                    one.announced(rate);
                }
                one.begin(7 * k);
                one.starts(Nanos((1e6 * at) as u64));
                sum += times_of(&mut one, [(7 * k, 0.02, at)])[0];
            }
            // 19.9 ms of wall time.
            assert!(sum < 0.0199 + BURST_S + 1e-6, "{rates:?}: {sum}");
        }
    }

    #[test]
    fn without_a_rate_the_shorter_time_holds() {
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
