//! Exchanges of a specimen that keeps moving between the targets of its controller.
//!
//! While the controller computes, each tick has a command along the prediction. When the target comes, the way leads there, and the answer
//! there is the controller's, taken on the move. What the motion is, and where it slows down, is [`Prediction`]'s.

use super::Trip;
use super::guarded_specimen::{GuardedSpecimen, Origin};
use super::pacing::PacedPath;
use gusset_control::engine::Between;
use gusset_control::port::{Made, Prediction, Refusal};
use gusset_quantity::frame::AtClient;
use gusset_quantity::substructure::{Command, Measurement};
use gusset_quantity::time::Nanos;

/// A tick begins this long before its edge: no wait for bytes is so short.
const MARGIN_NS: u64 = 300_000;

impl GuardedSpecimen {
    /// Moves the specimen to a target of the controller, and returns the answer there. If that is no longer `wanted`, the
    /// specimen comes to rest, and false is returned.
    pub(super) fn go_to(
        &mut self,
        path: &mut PacedPath,
        command: &Command<'_>,
        elapsed: f64,
        wanted: &mut dyn FnMut() -> bool,
        into: &mut Measurement,
    ) -> Result<bool, Trip> {
        let Some(mut prediction) = path.prediction.take() else {
            return Ok(false);
        };
        let outcome = self.go_on_to(path, &mut prediction, (command, elapsed), wanted, into);
        path.prediction = Some(prediction);
        outcome
    }

    fn go_on_to(
        &mut self,
        path: &mut PacedPath,
        prediction: &mut Prediction,
        (command, elapsed): (&Command<'_>, f64),
        wanted: &mut dyn FnMut() -> bool,
        into: &mut Measurement,
    ) -> Result<bool, Trip> {
        if let Err(trip) = self.know(prediction, command, elapsed) {
            // It does not go there.
            self.rest_on_the_way(path, prediction)?;
            self.trip(trip);
            return self.exchange_once(Origin::Controller, command, elapsed, wanted, into);
        }
        path.aim(AtClient(command.disp));
        path.times = [command.time - elapsed, elapsed];
        while wanted() {
            let Some(made) = prediction.next(&mut self.port) else {
                break;
            };
            self.corrections.has_rested = prediction.has_rested();
            self.go(path, made, into)?;
            if made.lands() {
                prediction.reached(&mut self.port);
                self.note_answer(path, command, Some(elapsed));
                return Ok(true);
            }
        }
        self.rest_on_the_way(path, prediction)?;
        path.is_on_the_way = true;
        path.answered = None;
        Ok(false)
    }

    /// Corrects the forces of the last answer by the initial stiffness, for what the specimen lacks to the target; not where it has
    /// rested on the way. Real-time: yes.
    pub(super) fn correct(&mut self, target: &[f64]) {
        let Self {
            identity,
            corrections,
            answer,
            ..
        } = self;
        let n = target.len();
        let most = identity.corrects_at_most;
        let (values, energy) = corrections.values.split_at_mut(n);
        for (row, (value, unit)) in values.iter_mut().zip(&identity.scale.units).enumerate() {
            let lacks = target.iter().zip(&answer.disp).enumerate();
            let force = lacks.map(|(column, (target, measured))| {
                let stiffness = identity.stiffness.get(column * n + row);
                stiffness.copied().unwrap_or(0.0) * (target - measured)
            });
            let newtons = unit.newtons * force.sum::<f64>();
            let before = *value;
            *value = if corrections.has_rested {
                0.0
            } else {
                newtons.clamp(-most, most)
            };
            let place = |values: &[f64]| values.get(row).copied().unwrap_or(0.0);
            let moved = unit.metres * (place(target) - place(&corrections.target));
            for energy in &mut *energy {
                *energy += f64::midpoint(before, *value) * moved;
            }
        }
        for (force, (value, unit)) in answer
            .force
            .iter_mut()
            .zip(values.iter().zip(&identity.scale.units))
        {
            *force += *value / unit.newtons;
        }
        corrections.target.copy_from_slice(target);
        self.test.note_corrections(&self.corrections.values);
    }

    /// The target is known, if the way there and on from it keeps the limits.
    fn know(
        &mut self,
        prediction: &mut Prediction,
        command: &Command<'_>,
        elapsed: f64,
    ) -> Result<(), Trip> {
        self.seek_target(command)?;
        let ticks = prediction.ticks();
        prediction
            .know(&mut self.port, elapsed)
            .map_err(|refusal| match refusal {
                Refusal::Ahead(ahead) => Trip::FarAhead(ahead),
                Refusal::Place(hit) => Trip::Limit(hit),
                Refusal::Limit(hit, slower) => Trip::TooFast {
                    hit,
                    ticks: (f64::from(ticks) * slower).ceil() as u32,
                },
            })
    }

    /// Sends the command that was made, on the way from the last target.
    fn go(&mut self, path: &mut PacedPath, made: Made, into: &mut Measurement) -> Result<(), Trip> {
        if std::mem::replace(&mut path.is_owed, true) {
            self.accept_on_the_way()?;
        }
        let period_s = path.pacing.period_s();
        let [time, elapsed] = &mut path.times;
        if made.share < path.share {
            // A last way to rest has passed the target.
            *time += *elapsed;
            path.share = 0.0;
        }
        let (time, elapsed) = (*time, *elapsed);
        let gone = (made.share - path.share).max(0.0) * elapsed;
        path.share = made.share;
        let theirs = Command {
            sequence: path.sequence,
            time: time + made.share * elapsed,
            dt: period_s,
            disp: path.rests(),
            vel: &path.vel,
        };
        let origin = Origin::Predicted {
            period_s,
            stage: made.stage,
            lands: made.lands(),
        };
        let exchanged = self.exchange_once(origin, &theirs, gone, &mut || true, into);
        path.count();
        let has_rested = std::mem::take(&mut path.has_rested);
        if exchanged.is_ok() && self.test.was_late() && !has_rested {
            self.misses_edge();
        }
        exchanged.map(|_| ())
    }

    /// The specimen comes to rest as soon as it gently can. Nothing happens where it rests.
    fn rest_on_the_way(
        &mut self,
        path: &mut PacedPath,
        prediction: &mut Prediction,
    ) -> Result<(), Trip> {
        prediction.end();
        let mut into = Measurement::zeros(path.rests().len());
        while let Some(made) = prediction.next(&mut self.port) {
            self.between.add(Between::UNWANTED);
            self.go(path, made, &mut into)?;
        }
        Ok(())
    }

    /// The controller's test ends: a specimen that still moves comes to rest.
    pub(crate) fn come_to_rest(&mut self) {
        if self.tripped().is_some() {
            return;
        }
        let Some(mut path) = self.path.take() else {
            return;
        };
        if path.is_first {
            self.path = Some(path);
            return;
        }
        if let Some(mut prediction) = path.prediction.take() {
            // A specimen that is lost cannot be led.
            let _ = self.rest_on_the_way(&mut path, &mut prediction);
            path.prediction = Some(prediction);
        }
        self.path = Some(path);
    }

    /// Lets the specimen go on by a tick while no target is known, if one is due. Returns when the next is; none if nothing
    /// moves before a target comes.
    pub(crate) fn go_on(&mut self) -> Result<Option<Nanos>, Trip> {
        if self.tripped().is_some() {
            return Ok(None);
        }
        let Some(mut path) = self.path.take() else {
            return Ok(None);
        };
        let outcome = self.go_on_along(&mut path);
        self.path = Some(path);
        outcome
    }

    fn go_on_along(&mut self, path: &mut PacedPath) -> Result<Option<Nanos>, Trip> {
        let Some(prediction) = path.prediction.as_mut().filter(|_| !path.is_first) else {
            return Ok(None);
        };
        if prediction.stands() {
            path.has_rested = true;
            return Ok(None);
        }
        let edge = self.test.next_edge();
        let now = path.pacing.clock.now_ns;
        if self.foretold.is_none() && (now)() + MARGIN_NS < edge.0 {
            return Ok(Some(Nanos(edge.0 - MARGIN_NS)));
        }
        let Some(made) = prediction.next(&mut self.port) else {
            path.has_rested = true;
            return Ok(None);
        };
        let mut into = std::mem::replace(&mut path.on_the_way, Measurement::zeros(0));
        let gone = self.go(path, made, &mut into);
        path.on_the_way = into;
        gone.map(|()| Some(Nanos(self.test.next_edge().0.saturating_sub(MARGIN_NS))))
    }

    /// True if the specimen keeps moving between targets.
    pub(crate) fn predicts(&self) -> bool {
        let path = self.path.as_ref();
        path.is_some_and(|path| path.pacing.predict.is_some())
    }
}
