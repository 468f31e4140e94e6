//! Notes and rows of a served specimen: into the record of its test, or into the program's log where nothing is recorded.

use super::exchange_columns::Exchange;
use super::identity::Identity;
use super::session_record::{RecordSettings, SessionRecord};
use super::{Controller, GuardStore, Trip};
use crate::quota::Allowance;
use gusset_control::port::ReceivedPort;
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::catalog::event::{Remark, Severity};
use gusset_quantity::substructure::LinkStats;
use gusset_record::Event;
use gusset_record::rt::os;

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
    open: Option<SessionRecord>,
}

impl Recording {
    /// Opens the record of a controller's test, if there is to be one. A server that paces it makes `pace_hz` commands per second.
    ///
    /// # Errors
    /// It cannot be kept.
    pub(crate) fn open(
        &mut self,
        specimen: (&Identity, &ReceivedPort),
        controller: &Controller,
        pace_hz: Option<f64>,
    ) -> Result<(), String> {
        self.link = LinkStats::default();
        self.missed_edges = 0;
        let Some(settings) = &self.settings else {
            return Ok(());
        };
        let record = SessionRecord::open(settings, specimen, controller, (pace_hz, self.away_from));
        let mut record = record.map_err(|text| format!("the log cannot be kept: {text}"))?;
        if let Some(words) = &self.played {
            record.warn(Remark::Faults, words);
        }
        self.open = Some(record);
        Ok(())
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

    /// The present time, if something is recorded: only the record needs it. Real-time: yes.
    pub(crate) fn now_ns(&self) -> u64 {
        self.open.as_ref().map_or(0, |_| os::monotonic_ns())
    }

    /// An exchange begins, whose command is of this test time. When it began. Real-time: yes.
    pub(crate) fn begins(&mut self, time: f64) -> u64 {
        let now_ns = self.now_ns();
        if let Some(record) = &mut self.open {
            record.begins(time);
        }
        now_ns
    }

    /// One row. Real-time: yes.
    pub(crate) fn exchange(&mut self, exchange: &Exchange<'_>) {
        if let Some(record) = &mut self.open {
            record.exchange(exchange);
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
        let row = event.row();
        // The operator of the server receives everything else.
        if row.is_some_and(|row| row.severity == Severity::Warning) {
            let Allowance { is_told, notice } = store.warning(os::monotonic_ns());
            let text = is_told.then_some(text);
            for text in text.into_iter().chain(notice.as_deref()) {
                tracing::warn!("{text}");
            }
        }
    }

    /// A warning for record and summary, which the summary lists once.
    pub(crate) fn warn_once(&mut self, store: &GuardStore, event: Remark, text: &str) {
        match &mut self.open {
            Some(record) if !record.has_warned(text) => record.warn(event, text),
            _ => self.note(store, event, text),
        }
    }

    /// The test is over.
    pub(crate) fn close(&mut self, cause: Cause, text: &str, commits: u64) {
        if let Some(record) = self.open.take() {
            record.close(cause, text, &self.link, (commits, self.missed_edges));
        }
    }
}
