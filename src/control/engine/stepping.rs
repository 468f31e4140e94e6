//! The test itself: tick after tick from target to target, and step after step.
//!
//! A force belongs to the tick in which its target was reached. It is kept until the slowest specimen has replied; then the step
//! is closed: equilibrium, the state of the next step, and its targets. A step is never skipped. At the last target all
//! specimens hold until the last reply is in. A hold of the operator stops test time between two ticks: no step
//! ends by it, and the next tick follows as if there had been none.

use super::cycle::{Engine, Maneuver};
use super::numerical::{Side, seek_along};
use super::order::{Kind, Order, Sends};
use super::phase::Phase;
use super::tick::Tick;
use super::{Ending, Stop};
use crate::port::{PacerTick, Port};
use gusset_numerics::integrate::first_beyond;
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::state::{Digest, Stateful, TestState};
use gusset_record::Event;
use gusset_record::rt::timing::TickStamps;

/// Where the stepping is beside its steps.
#[derive(Debug, Clone, Copy)]
enum Course {
    /// The next tick is one of the test.
    Moves,
    /// A tick of the test has ended: after it a hold may begin.
    MayHold(Tick),
    /// A hold after this tick.
    Holds(Tick),
}

/// The steps of the test.
#[derive(Debug)]
pub(super) struct Stepping {
    course: Course,
    /// The stride that has left.
    stride: PacerTick,
    /// The step of this tick is closed: the outcome of the next step's integration. An offline method that finds no equilibrium
    /// ends the test after the row.
    closed: Option<Result<(), Stop>>,
    /// Room for what elements and methods remember, for the digest of a checkpoint.
    memory: TestState,
}

impl Stepping {
    /// From the target that the specimens are at.
    pub(crate) fn new(side: &mut Side) -> Self {
        // As much as a checkpoint will need.
        let memory = TestState::with_room(|visit| {
            if let Side::Structure(numerical) = side {
                numerical.structure.visit_state(visit);
            }
        });
        Self {
            course: Course::Moves,
            stride: PacerTick::none(),
            closed: None,
            memory,
        }
    }

    /// From the state that was restored after the tick `last`.
    pub(crate) fn after(last: Tick, side: &mut Side) -> Self {
        Self {
            course: Course::MayHold(last),
            ..Self::new(side)
        }
    }

    /// True if a hold has brought test time to a stop after this tick.
    fn comes_to_hold(engine: &Engine<'_>) -> bool {
        let progress = &engine.progress;
        engine.environment.supervision.is_held()
            && progress.pacer().stands()
            && progress.step() <= engine.plan.steps
    }

    /// A hold begins: specimens that are commanded once a step are informed.
    fn begin_hold(engine: &mut Engine<'_>) -> Result<(), Stop> {
        let by_operator = Ending::Stopped(Stop::Operator);
        engine.environment.enter(Phase::Holding, by_operator);
        for (index, port) in engine.ports.iter_mut().enumerate() {
            port.pause()
                .map_err(|fault| Stop::Link { port: index, fault })?;
        }
        Ok(())
    }

    /// The hold is over.
    fn end_hold(engine: &mut Engine<'_>, last: &Tick) -> Result<(), Stop> {
        engine.progress.set_sub_tick(last.sub_tick);
        Self::prepare_next(engine);
        engine.judge_commands()?;
        let by_operator = Ending::Stopped(Stop::Operator);
        engine.environment.enter(Phase::Running, by_operator);
        Ok(())
    }

    /// The next tick of a hold, if test time stands.
    fn hold(&mut self, engine: &mut Engine<'_>) -> Result<Option<Order>, Stop> {
        if let Course::MayHold(after) = self.course {
            self.course = Course::Moves;
            if Self::comes_to_hold(engine) {
                Self::begin_hold(engine)?;
                self.course = Course::Holds(Tick {
                    step: engine.environment.place.steps_done(),
                    dt: 0.0,
                    ..after
                });
            }
        }
        let Course::Holds(tick) = &mut self.course else {
            return Ok(None);
        };
        if engine.environment.supervision.is_held() {
            tick.sub_tick += 1;
            return Ok(Some(Order::new(*tick, Sends::Last, Kind::Hold)));
        }
        let last = *tick;
        self.course = Course::Moves;
        Self::end_hold(engine, &last)?;
        Ok(None)
    }

    /// Equilibrium at the step whose target was reached, and the targets of the next.
    #[inline]
    fn close_step(
        &mut self,
        engine: &mut Engine<'_>,
        order: &mut Order,
        stamps: &mut TickStamps,
    ) -> Result<(), Stop> {
        order.place = Self::place_of_step(engine, &order.tick);
        let place = order.place;
        if let Err(stop) = engine.resolve_poses() {
            engine.record_trip(&place, stamps, &stop);
            return Err(stop);
        }
        if let Side::Structure(numerical) = &mut *engine.side {
            let dt = if place.step == 0 { 0.0 } else { engine.plan.dt };
            numerical.work_ahead(place.step, dt, usize::MAX);
        }
        let row = &mut engine.environment.journal.row;
        row.exchange(&place, Phase::Running, engine.side, engine.ports);
        engine.note_reached();
        self.closed = Some(Self::advance(engine, &place));
        stamps.ready = engine.environment.pace.read();
        engine.accept_step()?;
        if let Side::Structure(numerical) = &mut *engine.side {
            numerical.output_accel();
        }
        engine.environment.journal.row.outputs(engine.side);
        Ok(())
    }

    /// A tick that closes no step.
    fn pass(
        engine: &mut Engine<'_>,
        order: &mut Order,
        stride: &PacerTick,
        stamps: &mut TickStamps,
    ) -> Result<(), Stop> {
        // The step in progress is the last that was closed.
        order.place.step = engine.environment.place.steps_done();
        if engine.progress.keep() {
            engine.ports.iter_mut().for_each(Port::keep);
        }
        let row = &mut engine.environment.journal.row;
        let state = stride.stage.code();
        row.between(&order.place, state, engine.side, engine.ports);
        Self::prepare_next(engine);
        stamps.ready = engine.environment.pace.read();
        engine.accept()
    }
}

impl Maneuver for Stepping {
    #[inline]
    fn next(&mut self, engine: &mut Engine<'_>) -> Result<Option<Order>, Stop> {
        if let Some(order) = self.hold(engine)? {
            return Ok(Some(order));
        }
        let steps = engine.plan.steps;
        if engine.progress.step() > steps {
            // Given up for being late in its very last tick: of a recorded test only the row that comes next tells it.
            if engine
                .ports
                .iter()
                .any(|port| port.exchange().is_recording())
            {
                engine.environment.hear()?;
            }
            return Ok(None);
        }
        let tick = engine.progress.tick(engine.plan.dt);
        let sends = if engine.progress.is_at_the_end(steps) {
            Sends::Last
        } else {
            Sends::Next
        };
        Ok(Some(Order::new(tick, sends, Kind::Test)))
    }

    #[inline]
    fn measured(
        &mut self,
        engine: &mut Engine<'_>,
        order: &mut Order,
        stamps: &mut TickStamps,
    ) -> Result<(), Stop> {
        if order.kind == Kind::Hold {
            return Ok(());
        }
        if engine.progress.arrive() {
            engine
                .ports
                .iter_mut()
                .for_each(|port| port.path_mut().reach());
        }
        self.stride = engine.progress.stride();
        self.closed = None;
        if Self::can_close(engine) {
            self.close_step(engine, order, stamps)
        } else {
            Self::pass(engine, order, &self.stride, stamps)
        }
    }

    #[inline]
    fn recorded(
        &mut self,
        engine: &mut Engine<'_>,
        order: &Order,
        stamps: &mut TickStamps,
    ) -> Result<(), Stop> {
        if order.kind == Kind::Hold {
            engine.reuse_number();
            return Ok(());
        }
        self.course = Course::MayHold(order.tick);
        engine.ports.iter_mut().for_each(Port::pass);
        let place = &order.place;
        engine.progress.count_tick();
        let Some(advanced) = self.closed else {
            Self::note_stage(engine, place, &self.stride);
            if engine.progress.is_at_the_end(engine.plan.steps) {
                // The last command is repeated, and was judged.
                return Ok(());
            }
            return engine.judge_commands();
        };
        engine.environment.place.step_done(place.step);
        Self::note_stage(engine, place, &self.stride);
        Self::note_peaks(engine, place, stamps)?;
        advanced?;
        self.check(engine, order);
        Ok(())
    }
}

impl Stepping {
    /// Makes the next command, unless a hold is complete or no target is left. Real-time: yes.
    #[inline]
    pub(crate) fn prepare_next(engine: &mut Engine<'_>) {
        let held = engine.environment.supervision.is_held();
        let ports = engine.ports.iter_mut();
        match engine.progress.next(held, engine.plan.steps) {
            None => ports.for_each(|port| port.path_mut().hold()),
            Some(stride) => ports.for_each(|port| port.advance(&stride, engine.plan.dt)),
        }
    }

    /// True if the step can be closed: its target is reached, and no specimen owes a reply. Real-time: yes.
    #[inline]
    fn can_close(engine: &Engine<'_>) -> bool {
        let owes =
            |port: &Port| port.exchange().state().owes() || port.exchange().state().is_pending();
        let mut ports = engine.ports.iter();
        engine.progress.has_reached()
            && ports.all(|port| port.exchange().state().is_lost() || !owes(port))
    }

    /// The row's place of the step that is closed in this tick. What was kept for it is taken. Real-time: yes.
    #[inline]
    fn place_of_step(engine: &mut Engine<'_>, tick: &Tick) -> Tick {
        if engine.progress.is_kept() {
            engine.ports.iter_mut().for_each(Port::take_kept);
        }
        Tick::of_step(engine.progress.step(), engine.plan.dt, tick.dt)
    }

    /// Equilibrium at this step, x and v of the next, its targets, and the command that leaves next. Real-time: yes.
    #[inline]
    fn advance(engine: &mut Engine<'_>, place: &Tick) -> Result<(), Stop> {
        match &mut *engine.side {
            Side::Structure(numerical) => {
                let dt = if place.step == 0 { 0.0 } else { engine.plan.dt };
                let made = numerical.make_step(place.step, dt, engine.ports);
                made.map_err(Stop::Step)?;
                let base = numerical.base(place.step + 1);
                let state = &numerical.state;
                for port in &mut *engine.ports {
                    port.seek(&state.disp, &state.vel, base.disp, base.vel);
                }
            }
            Side::Prescribed(histories) => {
                seek_along(histories, place.index() + 1, engine.ports);
            }
            Side::Received(_) => {}
        }
        let share = engine.progress.know_the_next();
        for port in &mut *engine.ports {
            port.know(share);
        }
        Self::prepare_next(engine);
        Ok(())
    }

    /// A change of the pace is an event; that targets become known tick by tick is not. Real-time: yes.
    #[inline]
    fn note_stage(engine: &mut Engine<'_>, tick: &Tick, stride: &PacerTick) {
        if let Some(before) = engine.progress.change_stage(stride.stage) {
            let event = Event::Pace {
                from: before.word().into(),
                to: stride.stage.word().into(),
                share: stride.share,
            };
            engine.environment.report(tick, event);
        }
    }

    /// At times a checkpoint: the state after this step, and its digest. Real-time: yes.
    #[inline]
    fn check(&mut self, engine: &mut Engine<'_>, order: &Order) {
        if engine.progress.is_checkpoint(engine.plan.checkpoint_ticks) {
            self.make_checkpoint(engine, order);
        }
    }

    #[cold]
    fn make_checkpoint(&mut self, engine: &mut Engine<'_>, order: &Order) {
        if engine.plan.keeps_state {
            let mut last = order.tick;
            let (mut state, recorder) = engine.state(&mut last);
            // A state that finds no free buffer is skipped and counted.
            recorder.state(order.place.step, &mut |buffer| {
                buffer.take(|visit| state.visit_state(visit))
            });
        }
        let digest = self.digest(engine);
        let sha256 = None;
        let checkpoint = Event::Checkpoint { digest, sha256 };
        engine.environment.report(&order.place, checkpoint);
    }

    /// A number that says whether the state of the test is the same: of x, v, and what elements and methods remember. Real-time:
    /// yes.
    fn digest(&mut self, engine: &mut Engine<'_>) -> u64 {
        let mut digest = Digest::default();
        digest.add((engine.progress.step() as f64).to_bits());
        if let Side::Structure(numerical) = &mut *engine.side {
            let structure = &mut numerical.structure;
            // The room was made for these values.
            let _ = self.memory.take(|visit| structure.visit_state(visit));
            let state = &numerical.state;
            let parts: [&[f64]; 4] = [
                &state.disp,
                &state.vel,
                &state.weighted_accel,
                &state.memory,
            ];
            for part in parts {
                digest.add_list(part.iter().map(|value| value.to_bits()));
            }
            digest.add_list(self.memory.words().iter().copied());
        }
        for port in &*engine.ports {
            for value in port
                .feedback()
                .force()
                .iter()
                .chain(*port.feedback().disp())
            {
                digest.add(value.to_bits());
            }
        }
        digest.value()
    }

    /// Peaks over all DOFs, and the last look at the state before its command leaves; after the last step none does.
    #[inline]
    fn note_peaks(engine: &mut Engine<'_>, place: &Tick, stamps: &TickStamps) -> Result<(), Stop> {
        if let Side::Structure(numerical) = &*engine.side {
            engine
                .peaks
                .note_rates(&numerical.reported_vel, &numerical.accel);
        }
        if place.step >= engine.plan.steps {
            return Ok(());
        }
        if let Side::Structure(numerical) = &*engine.side {
            let bound = engine.plan.limits.divergence;
            if let Some((dof, value)) = first_beyond(&numerical.state.disp, bound) {
                Self::record_divergence(engine, place, stamps);
                return Err(Stop::Diverged { dof, value, bound });
            }
        }
        // A command that cannot be sent says more than the audit that it spoils.
        engine.judge_commands()?;
        let environment = &mut *engine.environment;
        engine
            .judge
            .judge_step(place, engine.side, engine.ports, environment)
    }

    /// Keeps the row of the step whose displacements are beyond the divergence bound. Its command never leaves: its measurements
    /// are those of the step before.
    #[cold]
    fn record_divergence(engine: &mut Engine<'_>, place: &Tick, stamps: &TickStamps) {
        let dt = engine.plan.dt;
        let next = Tick::of_step(place.step + 1, dt, dt);
        let journal = &mut engine.environment.journal;
        journal.note_trip();
        journal.row.cause = Some(Cause::Diverged);
        journal
            .row
            .exchange(&next, Phase::Tripped, engine.side, engine.ports);
        engine.note_reached();
        engine.keep_last_row(stamps);
    }
}
