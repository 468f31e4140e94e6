//! The page of an identification: verdict, key figures, pictures and models of each axis.

use super::outcome::{Axis, Outcome};
use super::words::{felt, of_specimen, parameters, with_error};
use gusset_config::Loaded;
use gusset_motion::identify::Identification;
use gusset_quantity::units::quantity;
use gusset_view::report::{
    Curve, Curves, Look, Scale, banner, escape, frame, note, section, tiles,
};

/// Points of a fitted curve.
const POINTS: usize = 300;
/// A delay is drawn where it is known to this part of itself, or of a tick.
const KNOWN: f64 = 0.25;
/// Axes that have key figures.
const MOST_FIGURES: usize = 2;
/// Smaller noise than this is shown as zero.
const LEAST_NOISE: f64 = 1e-15;
/// Width and height of a picture.
const SIZE: (f64, f64) = (560.0, 330.0);

/// Names and contents.
pub(super) fn files(outcome: &Outcome, driven: &Loaded) -> Vec<(String, String)> {
    let mut files = Vec::new();
    let mut body = format!(
        "<header>\n<p class=\"brand\">gusset · identification</p>\n<h1>{}</h1>\n",
        escape(&driven.file.title)
    );
    body += &verdict(&outcome.axes);
    body += &tiles(&key_figures(&outcome.axes));
    body += "</header>\n<main>\n";
    for axis in &outcome.axes {
        let markup = match &axis.found {
            Err(_) => grid(&mut files, axis, vec![walk(axis, None)]),
            Ok(found) => known(&mut files, axis, found),
        };
        body += &section(&named(axis), &markup);
    }
    body += &section("Method and files", &method());
    body += "</main>\n";
    files.push(("index.html".to_owned(), frame(&driven.file.title, &body)));
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
fn verdict(axes: &[Axis]) -> String {
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

fn method() -> String {
    note(
        "The response is the ratio of the Fourier transforms of measured and commanded displacement, averaged over neighbouring \
         spectral lines. The coherence is the share of the measured power that the command explains. The curves are models, \
         fitted to all spectral lines in the band and weighted by their noise. Standard errors follow ±.",
    ) + "<p><a href=\"../report.html\">Report of the run</a>, <a href=\"../identification.json\">all numbers</a>, \
         <a href=\"../identified.toml\">virtual twin</a>.</p>\n"
}

/// One picture.
struct Picture {
    name: &'static str,
    says: String,
    inline: String,
    alone: String,
}

fn grid(files: &mut Vec<(String, String)>, axis: &Axis, pictures: Vec<Picture>) -> String {
    let mut markup = String::from("<div class=\"grid\">\n");
    for picture in pictures {
        let name = format!(
            "{}-{}-{}.svg",
            picture.name,
            axis.driven.place + 1,
            axis.driven.axis + 1
        );
        markup += &format!(
            "<figure>{}<figcaption>{} <a href=\"{name}\">Picture</a>.</figcaption></figure>\n",
            picture.inline,
            escape(&picture.says)
        );
        files.push((name, picture.alone));
    }
    markup + "</div>\n"
}

fn known(files: &mut Vec<(String, String)>, axis: &Axis, found: &Identification) -> String {
    let pictures = vec![
        gain(axis, found),
        delay(axis, found),
        coherence(found),
        walk(axis, Some(found)),
    ];
    let mut markup = grid(files, axis, pictures);
    markup += "<div class=\"wide plain\"><table>\n<thead><tr><th>model</th><th>parameters</th><th>residual</th>\
               <th>slow delay</th></tr></thead>\n<tbody>\n";
    for (place, fit) in found.models.iter().enumerate() {
        let best = if place == 0 { " (best)" } else { "" };
        markup += &format!(
            "<tr><td>{}{best}</td><td>{}</td><td>{:.3} %</td><td>{:.4} ms</td></tr>\n",
            fit.model.words(),
            escape(&parameters(fit)),
            100.0 * fit.residual,
            1e3 * fit.slow_delay_s
        );
    }
    markup += "</tbody></table></div>\n<dl>\n";
    let mut row = |what: &str, text: &str| {
        markup += &format!("<dt>{}</dt><dd>{}</dd>\n", escape(what), escape(text));
    };
    row("delay over the band", &with_error(found.delay, "s"));
    row("gain over the band", &with_error(found.gain, "1"));
    row("mean coherence", &format!("{:.4}", found.coherence));
    if let Some(specimen) = &found.specimen {
        for (what, text) in of_specimen(specimen, axis.to_structure) {
            row(&what, &text);
        }
    }
    for (what, text) in felt(axis) {
        row(&what, &text);
    }
    let shown = |noise: f64, unit| match noise < LEAST_NOISE {
        true => format!("0 {unit}"),
        false => quantity(noise, unit),
    };
    let (disp, force) = (found.noise.disp_m, found.noise.force_n);
    let noise = format!("{}, {}", shown(disp, "m"), shown(force, "N"));
    row("noise at rest", &noise);
    markup + "</dl>\n"
}

/// Both skins of a picture.
fn picture(name: &'static str, says: String, curves: &Curves<'_>) -> Picture {
    Picture {
        name,
        says,
        inline: curves.svg(SIZE.0, SIZE.1, true),
        alone: curves.svg(SIZE.0, SIZE.1, false),
    }
}

fn frequencies(found: &Identification) -> Vec<f64> {
    let (from, to) = (found.band.from_hz, found.band.to_hz);
    let at = |i: usize| from + (to - from) * i as f64 / (POINTS - 1) as f64;
    (0..POINTS).map(at).collect()
}

const ACROSS: Scale<'static> = Scale {
    words: "frequency",
    unit: "Hz",
    range: None,
};

/// Measured points over the fitted models: `measured` (hz, value), and the value of a model at a frequency.
fn compared(
    name: &'static str,
    title: &'static str,
    up: Scale<'_>,
    found: &Identification,
    measured: (Vec<f64>, Vec<f64>),
    of_model: &dyn Fn(&gusset_motion::identify::Fit, f64) -> f64,
) -> Picture {
    let at = frequencies(found);
    let models: Vec<(String, Vec<f64>)> = found
        .models
        .iter()
        .map(|fit| {
            let values = at.iter().map(|hz| of_model(fit, *hz)).collect();
            (fit.model.words().to_owned(), values)
        })
        .collect();
    let mut curves: Vec<Curve<'_>> = models
        .iter()
        .enumerate()
        .map(|(place, (name, values))| Curve {
            name,
            x: &at,
            y: values,
            look: if place == 0 {
                Look::Reference
            } else {
                Look::Line
            },
        })
        .collect();
    // A meaningless curve would hide the others.
    curves.retain(|curve| curve.y.iter().all(|value| value.is_finite()));
    curves.truncate(3);
    curves.push(Curve {
        name: "measured",
        x: &measured.0,
        y: &measured.1,
        look: Look::Dots,
    });
    let says = format!(
        "{title}: measured, and the best models; the best one, {}, is dashed.",
        found.best().map_or("none", |fit| fit.model.words())
    );
    let curves = Curves {
        title,
        across: ACROSS,
        up,
        curves: &curves,
        logarithmic: false,
        square: false,
    };
    picture(name, says, &curves)
}

fn gain(axis: &Axis, found: &Identification) -> Picture {
    let points = found.response.iter().filter(|point| point.trusted);
    let measured = points.map(|point| (point.hz, point.gain)).unzip();
    let up = Scale {
        words: "gain",
        unit: "1",
        range: None,
    };
    compared(
        "gain",
        "Gain over frequency",
        up,
        found,
        measured,
        &|fit, hz| fit.response(hz, axis.tick).norm(),
    )
}

fn delay(axis: &Axis, found: &Identification) -> Picture {
    let is_known = |point: &&gusset_motion::identify::Point| {
        point.trusted && point.delay_std_s < KNOWN * point.delay_s.abs().max(axis.tick)
    };
    let points = found.response.iter().filter(is_known);
    let measured = points.map(|point| (point.hz, 1e3 * point.delay_s)).unzip();
    let up = Scale {
        words: "delay",
        unit: "ms",
        range: None,
    };
    compared(
        "delay",
        "Delay over frequency",
        up,
        found,
        measured,
        &|fit, hz| {
            use std::f64::consts::TAU;
            let response = fit.response(hz, axis.tick);
            // The slow delay gives the number of full turns of the phase.
            let expected = TAU * hz * fit.slow_delay_s;
            let raw = -libm::atan2(response.im, response.re);
            let turns = ((expected - raw) / TAU).round();
            1e3 * (raw + TAU * turns) / (TAU * hz)
        },
    )
}

fn coherence(found: &Identification) -> Picture {
    let x: Vec<f64> = found.response.iter().map(|point| point.hz).collect();
    let y: Vec<f64> = found.response.iter().map(|point| point.coherence).collect();
    let curves = [Curve {
        name: "",
        x: &x,
        y: &y,
        look: Look::Dots,
    }];
    let curves = Curves {
        title: "Coherence of command and measured displacement",
        across: ACROSS,
        up: Scale {
            words: "coherence",
            unit: "1",
            range: Some((0.0, 1.05)),
        },
        curves: &curves,
        logarithmic: false,
        square: false,
    };
    let says =
        "Share of the measured power that the command explains; below 0.8 a point is not trusted.";
    picture("coherence", says.to_owned(), &curves)
}

fn walk(axis: &Axis, found: Option<&Identification>) -> Picture {
    let (disp, force) = &axis.walk;
    let millimetres: Vec<f64> = disp.iter().map(|d| 1e3 * d).collect();
    let middle = |values: &[f64]| values.first().copied().unwrap_or(0.0);
    let (x0, f0) = (middle(disp), middle(force));
    let specimen = found.and_then(|found| found.specimen);
    let (low, high) = disp
        .iter()
        .fold((x0, x0), |(low, high), d| (low.min(*d), high.max(*d)));
    let ends = [1e3 * low, 1e3 * high];
    let line = specimen.map(|specimen| {
        let k = specimen.stiffness.value;
        [f0 + k * (low - x0), f0 + k * (high - x0)]
    });
    let mut curves = vec![Curve {
        name: "measured",
        x: &millimetres,
        y: force,
        look: Look::Line,
    }];
    if let Some(line) = &line {
        curves.push(Curve {
            name: "stiffness",
            x: &ends,
            y: line,
            look: Look::Reference,
        });
    }
    let curves = Curves {
        title: "Force over measured displacement",
        across: Scale {
            words: "measured displacement",
            unit: "mm",
            range: None,
        },
        up: Scale {
            words: "force",
            unit: "N",
            range: None,
        },
        curves: &curves,
        logarithmic: false,
        square: false,
    };
    let says = "Force over measured displacement, and the stiffness found.";
    picture("loop", says.to_owned(), &curves)
}
