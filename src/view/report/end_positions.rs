//! End positions of the specimens, in sentences.

use super::RunView;
use super::axis_end::{AxisEnd, FORCE, MEASURED};
use super::digest::Digest;
use super::scale::{AS_SEEN, Scale, own_unit};
use super::text::{plural, quantity};
use crate::TestFile;

/// Specimens that are listed one by one.
const MOST_TOLD: usize = 8;

/// The end position of each specimen, the gravest first; empty if the summary does not contain them.
pub(super) fn sentences(run: &RunView, rows: &Digest) -> Vec<String> {
    let test = &run.test.file;
    let left = run.summary.iter().flat_map(|summary| &summary.left);
    let mut left: Vec<(&str, &str)> = left
        .map(|(name, how)| (name.as_str(), how.as_str()))
        .collect();
    left.sort_by_key(|(_, how)| gravity(how));
    let is_whole = run.flaws.damaged.is_empty();
    let told = left.iter().take(MOST_TOLD).map(|(name, how)| {
        let ends = rows.ends.iter();
        let own: Vec<_> = ends
            .filter(|end| test.specimen_name(end.axis.specimen) == *name)
            .collect();
        let each: Vec<String> = own
            .iter()
            .map(|end| {
                let which = match own.len() {
                    1 => String::new(),
                    _ => format!("axis {}: ", end.axis.axis),
                };
                which + &words(end, rows, test, is_whole)
            })
            .collect();
        let each = match each.len() {
            0 => String::new(),
            _ => format!("; {}", each.join("; ")),
        };
        format!("Specimen \"{name}\" {}{each}.", how_words(how))
    });
    let mut sentences: Vec<String> = told.collect();
    let rest = left.get(MOST_TOLD..).unwrap_or_default();
    let counts = rest.chunk_by(|a, b| a.1 == b.1).map(|same| {
        let how = same.first().map_or("", |(_, how)| *how);
        format!(
            "{} {}",
            plural(same.len() as u64, "other", "others"),
            how_words(how)
        )
    });
    sentences.extend(counts.map(|count| format!("{count}.")));
    sentences
}

fn gravity(how: &str) -> u8 {
    match how {
        "lost" => 0,
        "not_reached" => 1,
        "reached" => 3,
        "stayed" => 4,
        _ => 2,
    }
}

fn how_words(how: &str) -> String {
    match how {
        "stayed" => "stayed at the last command".to_owned(),
        "reached" => "was moved to its end position (`at_end` of the test file)".to_owned(),
        "not_reached" => "DID NOT REACH its end position (`at_end` of the test file)".to_owned(),
        "lost" => "is LOST: only its own server can hold it".to_owned(),
        other => format!("was left: {}", other.replace('_', " ")),
    }
}

/// The end of one axis in words. If rows are missing, it moved on from the place that they show last.
fn words(end: &AxisEnd, rows: &Digest, test: &TestFile, is_whole: bool) -> String {
    let own = |value: f64, kind: &str| quantity(value, own_unit(rows, test, end.axis, kind));
    let [command, measured, force] = [
        own(end.command, "cmd"),
        own(end.measured, MEASURED),
        own(end.force, FORCE),
    ];
    let mut text = if is_whole && !rows.measures_disp(end.axis) {
        format!("last command sent {command}, last force received {force}")
    } else if is_whole {
        format!("last command sent {command}, last measurements received {measured} and {force}")
    } else {
        let at = if end.time.is_finite() {
            format!(" ({})", rows.moment(end.time))
        } else {
            String::new()
        };
        format!(
            "in the last row that can be read{at} the command was {command} and the measurements were {measured} and {force}; these \
             rows do not show its position at the end"
        )
    };
    let seen = Scale::of(rows, test, end.axis).map_or("", |_| AS_SEEN);
    let seen = |force: f64| quantity(force, rows.unit(&end.axis.column("force"))) + seen;
    // A test that ran has its own forces.
    if let Some(force) = end.on_the_way_in.filter(|_| rows.passed.ticks == 0) {
        text += &format!(", largest force before the first step {}", seen(force));
    }
    if let Some(force) = end.on_the_way_out {
        text += &format!(", largest force during shutdown {}", seen(force));
        let mut axes = rows.axes.iter();
        let running = axes
            .find(|axis| axis.axis == end.axis)
            .and_then(|axis| axis.peak_force);
        if running.is_some_and(|peak| force.abs() > peak.abs()) {
            text += ", more than in the running test";
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::render;
    use super::super::synthetic::columns;
    use super::*;
    use serde_json::{Value, json};

    /// One row before the test, three of it, a trip, then the shutdown, during which the force grows further.
    fn led_away(left: &str) -> RunView {
        let names = [
            "step",
            "state",
            "time",
            "target_1_1",
            "cmd_1_1",
            "meas_1_1",
            "force_1_1",
            "raw_disp_1_1",
            "raw_force_1_1",
        ];
        let states = [5.0, 3.0, 3.0, 3.0, 8.0, 7.0, 7.0, 7.0];
        let forces = [9e5, 0.0, 8e3, -16e3, 20e3, 46e3, -47e3, 30e3];
        let mut data = vec![Vec::new(); names.len()];
        for (i, (state, force)) in states.into_iter().zip(forces).enumerate() {
            let at = 0.004 * i as f64;
            let step = (i as f64 - 1.0).clamp(0.0, 3.0);
            let meas = at - 0.001;
            let row = [step, state, 0.1 * step, at, at, meas, force, meas, force];
            data.iter_mut()
                .zip(row)
                .for_each(|(column, v)| column.push(v));
        }
        RunView {
            columns: columns(&names),
            data,
            summary: Some(json!({"status": "stopped", "dt": 0.1, "left": {"column": left}}).into()),
            test: "[[specimen]]\nname = \"column\"\n".into(),
            ..RunView::default()
        }
    }

    #[test]
    fn page_shows_end_position_and_force() {
        let page = render(&led_away("reached")).replace("&quot;", "\"");
        for part in [
            "Specimen \"column\" was moved to its end position (`at_end` of the test file); last command sent 28.0\u{a0}mm, last measurements received \
             27.0\u{a0}mm and 30.0\u{a0}kN, largest force during shutdown −47.0\u{a0}kN, more than in the running test.",
            "largest force of the running test, column; −47.0\u{a0}kN during shutdown",
            "<b>20.0\u{a0}kN</b>",
            "<th>peak force during shutdown</th>",
            "8\u{a0}rows: 3\u{a0}steps of the running test and 1\u{a0}tick between two of them, in a hold or at a trip; \
             1\u{a0}row before the test; 3\u{a0}rows of the shutdown",
        ] {
            assert!(page.contains(part), "{part} is missing");
        }
        let page = render(&led_away("not_reached"));
        assert!(
            page.contains(
                "DID NOT REACH its end position (`at_end` of the test file); last command"
            )
        );
        let page = render(&led_away("lost"));
        assert!(page.contains("is LOST: only its own server can hold it"));
    }

    #[test]
    fn damaged_record_has_no_known_end() {
        let mut run = led_away("reached");
        run.data.iter_mut().for_each(|column| column.truncate(3));
        run.flaws.damaged = vec!["the rows end at 0.1 s".to_owned()];
        let page = render(&run).replace("&quot;", "\"");
        let said = "Specimen \"column\" was moved to its end position (`at_end` of the test file); in the last row that can be read (0.1\u{a0}s) \
                    the command was 8.00\u{a0}mm and the measurements were 7.00\u{a0}mm and 8.00\u{a0}kN; these rows do not \
                    show its position \
                    at the end";
        assert!(page.contains(said), "{page}");
        assert!(!page.contains("last command") && !page.contains("last measurements"));
    }

    /// An axis with a specimen in other units, at another scale or wired the other way.
    fn at_its_own_end(table: &str, metres: f64, newtons: f64) -> String {
        let mut run = led_away("reached");
        run.test = (run.test.text + table).into();
        for (name, factor) in [
            ("cmd_1_1", metres),
            ("raw_disp_1_1", metres),
            ("raw_force_1_1", newtons),
        ] {
            let place = run.columns.iter().position(|c| c.name == name).unwrap();
            run.columns[place].unit = "specimen unit".to_owned();
            run.data[place].iter_mut().for_each(|v| *v *= factor);
        }
        render(&run).replace("&quot;", "\"")
    }

    #[test]
    fn end_values_are_those_of_the_specimen() {
        let units = "[[specimen.axis]]\nunit_disp = \"mm\"\nunit_force = \"kN\"\n";
        let page = at_its_own_end(units, 1e3, 1e-3);
        let left = "last command sent 28.0\u{a0}mm, last measurements received 27.0\u{a0}mm and 30.0\u{a0}kN";
        assert!(page.contains(left));
        assert!(!page.contains("as the structure sees"));

        let scaled =
            "[specimen.similitude]\nlength = 3.0\nforce = 9.0\n[[specimen.axis]]\nsign = -1\n";
        let page = at_its_own_end(scaled, -1.0 / 3.0, -1.0 / 9.0);
        for part in [
            "last command sent −9.33\u{a0}mm, last measurements received −9.00\u{a0}mm and −3.33\u{a0}kN, \
             largest force during shutdown −47.0\u{a0}kN, as the structure sees it, more than in the running test.",
            "largest force of the running test, column, as the structure sees it; −47.0\u{a0}kN during shutdown",
            "peaks are as the structure sees them. column: \
             1\u{a0}m of the specimen is −3\u{a0}m of the structure, 1\u{a0}N is −9\u{a0}N.",
            "all as the structure sees it: 1\u{a0}m of the specimen is −3\u{a0}m",
        ] {
            assert!(page.contains(part), "{part} is missing");
        }
    }

    #[test]
    fn specimen_that_stayed_has_no_return_move() {
        let mut run = led_away("stayed");
        run.data.iter_mut().for_each(|column| column.truncate(4));
        let page = render(&run);
        assert!(page.contains("stayed at the last command; last command sent 12.0\u{a0}mm"));
        assert!(page.contains("largest force, column") && !page.contains("during shutdown"));
        let all: serde_json::Map<String, Value> = (0..12)
            .map(|i| {
                (
                    format!("s{i:02}"),
                    json!(if i == 11 { "lost" } else { "stayed" }),
                )
            })
            .collect();
        run.summary = Some(json!({"left": all}).into());
        let page = render(&run);
        assert!(page.contains("s11&quot; is LOST"));
        assert!(page.contains("4\u{a0}others stayed at the last command."));
    }
}
