//! A test file's text through configuration, engine and memory: shared by the tests of the physics.

use std::path::Path;
use std::sync::{Arc, Mutex};

use gusset_control::engine::{Connected, Control, Experiment, Outcome, Phase};
use gusset_quantity::time::{Clock, SimClock};
use gusset_record::{Column, MemoryRecorder, Recorder, TimedEvent};
use gusset_setup::{Facts, Prepared};

/// A recorder whose content can still be read when the engine has taken it.
#[derive(Clone, Default)]
pub struct SharedRecorder(Arc<Mutex<MemoryRecorder>>);

impl SharedRecorder {
    fn with_columns(columns: usize) -> Self {
        Self(Arc::new(Mutex::new(MemoryRecorder::with_capacity(
            columns, 4096, 64,
        ))))
    }
}

impl Recorder for SharedRecorder {
    fn row(&mut self, row: &[f64]) -> bool {
        self.0.lock().unwrap().row(row)
    }
    fn event(&mut self, event: TimedEvent) -> bool {
        self.0.lock().unwrap().event(event)
    }
}

/// Outcome, columns and events of a run.
pub struct Run {
    pub columns: Vec<Column>,
    pub rows: Vec<Vec<f64>>,
    pub events: Vec<TimedEvent>,
    pub outcome: Outcome,
}

impl Run {
    fn index(&self, name: &str) -> usize {
        let found = self.columns.iter().position(|column| column.name == name);
        found.unwrap_or_else(|| panic!("no column {name}"))
    }

    /// A column over all rows, those before t = 0 included.
    pub fn all(&self, name: &str) -> Vec<f64> {
        let index = self.index(name);
        self.rows.iter().map(|row| row[index]).collect()
    }

    /// A column from t = 0 on.
    pub fn column(&self, name: &str) -> Vec<f64> {
        let state = self.all("state").into_iter();
        let column = self.all(name).into_iter().zip(state);
        column
            .filter_map(|(value, state)| (state == Phase::Running.code()).then_some(value))
            .collect()
    }
}

/// Reads and builds a test; its mistakes are the test's.
pub fn prepare(text: &str) -> Prepared {
    let read = gusset_config::parse(Path::new("test.toml"), text.to_owned(), &[]);
    let loaded = read.unwrap_or_else(|error| panic!("{error}"));
    gusset_setup::build(&loaded).unwrap_or_else(|error| panic!("{error}"))
}

/// Runs a test on the simulated clock.
pub fn run(text: &str) -> Run {
    run_with_facts(text).0
}

/// Runs a test on the simulated clock, and what was known about it before.
pub fn run_with_facts(text: &str) -> (Run, Facts) {
    let Prepared {
        experiment, facts, ..
    } = prepare(text);
    (run_on(experiment, SimClock::new()), facts)
}

/// Runs an experiment on a clock of the test's own.
pub fn run_on(experiment: Experiment, clock: impl Clock + 'static) -> Run {
    run_under(
        experiment,
        clock,
        &Control::from(crossbeam_channel::never()),
    )
}

/// Runs an experiment with an operator.
pub fn run_under(experiment: Experiment, clock: impl Clock + 'static, control: &Control) -> Run {
    let recorder = SharedRecorder::with_columns(experiment.columns().len());
    let test = Connected::new(experiment, Box::new(clock), Box::new(recorder.clone()));
    let columns = test.columns().to_vec();
    let outcome = test.run(control).into_outcome();
    let recorder = recorder.0.lock().unwrap();
    Run {
        columns,
        rows: recorder.rows().map(<[f64]>::to_vec).collect(),
        events: recorder.events().to_vec(),
        outcome,
    }
}

/// Largest |a − b| over the largest |b|; infinite if the two differ in length or a number is missing.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    let peak = b.iter().fold(0.0, |peak: f64, b| peak.max(b.abs()));
    let pairs = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    let worst = pairs.fold(0.0, |worst: f64, d| {
        if d <= worst {
            worst
        } else if d.is_nan() {
            f64::INFINITY
        } else {
            d
        }
    });
    if a.len() == b.len() && peak > 0.0 {
        worst / peak
    } else {
        f64::INFINITY
    }
}
