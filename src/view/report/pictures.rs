//! Separate pictures: the wide one of a whole run, and the histogram of `gusset jitter`.
//!
//! Both have a transparent background and mid-tone colours, so that they can be read on white and on black.

use super::RunView;
use super::bars::HistogramChart;
use super::canvas::{Canvas, Ink, Skin, picture};
use super::charts::{Area, Quantity, sentence};
use super::histogram;
use super::lines::{Line, LoopChart, TimeChart};
use super::rows::{History, Rows};
use gusset_record::rt::timing::Percentiles;

/// One wide SVG: ground motion and top displacement, the first specimen's hysteresis, wake-up lateness.
#[must_use]
pub fn hero_svg(run: &RunView) -> String {
    let digest = run.digested();
    let rows = Rows::new(&digest);
    let ground = rows.history("ground");
    let top = rows
        .dofs()
        .iter()
        .copied()
        .rev()
        .find_map(|dof| Some((dof, rows.history(&format!("x{dof}"))?)));
    let axis = rows.axes().first().copied();
    let side = |kind: &str| {
        axis.and_then(|a| rows.filled(&a.column(kind)))
            .unwrap_or_default()
    };
    let name = axis.map(|a| run.test.file.specimen_name(a.specimen));
    let is_measured = axis.is_none_or(|axis| digest.measures_disp(axis));
    let what = if is_measured {
        "Measured"
    } else {
        "Force over command"
    };
    let measured = format!("{what}: {}", name.as_deref().unwrap_or("no specimen"));
    let (meas, force) = (side("meas"), side("force"));
    let label = format!(
        "{}: ground motion, displacement, hysteresis and timing of the run",
        run.title
    );
    picture(1240.0, 360.0, Skin::Picture, &label, |canvas| {
        let area = |x, y, w, h| Area { x, y, w, h };
        let shaking = Quantity {
            words: if rows.unit("ground") == "m" {
                "displ."
            } else {
                "accel."
            },
            unit: rows.unit("ground"),
        };
        let unit_of = |kind: &str| axis.map_or("1", |axis| rows.unit(&axis.column(kind)));
        let swaying = Quantity {
            words: "displ.",
            unit: top
                .as_ref()
                .map_or_else(|| unit_of("target"), |(dof, _)| rows.disp_unit(*dof)),
        };
        let commanded = axis.and_then(|a| rows.history(&a.column("target")));
        let upper = area(10.0, 12.0, 500.0, 160.0);
        let lower = area(10.0, 178.0, 500.0, 176.0);
        one_line(
            canvas,
            upper,
            "Ground motion",
            shaking,
            ground.as_ref(),
            Ink::Series(3),
            false,
        );
        match &top {
            Some((dof, disp)) => {
                let title = format!("Computed: displacement of DOF {dof}");
                one_line(
                    canvas,
                    lower,
                    &title,
                    swaying,
                    Some(disp),
                    Ink::Series(0),
                    true,
                );
            }
            None => one_line(
                canvas,
                lower,
                "Commanded displacement",
                swaying,
                commanded.as_ref(),
                Ink::Series(0),
                true,
            ),
        }
        let hysteresis = LoopChart {
            title: &measured,
            across: Quantity {
                words: "displacement",
                unit: unit_of("meas"),
            },
            up: Quantity {
                words: "force",
                unit: unit_of("force"),
            },
            lines: &[Line {
                name: "",
                x: &meas,
                y: &force,
                ink: Ink::Series(1),
                width: 1.3,
            }],
        };
        if run.is_simulated() {
            // Nothing was in real time: the loop's timing is meaningless.
            return hysteresis.draw(canvas, area(545.0, 12.0, 685.0, 342.0));
        }
        hysteresis.draw(canvas, area(545.0, 12.0, 325.0, 342.0));
        let timings = histogram::read(run.timing.as_ref());
        let place = area(905.0, 12.0, 325.0, 342.0);
        match timings
            .iter()
            .find(|t| t.key == "wakeup_lateness" && !t.histogram.is_empty())
        {
            Some(timing) => HistogramChart {
                title: "Wake-up lateness of the loop",
                histogram: &timing.histogram,
                percentiles: &timing.percentiles,
                deadline_us: None,
                ink: Ink::Series(2),
            }
            .draw(canvas, place),
            None => sentence(
                canvas,
                place,
                "Wake-up lateness of the loop",
                "No histogram was recorded.",
            ),
        }
    })
}

fn one_line(
    canvas: &mut Canvas<'_>,
    area: Area,
    title: &str,
    up: Quantity<'_>,
    found: Option<&History<'_>>,
    ink: Ink,
    named_time: bool,
) {
    let lines: Vec<_> = found.iter().map(|of| of.line("", ink, 1.1)).collect();
    TimeChart {
        named_time,
        ..TimeChart::history(title, up, &lines)
    }
    .draw(canvas, area);
}

/// The histogram of wake-up lateness that `gusset jitter --out` writes.
///
/// `histogram` holds the upper edge of each bin in µs and its count; `period_us`, where given, marks where a deadline lies.
#[must_use]
pub fn jitter_svg(
    title: &str,
    histogram: &[(f64, u64)],
    percentiles: &Percentiles,
    period_us: Option<f64>,
) -> String {
    picture(960.0, 440.0, Skin::Picture, title, |canvas| {
        let chart = HistogramChart {
            title,
            histogram,
            percentiles,
            deadline_us: period_us,
            ink: Ink::Series(0),
        };
        chart.draw(
            canvas,
            Area {
                x: 12.0,
                y: 10.0,
                w: 936.0,
                h: 422.0,
            },
        );
    })
}
