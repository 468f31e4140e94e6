//! What the loop waits for specimens, outside of its own edges: until they are armed, and until those have answered that owe an
//! answer for each command. Meanwhile an operator who asks for an end is heard; what else he says is heard in its turn.

use super::operator::Control;
use super::{Engine, Stop};
use crate::port::Port;
use crate::record::Event;
use crate::substructure::{Holder, LISTEN_NS};

/// Times in which no command left although each tick has one, outside of the ticks of the test, where such are misses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Gaps {
    /// How many.
    pub times: u64,
    /// The longest, ns.
    pub longest_ns: u64,
}

/// A gap from which on somebody must know of it; behind a partner that is asked once a step, and may take its time, a longer one.
const GAP_NS: u64 = 100_000_000;
const PATIENT_GAP_NS: u64 = 1_000_000_000;

impl Engine {
    /// The next command leaves so late, and so many ticks had none. Real-time: yes.
    #[cold]
    pub(super) fn note_gap(&mut self, late_ns: u64, ticks: u64) {
        let is_patient = self.ports.iter().any(Port::is_per_step);
        if late_ns < if is_patient { PATIENT_GAP_NS } else { GAP_NS } {
            return;
        }
        self.gaps.times += 1;
        self.gaps.longest_ns = self.gaps.longest_ns.max(late_ns);
        let tick = self.tick_of_report();
        self.report(&tick, Event::Gap { late_ns, ticks });
    }

    /// Arms all specimens: all are asked before any is waited for, so that they get ready at the same time. An operator who
    /// asks for an end meanwhile is heard at once.
    pub(super) fn arm(&mut self, control: &Control) -> Result<(), Stop> {
        for (index, port) in self.ports.iter_mut().enumerate() {
            port.ask_to_arm(self.sequence)
                .map_err(|fault| Stop::Link { port: index, fault })?;
        }
        let asked = &mut self.asked;
        let mut wanted = || !asked.takes_an_end(control);
        for (index, port) in self.ports.iter_mut().enumerate() {
            let is_armed = port.arm(self.sequence, &mut wanted);
            if !is_armed.map_err(|fault| Stop::Link { port: index, fault })? {
                let waited_for = self.ports.iter().enumerate().skip(index);
                let gets_ready =
                    waited_for.filter(|(_, port)| port.holder() == Holder::ItsWatchdog);
                self.unarmed = gets_ready.map(|(index, _)| index).collect();
                return Err(Stop::Operator);
            }
        }
        Ok(())
    }

    /// Waits for the answer that a lockstep partner owes, part by part: in between the operator is heard, and an end that he
    /// asks for ends the wait. That its own time limit has passed shows when its answer is taken. Real-time: yes.
    #[inline]
    pub(super) fn wait_for(&mut self, index: usize, control: Option<&Control>) -> Result<(), Stop> {
        let Some(port) = self.ports.get_mut(index) else {
            return Ok(());
        };
        if !port.is_awaited() {
            return Ok(());
        }
        let (wait_ns, parts) = if control.is_some() || port.is_recorded() {
            let patience = port.patience_ns(self.limits.reply_timeout_ns);
            (LISTEN_NS, patience.div_ceil(LISTEN_NS))
        } else {
            (0, 1)
        };
        for _ in 0..parts {
            let answered = port.is_answered(wait_ns);
            if answered.map_err(|fault| Stop::Link { port: index, fault })? {
                return Ok(());
            }
            // A recording answers unless the operator did not wait.
            if port.is_recorded() || control.is_none_or(|control| self.asked.takes_an_end(control))
            {
                port.leave_owing();
                return Err(Stop::Operator);
            }
        }
        Ok(())
    }
}
