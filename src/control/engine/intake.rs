//! The energy that a test has taken in: `added_energy_share` compares the energy from the actuators with it (guide:
//! mathematics-errors).
//!
//! Work of the loads, `½ (F[i] + F[i−1])ᵀ (x[i] − x[i−1])`, and of a moving base, `½ (q[i] + q[i−1]) (u[i] − u[i−1])` with the
//! reaction q = ιᵀ(r − F) that it gives; both relative to where x is measured from. The motion that a test begins with is
//! taken in, too: the largest kinetic energy counts. Real-time after `new`.

use gusset_numerics::model::Base;
use gusset_quantity::state;

/// The account of one run, begun by its first step.
#[derive(Debug, Clone)]
pub struct Intake {
    /// J below which nothing is held against it.
    floor: f64,
    /// ι; empty if the base does not move.
    influence: Vec<f64>,
    load: Vec<f64>,
    /// Of the step before.
    last_load: Vec<f64>,
    last_disp: Vec<f64>,
    last_base: f64,
    last_reaction: f64,
    begun: bool,
    work: f64,
    most_work: f64,
    most_motion: f64,
}

// The load of a step is given before the step is noted.
state! {
    Intake as "intake" {
        last_load, last_disp, begun, last_base, last_reaction, work, most_work, most_motion
    }
    keeps { floor, influence, load }
}

/// A step that was closed.
pub(super) struct Closed<'a> {
    pub disp: &'a [f64],
    /// r = F − R.
    pub residual: &'a [f64],
    pub base: Base,
    /// ½ vᵀ M v.
    pub kinetic: f64,
}

impl Intake {
    /// For structures of `dofs` degrees of freedom; `influence` is empty if the base does not move, `floor` in J.
    #[must_use]
    pub fn new(dofs: usize, influence: Vec<f64>, floor: f64) -> Self {
        Self {
            floor,
            influence,
            load: vec![0.0; dofs],
            last_load: vec![0.0; dofs],
            last_disp: vec![0.0; dofs],
            last_base: 0.0,
            last_reaction: 0.0,
            begun: false,
            work: 0.0,
            most_work: 0.0,
            most_motion: 0.0,
        }
    }

    /// The load of the step that is being closed. Real-time: yes.
    #[inline]
    pub(super) fn loaded(&mut self, load: &[f64]) {
        for (to, from) in self.load.iter_mut().zip(load) {
            *to = *from;
        }
    }

    /// Takes note of a closed step, whose load is known. Real-time: yes.
    #[inline]
    pub(super) fn note(&mut self, step: &Closed<'_>) {
        let pushed = step.residual.iter().zip(&self.load).zip(&self.influence);
        let reaction: f64 = pushed.map(|((r, f), share)| share * (r - f)).sum();
        let loads = self.load.iter().zip(&self.last_load);
        let ways = step.disp.iter().zip(&mut self.last_disp);
        let mut work = 0.0;
        for ((f, before), (x, from)) in loads.zip(ways) {
            work += 0.5 * (f + before) * (x - *from);
            *from = *x;
        }
        if self.begun {
            self.work +=
                work + 0.5 * (reaction + self.last_reaction) * (step.base.disp - self.last_base);
        }
        self.begun = true;
        self.most_work = self.most_work.max(self.work);
        self.most_motion = self.most_motion.max(step.kinetic);
        (self.last_reaction, self.last_base) = (reaction, step.base.disp);
        std::mem::swap(&mut self.load, &mut self.last_load);
    }

    /// `added` J in parts of what was taken in so far. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) fn share(&self, added: f64) -> f64 {
        added / (self.most_work + self.most_motion).max(self.floor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::state::{Stateful, TestState};

    /// An oscillator of 1 kg and 4π² N/m with a damper, in relative coordinates under −m·a_g or in absolute ones on a moving
    /// base: what is taken in is what it holds and what the damper has turned into heat.
    fn balance(on_base: bool) -> (f64, f64) {
        let (dt, k, c) = (1e-4, 39.478, 0.5);
        let ground = |t: f64| 0.01 * libm::sin(5.0 * t) * t;
        let (mut x, mut v, mut heat) = (0.0f64, 0.0f64, 0.0);
        let influence = if on_base { vec![1.0] } else { Vec::new() };
        let mut intake = Intake::new(1, influence, 0.0);
        for i in 0..30_000 {
            let t = f64::from(i) * dt;
            let slope = |t: f64| (ground(t + 1e-6) - ground(t - 1e-6)) / 2e-6;
            let accel = (ground(t + 1e-3) - 2.0 * ground(t) + ground(t - 1e-3)) / 1e-6;
            let (u, du, f) = if on_base {
                (ground(t), slope(t), 0.0)
            } else {
                (0.0, 0.0, -accel)
            };
            let r = f - c * (v - du) - k * (x - u);
            let base = Base { disp: u, vel: du };
            let step = Closed {
                disp: &[x],
                residual: &[r],
                base,
                kinetic: 0.0,
            };
            intake.loaded(&[f]);
            intake.note(&step);
            heat += c * (v - du) * (v - du) * dt;
            // Explicit with both terms of the Taylor series: off by dt² at each step.
            x += dt * v + 0.5 * dt * dt * r;
            v += dt * r;
        }
        let u = if on_base { ground(3.0) } else { 0.0 };
        (
            intake.work,
            0.5 * v * v + 0.5 * k * (x - u) * (x - u) + heat,
        )
    }

    #[test]
    fn work_equals_stored_and_dissipated_energy() {
        for on_base in [false, true] {
            let (taken, found) = balance(on_base);
            // First order in a step of 1e-4 of a period, over three of them.
            assert!((taken / found - 1.0).abs() < 5e-3, "{taken} {found}");
            assert!(found > 1e-3, "{found}");
        }
    }

    #[test]
    fn scale_is_the_largest_work_above_a_floor() {
        let mut intake = Intake::new(1, Vec::new(), 10.0);
        assert_eq!(intake.share(5.0), 0.5);
        for (x, kinetic) in [(0.0, 0.0), (1.0, 4.0), (0.0, 1.0)] {
            let step = Closed {
                disp: &[x],
                residual: &[0.0],
                base: Base::default(),
                kinetic,
            };
            intake.loaded(&[16.0]);
            intake.note(&step);
        }
        // 16 J went in and came out again; 4 J were in motion.
        assert_eq!(intake.share(5.0), 0.25);
    }

    #[test]
    fn restored_account_has_equal_bits() {
        let step = |intake: &mut Intake, k: u32| {
            let at = |phase: f64| libm::sin(0.1 * f64::from(k) + phase);
            intake.loaded(&[at(0.0), at(1.0)]);
            intake.note(&Closed {
                disp: &[at(2.0), at(3.0)],
                residual: &[at(4.0), at(5.0)],
                base: Base {
                    disp: at(6.0),
                    vel: 0.0,
                },
                kinetic: at(7.0),
            });
            intake.share(1.0).to_bits()
        };
        for taken in [0, 1, 50] {
            let build = || Intake::new(2, vec![1.0, 0.5], 1e-6);
            let (mut one, mut other) = (build(), build());
            (0..taken).for_each(|k| {
                step(&mut one, k);
            });
            let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
            step(&mut other, 7);
            state.restore(|visit| other.visit_state(visit)).unwrap();
            for k in taken..taken + 50 {
                assert_eq!(step(&mut one, k), step(&mut other, k), "{taken} {k}");
            }
        }
    }
}
