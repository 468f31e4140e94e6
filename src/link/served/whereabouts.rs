//! Where a specimen across a link stands, from test to test.
//!
//! A specimen says it when it is connected, or somebody has stated it. Whether it stays where a test leaves it shows with the next
//! test: a computed specimen may begin again each time.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::elsewhere;
use crate::substructure::Introduction;

/// Where a specimen across a link stands, as far as its last tests tell: shared by those who make its connections and those
/// who ask.
#[derive(Debug, Clone, Default)]
pub struct Whereabouts(Arc<Mutex<Known>>);

#[derive(Debug, Default)]
struct Known {
    /// Empty if it is not known.
    place: Vec<f64>,
    /// Where the last test found it, and where it left it.
    found: Vec<f64>,
    left: Vec<f64>,
    /// Whether it stays where a test leaves it: a formula may begin anew each time. None until it is known.
    stays: Option<bool>,
    /// It cannot tell where it stands, and stood here before the first test, as somebody says; empty if nobody does.
    said: Vec<f64>,
    /// Somebody says that it is a computation: nothing there can break.
    computed: bool,
}

impl Whereabouts {
    fn known(&self) -> MutexGuard<'_, Known> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Of what cannot tell where it stands: somebody says where that is before the first test. From then on it is where it was
    /// told to go last.
    #[must_use]
    pub fn said(place: Vec<f64>) -> Self {
        let known = Known {
            place: place.clone(),
            said: place,
            ..Known::default()
        };
        Self(Arc::new(Mutex::new(known)))
    }

    /// Of what somebody says to be a computation: it is believed at zero where nobody knows its place.
    #[must_use]
    pub fn of_a_computation(self) -> Self {
        self.known().computed = true;
        self
    }

    pub(super) fn is_of_a_computation(&self) -> bool {
        self.known().computed
    }

    /// Where one stands that cannot tell; empty if nobody knows. One that could tell earlier is known to stay where it is left, or
    /// is not.
    pub(super) fn stated(&self) -> Vec<f64> {
        let known = self.known();
        if known.said.is_empty() && known.stays != Some(true) {
            return Vec::new();
        }
        let latest = [&known.left, &known.found, &known.said];
        let latest = latest.into_iter().find(|place| !place.is_empty());
        latest.cloned().unwrap_or_default()
    }

    /// What a specimen says of itself before its first test, where the file says otherwise.
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

    /// Where it stands; empty if nothing is known.
    #[must_use]
    pub fn place(&self) -> Vec<f64> {
        self.known().place.clone()
    }

    /// A test begins and hears this. What it finds shows whether the last one's end is where it stayed.
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

    /// It was told to go there last.
    pub(super) fn ends(&self, left: &[f64]) {
        let mut known = self.known();
        if !known.found.is_empty() {
            known.left = left.to_vec();
            match known.stays {
                Some(true) => known.place = left.to_vec(),
                Some(false) => {}
                // Its next connection shows it. Whoever goes on where the test ended, or begins anew, is held against that.
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

    /// Tests that find the specimen here and leave it there; where it is believed to stand before each, and at the end.
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
    fn what_cannot_tell_is_where_somebody_says_and_then_where_it_was_told_to_go() {
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
        // Nobody told it anything in this one.
        whereabouts.begins(&Introduction {
            standing: whereabouts.stated(),
            ..Introduction::default()
        });
        found.push(whereabouts.stated());
        assert_eq!(found, [[0.01], [0.03], [-0.02]]);
        // Where a rig told once and does not now, it is where it was left; where it was moved meanwhile nobody knows.
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
        // Nobody says where a computation stands: it is believed at zero each time.
        let computed = Whereabouts::default();
        computed.begins(&Introduction::default());
        computed.ends(&[0.03]);
        assert!(computed.stated().is_empty());
    }

    #[test]
    fn a_rig_stays_where_it_was_left_and_a_formula_where_it_is_found_anew() {
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
