//! The codec of OpenFresco's serving dialects: bytes become requests, and answers become bytes.
//!
//! One codec serves one client. The role decides the dialect: application, actor, controller or Simulink.
//! The codec knows no socket, no clock and no specimen.
//! An error is final: the connection must be closed.
//! The codec allocates memory only when it is made and when the sizes arrive.
//! Flags of the Simulink model need no specimen: the codec answers them.

use super::role::Role;
use gusset_wire::WireError;
use gusset_wire::openfresco::{
    Actor, ActorEvent, Carrier, Course, Event, Followed, Inbox, Interface, Matrix, Response,
    Server, ServerDialect, SignalOrder, Simulink, SimulinkEvent, Sizes,
};

/// A request of the client.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Request {
    /// The message is not complete.
    More,
    /// The codec answers by itself: [`Codec::reply`].
    Reply,
    /// The handshake is complete: the client named its vector sizes.
    Sizes(Sizes),
    /// Move to a target: [`Codec::target`].
    Command(Course),
    /// The last command is accepted.
    Commit,
    /// Send the measured signals: [`Codec::answer`].
    Read,
    /// Send a matrix: [`Codec::answer_matrix`].
    Matrix(Matrix),
    /// Send a flag of the Simulink model: [`Codec::answer_switch`].
    Switch(bool),
    /// A line of an initialisation file.
    InitLine,
    /// An unknown action of the dialect. It gets no answer.
    Unknown(f64),
    /// The client ends the test. [`Codec::reply`] may hold an answer.
    Goodbye,
}

/// A target of the client.
#[derive(Debug)]
pub(crate) struct Target<'a> {
    /// The signals of the client.
    pub response: Response<'a>,
    /// Test time since the last commit, s, where it is known.
    pub dt: Option<f64>,
}

/// The codec of one client.
#[derive(Debug)]
pub(crate) struct Codec {
    dialect: Dialect,
    /// The protocol has no commits: each new command accepts the one before.
    commits_implicitly: bool,
}

#[derive(Debug)]
enum Dialect {
    Vectors(Server),
    Actor(Actor),
    Simulink {
        machine: Simulink,
        signals: Vec<f64>,
        sizes: Option<Sizes>,
    },
}

/// Site tag of our actor.
const SITE: f64 = 1.0;
/// No answer.
const SILENT: &[u8] = &[];

impl Codec {
    /// A codec of a client that has sent nothing. `order` is the order of SimSimulink's signals, if the user gave it.
    pub(crate) fn new(
        role: Role,
        order: Option<SignalOrder>,
        carrier: Carrier,
        axes: usize,
    ) -> Self {
        let interface = Interface::of_axes(axes);
        let vectors = |dialect| Dialect::Vectors(Server::new(dialect, carrier, interface));
        Self {
            dialect: match role {
                Role::Application => vectors(ServerDialect::Application),
                Role::Controller => vectors(ServerDialect::Controller),
                Role::Actor => Dialect::Actor(Actor::new(carrier, interface, SITE)),
                Role::Simulink => Dialect::Simulink {
                    machine: Simulink::new(carrier, interface).in_order(order),
                    signals: Vec::new(),
                    sizes: None,
                },
            },
            commits_implicitly: role == Role::Controller,
        }
    }

    /// True if each new command accepts the one before it.
    pub(crate) const fn commits_implicitly(&self) -> bool {
        self.commits_implicitly
    }

    /// The messages of the client. Real-time: yes.
    pub(crate) const fn inbox(&self) -> &Inbox {
        match &self.dialect {
            Dialect::Vectors(machine) => machine.inbox(),
            Dialect::Actor(machine) => machine.inbox(),
            Dialect::Simulink { machine, .. } => machine.inbox(),
        }
    }

    /// Reads at most one request. Returns it with the number of bytes that it used. Real-time: yes, after the sizes.
    pub(crate) fn feed(&mut self, bytes: &[u8]) -> Result<(usize, Request), WireError> {
        match &mut self.dialect {
            Dialect::Vectors(machine) => {
                let (used, event) = machine.feed(bytes)?;
                Ok((used, server_request(event)))
            }
            Dialect::Actor(machine) => {
                let (used, event) = machine.feed(bytes)?;
                Ok((used, actor_request(event)))
            }
            Dialect::Simulink {
                machine,
                signals,
                sizes,
            } => {
                let (used, event) = machine.feed(bytes)?;
                if let SimulinkEvent::Ready(found) = event {
                    signals.clear();
                    signals.resize(found.daq().total(), 0.0);
                    *sizes = Some(found);
                }
                Ok((used, simulink_request(event)))
            }
        }
    }

    /// The bytes that the codec answers by itself. Real-time: yes.
    pub(crate) fn reply(&self) -> &[u8] {
        match &self.dialect {
            Dialect::Vectors(machine) => machine.reply(),
            Dialect::Actor(machine) => machine.reply(),
            Dialect::Simulink { machine, .. } => machine.reply(),
        }
    }

    /// The bytes that answer a goodbye. Real-time: yes.
    pub(crate) fn goodbye(&self) -> &[u8] {
        match &self.dialect {
            Dialect::Actor(machine) => machine.reply(),
            Dialect::Vectors(_) | Dialect::Simulink { .. } => SILENT,
        }
    }

    fn followed(&self) -> Option<&Followed> {
        match &self.dialect {
            Dialect::Vectors(machine) => machine.followed(),
            Dialect::Actor(machine) => machine.followed(),
            Dialect::Simulink { machine, .. } => Some(machine.followed()),
        }
    }

    /// The target of the last command. Real-time: yes.
    pub(crate) fn target(&self) -> Option<Target<'_>> {
        let followed = self.followed()?;
        Some(Target {
            response: followed.trial(),
            dt: followed.dt(),
        })
    }

    /// True if the last command returned to the start of the client's analysis after a commit. Real-time: yes.
    pub(crate) fn is_reset(&self) -> bool {
        self.followed().is_some_and(Followed::is_reset)
    }

    /// The answer to [`Request::Read`]. Real-time: yes.
    pub(crate) fn answer(&mut self, measured: &Response<'_>) -> Result<&[u8], WireError> {
        match &mut self.dialect {
            Dialect::Vectors(machine) => machine.answer(measured),
            Dialect::Actor(machine) => machine.answer(measured),
            Dialect::Simulink {
                machine,
                signals,
                sizes,
            } => {
                if let Some(sizes) = sizes {
                    measured.gather(sizes.daq(), signals);
                }
                machine.answer_signals(true, signals)
            }
        }
    }

    /// The answer to [`Request::Matrix`]; `rows` holds the matrix row by row. Real-time: yes.
    pub(crate) fn answer_matrix(&mut self, rows: &[f64]) -> Result<&[u8], WireError> {
        match &mut self.dialect {
            Dialect::Vectors(machine) => machine.answer_matrix(rows),
            // These dialects know no request for a matrix.
            Dialect::Actor(_) | Dialect::Simulink { .. } => Ok(SILENT),
        }
    }

    /// The answer to [`Request::Switch`]. Real-time: yes.
    pub(crate) fn answer_switch(&mut self, is_on: bool) -> Result<&[u8], WireError> {
        match &mut self.dialect {
            Dialect::Simulink { machine, .. } => machine.answer_switch(is_on),
            // Only the Simulink model has such flags.
            Dialect::Vectors(_) | Dialect::Actor(_) => Ok(SILENT),
        }
    }
}

const fn server_request(event: Event) -> Request {
    match event {
        Event::NeedMore => Request::More,
        Event::Greeted => Request::Reply,
        Event::Ready(sizes) => Request::Sizes(sizes),
        Event::InitLine => Request::InitLine,
        Event::Trial(course) => Request::Command(course),
        Event::Commit { .. } => Request::Commit,
        Event::Read(_) => Request::Read,
        Event::Matrix(which) => Request::Matrix(which),
        Event::Ignored(code) => Request::Unknown(code),
        Event::Finished => Request::Goodbye,
    }
}

const fn actor_request(event: ActorEvent) -> Request {
    match event {
        ActorEvent::NeedMore => Request::More,
        ActorEvent::Greeted | ActorEvent::Opened { .. } => Request::Reply,
        ActorEvent::Ready(sizes) => Request::Sizes(sizes),
        ActorEvent::Trial(course) => Request::Command(course),
        ActorEvent::Commit { .. } => Request::Commit,
        ActorEvent::Read => Request::Read,
        ActorEvent::Ignored(code) => Request::Unknown(code),
        ActorEvent::Finished => Request::Goodbye,
    }
}

/// The model takes a target as soon as it has come, and reaches it when the specimen has been evaluated.
const fn simulink_request(event: SimulinkEvent) -> Request {
    match event {
        SimulinkEvent::NeedMore | SimulinkEvent::Execute | SimulinkEvent::TargetDone => {
            Request::More
        }
        SimulinkEvent::Greeted => Request::Reply,
        SimulinkEvent::Ready(sizes) => Request::Sizes(sizes),
        SimulinkEvent::Target(course) => Request::Command(course),
        SimulinkEvent::AtTarget => Request::Read,
        SimulinkEvent::TargetTaken => Request::Switch(true),
        SimulinkEvent::SwitchedBack => Request::Switch(false),
        SimulinkEvent::Commit => Request::Commit,
        SimulinkEvent::Ignored(code) => Request::Unknown(code),
        SimulinkEvent::Finished => Request::Goodbye,
    }
}
