//! Before a controller's first command: connection, comparison with the file, wiring check, arming.

use super::first_command::begins_elsewhere;
use super::guarded_specimen::{GuardedSpecimen, Origin, not_finite};
use super::link_maker::LinkMaker;
use super::pacing::Pacing;
use super::{Controller, ROUNDING, TestEnd, Trip, USUAL_TICK_S, Wanted, apart, elsewhere_by};
use gusset_control::engine::{Operator, Stop};
use gusset_control::port::{WayBack, Wiring, WiringCheck};
use gusset_quantity::catalog::event::Remark;
use gusset_quantity::frame::{AtAxis, AtClient};
use gusset_quantity::substructure::{Command, Introduction, Measurement, Retirement};
use gusset_quantity::units::{AxisUnits, in_axis_unit, signed_in_axis_unit};
use gusset_record::Ready;
use gusset_record::lasting::Place;
use gusset_record::rt::wall::Wall;
use gusset_record::utc::rfc3339;

const WHILE: &str = "while its direction was tried";

/// Prepares a specimen for a controller's first command.
pub(super) struct Readiness<'a> {
    served: &'a mut GuardedSpecimen,
    links: Option<&'a LinkMaker>,
    controller: &'a Controller,
    /// Messages for the operator of the server.
    told: Vec<String>,
}

impl<'a> Readiness<'a> {
    pub(crate) const fn new(
        served: &'a mut GuardedSpecimen,
        links: Option<&'a LinkMaker>,
        controller: &'a Controller,
    ) -> Self {
        Self {
            served,
            links,
            controller,
            told: Vec::new(),
        }
    }

    /// Connects the specimen, checks its wiring if required, and arms it. Blocks as long as the test is `wanted`.
    ///
    /// # Errors
    /// Why the test cannot begin.
    pub(crate) fn reach(
        mut self,
        wanted: &mut Wanted<'_>,
    ) -> Result<(Vec<String>, Ready), TestEnd> {
        self.told.extend(self.served.recording.place());
        let introduction = self.connect(wanted)?;
        let asked = self.served.place_for(AtClient(&self.controller.start))?;
        self.compare(&introduction, &asked)?;
        let start = self.start(&introduction, asked.part(Vec::as_slice))?;
        let names_start = !self.controller.start.is_empty();
        self.served.first.stands = (!names_start).then(|| start.clone());
        if !names_start && start.iter().any(|disp| *disp != 0.0) {
            self.told.push(format!(
                "the specimen is at {}: the first command is judged as a step from there",
                self.served.identity.in_words(&start)
            ));
        }
        let is_probed = matches!(
            self.served.port.startup().wiring(),
            WiringCheck::Probe { .. }
        );
        if is_probed {
            self.judge_start(&introduction, start.part(Vec::as_slice))?;
        }
        self.record_place(&introduction, &start)?;
        if is_probed {
            self.check_wiring(start.part(Vec::as_slice), wanted)?;
            self.served.port.has_come_to_rest();
        }
        if self.served.pacing().is_some() {
            // The ramp to the first target takes its least time only if the place is known.
            self.served
                .port
                .startup_mut()
                .report_position(start.part(Vec::as_slice));
        }
        let felt = self.feel(start.part(Vec::as_slice), &introduction, wanted)?;
        self.served.arm(
            self.controller.first_sequence,
            start.part(Vec::as_slice),
            wanted,
        )?;
        self.take_place(start.part(Vec::as_slice), &introduction);
        let rest = self.take_rest(&introduction, felt)?;
        let ready = self.ready(introduction, &rest);
        Ok((self.told, ready))
    }

    /// Everything with which the test begins, for its record.
    fn ready(&self, introduction: Introduction, rest: &Measurement) -> Ready {
        let (controller, identity) = (self.controller, &self.served.identity);
        let limits = controller.limits.iter().map(|axis| {
            let bounds = [axis.disp_min, axis.disp_max, axis.speed_max, axis.force_max];
            bounds.map(|bound| bound.is_finite().then_some(bound))
        });
        let rest = rest.disp.iter().zip(&rest.force);
        Ready {
            specimen: identity.name.clone(),
            remembers: identity.remembers,
            moves: identity.moves,
            first: controller.first_sequence,
            rate: controller.rate.map(|(above, below)| [above, below]),
            start: controller.start.clone(),
            limits: limits.collect(),
            standing: introduction.standing,
            measured: introduction.measured,
            force: introduction.force,
            at_rest: rest.map(|(disp, force)| [*disp, *force]).collect(),
        }
    }

    /// The link of this test, and the introduction of the specimen.
    fn connect(&mut self, wanted: &mut Wanted<'_>) -> Result<Introduction, TestEnd> {
        let rate = self.controller.rate.filter(|(commands, _)| *commands > 0);
        let every = rate.map_or(0.0, |(commands, seconds)| seconds as f64 / commands as f64);
        let pacing = self.served.pacing();
        if let Some(pacing) = pacing.filter(|pacing| every > 0.0 && pacing.step_s() > every) {
            let text = format!(
                "the controller sends a target every {every} s, and `serve.pace` takes {} s for each: lower `ticks_per_step`, or let \
                 the controller run slower",
                pacing.step_s()
            );
            return Err(TestEnd::failed(text));
        }
        let every = pacing.map_or(every, Pacing::period_s);
        let introduction = match self.links {
            Some(links) => self.connect_link(links, wanted)?,
            None => self
                .served
                .port
                .exchange_mut()
                .connect()
                .map_err(|error| TestEnd::failed(error.text))?,
        };
        self.served.port.exchange_mut().commanded_every(every);
        if self.served.port.exchange().is_remote() {
            let Introduction { peer, .. } = &introduction;
            let name = &self.served.identity.name;
            self.told.push(format!("specimen \"{name}\": {peer}"));
            self.served.note(Remark::Connected, peer);
        }
        Ok(introduction)
    }

    fn connect_link(
        &mut self,
        links: &LinkMaker,
        wanted: &mut Wanted<'_>,
    ) -> Result<Introduction, TestEnd> {
        let (mut link, introduction) = links.connect(self.controller, wanted)?;
        let (found, axes) = (link.axes(), self.served.port.axes());
        if found != axes {
            link.retire(Retirement::Tripped);
            let text = format!("the link has {found} axes, the specimen {axes}");
            return Err(text.into());
        }
        // From here on the specimen learns how the test ends.
        let before = self.served.port.swap_partner(link);
        before.map_err(|error| error.to_string())?;
        links.located(introduction)
    }

    /// Compares the specimen's introduction with the file.
    fn compare(&mut self, introduction: &Introduction, asked: &[f64]) -> Result<(), TestEnd> {
        let GuardedSpecimen { identity, port, .. } = &mut *self.served;
        let doubts = port.meet(introduction, |axis| {
            let AxisUnits {
                metres, newtons, ..
            } = identity.scale.port_units(axis);
            newtons / metres
        });
        let doubts = doubts.map_err(|refusal| TestEnd::failed(refusal.text))?;
        for warning in introduction.warnings.iter().chain(&doubts) {
            self.served.note(Remark::Warning, warning);
        }
        if let Some(text) = self.served.port.lacks_measured_disp(introduction) {
            return Err(text.into());
        }
        if introduction.repeats_the_command && self.served.identity.corrects_at_most > 0.0 {
            let text = "`correct` in `serve.pace` needs a measured displacement, and the end of this specimen repeats the command";
            return Err(TestEnd::failed(text));
        }
        if introduction.repeats_the_command {
            let text = "its end does not say that it measures displacement: what is passed on as measured may be the command";
            self.served.note(Remark::Warning, text);
            self.served.measures_no_disp(introduction);
        }
        // A measured position differs a little from each command: the first command is judged as a step from the measured one.
        if !introduction.measured
            && let Some(text) = elsewhere_by(&introduction.standing, asked, self.rounding())
        {
            return Err(text.into());
        }
        Ok(())
    }

    /// Largest rounding error of the controller's converted numbers.
    const fn rounding(&self) -> f64 {
        if self.served.identity.scale.is_of_axes() {
            0.0
        } else {
            ROUNDING
        }
    }

    /// Start of the first command: the announced place, else the reported position of the specimen. A computed specimen
    /// that does not report its position is assumed at zero.
    ///
    /// # Errors
    /// The actuators of a loading unit cannot have this position.
    fn start(
        &self,
        introduction: &Introduction,
        asked: AtAxis<&[f64]>,
    ) -> Result<AtAxis<Vec<f64>>, TestEnd> {
        let axes = self.served.port.axes();
        let known = [asked, AtAxis(&introduction.standing)];
        let known = known.into_iter().find(|known| known.len() == axes);
        let start = AtAxis(known.map_or_else(|| vec![0.0; axes], |known| known.to_vec()));
        let scale = &self.served.identity.scale;
        let posed = scale.disp_at(&self.served.port, start.part(Vec::as_slice));
        posed
            .map_err(|fault| TestEnd::failed(format_args!("where the specimen stands: {fault}")))?;
        Ok(start)
    }

    /// A wiring check begins at `start`: where the specimen was measured, no farther away than a first command may go.
    ///
    /// # Errors
    /// The controller expects the specimen elsewhere.
    fn judge_start(
        &self,
        introduction: &Introduction,
        start: AtAxis<&[f64]>,
    ) -> Result<(), TestEnd> {
        let Introduction {
            measured, standing, ..
        } = introduction;
        if !measured || standing.len() != start.len() {
            return Ok(());
        }
        let served = &*self.served;
        let Some(hit) = begins_elsewhere(&served.port, [AtAxis(standing), start]) else {
            return Ok(());
        };
        let text = format!(
            "the controller begins at {}, but {} was measured: axis {} may begin {} away at most. Correct the first displacement of the \
             controller, or the zero of the sensor",
            served.identity.in_words(&start),
            served.identity.in_words(standing),
            hit.axis + 1,
            in_axis_unit(hit.bound, "m")
        );
        Err(TestEnd::failed(text))
    }

    /// Records the position of a specimen before its first motion.
    ///
    /// # Errors
    /// It cannot be recorded.
    fn record_place(&self, introduction: &Introduction, start: &[f64]) -> Result<(), TestEnd> {
        let is_computed = self.links.is_some_and(LinkMaker::is_of_a_computation);
        if introduction.simulated || is_computed || !self.served.port.exchange().is_remote() {
            return Ok(());
        }
        let Controller { test, peer, .. } = self.controller;
        let what = match test.as_str() {
            "" => format!("a client at {peer}"),
            test => format!("\"{test}\" of {peer}"),
        };
        let units = self.served.identity.scale.axis_units();
        let place = Place {
            what,
            runs: Vec::new(),
            at: rfc3339(Wall::now().0),
            units: units.iter().map(|unit| unit.disp.to_owned()).collect(),
            began: start.to_vec(),
            left: Vec::new(),
        };
        self.served.latch.begins(place).map_err(TestEnd::failed)
    }

    /// A small motion shows the sign of each axis. An unwanted test ends the motion, which returns to its start; the message
    /// gives the position if it does not reach it.
    fn check_wiring(
        &mut self,
        start: AtAxis<&[f64]>,
        wanted: &mut Wanted<'_>,
    ) -> Result<(), TestEnd> {
        let checked = self.move_a_little(start, wanted);
        let rounding = self.rounding();
        let text = checked.map_err(|TestEnd { cause, text, .. }| {
            let served = &mut *self.served;
            let told = served.test.told();
            if apart(&told, &start, rounding).is_none() {
                return TestEnd::of(cause, text);
            }
            let left = format!(
                "it was led to {}, from {}",
                served.identity.in_words(&told),
                served.identity.in_words(&start)
            );
            served.warn(Remark::LeftAside, &format!("{WHILE}: {left}"));
            let text = format!("{text}; {left}");
            TestEnd::of(cause, text)
        })?;
        self.told.push(text);
        Ok(())
    }

    fn move_a_little(
        &mut self,
        start: AtAxis<&[f64]>,
        wanted: &mut Wanted<'_>,
    ) -> Result<String, TestEnd> {
        self.served.port.startup_mut().report_position(start);
        self.served.arm(0, start, wanted)?;
        let mut unwanted: Option<TestEnd> = None;
        let mut client = || {
            let over = wanted().err()?;
            let word = match (&unwanted, over.is_at_once) {
                (_, true) => Some(Operator::Stop),
                (None, false) => Some(Operator::Interrupt),
                (Some(_), false) => None,
            };
            unwanted.get_or_insert(over);
            word
        };
        let served = &mut *self.served;
        let text = "wiring check: each axis moves a little and back";
        served.recording.log_beside_an_event(&served.store, text);
        let holds = served.port.exchange().count().holds;
        let checked = served.test.check_wiring(&mut served.port, &mut client);
        served.warn_of_holds(holds);
        if let Some((axis, way_back)) = served.test.way_back() {
            let axis = axis + 1;
            let text = match way_back {
                WayBack::Complete => {
                    format!("{WHILE}: axis {axis} went back to where it began")
                }
                WayBack::Force(other) => format!(
                    "{WHILE}: axis {axis} rests on its way back: the force of axis {} left the range that it had passed",
                    other + 1
                ),
                WayBack::Incomplete => format!("{WHILE}: axis {axis} rests on its way back"),
            };
            served.recording.warn_beside_an_event(&served.store, &text);
        }
        match (checked, unwanted) {
            (Ok(_), Some(over)) => Err(over),
            (Ok(Some(wiring)), None) => Ok(self.agreed(&wiring)),
            (Ok(None), None) => Ok(String::new()),
            (Err(Stop::Operator), Some(over)) => {
                served.record_end_of_check(None);
                Err(over)
            }
            (Err(Stop::Misfit { misfit, .. }), _) => Err(misfit.to_string().into()),
            (Err(stop), _) => {
                let mut trip = stop.into();
                if let Trip::NotFinite { axis, measured } = &mut trip
                    && *measured
                {
                    let raw = served.port.feedback().raw();
                    *axis = not_finite(&raw.disp, &raw.force);
                }
                served.record_end_of_check(Some(trip));
                Err(format!("{WHILE}: {}", served.whole(trip)).into())
            }
        }
    }

    /// The result of a check, for the operator of the server.
    fn agreed(&mut self, wiring: &Wiring) -> String {
        if !wiring.accepted.is_empty()
            && let Some(reason) = self.served.port.startup().wiring().accepted()
        {
            self.served.recording.accept_wiring(reason);
        }
        for fault in &wiring.accepted {
            let text = format!("`safety.accept_wiring` accepts: {fault}");
            let served = &mut *self.served;
            served.recording.warn_beside_an_event(&served.store, &text);
        }
        let axes = wiring.found.iter().map(|axis| {
            let units = self.served.identity.scale.port_units(axis.axis);
            format!(
                "axis {}: {} gave {}",
                axis.axis + 1,
                signed_in_axis_unit(axis.disp, units.disp),
                signed_in_axis_unit(axis.force, units.force)
            )
        });
        format!("direction: {}", axes.collect::<Vec<_>>().join("; "))
    }

    /// The force at one command at the present position: nothing moves. A controller that does not announce its first command
    /// may request it before that. An unmeasured force is not an answer.
    fn feel(
        &mut self,
        stands: AtAxis<&[f64]>,
        introduction: &Introduction,
        wanted: &mut Wanted<'_>,
    ) -> Result<Option<Vec<f64>>, TestEnd> {
        let n = stands.len();
        let is_felt = self.served.port.exchange().is_remote()
            && self.controller.start.is_empty()
            && introduction.standing.len() == n
            && introduction.force.len() != n;
        if !is_felt {
            return Ok(None);
        }
        self.served.arm(0, stands, wanted)?;
        let command = Command {
            sequence: 0,
            time: 0.0,
            dt: 0.0,
            disp: &self.served.port.deformations_at(stands),
            vel: &vec![0.0; n],
        };
        let mut unwanted = None;
        let mut is_wanted = || wanted().map_err(|over| unwanted = Some(over)).is_ok();
        if !is_wanted() {
            return Err(unwanted.unwrap_or_else(TestEnd::told_to_stop));
        }
        let mut measured = Measurement::zeros(n);
        let origin = Origin::Own {
            period_s: USUAL_TICK_S,
        };
        let served = &mut *self.served;
        let outcome = served.exchange_as(origin, &command, 0.0, &mut is_wanted, &mut measured);
        match (unwanted, outcome) {
            (Some(over), _) => Err(over),
            (None, Err(trip)) => Err(format!("where it stands: {}", served.whole(trip)).into()),
            (None, Ok(_)) => Ok(Some(measured.force)),
        }
    }

    /// Takes the position before the first command: the measured one if there is one.
    fn take_place(&mut self, start: AtAxis<&[f64]>, introduction: &Introduction) {
        let is_measured = introduction.measured && introduction.standing.len() == start.len();
        let stands = if is_measured {
            AtAxis(introduction.standing.as_slice())
        } else {
            start
        };
        if is_measured {
            self.served.port.guard_mut().is_found_at(stands);
        }
        if !self.controller.start.is_empty() {
            self.served.begins_at(self.controller.first_sequence, start);
        }
        let moves = self.served.identity.moves;
        self.served.first.leaves = moves.then(|| AtAxis(stands.to_vec()));
    }

    /// Answers that are possible before the first command.
    fn take_rest(
        &mut self,
        introduction: &Introduction,
        felt: Option<Vec<f64>>,
    ) -> Result<Measurement, TestEnd> {
        let served = &mut *self.served;
        let mut rest = Measurement::zeros(served.port.axes());
        if !served.port.exchange_mut().at_rest(&mut rest) {
            let disp = rest.disp.iter_mut().zip(&introduction.standing);
            let force = rest.force.iter_mut().zip(&introduction.force);
            disp.chain(force).for_each(|(to, stands)| *to = *stands);
        }
        if let Some(force) = felt {
            // The place stays as commands count, whatever its sensor reads: a client may begin its test there.
            rest.force = force;
        }
        if let Some(axis) = not_finite(&rest.disp, &rest.force) {
            let of = format!("axis {}", axis + 1);
            return Err(Self::is_no_number(served, Some(axis), &of));
        }
        let GuardedSpecimen {
            identity,
            port,
            answer,
            ..
        } = &mut *served;
        let posed = port.take_at_rest(&rest);
        let posed = posed.and_then(|()| identity.scale.answer(port, answer));
        let posed = posed.map_err(|fault| format!("where the specimen stands: {fault}"))?;
        match posed {
            None => Ok(rest),
            Some(signal) => {
                let of = format!("displacement {}", signal + 1);
                Err(Self::is_no_number(served, None, &of))
            }
        }
    }

    /// The trip of a force at rest that is NaN or infinite.
    fn is_no_number(served: &mut GuardedSpecimen, axis: Option<usize>, of: &str) -> TestEnd {
        let measured = true;
        served.trip(Trip::NotFinite { axis, measured });
        format!("{of}: the force at rest is no number").into()
    }
}
