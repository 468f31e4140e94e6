//! A computed specimen behind a server.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use gusset_actuator::specimen::{Specimen, status};
use gusset_quantity::state::TestState;
use gusset_quantity::substructure::{
    Command, Freshness, Introduction, LinkFault, Measurement, Retirement, Substructure, Unavailable,
};
use gusset_quantity::time::Nanos;

/// State of a computed specimen after the last test: shared by its makers and the readers of its position.
#[derive(Debug, Clone, Default)]
pub struct Memory {
    left: Arc<Mutex<Option<Left>>>,
    /// A test has armed the specimen since this process made it.
    was_armed: Arc<AtomicBool>,
}

#[derive(Debug, Clone)]
struct Left {
    state: TestState,
    disp: Vec<f64>,
}

/// The committed state of a specimen; an empty one if the specimen does not visit the same values each time.
fn state_of(specimen: &mut dyn Specimen) -> TestState {
    let mut state = TestState::with_room(|visit| specimen.visit_state(visit));
    let _it_is_empty_then = state.take(|visit| specimen.visit_state(visit));
    state
}

/// Restores the specimen. The state of another specimen changes nothing.
fn put_back(specimen: &mut dyn Specimen, state: &TestState) {
    let _it_is_of_another = state.restore(|visit| specimen.visit_state(visit));
}

impl Memory {
    /// That of `specimen` after it was moved to `disp`, one displacement per axis in its own units.
    #[cfg(any(test, feature = "test-doubles"))]
    #[must_use]
    pub(crate) fn of(specimen: &mut dyn Specimen, disp: &[f64]) -> Self {
        let still = vec![0.0; disp.len()];
        specimen.trial(disp, &still, 0.0, &mut still.clone());
        specimen.commit();
        let left = Left {
            state: state_of(specimen),
            disp: disp.to_vec(),
        };
        Self {
            left: Arc::new(Mutex::new(Some(left))),
            ..Self::default()
        }
    }

    /// True if a test of this process has armed the specimen: the memory holds the state at the end of a test.
    #[must_use]
    pub(crate) fn is_of_a_test(&self) -> bool {
        self.was_armed.load(Ordering::Acquire)
    }

    fn recall(&self) -> Option<Left> {
        let left = self.left.lock().unwrap_or_else(PoisonError::into_inner);
        left.clone()
    }

    /// Its position; `None` before the first test.
    #[must_use]
    pub(crate) fn disp(&self) -> Option<Vec<f64>> {
        self.recall().map(|left| left.disp)
    }
}

/// A specimen that is computed.
pub struct Computed {
    specimen: Box<dyn Specimen>,
    /// The state and the place in which a test finds it.
    virgin: TestState,
    stands: Vec<f64>,
    memory: Option<Memory>,
    /// A test begins with the state at the end of the last one.
    remembers: bool,
    /// It was driven since the last commit.
    driven: bool,
    /// The command in force: its number, the test time since the last commit, displacements and velocities.
    sequence: u64,
    elapsed: f64,
    disp: Vec<f64>,
    vel: Vec<f64>,
    committed: Vec<f64>,
}

impl std::fmt::Debug for Computed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Computed").finish_non_exhaustive()
    }
}

impl Computed {
    /// A specimen in its present committed state, which is that of every test, or of the first one if it `remembers`.
    #[must_use]
    pub fn new(mut specimen: Box<dyn Specimen>, remembers: bool) -> Self {
        let axes = specimen.axes();
        Self {
            virgin: state_of(specimen.as_mut()),
            stands: vec![0.0; axes],
            memory: None,
            remembers,
            driven: false,
            sequence: 0,
            elapsed: 0.0,
            disp: vec![0.0; axes],
            vel: vec![0.0; axes],
            committed: vec![0.0; axes],
            specimen,
        }
    }

    /// Recalls the state that the last test left, and keeps that of this one.
    #[must_use]
    pub(crate) fn recalling(mut self, memory: Memory) -> Self {
        if let Some(left) = memory.recall() {
            put_back(self.specimen.as_mut(), &left.state);
            self.virgin = left.state;
            self.committed.clone_from(&left.disp);
            self.stands = left.disp;
        }
        self.memory = Some(memory);
        self
    }

    /// Initial stiffness and mass, n × n by columns.
    #[must_use]
    pub fn reference(&self) -> (Vec<f64>, Vec<f64>) {
        let n = self.disp.len() * self.disp.len();
        let (mut stiffness, mut damping) = (vec![0.0; n], vec![0.0; n]);
        let mut mass = vec![0.0; n];
        self.specimen
            .reference(&mut stiffness, &mut damping, &mut mass);
        (stiffness, mass)
    }
}

impl Substructure for Computed {
    fn axes(&self) -> usize {
        self.disp.len()
    }

    fn commanded_every(&mut self, seconds: f64) {
        self.specimen.commanded_every(seconds);
    }

    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        // A specimen that does not remember forgets the test before when it is armed.
        let standing = if self.remembers {
            &self.committed
        } else {
            &self.stands
        };
        Ok(Introduction {
            standing: standing.clone(),
            ..Introduction::default()
        })
    }

    fn arm(&mut self, _: u64, _: &[f64], _: &mut dyn FnMut() -> bool) -> Result<bool, LinkFault> {
        if !self.remembers {
            put_back(self.specimen.as_mut(), &self.virgin);
            self.committed.copy_from_slice(&self.stands);
        }
        self.specimen.revert();
        self.driven = false;
        if let Some(memory) = &self.memory {
            memory.was_armed.store(true, Ordering::Release);
        }
        Ok(true)
    }

    fn at_rest(&mut self, into: &mut Measurement) -> bool {
        self.vel.fill(0.0);
        self.specimen
            .trial(&self.committed, &self.vel, 0.0, &mut into.force);
        into.disp.copy_from_slice(&self.committed);
        self.specimen.measured(&mut into.disp);
        self.specimen.revert();
        true
    }

    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        (self.sequence, self.elapsed) = (command.sequence, command.dt);
        let own = self.disp.iter_mut().zip(&mut self.vel);
        for ((own_disp, own_vel), (disp, vel)) in own.zip(command.disp.iter().zip(command.vel)) {
            (*own_disp, *own_vel) = (*disp, *vel);
        }
        self.driven = true;
        Ok(())
    }

    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        into.sequence = self.sequence;
        for (measured, disp) in into.disp.iter_mut().zip(&self.disp) {
            *measured = *disp;
        }
        self.specimen
            .trial(&self.disp, &self.vel, self.elapsed, &mut into.force);
        self.specimen.measured(&mut into.disp);
        into.status = status(self.specimen.as_ref());
        Ok(Freshness::Fresh)
    }

    fn accepted(&mut self, _: u64) -> Result<(), LinkFault> {
        self.specimen.commit();
        self.committed.copy_from_slice(&self.disp);
        self.driven = false;
        Ok(())
    }

    fn revert(&mut self) {
        self.specimen.revert();
        self.driven = false;
    }

    fn tangent(&self, stiffness: &mut [f64]) -> bool {
        self.specimen.tangent(stiffness);
        true
    }

    fn retire(&mut self, _: Retirement) {
        let is_kept = self.remembers || self.memory.is_some();
        if is_kept && self.driven {
            // However the test ended, it is where it was driven last.
            self.specimen.commit();
            self.committed.copy_from_slice(&self.disp);
        } else {
            self.specimen.revert();
        }
        if let Some(memory) = &self.memory {
            let left = Left {
                state: state_of(self.specimen.as_mut()),
                disp: self.committed.clone(),
            };
            *memory.left.lock().unwrap_or_else(PoisonError::into_inner) = Some(left);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_actuator::specimen::SpecimenLaw;
    use gusset_numerics::law::LawSpec;

    fn spring() -> Box<dyn Specimen> {
        let spec: LawSpec = toml::from_str("linear = { stiffness_n_per_m = 4e5 }").unwrap();
        SpecimenLaw::Law(spec).build(1).unwrap()
    }

    /// A test that moves to these places, commits all but the last, and ends at once; the position in the law's introduction.
    fn goes_to(law: &mut Computed, places: &[f64]) -> Vec<f64> {
        let introduced = law.connect().unwrap().standing;
        law.arm(0, &introduced, &mut || true).unwrap();
        let mut measured = Measurement::zeros(1);
        for (index, place) in places.iter().enumerate() {
            if index > 0 {
                law.accepted(index as u64 - 1).unwrap();
            }
            let command = Command {
                sequence: index as u64,
                time: 0.0,
                dt: 0.01,
                disp: &[*place],
                vel: &[0.0],
            };
            law.issue(&command).unwrap();
            law.collect(Nanos(0), &mut measured).unwrap();
        }
        law.retire(Retirement::Tripped);
        introduced
    }

    /// A client that only connects leaves no state of a test, and neither does the initial position.
    #[test]
    fn memory_begins_with_the_first_arming() {
        let memory = Memory::of(spring().as_mut(), &[0.01]);
        let mut law = Computed::new(spring(), true).recalling(memory.clone());
        law.connect().unwrap();
        law.retire(Retirement::Operator);
        assert!(!memory.is_of_a_test());
        goes_to(&mut law, &[0.01]);
        assert!(memory.is_of_a_test());
    }

    #[test]
    fn memory_keeps_the_last_position() {
        // By itself from test to test, or one for each test, as over our own protocol.
        for remembers in [true, false] {
            let memory = Memory::default();
            let law = || Computed::new(spring(), remembers).recalling(memory.clone());
            assert_eq!(goes_to(&mut law(), &[0.01, 0.02]), [0.0]);
            assert_eq!(memory.disp(), Some(vec![0.02]));
            assert_eq!(goes_to(&mut law(), &[]), [0.02]);
            assert_eq!(memory.disp(), Some(vec![0.02]), "it was not driven");
        }
    }

    #[test]
    fn no_memory_starts_where_the_test_does() {
        let mut law = Computed::new(spring(), false);
        goes_to(&mut law, &[0.01, 0.02, 0.03]);
        assert_eq!(goes_to(&mut law, &[]), [0.0]);
    }
}
