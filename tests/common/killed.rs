//! A run folder as a kill leaves it.

use std::path::Path;

use gusset_record::Run;

use super::copy;

/// Copies a run as a kill leaves it: no summary, the rows up to `row`, a torn row, and the events until then.
pub fn killed(run: &Path, to: &Path, row: usize) {
    copy(run, to);
    for name in ["summary.json", "report.html", "timing.json"] {
        let _ = std::fs::remove_file(to.join(name));
    }
    let stride = Run::open(run).unwrap().layout().stride();
    let bytes = std::fs::read(run.join("samples.bin")).unwrap();
    std::fs::write(to.join("samples.bin"), &bytes[..row * stride + 17]).unwrap();
    let mut events = Run::open(run).unwrap().events().unwrap().to_json();
    // During the startup of a resumed test rows have no time yet, but events have.
    let begins = events.iter().find(|event| event["event"] == "phase");
    let begins = begins.and_then(|event| event["time"].as_f64());
    let ends = column(run, "time")[row - 1].max(begins.unwrap_or(0.0));
    events.retain_mut(|event| {
        let is_later = event["time"].as_f64().is_some_and(|time| time > ends);
        // Notes from before the loop have the time at which the writer came to them: here it may have been busy.
        let is_note = ["sha256", "standing"]
            .iter()
            .any(|key| event.get(key).is_some());
        if is_later && is_note {
            event["time"] = serde_json::Value::Null;
        }
        is_note || !is_later
    });
    let lines: String = events.iter().map(|event| format!("{event}\n")).collect();
    std::fs::write(to.join("events.jsonl"), lines).unwrap();
}

pub fn column(run: &Path, name: &str) -> Vec<f64> {
    Run::open(run).unwrap().columns(&[name]).unwrap().remove(0)
}
