//! Which axes are driven, how, how far, and when: judged before anything moves.

use super::super::table::{duration, quantity};
use super::{IdentifyArgs, usage};
use crate::config::{Drive, Loaded, SpecimenTable, TestFile, nearest};
use crate::control::limits::{BoundSpec, LimitsSpec, RangeSpec};
use crate::identify::{Band, Course, Shape};

/// Rest before and after every motion, in s, and in ticks at least.
const REST_S: f64 = 1.0;
const REST_TICKS: u64 = 64;
/// Share of the stroke that is left, and of everything else that is allowed, that a motion takes unless it is told.
const OF_STROKE: f64 = 0.05;
const OF_REST: f64 = 0.5;
/// Band unless it is told, in Hz, and as a share of the ticks per second.
const FROM_HZ: f64 = 0.2;
const TO_HZ: f64 = 10.0;
const OF_RATE: f64 = 0.2;

/// One axis and its part of the run.
#[derive(Debug, Clone)]
pub(super) struct Driven {
    /// Specimen in the test file, from 0.
    pub specimen: usize,
    /// Specimen in the driven test, from 0.
    pub place: usize,
    pub name: String,
    /// From 0.
    pub axis: usize,
    /// Axes of its specimen.
    pub axes: usize,
    /// Largest displacement at the specimen, in m.
    pub amplitude: f64,
    /// Why it is that large.
    pub reason: String,
    /// First tick of its motion.
    pub start: u64,
}

/// The whole run.
#[derive(Debug)]
pub(super) struct Plan {
    pub band: Band,
    pub shape: Shape,
    pub tick: f64,
    /// Ticks of one motion, and of a rest.
    pub ticks: u64,
    pub rest: u64,
    pub axes: Vec<Driven>,
    /// Names of specimens that are not part of it.
    pub left_out: Vec<String>,
    /// The test that is run.
    pub file: TestFile,
}

/// A limit that a motion meets, and the largest amplitude within it.
struct Room {
    key: &'static str,
    warn: f64,
    trip: f64,
    /// What the motion needs of it at a metre of amplitude.
    need: f64,
    unit: &'static str,
}

impl Plan {
    /// What is asked for, if it is allowed. An amplitude that was not asked for is halved so often.
    pub fn of(args: &IdentifyArgs, loaded: &Loaded, halved: i32) -> anyhow::Result<Self> {
        let tick = loaded.time.tick();
        let band = match args.band.as_deref() {
            None => Band {
                from_hz: FROM_HZ,
                to_hz: TO_HZ.min(OF_RATE / tick),
            },
            Some([from_hz, to_hz]) => Band {
                from_hz: *from_hz,
                to_hz: *to_hz,
            },
            Some(other) => {
                let text = format!("--band takes two frequencies, found {}", other.len());
                return Err(usage(text));
            }
        };
        let shape = Shape::from(args.motion);
        let course = Course::new(shape, band, args.duration, args.seed, tick)
            .map_err(|error| usage(error.to_string()))?;
        let chosen = chosen(args, loaded)?;
        let ticks = (course.duration() / tick).ceil() as u64;
        let rest = ((REST_S / tick).ceil() as u64).max(REST_TICKS);
        let mut axes = Vec::new();
        for (place, specimen) in chosen.iter().copied().enumerate() {
            let Some(table) = loaded.file.specimen.get(specimen) else {
                continue;
            };
            let count = table.axes();
            for (axis, limits) in table.limits_of(count).iter().enumerate() {
                let (mut amplitude, mut reason) =
                    amplitude(args.amplitude, table, axis, limits, &course, band, tick)?;
                if halved > 0 {
                    amplitude *= 0.5_f64.powi(halved);
                    reason =
                        format!("{reason}, halved {halved} times for limits of what is measured");
                }
                if args.amplitude.is_none() {
                    amplitude = rounded_down(amplitude);
                }
                axes.push(Driven {
                    specimen,
                    place,
                    name: table.name.clone(),
                    axis,
                    axes: count,
                    amplitude,
                    reason,
                    start: rest + axes.len() as u64 * (ticks + rest),
                });
            }
        }
        let drives: Vec<Drive> = axes
            .iter()
            .map(|driven| {
                let table = loaded.file.specimen.get(driven.specimen);
                let gear = table.map_or(1.0, |table| gear(table, driven.axis).0);
                Drive {
                    specimen: driven.specimen,
                    axis: driven.axis,
                    motion: course.motion(driven.amplitude * gear, driven.start as f64 * tick),
                }
            })
            .collect();
        let total = rest + axes.len() as u64 * (ticks + rest);
        let title = match chosen.as_slice() {
            [one] => {
                let name = loaded.file.specimen.get(*one).map(|table| &table.name);
                format!("Identification of {}", name.map_or("", String::as_str))
            }
            _ => format!("Identification of {}", loaded.file.title),
        };
        let others = loaded.file.specimen.iter().enumerate();
        Ok(Self {
            band,
            shape,
            tick,
            ticks,
            rest,
            left_out: others
                .filter(|(index, _)| !chosen.contains(index))
                .map(|(_, table)| table.name.clone())
                .collect(),
            file: loaded.driven(&title, &drives, total),
            axes,
        })
    }

    /// What will be done, for whoever stands beside the rig.
    pub fn announced(&self, loaded: &Loaded) -> Vec<String> {
        let word = match self.shape {
            Shape::Sweep => "sweep",
            Shape::Noise => "noise",
            Shape::Steps => "steps",
        };
        let mut lines: Vec<String> = self
            .axes
            .iter()
            .map(|driven| {
                format!(
                    "specimen \"{}\" axis {}: {word} from {} Hz to {} Hz, {} either way ({}), {} at {:.6} Hz, with rests of {}",
                    driven.name,
                    driven.axis + 1,
                    self.band.from_hz,
                    self.band.to_hz,
                    quantity(driven.amplitude, "m"),
                    driven.reason,
                    duration(self.ticks as f64 * self.tick),
                    1.0 / self.tick,
                    duration(self.rest as f64 * self.tick),
                )
            })
            .collect();
        for name in &self.left_out {
            lines.push(format!(
                "specimen \"{name}\" is left out: neither connected nor moved"
            ));
        }
        let compensated = self.axes.iter().any(|driven| {
            let table = loaded.file.specimen.get(driven.specimen);
            driven.axis == 0 && table.is_some_and(|table| table.compensation.is_some())
        });
        if compensated {
            lines.push("compensation is left out: the actuator itself is identified".to_owned());
        }
        lines
    }

    /// First line of the test file that is run.
    pub fn said(&self, args: &IdentifyArgs) -> String {
        format!("Made by `gusset identify` from {}.", args.test.display())
    }
}

/// The specimens that are driven, from 0.
fn chosen(args: &IdentifyArgs, loaded: &Loaded) -> anyhow::Result<Vec<usize>> {
    let tables = &loaded.file.specimen;
    let file = loaded.path.display();
    if tables.is_empty() {
        return Err(usage(format!(
            "{file} has no specimen, so there is nothing to identify"
        )));
    }
    let Some(name) = &args.specimen else {
        return Ok((0..tables.len()).collect());
    };
    let place = tables.iter().position(|table| table.name == *name);
    place.map(|place| vec![place]).ok_or_else(|| {
        let names: Vec<&str> = tables.iter().map(|table| table.name.as_str()).collect();
        let meant = nearest(name, &names)
            .map_or_else(String::new, |near| format!("; did you mean \"{near}\"?"));
        usage(format!(
            "--specimen: {file} has no specimen \"{name}\", only {}{meant}",
            names.join(", ")
        ))
    })
}

/// Metres of the structure per metre of the specimen; newtons likewise; seconds likewise.
pub(super) fn gear(table: &SpecimenTable, axis: usize) -> (f64, f64, f64) {
    let gear = table.axis.get(axis).map_or(1.0, |axis| axis.scale);
    let similitude = &table.similitude;
    (
        similitude.length / gear,
        similitude.force * gear,
        similitude.time,
    )
}

/// Two digits of a number, rounded down.
fn rounded_down(value: f64) -> f64 {
    let unit = libm::pow(10.0, libm::floor(libm::log10(value)) - 1.0);
    // A power of ten that is a hair too large must not take a digit away.
    (value / unit * (1.0 + 1e-12)).floor() * unit
}

fn levels(spec: Option<BoundSpec>) -> (f64, f64) {
    let spec = spec.unwrap_or_default();
    let level = |level: Option<f64>| level.unwrap_or(f64::INFINITY);
    (level(spec.warn), level(spec.trip))
}

/// Way that a range leaves on either side of where the axis stands at zero deformation.
fn ways(spec: Option<RangeSpec>, zero: f64) -> (f64, f64) {
    let spec = spec.unwrap_or_default();
    let way = |range: Option<[f64; 2]>| {
        range.map_or(f64::INFINITY, |[low, high]| (high - zero).min(zero - low))
    };
    (way(spec.warn), way(spec.trip))
}

/// How far an axis goes, and why.
fn amplitude(
    asked: Option<f64>,
    table: &SpecimenTable,
    axis: usize,
    limits: &LimitsSpec,
    course: &Course,
    band: Band,
    tick: f64,
) -> anyhow::Result<(f64, String)> {
    let zero = table.axis.get(axis).map_or(0.0, |axis| axis.offset_m);
    let demand = course.demand();
    let room = |key, (warn, trip): (f64, f64), need, unit| Room {
        key,
        warn,
        trip,
        need,
        unit,
    };
    let rooms = [
        room(
            "command_disp_m",
            ways(limits.command_disp_m, zero),
            1.0,
            "m",
        ),
        room(
            "measured_disp_m",
            ways(limits.measured_disp_m, zero),
            1.0,
            "m",
        ),
        room(
            "command_vel_m_per_s",
            levels(limits.command_vel_m_per_s),
            demand.vel,
            "m/s",
        ),
        room(
            "command_step_m",
            levels(limits.command_step_m),
            demand.vel * tick,
            "m",
        ),
        room(
            "command_accel_m_per_s2",
            levels(limits.command_accel_m_per_s2),
            demand.accel,
            "m/s²",
        ),
    ];
    let place = format!("specimen \"{}\" axis {}", table.name, axis + 1);
    let Some(asked) = asked else {
        return of_itself(&place, &rooms);
    };
    let positive = asked > 0.0 && asked.is_finite();
    if !positive {
        return Err(usage(format!(
            "--amplitude is {asked}, but must be greater than 0 m"
        )));
    }
    let tightest = rooms
        .iter()
        .min_by(|a, b| (a.trip / a.need).total_cmp(&(b.trip / b.need)));
    match tightest {
        Some(room) if asked * room.need > room.trip => {
            let largest = room.trip / room.need;
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
                    format!(", or a band up to about {hz:.3} Hz")
                });
            Err(usage(format!(
                "{place}: an amplitude of {asked} m needs {} of `{}`, allowed is {}; largest amplitude for this motion: {:e} m{or}",
                quantity(asked * room.need, room.unit),
                room.key,
                quantity(room.trip, room.unit),
                rounded_down(largest),
            )))
        }
        _ => Ok((asked, "as asked for".to_owned())),
    }
}

/// The amplitude where none was asked for.
fn of_itself(place: &str, rooms: &[Room]) -> anyhow::Result<(f64, String)> {
    let stroke = rooms
        .iter()
        .filter(|room| room.unit == "m" && room.need == 1.0);
    let stroke = stroke.map(|room| room.warn.min(room.trip));
    let stroke = stroke.fold(f64::INFINITY, f64::min);
    let is_known = stroke > 0.0 && stroke.is_finite();
    if !is_known {
        return Err(usage(format!(
            "{place} has no `command_disp_m` in its limits that leaves it a way, so there is nothing to take an amplitude from: \
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
