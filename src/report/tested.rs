//! What was tested, read out of the resolved configuration: a few lines that a reader needs before any picture.
//!
//! Reads by key and leaves out what it does not find; the whole configuration stands at the end of the page.

use serde_json::Value;

use super::RunData;
use super::columns::{Difference, SpecimenAxis, drift};
use super::outcome;
use super::text::{exact, number, plural, shortened};
use crate::record::{Event, EventLine};

/// The configuration as a tree of values; none if it is not TOML.
pub(super) fn configuration(run: &RunData) -> Option<Value> {
    toml::from_str(&run.resolved).ok()
}

/// Numbers from 1 of the specimens whose measured displacement is the command, as the events tell.
#[must_use]
pub fn without_disp(events: &[EventLine]) -> Vec<u32> {
    let repeats = events.iter().filter_map(|line| match line.event {
        Event::Connected {
            port,
            measures_disp: Some(false),
            ..
        } => Some(port + 1),
        _ => None,
    });
    repeats.collect()
}

/// Name of the specimen with number `specimen` (from 1).
pub(super) fn specimen_name(configuration: Option<&Value>, specimen: u32) -> String {
    let entry =
        configuration.and_then(|c| c.get("specimen")?.get(specimen.checked_sub(1)? as usize));
    let name = entry
        .and_then(|s| s.get("name")?.as_str())
        .filter(|name| !name.trim().is_empty());
    name.map_or_else(|| format!("specimen {specimen}"), str::to_owned)
}

/// The drift of every storey of a shear building, from the ground up.
#[must_use]
pub fn drifts(resolved: &str) -> Vec<Difference> {
    let tree: Option<Value> = toml::from_str(resolved).ok();
    let masses = tree.as_ref().and_then(|t| {
        t.get("structure")?
            .get("shear_building")?
            .get("mass_kg")?
            .as_array()
    });
    let storeys = masses.map_or(0, Vec::len);
    let base = tree
        .as_ref()
        .and_then(|t| t.get("excitation")?.get("base_displacement"));
    let below = |storey: usize| match storey {
        // Coordinates are absolute where the base is displaced: the ground is no longer at zero.
        1 => base.map(|_| "ground".to_owned()),
        _ => Some(format!("x{}", storey - 1)),
    };
    let of_storey = |storey: usize| Difference {
        name: drift(storey),
        meaning: format!("drift of storey {storey}"),
        of: format!("x{storey}"),
        less: below(storey),
    };
    (1..=storeys).map(of_storey).collect()
}

/// Ticks in a step, as a resolved configuration has it.
#[must_use]
pub fn ticks_per_step(resolved: &str) -> u64 {
    let tree: Option<Value> = toml::from_str(resolved).ok();
    let ticks = tree.and_then(|t| t.get("time")?.get("ticks_per_step")?.as_u64());
    ticks.unwrap_or(1).max(1)
}

/// Name of one axis: the specimen's, and the axis where it has several.
pub(super) fn axis_name(
    configuration: Option<&Value>,
    axis: SpecimenAxis,
    all: &[SpecimenAxis],
) -> String {
    let name = specimen_name(configuration, axis.specimen);
    let several = all.iter().filter(|a| a.specimen == axis.specimen).count() > 1;
    if several {
        format!("{name}, axis {}", axis.axis)
    } else {
        name
    }
}

/// Names and values for the list at the top.
pub(super) fn facts(run: &RunData, configuration: Option<&Value>) -> Vec<(String, String)> {
    let get = |path: &str| {
        path.split('.')
            .try_fold(configuration?, |value, key| value.get(key))
    };
    let mut facts = Vec::new();
    let mut say = |name: &str, text: Option<String>| {
        if let Some(text) = text.filter(|t| !t.is_empty()) {
            facts.push((name.to_owned(), text));
        }
    };
    let prescribed =
        get("specimen").map(|_| "none: the displacement of the specimens is prescribed".to_owned());
    say(
        "Structure",
        get("structure").and_then(structure).or(prescribed),
    );
    say(
        "Specimens",
        get("specimen")
            .and_then(Value::as_array)
            .map(|list| specimens(list)),
    );
    say("Excitation", get("excitation").and_then(excitation));
    if get("structure").is_some() {
        say("Integration", integration(run, get("integrator")));
    }
    // Of a run without a summary as it was configured.
    let configured = |path: &str| get(path).and_then(Value::as_f64);
    let rate =
        outcome::number(run, "rate_hz").map(|hz| format!("{hz} ticks per second of wall time"));
    let step = outcome::number(run, "dt")
        .or_else(|| configured("time.step_s"))
        .or_else(|| Some(1.0 / configured("time.rate_hz")?));
    let step = step.map(|dt| format!("step {}", exact(dt, "s")));
    let clock = outcome::text(run, "clock").or_else(|| get("time.clock")?.as_str());
    let clock = clock.map(|c| format!("{c} clock"));
    say(
        "Time",
        Some(
            [step, rate, clock]
                .into_iter()
                .flatten()
                .collect::<Vec<_>>()
                .join(", "),
        ),
    );
    say(
        "Program",
        outcome::text(run, "version").map(|v| format!("gusset {v}")),
    );
    let machine = outcome::at(run, "machine").and_then(Value::as_object);
    let machine = machine.map(|m| {
        m.iter()
            .map(|(topic, found)| format!("{topic}: {}", plain(found)))
            .collect::<Vec<_>>()
            .join("; ")
    });
    say("Machine", machine);
    say("Real-time features", realtime(run));
    facts
}

/// What was asked of the operating system, each with what came of it.
fn realtime(run: &RunData) -> Option<String> {
    let features = outcome::at(run, "realtime.features").and_then(Value::as_array)?;
    let describe = |feature: &Value| {
        let asked = feature
            .get("asked")
            .or_else(|| feature.get("want"))
            .and_then(Value::as_str)?;
        let is_granted = feature.get("granted").and_then(Value::as_bool) == Some(true);
        Some(format!(
            "{asked}: {}",
            if is_granted { "granted" } else { "REFUSED" }
        ))
    };
    let cpu = outcome::number(run, "realtime.cpu").map(|cpu| format!("loop on processor {cpu}"));
    let list = cpu.into_iter().chain(features.iter().filter_map(describe));
    Some(list.collect::<Vec<_>>().join("; "))
}

/// A value without quotes.
fn plain(value: &Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned)
}

/// A key as words.
fn spoken(key: &str) -> String {
    key.replace('_', " ")
}

/// The variant that a table names by its key (`{ bouc_wen = { … } }`) or a plain word.
fn variant(value: &Value) -> Option<String> {
    match value {
        Value::String(word) => Some(spoken(word)),
        Value::Object(table) => table.keys().next().map(|key| spoken(key)),
        Value::Array(list) => Some(
            list.iter()
                .filter_map(variant)
                .collect::<Vec<_>>()
                .join(", "),
        ),
        _ => None,
    }
}

fn structure(table: &Value) -> Option<String> {
    let kinds = ["shear_building", "matrices", "chain"];
    let (kind, inner) = kinds
        .iter()
        .find_map(|kind| Some((*kind, table.get(kind)?)))?;
    let listed = inner.get("mass_kg").and_then(Value::as_array).map(Vec::len);
    let dofs = inner
        .get("dofs")
        .and_then(Value::as_u64)
        .or(listed.map(|n| n as u64));
    let size = dofs.map(|n| plural(n, "DOF", "DOFs"));
    let damping = table
        .get("damping")
        .and_then(variant)
        .map(|d| format!("{d} damping"));
    let elements = table
        .get("element")
        .and_then(Value::as_array)
        .map(|list| list.len() as u64);
    let elements = elements.map(|n| plural(n, "nonlinear element", "nonlinear elements"));
    Some(
        [Some(spoken(kind)), size, damping, elements]
            .into_iter()
            .flatten()
            .collect::<Vec<_>>()
            .join(", "),
    )
}

fn excitation(table: &Value) -> Option<String> {
    let describe = |(key, value): (&String, &Value)| {
        let entries: Vec<&Value> = value
            .as_array()
            .map_or_else(|| vec![value], |list| list.iter().collect());
        let signals: Vec<_> = entries
            .iter()
            .filter_map(|e| Some(variant(e.get("signal")?)? + &record(e)))
            .collect();
        let signals = if signals.is_empty() {
            String::new()
        } else {
            format!(": {}", signals.join(", "))
        };
        format!("{}{signals}", spoken(key))
    };
    let parts: Vec<_> = table.as_object()?.iter().map(describe).collect();
    Some(shortened(&parts.join("; "), 300))
}

/// The file of an excitation and what its samples are scaled by, as far as they are told.
fn record(entry: &Value) -> String {
    let path = entry.pointer("/signal/file/path").and_then(Value::as_str);
    let path = path.map(|path| format!(" {path}"));
    let processing = |key: &str| entry.get("processing")?.get(key);
    let amount = |of: &Value| {
        let value = number(of.get("value")?.as_f64()?, 4);
        Some(format!("{value} {}", of.get("unit").map(plain)?))
    };
    let peak = processing("target_peak").and_then(amount);
    let peak = peak.map(|peak| format!(" scaled to a peak of {peak}"));
    let sa = processing("target_sa").and_then(|of| {
        let period = exact(of.get("period_s")?.as_f64()?, "s");
        Some(format!(
            " scaled to a spectral acceleration of {} at {period}",
            amount(of)?
        ))
    });
    let factor = processing("scale_factor").and_then(Value::as_f64);
    let factor = factor.filter(|factor| *factor != 1.0);
    let factor = factor.map(|factor| format!(" times {}", number(factor, 4)));
    [path, peak, sa, factor].into_iter().flatten().collect()
}

fn integration(run: &RunData, table: Option<&Value>) -> Option<String> {
    let table = table?;
    let method = table.get("method").map(plain);
    // JSON has no infinity: it stands there as a word.
    let used = outcome::at(run, "lambda")
        .filter(|v| !v.is_null())
        .map(|v| format!("λ = {}", plain(v)));
    let asked = table
        .get("lambda")
        .map(|v| format!("λ asked for: {}", plain(v)));
    Some(
        [method, used.or(asked)]
            .into_iter()
            .flatten()
            .collect::<Vec<_>>()
            .join(", "),
    )
}

/// A specimen behind a link, by what it is reached by.
fn remote(link: &Value) -> String {
    let word = |key: &str| link.get(key).and_then(Value::as_str);
    let by = word("protocol").map(|protocol| format!(": {protocol}"));
    let at = word("address").map(|address| format!(" at {address}"));
    [Some("behind a link".to_owned()), by, at]
        .into_iter()
        .flatten()
        .collect()
}

/// A specimen whose axes feel each other, by how many there are.
fn coupled(law: &Value) -> String {
    let rows = law.get("stiffness_n_per_m").and_then(Value::as_array);
    rows.map_or_else(
        || "coupled".to_owned(),
        |rows| format!("coupled, {}", plural(rows.len() as u64, "axis", "axes")),
    )
}

fn specimens(list: &[Value]) -> String {
    let describe = |(i, entry): (usize, &Value)| {
        let name = entry
            .get("name")
            .map_or_else(|| format!("specimen {}", i + 1), plain);
        let coupled = entry.get("coupled").map(coupled);
        let law = coupled.or_else(|| {
            let mut keys = ["law", "laws"].iter();
            keys.find_map(|key| variant(entry.get(key)?))
        });
        let kind = entry.get("link").map(remote).or(law);
        kind.map_or_else(|| name.clone(), |kind| format!("{name} ({kind})"))
    };
    match list.len() {
        0 => "none".to_owned(),
        1..=8 => list
            .iter()
            .enumerate()
            .map(describe)
            .collect::<Vec<_>>()
            .join(", "),
        n => plural(n as u64, "specimen", "specimens"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_names_structure_specimens_and_excitation() {
        let resolved = "[structure.shear_building]\nmass_kg = [1.0, 2.0]\n[structure.damping.rayleigh]\na = 1\n\
            [integrator]\nmethod = \"gui\"\nlambda = \"auto\"\n[[specimen]]\nname = \"brace\"\n[specimen.law.bouc_wen]\na = 1\n\
            [excitation.ground_acceleration.signal.sine]\nfrequency_hz = 1\n";
        let summary = serde_json::json!({"lambda": "inf", "dt": 1.0 / 1024.0});
        let run = RunData {
            resolved: resolved.to_owned(),
            summary: Some(summary),
            ..RunData::default()
        };
        let tree = configuration(&run);
        let facts = facts(&run, tree.as_ref());
        for (name, text) in [
            ("Structure", "shear building, 2\u{a0}DOFs, rayleigh damping"),
            ("Specimens", "brace (bouc wen)"),
            ("Excitation", "ground acceleration: sine"),
            ("Integration", "gui, λ = inf"),
            ("Time", "step 976.5625\u{a0}µs"),
        ] {
            assert!(
                facts.iter().any(|(n, t)| n == name && t == text),
                "{name}: {facts:?}"
            );
        }
        assert_eq!(specimen_name(tree.as_ref(), 1), "brace");
        assert_eq!(specimen_name(tree.as_ref(), 2), "specimen 2");
        assert_eq!(specimen_name(None, 0), "specimen 0");
    }

    #[test]
    fn the_lowest_storey_drifts_against_the_ground_where_that_is_not_at_zero() {
        let of = |excitation: &str| {
            let text = format!(
                "[structure.shear_building]\nmass_kg = [1.0, 2.0]\n[excitation.{excitation}.signal.sine]\namplitude = 0.1\n"
            );
            let drifts = drifts(&text).into_iter();
            drifts.map(|drift| drift.less).collect::<Vec<_>>()
        };
        let (x1, ground) = (Some("x1".to_owned()), Some("ground".to_owned()));
        assert_eq!(of("ground_acceleration"), [None, x1.clone()]);
        assert_eq!(of("base_displacement"), [ground, x1]);
    }

    #[test]
    fn a_record_is_named_with_its_scale() {
        let told = |processing: &str| {
            let text = format!(
                "[excitation.ground_acceleration]\nsignal.file.path = \"inputs/kobe.AT2\"\nprocessing = {processing}\n"
            );
            let run = RunData {
                resolved: text,
                ..RunData::default()
            };
            let facts = facts(&run, configuration(&run).as_ref());
            let mut facts = facts.into_iter();
            facts.find(|(name, _)| name == "Excitation").unwrap().1
        };
        let file = "ground acceleration: file inputs/kobe.AT2";
        assert_eq!(told("{ scale_factor = 1.0 }"), file);
        assert_eq!(
            told("{ scale_factor = 0.35 }"),
            format!("{file} times 0.3500")
        );
        assert_eq!(
            told("{ target_peak = { value = 0.4, unit = \"g\" } }"),
            format!("{file} scaled to a peak of 0.4000 g")
        );
        assert_eq!(
            told(
                "{ target_sa = { period_s = 0.5, damping_ratio = 0.05, value = 0.9, unit = \"g\" } }"
            ),
            format!("{file} scaled to a spectral acceleration of 0.9000 g at 500\u{a0}ms")
        );
    }

    #[test]
    fn a_remote_specimen_is_named_by_what_it_is_reached_by() {
        let resolved = "[[specimen]]\nname = \"A\"\n[specimen.stand_in.law.linear]\nstiffness_n_per_m = 1.0\n\
            [specimen.link]\naddress = \"127.0.0.1:4823\"\nprotocol = \"gusset\"\n\
            [[specimen]]\nname = \"B\"\nlink = {}\n[[specimen]]\nname = \"C\"\nlaw = \"linear\"\n";
        let run = RunData {
            resolved: resolved.to_owned(),
            ..RunData::default()
        };
        let tree = configuration(&run);
        let facts = facts(&run, tree.as_ref());
        let (_, text) = facts.iter().find(|(name, _)| name == "Specimens").unwrap();
        let wanted = "A (behind a link: gusset at 127.0.0.1:4823), B (behind a link), C (linear)";
        assert_eq!(text, wanted);
    }

    #[test]
    fn a_coupled_specimen_is_named_by_its_axes() {
        let run = RunData {
            resolved: "[[specimen]]\nname = \"column\"\n[specimen.coupled]\n\
                stiffness_n_per_m = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n"
                .to_owned(),
            ..RunData::default()
        };
        let facts = facts(&run, configuration(&run).as_ref());
        let text = facts.iter().find(|(name, _)| name == "Specimens");
        assert_eq!(text.unwrap().1, "column (coupled, 3\u{a0}axes)");
    }

    #[test]
    fn what_is_no_toml_gives_no_list_and_no_panic() {
        let run = RunData {
            resolved: "= broken".to_owned(),
            ..RunData::default()
        };
        assert!(configuration(&run).is_none());
        assert!(facts(&run, None).is_empty());
    }
}
