//! The slices of the loop: the phases of tick after tick, without a gap and without an overlap.
//!
//! The recording time of a tick is in the row behind it, and the loop's wait follows from the next edge. So a tick is shown
//! when the next one is known.

use std::io::Write;

use serde_json::{Value, json};

use super::lines::Lines;
use super::misses::{self, Misses};
use super::{GRID, LOOP, Stamped, instant, rounded, slice};

/// A lateness below this is rounding, µs.
const NOTHING: f64 = 1e-3;

/// A tick of the window.
pub(super) struct Tick {
    pub sequence: u64,
    pub stamped: Stamped,
}

/// A tick whose end is not known yet.
struct Open {
    tick: Tick,
    /// Begin of its first phase: its edge, or the end of the tick before.
    begin: f64,
    /// When its row was handed over.
    pushed: Option<f64>,
}

impl Open {
    /// The last that is known of it.
    fn done(&self) -> f64 {
        self.pushed
            .unwrap_or(self.tick.stamped.ready)
            .max(self.begin)
    }
}

/// The tick that follows another.
struct Next {
    /// Its edge.
    release: f64,
    /// Begin of its first phase.
    begin: f64,
    /// False if rows are missing between the two.
    follows: bool,
}

/// Shows one tick after the other.
pub(super) struct Loop {
    period_us: f64,
    misses: Misses,
    open: Option<Open>,
    stretched: f64,
}

impl Loop {
    pub(crate) const fn new(period_us: f64, misses: Misses) -> Self {
        Self {
            period_us,
            misses,
            open: None,
            stretched: f64::NAN,
        }
    }

    /// True if the grid was past this edge already.
    pub(crate) fn is_behind(&self, tick: &Stamped) -> bool {
        let open = self.open.as_ref();
        open.is_some_and(|open| tick.release < open.tick.stamped.release)
    }

    /// The row of this number says how long the recording of the one before took.
    pub(crate) const fn told(&mut self, sequence: u64, record_us: f64) {
        if let Some(open) = &mut self.open
            && open.tick.sequence + 1 == sequence
            && record_us >= 0.0
        {
            open.pushed = Some(open.tick.stamped.ready + record_us);
        }
    }

    /// The next tick.
    pub(crate) fn take<W: Write>(&mut self, tick: Tick, lines: &mut Lines<W>) {
        let release = tick.stamped.release;
        let mut begin = release;
        if let Some(open) = self.open.take() {
            let open = self.with_its_miss(open);
            begin = begin.max(open.done());
            let next = Next {
                release,
                begin,
                follows: open.tick.sequence + 1 == tick.sequence,
            };
            self.show(&open, Some(&next), lines);
        }
        let moved = tick.stamped.stretched - self.stretched;
        if moved > 0.0 {
            let args = json!({ "by_ticks": moved });
            lines.hold(release, instant(GRID, "tick", "grid moved", release, &args));
        }
        self.stretched = tick.stamped.stretched;
        self.open = Some(Open {
            tick,
            begin,
            pushed: None,
        });
    }

    /// Nothing follows.
    pub(crate) fn finish<W: Write>(&mut self, lines: &mut Lines<W>) {
        if let Some(open) = self.open.take() {
            let open = self.with_its_miss(open);
            self.show(&open, None, lines);
        }
    }

    /// A miss knows when the row was handed over, also where rows do not.
    fn with_its_miss(&self, mut open: Open) -> Open {
        let missed = self.misses.at(open.tick.stamped.release + self.period_us);
        if let (Some(missed), None) = (missed, open.pushed) {
            open.pushed = Some(missed.pushed.max(open.tick.stamped.ready));
        }
        open
    }

    fn show<W: Write>(&self, open: &Open, next: Option<&Next>, lines: &mut Lines<W>) {
        let Tick {
            sequence,
            stamped: tick,
        } = &open.tick;
        let mut put = |line: u16, name: &str, from: f64, to: f64, args: Value| {
            lines.hold(rounded(from), slice(line, "tick", name, from, to, args));
        };
        let about = json!({
            "row": sequence, "step": tick.step, "sub_tick": tick.sub_tick, "state": tick.state, "test_time_s": tick.time,
            "wakeup_lateness_us": rounded(tick.woke - tick.release),
            "command_lateness_us": rounded(tick.sent - tick.release),
            "stretched_ticks": tick.stretched,
        });
        let length = if self.period_us.is_finite() {
            self.period_us
        } else {
            tick.ready - tick.release
        };
        let deadline = tick.release + length;
        let name = format!("step {}", tick.step);
        // Edges are whole nanoseconds and a period need not be: not over the next.
        let until = next.map_or(deadline, |next| deadline.min(next.release));
        put(GRID, &name, tick.release, until, about);

        let done = open.done();
        let late = open
            .pushed
            .filter(|_| self.period_us.is_finite() && done - deadline > NOTHING);
        // A tick that began behind its deadline is late in all of it.
        let late_from = late.map(|_| deadline.max(open.begin));
        let mut under = late_from.map(|from| {
            let (name, args) = misses::words(self.misses.at(deadline), done - deadline);
            (from, name, args)
        });
        let mut from = open.begin;
        let phases = [
            ("wake up", Some(tick.woke)),
            ("send", Some(tick.sent)),
            ("wait for replies", Some(tick.decoded)),
            ("compute", Some(tick.ready)),
            ("record", open.pushed),
        ];
        for (name, to) in phases {
            let Some(to) = to else { continue };
            let to = to.max(from);
            // What straddles the deadline is shown in two parts.
            if let Some((at, ..)) = &under
                && *at < to
            {
                let at = at.max(from);
                if at > from {
                    put(
                        LOOP,
                        name,
                        from,
                        at,
                        json!({ "part": "before the deadline" }),
                    );
                    from = at;
                }
                if let Some((_, miss, args)) = under.take() {
                    put(LOOP, &miss, from, done, args);
                }
                if at > open.begin {
                    put(
                        LOOP,
                        name,
                        from,
                        to,
                        json!({ "part": "behind the deadline" }),
                    );
                } else {
                    put(LOOP, name, from, to, Value::Null);
                }
            } else {
                put(LOOP, name, from, to, Value::Null);
            }
            from = to;
        }
        if let Some(next) = next.filter(|next| next.begin > from) {
            let name = match open.pushed {
                _ if !next.follows => "no row of this",
                Some(_) => "wait for the edge",
                None => "record, then wait for the edge",
            };
            put(LOOP, name, from, next.begin, Value::Null);
        }
    }
}
