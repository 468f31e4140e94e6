//! One axis of a specimen, row by row: present values, the values that its limits judged, and its hysteresis loop.
//!
//! The rows contain all values. Nothing here decides anything.

use super::board::AxisView;
use super::history::corners;
use super::marks::Mark;
use super::subject::{WatchedAxis, at};
use gusset_control::engine::Phase;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::catalog::phase::Part;

/// Points of the loop in one bin at most: a longer bin is thinned while it is filled.
const MOST_POINTS: usize = 512;

/// Values of one axis in one row, SI at the specimen's scale.
#[derive(Debug, Clone, Copy)]
pub(super) struct Now {
    pub command: f64,
    pub measured: f64,
    pub force: f64,
    pub error: f64,
}

/// State of a specimen's measurement in a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Told {
    /// It was commanded.
    pub is_told: bool,
    /// It has answered.
    pub is_fresh: bool,
    /// Its answer is overdue: the values of the row were not measured then.
    pub is_silent: bool,
}

/// Past values of an axis.
#[derive(Debug, Clone)]
pub(super) struct AxisTap {
    /// The command, and the last measurement.
    pub now: Now,
    /// Values as drawn; NaN where nothing was measured.
    pub drawn: Now,
    /// Command at which the deformation is zero, in the specimen's unit; none before it is known.
    zero: Option<f64>,
    /// Command at which the sensor's zero is being read.
    zeroing: Option<f64>,
    stiffness: f64,
    tangent_damping: f64,
    added: f64,
    /// Largest tangents of the window before, and of this one.
    stiffest: [f64; 2],
    damping: [f64; 2],
    lag: f64,
    gain_error: f64,
    /// Present and smallest so far.
    margin: [f64; 2],
    limits: Vec<[f64; 3]>,
    /// Points of the loop in the open bin.
    points: Vec<[f32; 2]>,
}

impl AxisTap {
    pub(crate) fn new(axis: &WatchedAxis) -> Self {
        let none = f64::NAN;
        let nothing = Now {
            command: none,
            measured: none,
            force: none,
            error: none,
        };
        Self {
            now: nothing,
            drawn: nothing,
            zero: (!axis.zero.is_awaited).then_some(axis.zero.command),
            zeroing: None,
            stiffness: none,
            tangent_damping: none,
            added: none,
            stiffest: [none; 2],
            damping: [none; 2],
            lag: none,
            gain_error: none,
            margin: [none; 2],
            limits: vec![[none; 3]; axis.marks.len()],
            points: Vec::new(),
        }
    }

    /// Takes the command of a row. Commands count from the one at which the sensor's zero is read.
    pub(crate) fn begin(&mut self, row: &[f64], axis: &WatchedAxis, state: f64, part: Part) {
        let command = at(row, axis.places.command);
        self.now.command = command * axis.metres;
        if self.zero.is_some() {
            return;
        }
        if state == Phase::Zeroing.code() {
            self.zeroing = Some(command);
        } else if matches!(part, Part::Startup | Part::Test) {
            self.zero = self.zeroing.take();
        }
    }

    /// Takes the rest of a row.
    pub(crate) fn row(&mut self, row: &[f64], axis: &WatchedAxis, told: Told) {
        let places = &axis.places;
        if told.is_fresh {
            let measured = at(row, places.raw_disp) * axis.metres;
            let force = at(row, places.raw_force) * axis.newtons;
            // The measured displacement of the column counts from the sensor's zero.
            let stands = axis.zero.gain * at(row, places.measured);
            let stands = self.zero.map_or(f64::NAN, |zero| stands + zero);
            self.now = Now {
                command: self.now.command,
                measured,
                force,
                error: stands * axis.metres - self.now.command,
            };
            self.take_point(measured, force);
        }
        self.drawn = self.now;
        if told.is_silent {
            let none = f64::NAN;
            (self.drawn.measured, self.drawn.force, self.drawn.error) = (none, none, none);
        }
        self.stiffness = at(row, places.stiffness);
        self.stiffest[1] = self.stiffest[1].max(self.stiffness);
        self.tangent_damping = at(row, places.damping);
        self.damping[1] = self.damping[1].max(self.tangent_damping);
        self.added = at(row, places.added);
        self.lag = at(row, places.lag).abs();
        self.gain_error = (at(row, places.gain) - 1.0).abs();
        let margin = at(row, places.margin);
        self.margin = [margin, self.margin[1].min(margin)];
        for (place, mark) in axis.marks.iter().enumerate() {
            let value = self.value(mark, row, axis, told);
            if let Some(value) = value {
                self.keep(Some(place), value);
            }
        }
    }

    fn keep(&mut self, place: Option<usize>, value: f64) {
        if let Some(kept) = place.and_then(|place| self.limits.get_mut(place)) {
            *kept = [value, kept[1].min(value), kept[2].max(value)];
        }
    }

    /// Takes the value at which a limit tripped, which may be in no row.
    pub(crate) fn judged(&mut self, axis: &WatchedAxis, key: &str, value: f64) {
        self.keep(axis.marks.iter().position(|mark| mark.key == key), value);
    }

    /// The value that a limit judged in this row; none where it judged nothing.
    fn value(&self, mark: &Mark, row: &[f64], axis: &WatchedAxis, told: Told) -> Option<f64> {
        let value = match mark.quantity {
            Limit::CommandDisp => return told.is_told.then_some(self.now.command),
            Limit::MeasuredDisp | Limit::SensorDisp => self.now.measured,
            Limit::MeasuredForce | Limit::SensorForce => self.now.force,
            Limit::StiffnessRatio => self.stiffness / axis.stiffness_bound,
            Limit::DampingRatio => self.tangent_damping / axis.damping_bound,
            Limit::AddedEnergy => self.added,
            Limit::Lag => self.lag,
            Limit::GainError => self.gain_error,
            quantity => {
                let judged = at(row, mark.place);
                // Within the share of motion there is no following error.
                let value = match quantity {
                    Limit::FollowingError => judged.max(0.0),
                    _ => judged,
                };
                return (!judged.is_nan()).then_some(value);
            }
        };
        told.is_fresh.then_some(value)
    }

    /// A point of the loop, of the specimen's own end as the histories beside it are.
    fn take_point(&mut self, disp: f64, force: f64) {
        let point = [disp as f32, force as f32];
        if !(point[0].is_finite() && point[1].is_finite()) {
            return;
        }
        if self.points.len() >= MOST_POINTS {
            self.points = corners(&self.points);
        }
        self.points.push(point);
    }

    /// The corners of the loop in the bin that is closed.
    pub(crate) fn take_loop(&mut self) -> Vec<[f32; 2]> {
        let corners = corners(&self.points);
        self.points.clear();
        corners
    }

    /// Forgets the tangents of the window before the last.
    pub(crate) fn next_window(&mut self) {
        self.stiffest = [self.stiffest[1], f64::NAN];
        self.damping = [self.damping[1], f64::NAN];
    }

    pub(crate) fn view(&self) -> AxisView {
        AxisView {
            command: self.now.command,
            measured: self.now.measured,
            force: self.now.force,
            error: self.now.error,
            stiffness: self.stiffness,
            stiffest: self.stiffest[0].max(self.stiffest[1]),
            damping: self.damping[0].max(self.damping[1]),
            added: self.added,
            margin: self.margin,
            limits: self.limits.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::subject::AxisPlaces;
    use super::*;
    use gusset_control::port::DispZero;

    #[test]
    fn loop_and_histories_use_the_same_end() {
        // In millimetres and kilonewtons, with reversed sign, at a third of the structure's lengths.
        let axis = WatchedAxis {
            marks: Vec::new(),
            has_margin: false,
            metres: 1e-3,
            newtons: 1e3,
            zero: DispZero {
                gain: -1e3 / 3.0,
                command: 0.0,
                is_awaited: false,
            },
            stiffness_bound: f64::INFINITY,
            damping_bound: f64::INFINITY,
            places: AxisPlaces {
                measured: Some(0),
                raw_disp: Some(1),
                raw_force: Some(2),
                ..AxisPlaces::default()
            },
        };
        let told = Told {
            is_told: true,
            is_fresh: true,
            is_silent: false,
        };
        let mut tap = AxisTap::new(&axis);
        let row = [-6e-3, 2.0, 4.0];
        tap.row(&row, &axis, told);
        assert_eq!((tap.drawn.measured, tap.drawn.force), (2e-3, 4e3));
        assert_eq!(tap.take_loop(), [[2e-3, 4e3]]);
        assert!(tap.take_loop().is_empty());
    }
}
