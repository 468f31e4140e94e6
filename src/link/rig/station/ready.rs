//! Before a controller's first command: connection, comparison of estimates, direction, arming.

use super::attempt::Origin;
use super::{Station, USUAL_TICK_S, metres, not_finite};
use crate::catalog::event::Remark;
use crate::link::rig::settings::{ProbeSettings, TestEnd};
use crate::link::rig::{Visitor, Wanted, apart, elsewhere};
use crate::port::{Opinion, Pace, Probe, compare_stiffness};
use crate::rt::os;
use crate::substructure::{Command, Introduction, Measurement};
use crate::units::{AxisUnits, position, signed_in_axis_unit};

const WHILE: &str = "while its direction was tried";

impl Station {
    pub(super) fn get_ready(
        &mut self,
        visitor: &Visitor,
        wanted: &mut Wanted<'_>,
    ) -> Result<Vec<String>, TestEnd> {
        let mut told = Vec::new();
        if let Some(log) = &self.log {
            told.push(format!("recording into {}", log.path().display()));
        }
        let introduction = self.rig.connect(visitor, wanted)?;
        if self.rig.is_remote() {
            let text = format!("specimen \"{}\": {}", self.name, introduction.peer);
            self.note(Remark::Connected, &introduction.peer);
            told.push(text);
        }
        for warning in self.doubts(&introduction)? {
            self.note(Remark::Warning, &warning);
        }
        if introduction.repeats_the_command && !self.needs_measured_disp.is_empty() {
            let text = format!(
                "its end does not say that it measures displacement. What it sends as such may be the command, and {} would compare \
                 the command with itself: let the end of the link measure displacement and announce it, or do without",
                self.needs_measured_disp.join(", ")
            );
            return Err(text.into());
        }
        if introduction.repeats_the_command {
            let text = "its end does not say that it measures displacement: what is passed on as measured may be the command";
            self.note(Remark::Warning, text);
        }
        // What is measured is never quite what was commanded: the first command is judged as a step from there.
        if !introduction.measured
            && let Some(text) = elsewhere(&introduction.standing, &visitor.start)
        {
            return Err(text.into());
        }
        let start = self.start(visitor, &introduction);
        self.stands = visitor.start.is_empty().then(|| start.clone());
        if visitor.start.is_empty() && start.iter().any(|disp| *disp != 0.0) {
            told.push(format!(
                "the specimen is at {}: the first command is judged as a step from there",
                self.in_words(&start)
            ));
        }
        if let ProbeSettings::Motion {
            amplitude,
            pace,
            forgets,
        } = self.probe.clone()
        {
            told.push(self.try_direction(&start, &amplitude, (pace, forgets), wanted)?);
            self.guard.watch.rests();
        }
        // Who does not say where the first command will be may ask before it. What nobody has measured is no answer.
        let n = start.len();
        let is_felt = self.rig.is_remote()
            && visitor.start.is_empty()
            && introduction.standing.len() == n
            && introduction.force.len() != n;
        let felt = if is_felt {
            Some(self.feel(&start, wanted)?)
        } else {
            None
        };
        self.arm(visitor.first_sequence, &start, wanted)?;
        let is_measured = introduction.measured && introduction.standing.len() == start.len();
        let stands = if is_measured {
            &introduction.standing
        } else {
            &start
        };
        if is_measured {
            let stands = metres(&self.units, stands);
            self.guard.watch.is_found_at(stands);
        }
        if !visitor.start.is_empty() {
            self.begins_at(visitor.first_sequence, &visitor.start);
        }
        self.leaves = self.moves.then(|| metres(&self.units, stands).collect());
        self.rig.at_rest(&mut self.measured);
        if let Some(force) = felt {
            // The place stays as commands count, whatever its sensor reads: a client may begin its test there.
            self.measured.force = force;
        }
        match not_finite(&self.measured.disp, &self.measured.force) {
            Some(axis) => {
                let axis = axis + 1;
                Err(format!("axis {axis}: the force at rest is no number").into())
            }
            None => {
                self.sound.disp.clone_from(&self.measured.disp);
                self.sound.force.clone_from(&self.measured.force);
                Ok(told)
            }
        }
    }

    /// Where the first command leads away from: where the controller says that it will be, else where the specimen says
    /// that it stands, else what it is found at.
    fn start(&mut self, visitor: &Visitor, introduction: &Introduction) -> Vec<f64> {
        let axes = self.units.len();
        for known in [&visitor.start, &introduction.standing] {
            if known.len() == axes {
                return known.clone();
            }
        }
        self.rig.at_rest(&mut self.measured);
        self.measured.disp.clone()
    }

    /// A place, axis after axis.
    pub(super) fn in_words(&self, place: &[f64]) -> String {
        let axes = place.iter().zip(&self.units);
        let words: Vec<_> = axes
            .map(|(disp, units)| position(*disp, units.disp))
            .collect();
        words.join(", ")
    }

    /// What the specimen says of itself beside what is believed of it.
    fn doubts(&self, introduction: &Introduction) -> Result<Vec<String>, String> {
        let n = self.units.len();
        let mut doubts = introduction.warnings.clone();
        let theirs = introduction.stiffness.iter().step_by(n + 1);
        let ours = self.stiffness.iter().step_by(n + 1);
        for (number, ((theirs, ours), units)) in (1..).zip(theirs.zip(ours).zip(&self.units)) {
            let AxisUnits { disp, force, .. } = units;
            match compare_stiffness(*theirs, *ours) {
                Opinion::Agrees => {}
                Opinion::Differs => doubts.push(format!(
                    "axis {number} reports a stiffness of {theirs:e} {force}/{disp}, the file says {ours:e} \
                     {force}/{disp}"
                )),
                Opinion::Reversed => {
                    return Err(format!(
                        "axis {number} reports a stiffness of {theirs:e} {force}/{disp} where {ours:e} {force}/{disp} is \
                         expected: a channel is reversed; look at the wiring"
                    ));
                }
            }
        }
        if self.probe == (ProbeSettings::Unchecked { silent: false }) && !introduction.simulated {
            doubts.push(
                "NOTHING CHECKS WHICH WAY ROUND THE SPECIMEN IS WIRED: give `probe_m` in [specimen.link] for a small \
                 motion before each test, or say `probe = \"none\"`"
                    .to_owned(),
            );
        }
        Ok(doubts)
    }

    /// The small motion that shows the direction of each axis, and its judgement. Whoever does not want the test any more ends
    /// the motion where it is, and it is told where.
    fn try_direction(
        &mut self,
        start: &[f64],
        amplitude: &[f64],
        pacing: (Pace, bool),
        wanted: &mut Wanted<'_>,
    ) -> Result<String, TestEnd> {
        self.passed_on.clear();
        let tried = self.move_a_little(start, amplitude, pacing, wanted);
        tried.map_err(|TestEnd { cause, text }| {
            if apart(&self.passed_on, start).is_none() {
                return TestEnd { cause, text };
            }
            let left = format!(
                "it was led to {}, from {}",
                self.in_words(&self.passed_on),
                self.in_words(start)
            );
            self.warn_once(Remark::LeftAside, &format!("{WHILE}: {left}"));
            let text = format!("{text}; {left}");
            TestEnd { cause, text }
        })
    }

    fn move_a_little(
        &mut self,
        start: &[f64],
        amplitude: &[f64],
        (pace, forgets): (Pace, bool),
        wanted: &mut Wanted<'_>,
    ) -> Result<String, TestEnd> {
        let n = self.units.len();
        let diagonal: Vec<f64> = self.stiffness.iter().step_by(n + 1).copied().collect();
        let mut probe = Probe::new(start, amplitude, &diagonal, &self.units, pace);
        self.note(Remark::Probing, "a small motion and back, axis after axis");
        self.arm(0, start, wanted)?;
        let (mut disp, mut vel) = (start.to_vec(), vec![0.0; n]);
        let mut edge = os::monotonic_ns();
        let mut measured = Measurement::zeros(n);
        let mut sequence = 0;
        while probe.next(&mut disp, &mut vel) {
            let command = Command {
                sequence,
                time: 0.0,
                dt: 0.0,
                disp: &disp,
                vel: &vel,
            };
            let period_s = pace.period_ns as f64 * 1e-9;
            self.try_one(WHILE, (&command, period_s), wanted, &mut measured)?;
            probe.take(&measured.disp, &measured.force);
            if !forgets {
                // What moved has moved: a rig that hears of no step would take the way back for one that is taken back.
                let accepted = self.rig.commit();
                accepted.map_err(|fault| format!("{WHILE}: {fault}"))?;
            }
            sequence += 1;
            // An answer that came late is no reason to go faster.
            edge = (edge + pace.period_ns).max(os::monotonic_ns());
            os::sleep_until_ns(edge);
        }
        let found = probe.verdict().map_err(|misfit| misfit.to_string())?;
        let axes = found.iter().map(|axis| {
            let units = self.units.get(axis.axis).unwrap_or(&AxisUnits::SI);
            format!(
                "axis {}: {} gave {}",
                axis.axis + 1,
                signed_in_axis_unit(axis.disp, units.disp),
                signed_in_axis_unit(axis.force, units.force)
            )
        });
        let text = format!("direction: {}", axes.collect::<Vec<_>>().join("; "));
        self.note(Remark::Direction, &text);
        Ok(text)
    }

    /// The force that one command at the very place where it stands is answered with: nothing moves.
    fn feel(&mut self, stands: &[f64], wanted: &mut Wanted<'_>) -> Result<Vec<f64>, TestEnd> {
        self.arm(0, stands, wanted)?;
        let command = Command {
            sequence: 0,
            time: 0.0,
            dt: 0.0,
            disp: stands,
            vel: &vec![0.0; stands.len()],
        };
        let mut measured = Measurement::zeros(stands.len());
        let when = "where it stands";
        self.try_one(when, (&command, USUAL_TICK_S), wanted, &mut measured)?;
        Ok(measured.force)
    }

    /// One own exchange before the test, with the seconds that its motion takes.
    fn try_one(
        &mut self,
        when: &str,
        (command, period_s): (&Command<'_>, f64),
        wanted: &mut Wanted<'_>,
        measured: &mut Measurement,
    ) -> Result<(), TestEnd> {
        wanted()?;
        let mut unwanted = None;
        let mut is_wanted = || wanted().map_err(|over| unwanted = Some(over)).is_ok();
        let outcome = self.exchange_as(
            Origin::Own { period_s },
            command,
            0.0,
            &mut is_wanted,
            measured,
        );
        match (unwanted, outcome) {
            (Some(over), _) => Err(over),
            (None, Err(trip)) => Err(format!("{when}: {}", self.whole(trip)).into()),
            (None, Ok(_)) => Ok(()),
        }
    }

    /// The controller begins anew after commands that only tried the specimen: a formula forgets them. May block, for as long
    /// as that is `wanted`.
    ///
    /// # Errors
    /// The specimen is not ready, or gone, or need not be ready.
    pub fn begin_again(
        &mut self,
        sequence: u64,
        start: &[f64],
        wanted: &mut Wanted<'_>,
    ) -> Result<(), TestEnd> {
        self.note(Remark::ArmedAgain, "the controller begins again");
        self.arm(sequence, start, wanted)?;
        self.begins_at(sequence, start);
        Ok(())
    }

    /// The controller said that its first command will be here.
    fn begins_at(&mut self, sequence: u64, start: &[f64]) {
        self.begins = self.moves.then(|| (sequence, start.to_vec()));
    }

    pub(super) fn arm(
        &mut self,
        sequence: u64,
        start: &[f64],
        wanted: &mut Wanted<'_>,
    ) -> Result<(), TestEnd> {
        if !self.is_lasting() {
            self.guard.forget();
        }
        self.guard.arm(sequence, metres(&self.units, start));
        (self.goes_on_from, self.runs) = (None, false);
        if let Some(announced) = &mut self.announced {
            announced.begin(&self.guard.watch);
        }
        let mut unwanted = None;
        let mut is_wanted = || wanted().map_err(|over| unwanted = Some(over)).is_ok();
        let outcome = self.rig.arm(sequence, start, &mut is_wanted);
        if let Some(over) = unwanted {
            return Err(over);
        }
        outcome.map(|_| ()).map_err(|fault| {
            let why = self.rig.complaint().unwrap_or_default();
            let between = if why.is_empty() { "" } else { ": " };
            TestEnd::failed(format_args!("not armed: {fault}{between}{why}"))
        })
    }
}
