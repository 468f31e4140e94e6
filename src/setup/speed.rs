//! Velocities of a specimen behind a link: they are those of the laboratory, and can differ from those of the test.

use super::Site;
use gusset_config::{Finding, KeyPath, Loaded, Offer, PaceTable, ServedFile, SpecimenTable};
use gusset_quantity::units::number;

/// Velocities that differ by less than this share count as those of the test.
const CLOSE: f64 = 0.01;

/// Velocity of a specimen in the laboratory over that of the test at its own scale. A specimen of this process is part of the
/// computed structure: it sees the velocity of the test.
pub(super) fn pace(site: &Site<'_>, table: &SpecimenTable) -> f64 {
    if site.trial.is_some_and(|trial| trial.at_test_speed) {
        return 1.0;
    }
    ratio(site.loaded, table)
}

fn ratio(loaded: &Loaded, table: &SpecimenTable) -> f64 {
    match table.link {
        Some(_) => 1.0 / (loaded.file.time.scale.0.value() * table.similitude.time),
        None => 1.0,
    }
}

/// Velocity in the laboratory over that of the test, for a specimen behind a link that resists velocity and is slower or faster
/// than the test.
#[must_use]
pub fn speed_ratio(loaded: &Loaded, table: &SpecimenTable) -> Option<f64> {
    let ratio = ratio(loaded, table);
    let differs = (ratio - 1.0).abs() > CLOSE;
    (differs && table.resists_velocity()).then_some(ratio)
}

/// The finding on a specimen of a test whose velocities are not those of the test. Without a structure it is a warning: no response
/// follows from the force.
pub(super) fn of_test(loaded: &Loaded, table: &SpecimenTable, at: &KeyPath) -> Option<Finding> {
    let ratio = speed_ratio(loaded, table)?;
    let scale = loaded.file.time.scale.0.value();
    let text = format!(
        "specimen \"{}\" resists velocity, but moves at {} times the velocity of the test: its force is not that of the test",
        table.name,
        number(ratio)
    );
    let place = match loaded
        .locator
        .holds(&KeyPath::root().key("time").key("scale"))
    {
        true => KeyPath::root().key("time").key("scale"),
        false => at.key("similitude"),
    };
    let wanted = 1.0 / table.similitude.time;
    let finding = match loaded.file.structure {
        Some(_) => Finding::error(place, text),
        None => Finding::warning(place, text),
    };
    Some(
        finding
            .at_key()
            .label(format!(
                "`time.scale` is {}, and 1/`similitude.time` is {}",
                number(scale),
                number(wanted)
            ))
            .help(format!(
                "`time.scale = {}` gives the velocities of the test; model a damper in the structure if the rig is too slow",
                number(wanted)
            ))
            .number("speed_ratio", ratio)
            .number("scale", scale)
            .number("consistent_scale", wanted),
    )
}

/// The finding on a specimen whose gateway rests at each target, where a velocity has no force.
pub(super) fn of_gateway(source: &ServedFile, protocol: Offer) -> Option<Finding> {
    let table = source.specimen()?;
    let link = table.link.as_ref()?;
    let pace = source.file.serve.pace.as_ref();
    if pace.is_some_and(PaceTable::predicts) {
        return None;
    }
    let is_paced = pace.is_some();
    // A client of OpenFresco sends one target per step. A computed specimen takes the velocity that comes with it.
    let jumps = protocol != Offer::Gusset && !link.computed;
    if !((is_paced || jumps) && table.resists_velocity()) {
        return None;
    }
    let place = match is_paced {
        true => KeyPath::root().key("serve").key("pace"),
        false => source.place.key("link"),
    };
    let text = format!(
        "specimen \"{}\" resists velocity, but this gateway rests at each target: the force of its damping is lost",
        table.name
    );
    Some(
        Finding::error(place, text)
            .at_key()
            .label("measured at rest")
            .help("set `between = \"predict\"` in `serve.pace`, so that it arrives at each target on the move")
            .help("or test such a specimen in real time with `gusset run`, or model its damping in the client"),
    )
}
