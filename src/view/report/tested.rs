//! The tested model in a few lines, from the resolved test. Absent tables are omitted.

use super::RunView;
use super::columns::{Combination, MOST_DOFS, SpecimenAxis, Storey};
use super::text::{exact, number, plural, shortened};
use crate::{Excitation, SpecimenTable, Structure, TestFile, Variant};
use gusset_record::summary::ClockKind;
use gusset_record::{Event, EventLine};

/// Numbers from 1 of the specimens whose measured displacement is the command, from the events.
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

/// Storey drift, absolute floor acceleration and storey shear of a shear building, from the ground up.
///
/// The shear is the inertia of the floors above, −Σ m a. It includes damping forces, and is known where only the ground excites the
/// building. Buildings with very many storeys have drifts only.
#[must_use]
pub fn storeys(test: &TestFile) -> Vec<Combination> {
    let building = test
        .structure
        .as_ref()
        .and_then(|s| s.shear_building.as_ref());
    let masses = building.map_or(&[][..], |building| &building.mass_kg);
    // Coordinates are absolute where the base is displaced.
    let is_absolute = test.is_excited_by("base_displacement");
    let is_shaken = test.is_excited_by("ground_acceleration");
    let is_loaded = test
        .excitations()
        .any(|(kind, _)| !["ground_acceleration", "base_displacement"].contains(&kind));
    let ground = |factor: f64| is_shaken.then(|| ("ground".to_owned(), factor));
    let acceleration = |storey: usize| (format!("a{storey}"), 1.0);
    let mut all = Vec::new();
    for storey in 1..=masses.len() {
        let made = |kind: Storey, meaning: &str, unit, terms| Combination {
            name: kind.column(storey),
            meaning: format!("{meaning} {storey}"),
            unit,
            terms,
        };
        let below = match storey {
            1 => is_absolute.then(|| "ground".to_owned()),
            _ => Some(format!("x{}", storey - 1)),
        };
        let drift = std::iter::once((format!("x{storey}"), 1.0)).chain(below.map(|x| (x, -1.0)));
        all.push(made(Storey::Drift, "drift of storey", "m", drift.collect()));
        if masses.len() > MOST_DOFS {
            continue;
        }
        let floor = std::iter::once(acceleration(storey)).chain(ground(1.0));
        all.push(made(
            Storey::Floor,
            "absolute acceleration of floor",
            "m/s^2",
            floor.collect(),
        ));
        if !is_loaded {
            let above = masses.iter().zip(1..).skip(storey - 1);
            let floors = above.map(|(mass, floor)| (format!("a{floor}"), -mass));
            let mass: f64 = masses[storey - 1..].iter().sum();
            let terms = floors.chain(ground(-mass)).collect();
            all.push(made(Storey::Shear, "shear of storey", "N", terms));
        }
    }
    all
}

/// Name of one axis: the specimen's, and the axis where it has several.
pub(super) fn axis_name(test: &TestFile, axis: SpecimenAxis, all: &[SpecimenAxis]) -> String {
    let name = test.specimen_name(axis.specimen);
    let several = all.iter().filter(|a| a.specimen == axis.specimen).count() > 1;
    if several {
        format!("{name}, axis {}", axis.axis)
    } else {
        name
    }
}

/// Names and values of the tested model.
pub(super) fn facts(run: &RunView) -> Vec<(String, String)> {
    let test = &run.test.file;
    let has_specimens = !test.specimen.is_empty();
    let prescribed =
        has_specimens.then(|| "none: the displacement of the specimens is prescribed".to_owned());
    let structure = test.structure.as_ref();
    let facts = [
        (
            "Structure",
            structure.and_then(structure_words).or(prescribed),
        ),
        (
            "Specimens",
            has_specimens.then(|| specimens(&test.specimen)),
        ),
        ("Excitation", excitation(test)),
        ("Integration", structure.map(|_| integration(run))),
        ("Time", Some(time(run))),
    ];
    let known = facts.into_iter().filter_map(|(name, text)| {
        let text = text.filter(|text| !text.is_empty())?;
        Some((name.to_owned(), text))
    });
    known.collect()
}

/// Step, rate and clock: from the summary, else from the test file.
fn time(run: &RunView) -> String {
    let (test, progress) = (&run.test.file, run.progress());
    let step = progress.dt.or_else(|| test.step_s());
    let step = step.map(|dt| format!("step {}", exact(dt, "s")));
    let rate = progress
        .rate_hz
        .map(|hz| format!("{hz} ticks per second of wall time"));
    let clock = run.summary.as_ref().and_then(|summary| summary.clock);
    let clock = clock.map(clock_word).or_else(|| test.clock());
    let clock = clock.map(|clock| format!("{clock} clock"));
    [step, rate, clock]
        .into_iter()
        .flatten()
        .collect::<Vec<_>>()
        .join(", ")
}

/// A clock as the files name it.
pub(super) const fn clock_word(clock: ClockKind) -> &'static str {
    match clock {
        ClockKind::Real => "real",
        ClockKind::Simulated => "simulated",
    }
}

/// Names and values of the machine and the program.
pub(super) fn machine(run: &RunView) -> Vec<(String, String)> {
    let Some(summary) = &run.summary else {
        return Vec::new();
    };
    let program = summary
        .version
        .as_ref()
        .map(|v| ("Program".to_owned(), format!("gusset {v}")));
    let topics = summary.machine.iter().map(|(topic, found)| {
        let mut letters = topic.chars();
        let first = letters.next().map(char::to_uppercase);
        (
            first.into_iter().flatten().chain(letters).collect(),
            found.clone(),
        )
    });
    let cpu = summary
        .realtime
        .cpu
        .map(|cpu| format!("loop on processor {cpu}"));
    let features = summary.realtime.features.iter().filter_map(|feature| {
        let asked = feature.asked.as_ref().or(feature.want.as_ref())?;
        Some(format!(
            "{asked}: {}",
            if feature.granted {
                "granted"
            } else {
                "REFUSED"
            }
        ))
    });
    let realtime = cpu
        .into_iter()
        .chain(features)
        .collect::<Vec<_>>()
        .join("; ");
    let realtime =
        Some(("Real-time features".to_owned(), realtime)).filter(|(_, text)| !text.is_empty());
    program.into_iter().chain(topics).chain(realtime).collect()
}

/// A key as words.
fn spoken(key: &str) -> String {
    key.replace('_', " ")
}

fn variant(found: &Variant) -> String {
    found
        .names
        .iter()
        .map(|name| spoken(name))
        .collect::<Vec<_>>()
        .join(", ")
}

fn structure_words(table: &Structure) -> Option<String> {
    let (kind, inner) = table.kind()?;
    let listed = Some(inner.mass_kg.len() as u64).filter(|n| *n > 0);
    let size = inner.dofs.or(listed).map(|n| plural(n, "DOF", "DOFs"));
    let damping = table
        .damping
        .as_ref()
        .map(|d| format!("{} damping", variant(d)));
    let elements = Some(table.element.len() as u64).filter(|n| *n > 0);
    let elements = elements.map(|n| plural(n, "nonlinear element", "nonlinear elements"));
    let parts = [Some(kind.to_owned()), size, damping, elements];
    Some(parts.into_iter().flatten().collect::<Vec<_>>().join(", "))
}

fn excitation(test: &TestFile) -> Option<String> {
    let describe = |(kind, entries): (&str, &[Excitation])| {
        let signals = entries
            .iter()
            .filter_map(|e| Some(variant(e.signal.as_ref()?) + &record(e)));
        let signals = signals.collect::<Vec<_>>().join(", ");
        let signals = if signals.is_empty() {
            signals
        } else {
            format!(": {signals}")
        };
        format!("{}{signals}", spoken(kind))
    };
    let parts: Vec<_> = test.excitations().map(describe).collect();
    (!parts.is_empty()).then(|| shortened(&parts.join("; "), 300))
}

/// The file of an excitation and the scaling of its samples, where known.
fn record(entry: &Excitation) -> String {
    let path = entry
        .signal
        .as_ref()
        .and_then(|signal| signal.path.as_ref());
    let path = path.map(|path| format!(" {path}"));
    let processing = &entry.processing;
    let peak = processing.target_peak.as_ref();
    let peak = peak.map(|to| format!(" scaled to a peak of {} {}", number(to.value, 4), to.unit));
    let sa = processing.target_sa.as_ref().and_then(|to| {
        let (amount, period) = (number(to.value, 4), exact(to.period_s?, "s"));
        Some(format!(
            " scaled to a spectral acceleration of {amount} {} at {period}",
            to.unit
        ))
    });
    let factor = processing.scale_factor.filter(|factor| *factor != 1.0);
    let factor = factor.map(|factor| format!(" times {}", number(factor, 4)));
    [path, peak, sa, factor].into_iter().flatten().collect()
}

fn integration(run: &RunView) -> String {
    let table = &run.test.file.integrator;
    let used = run.summary.as_ref().and_then(|summary| summary.lambda);
    let used = used.map(|lambda| format!("λ = {}", lambda.0));
    let asked = table
        .lambda
        .as_ref()
        .map(|lambda| format!("λ asked for: {lambda}"));
    let parts = [table.method.clone(), used.or(asked)];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// Kind of a specimen: its law, or its link.
fn kind(table: &SpecimenTable) -> Option<String> {
    if let Some(link) = &table.link {
        let by = link
            .protocol
            .as_ref()
            .map(|protocol| format!(": {protocol}"));
        let at = link
            .address
            .as_ref()
            .map(|address| format!(" at {address}"));
        let parts = [Some("behind a link".to_owned()), by, at];
        return Some(parts.into_iter().flatten().collect());
    }
    let coupled = table
        .coupled
        .as_ref()
        .map(|law| match law.stiffness_n_per_m.len() {
            0 => "coupled".to_owned(),
            rows => format!("coupled, {}", plural(rows as u64, "axis", "axes")),
        });
    coupled.or_else(|| table.law.as_ref().map(variant))
}

fn specimens(list: &[SpecimenTable]) -> String {
    let describe = |(table, number): (&SpecimenTable, usize)| {
        let name = table
            .name
            .clone()
            .unwrap_or_else(|| format!("specimen {number}"));
        kind(table).map_or_else(|| name.clone(), |kind| format!("{name} ({kind})"))
    };
    match list.len() {
        1..=8 => list
            .iter()
            .zip(1..)
            .map(describe)
            .collect::<Vec<_>>()
            .join(", "),
        n => plural(n as u64, "specimen", "specimens"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ResolvedTest;

    #[test]
    fn list_names_the_parts_of_the_test() {
        let resolved = "[structure.shear_building]\nmass_kg = [1.0, 2.0]\n[structure.damping.rayleigh]\na = 1\n\
            [integrator]\nmethod = \"gui\"\nlambda = \"auto\"\n[[specimen]]\nname = \"brace\"\n[specimen.law.bouc_wen]\na = 1\n\
            [excitation.ground_acceleration.signal.sine]\nfrequency_hz = 1\n";
        let summary = serde_json::json!({"lambda": "inf", "dt": 1.0 / 1024.0});
        let run = RunView {
            test: resolved.into(),
            summary: Some(summary.into()),
            ..RunView::default()
        };
        let facts = facts(&run);
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
        assert_eq!(run.test.file.specimen_name(1), "brace");
        assert_eq!(run.test.file.specimen_name(2), "specimen 2");
        assert_eq!(TestFile::default().specimen_name(0), "specimen 0");
    }

    #[test]
    fn lowest_storey_drifts_against_the_ground() {
        let of = |excitation: &str| {
            let text = format!(
                "[structure.shear_building]\nmass_kg = [1.0, 2.0]\n[excitation.{excitation}.signal.sine]\namplitude = 0.1\n"
            );
            let storeys = storeys(&ResolvedTest::from(text).file).into_iter();
            let drifts = storeys.filter(|made| made.name.starts_with("drift"));
            drifts.map(|made| made.terms).collect::<Vec<_>>()
        };
        let term = |name: &str, factor: f64| (name.to_owned(), factor);
        let second = vec![term("x2", 1.0), term("x1", -1.0)];
        let shaken = [vec![term("x1", 1.0)], second.clone()];
        let displaced = [vec![term("x1", 1.0), term("ground", -1.0)], second];
        assert_eq!(of("ground_acceleration"), shaken);
        assert_eq!(of("base_displacement"), displaced);
    }

    #[test]
    fn shear_is_inertia_of_the_floors_above() {
        let of = |more: &str| {
            let text = format!(
                "[structure.shear_building]\nmass_kg = [2.0, 3.0]\n[excitation.ground_acceleration.signal.sine]\n\
                 amplitude = 0.1\n{more}"
            );
            let storeys = storeys(&ResolvedTest::from(text).file).into_iter();
            let shears = storeys.filter(|made| made.name.starts_with("shear"));
            shears.map(|made| made.terms).collect::<Vec<_>>()
        };
        let term = |name: &str, factor: f64| (name.to_owned(), factor);
        let base = vec![term("a1", -2.0), term("a2", -3.0), term("ground", -5.0)];
        let top = vec![term("a2", -3.0), term("ground", -3.0)];
        assert_eq!(of(""), [base, top]);
        assert!(of("[[excitation.nodal_force]]\ndof = 1\n").is_empty());
    }

    #[test]
    fn a_record_is_named_with_its_scale() {
        let told = |processing: &str| {
            let text = format!(
                "[excitation.ground_acceleration]\nsignal.file.path = \"inputs/kobe.AT2\"\nprocessing = {processing}\n"
            );
            let run = RunView {
                test: text.into(),
                ..RunView::default()
            };
            let facts = facts(&run);
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
    fn remote_specimen_is_named_by_its_address() {
        let resolved = "[[specimen]]\nname = \"A\"\n[specimen.stand_in.law.linear]\nstiffness_n_per_m = 1.0\n\
            [specimen.link]\naddress = \"127.0.0.1:4823\"\nprotocol = \"gusset\"\n\
            [[specimen]]\nname = \"B\"\nlink = {}\n[[specimen]]\nname = \"C\"\nlaw = \"linear\"\n";
        let run = RunView {
            test: resolved.into(),
            ..RunView::default()
        };
        let facts = facts(&run);
        let (_, text) = facts.iter().find(|(name, _)| name == "Specimens").unwrap();
        let wanted = "A (behind a link: gusset at 127.0.0.1:4823), B (behind a link), C (linear)";
        assert_eq!(text, wanted);
    }

    #[test]
    fn a_coupled_specimen_is_named_by_its_axes() {
        let run = RunView {
            test: "[[specimen]]\nname = \"column\"\n[specimen.coupled]\n\
                stiffness_n_per_m = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n"
                .into(),
            ..RunView::default()
        };
        let facts = facts(&run);
        let text = facts.iter().find(|(name, _)| name == "Specimens");
        assert_eq!(text.unwrap().1, "column (coupled, 3\u{a0}axes)");
    }

    #[test]
    fn invalid_toml_gives_no_list() {
        let run = RunView {
            test: "= broken".into(),
            ..RunView::default()
        };
        assert!(facts(&run).is_empty());
    }
}
