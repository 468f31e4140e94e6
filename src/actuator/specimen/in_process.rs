//! A specimen in this process as a substructure: the command is answered by a formula, at once.
//!
//! It commits when the step is accepted and never otherwise. A command whose sequence number was answered already gets
//! the stored answer, whatever its content, and moves nothing. The same holds for a repeated acceptance.

use super::Specimen;
use gusset_quantity::state;
use gusset_quantity::state::{Stateful, Visit};
use gusset_quantity::substructure::{
    Command, Freshness, LinkFault, Measurement, Retirement, Status, Substructure,
};
use gusset_quantity::time::Nanos;

/// A [`Specimen`] behind the hinge. Coupling: lockstep.
#[derive(Debug)]
pub struct InProcess {
    specimen: Box<dyn Specimen>,
    phase: Phase,
    sequence: u64,
    time: f64,
    dt: f64,
    disp: Vec<f64>,
    vel: Vec<f64>,
    measured: Vec<f64>,
    force: Vec<f64>,
    status: Status,
    /// Test time in s of a drill.
    breaks_at: f64,
}

state! {
    InProcess as "in_process" {
        phase, sequence, time, dt, disp, vel, measured, force, status, specimen
    }
    keeps { breaks_at }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// No command has come yet.
    Idle,
    /// The command is in the buffers, unanswered.
    Issued,
    /// Answered; the specimen's trial is that of the command.
    Answered,
    /// Answered and committed.
    Committed,
    /// Lost for good.
    Faulted(LinkFault),
}

impl Stateful for Phase {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        let mut is_committed = match self {
            Self::Idle => false,
            Self::Committed => true,
            Self::Issued | Self::Answered | Self::Faulted(_) => {
                if !visit.restores() {
                    visit.refuse();
                }
                false
            }
        };
        visit.flag(&mut is_committed);
        if visit.restores() {
            *self = if is_committed {
                Self::Committed
            } else {
                Self::Idle
            };
        }
    }
}

impl InProcess {
    /// The specimen in its present committed state, with no command yet.
    #[must_use]
    pub fn new(specimen: Box<dyn Specimen>) -> Self {
        let axes = specimen.axes();
        Self {
            specimen,
            phase: Phase::Idle,
            sequence: 0,
            time: 0.0,
            dt: 0.0,
            disp: vec![0.0; axes],
            vel: vec![0.0; axes],
            measured: vec![0.0; axes],
            force: vec![0.0; axes],
            status: Status::default(),
            breaks_at: f64::INFINITY,
        }
    }

    /// A drill: from this test time in s on, an answer is a panic, as a bug in the specimen's code would be one.
    #[must_use]
    pub const fn breaking_at(mut self, time: f64) -> Self {
        self.breaks_at = time;
        self
    }

    fn fault(&mut self, fault: LinkFault) -> LinkFault {
        self.phase = Phase::Faulted(fault);
        fault
    }
}

/// The one panic that is meant.
#[cold]
fn break_down(time: f64) -> ! {
    panic!("fault injection: the specimen's code fails on purpose at {time} s")
}

/// Status that a specimen reports.
pub fn status(specimen: &dyn Specimen) -> Status {
    let mut status = Status::default();
    if specimen.is_saturated() {
        status.0 |= Status::SATURATED.0;
    }
    if !specimen.is_settled() {
        status.0 |= Status::UNSETTLED.0;
    }
    status
}

impl Substructure for InProcess {
    fn axes(&self) -> usize {
        self.disp.len()
    }

    /// Refused: a number of axes that is not ours, a sequence number that runs backwards.
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        match self.phase {
            Phase::Faulted(fault) => return Err(fault),
            Phase::Answered | Phase::Committed if command.sequence == self.sequence => {
                return Ok(());
            }
            Phase::Issued | Phase::Answered | Phase::Committed
                if command.sequence < self.sequence =>
            {
                return Err(self.fault(LinkFault::Refused));
            }
            _ => {}
        }
        if command.disp.len() != self.disp.len() || command.vel.len() != self.vel.len() {
            return Err(self.fault(LinkFault::Refused));
        }
        self.sequence = command.sequence;
        self.time = command.time;
        self.dt = command.dt;
        let own = self.disp.iter_mut().zip(&mut self.vel);
        for ((own_disp, own_vel), (disp, vel)) in own.zip(command.disp.iter().zip(command.vel)) {
            (*own_disp, *own_vel) = (*disp, *vel);
        }
        self.phase = Phase::Issued;
        Ok(())
    }

    fn collect(
        &mut self,
        _deadline: Nanos,
        into: &mut Measurement,
    ) -> Result<Freshness, LinkFault> {
        match self.phase {
            Phase::Faulted(fault) => return Err(fault),
            // Nothing was asked, so nothing will ever come.
            Phase::Idle => return Err(LinkFault::Timeout),
            Phase::Issued => {
                if self.time >= self.breaks_at {
                    break_down(self.time);
                }
                self.specimen
                    .trial(&self.disp, &self.vel, self.dt, &mut self.force);
                for (measured, disp) in self.measured.iter_mut().zip(&self.disp) {
                    *measured = *disp;
                }
                self.specimen.measured(&mut self.measured);
                self.status = status(&*self.specimen);
                let numbers = self.disp.iter().zip(&self.measured).zip(&self.force);
                let mut finite = true;
                for ((disp, measured), force) in numbers {
                    finite &= disp.is_finite() && measured.is_finite() && force.is_finite();
                }
                if !finite {
                    return Err(self.fault(LinkFault::Diverged));
                }
                self.phase = Phase::Answered;
            }
            Phase::Answered | Phase::Committed => {}
        }
        into.sequence = self.sequence;
        into.time = self.time;
        into.status = self.status;
        let into = into.disp.iter_mut().zip(&mut into.force);
        for ((disp, force), (own_disp, own_force)) in
            into.zip(self.measured.iter().zip(&self.force))
        {
            (*disp, *force) = (*own_disp, *own_force);
        }
        Ok(Freshness::Fresh)
    }

    /// A state is taken between two exchanges: a command that was not accepted is no part of it.
    fn visit_state(&mut self, visit: &mut dyn Visit) -> bool {
        Stateful::visit_state(self, visit);
        true
    }

    /// Refused: a sequence number that was not answered yet.
    fn accepted(&mut self, sequence: u64) -> Result<(), LinkFault> {
        match self.phase {
            Phase::Faulted(fault) => Err(fault),
            Phase::Answered if sequence == self.sequence => {
                self.specimen.commit();
                self.phase = Phase::Committed;
                Ok(())
            }
            Phase::Committed if sequence == self.sequence => Ok(()),
            Phase::Issued | Phase::Answered | Phase::Committed if sequence < self.sequence => {
                Ok(())
            }
            _ => Err(self.fault(LinkFault::Refused)),
        }
    }

    /// A step that was not accepted is taken back.
    fn retire(&mut self, _how: Retirement) {
        self.specimen.revert();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

    use super::*;
    use crate::specimen::{SpecimenLaw, Uniaxial};
    use gusset_numerics::law::LawSpec;
    use gusset_quantity::state::{StateError, TestState};

    fn laws() -> Vec<Box<dyn gusset_numerics::law::Law>> {
        let text = "bouc_wen = { stiffness_n_per_m = 1.19e6, yield_force_n = 1190.0, \
                    post_yield_ratio = 0.1, beta = 0.5, gamma = 0.5, exponent = 2.5 }";
        let spec: LawSpec = toml::from_str(text).unwrap();
        let damper = "linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 500.0 }";
        let damper: LawSpec = toml::from_str(damper).unwrap();
        vec![spec.build().unwrap(), damper.build().unwrap()]
    }

    fn port() -> InProcess {
        InProcess::new(Box::new(Uniaxial::new(laws()).unwrap()))
    }

    fn command<'a>(sequence: u64, disp: &'a [f64], vel: &'a [f64]) -> Command<'a> {
        Command {
            sequence,
            time: sequence as f64 * 0.01,
            dt: 0.01,
            disp,
            vel,
        }
    }

    fn motion(k: u64) -> ([f64; 2], [f64; 2]) {
        let t = k as f64 * 0.1;
        ([5e-3 * libm::sin(t), 1e-3 * t], [0.05 * libm::cos(t), 0.01])
    }

    #[test]
    fn hinge_does_not_change_the_bits() {
        let mut port = port();
        let mut direct = laws();
        let mut measured = Measurement::zeros(2);
        for k in 0..200 {
            let (disp, vel) = motion(k);
            port.issue(&command(k, &disp, &vel)).unwrap();
            let fresh = port.collect(Nanos(0), &mut measured).unwrap();
            port.accepted(k).unwrap();
            assert_eq!(fresh, Freshness::Fresh);
            assert_eq!((measured.sequence, measured.time), (k, k as f64 * 0.01));
            assert_eq!(measured.disp, disp);
            for axis in 0..2 {
                let force = direct[axis].trial(disp[axis], vel[axis], 0.01);
                direct[axis].commit();
                assert_eq!(measured.force[axis].to_bits(), force.to_bits());
            }
        }
    }

    #[test]
    fn repeated_number_gets_the_stored_answer() {
        let (mut once, mut twice) = (port(), port());
        let (mut a, mut b) = (Measurement::zeros(2), Measurement::zeros(2));
        for k in 0..100 {
            let (disp, vel) = motion(k);
            for port in [&mut once, &mut twice] {
                port.issue(&command(k, &disp, &vel)).unwrap();
            }
            once.collect(Nanos(0), &mut a).unwrap();
            once.accepted(k).unwrap();
            twice.collect(Nanos(0), &mut b).unwrap();
            // Before and after the acceptance, with other numbers under the same sequence number.
            twice.issue(&command(k, &[0.1, 0.2], &[0.3, 0.4])).unwrap();
            twice.collect(Nanos(0), &mut b).unwrap();
            assert_eq!(a, b);
            twice.accepted(k).unwrap();
            twice.issue(&command(k, &[-0.1, 0.2], &[0.3, 0.4])).unwrap();
            twice.collect(Nanos(0), &mut b).unwrap();
            twice.accepted(k).unwrap();
            assert_eq!(a, b);
        }
        let state =
            |port: &mut InProcess| TestState::of(|visit| port.specimen.visit_state(visit)).unwrap();
        assert_eq!(state(&mut once), state(&mut twice));
    }

    #[test]
    fn state_is_taken_only_between_exchanges() {
        let (mut one, mut other) = (port(), port());
        let (mut a, mut b) = (Measurement::zeros(2), Measurement::zeros(2));
        let take = |port: &mut InProcess| {
            TestState::of(|visit| {
                Substructure::visit_state(port, visit);
            })
        };
        let mut state = take(&mut one).unwrap();
        for k in 0..50 {
            let (disp, vel) = motion(k);
            one.issue(&command(k, &disp, &vel)).unwrap();
            assert_eq!(take(&mut one), Err(StateError::Pending));
            one.collect(Nanos(0), &mut a).unwrap();
            assert_eq!(take(&mut one), Err(StateError::Pending));
            one.accepted(k).unwrap();
            state = take(&mut one).unwrap();
        }
        // The other one is in the middle of an exchange, which is forgotten.
        other.issue(&command(7, &[0.1, 0.2], &[0.0; 2])).unwrap();
        other.collect(Nanos(0), &mut b).unwrap();
        state
            .restore(|visit| {
                Substructure::visit_state(&mut other, visit);
            })
            .unwrap();
        for k in 49..120 {
            // The last command may come again: it gets the stored answer.
            let (disp, vel) = motion(k);
            for (port, into) in [(&mut one, &mut a), (&mut other, &mut b)] {
                port.issue(&command(k, &disp, &vel)).unwrap();
                port.collect(Nanos(0), into).unwrap();
                port.accepted(k).unwrap();
            }
            assert_eq!(a, b, "{k}");
        }
    }

    #[test]
    fn a_restored_measurement_is_the_same() {
        let mut one = Measurement {
            sequence: 7,
            time: 0.25,
            status: Status::SATURATED,
            disp: vec![-0.0, 1.0],
            force: vec![2.0, 3.0],
        };
        let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
        let mut other = Measurement::zeros(2);
        state.restore(|visit| other.visit_state(visit)).unwrap();
        assert_eq!(other, one);
    }

    /// Counts its calls; its force is the number of commits so far.
    #[derive(Debug, Default, Clone)]
    struct Counter {
        trials: Arc<AtomicU32>,
        commits: Arc<AtomicU32>,
    }

    state! { Counter {} keeps { trials, commits } }

    impl Specimen for Counter {
        fn axes(&self) -> usize {
            1
        }
        fn trial(&mut self, _disp: &[f64], _vel: &[f64], _dt: f64, force: &mut [f64]) {
            self.trials.fetch_add(1, Relaxed);
            force[0] = f64::from(self.commits.load(Relaxed));
        }
        fn commit(&mut self) {
            self.commits.fetch_add(1, Relaxed);
        }
        fn revert(&mut self) {}
        fn reference(&self, _: &mut [f64], _: &mut [f64], _: &mut [f64]) {}
        fn tangent(&self, _: &mut [f64]) {}
        fn bound(
            &self,
            _: &[gusset_numerics::law::Reach],
            _: &mut [f64],
            _: &mut [f64],
        ) -> Result<(), usize> {
            Ok(())
        }
    }

    #[test]
    fn one_number_is_one_trial_and_one_commit() {
        let counter = Counter::default();
        let mut port = InProcess::new(Box::new(counter.clone()));
        let mut into = Measurement::zeros(1);
        for k in 0..10 {
            for _ in 0..3 {
                port.issue(&command(k, &[0.0], &[0.0])).unwrap();
                port.collect(Nanos(0), &mut into).unwrap();
                port.collect(Nanos(0), &mut into).unwrap();
                assert_eq!(into.force[0], k as f64);
                port.accepted(k).unwrap();
                port.accepted(k).unwrap();
            }
            // An acceptance that comes late, of an older step, moves nothing either.
            port.accepted(k.saturating_sub(1)).unwrap();
        }
        assert_eq!(counter.trials.load(Relaxed), 10);
        assert_eq!(counter.commits.load(Relaxed), 10);
    }

    #[test]
    fn rejected_step_leaves_no_trace() {
        let (mut plain, mut disturbed) = (port(), port());
        let (mut a, mut b) = (Measurement::zeros(2), Measurement::zeros(2));
        disturbed
            .issue(&command(0, &[0.02, 0.0], &[0.0; 2]))
            .unwrap();
        disturbed.collect(Nanos(0), &mut b).unwrap();
        let (disp, vel) = motion(3);
        for (port, into) in [(&mut plain, &mut a), (&mut disturbed, &mut b)] {
            port.issue(&command(1, &disp, &vel)).unwrap();
            port.collect(Nanos(0), into).unwrap();
        }
        assert_eq!(a, b);
    }

    #[test]
    fn value_that_is_not_finite_is_a_fault() {
        let mut port = port();
        let mut into = Measurement::zeros(2);
        port.issue(&command(0, &[0.0, f64::NAN], &[0.0; 2]))
            .unwrap();
        let lost = Err(LinkFault::Diverged);
        assert_eq!(port.collect(Nanos(0), &mut into), lost);
        assert_eq!(port.collect(Nanos(0), &mut into), lost);
        assert_eq!(
            port.issue(&command(1, &[0.0; 2], &[0.0; 2])),
            Err(LinkFault::Diverged)
        );
        assert_eq!(port.accepted(0), Err(LinkFault::Diverged));
    }

    #[test]
    fn nonsense_is_refused_without_a_panic() {
        let mut into = Measurement::zeros(2);
        assert_eq!(port().collect(Nanos(0), &mut into), Err(LinkFault::Timeout));
        let wrong_axes = command(0, &[0.0], &[0.0]);
        assert_eq!(port().issue(&wrong_axes), Err(LinkFault::Refused));
        assert_eq!(port().accepted(0), Err(LinkFault::Refused));
        let mut backwards = port();
        backwards.issue(&command(5, &[0.0; 2], &[0.0; 2])).unwrap();
        assert_eq!(
            backwards.issue(&command(4, &[0.0; 2], &[0.0; 2])),
            Err(LinkFault::Refused)
        );
    }

    #[test]
    fn an_exchange_allocates_nothing() {
        let text = "coupled = { stiffness_n_per_m = [[2.0, -1.0], [-1.0, 2.0]] }";
        let coupled: SpecimenLaw = toml::from_str(text).unwrap();
        let mut ports: [Box<dyn Substructure>; 2] = [
            Box::new(port()),
            Box::new(InProcess::new(coupled.build(2).unwrap())),
        ];
        let mut into = Measurement::zeros(2);
        for port in &mut ports {
            let count = allocation_counter::measure(|| {
                for k in 0..500 {
                    let (disp, vel) = motion(k);
                    port.issue(&command(k, &disp, &vel)).unwrap();
                    port.collect(Nanos(0), &mut into).unwrap();
                    port.accepted(k).unwrap();
                }
            });
            assert_eq!(count.count_total, 0);
        }
    }
}
