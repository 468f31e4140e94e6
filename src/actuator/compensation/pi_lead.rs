//! The benchmark's sample controller: a phase lead, then a PI controller on the remaining error.
//!
//! The lead acts on targets, the controller in wall time. While test time is stretched, the controller acts in every tick. Its
//! target is then less ahead. In a complete hold the last command is repeated and the controller rests. Its integral
//! does not wind up, and it continues from there.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{CompensationError, Compensator, inside, positive};
use gusset_quantity::state;

/// PI control with a phase lead, K_p e + K_i ∫ e dt with e = lead(d) − x_m. The lead is (b s +
/// c)/(s + c), discretised by Tustin's rule. The defaults are the sample controller of the virtual
/// hybrid simulation benchmark.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PiLeadSpec {
    /// Proportional gain K_p.
    #[schemars(example = 2.0)]
    pub proportional: f64,
    /// Integral gain K_i.
    #[schemars(example = 95.0)]
    pub integral_per_s: f64,
    /// Gain b of the phase lead.
    #[schemars(example = 50.83)]
    pub lead_gain: f64,
    /// Corner c of the phase lead.
    #[schemars(example = 8570.0)]
    pub lead_corner_per_s: f64,
}

impl Default for PiLeadSpec {
    fn default() -> Self {
        Self {
            proportional: 2.0,
            integral_per_s: 95.0,
            lead_gain: 50.831_633_6,
            lead_corner_per_s: 8_570.397_34,
        }
    }
}

#[derive(Debug)]
pub(super) struct PiLead {
    proportional: f64,
    /// K_i Δt/2.
    integral: f64,
    /// Coefficients of the new target, the last target and the last output.
    lead: [f64; 3],
    target: f64,
    led: f64,
    error: f64,
    sum: f64,
    measured: f64,
}

state! {
    PiLead as "pi_lead" { target, led, error, sum, measured } keeps { proportional, integral, lead }
}

impl PiLeadSpec {
    pub(super) fn build(&self, dt: f64) -> Result<PiLead, CompensationError> {
        let allowed = "finite and not negative";
        let k = self.proportional;
        let proportional = inside("proportional", k, k >= 0.0, allowed)?;
        let k = self.integral_per_s;
        let integral = inside("integral_per_s", k, k >= 0.0, allowed)?;
        let b = positive("lead_gain", self.lead_gain)?;
        let c = positive("lead_corner_per_s", self.lead_corner_per_s)?;
        let s = 2.0 / dt;
        Ok(PiLead {
            proportional,
            integral: integral * dt / 2.0,
            lead: [
                (b * s + c) / (s + c),
                (c - b * s) / (s + c),
                (s - c) / (s + c),
            ],
            target: 0.0,
            led: 0.0,
            error: 0.0,
            sum: 0.0,
            measured: 0.0,
        })
    }
}

impl Compensator for PiLead {
    fn lead(&mut self, disp: f64, _: f64, _: f64) -> f64 {
        let [new, last, own] = self.lead;
        self.led = new * disp + last * self.target + own * self.led;
        self.target = disp;
        self.led
    }

    fn regulate(&mut self, led: f64) -> f64 {
        let error = led - self.measured;
        self.sum += self.integral * (error + self.error);
        self.error = error;
        self.proportional * error + self.sum
    }

    fn amend(&mut self, disp: f64) {
        let [new, ..] = self.lead;
        self.led += new * (disp - self.target);
        self.target = disp;
    }

    fn observe(&mut self, _: f64, measured: f64) {
        self.measured = measured;
    }

    fn notice(&mut self, _: f64, measured: f64) {
        self.measured = measured;
    }

    fn reset(&mut self, disp: f64) {
        (self.target, self.led, self.measured) = (disp, disp, disp);
        (self.error, self.sum) = (0.0, disp);
    }
}
