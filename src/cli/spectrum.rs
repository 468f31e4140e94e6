//! Modes and delays of a test in words and as JSON. The curves are in `figures`.

mod figures;

use std::f64::consts::TAU;

use serde_json::{Value, json};

use super::table::Table;
use crate::integrate::Lambda;
use crate::setup::{Facts, StructureFacts};
use crate::spectral::delay::{Critical, DelayError, Delayed, DiscreteLimit, continuous};
use crate::stability::{
    ALL_MODES, DelayBound, DelayBounds, DelayCondition, INERTIA, Loop, ModeFacts, diverging,
    growing,
};
use crate::units::{duration, number, quantity};

/// Modes that are listed.
const LISTED: usize = 6;

/// Frequency, period and Ω of a mode, in columns.
pub(super) fn swing(omega: f64, dt: f64) -> String {
    let hz = omega / TAU;
    let period = if hz > 0.0 {
        duration(1.0 / hz)
    } else {
        "none".to_owned()
    };
    format!("{hz:>9.4} Hz  {period:>11}  {:>10.6}", omega * dt)
}

/// A share in per cent. A value that rounds to zero has no sign.
fn percent(share: f64, signed: bool) -> String {
    let value = 100.0 * share;
    let zero = value.abs() < 0.5e-4;
    match (zero, signed) {
        (true, _) => "0.0000 %".to_owned(),
        (false, true) => format!("{value:+.4} %"),
        (false, false) => format!("{value:.4} %"),
    }
}

/// Modes and critical delays of a test. For a method outside the Gui-λ family only delays in continuous time are known.
pub(super) struct Spectrum {
    dt: f64,
    lambda: Option<f64>,
    modes: Vec<ModeFacts>,
    /// Whether these are all modes.
    complete: bool,
    highest: Option<f64>,
    delays: Vec<Delay>,
}

struct Delay {
    specimen: Loop,
    continuous: Result<Option<Critical>, DelayError>,
    /// By the recursion of the family.
    discrete: Option<Result<DiscreteLimit, DelayError>>,
    /// In continuous time at K0 and C0, where that is another structure.
    closed: Option<Result<Option<Critical>, DelayError>>,
    growth: Option<f64>,
    closed_growth: Option<f64>,
}

impl Delay {
    /// The reason why it is unstable without any delay, if it is.
    fn at_once(&self) -> Option<String> {
        let growing = self.growth.map(growing);
        let recursion = self.radius().map(diverging);
        let both: Vec<String> = growing.into_iter().chain(recursion).collect();
        (!both.is_empty()).then(|| both.join("; "))
    }

    /// The delays that are stable under each condition.
    fn bounds(&self) -> DelayBounds {
        let at_rest = DelayBound::continuous(self.growth, &self.continuous);
        let mut bounds = vec![(DelayCondition::AtRest, at_rest)];
        if let Some(found) = &self.discrete {
            bounds.push((DelayCondition::Recursion, DelayBound::recursion(found)));
        }
        if let Some(found) = &self.closed {
            let closed = DelayBound::continuous(self.closed_growth, found);
            bounds.push((DelayCondition::Closed, closed));
        }
        DelayBounds(bounds)
    }

    /// The frequency in rad/s that the critical delay makes unstable. For the recursion it is that in continuous time.
    fn grows_at(&self, condition: DelayCondition) -> Option<f64> {
        let found = match condition {
            DelayCondition::AtRest | DelayCondition::Recursion => Some(&self.continuous),
            DelayCondition::Closed => self.closed.as_ref(),
        };
        let critical = found?.as_ref().ok()?.as_ref()?;
        critical.omega.is_finite().then_some(critical.omega)
    }

    /// Spectral radius of a recursion that is unstable with nothing delayed.
    fn radius(&self) -> Option<f64> {
        match self.discrete {
            Some(Err(DelayError::Unstable { radius })) => Some(radius),
            _ => None,
        }
    }
}

impl Spectrum {
    /// Returns none for a structure that is too large.
    pub(super) fn of(facts: &Facts, structure: &StructureFacts) -> Option<Self> {
        let lambda = structure.lambda.map(Lambda::value);
        let analysis = structure.analysis.as_ref()?;
        let delays = analysis.loops.iter().map(|specimen| Delay {
            continuous: specimen.continuous(),
            discrete: lambda.map(|lambda| specimen.discrete(facts.dt, lambda)),
            closed: specimen.closed.as_ref().map(continuous),
            growth: specimen.system.growth(),
            closed_growth: specimen.closed.as_ref().and_then(Delayed::growth),
            specimen: specimen.clone(),
        });
        let modes = structure
            .lambda
            .map(|chosen| analysis.modes(facts.dt, chosen));
        let modes = modes.unwrap_or_default();
        let complete = structure.dofs <= ALL_MODES;
        let highest = if complete {
            modes.last().map(|mode| mode.frequency)
        } else {
            analysis.highest()
        };
        Some(Self {
            dt: facts.dt,
            lambda,
            modes,
            complete,
            highest,
            delays: delays.collect(),
        })
    }

    /// Whether the method is one of the family, of which more is known.
    pub(super) const fn is_of_family(&self) -> bool {
        self.lambda.is_some()
    }

    /// One line per mode: all that are listed, and the highest.
    pub(super) fn tabulate(&self, table: &mut Table) {
        if self.modes.is_empty() {
            return;
        }
        table.row(
            "mode",
            "   frequency       period    Ω = ω·Δt   period error   damping  → at this λ",
        );
        let line = |mode: &ModeFacts| {
            let swing = swing(mode.frequency, self.dt);
            match (mode.period_error(self.dt), mode.apparent) {
                (Some(error), Some(apparent)) => format!(
                    "{swing}  {:>13}  {:>8}  → {:>8}",
                    percent(error, true),
                    percent(mode.ratio, false),
                    percent(apparent.ratio, false)
                ),
                _ if mode.ratio >= 1.0 && mode.ratio.is_finite() => {
                    format!(
                        "{swing}   overdamped, ξ = {:.4}: no oscillation",
                        mode.ratio
                    )
                }
                _ if mode.frequency > 0.0 => {
                    format!("{swing}   real poles: no oscillation at this step")
                }
                _ => format!("{swing}   a free body"),
            }
        };
        let count = self.modes.len();
        let (listed, last) = match count {
            0..=LISTED => (count, None),
            _ => (LISTED - 1, self.modes.last().filter(|_| self.complete)),
        };
        let listed = if self.complete {
            listed
        } else {
            count.min(LISTED)
        };
        for (index, mode) in self.modes.iter().take(listed).enumerate() {
            table.row(&format!("  {}", index + 1), &line(mode));
        }
        match (last, self.highest) {
            (Some(last), _) => table.row(&format!("  {count}"), &line(last)),
            (None, Some(highest)) if !self.complete => {
                table.row("  highest", &swing(highest, self.dt));
            }
            _ => {}
        }
    }

    /// Period error of the lowest mode, if it is known and the mode oscillates.
    pub(super) fn period_error(&self) -> Option<f64> {
        self.modes.first()?.period_error(self.dt)
    }

    /// The lowest natural frequency in rad/s, if it is known.
    pub(super) fn lowest(&self) -> Option<f64> {
        self.modes.first().map(|mode| mode.frequency)
    }

    /// The highest natural frequency in rad/s, if it is known.
    pub(super) fn highest(&self) -> Option<f64> {
        self.highest
    }

    /// One line per specimen.
    pub(super) fn describe(&self, table: &mut Table) {
        const NO_DAMPING: &str =
            "none that is stable: without damping every delay lets the response grow";
        // A millionth of a step is where the search for it ends.
        let vanishes = |tau: f64| tau < 1e-5 * self.dt;
        for delay in &self.delays {
            if let Some(why) = delay.at_once() {
                table.row(
                    &format!("without delay, {}", delay.specimen.name),
                    &format!("UNSTABLE: {why}"),
                );
            }
            let steps = |tau: f64| format!("{} = {:.3} Δt", duration(tau), tau / self.dt);
            let continuous = match &delay.continuous {
                _ if delay.growth.is_some() => {
                    "none: unstable without any in continuous time".to_owned()
                }
                Ok(Some(found)) if found.omega.is_infinite() => format!("none: {INERTIA}"),
                Ok(Some(found)) if vanishes(found.delay) => NO_DAMPING.to_owned(),
                Ok(Some(found)) => format!(
                    "{} in continuous time, then it grows at {:.4} Hz",
                    steps(found.delay),
                    found.omega / TAU
                ),
                Ok(None) => "none in continuous time: every delay is stable".to_owned(),
                Err(error) => format!("not known in continuous time: {error}"),
            };
            let continuous = match &delay.closed {
                None => continuous,
                Some(closed) => {
                    let closed = match closed {
                        Ok(Some(found)) => steps(found.delay),
                        Ok(None) => "every delay is stable".to_owned(),
                        Err(error) => error.to_string(),
                    };
                    format!(
                        "{continuous}\n(at rest; with K0 and C0, that is with closed gaps and dampers at their reference: {closed})"
                    )
                }
            };
            let name = format!("critical delay, {}", delay.specimen.name);
            let Some(discrete) = &delay.discrete else {
                table.row(&name, &continuous);
                continue;
            };
            let discrete = match discrete {
                Ok(DiscreteLimit::At(tau)) if vanishes(*tau) => {
                    "none by the recursion either".to_owned()
                }
                Ok(DiscreteLimit::At(tau)) => {
                    format!("{} by the recursion at this Δt and λ", steps(*tau))
                }
                Ok(DiscreteLimit::Beyond(tau)) => {
                    format!("none up to {} by the recursion", duration(*tau))
                }
                Err(DelayError::Unstable { .. }) => {
                    "none: unstable without any by the recursion".to_owned()
                }
                Err(error) => format!("not known by the recursion: {error}"),
            };
            table.row(&name, &format!("{continuous};\n{discrete}"));
        }
    }

    /// The critical delay of one specimen in a few words, for each specimen that is not in `judged`.
    pub(super) fn in_short(&self, judged: &[&str]) -> Vec<(&str, String)> {
        let delays = self.delays.iter();
        let delays = delays.filter(|delay| !judged.contains(&delay.specimen.name.as_str()));
        let each = delays.map(|delay| (delay.specimen.name.as_str(), self.limit_of(delay)));
        each.collect()
    }

    /// The smallest critical delay that is known, and what follows from it.
    fn limit_of(&self, delay: &Delay) -> String {
        if let Some(why) = delay.at_once() {
            return format!("UNSTABLE without any delay: {why}");
        }
        let bounds = delay.bounds();
        let text = bounds.in_words(|_, tau| match tau < 1e-5 * self.dt {
            true => "0".to_owned(),
            false => format!("{} ({} steps)", quantity(tau, "s"), number(tau / self.dt)),
        });
        match bounds.smallest() {
            Some((_, DelayBound::Below(tau))) if *tau < 1e-5 * self.dt => {
                format!("{text}: without damping every delay lets the response grow")
            }
            Some((condition, DelayBound::Below(_))) => {
                let grows = delay.grows_at(condition).map(|omega| {
                    format!(
                        "; beyond it the response grows at {} Hz",
                        number(omega / TAU)
                    )
                });
                format!("{text}{}", grows.unwrap_or_default())
            }
            _ => text,
        }
    }

    /// Modes as JSON.
    pub(super) fn modes_json(&self) -> Value {
        let each = self.modes.iter().take(LISTED).map(|mode| {
            json!({
                "frequency_rad_per_s": mode.frequency,
                "omega": mode.frequency * self.dt,
                "damping_ratio": finite(mode.ratio),
                "apparent_omega": mode.apparent.map(|apparent| apparent.omega),
                "period_error": mode.period_error(self.dt).and_then(finite),
                "damping_error": mode.damping_error().and_then(finite),
            })
        });
        each.collect()
    }

    /// Delays as JSON.
    pub(super) fn delays_json(&self) -> Value {
        let each = self.delays.iter().map(|delay| {
            let continuous = match &delay.continuous {
                _ if delay.growth.is_some() => json!({ "growth_per_s": delay.growth }),
                Ok(Some(found)) => {
                    json!({ "delay_s": found.delay, "omega_rad_per_s": finite(found.omega) })
                }
                Ok(None) => json!({ "delay_s": null }),
                Err(error) => json!({ "unknown": error.to_string() }),
            };
            let discrete = delay.discrete.as_ref().map(|found| match found {
                Ok(DiscreteLimit::At(tau)) => json!({ "delay_s": tau }),
                Ok(DiscreteLimit::Beyond(tau)) => json!({ "delay_s": null, "looked_to_s": tau }),
                Err(DelayError::Unstable { radius }) => json!({ "spectral_radius": radius }),
                Err(error) => json!({ "unknown": error.to_string() }),
            });
            json!({
                "specimen": delay.specimen.name,
                "unstable_without_delay": delay.at_once(),
                "continuous": continuous,
                "with_gaps_closed": delay.closed.as_ref().map(|found| match found {
                    Ok(found) => json!({ "delay_s": found.map(|found| found.delay) }),
                    Err(error) => json!({ "unknown": error.to_string() }),
                }),
                "discrete": discrete,
            })
        });
        each.collect()
    }
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
