//! Limits that a controller announces in the handshake of our own protocol, and how the specimen's end uses them.
//!
//! A controller never sends a command beyond the announced limits, because its loop judges every command before it leaves.
//! So a command beyond them is a fault, and the specimen's end holds. The controller judges forces first, because it may
//! return the specimen; the specimen's end acts if that has failed.

use gusset_control::port::limits::{AxisLimits, Bound, Range};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::units::AxisUnits;
use gusset_wire::handshake::{Axis, Limits, Unit};

/// Relative slack that the specimen's end adds to an announced bound of commands, for the rounding of units.
const ROUNDING: f64 = 1e-9;
/// Factor on an announced force limit, so that the controller can react first.
const LAST_RESORT: f64 = 1.25;

/// The units of an axis on the wire.
#[must_use]
pub(crate) fn units_of(axis: &Axis) -> AxisUnits {
    let si = |unit| match unit {
        Unit::Millimetre => 1e-3,
        Unit::Kilonewton | Unit::KilonewtonMetre => 1e3,
        Unit::Metre | Unit::Radian | Unit::Newton | Unit::NewtonMetre => 1.0,
    };
    AxisUnits {
        metres: si(axis.disp_unit),
        newtons: si(axis.force_unit),
        disp: axis.disp_unit.symbol(),
        force: axis.force_unit.symbol(),
    }
}

/// The trip levels of an axis as sent on the wire, in its units. `tick_s` is the shortest wall time from one command to the
/// next, if it is known: a bound of the change of the command in that time bounds its speed.
#[must_use]
pub fn announce(limits: &AxisLimits, units: &AxisUnits, tick_s: Option<f64>) -> Limits {
    let by_step = tick_s.map_or(f64::INFINITY, |tick_s| {
        limits.size(Limit::CommandStep).trip / tick_s
    });
    let [low, high] = limits.get(Limit::CommandDisp).trip;
    let [pull, push] = limits.get(Limit::MeasuredForce).trip;
    Limits {
        disp_min: low / units.metres,
        disp_max: high / units.metres,
        speed_max: limits.size(Limit::CommandVel).trip.min(by_step) / units.metres,
        force_max: pull.abs().max(push.abs()) / units.newtons,
    }
}

/// The limits that the specimen's end keeps of those announced, SI.
#[must_use]
pub(crate) fn kept(limits: &Limits, units: &AxisUnits) -> AxisLimits {
    let width = limits.disp_max - limits.disp_min;
    let slack = if width.is_finite() {
        ROUNDING * width
    } else {
        ROUNDING * limits.disp_min.abs().min(limits.disp_max.abs())
    };
    let slack = if slack.is_finite() { slack } else { 0.0 };
    let force = LAST_RESORT * limits.force_max * units.newtons;
    let disp = [
        (limits.disp_min - slack) * units.metres,
        (limits.disp_max + slack) * units.metres,
    ];
    let speed = limits.speed_max * (1.0 + ROUNDING) * units.metres;
    AxisLimits::NONE
        .with(Limit::CommandDisp, Range::trip(disp))
        .with(Limit::CommandVel, Bound::trip(speed))
        .with(Limit::MeasuredForce, Range::trip([-force, force]))
}

/// The narrower of two bounds on every side.
#[must_use]
pub fn narrower(one: &Limits, other: &Limits) -> Limits {
    Limits {
        disp_min: one.disp_min.max(other.disp_min),
        disp_max: one.disp_max.min(other.disp_max),
        speed_max: one.speed_max.min(other.speed_max),
        force_max: one.force_max.min(other.force_max),
    }
}

/// Limits of the specimen's end that the test does not know, in words; `None` if it knows all.
#[must_use]
pub(crate) fn unknown_to_us(ours: &Limits, theirs: &Limits, units: &AxisUnits) -> Option<String> {
    let AxisUnits { disp, force, .. } = units;
    let sides = [
        (
            "displacement from",
            ours.disp_min,
            theirs.disp_min,
            *disp,
            "",
        ),
        ("displacement to", ours.disp_max, theirs.disp_max, *disp, ""),
        ("speed to", ours.speed_max, theirs.speed_max, *disp, "/s"),
        ("force to", ours.force_max, theirs.force_max, *force, ""),
    ];
    let kept: Vec<String> = sides
        .iter()
        .filter(|(_, ours, theirs, ..)| ours.is_infinite() && theirs.is_finite())
        .map(|(what, _, theirs, unit, per)| format!("{what} {theirs} {unit}{per}"))
        .collect();
    (!kept.is_empty()).then(|| kept.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_control::port::limits::Watch;
    use gusset_quantity::frame::AtSpecimen;

    const MM_KN: AxisUnits = AxisUnits {
        metres: 1e-3,
        newtons: 1e3,
        disp: "mm",
        force: "kN",
    };

    fn limits() -> AxisLimits {
        AxisLimits::NONE
            .with(Limit::CommandDisp, Range::trip([-0.05, 0.07]))
            .with(Limit::CommandVel, Bound::trip(0.3))
            .with(Limit::MeasuredForce, Range::trip([-90e3, 120e3]))
    }

    #[test]
    fn trip_levels_are_announced_in_axis_units() {
        let wire = announce(&limits(), &MM_KN, None);
        assert!((wire.disp_min + 50.0).abs() < 1e-12 && (wire.disp_max - 70.0).abs() < 1e-12);
        assert!((wire.speed_max - 300.0).abs() < 1e-12);
        assert!((wire.force_max - 120.0).abs() < 1e-12, "the larger side");
        assert_eq!(announce(&AxisLimits::NONE, &MM_KN, None), Limits::NONE);
    }

    #[test]
    fn step_bound_is_announced_as_a_speed() {
        let speed_max = |step: f64, vel: f64| {
            let limits = AxisLimits::NONE
                .with(Limit::CommandStep, Bound::trip(step))
                .with(Limit::CommandVel, Bound::trip(vel));
            announce(&limits, &MM_KN, Some(0.01)).speed_max
        };
        assert_eq!(speed_max(1e-3, f64::INFINITY), 100.0);
        assert_eq!(speed_max(1e-3, 0.05), 50.0);
        assert_eq!(speed_max(1e-3, 0.2), 100.0);
        assert_eq!(speed_max(f64::INFINITY, 0.2), 200.0);
        assert_eq!(speed_max(f64::INFINITY, f64::INFINITY), f64::INFINITY);
    }

    #[test]
    fn announced_bounds_pass_allowed_commands() {
        let kept = kept(&announce(&limits(), &MM_KN, None), &MM_KN);
        let tripped = |disp: f64, force: f64| {
            let mut watch = Watch::new(vec![kept], 1.0);
            let command = watch
                .command(std::iter::once(AtSpecimen(disp)))
                .trip
                .is_some();
            let measured = watch
                .measured(std::iter::once(AtSpecimen((disp, force))))
                .trip
                .is_some();
            (command, measured)
        };
        assert_eq!(tripped(0.07, 149e3), (false, false));
        assert_eq!(tripped(-0.05, -149e3), (false, false));
        assert_eq!(tripped(0.070_001, 0.0), (true, false));
        assert_eq!(tripped(-0.050_001, 151e3), (true, true));
        // 1 s from one command to the next.
        let mut watch = Watch::new(vec![kept.with(Limit::CommandDisp, Range::NONE)], 1.0);
        watch.stands_at(std::iter::once(AtSpecimen(0.0)));
        assert_eq!(watch.command(std::iter::once(AtSpecimen(0.3))).trip, None);
        assert!(
            watch
                .command(std::iter::once(AtSpecimen(0.300_001)))
                .trip
                .is_some()
        );
    }

    #[test]
    fn limit_known_only_there_is_reported() {
        let theirs = announce(&limits(), &MM_KN, None);
        let said = unknown_to_us(&Limits::NONE, &theirs, &MM_KN).unwrap();
        assert_eq!(
            said,
            "displacement from -50 mm, displacement to 70 mm, speed to 300 mm/s, force to 120 kN"
        );
        assert_eq!(unknown_to_us(&theirs, &theirs, &MM_KN), None);
        assert_eq!(unknown_to_us(&theirs, &Limits::NONE, &MM_KN), None);
    }
}
