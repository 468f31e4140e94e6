//! Whether a fault script can be played: what makes no sense is refused, with its place.

use thiserror::Error;

use super::spec::{Fault, Kind, MEMORY, Place, Script, Way};

/// A script that cannot be played.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("`{key}` {text}")]
pub struct ScriptError {
    /// Fault, from 0; none for what concerns the script as a whole.
    pub fault: Option<usize>,
    /// The key.
    pub key: &'static str,
    /// What was found, and what is wanted.
    pub text: String,
}

impl Kind {
    /// Happens with the arming, or all the time: no command is named.
    const fn is_timeless(self) -> bool {
        matches!(
            self,
            Self::ClockDrift { .. } | Self::ArmingUnanswered | Self::Elsewhere { .. }
        )
    }

    /// Happens once, at one command.
    const fn is_moment(self) -> bool {
        matches!(
            self,
            Self::Closed | Self::Hangs { .. } | Self::Goodbye | Self::ControllerStalls { .. }
        )
    }

    /// A parameter that is not inside, with its key and what is wanted.
    fn wrong(self) -> Option<(&'static str, f64, &'static str)> {
        let positive = |key, value: f64| {
            let inside = value > 0.0 && value < 1e12;
            (!inside).then_some((key, value, "greater than 0 and less than 1e12"))
        };
        let memory = |key, value: usize| {
            let inside = (1..=MEMORY).contains(&value);
            (!inside).then_some((key, value as f64, "from 1 to 64"))
        };
        let noise = |key, value: f64| {
            let inside = value >= 0.0;
            (!inside).then_some((key, value, "at least 0: it goes either way"))
        };
        let some = |disp: f64, force: f64| {
            let inside = disp != 0.0 || force != 0.0;
            (!inside).then_some(("force_n", force, "something, or `disp_m`"))
        };
        match self {
            Self::Late { ticks } | Self::Jitter { ticks } | Self::Hangs { ticks } => {
                positive("ticks", ticks)
            }
            Self::ControllerStalls { ticks } => positive("ticks", ticks as f64),
            Self::Duplicated { times } => memory("times", times as usize),
            Self::OldAgain { age } => memory("age", age),
            Self::Corrupted { bits } => memory("bits", bits as usize),
            Self::AnswersTheFuture { by } => positive("by", by as f64),
            Self::ClockDrift { ppm } => {
                let inside = ppm != 0.0 && ppm.abs() <= 500_000.0;
                (!inside).then_some(("ppm", ppm, "other than 0, at most 500000 either way"))
            }
            Self::Stroke { disp_m } => positive("disp_m", disp_m),
            Self::Rate { vel_m_per_s } => positive("vel_m_per_s", vel_m_per_s),
            Self::ForceLimit { force_n } => positive("force_n", force_n),
            Self::Lag { commands } => memory("commands", commands),
            Self::Elsewhere { disp_m } => {
                some(disp_m, 0.0).map(|_| ("disp_m", disp_m, "other than 0"))
            }
            Self::Bias { disp_m, force_n } | Self::Drift { disp_m, force_n } => {
                some(disp_m, force_n)
            }
            Self::Noise { disp_m, force_n } => noise("disp_m", disp_m)
                .or(noise("force_n", force_n))
                .or(some(disp_m, force_n)),
            Self::Gain { factor } => {
                let inside = factor != 1.0 && factor.abs() < 1e12;
                let allowed = "another number than 1, below 1e12 either way";
                (!inside).then_some(("factor", factor, allowed))
            }
            _ => None,
        }
    }
}

/// A number without the three hundred digits of a slip in its exponent.
fn short(value: f64) -> String {
    if (1e-5..1e15).contains(&value.abs()) || value == 0.0 {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

impl Fault {
    fn check(&self, number: usize) -> Result<(), ScriptError> {
        let wrong = |key, text: String| {
            Err(ScriptError {
                fault: Some(number),
                key,
                text,
            })
        };
        let place = self.kind.place();
        if let Some((key, found, wanted)) = self.kind.wrong() {
            return wrong(key, format!("is {}, but must be {wanted}", short(found)));
        }
        if let Some(probability) = self.probability {
            let inside = probability > 0.0 && probability <= 1.0;
            if !inside {
                let text = format!("is {probability}, but must be greater than 0 and at most 1");
                return wrong("probability", text);
            }
        }
        if self.lasts == Some(0) {
            return wrong("for", "is 0, but must be at least 1".to_owned());
        }
        if self.axis == Some(0) {
            return wrong("axis", "is 0, but axes count from 1".to_owned());
        }
        let timeless = self.kind.is_timeless();
        let no = |key| wrong(key, "has no meaning for this kind of fault".to_owned());
        if timeless && self.at.is_some() {
            return no("at");
        }
        if (timeless || self.kind.is_moment()) && self.lasts.is_some() {
            return no("for");
        }
        if (timeless || place == Place::Controller) && self.probability.is_some() {
            return no("probability");
        }
        if self.on.is_some() && place != Place::Frames {
            return no("on");
        }
        let of_an_axis = place == Place::Rig
            && !matches!(self.kind, Kind::Interlock | Kind::Saturated | Kind::Goodbye);
        if self.axis.is_some() && !of_an_axis && self.kind != Kind::NotANumberSent {
            return no("axis");
        }
        let of_replies = matches!(
            self.kind,
            Kind::NotANumberSent | Kind::AnswersTheFuture { .. }
        );
        if of_replies && self.on == Some(Way::Commands) {
            return wrong(
                "on",
                "is \"commands\", but only a reply can do that".to_owned(),
            );
        }
        Ok(())
    }
}

impl Script {
    /// Whether it can be played on a specimen of so many axes.
    ///
    /// # Errors
    /// The first thing that is wrong with it.
    pub fn check(&self, axes: Option<usize>) -> Result<(), ScriptError> {
        for (number, fault) in self.fault.iter().enumerate() {
            fault.check(number)?;
            if let (Some(axis), Some(axes)) = (fault.axis, axes)
                && axis > axes
            {
                return Err(ScriptError {
                    fault: Some(number),
                    key: "axis",
                    text: format!("is {axis}, but the specimen has {axes}"),
                });
            }
        }
        Ok(())
    }
}
