//! Rules of a fault script. A fault that makes no sense is refused, with its place.

use thiserror::Error;

use super::echo;
use super::fault_script::{Fault, Kind, MEMORY, Place, Script, Way};

/// A script that cannot be played.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("`{key}` {text}")]
pub struct ScriptError {
    /// Fault, from 0; `None` for an error of the script as a whole.
    pub fault: Option<usize>,
    /// The key.
    pub key: &'static str,
    /// The value found, and the values allowed.
    pub text: String,
}

/// Happens with the arming, or all the time: no command is named.
const fn is_timeless(kind: Kind) -> bool {
    matches!(
        kind,
        Kind::ClockDrift { .. } | Kind::ArmingUnanswered | Kind::Elsewhere { .. }
    )
}

/// Happens once, at one command.
const fn is_moment(kind: Kind) -> bool {
    matches!(
        kind,
        Kind::Closed | Kind::Hangs { .. } | Kind::Goodbye | Kind::ControllerStalls { .. }
    )
}

/// A parameter out of range, with its key and the allowed range.
fn wrong_parameter(kind: Kind) -> Option<(&'static str, f64, &'static str)> {
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
    match kind {
        Kind::Late { ticks } | Kind::Jitter { ticks } | Kind::Hangs { ticks } => {
            positive("ticks", ticks)
        }
        Kind::ControllerStalls { ticks } => positive("ticks", ticks as f64),
        Kind::Duplicated { times } => memory("times", times as usize),
        Kind::OldAgain { age } => memory("age", age),
        Kind::Corrupted { bits } => memory("bits", bits as usize),
        Kind::AnswersTheFuture { by } => positive("by", by as f64),
        Kind::ClockDrift { ppm } => {
            let inside = ppm != 0.0 && ppm.abs() <= 500_000.0;
            (!inside).then_some(("ppm", ppm, "other than 0, at most 500000 either way"))
        }
        Kind::Stroke { disp_m } => positive("disp_m", disp_m),
        Kind::Rate { vel_m_per_s } => positive("vel_m_per_s", vel_m_per_s),
        Kind::ForceLimit { force_n } => positive("force_n", force_n),
        Kind::Lag { commands } => memory("commands", commands),
        Kind::Elsewhere { disp_m } => some(disp_m, 0.0).map(|_| ("disp_m", disp_m, "other than 0")),
        Kind::Bias { disp_m, force_n } | Kind::Drift { disp_m, force_n } => some(disp_m, force_n),
        Kind::Noise { disp_m, force_n } => noise("disp_m", disp_m)
            .or(noise("force_n", force_n))
            .or(some(disp_m, force_n)),
        Kind::Gain { factor } => {
            let inside = factor != 1.0 && factor.abs() < 1e12;
            let allowed = "another number than 1, below 1e12 either way";
            (!inside).then_some(("factor", factor, allowed))
        }
        _ => None,
    }
}
/// Checks whether `script` can be played on a specimen with this number of axes.
///
/// # Errors
/// The first mistake.
pub fn check_script(script: &Script, axes: Option<usize>) -> Result<(), ScriptError> {
    for (number, fault) in script.fault.iter().enumerate() {
        check_fault(fault, number)?;
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

fn check_fault(fault: &Fault, number: usize) -> Result<(), ScriptError> {
    let wrong = |key, text: String| {
        Err(ScriptError {
            fault: Some(number),
            key,
            text,
        })
    };
    let place = fault.kind.place();
    if let Some((key, found, wanted)) = wrong_parameter(fault.kind) {
        return wrong(
            key,
            format!("is {}, but must be {wanted}", echo::number(found)),
        );
    }
    if let Some(probability) = fault.probability {
        let inside = probability > 0.0 && probability <= 1.0;
        if !inside {
            let text = format!("is {probability}, but must be greater than 0 and at most 1");
            return wrong("probability", text);
        }
    }
    if fault.lasts == Some(0) {
        return wrong("for", "is 0, but must be at least 1".to_owned());
    }
    if fault.axis == Some(0) {
        return wrong("axis", "is 0, but axes count from 1".to_owned());
    }
    let timeless = is_timeless(fault.kind);
    let no = |key| wrong(key, "has no meaning for this kind of fault".to_owned());
    if timeless && fault.at.is_some() {
        return no("at");
    }
    if (timeless || is_moment(fault.kind)) && fault.lasts.is_some() {
        return no("for");
    }
    if (timeless || place == Place::Controller) && fault.probability.is_some() {
        return no("probability");
    }
    if fault.on.is_some() && place != Place::Frames {
        return no("on");
    }
    let of_an_axis = place == Place::Rig
        && !matches!(
            fault.kind,
            Kind::Interlock | Kind::Saturated | Kind::Goodbye
        );
    if fault.axis.is_some() && !of_an_axis && fault.kind != Kind::NotANumberSent {
        return no("axis");
    }
    let of_replies = matches!(
        fault.kind,
        Kind::NotANumberSent | Kind::AnswersTheFuture { .. }
    );
    if of_replies && fault.on == Some(Way::Commands) {
        return wrong(
            "on",
            "is \"commands\", but only a reply can do that".to_owned(),
        );
    }
    Ok(())
}
