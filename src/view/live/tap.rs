//! Reads the rows on the writer's thread: present values, peaks, counts, and the thinned history.
//!
//! It allocates sixty times a second and never waits: values that the board does not take now follow at the next turn.

use std::collections::VecDeque;
use std::sync::Arc;

use crossbeam_channel::Receiver;

use super::axis::AxisTap;
use super::board::{Board, Snapshot, WINDOW_NS};
use super::history::Bin;
use super::latency::{KEYS, Latency, Stall};
use super::specimen::{RowHead, SpecimenTap};
use super::subject::{ChannelKind, at};
use super::trip::Trip;
use gusset_control::engine::Phase;
use gusset_quantity::catalog::limit::Limit;
use gusset_record::{Event, Note, Onlooker, Progress, TimedEvent};

/// Bins a second of wall time at most, on the real clock.
const BINS_HZ: f64 = 60.0;
/// Least wall time of a bin where rows come faster than in real time, ns.
const BIN_NS: u64 = 1_000_000;
/// Time between two snapshots, ns.
const SNAPSHOT_NS: u64 = 50_000_000;
/// Span of the recent deadline misses, ns.
const RECENT_NS: u64 = 10_000_000_000;
/// Bins that may wait for the board.
const WAITING: usize = 512;
/// Most causes of a trip that are kept.
const MOST_TRIPS: usize = 16;

/// Reads every row of a test and keeps a [`Board`] up to date.
#[derive(Debug)]
pub struct Tap {
    board: Arc<Board>,
    notes: Receiver<Note>,
    rows_per_bin: u64,
    open: Open,
    waiting: Vec<Bin>,
    specimens: Vec<SpecimenTap>,
    test: Vec<[f64; 2]>,
    timing: Vec<Latency>,
    /// Values of the last row, and the causes of a trip.
    seen: Snapshot,
    /// Number of the first row.
    first: Option<u64>,
    /// A row came since the last turn.
    is_fresh: bool,
    /// An event has already reported the trip of the next phase.
    is_told: bool,
    recent: RecentMisses,
    last_snapshot_ns: u64,
    last_bin_ns: u64,
    window_ns: u64,
}

/// The bin that is being filled.
#[derive(Debug, Default)]
struct Open {
    rows: u64,
    values: Vec<[f32; 2]>,
}

/// Deadline misses of the last 10 s.
#[derive(Debug, Default)]
struct RecentMisses {
    /// Monotonic clock in ns and the total from then on, oldest first.
    totals: VecDeque<(u64, u64)>,
}

impl RecentMisses {
    /// Takes the total of now, at most every tenth of a second.
    fn note(&mut self, now_ns: u64, total: u64) {
        let last = self.totals.back();
        if last.is_some_and(|(at, _)| now_ns.saturating_sub(*at) < RECENT_NS / 100) {
            return;
        }
        self.totals.push_back((now_ns, total));
        // The newest total that is older than the span is the one to compare with.
        let is_old = |entry: Option<&(u64, u64)>| {
            entry.is_some_and(|(at, _)| now_ns.saturating_sub(*at) >= RECENT_NS)
        };
        while is_old(self.totals.get(1)) {
            self.totals.pop_front();
        }
    }

    /// Misses between the start of the span and now. The first total counts from zero.
    fn of(&self, now_ns: u64, total: u64) -> u64 {
        let oldest = self.totals.front();
        let before = oldest.filter(|(at, _)| now_ns.saturating_sub(*at) >= RECENT_NS);
        total.saturating_sub(before.map_or(0, |(_, before)| *before))
    }
}

impl Tap {
    /// For the test of `board`; `notes` are written among its events.
    #[must_use]
    pub fn new(board: Arc<Board>, notes: Receiver<Note>) -> Self {
        let subject = &board.subject;
        let per_bin = (1.0 / (BINS_HZ * subject.tick_s)).ceil();
        Self {
            rows_per_bin: (per_bin as u64).max(1),
            open: Open {
                rows: 0,
                values: vec![[f32::NAN; 2]; subject.channels.len()],
            },
            waiting: Vec::new(),
            specimens: subject.specimens.iter().map(SpecimenTap::new).collect(),
            test: vec![[f64::NAN; 2]; subject.test.len()],
            timing: if subject.real_clock {
                KEYS.map(|_| Latency::new()).into()
            } else {
                Vec::new()
            },
            seen: Snapshot::default(),
            first: None,
            is_fresh: false,
            is_told: false,
            recent: RecentMisses::default(),
            last_snapshot_ns: 0,
            last_bin_ns: 0,
            window_ns: 0,
            board,
            notes,
        }
    }

    fn close_bin(&mut self) {
        if self.open.rows == 0 {
            return;
        }
        self.open.rows = 0;
        let fresh = vec![[f32::NAN; 2]; self.open.values.len()];
        let bin = Bin {
            until: self.seen.elapsed,
            time: self.seen.time,
            state: self.seen.state,
            values: std::mem::replace(&mut self.open.values, fresh),
            loops: axes_mut(&mut self.specimens)
                .map(AxisTap::take_loop)
                .collect(),
        };
        if self.waiting.len() < WAITING {
            self.waiting.push(bin);
        }
    }

    fn snapshot(&self, now_ns: u64, progress: &Progress) -> Snapshot {
        let views = KEYS.into_iter().zip(&self.timing);
        Snapshot {
            now_ns,
            steps: self.seen.step.max(0.0) as u64,
            rows_written: progress.rows_written,
            rows_lost: progress.rows_lost,
            events: progress.events,
            misses: progress.misses,
            recent_misses: self.recent.of(now_ns, progress.misses.total()),
            timing: views.map(|(key, latency)| latency.view(key)).collect(),
            axes: axes(&self.specimens).map(AxisTap::view).collect(),
            specimens: self.specimens.iter().map(|tap| tap.view.clone()).collect(),
            test: self.test_values(progress),
            ..self.seen.clone()
        }
    }

    fn test_values(&self, progress: &Progress) -> Vec<[f64; 2]> {
        let misses = progress.misses.total() as f64;
        let marks = self.board.subject.test.iter().zip(&self.test);
        marks
            .map(|(mark, values)| match mark.quantity {
                Limit::Misses => [misses; 2],
                _ => *values,
            })
            .collect()
    }

    /// Puts the values of a row into the open bin.
    fn fill(&mut self, row: &[f64]) {
        let subject = &self.board.subject;
        let places = &subject.places;
        let (mut dofs, mut grounds) = (places.dofs.iter(), places.grounds.iter());
        let mut axes = axes(&self.specimens);
        let mut axis = None;
        for (slot, channel) in self.open.values.iter_mut().zip(&subject.channels) {
            let value = match channel.kind {
                ChannelKind::Dof => at(row, dofs.next().copied()),
                ChannelKind::Ground => at(row, grounds.next().copied()),
                ChannelKind::Lateness => at(row, places.timing[0]),
                ChannelKind::Command => {
                    // The first of an axis' channels.
                    axis = axes.next();
                    axis.map_or(f64::NAN, |axis| axis.drawn.command)
                }
                ChannelKind::Measured => axis.map_or(f64::NAN, |axis| axis.drawn.measured),
                ChannelKind::Error => axis.map_or(f64::NAN, |axis| axis.drawn.error),
                ChannelKind::Force => axis.map_or(f64::NAN, |axis| axis.drawn.force),
            };
            let value = value as f32;
            *slot = [slot[0].min(value), slot[1].max(value)];
        }
    }

    fn count_timing(&mut self, row: &[f64]) {
        // No deadline counts while specimens move to the start of the test.
        if self.seen.state != Phase::Running.code() && self.seen.state <= Phase::Armed.code() {
            return;
        }
        let subject = &self.board.subject;
        let places = &subject.places;
        let stall = |late_s, ticks| Stall {
            late_s: at(row, late_s),
            // No number makes none.
            ticks: at(row, ticks) as u64,
        };
        let stalls = [
            stall(places.overrun, places.skipped_by_work),
            stall(places.timing[0], places.skipped_by_wakeup),
        ];
        // Both kinds of lateness, as the loop counts them.
        for latency in self.timing.iter_mut().take(2) {
            for stall in stalls {
                latency.swallowed(stall, subject.tick_s);
            }
        }
        for (latency, place) in self.timing.iter_mut().zip(places.timing) {
            latency.count(at(row, place));
        }
    }
}

/// Every axis of every specimen, in order.
fn axes(specimens: &[SpecimenTap]) -> impl Iterator<Item = &AxisTap> {
    specimens.iter().flat_map(|specimen| &specimen.axes)
}

fn axes_mut(specimens: &mut [SpecimenTap]) -> impl Iterator<Item = &mut AxisTap> {
    specimens.iter_mut().flat_map(|specimen| &mut specimen.axes)
}

impl Onlooker for Tap {
    fn row(&mut self, sequence: u64, row: &[f64]) {
        let board = Arc::clone(&self.board);
        let subject = &board.subject;
        let places = &subject.places;
        let first = *self.first.get_or_insert(sequence);
        self.is_fresh = true;
        let seen = &mut self.seen;
        seen.rows += 1;
        seen.elapsed = sequence.saturating_sub(first) as f64 * subject.tick_s;
        (seen.step, seen.time) = (at(row, places.step), at(row, places.time));
        (seen.state, seen.stretched) = (at(row, places.state), at(row, places.stretched));
        let head = RowHead {
            sequence,
            state: self.seen.state,
        };
        for (tap, specimen) in self.specimens.iter_mut().zip(&subject.specimens) {
            tap.row(head, row, specimen);
        }
        for (mark, kept) in subject.test.iter().zip(&mut self.test) {
            let value = at(row, mark.place);
            *kept = [value, kept[1].max(value)];
        }
        self.count_timing(row);
        self.fill(row);
        self.open.rows += 1;
        if self.open.rows >= self.rows_per_bin && self.board.subject.real_clock {
            self.close_bin();
        }
    }

    fn event(&mut self, event: &TimedEvent) {
        let board = Arc::clone(&self.board);
        let Some(trip) = Trip::of(event, &board.subject) else {
            return;
        };
        let is_of_phase = matches!(event.kind, Event::Phase { .. });
        let was_told = std::mem::replace(&mut self.is_told, !is_of_phase);
        if (is_of_phase && was_told) || self.seen.trips.len() >= MOST_TRIPS {
            return;
        }
        if let (Some(specimen), Some(axis)) = (trip.specimen, trip.axis) {
            let watched = board.subject.specimens.get(specimen);
            let watched = watched.and_then(|specimen| specimen.axes.get(axis));
            let tap = self.specimens.get_mut(specimen);
            let tap = tap.and_then(|specimen| specimen.axes.get_mut(axis));
            if let (Some(watched), Some(tap)) = (watched, tap) {
                tap.judged(watched, &trip.limit, trip.value);
            }
        }
        self.seen.trips.push(trip);
    }

    fn turn(&mut self, now_ns: u64, progress: &Progress) {
        // The rows of the warm-up are held back: that none comes is no sign of anything.
        let is_held_back = self.board.phase() == Phase::Armed;
        if std::mem::take(&mut self.is_fresh) || is_held_back {
            self.seen.row_ns = now_ns;
        }
        // Where a test runs faster than in real time, by the wall and by the rows.
        if self.open.rows >= self.rows_per_bin && now_ns.saturating_sub(self.last_bin_ns) >= BIN_NS
        {
            self.last_bin_ns = now_ns;
            self.close_bin();
        }
        if !self.waiting.is_empty() {
            self.board.try_append(&mut self.waiting);
        }
        if now_ns.saturating_sub(self.window_ns) >= WINDOW_NS {
            self.window_ns = now_ns;
            axes_mut(&mut self.specimens).for_each(AxisTap::next_window);
        }
        self.recent.note(now_ns, progress.misses.total());
        if now_ns.saturating_sub(self.last_snapshot_ns) >= SNAPSHOT_NS
            && self.board.try_show(self.snapshot(now_ns, progress))
        {
            self.last_snapshot_ns = now_ns;
        }
    }

    fn note(&mut self) -> Option<Note> {
        self.notes.try_recv().ok()
    }

    fn finish(&mut self, now_ns: u64, progress: &Progress) {
        self.close_bin();
        // Viewers hold the lock only to copy, and the loop has ended, so this may wait.
        while !self.waiting.is_empty() {
            self.board.try_append(&mut self.waiting);
            std::thread::yield_now();
        }
        while !self.board.try_show(self.snapshot(now_ns, progress)) {
            std::thread::yield_now();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::RecentMisses;

    #[test]
    fn misses_older_than_10_s_are_not_recent() {
        let mut recent = RecentMisses::default();
        let s = 1_000_000_000;
        let totals = [(0, 2), (4, 5), (9, 5), (11, 6), (15, 9)];
        let mut found = Vec::new();
        for (at, total) in totals {
            recent.note(at * s, total);
            found.push(recent.of(at * s, total));
        }
        // At 11 s the total of 0 s is subtracted, at 15 s that of 4 s.
        assert_eq!(found, [2, 5, 5, 4, 4]);
        assert!((0..100_000).all(|ms| {
            recent.note(15 * s + ms * 1_000_000, 9);
            recent.totals.len() <= 102
        }));
    }
}
