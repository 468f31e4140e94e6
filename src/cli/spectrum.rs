//! Modes and delays of a test in words and as JSON.

use std::f64::consts::TAU;

use anyhow::Context;
use std::path::Path;

use serde_json::{Value, json};

use super::table::Table;
use gusset_evidence::verify::{Axes, Figure, Scale, Series};
use gusset_numerics::spectral::delay::{DelayError, DiscreteLimit};
use gusset_proof::{CriticalDelays, DelayBound, Diagram, INERTIA, ModeFacts, Spectrum, diagrams};
use gusset_quantity::units::{duration, number, quantity};
use gusset_record::{atomic, make_free};

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

/// One line per mode: all that are listed, and the highest.
pub(super) fn tabulate(spectrum: &Spectrum, table: &mut Table) {
    if spectrum.modes.is_empty() {
        return;
    }
    table.row(
        "mode",
        "   frequency       period    Ω = ω·Δt   period error   damping  → at this λ",
    );
    let line = |mode: &ModeFacts| {
        let swing = swing(mode.frequency, spectrum.dt);
        match (mode.period_error(spectrum.dt), mode.apparent) {
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
    let count = spectrum.modes.len();
    let (listed, last) = match count {
        0..=LISTED => (count, None),
        _ => (
            LISTED - 1,
            spectrum.modes.last().filter(|_| spectrum.complete),
        ),
    };
    let listed = if spectrum.complete {
        listed
    } else {
        count.min(LISTED)
    };
    for (index, mode) in spectrum.modes.iter().take(listed).enumerate() {
        table.row(&format!("  {}", index + 1), &line(mode));
    }
    match (last, spectrum.highest) {
        (Some(last), _) => table.row(&format!("  {count}"), &line(last)),
        (None, Some(highest)) if !spectrum.complete => {
            table.row("  highest", &swing(highest, spectrum.dt));
        }
        _ => {}
    }
}

/// One line per specimen.
pub(super) fn describe(spectrum: &Spectrum, table: &mut Table) {
    const NO_DAMPING: &str =
        "none that is stable: without damping every delay lets the response grow";
    let vanishes = |tau: f64| spectrum.vanishes(tau);
    for delay in &spectrum.delays {
        if let Some(why) = delay.at_once() {
            table.row(
                &format!("without delay, {}", delay.specimen.name),
                &format!("UNSTABLE: {why}"),
            );
        }
        let steps = |tau: f64| format!("{} = {:.3} Δt", duration(tau), tau / spectrum.dt);
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
pub(super) fn in_short<'a>(spectrum: &'a Spectrum, judged: &[&str]) -> Vec<(&'a str, String)> {
    let delays = spectrum.delays.iter();
    let delays = delays.filter(|delay| !judged.contains(&delay.specimen.name.as_str()));
    let each = delays.map(|delay| (delay.specimen.name.as_str(), limit_of(spectrum, delay)));
    each.collect()
}

/// The smallest known critical delay, and its consequences.
fn limit_of(spectrum: &Spectrum, delay: &CriticalDelays) -> String {
    if let Some(why) = delay.at_once() {
        return format!("UNSTABLE without any delay: {why}");
    }
    let bounds = delay.bounds();
    let text = bounds.in_words(|_, tau| match spectrum.vanishes(tau) {
        true => "0".to_owned(),
        false => format!(
            "{} ({} steps)",
            quantity(tau, "s"),
            number(tau / spectrum.dt)
        ),
    });
    match bounds.smallest() {
        Some((_, DelayBound::Below(tau))) if spectrum.vanishes(*tau) => {
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
pub(super) fn modes_json(spectrum: &Spectrum) -> Value {
    let each = spectrum.modes.iter().take(LISTED).map(|mode| {
        json!({
            "frequency_rad_per_s": mode.frequency,
            "omega": mode.frequency * spectrum.dt,
            "damping_ratio": finite(mode.ratio),
            "apparent_omega": mode.apparent.map(|apparent| apparent.omega),
            "period_error": mode.period_error(spectrum.dt).and_then(finite),
            "damping_error": mode.damping_error().and_then(finite),
        })
    });
    each.collect()
}

/// Delays as JSON.
pub(super) fn delays_json(spectrum: &Spectrum) -> Value {
    let each = spectrum.delays.iter().map(|delay| {
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
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Writes the curves of `check --plot` into a new folder.
pub(super) fn plot(spectrum: &Spectrum, folder: &Path) -> anyhow::Result<()> {
    make_free(folder).context("--plot")?;
    for diagram in diagrams(spectrum) {
        let figure = figure(&diagram);
        for (ending, text) in [("svg", figure.chart().svg()), ("csv", figure.csv())] {
            let path = folder.join(format!("{}.{ending}", diagram.name));
            atomic::write(&path, text.as_bytes()).with_context(|| path.display().to_string())?;
        }
    }
    Ok(())
}

fn figure(diagram: &Diagram) -> Figure {
    let curves = diagram.curves.iter().map(|curve| {
        let (label, x, y) = (curve.label.clone(), curve.x.clone(), curve.y.clone());
        match curve.dots {
            true => Series::dots(label, x, y),
            false => Series::line(label, x, y),
        }
    });
    let scale = |(what, unit): (&'static str, &'static str)| Scale::free(what, unit);
    Figure {
        file: "",
        title: diagram.title,
        claim: "",
        across: scale(diagram.across),
        up: scale(diagram.up),
        axes: Axes::Linear,
        series: curves.collect(),
    }
}
