//! The numbers of commands on a link beside their numbers in the test.
//!
//! An exchange that is no part of the test puts the link ahead of the test. A tick without a command puts it behind. Invariant:
//! an answer is counted back with the offsets of the command that left last, not with those of the command to come.

use gusset_quantity::state;
use gusset_quantity::state::{Stateful, Visit};

/// Offset between the numbers on a link and the numbers of the test.
#[derive(Debug, Clone, Copy, Default)]
struct Offset {
    /// Exchanges that were not part of the test.
    ahead: u64,
    /// Ticks of the test without a command.
    behind: u64,
}

state! { Offset { ahead, behind } }

impl Offset {
    #[inline]
    const fn on_link(self, sequence: u64) -> u64 {
        sequence
            .saturating_add(self.ahead)
            .saturating_sub(self.behind)
    }

    #[inline]
    const fn in_test(self, number: u64) -> u64 {
        number
            .saturating_add(self.behind)
            .saturating_sub(self.ahead)
    }
}

/// The numbers of one link.
#[derive(Debug, Default)]
pub(super) struct LinkNumbers {
    /// Offset of the next command.
    next: Offset,
    /// Offset of the last command.
    last: Offset,
    /// Number of that command in the test; none before the first.
    sent: Option<u64>,
}

impl LinkNumbers {
    /// Visits the number of the last command. Offsets that belong to a connection are not visited: a resumed test has another one.
    /// Real-time: yes.
    pub(crate) fn visit_state(&mut self, are_of_connection: bool, visit: &mut dyn Visit) {
        let Self { next, last, sent } = self;
        sent.visit_state(visit);
        if !are_of_connection {
            next.visit_state(visit);
            last.visit_state(visit);
        }
    }

    /// The number on the link of a command that leaves now. Real-time: yes.
    #[inline]
    pub(crate) fn number(&mut self, sequence: u64) -> u64 {
        self.sent = Some(sequence);
        self.last = self.next;
        self.on_link(sequence)
    }

    /// The number on the link of the first of many commands.
    pub(crate) const fn first(&self, sequence: u64) -> u64 {
        self.next.on_link(sequence)
    }

    /// A number of the test on the link, as of the last command. Real-time: yes.
    #[inline]
    pub(crate) const fn on_link(&self, sequence: u64) -> u64 {
        self.last.on_link(sequence)
    }

    /// A number on the link in the test, as of the last command. Real-time: yes.
    #[inline]
    pub(crate) const fn in_test(&self, number: u64) -> u64 {
        self.last.in_test(number)
    }

    /// Number in the test of the command that left last. Real-time: yes.
    #[inline]
    pub(crate) fn sent(&self) -> u64 {
        self.sent.unwrap_or(0)
    }

    /// True if the last command had this number of the test.
    pub(crate) fn was_issued(&self, sequence: u64) -> bool {
        let issued = self.sent.map(|sent| sent + self.last.ahead);
        issued == Some(sequence + self.next.ahead)
    }

    /// The last exchange was not part of the test. Real-time: yes.
    pub(crate) const fn go_ahead(&mut self) {
        self.next.ahead += 1;
    }

    /// A tick of the test passes without a command. Real-time: yes.
    pub(crate) const fn fall_behind(&mut self) {
        self.next.behind += 1;
    }

    /// Another partner takes over: the next numbers are those of the test.
    pub(crate) fn restart(&mut self) {
        self.next = Offset::default();
    }

    /// The next command has this number for the controller, and the next free number on the link.
    pub(crate) fn rebase(&mut self, sequence: u64) {
        let free = self
            .sent
            .map_or(0, |sent| self.on_link(sent).saturating_add(1));
        self.next = Offset {
            ahead: free.saturating_sub(sequence),
            behind: sequence.saturating_sub(free),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answer_takes_offsets_of_its_command() {
        let mut numbers = LinkNumbers::default();
        numbers.go_ahead();
        numbers.go_ahead();
        numbers.fall_behind();
        assert_eq!(numbers.number(5), 6);
        numbers.go_ahead();
        assert_eq!((numbers.on_link(5), numbers.in_test(6)), (6, 5));
        assert_eq!(numbers.first(6), 8);
        numbers.restart();
        assert_eq!(numbers.first(6), 6);
    }

    #[test]
    fn restarted_controller_gets_free_numbers() {
        let mut numbers = LinkNumbers::default();
        for (first, on_link) in [(100, 0), (0, 3), (7, 6)] {
            numbers.rebase(first);
            assert_eq!(numbers.first(first), on_link);
            assert_eq!(numbers.number(first), on_link);
            // One is lost on the way.
            assert_eq!(numbers.number(first + 2), on_link + 2);
            assert_eq!(numbers.in_test(on_link + 2), first + 2);
        }
        assert_eq!(numbers.number(u64::MAX), u64::MAX - 1);
    }
}
