//! Is the loop stable with its declared actuator and compensation? One proof per specimen with one axis.
//!
//! The proof is in continuous time with linear specimens at their estimates. The loop is stable if
//! 1 + (H − 1) Z_e bᵀ Z⁻¹ b has no zero right of the imaginary axis. H is compensation times actuator, Z the dynamic stiffness
//! of the whole and Z_e that of the specimen. A compensator that adapts or feeds back is not proven here.

use std::cell::LazyCell;
use std::f64::consts::PI;

use serde_json::json;

use super::bound::{DelayBound, DelayBounds, DelayCondition, diverging, growing};
use super::case::Case;
use super::kind::Kind;
use super::state::{Bears, State};
use gusset_numerics::spectral::delay::{DelayError, DiscreteLimit};
use gusset_quantity::finding::{Finding, KeyPath};
use gusset_quantity::units::duration;

/// Findings about one specimen behind a declared actuator.
#[derive(Debug, Clone)]
pub struct Following {
    /// Key of the actuator or compensation that decides how it follows.
    place: KeyPath,
    specimen: String,
    at_rest: State,
    /// Standard deviation of the delay, s.
    spread: f64,
    /// The critical delay of the recursion in s, or the longest delay that was examined. `None` for a method outside the
    /// family.
    discrete: Option<Result<DiscreteLimit, DelayError>>,
    /// Kind of the compensation.
    kind: &'static str,
    /// The state at K0 and C0 (gaps closed, dampers at their reference), where it differs from that at rest.
    held: Option<State>,
    /// Whether the whole grows with nothing delayed, whatever is in touch.
    grows: bool,
}

/// What small motions do where dampers and gaps hold larger ones.
const ONLY_SMALL: &str =
    "small motions grow until gaps close, or until dampers reach their reference state";
/// Where nothing adapts, and yet no roots are counted.
const NOT_FOLLOWED: &str = "not known: nothing damps it, or its curve could not be followed";
/// What larger motions may do.
const ONLY_LARGE: &str =
    "stable at rest, and UNSTABLE with K0 and C0 (gaps closed, dampers at their reference)";

impl Following {
    /// One per specimen with one axis and a declared actuator.
    #[must_use]
    pub fn of(case: &Case<'_>) -> Vec<Self> {
        let analysis = case.analysis;
        let loops = analysis.map(|analysis| analysis.loops.as_slice());
        let grows = LazyCell::new(|| analysis.is_some_and(|analysis| analysis.growth().is_some()));
        let pairs = loops.unwrap_or_default().iter().zip(&case.actuators);
        let judged = pairs.filter_map(|(one, actuator)| {
            let follows = actuator.follows(case.tick)?;
            if one.system.rows.nrows() != 1 {
                return None;
            }
            Some(Self {
                place: actuator.place(),
                specimen: one.name.clone(),
                at_rest: State::of(&one.system, follows),
                spread: actuator.delay_std_s,
                discrete: case.lambda.map(|lambda| one.discrete(case.dt, lambda)),
                held: one.closed.as_ref().map(|closed| State::of(closed, follows)),
                kind: actuator.kind(),
                grows: *grows,
            })
        });
        judged.collect()
    }

    /// Name of the specimen.
    #[must_use]
    pub fn specimen(&self) -> &str {
        &self.specimen
    }

    /// False if the loop is proven unstable.
    #[must_use]
    pub(crate) fn is_possible(&self) -> bool {
        !self.grows && !self.is_unstable()
    }

    /// True if the loop is proven unstable with its actuator: at rest, and not known to be stable at K0 and C0, where growing
    /// motions would take it; or at K0 and C0, and not known to be stable at rest.
    fn is_unstable(&self) -> bool {
        let at_rest = &self.at_rest;
        self.held.as_ref().map_or(at_rest.is_unstable(), |held| {
            (at_rest.is_unstable() && !held.is_stable())
                || (held.is_unstable() && at_rest.bears_nothing())
        })
    }

    /// Says in which of both states the loop is unstable, if it is unstable in one only.
    fn in_one_only(&self) -> Option<String> {
        let held = self.held.as_ref()?;
        if self.is_unstable() {
            return None;
        }
        if self.at_rest.is_unstable() {
            return Some(format!("UNSTABLE at rest: {ONLY_SMALL}"));
        }
        held.is_unstable().then(|| ONLY_LARGE.to_owned())
    }

    /// Roots right of the imaginary axis in the state that decides; none if they are not counted.
    fn unstable_roots(&self) -> Option<u32> {
        if self.is_unstable() {
            return self.at_rest.roots;
        }
        match &self.held {
            Some(held) if self.at_rest.is_unstable() => held.roots,
            _ => self.at_rest.roots,
        }
    }

    /// Its finding for the verdict: an error if the loop is proven unstable, a warning if the stability is not known.
    #[must_use]
    pub(crate) fn finding(&self) -> Option<(Kind, Finding)> {
        let at = self.place.clone();
        let name = &self.specimen;
        if self.is_unstable() {
            let text = format!(
                "the loop is unstable with the actuator of specimen \"{name}\"{}",
                self.reason()
            );
            let finding = self.with_numbers(Finding::error(at, text).at_key());
            let label = match self.kind {
                "none" => "nothing compensates its lag",
                _ => "this compensation does not suit the actuator",
            };
            return Some((Kind::Unstable, finding.label(label).help(self.advice())));
        }
        if let Some(why) = self.in_one_only() {
            let text = format!("the response may grow with the actuator of specimen \"{name}\"");
            let finding = self.with_numbers(Finding::warning(at, text).at_key());
            let help =
                "the rehearsal shows how far it grows; `added_energy_j` and `delay_used` watch it";
            return Some((Kind::Unknown, finding.label(why).help(help)));
        }
        if self.grows || self.at_rest.roots.is_some() {
            return None;
        }
        let text = format!(
            "the stability of the loop with the actuator of specimen \"{name}\" is not known"
        );
        let label = match self.kind {
            "none" => NOT_FOLLOWED.to_owned(),
            kind => format!("no proof for \"{kind}\", which adapts or feeds back"),
        };
        let finding = Finding::warning(at, text).at_key().label(label);
        let help = "`check --rehearse` tries it over everything that is uncertain";
        Some((Kind::Unknown, self.with_numbers(finding).help(help)))
    }

    fn with_numbers(&self, finding: Finding) -> Finding {
        let finding = match self.at_rest.bears {
            Bears::LessThan { critical, lag, .. } => finding
                .number("lag_s", lag)
                .number("critical_delay_s", critical),
            _ => finding,
        };
        match self.unstable_roots() {
            Some(roots) => finding.number("unstable_roots", f64::from(roots)),
            None => finding,
        }
    }

    /// Why an unstable loop is unstable.
    fn reason(&self) -> String {
        match self.at_rest.bears {
            Bears::LessThan { critical, lag, .. } => format!(
                ": it lags {}, and the critical delay is {}",
                duration(lag),
                duration(critical)
            ),
            _ => String::new(),
        }
    }

    /// What makes an unstable loop stable.
    fn advice(&self) -> &'static str {
        match self.kind {
            "none" => "compensate the lag with [specimen.compensation]",
            _ => "tune [specimen.compensation] to this actuator",
        }
    }

    /// Whether what is left of the delay is below what is critical, twice its spread included; not known where one of both ways
    /// to that does not know it, and the other does not forbid it.
    #[must_use]
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
                    // The recursion's own limit is not computed at K0 and C0.
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

    /// Whether the loop at K0 and C0, where that is another system, is stable with the remaining delay.
    fn held_bears(&self) -> Option<bool> {
        self.held.as_ref()?.bears_what_is_left(self.spread)
    }

    /// Whether the loop with actuator and compensation is stable.
    #[must_use]
    pub fn of_stability(&self) -> (Option<bool>, String, String) {
        let about = format!("stability, {}", self.specimen);
        if let Some(text) = self.in_one_only() {
            return (None, about, text);
        }
        if self.is_unstable() {
            return (Some(false), about, self.roots_in_words());
        }
        match self.at_rest.roots {
            None if self.kind == "none" => (None, about, NOT_FOLLOWED.to_owned()),
            None => {
                let text = format!("\"{}\" adapts or feeds back: the trials decide", self.kind);
                (None, about, text)
            }
            Some(_) => (Some(true), about, format!("stable with \"{}\"", self.kind)),
        }
    }

    /// That the loop is unstable, and by how many roots where they are counted.
    fn roots_in_words(&self) -> String {
        match self.unstable_roots() {
            Some(roots) if roots > 0 => format!(
                "UNSTABLE with \"{}\": {roots} roots right of the imaginary axis",
                self.kind
            ),
            _ => format!(
                "UNSTABLE with \"{}\": its lag is beyond the critical delay",
                self.kind
            ),
        }
    }

    /// Its lag, the critical delay and what follows, in two lines.
    #[must_use]
    pub fn words(&self) -> (String, String) {
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
            _ if self.is_unstable() => self.roots_in_words(),
            (None, None) if self.kind == "none" => NOT_FOLLOWED.to_owned(),
            (None, None) => "not proven: it adapts or feeds back".to_owned(),
            (None, Some(_)) => "stable".to_owned(),
        };
        (
            format!("actuator, {}", self.specimen),
            format!("{lag};\nwith compensation \"{}\": {verdict}", self.kind),
        )
    }

    /// Lag, critical delay and stability with the compensation, in one line.
    #[must_use]
    pub fn in_short(&self) -> String {
        let bounds = self.bounds();
        let lag = bounds.in_words(|condition, critical| {
            let critical = format!("critical delay {}", duration(critical));
            match self.lag_under(condition) {
                Some(lag) => format!("lags {}, {critical}", duration(lag)),
                None => critical,
            }
        });
        let verdict = match (self.in_one_only(), self.at_rest.roots) {
            (Some(text), _) => text,
            _ if self.is_unstable() => "UNSTABLE".to_owned(),
            (None, None) => "not proven".to_owned(),
            (None, Some(_)) => "stable".to_owned(),
        };
        match self.kind {
            "none" => format!("{lag}; uncompensated: {verdict}"),
            _ => format!("{lag}; compensated: {verdict}"),
        }
    }

    /// The delays that are stable under each condition.
    fn bounds(&self) -> DelayBounds {
        let mut bounds = vec![(DelayCondition::AtRest, self.at_rest.bears.bound())];
        if let Some(found) = &self.discrete {
            bounds.push((DelayCondition::Recursion, DelayBound::recursion(found)));
        }
        if let Some(held) = &self.held {
            bounds.push((DelayCondition::Closed, held.bears.bound()));
        }
        DelayBounds(bounds)
    }

    /// The lag of the actuator in s at the frequency that its critical delay makes unstable; none where no frequency is known.
    fn lag_under(&self, condition: DelayCondition) -> Option<f64> {
        let bears = match (condition, &self.held) {
            (DelayCondition::Closed, Some(held)) => &held.bears,
            _ => &self.at_rest.bears,
        };
        match bears {
            Bears::LessThan { lag, .. } => Some(*lag),
            _ => None,
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

    /// As `following` of `check --json`.
    #[must_use]
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
            "unstable_roots": self.unstable_roots(),
            "possible": self.is_possible(),
        })
    }
}
