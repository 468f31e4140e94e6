//! Adaptive model-based compensation (Gálmez & Fermandois 2022): the inverse of a three-pole model whose coefficients follow
//! a normalised gradient.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::adaptive::{Bounded, COEFFICIENTS, GAIN, Regressors};
use super::filter::Differences;
use super::{CompensationError, Compensator, Parameter, inside};

/// ȧ = Γ φ (u − aᵀφ)/(1 + φᵀφ), φ the measured displacement and its first three derivatives, both sides filtered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AmbSpec {
    /// Start of a₀, a₁ in s, a₂ in s², a₃ in s³. Default: the benchmark's load system without a specimen.
    pub start: [f64; 4],
    /// Decimal logarithms of the diagonal of Γ, for motions in m.
    pub log10_gains: [f64; 4],
    /// Corner of the filter of commands and measurements, in Hz.
    pub filter_hz: f64,
    /// Lower bounds of the coefficients. Default: 0.7 of the start for a₀, 0 for the others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lower: Option<Vec<f64>>,
    /// Upper bounds. Default: 1.4 of the start for a₀, three times the start for the others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upper: Option<Vec<f64>>,
    /// Greatest change of each coefficient per second. Default: half of the way between its bounds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_per_s: Option<Vec<f64>>,
}

impl Default for AmbSpec {
    fn default() -> Self {
        Self {
            start: [1.0, 0.01986, 8.44e-5, 1.986e-7],
            log10_gains: [8.4, 6.2, 2.1, 0.8],
            filter_hz: 20.0,
            lower: None,
            upper: None,
            rate_per_s: None,
        }
    }
}

#[derive(Debug)]
pub(super) struct Amb {
    a: Bounded,
    gains: [f64; 4],
    targets: Differences,
    regressors: Regressors,
}

impl AmbSpec {
    pub(super) fn build(&self, dt: f64) -> Result<Amb, CompensationError> {
        let defaults = self.start.iter().enumerate().map(|(j, a)| match j {
            0 => (GAIN.0 * a, GAIN.1 * a),
            _ => (0.0, 3.0 * a),
        });
        let a = Bounded::new(
            self.start.to_vec(),
            defaults.collect(),
            self.lower.as_deref(),
            self.upper.as_deref(),
            self.rate_per_s.as_deref(),
            dt,
        )?;
        let mut gains = [0.0; 4];
        for (gain, log) in gains.iter_mut().zip(self.log10_gains) {
            inside(
                "log10_gains",
                log,
                (-30.0..=30.0).contains(&log),
                "from -30 to 30",
            )?;
            *gain = libm::pow(10.0, log) * dt;
        }
        Ok(Amb {
            a,
            gains,
            targets: Differences::new(dt),
            regressors: Regressors::new(self.filter_hz, dt)?,
        })
    }
}

impl Compensator for Amb {
    fn lead(&mut self, disp: f64, _: f64, _: f64) -> f64 {
        self.a.times(self.targets.push(disp))
    }

    fn stands(&self, disp: f64) -> f64 {
        self.a.times([disp, 0.0, 0.0, 0.0])
    }

    fn amend(&mut self, disp: f64) {
        self.targets.amend(disp);
    }

    fn observe(&mut self, command: f64, measured: f64) {
        let (u, phi) = self.regressors.push(command, measured);
        let (mut fitted, mut norm, mut step) = (0.0, 1.0, 0.0);
        for ((a, phi), gain) in self.a.values.iter().zip(phi).zip(self.gains) {
            fitted += a * phi;
            norm += phi * phi;
            step += gain * phi * phi;
        }
        // One tick takes off at most the whole error: beyond, the law would not be that of continuous time.
        let size = (u - fitted) / norm.max(step);
        let mut goal = [0.0; 4];
        for ((goal, a), (phi, gain)) in goal
            .iter_mut()
            .zip(&self.a.values)
            .zip(phi.iter().zip(self.gains))
        {
            *goal = a + gain * phi * size;
        }
        self.a.approach(&goal);
    }

    fn notice(&mut self, command: f64, measured: f64) {
        self.regressors.push(command, measured);
    }

    fn memory(&self) -> u32 {
        self.regressors.memory()
    }

    fn reset(&mut self, disp: f64) {
        self.a.reset();
        self.targets.reset(disp);
        self.regressors.reset(disp);
    }

    fn names(&self) -> &'static [Parameter] {
        COEFFICIENTS
    }

    fn parameters(&self) -> &[f64] {
        &self.a.values
    }

    fn bounds(&self) -> &[(f64, f64)] {
        &self.a.bounds
    }

    fn freeze(&self, out: &mut Vec<f64>) {
        out.extend(&self.a.values);
        self.targets.freeze(out);
        self.regressors.freeze(out);
    }

    fn thaw<'a>(&mut self, from: &'a [f64]) -> &'a [f64] {
        let slots = self.a.values.iter_mut().chain(self.targets.slots());
        super::take(slots.chain(self.regressors.slots()), from)
    }
}
