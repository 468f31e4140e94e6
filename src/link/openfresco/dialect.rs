//! The four serving dialects as one: bytes in, the specimen served, bytes out.
//!
//! Invariant: whatever a client may ask is answered from the host within the same call, and nothing is allocated
//! after the sizes have come. No socket and no clock.

use thiserror::Error;

use super::host::{Host, HostFault};
use crate::wire::WireError;
use crate::wire::openfresco::{
    Actor, ActorEvent, Carrier, Course, Event, Interface, Response, Server, ServerDialect,
    Simulink, SimulinkEvent, Sizes,
};

/// Which program a server takes the place of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Role {
    /// A: OpenFresco's `startSimAppElemServer`, for OpenSees `genericClient`, OpenFresco's elements, the C library.
    Application,
    /// B: OpenFresco's `expSite ActorSite`.
    Actor,
    /// D: a laboratory controller behind OpenFresco's `expControl GenericTCP`.
    Controller,
    /// D: the Simulink model behind OpenFresco's `expControl SimSimulink`.
    Simulink,
}

/// Why an exchange ends badly.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum ExchangeFault {
    /// Bytes that the dialect does not allow.
    #[error(transparent)]
    Wire(#[from] WireError),
    /// The specimen's side refuses.
    #[error(transparent)]
    Host(#[from] HostFault),
}

/// What a piece of the client's bytes meant, as far as it is news.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Said {
    /// Nothing to tell.
    Nothing,
    /// The sizes have come and fit.
    Ready(Sizes),
    /// A line of an init file.
    InitLine,
    /// An action that the dialect does not know. It is not answered.
    Ignored(f64),
    /// The end of the test.
    Finished,
}

/// What came of a piece of bytes.
#[derive(Debug)]
pub(super) struct Heard<'a> {
    /// Bytes used.
    pub used: usize,
    /// The news.
    pub said: Said,
    /// What to send now, one message; usually empty for anything but requests.
    pub reply: &'a [u8],
}

/// One connection's machine.
#[derive(Debug)]
pub(super) enum Machine {
    Vectors {
        machine: Server,
        implicit: bool,
    },
    Actor(Actor),
    Simulink {
        machine: Simulink,
        signals: Vec<f64>,
        sizes: Option<Sizes>,
        tracker: Targets,
    },
}

/// What `SimSimulink` has commanded since its last commit.
#[derive(Debug, Default)]
pub(super) struct Targets {
    /// A command has come since.
    commanded: bool,
    /// Test time of that commit in s.
    base: f64,
}

/// Site tag that our actor names itself with.
const SITE: f64 = 1.0;

impl Machine {
    pub(super) fn new(role: Role, carrier: Carrier, axes: usize) -> Self {
        let interface = Interface::of_axes(axes);
        let vectors = |dialect| Server::new(dialect, carrier, interface);
        match role {
            Role::Application => Self::Vectors {
                machine: vectors(ServerDialect::Application),
                implicit: false,
            },
            Role::Controller => Self::Vectors {
                machine: vectors(ServerDialect::Controller),
                implicit: true,
            },
            Role::Actor => Self::Actor(Actor::new(carrier, interface, SITE)),
            Role::Simulink => Self::Simulink {
                machine: Simulink::new(carrier, interface),
                signals: Vec::new(),
                sizes: None,
                tracker: Targets::default(),
            },
        }
    }

    /// Over UDP: answers are cut as the client cuts its vectors.
    pub(super) fn piece(&self) -> usize {
        match self {
            Self::Vectors { machine, .. } => machine.piece(),
            Self::Actor(machine) => machine.piece(),
            Self::Simulink { machine, .. } => machine.piece(),
        }
    }

    /// Takes one message or a part of it and does what it says. Real-time: yes, after the sizes.
    pub(super) fn hear(
        &mut self,
        bytes: &[u8],
        host: &mut Host,
    ) -> Result<Heard<'_>, ExchangeFault> {
        match self {
            Self::Vectors { machine, implicit } => hear_server(machine, *implicit, bytes, host),
            Self::Actor(machine) => hear_actor(machine, bytes, host),
            Self::Simulink {
                machine,
                signals,
                sizes,
                tracker,
            } => hear_simulink(machine, signals, sizes, tracker, bytes, host),
        }
    }
}

/// No answer.
const SILENT: &[u8] = &[];

fn hear_server<'a>(
    machine: &'a mut Server,
    implicit: bool,
    bytes: &[u8],
    host: &mut Host,
) -> Result<Heard<'a>, ExchangeFault> {
    let (used, event) = machine.feed(bytes)?;
    let (said, reply) = match event {
        Event::NeedMore => (Said::Nothing, SILENT),
        Event::Greeted => (Said::Nothing, machine.reply()),
        Event::Ready(sizes) => (Said::Ready(sizes), SILENT),
        Event::InitLine => (Said::InitLine, SILENT),
        Event::Trial(course) => {
            if implicit && course != Course::Repeat && host.tally().commands > 0 {
                host.commit();
            }
            let dt = machine.dt();
            if let Some(trial) = machine.trial() {
                host.trial(course, &trial, dt)?;
            }
            (Said::Nothing, SILENT)
        }
        Event::Commit { .. } => {
            host.commit();
            (Said::Nothing, SILENT)
        }
        Event::Read(_) => (Said::Nothing, machine.answer(&host.response())?),
        Event::Matrix(which) => (Said::Nothing, machine.answer_matrix(host.matrix(which))?),
        Event::Ignored(code) => (Said::Ignored(code), SILENT),
        Event::Finished => (Said::Finished, SILENT),
    };
    Ok(Heard { used, said, reply })
}

fn hear_actor<'a>(
    machine: &'a mut Actor,
    bytes: &[u8],
    host: &mut Host,
) -> Result<Heard<'a>, ExchangeFault> {
    let (used, event) = machine.feed(bytes)?;
    let (said, reply) = match event {
        ActorEvent::NeedMore => (Said::Nothing, SILENT),
        ActorEvent::Greeted | ActorEvent::Opened { .. } => (Said::Nothing, machine.reply()),
        ActorEvent::Ready(sizes) => (Said::Ready(sizes), SILENT),
        ActorEvent::Trial(course) => {
            let dt = machine.dt();
            if let Some(trial) = machine.trial() {
                host.trial(course, &trial, dt)?;
            }
            (Said::Nothing, SILENT)
        }
        ActorEvent::Commit { .. } => {
            host.commit();
            (Said::Nothing, SILENT)
        }
        ActorEvent::Read => (Said::Nothing, machine.answer(&host.response())?),
        ActorEvent::Ignored(code) => (Said::Ignored(code), SILENT),
        ActorEvent::Finished => (Said::Finished, machine.reply()),
    };
    Ok(Heard { used, said, reply })
}

/// The flags answer at once: a target is taken as soon as it has come, and is reached when the specimen has been
/// evaluated.
fn hear_simulink<'a>(
    machine: &'a mut Simulink,
    signals: &mut Vec<f64>,
    sizes: &mut Option<Sizes>,
    tracker: &mut Targets,
    bytes: &[u8],
    host: &mut Host,
) -> Result<Heard<'a>, ExchangeFault> {
    let (used, event) = machine.feed(bytes)?;
    let (said, reply) = match event {
        SimulinkEvent::NeedMore | SimulinkEvent::Execute | SimulinkEvent::TargetDone => {
            (Said::Nothing, SILENT)
        }
        SimulinkEvent::Greeted => (Said::Nothing, machine.reply()),
        SimulinkEvent::Ready(found) => {
            signals.clear();
            signals.resize(found.daq().total(), 0.0);
            *sizes = Some(found);
            (Said::Ready(found), SILENT)
        }
        SimulinkEvent::Target => {
            if let Some(sizes) = sizes {
                let target = Response::split(sizes.ctrl(), machine.signals());
                let course = if tracker.commanded {
                    Course::Iteration
                } else {
                    Course::Step
                };
                let timed = sizes.ctrl().time == 1;
                let dt = timed.then_some(target.time - tracker.base);
                host.trial(course, &target, dt)?;
                tracker.commanded = true;
            }
            (Said::Nothing, SILENT)
        }
        SimulinkEvent::AtTarget => {
            if let Some(sizes) = sizes {
                host.response().gather(sizes.daq(), signals);
            }
            (Said::Nothing, machine.answer_signals(true, signals)?)
        }
        SimulinkEvent::TargetTaken => (Said::Nothing, machine.answer_switch(true)?),
        SimulinkEvent::SwitchedBack => (Said::Nothing, machine.answer_switch(false)?),
        SimulinkEvent::Commit => {
            host.commit();
            tracker.commanded = false;
            if let Some(sizes) = sizes {
                tracker.base = Response::split(sizes.ctrl(), machine.signals()).time;
            }
            (Said::Nothing, SILENT)
        }
        SimulinkEvent::Ignored(code) => (Said::Ignored(code), SILENT),
        SimulinkEvent::Finished => (Said::Finished, SILENT),
    };
    Ok(Heard { used, said, reply })
}
