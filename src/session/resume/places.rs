//! End positions of the specimens of an interrupted test, and their tolerances.
//!
//! They follow from the last recorded commands, and from the largest errors of the sensors while the test ran. After a
//! kill, a loss, or a failure in a tick without a row, a specimen may have moved further than its record.

use std::collections::VecDeque;

use super::ResumeError;
use crate::checksum::unreadable;
use crate::origin::{Kept, Origin};
use gusset_control::engine::{EndPosition, Phase, Place};
use gusset_control::port::Port;
use gusset_quantity::catalog::column;
use gusset_quantity::substructure::Status as LinkStatus;
use gusset_record::summary::{Peak, Status};
use gusset_record::{Row, Run};

/// Wall time in s of which the record may be lost, and the time before it that gives the last speed.
const LOST_S: f64 = 0.05;
const LATEST_S: f64 = 1.0;
/// A specimen may be off by this multiple of its largest recorded error.
const SHARE: f64 = 1.5;
/// Relative size that counts as zero.
const NOTHING: f64 = 1e-9;
/// Allowed difference of a force: this share of the largest recorded force, and this multiple of the load cell's noise.
const FORCE_SHARE: f64 = 0.02;
const NOISE: f64 = 5.0;

/// Tolerances of specimens, from the test file and the record.
pub(super) struct Tolerances<'a> {
    /// How far in m each axis may be from its end position; `None`: as far as the record allows.
    pub within_m: Option<f64>,
    /// How far in N the force of each axis may differ; `None`: as far as the record allows.
    pub within_n: Option<f64>,
    /// Root mean square of the noise that each specimen's load cells are declared to have, N.
    pub noise_n: &'a [f64],
    /// The largest forces that the ports, which were retraced, do not know.
    pub peak: &'a Peak,
    /// Ticks per second of wall time, and in one step.
    pub pace: (f64, u32),
}

/// Places of the columns of one axis in a row.
struct Columns {
    command: usize,
    disp: usize,
    force: usize,
    state: usize,
    status: usize,
}

/// The values that are kept of the rows of one axis: as many for a long test as for a short one.
struct Axis {
    columns: Columns,
    /// Its place according to the test before, if the interrupted test ended during its startup.
    found: Option<Kept>,
    /// Measured less commanded displacement while the test ran: number, sum, smallest and largest.
    errors: (f64, f64, [f64; 2]),
    /// Measured less commanded displacement in the last row, unless the measurement is old.
    error_at_last: Option<f64>,
    command: Option<f64>,
    /// Displacement and force of the last row that has both.
    measured: Option<[f64; 2]>,
    /// Forces at the position `found`: number and sum.
    stood: (f64, f64),
    /// The last commands, and how many of them are kept.
    latest: VecDeque<f64>,
    most: usize,
}

impl Axis {
    fn new(columns: Columns, found: Option<Kept>, rate_hz: f64) -> Self {
        Self {
            columns,
            found,
            errors: (0.0, 0.0, [f64::INFINITY, f64::NEG_INFINITY]),
            error_at_last: None,
            command: None,
            measured: None,
            stood: (0.0, 0.0),
            latest: VecDeque::new(),
            most: (LATEST_S * rate_hz).ceil() as usize + 1,
        }
    }

    fn take(&mut self, row: &[f64]) {
        let at = |place: usize| row.get(place).copied().unwrap_or(f64::NAN);
        let Columns {
            command,
            disp,
            force,
            state,
            status,
        } = self.columns;
        let [command, disp, force] = [command, disp, force].map(at);
        // An old measurement does not belong to the command beside it.
        let is_old = LinkStatus(at(status) as u32).has(LinkStatus::STALE);
        let error = disp - command;
        self.error_at_last = (!is_old).then_some(error);
        if at(state) == Phase::Running.code() && !is_old {
            let (count, sum, [least, most]) = &mut self.errors;
            *count += 1.0;
            *sum += error;
            *least = least.min(error);
            *most = most.max(error);
        }
        self.command = Some(command);
        if disp.is_finite() && force.is_finite() {
            self.measured = Some([disp, force]);
        }
        if self.found.is_some_and(|found| found.command == command) {
            self.stood.0 += 1.0;
            self.stood.1 += force;
        }
        if self.latest.len() == self.most {
            self.latest.pop_front();
        }
        self.latest.push_back(command);
    }

    fn place(&self) -> Kept {
        match &self.found {
            None => self.place_of_steps(),
            Some(found) => self.place_after(found),
        }
    }

    /// Place after a test that made steps itself.
    fn place_of_steps(&self) -> Kept {
        // The mean difference while the test ran is the offset of the sensor.
        let (count, sum, [least, most]) = self.errors;
        let beyond = sum / count.max(1.0);
        // The return move may have moved it to a place where a wrong scale reads another offset.
        let extremes = [least, most].into_iter().filter(|error| error.is_finite());
        let off = extremes
            .chain(self.error_at_last)
            .map(|error| (error - beyond).abs())
            .fold(0.0, f64::max);
        let command = self.command.unwrap_or(0.0);
        let disp = command + beyond;
        let [disp_of_force, force] = self.measured.unwrap_or([disp, 0.0]);
        let place = Place {
            disp,
            force,
            within: SHARE * off,
            disp_of_force,
            force_within: f64::INFINITY,
            way_lost: 0.0,
        };
        Kept { command, place }
    }

    /// Place after a resumed test that ended during its startup: the found position plus the change of command since. Its
    /// force is compared with the readings of the test before, because it adds no newer ones.
    fn place_after(&self, found: &Kept) -> Kept {
        let command = self.command.unwrap_or(found.command);
        let (count, sum) = self.stood;
        let stood = sum / count.max(1.0);
        let force = self.measured.map_or(0.0, |[_, last]| last - stood);
        let is_there = command == found.command;
        let way = command - found.command;
        let before = found.place;
        let place = Place {
            disp: before.disp + way,
            force: before.force + if is_there { 0.0 } else { force },
            disp_of_force: before.disp_of_force + way,
            ..before
        };
        Kept { command, place }
    }

    /// How far a command may have moved after the last row of a test that was killed, in its own unit: at its last speed, and
    /// at least to the next command. A per-step partner moves by a whole step with each command, and gets that many fewer of
    /// them.
    fn way_lost(&self, port: &Port, axis: usize, (rate_hz, ticks_per_step): (f64, u32)) -> f64 {
        let pairs = self.latest.iter().zip(self.latest.iter().skip(1));
        let steps = pairs.map(|(one, next)| (next - one).abs());
        let ready = port
            .command()
            .0
            .get(axis)
            .zip(port.path().sent().0.get(axis));
        let ready = ready.map(|(ready, sent)| (ready - sent).abs());
        let ticks = ticks_lost(rate_hz);
        let commands = if port.path().is_per_step() {
            (ticks / f64::from(ticks_per_step)).ceil()
        } else {
            ticks
        };
        steps.chain(ready).fold(0.0, f64::max) * commands
    }
}

/// Ticks of which the record may be lost.
pub(super) fn ticks_lost(rate_hz: f64) -> f64 {
    (LOST_S * rate_hz).max(1.0)
}

/// True if every command to the specimen is on record: the test ended cleanly, and the specimen is at its last command and was
/// not lost. A failure without a row of its end, as after a panic, came in a tick whose commands had left.
fn is_all_known(run: &Run, port: &Port, state: Option<f64>) -> bool {
    let Some(summary) = run.summary() else {
        return false;
    };
    let left = summary.left.get(port.name()).map(String::as_str);
    let stands = [EndPosition::Stayed, EndPosition::Reached].map(|left| Some(left.word()));
    let ends = [Phase::Tripped, Phase::Leaving].map(Phase::code);
    let has_its_end = state.is_none_or(|last| ends.contains(&last));
    summary.rows_lost == 0
        && stands.contains(&left)
        && (summary.status != Status::Failed || has_its_end)
}

/// How far the force of an axis may differ where its displacement does not, in its own unit: by the noise of the load cell as it
/// is declared, else as measured before the test.
fn force_within(port: &Port, index: usize, axis: usize, by: &Tolerances<'_>) -> f64 {
    if let Some(newtons) = by.within_n {
        return newtons / port.guard().newtons_of(axis);
    }
    let told = by.peak.force.get(port.name());
    let told = told.and_then(|peaks| *peaks.get(axis)?).unwrap_or(0.0);
    let peak = port
        .feedback()
        .peak()
        .get(axis)
        .map_or(told, |own| own.max(told));
    let declared = by.noise_n.get(index).copied().filter(|rms| *rms > 0.0);
    let noise = declared.map(|rms| rms / port.guard().newtons_of(axis));
    let noise = noise.unwrap_or_else(|| port.startup().reading(axis).force_noise);
    // In the unit of the load cell.
    let gain = port.axis_maps().get(axis).map_or(1.0, |map| map.force_gain);
    FORCE_SHARE * (peak / gain.abs()) + NOISE * noise
}

/// Where the last recorded command left each axis, and its tolerance. `before`: the origin of a test that ended during startup.
/// The rows are read once, one after the other.
pub(super) fn places(
    run: &Run,
    ports: &[Port],
    by: &Tolerances<'_>,
    before: Option<&Origin>,
) -> Result<Vec<Vec<Kept>>, ResumeError> {
    let mut all = axes_of(run, ports, by.pace.0, before)?;
    let place = run.layout().index_of("state");
    let (mut journal, mut state) = (run.journal()?, None);
    let failed = |source| unreadable(&run.path().join("samples.bin"), source);
    while let Some(Row { values, .. }) = journal.next_row().map_err(failed)? {
        state = place.and_then(|place| values.get(place).copied());
        all.iter_mut().flatten().for_each(|axis| axis.take(values));
    }
    let specimens = ports.iter().zip(&all).enumerate();
    let kept = specimens.map(|(index, (port, axes))| {
        let is_all_known = is_all_known(run, port, state);
        let one = |(number, axis): (usize, &Axis)| {
            let Kept { command, mut place } = axis.place();
            if port.exchange().is_formula() {
                // A formula is at its last command.
                (place.within, place.force_within) = (f64::INFINITY, f64::INFINITY);
                return Kept { command, place };
            }
            let lost = if is_all_known {
                0.0
            } else {
                axis.way_lost(port, number, by.pace)
            };
            let own = place.within + lost + NOTHING * command.abs();
            place.within = by
                .within_m
                .map_or(own, |metres| metres / port.guard().metres_of(number));
            place.way_lost += lost;
            place.force_within = force_within(port, index, number, by);
            Kept { command, place }
        };
        axes.iter().enumerate().map(one).collect()
    });
    Ok(kept.collect())
}

/// The axes of all specimens before the first row.
fn axes_of(
    run: &Run,
    ports: &[Port],
    rate_hz: f64,
    before: Option<&Origin>,
) -> Result<Vec<Vec<Axis>>, ResumeError> {
    let find = |name: String| {
        let place = run.layout().index_of(&name);
        place.ok_or(gusset_record::FolderError::NoColumn(name))
    };
    let mut all = Vec::new();
    for (index, port) in ports.iter().enumerate() {
        let mut axes = Vec::new();
        for axis in 0..port.axes() {
            let of_axis = |kind: &column::Kind| find(kind.of_axis(index + 1, axis + 1));
            let columns = Columns {
                command: of_axis(&column::COMMAND)?,
                disp: of_axis(&column::RAW_DISP)?,
                force: of_axis(&column::RAW_FORCE)?,
                state: find(column::STATE.name().to_owned())?,
                status: find(column::STATUS.of_specimen(index + 1))?,
            };
            let found = before.and_then(|origin| origin.axis(index, axis));
            axes.push(Axis::new(columns, found, rate_hz));
        }
        all.push(axes);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_control::port::{Axis as Seen, AxisSpec, LinearStandIn, PortSpec};

    #[test]
    fn per_step_partner_loses_whole_steps() {
        // 500 ticks a second, twenty a step of 12 mm: in 50 ms are 25 of its parts, or two whole ones at the most.
        let (rate_hz, ticks) = (500.0, 20);
        for (per_step, wanted) in [(false, 25.0 * 0.6e-3), (true, 2.0 * 12e-3)] {
            let axes = vec![Seen::plain(vec![(0, 1.0)])];
            let rig = LinearStandIn::new(axes.clone(), vec![vec![1e5]], Vec::new());
            let axes = axes.into_iter().map(|axis| AxisSpec::new(axis, 1e5));
            let mut spec = PortSpec::new("rig", Box::new(rig), 1, axes.collect());
            spec.per_step = per_step;
            let port = spec.build().unwrap();
            let steps = (0..600).map(|row| f64::from(row) / f64::from(ticks));
            let steps = steps.map(|steps| if per_step { steps.floor() } else { steps });
            let command: Vec<f64> = steps.map(|steps| 12e-3 * steps).collect();
            let columns = Columns {
                command: 0,
                disp: 1,
                force: 2,
                state: 3,
                status: 4,
            };
            let mut axis = Axis::new(columns, None, rate_hz);
            for command in command {
                axis.take(&[command, command, 0.0, Phase::Running.code(), 0.0]);
            }
            assert!(
                axis.latest.len() <= 501,
                "bounded, however long the test is"
            );
            let way = axis.way_lost(&port, 0, (rate_hz, ticks));
            assert!((way - wanted).abs() < 1e-12, "{per_step}: {way}");
        }
    }
}
