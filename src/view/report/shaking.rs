//! The ground motion of a test: intensity, response spectrum and Fourier amplitudes.

use super::axes::envelope;
use gusset_motion::metrics::ground::{Intensity, intensity};
use gusset_motion::metrics::spectrum::{Ordinate, periods, response_spectrum};

/// Damping of the response spectrum.
pub(super) const RATIO: f64 = 0.05;
/// Periods of the response spectrum: from 0.02 to 10 s.
const PERIODS: usize = 80;

/// Facts about the ground motion.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shaking {
    /// None for a displacement of the base.
    pub intensity: Option<Intensity>,
    /// 5 % damping; empty for a displacement of the base.
    pub spectrum: Vec<Ordinate>,
    /// (Hz, record times s).
    pub amplitudes: Vec<(f64, f64)>,
}

impl Shaking {
    /// Facts from a record in m/s² or m with this interval in s; `None` if nothing moves.
    pub(crate) fn of(ground: &[f64], unit: &str, dt: f64) -> Option<Self> {
        gusset_motion::metrics::peak(ground).filter(|peak| peak.value != 0.0)?;
        let is_accel = unit != "m";
        let span = dt * ground.len() as f64;
        // Longer periods than the record are meaningless; shorter ones than two samples are not in it.
        let (shortest, longest) = (0.02f64.max(2.0 * dt), 10.0f64.min(span));
        let wanted = if is_accel && longest > shortest {
            periods(shortest, longest, PERIODS)
        } else {
            Vec::new()
        };
        Some(Self {
            intensity: is_accel.then(|| intensity(ground, dt)).flatten(),
            spectrum: response_spectrum(ground, dt, &wanted, RATIO),
            amplitudes: envelope(ground, dt).unwrap_or_default(),
        })
    }
}
