//! `gusset check`: whether a test whose actuator is declared is stable with it, and with what makes up for it.
//!
//! The proof is in continuous time with linear specimens at their estimates: 1 + (H − 1) Z_e bᵀ Z⁻¹ b must not go round zero,
//! H being compensation times actuator, Z the dynamic stiffness of the whole and Z_e that of the specimen. It refuses only
//! what stays unstable with five per cent less of H − 1; what adapts, or feeds back, is not judged here but by a rehearsal.

use std::f64::consts::PI;

use nalgebra::{Complex, DMatrix, DVector};
use serde_json::json;

use super::spectrum::Spectrum;
use super::table::{Table, duration};
use crate::config::{Facts, Loaded};
use crate::spectral::delay::{Delayed, DiscreteLimit};
use crate::spectral::unstable_roots;

/// What is known of one specimen behind a declared actuator.
#[derive(Debug, Clone)]
pub struct Following {
    specimen: String,
    /// Lag of the actuator at the critical frequency, and that frequency in rad/s, and the critical delay in s.
    lag: Option<(f64, f64, f64)>,
    /// What of the lag is left after a compensation that neither adapts nor feeds back, in s.
    left: Option<f64>,
    /// Standard deviation of the delay, s.
    spread: f64,
    /// The critical delay of the recursion, s; what was looked at, if there is none.
    discrete: Result<DiscreteLimit, String>,
    /// Roots right of the imaginary axis, with the whole actuator and with five per cent less of it; none if not judged.
    roots: Option<(u32, u32)>,
    /// Kind of the compensation.
    kind: &'static str,
}

/// Frequencies that count are below this share of half the rate.
const HIGHEST: f64 = 0.9;
/// What is left of H − 1 where it must still be unstable to be refused.
const LESS: f64 = 0.95;

impl Following {
    /// One per specimen of one axis behind a declared actuator.
    pub fn of(loaded: &Loaded, facts: &Facts, spectrum: Option<&Spectrum>) -> Vec<Self> {
        let analysis = facts.structure.as_ref().and_then(|s| s.analysis.as_ref());
        let loops = analysis.map(|analysis| analysis.loops.as_slice());
        let pairs = loops.unwrap_or_default().iter().zip(&loaded.file.specimen);
        let judged = pairs.filter_map(|(one, table)| {
            let transfer = table.believed_transfer(1.0)?;
            let system = &one.system;
            if system.rows.nrows() != 1 {
                return None;
            }
            let (k, c) = (
                system.specimen_stiffness[(0, 0)],
                system.specimen_damping[(0, 0)],
            );
            let lag = one
                .continuous()
                .ok()
                .flatten()
                .map(|found| (transfer.lag(found.omega, k, c), found.omega, found.delay));
            let compensation = table.compensation.as_ref();
            let tick = facts.rate_hz.recip();
            let lead = |omega: f64| match compensation {
                None => Some(Complex::new(1.0, 0.0)),
                Some(spec) => spec.response(omega, tick),
            };
            let left = lag.and_then(|(_, omega, _)| {
                let chain = lead(omega)? * transfer.response(omega, k, c);
                Some(-chain.arg() / omega)
            });
            let marks = system.marks();
            let roots = |share: f64| {
                let chain = |omega: f64| {
                    let follows = lead(omega)? * transfer.response(omega, k, c);
                    let missing = (follows - 1.0) * share;
                    felt(system, omega).map(|felt| missing * felt + 1.0)
                };
                unstable_roots(chain, 1e-2, HIGHEST * PI / tick, &marks)
            };
            Some(Self {
                specimen: one.name.clone(),
                lag,
                left,
                spread: table
                    .identified
                    .and_then(|known| known.delay_std_s)
                    .unwrap_or(0.0),
                discrete: spectrum.map_or_else(
                    || Err("another method than the family".to_owned()),
                    |spectrum| spectrum.discrete(&one.name),
                ),
                roots: roots(1.0).zip(roots(LESS)),
                kind: compensation.map_or("none", |spec| spec.kind()),
            })
        });
        judged.collect()
    }

    /// False if it is proven unstable.
    pub fn is_possible(&self) -> bool {
        !matches!(self.roots, Some((all, less)) if all > 0 && less > 0)
    }

    /// Whether what is left of the delay is below what is critical, twice its spread included.
    pub fn of_delay(&self) -> (Option<bool>, String, String) {
        let about = format!("delay, {}", self.specimen);
        let Some((lag, _, critical)) = self.lag else {
            return (Some(true), about, "every delay is stable".to_owned());
        };
        let (discrete, recursion) = match &self.discrete {
            Ok(DiscreteLimit::At(tau)) => (*tau, format!("{} by the recursion", duration(*tau))),
            Ok(DiscreteLimit::Beyond(tau)) => (
                f64::INFINITY,
                format!("none up to {} by the recursion", duration(*tau)),
            ),
            Err(error) => (
                f64::INFINITY,
                format!("not known by the recursion: {error}"),
            ),
        };
        let spread = if self.spread > 0.0 {
            format!(" ± {}", duration(self.spread))
        } else {
            String::new()
        };
        let limits = format!("critical are {}, {recursion}", duration(critical));
        let lags = format!("the actuator lags {}{spread}", duration(lag));
        match self.left {
            Some(left) => {
                let go = left + 2.0 * self.spread < critical.min(discrete);
                let text = format!(
                    "{lags}, {} of it left after \"{}\"; {limits}",
                    duration(left),
                    self.kind
                );
                (Some(go), about, text)
            }
            None => {
                let text = format!(
                    "{lags}; {limits}; what \"{}\" leaves of it is for the trials to say",
                    self.kind
                );
                (None, about, text)
            }
        }
    }

    /// Whether the loop with actuator and compensation is stable.
    pub fn of_stability(&self) -> (Option<bool>, String, String) {
        let about = format!("stability, {}", self.specimen);
        match self.roots {
            None => (
                None,
                about,
                format!(
                    "\"{}\" adapts or feeds back: it is for the trials to say",
                    self.kind
                ),
            ),
            Some((0, 0)) => (Some(true), about, format!("stable with \"{}\"", self.kind)),
            Some((all, 0) | (0, all)) => (
                None,
                about,
                format!("at the limit with \"{}\" ({all} roots)", self.kind),
            ),
            Some((all, _)) => (
                Some(false),
                about,
                format!(
                    "UNSTABLE with \"{}\": {all} roots right of the imaginary axis",
                    self.kind
                ),
            ),
        }
    }

    pub fn tabulate(&self, table: &mut Table) {
        let lag = match self.lag {
            Some((lag, omega, critical)) => format!(
                "actuator lags {} at {:.3} Hz, critical delay {}",
                duration(lag),
                omega / (2.0 * PI),
                duration(critical)
            ),
            None => "every delay of the actuator is stable".to_owned(),
        };
        let verdict = match self.roots {
            None => "not judged: what adapts or feeds back is for a rehearsal".to_owned(),
            Some((0, 0)) => "stable".to_owned(),
            Some((all, 0) | (0, all)) => format!("at the limit of stability ({all} roots)"),
            Some((all, _)) => format!("UNSTABLE: {all} roots right of the imaginary axis"),
        };
        table.row(
            &format!("following, {}", self.specimen),
            &format!("{lag};\nwith compensation \"{}\": {verdict}", self.kind),
        );
    }

    pub fn as_json(&self) -> serde_json::Value {
        json!({
            "specimen": self.specimen,
            "compensation": self.kind,
            "lag_s": self.lag.map(|lag| lag.0),
            "at_rad_per_s": self.lag.map(|lag| lag.1),
            "critical_delay_s": self.lag.map(|lag| lag.2),
            "unstable_roots": self.roots.map(|roots| roots.0),
            "possible": self.is_possible(),
        })
    }
}

/// Z_e bᵀ Z⁻¹ b at iω: what the specimen feels of its own missing motion.
fn felt(system: &Delayed, omega: f64) -> Option<Complex<f64>> {
    let n = system.mass.nrows();
    let square = omega * omega;
    let specimen = Complex::new(
        system.specimen_stiffness[(0, 0)] - square * system.specimen_mass,
        omega * system.specimen_damping[(0, 0)],
    );
    let row = DVector::from_fn(n, |i, _| Complex::new(system.rows[(0, i)], 0.0));
    let whole = DMatrix::from_fn(n, n, |i, j| {
        let own = Complex::new(
            system.stiffness[(i, j)] - square * system.mass[(i, j)],
            omega * system.damping[(i, j)],
        );
        own + specimen * row[i] * row[j]
    });
    Some(specimen * row.dot(&whole.lu().solve(&row)?))
}
