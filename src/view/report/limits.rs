//! The table of limits: the limits of the test, how they were judged and by which program, and the motions of the
//! specimens at either end of a test.

use maud::{Markup, html};

use super::RunView;
use super::columns::SpecimenAxis;
use super::digest::Digest;
use super::html::{details, note, paragraph, table_without};
use super::scale::{Scale, own_unit};
use super::text::{NOTHING, exact, named_once, number, or_dash, quantity};
use super::tracked::Tracked;
use gusset_quantity::catalog::column::JUDGED;
use gusset_quantity::catalog::limit::Limit;
use gusset_record::summary::{LimitFact, LimitFacts, SpecimenLimits};

/// The limits of the run, as markup; nothing where the summary has none.
///
/// `largest` has the farthest value from zero of each column that a limit of an axis is about.
pub(super) fn limits(
    run: &RunView,
    recorded: &Digest,
    largest: &[(String, f64)],
) -> Option<Markup> {
    let limits = run.summary.as_ref()?.limits.as_ref()?;
    let mut rows: Vec<Vec<String>> = Vec::new();
    let mut unlimited = Vec::new();
    for (number, specimen) in (1..).zip(&limits.specimens) {
        let name = &specimen.name;
        for (axis, of_axis) in specimen.axes.iter().enumerate() {
            let who = if specimen.axes.len() > 1 {
                format!("{name}, axis {}", axis + 1)
            } else {
                name.clone()
            };
            let place = SpecimenAxis {
                specimen: number,
                axis: axis as u32 + 1,
            };
            let far = |limit: &LimitFact| farthest(limit, place, run, recorded, largest);
            rows.extend(of_axis.iter().map(|limit| row(&who, limit, far(limit))));
            if of_axis.is_empty() {
                unlimited.push(who);
            }
        }
    }
    rows.extend(limits.test.iter().map(|limit| row("the test", limit, None)));
    let heading = [
        "of",
        "limit",
        "warning",
        "trip",
        "largest value",
        "also at the specimen",
        "how it is checked",
    ];
    Some(html! {
        @if rows.is_empty() { (paragraph("The test had no limits but those that every test has.")) }
        @else { (table_without("no", "limits", &heading, &rows)) }
        @if !unlimited.is_empty() { (note(&format!("Without limits: {}.", unlimited.join(", ")))) }
        (details("What else ends a test, and what happens then", consequences(limits)))
    })
}

/// The trip levels of an axis as the structure sees them, each with its name, for a chart of that quantity.
pub(super) fn levels(
    run: &RunView,
    rows: &Digest,
    axis: &Tracked<'_>,
    of: &[Limit],
) -> Vec<(String, f64)> {
    let place = axis.digest.axis;
    let facts = || {
        let specimens = &run.summary.as_ref()?.limits.as_ref()?.specimens;
        specimens
            .get(place.specimen as usize - 1)?
            .axes
            .get(place.axis as usize - 1)
    };
    let scale = Scale::of(rows, &run.test.file, place);
    let each = facts().into_iter().flatten().filter_map(|fact| {
        let limit = Limit::of_key(&fact.key).filter(|limit| of.contains(limit))?;
        let factor = scale.map_or(1.0, |scale| match limit {
            Limit::MeasuredForce => scale.newtons,
            _ => scale.metres,
        });
        let name = format!("trip, {}", limit.words());
        Some(
            fact.trip
                .iter()
                .filter(|at| at.is_finite())
                .map(move |at| (name.clone(), at * factor)),
        )
    });
    each.flatten().collect()
}

/// The farthest value from zero that a limit judged, at the specimen; none where it is not recorded.
fn farthest(
    limit: &LimitFact,
    axis: SpecimenAxis,
    run: &RunView,
    recorded: &Digest,
    largest: &[(String, f64)],
) -> Option<f64> {
    let of = |column: String| {
        let found = largest.iter().find(|(name, _)| *name == column);
        found.map(|(_, value)| *value)
    };
    let test = &run.test.file;
    let scale = Scale::of(recorded, test, axis);
    match Limit::of_key(&limit.key)? {
        Limit::CommandDisp => {
            let metres = match own_unit(recorded, test, axis, "cmd") {
                "m" => 1.0,
                "mm" => 1e-3,
                "in" => 0.0254,
                _ => return None,
            };
            of(axis.column("cmd")).map(|value| value * metres)
        }
        Limit::MeasuredDisp => {
            of(axis.column("meas")).map(|value| value / scale.map_or(1.0, |s| s.metres))
        }
        Limit::MeasuredForce => {
            of(axis.column("force")).map(|value| value / scale.map_or(1.0, |s| s.newtons))
        }
        other => of(JUDGED.of_parameter(other.row().name, axis.specimen, axis.axis)),
    }
}

/// Causes that end every test, and the consequences of a trip, a late tick and the end.
fn consequences(limits: &LimitFacts) -> Markup {
    let always = limits.always.join("; ");
    let each = [
        ("Always", always.as_str()),
        ("Unlimited", limits.unlimited.as_deref().unwrap_or_default()),
        ("Startup", &limits.way_in),
        ("A late tick", &limits.on_miss),
        ("On a trip", &limits.on_trip),
        ("At the end", &limits.at_end),
    ];
    let known = each.into_iter().filter(|(_, text)| !text.is_empty());
    let own = known.map(|(what, text)| format!("{what}: {}.", one_line(text)));
    let all = own.chain(of_specimens(&limits.specimens));
    html! { @for text in all { (note(&text)) } }
}

/// A text of several lines as a sentence.
fn one_line(text: &str) -> String {
    text.lines().map(str::trim).collect::<Vec<_>>().join(" ")
}

/// Facts about specimens beside the sizes; equal ones are shown once.
fn of_specimens(specimens: &[SpecimenLimits]) -> Vec<String> {
    let facts = specimens.iter().map(|specimen| {
        let parts = [
            ("limits checked by", Some(&specimen.checked_by)),
            ("stale answers:", Some(&specimen.stale)),
            ("watchdog:", specimen.watchdog.as_ref()),
            ("direction:", specimen.direction.as_ref()),
            ("ends of its range:", specimen.ends.as_ref()),
        ];
        // The star refers to a column of this table.
        let told_of = |(what, text): (&str, Option<&String>)| {
            let text = text.filter(|text| !text.is_empty())?;
            Some(format!("{what} {}", text.replace(" (*)", "")))
        };
        let parts = parts.into_iter().filter_map(told_of);
        let safe = specimen.safe_disp_m.iter().flatten();
        let safe = safe.map(|disp| exact(*disp, "m"));
        let safe = safe.collect::<Vec<_>>().join(", ");
        let safe = (!safe.is_empty()).then(|| format!("safe displacement: {safe}"));
        let text = parts.chain(safe).collect::<Vec<_>>().join("; ");
        (specimen.name.clone(), one_line(&text))
    });
    named_once(facts.filter(|(_, text)| !text.is_empty()))
}

fn row(who: &str, limit: &LimitFact, largest: Option<f64>) -> Vec<String> {
    let sizes = |values: &[f64]| {
        let write = |v: &f64| match limit.unit.as_str() {
            "" => number(*v, 3),
            words if words.starts_with("in ") => format!("{} {words}", exact(*v, "1").trim()),
            unit => quantity(*v, unit),
        };
        let finite = values.iter().filter(|value| value.is_finite());
        match finite.clone().next() {
            None => NOTHING.to_owned(),
            Some(_) => finite.map(write).collect::<Vec<_>>().join(" … "),
        }
    };
    let is_twice = limit.also_at_the_specimen;
    vec![
        who.to_owned(),
        words(&limit.key),
        sizes(&limit.warn),
        sizes(&limit.trip),
        sizes(largest.as_slice()),
        if is_twice { "yes" } else { "no" }.to_owned(),
        or_dash(limit.judged.clone()),
    ]
}

/// A key of a limit in words. The table shows units with the values.
fn words(key: &str) -> String {
    match Limit::of_key(key) {
        Some(limit) => limit.words().to_owned(),
        None => key.strip_suffix("_m").unwrap_or(key).replace('_', " "),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Digest;
    use super::*;
    use serde_json::json;

    #[test]
    fn limits_show_sizes_and_consequences() {
        let miss = json!({"key": "max_total_misses", "unit": "in all", "warn": [50.0], "trip": [100.0],
            "judged": "not checked: the simulated clock misses no deadlines"});
        let following = json!({"key": "following_error_m", "unit": "m", "warn": [], "trip": [0.02],
            "judged": "at rest; in motion 0.02 s of it more"});
        let specimen = |name: &str| {
            json!({"name": name, "axes": [[following]], "safe_disp_m": [0.02], "watchdog": "after 0.25 s it holds",
                "stale": "the last force is held", "checked_by": "this loop, its server (*)"})
        };
        let run = RunView {
            summary: Some(json!({"limits": {
                "specimens": [specimen("a"), specimen("b")], "test": [miss],
                "way_in": "no sensor is read;\nthen a ramp", "at_end": "every specimen moves to its `safe_disp_m`",
                "on_trip": "every specimen holds", "on_miss": "the grid moves",
            }}).into()),
            ..RunView::default()
        };
        let markup = limits(&run, &Digest::default(), &[]).unwrap().0;
        for part in [
            "<th>how it is checked</th>",
            "<td>at rest; in motion 0.02 s of it more</td>",
            "<td>not checked: the simulated clock misses no deadlines</td>",
            "Startup: no sensor is read; then a ramp.",
            "A late tick: the grid moves.",
            "On a trip: every specimen holds.",
            "At the end: every specimen moves to its `safe_disp_m`.",
            "a, b: limits checked by this loop, its server; stale answers: the last force is held; \
             watchdog: after 0.25 s it holds; safe displacement: 20\u{a0}mm.",
        ] {
            assert!(markup.contains(part), "{part} is missing in {markup}");
        }
    }

    #[test]
    fn largest_value_is_beside_its_levels() {
        let limit = json!({"key": "following_error_m", "unit": "m", "warn": [], "trip": [0.02]});
        let run = RunView {
            summary: Some(
                json!({"limits": {"specimens": [{"name": "a", "axes": [[limit]]}]}}).into(),
            ),
            ..RunView::default()
        };
        let largest = [("judged_following_error_1_1".to_owned(), 0.0125)];
        let markup = limits(&run, &Digest::default(), &largest).unwrap().0;
        assert!(markup.contains("<td>12.5\u{a0}mm</td>"), "{markup}");
    }

    #[test]
    fn keys_are_shown_in_words() {
        assert_eq!(words("command_disp_m"), "commanded displacement");
        assert_eq!(words("following_error_m"), "following error");
        assert_eq!(words("max_total_misses"), "deadlines missed in total");
        assert_eq!(words("divergence_m"), "divergence");
    }
}
