//! Limits of the specimens: bounds that cannot be kept, that contradict each other, or that a specimen behind a link lacks; and
//! motions and places of the file beyond the limits or the capacity of the rig.

use super::Findings;
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::limit_table::LimitsSpec;
use crate::safety::{ExitChoice, SafetyTable};
use crate::specimen::SpecimenTable;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::text::is_reason;

/// A range, the place of its key, why a position outside it is impossible, and its label.
type PlaceBound = ([f64; 2], KeyPath, &'static str, &'static str);

/// Equal bounds in different units may differ by rounding.
const SAME: f64 = 1.0 + 1e-9;
/// Stroke in m of the example that is shown where a specimen has no limits and its reach is not declared.
const EXAMPLE_STROKE_M: f64 = 0.05;

/// One specimen's bounds for themselves and against each other; `tick_s` is the wall time of one tick, if it is known.
pub(super) fn check_limits(
    specimen: &SpecimenTable,
    tick_s: Option<f64>,
    safety: Option<&SafetyTable>,
    at: &KeyPath,
    findings: &mut Findings,
) {
    let before = findings.0.len();
    let mut judge = |limits: &Option<LimitsSpec>, at: KeyPath| {
        if let Some(Err(error)) = limits.as_ref().map(LimitsSpec::check) {
            let finding = Finding::error(at.key(error.key()), error.to_string());
            findings.0.push(finding);
        }
    };
    judge(&specimen.limits, at.key("limits"));
    for (index, axis) in specimen.axis.iter().enumerate() {
        judge(&axis.limits, at.key("axis").index(index).key("limits"));
    }
    // Invalid limits are not compared.
    if findings.0.len() > before {
        return;
    }
    check_merged(specimen, at, findings);
    if findings.0.len() > before {
        return;
    }
    for (index, limits) in specimen.limits_of(specimen.axes()).iter().enumerate() {
        let axis = Place {
            specimen,
            at,
            index,
        };
        if let Some(tick_s) = tick_s {
            axis.check_speeds(limits, tick_s, findings);
        }
        axis.check_sensors(limits, findings);
        axis.check_places(limits, findings);
        if let Some(safety) = safety {
            axis.check_exit(limits, safety, tick_s, findings);
        }
    }
}

/// A level of an axis and the other one of its specimen may contradict each other.
fn check_merged(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    let merged = specimen.limits_of(specimen.axis.len());
    for (index, (axis, merged)) in specimen.axis.iter().zip(merged).enumerate() {
        if let (Some(_), Err(error)) = (&axis.limits, merged.check()) {
            let own = at.key("axis").index(index).key("limits").key(error.key());
            let all = at.key("limits").key(error.key());
            let finding = Finding::error(own, error.to_string())
                .beside(all, "the specimen gives the other level")
                .help("give both `warn` and `trip` at the axis");
            findings.0.push(finding);
        }
    }
}

/// One axis of a specimen in the file.
struct Place<'a> {
    specimen: &'a SpecimenTable,
    at: &'a KeyPath,
    index: usize,
}

impl Place<'_> {
    /// Place of the bound of the axis: in its own table, or in that of all axes.
    fn of(&self, limit: Limit) -> KeyPath {
        let key = limit.key();
        let own = self
            .specimen
            .axis
            .get(self.index)
            .and_then(|axis| axis.limits);
        if own.is_some_and(|own| own.has(limit)) {
            self.at.key("axis").index(self.index).key("limits").key(key)
        } else {
            self.at.key("limits").key(key)
        }
    }

    /// An increment per tick and a velocity are the same bound in other units.
    fn check_speeds(&self, limits: &LimitsSpec, tick_s: f64, findings: &mut Findings) {
        let vel = limits.trip_size(Limit::CommandVel);
        let step = limits.trip_size(Limit::CommandStep);
        if let (Some(vel), Some(step)) = (vel, step)
            && step > SAME * vel * tick_s
        {
            let there = self.of(Limit::CommandStep);
            let here = self.of(Limit::CommandVel);
            findings.0.push(
                Finding::error(
                    here,
                    format!(
                        "{vel} m/s are {} m in a tick of {tick_s} s, less than the {step} m that `command_step_m` allows",
                        vel * tick_s
                    ),
                )
                .label("this limit always trips first")
                .beside(there, "can never trip")
                .help("both limit the change of the command per tick: give only one of them"),
            );
        }
    }

    /// A sensor cannot measure beyond its range.
    fn check_sensors(&self, limits: &LimitsSpec, findings: &mut Findings) {
        let pairs = [
            (Limit::MeasuredDisp, Limit::SensorDisp),
            (Limit::MeasuredForce, Limit::SensorForce),
        ];
        for (measured, sensor) in pairs {
            let (Some([low, high]), Some([least, most])) =
                (limits.trip(measured), limits.trip(sensor))
            else {
                continue;
            };
            if low < least || high > most {
                findings.0.push(
                    Finding::error(
                        self.of(measured),
                        format!(
                            "`{}` is {low} to {high}, but the sensor measures only {least} to {most}",
                            measured.key()
                        ),
                    )
                    .label("the range of the sensor")
                    .beside(self.of(sensor), "its range"),
                );
            }
        }
    }

    /// The return move must not trip itself. Its acceleration follows from the limit itself.
    fn check_exit(
        &self,
        limits: &LimitsSpec,
        safety: &SafetyTable,
        tick_s: Option<f64>,
        findings: &mut Findings,
    ) {
        let moves = [safety.on_trip, safety.at_end]
            .iter()
            .any(|choice| *choice != ExitChoice::Freeze);
        let vel = limits.trip_size(Limit::CommandVel);
        let step = limits.trip_size(Limit::CommandStep);
        let exit = KeyPath::root().key("safety").key("exit_speed_m_per_s");
        if let (true, Some(speed), Some(step), Some(tick_s)) =
            (moves, safety.exit_speed_m_per_s, step, tick_s)
            && speed * tick_s > SAME * step
        {
            findings.0.push(
                Finding::error(
                    exit.clone(),
                    format!(
                        "specimen \"{}\" would move to its end position at {speed} m/s, {} m in a tick of {tick_s} s, but \
                         {step} m trip",
                        self.specimen.name,
                        speed * tick_s
                    ),
                )
                .label("faster than its limit")
                .beside(
                    self.of(Limit::CommandStep),
                    "its limit",
                ),
            );
        }
        if let (true, Some(speed), Some(vel)) = (moves, safety.exit_speed_m_per_s, vel)
            && speed > vel
        {
            findings.0.push(
                Finding::error(
                    exit.clone(),
                    format!(
                        "specimen \"{}\" would move to its end position at {speed} m/s, but {vel} m/s trip",
                        self.specimen.name
                    ),
                )
                .label("faster than its limit")
                .beside(
                    self.of(Limit::CommandVel),
                    "its limit",
                ),
            );
        }
        let most = self.specimen.capacity.unwrap_or_default().velocity_m_per_s;
        if let (true, Some(speed), Some(most)) = (moves, safety.exit_speed_m_per_s, most)
            && speed > SAME * most
        {
            let name = &self.specimen.name;
            let text = format!(
                "specimen \"{name}\" would move to its end position at {speed} m/s, but its rig reaches only {most} m/s"
            );
            findings.0.push(
                Finding::error(exit, text)
                    .label("faster than the rig")
                    .beside(
                        self.at.key("capacity").key("velocity_m_per_s"),
                        "what it can give",
                    ),
            );
        }
    }

    /// The start and the safe position are within the allowed commands and the capacity of the rig, and so is the wiring check.
    fn check_places(&self, limits: &LimitsSpec, findings: &mut Findings) {
        let range = limits.trip(Limit::CommandDisp);
        let range = range.map(|range| {
            let at = self.of(Limit::CommandDisp);
            (
                range,
                at,
                "which is outside the allowed commands",
                "its limit",
            )
        });
        let stroke = self.specimen.capacity.unwrap_or_default().stroke_m;
        let stroke = stroke.map(|stroke| {
            let at = self.at.key("capacity").key("stroke_m");
            (
                [-stroke, stroke],
                at,
                "which its rig cannot reach",
                "what it can give",
            )
        });
        let bounds: Vec<PlaceBound> = range.into_iter().chain(stroke).collect();
        let place = |given: Option<&Vec<f64>>| given?.get(self.index).copied();
        let link = self.specimen.link.as_ref();
        let stands = place(link.and_then(|link| link.stands_at_m.as_ref()));
        let at = self.at.key("link");
        let safe = place(self.specimen.safe_disp_m.as_ref());
        for (key, place, is) in [
            (self.at.key("safe_disp_m"), safe, "is safe"),
            (at.key("stands_at_m"), stands, "begins"),
        ] {
            let Some(place) = place else { continue };
            let beyond = |([low, high], ..): &&PlaceBound| !(place >= *low && place <= *high);
            if let Some((_, bound, why, label)) = bounds.iter().find(beyond) {
                let text = format!("axis {} {is} at {place} m, {why}", self.index + 1);
                findings.0.push(
                    Finding::error(key, text)
                        .label("outside its limit")
                        .beside(bound.clone(), *label),
                );
            }
        }
        self.check_wiring_check(stands, &bounds, findings);
    }

    /// The motion of the wiring check stays within the bounds.
    fn check_wiring_check(
        &self,
        stands: Option<f64>,
        bounds: &[PlaceBound],
        findings: &mut Findings,
    ) {
        let link = self.specimen.link.as_ref();
        let at = self.at.key("link");
        let Some(way) = link.and_then(|link| link.probe_m) else {
            return;
        };
        let backwards = self
            .specimen
            .axis
            .get(self.index)
            .is_some_and(|axis| axis.sign < 0);
        let room = |[low, high]: [f64; 2]| match stands {
            Some(stands) if backwards => stands - low,
            Some(stands) => high - stands,
            // Wherever it is.
            None => high - low,
        };
        if let Some((_, bound, _, label)) =
            bounds.iter().find(|(range, ..)| way > SAME * room(*range))
        {
            let text = format!(
                "the wiring check moves axis {} by {way} m, which its limits do not allow",
                self.index + 1
            );
            findings.0.push(
                Finding::error(at.key("probe_m"), text)
                    .label("outside its limit")
                    .beside(bound.clone(), *label),
            );
        }
    }
}

/// Minimum for a specimen behind a link: a bound of its commands and one of its forces, on every axis.
pub(super) fn check_required(
    specimens: &[SpecimenTable],
    unlimited: Option<&str>,
    findings: &mut Findings,
) {
    let why = KeyPath::root().key("safety").key("unlimited");
    if unlimited.is_some_and(|reason| !is_reason(reason)) {
        findings.0.push(
            Finding::error(why, "`unlimited` gives no reason")
                .label("a reason why the specimen may run without limits is needed")
                .help("the reason is shown at the start and written to the summary of the run"),
        );
        return;
    }
    let mut idle = true;
    for (index, specimen) in specimens.iter().enumerate() {
        let missing = missing_limits(specimen);
        if specimen.link.is_none() || missing.is_empty() {
            continue;
        }
        idle = false;
        let what = missing.join(", ");
        let name = &specimen.name;
        findings.0.push(match unlimited {
            Some(reason) => Finding::warning(
                why.clone(),
                format!(
                    "specimen \"{name}\" is UNLIMITED, without a trip level of {what}: {reason}"
                ),
            ),
            None => Finding::error(
                KeyPath::root().key("specimen").index(index).key("link"),
                format!("specimen \"{name}\" is behind a link and has no trip level of {what}"),
            )
            .label("commands leave this machine")
            .help(format!(
                "give limits for the stroke and the strength of the specimen, in m and N:\n{}",
                example(specimen)
            ))
            .help("or give the reason why limits are not needed: `unlimited = \"reason\"` in [safety]"),
        });
    }
    if idle && unlimited.is_some() {
        findings.0.push(
            Finding::warning(
                why,
                "`unlimited` has no effect: every specimen behind a link has limits",
            )
            .at_key(),
        );
    }
}

/// Limits that a specimen behind a link needs and that have no trip level, with their axis where the axes differ.
#[must_use]
pub fn missing_limits(specimen: &SpecimenTable) -> Vec<String> {
    let limits = specimen.limits_of(specimen.axes());
    let mut missing = Vec::new();
    for limit in [Limit::CommandDisp, Limit::MeasuredForce] {
        let key = limit.key();
        let without: Vec<usize> = (0..limits.len())
            .filter(|axis| limits[*axis].trip(limit).is_none())
            .collect();
        if without.len() == limits.len() {
            missing.push(format!("`{key}`"));
        } else {
            let axes = without
                .iter()
                .map(|axis| format!("`{key}` on axis {}", axis + 1));
            missing.extend(axes);
        }
    }
    missing
}

/// A table to start from.
fn example(specimen: &SpecimenTable) -> String {
    let scale = specimen.axis.first().map_or(1.0, |axis| axis.scale);
    let reach = specimen
        .reach_disp_m
        .map(|reach| reach * scale / specimen.similitude.length);
    let stroke = reach.unwrap_or(EXAMPLE_STROKE_M);
    let rows = specimen
        .stiffness_n_per_m
        .as_ref()
        .map(|matrix| matrix.rows());
    let stiffness = rows.and_then(|rows| rows.first()?.first().copied());
    let force = stiffness
        .map_or(100e3, |stiffness| stiffness * stroke)
        .max(1.0);
    format!(
        "[specimen.limits]\ncommand_disp_m = {{ trip = [-{stroke}, {stroke}] }}\nmeasured_force_n = {{ trip = [-{force}, {force}] }}"
    )
}
