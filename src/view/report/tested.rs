//! The tested model in a few lines, from the resolved test. Absent tables are omitted.

use super::RunView;
use super::columns::{Combination, MOST_DOFS, SpecimenAxis, Storey};
use super::text::{exact, number, plural, shortened};
use crate::TestFile;
use gusset_actuator::specimen::SpecimenLaw;
use gusset_config::{ClockChoice, LambdaValue, SpecimenTable, StructureTable, word};
use gusset_motion::{Processing, Signal};
use gusset_numerics::model::{ShearBuildingSpec, StructureSpec};
use gusset_quantity::catalog::column::GROUND;
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

/// The shear building of a test, if it has one.
fn building(test: &TestFile) -> Option<&ShearBuildingSpec> {
    test.structure.as_ref()?.shear_building.as_ref()
}

/// Storey drift, absolute floor acceleration and storey shear of a shear building, from the ground up.
///
/// The shear is the inertia of the floors above, −Σ m a. It includes damping forces, and is known where only the ground excites the
/// building. Buildings with very many storeys have drifts only.
pub(super) fn storeys(test: &TestFile) -> Vec<Combination> {
    let masses = building(test).map_or(&[][..], |building| &building.mass_kg);
    let excitation = &test.excitation;
    // Coordinates are absolute where the base is displaced.
    let is_absolute = excitation.base_displacement.is_some();
    let is_loaded = !excitation.nodal_force.is_empty() || excitation.nodal_table.is_some();
    let grounds = &excitation.ground_acceleration;
    let tracks = grounds.tracks();
    // The motion of the ground at floors, each with a factor; several components have influence vectors.
    let ground = |factors: &[(usize, f64)]| -> Vec<(String, f64)> {
        let terms = tracks.iter().map(|track| {
            let component = grounds.all().get(track.components[0]);
            let influence = component.and_then(|one| one.influence.as_ref());
            let influence = influence.filter(|_| grounds.all().len() > 1);
            let share =
                |floor: usize| influence.map_or(1.0, |iota| *iota.get(floor - 1).unwrap_or(&0.0));
            let sum = factors.iter().map(|(floor, factor)| factor * share(*floor));
            (GROUND.of_component(&track.suffix), sum.sum::<f64>())
        });
        terms.filter(|(_, factor)| *factor != 0.0).collect()
    };
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
        let floor = std::iter::once(acceleration(storey)).chain(ground(&[(storey, 1.0)]));
        all.push(made(
            Storey::Floor,
            "absolute acceleration of floor",
            "m/s^2",
            floor.collect(),
        ));
        if !is_loaded {
            let above = masses.iter().zip(1..).skip(storey - 1);
            let above: Vec<(usize, f64)> = above.map(|(mass, floor)| (floor, -mass)).collect();
            let floors = above
                .iter()
                .map(|(floor, mass)| (format!("a{floor}"), *mass));
            let terms = floors.chain(ground(&above)).collect();
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

/// A degree of freedom, from 1, in words.
pub(super) fn dof(run: &RunView, dof: u32) -> String {
    let structure = run.test.file.structure.as_ref();
    let words = structure.map(|structure| structure.dof_in_words(dof as usize));
    words.unwrap_or_else(|| format!("DOF {dof}"))
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
    let (test, summary) = (&run.test.file, run.summary.as_ref());
    let step = summary.map(|summary| summary.dt).or_else(|| test.step_s());
    let step = step.map(|dt| format!("step {}", exact(dt, "s")));
    let rate = summary.map(|summary| format!("{} ticks per second of wall time", summary.rate_hz));
    let clock = summary.map(|summary| summary.clock);
    let clock = clock.or_else(|| match test.time.as_ref()?.clock {
        ClockChoice::Real => Some(ClockKind::Real),
        ClockChoice::Simulated => Some(ClockKind::Simulated),
    });
    let clock = clock.map(clock_word);
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
    let program = ("Program".to_owned(), format!("gusset {}", summary.version));
    let topics = summary.machine.iter().flat_map(|machine| &machine.0);
    let topics = topics.map(|(topic, found)| {
        let mut letters = topic.chars();
        let first = letters.next().map(char::to_uppercase);
        (
            first.into_iter().flatten().chain(letters).collect(),
            found.clone(),
        )
    });
    let granted = summary.realtime.granted.iter();
    let cpu = granted.clone().find_map(|granted| granted.cpu);
    let cpu = cpu.map(|cpu| format!("loop on processor {cpu}"));
    let features = granted.flat_map(|granted| &granted.features);
    let features = features.map(|feature| {
        let answer = match feature.granted {
            true => "granted",
            false => "REFUSED",
        };
        format!("{}: {answer}", feature.asked)
    });
    let realtime = cpu
        .into_iter()
        .chain(features)
        .collect::<Vec<_>>()
        .join("; ");
    let realtime =
        Some(("Real-time features".to_owned(), realtime)).filter(|(_, text)| !text.is_empty());
    std::iter::once(program)
        .chain(topics)
        .chain(realtime)
        .collect()
}

/// A key as words.
fn spoken(key: &str) -> String {
    key.replace('_', " ")
}

fn structure_words(table: &StructureTable) -> Option<String> {
    let (kind, spec) = table.kind()?;
    let size = match spec {
        StructureSpec::ShearBuilding(building) => building.mass_kg.len(),
        StructureSpec::Matrices(matrices) => matrices.mass.as_ref().map_or(0, Vec::len),
        StructureSpec::Chain(chain) => chain.dofs,
        StructureSpec::Frame(frame) => frame.places().len(),
    };
    let size = (size > 0).then(|| plural(size as u64, "DOF", "DOFs"));
    let damping = table.damping.as_ref();
    let damping = damping.map(|damping| format!("{} damping", spoken(&word(damping))));
    let elements = Some(table.element.len() as u64).filter(|n| *n > 0);
    let elements = elements.map(|n| plural(n, "nonlinear element", "nonlinear elements"));
    let parts = [Some(spoken(kind)), size, damping, elements];
    Some(parts.into_iter().flatten().collect::<Vec<_>>().join(", "))
}

fn excitation(test: &TestFile) -> Option<String> {
    let table = &test.excitation;
    let base = table.base_displacement.iter();
    let base = base.map(|base| signal(&base.signal, &base.processing));
    let grounds = table.ground_acceleration.all().iter();
    let grounds = grounds.map(|ground| signal(&ground.signal, &ground.processing));
    let forces = table.nodal_force.iter();
    let forces = forces.map(|force| signal(&force.signal, &force.processing));
    let moves = table.prescribed_displacement.iter();
    let moves = moves.map(|path| signal(&path.signal, &path.processing));
    let supports = table.support_motion.iter();
    let supports = supports.map(|moved| signal(&moved.signal, &moved.processing));
    let files = table.nodal_table.iter();
    let kinds = [
        ("base displacement", base.collect::<Vec<_>>()),
        ("ground acceleration", grounds.collect()),
        ("support motion", supports.collect()),
        ("nodal force", forces.collect()),
        (
            "nodal table",
            files.map(|table| table.file.clone()).collect(),
        ),
        ("prescribed displacement", moves.collect()),
    ];
    let given = kinds.into_iter().filter(|(_, signals)| !signals.is_empty());
    let parts: Vec<_> = given
        .map(|(kind, signals)| format!("{kind}: {}", signals.join(", ")))
        .collect();
    (!parts.is_empty()).then(|| shortened(&parts.join("; "), 300))
}

/// The kind of a signal, its file, and the scaling of its samples.
fn signal(signal: &Signal, processing: &Processing) -> String {
    let path = match signal {
        Signal::File(file) => format!(" {}", file.path),
        _ => String::new(),
    };
    let peak = processing.target_peak.as_ref().map(|to| {
        let amount = number(to.value, 4);
        format!(" scaled to a peak of {amount} {}", word(&to.unit))
    });
    let sa = processing.target_sa.as_ref().map(|to| {
        let (amount, period) = (number(to.value, 4), exact(to.period_s, "s"));
        format!(
            " scaled to a spectral acceleration of {amount} {} at {period}",
            word(&to.unit)
        )
    });
    let factor = Some(processing.scale_factor).filter(|factor| *factor != 1.0);
    let factor = factor.map(|factor| format!(" times {}", number(factor, 4)));
    let parts = [Some(spoken(&word(signal)) + &path), peak, sa, factor];
    parts.into_iter().flatten().collect()
}

fn integration(run: &RunView) -> String {
    let table = &run.test.file.integrator;
    let used = run.summary.as_ref().and_then(|summary| summary.lambda);
    let lambda = match (used, table.lambda) {
        (Some(used), _) => format!("λ = {}", used.0),
        (None, LambdaValue::Number(asked)) => format!("λ asked for: {asked}"),
        (None, LambdaValue::Infinite) => "λ asked for: inf".to_owned(),
        (None, LambdaValue::Auto) => "λ asked for: auto".to_owned(),
    };
    format!("{}, {lambda}", word(&table.method))
}

/// Kind of a specimen: its law, or its link.
fn kind(table: &SpecimenTable) -> Option<String> {
    if let Some(link) = &table.link {
        let by = word(&link.protocol);
        return Some(format!("behind a link: {by} at {}", link.address));
    }
    let (_, law) = table.source()?;
    Some(match law {
        SpecimenLaw::Law(law) => spoken(&word(&law)),
        SpecimenLaw::Laws(laws) => {
            let each = laws.iter().map(|law| spoken(&word(law)));
            each.collect::<Vec<_>>().join(", ")
        }
        SpecimenLaw::Coupled(law) => {
            let axes = law.stiffness_n_per_m.len() as u64;
            format!("coupled, {}", plural(axes, "axis", "axes"))
        }
        SpecimenLaw::Bearing(bearing) => format!("{} bearing", spoken(&word(&bearing))),
    })
}

fn specimens(list: &[SpecimenTable]) -> String {
    let describe = |table: &SpecimenTable| match kind(table) {
        Some(kind) => format!("{} ({kind})", table.name),
        None => table.name.clone(),
    };
    match list.len() {
        1..=8 => list.iter().map(describe).collect::<Vec<_>>().join(", "),
        n => plural(n as u64, "specimen", "specimens"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ResolvedTest;

    #[test]
    fn list_names_the_parts_of_the_test() {
        let resolved = "[structure.shear_building]\nmass_kg = [1.0, 2.0]\nstiffness_n_per_m = [1e3, 1e3]\n\
            [structure.damping.rayleigh]\nmass_coefficient_per_s = 1\nstiffness_coefficient_s = 0\n\
            [integrator]\nmethod = \"gui\"\nlambda = \"auto\"\n[[specimen]]\nname = \"brace\"\n[specimen.law.bilinear]\n\
            stiffness_n_per_m = 1e3\nyield_force_n = 1.0\npost_yield_ratio = 0.1\n\
            [excitation.ground_acceleration.signal.sine]\nfrequency_hz = 1\namplitude = 0.1\n";
        let summary = serde_json::json!({"lambda": "inf", "dt": 1.0 / 1024.0, "rate_hz": 1024.0});
        let run = RunView {
            test: resolved.into(),
            summary: Some(summary.into()),
            ..RunView::default()
        };
        let facts = facts(&run);
        for (name, text) in [
            ("Structure", "shear building, 2\u{a0}DOFs, rayleigh damping"),
            ("Specimens", "brace (bilinear)"),
            ("Excitation", "ground acceleration: sine"),
            ("Integration", "gui, λ = inf"),
            (
                "Time",
                "step 976.5625\u{a0}µs, 1024 ticks per second of wall time, real clock",
            ),
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
                "[structure.shear_building]\nmass_kg = [1.0, 2.0]\nstiffness_n_per_m = [1e3, 1e3]\n\
                 [excitation.{excitation}.signal.sine]\namplitude = 0.1\nfrequency_hz = 1\n"
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
                "[structure.shear_building]\nmass_kg = [2.0, 3.0]\nstiffness_n_per_m = [1e3, 1e3]\n\
                 [excitation.ground_acceleration.signal.sine]\namplitude = 0.1\nfrequency_hz = 1\n{more}"
            );
            let storeys = storeys(&ResolvedTest::from(text).file).into_iter();
            let shears = storeys.filter(|made| made.name.starts_with("shear"));
            shears.map(|made| made.terms).collect::<Vec<_>>()
        };
        let term = |name: &str, factor: f64| (name.to_owned(), factor);
        let base = vec![term("a1", -2.0), term("a2", -3.0), term("ground", -5.0)];
        let top = vec![term("a2", -3.0), term("ground", -3.0)];
        assert_eq!(of(""), [base, top]);
        assert!(
            of("[[excitation.nodal_force]]\ndofs = [1]\nsignal.constant.value = 1.0\n").is_empty()
        );
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
            [[specimen]]\nname = \"C\"\nlaw.linear.stiffness_n_per_m = 1.0\n[[specimen]]\nname = \"D\"\n";
        let run = RunView {
            test: resolved.into(),
            ..RunView::default()
        };
        let facts = facts(&run);
        let (_, text) = facts.iter().find(|(name, _)| name == "Specimens").unwrap();
        let wanted = "A (behind a link: gusset at 127.0.0.1:4823), C (linear), D";
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
    fn unknown_configuration_gives_no_list() {
        assert!(facts(&RunView::default()).is_empty());
    }
}
