//! What the loop waits for specimens, outside of its own edges: until those have answered that owe an answer for each command.
//! Meanwhile an operator who asks for an end is heard; what else he says is heard in its turn.

use super::operator::Control;
use super::{Engine, Stop};

/// He is listened to this often.
const LISTEN_NS: u64 = 50_000_000;

impl Engine {
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
