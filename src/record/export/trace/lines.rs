//! The events of a trace, in order of time, as JSON.

use std::io::{self, BufWriter, Write};

use serde_json::{Value, json};

use super::{EVENTS, GRID, LOOP};
use crate::atomic::AtomicFile;
use crate::run::Run;

/// The events of the file, put into order.
pub(super) struct Lines<W> {
    out: W,
    held: Vec<(f64, Value)>,
    begun: bool,
}

impl Lines<BufWriter<AtomicFile>> {
    pub(crate) fn end(mut self) -> io::Result<AtomicFile> {
        self.pass(f64::INFINITY)?;
        self.out.write_all(b"\n]}\n")?;
        self.out
            .into_inner()
            .map_err(io::IntoInnerError::into_error)
    }
}

impl<W: Write> Lines<W> {
    pub(crate) const fn new(out: W) -> Self {
        Self {
            out,
            held: Vec::new(),
            begun: false,
        }
    }

    /// The head: what this is of, and the names of its lines. `origin_us`: zero on the loop's clock.
    pub(crate) fn begin(&mut self, run: &Run, origin_us: Option<f64>) -> io::Result<()> {
        let name = run.path().file_name().map(|name| name.to_string_lossy());
        let about = json!({
            "run": name,
            "clock": run.summary().map(|summary| summary.clock),
            "rate_hz": run.summary().map(|summary| summary.rate_hz),
            "status": run.summary().map(|summary| summary.status),
            "clock_ns_at_zero": origin_us.map(|us| (us * 1e3).round()),
        });
        write!(
            self.out,
            "{{\"displayTimeUnit\":\"ns\",\"otherData\":{about},\"traceEvents\":["
        )?;
        let process = format!("gusset {}", name.unwrap_or_default());
        self.line(&named("process_name", 0, &process))?;
        for (line, name) in [(GRID, "grid"), (LOOP, "loop"), (EVENTS, "events")] {
            self.line(&named("thread_name", line, name))?;
            let order = json!({
                "name": "thread_sort_index", "ph": "M", "pid": 1, "tid": line, "ts": 0, "args": {"sort_index": line},
            });
            self.line(&order)?;
        }
        Ok(())
    }

    fn line(&mut self, event: &Value) -> io::Result<()> {
        let comma: &[u8] = if self.begun { b",\n" } else { b"\n" };
        self.begun = true;
        self.out.write_all(comma)?;
        serde_json::to_writer(&mut self.out, event).map_err(io::Error::from)
    }

    pub(crate) fn hold(&mut self, at: f64, event: Value) {
        self.held.push((at, event));
    }

    /// Writes what is held from before `now`: nothing that is held later begins there.
    pub(crate) fn pass(&mut self, now: f64) -> io::Result<()> {
        // Stable: what begins together stays in the order in which it came, the outer slice first.
        self.held.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let passed = self.held.partition_point(|(at, _)| *at < now);
        let ready: Vec<(f64, Value)> = self.held.drain(..passed).collect();
        ready.iter().try_for_each(|(_, event)| self.line(event))
    }
}

fn named(what: &str, line: u16, name: &str) -> Value {
    json!({"name": what, "ph": "M", "pid": 1, "tid": line, "ts": 0, "args": {"name": name}})
}
