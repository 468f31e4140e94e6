//! The exchange with one substructure: who answers, what is owed, and what was counted.
//!
//! Invariant: no command leaves to a partner that is lost or overdue, and the numbers on the link are those of the test but for
//! exchanges that are not part of it. Limits: it knows no clock; the loop gives the times.

use super::exchange_state::ExchangeState;
use super::link_numbers::LinkNumbers;
use gusset_quantity::frame::AtAxis;
use gusset_quantity::state;
use gusset_quantity::state::{Stateful, Visit};
use gusset_quantity::substructure::{
    Command, Coupling, Freshness, Holder, Introduction, LinkFault, LinkStats, Measurement,
    Retirement, Status, Substructure, Unavailable,
};
use gusset_quantity::time::Nanos;

/// Counts of one link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinkCount {
    /// Commands sent.
    pub sent: u64,
    /// Fresh measurements taken.
    pub received: u64,
    /// Commands whose measurement was not there at the deadline.
    pub stale: u64,
    /// Measurements in which the actuator–specimen iteration did not converge.
    pub unsettled: u64,
    /// Times that the specimen reported a hold by its own watchdog.
    pub holds: u64,
    /// Counts of the link itself.
    pub stats: LinkStats,
}

// The counts of the link itself belong to the link.
state! { LinkCount { sent, received, stale, unsettled, holds } keeps { stats } }

/// What answers say of a hold by the specimen's own watchdog.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hold {
    /// This answer begins the hold.
    pub begins: bool,
    /// Answers in a row that report the hold.
    pub answers: u64,
}

/// Use of a stale force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnStale {
    /// The loop uses it unchanged.
    Hold,
    /// The loop moves it along the estimate k̂.
    Extrapolate,
    /// The test stops.
    Stop,
}

/// How long the loop waits for one specimen, and what happens when it is late.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WaitRules {
    /// How long the loop waits for a lockstep partner, in ns.
    pub reply_timeout_ns: u64,
    /// Use of a stale force.
    pub on_stale: OnStale,
    /// Stale measurements in a row after which the test stops.
    pub stale_in_a_row: u64,
    /// The loop follows the clock of this specimen, and records how far that deviates.
    pub has_clock: bool,
}

/// The exchange with one substructure.
pub struct Exchange {
    substructure: Box<dyn Substructure>,
    is_recording: bool,
    state: ExchangeState,
    numbers: LinkNumbers,
    count: LinkCount,
    wait: Option<WaitRules>,
    /// A fresh measurement has come since the specimen was armed; before that its values are made up.
    has_answered: bool,
    /// Stale measurements in a row.
    stale: u64,
    /// Answers in a row in which the specimen reports a hold by its own watchdog.
    holding: u64,
}

impl std::fmt::Debug for Exchange {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Exchange")
            .field("state", &self.state)
            .field("count", &self.count)
            .finish_non_exhaustive()
    }
}

/// The state has what is owed and counted, and a specimen that is computed in this process. Other specimens keep their own.
impl Stateful for Exchange {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        let is_elsewhere = self.is_remote() || self.is_recording;
        let Self {
            substructure,
            is_recording: _,
            state,
            numbers,
            count,
            wait: _,
            has_answered,
            stale,
            holding,
        } = self;
        visit.part("exchange");
        state.visit_state(visit);
        numbers.visit_state(is_elsewhere, visit);
        count.visit_state(visit);
        has_answered.visit_state(visit);
        stale.visit_state(visit);
        holding.visit_state(visit);
        if !substructure.visit_state(visit) && !is_elsewhere {
            visit.refuse();
        }
    }
}

impl Exchange {
    pub(crate) fn new(substructure: Box<dyn Substructure>) -> Self {
        Self {
            substructure,
            is_recording: false,
            state: ExchangeState::Idle,
            numbers: LinkNumbers::default(),
            count: LinkCount::default(),
            wait: None,
            has_answered: false,
            stale: 0,
            holding: 0,
        }
    }

    /// A recording answers in place of the substructure: it knows the numbers of the test only.
    pub(crate) fn put_recording(&mut self, recording: Box<dyn Substructure>) {
        self.substructure = recording;
        self.is_recording = true;
    }

    /// The exchange with something round its substructure.
    pub(crate) fn wrapped(
        mut self,
        wrap: impl FnOnce(Box<dyn Substructure>) -> Box<dyn Substructure>,
    ) -> Self {
        self.substructure = wrap(self.substructure);
        self
    }

    /// Takes the live partner of `fresh` in place of a recording; a formula stays. Counts restart, and no partner is lost.
    /// True if another partner answers now.
    pub(crate) fn go_live(&mut self, fresh: Self) -> bool {
        let is_new = fresh.substructure.is_remote();
        if is_new {
            self.substructure = fresh.substructure;
            self.is_recording = false;
            self.numbers.restart();
        }
        // Times and counts in a row are of the clock of another test.
        self.count = LinkCount::default();
        (self.has_answered, self.stale, self.holding) = (false, 0, 0);
        self.state.go_live();
        is_new
    }

    /// Another partner with as many axes answers from here on. Returns the partner before. All counts restart.
    pub(crate) fn swap(&mut self, substructure: Box<dyn Substructure>) -> Box<dyn Substructure> {
        self.begin_session();
        std::mem::replace(&mut self.substructure, substructure)
    }

    /// Another controller commands: all counts restart, and nothing is owed.
    pub(crate) fn begin_session(&mut self) {
        self.numbers = LinkNumbers::default();
        self.count = LinkCount::default();
        (self.has_answered, self.stale, self.holding) = (false, 0, 0);
        self.state = ExchangeState::Idle;
    }

    /// The next command has this number for the controller, and the next free number on the link.
    pub(crate) fn renumber(&mut self, sequence: u64) {
        self.numbers.rebase(sequence);
    }

    /// See [`Substructure::commanded_every`].
    pub fn commanded_every(&mut self, seconds: f64) {
        self.substructure.commanded_every(seconds);
    }

    /// Measures before the first command; false if the specimen does not.
    pub fn at_rest(&mut self, into: &mut Measurement) -> bool {
        self.substructure.at_rest(into)
    }

    /// A computed specimen forgets what was not accepted.
    pub fn revert(&mut self) {
        self.substructure.revert();
    }

    /// Tangent stiffness, n × n by columns, in the specimen's units; false if it is not known. Real-time: yes.
    pub fn tangent(&self, stiffness: &mut [f64]) -> bool {
        self.substructure.tangent(stiffness)
    }

    #[inline]
    pub(crate) const fn state(&self) -> &ExchangeState {
        &self.state
    }

    #[inline]
    pub(crate) const fn state_mut(&mut self) -> &mut ExchangeState {
        &mut self.state
    }

    /// Whether a reply is owed for each command.
    #[inline]
    #[must_use]
    pub fn coupling(&self) -> Coupling {
        self.substructure.coupling()
    }

    /// True if replies come from outside this process, so that a late one is the peer's doing.
    #[inline]
    #[must_use]
    pub fn is_remote(&self) -> bool {
        self.substructure.is_remote()
    }

    /// True if a recording answers in place of the specimen.
    #[inline]
    pub(crate) const fn is_recording(&self) -> bool {
        self.is_recording
    }

    /// True if it is neither behind a link nor a recording.
    #[must_use]
    pub fn is_formula(&self) -> bool {
        !self.is_recording && !self.is_remote()
    }

    /// True if its answer has to be waited for: it comes from outside this process. A recording says whether it was.
    #[inline]
    pub(crate) fn is_awaited(&self) -> bool {
        (self.is_remote() || self.is_recording) && self.coupling() == Coupling::Lockstep
    }

    /// Sends a command that has this number in the test, unless the partner is lost or overdue. Real-time: yes.
    #[inline]
    pub(crate) fn send(
        &mut self,
        sequence: u64,
        [time, dt]: [f64; 2],
        [AtAxis(disp), AtAxis(vel)]: [AtAxis<&[f64]>; 2],
    ) -> Result<(), LinkFault> {
        if !self.state.may_be_commanded() {
            return Err(LinkFault::Refused);
        }
        self.count.sent += 1;
        let sequence = self.numbers.number(sequence);
        if sequence == u64::MAX {
            // No protocol has this number.
            return Err(LinkFault::Refused);
        }
        let command = Command {
            sequence,
            time,
            dt,
            disp,
            vel,
        };
        self.substructure.issue(&command)?;
        self.state.sent();
        Ok(())
    }

    /// Takes the answer into `incoming`, which holds the newest one that is known. Real-time: yes.
    #[inline]
    pub(crate) fn collect(
        &mut self,
        deadline: Nanos,
        incoming: &mut Measurement,
    ) -> Result<Freshness, LinkFault> {
        incoming.sequence = self.numbers.on_link(incoming.sequence);
        let answer = self.substructure.collect(deadline, incoming);
        incoming.sequence = self.numbers.in_test(incoming.sequence);
        answer
    }

    /// The answer was taken, fresh or stale. One that is not finite settles nothing. Real-time: yes.
    #[inline]
    pub(crate) const fn note_answer(&mut self, is_fresh: bool, is_finite: bool) {
        if is_fresh {
            self.count.received += 1;
            self.has_answered = true;
        } else {
            self.count.stale += 1;
        }
        if is_finite {
            self.state.answered();
        }
    }

    /// The force of an answer that was lost and came with a later one; the number of its command in the test. Real-time: yes.
    pub(crate) fn recover(&mut self, force: &mut [f64]) -> Option<u64> {
        let number = self.substructure.recover(force)?;
        Some(self.numbers.in_test(number))
    }

    /// The command of this number is accepted, or the last one of a partner of whole steps. Real-time:
    /// yes.
    #[inline]
    pub(crate) fn accepted(&mut self, sequence: u64, per_step: bool) -> Result<(), LinkFault> {
        let sequence = if per_step {
            self.numbers.sent()
        } else {
            sequence
        };
        self.substructure.accepted(self.numbers.on_link(sequence))
    }

    /// The last exchange was not part of the test: the numbers of the test go on without it. Real-time: yes.
    pub(crate) const fn skip_number(&mut self) {
        if !self.is_recording {
            self.numbers.go_ahead();
        }
    }

    /// A tick passes without a command. Real-time: yes.
    pub(crate) const fn skip_command(&mut self) {
        if !self.is_recording {
            self.numbers.fall_behind();
        }
    }

    /// The next command is another one than the one of this number, which may have left: then that was accepted.
    pub(crate) fn leave_number(&mut self, sequence: u64) {
        if self.numbers.was_issued(sequence) {
            if !self.state.owes() {
                // A link that is lost shows at the next command.
                let _ = self.substructure.accepted(self.numbers.on_link(sequence));
            }
            self.skip_number();
        }
    }

    /// Connects the substructure.
    pub fn connect(&mut self) -> Result<Introduction, Unavailable> {
        self.substructure.connect()
    }

    /// Asks what [`Exchange::arm`] waits for, and does not wait.
    pub(crate) fn ask_to_arm(
        &mut self,
        sequence: u64,
        command: AtAxis<&[f64]>,
    ) -> Result<(), LinkFault> {
        self.substructure
            .ask_to_arm(self.numbers.first(sequence), &command)
    }

    /// The last agreement before commands move the specimen; false if it was not `wanted` any more.
    pub(crate) fn arm(
        &mut self,
        sequence: u64,
        command: AtAxis<&[f64]>,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, LinkFault> {
        self.has_answered = false;
        let number = self.numbers.first(sequence);
        self.substructure.arm(number, &command, wanted)
    }

    /// True if the answer is here, or comes within `wait_ns` of wall time. Real-time: yes.
    #[inline]
    pub fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        self.substructure.is_answered(wait_ns)
    }

    /// Nothing to command: see [`Substructure::attend`]. Real-time: yes.
    pub fn attend(&mut self) -> Result<(), LinkFault> {
        self.substructure.attend()
    }

    /// The operator holds the test. Real-time: yes.
    pub(crate) fn pause(&mut self) -> Result<(), LinkFault> {
        self.substructure.pause()
    }

    /// The specimen stops where it is. A link that is lost shows with the next command.
    pub fn halt(&mut self) {
        if self.has_begun() {
            let _ = self.substructure.halt();
        }
    }

    /// See [`Substructure::settle`].
    pub(crate) fn settle(&mut self, how: Retirement) -> bool {
        self.substructure.settle(how)
    }

    /// See [`Substructure::clock_ppm`]; none of a specimen whose clock the loop does not follow. Real-time: yes.
    pub(crate) fn clock_ppm(&self) -> Option<f64> {
        let has_clock = self.wait.is_some_and(|wait| wait.has_clock);
        has_clock.then(|| self.substructure.clock_ppm())
    }

    /// Says goodbye.
    pub fn retire(&mut self, how: Retirement) {
        self.substructure.retire(how);
    }

    /// Whether the goodbye was acknowledged; none of a partner that need not acknowledge it.
    pub(crate) fn has_acknowledged(&self) -> Option<bool> {
        self.substructure.has_acknowledged()
    }

    /// True of a specimen that need not acknowledge the goodbye.
    pub(crate) fn needs_no_acknowledgement(&self) -> bool {
        self.has_acknowledged().is_none()
    }

    /// True of a specimen that should have acknowledged the goodbye, and did not.
    pub(crate) fn lacks_acknowledgement(&self) -> bool {
        self.has_acknowledged() == Some(false)
    }

    /// Answer to the goodbye beyond a plain acknowledgement.
    #[must_use]
    pub fn last_words(&self) -> Option<String> {
        self.substructure.last_words()
    }

    /// More than the fault says about why the link was lost.
    #[must_use]
    pub fn complaint(&self) -> Option<String> {
        self.substructure.complaint()
    }

    /// Who holds the specimen if commands stay away.
    pub(crate) fn holder(&self) -> Holder {
        self.substructure.holder()
    }

    /// True if a command has left.
    #[must_use]
    pub const fn has_begun(&self) -> bool {
        self.count.sent > 0
    }

    /// Counts of this exchange, without those of the link itself. Real-time: yes.
    #[inline]
    #[must_use]
    pub const fn count(&self) -> &LinkCount {
        &self.count
    }

    /// Everything that was counted.
    #[must_use]
    pub fn full_count(&self) -> LinkCount {
        LinkCount {
            stats: self.substructure.stats(),
            ..self.count
        }
    }

    /// How the loop waits for this specimen; none: by the limits of the test.
    #[must_use]
    pub const fn wait(&self) -> Option<WaitRules> {
        self.wait
    }

    /// How long the loop waits for it in ns: by its own rules, or as long as for others. Real-time: yes.
    #[inline]
    pub(crate) fn patience_ns(&self, others: u64) -> u64 {
        self.wait.map_or(others, |own| own.reply_timeout_ns)
    }

    pub(crate) const fn set_wait(&mut self, wait: Option<WaitRules>) {
        self.wait = wait;
    }

    /// True if a fresh measurement has come since the specimen was armed. Real-time: yes.
    #[inline]
    pub(crate) const fn has_answered(&self) -> bool {
        self.has_answered
    }

    /// From here on the specimen counts as one that has answered.
    pub(crate) const fn take_for_answered(&mut self) {
        self.has_answered = true;
    }

    /// Stale measurements in a row. Real-time: yes.
    #[inline]
    pub(crate) const fn stale_in_a_row(&self) -> u64 {
        self.stale
    }

    /// One more stale measurement; how many there are in a row. Real-time: yes.
    pub(crate) const fn count_stale(&mut self) -> u64 {
        self.stale += 1;
        self.stale
    }

    /// The last measurement was fresh. Real-time: yes.
    #[inline]
    pub(crate) const fn forget_stale(&mut self) {
        self.stale = 0;
    }

    /// Answers in a row in which it reports a hold by its own watchdog. Real-time: yes.
    #[inline]
    pub(crate) const fn holding_in_a_row(&self) -> u64 {
        self.holding
    }

    /// Sets their number. Real-time: yes.
    pub(crate) const fn set_holding_in_a_row(&mut self, answers: u64) {
        self.holding = answers;
    }

    /// Takes note of whether the last answer says that the specimen's own watchdog holds it. Real-time: yes.
    pub(crate) fn note_hold(&mut self, status: Status, freshness: Freshness) -> Hold {
        let before = self.holding;
        let holds = status.has(Status::HOLDING);
        let goes_on = holds && !status.has(Status::HELD);
        self.holding = match (goes_on, freshness) {
            (true, Freshness::Fresh) => before + 1,
            (true, Freshness::Stale) => before.max(1),
            (false, Freshness::Fresh) => 0,
            // Stale data say nothing new.
            (false, Freshness::Stale) => before,
        };
        let begins = holds && before == 0;
        self.count.holds += u64::from(begins);
        Hold {
            begins,
            answers: self.holding,
        }
    }

    /// One more measurement whose iteration did not converge; how many there are. Real-time: yes.
    pub(crate) const fn count_unsettled(&mut self) -> u64 {
        self.count.unsettled += 1;
        self.count.unsettled
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::exchange_state::Loss;

    /// Behind a link that takes commands, or does not.
    struct Linked(Result<(), LinkFault>);

    impl Substructure for Linked {
        fn axes(&self) -> usize {
            1
        }
        fn is_remote(&self) -> bool {
            true
        }
        fn issue(&mut self, _: &Command<'_>) -> Result<(), LinkFault> {
            self.0
        }
        fn collect(&mut self, _: Nanos, _: &mut Measurement) -> Result<Freshness, LinkFault> {
            Ok(Freshness::Fresh)
        }
        fn retire(&mut self, _: Retirement) {}
    }

    fn exchange() -> Exchange {
        Exchange::new(Box::new(Linked(Ok(()))))
    }

    fn send(exchange: &mut Exchange) -> Result<(), LinkFault> {
        exchange.send(0, [0.0; 2], [AtAxis(&[0.0]), AtAxis(&[0.0])])
    }

    #[test]
    fn pending_target_waits_before_the_test() {
        let mut exchange = exchange();
        exchange.state_mut().pend();
        send(&mut exchange).unwrap();
        assert!(exchange.state().owes() && !exchange.state().is_pending());
        exchange.note_answer(true, true);
        assert!(exchange.state().is_pending() && !exchange.state().owes());
        send(&mut exchange).unwrap();
        exchange.state_mut().told_the_target();
        exchange.note_answer(false, true);
        assert_eq!(*exchange.state(), ExchangeState::Idle);
        assert!(exchange.has_answered());
    }

    #[test]
    fn lost_commands_and_nan_settle_nothing() {
        let mut exchange = Exchange::new(Box::new(Linked(Err(LinkFault::Closed))));
        exchange.state_mut().pend();
        assert!(send(&mut exchange).is_err());
        assert!(exchange.state().is_pending() && !exchange.state().owes());
        let mut exchange = self::exchange();
        send(&mut exchange).unwrap();
        exchange.note_answer(true, false);
        assert!(exchange.state().owes());
    }

    #[test]
    fn overdue_link_gets_no_command() {
        let mut exchange = exchange();
        send(&mut exchange).unwrap();
        assert_eq!(exchange.state_mut().look_for_answer(Nanos(7)), Nanos(7));
        exchange.state_mut().end_test();
        assert_eq!(exchange.state_mut().look_for_answer(Nanos(9)), Nanos(7));
        assert!(exchange.state().owes_the_last() && exchange.state().owes());
        assert_eq!(send(&mut exchange), Err(LinkFault::Refused));
        exchange.state_mut().close_tick_of_shutdown();
        assert!(exchange.state().owes_the_last(), "it has not answered");
        exchange.note_answer(true, true);
        assert!(!exchange.state().owes() && !exchange.state().may_be_commanded());
        exchange.state_mut().close_tick_of_shutdown();
        assert!(exchange.state().may_be_commanded());
        send(&mut exchange).unwrap();
    }

    #[test]
    fn lost_link_gets_no_command() {
        let mut exchange = exchange();
        exchange.state_mut().lose(Loss::Distrusted);
        assert!(exchange.state().is_lost() && !exchange.state().is_gone());
        assert_eq!(send(&mut exchange), Err(LinkFault::Refused));
        exchange.state_mut().lose(Loss::Gone);
        exchange.state_mut().lose(Loss::Distrusted);
        assert!(exchange.state().is_gone());
        assert_eq!(exchange.count().sent, 0);
    }

    /// A recording that ends loses every partner; the live partner gets the target that was not answered.
    #[test]
    fn unanswered_target_is_sent_again() {
        for (told, answered) in [(false, false), (true, false), (true, true)] {
            let mut exchange = exchange();
            exchange.state_mut().pend();
            if told {
                send(&mut exchange).unwrap();
                exchange.state_mut().told_the_target();
            }
            if answered {
                exchange.note_answer(true, true);
            }
            exchange.state_mut().lose(Loss::Gone);
            exchange.go_live(self::exchange());
            assert!(exchange.state().may_be_commanded() && !exchange.has_begun());
            assert_eq!(exchange.state_mut().ask_again(true), told && !answered);
            assert_eq!(exchange.state().is_pending(), !answered);
        }
        // One that is commanded in every tick is sent its next command.
        let mut exchange = exchange();
        send(&mut exchange).unwrap();
        exchange.state_mut().ask_again(false);
        assert_eq!(*exchange.state(), ExchangeState::Idle);
    }
}
