//! A specimen that records every call and misbehaves on demand.

use std::sync::{Arc, Mutex};

use gusset_control::engine::Experiment;
use gusset_control::port::{Axis, AxisSpec, Exits, PortSpec};
use gusset_quantity::substructure::{
    Command, Coupling, Freshness, LinkFault, Measurement, Retirement, Status, Substructure,
};
use gusset_quantity::time::Nanos;

/// Stiffness of every rig, N/m.
pub const STIFFNESS: f64 = 2e5;

/// One call of the loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Call {
    Issue { sequence: u64, disp: f64, vel: f64 },
    Collect { deadline: Nanos },
    Accepted(u64),
    Retire(Retirement),
}

/// The call at which a rig chooses its behaviour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    Issue,
    Collect,
    Accepted,
    Retire,
}

/// The behaviour of a rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Act {
    /// Normal operation.
    Serve,
    /// Its link fails.
    Fail(LinkFault),
    /// It answers with this force.
    Force(f64),
    /// A sensor of it is at the end of its range.
    Saturated,
    /// It reports this status, and answers with a force that would do harm.
    Says(Status),
    /// It reports that its own watchdog holds it.
    Holds,
    /// Its answer is not there yet.
    Miss,
    /// No answer either, but it reports this status.
    MissSays(Status),
    /// An answer of this age in commands arrives and calls itself fresh, with a force that would do harm.
    Late(u64),
}

/// Calls on all rigs in order, with the rig's number.
pub type Log = Arc<Mutex<Vec<(usize, Call)>>>;

struct Rig<F> {
    number: usize,
    log: Log,
    coupling: Coupling,
    /// Called in every phase with the sequence number.
    act: F,
    disp: f64,
    sequence: u64,
}

impl<F: FnMut(Phase, u64) -> Act + Send> Rig<F> {
    fn note(&self, call: Call) {
        self.log.lock().unwrap().push((self.number, call));
    }
}

impl<F: FnMut(Phase, u64) -> Act + Send> Substructure for Rig<F> {
    fn axes(&self) -> usize {
        1
    }

    fn coupling(&self) -> Coupling {
        self.coupling
    }

    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        let &Command { sequence, .. } = command;
        let (disp, vel) = (command.disp[0], command.vel[0]);
        self.note(Call::Issue {
            sequence,
            disp,
            vel,
        });
        (self.disp, self.sequence) = (disp, sequence);
        match (self.act)(Phase::Issue, sequence) {
            Act::Fail(fault) => Err(fault),
            _ => Ok(()),
        }
    }

    fn collect(&mut self, deadline: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        self.note(Call::Collect { deadline });
        into.status.0 &= !Status::HOLDING.0;
        let (age, force) = match (self.act)(Phase::Collect, self.sequence) {
            Act::Fail(fault) => return Err(fault),
            Act::Miss => return Ok(Freshness::Stale),
            Act::MissSays(status) => {
                into.status.0 |= status.0;
                return Ok(Freshness::Stale);
            }
            Act::Serve => (0, STIFFNESS * self.disp),
            Act::Force(force) => (0, force),
            Act::Saturated => {
                into.status.0 |= Status::SATURATED.0;
                (0, STIFFNESS * self.disp)
            }
            Act::Says(status) => {
                into.status.0 |= status.0;
                (0, 1e12)
            }
            Act::Holds => {
                into.status.0 |= Status::HOLDING.0;
                (0, STIFFNESS * self.disp)
            }
            Act::Late(age) => (age, 1e12),
        };
        into.sequence = self.sequence - age;
        into.disp[0] = self.disp;
        into.force[0] = force;
        Ok(Freshness::Fresh)
    }

    fn accepted(&mut self, sequence: u64) -> Result<(), LinkFault> {
        self.note(Call::Accepted(sequence));
        match (self.act)(Phase::Accepted, sequence) {
            Act::Fail(fault) => Err(fault),
            _ => Ok(()),
        }
    }

    fn retire(&mut self, how: Retirement) {
        self.note(Call::Retire(how));
        (self.act)(Phase::Retire, self.sequence);
    }
}

/// Two floors of 2 t on storeys of 3e5 N/m, pushed from the first step on, at 1 kHz; `more` goes into the test file.
pub fn two_floors(steps: u32, more: &str) -> Experiment {
    let duration = f64::from(steps) / 1000.0;
    super::engine::prepare(&format!(
        "{more}\n[time]\nrate_hz = 1000\nduration_s = {duration}\n[integrator]\nlambda = 2\n\
         [structure.shear_building]\nmass_kg = [2e3, 2e3]\nstiffness_n_per_m = [3e5, 3e5]\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = 5\nfrequency_hz = 1\nphase_rad = 1\n\
         [safety]\nzero_s = 0\nramp_s = 0\n"
    ))
    .experiment
}

/// The row of B of storey `number` + 1.
pub fn storey(number: usize) -> Axis {
    Axis::plain(if number == 0 {
        vec![(0, 1.0)]
    } else {
        vec![(number - 1, -1.0), (number, 1.0)]
    })
}

/// Adds the next rig behind `axis`; its behaviour in every phase is `act`.
pub fn attach(
    experiment: &mut Experiment,
    axis: Axis,
    coupling: Coupling,
    log: &Log,
    act: impl FnMut(Phase, u64) -> Act + Send + 'static,
) {
    attach_of(experiment, (axis, 2), coupling, log, act);
}

/// Adds the next rig as the next storey.
pub fn attach_storey(
    experiment: &mut Experiment,
    coupling: Coupling,
    log: &Log,
    act: impl FnMut(Phase, u64) -> Act + Send + 'static,
) {
    let axis = storey(experiment.ports.len());
    attach(experiment, axis, coupling, log, act);
}

/// Adds the next rig behind an axis of a structure with `dofs` degrees of freedom.
pub fn attach_of(
    experiment: &mut Experiment,
    (axis, dofs): (Axis, usize),
    coupling: Coupling,
    log: &Log,
    act: impl FnMut(Phase, u64) -> Act + Send + 'static,
) {
    let number = experiment.ports.len();
    let mut spec = spec(number, axis, coupling, log, act);
    spec.dofs = dofs;
    experiment.ports.push(spec.build().unwrap());
}

/// Adds the next rig, which ends with these exits.
pub fn attach_leaving(
    experiment: &mut Experiment,
    axis: Axis,
    exits: Exits,
    log: &Log,
    act: impl FnMut(Phase, u64) -> Act + Send + 'static,
) {
    let mut spec = spec(experiment.ports.len(), axis, Coupling::Sampled, log, act);
    spec.exits = exits;
    experiment.ports.push(spec.build().unwrap());
}

/// The specification of the port of rig `number`.
pub fn spec(
    number: usize,
    axis: Axis,
    coupling: Coupling,
    log: &Log,
    act: impl FnMut(Phase, u64) -> Act + Send + 'static,
) -> PortSpec {
    let rig = Rig {
        number,
        log: log.clone(),
        coupling,
        act,
        disp: 0.0,
        sequence: 0,
    };
    let name = format!("rig-{}", number + 1);
    PortSpec::new(name, Box::new(rig), 2, vec![AxisSpec::new(axis, STIFFNESS)])
}
