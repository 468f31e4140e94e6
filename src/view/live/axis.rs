//! One axis of a specimen, row by row: present values, the values that its limits judged, and its hysteresis loop.
//!
//! The rows contain all values. Nothing here decides anything.

use super::board::AxisView;
use super::history::corners;
use super::subject::{WatchedAxis, at};
use gusset_control::engine::Phase;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::catalog::phase::Part;

/// Points of the loop in one bin at most: a longer bin is thinned while it is filled.
const MOST_POINTS: usize = 512;

/// Drawn values of one axis, SI at the specimen's scale; NaN where nothing was measured.
#[derive(Debug, Clone, Copy)]
pub(super) struct Drawn {
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
    /// The command, the last measurement and the values of its limits.
    view: AxisView,
    pub drawn: Drawn,
    /// Command at which the deformation is zero, in the specimen's unit; none before it is known.
    zero: Option<f64>,
    /// Command at which the sensor's zero is being read.
    zeroing: Option<f64>,
    /// Largest tangents of the window before, and of this one.
    stiffest: [f64; 2],
    damping: [f64; 2],
    /// Points of the loop in the open bin.
    points: Vec<[f32; 2]>,
}

impl AxisTap {
    pub(crate) fn new(axis: &WatchedAxis) -> Self {
        let none = f64::NAN;
        let view = AxisView {
            command: none,
            measured: none,
            force: none,
            error: none,
            stiffness: none,
            stiffest: none,
            damping: none,
            added: none,
            margin: [none; 2],
            limits: vec![[none; 3]; axis.marks.len()],
        };
        Self {
            drawn: Drawn::of(&view),
            view,
            zero: (!axis.zero.is_awaited).then_some(axis.zero.command),
            zeroing: None,
            stiffest: [none; 2],
            damping: [none; 2],
            points: Vec::new(),
        }
    }

    /// Takes the command of a row. Commands count from the one at which the sensor's zero is read.
    pub(crate) fn begin(&mut self, row: &[f64], axis: &WatchedAxis, state: f64, part: Part) {
        let [command, ..] = axis.values(row);
        self.view.command = command * axis.metres;
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
        let [
            _,
            meas,
            disp,
            force,
            stiffness,
            damping,
            added,
            lag,
            gain,
            margin,
        ] = axis.values(row);
        if told.is_fresh {
            // The measured displacement of the column counts from the sensor's zero.
            let stands = self
                .zero
                .map_or(f64::NAN, |zero| axis.zero.gain * meas + zero);
            let view = &mut self.view;
            (view.measured, view.force) = (disp * axis.metres, force * axis.newtons);
            view.error = stands * axis.metres - view.command;
            let (measured, force) = (view.measured, view.force);
            self.take_point(measured, force);
        }
        self.drawn = Drawn::of(&self.view);
        if told.is_silent {
            let none = f64::NAN;
            (self.drawn.measured, self.drawn.force, self.drawn.error) = (none, none, none);
        }
        self.stiffest[1] = self.stiffest[1].max(stiffness);
        self.damping[1] = self.damping[1].max(damping);
        (self.view.stiffness, self.view.added) = (stiffness, added);
        self.view.margin = [margin, self.view.margin[1].min(margin)];
        for (place, mark) in axis.marks.iter().enumerate() {
            let judged = at(row, mark.place);
            let fresh = |value: f64| told.is_fresh.then_some(value);
            let value = match mark.quantity {
                Limit::CommandDisp => told.is_told.then_some(self.view.command),
                Limit::MeasuredDisp | Limit::SensorDisp => fresh(self.view.measured),
                Limit::MeasuredForce | Limit::SensorForce => fresh(self.view.force),
                Limit::StiffnessRatio => fresh(stiffness / axis.stiffness_bound),
                Limit::DampingRatio => fresh(damping / axis.damping_bound),
                Limit::AddedEnergy => fresh(added),
                Limit::Lag => fresh(lag.abs()),
                Limit::GainError => fresh((gain - 1.0).abs()),
                _ if judged.is_nan() => None,
                // Within the share of motion there is no following error.
                Limit::FollowingError => Some(judged.max(0.0)),
                _ => Some(judged),
            };
            if let Some(value) = value {
                self.keep(Some(place), value);
            }
        }
    }

    fn keep(&mut self, place: Option<usize>, value: f64) {
        if let Some(kept) = place.and_then(|place| self.view.limits.get_mut(place)) {
            *kept = [value, kept[1].min(value), kept[2].max(value)];
        }
    }

    /// Takes the value at which a limit tripped, which may be in no row.
    pub(crate) fn judged(&mut self, axis: &WatchedAxis, key: &str, value: f64) {
        self.keep(axis.marks.iter().position(|mark| mark.key == key), value);
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
            stiffest: self.stiffest[0].max(self.stiffest[1]),
            damping: self.damping[0].max(self.damping[1]),
            ..self.view.clone()
        }
    }
}

impl Drawn {
    const fn of(view: &AxisView) -> Self {
        Self {
            command: view.command,
            measured: view.measured,
            force: view.force,
            error: view.error,
        }
    }
}

#[cfg(test)]
mod tests {
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
            places: std::array::from_fn(|place| [1, 2, 3].contains(&place).then(|| place - 1)),
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
