//! Terminal output while a test runs: one line, or several; the same numbers as the live page.
//!
//! Words and bars only: keys are not read. The system stops a program that reads its terminal as soon as it runs in the
//! background, and the loop with it. `gusset hold RUN_DIR` from another terminal replaces a key.

use std::cell::Cell;
use std::sync::Arc;

use super::args::{RunArgs, StatusArg};
use super::drawn::{bar, cut, gauge, short, width};
use super::progress::remaining;
use super::screen;
use gusset_control::engine::Phase;
use gusset_record::rt::os::monotonic_ns;
use gusset_setup::Facts;
use gusset_view::live::{Board, Margin, Mark, Snapshot, share};

/// Limits of one axis that are shown at most.
const MOST_LIMITS: usize = 4;

/// The status of a running test on a terminal.
pub struct Status {
    mode: StatusArg,
    rate_hz: f64,
    board: Option<Arc<Board>>,
    /// When the test was first seen to run, in ns, and its share then.
    begun: Cell<Option<(u64, f64)>>,
}

impl Status {
    /// As requested by the user; it also needs a terminal.
    pub fn new(facts: &Facts, args: &RunArgs) -> Self {
        let shown = !args.quiet && screen::is_there();
        Self {
            mode: if shown { args.status } else { StatusArg::Off },
            rate_hz: facts.rate_hz,
            board: None,
            begun: Cell::new(None),
        }
    }

    /// Whether anything is shown.
    pub fn is_shown(&self) -> bool {
        self.mode != StatusArg::Off
    }

    /// Shows this board from here on.
    pub fn look_at(&mut self, board: &Arc<Board>) {
        self.board = Some(Arc::clone(board));
    }

    /// Draws it again.
    pub fn show(&self) {
        let Some(board) = self.board.as_ref().filter(|_| self.is_shown()) else {
            return;
        };
        let (columns, rows) = screen::size();
        let mut sight = Sight::of(board, self.rate_hz);
        sight.remaining = self.remaining(&sight);
        let lines = match self.mode {
            StatusArg::Full => sight.block(columns, rows.saturating_sub(1)),
            _ => vec![sight.line(columns)],
        };
        screen::draw(&lines);
    }

    /// The remaining time of a test that runs.
    fn remaining(&self, sight: &Sight<'_>) -> Option<String> {
        if sight.board.glimpse().phase != Phase::Running {
            return None;
        }
        let (now_ns, share) = (monotonic_ns(), sight.share());
        let (began_ns, began_at) = self.begun.get().unwrap_or((now_ns, share));
        self.begun.set(Some((began_ns, began_at)));
        let elapsed_s = now_ns.saturating_sub(began_ns) as f64 * 1e-9;
        remaining(share - began_at, 1.0 - share, elapsed_s)
    }

    /// Takes it away.
    pub fn clear(&self) {
        screen::step_aside();
    }
}

/// Everything that is shown, at one moment.
struct Sight<'a> {
    board: &'a Board,
    now: Arc<Snapshot>,
    margin: Option<Margin>,
    rate_hz: f64,
    age_s: f64,
    remaining: Option<String>,
}

impl<'a> Sight<'a> {
    fn of(board: &'a Board, rate_hz: f64) -> Self {
        let now = board.latest();
        let at = monotonic_ns();
        let age_s = if now.row_ns == 0 {
            0.0
        } else {
            at.saturating_sub(now.row_ns) as f64 * 1e-9
        };
        Self {
            margin: board.margin(at),
            board,
            now,
            rate_hz,
            age_s,
            remaining: None,
        }
    }

    fn duration(&self) -> f64 {
        self.board.subject.steps as f64 * self.board.subject.dt
    }

    fn share(&self) -> f64 {
        let share = self.now.time / self.duration();
        if share.is_finite() {
            share.clamp(0.0, 1.0)
        } else {
            0.0
        }
    }

    /// The phase; a lack of new rows is shown before everything else.
    fn phase(&self) -> String {
        let seen = self.board.glimpse();
        let phase = seen.phase;
        if seen.awaits_release() {
            return "UNLOAD EVERY AXIS, THEN CONFIRM".to_owned();
        }
        // The slowest tests make a row in some seconds; then the limit follows from the period.
        if self.age_s > 2.0_f64.max(3.0 * self.board.subject.tick_s) {
            return format!("NO ROWS SINCE {:.0} s ({})", self.age_s, phase.word());
        }
        let mut words = phase.word().to_uppercase();
        if seen.unconfirmed {
            words.push_str(", TO BE CONFIRMED");
        }
        // In the test itself a hold is a phase.
        if seen.stands && phase != Phase::Holding {
            words.push_str(", HELD");
        }
        // The phase itself passes at once if a return move follows.
        if !self.now.trips.is_empty() && phase != Phase::Tripped {
            words.push_str(", TRIPPED");
        }
        words
    }

    /// Why it has tripped, if it has.
    fn trips(&self) -> Option<String> {
        let words = self.now.trips.iter().map(|trip| trip.words.as_str());
        let words: Vec<_> = words.collect();
        (!words.is_empty()).then(|| words.join("; "))
    }

    fn lambda(&self) -> Option<String> {
        let used = self.board.subject.lambda?.used;
        let margin = self.margin?;
        let limit = |value: f64| {
            if value.is_finite() {
                format!("{value:.3}")
            } else {
                "none".to_owned()
            }
        };
        let beyond = if used > margin.limit {
            "  UNSTABLE"
        } else {
            ""
        };
        Some(format!(
            "lambda {used}, limit {} (lowest {}){beyond}",
            limit(margin.limit),
            limit(margin.lowest)
        ))
    }

    /// The smallest margin of a specimen to its critical delay: now, and so far.
    fn delays(&self) -> Option<String> {
        let axes = self.board.subject.axes().zip(&self.now.axes);
        let known = axes.filter(|((_, _, axis), _)| axis.has_margin);
        let smallest = known
            .map(|((specimen, ..), view)| (view.margin, &specimen.name))
            // An unknown margin is not the smallest.
            .filter(|(margin, _)| !margin[1].is_nan())
            .min_by(|(a, _), (b, _)| a[1].total_cmp(&b[1]));
        let ([now, lowest], name) = smallest?;
        let room = |value: f64| {
            if value == f64::INFINITY {
                "none, every delay is stable".to_owned()
            } else {
                short(value, "s")
            }
        };
        let beyond = if now < 0.0 { "  UNSTABLE" } else { "" };
        Some(format!(
            "delay margin of {name} {} (lowest {}){beyond}",
            room(now),
            room(lowest)
        ))
    }

    /// Every limit that has a level and a value: whose, its mark, [value, low, high], share of the level that is used.
    fn limits(&self) -> impl Iterator<Item = (usize, String, &Mark, [f64; 3], f64)> {
        let axes = self.board.subject.axes().zip(&self.now.axes).enumerate();
        axes.flat_map(|(place, ((specimen, index, axis), view))| {
            let name = if specimen.axes.len() > 1 {
                format!("{} axis {}", specimen.name, index + 1)
            } else {
                specimen.name.clone()
            };
            let marks = axis.marks.iter().zip(&view.limits);
            marks.filter_map(move |(mark, values)| {
                let used = used(mark, values[0]);
                (!used.is_nan()).then(|| (place, name.clone(), mark, *values, used))
            })
        })
    }

    /// All in one line, the most important first: a narrow terminal cuts required parts, and omits the others.
    fn line(&self, columns: usize) -> String {
        let mut must = vec![self.phase()];
        must.push(format!("{:.2} of {:.2} s", self.now.time, self.duration()));
        must.push(format!("misses {}", self.now.misses.total()));
        if self.now.rows_lost > 0 {
            must.push(format!("ROWS LOST {}", self.now.rows_lost));
        }
        let closest = self.limits().max_by(|a, b| a.4.total_cmp(&b.4));
        let closest = closest.map(|(_, name, mark, _, used)| {
            format!("{:.0} % of trip: {name} {}", 100.0 * used, mark.key)
        });
        must.extend(self.trips().or(closest));
        let mut room = columns.saturating_sub(width(&must.join("  ")));
        let mut fits = |part: &String| {
            let is_room = width(part) + 2 <= room;
            room -= if is_room { width(part) + 2 } else { 0 };
            is_room
        };
        let late = self.now.timing.first().filter(|late| late.count > 0);
        let late = late.map(|late| format!("late p99 {}", short(late.p99, "s")));
        let rate = format!("{:.0} Hz", self.rate_hz);
        let rest = [
            self.remaining.clone(),
            late,
            self.delays(),
            self.lambda(),
            Some(rate),
        ];
        let rest = rest.into_iter().flatten();
        let rest: Vec<_> = rest.filter(&mut fits).collect();
        // A picture that repeats the numbers is the first to be omitted.
        let bars = [20, 10].map(|width| bar(self.share(), width));
        let bar = bars.into_iter().find(fits);
        let tail = must.split_off(2);
        let parts = must.into_iter().chain(bar).chain(tail);
        let parts: Vec<_> = parts.chain(rest).collect();
        cut(&parts.join("  "), columns)
    }

    fn block(&self, columns: usize, rows: usize) -> Vec<String> {
        let now = &self.now;
        let mut lines = vec![
            format!(
                "{}  test time {:.3} of {:.3} s{}  step {}  {:.0} Hz",
                self.phase(),
                now.time,
                self.duration(),
                self.remaining
                    .as_ref()
                    .map_or_else(String::new, |text| format!(", {text}")),
                now.steps,
                self.rate_hz
            ),
            bar(self.share(), columns.saturating_sub(1).min(78)),
        ];
        lines.extend(self.trips().map(|trips| format!("TRIPPED  {trips}")));
        let mut last = vec![self.losses()];
        for late in now.timing.iter().filter(|late| late.count > 0) {
            last.push(format!(
                "{:<17}  p50 {}  p99 {}  p99.9 {}  max {}",
                late.key,
                short(late.p50, "s"),
                short(late.p99, "s"),
                short(late.p99_9, "s"),
                short(late.max, "s")
            ));
        }
        last.extend(self.delays());
        last.extend(self.lambda());
        last.push(format!(
            "Ctrl-C stops   gusset hold {}",
            self.board.subject.run
        ));
        let room = rows.saturating_sub(lines.len() + last.len());
        let axes = self.axes(columns);
        let hidden = axes.len().saturating_sub(room);
        lines.extend(axes.into_iter().take(room));
        if hidden > 0 && room > 0 {
            lines.pop();
            lines.push(format!(
                "… {} lines more: the terminal is too low",
                hidden + 1
            ));
        }
        lines.extend(last);
        lines.truncate(rows.max(1));
        lines.iter().map(|line| cut(line, columns)).collect()
    }

    fn losses(&self) -> String {
        let misses = self.now.misses;
        format!(
            "deadline misses {} ({})  stretched {}  rows lost {}",
            misses.total(),
            misses
                .each()
                .map(|(cause, count)| format!("{} {count}", cause.words()))
                .join(", "),
            if self.now.stretched.is_finite() {
                self.now.stretched
            } else {
                0.0
            },
            self.now.rows_lost
        )
    }

    /// Every axis: its values, and below them the limits that are closest.
    fn axes(&self, columns: usize) -> Vec<String> {
        let mut lines = Vec::new();
        let axes = self.board.subject.axes().zip(&self.now.axes).enumerate();
        for (place, ((specimen, index, _), view)) in axes {
            let name = match specimen.axes.len() {
                1 => specimen.name.clone(),
                _ => format!("{} axis {}", specimen.name, index + 1),
            };
            lines.push(format!(
                "{name}  command {}  measured {}  force {}",
                short(view.command, "m"),
                short(view.measured, "m"),
                short(view.force, "N")
            ));
            let mut limits: Vec<_> = self.limits().filter(|limit| limit.0 == place).collect();
            limits.sort_by(|a, b| b.4.total_cmp(&a.4));
            for (_, _, mark, [value, low, high], share) in limits.into_iter().take(MOST_LIMITS) {
                let worst = used(mark, low).max(used(mark, high));
                lines.push(format!(
                    "  {:<22} {} {:>12}  {:>3.0} % of trip, worst {:.0} %",
                    mark.key,
                    gauge(
                        mark,
                        value,
                        [low, high],
                        if columns >= 90 { 24 } else { 12 }
                    ),
                    short(value, mark.unit),
                    100.0 * share,
                    100.0 * worst
                ));
            }
        }
        lines
    }
}

/// Share of the level at which a limit trips, on the side of the value; of the warning level where it never trips.
fn used(mark: &Mark, value: f64) -> f64 {
    let shares = [mark.trip, mark.warn].map(|levels| share(levels, value));
    shares
        .into_iter()
        .find(|share| !share.is_nan())
        .unwrap_or(f64::NAN)
}

#[cfg(test)]
#[path = "status_tests.rs"]
mod tests;
