//! Laws of the velocity: biviscous, power of the velocity, and friction smoothed around rest. No memory.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::domain::{declared, inside, not_negative, positive, reference};
use super::{Law, LawError, Memoryless, Reach, Tangent};
use gusset_quantity::state;

/// Biviscous damper, f = c₀ v for |v| ≤ v_y and f = sgn(v) (c₀ v_y + c_y (|v| − v_y)) beyond.
/// Source: Gui et al. 2014, example 4.3.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct BiviscousSpec {
    /// Damping c₀ below the yield velocity, greater than 0.
    #[schemars(example = 1.0e5)]
    pub damping_n_s_per_m: f64,
    /// Damping c_y above the yield velocity. It must not be negative.
    #[schemars(example = 1.0e4)]
    pub post_yield_damping_n_s_per_m: f64,
    /// Yield velocity v_y, greater than 0.
    #[schemars(example = 0.1)]
    pub yield_velocity_m_per_s: f64,
}

impl BiviscousSpec {
    /// # Errors
    /// A parameter outside its domain.
    pub fn build(&self) -> Result<Biviscous, LawError> {
        Ok(Biviscous {
            damping: positive("damping_n_s_per_m", self.damping_n_s_per_m)?,
            post_yield: not_negative(
                "post_yield_damping_n_s_per_m",
                self.post_yield_damping_n_s_per_m,
            )?,
            yield_vel: positive("yield_velocity_m_per_s", self.yield_velocity_m_per_s)?,
            yielding: false,
        })
    }
}

/// See [`BiviscousSpec`].
#[derive(Debug, Clone)]
pub struct Biviscous {
    damping: f64,
    post_yield: f64,
    yield_vel: f64,
    /// At the last trial.
    yielding: bool,
}

state! { Biviscous as "biviscous" {} keeps { damping, post_yield, yield_vel, yielding } }

impl Law for Biviscous {
    fn trial(&mut self, _disp: f64, vel: f64, _dt: f64) -> f64 {
        let speed = vel.abs();
        self.yielding = speed > self.yield_vel;
        if self.yielding {
            let force = self.damping * self.yield_vel + self.post_yield * (speed - self.yield_vel);
            force.copysign(vel)
        } else {
            self.damping * vel
        }
    }

    fn tangent(&self) -> Tangent {
        Tangent {
            stiffness: 0.0,
            damping: if self.yielding {
                self.post_yield
            } else {
                self.damping
            },
        }
    }

    fn reference(&self) -> Tangent {
        Tangent {
            stiffness: 0.0,
            damping: self.damping,
        }
    }

    fn bound(&self, _reach: Reach) -> (Option<f64>, Option<f64>) {
        (Some(0.0), Some(self.damping.max(self.post_yield)))
    }

    fn memoryless(&self) -> Option<Memoryless> {
        Some(Memoryless::Biviscous {
            damping: self.damping,
            post_yield: self.post_yield,
            yield_vel: self.yield_vel,
        })
    }
}

/// Fluid damper, f = c |v|^a sgn(v).
///
/// At rest its tangent is infinite for a < 1 and zero for a > 1. Give a reference damping, or a
/// velocity below which the force is linear. For a < 1, stability can be proven only with that
/// linear part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct PowerDamperSpec {
    /// Force c at a velocity of 1 m/s, greater than 0. Its unit is N (s/m)^a.
    #[schemars(example = 5.0e4)]
    pub force_at_unit_velocity_n: f64,
    /// Exponent a, greater than 0 and at most 10.
    #[schemars(example = 0.5)]
    pub exponent: f64,
    /// Damping that this damper adds to the initial damping of the structure, greater than 0.
    /// Default: the tangent at rest, if that is finite and not zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 1.0e5)]
    pub reference_damping_n_s_per_m: Option<f64>,
    /// Velocity below which the force is linear in the velocity, greater than 0. The force is
    /// continuous there. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.01)]
    pub linear_below_m_per_s: Option<f64>,
}

impl PowerDamperSpec {
    /// # Errors
    /// A parameter outside its domain, or no finite, positive tangent at rest and no reference.
    pub(crate) fn build(&self) -> Result<PowerDamper, LawError> {
        let coefficient = positive("force_at_unit_velocity_n", self.force_at_unit_velocity_n)?;
        let exponent = inside(
            "exponent",
            self.exponent,
            self.exponent > 0.0 && self.exponent <= 10.0,
            "greater than 0 and at most 10",
        )?;
        let linear_below = match self.linear_below_m_per_s {
            Some(speed) => positive("linear_below_m_per_s", speed)?,
            None => 0.0,
        };
        // pow(0, a − 1) is ∞, 1 or 0 for a below, at or above 1: the tangent at rest.
        let at_rest = coefficient * libm::pow(linear_below, exponent - 1.0);
        if let Some(speed) = self.linear_below_m_per_s {
            let is_inside = at_rest > 0.0 && at_rest.is_finite();
            let allowed = "a speed whose damping around rest is finite and greater than 0";
            inside("linear_below_m_per_s", speed, is_inside, allowed)?;
        }
        Ok(PowerDamper {
            coefficient,
            exponent,
            linear_below,
            at_rest,
            reference: reference(
                "reference_damping_n_s_per_m",
                self.reference_damping_n_s_per_m,
                at_rest,
            )?,
            speed: 0.0,
        })
    }
}

/// See [`PowerDamperSpec`].
#[derive(Debug, Clone)]
pub struct PowerDamper {
    coefficient: f64,
    exponent: f64,
    linear_below: f64,
    /// Tangent around rest; may be 0 or infinite.
    at_rest: f64,
    reference: f64,
    /// |v| at the last trial.
    speed: f64,
}

state! {
    PowerDamper as "power_damper" {}
    keeps { coefficient, exponent, linear_below, at_rest, reference, speed }
}

impl PowerDamper {
    fn slope(&self, speed: f64) -> f64 {
        self.coefficient * self.exponent * libm::pow(speed, self.exponent - 1.0)
    }
}

impl Law for PowerDamper {
    fn trial(&mut self, _disp: f64, vel: f64, _dt: f64) -> f64 {
        self.speed = vel.abs();
        if self.speed < self.linear_below {
            self.at_rest * vel
        } else {
            (self.coefficient * libm::pow(self.speed, self.exponent)).copysign(vel)
        }
    }

    fn tangent(&self) -> Tangent {
        Tangent {
            stiffness: 0.0,
            damping: if self.speed < self.linear_below {
                self.at_rest
            } else {
                self.slope(self.speed)
            },
        }
    }

    fn reference(&self) -> Tangent {
        Tangent {
            stiffness: 0.0,
            damping: self.reference,
        }
    }

    fn rest_damping(&self) -> f64 {
        // A reference that the user gives is kept.
        let is_own = self.reference == self.at_rest && self.exponent < 1.0;
        if is_own { self.at_rest } else { 0.0 }
    }

    fn bound(&self, reach: Reach) -> (Option<f64>, Option<f64>) {
        let damping = if self.exponent > 1.0 {
            declared(reach.vel).map(|speed| self.slope(speed).max(self.at_rest))
        } else {
            Some(self.at_rest)
        };
        (Some(0.0), damping)
    }
}

/// Smoothed friction, f = F tanh(v/v_r). It creeps under a constant force. Use `bilinear`
/// with `post_yield_ratio = 0` if the surface must stick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct SmoothFrictionSpec {
    /// Slip force F, greater than 0: friction coefficient times normal force.
    #[schemars(example = 2.0e4)]
    pub slip_force_n: f64,
    /// Velocity v_r at which the force is 76 % of the slip force, greater than 0.
    #[schemars(example = 0.001)]
    pub reference_velocity_m_per_s: f64,
}

impl SmoothFrictionSpec {
    /// # Errors
    /// A parameter outside its domain.
    pub(crate) fn build(&self) -> Result<SmoothFriction, LawError> {
        let force = positive("slip_force_n", self.slip_force_n)?;
        let vel = positive(
            "reference_velocity_m_per_s",
            self.reference_velocity_m_per_s,
        )?;
        let slope = force / vel;
        let allowed = "a speed whose damping at rest is finite and greater than 0";
        let is_inside = slope > 0.0 && slope.is_finite();
        inside("reference_velocity_m_per_s", vel, is_inside, allowed)?;
        Ok(SmoothFriction {
            force,
            vel,
            slope,
            share: 0.0,
        })
    }
}

/// See [`SmoothFrictionSpec`].
#[derive(Debug, Clone)]
pub struct SmoothFriction {
    force: f64,
    vel: f64,
    slope: f64,
    /// tanh(v/v_r) at the last trial.
    share: f64,
}

state! { SmoothFriction as "smooth_friction" {} keeps { force, vel, slope, share } }

impl Law for SmoothFriction {
    fn trial(&mut self, _disp: f64, vel: f64, _dt: f64) -> f64 {
        self.share = libm::tanh(vel / self.vel);
        self.force * self.share
    }

    fn tangent(&self) -> Tangent {
        Tangent {
            stiffness: 0.0,
            damping: self.slope * (1.0 - self.share * self.share),
        }
    }

    fn reference(&self) -> Tangent {
        Tangent {
            stiffness: 0.0,
            damping: self.slope,
        }
    }

    fn rest_damping(&self) -> f64 {
        self.slope
    }

    fn bound(&self, _reach: Reach) -> (Option<f64>, Option<f64>) {
        (Some(0.0), Some(self.slope))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damper_of_example_4_3_is_as_published() {
        let mut law = BiviscousSpec {
            damping_n_s_per_m: 180.0,
            post_yield_damping_n_s_per_m: 90.0,
            yield_velocity_m_per_s: 1.0 / 3.0,
        }
        .build()
        .unwrap();
        assert!((law.trial(0.0, 1.0 / 3.0, 0.0) - 60.0).abs() < 1e-13);
        assert_eq!(law.tangent().damping, 180.0);
        assert!((law.trial(0.0, -1.0, 0.0) + 120.0).abs() < 1e-13);
        assert_eq!(law.tangent().damping, 90.0);
        assert_eq!(law.bound(Reach::default()), (Some(0.0), Some(180.0)));
    }

    fn power(exponent: f64) -> PowerDamperSpec {
        PowerDamperSpec {
            force_at_unit_velocity_n: 1000.0,
            exponent,
            reference_damping_n_s_per_m: None,
            linear_below_m_per_s: None,
        }
    }

    #[test]
    fn power_damper_may_need_a_reference() {
        let needed = LawError::ReferenceNeeded {
            name: "reference_damping_n_s_per_m",
        };
        assert_eq!(power(0.5).build().unwrap_err(), needed);
        assert_eq!(power(2.0).build().unwrap_err(), needed);
        assert_eq!(power(1.0).build().unwrap().reference().damping, 1000.0);
        let mut spec = power(0.5);
        spec.reference_damping_n_s_per_m = Some(5e3);
        let mut law = spec.build().unwrap();
        assert_eq!(law.reference().damping, 5e3);
        assert_eq!(law.trial(0.0, -0.25, 0.0), -500.0);
        assert_eq!(law.bound(Reach::default()).1, Some(f64::INFINITY));
        // c v_lin^(a−1) = 1000/√0.01 = 1e4, reached from both sides at v_lin.
        spec.reference_damping_n_s_per_m = None;
        spec.linear_below_m_per_s = Some(0.01);
        let mut law = spec.build().unwrap();
        assert!((law.reference().damping - 1e4).abs() < 1e-9);
        assert!((law.trial(0.0, 0.01, 0.0) - 100.0).abs() < 1e-11);
        assert!((law.trial(0.0, 0.005, 0.0) - 50.0).abs() < 1e-11);
        assert!((law.bound(Reach::default()).1.unwrap() - 1e4).abs() < 1e-9);
    }

    #[test]
    fn quadratic_damper_is_bounded_by_speed() {
        let mut spec = power(2.0);
        spec.reference_damping_n_s_per_m = Some(1.0);
        let law = spec.build().unwrap();
        assert_eq!(law.bound(Reach::default()).1, None);
        let reach = Reach {
            disp: None,
            vel: Some(3.0),
        };
        assert_eq!(law.bound(reach).1, Some(6000.0));
    }

    #[test]
    fn smooth_friction_is_linear_then_saturates() {
        let mut law = SmoothFrictionSpec {
            slip_force_n: 40.0,
            reference_velocity_m_per_s: 0.002,
        }
        .build()
        .unwrap();
        assert_eq!(law.reference().damping, 2e4);
        // tanh(1) = 0.76159415595576488…
        assert!((law.trial(0.0, 0.002, 0.0) - 40.0 * 0.761_594_155_955_764_9).abs() < 1e-13);
        assert_eq!(law.trial(0.0, -1.0, 0.0), -40.0);
    }
}
