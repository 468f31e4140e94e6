//! A test that goes on where an interrupted one stood.
//!
//! Nothing of the state is saved while a test runs: what was measured is on record, and the loop makes the same bits of it
//! again. So the interrupted test is retraced through the same loop ([`Engine::retrace`]), and what the loop then holds
//! ([`Engine::stand_by`]) is what it held. The resumed test reads every sensor before it moves a specimen. Position and force
//! must be those of the record: a specimen that differs by more than its tolerance has changed, and the test is refused unless
//! the user has accepted that. A relative displacement sensor takes its drift for its zero, a load cell only if
//! `resume_takes_force_drift` is set. The pace is that after a hold.

use super::operator::{Control, Notice};
use super::phase::Phase;
use super::{Ending, Engine, Peaks, Side, Stop};
use crate::port::{Port, Reading};
use crate::record::{Event, GridOf, Standing};

/// A force that differs by so many times its noise differs.
const NOISE: f64 = 5.0;

/// Where one axis was left, in its own units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// What its displacement sensor reads where it was commanded last.
    pub disp: f64,
    /// What its load cell read last.
    pub force: f64,
    /// How far from it it may stand; infinite for a formula, which stands where it is told.
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
    /// Of the structure.
    pub peaks: Peaks,
    /// |force| of each axis of each specimen, N.
    pub forces: Vec<Vec<f64>>,
}

/// What is carried over besides the numerical side and the ports.
#[derive(Debug, Clone)]
pub struct Resumption {
    pub(super) ride: super::ride::Ride,
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
    let way = ways.get(axis).copied().unwrap_or(0.0);
    let expected = place.force + port.elastic_force_of(axis, way);
    let others = ways.iter().enumerate();
    let others = others.map(|(other, way)| if other == axis { 0.0 } else { *way });
    let others: Vec<f64> = others.collect();
    let noise = NOISE * port.elastic_force_of(axis, reading.disp_noise).abs();
    let explained = if port.has_relative_disp(axis) {
        place.within
    } else {
        place.way_lost
    };
    let explained = way.abs().min(explained.max(0.0)).copysign(way);
    let yields = port.elastic_force_of(axis, explained);
    let has_yielded = (reading.force - expected) * yields < 0.0;
    let yields = if has_yielded { yields.abs() } else { 0.0 };
    let coupled = port.most_force_of(axis, &others);
    [expected, place.force_within + coupled + noise + yields]
}

impl Engine {
    /// Follows a recorded test as far as the recording lets it, and leaves everything as it is then: nobody is retired.
    pub fn retrace(&mut self, control: &Control) -> Ending {
        for port in &mut self.ports {
            port.follow_compensation();
        }
        self.course(control).into()
    }

    /// What a retraced test came to; none if it ended before its first step.
    #[must_use]
    pub fn stand_by(self) -> Option<(Side, Vec<Port>, Resumption)> {
        if !matches!(self.phase, Phase::Running | Phase::Holding) || self.ride.step == 0 {
            return None;
        }
        let mut ride = self.ride;
        // The command that stood ready never left.
        ride.tempo = ride.before;
        let resumption = Resumption {
            ride,
            sequence: self.sequence,
            steps_done: self.steps_done,
            peaks: self.peaks,
            left: Vec::new(),
            earlier: EarlierPeaks::default(),
            accepts_changed: false,
        };
        Some((self.side, self.ports, resumption))
    }

    /// From the agreed connection to the tick after the last one of the interrupted test.
    pub(super) fn take_up(&mut self, from: Resumption, control: &Control) -> Result<(), Stop> {
        self.sequence = from.sequence;
        self.steps_done = from.steps_done;
        self.peaks = from.peaks;
        self.peaks.raise(&from.earlier.peaks);
        self.earlier_forces = from.earlier.forces;
        self.ride = from.ride;
        self.ride.tempo.stand();
        // What moves the specimens before the test goes on teaches no compensator anything.
        let mut learned = Vec::new();
        for port in &mut self.ports {
            port.freeze_compensation(&mut learned);
            port.pause_following();
            port.stand_still();
            port.ask_again();
            port.has_come_to_rest();
        }
        let (left, accepts_changed) = (&from.left, from.accepts_changed);
        self.stand_where_left(left, accepts_changed)?;
        self.arm(control)?;
        self.begin_grid(GridOf::Opening);
        self.read_again(left, accepts_changed, control)?;
        for port in &mut self.ports {
            port.return_to_the_test();
        }
        self.ramp(control)?;
        for port in &mut self.ports {
            port.return_to_the_test();
        }
        self.warm_up(control)?;
        let mut learned = learned.as_slice();
        for port in &mut self.ports {
            learned = port.thaw_compensation(learned);
            port.go_on_following();
            port.take_up_target();
        }
        self.prepare_next();
        // As in the running test: who is commanded once a step has no other command ready than the one that it waits for.
        self.riding = true;
        let cleared = self.clear_commands();
        self.riding = false;
        cleared
    }

    /// Largest |force| per axis of each specimen, over the whole test. A way out knows the own ones only: what tripped the test
    /// before is no force that it may come to again.
    pub(super) fn peak_forces(&self) -> impl Iterator<Item = Vec<f64>> {
        let before = self.earlier_forces.iter().map(Vec::as_slice);
        let before = before.chain(std::iter::repeat(&[][..]));
        self.ports.iter().zip(before).map(|(port, before)| {
            let before = before.iter().copied().chain(std::iter::repeat(0.0));
            let each = port.peak_force().iter().zip(before);
            each.map(|(own, before)| own.max(before)).collect()
        })
    }

    /// Specimens that say where they stand must stand where they were left; nothing has moved yet.
    fn stand_where_left(&mut self, left: &[Vec<Place>], accepts_changed: bool) -> Result<(), Stop> {
        for (index, (port, places)) in self.ports.iter().zip(left).enumerate() {
            let stands = port.standing().unwrap_or(port.sent());
            let axes = stands.iter().zip(port.sent()).zip(places);
            for (axis, ((found, left), place)) in axes.enumerate() {
                let stands_there = (found - left).abs() <= place.within;
                if !stands_there && !accepts_changed {
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
        self.take_their_word();
        Ok(())
    }

    /// Reads every sensor while the specimens hold, and compares position and force with the record.
    fn read_again(
        &mut self,
        left: &[Vec<Place>],
        accepts_changed: bool,
        control: &Control,
    ) -> Result<(), Stop> {
        if self.ports.is_empty() {
            return Ok(());
        }
        for port in &mut self.ports {
            port.forget_readings();
            port.leave_test();
            // What stands shows its noise and no stiffness.
            port.pause_estimates();
        }
        self.read_at_rest(self.opening.zero_ticks.max(1), control)?;
        self.tell_readings(control);
        let moved = self.report_places(left);
        let changed = self.report_forces(left);
        if let Some(stop) = moved.or(changed).filter(|_| !accepts_changed) {
            return Err(stop);
        }
        self.take_drift(left);
        self.wait_for_confirmation(control)?;
        self.ports.iter_mut().for_each(Port::resume_estimates);
        Ok(())
    }

    /// Reports what each displacement sensor reads and where its axis was left; returns the first that differs too much.
    fn report_places(&mut self, left: &[Vec<Place>]) -> Option<Stop> {
        let (mut moved, mut found) = (None, Vec::new());
        for (index, (port, places)) in self.ports.iter().zip(left).enumerate() {
            for (axis, place) in places.iter().enumerate() {
                let disp = port.reading(axis).disp;
                found.push((index, axis, [disp, place.disp, place.within]));
                if !place.stands_at(disp) && moved.is_none() {
                    moved = Some(Stop::Moved {
                        port: index,
                        axis,
                        read: true,
                        found: disp,
                        left: place.disp,
                        within: place.within,
                    });
                }
            }
        }
        for (port, axis, [found, left, within]) in found {
            self.report_now(Event::Stands(Standing {
                port: port as u32,
                axis: axis as u32,
                found,
                left,
                within,
            }));
        }
        moved
    }

    /// Reports each load cell that reads another force than expected; returns the first that differs too much.
    fn report_forces(&mut self, left: &[Vec<Place>]) -> Option<Stop> {
        let takes_drift = self.opening.takes_force_drift;
        let (mut changed, mut differ) = (None, Vec::new());
        for (index, (port, places)) in self.ports.iter().zip(left).enumerate() {
            let ways: Vec<f64> = places
                .iter()
                .enumerate()
                .map(|(axis, place)| port.reading(axis).disp - place.disp_of_force)
                .collect();
            for (axis, place) in places.iter().enumerate() {
                // A formula has no load cell: it continues from its own state.
                if place.within.is_infinite() {
                    continue;
                }
                let reading = port.reading(axis);
                let [left, within] = expected_force(port, axis, place, &ways, &reading);
                let difference = (reading.force - left).abs();
                let is_the_same = difference <= within;
                if !is_the_same && changed.is_none() {
                    changed = Some(Stop::ForceChanged {
                        port: index,
                        axis,
                        found: reading.force,
                        left,
                        within,
                    });
                }
                if !is_the_same || difference > NOISE * reading.force_noise {
                    let is_taken = takes_drift && port.has_relative_force(axis);
                    let values = [left, reading.force, within];
                    differ.push((index as u32, axis as u32, values, is_taken));
                }
            }
        }
        for (port, axis, [left, found, within], is_taken) in differ {
            self.report_now(Event::ForceChanged {
                port,
                axis,
                left,
                found,
                within,
                taken_for_drift: is_taken,
            });
        }
        changed
    }

    /// A relative displacement sensor takes a difference within its tolerance for drift of its zero. A relative load cell does so
    /// only with `resume_takes_force_drift`: at the end of a motion a specimen may lose a real force. An axis that was moved, as
    /// the user has accepted, has not drifted.
    fn take_drift(&mut self, left: &[Vec<Place>]) {
        let takes_force = self.opening.takes_force_drift;
        for (port, places) in self.ports.iter_mut().zip(left) {
            for (axis, place) in places.iter().enumerate() {
                // A formula has no sensors that drift: it stays where the test was.
                if place.within.is_infinite() {
                    continue;
                }
                if place.stands_at(port.reading(axis).disp) {
                    port.take_disp_drift(axis, place.disp);
                }
                if takes_force {
                    port.take_force_drift(axis, place.force);
                }
            }
        }
    }

    /// The readings, for the log and for whoever attends.
    pub(super) fn tell_readings(&mut self, control: &Control) {
        let mut readings = Vec::new();
        for (port, behind) in self.ports.iter().enumerate() {
            readings.extend((0..behind.axes()).map(|axis| (port, axis, behind.reading(axis))));
        }
        for (port, axis, reading) in readings {
            let [disp_noise, force_noise] = reading.noise().unwrap_or([f64::NAN; 2]);
            self.report_now(Event::Zeroed {
                port: port as u32,
                axis: axis as u32,
                disp: reading.disp,
                force: reading.force,
                disp_noise_rms: disp_noise,
                force_noise_rms: force_noise,
            });
            // Nobody attends, or does not read: the log has it.
            let _ = control.notices.try_send(Notice::Zeroed {
                port,
                axis,
                reading,
            });
        }
    }

    /// Reads every sensor in so many ticks while the specimens hold where they stand. It takes longer where answers stay away:
    /// bounded by how many of them may do so in a row.
    pub(super) fn read_at_rest(&mut self, ticks: u32, control: &Control) -> Result<(), Stop> {
        self.enter(Phase::Zeroing, Ending::Completed);
        for port in &mut self.ports {
            port.stand_still();
        }
        self.clear_commands()?;
        while !self.ports.iter().all(|port| port.has_read(ticks)) {
            self.still_tick(Phase::Zeroing, control)?;
            for port in &mut self.ports {
                port.take_reading();
            }
        }
        Ok(())
    }

    /// Waits until the operator has confirmed what was read, if he must. A hold is another matter: it neither begins nor ends
    /// here.
    pub(super) fn wait_for_confirmation(&mut self, control: &Control) -> Result<(), Stop> {
        if self.opening.confirm {
            self.unconfirmed = true;
            // Whoever is told sees the question.
            self.show();
            let _ = control.notices.try_send(Notice::AwaitingConfirmation);
            // However long it takes: what stands shows its noise and no stiffness.
            self.ports.iter_mut().for_each(Port::pause_estimates);
            while self.unconfirmed {
                self.still_tick(Phase::Zeroing, control)?;
            }
            self.report_now(Event::Confirmed);
            self.ports.iter_mut().for_each(Port::resume_estimates);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::{Axis, LinearStandIn};

    /// The force of a specimen of 1e5 N/m was 100 N at 1 mm; the specimen is found at 0.5 mm.
    fn passes(way_lost: f64, force: f64) -> bool {
        let axes = vec![Axis::plain(vec![(0, 1.0)])];
        let rig = LinearStandIn::new(axes.clone(), vec![vec![1e5]], Vec::new());
        let port = Port::new("rig", axes, Box::new(rig), 1, vec![1e5]).unwrap();
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
            ..port.reading(0)
        };
        let [expected, within] = expected_force(&port, 0, &place, &[-0.5e-3], &reading);
        assert!((expected - 50.0).abs() < 1e-9, "{expected}");
        (reading.force - expected).abs() <= within
    }

    #[test]
    fn a_force_follows_the_displacement_elastically_and_only_lost_commands_explain_that_it_does_not()
     {
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
