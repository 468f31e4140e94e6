//! Which answer belongs to which command: pure bookkeeping, no bytes, no clock.
//!
//! Invariant: the newest measurement is never replaced by an older one, and every answer is counted once, as fresh, late
//! or duplicate.

use gusset_quantity::substructure::{LinkStats, Measurement, Status};
use gusset_wire::WireError;
use gusset_wire::native::{Earlier, MeasurementFrame};
use gusset_wire::window::{Arrival, SequenceWindow};

/// Recovered answers that are kept until they are taken, which is once a tick.
const KEPT: usize = 64;

/// The measurements of one session.
#[derive(Debug)]
pub(super) struct Book {
    newest: Measurement,
    known: Option<u64>,
    /// Which commands have been answered, their numbers plus one.
    answered: SequenceWindow,
    /// Flags received outside a measurement, or in one that was overtaken.
    latched: Status,
    recovered: Recovered,
    pub(super) stats: LinkStats,
}

/// Measurements recovered from the history of a later answer, until the loop takes them.
#[derive(Debug)]
struct Recovered {
    sequences: Vec<u64>,
    /// One after the other, as many values each as there are axes.
    forces: Vec<f64>,
    taken: usize,
}

impl Recovered {
    /// Room for all of them is made here. Real-time: no.
    fn new(axes: usize) -> Self {
        Self {
            sequences: Vec::with_capacity(KEPT),
            forces: vec![0.0; KEPT * axes],
            taken: 0,
        }
    }

    /// Keeps one more, if there is room. Real-time: yes.
    fn keep(&mut self, entry: &Earlier<'_>, axes: usize) -> Result<(), WireError> {
        let count = self.sequences.len();
        if let Some(slot) = self.forces.get_mut(count * axes..(count + 1) * axes)
            && count < KEPT
        {
            entry.read(slot)?;
            self.sequences.push(entry.sequence);
        }
        Ok(())
    }

    /// The next one. Real-time: yes.
    fn take(&mut self, force: &mut [f64]) -> Option<u64> {
        let (taken, axes) = (self.taken, force.len());
        let Some(sequence) = self.sequences.get(taken).copied() else {
            self.sequences.clear();
            self.taken = 0;
            return None;
        };
        force.copy_from_slice(self.forces.get(taken * axes..(taken + 1) * axes)?);
        self.taken += 1;
        Some(sequence)
    }
}

impl Book {
    pub(super) fn new(axes: usize) -> Self {
        Self {
            newest: Measurement::zeros(axes),
            known: None,
            answered: SequenceWindow::new(),
            latched: Status::default(),
            recovered: Recovered::new(axes),
            stats: LinkStats::default(),
        }
    }

    /// True if the answer to `sequence` is here.
    pub(super) fn has(&self, sequence: u64) -> bool {
        self.known == Some(sequence)
    }

    /// Records the flags of a heartbeat. An interlock stays; holding is reported once.
    pub(super) fn flags(&mut self, status: Status) {
        self.latched.0 |= status.0 & (Status::INTERLOCK.0 | Status::HOLDING.0);
    }

    /// True once its interlock has been reported open.
    pub(super) const fn has_interlock(&self) -> bool {
        self.latched.has(Status::INTERLOCK)
    }

    /// Takes a measurement while `issued` is the newest command. Real-time: yes.
    ///
    /// # Errors
    /// An answer to a command that was never sent.
    pub(super) fn measured(
        &mut self,
        frame: &MeasurementFrame<'_>,
        arrival: Arrival,
        issued: u64,
    ) -> Result<(), WireError> {
        let sequence = frame.sequence;
        if sequence > issued {
            return Err(WireError::Order {
                expected: "an answer to a command that was sent",
                found: "one to a later command",
            });
        }
        self.latched.0 |= frame.status.0 & Status::INTERLOCK.0;
        self.stats.missed = self.stats.missed.max(u64::from(frame.missed));
        match self.answered.accept(sequence.saturating_add(1)) {
            Err(WireError::Replayed { .. }) => self.stats.duplicates += 1,
            // More than 64 commands behind: the first and the second answer cannot be distinguished.
            Err(_) => self.stats.late += 1,
            Ok(_) if sequence < issued => self.stats.late += 1,
            Ok(_) => {}
        }
        let newer = match self.known {
            None => true,
            Some(known) => {
                let again = sequence == known && matches!(arrival, Arrival::Newest { .. });
                sequence > known || again
            }
        };
        if newer {
            let since = self.known;
            let lost = frame.earlier().filter(|entry| {
                entry.sequence < sequence && since.is_none_or(|known| entry.sequence > known)
            });
            for entry in lost {
                self.stats.recovered += 1;
                self.recovered.keep(&entry, self.newest.force.len())?;
            }
            frame.read(&mut self.newest)?;
            self.known = Some(sequence);
        }
        Ok(())
    }

    /// The next force that was recovered, and the command that it answers. Real-time: yes.
    pub(super) fn recover(&mut self, force: &mut [f64]) -> Option<u64> {
        self.recovered.take(force)
    }

    /// The newest data known. Real-time: yes.
    pub(super) fn copy_into(&mut self, into: &mut Measurement) {
        into.sequence = self.newest.sequence;
        into.time = self.newest.time;
        into.status = Status(self.newest.status.0 | self.latched.0);
        if self.latched.has(Status::HOLDING) && !self.newest.status.has(Status::HOLDING) {
            into.status.0 |= Status::HELD.0;
        }
        for (to, from) in into.disp.iter_mut().zip(&self.newest.disp) {
            *to = *from;
        }
        for (to, from) in into.force.iter_mut().zip(&self.newest.force) {
            *to = *from;
        }
        self.latched.0 &= Status::INTERLOCK.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_wire::Side;
    use gusset_wire::native::{Decoder, Encoder, Frame, Moment};

    /// A specimen's encoder and the controller's decoder and book, one axis.
    struct Ends {
        encoder: Encoder,
        decoder: Decoder,
        book: Book,
    }

    impl Ends {
        fn new() -> Self {
            Self {
                encoder: Encoder::new(Side::Specimen, 1, 7, None).unwrap(),
                decoder: Decoder::new(Side::Specimen, 1, 7, None).unwrap(),
                book: Book::new(1),
            }
        }

        fn frame(&mut self, sequence: u64, status: Status) -> Vec<u8> {
            let measured = Measurement {
                sequence,
                force: vec![sequence as f64],
                status,
                ..Measurement::zeros(1)
            };
            let mut out = vec![0; 400];
            let length = self
                .encoder
                .measurement(&measured, Moment::default(), &mut out)
                .unwrap();
            out.truncate(length);
            out
        }

        fn take(&mut self, frame: &[u8], issued: u64) -> Result<(), WireError> {
            let received = self.decoder.open(frame)?;
            let Frame::Measurement(measurement) = received.frame else {
                panic!("a measurement");
            };
            self.book.measured(&measurement, received.arrival, issued)
        }

        fn held(&mut self) -> Measurement {
            let mut into = Measurement::zeros(1);
            self.book.copy_into(&mut into);
            into
        }
    }

    #[test]
    fn late_answer_never_replaces_a_newer_one() {
        let mut ends = Ends::new();
        let frames: Vec<_> = (0..3).map(|k| ends.frame(k, Status::default())).collect();
        ends.take(&frames[0], 0).unwrap();
        ends.take(&frames[2], 2).unwrap();
        assert!(ends.book.has(2));
        assert_eq!(ends.book.stats.recovered, 1, "message 2 repeats message 1");
        ends.take(&frames[1], 2).unwrap();
        assert_eq!(ends.held().force, [2.0]);
        assert_eq!(ends.book.stats.late, 1);
    }

    #[test]
    fn second_answer_is_a_duplicate() {
        let mut ends = Ends::new();
        for _ in 0..2 {
            let frame = ends.frame(4, Status::default());
            ends.take(&frame, 4).unwrap();
        }
        assert_eq!(ends.book.stats.duplicates, 1);
        let frame = ends.frame(9, Status::default());
        assert!(matches!(ends.take(&frame, 5), Err(WireError::Order { .. })));
    }

    #[test]
    fn interlock_stays_holding_is_reported_once() {
        let mut ends = Ends::new();
        let frame = ends.frame(0, Status::INTERLOCK);
        ends.take(&frame, 0).unwrap();
        let frame = ends.frame(1, Status::default());
        ends.take(&frame, 1).unwrap();
        ends.book.flags(Status::HOLDING);
        assert_eq!(ends.held().status, Status(3 | Status::HELD.0));
        assert_eq!(ends.held().status, Status::INTERLOCK);
        // A hold that continues is reported in the answers.
        ends.book.flags(Status::HOLDING);
        let frame = ends.frame(2, Status::HOLDING);
        ends.take(&frame, 2).unwrap();
        assert_eq!(ends.held().status, Status(3));
    }
}
