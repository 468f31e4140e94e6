//! Dialect D behind `SimSimulink`: the client polls flags, and actions are compared as doubles.
//!
//! Answers carry a flag in double 0 and the signals from double 1 on. Commands and answers have their signals in
//! the order of the control points ([`SignalOrder`]); this module's callers have them by quantity. The client asks again until a flag has the value it waits for, so an answer may say "not yet" at once, or be
//! held back until it can say "yes".

use super::action::{Action, Reading};
use super::course::Course;
use super::exchange::Debt;
use super::followed::Followed;
use super::inbox::{Carrier, Inbox};
use super::opening::{Came, NOT_READY, Opening};
use super::order::SignalOrder;
use super::sizes::{Counts, Interface, Sizes};
use super::vector::read_lead;
use crate::WireError;
use crate::bytes::{array, finite, put, put_doubles, same_length};

/// What came.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SimulinkEvent {
    /// Not a whole message yet.
    NeedMore,
    /// A UDP hello; `reply` holds the answer.
    Greeted,
    /// The sizes are known and fit.
    Ready(Sizes),
    /// A new target: it is held as the trial. Raise `newTarget`.
    Target(Course),
    /// 6: answer with [`Simulink::answer_signals`]; the flag is `atTarget`. Asked until it is 1.
    AtTarget,
    /// 4.1: answer with [`Simulink::answer_switch`]; the flag is `switchPC`. Asked until it is 1: target taken.
    TargetTaken,
    /// 4.2: take `newTarget` back. No answer.
    TargetDone,
    /// 4.3: answer with [`Simulink::answer_switch`]; the flag is `switchPC`. Asked until it is 0.
    SwitchedBack,
    /// The step is committed.
    Commit,
    /// 4 after 3, from versions up to 2.7, whose signals are those announced: nothing to do.
    Execute,
    /// An unknown action. It is not answered.
    Ignored(f64),
    /// The end; a second one is ignored.
    Finished,
}

/// A laboratory controller, as `SimSimulink` sees it.
#[derive(Debug)]
pub struct Simulink {
    opening: Opening,
    outbox: Vec<u8>,
    followed: Followed,
    order: Option<SignalOrder>,
    /// Places of the signals of a command and of an answer on the wire.
    ctrl_places: Vec<usize>,
    daq_places: Vec<usize>,
    /// OpenFresco up to 2.7 sends these signals in this order.
    suits_old_versions: bool,
    /// The last command with its signals by quantity.
    arranged: Vec<u8>,
    debt: Option<Debt>,
}

impl Simulink {
    /// A controller that waits for OpenFresco.
    #[must_use]
    pub fn new(carrier: Carrier, interface: Interface) -> Self {
        Self {
            opening: Opening::new(carrier, interface),
            outbox: Vec::new(),
            followed: Followed::new(Counts::default(), false),
            order: None,
            ctrl_places: Vec::new(),
            daq_places: Vec::new(),
            suits_old_versions: true,
            arranged: Vec::new(),
            debt: None,
        }
    }

    /// The order in which OpenFresco's control points have their signals. Without it a client with several quantities of
    /// several axes is refused.
    #[must_use]
    pub const fn in_order(mut self, order: Option<SignalOrder>) -> Self {
        self.order = order;
        self
    }

    /// Takes bytes up to the end of one message (of a datagram: all of them); returns how many were used and
    /// what they mean. Allocates only when the sizes arrive. Real-time: yes.
    ///
    /// # Errors
    /// Nonsense. The machine is failed then and stays so.
    pub fn feed(&mut self, bytes: &[u8]) -> Result<(usize, SimulinkEvent), WireError> {
        let outcome = self.step(bytes);
        if outcome.is_err() {
            self.opening.fail();
        }
        outcome
    }

    /// Bytes to send after the last event; empty for most.
    #[must_use]
    pub const fn reply(&self) -> &[u8] {
        self.opening.reply
    }

    /// The target and its course.
    #[must_use]
    pub const fn followed(&self) -> &Followed {
        &self.followed
    }

    /// Encodes the answer to 6: the flag `atTarget` and the measured `signals`, which are given by quantity. Real-time:
    /// yes.
    ///
    /// # Errors
    /// No such answer is owed, wrong number of signals, a number that is not finite.
    pub fn answer_signals(&mut self, at_target: bool, signals: &[f64]) -> Result<&[u8], WireError> {
        same_length("measured signals", self.daq_places.len(), signals.len())?;
        finite("measured signals", signals)?;
        self.settle(Debt::Signals)?;
        write_flag(&mut self.outbox, at_target)?;
        for (place, signal) in self.daq_places.iter().zip(signals) {
            put(&mut self.outbox, 8 * (1 + place), signal.to_le_bytes())?;
        }
        Ok(&self.outbox)
    }

    /// Encodes the answer to 4.1 or 4.3: the flag `switchPC`. Real-time: yes.
    ///
    /// # Errors
    /// No such answer is owed.
    pub fn answer_switch(&mut self, switched: bool) -> Result<&[u8], WireError> {
        self.settle(Debt::Switch)?;
        write_flag(&mut self.outbox, switched)?;
        Ok(&self.outbox)
    }

    /// The messages of the client.
    #[must_use]
    pub const fn inbox(&self) -> &Inbox {
        &self.opening.inbox
    }

    fn settle(&mut self, debt: Debt) -> Result<(), WireError> {
        if self.outbox.is_empty() {
            return Err(NOT_READY);
        }
        debt.settle(&mut self.debt)
    }

    fn step(&mut self, bytes: &[u8]) -> Result<(usize, SimulinkEvent), WireError> {
        let (used, came) = self.opening.take(bytes)?;
        let event = match came {
            Came::Nothing => SimulinkEvent::NeedMore,
            Came::Hello => SimulinkEvent::Greeted,
            Came::Stray(byte) => SimulinkEvent::Ignored(byte),
            Came::Sizes(sizes) => self.ready(sizes)?,
            Came::Vector => self.vector()?,
        };
        Ok((used, event))
    }

    fn ready(&mut self, sizes: Sizes) -> Result<SimulinkEvent, WireError> {
        // The flag precedes the signals.
        super::sizes::inside(
            "data size N",
            1 + sizes.daq().total(),
            super::MAX_DATA_SIZE,
            sizes.data_size() as i64,
        )?;
        let (ctrl, daq) = (sizes.ctrl(), sizes.daq());
        let ctrl_order = SignalOrder::of(self.order, ctrl)?;
        let daq_order = SignalOrder::of(self.order, daq)?;
        self.ctrl_places = ctrl_order.places(ctrl);
        self.daq_places = daq_order.places(daq);
        let is_plain = |counts: &Counts| counts.vel == 0 && counts.accel == 0;
        let is_by_quantity = [ctrl_order, daq_order] == [SignalOrder::ByQuantity; 2];
        self.suits_old_versions = is_plain(ctrl) && is_plain(daq) && is_by_quantity;
        self.arranged.resize(8 * (1 + ctrl.total()), 0);
        self.followed = Followed::new(*ctrl, false);
        self.outbox.resize(sizes.vector_len(), 0);
        self.opening.ready(&sizes);
        Ok(SimulinkEvent::Ready(sizes))
    }

    fn vector(&mut self) -> Result<SimulinkEvent, WireError> {
        let vector = self.opening.vector();
        let code = read_lead(vector)?;
        Ok(match Action::exact(code)? {
            Some(Action::Trial) => {
                for (signal, place) in self.ctrl_places.iter().enumerate() {
                    let word: [u8; 8] = array(vector, 8 * (1 + place))?;
                    put(&mut self.arranged, 8 * (1 + signal), word)?;
                }
                SimulinkEvent::Target(self.followed.command("target", &self.arranged)?)
            }
            Some(Action::Read(Reading::All)) => {
                self.debt = Some(Debt::Signals);
                SimulinkEvent::AtTarget
            }
            Some(Action::TargetTaken) => {
                self.debt = Some(Debt::Switch);
                SimulinkEvent::TargetTaken
            }
            Some(Action::TargetDone) => SimulinkEvent::TargetDone,
            Some(Action::SwitchedBack) => {
                self.debt = Some(Debt::Switch);
                SimulinkEvent::SwitchedBack
            }
            Some(Action::Commit) => {
                // The commit has no time field.
                self.followed.commit(self.followed.time());
                SimulinkEvent::Commit
            }
            Some(Action::Execute) if self.suits_old_versions => SimulinkEvent::Execute,
            Some(Action::Execute) => return Err(WireError::OldSimulink),
            Some(Action::Die) => {
                self.opening.finish();
                SimulinkEvent::Finished
            }
            _ => SimulinkEvent::Ignored(code),
        })
    }
}

/// The flag and zeros.
fn write_flag(out: &mut [u8], flag: bool) -> Result<(), WireError> {
    let flag = if flag { 1.0 } else { 0.0 };
    out.fill(0);
    put_doubles(out, 0, &[flag])
}
