//! The actuator of a specimen as its proofs see it: declared dynamics, compensation, and the remaining lag.

use nalgebra::{Complex, ComplexField as _};

use gusset_actuator::compensation::CompensationSpec;
use gusset_actuator::transfer::TransferSpec;
use gusset_numerics::spectral::delay::Delayed;
use gusset_quantity::finding::KeyPath;

/// One specimen and what is declared of its actuator.
#[derive(Debug, Clone)]
pub struct Actuator {
    /// Number of the specimen, from 0.
    pub number: usize,
    /// Name of the specimen.
    pub name: String,
    /// Key of `[[specimen]]` that decides how the specimen follows: the compensation, or else the actuator.
    pub key: &'static str,
    /// The declared or identified actuator and sensors, if they are known.
    pub transfer: Option<TransferSpec>,
    /// The compensation of its lag.
    pub compensation: Option<CompensationSpec>,
    /// Standard deviation of its delay, s.
    pub delay_std_s: f64,
    /// Its connection; none for a specimen that is simulated here.
    pub link: Option<Machine>,
}

/// The program behind a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Machine {
    /// The specimen is computed: there is no actuator.
    pub computed: bool,
    /// It answers with forces only, so that no delay can be measured.
    pub forces_only: bool,
}

impl Actuator {
    /// True if its dynamics are declared, or if it has no actuator.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.transfer.is_some() || self.link.is_none_or(|machine| machine.computed)
    }

    /// The key that decides how the specimen follows.
    pub(super) fn place(&self) -> KeyPath {
        self.at(self.key)
    }

    /// A key of its table.
    pub(super) fn at(&self, key: &str) -> KeyPath {
        let table = KeyPath::root().key("specimen").index(self.number);
        table.key(key)
    }

    /// Kind of the compensation; "none" without one.
    pub(super) fn kind(&self) -> &'static str {
        self.compensation
            .as_ref()
            .map_or("none", |spec| spec.kind())
    }

    /// Its known dynamics at ticks of `tick` s of wall time; none if they are not known.
    pub(super) fn follows(&self, tick: f64) -> Option<Follows<'_>> {
        Some(Follows {
            transfer: self.transfer.as_ref()?,
            compensation: self.compensation.as_ref(),
            tick,
        })
    }
}

/// An actuator with its compensation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Follows<'a> {
    pub transfer: &'a TransferSpec,
    compensation: Option<&'a CompensationSpec>,
    /// Length in wall time, s.
    pub tick: f64,
}

impl Follows<'_> {
    /// H at ω in rad/s for one axis of a system; none for a compensation that adapts or feeds back.
    pub(crate) fn at(&self, omega: f64, system: &Delayed, axis: usize) -> Option<Complex<f64>> {
        let lead = match self.compensation {
            None => Complex::new(1.0, 0.0),
            Some(spec) => spec.response(omega, self.tick)?,
        };
        let (k, c) = of_axis(system, axis);
        Some(lead * self.transfer.response_to_ticks(omega, k, c, self.tick))
    }

    /// The lag of the actuator alone at ω in rad/s, s.
    pub(crate) fn lag(&self, omega: f64, system: &Delayed, axis: usize) -> f64 {
        let (k, c) = of_axis(system, axis);
        self.transfer.lag_to_ticks(omega, k, c, self.tick)
    }

    /// The remaining lag of an axis at ω in rad/s, s.
    pub(crate) fn left(&self, omega: f64, system: &Delayed, axis: usize) -> Option<f64> {
        self.at(omega, system, axis).map(|h| -h.argument() / omega)
    }
}

/// Stiffness and damping of one axis of a specimen.
fn of_axis(system: &Delayed, axis: usize) -> (f64, f64) {
    let at = (axis, axis);
    (system.specimen_stiffness[at], system.specimen_damping[at])
}
