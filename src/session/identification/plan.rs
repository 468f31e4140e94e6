//! Which axes are driven, how, how far, and when: judged before anything moves.

use super::super::rehearsal::FullRehearsal;
use super::amplitude::{amplitude, rounded_down};
use super::{IdentificationError, Request, refusal};
use gusset_config::{Drive, Loaded, SpecimenTable, TestFile, nearest};
use gusset_motion::identify::{Band, Course, Shape};
use gusset_quantity::units::{duration, quantity, rate};

/// Rest before and after every motion, in s, and in ticks at least.
const REST_S: f64 = 1.0;
const REST_TICKS: u64 = 64;
/// Default band, in Hz, and as a share of the ticks per second.
const FROM_HZ: f64 = 0.2;
const TO_HZ: f64 = 10.0;
const OF_RATE: f64 = 0.2;

/// One axis and its part of the run.
#[derive(Debug, Clone)]
pub struct Driven {
    /// Specimen in the test file, from 0.
    pub specimen: usize,
    /// Specimen in the driven test, from 0.
    pub place: usize,
    /// Name of the specimen.
    pub name: String,
    /// Axis, from 0.
    pub axis: usize,
    /// Axes of its specimen.
    pub axes: usize,
    /// Whether it is an actuator of a loading unit.
    pub is_actuator: bool,
    /// Largest displacement at the specimen, in m.
    pub amplitude: f64,
    /// Why it is that large.
    pub reason: String,
    /// First tick of its motion.
    pub start: u64,
}

impl Driven {
    /// "specimen "column" actuator 2".
    #[must_use]
    pub fn words(&self) -> String {
        format!("specimen \"{}\" {}", self.name, self.place_words(self.axis))
    }

    /// "actuator 2", from 0.
    #[must_use]
    pub(crate) fn place_words(&self, axis: usize) -> String {
        let what = if self.is_actuator { "actuator" } else { "axis" };
        format!("{what} {}", axis + 1)
    }
}

/// How often an amplitude is halved.
const MOST_HALVED: i32 = 6;
/// Ticks of one motion at most: its numbers are kept in memory.
const MOST_TICKS: f64 = 16_777_216.0;

/// The whole run.
#[derive(Debug)]
pub struct Plan {
    /// Frequencies of the motion.
    pub band: Band,
    /// Kind of motion.
    pub shape: Shape,
    /// Period of the controller in s.
    pub tick: f64,
    /// Ticks of one motion.
    pub ticks: u64,
    /// Ticks of a rest.
    pub rest: u64,
    /// The axes, in the order of their motions.
    pub axes: Vec<Driven>,
    /// Names of specimens that are not part of it.
    pub left_out: Vec<String>,
    /// The flags that ask for the same motion.
    pub asked: String,
    /// The test that is run.
    pub file: TestFile,
}

const fn word(shape: Shape) -> &'static str {
    match shape {
        Shape::Sweep => "sweep",
        Shape::Noise => "noise",
        Shape::Steps => "steps",
    }
}

/// The flags of a motion. Amplitudes that differ are found again from the limits.
fn asked(args: &Request, shape: Shape, band: Band, axes: &[Driven]) -> String {
    let mut flags = format!(
        "--motion {} --band {},{} --duration {} --seed {}",
        word(shape),
        band.from_hz,
        band.to_hz,
        args.duration,
        args.seed
    );
    if let Some(one) = axes.first()
        && axes.iter().all(|axis| axis.amplitude == one.amplitude)
    {
        flags = format!("{flags} --amplitude {}", one.amplitude);
    }
    flags
}

impl Plan {
    /// The motion, its test, and its rehearsal. The last may refuse the motion. An amplitude that was not requested is halved
    /// until no limit of the file would trip.
    ///
    /// # Errors
    /// The motion is refused, or the test that makes it cannot be built.
    pub fn within_limits(
        args: &Request,
        loaded: &Loaded,
    ) -> Result<(Self, Loaded, FullRehearsal), IdentificationError> {
        let mut halved = 0;
        loop {
            let plan = Self::of(args, loaded, halved)?;
            let driven = loaded.beside(&plan.said(args), &plan.file)?;
            // A linear stand-in shows forces, and limits other than those of the command.
            let full = FullRehearsal::of(&driven)?;
            if full.is_possible() || args.amplitude.is_some() || halved == MOST_HALVED {
                return Ok((plan, driven, full));
            }
            halved += 1;
        }
    }

    /// Refuses a specimen whose link is known to answer with forces only: against its command it would follow without fault.
    ///
    /// # Errors
    /// There is such a specimen.
    pub fn refuse_forces_only(&self, driven: &Loaded) -> Result<(), IdentificationError> {
        let specimens = &driven.file.specimen;
        let mut without = self.axes.iter().filter(|axis| {
            let specimen = specimens.get(axis.place);
            specimen.is_some_and(|of| of.force_only_link().is_some())
        });
        without.next().map_or(Ok(()), |axis| {
            Err(refusal(format!(
                "{}: its link answers with forces only, so its actuator cannot be identified: the command would be compared with itself. \
                 State `delay_s` in [specimen.identified] as the laboratory measured it",
                axis.words()
            )))
        })
    }

    /// The requested motion, if it is allowed. An amplitude that was not requested is halved so often.
    fn of(args: &Request, loaded: &Loaded, halved: i32) -> Result<Self, IdentificationError> {
        let tick = loaded.time.tick();
        // The motion is made in memory before it is judged as a test.
        let ticks = args.duration / tick;
        if ticks.is_finite() && ticks > MOST_TICKS {
            return Err(refusal(format!(
                "--duration is {} s, which is more than {MOST_TICKS} ticks",
                args.duration
            )));
        }
        let band = band(args, tick)?;
        let shape = args.shape;
        let course = Course::new(shape, band, args.duration, args.seed, tick)
            .map_err(|error| refusal(error.to_string()))?;
        let chosen = chosen(args, loaded)?;
        let ticks = (course.duration / tick).ceil() as u64;
        let rest = ((REST_S / tick).ceil() as u64).max(REST_TICKS);
        let mut axes = Vec::new();
        for (place, specimen) in chosen.iter().copied().enumerate() {
            let Some(table) = loaded.file.specimen.get(specimen) else {
                continue;
            };
            let count = table.axes();
            by_themselves(table)?;
            for (axis, limits) in table.limits_of(count).iter().enumerate() {
                let (mut amplitude, mut reason) =
                    amplitude(args.amplitude, table, axis, limits, &course, band, tick)?;
                if halved > 0 {
                    amplitude *= 0.5_f64.powi(halved);
                    reason = format!(
                        "{reason}, halved {halved} times to keep the limits of the measurements"
                    );
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
                    is_actuator: table.geometry.is_some(),
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
        let one = match chosen.as_slice() {
            [one] => loaded.file.specimen.get(*one),
            _ => None,
        };
        let what = one.map_or(&loaded.file.title, |table| &table.name);
        let title = format!("Identification of {what}");
        let others = loaded.file.specimen.iter().enumerate();
        let asked = asked(args, shape, band, &axes);
        Ok(Self {
            asked,
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

    /// The motion in words, for the people beside the rig.
    #[must_use]
    pub fn announced(&self, loaded: &Loaded) -> Vec<String> {
        let word = word(self.shape);
        let mut lines: Vec<String> = self
            .axes
            .iter()
            .map(|driven| {
                format!(
                    "{}: {word} from {} Hz to {} Hz, {} either way ({}), {} at {}, with rests of {}",
                    driven.words(),
                    self.band.from_hz,
                    self.band.to_hz,
                    quantity(driven.amplitude, "m"),
                    driven.reason,
                    duration(self.ticks as f64 * self.tick),
                    rate(1.0 / self.tick),
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
    fn said(&self, args: &Request) -> String {
        format!("Made by `gusset identify` from {}.", args.test.display())
    }
}

/// The requested band, or the default.
fn band(args: &Request, tick: f64) -> Result<Band, IdentificationError> {
    match args.band.as_deref() {
        None => Ok(Band {
            from_hz: FROM_HZ,
            to_hz: TO_HZ.min(OF_RATE / tick),
        }),
        Some(&[from_hz, to_hz]) => Ok(Band { from_hz, to_hz }),
        Some(other) => {
            let text = format!("--band takes two frequencies, found {}", other.len());
            Err(refusal(text))
        }
    }
}

/// The specimens that are driven, from 0.
fn chosen(args: &Request, loaded: &Loaded) -> Result<Vec<usize>, IdentificationError> {
    let tables = &loaded.file.specimen;
    let file = loaded.path.display();
    if tables.is_empty() {
        return Err(refusal(format!(
            "{file} has no specimen, so there is nothing to identify"
        )));
    }
    let Some(name) = &args.specimen else {
        return Ok((0..tables.len()).collect());
    };
    let place = tables.iter().position(|table| table.name == *name);
    let bus = place.and_then(|place| Some(&tables.get(place)?.bus.as_ref()?.bus));
    // An output whose specimen takes no part would be 0.
    let other = tables.iter().find(|table| {
        let spec = table.bus.as_ref().filter(|spec| Some(&spec.bus) == bus);
        table.name != *name
            && spec.is_some_and(|spec| spec.axis.iter().any(|axis| axis.command.is_some()))
    });
    if let Some(other) = other {
        return Err(refusal(format!(
            "--specimen: specimen \"{}\" is commanded by an output of the same bus, which would be 0; leave `--specimen` out",
            other.name
        )));
    }
    place.map(|place| vec![place]).ok_or_else(|| {
        let names: Vec<&str> = tables.iter().map(|table| table.name.as_str()).collect();
        let meant = nearest(name, &names)
            .map_or_else(String::new, |near| format!("; did you mean \"{near}\"?"));
        refusal(format!(
            "--specimen: {file} has no specimen \"{name}\", only {}{meant}",
            names.join(", ")
        ))
    })
}

/// Axes are driven one at a time: refuses where that cannot be.
fn by_themselves(table: &SpecimenTable) -> Result<(), IdentificationError> {
    let Some(spec) = &table.geometry else {
        return Ok(());
    };
    let (actuators, coordinates) = (spec.actuators(), spec.width());
    if actuators <= coordinates {
        return Ok(());
    }
    Err(refusal(format!(
        "specimen \"{}\": {actuators} actuators hold {coordinates} coordinates of a platform. One of them cannot move while the \
         others hold, so their responses cannot be separated",
        table.name
    )))
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
