//! Where the specimens of an interrupted test were left, and how far off they may stand.
//!
//! By the last commands on record, and by how far the sensors were ever off their commands while the test ran. What was
//! killed, what was lost, and what failed in a tick without a row may have gone further than its record.

use super::ResumeError;
use crate::control::Port;
use crate::engine::{Left, Phase};
use crate::record::Run;
use crate::record::summary::Status;
use crate::session::retrace::Origin;
use crate::substructure::Status as LinkStatus;

/// Wall time in s of which the record may be lost, and before that the time in which it went as fast as then.
const LOST_S: f64 = 0.05;
const LATEST_S: f64 = 1.0;
/// A specimen may be so many times as far off as it was ever off its command.
const SHARE: f64 = 1.5;
/// Relative size of what is nothing.
const NOTHING: f64 = 1e-9;

/// Where one axis was left, in its own unit.
struct Place {
    command: f64,
    disp: f64,
    force: f64,
    within: f64,
}

/// What is on record of one axis, row by row.
struct Axis<'a> {
    command: &'a [f64],
    disp: &'a [f64],
    force: &'a [f64],
    state: &'a [f64],
    status: &'a [f64],
}

impl Axis<'_> {
    /// Of a test that made steps of its own.
    fn place(&self) -> Place {
        let is_old = |status: f64| LinkStatus(status as u32).has(LinkStatus::STALE);
        // What it reads beyond its command, on the average of the test itself: the offset of its sensor. An old measurement
        // says nothing of that.
        let rows = self.disp.iter().zip(self.command);
        let rows = rows.zip(self.state.iter().zip(self.status));
        let errors: Vec<f64> = rows
            .filter(|(_, (state, status))| **state == Phase::Running.code() && !is_old(**status))
            .map(|((disp, command), _)| disp - command)
            .collect();
        let beyond = errors.iter().sum::<f64>() / (errors.len().max(1) as f64);
        // The way out may have led it where a wrong scale reads another offset.
        let last = self.disp.last().zip(self.command.last());
        let last = last.zip(self.status.last());
        let at_last = last.filter(|(_, status)| !is_old(**status));
        let at_last = at_last.map(|((disp, command), _)| disp - command);
        let off = errors.iter().copied().chain(at_last);
        let off = off.map(|error| (error - beyond).abs()).fold(0.0, f64::max);
        let command = self.command.last().copied().unwrap_or(0.0);
        Place {
            command,
            disp: command + beyond,
            force: self.force.last().copied().unwrap_or(0.0),
            within: SHARE * off,
        }
    }

    /// Of a test that went on with another and ended on its way in: as far from where it found the axis as it was commanded
    /// since. Its sensors are held against what they read in the test before, of which it tells nothing new.
    fn place_after(&self, found: &Place) -> Place {
        let command = self.command.last().copied().unwrap_or(found.command);
        let rows = self.force.iter().zip(self.command);
        let stood = rows.filter(|(_, command)| **command == found.command);
        let stood: Vec<f64> = stood.map(|(force, _)| *force).collect();
        let force = stood.iter().sum::<f64>() / (stood.len().max(1) as f64);
        let force = self.force.last().map_or(0.0, |last| last - force);
        let is_there = command == found.command;
        Place {
            command,
            disp: found.disp + (command - found.command),
            force: found.force + if is_there { 0.0 } else { force },
            within: found.within,
        }
    }
}

/// Ticks of which the record may be lost.
pub(super) fn ticks_lost(rate_hz: f64) -> f64 {
    (LOST_S * rate_hz).max(1.0)
}

/// How far a command may have gone after the last row of a test that was killed, in its own unit: as fast as at the end of it,
/// and at least to the command that stood ready. Who is commanded once a step goes the way of a whole one with each command, and
/// gets that much fewer of them.
fn way_lost(command: &[f64], port: &Port, axis: usize, rate_hz: f64, ticks_per_step: u32) -> f64 {
    let latest = command
        .len()
        .saturating_sub((LATEST_S * rate_hz).ceil() as usize + 1);
    let steps = command.get(latest..).unwrap_or_default().windows(2);
    let steps = steps.map(|pair| (pair[1] - pair[0]).abs());
    let ready = port.command.get(axis).zip(port.sent.get(axis));
    let ready = ready.map(|(ready, sent)| (ready - sent).abs());
    let ticks = ticks_lost(rate_hz);
    let commands = if port.is_per_step() {
        (ticks / f64::from(ticks_per_step)).ceil()
    } else {
        ticks
    };
    steps.chain(ready).fold(0.0, f64::max) * commands
}

/// True if the specimen was sent nothing that is not on record: the test ended in order, and the specimen, which was not lost,
/// stands at its last command. What failed without a row of its end, as after a panic of our own, failed in a tick whose
/// commands had left.
fn is_all_known(run: &Run, port: &Port, state: &[f64]) -> bool {
    let Some(summary) = run.summary() else {
        return false;
    };
    let left = summary.left.get(port.name.as_str()).map(String::as_str);
    let stands = [Left::Stayed, Left::Reached].map(|left| Some(left.word()));
    let ends = [Phase::Tripped, Phase::Leaving].map(Phase::code);
    let has_its_end = state.last().is_none_or(|last| ends.contains(last));
    summary.rows_lost == 0
        && stands.contains(&left)
        && (summary.status != Status::Failed || has_its_end)
}

/// Where each axis was left by the last command on record, and how far off it may stand: `within` in m if that is given.
/// `before`: the origin of a test that ended on its way in.
pub(super) fn places(
    run: &Run,
    ports: &[Port],
    within: Option<f64>,
    (rate_hz, ticks_per_step): (f64, u32),
    before: Option<&Origin>,
) -> Result<Vec<Vec<[String; 4]>>, ResumeError> {
    let mut all = Vec::new();
    for (index, port) in ports.iter().enumerate() {
        let mut axes = Vec::new();
        for axis in 0..port.axes() {
            let name = |kind: &str| format!("{kind}_{}_{}", index + 1, axis + 1);
            let names = [name("cmd"), name("raw_disp"), name("raw_force")];
            let mut names: Vec<&str> = names.iter().map(String::as_str).collect();
            let status = format!("status_{}", index + 1);
            names.extend(["state", &status]);
            let columns = run.columns(&names)?;
            let [command, disp, force, state, status] = columns.as_slice() else {
                continue;
            };
            let recorded = Axis {
                command,
                disp,
                force,
                state,
                status,
            };
            let found = before.and_then(|origin| origin.axis(index, axis));
            let place = match found {
                None => recorded.place(),
                Some([command, disp, force, within]) => recorded.place_after(&Place {
                    command,
                    disp,
                    force,
                    within,
                }),
            };
            let lost = if is_all_known(run, port, state) {
                0.0
            } else {
                way_lost(command, port, axis, rate_hz, ticks_per_step)
            };
            let own = place.within + lost + NOTHING * place.command.abs();
            let own = within.map_or(own, |metres| metres / port.metres_of(axis));
            // A formula stands where it is told.
            let within = if port.is_formula() {
                f64::INFINITY
            } else {
                own
            };
            let values = [place.command, place.disp, place.force, within];
            axes.push(values.map(|value| format!("{value:?}")));
        }
        all.push(axes);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::{Axis as Seen, Believed, Order};

    #[test]
    fn who_is_commanded_once_a_step_loses_commands_by_steps_and_not_by_ticks() {
        // 500 ticks a second, twenty a step of 12 mm: in 50 ms are 25 of its parts, or two whole ones at the most.
        let (rate_hz, ticks) = (500.0, 20);
        for (per_step, wanted) in [(false, 25.0 * 0.6e-3), (true, 2.0 * 12e-3)] {
            let axes = vec![Seen::plain(vec![(0, 1.0)])];
            let rig = Believed::new(axes.clone(), vec![vec![1e5]], Vec::new());
            let port = Port::new("rig", axes, Box::new(rig), 1, vec![1e5]).unwrap();
            let port = port.with_pace(per_step, Order::Quadratic);
            let steps = (0..600).map(|row| f64::from(row) / f64::from(ticks));
            let steps = steps.map(|steps| if per_step { steps.floor() } else { steps });
            let command: Vec<f64> = steps.map(|steps| 12e-3 * steps).collect();
            let way = way_lost(&command, &port, 0, rate_hz, ticks);
            assert!((way - wanted).abs() < 1e-12, "{per_step}: {way}");
        }
    }
}
