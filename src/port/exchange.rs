//! The exchange with one substructure: who answers, what is owed, and what was counted.
//!
//! One enum says what stands between the loop and the partner. A partner that is commanded once a step goes from `Pending` (its
//! target is known) to `Awaiting` (it was told) to `Idle` (it has answered). Every other command goes from `Idle` to `Awaiting`
//! and back within one tick. An answer that is still owed when the test ends is `Overdue`: the partner hears nothing before it
//! has come. A partner that is `Lost` is not commanded any more. Invariant: no command leaves to a partner that is lost or
//! overdue. Limits: it knows no clock; the loop gives the times.

use super::link_numbers::LinkNumbers;
use crate::state::Visit;
use crate::substructure::{
    Command, Coupling, Freshness, Holder, Introduction, LinkFault, LinkStats, Measurement,
    Retirement, Substructure, Unavailable,
};
use crate::time::Nanos;

/// What went over one link.
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
    /// What the link itself counts.
    pub stats: LinkStats,
}

/// What is done with a stale force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnStale {
    /// The loop uses it as it is.
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
    /// What is done with a stale force.
    pub on_stale: OnStale,
    /// Stale measurements in a row after which the test stops.
    pub stale_in_a_row: u64,
}

/// Why a partner is lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Loss {
    /// The loop does not command it any more; its link may live.
    Distrusted,
    /// Its link is gone: nothing is known of it.
    Gone,
}

/// What a partner of whole steps has to be told, or has to answer, besides the command in force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Owed {
    Nothing,
    /// Its target: it was not told.
    Target,
    /// Its answer: it was told.
    Answer,
}

/// What stands between the loop and the partner.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Nothing is owed.
    Idle,
    /// The target of the step is known and was not sent.
    Pending,
    /// A command has left, and its answer was not taken.
    Awaiting {
        /// When the loop first looked for the answer; none before.
        since: Option<Nanos>,
        /// The target of the step is still to be sent after the answer: the command was not that target.
        target_follows: bool,
    },
    /// The test has ended before the answer was here.
    Overdue {
        /// As in [`State::Awaiting`].
        since: Option<Nanos>,
    },
    /// The overdue answer came in this tick.
    Answered,
    /// The partner is not commanded any more.
    Lost {
        cause: Loss,
        /// What was owed then: a test that is resumed tells the target again.
        owed: Owed,
    },
}

impl State {
    const fn owed(self) -> Owed {
        match self {
            Self::Idle | Self::Answered => Owed::Nothing,
            Self::Pending
            | Self::Awaiting {
                target_follows: true,
                ..
            } => Owed::Target,
            Self::Awaiting { .. } | Self::Overdue { .. } => Owed::Answer,
            Self::Lost { owed, .. } => owed,
        }
    }
}

/// The exchange with one substructure.
pub(super) struct Exchange {
    substructure: Box<dyn Substructure>,
    is_recording: bool,
    state: State,
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

impl LinkCount {
    /// Visits what was counted here. What the link itself counts belongs to the link. Real-time: yes.
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        for count in [
            &mut self.sent,
            &mut self.received,
            &mut self.stale,
            &mut self.unsettled,
            &mut self.holds,
        ] {
            visit.count(count);
        }
    }
}

impl Exchange {
    pub fn new(substructure: Box<dyn Substructure>) -> Self {
        Self {
            substructure,
            is_recording: false,
            state: State::Idle,
            numbers: LinkNumbers::default(),
            count: LinkCount::default(),
            wait: None,
            has_answered: false,
            stale: 0,
            holding: 0,
        }
    }

    /// Visits what is owed and counted, and a specimen that is computed in this process. A state is taken when no answer is owed: a
    /// target may be pending. Real-time: yes.
    pub fn visit_state(&mut self, visit: &mut dyn Visit) {
        visit.part("exchange");
        let mut is_pending = self.is_pending();
        if !is_pending && self.state != State::Idle {
            visit.refuse();
        }
        visit.flag(&mut is_pending);
        if visit.restores() {
            self.state = if is_pending {
                State::Pending
            } else {
                State::Idle
            };
        }
        let is_elsewhere = self.is_remote() || self.is_recording;
        self.numbers.visit_state(is_elsewhere, visit);
        self.count.visit_state(visit);
        visit.flag(&mut self.has_answered);
        visit.count(&mut self.stale);
        visit.count(&mut self.holding);
        if !self.substructure.visit_state(visit) && !is_elsewhere {
            visit.refuse();
        }
    }

    /// A recording answers in place of the substructure: it knows the numbers of the test only.
    pub fn put_recording(&mut self, recording: Box<dyn Substructure>) {
        self.substructure = recording;
        self.is_recording = true;
    }

    /// The same exchange with something round its substructure.
    pub fn wrapped(
        mut self,
        wrap: impl FnOnce(Box<dyn Substructure>) -> Box<dyn Substructure>,
    ) -> Self {
        self.substructure = wrap(self.substructure);
        self
    }

    /// Goes on with the live partner of `fresh` in place of a recording; a formula stays. Counts begin anew, and nothing is lost.
    /// True if another partner answers now.
    pub fn go_live(&mut self, fresh: Self) -> bool {
        let is_new = fresh.substructure.is_remote();
        if is_new {
            self.substructure = fresh.substructure;
            self.is_recording = false;
            self.numbers.restart();
        }
        // Times and counts in a row are of the clock of another test.
        self.count = LinkCount::default();
        (self.has_answered, self.stale, self.holding) = (false, 0, 0);
        self.state = match self.state.owed() {
            Owed::Nothing => State::Idle,
            Owed::Target => State::Pending,
            Owed::Answer => State::Awaiting {
                since: None,
                target_follows: false,
            },
        };
        is_new
    }

    #[inline]
    pub fn coupling(&self) -> Coupling {
        self.substructure.coupling()
    }

    #[inline]
    pub fn is_remote(&self) -> bool {
        self.substructure.is_remote()
    }

    #[inline]
    pub const fn is_recording(&self) -> bool {
        self.is_recording
    }

    /// True if its answer has to be waited for: it comes from outside this process. A recording says whether it was.
    #[inline]
    pub fn is_awaited(&self) -> bool {
        (self.is_remote() || self.is_recording) && self.coupling() == Coupling::Lockstep
    }

    /// A command has left, and its answer was not taken. Real-time: yes.
    #[inline]
    pub const fn owes(&self) -> bool {
        matches!(self.state.owed(), Owed::Answer) || matches!(self.state, State::Awaiting { .. })
    }

    /// The target of the step is known and was not sent. Real-time: yes.
    #[inline]
    pub const fn is_pending(&self) -> bool {
        matches!(self.state, State::Pending)
    }

    #[inline]
    pub const fn is_lost(&self) -> bool {
        matches!(self.state, State::Lost { .. })
    }

    #[inline]
    pub const fn is_gone(&self) -> bool {
        matches!(
            self.state,
            State::Lost {
                cause: Loss::Gone,
                ..
            }
        )
    }

    /// It owed an answer when the test ended, and is told nothing until the tick after that has come. Real-time: yes.
    #[inline]
    pub const fn owes_the_last(&self) -> bool {
        matches!(self.state, State::Overdue { .. } | State::Answered)
    }

    /// It may be commanded. Real-time: yes.
    #[inline]
    pub const fn is_heard(&self) -> bool {
        !self.is_lost() && !self.owes_the_last()
    }

    /// The target of a step is known. Real-time: yes.
    #[inline]
    pub const fn pend(&mut self) {
        match &mut self.state {
            State::Lost { owed, .. } => *owed = Owed::Target,
            state => *state = State::Pending,
        }
    }

    /// The target of a step was told, and the answer to the command in force is the answer to it. Real-time: yes.
    #[inline]
    pub const fn told_the_target(&mut self) {
        if let State::Awaiting { target_follows, .. } = &mut self.state {
            *target_follows = false;
        }
    }

    /// The interrupted test goes on: a partner of whole steps is told its target again unless it has answered it. True if the
    /// partner had been told it before.
    pub fn ask_again(&mut self, per_step: bool) -> bool {
        let owed = self.state.owed();
        self.state = if per_step && owed != Owed::Nothing {
            State::Pending
        } else {
            State::Idle
        };
        owed == Owed::Answer
    }

    /// The test is over: an answer that is owed now is overdue.
    pub const fn end_test(&mut self) {
        if let State::Awaiting { since, .. } = self.state {
            self.state = State::Overdue { since };
        }
    }

    /// A tick of the shutdown is over: an overdue answer that came in it is not waited for any more. Real-time: yes.
    pub const fn close_tick_of_shutdown(&mut self) {
        if matches!(self.state, State::Answered) {
            self.state = State::Idle;
        }
    }

    /// The partner is not commanded any more. Real-time: yes.
    pub fn lose(&mut self, loss: Loss) {
        let cause = if self.is_gone() { Loss::Gone } else { loss };
        self.state = State::Lost {
            cause,
            owed: self.state.owed(),
        };
    }

    /// When the loop first looked for the answer that is owed; none if it is not owed, or was not looked for. Real-time: yes.
    #[inline]
    pub const fn asked_at(&self) -> Option<Nanos> {
        match self.state {
            State::Awaiting { since, .. } | State::Overdue { since } => since,
            _ => None,
        }
    }

    /// The same; the loop looks for it now, if it has not before. Real-time: yes.
    #[inline]
    pub fn look_for_answer(&mut self, now: Nanos) -> Nanos {
        match &mut self.state {
            State::Awaiting { since, .. } | State::Overdue { since } => *since.get_or_insert(now),
            _ => now,
        }
    }

    /// Sends a command that has this number in the test, unless the partner is lost or overdue. Real-time: yes.
    #[inline]
    pub fn send(
        &mut self,
        sequence: u64,
        [time, dt]: [f64; 2],
        [disp, vel]: [&[f64]; 2],
    ) -> Result<(), LinkFault> {
        if !self.is_heard() {
            return Err(LinkFault::Refused);
        }
        self.count.sent += 1;
        let command = Command {
            sequence: self.numbers.number(sequence),
            time,
            dt,
            disp,
            vel,
        };
        self.substructure.issue(&command)?;
        self.state = State::Awaiting {
            since: None,
            target_follows: matches!(self.state.owed(), Owed::Target),
        };
        Ok(())
    }

    /// Takes the answer into `incoming`, which holds the newest one that is known. Real-time: yes.
    #[inline]
    pub fn collect(
        &mut self,
        deadline: Nanos,
        incoming: &mut Measurement,
    ) -> Result<Freshness, LinkFault> {
        incoming.sequence = self.numbers.on_link(incoming.sequence);
        let answer = self.substructure.collect(deadline, incoming);
        incoming.sequence = self.numbers.in_test(incoming.sequence);
        answer
    }

    /// The answer was taken; a stale one stands for a fresh one that stayed away. One that is not finite answers nothing. Real-time: yes.
    #[inline]
    pub const fn note_answer(&mut self, is_fresh: bool, is_finite: bool) {
        if is_fresh {
            self.count.received += 1;
            self.has_answered = true;
        } else {
            self.count.stale += 1;
        }
        if !is_finite {
            return;
        }
        self.state = match self.state {
            State::Awaiting {
                target_follows: true,
                ..
            } => State::Pending,
            State::Awaiting { .. } => State::Idle,
            State::Overdue { .. } => State::Answered,
            other => other,
        };
    }

    /// The force of an answer that was lost and came with a later one; the number of its command in the test. Real-time: yes.
    pub fn recover(&mut self, force: &mut [f64]) -> Option<u64> {
        let number = self.substructure.recover(force)?;
        Some(self.numbers.in_test(number))
    }

    /// The command of this number is accepted, or the last one of a partner that was told its target some ticks ago. Real-time:
    /// yes.
    #[inline]
    pub fn accepted(&mut self, sequence: u64, per_step: bool) -> Result<(), LinkFault> {
        let sequence = if per_step {
            self.numbers.sent()
        } else {
            sequence
        };
        self.substructure.accepted(self.numbers.on_link(sequence))
    }

    /// The last exchange was not part of the test: the numbers of the test go on without it. Real-time: yes.
    pub const fn skip_number(&mut self) {
        if !self.is_recording {
            self.numbers.go_ahead();
        }
    }

    /// A tick passes without a command. Real-time: yes.
    pub const fn skip_command(&mut self) {
        if !self.is_recording {
            self.numbers.fall_behind();
        }
    }

    /// The next command is another one than the one of this number, which may have left: then that was accepted.
    pub fn leave_number(&mut self, sequence: u64) {
        if self.numbers.was_issued(sequence) {
            if !self.owes() {
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
    pub fn ask_to_arm(&mut self, sequence: u64, command: &[f64]) -> Result<(), LinkFault> {
        self.substructure
            .ask_to_arm(self.numbers.first(sequence), command)
    }

    /// The last agreement before commands move the specimen; false if it was not `wanted` any more.
    pub fn arm(
        &mut self,
        sequence: u64,
        command: &[f64],
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, LinkFault> {
        self.has_answered = false;
        let number = self.numbers.first(sequence);
        self.substructure.arm(number, command, wanted)
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
    pub fn pause(&mut self) -> Result<(), LinkFault> {
        self.substructure.pause()
    }

    /// The specimen stops where it is. A link that is lost shows with the next command.
    pub fn halt(&mut self) {
        if self.has_begun() {
            let _ = self.substructure.halt();
        }
    }

    /// Says goodbye.
    pub fn retire(&mut self, how: Retirement) {
        self.substructure.retire(how);
    }

    /// Whether the goodbye was acknowledged; none of a partner that need not acknowledge it.
    pub fn has_acknowledged(&self) -> Option<bool> {
        self.substructure.has_acknowledged()
    }

    pub fn last_words(&self) -> Option<String> {
        self.substructure.last_words()
    }

    pub fn complaint(&self) -> Option<String> {
        self.substructure.complaint()
    }

    pub fn holder(&self) -> Holder {
        self.substructure.holder()
    }

    /// True if a command has left.
    pub const fn has_begun(&self) -> bool {
        self.count.sent > 0
    }

    /// What was counted here, without what the link itself counts. Real-time: yes.
    #[inline]
    pub const fn count(&self) -> &LinkCount {
        &self.count
    }

    /// Everything that was counted.
    pub fn full_count(&self) -> LinkCount {
        LinkCount {
            stats: self.substructure.stats(),
            ..self.count
        }
    }

    pub const fn wait(&self) -> Option<WaitRules> {
        self.wait
    }

    pub const fn set_wait(&mut self, wait: Option<WaitRules>) {
        self.wait = wait;
    }

    #[inline]
    pub const fn has_answered(&self) -> bool {
        self.has_answered
    }

    /// From here on the specimen counts as one that has answered.
    pub const fn take_for_answered(&mut self) {
        self.has_answered = true;
    }

    #[inline]
    pub const fn stale_in_a_row(&self) -> u64 {
        self.stale
    }

    /// One more stale measurement; how many there are in a row. Real-time: yes.
    pub const fn count_stale(&mut self) -> u64 {
        self.stale += 1;
        self.stale
    }

    #[inline]
    pub const fn forget_stale(&mut self) {
        self.stale = 0;
    }

    #[inline]
    pub const fn holding_in_a_row(&self) -> u64 {
        self.holding
    }

    pub const fn set_holding_in_a_row(&mut self, answers: u64) {
        self.holding = answers;
    }

    /// The specimen begins a hold by its own watchdog. Real-time: yes.
    pub const fn count_hold(&mut self) {
        self.count.holds += 1;
    }

    /// One more measurement whose iteration did not converge; how many there are. Real-time: yes.
    pub const fn count_unsettled(&mut self) -> u64 {
        self.count.unsettled += 1;
        self.count.unsettled
    }
}
