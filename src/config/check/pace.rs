//! A pace that predicts: its keys fit together, and its slow-down keeps the limits of the axes.

use super::{Finding, Findings, KeyPath};
use crate::ServeFile;
use crate::link_table::Carrier;
use crate::serve_table::{Correction, PaceTable};
use crate::specimen::SpecimenTable;
use gusset_quantity::catalog::limit::Limit;

/// Keys that only a prediction has.
const OF_PREDICTION: &str = "prediction_order prediction_by_velocity slow_at slow_until predict_within_m correct correct_at_most_n";
/// Axes whose motion can be predicted.
const MOST_AXES: usize = 6;
/// Fewest ticks in which it slows down, and in which it is fast again.
const FEWEST_TICKS: f64 = 4.0;

pub(super) fn check(pace: &PaceTable, file: &ServeFile, findings: &mut Findings) {
    let at = KeyPath::root().under("serve.pace");
    if !pace.predicts() {
        for key in findings.given(&at, OF_PREDICTION) {
            let text = format!("`{key}` has no effect with `between = \"rest\"`");
            let finding = Finding::error(key, text).at_key();
            findings.push(finding.help("set `between = \"predict\"`, or leave it out"));
        }
        return;
    }
    let mut refuse = |key: &str, text: String, help: &str| {
        let finding = Finding::error(at.key(key), text).at_key();
        findings.push(if help.is_empty() {
            finding
        } else {
            finding.help(help)
        });
    };
    if pace.settle_ticks > 0 {
        let text =
            "`settle_ticks` has no effect with `between = \"predict\"`: nothing rests at a target";
        refuse(
            "settle_ticks",
            text.to_owned(),
            "give the specimen a `compensation` for its lag",
        );
    }
    if pace.prediction_by_velocity && pace.prediction_order.is_some() {
        let text = "`prediction_order` is for a polynomial, and `prediction_by_velocity` for none";
        refuse("prediction_order", text.to_owned(), "give one of the two");
    }
    if file.serve.transport == Some(Carrier::Udp) {
        let text = "`between = \"predict\"` needs a stream: nothing shows that a client of datagrams is lost";
        refuse(
            "between",
            text.to_owned(),
            "set `transport = \"tcp\"` or \"tls\"",
        );
    }
    let corrects = pace.correct == Correction::InitialStiffness;
    match pace.correct_at_most_n {
        Some(most) if most <= 0.0 || !most.is_finite() => {
            let text = format!("`correct_at_most_n` is {most}, but must be above 0");
            refuse("correct_at_most_n", text, "");
        }
        Some(_) if !corrects => {
            let text = "`correct_at_most_n` has no effect without `correct`";
            refuse(
                "correct_at_most_n",
                text.to_owned(),
                "set `correct = \"initial_stiffness\"`",
            );
        }
        None if corrects => {
            let text = "`correct` needs `correct_at_most_n`: the largest correction of a force";
            refuse(
                "correct",
                text.to_owned(),
                "for example a tenth of the largest force",
            );
        }
        _ => {}
    }
    let measures_none = |specimen: &SpecimenTable| specimen.force_only_link().is_some();
    if corrects && file.specimen.iter().any(measures_none) {
        let text = "`correct` needs a measured displacement, and this link gives none";
        refuse("correct", text.to_owned(), "set `correct = \"none\"`");
    }
    let openfresco = &file.serve.openfresco;
    if openfresco.iterates_within_m.is_some() {
        let text = "`between = \"predict\"` is for clients that do not iterate: `iterates_within_m` has no effect";
        refuse("between", text.to_owned(), "leave out `iterates_within_m`");
    }
    if openfresco.updates_tangent && corrects {
        let text = "`correct` changes the force from which `updates_tangent` follows";
        refuse("correct", text.to_owned(), "leave one of the two out");
    }
    let [slow_at, slow_until] = pace.slows();
    let n = f64::from(pace.ticks_per_step);
    let is_ordered = 0.0 < slow_at && slow_at < slow_until && slow_until < 1.0;
    let room = (slow_until - slow_at).min(1.0 - slow_until) * n;
    if !is_ordered {
        let key = if pace.slow_at.is_some() {
            "slow_at"
        } else {
            "slow_until"
        };
        let text = format!(
            "`slow_at` is {slow_at} and `slow_until` is {slow_until}: 0 < `slow_at` < `slow_until` < 1 is needed"
        );
        refuse(key, text, "");
    } else if room < FEWEST_TICKS * (1.0 - 1e-9) {
        let text = format!(
            "the specimen slows down in {room:.1} ticks, at least {FEWEST_TICKS} are needed"
        );
        refuse(
            "ticks_per_step",
            text,
            "give more `ticks_per_step`, or set `slow_at` and `slow_until` further apart",
        );
    }
    let Some(within) = &pace.predict_within_m else {
        let text = "`between = \"predict\"` needs `predict_within_m`: how far the command may go beyond the last target";
        refuse(
            "between",
            text.to_owned(),
            "for example predict_within_m = 0.005",
        );
        return;
    };
    for (index, specimen) in file.specimen.iter().enumerate() {
        let place = KeyPath::root().key("specimen").index(index);
        let axes = specimen.axes();
        if specimen.link.is_none() {
            let text = "`between = \"predict\"` is for a specimen behind a link";
            let finding = Finding::error(place.clone(), text).at_key();
            findings.push(finding.beside(at.key("between"), "the pace"));
            continue;
        }
        let within = within
            .of(axes)
            .filter(|within| within.iter().all(|one| *one > 0.0));
        if within.filter(|_| axes <= MOST_AXES).is_none() {
            let text = if axes > MOST_AXES {
                format!("a prediction is for {MOST_AXES} axes at most, this specimen has {axes}")
            } else {
                format!(
                    "`predict_within_m` must be one number above 0, or one for each of {axes} axes"
                )
            };
            findings.push(Finding::error(at.key("predict_within_m"), text));
            continue;
        }
        for (index, limits) in specimen.limits_of(axes).iter().enumerate() {
            for limit in [Limit::CommandVel, Limit::CommandAccel] {
                if limits.size(limit).and_then(|levels| levels.trip).is_none() {
                    let text = format!(
                        "`between = \"predict\"` needs the limit `{}` of axis {}",
                        limit.key(),
                        index + 1
                    );
                    let finding = Finding::error(place.clone(), text).at_key();
                    findings.push(finding.label("a target that would need more is refused"));
                }
            }
        }
    }
}
