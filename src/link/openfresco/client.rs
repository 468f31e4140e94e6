//! Our controller as a client: dialects A, B and C behind the hinge.
//!
//! Coupling is lockstep: each command needs one answer. Nothing has a sequence number, so nothing may be lost or late.
//! Command and request leave in one write. Each wait ends at the time limit of [`RemoteSettings`], on the wall clock of
//! the socket: the engine's deadline is on the engine's clock, which may be simulated. Nothing is allocated for an
//! exchange.
//!
//! Not here: the meaning of the numbers for the structure, and reactions to a fault; a fault is final.

mod opening;

use super::asking::{Asking, Came, Echo, machine, send, transport};
use super::below::Below;
use super::error::{Lost, RemoteError};
use super::settings::RemoteSettings;
use crate::Transport;
use crate::socket::LOOK;
use gusset_quantity::substructure::{
    Command, Freshness, Introduction, LinkFault, Measurement, Retirement, Substructure, Unavailable,
};
use gusset_quantity::time::Nanos;
use gusset_record::rt::os;
use gusset_wire::not_foreign;
use gusset_wire::openfresco::Peer;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    New,
    Idle,
    Issued,
    Answered,
    Committed,
    Retired,
    Faulted(LinkFault),
}

/// Longest chunk that is read at once; no datagram is longer.
const CHUNK: usize = 65_536;
/// Longest wait for the answer to a goodbye.
const FAREWELL_NS: u64 = 1_000_000_000;

/// A specimen behind OpenFresco or OpenSees. Coupling: lockstep.
pub struct Remote {
    settings: RemoteSettings,
    link: Option<Box<dyn Transport>>,
    machine: Asking,
    buffer: Vec<u8>,
    phase: Phase,
    sequence: u64,
    time: f64,
    echo: Echo,
    sent_at: Nanos,
    reply_limit_ns: u64,
    initial_stiffness: Option<Vec<f64>>,
    /// Measurement of a server before the first command.
    standing: Option<(Vec<f64>, Vec<f64>)>,
    complaint: Option<Lost>,
    below: Below,
}

impl std::fmt::Debug for Remote {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Remote")
            .field("machine", &self.machine)
            .field("phase", &self.phase)
            .finish_non_exhaustive()
    }
}

impl Remote {
    /// A specimen that is not connected yet.
    ///
    /// # Errors
    /// Settings that cannot be: see [`RemoteError::Setting`] and [`RemoteError::Wire`].
    pub fn new(settings: RemoteSettings) -> Result<Self, RemoteError> {
        for (name, found) in [
            ("connect_timeout_s", settings.connect_limit_s),
            ("reply_timeout_s", settings.reply_limit_s),
        ] {
            if !(found > 0.0 && found <= 1e6) {
                return Err(RemoteError::Setting {
                    name,
                    found,
                    allowed: "greater than 0 and at most 1e6 s",
                });
            }
        }
        let machine = machine(&settings).map_err(|source| RemoteError::Wire {
            address: settings.address.clone(),
            what: "the settings",
            source,
        })?;
        Ok(Self {
            link: None,
            machine,
            buffer: vec![0; CHUNK],
            phase: Phase::New,
            sequence: 0,
            time: 0.0,
            echo: Echo::default(),
            sent_at: Nanos(0),
            reply_limit_ns: (settings.reply_limit_s * 1e9) as u64,
            initial_stiffness: None,
            standing: None,
            complaint: None,
            below: Below::default(),
            settings,
        })
    }

    /// Connects and sets everything up. Reads the initial stiffness of an element server, and the position of the
    /// specimen from every server. Nothing moves.
    ///
    /// # Errors
    /// See [`RemoteError`].
    pub fn open(&mut self) -> Result<(), RemoteError> {
        let until = Nanos(os::monotonic_ns()).plus((self.settings.connect_limit_s * 1e9) as u64);
        self.link = Some(transport(&self.settings, until)?);
        let mut done = self.set_up(until);
        if done.is_ok() && self.settings.peer == Peer::Element {
            done = self.ask_stiffness(until);
        }
        if done.is_ok() && self.settings.reports_position() {
            done = self.ask_standing(until);
        }
        self.below.ask(self.link.as_deref());
        done.map_err(|error| self.below.explain(error, self.settings.tls.is_none()))?;
        self.phase = Phase::Idle;
        Ok(())
    }

    /// Initial stiffness as an element server reports it, n × n by rows, in the specimen's units.
    #[must_use]
    pub fn initial_stiffness(&self) -> Option<&[f64]> {
        self.initial_stiffness.as_deref()
    }

    fn send_raw(&mut self, bytes: &[u8]) -> Result<(), LinkFault> {
        let link = self.link.as_mut().ok_or(LinkFault::Closed)?;
        send(link.as_mut(), self.settings.carrier, bytes, bytes.len())
    }

    /// Reads until something whole has come. Real-time: yes, after the set-up.
    fn hear(&mut self, until: Nanos) -> Result<Came, Lost> {
        let link = self.link.as_mut().ok_or(LinkFault::Closed)?;
        let mut came = Came::Nothing;
        while came == Came::Nothing {
            let Some(count) = link.recv(&mut self.buffer, until)? else {
                return Err(Lost::Link(LinkFault::Timeout));
            };
            let bytes = self.buffer.get(..count).unwrap_or_default();
            self.below.follow(bytes);
            if self.phase == Phase::New {
                not_foreign(bytes)?;
            }
            let carrier = self.settings.carrier;
            came = self.machine.digest(link.as_mut(), carrier, bytes)?;
        }
        Ok(came)
    }

    /// Answers have no numbers: one that is here before it was asked for (sent twice, or doubled by the network) would be
    /// taken for the next, and from then on every force would be one step old without a sign of it. Real-time: yes.
    fn nothing_unasked(&mut self) -> Result<(), Lost> {
        let link = self.link.as_mut().ok_or(LinkFault::Closed)?;
        let Some(count) = link.recv(&mut self.buffer, LOOK)? else {
            return Ok(());
        };
        let bytes = self.buffer.get(..count).unwrap_or_default();
        let carrier = self.settings.carrier;
        // The machine refuses all but a greeting's answer that came twice.
        self.machine
            .digest(link.as_mut(), carrier, bytes)
            .map(|_| ())
    }

    fn fault(&mut self, lost: impl Into<Lost>) -> LinkFault {
        let lost = lost.into();
        self.complaint = Some(lost);
        self.below.ask(self.link.as_deref());
        self.phase = Phase::Faulted(lost.fault());
        lost.fault()
    }

    fn exchange_out(&mut self, command: &Command<'_>) -> Result<(), Lost> {
        let link = self.link.as_mut().ok_or(LinkFault::Closed)?;
        let (bytes, message) = self.machine.command(command)?;
        Ok(send(link.as_mut(), self.settings.carrier, bytes, message)?)
    }

    fn commit_out(&mut self) -> Result<(), Lost> {
        let link = self.link.as_mut().ok_or(LinkFault::Closed)?;
        let bytes = self.machine.commit(self.time)?;
        Ok(send(
            link.as_mut(),
            self.settings.carrier,
            bytes,
            bytes.len(),
        )?)
    }

    /// The goodbye: 99, whose answer is waited for only in dialect B. OpenFresco sends it twice in dialect C, where the
    /// far end has closed after the first.
    fn say_goodbye(&mut self) -> Result<(), Lost> {
        let link = self.link.as_mut().ok_or(LinkFault::Closed)?;
        let (bytes, answered) = self.machine.die()?;
        send(link.as_mut(), self.settings.carrier, bytes, bytes.len())?;
        let until = Nanos(os::monotonic_ns()).plus(FAREWELL_NS);
        while answered && self.hear(until)? != Came::Farewell {}
        Ok(())
    }
}

impl Substructure for Remote {
    fn axes(&self) -> usize {
        self.settings.axes
    }

    fn is_remote(&self) -> bool {
        true
    }

    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        self.open().map_err(|error| Unavailable {
            fault: error.fault(),
            text: error.to_string(),
        })?;
        let RemoteSettings {
            peer,
            address,
            axes,
            ..
        } = &self.settings;
        // This is the wire's matrix by rows.
        let rows = self.initial_stiffness.as_deref().unwrap_or_default();
        let (standing, force) = self
            .standing
            .as_ref()
            .map(|(disp, force)| (disp, force))
            .unzip();
        let mut warnings = Vec::new();
        if standing.is_none() {
            warnings.push(format!(
                "{address}: this protocol cannot tell where the specimen stands before its first command"
            ));
        }
        let measures_disp = self.settings.measures_disp();
        if !measures_disp {
            warnings.push(format!(
                "{address}: the server gives forces only, so the record repeats the command as the measured displacement"
            ));
        }
        let column = |j: usize| rows.iter().skip(j).step_by((*axes).max(1));
        Ok(Introduction {
            peer: format!("{peer} at {address}, {}", self.settings.carrier_name()),
            stiffness: (0..*axes).flat_map(column).copied().collect(),
            standing: standing.cloned().unwrap_or_default(),
            measured: true,
            force: force.cloned().unwrap_or_default(),
            warnings,
            simulated: false,
            keeps_state: false,
            repeats_the_command: !measures_disp,
        })
    }

    fn complaint(&self) -> Option<String> {
        let lost = self.complaint?;
        if let Some(text) = self.below.text(self.settings.tls.is_none()) {
            return Some(format!("{}: {text}", self.settings.address));
        }
        Some(match lost {
            Lost::Link(LinkFault::Timeout) => {
                let seconds = self.settings.reply_limit_s;
                format!(
                    "{} did not answer within {seconds} s",
                    self.settings.address
                )
            }
            Lost::Link(fault) => format!("{}: {fault}", self.settings.address),
            Lost::Wire(error) => format!("{}: {error}", self.settings.address),
        })
    }

    /// Refused: a command before the last answer, and one after the end. A command whose sequence number was answered
    /// already moves nothing.
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        match self.phase {
            Phase::Faulted(fault) => return Err(fault),
            Phase::New | Phase::Issued | Phase::Retired => {
                return Err(self.fault(LinkFault::Refused));
            }
            Phase::Answered | Phase::Committed if command.sequence == self.sequence => {
                return Ok(());
            }
            Phase::Idle | Phase::Answered | Phase::Committed => {}
        }
        self.sequence = command.sequence;
        self.time = command.time;
        let sent = self
            .nothing_unasked()
            .and_then(|()| self.exchange_out(command));
        if let Err(lost) = sent {
            return Err(self.fault(lost));
        }
        self.sent_at = Nanos(os::monotonic_ns());
        self.phase = Phase::Issued;
        Ok(())
    }

    /// Waits up to the time limit of a reply, whatever the engine's deadline is: an unanswered command must not be
    /// abandoned.
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        match self.phase {
            Phase::Faulted(fault) => return Err(fault),
            Phase::New | Phase::Idle | Phase::Retired => return Err(LinkFault::Timeout),
            Phase::Issued => {
                let until = self.sent_at.plus(self.reply_limit_ns);
                loop {
                    match self.hear(until) {
                        Ok(Came::Signals) => break,
                        Ok(_) => {}
                        Err(lost) => return Err(self.fault(lost)),
                    }
                }
                self.phase = Phase::Answered;
            }
            Phase::Answered | Phase::Committed => {}
        }
        let filled = self.machine.measurement(into);
        match filled.and_then(|()| self.echo.check(self.time, into.time)) {
            Ok(()) => {
                into.sequence = self.sequence;
                Ok(Freshness::Fresh)
            }
            Err(error) => Err(self.fault(error)),
        }
    }

    fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        let until = match wait_ns {
            0 => LOOK,
            wait_ns => {
                let limit = self.sent_at.plus(self.reply_limit_ns);
                Nanos(os::monotonic_ns()).plus(wait_ns).min(limit)
            }
        };
        loop {
            match self.phase {
                Phase::Faulted(fault) => return Err(fault),
                Phase::Issued => {}
                _ => return Ok(true),
            }
            match self.hear(until) {
                Ok(Came::Signals) => self.phase = Phase::Answered,
                Ok(_) => {}
                Err(Lost::Link(LinkFault::Timeout)) => return Ok(false),
                Err(lost) => return Err(self.fault(lost)),
            }
        }
    }

    /// A commit in dialects A and B; dialect C knows none.
    fn accepted(&mut self, sequence: u64) -> Result<(), LinkFault> {
        match self.phase {
            Phase::Faulted(fault) => Err(fault),
            Phase::Answered if sequence == self.sequence => {
                if self.settings.peer != Peer::Adapter
                    && let Err(lost) = self.commit_out()
                {
                    return Err(self.fault(lost));
                }
                self.phase = Phase::Committed;
                Ok(())
            }
            Phase::Answered | Phase::Committed if sequence <= self.sequence => Ok(()),
            _ => Err(self.fault(LinkFault::Refused)),
        }
    }

    /// Between exchanges nothing comes but the end of the connection.
    fn attend(&mut self) -> Result<(), LinkFault> {
        if !matches!(self.phase, Phase::Idle | Phase::Answered | Phase::Committed) {
            return Ok(());
        }
        let Some(link) = self.link.as_mut() else {
            return Ok(());
        };
        match link.recv(&mut self.buffer, Nanos(0)) {
            Ok(None) => Ok(()),
            Ok(Some(_)) => Err(self.fault(LinkFault::Malformed)),
            Err(fault) => Err(self.fault(fault)),
        }
    }

    /// The protocols have one goodbye, whatever happened; we close first, so that the far end's port is free at once.
    fn retire(&mut self, _how: Retirement) {
        // A lost link carries no goodbye; nothing can be done about it.
        let _ = self.say_goodbye();
        self.link = None;
        self.phase = Phase::Retired;
    }
}
