//! The operator's view of the test and his requests: phase, hold, confirmation.
//!
//! A hold is not a maneuver. It stretches the time of a motion (wiring check, static load, ramp, steps), which continues after it.
//! Zeroing, warm-up and shutdown are not stretched: specimens rest in the first two, and nothing interrupts the third.

use std::time::Duration;

use super::operator::{Client, Control, Notice, Operator, Requests};
use super::phase::{Glimpse, Phase};
use gusset_quantity::state;
use gusset_quantity::state::{Stateful, Visit};
use gusset_quantity::substructure::LISTEN_NS;

/// The operator's hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Hold {
    #[default]
    Off,
    Wanted,
}

impl Stateful for Hold {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        let mut is_wanted = match self {
            Self::Off => false,
            Self::Wanted => true,
        };
        visit.flag(&mut is_wanted);
        *self = if is_wanted { Self::Wanted } else { Self::Off };
    }
}

/// Whether the operator must confirm the sensor readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Confirmation {
    #[default]
    NotAsked,
    Awaited,
}

/// How the current tick moves the specimens, as far as the operator sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Motion {
    #[default]
    Moves,
    Still,
}

/// Whether requests of the operator are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Hearing {
    On,
    /// The replay of a test that did not record these ticks: nothing was asked in them.
    Off,
}

/// The operator's line and what is shown on it.
pub(super) struct Supervision {
    control: Control,
    requests: Requests,
    hearing: Hearing,
    phase: Phase,
    hold: Hold,
    /// Number of the latest hold, from 1.
    hold_number: u32,
    /// The operator said in this tick that the test continues.
    continues: bool,
    confirmation: Confirmation,
    motion: Motion,
    /// The test is a motion that goes back to its start when it is interrupted.
    retraces: bool,
    /// It was interrupted, and goes back.
    goes_back: bool,
}

// A state is taken in the running test, where nothing is to be confirmed.
state! {
    Supervision { hold, hold_number }
    keeps {
        control, requests, hearing, phase, continues, confirmation, motion, retraces, goes_back
    }
}

impl Supervision {
    /// A connected test without a hold.
    pub(crate) fn new(control: Control) -> Self {
        Self {
            control,
            requests: Requests::default(),
            hearing: Hearing::On,
            phase: Phase::Connected,
            hold: Hold::Off,
            hold_number: 0,
            continues: false,
            confirmation: Confirmation::NotAsked,
            motion: Motion::Moves,
            retraces: false,
            goes_back: false,
        }
    }

    /// The test is a motion that goes back to its start when it is interrupted.
    pub(crate) const fn set_retraces(&mut self, retraces: bool) {
        self.retraces = retraces;
    }

    /// True of a test that goes back to its start when it is interrupted.
    pub(crate) const fn retraces(&self) -> bool {
        self.retraces
    }

    /// True if the motion of this phase goes back to its start when it is interrupted. Real-time: yes.
    pub(crate) fn can_go_back(&self) -> bool {
        let is_drive = self.retraces && matches!(self.phase, Phase::Running | Phase::Holding);
        !self.goes_back && (is_drive || self.phase == Phase::Probing)
    }

    /// The motion goes back to its start. No hold is left. Real-time: yes.
    pub(crate) fn begin_going_back(&mut self) {
        self.goes_back = true;
        self.drop_hold();
    }

    /// True if the motion was interrupted and goes back to its start. Real-time: yes.
    pub(crate) const fn goes_back(&self) -> bool {
        self.goes_back
    }

    /// The operator's line.
    pub(crate) const fn control(&self) -> &Control {
        &self.control
    }

    /// Puts another operator in place.
    pub(crate) fn attend(&mut self, control: Control) {
        self.control = control;
    }

    /// The phase. Real-time: yes.
    #[inline]
    pub(crate) const fn phase(&self) -> Phase {
        self.phase
    }

    /// Enters a phase; returns the one before. Real-time: yes.
    pub(crate) fn enter(&mut self, phase: Phase) -> Phase {
        let from = self.phase;
        debug_assert!(from.may_become(phase), "{from:?} to {phase:?}");
        self.phase = phase;
        if phase != Phase::Zeroing {
            // The question about the readings is over.
            self.confirm();
        }
        self.show();
        from
    }

    /// A restored test runs.
    pub(crate) fn continue_running(&mut self) {
        self.phase = Phase::Running;
        self.show();
    }

    /// Shows the test on the operator's line. Real-time: yes.
    pub(crate) fn show(&self) {
        let still = self.motion == Motion::Still;
        self.control.phase.show(Glimpse {
            phase: self.phase,
            hold: self.is_held(),
            unconfirmed: self.is_unconfirmed(),
            hold_number: self.hold_number,
            stands: still || matches!(self.phase, Phase::Armed | Phase::Holding),
        });
    }

    /// True while the operator wants a hold. Real-time: yes.
    #[inline]
    pub(crate) fn is_held(&self) -> bool {
        self.hold == Hold::Wanted
    }

    /// Number of the latest hold, from 1; 0 before the first.
    pub(crate) const fn hold_number(&self) -> u32 {
        self.hold_number
    }

    /// Begins a hold; false if there is one. Real-time: yes.
    pub(crate) fn begin_hold(&mut self) -> bool {
        if self.is_held() {
            return false;
        }
        self.hold = Hold::Wanted;
        self.hold_number = self.hold_number.saturating_add(1);
        true
    }

    /// The test continues; false if there was no hold. Real-time: yes.
    pub(crate) fn end_hold(&mut self) -> bool {
        let was_held = self.is_held();
        self.hold = Hold::Off;
        self.continues = true;
        was_held
    }

    /// The shutdown is not held.
    pub(crate) fn drop_hold(&mut self) {
        self.hold = Hold::Off;
    }

    /// The operator said in this tick that the test continues. Real-time: yes.
    #[inline]
    pub(crate) const fn continues(&self) -> bool {
        self.continues
    }

    /// A tick begins. Real-time: yes.
    #[inline]
    pub(crate) fn begin_tick(&mut self, is_still: bool) {
        self.continues = false;
        self.motion = if is_still {
            Motion::Still
        } else {
            Motion::Moves
        };
    }

    /// The wait for the edge is over. Real-time: yes.
    #[inline]
    pub(crate) fn end_wait(&mut self) {
        self.motion = Motion::Moves;
    }

    /// Asks for a confirmation of the sensor readings.
    pub(crate) fn ask_for_confirmation(&mut self) {
        self.confirmation = Confirmation::Awaited;
        self.show();
    }

    /// Waits until the operator confirms that the specimens are unloaded, which torque or outputs hold. Nothing else ends the wait.
    pub(crate) fn await_release(&mut self) {
        self.requests.clear();
        self.ask_for_confirmation();
        let _ = self.control.notices.try_send(Notice::AwaitingRelease);
        while self.is_unconfirmed() {
            let most = Duration::from_nanos(LISTEN_NS);
            self.requests.wait(&self.control, most);
            if self.requests.take(&self.control) == Some(Operator::Confirm) {
                self.confirm();
            }
        }
        self.show();
    }

    /// True while the confirmation is awaited. Real-time: yes.
    #[inline]
    pub(crate) fn is_unconfirmed(&self) -> bool {
        self.confirmation == Confirmation::Awaited
    }

    /// The operator confirms; false if nothing was asked. Real-time: yes.
    pub(crate) fn confirm(&mut self) -> bool {
        let was_asked = self.is_unconfirmed();
        self.confirmation = Confirmation::NotAsked;
        was_asked
    }

    /// Requests of the operator are taken from here on, or not. Real-time: yes.
    pub(crate) fn hears(&mut self, hears: bool) {
        self.hearing = if hears { Hearing::On } else { Hearing::Off };
    }

    /// Drops requests that were not taken.
    pub(crate) fn forget_requests(&mut self) {
        self.requests.clear();
    }

    /// Asks another controller, and takes its word like one of the operator.
    pub(crate) fn hear_client(&mut self, client: &mut Client<'_>) {
        if let Some(word) = client() {
            self.requests.add(word);
        }
    }

    /// The next request, which leaves the queue. Real-time: yes.
    #[inline]
    pub(crate) fn take_request(&mut self) -> Option<Operator> {
        match self.hearing {
            Hearing::On => self.requests.take(&self.control),
            Hearing::Off => None,
        }
    }

    /// The next request, which stays in the queue.
    pub(crate) fn next_request(&mut self) -> Option<Operator> {
        match self.hearing {
            Hearing::On => self.requests.next(&self.control),
            Hearing::Off => None,
        }
    }

    /// True if a stop was asked for; it leaves the queue, and what was asked before it. Real-time: yes.
    pub(crate) fn takes_a_stop(&mut self) -> bool {
        self.hearing == Hearing::On && self.requests.takes_an_end(&self.control, false)
    }

    /// True if a stop was asked for while a reply is awaited: a specimen that is to go back replies first. Real-time: yes.
    pub(crate) fn takes_a_stop_in_wait(&mut self) -> bool {
        let first_waits = self.can_go_back();
        self.hearing == Hearing::On && self.requests.takes_an_end(&self.control, first_waits)
    }

    /// On simulated time a test that stands until the operator speaks would make millions of rows: it waits for him a while.
    pub(crate) fn wait_where_it_stands(&mut self) {
        let stands = self.motion == Motion::Still || self.phase == Phase::Holding;
        let is_waiting = stands && (self.is_unconfirmed() || self.is_held());
        if is_waiting && self.control.request_socket.is_some() && self.hearing == Hearing::On {
            let most = Duration::from_nanos(LISTEN_NS);
            self.requests.wait(&self.control, most);
        }
    }
}
