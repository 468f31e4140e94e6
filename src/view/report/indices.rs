//! The table of tracking indices: each number, its noise floor, and its value without the noise. The guide defines them
//! (`gusset guide mathematics-errors`).

use super::axes::AxisDigest;
use super::html::{note, table_without};
use super::text::{NOTHING, number, plural, quantity};
use super::tracked::Tracked;
use gusset_motion::metrics::Judged;
use gusset_motion::metrics::tracking::Tracking;

/// How a number is written.
type Written<'a> = &'a dyn Fn(f64) -> String;

/// The indices of one axis; nothing where they are not known.
pub(super) fn table_of(axis: &AxisDigest, named: &Tracked<'_>) -> String {
    let (disp_unit, force_unit) = (named.disp_unit, named.force_unit);
    let Some(tracking) = &axis.tracking else {
        return String::new();
    };
    let metre = |v: f64| quantity(v, disp_unit);
    let second = |v: f64| {
        if v.abs() < 1e-9 {
            "0\u{a0}s".to_owned()
        } else {
            quantity(v, "s")
        }
    };
    let percent = |v: f64| format!("{}\u{a0}%", number(100.0 * v, 3));
    let plain = |v: f64| number(v, 4);
    let radian = |v: f64| quantity(v, "rad");
    let square = |v: f64| format!("{}\u{a0}{disp_unit}²", number(v, 3));
    let joule = |v: f64| quantity(v, named.work_unit());
    let mut rows = Vec::new();
    let mut row = |name: &str, judged: Option<Judged>, write: Written<'_>| {
        let Some(judged) = judged else { return };
        let or_dash = |v: Option<f64>| v.map_or_else(|| NOTHING.to_owned(), write);
        rows.push(vec![
            name.to_owned(),
            write(judged.value),
            or_dash(judged.floor),
            or_dash(judged.corrected),
        ]);
    };
    let t: &Tracking = tracking;
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
    let at = t.fei.map_or_else(String::new, |f| {
        format!(
            " FEI belongs to {}.",
            format_args!("{}\u{a0}Hz", number(f.frequency_hz, 3))
        )
    });
    let damping = t
        .fei
        .zip(axis.whole.filter(|whole| whole.stiffness.is_sure()))
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
    table_without(
        NOTHING,
        &[
            "measured against target",
            "value",
            "noise floor",
            "corrected",
        ],
        &rows,
    ) + &note(&format!(
        "{samples}.{at}{damping}{noise} `gusset guide mathematics-errors` defines the indices."
    ))
}
