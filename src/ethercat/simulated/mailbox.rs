//! The mailbox of a simulated device (ETG.1000.6): two sync managers, each with one message.

use super::device::{Device, RECEIVE, SEND};
use crate::wire::coe::Answer;
use crate::wire::drive as words;
use crate::wire::register as reg;
use crate::wire::register::AlState;

impl Device {
    pub(super) fn mailbox_status(&self, manager: u16) -> bool {
        let at = reg::SYNC_MANAGER + manager * reg::SYNC_MANAGER_SIZE + reg::SYNC_MANAGER_STATUS;
        let status = self.memory.get(usize::from(at));
        status.is_some_and(|status| status & reg::MAILBOX_FULL != 0)
    }

    pub(super) fn set_mailbox(&mut self, manager: u16, full: bool) {
        let at = reg::SYNC_MANAGER + manager * reg::SYNC_MANAGER_SIZE + reg::SYNC_MANAGER_STATUS;
        self.put(at, &[if full { reg::MAILBOX_FULL } else { 0 }]);
    }

    /// Takes the message that fills its mailbox.
    pub(super) fn hear(&mut self) {
        if self.state == AlState::Init {
            return;
        }
        let start = usize::from(RECEIVE.0);
        let message = self.memory.get(start..start + usize::from(RECEIVE.1));
        let message = message.unwrap_or_default().to_vec();
        self.count = self.count % 7 + 1;
        let maps = self.state == AlState::PreOp;
        let count = self.count;
        if let Some(servo) = &self.servo {
            self.dictionary
                .set(words::STATUSWORD, &servo.status().to_le_bytes());
            self.dictionary
                .set(words::ERROR_CODE, &servo.error.to_le_bytes());
        }
        if let Some(answer) = self.dictionary.answer(&message, count, maps) {
            self.answers.push(answer);
            self.next_answer();
        }
        if let (Some(servo), Some(word)) = (
            &mut self.servo,
            self.dictionary.get(words::CONTROLWORD, 0).first_chunk(),
        ) && self.state != AlState::Op
        {
            servo.reset(u16::from_le_bytes(*word));
        }
    }

    pub(super) fn next_answer(&mut self) {
        if !self.mailbox_status(1) && !self.answers.is_empty() {
            let answer = self.answers.remove(0);
            let mut whole = answer;
            whole.resize(usize::from(SEND.1), 0);
            self.put(SEND.0, &whole);
            self.set_mailbox(1, true);
        }
    }

    /// Reports an emergency by its mailbox.
    pub(super) fn report(&mut self, code: u16) {
        self.count = self.count % 7 + 1;
        let mut out = vec![0; usize::from(SEND.1)];
        if Answer::Emergency(code)
            .write(self.count, &mut out)
            .is_some()
        {
            self.answers.push(out);
            self.next_answer();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::plan;
    use super::*;
    use crate::plan::TimeSource;
    use crate::wire::coe::{NO_ACCESS, Object, Request};

    #[test]
    fn the_mailbox_answers_what_it_cannot_do() {
        let mut own = Device::new((0, true), (&plan().devices[3], ""), TimeSource::Loop, 0.0);
        own.state = AlState::PreOp;
        let object = Object {
            index: 0x1018,
            sub: 0,
        };
        let mut complete = [0; 16];
        Request::Complete(object).write(1, &mut complete).unwrap();
        // SDO information, and EoE.
        let information = [8, 0, 0, 0, 0, 0x13, 0, 0x80, 1, 0, 0, 0, 0, 0];
        let ethernet = [8, 0, 0, 0, 0, 0x12, 0, 0, 0, 0, 0, 0, 0, 0];
        for (message, wanted) in [
            (&complete[..], Answer::Aborted(object, NO_ACCESS)),
            (&information[..], Answer::Refused(4)),
            (&ethernet[..], Answer::Refused(2)),
        ] {
            own.put(RECEIVE.0, message);
            own.hear();
            let from = usize::from(SEND.0);
            assert!(own.mailbox_status(1));
            let sent = &own.memory[from..from + usize::from(SEND.1)];
            assert_eq!(Answer::read(sent), Some(wanted));
            own.set_mailbox(1, false);
        }
    }
}
