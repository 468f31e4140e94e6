//! Window of received counters: duplicates, replays and late datagrams, as pure arithmetic.
//!
//! The window keeps the newest counter and one bit for each of the 64 counters up to it, as the anti-replay window of
//! RFC 4303 (IPsec ESP), section 3.4.3, does. Invariant: a counter is accepted at most once, and never when it is too
//! old to decide this. Counters begin at 1; 0 is always refused.

use super::WireError;

/// How many counters back the window remembers.
pub const WINDOW: u64 = 64;

/// How an accepted frame arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// Newer than everything before.
    Newest {
        /// How many counters were passed over: frames that are lost, unless they turn up late.
        skipped: u64,
    },
    /// Older than the newest one, received for the first time: overtaken on the way. Its content may fill a gap but
    /// must never replace newer content.
    Late {
        /// How far behind the newest one.
        behind: u64,
    },
}

/// The counters of one direction of one session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SequenceWindow {
    /// Newest counter, 0 before the first.
    newest: u64,
    /// Bit i is set if `newest - i` has been received.
    seen: u64,
}

impl SequenceWindow {
    /// A window before the first counter.
    #[must_use]
    pub const fn new() -> Self {
        Self { newest: 0, seen: 0 }
    }

    /// The newest counter accepted, 0 before the first.
    #[must_use]
    #[cfg(test)]
    pub(crate) const fn newest(&self) -> u64 {
        self.newest
    }

    /// Accepts a counter that has not been received, and remembers it. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Replayed`] or [`WireError::TooOld`]; the window is unchanged then.
    pub fn accept(&mut self, counter: u64) -> Result<Arrival, WireError> {
        if counter > self.newest {
            let forward = counter - self.newest;
            self.seen = if forward < WINDOW {
                (self.seen << forward) | 1
            } else {
                1
            };
            self.newest = counter;
            return Ok(Arrival::Newest {
                skipped: forward - 1,
            });
        }
        let behind = self.newest - counter;
        if behind >= WINDOW || counter == 0 {
            return Err(WireError::TooOld {
                counter,
                newest: self.newest,
            });
        }
        let bit = 1_u64 << behind;
        if self.seen & bit != 0 {
            return Err(WireError::Replayed { counter });
        }
        self.seen |= bit;
        Ok(Arrival::Late { behind })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn arrivals_match_the_table() {
        let newest = |skipped| Ok(Arrival::Newest { skipped });
        let late = |behind| Ok(Arrival::Late { behind });
        let replayed = |counter| Err(WireError::Replayed { counter });
        let too_old = |counter, newest| Err(WireError::TooOld { counter, newest });
        let table = [
            (0, too_old(0, 0)),
            (1, newest(0)),
            (1, replayed(1)),
            (2, newest(0)),
            (5, newest(2)),
            (4, late(1)),
            (4, replayed(4)),
            (2, replayed(2)),
            (3, late(2)),
            (66, newest(60)),
            (3, replayed(3)),
            (2, too_old(2, 66)),
            (65, late(1)),
            (200, newest(133)),
            (136, too_old(136, 200)),
            (137, late(63)),
            (137, replayed(137)),
            (66, too_old(66, 200)),
            (264, newest(63)),
            (200, too_old(200, 264)),
            (u64::MAX, newest(u64::MAX - 265)),
            (u64::MAX, replayed(u64::MAX)),
            (u64::MAX - 63, late(63)),
            (0, too_old(0, u64::MAX)),
        ];
        let mut window = SequenceWindow::new();
        for (row, (counter, expected)) in table.into_iter().enumerate() {
            assert_eq!(window.accept(counter), expected, "row {row}");
        }
    }

    proptest! {
        #[test]
        fn window_decides_like_a_set_of_counters(counters in prop::collection::vec(0_u64..400, 1..400)) {
            let mut window = SequenceWindow::new();
            let mut all = std::collections::HashSet::new();
            let mut newest = 0;
            for counter in counters {
                let fresh = counter != 0 && counter + WINDOW > newest && !all.contains(&counter);
                prop_assert_eq!(window.accept(counter).is_ok(), fresh);
                if fresh {
                    all.insert(counter);
                    newest = newest.max(counter);
                }
                prop_assert_eq!(window.newest(), newest);
            }
        }
    }
}
