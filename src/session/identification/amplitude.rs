//! How far an axis is driven: as requested if the limits allow it, else a share of the range that they allow.

use super::{IdentificationError, refusal};
use gusset_config::{LimitsSpec, RangeSpec, SpecimenTable};
use gusset_motion::identify::{Band, Course};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::units::{compared, number, quantity};

/// Default share of the remaining stroke, and of every other limit, that a motion uses.
const OF_STROKE: f64 = 0.05;
const OF_REST: f64 = 0.5;

/// A limit that a motion meets, and the largest amplitude within it.
struct Room {
    key: &'static str,
    warn: f64,
    trip: f64,
    /// Need of the motion at a metre of amplitude.
    need: f64,
    unit: &'static str,
}

/// Amplitude of an axis, and its reason.
pub(super) fn amplitude(
    asked: Option<f64>,
    table: &SpecimenTable,
    axis: usize,
    limits: &LimitsSpec,
    course: &Course,
    band: Band,
    tick: f64,
) -> Result<(f64, String), IdentificationError> {
    let zero = table.axis.get(axis).map_or(0.0, |axis| axis.offset_m);
    let demand = course.demand;
    let room = |key, (warn, trip): (f64, f64), need, unit| Room {
        key,
        warn,
        trip,
        need,
        unit,
    };
    let of_range = |limit: Limit| {
        let ways = ways(limits.get(limit), zero);
        room(limit.key(), ways, 1.0, "m")
    };
    let of_size = |limit: Limit, need, unit| {
        let [warn, trip] = limits.size(limit).unwrap_or_default().levels();
        room(limit.key(), (warn, trip), need, unit)
    };
    let rooms = [
        of_range(Limit::CommandDisp),
        of_range(Limit::MeasuredDisp),
        room("length_m", (f64::INFINITY, length(table, axis)), 1.0, "m"),
        of_size(Limit::CommandVel, demand.vel, "m/s"),
        of_size(Limit::CommandStep, demand.vel * tick, "m"),
        of_size(Limit::CommandAccel, demand.accel, "m/s²"),
    ];
    let what = if table.geometry.is_some() {
        "actuator"
    } else {
        "axis"
    };
    let place = format!("specimen \"{}\" {what} {}", table.name, axis + 1);
    let Some(asked) = asked else {
        return of_itself(&place, &rooms);
    };
    let positive = asked > 0.0 && asked.is_finite();
    if !positive {
        return Err(refusal(format!(
            "--amplitude is {asked}, but must be greater than 0 m"
        )));
    }
    let tightest = rooms
        .iter()
        .min_by(|a, b| (a.trip / a.need).total_cmp(&(b.trip / b.need)));
    match tightest {
        Some(room) if asked * room.need > room.trip => {
            let largest = rounded_down(room.trip / room.need);
            let [needed, allowed] = compared(asked * room.need, room.trip, room.unit);
            let narrower = match room.key {
                "command_vel_m_per_s" | "command_step_m" => Some(room.trip / (asked * room.need)),
                "command_accel_m_per_s2" => Some((room.trip / (asked * room.need)).sqrt()),
                _ => None,
            };
            // Velocity grows with the frequency, acceleration with its square.
            let narrower = narrower.map(|share| share * band.to_hz);
            let or = narrower
                .filter(|hz| *hz > band.from_hz)
                .map_or_else(String::new, |hz| {
                    format!(", or a band up to about {} Hz", number(hz))
                });
            Err(refusal(format!(
                "{place}: an amplitude of {} needs {needed} of `{}`, allowed is {allowed}; largest amplitude for this motion: {} \
                 (`--amplitude {}`){or}",
                quantity(asked, "m"),
                room.key,
                quantity(largest, "m"),
                number(largest)
            )))
        }
        _ => Ok((asked, "as asked for".to_owned())),
    }
}

/// The amplitude where none was asked for.
fn of_itself(place: &str, rooms: &[Room]) -> Result<(f64, String), IdentificationError> {
    let stroke = rooms
        .iter()
        .filter(|room| room.unit == "m" && room.need == 1.0);
    let stroke = stroke.map(|room| room.warn.min(room.trip));
    let stroke = stroke.fold(f64::INFINITY, f64::min);
    let is_known = stroke > 0.0 && stroke.is_finite();
    if !is_known {
        return Err(refusal(format!(
            "{place} has no `command_disp_m` in its limits that leaves it a way, and no `length_m`, so there is nothing to take an amplitude from: \
             give --amplitude"
        )));
    }
    let mut found = (OF_STROKE * stroke, "5 % of the stroke".to_owned());
    for room in rooms {
        let share = OF_REST * room.warn.min(room.trip) / room.need;
        if share < found.0 {
            found = (share, format!("half of what `{}` allows", room.key));
        }
    }
    Ok(found)
}

/// Stroke of a range on either side of the axis's position at zero deformation.
fn ways(spec: Option<RangeSpec>, zero: f64) -> (f64, f64) {
    let spec = spec.unwrap_or_default();
    let way = |range: Option<[f64; 2]>| {
        range.map_or(f64::INFINITY, |[low, high]| (high - zero).min(zero - low))
    };
    (way(spec.warn), way(spec.trip))
}

/// Stroke in either direction in m, in the axis's unit, that the length of an actuator allows.
fn length(table: &SpecimenTable, axis: usize) -> f64 {
    let geometry = table.geometry.as_ref();
    let Some(geometry) = geometry.and_then(|spec| spec.build(1.0).ok()) else {
        return f64::INFINITY;
    };
    let [least, most] = geometry.stroke_range(axis);
    let scale = table.axis.get(axis).map_or(1.0, |axis| axis.scale);
    scale * most.min(-least)
}

/// Two digits of a number, rounded down.
pub(super) fn rounded_down(value: f64) -> f64 {
    let unit = libm::pow(10.0, libm::floor(libm::log10(value)) - 1.0);
    // A power of ten that is a hair too large must not take a digit away.
    (value / unit * (1.0 + 1e-12)).floor() * unit
}
