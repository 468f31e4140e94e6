//! The limits of one specimen: bounded quantities, their judgement, the reactions of its end, and its end position.

use super::super::links;
use super::super::specimens::loading;
use gusset_config::{ClockChoice, LinkSpec, Protocol, SpecimenTable, StaleChoice, Time};
use gusset_control::port::limits::{AxisLimits, listed};
use gusset_control::port::{Port, WiringCheck};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::substructure::Coupling;
use gusset_quantity::units::{self, duration};
use gusset_record::summary::{LimitFact, SpecimenLimits};

/// All of them.
pub(super) fn of_specimen(table: &SpecimenTable, port: &Port, time: &Time) -> SpecimenLimits {
    let is_told = table
        .link
        .as_ref()
        .is_some_and(|link| link.protocol == Protocol::Gusset);
    let axes = port.guard().declared().iter().map(|axis| {
        let levels = axis.levels().map(|(quantity, levels)| {
            let [warn, trip] = [levels.warn, levels.trip].map(|ends| listed(quantity, ends));
            LimitFact {
                key: quantity.key().to_owned(),
                unit: quantity.unit().to_owned(),
                also_at_the_specimen: is_told && quantity.is_announced() && !trip.is_empty(),
                warn,
                trip,
                judged: if is_told {
                    announced(quantity, axis, time).or_else(|| judged(quantity, axis))
                } else {
                    judged(quantity, axis)
                },
            }
        });
        levels
            .filter(|limit| !(limit.warn.is_empty() && limit.trip.is_empty()))
            .collect()
    });
    let axes = axes.collect();
    let name = port.name().to_owned();
    let geometry = loading::facts(table);
    let safe_disp_m = table.safe_disp_m.clone();
    match &table.link {
        None => SpecimenLimits {
            name,
            geometry,
            checked_by: "this loop, before each command and after each reply".to_owned(),
            axes,
            stale: "not needed: this program simulates it".to_owned(),
            watchdog: None,
            ends: ends(table),
            direction: None,
            safe_disp_m,
        },
        Some(link) => {
            let far = if is_told {
                "; its server also checks the limits that the handshake announces (*)"
            } else {
                "; its protocol has no limits, so its server checks none of them"
            };
            SpecimenLimits {
                name,
                geometry,
                checked_by: format!("this loop, before each command and after each new reply{far}"),
                axes,
                stale: stale(link, port),
                watchdog: Some(watchdog(link, time)),
                ends: None,
                direction: Some(direction(link, port)),
                safe_disp_m,
            }
        }
    }
}

/// The announced form of a bound, where that is not the bound itself.
fn announced(quantity: Limit, axis: &AxisLimits, time: &Time) -> Option<String> {
    match quantity {
        Limit::CommandStep => {
            let speed = axis.size(Limit::CommandStep).trip / time.period.value();
            let speed = speed.min(axis.size(Limit::CommandVel).trip);
            (speed < f64::INFINITY)
                .then(|| format!("announced as a speed of {}", units::quantity(speed, "m/s")))
        }
        Limit::MeasuredForce => {
            let [low, high] = axis.get(Limit::MeasuredForce).trip;
            // The protocol has one number for both.
            let either = low.abs().max(high.abs());
            (low.is_finite() || high.is_finite())
                .then_some(either)
                .filter(|_| low != -high)
                .map(|either| format!("announced as {} either way", units::quantity(either, "N")))
        }
        _ => None,
    }
}

/// Other keys of the file for a bound.
fn judged(quantity: Limit, axis: &AxisLimits) -> Option<String> {
    let tangents = || "from motions beyond ten times the noise".to_owned();
    let over_time = || "over the last seconds of motion, after two periods of it".to_owned();
    match quantity {
        Limit::FollowingError => Some(if axis.following_time > 0.0 {
            format!(
                "at rest; in motion {} of it more",
                duration(axis.following_time)
            )
        } else {
            "at rest and in motion alike".to_owned()
        }),
        Limit::StuckSensor if axis.stuck_travel > 0.0 => Some(format!(
            "once the command has gone {}",
            units::quantity(axis.stuck_travel, "m")
        )),
        Limit::StiffnessRatio | Limit::DampingRatio => Some(tangents()),
        Limit::Lag | Limit::GainError => Some(over_time()),
        Limit::CommandVel | Limit::CommandAccel => Some("in wall time".to_owned()),
        _ => None,
    }
}

fn stale(link: &LinkSpec, port: &Port) -> String {
    let way = match link.on_stale {
        StaleChoice::Hold => "the last force is held",
        StaleChoice::Extrapolate => "the force is extrapolated with the estimated stiffness",
        StaleChoice::Stop => "the first one trips",
    };
    match link.on_stale {
        _ if port.exchange().coupling() == Coupling::Lockstep => format!(
            "not possible: the loop waits for each reply; after {} without a reply the link is lost",
            duration(link.reply_timeout_s)
        ),
        StaleChoice::Stop => way.to_owned(),
        StaleChoice::Hold | StaleChoice::Extrapolate => {
            let most = port.exchange().wait().map_or(0, |wait| wait.stale_in_a_row);
            format!("{way}; more than {most} in a row cause a trip")
        }
    }
}

fn watchdog(link: &LinkSpec, time: &Time) -> String {
    match link.protocol {
        Protocol::Gusset => {
            let after = links::watchdog_s(link, time.between_commands_s(link));
            let unwatched = match time.clock {
                ClockChoice::Real => "",
                ClockChoice::Simulated => " (by wall time, whatever the clock of the test)",
            };
            format!(
                "the specimen's server holds after {} without a command{unwatched}",
                duration(after)
            )
        }
        Protocol::Ethercat => format!(
            "each device with outputs leaves OP {} after the last exchange",
            duration(link.watchdog_s.unwrap_or_default())
        ),
        Protocol::OpenFresco | Protocol::OpenFrescoShadow | Protocol::OpenFrescoAdapter => {
            "none: this protocol has no watchdog, so nothing holds the specimen if this program stops sending"
                .to_owned()
        }
    }
}

fn direction(link: &LinkSpec, port: &Port) -> String {
    match (link.probe_m, port.startup().wiring()) {
        (Some(metres), direction) => {
            let way = match direction {
                WiringCheck::Probe { pace, .. } if pace.is_shortest() => {
                    format!("{} ticks", pace.ramp)
                }
                _ => duration(link.probe_ramp_s),
            };
            format!(
                "wiring check: each axis moves {} and back before the test, {way} each way; a specimen with wrong wiring is not armed",
                units::quantity(metres, "m")
            )
        }
        (None, WiringCheck::Settling(_)) => {
            "wiring check under the static load; a specimen with wrong wiring is not armed"
                .to_owned()
        }
        (None, _) => "no wiring check: set `probe_m`, or apply a static load".to_owned(),
    }
}

/// Where the actuator and the sensors of a law end.
fn ends(table: &SpecimenTable) -> Option<String> {
    let spec = table.own_transfer()?;
    let ends = [
        ("stroke", spec.stroke_m, "m"),
        ("force", spec.force_limit_n, "N"),
        ("displacement sensor", spec.disp_sensor.range_m, "m"),
        ("load cell", spec.force_sensor.range_n, "N"),
    ];
    let ends: Vec<String> = ends
        .iter()
        .filter_map(|(what, end, unit)| {
            Some(format!("{what} ± {}", units::quantity((*end)?, unit)))
        })
        .collect();
    if ends.is_empty() {
        return None;
    }
    Some(format!("{}; reaching one trips", ends.join(", ")))
}
