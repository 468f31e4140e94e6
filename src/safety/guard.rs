//! The judgement on each command before it leaves, and on each measurement when it has come.

use super::limits::{AxisUnits, Levels, LimitsSpec};

/// What a bound is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Commanded displacement.
    CommandDisp,
    /// Commanded velocity.
    CommandVel,
    /// Change of displacement from one command to the next.
    CommandStep,
    /// Measured displacement.
    MeasuredDisp,
    /// Measured force.
    MeasuredForce,
    /// Range of the displacement sensor.
    SensorDisp,
    /// Range of the load cell.
    SensorForce,
    /// A command that is no finite number.
    CommandNotFinite,
    /// A measurement that is no finite number.
    MeasuredNotFinite,
}

impl Kind {
    const BOUNDS: [Kind; 7] = [
        Kind::CommandDisp,
        Kind::CommandVel,
        Kind::CommandStep,
        Kind::MeasuredDisp,
        Kind::MeasuredForce,
        Kind::SensorDisp,
        Kind::SensorForce,
    ];

    /// As it stands in events and in the file: the key without its unit.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Kind::CommandDisp => "command_disp",
            Kind::CommandVel => "command_vel",
            Kind::CommandStep => "command_step",
            Kind::MeasuredDisp => "measured_disp",
            Kind::MeasuredForce => "measured_force",
            Kind::SensorDisp => "sensor_disp",
            Kind::SensorForce => "sensor_force",
            Kind::CommandNotFinite => "command_not_finite",
            Kind::MeasuredNotFinite => "measured_not_finite",
        }
    }

    /// Its number in the column `trip` of recorded rows, from 1.
    #[must_use]
    pub const fn code(self) -> u32 {
        match self {
            Kind::CommandDisp => 1,
            Kind::CommandVel => 2,
            Kind::CommandStep => 3,
            Kind::MeasuredDisp => 4,
            Kind::MeasuredForce => 5,
            Kind::SensorDisp => 6,
            Kind::SensorForce => 7,
            Kind::CommandNotFinite => 8,
            Kind::MeasuredNotFinite => 9,
        }
    }

    const fn words(self) -> &'static str {
        match self {
            Kind::CommandDisp => "commanded displacement",
            Kind::CommandVel => "commanded velocity",
            Kind::CommandStep => "step from one command to the next",
            Kind::MeasuredDisp => "measured displacement",
            Kind::MeasuredForce => "measured force",
            Kind::SensorDisp => "reading of the displacement sensor",
            Kind::SensorForce => "reading of the load cell",
            Kind::CommandNotFinite => "command",
            Kind::MeasuredNotFinite => "measurement",
        }
    }
}

/// A level that was reached. Numbers are in the units of the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Breach {
    /// Axis, from 0.
    pub axis: usize,
    /// What it is about.
    pub kind: Kind,
    /// What was found.
    pub value: f64,
    /// The level.
    pub bound: f64,
    /// Unit of both.
    pub unit: &'static str,
}

impl std::fmt::Display for Breach {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Breach {
            axis,
            kind,
            value,
            bound,
            unit,
        } = self;
        let words = kind.words();
        let axis = axis + 1;
        match kind {
            Kind::CommandNotFinite | Kind::MeasuredNotFinite => {
                write!(f, "axis {axis}: the {words} is {value}, not a finite number")
            }
            Kind::SensorDisp | Kind::SensorForce => write!(
                f,
                "axis {axis}: the {words}, {value} {unit}, is at the end of its range of {bound} {unit} ({})",
                kind.name()
            ),
            Kind::CommandVel => write!(
                f,
                "axis {axis}: the {words}, {value} {unit}/s, reaches the limit of {bound} {unit}/s ({})",
                kind.name()
            ),
            _ => write!(
                f,
                "axis {axis}: the {words}, {value} {unit}, reaches the limit of {bound} {unit} ({})",
                kind.name()
            ),
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Bound {
    warn: f64,
    trip: f64,
    warned: bool,
}

#[derive(Debug, Clone)]
struct AxisGuard {
    units: AxisUnits,
    bounds: [Bound; 7],
    last: f64,
}

/// The bounds of all axes of one specimen, and what was commanded last. Real-time: yes, after its making.
#[derive(Debug, Clone)]
pub struct Guard {
    axes: Vec<AxisGuard>,
}

impl Guard {
    /// A guard of as many axes as there are `units`; bounds of axes beyond those of `limits` are absent.
    #[must_use]
    pub fn new(limits: &[LimitsSpec], units: &[AxisUnits]) -> Self {
        let axes = units.iter().enumerate().map(|(index, units)| {
            let spec = limits.get(index).copied().unwrap_or_default();
            let bounds = Kind::BOUNDS.map(|kind| {
                let (levels, unit) = match kind {
                    Kind::CommandDisp => (spec.command_disp_m, units.metres),
                    Kind::CommandVel => (spec.command_vel_m_per_s, units.metres),
                    Kind::CommandStep => (spec.command_step_m, units.metres),
                    Kind::MeasuredDisp => (spec.measured_disp_m, units.metres),
                    Kind::SensorDisp => (spec.sensor_disp_m, units.metres),
                    Kind::SensorForce => (spec.sensor_force_n, units.newtons),
                    _ => (spec.measured_force_n, units.newtons),
                };
                let Levels { warn, trip } = levels.unwrap_or_default();
                let level = |level: Option<f64>| level.map_or(f64::INFINITY, |level| level / unit);
                Bound {
                    warn: level(warn),
                    trip: level(trip),
                    warned: false,
                }
            });
            AxisGuard {
                units: *units,
                bounds,
                last: 0.0,
            }
        });
        Self {
            axes: axes.collect(),
        }
    }

    /// True if any level is set.
    #[must_use]
    pub fn has_bounds(&self) -> bool {
        let mut bounds = self.axes.iter().flat_map(|axis| &axis.bounds);
        bounds.any(|bound| bound.warn.is_finite() || bound.trip.is_finite())
    }

    /// A test begins at `start`, in the units of the axes: the first step is counted from there.
    pub fn begin(&mut self, start: &[f64]) {
        for (index, axis) in self.axes.iter_mut().enumerate() {
            axis.last = start.get(index).copied().unwrap_or(0.0);
            for bound in &mut axis.bounds {
                bound.warned = false;
            }
        }
    }

    /// May this be sent? `dt` is the test time since the last command in s; 0 where none passes. A first warning of each
    /// kind comes back once. Real-time: yes.
    ///
    /// # Errors
    /// A trip level is reached: it must not be sent.
    pub fn command(
        &mut self,
        disp: &[f64],
        vel: &[f64],
        dt: f64,
    ) -> Result<Option<Breach>, Breach> {
        let mut warning = None;
        let numbers = disp.iter().zip(vel);
        for (index, (axis, (disp, vel))) in self.axes.iter_mut().zip(numbers).enumerate() {
            if let Some(value) = [*disp, *vel].into_iter().find(|value| !value.is_finite()) {
                return Err(axis.breach(index, Kind::CommandNotFinite, value, f64::NAN));
            }
            let step = disp - axis.last;
            let rate = if dt > 0.0 { step / dt } else { 0.0 };
            let speed = vel.abs().max(rate.abs());
            for (kind, value) in [
                (Kind::CommandDisp, disp.abs()),
                (Kind::CommandVel, speed),
                (Kind::CommandStep, step.abs()),
            ] {
                warning = axis.judge(index, kind, value)?.or(warning);
            }
        }
        // All may be sent: only now is this the last command.
        for (axis, disp) in self.axes.iter_mut().zip(disp) {
            axis.last = *disp;
        }
        Ok(warning)
    }

    /// Can this be true, and may the specimen be there? Real-time: yes.
    ///
    /// # Errors
    /// A trip level is reached.
    pub fn measured(&mut self, disp: &[f64], force: &[f64]) -> Result<Option<Breach>, Breach> {
        let mut warning = None;
        let numbers = disp.iter().zip(force);
        for (index, (axis, (disp, force))) in self.axes.iter_mut().zip(numbers).enumerate() {
            if let Some(value) = [*disp, *force].into_iter().find(|v| !v.is_finite()) {
                return Err(axis.breach(index, Kind::MeasuredNotFinite, value, f64::NAN));
            }
            for (kind, value) in [
                // A sensor at its end comes first: what it reads is not what is.
                (Kind::SensorDisp, disp.abs()),
                (Kind::SensorForce, force.abs()),
                (Kind::MeasuredDisp, disp.abs()),
                (Kind::MeasuredForce, force.abs()),
            ] {
                warning = axis.judge(index, kind, value)?.or(warning);
            }
        }
        Ok(warning)
    }
}

impl AxisGuard {
    fn judge(&mut self, index: usize, kind: Kind, value: f64) -> Result<Option<Breach>, Breach> {
        let place = kind.code() as usize - 1;
        let Some(bound) = self.bounds.get_mut(place) else {
            return Ok(None);
        };
        let Bound { warn, trip, .. } = *bound;
        if value < warn && value < trip {
            return Ok(None);
        }
        if value >= trip {
            return Err(self.breach(index, kind, value, trip));
        }
        if std::mem::replace(&mut bound.warned, true) {
            return Ok(None);
        }
        Ok(Some(self.breach(index, kind, value, warn)))
    }

    fn breach(&self, axis: usize, kind: Kind, value: f64, bound: f64) -> Breach {
        let unit = match kind {
            Kind::MeasuredForce | Kind::SensorForce => self.units.force,
            _ => self.units.disp,
        };
        Breach {
            axis,
            kind,
            value,
            bound,
            unit,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MM: AxisUnits = AxisUnits {
        metres: 1e-3,
        newtons: 1e3,
        disp: "mm",
        force: "kN",
    };

    fn trip(at: f64) -> Option<Levels> {
        Some(Levels {
            warn: None,
            trip: Some(at),
        })
    }

    /// One axis in mm and kN whose every bound is another number.
    fn guard() -> Guard {
        let spec = LimitsSpec {
            command_disp_m: trip(0.010),
            command_vel_m_per_s: trip(0.5),
            command_step_m: trip(0.004),
            measured_disp_m: trip(0.011),
            measured_force_n: trip(20e3),
            sensor_disp_m: trip(0.050),
            sensor_force_n: trip(25e3),
        };
        Guard::new(&[spec], &[MM])
    }

    #[test]
    fn each_bound_trips_at_its_level_and_not_below_in_the_units_of_the_axis() {
        let mut walks = guard();
        for disp in [3.9, 7.8, 9.9] {
            assert_eq!(walks.command(&[disp], &[0.0], 0.01), Ok(None));
        }
        let kind = |result: Result<Option<Breach>, Breach>| result.unwrap_err().kind;
        assert_eq!(kind(walks.command(&[10.0], &[0.0], 0.0)), Kind::CommandDisp);
        assert_eq!(kind(guard().command(&[0.0], &[-500.0], 0.0)), Kind::CommandVel);
        // 3 mm in 5 ms are 0.6 m/s, whatever the command calls its velocity.
        assert_eq!(kind(guard().command(&[3.0], &[0.0], 0.005)), Kind::CommandVel);
        assert_eq!(kind(guard().command(&[-4.0], &[0.0], 0.0)), Kind::CommandStep);
        for (disp, force, expected) in [
            (11.0, 0.0, Kind::MeasuredDisp),
            (0.0, -20.0, Kind::MeasuredForce),
            (50.0, 0.0, Kind::SensorDisp),
            (0.0, 25.0, Kind::SensorForce),
            (0.0, f64::NAN, Kind::MeasuredNotFinite),
        ] {
            assert_eq!(kind(guard().measured(&[disp], &[force])), expected);
        }
        assert_eq!(guard().measured(&[10.9], &[19.9]), Ok(None));
        let lost = guard().command(&[f64::INFINITY], &[0.0], 0.0);
        assert_eq!(kind(lost), Kind::CommandNotFinite);
        assert_eq!(
            guard().measured(&[0.0], &[21.0]).unwrap_err().to_string(),
            "axis 1: the measured force, 21 kN, reaches the limit of 20 kN (measured_force)"
        );
    }

    #[test]
    fn a_command_that_was_not_sent_is_not_the_last_one() {
        let mut guard = guard();
        assert!(guard.command(&[5.0], &[0.0], 0.0).is_err());
        assert!(guard.command(&[5.0], &[0.0], 0.0).is_err(), "still 5 mm away");
        guard.begin(&[5.0]);
        assert_eq!(guard.command(&[6.0], &[0.0], 0.0), Ok(None));
    }

    #[test]
    fn a_warning_comes_once_and_a_test_later_again() {
        let levels = Levels {
            warn: Some(1.0),
            trip: Some(2.0),
        };
        let spec = LimitsSpec {
            measured_force_n: Some(levels),
            ..LimitsSpec::default()
        };
        let mut guard = Guard::new(&[spec], &[AxisUnits::SI]);
        for _ in 0..2 {
            assert_eq!(guard.measured(&[0.0], &[0.9]), Ok(None));
            let warned = guard.measured(&[0.0], &[1.5]).unwrap().unwrap();
            assert_eq!((warned.kind, warned.bound), (Kind::MeasuredForce, 1.0));
            assert_eq!(guard.measured(&[0.0], &[1.6]), Ok(None));
            assert!(guard.measured(&[0.0], &[2.0]).is_err());
            guard.begin(&[0.0]);
        }
    }

    #[test]
    fn without_bounds_only_numbers_are_asked_for() {
        let mut guard = Guard::new(&[], &[AxisUnits::SI, AxisUnits::SI]);
        assert!(!guard.has_bounds());
        assert_eq!(guard.command(&[1e300, -1e300], &[0.0, 1e300], 1e-3), Ok(None));
        assert_eq!(guard.measured(&[1e300, 0.0], &[0.0, -1e300]), Ok(None));
        assert!(guard.measured(&[0.0, 0.0], &[0.0, f64::INFINITY]).is_err());
    }
}
