//! Our controller as a client: dialects A, B and C behind the hinge.
//!
//! Coupling is lockstep: one answer is owed for each command, nothing has a sequence number, so nothing may be lost or
//! late. Command and request leave in one write. Each wait ends at the time limit of [`RemoteSettings`], on the
//! wall clock of the socket: the engine's deadline is on the engine's clock, which may be simulated. Nothing is
//! allocated for an exchange.
//!
//! Not here: what the numbers mean for the structure, and what to do about a fault; a fault is final.

use std::time::Duration;

use thiserror::Error;

use crate::link::Transport;
use crate::link::socket::{ConnectError, SocketOptions, TcpTransport, UdpTransport, Wait};
use crate::rt::os;
use crate::substructure::{
    Command, Coupling, Freshness, Introduction, LinkFault, Measurement, Retirement, Substructure,
    Unavailable,
};
use crate::time::Nanos;
use crate::wire::WireError;
use crate::wire::openfresco::{
    Asked, Carrier, Client, ClientDialect, ClientEvent, ClientSettings, Counts, DATAGRAM_LIMIT,
    DEFAULT_DATA_SIZE, Matrix, Peer as Program, Shadow, ShadowEvent, ShadowSettings, Sizes,
    UdpGreeting, datagrams,
};

/// What listens at the other end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Peer {
    /// A: OpenFresco's `startSimAppElemServer`, or a server of ours. Answers requests for matrices.
    Element,
    /// A: OpenFresco's `startSimAppSiteServer`. Knows no matrices.
    Site,
    /// B: OpenFresco's `expSite ActorSite` with `startLabServer`.
    Actor,
    /// C: an OpenSees `adapter`, `actuator` or `corotActuator`.
    Adapter,
}

impl std::fmt::Display for Peer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Element => "OpenFresco element server",
            Self::Site => "OpenFresco site server",
            Self::Actor => "OpenFresco actor site",
            Self::Adapter => "OpenSees adapter",
        })
    }
}

/// How to reach a specimen behind OpenFresco or OpenSees.
#[derive(Debug, Clone, PartialEq)]
pub struct RemoteSettings {
    /// What listens there.
    pub peer: Peer,
    /// TCP or UDP.
    pub carrier: Carrier,
    /// "host:port".
    pub address: String,
    /// Number of axes.
    pub axes: usize,
    /// Signals of a command.
    pub ctrl: Counts,
    /// Signals of an answer.
    pub daq: Counts,
    /// Doubles in a vector; raised as far as commands, answers and matrices need it.
    pub data_size: usize,
    /// Bytes before everything else, over UDP.
    pub greeting: UdpGreeting,
    /// Dialect B: our site tag.
    pub site: f64,
    /// Dialect B: the version that both sides compare for exact equality.
    pub version: f64,
    /// Time limit of the connection and its set-up, in s. A refused connection is tried again until then: the far end
    /// may be started after us.
    pub connect_limit_s: f64,
    /// Time limit of each answer, in s.
    pub reply_limit_s: f64,
    /// How waits are spent.
    pub wait: Wait,
}

impl RemoteSettings {
    /// The usual settings for a peer.
    #[must_use]
    pub fn new(peer: Peer, carrier: Carrier, address: impl Into<String>, axes: usize) -> Self {
        let n = axes;
        let (ctrl, daq, program) = match peer {
            Peer::Element | Peer::Site => (
                Counts::new(n, n, n, 0, 1),
                Counts::new(n, n, n, n, 1),
                Program::OpenFrescoServer,
            ),
            // What a bank of uniaxial materials insists on.
            Peer::Actor => (
                Counts::new(n, n, 0, 0, 0),
                Counts::new(n, n, 0, n, 0),
                Program::OpenFrescoSite,
            ),
            Peer::Adapter => (
                Counts::new(n, 0, 0, 0, 0),
                Counts::new(n, 0, 0, n, 0),
                Program::OpenSees,
            ),
        };
        Self {
            peer,
            carrier,
            address: address.into(),
            axes,
            ctrl,
            daq,
            data_size: DEFAULT_DATA_SIZE,
            greeting: UdpGreeting::expected_by(program),
            site: 0.0,
            version: 2.8,
            connect_limit_s: 10.0,
            reply_limit_s: 5.0,
            wait: Wait::default(),
        }
    }

    fn sizes(&self) -> Result<Sizes, WireError> {
        let matrices = self.peer == Peer::Element;
        Sizes::fitted(self.ctrl, self.daq, self.data_size, matrices)
    }
}

/// Why there is no link to a specimen. Nothing was moved.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RemoteError {
    /// No connection.
    #[error(transparent)]
    Connect(#[from] ConnectError),
    /// The settings, or what the peer answered, cannot be.
    #[error("{address}: {what}: {source}")]
    Wire {
        /// Where to.
        address: String,
        /// What was being done.
        what: &'static str,
        /// What is wrong.
        source: WireError,
    },
    /// The link was lost while it was set up.
    #[error("{address}: {what}: {fault}")]
    Lost {
        /// Where to.
        address: String,
        /// What was being done.
        what: &'static str,
        /// How.
        fault: LinkFault,
    },
    /// The peer did not answer in time.
    #[error(
        "{address} did not answer {what} within {seconds} s: is it the right program, and, over UDP, the right hello?"
    )]
    Timeout {
        /// Where to.
        address: String,
        /// What was asked.
        what: &'static str,
        /// The time limit.
        seconds: f64,
    },
    /// A time limit or a number of axes that cannot be.
    #[error("{name} is {found}, but must be {allowed}")]
    Setting {
        /// Which.
        name: &'static str,
        /// What was given.
        found: f64,
        /// The domain, in words.
        allowed: &'static str,
    },
}

impl RemoteError {
    /// The configuration key to point at.
    #[must_use]
    pub const fn key(&self) -> &'static str {
        match self {
            Self::Setting { name, .. } => name,
            Self::Wire { .. } => "openfresco",
            Self::Connect(_) | Self::Lost { .. } | Self::Timeout { .. } => "address",
        }
    }

    /// The kind of the fault.
    #[must_use]
    pub fn fault(&self) -> LinkFault {
        match self {
            Self::Connect(_) | Self::Setting { .. } => LinkFault::Closed,
            Self::Wire { source, .. } => source.fault(),
            Self::Lost { fault, .. } => *fault,
            Self::Timeout { .. } => LinkFault::Timeout,
        }
    }
}

fn name(carrier: Carrier) -> &'static str {
    match carrier {
        Carrier::Stream => "TCP",
        Carrier::Datagrams => "UDP",
    }
}

#[derive(Debug)]
enum Machine {
    Client(Client),
    Shadow(Shadow),
}

/// What came of some bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Came {
    Nothing,
    /// A step of the set-up; there may be something to send.
    Greeted,
    /// Commands may follow.
    Ready,
    Signals,
    Matrix,
    Farewell,
}

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
/// Pause between two attempts to connect.
const AGAIN_NS: u64 = 20_000_000;
/// Longest wait for the answer to a goodbye.
const FAREWELL_NS: u64 = 1_000_000_000;

/// A specimen behind OpenFresco or OpenSees. Coupling: lockstep.
pub struct Remote {
    settings: RemoteSettings,
    link: Option<Box<dyn Transport>>,
    machine: Machine,
    buffer: Vec<u8>,
    phase: Phase,
    sequence: u64,
    time: f64,
    sent_at: Nanos,
    reply_limit_ns: u64,
    initial_stiffness: Option<Vec<f64>>,
    complaint: Option<Lost>,
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
            sent_at: Nanos(0),
            reply_limit_ns: (settings.reply_limit_s * 1e9) as u64,
            initial_stiffness: None,
            complaint: None,
            settings,
        })
    }

    /// Connects and sets everything up; an element server is asked for its initial stiffness. Nothing moves.
    ///
    /// # Errors
    /// See [`RemoteError`].
    pub fn open(&mut self) -> Result<(), RemoteError> {
        let until = Nanos(os::monotonic_ns()).plus((self.settings.connect_limit_s * 1e9) as u64);
        self.link = Some(transport(&self.settings, until)?);
        self.set_up(until)?;
        if self.settings.peer == Peer::Element {
            self.ask_stiffness(until)?;
        }
        self.phase = Phase::Idle;
        Ok(())
    }

    /// Initial stiffness as an element server reports it, n × n by rows, in the specimen's units.
    #[must_use]
    pub fn initial_stiffness(&self) -> Option<&[f64]> {
        self.initial_stiffness.as_deref()
    }

    fn set_up(&mut self, until: Nanos) -> Result<(), RemoteError> {
        let say = Saying::new(&self.settings, "the set-up");
        let opening = match &mut self.machine {
            Machine::Client(client) => client.open(),
            Machine::Shadow(shadow) => shadow.open(),
        };
        let opening = opening.map_err(|error| say.wire(error))?.to_vec();
        let hello = opening.len() == 1;
        self.send_raw(&opening).map_err(|fault| say.lost(fault))?;
        if !hello && matches!(self.machine, Machine::Client(_)) {
            return Ok(());
        }
        loop {
            match self.hear(until) {
                Ok(Came::Ready) => return Ok(()),
                Ok(_) => {}
                // Nobody has the port yet: the hello has certainly not arrived, so it may be sent again.
                Err(Lost::Link(LinkFault::Closed))
                    if hello && Nanos(os::monotonic_ns()) < until =>
                {
                    pause();
                    self.send_raw(&opening).or_else(|fault| match fault {
                        LinkFault::Closed => Ok(()),
                        fault => Err(say.lost(fault)),
                    })?;
                }
                Err(lost) => return Err(say.why(lost)),
            }
        }
    }

    fn ask_stiffness(&mut self, until: Nanos) -> Result<(), RemoteError> {
        let say = Saying::new(&self.settings, "the request for the initial stiffness");
        let Self {
            machine: Machine::Client(client),
            link: Some(link),
            ..
        } = self
        else {
            return Ok(());
        };
        let bytes = client
            .request_matrix(Matrix::InitialStiffness)
            .map_err(|error| say.wire(error))?;
        send(link.as_mut(), self.settings.carrier, bytes, bytes.len())
            .map_err(|fault| say.lost(fault))?;
        while self.hear(until).map_err(|lost| say.why(lost))? != Came::Matrix {}
        let mut rows = vec![0.0; self.settings.axes * self.settings.axes];
        if let Machine::Client(client) = &self.machine {
            client.matrix(&mut rows).map_err(|error| say.wire(error))?;
        }
        self.initial_stiffness = Some(rows);
        Ok(())
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
            let mut rest = self.buffer.get(..count).unwrap_or_default();
            while !rest.is_empty() {
                let (used, what) = self.machine.feed(rest)?;
                if what != Came::Nothing {
                    self.machine
                        .answer_back(link.as_mut(), self.settings.carrier)?;
                    came = what;
                }
                rest = rest.get(used.max(1)..).unwrap_or_default();
            }
        }
        Ok(came)
    }

    fn fault(&mut self, lost: impl Into<Lost>) -> LinkFault {
        let lost = lost.into();
        self.complaint = Some(lost);
        self.phase = Phase::Faulted(lost.fault());
        lost.fault()
    }

    fn exchange_out(&mut self, command: &Command<'_>) -> Result<(), Lost> {
        let link = self.link.as_mut().ok_or(LinkFault::Closed)?;
        let (bytes, message) = match &mut self.machine {
            Machine::Client(client) => {
                let message = client.vector_len();
                (client.command(command)?, message)
            }
            Machine::Shadow(shadow) => {
                let message = shadow.vector_len();
                (shadow.command(command)?, message)
            }
        };
        Ok(send(link.as_mut(), self.settings.carrier, bytes, message)?)
    }

    fn commit_out(&mut self) -> Result<(), Lost> {
        let link = self.link.as_mut().ok_or(LinkFault::Closed)?;
        let bytes = match &mut self.machine {
            Machine::Client(client) => client.commit(self.time)?,
            Machine::Shadow(shadow) => shadow.commit(self.time)?,
        };
        Ok(send(
            link.as_mut(),
            self.settings.carrier,
            bytes,
            bytes.len(),
        )?)
    }

    /// The goodbye: 99, whose answer is waited for only in dialect B. OpenFresco says it twice in dialect C, where
    /// the far end has gone after the first.
    fn say_goodbye(&mut self) -> Result<(), Lost> {
        let link = self.link.as_mut().ok_or(LinkFault::Closed)?;
        let (bytes, answered) = match &mut self.machine {
            Machine::Client(client) => (client.die()?, false),
            Machine::Shadow(shadow) => (shadow.die()?, true),
        };
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

    fn coupling(&self) -> Coupling {
        Coupling::Lockstep
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
            carrier,
            address,
            axes,
            ..
        } = &self.settings;
        // The wire's matrix stands here by rows.
        let rows = self.initial_stiffness.as_deref().unwrap_or_default();
        let column = |j: usize| rows.iter().skip(j).step_by((*axes).max(1));
        Ok(Introduction {
            peer: format!("{peer} at {address}, {}", name(*carrier)),
            stiffness: (0..*axes).flat_map(column).copied().collect(),
            warnings: Vec::new(),
        })
    }

    fn complaint(&self) -> Option<String> {
        self.complaint.map(|lost| match lost {
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

    /// Refused: a command while an answer is owed, and one after the end. One whose sequence number was answered
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
        if let Err(lost) = self.exchange_out(command) {
            return Err(self.fault(lost));
        }
        self.sent_at = Nanos(os::monotonic_ns());
        self.phase = Phase::Issued;
        Ok(())
    }

    /// Waits up to the time limit of a reply, whatever the engine's deadline is: an answer that is owed cannot be left
    /// behind.
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
        let filled = match &self.machine {
            Machine::Client(client) => client.measurement(into),
            Machine::Shadow(shadow) => shadow.measurement(into),
        };
        match filled {
            Ok(()) => {
                into.sequence = self.sequence;
                Ok(Freshness::Fresh)
            }
            Err(error) => Err(self.fault(error)),
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

    /// The protocols have one goodbye, whatever happened; we close first, so that the far end's port is free at once.
    fn retire(&mut self, _how: Retirement) {
        // A lost link takes no last words; nothing is left to do about it.
        let _ = self.say_goodbye();
        self.link = None;
        self.phase = Phase::Retired;
    }
}

impl Machine {
    fn feed(&mut self, bytes: &[u8]) -> Result<(usize, Came), WireError> {
        Ok(match self {
            Self::Client(client) => {
                let (used, event) = client.feed(bytes)?;
                let came = match event {
                    ClientEvent::NeedMore => Came::Nothing,
                    ClientEvent::Greeted => Came::Ready,
                    ClientEvent::Answer(Asked::Signals) => Came::Signals,
                    ClientEvent::Answer(Asked::Matrix(_)) => Came::Matrix,
                };
                (used, came)
            }
            Self::Shadow(shadow) => {
                let (used, event) = shadow.feed(bytes)?;
                let came = match event {
                    ShadowEvent::NeedMore => Came::Nothing,
                    ShadowEvent::Greeted => Came::Greeted,
                    ShadowEvent::Ready { .. } => Came::Ready,
                    ShadowEvent::Answer => Came::Signals,
                    ShadowEvent::Finished => Came::Farewell,
                };
                (used, came)
            }
        })
    }

    fn answer_back(&self, link: &mut dyn Transport, carrier: Carrier) -> Result<(), LinkFault> {
        match self {
            Self::Client(client) => send(link, carrier, client.reply(), client.reply().len()),
            Self::Shadow(shadow) => shadow
                .reply_messages()
                .try_for_each(|message| send(link, carrier, message, message.len())),
        }
    }
}

/// A stream takes all in one write, datagrams leave message by message. Real-time: yes.
fn send(
    link: &mut dyn Transport,
    carrier: Carrier,
    bytes: &[u8],
    message: usize,
) -> Result<(), LinkFault> {
    match carrier {
        Carrier::Stream if bytes.is_empty() => Ok(()),
        Carrier::Stream => link.send(bytes),
        Carrier::Datagrams => {
            datagrams(bytes, message, DATAGRAM_LIMIT).try_for_each(|part| link.send(part))
        }
    }
}

fn machine(settings: &RemoteSettings) -> Result<Machine, WireError> {
    let sizes = settings.sizes()?;
    let dialect = match settings.peer {
        Peer::Element | Peer::Site => ClientDialect::Application,
        Peer::Adapter => ClientDialect::Adapter,
        Peer::Actor => {
            return Ok(Machine::Shadow(Shadow::new(ShadowSettings {
                carrier: settings.carrier,
                sizes,
                site: settings.site,
                version: settings.version,
                greeting: settings.greeting,
            })?));
        }
    };
    Ok(Machine::Client(Client::new(ClientSettings {
        dialect,
        carrier: settings.carrier,
        sizes,
        greeting: settings.greeting,
    })?))
}

fn transport(settings: &RemoteSettings, until: Nanos) -> Result<Box<dyn Transport>, RemoteError> {
    let options = SocketOptions {
        wait: settings.wait,
        ..SocketOptions::default()
    };
    if settings.carrier == Carrier::Datagrams {
        return Ok(Box::new(UdpTransport::connect(&settings.address, options)?));
    }
    loop {
        let left = until.since(Nanos(os::monotonic_ns()));
        let limit = Duration::from_nanos(left.max(1_000_000));
        match TcpTransport::connect(&settings.address, limit, options) {
            Ok(link) => return Ok(Box::new(link)),
            Err(ConnectError::Refused { .. }) if left > AGAIN_NS => pause(),
            Err(error) => return Err(error.into()),
        }
    }
}

fn pause() {
    os::sleep_until_ns(os::monotonic_ns() + AGAIN_NS);
}

/// A link lost on the way, or bytes that cannot be.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Lost {
    Link(LinkFault),
    Wire(WireError),
}

impl Lost {
    fn fault(self) -> LinkFault {
        match self {
            Self::Link(fault) => fault,
            Self::Wire(error) => error.fault(),
        }
    }
}

impl From<LinkFault> for Lost {
    fn from(fault: LinkFault) -> Self {
        Self::Link(fault)
    }
}

impl From<WireError> for Lost {
    fn from(error: WireError) -> Self {
        Self::Wire(error)
    }
}

/// Puts names on what goes wrong in the set-up.
struct Saying {
    address: String,
    seconds: f64,
    what: &'static str,
}

impl Saying {
    fn new(settings: &RemoteSettings, what: &'static str) -> Self {
        Self {
            address: settings.address.clone(),
            seconds: settings.connect_limit_s,
            what,
        }
    }

    fn wire(&self, source: WireError) -> RemoteError {
        RemoteError::Wire {
            address: self.address.clone(),
            what: self.what,
            source,
        }
    }

    fn lost(&self, fault: LinkFault) -> RemoteError {
        let (address, what) = (self.address.clone(), self.what);
        match fault {
            LinkFault::Timeout => RemoteError::Timeout {
                address,
                what,
                seconds: self.seconds,
            },
            fault => RemoteError::Lost {
                address,
                what,
                fault,
            },
        }
    }

    fn why(&self, lost: Lost) -> RemoteError {
        match lost {
            Lost::Link(fault) => self.lost(fault),
            Lost::Wire(error) => self.wire(error),
        }
    }
}
