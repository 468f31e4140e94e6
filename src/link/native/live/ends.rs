//! Beginning and end of a session: arming and retiring. Both wait, within time limits.

use super::{Detail, Live};
use crate::native::ask::{ask, explained, not_welcome};
use crate::native::refused::SetupError;
use gusset_quantity::substructure::{Coupling, LinkFault, Retirement, Status};
use gusset_quantity::time::Nanos;
use gusset_wire::handshake::{self, Arm, Bye, Control};
use gusset_wire::native::{Cause, Frame, Notice};

/// How long the link waits for the goodbye of a specimen; over UDP it repeats its own meanwhile.
const GOODBYE_NS: u64 = 300_000_000;
/// Time limit for a specimen that has not answered its last command yet: it reads the goodbye after that.
const BUSY_NS: u64 = 2_000_000_000;
const GOODBYE_REPEAT_NS: u64 = 100_000_000;

impl Live {
    /// Sends the last question before anything moves, and does not wait for the answer.
    pub(in crate::native) fn ask_to_arm(
        &mut self,
        sequence: u64,
        disp: &[f64],
    ) -> Result<(), LinkFault> {
        let message = Control::Arm(Arm {
            session: self.session,
            first_sequence: sequence,
            disp: disp.to_vec(),
        });
        let written = handshake::encode(&message).and_then(|bytes| {
            let written = self.encoder.control(&bytes, &mut self.out);
            self.asked_to_arm = Some(bytes);
            written
        });
        self.send(written)
    }

    /// Last question before anything moves. Blocks within the time limit while the answer is `wanted`: false if it is no
    /// longer.
    pub(in crate::native) fn arm(
        &mut self,
        sequence: u64,
        disp: &[f64],
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, LinkFault> {
        if self.asked_to_arm.is_none() {
            self.ask_to_arm(sequence, disp)?;
        }
        let bytes = self.asked_to_arm.take().unwrap_or_default();
        let (session, limit) = (self.session, self.connect_limit);
        let Self {
            transport,
            inbox,
            encoder,
            decoder,
            out,
            ..
        } = self;
        let mut is_on_its_way = true;
        let answer = ask(
            transport.as_mut(),
            inbox,
            ("request to arm", limit),
            |transport| {
                if std::mem::take(&mut is_on_its_way) {
                    return Ok(());
                }
                let length = encoder.control(&bytes, out)?;
                let frame = out.get(..length).unwrap_or_default();
                transport.send(frame).map_err(SetupError::Lost)
            },
            wanted,
            |frame| match decoder.open(frame)?.frame {
                Frame::Control(message) => match handshake::decode(message)? {
                    Control::Arm(arm)
                        if arm.session == session && arm.first_sequence == sequence =>
                    {
                        if arm.disp == disp {
                            Ok(Some(()))
                        } else {
                            Err(SetupError::ArmedElsewhere)
                        }
                    }
                    // The answer to an earlier one, that was repeated.
                    Control::Arm(_) => Ok(None),
                    other => Err(not_welcome(other, "the arming")),
                },
                Frame::Goodbye(notice) => Err(SetupError::Left {
                    due: "the arming",
                    cause: notice.cause.code(),
                    text: String::new(),
                }),
                _ => Ok(None),
            },
        );
        match answer {
            Ok(()) => {
                self.armed = true;
                Ok(true)
            }
            // The specimen learns this from the goodbye.
            Err(SetupError::Unwanted) => Ok(false),
            Err(error) => {
                let error = explained(error, self.transport.as_ref());
                if let Some((code, text)) = error.goodbye() {
                    self.heard_goodbye(code, text);
                }
                Err(self.fail(error.fault(), Detail::Said(error.to_string())))
            }
        }
    }

    /// See [`gusset_quantity::substructure::Substructure::has_acknowledged`].
    pub(in crate::native) const fn has_acknowledged(&self) -> Option<bool> {
        self.acknowledged
    }

    /// Tells the specimen, and waits a little for its goodbye. Whatever happens, this is the end.
    pub(in crate::native) fn retire(&mut self, how: Retirement) {
        self.acknowledged = self.armed.then_some(false);
        if self.fault == Some(LinkFault::Closed) {
            return;
        }
        let cause = Cause::from(how);
        if !self.armed {
            let bye = Control::Bye(Bye {
                cause: cause.code(),
                text: String::new(),
            });
            if let Ok(bytes) = handshake::encode(&bye) {
                let written = self.encoder.control(&bytes, &mut self.out);
                let _ = self.send(written);
            }
            return;
        }
        let is_busy = self.fault.is_none()
            && self.coupling == Coupling::Lockstep
            && self.issued.is_some_and(|issued| !self.book.has(issued));
        let patience = if is_busy {
            self.reply_timeout_ns.clamp(GOODBYE_NS, BUSY_NS)
        } else {
            GOODBYE_NS
        };
        let notice = Notice {
            sequence: self.issued.unwrap_or_default(),
            cause,
        };
        let was_open = self.book.has_interlock();
        let said = self.hear_goodbye(notice, patience);
        self.last_words = said.words(cause, was_open);
    }

    /// Requests the goodbye, and reads frames until it comes.
    fn hear_goodbye(&mut self, notice: Notice, patience: u64) -> Parting {
        let mut said = Parting::default();
        // A second goodbye contains more than the first.
        let is_explained = self.detail.is_some();
        let until = self.transport.now().plus(patience);
        let mut ask_at = Nanos(0);
        while self.transport.now() < until {
            if self.transport.now() >= ask_at {
                let written = self.encoder.retire(notice, &mut self.out);
                if self.send(written).is_err() {
                    return said;
                }
                ask_at = if self.inbox.is_stream() {
                    until
                } else {
                    self.transport.now().plus(GOODBYE_REPEAT_NS)
                };
            }
            match self.transport.recv(self.inbox.space(), until.min(ask_at)) {
                Ok(Some(count)) => self.inbox.filled(count),
                Ok(None) => continue,
                Err(_) => return said,
            }
            while let Ok(Some(place)) = self.inbox.next() {
                match self.decoder.open(self.inbox.frame(place)).map(|r| r.frame) {
                    Ok(Frame::Goodbye(answer)) => {
                        self.acknowledged = Some(true);
                        self.heard_goodbye(answer.cause.code(), "");
                        said.cause = Some(answer.cause);
                        return said;
                    }
                    Ok(Frame::Heartbeat(beat)) => said.status.0 |= beat.status.0,
                    Ok(Frame::Measurement(measured)) => said.status.0 |= measured.status.0,
                    // Why it tripped, if it did.
                    Ok(Frame::Control(message)) => {
                        if let Ok(Control::Bye(bye)) = handshake::decode(message) {
                            self.heard_goodbye(bye.cause, &bye.text);
                            if !bye.text.is_empty() && !is_explained {
                                self.detail = Some(Detail::Said(bye.text.clone()));
                            }
                            said.bye = Some(bye);
                        }
                    }
                    _ => {}
                }
            }
        }
        said
    }

    /// See [`gusset_quantity::substructure::Substructure::last_words`].
    pub(in crate::native) fn last_words(&self) -> Option<String> {
        self.last_words.clone()
    }
}

/// The answer of a specimen that has been retired.
#[derive(Debug, Default)]
struct Parting {
    cause: Option<Cause>,
    bye: Option<Bye>,
    status: Status,
}

impl Parting {
    /// Its unusual parts, in words. `asked`: why it was retired, which it may repeat; `was_open`: its interlock was reported
    /// open before.
    fn words(self, asked: Cause, was_open: bool) -> Option<String> {
        let text = self.bye.as_ref().map(|bye| bye.text.trim());
        let text = text.filter(|text| !text.is_empty());
        let by_bye = self
            .bye
            .as_ref()
            .and_then(|bye| Cause::from_code(bye.cause).ok());
        let opened = self
            .status
            .has(Status::INTERLOCK)
            .then_some(Cause::Interlock);
        let is_news = |cause: &Cause| {
            let is_known = *cause == asked || (was_open && *cause == Cause::Interlock);
            *cause != Cause::Orderly && !is_known
        };
        let mut causes = [self.cause, by_bye, opened].into_iter().flatten();
        let why = causes.find(is_news).map(Cause::why);
        match (why, text) {
            (Some(why), Some(text)) => Some(format!("{why}: {text}")),
            (why, text) => why.or(text).map(str::to_owned),
        }
    }
}
