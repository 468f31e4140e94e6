//! What the loop did when, in the trace-event format of Chrome: opens in ui.perfetto.dev and chrome://tracing.
//!
//! Three lines, in µs of wall time from the first edge. *Grid*: the edges, one slice per tick as long as a period. *Loop*:
//! the phases of each tick that the log has: late wake-up, send, wait for the replies, compute, then what is left (row,
//! histograms, sleep) until it begins with the next. *Events*: the lines of `events.jsonl`, misses among them. The log
//! has the stamps of the loop's thread only; what others did shows in the evidence that a miss carries.
//!
//! Events are in order of time. Only what overlaps is held: a tick's slices wait until an edge has passed them.

mod lines;
mod places;

use std::io::BufWriter;
use std::path::Path;

use serde_json::{Value, json};

use lines::Lines;
use places::Places;

use super::plan::{Choice, Plan, Rows};
use super::{ExportError, Exported, Notice};
use crate::record::atomic::AtomicFile;
use crate::record::layout::Layout;
use crate::record::run::Run;

/// Ticks that are taken without being asked for: about 150 MB of text, which a browser still opens.
const MOST: u64 = 200_000;

/// Lines of the picture. One would be taken for the process itself.
const GRID: u8 = 2;
const LOOP: u8 = 3;
const EVENTS: u8 = 4;

/// Writes the ticks of the window.
pub(super) fn export(run: &Run, choice: &Choice, out: &Path) -> Result<Exported, ExportError> {
    let failed = ExportError::write(out);
    let plan = Plan::new(run.layout())?;
    let stamps = Stamps::find(run.layout(), plan.time)?;
    let choice = Choice {
        rows: Rows::Tick,
        ..*choice
    };
    let told = run.events()?.events;
    let mut places = Places::wanted(&told, &choice);
    let (mut first, mut last) = (f64::NAN, f64::NAN);
    let mut counting = run.journal()?;
    let ticks = plan
        .walk(&mut counting, &choice, u64::MAX, |_, row| {
            if first.is_nan() {
                first = stamps.read(row).time;
            }
            last = stamps.read(row).time;
            places.note(&stamps.read(row));
            Ok(())
        })
        .map_err(|trouble| trouble.told(failed))?;
    if ticks > MOST && !choice.is_part() {
        return Err(ExportError::LongTrace {
            ticks,
            limit: MOST,
            first,
            last,
        });
    }
    let mut exported = Exported::new(run, ticks, &counting);
    exported.notices.retain(|notice| *notice != Notice::Empty);
    let period_us = places.period_us(run);
    let mut events = places.placed(&told, period_us);

    let file = AtomicFile::create(out).map_err(failed)?;
    let mut lines = Lines::new(BufWriter::with_capacity(1 << 17, file));
    lines.begin(run).map_err(failed)?;
    let mut before = Before::default();
    plan.walk(&mut run.journal()?, &choice, ticks, |sequence, row| {
        let tick = stamps.read(row);
        // The row that ends a test may stand in for a tick that was not made.
        if !tick.is_stamped() || tick.release < before.release {
            return Ok(());
        }
        while events.front().is_some_and(|(at, _)| *at <= tick.release)
            && let Some((at, event)) = events.pop_front()
        {
            lines.hold(at, event);
        }
        // The next slice is what is left of the tick before, or begins at this edge.
        lines.pass(tick.release.min(before.ready))?;
        for (at, slice) in slices(sequence, &tick, &mut before, period_us) {
            lines.hold(at, slice);
        }
        Ok(())
    })
    .map_err(|trouble| trouble.told(failed))?;
    for (at, event) in events {
        lines.hold(at, event);
    }
    let file = lines.end().map_err(failed)?;
    file.commit().map_err(failed)?;
    Ok(exported)
}

/// Where the stamps of a tick stand in its row.
struct Stamps {
    step: usize,
    time: usize,
    sub_tick: Option<usize>,
    state: Option<usize>,
    stretched: Option<usize>,
    durations: [usize; 5],
}

/// A tick as its row tells it; µs from the first edge.
struct Stamped {
    step: f64,
    time: f64,
    sub_tick: f64,
    state: f64,
    stretched: f64,
    release: f64,
    woke: f64,
    sent: f64,
    decoded: f64,
    ready: f64,
}

impl Stamps {
    fn find(layout: &Layout, time: usize) -> Result<Self, ExportError> {
        let need = |name| layout.index_of(name).ok_or(ExportError::NoColumn(name));
        Ok(Self {
            step: need("step")?,
            time,
            sub_tick: layout.index_of("sub_tick"),
            state: layout.index_of("state"),
            stretched: layout.index_of("stretched"),
            durations: [
                need("release_s")?,
                need("wakeup_lateness_s")?,
                need("command_lateness_s")?,
                need("round_trip_s")?,
                need("compute_s")?,
            ],
        })
    }

    fn read(&self, row: &[f64]) -> Stamped {
        let at = |place: usize| row.get(place).copied().unwrap_or(f64::NAN);
        let maybe = |place: Option<usize>| place.map_or(f64::NAN, at);
        let [release, woke, sent, answered, computed] = self.durations.map(|place| at(place) * 1e6);
        // A phase ends no earlier than it begins.
        let woke = release + woke;
        let sent = (release + sent).max(woke);
        let decoded = (sent + answered).max(sent);
        Stamped {
            step: at(self.step),
            time: at(self.time),
            sub_tick: maybe(self.sub_tick),
            state: maybe(self.state),
            stretched: maybe(self.stretched),
            release,
            woke,
            sent,
            decoded,
            ready: (decoded + computed).max(decoded),
        }
    }
}

impl Stamped {
    fn is_stamped(&self) -> bool {
        self.release.is_finite() && self.ready.is_finite() && self.woke >= self.release
    }
}

/// What the next tick must know of the one before.
struct Before {
    release: f64,
    ready: f64,
    stretched: f64,
}

impl Default for Before {
    fn default() -> Self {
        Self {
            release: f64::NEG_INFINITY,
            ready: f64::NEG_INFINITY,
            stretched: f64::NAN,
        }
    }
}

/// The slices of a tick, and what is left of the one before.
fn slices(sequence: u64, tick: &Stamped, before: &mut Before, period_us: f64) -> Vec<(f64, Value)> {
    let mut out = Vec::with_capacity(8);
    let mut slice = |line: u8, name: &str, from: f64, to: f64, args: Value| {
        let mut event = json!({
            "name": name, "cat": "tick", "ph": "X", "pid": 1, "tid": line,
            "ts": rounded(from), "dur": rounded(to - from),
        });
        if let (Some(object), false) = (event.as_object_mut(), args.is_null()) {
            object.insert("args".to_owned(), args);
        }
        out.push((from, event));
    };
    let began = tick.release.max(before.ready);
    if before.ready < began && before.ready.is_finite() {
        let name = "record, then wait for the edge";
        slice(LOOP, name, before.ready, began, Value::Null);
    }
    let about = json!({
        "row": sequence, "step": tick.step, "sub_tick": tick.sub_tick, "state": tick.state, "test_time_s": tick.time,
        "wakeup_lateness_us": rounded(tick.woke - tick.release),
        "command_lateness_us": rounded(tick.sent - tick.release),
        "stretched_ticks": tick.stretched,
    });
    let length = if period_us.is_finite() {
        period_us
    } else {
        tick.ready - tick.release
    };
    let name = format!("step {}", tick.step);
    slice(GRID, &name, tick.release, tick.release + length, about);
    let mut from = began;
    for (name, to) in [
        ("wake up", tick.woke),
        ("send", tick.sent),
        ("wait for replies", tick.decoded),
        ("compute", tick.ready),
    ] {
        let to = to.max(from);
        slice(LOOP, name, from, to, Value::Null);
        from = to;
    }
    let moved = tick.stretched - before.stretched;
    if moved > 0.0 {
        let ts = rounded(tick.release);
        out.push((
            tick.release,
            json!({
                "name": "grid moved", "cat": "tick", "ph": "i", "s": "t", "pid": 1, "tid": GRID, "ts": ts,
                "args": {"by_ticks": moved},
            }),
        ));
    }
    *before = Before {
        release: tick.release,
        ready: from,
        stretched: tick.stretched,
    };
    out
}

/// To the nanosecond.
fn rounded(us: f64) -> f64 {
    (us * 1e3).round() / 1e3
}
