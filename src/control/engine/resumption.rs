//! A test that continues where an interrupted one stood.
//!
//! The state of the interrupted test is that after its last row, which its rows come to when the same loop retraces them. The
//! resumed test reads every sensor before it moves a specimen. Position and force must be those of the record: a specimen that differs by
//! more than its tolerance has changed, and the test is refused unless the user has accepted that. A relative displacement
//! sensor takes its drift for its zero, a load cell only if `resume_takes_force_drift` is set. The pace is that after a hold.

use super::commanding::Commanding;
use super::cycle::Engine;
use super::phase::Phase;
use super::ramping::Ramp;
use super::standing::{Confirmation, Zeroing};
use super::step_progress::StepProgress;
use super::stepping::Stepping;
use super::warm_up::WarmUp;
use super::{Peaks, Stop};
use crate::port::{Port, Reading};
use gusset_quantity::frame::AtAxis;
use gusset_record::{Event, GridOf, Standing};

/// Multiple of the noise of a reading beyond which it differs, and share of it up to which a difference is roundoff.
const NOISE: f64 = 5.0;
const ROUNDOFF: f64 = 1e-9;

/// True if a reading is not `left`: it differs by more than `within`, or by more than its noise and roundoff.
fn differs(found: f64, left: f64, within: f64, noise: f64) -> bool {
    let roundoff = ROUNDOFF * found.abs().max(left.abs());
    let most = (NOISE * noise).max(roundoff).min(within);
    let difference = (found - left).abs();
    difference.is_nan() || difference > most
}

/// Where one axis was left, in its own units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// What its displacement sensor reads where it was commanded last.
    pub disp: f64,
    /// What its load cell read last.
    pub force: f64,
    /// Tolerance of the position; infinite for a computed specimen, which is always at its command.
    pub within: f64,
    /// Reading of the displacement sensor in the row of `force`.
    pub disp_of_force: f64,
    /// How far the load cell may differ from `force` where the displacement sensor reads `disp_of_force`; infinite for a formula,
    /// and in recordings of earlier versions.
    pub force_within: f64,
    /// The way of the commands that the record may have lost. On that way the axis may have yielded.
    pub way_lost: f64,
}

impl Place {
    /// True if a displacement sensor that reads `disp` reads what it read there.
    fn stands_at(&self, disp: f64) -> bool {
        (disp - self.disp).abs() <= self.within
    }
}

/// The largest magnitudes of the interrupted test. The state goes back to the last step that counts; these include the steps
/// after it, because the specimens were loaded by them.
#[derive(Debug, Clone, Default)]
pub struct EarlierPeaks {
    /// Peaks of the structure.
    pub peaks: Peaks,
    /// |force| of each axis of each specimen, N.
    pub forces: Vec<Vec<f64>>,
}

/// The state of an interrupted test beside its numerical side and its ports.
#[derive(Debug, Clone)]
pub struct Resumption {
    pub(super) progress: StepProgress,
    pub(super) sequence: u64,
    pub(super) steps_done: u64,
    pub(super) peaks: Peaks,
    /// Where the axes of each specimen were left.
    pub left: Vec<Vec<Place>>,
    /// Largest magnitudes so far.
    pub earlier: EarlierPeaks,
    /// The user has accepted that a specimen changed since the interruption: what differs is reported, and refuses nothing.
    pub accepts_changed: bool,
}

impl Resumption {
    /// The last step that was made.
    #[must_use]
    pub const fn step(&self) -> u64 {
        self.steps_done
    }
}

/// The force that an axis bears where it is found, and how far its load cell may differ from that. `ways`: how far each axis stands
/// from where its last force was recorded. The specimen unloads elastically: the recorded force changes by the initial stiffness
/// times the way. It may also have yielded: the force then lies between the recorded and the elastic one, as far as lost commands
/// or the drift of a relative displacement sensor explain the way. The stiffness between two axes is known by its bound only.
fn expected_force(
    port: &Port,
    axis: usize,
    place: &Place,
    ways: &[f64],
    reading: &Reading,
) -> [f64; 2] {
    let way = ways.get(axis).copied().unwrap_or(f64::NAN);
    let expected = place.force + port.elastic_force_of(axis, AtAxis(way)).0;
    let others = ways.iter().enumerate();
    let others = others.map(|(other, way)| if other == axis { 0.0 } else { *way });
    let others: Vec<f64> = others.collect();
    let noise = NOISE
        * port
            .elastic_force_of(axis, AtAxis(reading.disp_noise))
            .abs();
    let explained = if port.startup().has_relative_disp(axis) {
        place.within
    } else {
        place.way_lost
    };
    let explained = way.abs().min(explained.max(0.0)).copysign(way);
    let AtAxis(yields) = port.elastic_force_of(axis, AtAxis(explained));
    let has_yielded = (reading.force - expected) * yields < 0.0;
    let yields = if has_yielded { yields.abs() } else { 0.0 };
    let AtAxis(coupled) = port.most_force_of(axis, AtAxis(&others));
    [expected, place.force_within + coupled + noise + yields]
}

impl Resumption {
    /// The state of a retraced test that came to this phase; none if it ended before its first step.
    pub(super) fn of(
        phase: Phase,
        mut progress: StepProgress,
        (sequence, steps_done): (u64, u64),
        peaks: Peaks,
    ) -> Option<Self> {
        if !matches!(phase, Phase::Running | Phase::Holding) || progress.step() == 0 {
            return None;
        }
        // The next command never left.
        progress.take_back_the_next();
        Some(Self {
            progress,
            sequence,
            steps_done,
            peaks,
            left: Vec::new(),
            earlier: EarlierPeaks::default(),
            accepts_changed: false,
        })
    }

    /// From the agreed connection to the tick after the last one of the interrupted test.
    ///
    /// # Errors
    /// A specimen has changed since the interruption, or the test ends.
    pub(super) fn perform(self, engine: &mut Engine<'_>) -> Result<(), Stop> {
        engine.exchanges.continue_at(self.sequence);
        engine.environment.place.step_done(self.steps_done);
        engine.peaks.clone_from(&self.peaks);
        engine.peaks.raise(&self.earlier.peaks);
        *engine.progress = self.progress;
        engine.progress.stand();
        // Motions before the test continues teach no compensator.
        let mut learned = Vec::new();
        for port in &mut *engine.ports {
            learned.push(port.freeze_compensation());
            port.pause_following();
            port.stand_still();
            port.ask_again();
            port.has_come_to_rest();
        }
        self.compare_positions(engine)?;
        engine.arm()?;
        engine.environment.begin_grid(GridOf::Opening);
        self.read_again(engine)?;
        engine.ports.iter_mut().for_each(Port::return_to_the_test);
        Ramp::perform(engine)?;
        engine.ports.iter_mut().for_each(Port::return_to_the_test);
        WarmUp::perform(engine)?;
        for (port, learned) in engine.ports.iter_mut().zip(&learned) {
            if let Some(learned) = learned {
                port.thaw_compensation(learned);
            }
            port.go_on_following();
            port.take_up_target();
        }
        Stepping::prepare_next(engine);
        // As in the running test: a specimen that is commanded once a step has no other command ready than the one that it waits
        // for.
        engine.exchanges.commanding = Commanding::EveryStep;
        let judged = engine.judge_commands();
        engine.exchanges.commanding = Commanding::EveryTick;
        judged
    }

    /// Specimens that report their position must stand where they were left; nothing has moved yet.
    fn compare_positions(&self, engine: &mut Engine<'_>) -> Result<(), Stop> {
        for (index, (port, places)) in engine.ports.iter().zip(&self.left).enumerate() {
            let stands = port.startup().standing().unwrap_or(port.path().sent());
            let axes = stands.iter().zip(*port.path().sent()).zip(places);
            for (axis, ((found, left), place)) in axes.enumerate() {
                let stands_there = (found - left).abs() <= place.within;
                if !stands_there && !self.accepts_changed {
                    return Err(Stop::Moved {
                        port: index,
                        axis,
                        read: false,
                        found: *found,
                        left: *left,
                        within: place.within,
                    });
                }
            }
        }
        engine
            .ports
            .iter_mut()
            .for_each(Port::take_reported_position);
        Ok(())
    }

    /// Reads every sensor while the specimens hold, and compares position and force with the record.
    fn read_again(&self, engine: &mut Engine<'_>) -> Result<(), Stop> {
        if engine.ports.is_empty() {
            return Ok(());
        }
        for port in &mut *engine.ports {
            port.startup_mut().forget_readings();
            port.leave_test();
            // A specimen at rest shows its noise and no stiffness.
            port.pause_estimates();
        }
        let mut zeroing = Zeroing::begin(engine.plan.opening.zero_ticks.max(1), engine)?;
        engine.perform(&mut zeroing)?;
        Zeroing::report_readings(engine);
        let moved = self.report_places(engine);
        let changed = self.report_forces(engine);
        if let Some(stop) = moved.or(changed).filter(|_| !self.accepts_changed) {
            return Err(stop);
        }
        self.take_drift(engine);
        Confirmation::perform(engine)?;
        engine.ports.iter_mut().for_each(Port::resume_estimates);
        Ok(())
    }

    /// Reports the reading of each displacement sensor and the place where its axis was left. Returns the first that differs too
    /// much.
    fn report_places(&self, engine: &mut Engine<'_>) -> Option<Stop> {
        let mut moved = None;
        for (index, (port, places)) in engine.ports.iter().zip(&self.left).enumerate() {
            for (axis, place) in places.iter().enumerate() {
                let reading = port.startup().reading(axis);
                let found = reading.disp;
                let (left, within) = (place.disp, place.within);
                if !place.stands_at(found) && moved.is_none() {
                    moved = Some(Stop::Moved {
                        port: index,
                        axis,
                        read: true,
                        found,
                        left,
                        within,
                    });
                }
                engine.environment.report_now(Event::Stands(Standing {
                    port: index as u32,
                    axis: axis as u32,
                    found,
                    left,
                    within,
                    differs: within.is_finite() && differs(found, left, within, reading.disp_noise),
                }));
            }
        }
        moved
    }

    /// Reports each load cell that reads another force than expected. Returns the first that differs too much.
    fn report_forces(&self, engine: &mut Engine<'_>) -> Option<Stop> {
        let takes_drift = engine.plan.opening.takes_force_drift;
        let mut changed = None;
        for (index, (port, places)) in engine.ports.iter().zip(&self.left).enumerate() {
            let ways = places.iter().enumerate();
            let ways =
                ways.map(|(axis, place)| port.startup().reading(axis).disp - place.disp_of_force);
            let ways: Vec<f64> = ways.collect();
            for (axis, place) in places.iter().enumerate() {
                // A formula has no load cell: it continues from its own state.
                if place.within.is_infinite() {
                    continue;
                }
                let reading = port.startup().reading(axis);
                let [left, within] = expected_force(port, axis, place, &ways, &reading);
                let difference = (reading.force - left).abs();
                if (difference.is_nan() || difference > within) && changed.is_none() {
                    changed = Some(Stop::ForceChanged {
                        port: index,
                        axis,
                        found: reading.force,
                        left,
                        within,
                    });
                }
                if differs(reading.force, left, within, reading.force_noise) {
                    engine.environment.report_now(Event::ForceChanged {
                        port: index as u32,
                        axis: axis as u32,
                        left,
                        found: reading.force,
                        within,
                        taken_for_drift: takes_drift && port.startup().has_relative_force(axis),
                    });
                }
            }
        }
        changed
    }

    /// A relative displacement sensor takes a difference within its tolerance for drift of its zero. A relative load cell does so
    /// only with `resume_takes_force_drift`: at the end of a motion a specimen may lose a real force. An axis that was moved, as
    /// the user has accepted, has not drifted.
    fn take_drift(&self, engine: &mut Engine<'_>) {
        let takes_force = engine.plan.opening.takes_force_drift;
        for (port, places) in engine.ports.iter_mut().zip(&self.left) {
            for (axis, place) in places.iter().enumerate() {
                // A formula has no sensors that drift: it stays where the test was.
                if place.within.is_infinite() {
                    continue;
                }
                if place.stands_at(port.startup().reading(axis).disp) {
                    port.take_disp_drift(axis, place.disp);
                }
                if takes_force {
                    port.take_force_drift(axis, place.force);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::{Axis, AxisSpec, LinearStandIn, PortSpec};

    /// The force of a specimen of 1e5 N/m was 100 N at 1 mm; the specimen is found at 0.5 mm.
    fn passes(way_lost: f64, force: f64) -> bool {
        let axes = vec![Axis::plain(vec![(0, 1.0)])];
        let rig = LinearStandIn::new(axes.clone(), vec![vec![1e5]], Vec::new());
        let port = PortSpec::new(
            "rig",
            Box::new(rig),
            1,
            vec![AxisSpec::new(Axis::plain(vec![(0, 1.0)]), 1e5)],
        )
        .build()
        .unwrap();
        let place = Place {
            disp: 1e-3,
            force: 100.0,
            within: 1e-3,
            disp_of_force: 1e-3,
            force_within: 2.0,
            way_lost,
        };
        let reading = Reading {
            force,
            ..port.startup().reading(0)
        };
        let [expected, within] = expected_force(&port, 0, &place, &[-0.5e-3], &reading);
        assert!((expected - 50.0).abs() < 1e-9, "{expected}");
        (reading.force - expected).abs() <= within
    }

    #[test]
    fn only_lost_commands_excuse_a_new_force() {
        for (way_lost, least, most) in [(0.0, 48.0, 52.0), (0.2e-3, 48.0, 72.0), (1.0, 48.0, 102.0)]
        {
            for (force, is_within) in [
                (least - 0.1, false),
                (least + 0.1, true),
                (most - 0.1, true),
                (most + 0.1, false),
            ] {
                assert_eq!(passes(way_lost, force), is_within, "{way_lost} {force}");
            }
        }
    }
}
