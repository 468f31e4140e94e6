//! The page of an identification: verdict, key figures, charts and models of each axis.

use nalgebra::ComplexField as _;
use std::f64::consts::TAU;

use maud::{Markup, html};

use super::outcome::{Axis, Outcome};
use super::words::{felt, of_specimen, parameters, with_error};
use gusset_config::Loaded;
use gusset_motion::identify::{Fit, Identification, Point};
use gusset_quantity::units::quantity;
use gusset_view::report::{
    Chart, Look, Scale, banner, beside, definitions, frame, header, note, section, table_of, tiles,
};

/// Points of a fitted curve.
const POINTS: usize = 300;
/// A delay is drawn where it is known to this part of itself, or of a tick.
const KNOWN: f64 = 0.25;
/// Axes that have key figures.
const MOST_FIGURES: usize = 2;
/// Smaller noise than this is shown as zero.
const LEAST_NOISE: f64 = 1e-15;
/// Fitted curves of a chart.
const MOST_MODELS: usize = 3;
/// Across most charts.
const FREQUENCY: Scale<'static> = Scale::new("frequency", "Hz");

/// Names and contents.
pub(super) fn files(outcome: &Outcome, driven: &Loaded) -> Vec<(String, String)> {
    let mut files = Vec::new();
    let title = &driven.file.title;
    let head = html! { (verdict(&outcome.axes)) (tiles(&key_figures(&outcome.axes))) };
    let mut of_axis = |axis: &Axis| {
        let markup = match &axis.found {
            Err(_) => grid(&mut files, axis, vec![walk(axis, None)]),
            Ok(found) => known(&mut files, axis, found),
        };
        section(&named(axis), markup)
    };
    let body = html! {
        (header("· identification", title, head))
        main {
            @for axis in &outcome.axes { (of_axis(axis)) }
            (section("Method and files", method()))
        }
    };
    files.push(("index.html".to_owned(), frame(title, &body)));
    files
}

fn named(axis: &Axis) -> String {
    format!(
        "{}, {}",
        axis.driven.name,
        axis.driven.place_words(axis.driven.axis)
    )
}

/// Whether the axes were identified, and how well the best model fits each.
fn verdict(axes: &[Axis]) -> Markup {
    let failed = axes.iter().filter(|axis| axis.found.is_err()).count();
    let of_axis = |axis: &Axis| match &axis.found {
        Err(error) => format!("{}: {error}", named(axis)),
        Ok(found) => {
            let best = found.best().map_or_else(String::new, |best| {
                let (model, residual) = (best.model.words(), 100.0 * best.residual);
                format!(": the best model is {model}, with a residual of {residual:.3} %")
            });
            let nonlinear = found.specimen.filter(|specimen| specimen.is_nonlinear());
            let nonlinear = nonlinear.map_or(
                "",
                |_| " The specimen is not linear at this amplitude; the stiffness is a secant.",
            );
            format!("{}{best}.{nonlinear}", named(axis))
        }
    };
    let is_nonlinear = |axis: &Axis| {
        let found = axis.found.as_ref().ok();
        let specimen = found.and_then(|found| found.specimen);
        specimen.is_some_and(|specimen| specimen.is_nonlinear())
    };
    let (class, headline) = match (failed, axes.len()) {
        (0, 1) if !axes.iter().any(is_nonlinear) => ("good", "The axis is identified".to_owned()),
        (0, many) if !axes.iter().any(is_nonlinear) => {
            ("good", format!("All {many} axes are identified"))
        }
        (0, _) => (
            "warning",
            "Identified, but a specimen is not linear".to_owned(),
        ),
        (1, 1) => ("bad", "The axis is not identified".to_owned()),
        (failed, many) => ("bad", format!("{failed} of {many} axes are not identified")),
    };
    let sentences: Vec<String> = axes.iter().map(of_axis).collect();
    banner(class, &headline, &sentences)
}

/// Delay, gain and specimen of the first axes.
fn key_figures(axes: &[Axis]) -> Vec<(String, String)> {
    let mut shown = Vec::new();
    for axis in axes.iter().take(MOST_FIGURES) {
        let Ok(found) = &axis.found else { continue };
        let of = |what: &str| match axes.len() {
            1 => what.to_owned(),
            _ => format!("{what}, {}", named(axis)),
        };
        shown.push((with_error(found.delay, "s"), of("delay over the band")));
        shown.push((with_error(found.gain, "1"), of("gain over the band")));
        if let Some(specimen) = &found.specimen {
            shown.push((with_error(specimen.stiffness, "N/m"), of("stiffness")));
            shown.push((with_error(specimen.damping, "N s/m"), of("damping")));
        }
    }
    shown
}

fn method() -> Markup {
    html! {
        (note(
            "The response is the ratio of the Fourier transforms of measured and commanded displacement, averaged over neighbouring \
             spectral lines. The coherence is the share of the measured power that the command explains. The curves are models, \
             fitted to all spectral lines in the band and weighted by their noise. Standard errors follow ±."
        ))
        p {
            a href="../report.html" { "Report of the run" } ", "
            a href="../identification.json" { "all numbers" } ", "
            a href="../identified.toml" { "virtual twin" } "."
        }
    }
}

/// A chart: name of its file, caption and the chart.
type Picture<'a> = (&'static str, String, Chart<'a>);

fn grid(files: &mut Vec<(String, String)>, axis: &Axis, pictures: Vec<Picture<'_>>) -> Markup {
    let mut figures = Vec::new();
    for (name, says, chart) in pictures {
        let name = format!(
            "{name}-{}-{}.svg",
            axis.driven.place + 1,
            axis.driven.axis + 1
        );
        figures.push(html! { figure { (chart.inline()) figcaption { (says) " " a href=(name) { "Picture" } "." } } });
        files.push((name, chart.svg()));
    }
    beside("grid", html! { @for figure in figures { (figure) } })
}

fn known(files: &mut Vec<(String, String)>, axis: &Axis, found: &Identification) -> Markup {
    let pictures = vec![
        gain(axis, found),
        delay(axis, found),
        coherence(found),
        walk(axis, Some(found)),
    ];
    let model = |(place, fit): (usize, &Fit)| {
        let best = if place == 0 { " (best)" } else { "" };
        let residual = format!("{:.3} %", 100.0 * fit.residual);
        let delay = format!("{:.4} ms", 1e3 * fit.slow_delay_s);
        vec![
            format!("{}{best}", fit.model.words()),
            parameters(fit),
            residual,
            delay,
        ]
    };
    let models: Vec<_> = found.models.iter().enumerate().map(model).collect();
    let pair = |what: &str, text: String| (what.to_owned(), text);
    let mut facts = vec![
        pair("delay over the band", with_error(found.delay, "s")),
        pair("gain over the band", with_error(found.gain, "1")),
        pair("mean coherence", format!("{:.4}", found.coherence)),
    ];
    if let Some(specimen) = &found.specimen {
        facts.extend(
            of_specimen(specimen, axis.to_structure)
                .into_iter()
                .map(|(what, text)| pair(&what, text)),
        );
    }
    facts.extend(felt(axis).into_iter().map(|(what, text)| pair(&what, text)));
    let shown = |noise: f64, unit| match noise < LEAST_NOISE {
        true => format!("0 {unit}"),
        false => quantity(noise, unit),
    };
    let noise = format!(
        "{}, {}",
        shown(found.noise.disp_m, "m"),
        shown(found.noise.force_n, "N")
    );
    facts.push(pair("noise at rest", noise));
    html! {
        (grid(files, axis, pictures))
        (table_of("plain", &["model", "parameters", "residual", "slow delay"], &models))
        (definitions(&facts))
    }
}

fn frequencies(found: &Identification) -> Vec<f64> {
    let (from, to) = (found.band.from_hz, found.band.to_hz);
    let at = |i: usize| from + (to - from) * i as f64 / (POINTS - 1) as f64;
    (0..POINTS).map(at).collect()
}

/// Measured points over the fitted models: `measured` (hz, value), and the value of a model at a frequency.
fn compared(
    name: &'static str,
    title: &'static str,
    up: Scale<'static>,
    found: &Identification,
    measured: (Vec<f64>, Vec<f64>),
    of_model: &dyn Fn(&Fit, f64) -> f64,
) -> Picture<'static> {
    let at = frequencies(found);
    let models = found.models.iter().enumerate().map(|(place, fit)| {
        let values: Vec<f64> = at.iter().map(|hz| of_model(fit, *hz)).collect();
        let look = if place == 0 {
            Look::Reference
        } else {
            Look::Line
        };
        (fit.model.words(), values, look)
    });
    // A meaningless curve would hide the others.
    let models = models.filter(|(_, values, _)| values.iter().all(|value| value.is_finite()));
    let chart = Chart::new(title, FREQUENCY, up);
    let chart = models
        .take(MOST_MODELS)
        .fold(chart, |chart, (name, values, look)| {
            chart.with(name.to_owned(), at.clone(), values, look)
        });
    let best = found.best().map_or("none", |fit| fit.model.words());
    let says = format!("{title}: measured, and the best models; the best one, {best}, is dashed.");
    (
        name,
        says,
        chart
            .with("measured", measured.0, measured.1, Look::Dots)
            .sized(560.0, 330.0),
    )
}

fn gain(axis: &Axis, found: &Identification) -> Picture<'static> {
    let points = found.response.iter().filter(|point| point.trusted);
    let measured = points.map(|point| (point.hz, point.gain)).unzip();
    let of_model = |fit: &Fit, hz: f64| fit.response(hz, axis.tick).modulus();
    compared(
        "gain",
        "Gain over frequency",
        Scale::new("gain", "1"),
        found,
        measured,
        &of_model,
    )
}

fn delay(axis: &Axis, found: &Identification) -> Picture<'static> {
    let is_known = |point: &&Point| {
        point.trusted && point.delay_std_s < KNOWN * point.delay_s.abs().max(axis.tick)
    };
    let points = found.response.iter().filter(is_known);
    let measured: (Vec<f64>, Vec<f64>) =
        points.map(|point| (point.hz, 1e3 * point.delay_s)).unzip();
    // Roundoff is no delay.
    let has_delay = measured.1.iter().any(|delay| delay.abs() > 1e-6);
    let range = (!has_delay).then_some((-0.1, 0.1));
    let of_model = |fit: &Fit, hz: f64| {
        let response = fit.response(hz, axis.tick);
        // The slow delay gives the number of full turns of the phase.
        let expected = TAU * hz * fit.slow_delay_s;
        let raw = -libm::atan2(response.im, response.re);
        let turns = ((expected - raw) / TAU).round();
        1e3 * (raw + TAU * turns) / (TAU * hz)
    };
    compared(
        "delay",
        "Delay over frequency",
        Scale::new("delay", "ms").within(range),
        found,
        measured,
        &of_model,
    )
}

fn coherence(found: &Identification) -> Picture<'static> {
    let points = found
        .response
        .iter()
        .map(|point| (point.hz, point.coherence));
    let (x, y): (Vec<f64>, Vec<f64>) = points.unzip();
    let up = Scale::new("coherence", "1").within(Some((0.0, 1.05)));
    let title = "Coherence of command and measured displacement";
    let chart = Chart::new(title, FREQUENCY, up).with("", x, y, Look::Dots);
    let says =
        "Share of the measured power that the command explains; below 0.8 a point is not trusted.";
    ("coherence", says.to_owned(), chart.sized(560.0, 330.0))
}

fn walk<'a>(axis: &'a Axis, found: Option<&Identification>) -> Picture<'a> {
    let (disp, force) = &axis.walk;
    let middle = |values: &[f64]| values.first().copied().unwrap_or(0.0);
    let (x0, f0) = (middle(disp), middle(force));
    let (across, up) = (
        Scale::new("measured displacement", "m"),
        Scale::new("force", "N"),
    );
    let chart = Chart::new("Force over measured displacement", across, up);
    let mut chart = chart.with("measured", disp, force, Look::Line);
    if let Some(specimen) = found.and_then(|found| found.specimen) {
        let ends = disp
            .iter()
            .fold((x0, x0), |(low, high), d| (d.min(low), d.max(high)));
        let force = |x: f64| f0 + specimen.stiffness.value * (x - x0);
        let line = vec![force(ends.0), force(ends.1)];
        chart = chart.with("stiffness", vec![ends.0, ends.1], line, Look::Reference);
    }
    let says = "Force over measured displacement, and the stiffness found.";
    ("loop", says.to_owned(), chart.sized(560.0, 330.0))
}
