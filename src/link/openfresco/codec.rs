//! The four serving dialects as one: bytes in, the specimen served, bytes out.
//!
//! Invariant: whatever a client may ask is answered from the host within the same call, and nothing is allocated
//! after the sizes have come. No socket and no clock.

use thiserror::Error;

use super::host::{Host, HostFault};
use super::role::Role;
use crate::wire::WireError;
use crate::wire::openfresco::{
    Actor, ActorEvent, Carrier, Course, Event, Interface, Server, ServerDialect, SignalOrder,
    Simulink, SimulinkEvent, Sizes,
};

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
    /// A command went back to the start of the client's analysis after a commit.
    Reset,
    /// The end of the test.
    Finished,
}

impl Said {
    /// A command that the specimen has followed.
    const fn command(is_reset: bool) -> Self {
        if is_reset { Self::Reset } else { Self::Nothing }
    }
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
    },
}

/// Site tag that our actor names itself with.
const SITE: f64 = 1.0;

impl Machine {
    /// `order` is that of SimSimulink's signals, where the user gives it.
    pub(super) fn new(
        role: Role,
        order: Option<SignalOrder>,
        carrier: Carrier,
        axes: usize,
    ) -> Self {
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
                machine: Simulink::new(carrier, interface).in_order(order),
                signals: Vec::new(),
                sizes: None,
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

    /// Bytes of a message that has not come whole.
    pub(super) const fn partial(&self) -> usize {
        match self {
            Self::Vectors { machine, .. } => machine.partial(),
            Self::Actor(machine) => machine.partial(),
            Self::Simulink { machine, .. } => machine.partial(),
        }
    }

    /// Takes one message or a part of it and does what it says; a specimen's answer is waited for as long as it is `wanted`.
    /// Real-time: yes, after the sizes.
    pub(super) fn hear(
        &mut self,
        bytes: &[u8],
        host: &mut Host,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<Heard<'_>, ExchangeFault> {
        match self {
            Self::Vectors { machine, implicit } => {
                hear_server(machine, *implicit, bytes, host, wanted)
            }
            Self::Actor(machine) => hear_actor(machine, bytes, host, wanted),
            Self::Simulink {
                machine,
                signals,
                sizes,
            } => hear_simulink(machine, signals, sizes, bytes, host, wanted),
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
    wanted: &mut dyn FnMut() -> bool,
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
                host.trial(course, &trial, dt, wanted)?;
            }
            (Said::command(machine.is_reset()), SILENT)
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
    wanted: &mut dyn FnMut() -> bool,
) -> Result<Heard<'a>, ExchangeFault> {
    let (used, event) = machine.feed(bytes)?;
    let (said, reply) = match event {
        ActorEvent::NeedMore => (Said::Nothing, SILENT),
        ActorEvent::Greeted | ActorEvent::Opened { .. } => (Said::Nothing, machine.reply()),
        ActorEvent::Ready(sizes) => (Said::Ready(sizes), SILENT),
        ActorEvent::Trial(course) => {
            let dt = machine.dt();
            if let Some(trial) = machine.trial() {
                host.trial(course, &trial, dt, wanted)?;
            }
            (Said::command(machine.is_reset()), SILENT)
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
    bytes: &[u8],
    host: &mut Host,
    wanted: &mut dyn FnMut() -> bool,
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
        SimulinkEvent::Target(course) => {
            host.trial(course, &machine.trial(), machine.dt(), wanted)?;
            (Said::command(machine.is_reset()), SILENT)
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
            (Said::Nothing, SILENT)
        }
        SimulinkEvent::Ignored(code) => (Said::Ignored(code), SILENT),
        SimulinkEvent::Finished => (Said::Finished, SILENT),
    };
    Ok(Heard { used, said, reply })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::openfresco::Nature;
    use crate::link::rig::Visitor;
    use crate::specimen::SpecimenLaw;

    const LINEAR: &str = "law = { linear = { stiffness_n_per_m = 8000.0 } }";
    const VISCOUS: &str = "law = { linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 50.0 } }";
    /// Doubles of a vector.
    const N: usize = 4;

    /// A client of one axis that commands displacements and, if it is `timed`, times, and wants forces.
    struct Client {
        machine: Machine,
        host: Host,
        timed: i32,
    }

    impl Client {
        fn new(role: Role, law: &str, nature: Nature, timed: bool) -> Self {
            let law: SpecimenLaw = toml::from_str(law).unwrap();
            let mut host = Host::new(law.build(1).unwrap(), nature, Some(0.01));
            let visitor = Visitor::unnamed(([127, 0, 0, 1], 1).into());
            host.begin(&visitor, &mut || Ok(())).unwrap();
            let mut machine = Machine::new(role, None, Carrier::Stream, 1);
            let timed = i32::from(timed);
            let sizes = [1, 0, 0, 0, timed, 0, 0, 0, 1, 0, N as i32];
            let bytes: Vec<u8> = sizes.into_iter().flat_map(i32::to_le_bytes).collect();
            machine.hear(&bytes, &mut host, &mut || true).unwrap();
            Self {
                machine,
                host,
                timed,
            }
        }

        fn send(&mut self, code: f64, disp: f64, time: f64) -> Result<Vec<f64>, ExchangeFault> {
            let values = [code, disp, time * f64::from(self.timed), 0.0];
            let bytes: Vec<u8> = values.into_iter().flat_map(f64::to_le_bytes).collect();
            let heard = self.machine.hear(&bytes, &mut self.host, &mut || true)?;
            let words = heard.reply.chunks_exact(8);
            Ok(words
                .map(|word| f64::from_le_bytes(word.try_into().unwrap()))
                .collect())
        }

        /// The force of a command, which is committed then.
        fn step(&mut self, disp: f64, time: f64) -> f64 {
            self.send(3.0, disp, time).unwrap();
            // Behind the flag, where there is one.
            let at = usize::from(matches!(self.machine, Machine::Simulink { .. }));
            let force = self.send(6.0, 0.0, 0.0).unwrap()[at];
            // The time stands where a command has it.
            self.send(5.0, 0.0, time).unwrap();
            force
        }
    }

    #[test]
    fn a_damper_whose_client_holds_its_command_is_at_rest_with_and_without_a_time() {
        for role in [Role::Application, Role::Simulink] {
            for timed in [false, true] {
                let mut client = Client::new(role, VISCOUS, Nature::Simulated, timed);
                let commands = [0.0, 0.001, 0.002, 0.002, 0.002, 0.001];
                let forces = (0_i32..)
                    .zip(commands)
                    .map(|(k, disp)| client.step(disp, 0.01 * f64::from(k)));
                let forces: Vec<f64> = forces.collect();
                for (force, wanted) in forces.iter().zip([0.0, 5.0, 5.0, 0.0, 0.0, -5.0]) {
                    assert!(
                        (force - wanted).abs() < 1e-9,
                        "{role:?} {timed}: {forces:?}"
                    );
                }
            }
        }
        // Nobody commits here: each target is a step.
        let mut client = Client::new(Role::Controller, VISCOUS, Nature::Simulated, false);
        for (disp, wanted) in [(0.0, 0.0), (0.001, 5.0), (0.001, 0.0)] {
            client.send(3.0, disp, 0.0).unwrap();
            let force = client.send(6.0, 0.0, 0.0).unwrap()[0];
            assert!((force - wanted).abs() < 1e-9, "{force} {wanted}");
        }
    }

    #[test]
    fn a_step_taken_back_ends_the_test_of_what_moves_whoever_asks() {
        for role in [Role::Application, Role::Simulink] {
            for timed in [false, true] {
                for nature in [Nature::Simulated, Nature::Physical] {
                    let mut client = Client::new(role, LINEAR, nature, timed);
                    client.step(0.0, 0.0);
                    client.step(0.0004, 0.01);
                    client.send(3.0, 0.0008, 0.02).unwrap();
                    client.send(3.0, 0.0009, 0.02).unwrap();
                    let back = client.send(3.0, 0.0004, 0.01);
                    match nature {
                        Nature::Simulated => assert!(back.is_ok(), "{role:?}"),
                        Nature::Physical => assert!(
                            matches!(back, Err(ExchangeFault::Host(HostFault::TakenBack { .. }))),
                            "{role:?} {timed}: {back:?}"
                        ),
                    }
                }
            }
        }
    }

    #[test]
    fn what_moves_follows_a_client_without_commits_through_zero() {
        for nature in [Nature::Simulated, Nature::Physical] {
            let mut client = Client::new(Role::Application, LINEAR, nature, false);
            for disp in [0.0, 0.0005, 0.001, 0.0005, 0.0] {
                client.send(3.0, disp, 0.0).unwrap();
                let force = client.send(10.0, 0.0, 0.0).unwrap()[0];
                assert!((force - 8e3 * disp).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_commit_with_zeros_behind_it_leaves_the_steps_their_length() {
        let mut client = Client::new(Role::Application, VISCOUS, Nature::Simulated, true);
        for k in 0..5 {
            let (disp, time) = (0.001 * f64::from(k), 0.01 * f64::from(k));
            client.send(3.0, disp, time).unwrap();
            let force = client.send(10.0, 0.0, 0.0).unwrap()[0];
            // 1 mm in 10 ms at 50 N s/m.
            let wanted = if k > 0 { 5.0 } else { 0.0 };
            assert!((force - wanted).abs() < 1e-9, "{k}: {force}");
            client.send(5.0, 0.0, 0.0).unwrap();
        }
    }

    #[test]
    fn a_return_to_the_start_is_told_and_leaves_the_specimen_at_its_committed_state() {
        const BILINEAR: &str = "law = { bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }";
        let mut client = Client::new(Role::Application, BILINEAR, Nature::Simulated, true);
        client.step(0.0, 0.0);
        client.step(0.0275, 0.01);
        let vector: Vec<u8> = [3.0, 0.0, 0.0, 0.0]
            .into_iter()
            .flat_map(f64::to_le_bytes)
            .collect();
        let heard = client
            .machine
            .hear(&vector, &mut client.host, &mut || true)
            .unwrap();
        assert_eq!(heard.said, Said::Reset);
        // 27.5 mm are 20 mm beyond the yield: unloaded by 15 mm, and 12.5 mm beyond the other one.
        let force = client.send(10.0, 0.0, 0.0).unwrap()[0];
        assert!((force + 57.0).abs() < 1e-9, "{force}");
    }

    #[test]
    fn a_load_factor_that_falls_in_a_step_ends_no_test() {
        for nature in [Nature::Simulated, Nature::Physical] {
            let mut client = Client::new(Role::Application, LINEAR, nature, true);
            client.step(0.0, 0.0);
            client.step(0.0004, 49.0);
            client.send(3.0, 0.0008, 56.0).unwrap();
            client.send(3.0, 0.0008, 47.0).unwrap();
            let force = client.send(6.0, 0.0, 0.0).unwrap()[0];
            assert!((force - 6.4).abs() < 1e-12);
        }
    }
}
