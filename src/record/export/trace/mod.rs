//! Timeline of a run in the trace-event format of Chrome: opens in ui.perfetto.dev and chrome://tracing.
//!
//! Lines of the picture, in µs of wall time from the first edge. *Grid*: the edges, one slice per tick as long as a period.
//! *Loop*: the phases of each tick: wake up, send, wait for the replies, compute, record, wait for the edge; what is behind a
//! deadline lies under a slice that names the miss and its cause. *Events*: the lines of `events.jsonl`.
//!
//! Rows and events meet by the edge that the `grid` events name, to the nanosecond. Folders of earlier versions have neither
//! that nor `record_before_s`: events are tied to rows by the misses, and recording and waiting are one slice.
//!
//! Events are in order of time. Only what overlaps is held: a tick's slices wait until an edge has passed them.

pub(super) mod grid;
mod lines;
mod misses;
mod places;
mod slices;
pub(super) mod stamps;

use std::io::BufWriter;
use std::path::Path;

use serde_json::Value;

use grid::Grid;
use lines::Lines;
use misses::Misses;
use places::Places;
use slices::{Loop, Tick};
use stamps::{Stamped, Stamps};

use super::plan::{Choice, Plan, Rows, WARMING_UP};
use super::{ExportError, Exported, Notice};
use crate::atomic::AtomicFile;
use crate::run::Run;

/// Ticks of a trace without a window: about 160 MB of text, which a browser still opens.
const MOST: u64 = 200_000;

/// Lines of the picture. One would be taken for the process itself.
const GRID: u16 = 2;
const LOOP: u16 = 3;
const EVENTS: u16 = 4;

/// Writes the ticks of the window.
pub(super) fn export(run: &Run, choice: &Choice, out: &Path) -> Result<Exported, ExportError> {
    let failed = ExportError::write(out);
    let plan = Plan::new(run.layout(), &[])?;
    let stamps = Stamps::find(run.layout(), plan.time)?;
    let choice = Choice {
        rows: Rows::Tick,
        ..*choice
    };
    let told = run.events()?;
    let left_out = told.left_out.values().sum();
    let told = told.events;
    let mut places = Places::wanted(&told, &choice);
    let (mut first, mut last) = (f64::NAN, f64::NAN);
    let mut ticks = 0;
    let mut grid = Grid::of(&told);
    let mut counting = run.journal()?;
    while let Some(row) = counting.next_row().map_err(ExportError::Read)? {
        let tick = grid.place(&stamps.read(row.values));
        if tick.state == WARMING_UP || !choice.holds(tick.time) {
            continue;
        }
        ticks += 1;
        if first.is_nan() {
            first = tick.time;
        }
        last = tick.time;
        places.note(&tick);
    }
    if ticks > MOST && !choice.is_part() {
        return Err(ExportError::LongTrace {
            ticks,
            limit: MOST,
            first,
            last,
        });
    }
    let mut exported = Exported::new(run, ticks, &counting);
    if left_out > 0 {
        exported.notices.push(Notice::EventsLeftOut(left_out));
    }
    let period_us = places.period_us(run);
    let origin_us = grid
        .zero_us()
        .or_else(|| places.origin_us(&told, period_us));
    let mut others: Vec<(f64, Value)> = places.placed(&told, origin_us);
    // Stable: what begins together stays in the order in which it came.
    others.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let mut others = others.into_iter().peekable();

    let file = AtomicFile::create(out).map_err(failed)?;
    let mut lines = Lines::new(BufWriter::with_capacity(1 << 17, file));
    lines.begin(run, origin_us).map_err(failed)?;
    let mut shown = Loop::new(period_us, Misses::of(&told, origin_us));
    let mut grid = Grid::of(&told);
    let mut left = ticks;
    let mut journal = run.journal()?;
    while let Some(row) = journal.next_row().map_err(ExportError::Read)? {
        let tick = grid.place(&stamps.read(row.values));
        if tick.state == WARMING_UP {
            continue;
        }
        // Also behind the window: the row holds the recording time of the one before.
        shown.told(row.sequence, tick.record_before);
        if left == 0 {
            break;
        }
        if !choice.holds(tick.time) {
            continue;
        }
        left -= 1;
        // The row that ends a test may belong to no tick.
        if !tick.is_stamped() || shown.is_behind(&tick) {
            continue;
        }
        let release = tick.release;
        shown.take(
            Tick {
                sequence: row.sequence,
                stamped: tick,
            },
            &mut lines,
        );
        while let Some((at, event)) = others.next_if(|(at, _)| *at <= release) {
            lines.hold(at, event);
        }
        // Nothing that follows begins before this edge.
        lines.pass(release).map_err(failed)?;
    }
    shown.finish(&mut lines);
    for (at, event) in others {
        lines.hold(at, event);
    }
    let file = lines.end().map_err(failed)?;
    file.commit().map_err(failed)?;
    Ok(exported)
}

/// To the nanosecond.
fn rounded(us: f64) -> f64 {
    (us * 1e3).round() / 1e3
}

/// A slice of a line.
fn slice(line: u16, category: &str, name: &str, from: f64, to: f64, args: Value) -> Value {
    let (from, to) = (rounded(from), rounded(to));
    let mut event = serde_json::json!({
        "name": name, "cat": category, "ph": "X", "pid": 1, "tid": line, "ts": from, "dur": rounded(to - from),
    });
    if let (Some(object), false) = (event.as_object_mut(), args.is_null()) {
        object.insert("args".to_owned(), args);
    }
    event
}

/// A moment on a line.
fn instant(line: u16, category: &str, name: &str, at: f64, args: &Value) -> Value {
    serde_json::json!({
        "name": name, "cat": category, "ph": "i", "s": "t", "pid": 1, "tid": line, "ts": rounded(at), "args": args,
    })
}

#[cfg(test)]
mod tests;
