//! The position of a specimen behind a link, from test to test.
//!
//! A specimen reports its position when it is connected, or the file states it. The next test shows whether the specimen stays at
//! the last position of a test: a computed specimen may begin again each time.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::elsewhere;
use gusset_quantity::substructure::Introduction;

/// Position of a specimen across a link, as known from its last tests: shared by the makers of its connections and the
/// readers of the position.
#[derive(Debug, Clone, Default)]
pub struct Whereabouts(Arc<Mutex<Known>>);

#[derive(Debug, Default)]
struct Known {
    /// Empty if it is not known.
    place: Vec<f64>,
    /// Its position at the start of the last test, and at its end.
    found: Vec<f64>,
    left: Vec<f64>,
    /// Whether the specimen stays at its last position: a computed one may begin again in each test. `None` until it is
    /// known.
    stays: Option<bool>,
    /// Position before the first test from the file, for a specimen that does not report its position; empty without one.
    said: Vec<f64>,
    /// The operator declares it a computation: nothing there can break.
    computed: bool,
}

impl Whereabouts {
    fn known(&self) -> MutexGuard<'_, Known> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// For a specimen that does not report its position: the file states it before the first test. Later the position is that of
    /// the last command.
    #[must_use]
    pub(crate) fn said(place: Vec<f64>) -> Self {
        let known = Known {
            place: place.clone(),
            said: place,
            ..Known::default()
        };
        Self(Arc::new(Mutex::new(known)))
    }

    /// For a computed specimen, as the file states: it is assumed at zero if its position is unknown.
    #[must_use]
    pub(crate) fn of_a_computation(self) -> Self {
        self.known().computed = true;
        self
    }

    pub(super) fn is_of_a_computation(&self) -> bool {
        self.known().computed
    }

    /// Position of a specimen that does not report it; empty if it is unknown. A specimen that reported it earlier has shown whether
    /// it stays at the last command.
    pub(super) fn stated(&self) -> Vec<f64> {
        let known = self.known();
        if known.said.is_empty() && known.stays != Some(true) {
            return Vec::new();
        }
        let latest = [&known.left, &known.found, &known.said];
        let latest = latest.into_iter().find(|place| !place.is_empty());
        latest.cloned().unwrap_or_default()
    }

    /// Contradiction between the reported position before the first test and the one in the file.
    pub(super) fn contradicted_by(&self, standing: &[f64]) -> Option<String> {
        let known = self.known();
        let is_first = known.found.is_empty() && known.said.len() == standing.len();
        let differs = is_first && elsewhere(standing, &known.said).is_some();
        differs.then(|| {
            format!(
                "it reports the position {standing:?}, and `stands_at_m` gives {:?} (unit of the axis): the reported \
                 position is used",
                known.said
            )
        })
    }

    /// Its position; empty if it is unknown.
    #[must_use]
    pub(crate) fn place(&self) -> Vec<f64> {
        self.known().place.clone()
    }

    /// A test begins with this introduction, which shows whether the specimen stayed at the end of the test before.
    pub(super) fn begins(&self, introduction: &Introduction) {
        let mut known = self.known();
        let here = &introduction.standing;
        let from_left = distance(here, &known.left);
        let from_found = distance(here, &known.found);
        known.stays = if known.left.is_empty() || from_left == from_found {
            let moves = !(introduction.simulated || introduction.measured);
            known.stays.or(moves.then_some(true))
        } else {
            Some(from_left < from_found)
        };
        known.place.clone_from(here);
        known.found.clone_from(here);
        known.left.clear();
    }

    /// Position of the last command of a test.
    pub(super) fn ends(&self, left: &[f64]) {
        let mut known = self.known();
        if !known.found.is_empty() {
            known.left = left.to_vec();
            match known.stays {
                Some(true) => known.place = left.to_vec(),
                Some(false) => {}
                // The next connection shows it, and the next controller's start is compared with it.
                None => known.place.clear(),
            }
        }
    }
}

fn distance(one: &[f64], other: &[f64]) -> f64 {
    let pairs = one.iter().zip(other);
    pairs.fold(0.0, |most, (one, other)| most.max((one - other).abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests with the specimen's position at their start and end; the known position before each test, and at the end.
    fn believed(simulated: bool, tests: &[(f64, f64)]) -> Vec<Vec<f64>> {
        let whereabouts = Whereabouts::default();
        let mut believed = vec![whereabouts.place()];
        for (found, left) in tests {
            whereabouts.begins(&Introduction {
                standing: vec![*found],
                simulated,
                ..Introduction::default()
            });
            whereabouts.ends(&[*left]);
            believed.push(whereabouts.place());
        }
        believed
    }

    #[test]
    fn place_is_declared_then_commanded() {
        let whereabouts = Whereabouts::said(vec![0.01]);
        assert_eq!(whereabouts.place(), [0.01]);
        let mut found = Vec::new();
        for left in [0.03, -0.02] {
            found.push(whereabouts.stated());
            whereabouts.begins(&Introduction {
                standing: whereabouts.stated(),
                ..Introduction::default()
            });
            whereabouts.ends(&[left]);
        }
        // A test without a command.
        whereabouts.begins(&Introduction {
            standing: whereabouts.stated(),
            ..Introduction::default()
        });
        found.push(whereabouts.stated());
        assert_eq!(found, [[0.01], [0.03], [-0.02]]);
        // A specimen that reported its position once and does not now is at the last command, unless it was moved meanwhile.
        let rig = Whereabouts::default();
        let told = |place: f64| Introduction {
            standing: vec![place],
            ..Introduction::default()
        };
        rig.begins(&told(0.01));
        rig.ends(&[0.03]);
        assert_eq!(rig.stated(), [0.03]);
        rig.begins(&told(0.01));
        rig.ends(&[0.02]);
        assert!(rig.stated().is_empty());
        // A computed specimen without a stated position is assumed at zero each time.
        let computed = Whereabouts::default();
        computed.begins(&Introduction::default());
        computed.ends(&[0.03]);
        assert!(computed.stated().is_empty());
    }

    #[test]
    fn formula_restarts_physical_specimen_stays() {
        let rig = believed(false, &[(0.01, 0.04), (0.04, -0.02)]);
        assert_eq!(rig, [vec![], vec![0.04], vec![-0.02]]);
        let formula = believed(true, &[(0.0, 0.04), (0.0, -0.02)]);
        assert_eq!(formula, [vec![], vec![], vec![0.0]]);
        let stays = believed(true, &[(0.0, 0.04), (0.04, -0.02), (-0.02, 0.03)]);
        assert_eq!(stays, [vec![], vec![], vec![-0.02], vec![0.03]]);
        let driven_home = believed(false, &[(0.0, 0.04), (0.0, 0.03), (0.0, 0.02)]);
        assert_eq!(driven_home, [vec![], vec![0.04], vec![0.0], vec![0.0]]);
    }
}
