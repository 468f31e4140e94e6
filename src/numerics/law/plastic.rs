//! Bilinear spring with kinematic hardening. Without hardening it is perfectly plastic, or Coulomb friction.
//!
//! It is a spring in series with a slider, and a spring beside both.
//! The state is the displacement of the slider, and the force is a function of it, so nothing drifts in a long test.
//! For a straight path the return map is exact: one step equals any number of partial steps.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::domain::{fraction, positive, yield_disp};
use super::{Law, LawError, Reach, Tangent};
use gusset_quantity::state;
use gusset_quantity::state::{Stateful, Visit};

/// Bilinear spring with kinematic hardening. The stiffness is k up to the yield force and b k
/// beyond it. Unloading has stiffness k over twice the yield force. With b = 0 it is perfectly plastic.
/// It is then also Coulomb friction with slip at the yield force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct BilinearSpec {
    /// Elastic stiffness k, greater than 0.
    #[schemars(example = 1.0e6)]
    pub stiffness_n_per_m: f64,
    /// Force at first yield, greater than 0.
    #[schemars(example = 2.0e4)]
    pub yield_force_n: f64,
    /// Stiffness ratio b after yield, from 0 to 1.
    #[schemars(example = 0.1)]
    pub post_yield_ratio: f64,
}

impl BilinearSpec {
    /// # Errors
    /// A parameter outside its domain.
    pub fn build(&self) -> Result<Bilinear, LawError> {
        let stiffness = positive("stiffness_n_per_m", self.stiffness_n_per_m)?;
        let yield_force = positive("yield_force_n", self.yield_force_n)?;
        Ok(Bilinear {
            stiffness,
            yield_force,
            yield_disp: yield_disp("yield_force_n", yield_force, stiffness)?,
            ratio: fraction("post_yield_ratio", self.post_yield_ratio)?,
            committed: Slider::default(),
            trial: Slider::default(),
        })
    }
}

/// See [`BilinearSpec`].
#[derive(Debug, Clone)]
pub struct Bilinear {
    stiffness: f64,
    yield_force: f64,
    yield_disp: f64,
    ratio: f64,
    committed: Slider,
    trial: Slider,
}

state! {
    Bilinear as "bilinear" { committed } keeps { stiffness, yield_force, yield_disp, ratio, trial }
    restored { *trial = *committed; }
}

/// A bilinear law as plain numbers, for loops over many.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SliderForm {
    /// k in N/m.
    pub stiffness: f64,
    /// In N.
    pub yield_force: f64,
    /// In m.
    pub yield_disp: f64,
    /// b.
    pub ratio: f64,
}

impl Bilinear {
    pub(crate) fn form(&self) -> SliderForm {
        SliderForm {
            stiffness: self.stiffness,
            yield_force: self.yield_force,
            yield_disp: self.yield_disp,
            ratio: self.ratio,
        }
    }

    /// Position of the committed slider and its last motion: see [`Slider::to_number`].
    pub(crate) fn slider(&self) -> (f64, f64) {
        (self.committed.disp, self.committed.to_number())
    }

    /// Commits another slider; the last trial is that one, too.
    pub(crate) fn set_slider(&mut self, disp: f64, motion: f64) {
        self.committed = Slider::from_numbers(disp, motion);
        self.trial = self.committed;
    }

    /// The slider and the force at `disp`, on a straight path from the committed slider.
    #[inline]
    fn at(&self, disp: f64) -> (Slider, f64) {
        let stretch = disp - self.committed.disp;
        let (moved, slipping, force) = if stretch > self.yield_disp {
            (disp - self.yield_disp, true, self.yield_force)
        } else if stretch < -self.yield_disp {
            (disp + self.yield_disp, true, -self.yield_force)
        } else {
            (self.committed.disp, false, self.stiffness * stretch)
        };
        // After slipping the committed displacement is where the spring is at its yield: there a trial that repeats it keeps
        // the slider, but for rounding.
        let rounding = 2.0 * f64::EPSILON * disp.abs().max(self.yield_disp);
        let repeats = self.committed.flows && stretch.abs() >= self.yield_disp - rounding;
        let slider = Slider {
            disp: moved,
            slipping,
            flows: slipping || repeats,
        };
        let sum = self.ratio * self.stiffness * disp + (1.0 - self.ratio) * force;
        (slider, sum)
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct Slider {
    /// Position of the slider, in m.
    disp: f64,
    /// It moved on the way here.
    slipping: bool,
    /// It moved in the last motion. A trial that repeats the committed displacement is no motion.
    flows: bool,
}

impl Slider {
    /// `slipping` and `flows` as one number: 0, 1 (both) or 2 (only `flows`). States of older records have 0 or 1.
    fn to_number(self) -> f64 {
        f64::from(u8::from(self.slipping) + 2 * u8::from(self.flows && !self.slipping))
    }

    /// What slips flows.
    fn from_numbers(disp: f64, number: f64) -> Self {
        Self {
            disp,
            slipping: number == 1.0,
            flows: number != 0.0,
        }
    }
}

impl Stateful for Slider {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        let mut motion = self.to_number();
        visit.number(&mut self.disp);
        visit.number(&mut motion);
        *self = Self::from_numbers(self.disp, motion);
    }
}

impl Law for Bilinear {
    fn trial(&mut self, disp: f64, _vel: f64, _dt: f64) -> f64 {
        let (slider, force) = self.at(disp);
        self.trial = slider;
        force
    }

    fn step(&mut self, disp: f64, _vel: f64, _dt: f64) -> f64 {
        let (slider, force) = self.at(disp);
        (self.trial, self.committed) = (slider, slider);
        force
    }

    fn commit(&mut self) {
        self.committed = self.trial;
    }

    fn revert(&mut self) {
        self.trial = self.committed;
    }

    fn tangent(&self) -> Tangent {
        let ratio = if self.trial.slipping { self.ratio } else { 1.0 };
        Tangent::elastic(ratio * self.stiffness)
    }

    fn solver_tangent(&self) -> Tangent {
        let ratio = if self.trial.flows { self.ratio } else { 1.0 };
        Tangent::elastic(ratio * self.stiffness)
    }

    fn reference(&self) -> Tangent {
        Tangent::elastic(self.stiffness)
    }

    fn bound(&self, _reach: Reach) -> (Option<f64>, Option<f64>) {
        (Some(self.stiffness), Some(0.0))
    }

    fn bilinear(&mut self) -> Option<&mut Bilinear> {
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::state::{Stateful, TestState};

    /// ∮ f du over one closed cycle 0 → U → −U → U, after the first quarter, in `n` steps a leg; exact for a path of
    /// straight pieces up to the two pieces in which the law has its kink.
    fn cycle_energy(law: &mut Bilinear, amplitude: f64, n: u32) -> f64 {
        law.trial(amplitude, 0.0, 0.0);
        law.commit();
        let mut energy = 0.0;
        let mut last = (amplitude, law.trial(amplitude, 0.0, 0.0));
        for (from, to) in [(amplitude, -amplitude), (-amplitude, amplitude)] {
            for i in 1..=n {
                let disp = from + (to - from) * f64::from(i) / f64::from(n);
                let force = law.trial(disp, 0.0, 0.0);
                law.commit();
                energy += 0.5 * (force + last.1) * (disp - last.0);
                last = (disp, force);
            }
        }
        energy
    }

    #[test]
    fn bilinear_loop_is_as_published() {
        let spec = BilinearSpec {
            stiffness_n_per_m: 1.19e6,
            yield_force_n: 1190.0,
            post_yield_ratio: 0.1,
        };
        let mut law = spec.build().unwrap();
        assert!((law.trial(3e-3, 0.0, 0.0) - 1428.0).abs() < 1e-9);
        // 4 (1 − b) F_y (U − u_y); the legs of 6 mm in 3000 steps of 2 µm meet the kinks at 1 mm and −1 mm, where a
        // trapezoid errs by at most k h²/8 = 6e-7 J if the kink were inside a step.
        let energy = cycle_energy(&mut law, 3e-3, 3000);
        assert!((energy - 8.568).abs() < 2e-6, "{energy}");
    }

    /// OpenSees' Steel01 keeps its tangent where a trial repeats the committed strain.
    #[test]
    fn repeated_displacement_keeps_the_tangent() {
        let spec = BilinearSpec {
            stiffness_n_per_m: 8000.0,
            yield_force_n: 60.0,
            post_yield_ratio: 0.05,
        };
        let mut law = spec.build().unwrap();
        let k = 8000.0;
        for (disp, tangent) in [
            (0.0, k),
            (0.005, k),
            (0.005, k),
            (0.0301, 400.0),
            (0.0301, 400.0),
            (0.0301, 400.0),
            (0.02, k),
            (0.02, k),
            (0.0017, 400.0),
            (0.0017, 400.0),
            (0.003, k),
        ] {
            law.trial(disp, 0.0, 0.01);
            assert_eq!(law.solver_tangent().stiffness, tangent, "{disp}");
            law.commit();
        }
        // Wherever the slider is, and from a restored state, too.
        for i in 1..2000 {
            let disp = 0.01 * libm::sin(0.7 * f64::from(i)) + 1e-5 * f64::from(i);
            law.trial(disp, 0.0, 0.01);
            let moved = law.tangent();
            law.commit();
            for _ in 0..2 {
                let state = TestState::of(|visit| law.visit_state(visit)).unwrap();
                law = spec.build().unwrap();
                state.restore(|visit| law.visit_state(visit)).unwrap();
                law.trial(disp, 0.0, 0.01);
                assert_eq!(law.solver_tangent(), moved, "{i}");
                law.commit();
            }
        }
    }

    #[test]
    fn perfect_plasticity_unloads_elastically() {
        let mut law = BilinearSpec {
            stiffness_n_per_m: 2e6,
            yield_force_n: 1000.0,
            post_yield_ratio: 0.0,
        }
        .build()
        .unwrap();
        assert_eq!(law.trial(0.25e-3, 0.0, 0.0), 500.0);
        assert_eq!(law.trial(7e-3, 0.0, 0.0), 1000.0);
        assert_eq!(law.tangent().stiffness, 0.0);
        law.commit();
        assert!((law.trial(6.75e-3, 0.0, 0.0) - 500.0).abs() < 1e-9);
        assert_eq!(law.tangent().stiffness, 2e6);
        assert_eq!(law.trial(5.9e-3, 0.0, 0.0), -1000.0);
    }

    #[test]
    fn friction_cycle_dissipates_four_slips() {
        let (force, stiffness, amplitude) = (750.0, 5e7, 0.02);
        let mut law = BilinearSpec {
            stiffness_n_per_m: stiffness,
            yield_force_n: force,
            post_yield_ratio: 0.0,
        }
        .build()
        .unwrap();
        let exact = 4.0 * force * (amplitude - force / stiffness);
        // Steps of 10 µm; the two kinks err by at most k h²/8 each.
        let energy = cycle_energy(&mut law, amplitude, 4000);
        assert!(
            (energy - exact).abs() < 2.0 * stiffness * 1e-10 / 8.0 + 1e-9,
            "{energy} {exact}"
        );
    }
}
