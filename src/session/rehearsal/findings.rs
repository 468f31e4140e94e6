//! A rehearsal judged: the limits of the file that the test would meet, and their places.

use super::hold::depends_on_pace;
use super::{Held, Need, Needs, Rehearsal};
use gusset_config::{ClockChoice, Finding, KeyPath, Loaded};
use gusset_control::engine::{Ending, Stop};
use gusset_control::port::Poses;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::units::quantity;

/// Part of a tick that its computation may need before a warning: the loop must be able to catch up.
const MUCH: f64 = 0.5;

/// A corotational member that λ was not chosen for, in a sentence.
pub(crate) fn beyond_declared((name, [tension, rotation]): &(String, [f64; 2])) -> String {
    format!(
        "{name} goes beyond what λ was chosen for: its tension reaches {} and its rotation {}; declare both as \
         `corotational = {{ largest_tension_n = …, largest_rotation_rad = … }}`",
        quantity(*tension, "N"),
        quantity(*rotation, "rad")
    )
}

impl Rehearsal {
    /// Every limit that the test would meet, at its place in the file: a trip is an error, a warning a warning.
    #[must_use]
    pub fn findings(&self, loaded: &Loaded) -> Vec<Finding> {
        let mut findings = Vec::new();
        for (index, needs) in self.specimens.iter().enumerate() {
            for (axis, all) in needs.axes.iter().enumerate() {
                let place = |need: &Need| {
                    let level = if need.trips() { "trip" } else { "warn" };
                    place(loaded, index, axis, need.quantity, level)
                };
                let found = all
                    .iter()
                    .filter_map(|need| finding(need, needs, axis, place(need)));
                findings.extend(found);
            }
            findings.extend(deaf(loaded, needs, index));
            findings.extend(nearly_singular(needs, index));
            findings.extend(unsettled(loaded, needs, index));
        }
        findings.extend(self.beyond_declared.iter().map(|member| {
            let at = KeyPath::root().key("structure").key("frame");
            Finding::error(at, beyond_declared(member))
        }));
        findings.extend(self.end(loaded));
        findings.extend(self.slow(loaded));
        findings
    }

    /// A warning if this machine needs much of a tick for its computation.
    fn slow(&self, loaded: &Loaded) -> Option<Finding> {
        let period = loaded.time.period.value();
        let took = self.tick_s?;
        let matters = loaded.time.clock == ClockChoice::Real && took > MUCH * period;
        matters.then(|| {
            let text = if took > period {
                "this machine cannot keep the ticks of the test"
            } else {
                "this machine has little time left in the ticks of the test"
            };
            Finding::warning(
                KeyPath::root().key("time"),
                format!(
                    "{text}: one took {} ms in the rehearsal, and there are {} ms for it",
                    short(took * 1e3),
                    short(period * 1e3)
                ),
            )
            .help(
                "this is an average with stand-ins for the specimens and without links; the warm-up of the test decides whether \
                 it starts. A longer step, `time.scale` or fewer DOFs give more time",
            )
        })
    }

    /// A warning where the budget ended the rehearsal before the end of the test.
    #[must_use]
    pub(crate) fn beyond_budget(&self) -> Option<Finding> {
        self.is_out_of_budget().then(|| {
            let text = format!(
                "only the first {} s of the test were rehearsed: its DOFs times ticks are beyond the budget",
                short(self.time)
            );
            Finding::warning(KeyPath::root().key("time"), text)
                .number("rehearsed_s", self.time)
                .help("what comes later was not compared with the limits")
        })
    }

    /// Cause that ended the rehearsal before the test's end.
    pub(super) fn end(&self, loaded: &Loaded) -> Option<Finding> {
        let at = short(self.time);
        let named = |port| named(loaded, port);
        let root = KeyPath::root();
        match self.ending {
            Ending::Completed | Ending::Stopped(Stop::Operator) => None,
            Ending::Stopped(Stop::Limit { port, hit }) => {
                let text = format!("the test would stop at {at} s: {}, {hit}", named(port));
                let place = place(loaded, port, hit.axis, hit.quantity, "trip");
                Some(Finding::error(place, text).help("found on the simulated clock"))
            }
            Ending::Stopped(stop @ Stop::Geometry { port, .. }) => Some(
                Finding::error(
                    root.key("specimen").index(port).key("geometry"),
                    format!("the test would stop at {at} s: {}", stop.with_name(named)),
                )
                .at_key()
                .label("these actuators")
                .help("found on the simulated clock: a smaller motion, longer actuators, or other pins"),
            ),
            Ending::Stopped(stop @ Stop::TestLimit(hit)) => Some(Finding::error(
                root.key("safety").key(hit.quantity.key()),
                format!("the test would stop at {at} s: {}", stop.with_name(named)),
            )),
            Ending::Stopped(stop @ Stop::Diverged { value, .. }) => {
                let text = format!("the test would stop at {at} s: {stop}");
                let finding = match loaded.file.safety.divergence_m {
                    Some(_) => Finding::error(root.key("safety").key("divergence_m"), text),
                    None => Finding::error(root.key("structure"), text).at_key(),
                };
                let finding = finding.number("value_m", value);
                Some(finding.help(
                    "found on the simulated clock: the actuators' lag, λ or the structure itself lets it grow, or the motion is that large",
                ))
            }
            Ending::Stopped(stop) => {
                let specimen = |port| root.key("specimen").index(port);
                Some(Finding::error(
                    stop.port().map_or(root.clone(), specimen),
                    format!("the test would stop at {at} s: {}", stop.with_name(named)),
                ))
            }
        }
    }
}

/// A specimen by its name.
fn named(loaded: &Loaded, port: usize) -> String {
    match loaded.file.specimen.get(port) {
        Some(table) => format!("specimen {:?}", table.name),
        None => format!("specimen {}", port + 1),
    }
}

impl Held {
    /// Every limit on which the test would trip in its hold, and not without it.
    #[must_use]
    pub(crate) fn findings(&self, undisturbed: &Rehearsal, loaded: &Loaded) -> Vec<Finding> {
        let mut findings = Vec::new();
        for (index, needs) in self.specimens.iter().enumerate() {
            for (axis, all) in needs.axes.iter().enumerate() {
                let trips_anyway = |quantity| {
                    let before = undisturbed.specimens.get(index);
                    let before = before.and_then(|needs| needs.axes.get(axis));
                    let before = before.into_iter().flatten();
                    before
                        .into_iter()
                        .any(|need| need.quantity == quantity && need.trips())
                };
                let new = all.iter().filter(|need| {
                    depends_on_pace(need.quantity)
                        && need.trips()
                        && self.holds(need)
                        && !trips_anyway(need.quantity)
                });
                findings.extend(new.map(|need| {
                    let (value, _) = need.needed.farther_from(need.trip, need.warn);
                    let unit = need.quantity.unit();
                    Finding::warning(
                        place(loaded, index, axis, need.quantity, "trip"),
                        format!(
                            "an operator's hold at {} s needs a {} of {} on axis {} of `{}`, and would trip",
                            short(self.at),
                            need.quantity.words(),
                            quantity(value, unit),
                            axis + 1,
                            needs.name,
                        ),
                    )
                    .label(allowed(need.trip, unit))
                    .help(
                        "found on the simulated clock, where the test is fastest; with more ticks per step, a longer \
                         `ease_s` or a wider limit the specimen could be held there",
                    )
                }));
            }
        }
        findings
    }
}

/// A warning for each axis whose dead sensors would be noticed only after more travel than the test has in all.
fn deaf(loaded: &Loaded, needs: &Needs, specimen: usize) -> Vec<Finding> {
    let table = loaded.file.specimen.get(specimen);
    let limits = table.map(|table| table.limits_of(needs.found.len()));
    let axes = needs.found.iter().zip(limits.into_iter().flatten());
    let deaf = axes.enumerate().filter_map(|(axis, (found, limits))| {
        let travel = limits.stuck_travel_m;
        let goes = found.travel;
        (limits.has(Limit::StuckSensor) && goes > 0.0 && travel > goes).then(|| {
            let text = format!(
                "dead sensors on axis {} of `{}` would be noticed only after {} of travel, and its commands go {} in all",
                axis + 1,
                needs.name,
                quantity(travel, "m"),
                quantity(goes, "m")
            );
            let at = limit(loaded, specimen, axis, "stuck_travel_m");
            Finding::warning(at, text).help("found on the simulated clock")
        })
    });
    deaf.collect()
}

/// Beyond this condition number the actuators hold their platform badly: their error is twenty times as large in its weakest
/// direction as in its strongest.
const WEAK: f64 = 20.0;

/// A warning where the platform comes near to where its actuators cannot hold it.
fn nearly_singular(needs: &Needs, specimen: usize) -> Option<Finding> {
    let Poses {
        condition: [at_rest, worst],
        worst: pose,
        ..
    } = needs.poses.as_ref()?;
    (*worst > WEAK).then(|| {
        let at = KeyPath::root().key("specimen").index(specimen);
        Finding::warning(
            at.key("geometry"),
            format!(
                "`{}` comes near a singular pose: condition {worst:.1} at {pose}, {at_rest:.1} at the reference pose",
                needs.name
            ),
        )
        .at_key()
        .label("1 would be best")
        .help("there small errors of the actuators are large ones of the platform")
    })
}

/// A warning where the actuator–specimen iteration did not converge.
fn unsettled(loaded: &Loaded, needs: &Needs, specimen: usize) -> Option<Finding> {
    (needs.unsettled > 0).then(|| {
        let at = KeyPath::root().key("specimen").index(specimen);
        let keys = ["transfer", "identified"];
        let place = keys.iter().map(|key| at.key(key));
        let place = place.into_iter().find(|at| loaded.locator.holds(at));
        Finding::warning(
            place.unwrap_or(at),
            format!(
                "the iteration of the servo-hydraulic actuator and the law of `{}` did not converge in {} ticks of the test",
                needs.name, needs.unsettled
            ),
        )
        .at_key()
        .label("what is measured then is not exact")
        .help("a tick is too long for a law that bends so sharply: `time.ticks_per_step` makes it finer")
    })
}

/// A need that is beyond a level, in words.
fn finding(need: &Need, needs: &Needs, axis: usize, at: KeyPath) -> Option<Finding> {
    let (value, time) = need.needed.farther_from(need.trip, need.warn);
    let unit = need.quantity.unit();
    let text = format!(
        "the test needs a {} of {} on axis {} of `{}`, at {} s",
        need.quantity.words(),
        quantity(value, unit),
        axis + 1,
        needs.name,
        short(time),
    );
    let stated = |finding: Finding, [low, high]: [f64; 2]| {
        let limit = if value.is_sign_negative() && low.is_finite() {
            low
        } else {
            high
        };
        finding
            .number("needed", value)
            .number("limit", limit)
            .number("at_s", time)
    };
    let (finding, levels) = if need.trips() {
        let text = format!("{text}, and would trip");
        (Finding::error(at, text), need.trip)
    } else if need.warns() {
        let text = format!("{text}, beyond the level of the warning");
        (Finding::warning(at, text), need.warn)
    } else {
        return None;
    };
    let words = needs.stand_in.words();
    let help =
        format!("found in a rehearsal on the simulated clock; the specimen is replaced by {words}");
    Some(
        stated(finding, levels)
            .label(allowed(levels, unit))
            .help(help),
    )
}

/// Place of a limit: with its axis, or with the whole specimen. Levels are merged: the level decides, and not the
/// limit.
fn place(loaded: &Loaded, specimen: usize, axis: usize, quantity: Limit, level: &str) -> KeyPath {
    let common = KeyPath::root()
        .key("specimen")
        .index(specimen)
        .key("limits");
    let common = common.key(quantity.key());
    let own = limit(loaded, specimen, axis, quantity.key());
    let holds = |at: &KeyPath| loaded.locator.holds(&at.key(level));
    if !holds(&own) && holds(&common) {
        common
    } else {
        own
    }
}

/// Place of a key of the limits of an axis: its own, or that of its specimen.
fn limit(loaded: &Loaded, specimen: usize, axis: usize, key: &'static str) -> KeyPath {
    let at = KeyPath::root().key("specimen").index(specimen);
    let own = at.key("axis").index(axis).key("limits").key(key);
    if loaded.locator.holds(&own) {
        own
    } else {
        at.key("limits").key(key)
    }
}

fn allowed([low, high]: [f64; 2], unit: &str) -> String {
    match (low.is_finite(), high.is_finite()) {
        (true, true) => format!("{} to {}", quantity(low, unit), quantity(high, unit)),
        (true, false) => format!("at least {}", quantity(low, unit)),
        _ => format!("at most {}", quantity(high, unit)),
    }
}

/// Four digits are enough to compare with a limit.
pub(super) fn short(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e6).contains(&size) {
        return format!("{value:.3e}");
    }
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text.is_empty() || text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::rehearsal::{Budget, StandIn, rehearse};

    const STOREY: &str = "[time]\nrate_hz = 200\nduration_s = 0.5\nclock = \"simulated\"\n[structure.shear_building]\n\
        mass_kg = [1e3]\nstiffness_n_per_m = [0]\n[excitation.ground_acceleration.signal.sine]\namplitude = 3.0\n\
        frequency_hz = 2.0\n[[specimen]]\nname = \"storey\"\nstorey = 1\nlaw.linear.stiffness_n_per_m = 5e5\n";

    #[test]
    fn costly_rehearsal_states_its_progress() {
        let loaded = gusset_config::parse(Path::new("test.toml"), STOREY.to_owned(), &[]).unwrap();
        let built = gusset_setup::build(&loaded).unwrap();
        let mut budget = Budget::new(64 * 20);
        let found = rehearse(&loaded, Some(built.experiment), &mut budget).unwrap();
        assert!(found.is_out_of_budget());
        assert_eq!(found.specimens[0].stand_in, StandIn::Itself);
        // 64 DOFs count for a tick at least: 20 ticks of 101 are left.
        assert!(found.time > 0.0 && found.time < 0.4, "{}", found.time);
        assert_eq!(found.findings(&loaded), []);
        let beyond = found.beyond_budget().unwrap();
        assert_eq!(beyond.numbers, [("rehearsed_s", found.time)]);
    }
}
