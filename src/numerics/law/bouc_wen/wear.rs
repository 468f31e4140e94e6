//! Degradation and pinching after Baber and Wen (1981), Baber and Noori (1985), as functions of dissipated energy.
//!
//! With ε = ∫ ζ dx/u_y (energy of the hysteretic part over F_y u_y, without the factor 1 − α):
//!
//! ```text
//! ν = 1 + δ_ν ε,  η = 1 + δ_η ε                          strength and stiffness
//! h = 1 − ζ₁ exp(−(s ζ − q ζ_u)²/ζ₂²)                    pinching
//! ζ₁ = ζ_s (1 − exp(−p ε)),  ζ₂ = (ψ₀ + δ_ψ ε)(λ + ζ₁),  ζ_u = (A/(ν (β + γ)))^(1/n)
//! ```
//!
//! No closed form: the pair (s ζ, ε) is integrated along the path by extrapolation, and where s ζ passes zero the
//! path is divided exactly there, because the law has a kink.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::extrapolate::integrate;
use super::{LawError, Parameters, power};
use crate::law::domain::{fraction, inside, not_negative, positive};

/// Degradation rates per unit of normalised dissipated energy ε.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct DegradationSpec {
    /// Rate δ_ν of the strength degradation, ν = 1 + δ_ν ε. It must not be negative.
    #[serde(default)]
    #[schemars(example = 0.05)]
    pub strength: f64,
    /// Rate δ_η of the stiffness degradation, η = 1 + δ_η ε. It must not be negative.
    #[serde(default)]
    #[schemars(example = 0.05)]
    pub stiffness: f64,
}

/// Pinching parameters. Source: Baber & Noori 1985.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct PinchingSpec {
    /// Total slip ζ_s, from 0 to less than 1.
    #[schemars(example = 0.9)]
    pub total_slip: f64,
    /// Pinching slope p: how fast the slip develops with dissipated energy. It must not be
    /// negative.
    #[schemars(example = 1.0)]
    pub slope: f64,
    /// Pinching initiation q, from 0 to 1: location of the pinch as a fraction of the ultimate ζ.
    #[schemars(example = 0.1)]
    pub initiation: f64,
    /// Pinching magnitude ψ₀, greater than 0.
    #[schemars(example = 0.2)]
    pub magnitude: f64,
    /// Pinching rate δ_ψ: growth of the pinched region with dissipated energy. It must not be
    /// negative.
    #[schemars(example = 0.005)]
    pub rate: f64,
    /// Pinching severity λ, greater than 0: a larger value widens the pinched region.
    #[schemars(example = 0.1)]
    pub severity: f64,
}

/// y = s ζ and ε.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub(super) y: f64,
    pub(super) energy: f64,
}

/// |y| beyond zero that is rounding.
const BEYOND: f64 = 1e-9;

#[derive(Debug, PartialEq)]
pub(super) struct Wear {
    strength: f64,
    stiffness: f64,
    pinching: Option<PinchingSpec>,
}

impl Wear {
    pub(super) fn new(
        degradation: Option<&DegradationSpec>,
        pinching: Option<&PinchingSpec>,
    ) -> Result<Self, LawError> {
        let (strength, stiffness) = match degradation {
            Some(spec) => (
                not_negative("strength", spec.strength)?,
                not_negative("stiffness", spec.stiffness)?,
            ),
            None => (0.0, 0.0),
        };
        if let Some(spec) = pinching {
            let slip = spec.total_slip;
            inside(
                "total_slip",
                slip,
                (0.0..1.0).contains(&slip),
                "from 0 to below 1",
            )?;
            not_negative("slope", spec.slope)?;
            fraction("initiation", spec.initiation)?;
            positive("magnitude", spec.magnitude)?;
            not_negative("rate", spec.rate)?;
            positive("severity", spec.severity)?;
        }
        Ok(Self {
            strength,
            stiffness,
            pinching: pinching.cloned(),
        })
    }

    /// dy/dτ. Real-time: yes.
    pub(super) fn slope(&self, parameters: &Parameters, at: Point) -> f64 {
        // Elastic energy given back may take ε below zero by rounding only; wear does not heal.
        let energy = if at.energy < 0.0 { 0.0 } else { at.energy };
        let nu = 1.0 + self.strength * energy;
        let eta = 1.0 + self.stiffness * energy;
        let pinch = match &self.pinching {
            Some(spec) => pinch(spec, parameters, nu, energy, at.y),
            None => 1.0,
        };
        pinch / eta * (parameters.a - nu * parameters.resistance(at.y))
    }

    /// The point after the path length τ; nothing if that cannot be computed within bounds. Real-time: yes.
    pub(super) fn along(&self, parameters: &Parameters, start: Point, tau: f64) -> Option<Point> {
        let mut at = start;
        let mut rest = tau;
        if at.y < 0.0 {
            if self.may_vanish(parameters, at, tau) {
                // y as the independent variable: τ and ε at the very place where y vanishes.
                let [_, spent, energy] = integrate([at.y, 0.0, at.energy], -at.y, |s| {
                    let point = Point {
                        y: s[0].min(0.0),
                        energy: s[2],
                    };
                    let slowness = 1.0 / self.slope(parameters, point);
                    [1.0, slowness, point.y * slowness]
                })?;
                rest = tau - spent;
                at = Point { y: 0.0, energy };
            }
            if at.y < 0.0 || rest < 0.0 {
                return self.follow(parameters, start, tau, -1.0);
            }
        }
        self.follow(parameters, at, rest, 1.0)
    }

    /// The stretch on which y keeps its sign, which is `side`.
    ///
    /// Stages of a step that is too long lie beyond zero, where the law is another. To take zero for them makes the slope a
    /// constant, on which the extrapolation agrees with itself and not with the law: such a step is rejected.
    fn follow(&self, parameters: &Parameters, from: Point, tau: f64, side: f64) -> Option<Point> {
        let kept = |y: f64| match side * y {
            inside if inside >= 0.0 => y,
            rounded if rounded > -BEYOND => 0.0 * side,
            _ => f64::NAN,
        };
        let [y, energy] = integrate([from.y, from.energy], tau, |s| {
            let point = Point {
                y: kept(s[0]),
                energy: s[1],
            };
            [self.slope(parameters, point), point.y]
        })?;
        Some(Point { y: kept(y), energy })
    }

    /// False if y < 0 cannot reach zero within τ: on the way ε falls, so ν does, h ≤ 1 ≤ η, and |y| shrinks.
    fn may_vanish(&self, parameters: &Parameters, at: Point, tau: f64) -> bool {
        let nu = 1.0 + self.strength * f64::max(at.energy, 0.0);
        let helped = f64::max(0.0, -nu * parameters.resistance(at.y));
        -at.y <= tau * (parameters.a + helped)
    }
}

/// h.
fn pinch(spec: &PinchingSpec, parameters: &Parameters, nu: f64, energy: f64, y: f64) -> f64 {
    let slip = -spec.total_slip * libm::expm1(-spec.slope * energy);
    let spread = (spec.magnitude + spec.rate * energy) * (spec.severity + slip);
    let limit = parameters.a / (nu * (parameters.beta + parameters.gamma));
    let ultimate = match parameters.exponent {
        1.0 => limit,
        2.0 => limit.sqrt(),
        exponent => power(limit, 1.0 / exponent),
    };
    let distance = (y - spec.initiation * ultimate) / spread;
    1.0 - slip * libm::exp(-distance * distance)
}
