//! Limits of a test, who checks them and what they cause: for the person responsible for the specimens.

mod specimen;

use gusset_config::{ClockChoice, ExitChoice, TestFile, Time};
use gusset_control::engine::{Limits, OnMiss};
use gusset_control::port::Port;
use gusset_control::port::limits::Bound;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::units::duration;
use gusset_record::summary::{LimitFact, LimitFacts};

fn sizes(values: &[f64]) -> Vec<f64> {
    // A missing limit is an infinite one; half a range is shown whole.
    if values.iter().any(|value| value.is_finite()) {
        values.to_vec()
    } else {
        Vec::new()
    }
}

fn of_test(quantity: Limit, bound: Bound, judged: Option<String>) -> LimitFact {
    LimitFact {
        key: quantity.key().to_owned(),
        unit: quantity.unit().to_owned(),
        warn: sizes(&[bound.warn]),
        trip: sizes(&[bound.trip]),
        also_at_the_specimen: false,
        judged,
    }
}

/// Effect of a choice on the specimens.
fn way_out(choice: ExitChoice, speed: Option<f64>) -> String {
    let speed = speed.unwrap_or_default();
    let led = |to: &str| {
        format!(
            "every specimen moves to {to}, at {speed} m/s at most (while directions and zeros are being found it stays; one that \
             is lost, silent or saturated, or whose interlock is open, is left to its own end; a further limit that trips on \
             the way leaves all where they are)"
        )
    };
    match choice {
        ExitChoice::Freeze => "every specimen holds its last command".to_owned(),
        ExitChoice::ZeroForce => format!(
            "{}, in 120 s or three times what that way takes; one whose `sensor_force_n` tripped stays, or whose force has jumped \
             beyond `force_step_n` and not come back: no force is known to go by; one whose force does not follow is led no further",
            led("where its forces are small")
        ),
        ExitChoice::ZeroDisplacement => led("zero deformation"),
        ExitChoice::SafeDisplacement => led("its `safe_disp_m`"),
    }
}

/// How the specimens reach the start of the test, and come to rest.
fn way_in(file: &TestFile, time: &Time) -> String {
    if file.specimen.is_empty() {
        return "nothing is moved".to_owned();
    }
    let period = time.period.value();
    let opening = super::safety::opening(file, period);
    let zero = f64::from(opening.zero_ticks) * period;
    let zeroed = if opening.zero_ticks == 0 {
        "the sensors are not read before the first command".to_owned()
    } else {
        let confirmed = if opening.confirm {
            " and the operator confirms the readings"
        } else {
            ""
        };
        format!(
            "the specimens hold for {} while every sensor is read{confirmed}",
            duration(zero)
        )
    };
    format!(
        "{zeroed};\nthen a ramp of {} s or longer, at half of a velocity limit at most;\nafter a `hold` the specimens come to rest in {} s",
        opening.ramp_s, file.safety.ease_s
    )
}

/// Effect of a late tick.
fn on_miss(file: &TestFile, limits: &Limits, is_real: bool) -> String {
    let text = match limits.on_miss {
        _ if !is_real => return "none: the simulated clock has no late ticks".to_owned(),
        OnMiss::Stretch => {
            "the grid moves by whole ticks: the specimens see slower time and never a burst of commands".to_owned()
        }
        OnMiss::CatchUp { at_most } => {
            format!("up to {at_most} missed ticks run back to back, beyond it the grid moves")
        }
        OnMiss::Stop => "a tick that is late by less than a period does not move the next one".to_owned(),
    };
    if file.timing.require_realtime {
        format!("{text};\nthe test does not start without all real-time settings (exit code 4)")
    } else {
        text
    }
}

/// All of them.
pub(super) fn facts(
    file: &TestFile,
    time: &Time,
    ports: &[Port],
    limits: &Limits,
    columns: &[Limit],
) -> LimitFacts {
    let is_real = time.clock == ClockChoice::Real;
    let warm_up = format!(
        "not counted in the {} ticks of the warm-up; the test starts only if the second half of the warm-up keeps the limits",
        limits.warmup_ticks
    );
    let mut test = Vec::new();
    for quantity in Limit::OF_TEST {
        let judged = match (quantity, file.safety.added_energy_share) {
            _ if quantity.is_of_misses() && !is_real => {
                Some("not checked: the simulated clock misses no deadlines".to_owned())
            }
            (Limit::MissesInWindow, _) => {
                Some(format!("in {} s, {warm_up}", file.timing.misses.window_s))
            }
            (Limit::AddedEnergyShare, Some(share)) => Some(format!(
                "{} J count as taken in from the start",
                share.floor_j
            )),
            _ => quantity.is_of_misses().then(|| warm_up.clone()),
        };
        if quantity.is_of_misses() || columns.contains(&quantity) {
            test.push(of_test(quantity, limits.test.of_test(quantity), judged));
        }
    }
    if limits.divergence < f64::MAX {
        test.push(LimitFact {
            key: "divergence_m".to_owned(),
            unit: "m".to_owned(),
            warn: Vec::new(),
            trip: vec![limits.divergence],
            also_at_the_specimen: false,
            judged: Some("every DOF of the structure".to_owned()),
        });
    }
    let mut always =
        vec!["a command, measurement or response that is not a finite number".to_owned()];
    if file.specimen.iter().any(|table| table.link.is_some()) {
        always.push(
            "an open interlock or emergency stop of a specimen, even if it closes again".to_owned(),
        );
        always.push(
            "a sensor or actuator that the specimen's server reports as saturated; a failed link"
                .to_owned(),
        );
    }
    if file.specimen.iter().any(|table| table.geometry.is_some()) {
        always.push("a pose that the actuators of a loading unit cannot take".to_owned());
    }
    if limits.on_miss == OnMiss::Stop {
        always.push("a tick that is late by a whole period".to_owned());
    }
    let safety = &file.safety;
    LimitFacts {
        specimens: file
            .specimen
            .iter()
            .zip(ports)
            .map(|(table, port)| specimen::of_specimen(table, port, time))
            .collect(),
        test,
        always,
        on_trip: format!(
            "{}, and the test ends; exit code 1, or 3 for a failed link",
            way_out(safety.on_trip, safety.exit_speed_m_per_s)
        ),
        at_end: format!(
            "{};\nalso when the operator stops the test",
            way_out(safety.at_end, safety.exit_speed_m_per_s)
        ),
        way_in: way_in(file, time),
        on_miss: on_miss(file, limits, is_real),
        unlimited: safety.unlimited.clone(),
    }
}
