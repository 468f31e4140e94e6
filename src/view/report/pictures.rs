//! Separate pictures: the wide one of a whole run, and the histogram of `gusset jitter`.
//!
//! Both have a transparent background and mid-tone colours, so that they can be read on white and on black.

use super::RunView;
use super::chart::{Area, Chart, Ink, Look, Scale, picture};
use super::rows::History;
use super::timing;
use gusset_record::rt::timing::Percentiles;

/// One wide SVG: ground motion and top displacement, the first specimen's hysteresis, wake-up lateness.
#[must_use]
pub fn hero_svg(run: &RunView) -> String {
    let digest = run.digested();
    let rows = &*digest;
    let tops = rows.dofs.iter().copied().rev();
    let top = tops
        .map(|dof| (dof, rows.history(&format!("x{dof}"))))
        .find(|(_, of)| of.is_some());
    let axis = rows.all_axes.first().copied();
    let column = |kind: &str| axis.map_or_else(String::new, |axis| axis.column(kind));
    let name = axis.map_or_else(
        || "no specimen".to_owned(),
        |axis| run.test.file.specimen_name(axis.specimen),
    );
    let is_measured = axis.is_none_or(|axis| digest.measures_disp(axis));
    let what = if is_measured {
        "Measured"
    } else {
        "Force over command"
    };
    let unit_of = |kind: &str| axis.map_or("1", |_| rows.unit(&column(kind)));
    let ground = rows.grounds.first().map_or("ground", String::as_str);
    let shaking = if rows.unit(ground) == "m" {
        "displ."
    } else {
        "accel."
    };
    let ground = one_line(
        "Ground motion",
        shaking,
        rows.unit(ground),
        rows.history(ground),
        3,
    );
    let (title, unit, of) = match top {
        Some((dof, of)) => (
            format!("Computed: displacement of DOF {dof}"),
            rows.disp_unit(dof),
            of,
        ),
        None => (
            "Commanded displacement".to_owned(),
            unit_of("target"),
            rows.history(&column("target")),
        ),
    };
    let response = one_line(&title, "displ.", unit, of, 0);
    let loops = digest.axes.iter().find(|own| Some(own.axis) == axis);
    let (disp, force) = loops.map(|own| own.hysteresis.clone()).unwrap_or_default();
    let across = Scale::new("displacement", unit_of("meas"));
    let hysteresis = Chart::new(
        format!("{what}: {name}"),
        across,
        Scale::new("force", unit_of("force")),
    )
    .with("", disp, force, Look::Line)
    .inked(Ink::Series(1));
    let label = format!(
        "{}: ground motion, displacement, hysteresis and timing of the run",
        run.title
    );
    picture(1240.0, 360.0, &label, |canvas| {
        let area = |x, y, w, h| Area { x, y, w, h };
        ground.draw(canvas, area(10.0, 12.0, 500.0, 165.0));
        response.draw(canvas, area(10.0, 183.0, 500.0, 171.0));
        if run.is_simulated() {
            // Nothing was in real time: the loop's timing is meaningless.
            return hysteresis.draw(canvas, area(545.0, 12.0, 685.0, 342.0));
        }
        hysteresis.draw(canvas, area(545.0, 12.0, 325.0, 342.0));
        let timings = timing::read(run.timing.as_ref());
        let wakeup = timings.iter().find(|t| t.key == "wakeup_lateness");
        let (bins, percentiles) = wakeup.map_or((&[][..], Percentiles::default()), |t| {
            (&t.histogram, t.percentiles)
        });
        timing::histogram("Wake-up lateness of the loop", bins, &percentiles, None)
            .draw(canvas, area(905.0, 12.0, 325.0, 342.0));
    })
}

fn one_line<'a>(
    title: &'a str,
    words: &'a str,
    unit: &'a str,
    found: Option<History<'a>>,
    ink: usize,
) -> Chart<'a> {
    let chart = Chart::history(title, Scale::new(words, unit));
    match found {
        Some(of) => chart
            .with("", of.time, of.values, Look::Line)
            .inked(Ink::Series(ink)),
        None => chart,
    }
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
    timing::histogram(title, histogram, percentiles, period_us)
        .sized(936.0, 422.0)
        .svg()
}
