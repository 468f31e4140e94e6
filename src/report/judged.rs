//! The table of tracking metrics: each number, its noise floor, and what is left without the noise.

use super::axes::AxisDigest;
use super::html::{note, table};
use super::text::{NOTHING, escape, number, plural, quantity};
use crate::metrics::Judged;
use crate::metrics::tracking::Tracking;

/// How a number is written.
type Written<'a> = &'a dyn Fn(f64) -> String;

/// The metrics of one axis, under its name.
pub(super) fn table_of(name: &str, axis: &AxisDigest, disp_unit: &str, force_unit: &str) -> String {
    let heading = format!("<h4>Tracking of {}</h4>\n", escape(name));
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
    let work = if disp_unit.starts_with("rad") {
        "N m"
    } else {
        "J"
    };
    let joule = |v: f64| quantity(v, work);
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
    heading
        + &table(
            &[
                "measured against target",
                "value",
                "noise floor",
                "corrected",
            ],
            &rows,
        )
        + &note(&format!("{samples}.{at}{damping}{noise}"))
}

/// What the numbers mean; once for all axes.
pub(super) fn legend() -> String {
    note(
        "Noise floor: the number for a perfect specimen with this noise. Corrected: NRMSE and largest error without the \
         noise's share (difference of squares); the others unchanged where they exceed twice their scatter, else the value of a \
         perfect specimen. Delays are positive where the measured displacement is behind. FEI: frequency evaluation index of Guo et al. \
         (2014), l = 2. PAEI and FDB: indices named after those of Mirza Hessabi and Mercan (2012, 2014), in windows of four periods of the \
         target with the taper of Hann. PAEI: of the ellipse of measured against target, √(S_yy/S_xx) − 1 of its second moments, and \
         the phase from S_xy and from the area that is swept, with its sense. FDB: measured over target at the dominant frequency of \
         the target in the window. TI: Mercan and Ricles (2007), it falls while the measured displacement lags. Energy error: ∫ f d(measured − target), Mosqueda et al. \
         (2007), positive where the transfer system adds energy to the test; over the largest input energy and the largest elastic strain \
         energy of the whole test together. Delay by cross-correlation: refined within a sample by least squares; of a test of more than 100 000 samples, around its largest target.",
    )
}
