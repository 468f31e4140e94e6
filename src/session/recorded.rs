//! The recording in place of specimens: each answers as it did in the row that comes.

use std::sync::Arc;

use super::playback::{Shared, at, with};
use gusset_control::engine::Experiment;
use gusset_control::port::PortError;
use gusset_quantity::catalog::column::{RAW_DISP, RAW_FORCE, SEQUENCE, STATUS};
use gusset_quantity::substructure::{
    Command, Freshness, LinkFault, Measurement, Retirement, Status, Substructure,
};
use gusset_quantity::time::Nanos;
use gusset_record::Layout;

/// Answers as the recorded specimen did.
struct Recorded {
    playback: Shared,
    /// Places of raw displacement and raw force of each axis, of the sequence number and of the status.
    axes: Vec<[usize; 2]>,
    sequence: usize,
    status: usize,
    issued: u64,
    /// Rows that there were before its last answer.
    answered: Option<u64>,
}

impl Recorded {
    /// Fails if the next row marks the specimen as lost.
    fn is_lost(&self, mark: Status) -> Result<(), LinkFault> {
        with(&self.playback, |playback| {
            let status = Status(at(playback.next(), self.status) as u32);
            if playback.is_over_next() && status.has(mark) {
                return Err(playback.fault_next());
            }
            Ok(())
        })
    }
}

impl Substructure for Recorded {
    fn axes(&self) -> usize {
        self.axes.len()
    }

    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.issued = command.sequence;
        self.is_lost(Status::UNSENT)
    }

    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        let issued = self.issued;
        let told = with(&self.playback, |playback| {
            at(playback.next(), self.sequence) as u64
        });
        // One that was lost after it had answered has answered.
        if told < issued || told <= into.sequence {
            self.is_lost(Status::LOST)?;
        }
        let answered = &mut self.answered;
        with(&self.playback, |playback| {
            // The end of the recording ends the replay.
            playback.ran_out |= playback.next().is_none();
            let row = playback.next().ok_or(LinkFault::Closed)?;
            let at = |index: usize| at(Some(row), index);
            let recorded = at(self.sequence) as u64;
            let axes = into.disp.iter_mut().zip(&mut into.force);
            for ((disp, force), [disp_at, force_at]) in axes.zip(&self.axes) {
                (*disp, *force) = (at(*disp_at), at(*force_at));
            }
            into.status = Status(at(self.status) as u32);
            into.sequence = recorded;
            *answered = Some(playback.row);
            // Ticks in which nothing moves share a number: there the row shows the age of its measurement.
            let stale = issued == recorded && into.status.has(Status::STALE);
            Ok(if issued > recorded || stale {
                Freshness::Stale
            } else {
                Freshness::Fresh
            })
        })
    }

    /// A partner that takes several ticks answers in the row of its recorded answer. A partner that the loop waits for
    /// answers, unless the operator ended the wait in this row.
    fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        let is_here = with(&self.playback, |playback| {
            playback.ran_out |= playback.next().is_none();
            let row = playback.next().ok_or(LinkFault::Closed)?;
            if Status(at(Some(row), self.status) as u32).has(Status::OWED) {
                // If the wait ended in this row, a partner that was checked was also waited for.
                return Ok(wait_ns == 0 && playback.waits_in_vain_next());
            }
            Ok(wait_ns > 0 || at(Some(row), self.sequence) as u64 >= self.issued)
        })?;
        // Whether it was lost then shows when it is taken.
        if !is_here {
            self.is_lost(Status::LOST)?;
        }
        Ok(is_here)
    }

    /// Lost at the commit: the row of this very tick was never made.
    fn accepted(&mut self, _: u64) -> Result<(), LinkFault> {
        let rows = with(&self.playback, |playback| playback.row);
        if self.answered == Some(rows) {
            self.is_lost(Status::LOST)?;
        }
        Ok(())
    }

    /// Lost between its answer and the next command.
    fn attend(&mut self) -> Result<(), LinkFault> {
        self.is_lost(Status::LOST)
    }

    /// Lost as the hold began: the position was not sent again.
    fn pause(&mut self) -> Result<(), LinkFault> {
        if with(&self.playback, |playback| playback.has_an_answer_next()) {
            return Ok(());
        }
        self.is_lost(Status::LOST)
    }

    fn retire(&mut self, _: Retirement) {}
}

/// Whose place the recording takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Replaced {
    /// That of every specimen.
    All,
    /// That of specimens behind links: formulas continue by themselves, and remember it.
    Remote,
}

/// Puts the recording in place of the specimens.
pub(super) fn put_recorded(
    experiment: &mut Experiment,
    playback: &Shared,
    layout: &Layout,
    replaced: Replaced,
) -> Result<(), PortError> {
    let place = |name: &str| layout.index_of(name).unwrap_or(usize::MAX);
    for (index, port) in experiment.ports.iter_mut().enumerate() {
        if replaced == Replaced::Remote && !port.exchange().is_remote() {
            continue;
        }
        let s = index + 1;
        let axis = |j: usize| {
            [
                place(&RAW_DISP.of_axis(s, j)),
                place(&RAW_FORCE.of_axis(s, j)),
            ]
        };
        port.put_recording(Box::new(Recorded {
            playback: Arc::clone(playback),
            axes: (1..=port.axes()).map(axis).collect(),
            sequence: place(&SEQUENCE.of_specimen(s)),
            status: place(&STATUS.of_specimen(s)),
            issued: 0,
            answered: None,
        }))?;
    }
    Ok(())
}
