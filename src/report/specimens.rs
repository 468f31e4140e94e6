//! Sections on the measured side: hysteresis, how well the specimen followed its command, and, in a test of prescribed
//! displacement, what stiffness and lag it showed.

use std::borrow::Cow;

use serde_json::Value;

use super::RunData;
use super::canvas::Ink;
use super::charts::Quantity;
use super::html::{beside, figure, note, paragraph, section, table};
use super::lines::{Line, LoopChart, Reduce, TimeChart};
use super::metrics::{self, Denominator, Identified};
use super::outcome;
use super::rows::{Rows, SpecimenAxis};
use super::tested::axis_name;
use super::text::{NOTHING, count, number, plural, quantity};

/// Axes that are drawn; a table lists more.
const MOST_DRAWN: usize = 8;
/// Axes that are listed.
const MOST_LISTED: usize = 40;
/// Largest lag that is looked for, in s of test time, and in samples at least and at most.
const LAG_S: f64 = 0.1;
const LAG_LEAST: usize = 25;
const LAG_MOST: usize = 800;
/// Samples that are correlated at most: the middle of a longer test.
const LAG_WINDOW: usize = 100_000;
/// Share of the largest displacement that counts as first loading.
const FIRST_LOADING: f64 = 0.2;

/// Everything the page says about one axis.
pub(super) struct Tracking<'a> {
    pub name: String,
    disp_unit: &'a str,
    force_unit: &'a str,
    target: Cow<'a, [f64]>,
    meas: Cow<'a, [f64]>,
    force: Cow<'a, [f64]>,
    /// Lag of measured behind target in s.
    pub lag: Option<f64>,
    nrmse: Option<f64>,
    error: Option<f64>,
    dt: Option<f64>,
}

impl<'a> Tracking<'a> {
    fn new(rows: &Rows<'a>, axis: SpecimenAxis, name: String) -> Self {
        let column = |kind: &str| rows.get(&axis.column(kind)).unwrap_or_default();
        let (target, meas, force) = (column("target"), column("meas"), column("force"));
        let dt = rows.interval();
        let lag = dt.and_then(|dt| {
            let most = ((LAG_S / dt) as usize).clamp(LAG_LEAST, LAG_MOST);
            let n = target.len().min(meas.len());
            let from = n.saturating_sub(LAG_WINDOW) / 2;
            let to = (from + LAG_WINDOW).min(n);
            let lag = metrics::lag(&target[from..to], &meas[from..to], most)?;
            // A thousandth of a sample is what the refinement itself is uncertain by.
            Some(if lag.abs() < 1e-3 { 0.0 } else { lag * dt })
        });
        Self {
            name,
            disp_unit: rows.unit(&axis.column("meas")),
            force_unit: rows.unit(&axis.column("force")),
            lag,
            nrmse: metrics::nrmse(&target, &meas, Denominator::CommandRms),
            error: metrics::largest_error(&target, &meas),
            dt,
            target,
            meas,
            force,
        }
    }

    /// Stiffness and damping of the whole test, and of the first loading.
    fn identified(&self) -> (Option<Identified>, Option<Identified>) {
        let Some(dt) = self.dt else {
            return (None, None);
        };
        let first = metrics::loading(&self.meas, FIRST_LOADING).min(self.force.len());
        let initial = metrics::identify(&self.meas[..first], &self.force[..first], dt);
        (metrics::identify(&self.meas, &self.force, dt), initial)
    }

    fn is_drawable(&self) -> bool {
        self.meas
            .iter()
            .zip(self.force.iter())
            .any(|(d, f)| d.is_finite() && f.is_finite())
    }

    /// Peak force with its unit.
    pub fn peak_force(&self) -> Option<(f64, &'a str)> {
        metrics::peak(&self.force).map(|p| (p.value, self.force_unit))
    }
}

/// Reads every axis once; names come from the configuration.
pub(super) fn tracking<'a>(rows: &Rows<'a>, configuration: Option<&Value>) -> Vec<Tracking<'a>> {
    let axes = rows.axes();
    axes.iter()
        .take(MOST_LISTED)
        .map(|&axis| Tracking::new(rows, axis, axis_name(configuration, axis, &axes)))
        .collect()
}

/// The section on specimens; none if there are none.
pub(super) fn specimens(run: &RunData, rows: &Rows<'_>, axes: &[Tracking<'_>]) -> Option<String> {
    if axes.is_empty() {
        return None;
    }
    let heading = "Specimens";
    if rows.running() == 0 {
        return Some(section(
            heading,
            &paragraph(
                "No row was recorded while the test was running, so there is no measurement to show.",
            ),
        ));
    }
    let time = rows.get("time").unwrap_or_default();
    let mut markup = String::new();
    for axis in axes.iter().take(MOST_DRAWN) {
        markup += &drawn(&time, axis);
    }
    let all = rows.axes().len();
    if all > MOST_DRAWN {
        markup += &note(&format!(
            "The pictures show {MOST_DRAWN} of {all} axes; the samples hold them all."
        ));
    }
    Some(section(heading, &(markup + &listed(axes) + &traffic(run))))
}

fn drawn(time: &[f64], axis: &Tracking<'_>) -> String {
    let mut markup = format!("<h3>{}</h3>\n", super::text::escape(&axis.name));
    if !axis.is_drawable() {
        return markup + &paragraph("Nothing was measured on this axis.");
    }
    let hysteresis = LoopChart {
        title: "Force against measured displacement",
        across: Quantity {
            words: "measured displacement",
            unit: axis.disp_unit,
        },
        up: Quantity {
            words: "force",
            unit: axis.force_unit,
        },
        line: Line {
            name: "",
            x: &axis.meas,
            y: &axis.force,
            ink: Ink::Series(1),
            width: 1.3,
        },
    };
    let disp = Quantity {
        words: "displacement",
        unit: axis.disp_unit,
    };
    let target = |x, y, width| Line {
        name: "target",
        x,
        y,
        ink: Ink::Series(0),
        width,
    };
    let measured = |x, y, width| Line {
        name: "measured",
        x,
        y,
        ink: Ink::Series(1),
        width,
    };
    let lines = [
        target(time, &axis.target, 1.6),
        measured(time, &axis.meas, 1.0),
    ];
    let title = "Target and measured";
    let history = TimeChart {
        title,
        up: disp,
        lines: &lines,
        marks: &[],
        reduce: Reduce::Extremes,
        named_time: true,
    };
    let (from, to) = close_up(time, &axis.target, &axis.meas);
    let near = |v: &'_ [f64]| v.get(from..to).unwrap_or_default().to_vec();
    let (near_time, near_target, near_meas) = (near(time), near(&axis.target), near(&axis.meas));
    let lines = [
        target(&near_time, &near_target, 2.2),
        measured(&near_time, &near_meas, 1.3),
    ];
    let title = "The same around its largest value";
    let zoom = TimeChart {
        title,
        up: disp,
        lines: &lines,
        marks: &[],
        reduce: Reduce::Extremes,
        named_time: true,
    };
    let label = |what: &str| format!("{}: {what}", axis.name);
    let left = figure(
        500.0,
        420.0,
        &label("force against measured displacement"),
        |canvas, area| hysteresis.draw(canvas, area),
    );
    let right = figure(
        530.0,
        204.0,
        &label("target and measured over test time"),
        |canvas, area| history.draw(canvas, area),
    ) + &figure(
        530.0,
        204.0,
        &label("target and measured around the largest value"),
        |canvas, area| zoom.draw(canvas, area),
    );
    markup += &beside("pair", &(left + &beside("stack", &right)));
    markup
}

/// Samples around the largest command: about one of its swings, so that a lag can be seen.
fn close_up(time: &[f64], cmd: &[f64], meas: &[f64]) -> (usize, usize) {
    let n = time.len().min(cmd.len()).min(meas.len());
    let peak = metrics::peak(&cmd[..n]);
    let middle = peak.map_or(n / 2, |p| p.index);
    // Noise about zero is no swing: only what passes a tenth of the peak on both sides counts.
    let bound = 0.1 * peak.map_or(0.0, |p| p.value.abs());
    let (mut crossings, mut side, mut span) = (0, None, None);
    for (i, &c) in cmd[..n].iter().enumerate().filter(|(_, c)| c.abs() > bound) {
        crossings += usize::from(side.is_some_and(|before| before != (c > 0.0)));
        side = Some(c > 0.0);
        span = Some(span.map_or((i, i), |(first, _)| (first, i)));
    }
    let active = span.map_or(n, |(first, last)| last - first + 1);
    // One swing is two crossings; never less than 40 samples, never more than a quarter of the test.
    let length = (2 * active / (crossings + 1)).clamp(40.min(n), (n / 4).max(40.min(n)));
    let from = middle.saturating_sub(length / 2).min(n - length);
    (from, from + length)
}

fn listed(axes: &[Tracking<'_>]) -> String {
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| NOTHING.to_owned());
    let row = |axis: &Tracking<'_>| {
        let energy_unit = if axis.disp_unit.starts_with("rad") {
            "N m"
        } else {
            "J"
        };
        vec![
            axis.name.clone(),
            or_dash(metrics::peak(&axis.meas).map(|p| quantity(p.value, axis.disp_unit))),
            or_dash(axis.peak_force().map(|(f, unit)| quantity(f, unit))),
            or_dash(
                metrics::absorbed_energy(&axis.meas, &axis.force).map(|e| quantity(e, energy_unit)),
            ),
            or_dash(axis.lag.map(lag_words)),
            or_dash(axis.nrmse.map(|e| format!("{} %", number(100.0 * e, 3)))),
            or_dash(axis.error.map(|e| quantity(e, axis.disp_unit))),
        ]
    };
    let rows: Vec<_> = axes.iter().map(row).collect();
    table(
        &[
            "",
            "peak measured displacement",
            "peak force",
            "absorbed energy",
            "lag",
            "NRMSE",
            "largest error",
        ],
        &rows,
    ) + &note(
        "Absorbed energy: ∮ force d(measured displacement), dissipated and what is stored at the end. Lag: measured behind \
             target in test time, from the largest cross-correlation, refined by a parabola; positive means later (a test of more than 100 000 samples: of their middle). \
             NRMSE: root mean square of measured − target over root mean square of the target.",
    )
}

/// What went over the links, by specimen; nothing where nothing was counted.
fn traffic(run: &RunData) -> String {
    let keys = ["sent", "received", "late", "lost", "corrupt"];
    let links = outcome::at(run, "link")
        .and_then(Value::as_object)
        .into_iter()
        .flatten();
    let row = |(name, counts): (&String, &Value)| {
        let counts: Option<Vec<u64>> = keys.iter().map(|key| counts.get(key)?.as_u64()).collect();
        let counts = counts.filter(|c| c.iter().any(|n| *n > 0))?;
        Some(
            std::iter::once(name.clone())
                .chain(counts.into_iter().map(count))
                .collect(),
        )
    };
    let rows: Vec<Vec<String>> = links.filter_map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    table(
        &[
            "commands and measurements",
            "sent",
            "received",
            "late",
            "lost",
            "corrupt",
        ],
        &rows,
    )
}

/// A share in percent; below what matters it is only said to be small.
fn small_percent(share: f64) -> String {
    if share < 1e-4 {
        "below 0.01".to_owned()
    } else {
        number(100.0 * share, 2)
    }
}

fn lag_words(lag: f64) -> String {
    // A nanosecond is far below what a parabola through samples can tell from zero.
    if lag.abs() < 1e-9 {
        "0\u{a0}s".to_owned()
    } else {
        quantity(lag, "s")
    }
}

/// What a test of prescribed displacement says of one axis, in words.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentifiedAxis {
    /// Name of the specimen, and the axis where there are several.
    pub name: String,
    /// k̂ of the first loading, N/m: what belongs into K0.
    pub stiffness: Option<f64>,
    /// ĉ of the whole test, N s/m.
    pub damping: Option<f64>,
    /// Lag of the measured behind the target displacement, s.
    pub lag: Option<f64>,
}

/// Every axis of a test of prescribed displacement, identified; none for a test with a structure.
#[must_use]
pub fn identified(run: &RunData) -> Vec<IdentifiedAxis> {
    let rows = Rows::new(run);
    if !rows.dofs().is_empty() {
        return Vec::new();
    }
    let configuration = super::tested::configuration(run);
    let axes = tracking(&rows, configuration.as_ref());
    axes.into_iter()
        .map(|axis| {
            let (whole, initial) = axis.identified();
            IdentifiedAxis {
                stiffness: initial.or(whole).map(|found| found.stiffness),
                damping: whole.and_then(|found| found.damping),
                lag: axis.lag,
                name: axis.name,
            }
        })
        .collect()
}

/// For a test of prescribed displacement: identified stiffness, damping and lag of each axis.
pub(super) fn identification(rows: &Rows<'_>, axes: &[Tracking<'_>]) -> Option<String> {
    if axes.is_empty() || !rows.dofs().is_empty() {
        return None;
    }
    let mut lines = Vec::new();
    for axis in axes {
        let (whole, initial) = axis.identified();
        let per = |unit: &str| format!("{}/{}", axis.force_unit, unit);
        let stiffness = |k: f64| quantity(k, &per(axis.disp_unit));
        let or_dash = |text: Option<String>| text.unwrap_or_else(|| NOTHING.to_owned());
        lines.push(vec![
            axis.name.clone(),
            or_dash(initial.map(|i| stiffness(i.stiffness))),
            or_dash(whole.map(|i| stiffness(i.stiffness))),
            or_dash(
                whole
                    .and_then(|i| i.damping)
                    .map(|c| quantity(c, &format!("{} s/{}", axis.force_unit, axis.disp_unit))),
            ),
            or_dash(whole.map(|i| format!("{} %", small_percent(i.unexplained)))),
            or_dash(axis.lag.map(lag_words)),
        ]);
    }
    let markup = table(
        &[
            "",
            "k̂, first loading",
            "k̂, whole test",
            "ĉ, whole test",
            "not explained",
            "lag",
        ],
        &lines,
    );
    let how = format!(
        "Least squares of force on measured displacement and its velocity, {}. First loading: until {:.0} % of the largest \
         displacement is passed; for a specimen that yields, k̂ of the whole test is a secant. Not explained: share of the \
         force's variance that the line misses. This is the test before a hybrid test: k̂ and ĉ go into the specimen's \
         estimate, the lag into its compensator.",
        plural(axes.len() as u64, "axis by itself", "axes each by itself"),
        100.0 * FIRST_LOADING
    );
    Some(section("Identified specimen", &(markup + &note(&how))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_close_up_lies_inside_the_test_and_around_its_peak() {
        let time: Vec<f64> = (0..1000).map(f64::from).collect();
        let mut cmd: Vec<f64> = time.iter().map(|t| libm::sin(t / 10.0)).collect();
        cmd[990] = 5.0;
        let (from, to) = close_up(&time, &cmd, &cmd);
        assert!(from < 990 && to > 990 && to <= 1000 && to - from >= 40);
        assert_eq!(close_up(&[], &[], &[]), (0, 0));
        assert_eq!(close_up(&time[..3], &cmd[..3], &cmd[..3]), (0, 3));
    }
}
