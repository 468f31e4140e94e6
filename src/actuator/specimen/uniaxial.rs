//! Axes that do not know of each other: one law each.

use super::Specimen;
use gusset_numerics::law::{Law, LawError, Reach};
use gusset_quantity::state;

/// A specimen with one independent law per axis. Declares no mass.
#[derive(Debug)]
pub(crate) struct Uniaxial {
    laws: Vec<Box<dyn Law>>,
}

state! { Uniaxial { laws } }

impl Uniaxial {
    /// One axis per law, in the order given.
    ///
    /// # Errors
    /// No law at all.
    pub(crate) fn new(laws: Vec<Box<dyn Law>>) -> Result<Self, LawError> {
        if laws.is_empty() {
            return Err(LawError::Size {
                name: "laws",
                what: "entries",
                found: 0,
                wanted: 1,
            });
        }
        Ok(Self { laws })
    }
}

/// Writes `values` on the diagonal of an n × n matrix and zeros elsewhere.
fn diagonal(matrix: &mut [f64], axes: usize, values: impl Iterator<Item = f64>) {
    matrix.fill(0.0);
    for (entry, value) in matrix.iter_mut().step_by(axes + 1).zip(values) {
        *entry = value;
    }
}

impl Specimen for Uniaxial {
    fn axes(&self) -> usize {
        self.laws.len()
    }

    fn trial(&mut self, disp: &[f64], vel: &[f64], dt: f64, force: &mut [f64]) {
        let inputs = disp.iter().zip(vel);
        for ((law, (disp, vel)), force) in self.laws.iter_mut().zip(inputs).zip(force) {
            *force = law.trial(*disp, *vel, dt);
        }
    }

    fn commit(&mut self) {
        for law in &mut self.laws {
            law.commit();
        }
    }

    fn revert(&mut self) {
        for law in &mut self.laws {
            law.revert();
        }
    }

    fn reference(&self, stiffness: &mut [f64], damping: &mut [f64], mass: &mut [f64]) {
        let (axes, laws) = (self.axes(), self.laws.iter());
        let tangents = laws.map(|law| law.reference());
        diagonal(stiffness, axes, tangents.clone().map(|t| t.stiffness));
        diagonal(damping, axes, tangents.map(|t| t.damping));
        mass.fill(0.0);
    }

    fn tangent(&self, stiffness: &mut [f64]) {
        let tangents = self.laws.iter().map(|law| law.solver_tangent().stiffness);
        diagonal(stiffness, self.axes(), tangents);
    }

    fn tangent_damping(&self, damping: &mut [f64]) {
        let least = self.laws.iter().map(|law| law.least_damping());
        diagonal(damping, self.axes(), least);
    }

    fn rest_damping(&self, damping: &mut [f64]) {
        let at_rest = self.laws.iter().map(|law| law.rest_damping());
        diagonal(damping, self.axes(), at_rest);
    }

    fn bound(
        &self,
        reach: &[Reach],
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) -> Result<(), usize> {
        stiffness.fill(0.0);
        damping.fill(0.0);
        let axes = self.axes();
        let entries = stiffness.iter_mut().zip(damping).step_by(axes + 1);
        for ((axis, law), (stiffness, damping)) in self.laws.iter().enumerate().zip(entries) {
            let reach = reach.get(axis).copied().unwrap_or_default();
            let (Some(k), Some(c)) = law.bound(reach) else {
                return Err(axis);
            };
            (*stiffness, *damping) = (k, c);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_numerics::law::LawSpec;
    use gusset_quantity::state::{Stateful, TestState};

    fn two() -> Uniaxial {
        let hardening = "square_root = { stiffness_n_per_m = 1e7, hardening_per_sqrt_m = 1.0 }";
        let plastic = "bilinear = { stiffness_n_per_m = 1.19e6, yield_force_n = 1190.0, post_yield_ratio = 0.1 }";
        let build = |text| toml::from_str::<LawSpec>(text).unwrap().build().unwrap();
        Uniaxial::new(vec![build(plastic), build(hardening)]).unwrap()
    }

    #[test]
    fn each_axis_follows_its_own_law_and_memory() {
        let mut specimen = two();
        let mut force = [0.0; 2];
        specimen.trial(&[3e-3, 0.01], &[0.0; 2], 0.0, &mut force);
        assert!((force[0] - 1428.0).abs() < 1e-9);
        assert_eq!(force[1], 110_000.0);
        let mut tangent = [9.0; 4];
        specimen.tangent(&mut tangent);
        assert!((tangent[0] - 1.19e5).abs() < 1e-9 && (tangent[3] - 1.15e7).abs() < 1e-8);
        assert_eq!((tangent[1], tangent[2]), (0.0, 0.0));
        specimen.commit();
        let state = TestState::of(|visit| specimen.visit_state(visit)).unwrap();
        let mut other = two();
        state.restore(|visit| other.visit_state(visit)).unwrap();
        let (mut a, mut b) = ([0.0; 2], [0.0; 2]);
        specimen.trial(&[1e-3, 0.0], &[0.0; 2], 0.0, &mut a);
        other.trial(&[1e-3, 0.0], &[0.0; 2], 0.0, &mut b);
        assert_eq!(a, b);
    }

    #[test]
    fn the_axis_that_lacks_a_reach_is_named() {
        let specimen = two();
        let (mut stiffness, mut damping) = ([7.0; 4], [7.0; 4]);
        let reach = [Reach::default(); 2];
        assert_eq!(specimen.bound(&reach, &mut stiffness, &mut damping), Err(1));
        let reach = [
            Reach::default(),
            Reach {
                disp: Some(0.04),
                vel: None,
            },
        ];
        assert_eq!(specimen.bound(&reach, &mut stiffness, &mut damping), Ok(()));
        assert_eq!(stiffness[0], 1.19e6);
        assert!((stiffness[3] - 1.3e7).abs() < 1e-8);
        assert_eq!((stiffness[1], stiffness[2], damping), (0.0, 0.0, [0.0; 4]));
    }
}
