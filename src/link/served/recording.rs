//! Notes and rows of a served specimen: into the record of its test, or into the program's log where nothing is recorded.

use super::identity::Identity;
use super::session_record::{RecordSettings, RowSink, SessionRecord};
use super::{Controller, GuardStore, Trip};
use crate::quota::Allowance;
use gusset_control::engine::ReceivedTest;
use gusset_control::port::ReceivedPort;
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::catalog::event::{Remark, Severity};
use gusset_quantity::substructure::LinkStats;
use gusset_record::rt::os;
use gusset_record::{Event, Recorder, TimedEvent};

/// The record of a served specimen, and its settings.
#[derive(Default)]
pub(super) struct Recording {
    /// Each test gets a run folder.
    pub settings: Option<RecordSettings>,
    /// Faults of every test, in words.
    pub played: Option<String>,
    pub away_from: Option<usize>,
    /// Counts of the controller's link for a specimen in this process, else counts of the specimen's own link at its goodbye.
    pub link: LinkStats,
    /// The controller's number of the target whose path is commanded.
    pub target_number: u64,
    /// Commands of this test that left late.
    missed_edges: u64,
    /// Where the rows of a replay go, whose warnings were given when it was recorded.
    pub replay: Option<Box<dyn Recorder>>,
    is_a_replay: bool,
    open: Option<SessionRecord>,
}

impl Recording {
    /// Opens the record of a controller's test, if there is to be one: the number of its columns, and where its rows go. A server that
    /// paces it makes `pace_hz` commands per second.
    ///
    /// # Errors
    /// It cannot be kept.
    pub(crate) fn open(
        &mut self,
        specimen: (&Identity, &ReceivedPort),
        controller: &Controller,
        pace_hz: Option<f64>,
    ) -> Result<Option<RowSink>, String> {
        self.link = LinkStats::default();
        self.missed_edges = 0;
        if let Some(recorder) = self.replay.take() {
            let (identity, port) = specimen;
            self.is_a_replay = true;
            return Ok(Some((identity.columns(port).len(), recorder)));
        }
        let Some(settings) = &self.settings else {
            return Ok(None);
        };
        let record = SessionRecord::open(settings, specimen, controller, (pace_hz, self.away_from));
        let (mut record, recorder) =
            record.map_err(|text| format!("the log cannot be kept: {text}"))?;
        if let Some(words) = &self.played {
            record.warn(Remark::Faults, words);
        }
        self.open = Some(record);
        Ok(Some(recorder))
    }

    /// The user's reason to accept a wiring fault.
    pub(crate) fn accept_wiring(&mut self, reason: &str) {
        if let Some(record) = &mut self.open {
            record.accept_wiring(reason);
        }
    }

    /// Folder of the record, as a message for the operator of the server.
    pub(crate) fn place(&self) -> Option<String> {
        let record = self.open.as_ref()?;
        Some(format!("recording into {}", record.path().display()))
    }

    /// This exchange begins, whose command is of this test time. Real-time: yes.
    pub(crate) const fn begins(&mut self, exchange: u64, time: f64) {
        if let Some(record) = &mut self.open {
            record.begins(exchange, time);
        }
    }

    /// A command left late. True of the first one. Real-time: yes.
    pub(crate) const fn misses_edge(&mut self) -> bool {
        self.missed_edges += 1;
        self.missed_edges == 1
    }

    /// The specimen holds from here on.
    pub(crate) fn tripped(&self, trip: Trip, text: &str) {
        if let Some(record) = &self.open {
            record.tripped(trip, text);
        }
    }

    /// An event for the record, if there is one.
    pub(crate) fn event(&self, event: Event) {
        if let Some(record) = &self.open {
            record.note(event.into());
        }
    }

    /// Something for the record. Without one the program's log has the warnings, as many as the `store` lets through.
    pub(crate) fn note(&self, store: &GuardStore, event: Remark, text: &str) {
        let event = Event::said(event, text);
        if let Some(record) = &self.open {
            return record.note(event.into());
        }
        if !self.is_a_replay {
            log_warning(store, &event);
        }
    }

    /// A warning for record and summary, which the summary lists once.
    pub(crate) fn warn_once(&mut self, store: &GuardStore, event: Remark, text: &str) {
        match &mut self.open {
            Some(record) if !record.has_warned(text) => record.warn(event, text),
            _ => self.note(store, event, text),
        }
    }

    /// A warning for the summary, whose event the loop records.
    pub(crate) fn warn_beside_an_event(&mut self, store: &GuardStore, text: &str) {
        if let Some(record) = &mut self.open {
            record.list_warning(text);
        }
        self.log_beside_an_event(store, text);
    }

    /// A warning whose event the loop records: the program's log contains it where nothing is recorded.
    pub(crate) fn log_beside_an_event(&self, store: &GuardStore, text: &str) {
        if self.open.is_none() && !self.is_a_replay {
            log(store, text);
        }
    }

    /// The test is over.
    pub(crate) fn close(
        &mut self,
        cause: Cause,
        text: &str,
        commits: u64,
        test: &mut ReceivedTest,
    ) {
        if let Some(record) = self.open.take() {
            let counts = (commits, self.missed_edges);
            record.close(cause, text, &self.link, counts, test);
        }
    }
}

/// Events of a test without a record: the program's log has the warnings, as many as the store lets through.
pub(super) struct Unrecorded(GuardStore);

impl Unrecorded {
    /// No column of rows, and where the events go.
    pub(super) fn sink(store: &GuardStore) -> RowSink {
        (0, Box::new(Self(store.clone())))
    }
}

impl Recorder for Unrecorded {
    fn row(&mut self, _: &[f64]) -> bool {
        true
    }

    fn event(&mut self, event: TimedEvent) -> bool {
        log_warning(&self.0, &event.kind);
        true
    }
}

/// Shows a warning in the program's log. The operator of the server receives everything else.
fn log_warning(store: &GuardStore, event: &Event) {
    let row = event.row();
    let is_warning = row.is_some_and(|row| row.severity == Severity::Warning);
    if let (Event::Said { text, .. }, true) = (event, is_warning) {
        log(store, text);
    }
}

fn log(store: &GuardStore, text: &str) {
    let Allowance { is_told, notice } = store.warning(os::monotonic_ns());
    let text = is_told.then_some(text);
    for text in text.into_iter().chain(notice.as_deref()) {
        tracing::warn!("{text}");
    }
}
