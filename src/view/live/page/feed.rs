//! Events for viewers: server-sent events, made once and handed to each of them.
//!
//! Every viewer has a place in the history and takes new bins from there, thirty times a second and as long as its connection
//! takes bytes. A slow viewer gets fewer and larger events, and skips bins that are no longer kept. Nothing is queued beyond
//! the bytes that its connection has taken.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::fmt::Write;
use std::pin::Pin;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::body::Bytes;
use futures_core::Stream;
use serde_json::{Value, json};
use tokio::time::{Interval, MissedTickBehavior};

use super::connections::PendingRequest;
use crate::live::board::Board;
use crate::live::history::{Bin, RECENT};
use crate::live::latency::BOUNDS;
use crate::live::metrics::FLAGS;
use gusset_control::engine::{Glimpse, Phase};
use gusset_record::rt::os::monotonic_ns;

/// Time between two events for one viewer.
const PACE: Duration = Duration::from_millis(33);
/// Least time between two reads of the board, ns; a little less than `PACE`.
const LOOK_NS: u64 = 30_000_000;
/// Time between two states, ns.
const STATE_NS: u64 = 95_000_000;
/// Bins in one event at most.
const MOST_BINS: usize = 1200;

/// Text of the events, made once for all viewers.
#[derive(Debug)]
pub(super) struct Feed {
    pub board: Arc<Board>,
    made: Mutex<Made>,
    viewers: AtomicUsize,
    /// Viewers that received the address of the report and have not fetched it yet.
    awaited: AtomicUsize,
    /// Random part of the address of the report: only viewers learn it.
    report_key: Box<str>,
}

/// Events made of the board so far.
#[derive(Debug, Default)]
struct Made {
    looked_ns: u64,
    /// Recent bins as text, and the number of the bin after the last.
    bins: VecDeque<Box<str>>,
    next: u64,
    state: Arc<str>,
    /// Counts the states.
    version: u64,
    state_ns: u64,
    seen: Option<Glimpse>,
    ended: bool,
}

impl Feed {
    pub(crate) fn new(board: Arc<Board>, report_key: &str) -> Self {
        Self {
            board,
            made: Mutex::default(),
            viewers: AtomicUsize::new(0),
            awaited: AtomicUsize::new(0),
            report_key: report_key.into(),
        }
    }

    /// The report of a test that has ended, for a viewer that knows its key.
    pub(crate) fn report(&self, key: &str) -> Option<String> {
        let path = self
            .board
            .ended()?
            .report
            .filter(|_| *key == *self.report_key)?;
        let text = std::fs::read_to_string(path).ok();
        let less = |awaited: usize| awaited.checked_sub(1);
        let _none = self
            .awaited
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, less);
        text
    }

    /// Waits until every viewer has received the end of the test and has fetched the report.
    pub(crate) async fn is_done(&self) {
        while self.viewers() > 0 || self.awaited.load(Ordering::Relaxed) > 0 {
            tokio::time::sleep(PACE).await;
        }
    }

    pub(crate) fn viewers(&self) -> usize {
        self.viewers.load(Ordering::Relaxed)
    }

    fn made(&self) -> MutexGuard<'_, Made> {
        self.made.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Updates the made events, if they are old enough.
    fn refreshed(&self) -> MutexGuard<'_, Made> {
        let mut made = self.made();
        let now = monotonic_ns();
        let ended = self.board.ended();
        let has_just_ended = ended.is_some() != made.ended;
        if !has_just_ended && now.saturating_sub(made.looked_ns) < LOOK_NS {
            return made;
        }
        made.looked_ns = now;
        let (first, bins): (u64, Vec<Arc<Bin>>) = self.board.look_back(|history| {
            let (first, bins) = history.since(made.next);
            (first, bins.cloned().collect())
        });
        if first > made.next {
            made.bins.clear();
        }
        made.next = first + bins.len() as u64;
        made.bins.extend(bins.iter().map(|bin| text_of(bin)));
        let over = made.bins.len().saturating_sub(RECENT);
        made.bins.drain(..over);
        let seen = Some(self.board.glimpse());
        if has_just_ended || seen != made.seen || now.saturating_sub(made.state_ns) >= STATE_NS {
            (made.state_ns, made.seen, made.ended) = (now, seen, ended.is_some());
            made.state = self.state(now).to_string().into();
            made.version += 1;
        }
        made
    }

    fn state(&self, now: u64) -> Value {
        let board = &self.board;
        let (latest, seen) = (board.latest(), board.glimpse());
        let age = |at: u64| now.saturating_sub(at) as f64 * 1e-9;
        let ended = board.ended();
        let report = ended.as_ref().and_then(|ended| ended.report.as_ref());
        json!({
            "phase": seen.phase.word(),
            "hold": seen.hold,
            "stands": seen.stands,
            "unconfirmed": seen.unconfirmed,
            "hold_number": seen.hold_number,
            "sent": now as f64 * 1e-9,
            "age": (latest.row_ns > 0).then(|| age(latest.row_ns)),
            "viewers": self.viewers(),
            "lambda": board.margin(now),
            "ended": ended,
            "report": report.map(|_| format!("/report/{}", self.report_key)),
            "now": &*latest,
        })
    }

    /// The first event of a viewer.
    fn hello(&self) -> (u64, String) {
        let whole: Vec<Bin> = self
            .board
            .look_back(|history| history.whole().cloned().collect());
        let made = self.refreshed();
        let phases: Vec<(f64, &str)> = Phase::ALL
            .into_iter()
            .map(|phase| (phase.code(), phase.word()))
            .collect();
        let flags: Vec<(u32, &str)> = FLAGS.iter().map(|(flag, word)| (flag.0, *word)).collect();
        let mut text = String::with_capacity(64 << 10);
        let head = json!({
            "subject": &self.board.subject,
            "buckets": BOUNDS,
            "phases": phases,
            "flags": flags,
            "version": env!("CARGO_PKG_VERSION"),
        });
        let _ = write!(text, "data: {{\"hello\":{head},\"whole\":[");
        push_all(&mut text, whole.iter().map(text_of));
        text.push_str("],\"bins\":[");
        push_all(&mut text, made.bins.iter());
        let _ = write!(text, "],\"state\":{}}}\n\n", made.state);
        (made.next, text)
    }
}

fn push_all(text: &mut String, parts: impl Iterator<Item = impl AsRef<str>>) {
    for (place, part) in parts.enumerate() {
        if place > 0 {
            text.push(',');
        }
        text.push_str(part.as_ref());
    }
}

/// One bin: when, test time, state, then two numbers of each channel, then a list of displacements and forces of each loop.
fn text_of(bin: &Bin) -> Box<str> {
    let mut text = String::with_capacity(16 * bin.values.len() + 64);
    text.push('[');
    for value in [bin.until, bin.time, bin.state] {
        let _ = if value.is_finite() {
            write!(text, "{value},")
        } else {
            write!(text, "null,")
        };
    }
    for value in bin.values.iter().flatten() {
        // Four digits more than a screen shows; shortest form.
        let _ = if value.is_finite() {
            write!(text, "{value:e},")
        } else {
            write!(text, "null,")
        };
    }
    for points in &bin.loops {
        let points = points.iter().flatten();
        let points: Vec<_> = points.map(|value| format!("{value:e}")).collect();
        let _ = write!(text, "[{}],", points.join(","));
    }
    text.pop();
    text.push(']');
    text.into()
}

/// One viewer: a stream of events that ends with the test.
#[derive(Debug)]
pub(super) struct Viewer {
    feed: Arc<Feed>,
    /// Its connection is not idle.
    _asking: PendingRequest,
    pace: Interval,
    /// Number of the next bin to send; none before the greeting.
    next: Option<u64>,
    version: u64,
    done: bool,
}

impl Viewer {
    pub(crate) fn new(feed: Arc<Feed>, asking: PendingRequest) -> Self {
        feed.viewers.fetch_add(1, Ordering::Relaxed);
        let mut pace = tokio::time::interval(PACE);
        pace.set_missed_tick_behavior(MissedTickBehavior::Delay);
        Self {
            feed,
            _asking: asking,
            pace,
            next: None,
            version: 0,
            done: false,
        }
    }

    /// The bins since the last event; `None` if there are no new ones.
    fn event(&mut self) -> Option<String> {
        let Some(next) = self.next else {
            let (next, text) = self.feed.hello();
            self.next = Some(next);
            return Some(text);
        };
        let made = self.feed.refreshed();
        let fresh_state = made.version != self.version;
        if next == made.next && !fresh_state {
            return None;
        }
        let kept = made.bins.len() as u64;
        let wanted = made.next.saturating_sub(next).min(kept);
        let behind = usize::try_from(wanted).unwrap_or(usize::MAX);
        let count = behind.min(MOST_BINS);
        let skipped = made.next.saturating_sub(next) - count as u64;
        let from = made.bins.len() - count;
        let mut text = String::with_capacity(8 << 10);
        text.push_str("data: {\"bins\":[");
        push_all(&mut text, made.bins.iter().skip(from));
        let _ = write!(text, "],\"skipped\":{skipped}");
        if fresh_state {
            let _ = write!(text, ",\"state\":{}", made.state);
            self.version = made.version;
            self.done = made.ended;
            let has_report = self
                .feed
                .board
                .ended()
                .is_some_and(|end| end.report.is_some());
            if self.done && has_report {
                self.feed.awaited.fetch_add(1, Ordering::Relaxed);
            }
        }
        text.push_str("}\n\n");
        self.next = Some(made.next);
        Some(text)
    }
}

impl Stream for Viewer {
    type Item = Result<Bytes, Infallible>;

    fn poll_next(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        loop {
            if self.done {
                return Poll::Ready(None);
            }
            ready!(self.pace.poll_tick(cx));
            if let Some(text) = self.event() {
                return Poll::Ready(Some(Ok(text.into())));
            }
        }
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        self.feed.viewers.fetch_sub(1, Ordering::Relaxed);
    }
}
