//! From the agreed connection to the first tick: zero, ramp, arm.
//!
//! Zeroing commands every specimen to where it stands and reads; ramping goes from there to where the test begins along
//! half a cosine, slower than any speed limit. Nothing jumps.

use super::operator::{Control, OperatorCommands};
use super::phase::Phase;
use super::ready::Readiness;
use super::tick::Tick;
use super::{Ending, Engine, Side, Stop};
use crate::control::Port;
use crate::record::{Event, WarmUpRows};
use crate::rt::timing::TickStamps;

/// Share of a speed limit that a ramp uses at its fastest.
const SHARE_OF_SPEED: f64 = 0.5;
/// Ticks of a warm-up whose rows are held back until it is known whether they matter.
const MOST_HELD_BACK: u64 = 10_000;

/// How a test begins.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Opening {
    /// Ticks over which each sensor is averaged while the specimens hold; 0: not at all.
    pub zero_ticks: u32,
    /// Whether the operator must confirm the offsets.
    pub confirm: bool,
    /// Shortest time of a ramp in s of wall time.
    pub ramp_s: f64,
    /// Of a test that is gone on with: whether a relative load cell's change is drift of its zero.
    pub takes_force_drift: bool,
    /// Of each axis of each specimen: the largest force that it may bear before the test moves it, without a warning.
    pub initial_forces: Vec<Vec<InitialForce>>,
}

/// The largest force that an axis may bear before the test moves it, without a warning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InitialForce {
    /// The reference: `yield_force_n` of the stand-in, `measured_force_n` of the limits, or `noise` if neither is known.
    pub of: &'static str,
    /// 1 % of the reference, N at the specimen.
    pub most_n: f64,
}

/// Multiple of the load cell's noise, and displacement in m, whose force is added to the allowed force.
const NOISE: f64 = 5.0;
const RESOLUTION_M: f64 = 1e-9;
/// The initial stiffness is known to this share.
const STIFFNESS_SHARE: f64 = 0.1;

impl Opening {
    /// True if nothing moves at once: the first command is where the specimen stands.
    #[must_use]
    pub fn is_gentle(&self) -> bool {
        self.zero_ticks > 0 || self.ramp_s > 0.0
    }
}

impl Engine {
    /// Reads every sensor while the specimens hold where they stand, and takes what is declared as relative for zero.
    pub(super) fn zero(&mut self, control: &Control) -> Result<(), Stop> {
        let ticks = self.opening.zero_ticks;
        if ticks == 0 || self.ports.is_empty() {
            return Ok(());
        }
        // What stands shows its noise and no stiffness.
        for port in &mut self.ports {
            port.rest();
        }
        self.read_at_rest(ticks, control)?;
        for port in &mut self.ports {
            port.take_zero();
        }
        self.tell_readings(control);
        // Under a static load a force at t = 0 is as it must be: what counts is the force before it.
        if self.settling.is_some() {
            self.report_initial_forces(|port, axis| {
                let reading = port.reading(axis);
                [reading.disp, reading.force]
            });
        }
        self.wait_for_confirmation(control)
    }

    /// Reports each axis of a specimen behind a link that bears a force beyond what its displacement explains: it has yielded before,
    /// or something holds it. `measured`: displacement and force of an axis in its own units.
    pub(super) fn report_initial_forces(&mut self, measured: impl Fn(&Port, usize) -> [f64; 2]) {
        let mut found = Vec::new();
        for (index, (port, bounds)) in self
            .ports
            .iter()
            .zip(&self.opening.initial_forces)
            .enumerate()
        {
            // A law of this process begins in its virgin state; of one that has not answered nothing is known.
            if port.is_formula() || !port.partner.measured {
                continue;
            }
            let all: Vec<[f64; 2]> = (0..port.axes()).map(|axis| measured(port, axis)).collect();
            for (axis, bound) in bounds.iter().enumerate().take(all.len()) {
                let newtons = port.newtons_of(axis);
                let noise = port.reading(axis).force_noise * newtons;
                let (force, slack) = port.unexplained_force(axis, &all, STIFFNESS_SHARE);
                let resolution = port.stiffness_at_specimen(axis) * RESOLUTION_M;
                let most = bound.most_n + NOISE * noise + resolution + slack * newtons;
                let force = force * newtons;
                if force.abs() > most {
                    found.push((index, axis, bound.of, [force, most]));
                }
            }
        }
        for (port, axis, of, [force, most]) in found {
            self.report_now(Event::InitialForce {
                port: port as u32,
                axis: axis as u32,
                of: of.into(),
                force,
                most,
            });
        }
    }

    /// What one tick that moves the specimens beside the test is of its time, in s.
    pub(super) fn tick_passes(&self) -> f64 {
        self.dt / self.ride.tempo.ticks_per_step()
    }

    /// A tick in which test time stands still: at t = 0, or where an interrupted test stood.
    pub(super) fn tick_at_rest(&self, dt: f64) -> Tick {
        let step = self.steps_done;
        Tick {
            step,
            time: step as f64 * self.dt,
            ..Tick::before_start(dt)
        }
    }

    /// One tick in which the last command is sent again: nothing moves, everything is read.
    pub(super) fn still_tick(&mut self, phase: Phase, control: &Control) -> Result<(), Stop> {
        let tick = self.tick_at_rest(0.0);
        let mut stamps = TickStamps::default();
        self.still = true;
        let heard = self.wait_before_start(&mut stamps, control);
        self.still = false;
        heard?;
        self.exchange_again(&tick, &mut stamps, control)?;
        self.row_before_start(&tick, phase, &stamps);
        self.skip_numbers();
        Ok(())
    }

    /// The exchange that was just made moved nothing and is none of the test's. Real-time: yes.
    pub(super) fn skip_numbers(&mut self) {
        for port in &mut self.ports {
            port.skip_number();
        }
    }

    /// Moves every specimen from its last command to the one that stands ready. Does nothing where they are the same.
    pub(super) fn ramp(&mut self, control: &Control) -> Result<(), Stop> {
        let (tick, shortest) = (self.period.value(), self.opening.ramp_s);
        let ticks = self.ramp_ticks(|port, share| port.ramp_time(share, tick, shortest));
        if ticks == 0 {
            return Ok(());
        }
        self.enter(Phase::Ramping, Ending::Completed);
        self.lead(ticks, Phase::Ramping, control)?;
        self.timing.reset();
        Ok(())
    }

    /// Begins the ramp of every specimen to the command that stands ready. Ticks of the longest way, each of which takes so many seconds by the share of a speed limit that may be used.
    pub(super) fn ramp_ticks(&mut self, seconds: impl Fn(&Port, f64) -> f64) -> u64 {
        // The poses on its way say how fast it is.
        self.ports.iter_mut().for_each(Port::begin_ramp);
        let ways = self.ports.iter().map(|port| seconds(port, SHARE_OF_SPEED));
        let longest = ways.fold(0.0, f64::max);
        (longest / self.period.value()).ceil() as u64
    }

    /// Leads every specimen along the ramp that was begun, in so many ticks. A hold of the operator
    /// eases out and in as in the test: what it stretches is the time of the way. Nobody moves before all have answered: how
    /// long that may take is bounded by how many answers may stay away in a row.
    pub(super) fn lead(&mut self, ticks: u64, phase: Phase, control: &Control) -> Result<(), Stop> {
        let (whole, passes) = (ticks as f64, self.tick_passes());
        let seconds = whole * passes;
        let all_answered = |ports: &[Port]| ports.iter().all(|port| port.partner.measured);
        if !all_answered(&self.ports) {
            for port in &mut self.ports {
                port.ramp_to(0.0, seconds);
            }
            self.clear_commands()?;
        }
        while !all_answered(&self.ports) {
            self.still_tick(phase, control)?;
        }
        let (mut gone, mut pace) = (0.0, f64::from(u8::from(!self.hold_wanted)));
        while gone < whole {
            pace = self.ride.tempo.eased(pace, self.hold_wanted);
            if pace == 0.0 {
                self.still_tick(phase, control)?;
                continue;
            }
            gone = (gone + pace).min(whole);
            for port in &mut self.ports {
                port.ramp_to(gone / whole, seconds / pace);
            }
            self.clear_commands()?;
            let tick = self.tick_at_rest(passes * pace);
            let mut stamps = TickStamps::default();
            self.wait_before_start(&mut stamps, control)?;
            self.exchange(&tick, &mut stamps, control)?;
            self.row_before_start(&tick, phase, &stamps);
            self.accept()?;
        }
        Ok(())
    }

    /// The row of a tick before t = 0.
    pub(super) fn row_before_start(&mut self, tick: &Tick, phase: Phase, stamps: &TickStamps) {
        for port in &mut self.ports {
            port.look_at_pose();
        }
        self.row.exchange(tick, phase, &self.side, &self.ports);
        self.row.outputs(&self.side);
        self.row
            .timing(stamps, self.first_edge, self.schedule.stretched());
        self.keep_row();
    }

    /// The row of a tick of the warm-up. x, v and a stay what they were: what follows is the same with these rows and without.
    fn warm_up_row(&mut self, rows: WarmUpRows, tick: &Tick, stamps: &TickStamps) {
        if rows == WarmUpRows::Never {
            return;
        }
        let state = Phase::Armed.code();
        self.row.between(tick, state, &self.side, &self.ports);
        self.row
            .timing(stamps, self.first_edge, self.schedule.stretched());
        if rows == WarmUpRows::IfTheyMatter {
            // Within its capacity.
            self.held_back.extend_from_slice(self.row.values());
            self.row.commands = OperatorCommands::default();
            self.sent_since_row = false;
        } else {
            self.keep_row();
        }
    }

    /// Warm-up ticks: the loop lives, the specimens hold the first command, nothing is counted as a miss. What the last half
    /// of them would miss in the test is judged all the same: a loop that cannot keep its ticks does not begin.
    pub(super) fn warm_up(&mut self, control: &Control) -> Result<(), Stop> {
        self.enter(Phase::Armed, Ending::Completed);
        let rows = match self.recorder.warm_up() {
            // Too many to be held back.
            WarmUpRows::IfTheyMatter if self.limits.warmup_ticks > MOST_HELD_BACK => {
                WarmUpRows::AsTheyCome
            }
            rows => rows,
        };
        // In a replay without these rows nobody asks for anything, and nobody answers.
        let nobody = Control::unattended();
        self.unanswered = rows == WarmUpRows::Never;
        if self.unanswered {
            // Who never answered before the test, and is late in its first tick, ends it there: then these rows are kept.
            for port in &mut self.ports {
                port.partner.measured = true;
            }
        }
        let control = if self.unanswered { &nobody } else { control };
        if rows == WarmUpRows::IfTheyMatter {
            let ticks = usize::try_from(self.limits.warmup_ticks).unwrap_or(0);
            self.held_back = Vec::with_capacity(ticks * self.columns.len());
        }
        let held_before = self.hold_wanted;
        let outcome = self.warm_up_ticks(rows, control);
        self.unanswered = false;
        if self.hold_wanted != held_before {
            self.keep_warm_up();
        }
        outcome
    }

    /// The rows of the warm-up matter: something was asked in it, or the test ends before its first row. Real-time: yes.
    pub(super) fn keep_warm_up(&mut self) {
        let columns = self.columns.len().max(1);
        for row in self.held_back.chunks_exact(columns) {
            if !self.recorder.row(row) {
                self.rows_lost += 1;
            }
        }
        self.held_back.clear();
    }

    fn warm_up_ticks(&mut self, rows: WarmUpRows, control: &Control) -> Result<(), Stop> {
        for port in &mut self.ports {
            port.rest();
        }
        self.clear_commands()?;
        let ticks_per_step = self.ride.tempo.ticks_per_step() as u64;
        // A processor that only waited is slow in its first steps: each tick does the work of one.
        let scratch = match &mut self.side {
            Side::Structure(numerical) => numerical.scratch(),
            Side::Prescribed(_) => None,
        };
        let judged_from = self.limits.warmup_ticks / 2;
        let mut readiness = Readiness::default();
        for k in 0..self.limits.warmup_ticks {
            let is_judged = k >= judged_from;
            let tick = self.tick_at_rest(0.0);
            let mut stamps = TickStamps::default();
            self.wait_before_start(&mut stamps, control)?;
            if k == 0 {
                self.exchange(&tick, &mut stamps, control)?;
            } else {
                self.exchange_again(&tick, &mut stamps, control)?;
            }
            self.warm_up_row(rows, &tick, &stamps);
            self.sequence += 1;
            // Judged is what the test will do: a step in one of its ticks.
            let steps = !is_judged || (k - judged_from).is_multiple_of(ticks_per_step);
            let scratch = scratch.as_ref().filter(|_| steps);
            if let (Side::Structure(numerical), Some(_)) = (&mut self.side, scratch) {
                numerical.try_step(&mut self.ports);
            }
            stamps.ready = stamps.decoded;
            stamps.pushed = self.clock.now();
            self.timing.tick(&stamps);
            // Whom the test asks once a step it does not wait for.
            let waits = self.ports.iter().any(Port::is_per_step);
            if is_judged {
                let waited_ns = u64::from(waits) * stamps.decoded.since(stamps.sent);
                readiness.note(&stamps, waited_ns);
            }
            let undone = scratch.is_some();
            if let (Side::Structure(numerical), Some(scratch)) = (&mut self.side, scratch) {
                numerical.undo(scratch);
            }
            if undone || waits {
                // Which the test will not do: no tick is late for it.
                let now = self.clock.now();
                self.skip_edges_before(now);
            }
        }
        self.hear_if_given_up(control)?;
        self.judge_readiness(&readiness)?;
        for port in &mut self.ports {
            port.begin_test();
            port.is_told_by_steps(true);
            // Warm-up ticks do not count, but for one that has not answered yet.
            if port.partner.measured {
                port.partner.stale = 0;
                port.partner.holding = 0;
            }
        }
        self.clear_commands()
    }
}
