//! The running test: tick after tick, from target to target.
//!
//! With one tick a step every tick reaches a target. With more, or while the operator's hold eases in or out, or while a
//! slow partner owes its answer, there are ticks in between: the command goes along its way ([`crate::port::StepPacer`]), the loop never waits. A force belongs to the tick in which its target was reached; it is kept
//! until the slowest partner has answered. At the last target everybody stands until the last answer is in.

use super::numerical::Side;
use super::operator::Control;
use super::tick::Tick;
use super::{Engine, Stop};
use crate::port::{PacerTick, Port, Stage, StepPacer};
use crate::record::{Event, GridOf};
use crate::rt::timing::TickStamps;
use crate::substructure::LinkFault;
use crate::time::Nanos;

/// How the integration and the ticks of the controller belong together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pacing {
    /// Ticks of one step.
    pub ticks_per_step: u32,
    /// Ticks in which a hold comes to rest and the test comes to its pace again; 0: at once.
    pub ease_ticks: u32,
    /// Ticks from one checkpoint to the next, at least.
    pub checkpoint_ticks: u64,
}

impl Default for Pacing {
    /// A step every tick, holds at once, no checkpoints.
    fn default() -> Self {
        Self {
            ticks_per_step: 1,
            ease_ticks: 0,
            checkpoint_ticks: u64::MAX,
        }
    }
}

/// Where the loop is between two targets.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ride {
    pub tempo: StepPacer,
    /// The same before the stride that stands ready.
    pub before: StepPacer,
    /// The way of the command that stands ready.
    pub stride: PacerTick,
    /// Step whose target is on the way, or reached and not closed yet.
    pub step: u64,
    /// True if it is reached.
    pub reached: bool,
    /// True if what belongs to it was kept some ticks ago.
    pub kept: bool,
    /// Ticks since the last step was closed.
    pub sub_tick: u64,
    /// Ticks since the last checkpoint.
    pub unchecked: u64,
    pub stage: Stage,
}

impl Ride {
    pub fn new(pacing: Pacing) -> Self {
        let mut tempo = StepPacer::new(pacing.ticks_per_step, pacing.ease_ticks);
        tempo.know();
        Self {
            tempo,
            before: tempo,
            // The specimens are at the first target already.
            stride: PacerTick::none(),
            step: 0,
            reached: false,
            kept: false,
            sub_tick: 0,
            unchecked: 0,
            stage: Stage::Correct,
        }
    }

    /// The tick of the command that stands ready, with steps of `dt`. Real-time: yes.
    #[inline]
    fn tick(&self, dt: f64) -> Tick {
        let lands = self.stride.lands() && !self.reached;
        let last = if self.reached {
            self.step
        } else {
            self.step.saturating_sub(1)
        };
        let time = if lands {
            self.step as f64 * dt
        } else {
            (last as f64 + self.stride.share) * dt
        };
        let closes_at_best = lands || self.reached;
        Tick {
            step: if closes_at_best { self.step } else { last },
            sub_tick: self.sub_tick,
            time,
            dt: self.stride.length * dt,
        }
    }
}

/// A partner that is commanded once a step is told its target as soon as that is known; else there is nothing to say. In a
/// hold of the operator (`holds`) nothing moves: it is told afterwards. That the others stand and wait for it is none.
/// Real-time: yes.
pub(super) fn tell(
    port: &mut Port,
    sequence: u64,
    step: u64,
    dt: f64,
    holds: bool,
) -> Result<(), LinkFault> {
    if port.has_pending_target() && !holds {
        let passed = if step == 0 { 0.0 } else { dt };
        return port.tell_target(sequence, step as f64 * dt, passed);
    }
    port.skip_command();
    Ok(())
}

/// False if the answer of a partner that is commanded once a step is not here, or not owed. Real-time: yes.
pub(super) fn has_answer(
    port: &mut Port,
    now: Nanos,
    patience_ns: u64,
    simulated: bool,
) -> Result<bool, LinkFault> {
    if !port.owes() {
        port.attend()?;
        return Ok(false);
    }
    // A socket has a wall clock of its own: under the simulated clock it is waited for.
    if (simulated && port.is_remote()) || port.is_answered(0)? {
        return Ok(true);
    }
    let asked_at = port.look_for_answer(now);
    if now.since(asked_at) > patience_ns {
        return Err(LinkFault::Timeout);
    }
    Ok(false)
}

impl Engine {
    /// From the first target to the last. Test time goes on from where a resumed test stood.
    pub(super) fn all_steps(&mut self, control: &Control) -> Result<(), Stop> {
        // The first edge of the test is one that can be met, whatever came before.
        self.skip_edges_before(self.clock.now());
        self.first_edge = self.schedule.tick(self.edge);
        self.report_grid(GridOf::Test);
        // A hold that was asked for before: nothing moves until the operator goes on.
        if self.hold_wanted {
            self.ride.tempo.stand();
        }
        self.riding = true;
        let result = self.ride_on(control);
        self.riding = false;
        for port in &mut self.ports {
            port.is_told_by_steps(false);
        }
        result
    }

    fn ride_on(&mut self, control: &Control) -> Result<(), Stop> {
        while self.ride.step <= self.steps {
            let mut stamps = TickStamps::default();
            self.wait_for_edge(&mut stamps, control)?;
            let stalled = self.stretch_after_stall(stamps.woke.since(stamps.release), 0);
            self.row.lateness.skipped_by_wakeup = stalled;
            let tick = self.ride.tick(self.dt);
            self.tick(&tick, &mut stamps, control)?;
            self.close_tick(&tick, stamps, stalled)?;
            if self.hold_wanted && self.ride.tempo.stands() && self.ride.step <= self.steps {
                self.stand(&tick, control)?;
            }
        }
        // Given up for being late in its very last tick: of a recorded test only the row that comes next tells it.
        if self.ports.iter().any(Port::is_recorded) {
            self.hear(control)?;
        }
        Ok(())
    }

    /// The command that has just left: if it is at its target, what was measured belongs to that. Real-time: yes.
    #[inline]
    pub(super) fn arrive(&mut self) {
        if self.ride.reached || !self.ride.stride.lands() {
            return;
        }
        self.ride.reached = true;
        self.ride.tempo.begin();
        for port in &mut self.ports {
            port.reach();
        }
    }

    /// True if the step can be closed: its target is reached, and nobody owes an answer. Real-time: yes.
    #[inline]
    pub(super) fn can_close(&self) -> bool {
        let owes = |port: &Port| port.owes() || port.has_pending_target();
        let mut ports = self.ports.iter();
        self.ride.reached && ports.all(|port| port.is_lost() || !owes(port))
    }

    /// The row's place of the step that is closed in this tick. What was kept for it is taken. Real-time: yes.
    #[inline]
    pub(super) fn step_of(&mut self, tick: &Tick) -> Tick {
        if self.ride.kept {
            for port in &mut self.ports {
                port.take_kept();
            }
        }
        let step = self.ride.step;
        Tick {
            step,
            sub_tick: 0,
            time: step as f64 * self.dt,
            dt: tick.dt,
        }
    }

    /// The next targets are known: from here on the commands go there. Real-time: yes.
    #[inline]
    pub(super) fn know_the_next(&mut self) {
        self.ride.step += 1;
        self.ride.reached = false;
        self.ride.kept = false;
        self.ride.sub_tick = 0;
        let share = self.ride.tempo.share();
        self.ride.tempo.know();
        for port in &mut self.ports {
            port.know(share);
        }
        self.prepare_next();
    }

    /// True if the last target is reached and its step not closed: somebody owes an answer, and there is nowhere to go on to.
    /// Real-time: yes.
    #[inline]
    pub(super) const fn is_at_the_end(&self) -> bool {
        self.ride.reached && self.ride.step >= self.steps
    }

    /// Makes the next command, unless a hold is complete or no target is left. Real-time: yes.
    #[inline]
    pub(super) fn prepare_next(&mut self) {
        self.ride.before = self.ride.tempo;
        self.ride.sub_tick += 1;
        if self.is_at_the_end() {
            self.ride.tempo.stand();
        }
        let holds = self.hold_wanted || self.is_at_the_end();
        self.ride.stride = self.ride.tempo.next(holds);
        if holds && self.ride.tempo.stands() {
            for port in &mut self.ports {
                port.hold_compensation();
            }
            return;
        }
        for port in &mut self.ports {
            port.advance(&self.ride.stride, self.dt);
        }
    }

    /// A tick that closes no step. Real-time: yes.
    pub(super) fn pass(&mut self, tick: &Tick, stamps: &mut TickStamps) -> Result<(), Stop> {
        let stride = self.ride.stride;
        // The step in progress is the last that was closed.
        let step = self.steps_done;
        let tick = Tick { step, ..*tick };
        if self.ride.reached && !self.ride.kept {
            self.ride.kept = true;
            for port in &mut self.ports {
                port.keep();
            }
        }
        self.row
            .between(&tick, stride.stage.code(), &self.side, &self.ports);
        self.prepare_next();
        stamps.ready = self.clock.now();
        self.accept()?;
        self.row
            .timing(stamps, self.first_edge, self.schedule.stretched());
        self.ride.unchecked += 1;
        self.held_back.clear();
        if !self.keep_row() {
            self.report(&tick, Event::RowLost);
        }
        self.note_stage(&tick, &stride);
        if self.is_at_the_end() {
            // The last command is repeated, and was cleared.
            return Ok(());
        }
        self.clear_commands()
    }

    /// A change of the pace is an event; that targets become known tick by tick is not. Real-time: yes.
    #[inline]
    pub(super) fn note_stage(&mut self, tick: &Tick, stride: &PacerTick) {
        let stage = stride.stage;
        let slow = |stage| stage == Stage::SlowDown;
        if slow(stage) != slow(self.ride.stage) {
            self.report(
                tick,
                Event::Pace {
                    from: self.ride.stage.word().into(),
                    to: stage.word().into(),
                    share: stride.share,
                },
            );
        }
        self.ride.stage = stage;
    }

    /// The way begins where the first command is.
    pub(super) fn begin_ride(&mut self) {
        for port in &mut self.ports {
            port.begin_way();
        }
    }

    /// A number that says whether the state of the test is the same: of x, v, and what elements and methods remember. FNV-1a
    /// over the bits. Real-time: yes, once the buffer has its size.
    pub(super) fn digest(&mut self) -> u64 {
        let mut hash = Fnv::default();
        hash.take(self.ride.step as f64);
        if let Side::Structure(numerical) = &self.side {
            let state = &numerical.state;
            self.memory.clear();
            numerical.structure.freeze(&mut self.memory);
            let parts: [&[f64]; 5] = [
                &state.disp,
                &state.vel,
                &state.weighted_accel,
                &state.memory,
                &self.memory,
            ];
            for part in parts {
                for value in part.iter().step_by(part.len() / SAMPLED + 1) {
                    hash.take(*value);
                }
            }
        }
        for port in &self.ports {
            for value in port.force().iter().chain(port.measured()) {
                hash.take(*value);
            }
        }
        hash.0
    }

    /// Now and then a checkpoint: what the state was after this step. Real-time: yes.
    #[inline]
    pub(super) fn check(&mut self, tick: &Tick) {
        self.ride.unchecked += 1;
        if self.ride.unchecked < self.checkpoint_ticks {
            return;
        }
        self.ride.unchecked = 0;
        let digest = self.digest();
        self.report(tick, Event::Checkpoint { digest });
    }
}

/// Of long vectors so many values are hashed, evenly spread: a checkpoint must not cost a deadline.
const SAMPLED: usize = 1024;

/// FNV-1a, 64 bits at a time: quick, and good enough against damage and mistakes; not against malice.
struct Fnv(u64);

impl Default for Fnv {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv {
    fn take(&mut self, value: f64) {
        let mixed = (self.0 ^ value.to_bits()).wrapping_mul(0x0000_0100_0000_01b3);
        // The product carries nothing downwards: without this the low bits would never see the high ones.
        self.0 = mixed ^ (mixed >> 32);
    }
}
