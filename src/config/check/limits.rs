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
    check_settings(specimen, at, findings);
    let before = findings.list.len();
    let mut judge = |limits: &Option<LimitsSpec>, at: KeyPath| {
        if let Some(Err(error)) = limits.as_ref().map(LimitsSpec::check) {
            let finding = Finding::error(at.key(error.key), error.to_string());
            findings.push(finding);
        }
    };
    judge(&specimen.limits, at.key("limits"));
    for (index, axis) in specimen.axis.iter().enumerate() {
        judge(&axis.limits, at.key("axis").index(index).key("limits"));
    }
    // Invalid limits are not compared.
    if findings.list.len() > before {
        return;
    }
    check_merged(specimen, at, findings);
    if findings.list.len() > before {
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

/// Numbers that only affect the judgement of a bound, without that bound.
fn check_settings(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    let merged = specimen.limits_of(specimen.axes().max(specimen.axis.len()));
    let mut check = |limits: &LimitsSpec, bounds: &[LimitsSpec], at: &KeyPath| {
        for limit in Limit::OF_AXIS {
            if let Some((setting, _)) = limits.setting(limit)
                && !bounds.iter().any(|axis| axis.has(limit))
            {
                let why = format!("only with a limit `{}`", limit.key());
                findings.no_effect(at, setting.key, &why);
            }
        }
    };
    if let Some(all) = &specimen.limits {
        check(all, &merged, &at.key("limits"));
    }
    for (index, axis) in specimen.axis.iter().enumerate() {
        if let (Some(own), Some(merged)) = (&axis.limits, merged.get(index)) {
            let at = at.key("axis").index(index).key("limits");
            check(own, std::slice::from_ref(merged), &at);
        }
    }
}

/// A level of an axis and the other one of its specimen may contradict each other.
fn check_merged(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    let merged = specimen.limits_of(specimen.axis.len());
    for (index, (axis, merged)) in specimen.axis.iter().zip(merged).enumerate() {
        if let (Some(_), Err(error)) = (&axis.limits, merged.check()) {
            let own = at.key("axis").index(index).key("limits").key(error.key);
            let all = at.key("limits").key(error.key);
            let finding = Finding::error(own, error.to_string())
                .beside(all, "the specimen gives the other level")
                .help("give both `warn` and `trip` at the axis");
            findings.push(finding);
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
            findings.push(
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
                findings.push(
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
        let leaves = [safety.on_trip, safety.at_end] != [ExitChoice::Freeze; 2];
        let Some(speed) = safety.exit_speed_m_per_s.filter(|_| leaves) else {
            return;
        };
        let name = &self.specimen.name;
        let mut refuse = |why: String, label: &str, (place, words): (KeyPath, &str)| {
            let exit = KeyPath::root().under("safety.exit_speed_m_per_s");
            let text =
                format!("specimen \"{name}\" would move to its end position at {speed} m/s, {why}");
            let finding = Finding::error(exit, text).label(label);
            findings.push(finding.beside(place, words));
        };
        let (of_limit, its_limit) = ("faster than its limit", "its limit");
        if let (Some(step), Some(tick_s)) = (limits.trip_size(Limit::CommandStep), tick_s)
            && speed * tick_s > SAME * step
        {
            let way = speed * tick_s;
            let why = format!("{way} m in a tick of {tick_s} s, but {step} m trip");
            refuse(why, of_limit, (self.of(Limit::CommandStep), its_limit));
        }
        if let Some(vel) = limits.trip_size(Limit::CommandVel)
            && speed > vel
        {
            let why = format!("but {vel} m/s trip");
            refuse(why, of_limit, (self.of(Limit::CommandVel), its_limit));
        }
        let most = self.specimen.capacity.unwrap_or_default().velocity_m_per_s;
        if let Some(most) = most
            && speed > SAME * most
        {
            let place = self.at.under("capacity.velocity_m_per_s");
            let why = format!("but its rig reaches only {most} m/s");
            refuse(why, "faster than the rig", (place, "what it can give"));
        }
    }

    /// The start and the safe position are within the allowed commands and the capacity of the rig, and so is the wiring check.
    fn check_places(&self, limits: &LimitsSpec, findings: &mut Findings) {
        let range = limits.trip(Limit::CommandDisp).map(|range| {
            let why = "which is outside the allowed commands";
            (range, self.of(Limit::CommandDisp), why, "its limit")
        });
        let stroke = self.specimen.capacity.unwrap_or_default().stroke_m;
        let stroke = stroke.map(|stroke| {
            let at = self.at.under("capacity.stroke_m");
            let why = "which its rig cannot reach";
            ([-stroke, stroke], at, why, "what it can give")
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
                findings.push(
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
            findings.push(
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
        findings.push(
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
        findings.push(match unlimited {
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
        findings.push(
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
