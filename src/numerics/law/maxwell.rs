//! Maxwell element: a spring in series with a fluid damper, as a damper in its brace, or a material that relaxes.
//!
//! The state is the force f: df/dt = k (v − sgn(f) (|f|/c)^(1/a)), with the velocity v of the straight path. The linear damper is
//! exact. Any other takes a fixed number of steps with Alexander's method of third order (1977, SIAM J. Numer. Anal. 14(6), equation 3.1),
//! whose stages are solved by Newton's method. Its start is above the root of a convex function, so it cannot fail.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::domain::{inside, positive};
use super::{Law, LawError, Reach, Tangent};
use gusset_quantity::state;

/// Steps of a path, and Newton steps of a stage.
const STEPS: u32 = 4;
const NEWTON_STEPS: u32 = 6;

/// Spring in series with a fluid damper of force c |v|^a sgn(v), as a damper in its brace. A steady displacement relaxes it. Its
/// initial stiffness is that of the spring. A static load before the test leaves it without force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MaxwellSpec {
    /// Stiffness k of the spring, greater than 0.
    #[schemars(example = 2.0e7)]
    pub stiffness_n_per_m: f64,
    /// Force c of the damper at a velocity of 1 m/s, greater than 0. Its unit is N (s/m)^a.
    #[schemars(example = 5.0e5)]
    pub force_at_unit_velocity_n: f64,
    /// Exponent a, from 0.1 to 1. Default: a linear damper.
    #[serde(default = "linear")]
    #[schemars(example = 0.4)]
    pub exponent: f64,
}

const fn linear() -> f64 {
    1.0
}

impl MaxwellSpec {
    /// # Errors
    /// A parameter outside its domain.
    pub(super) fn build(&self) -> Result<Maxwell, LawError> {
        let exponent = inside(
            "exponent",
            self.exponent,
            (0.1..=1.0).contains(&self.exponent),
            "from 0.1 to 1",
        )?;
        Ok(Maxwell {
            stiffness: positive("stiffness_n_per_m", self.stiffness_n_per_m)?,
            coefficient: positive("force_at_unit_velocity_n", self.force_at_unit_velocity_n)?,
            exponent,
            disp: 0.0,
            force: 0.0,
            trial: Trial::default(),
        })
    }
}

/// See [`MaxwellSpec`].
#[derive(Debug, Clone)]
pub struct Maxwell {
    stiffness: f64,
    coefficient: f64,
    exponent: f64,
    /// Committed.
    disp: f64,
    force: f64,
    trial: Trial,
}

#[derive(Debug, Clone, Copy, Default)]
struct Trial {
    disp: f64,
    force: f64,
    tangent: f64,
}

state! {
    Maxwell as "maxwell" { disp, force } keeps { stiffness, coefficient, exponent, trial }
    restored { *trial = Trial { disp: *disp, force: *force, tangent: 0.0 }; }
}

/// A number and its derivative with respect to the displacement at the end of the path.
#[derive(Clone, Copy)]
struct Dual {
    value: f64,
    slope: f64,
}

impl Dual {
    /// This one, and `factor` of another.
    fn and(self, factor: f64, other: Self) -> Self {
        Self {
            value: self.value + factor * other.value,
            slope: self.slope + factor * other.slope,
        }
    }
}

impl Maxwell {
    /// The force x for which x + w sgn(x) (|x|/c)^(1/a) = `sum`.
    fn solve(&self, sum: Dual, w: f64) -> Dual {
        let (size, power) = (sum.value.abs(), 1.0 / self.exponent);
        if size == 0.0 {
            let slope = sum.slope;
            return Dual { value: 0.0, slope };
        }
        let alone = self.coefficient * libm::pow(size / w, self.exponent);
        let (mut x, mut steepness) = (size.min(alone), 1.0);
        for _ in 0..NEWTON_STEPS {
            let speed = w * libm::pow(x / self.coefficient, power);
            steepness = 1.0 + power * speed / x;
            x -= (x + speed - size) / steepness;
        }
        Dual {
            value: x.copysign(sum.value),
            slope: sum.slope / steepness,
        }
    }

    /// The force after a step of `h` s at the velocity `vel`.
    fn advance(&self, force: Dual, vel: Dual, h: f64) -> Dual {
        const G: f64 = 0.435_866_521_508_459;
        const B: [f64; 2] = [
            (-6.0 * G * G + 16.0 * G - 1.0) / 4.0,
            (6.0 * G * G - 20.0 * G + 5.0) / 4.0,
        ];
        let w = G * h * self.stiffness;
        let stage = |base: Dual| {
            let force = self.solve(base.and(w, vel), w);
            // h times the rate.
            let zero = Dual {
                value: 0.0,
                slope: 0.0,
            };
            (force, zero.and(1.0 / G, force.and(-1.0, base)))
        };
        let (_, one) = stage(force);
        let (_, two) = stage(force.and(0.5 - 0.5 * G, one));
        stage(force.and(B[0], one).and(B[1], two)).0
    }
}

impl Law for Maxwell {
    fn trial(&mut self, disp: f64, _vel: f64, dt: f64) -> f64 {
        let (force, tangent) = if dt <= 0.0 {
            (self.force, 0.0)
        } else if self.exponent == 1.0 {
            let share = dt * self.stiffness / self.coefficient;
            let gone = -libm::expm1(-share);
            let tangent = self.stiffness * (gone / share).min(1.0);
            let force = self.force - gone * self.force + tangent * (disp - self.disp);
            (force, tangent)
        } else {
            let vel = Dual {
                value: (disp - self.disp) / dt,
                slope: 1.0 / dt,
            };
            let start = Dual {
                value: self.force,
                slope: 0.0,
            };
            let h = dt / f64::from(STEPS);
            let end = (0..STEPS).fold(start, |force, _| self.advance(force, vel, h));
            (end.value, end.slope.min(self.stiffness))
        };
        self.trial = Trial {
            disp,
            force,
            tangent,
        };
        force
    }

    fn commit(&mut self) {
        (self.disp, self.force) = (self.trial.disp, self.trial.force);
    }

    fn revert(&mut self) {
        self.trial = Trial {
            disp: self.disp,
            force: self.force,
            tangent: 0.0,
        };
    }

    fn tangent(&self) -> Tangent {
        Tangent::elastic(self.trial.tangent)
    }

    fn reference(&self) -> Tangent {
        Tangent::elastic(self.stiffness)
    }

    /// The force is that of a spring that slips: no tangent exceeds that of the spring.
    fn bound(&self, _reach: Reach) -> (Option<f64>, Option<f64>) {
        (Some(self.stiffness), Some(0.0))
    }

    fn resists_velocity(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(exponent: f64) -> Maxwell {
        let spec = MaxwellSpec {
            stiffness_n_per_m: 2e7,
            force_at_unit_velocity_n: 5e5,
            exponent,
        };
        spec.build().unwrap()
    }

    /// Force after one second at a steady velocity, in `steps` trials.
    fn pull(law: &mut Maxwell, vel: f64, seconds: f64, steps: u32) -> f64 {
        let dt = seconds / f64::from(steps);
        let from = law.disp;
        let forces = (1..=steps).map(|i| law.step(from + vel * dt * f64::from(i), vel, dt));
        forces.last().unwrap()
    }

    #[test]
    fn linear_damper_is_exact() {
        let mut one = law(1.0);
        let tau = 5e5 / 2e7;
        for seconds in [1e-4, 0.01, 0.3] {
            one = law(1.0);
            let exact = 5e5 * 0.2 * -libm::expm1(-seconds / tau);
            for steps in [1, 7] {
                let mut law = law(1.0);
                assert!((pull(&mut law, 0.2, seconds, steps) / exact - 1.0).abs() < 1e-12);
            }
            pull(&mut one, 0.2, seconds, 1);
        }
        // At rest it relaxes.
        let before = one.force;
        let after = pull(&mut one, 0.0, tau, 1);
        assert!((after / before - libm::exp(-1.0)).abs() < 1e-12);
    }

    /// For a = 1/2, df/dt = k (v − (f/c)²): f = c √v tanh(k √v t / c).
    #[test]
    fn square_root_damper_is_its_closed_form() {
        let v: f64 = 0.15;
        for (seconds, steps) in [(0.002, 1), (0.02, 2), (0.2, 20), (2.0, 1)] {
            let exact = 5e5 * v.sqrt() * libm::tanh(2e7 * v.sqrt() * seconds / 5e5);
            for sign in [1.0, -1.0] {
                let found = sign * pull(&mut law(0.5), sign * v, seconds, steps);
                assert!(
                    (found / exact - 1.0).abs() < 2e-4,
                    "{seconds} {found} {exact}"
                );
            }
        }
        // Relaxing from there: 1/f grows by k t/c².
        let mut law = law(0.5);
        let from = pull(&mut law, v, 0.2, 200);
        let exact = 1.0 / (1.0 / from + 2e7 * 0.05 / 25e10);
        let found = pull(&mut law, 0.0, 0.05, 5);
        assert!((found / exact - 1.0).abs() < 1e-5, "{found} {exact}");
    }

    /// The tangent is the derivative, from 0 to k, and one step is as many.
    #[test]
    fn tangent_is_the_derivative_within_its_bound() {
        for exponent in [0.1, 0.25, 0.5, 0.8, 1.0] {
            let (mut one, mut many) = (law(exponent), law(exponent));
            let (mut worst, mut peak) = (0.0f64, 0.0f64);
            for i in 1..=2000 {
                let dt = 2e-3;
                let at = |i: f64| 0.03 * libm::sin(0.02 * i) * libm::cos(0.003 * i);
                let disp = at(f64::from(i));
                let h = 1e-9;
                let ends = [one.trial(disp - h, 0.0, dt), one.trial(disp + h, 0.0, dt)];
                let force = one.trial(disp, 0.0, dt);
                let slope = one.tangent().stiffness;
                assert!((0.0..=2e7).contains(&slope), "{slope}");
                let error = ((ends[1] - ends[0]) / (2.0 * h) - slope).abs();
                assert!(error < 2e-4 * 2e7, "{exponent} {i} {error} {slope}");
                one.commit();
                let from = many.disp;
                let mut fine = 0.0;
                for k in 1..=20 {
                    let part = f64::from(k) / 20.0;
                    fine = many.step(from + part * (disp - from), 0.0, dt / 20.0);
                }
                (worst, peak) = (worst.max((force - fine).abs()), peak.max(force.abs()));
            }
            assert!(worst < 1e-4 * peak, "{exponent}: {}", worst / peak);
        }
    }

    #[test]
    fn first_reading_finds_it_without_force() {
        let mut law = law(0.5);
        assert_eq!(law.step(0.02, 0.0, 0.0), 0.0);
        assert_eq!(law.step(0.02, 0.0, 0.01), 0.0);
        assert!(law.step(0.021, 0.1, 0.01) > 0.0);
    }
}
