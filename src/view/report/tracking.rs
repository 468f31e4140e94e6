//! How well the specimens followed their targets: plain figures, histories, and the indices of the literature, each with its
//! noise floor and its value without the noise. The guide defines them (`gusset guide mathematics-errors`).

use maud::{Markup, html};

use super::RunView;
use super::chart::{Chart, HALF, Look, Scale};
use super::columns::ERROR;
use super::digest::{Digest, NOT_MEASURED};
use super::html::{beside, details, note, table, table_without};
use super::limits;
use super::response::{MOST_DRAWN, amplitudes, history};
use super::text::{NOTHING, lag_words, number, or_dash, percent, plural, quantity};
use super::tracked::Tracked;
use gusset_motion::metrics::Judged;
use gusset_quantity::catalog::limit::Limit;

/// Kind of the column of the margin to the critical delay.
pub(super) const MARGIN: &str = "margin";

/// The section on tracking; `effect` is the effect of the errors on the test. `None` without a specimen that moved.
pub(super) fn tracking(
    run: &RunView,
    rows: &Digest,
    axes: &[Tracked<'_>],
    effect: &Markup,
) -> Option<Markup> {
    if axes.is_empty() || rows.passed.steps == 0 {
        return None;
    }
    let drawn = axes.iter().filter(|axis| axis.digest.is_drawable());
    let (ideal, others): (Vec<_>, Vec<_>) =
        drawn.take(MOST_DRAWN).partition(|axis| axis.is_ideal());
    let names: Vec<_> = ideal.iter().map(|axis| axis.name.as_str()).collect();
    let markup = html! {
        @if !axes.iter().all(Tracked::is_ideal) { (figures(rows, axes)) }
        @if !ideal.is_empty() {
            (note(&format!(
                "No displacement is measured: the specimen is computed without an actuator, at its target in every sample ({}).",
                names.join(", ")
            )))
        }
        @for axis in others {
            @if axes.len() > 1 { h3 { (axis.name) } }
            (followed(run, rows, axis))
        }
        (effect)
    };
    Some(rows.section("Tracking", markup))
}

/// Delay, amplitude error and energy error of every axis.
fn figures(rows: &Digest, axes: &[Tracked<'_>]) -> Markup {
    let row = |axis: &Tracked<'_>| {
        let cells = match axis.is_ideal() || !rows.measures_disp(axis.digest.axis) {
            true => [NOT_MEASURED; 4].map(str::to_owned),
            false => axis.figures().map(|(_, text)| or_dash(text)),
        };
        std::iter::once(axis.name.clone()).chain(cells).collect()
    };
    let listed: Vec<_> = axes.iter().map(row).collect();
    let heading = [
        "",
        "delay",
        "amplitude error",
        "energy error",
        "largest error",
    ];
    html! {
        (table(&heading, &listed))
        (note(
            "Measured against target. Delay: positive where the measured displacement is behind. Energy error: positive where the \
             actuator adds energy to the test; in brackets, its share of the energy of the test."
        ))
    }
}

/// Charts of an axis that did not follow exactly. The record of a link with forces only repeats the command as the measurement.
fn followed(run: &RunView, rows: &Digest, axis: &Tracked<'_>) -> Markup {
    let column = |kind: &str| axis.digest.axis.column(kind);
    let is_measured = rows.measures_disp(axis.digest.axis);
    let what = if is_measured { "measured" } else { "command" };
    let columns =
        [("target", "target"), (what, "meas")].map(|(name, kind)| (name.to_owned(), column(kind)));
    let levels = limits::levels(run, rows, axis, &[Limit::MeasuredDisp, Limit::CommandDisp]);
    let both = history(
        run,
        rows,
        format!("Target and {what}"),
        axis.disp("displacement"),
        columns,
    )
    .labelled(axis.label(&format!("target and {what} displacement over test time")))
    .levels(levels);
    if !is_measured {
        return both.figure();
    }
    let errors = [("measured − target".to_owned(), column(ERROR))];
    let error = history(
        run,
        rows,
        "Tracking error".to_owned(),
        axis.disp("error"),
        errors,
    )
    .labelled(axis.label("tracking error over test time"))
    .half(290.0);
    let is_broken = rows.broken().any(|broken| broken == axis.digest.axis);
    let broken = if rows.passed.missing_ticks > 0 {
        "Rows are missing in the record: lag, tracking metrics, frequency content and absorbed energy of this axis are left out. \
         Peaks are those of the rows that are there."
    } else {
        "No row is missing, but the rows are not at even times: lag, tracking metrics and frequency content of this axis are \
         left out."
    };
    let more = html! {
        (table_of_indices(rows, axis))
        (beside("grid", html! { (subspace(axis)) (content(axis)) (response_of(axis)) }))
        (windows(run, axis))
        (estimates(run, rows, axis))
    };
    html! {
        (both.figure())
        (beside("grid", html! { (error.figure()) (close_up(axis)) }))
        @if is_broken { (note(broken)) }
        (details(&format!("Tracking indices of {}", axis.name), more))
    }
}

/// Target and measured around the largest target.
fn close_up(axis: &Tracked<'_>) -> Markup {
    let [time, target, meas] = &axis.digest.close_up;
    Chart::new(
        "Around the largest target",
        Scale::new("test time", "s"),
        axis.disp("displacement"),
    )
    .labelled(axis.label("target and measured around the largest target"))
    .with("target", time, target, Look::Line)
    .with("measured", time, meas, Look::Line)
    .half(290.0)
    .figure()
}

fn subspace(axis: &Tracked<'_>) -> Markup {
    let (target, meas) = &axis.digest.subspace;
    Chart::new(
        "Synchronisation subspace: measured against target",
        axis.disp("target"),
        axis.disp("measured"),
    )
    .labelled(axis.label("measured against target displacement"))
    .with("", target, meas, Look::Line)
    .figure()
}

/// Frequency content of target, measured and their difference.
fn content(axis: &Tracked<'_>) -> Markup {
    let names = ["target", "measured", "measured − target"].map(str::to_owned);
    let curves = names
        .into_iter()
        .zip(axis.digest.spectra.iter().map(Vec::as_slice));
    amplitudes(
        "Frequency content",
        "Fourier amplitude",
        &format!("{} s", axis.disp_unit),
        curves,
        (HALF, 320.0),
    )
}

/// Gain and phase of measured over target by frequency.
fn response_of(axis: &Tracked<'_>) -> Markup {
    let found = &axis.digest.response;
    if found.len() < 2 {
        return Markup::default();
    }
    let hz: Vec<f64> = found.iter().map(|one| one.frequency_hz).collect();
    let gain = found.iter().map(|one| one.gain).collect::<Vec<f64>>();
    let phase = found.iter().map(|one| one.phase).collect::<Vec<f64>>();
    let charts = [
        ("Gain", Scale::new("gain", "1"), gain),
        ("Phase, negative: behind", Scale::new("phase", "rad"), phase),
    ];
    let drawn = charts.into_iter().map(|(what, up, values)| {
        let title = format!("{what} of measured over target by frequency");
        Chart::new(title.clone(), Scale::new("frequency", "Hz").log(), up)
            .labelled(axis.label(&title))
            .with("", &hz, values, Look::Dots)
    });
    html! { @for chart in drawn { (chart.figure()) } }
}

/// Amplitude and phase errors in moving windows.
fn windows(run: &RunView, axis: &Tracked<'_>) -> Markup {
    let Some((time, found)) = &axis.digest.course else {
        return Markup::default();
    };
    let kinds = [
        (
            "Amplitude error in moving windows",
            Scale::new("amplitude error", "1"),
        ),
        (
            "Phase error in moving windows, negative: behind",
            Scale::new("phase error", "rad"),
        ),
    ];
    let drawn = kinds.into_iter().enumerate().map(|(place, (title, up))| {
        Chart::history(title, up)
            .labelled(axis.label(title))
            .with("PAEI", time, &found.paei[place], Look::Line)
            .with("FDB", time, &found.fdb[place], Look::Line)
            .marks(super::response::trips(run))
            .half(260.0)
    });
    beside("grid", html! { @for chart in drawn { (chart.figure()) } })
}

/// Delay, gain and margin as estimated while the test ran, if they were estimated.
fn estimates(run: &RunView, rows: &Digest, axis: &Tracked<'_>) -> Markup {
    let kinds = [
        (
            "Delay as estimated while the test ran",
            Scale::new("delay", "s"),
            "lag",
        ),
        (
            "Gain as estimated while the test ran",
            Scale::new("gain", "1"),
            "gain",
        ),
        (
            "Margin: critical delay less delay, as estimated",
            Scale::new("margin", "s"),
            MARGIN,
        ),
    ];
    let drawn = kinds.map(|(title, up, kind)| {
        let columns = [(String::new(), axis.digest.axis.column(kind))];
        history(run, rows, title.to_owned(), up, columns)
            .labelled(axis.label(title))
            .half(260.0)
    });
    let drawn = drawn.iter().filter(|chart| !chart.is_empty());
    beside("grid", html! { @for chart in drawn { (chart.figure()) } })
}

/// How a number is written.
type Written<'a> = &'a dyn Fn(f64) -> String;

/// The indices of one axis: name, and value, noise floor and corrected value as text; none where they are not known.
pub(super) fn indices(axis: &Tracked<'_>) -> Vec<(String, [String; 3])> {
    let Some(t) = &axis.digest.tracking else {
        return Vec::new();
    };
    let metre = |v: f64| quantity(v, axis.disp_unit);
    let second = lag_words;
    let plain = |v: f64| number(v, 4);
    let radian = |v: f64| quantity(v, "rad");
    let square = |v: f64| format!("{}\u{a0}{}²", number(v, 3), axis.disp_unit);
    let joule = |v: f64| quantity(v, axis.work_unit());
    let mut all = Vec::new();
    let mut row = |name: &str, judged: Option<Judged>, write: Written<'_>| {
        let Some(judged) = judged else { return };
        let others = [judged.floor, judged.corrected].map(|v| or_dash(v.map(write)));
        let [floor, corrected] = others;
        all.push((name.to_owned(), [write(judged.value), floor, corrected]));
    };
    row(
        "NRMSE, by the root mean square of the target",
        Some(t.nrmse),
        &percent,
    );
    row(
        "NRMSE, by the range of the target",
        Some(t.nrmse_of_range),
        &percent,
    );
    row("largest error", Some(t.peak_error_m), &metre);
    row("delay by cross-correlation", t.delay_s, &second);
    row("FEI amplitude", t.fei.map(|f| f.amplitude), &plain);
    row("FEI phase", t.fei.map(|f| f.phase_rad), &radian);
    row("FEI delay", t.fei.map(|f| f.delay_s), &second);
    row(
        "slope of the synchronisation subspace",
        Some(t.slope),
        &plain,
    );
    for (name, of) in [
        ("PAEI", t.windows.map(|windows| windows.paei)),
        ("FDB", t.windows.map(|windows| windows.fdb)),
    ] {
        let Some(found) = of else { continue };
        for (what, spread, write) in [
            ("amplitude error", found.amplitude, &plain as Written<'_>),
            ("phase error", found.phase_rad, &radian),
        ] {
            row(&format!("{name} {what}, median"), Some(spread.p50), write);
            row(
                &format!("{name} {what}, worst window"),
                Some(spread.worst),
                write,
            );
        }
    }
    row(
        "tracking indicator TI at the end",
        Some(t.tracking_indicator_m2),
        &square,
    );
    row("energy error", Some(t.energy_error_j), &joule);
    row(
        "energy error over input and strain energy",
        t.energy_error_share,
        &percent,
    );
    all
}

/// The table of indices of one axis; nothing where they are not known.
fn table_of_indices(rows: &Digest, axis: &Tracked<'_>) -> Markup {
    let (disp_unit, force_unit) = (axis.disp_unit, axis.force_unit);
    let Some(t) = &axis.digest.tracking else {
        return Markup::default();
    };
    let listed: Vec<Vec<String>> = indices(axis)
        .into_iter()
        .map(|(name, cells)| std::iter::once(name).chain(cells).collect())
        .collect();
    let at = t.fei.map_or_else(String::new, |f| {
        format!(
            " FEI belongs to {}.",
            format_args!("{}\u{a0}Hz", number(f.frequency_hz, 3))
        )
    });
    let damping = t
        .fei
        .zip(axis.digest.whole.filter(|whole| whole.stiffness.is_sure()))
        .map_or_else(String::new, |(f, whole)| {
            let c = -whole.stiffness.value * f.delay_s.value;
            let sign = if c < 0.0 {
                "energy goes into the test"
            } else {
                "energy is taken out of the test"
            };
            if f.delay_s.value.abs() < 1e-9 {
                String::new()
            } else {
                let unit = format!("{force_unit} s/{disp_unit}");
                format!(
                    " On the specimen's stiffness this delay acts as a damping of {}: {sign}.",
                    quantity(c, &unit)
                )
            }
        });
    let noise = t.noise.map_or_else(
        || " No noise floor: the test did not zero its sensors ([safety] zero_s), so what they read at rest is not known.".to_owned(),
        |noise| {
            format!(
                " Noise at rest, from {} while zeroing: {} and {} (standard deviation).",
                plural(noise.count, "reading", "readings"),
                quantity(noise.disp_std_m, disp_unit),
                quantity(noise.force_std_n, force_unit)
            )
        },
    );
    let samples = plural(t.samples, "sample", "samples");
    let means = match rows.means_of {
        0 | 1 => String::new(),
        every => format!(", each the mean of {every} ticks of this long test"),
    };
    html! {
        (table_without(NOTHING, "", &["measured against target", "value", "noise floor", "corrected"], &listed))
        (note(&format!("{samples}{means}.{at}{damping}{noise} `gusset guide mathematics-errors` defines the indices.")))
    }
}
