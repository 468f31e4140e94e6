//! `gusset check`: whether a test whose actuator is declared is stable with it, and with what makes up for it.
//!
//! The proof is in continuous time with linear specimens at their estimates: 1 + (H − 1) Z_e bᵀ Z⁻¹ b must not go round zero,
//! H being compensation times actuator, Z the dynamic stiffness of the whole and Z_e that of the specimen. It refuses only
//! what stays unstable with five per cent less of H − 1; what adapts, or feeds back, is not judged here but by a rehearsal.

mod state;

use std::f64::consts::PI;

use serde_json::json;

pub(super) use state::Follows;
use state::{Bears, State};

use super::spectrum::{Spectrum, diverging, growing};
use super::table::{Table, duration};
use crate::config::{Facts, Finding, KeyPath, Loaded, SpecimenTable};
use crate::spectral::delay::{DelayError, DiscreteLimit};

/// What is known of one specimen behind a declared actuator.
#[derive(Debug, Clone)]
pub struct Following {
    /// From 0.
    number: usize,
    /// Key of what decides how it follows: the compensation, or else the actuator.
    key: &'static str,
    specimen: String,
    at_rest: State,
    /// Standard deviation of the delay, s.
    spread: f64,
    /// The critical delay of the recursion, s; what was looked at, if there is none. None for another method than the family.
    discrete: Option<Result<DiscreteLimit, DelayError>>,
    /// Kind of the compensation.
    kind: &'static str,
    /// The same as K0 and C0 have it, with gaps closed and dampers at their reference, where that is another system than at rest.
    held: Option<State>,
    /// Whether the whole grows with nothing delayed, whatever is in touch.
    grows: bool,
}

/// Key of what decides how a specimen follows: the compensation, or else the actuator.
pub(super) const fn decides(table: &SpecimenTable) -> &'static str {
    match (&table.compensation, &table.link, &table.stand_in_transfer) {
        (Some(_), _, _) => "compensation",
        (None, None, _) => "transfer",
        (None, Some(_), Some(_)) => "stand_in_transfer",
        (None, Some(_), None) => "identified",
    }
}

/// What small motions do where dampers and gaps hold larger ones.
const ONLY_SMALL: &str =
    "small motions grow until closing gaps, or dampers as they are at their reference, hold them";
/// Where nothing adapts, and yet no roots are counted.
const NOT_FOLLOWED: &str = "not known: nothing damps it, or its curve could not be followed";
/// Where what is at rest does not hold what is beyond it.
const NO_BETTER: &str = "UNSTABLE as K0 and C0 have it, with gaps closed and dampers at their reference, and no better at rest";
/// What larger motions may do.
const ONLY_LARGE: &str = "stable at rest, and UNSTABLE as K0 and C0 have it, with gaps closed and dampers at their reference";

impl Following {
    /// One per specimen of one axis behind a declared actuator.
    pub fn of(loaded: &Loaded, facts: &Facts, spectrum: Option<&Spectrum>) -> Vec<Self> {
        let analysis = facts.structure.as_ref().and_then(|s| s.analysis.as_ref());
        let loops = analysis.map(|analysis| analysis.loops.as_slice());
        let grows = analysis.is_some_and(|analysis| analysis.growth().is_some());
        let pairs = loops.unwrap_or_default().iter().zip(&loaded.file.specimen);
        let judged = pairs.enumerate().filter_map(|(number, (one, table))| {
            let transfer = table.believed_transfer(1.0)?;
            let system = &one.system;
            if system.rows.nrows() != 1 {
                return None;
            }
            let follows = Follows {
                table,
                transfer: &transfer,
                tick: facts.rate_hz.recip(),
            };
            Some(Self {
                number,
                key: decides(table),
                specimen: one.name.clone(),
                at_rest: State::of(system, follows),
                spread: table
                    .identified
                    .and_then(|known| known.delay_std_s)
                    .unwrap_or(0.0),
                discrete: spectrum.and_then(|spectrum| spectrum.discrete(&one.name)),
                held: one.closed.as_ref().map(|closed| State::of(closed, follows)),
                kind: table
                    .compensation
                    .as_ref()
                    .map_or("none", |spec| spec.kind()),
                grows,
            })
        });
        judged.collect()
    }

    /// False if it is proven unstable.
    pub fn is_possible(&self) -> bool {
        !self.grows && !self.is_driven()
    }

    /// True if it is proven unstable at rest, and not stable as K0 and C0 have it, which is where it would come to; or unstable
    /// there, and no better at rest.
    fn is_driven(&self) -> bool {
        let at_rest = &self.at_rest;
        self.held.as_ref().map_or(at_rest.is_driven(), |held| {
            (at_rest.is_driven() && !held.is_stable()) || (held.is_driven() && at_rest.fails())
        })
    }

    /// True if it is refused for what it is as K0 and C0 have it.
    fn is_driven_beyond_rest(&self) -> bool {
        self.is_driven() && !self.at_rest.is_driven()
    }

    /// What is proven unstable in one of both and stable in the other, in words.
    fn in_one_only(&self) -> Option<String> {
        let held = self.held.as_ref()?;
        if self.at_rest.is_driven() && held.is_stable() {
            return Some(format!("UNSTABLE at rest: {ONLY_SMALL}"));
        }
        let only_beyond = held.is_driven() && self.at_rest.is_stable();
        only_beyond.then(|| ONLY_LARGE.to_owned())
    }

    /// The same as a warning, where the file says what makes it so.
    pub fn warning(&self) -> Option<Finding> {
        let at = KeyPath::root().key("specimen").index(self.number);
        let text = format!(
            "the test may grow with the actuator of {:?} as it is declared",
            self.specimen
        );
        let found = Finding::warning(at.key(self.key), text).at_key();
        let help = "how large it becomes is for the rehearsal to say, and for `added_energy_j` and `delay_used` to watch";
        self.in_one_only().map(|why| found.label(why).help(help))
    }

    /// Where the file says what makes it unstable.
    pub fn finding(&self) -> Option<Finding> {
        let at = KeyPath::root().key("specimen").index(self.number);
        let text = format!(
            "the test is unstable with the actuator of {:?} as it is declared",
            self.specimen
        );
        let label = match self.kind {
            "none" => "nothing makes up for its lag",
            _ => "too little, or too much, for this actuator",
        };
        let finding = Finding::error(at.key(self.key), text).at_key();
        let help = "the table shows its lag and the critical delay, where there is one";
        self.is_driven().then(|| finding.label(label).help(help))
    }

    /// Whether what is left of the delay is below what is critical, twice its spread included; not known where one of both ways
    /// to that does not know it, and the other does not forbid it.
    pub fn of_delay(&self) -> (Option<bool>, String, String) {
        let about = format!("delay, {}", self.specimen);
        if let Some(why) = self.unstable_at_once() {
            let text = format!("UNSTABLE without any delay: {why}");
            return (Some(false), about, text);
        }
        let (critical, lag) = match &self.at_rest.bears {
            Bears::Every if self.held_bears() == Some(false) => {
                return (None, about, ONLY_LARGE.to_owned());
            }
            Bears::Every => return (Some(true), about, "every delay is stable".to_owned()),
            Bears::None(why) => return (Some(false), about, format!("no delay is stable: {why}")),
            Bears::Unknown(error) => {
                let text = format!("no critical delay is known: {error}");
                return (None, about, text);
            }
            // Told above.
            Bears::Unstable(growth) => return (Some(false), about, growing(*growth)),
            Bears::LessThan { critical, lag, .. } => (*critical, *lag),
        };
        // Up to where the recursion is known to be stable, and whether it is known not to be beyond.
        let (known, ends, recursion) = match &self.discrete {
            Some(Ok(DiscreteLimit::At(tau))) => {
                (*tau, true, format!("{} by the recursion", duration(*tau)))
            }
            Some(Ok(DiscreteLimit::Beyond(tau))) => {
                let text = format!("none up to {} by the recursion", duration(*tau));
                (*tau, false, text)
            }
            Some(Err(error)) => (0.0, false, format!("not known by the recursion: {error}")),
            None => {
                let text = "not known by a recursion: another method than the family";
                (0.0, false, text.to_owned())
            }
        };
        let spread = if self.spread > 0.0 {
            format!(" ± {}", duration(self.spread))
        } else {
            String::new()
        };
        let limits = format!("critical are {}, {recursion}", duration(critical));
        let lags = format!("the actuator lags {}{spread}", duration(lag));
        match self.at_rest.left {
            Some(left) => {
                let most = left + 2.0 * self.spread;
                let go = match (most < critical, most < known) {
                    (true, true) => Some(true),
                    (true, false) if !ends => None,
                    _ => Some(false),
                };
                let text = format!(
                    "{lags}, {} of it left after \"{}\"; {limits}",
                    duration(left),
                    self.kind
                );
                match (go, self.held_bears()) {
                    // What the recursion alone forbids is not looked at as K0 and C0 have it.
                    (Some(false), Some(true)) if most >= critical => {
                        (None, about, format!("{text}; {ONLY_SMALL}"))
                    }
                    (Some(true), Some(false)) => (None, about, format!("{text}; {ONLY_LARGE}")),
                    _ => (go, about, text),
                }
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

    /// Whether it bears what is left of its delay as K0 and C0 have it, where that is another system.
    fn held_bears(&self) -> Option<bool> {
        self.held.as_ref()?.bears_what_is_left(self.spread)
    }

    /// Whether the loop with actuator and compensation is stable.
    pub fn of_stability(&self) -> (Option<bool>, String, String) {
        let about = format!("stability, {}", self.specimen);
        if let Some(text) = self.in_one_only() {
            return (None, about, text);
        }
        if self.is_driven_beyond_rest() {
            return (Some(false), about, NO_BETTER.to_owned());
        }
        match self.at_rest.roots {
            None if self.kind == "none" => (None, about, NOT_FOLLOWED.to_owned()),
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
        let lag = match &self.at_rest.bears {
            Bears::LessThan {
                critical,
                lag,
                omega,
            } => format!(
                "actuator lags {} at {:.3} Hz, critical delay {}",
                duration(*lag),
                omega / (2.0 * PI),
                duration(*critical)
            ),
            Bears::Every => "every delay of the actuator is stable".to_owned(),
            Bears::None(why) => format!("no delay of the actuator is stable: {why}"),
            Bears::Unstable(growth) => {
                format!("UNSTABLE without any delay: {}", growing(*growth))
            }
            Bears::Unknown(error) => format!("no critical delay is known: {error}"),
        };
        let verdict = match (self.in_one_only(), self.at_rest.roots) {
            (Some(text), _) => text,
            _ if self.is_driven_beyond_rest() => NO_BETTER.to_owned(),
            (None, None) if self.kind == "none" => NOT_FOLLOWED.to_owned(),
            (None, roots) => Self::verdict(roots),
        };
        table.row(
            &format!("following, {}", self.specimen),
            &format!("{lag};\nwith compensation \"{}\": {verdict}", self.kind),
        );
    }

    fn verdict(roots: Option<(u32, u32)>) -> String {
        match roots {
            None => "not judged: what adapts or feeds back is for a rehearsal".to_owned(),
            Some((0, 0)) => "stable".to_owned(),
            Some((all, 0) | (0, all)) => format!("at the limit of stability ({all} roots)"),
            Some((all, _)) => format!("UNSTABLE: {all} roots right of the imaginary axis"),
        }
    }

    /// What makes it unstable with nothing delayed, if anything does.
    fn unstable_at_once(&self) -> Option<String> {
        match (&self.at_rest.bears, &self.discrete) {
            (Bears::Unstable(growth), _) => Some(growing(*growth)),
            (_, Some(Err(DelayError::Unstable { radius }))) => Some(diverging(*radius)),
            _ => None,
        }
    }

    pub fn as_json(&self) -> serde_json::Value {
        let (critical, lag, omega) = match self.at_rest.bears {
            Bears::LessThan {
                critical,
                lag,
                omega,
            } => (Some(critical), Some(lag), Some(omega)),
            Bears::None(_) => (Some(0.0), None, None),
            Bears::Every | Bears::Unstable(_) | Bears::Unknown(_) => (None, None, None),
        };
        let unknown = match &self.at_rest.bears {
            Bears::Unknown(error) => Some(error.to_string()),
            _ => None,
        };
        json!({
            "specimen": self.specimen,
            "compensation": self.kind,
            "lag_s": lag,
            "at_rad_per_s": omega,
            "critical_delay_s": critical,
            "critical_delay_unknown": unknown,
            "unstable_without_delay": self.unstable_at_once(),
            "unstable_roots": self.at_rest.roots.map(|roots| roots.0),
            "possible": self.is_possible(),
        })
    }
}
