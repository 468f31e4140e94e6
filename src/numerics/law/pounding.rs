//! Pounding of two bodies: contact after Hertz that dissipates energy.
//!
//! Source: Muthukumar & DesRoches 2006, Earthquake Engng Struct. Dyn. 35, 811–828 (`Hertzdamp`), after Lankarani & Nikravesh 1990.
//!
//! ```text
//! F = k δ^1.5 (1 + ¾ (1 − e²) δ̇/v₀)
//! ```
//!
//! δ is the penetration, v₀ the approach velocity with which the contact began. The force never pulls.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::contact::Side;
use super::domain::{fraction, not_negative, positive};
use super::{Law, LawError, Reach, Tangent};
use gusset_quantity::state;

/// Pounding behind a gap, F = k δ^1.5 (1 + ¾ (1 − e²) v/v₀). δ is the penetration, v its velocity, and v₀ that at which contact began.
/// The force never pulls. Source: Muthukumar & DesRoches 2006.
///
/// Two limits keep the tangents finite. Beyond the largest penetration the force grows linearly. A contact that begins slower than
/// the least impact velocity has that velocity as v₀, and v counts up to v₀.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct PoundingSpec {
    /// Stiffness k of the contact in N/m^1.5, greater than 0.
    #[schemars(example = 2.0e9)]
    pub stiffness_n_per_m1_5: f64,
    /// Width of the gap. It must not be negative, and it is equal on both sides.
    #[schemars(example = 0.02)]
    pub gap_m: f64,
    /// Side on which the gap can close.
    #[schemars(example = &"compression")]
    pub side: Side,
    /// Coefficient of restitution e, from 0 to 1: 1 dissipates nothing. The formula keeps it well from about 0.6 on.
    #[schemars(example = 0.7)]
    pub restitution: f64,
    /// Largest penetration expected, greater than 0. It bounds the tangents, and the initial stiffness of the structure contains
    /// the stiffness there, although the gap is open at the start.
    #[schemars(example = 0.005)]
    pub largest_penetration_m: f64,
    /// Least impact velocity v₀, greater than 0. It bounds the damping.
    #[schemars(example = 0.05)]
    pub least_impact_velocity_m_per_s: f64,
}

impl PoundingSpec {
    /// # Errors
    /// A parameter outside its domain.
    pub(crate) fn build(&self) -> Result<Pounding, LawError> {
        let stiffness = positive("stiffness_n_per_m1_5", self.stiffness_n_per_m1_5)?;
        let largest = positive("largest_penetration_m", self.largest_penetration_m)?;
        let least = positive(
            "least_impact_velocity_m_per_s",
            self.least_impact_velocity_m_per_s,
        )?;
        let restitution = fraction("restitution", self.restitution)?;
        Ok(Pounding {
            stiffness,
            gap: not_negative("gap_m", self.gap_m)?,
            side: self.side,
            loss: 0.75 * (1.0 - restitution * restitution),
            largest,
            least,
            committed: Contact::default(),
            trial: Contact::default(),
            tangent: Tangent::default(),
        })
    }
}

/// See [`PoundingSpec`].
#[derive(Debug, Clone)]
pub struct Pounding {
    stiffness: f64,
    gap: f64,
    side: Side,
    /// ¾ (1 − e²).
    loss: f64,
    largest: f64,
    least: f64,
    committed: Contact,
    trial: Contact,
    /// At the last trial.
    tangent: Tangent,
}

state! {
    Pounding as "pounding" { committed }
    keeps { stiffness, gap, side, loss, largest, least, trial, tangent }
    restored { *trial = *committed; *tangent = Tangent::default(); }
}

/// A contact that lasts.
#[derive(Debug, Clone, Copy, Default)]
struct Contact {
    /// +1 in tension, −1 in compression, 0 without contact.
    sign: f64,
    /// v₀.
    began_at: f64,
}

state! { Contact { sign, began_at } }

impl Pounding {
    /// Elastic force and its slope at a penetration: a power up to the largest one, then a line.
    fn hertz(&self, penetration: f64) -> (f64, f64) {
        let within = penetration.min(self.largest);
        let root = within.sqrt();
        let slope = 1.5 * self.stiffness * root;
        let force = self.stiffness * within * root + slope * (penetration - within);
        (force, slope)
    }
}

impl Law for Pounding {
    fn trial(&mut self, disp: f64, vel: f64, _dt: f64) -> f64 {
        let tension = matches!(self.side, Side::Tension | Side::Both) && disp > self.gap;
        let compression = matches!(self.side, Side::Compression | Side::Both) && disp < -self.gap;
        self.tangent = Tangent::default();
        let sign = match (tension, compression) {
            (true, _) => 1.0,
            (_, true) => -1.0,
            _ => {
                self.trial = Contact::default();
                // 0 for every number, NaN for NaN and ∞: a lost displacement must not pass for an open gap.
                return 0.0 * disp + 0.0;
            }
        };
        let approach = sign * vel;
        self.trial = if self.committed.sign == sign {
            self.committed
        } else {
            Contact {
                sign,
                began_at: approach.max(self.least),
            }
        };
        let penetration = sign * disp - self.gap;
        let (elastic, slope) = self.hertz(penetration);
        let within = self.hertz(penetration.min(self.largest)).0;
        let ratio = approach / self.trial.began_at;
        // 0 for every number, NaN for NaN and ∞: a lost velocity must not pass for a slow one.
        let force = elastic + self.loss * ratio.min(1.0) * within + 0.0 * vel;
        if force > 0.0 {
            let grows = if penetration < self.largest {
                slope
            } else {
                0.0
            };
            self.tangent = Tangent {
                stiffness: slope + self.loss * ratio.min(1.0) * grows,
                damping: if ratio < 1.0 {
                    self.loss * within / self.trial.began_at
                } else {
                    0.0
                },
            };
        }
        sign * if force < 0.0 { 0.0 } else { force }
    }

    fn commit(&mut self) {
        self.committed = self.trial;
    }

    fn revert(&mut self) {
        self.trial = self.committed;
    }

    fn tangent(&self) -> Tangent {
        self.tangent
    }

    fn reference(&self) -> Tangent {
        let (force, slope) = self.hertz(self.largest);
        Tangent {
            stiffness: slope,
            damping: self.loss * force / self.least,
        }
    }

    /// The damping acts during contact alone.
    fn rest_damping(&self) -> f64 {
        self.reference().damping
    }

    fn bound(&self, _reach: Reach) -> (Option<f64>, Option<f64>) {
        let Tangent { stiffness, damping } = self.reference();
        (Some(stiffness * (1.0 + self.loss)), Some(damping))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(restitution: f64) -> PoundingSpec {
        PoundingSpec {
            stiffness_n_per_m1_5: 1e9,
            gap_m: 2e-3,
            side: Side::Compression,
            restitution,
            largest_penetration_m: 0.01,
            least_impact_velocity_m_per_s: 0.01,
        }
    }

    #[test]
    fn contact_without_loss_is_that_of_hertz() {
        let mut law = spec(1.0).build().unwrap();
        assert_eq!(law.step(-1e-3, -1.0, 0.01), 0.0);
        assert_eq!(law.step(3e-3, 1.0, 0.01), 0.0);
        // 1e9 · (1e-4)^1.5 = 1000 N at a penetration of 0.1 mm.
        assert!((law.step(-2.1e-3, -1.0, 0.01) + 1000.0).abs() < 1e-8);
        // Beyond the largest penetration: 1e6 N and 1.5e8 N/m.
        assert!((law.step(-0.013, 1.0, 0.01) + 1.15e6).abs() < 1e-5);
    }

    /// A mass strikes with v₀ and leaves with e' v₀. From v dv/dδ = −F/m, G(1) = G(−e') with a = ¾ (1 − e²) and
    /// G(u) = u/a − ln(1 + a u)/a². For e near 1, e' is e.
    #[test]
    fn restitution_is_that_of_the_formula() {
        for (restitution, most) in [(0.98, 2e-3), (0.9, 2e-2), (0.7, 0.1)] {
            let mut law = spec(restitution).build().unwrap();
            let (mass, dt) = (1000.0, 1e-7);
            let (mut disp, mut vel, mut least) = (-2e-3, -1.0, 0.0);
            for _ in 0..1_000_000 {
                disp += vel * dt;
                let force = law.step(disp, vel, dt);
                least = f64::min(least, -force);
                vel -= force / mass * dt;
                if disp > -2e-3 {
                    break;
                }
            }
            assert_eq!(least, 0.0, "the force never pulls");
            assert!((vel - restitution).abs() < most, "{restitution}: {vel}");
            let a = 0.75 * (1.0 - restitution * restitution);
            let integral = |u: f64| u / a - libm::log1p(a * u) / (a * a);
            let off = integral(1.0) - integral(-vel);
            assert!(off.abs() < 1e-3, "{restitution}: {off}");
        }
    }

    /// A contact that begins at rest has the least impact velocity.
    #[test]
    fn slow_contact_is_bounded() {
        let mut law = spec(0.5).build().unwrap();
        let (stiffness, damping) = law.bound(Reach::default());
        law.trial(-0.012, 0.0, 0.01);
        assert!((law.tangent().damping - damping.unwrap()).abs() < 1e-3);
        law.trial(-0.011_999_999, -0.02, 0.01);
        assert!((law.tangent().stiffness / stiffness.unwrap() - 1.0).abs() < 1e-6);
        assert!(law.trial(-0.011_999_999, 10.0, 0.01) <= 0.0);
        assert!(law.trial(-0.011_999_999, f64::NAN, 0.01).is_nan());
    }
}
