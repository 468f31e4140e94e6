//! Faults of actuator, specimen and sensors.
//!
//! Invariant: a fault that does not concern the present command leaves command and measurement unchanged, to the last
//! bit.

use std::collections::VecDeque;

use super::dice::Dice;
use gusset_config::fault_script::{Channel, Fault, Kind, MEMORY, Place, Script};
use gusset_quantity::substructure::{
    Command, Coupling, Freshness, Introduction, LinkFault, LinkStats, Measurement, Retirement,
    Status, Substructure, Unavailable,
};
use gusset_quantity::time::Nanos;
use gusset_quantity::units::AxisUnits;

/// The stream of chance at the bench.
const STREAM: u64 = 2;

/// A specimen on which a script is played.
pub(crate) struct Bench {
    specimen: Box<dyn Substructure>,
    faults: Vec<Fault>,
    units: Vec<AxisUnits>,
    dice: Dice,
    /// Which faults apply to the present command.
    happen: Vec<bool>,
    first: u64,
    /// Wall time in s from one command to the next, and the command that was committed last; from `first`.
    period: Option<f64>,
    committed: Option<u64>,
    number: u64,
    /// Position of the actuators: committed, and as last tried.
    place: Vec<f64>,
    tried: Vec<f64>,
    /// The present command, and whether a fault concerns it.
    command: CommandAtHand,
    vel: Vec<f64>,
    /// The last measurement of the sensors.
    said: Measurement,
    past: VecDeque<(u64, Vec<f64>)>,
    complaint: Option<String>,
}

/// A command whose answer was not taken.
#[derive(Debug, Default)]
struct CommandAtHand {
    sequence: u64,
    time: f64,
    dt: f64,
    disp: Vec<f64>,
    vel: Vec<f64>,
    is_concerned: bool,
}

impl std::fmt::Debug for Bench {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bench")
            .field("faults", &self.faults)
            .finish_non_exhaustive()
    }
}

impl Bench {
    /// `specimen`, which counts in `units`, with the faults of `script` that happen there; itself where none does.
    #[must_use]
    pub(crate) fn around(
        specimen: Box<dyn Substructure>,
        script: &Script,
        units: Vec<AxisUnits>,
    ) -> Box<dyn Substructure> {
        if script.faults_at(Place::Rig).is_empty() {
            specimen
        } else {
            Box::new(Self::new(specimen, script, units))
        }
    }

    fn new(specimen: Box<dyn Substructure>, script: &Script, units: Vec<AxisUnits>) -> Self {
        let axes = specimen.axes();
        let faults = script.faults_at(Place::Rig);
        Self {
            specimen,
            happen: vec![false; faults.len()],
            faults,
            units,
            dice: Dice::new(script.seed, STREAM),
            first: 0,
            period: None,
            committed: None,
            number: 0,
            place: vec![0.0; axes],
            tried: vec![0.0; axes],
            command: CommandAtHand {
                disp: vec![0.0; axes],
                vel: vec![0.0; axes],
                ..CommandAtHand::default()
            },
            vel: vec![0.0; axes],
            said: Measurement::zeros(axes),
            past: VecDeque::new(),
            complaint: None,
        }
    }

    /// Throws the dice for every fault that concerns a command; true if any happens to it.
    fn throw(&mut self, number: u64) -> bool {
        for (happens, fault) in self.happen.iter_mut().zip(&self.faults) {
            let probability = fault.probability.unwrap_or(1.0);
            *happens = fault.concerns(number) && self.dice.happens(probability);
        }
        self.happen.contains(&true)
    }

    /// The faults of the present command.
    fn happening(&self) -> impl Iterator<Item = &Fault> {
        happening(&self.faults, &self.happen)
    }

    /// Wall time in s since the command that was committed last; by a protocol without a rate `elapsed`, which is test time.
    fn since_committed(&self, elapsed: f64) -> f64 {
        let commands = match self.committed {
            Some(committed) => self.number.saturating_sub(committed),
            None => 1,
        };
        self.period
            .map_or(elapsed, |period| commands as f64 * period)
    }

    /// Moves the actuators for the command `self.tried`.
    fn actuate(&mut self, number: u64, elapsed: f64) {
        let elapsed = self.since_committed(elapsed);
        for fault in happening(&self.faults, &self.happen) {
            let axes = self.tried.iter_mut().zip(&self.place).zip(&self.units);
            for (axis, ((to, place), units)) in axes.enumerate() {
                if fault.axis.is_some_and(|only| only != axis + 1) {
                    continue;
                }
                match fault.kind {
                    Kind::Frozen => *to = *place,
                    Kind::Stroke { disp_m } => {
                        let end = disp_m / units.metres;
                        *to = to.clamp(-end, end);
                    }
                    Kind::Rate { vel_m_per_s } => {
                        let way = vel_m_per_s * elapsed / units.metres;
                        *to = to.clamp(place - way, place + way);
                    }
                    Kind::Lag { commands } => {
                        let old = number.saturating_sub(commands as u64);
                        let then = self.past.iter().rev().find(|(when, _)| *when <= old);
                        let then = then.or(self.past.front());
                        *to = then
                            .and_then(|(_, disp)| disp.get(axis))
                            .copied()
                            .unwrap_or(*place);
                    }
                    _ => {}
                }
            }
        }
    }

    /// Stands where the force is too large; true if an axis does.
    fn stalls(&mut self, force: &[f64]) -> bool {
        let mut stalls = false;
        for fault in happening(&self.faults, &self.happen) {
            let Kind::ForceLimit { force_n } = fault.kind else {
                continue;
            };
            let axes = self.tried.iter_mut().zip(&self.place).zip(&self.units);
            for (axis, (((to, place), units), force)) in axes.zip(force).enumerate() {
                let meant = fault.axis.is_none_or(|only| only == axis + 1);
                if meant && (force * units.newtons).abs() > force_n && to != place {
                    *to = *place;
                    stalls = true;
                }
            }
        }
        stalls
    }

    /// Writes what the sensors measure.
    fn sense(&mut self, number: u64, into: &mut Measurement) {
        for fault in happening(&self.faults, &self.happen) {
            match fault.kind {
                Kind::Interlock => into.status.0 |= Status::INTERLOCK.0,
                Kind::Saturated => into.status.0 |= Status::SATURATED.0,
                _ => {}
            }
            let age = (number - fault.at.unwrap_or(0) + 1) as f64;
            let said = self.said.disp.iter().zip(&self.said.force);
            let axes = into.disp.iter_mut().zip(&mut into.force).zip(said);
            for (axis, (((disp, force), (said_disp, said_force)), units)) in
                axes.zip(&self.units).enumerate()
            {
                if fault.axis.is_some_and(|only| only != axis + 1) {
                    continue;
                }
                let each = |channel: Channel, disp: &mut f64, force: &mut f64, to: [f64; 2]| {
                    if channel != Channel::Force {
                        *disp = to[0];
                    }
                    if channel != Channel::Disp {
                        *force = to[1];
                    }
                };
                match fault.kind {
                    Kind::Stuck { channel } => {
                        each(channel, disp, force, [*said_disp, *said_force]);
                    }
                    Kind::Dropout { channel } => each(channel, disp, force, [0.0; 2]),
                    Kind::Reversed { channel } => {
                        let to = [-*disp, -*force];
                        each(channel, disp, force, to);
                    }
                    Kind::Bias { disp_m, force_n } => {
                        *disp += disp_m / units.metres;
                        *force += force_n / units.newtons;
                    }
                    Kind::Drift { disp_m, force_n } => {
                        *disp += age * disp_m / units.metres;
                        *force += age * force_n / units.newtons;
                    }
                    Kind::Noise { disp_m, force_n } => {
                        *disp += (2.0 * self.dice.uniform() - 1.0) * disp_m / units.metres;
                        *force += (2.0 * self.dice.uniform() - 1.0) * force_n / units.newtons;
                    }
                    Kind::Gain { factor } => *force *= factor,
                    Kind::NotANumber => *force = f64::NAN,
                    _ => {}
                }
            }
        }
    }

    fn remember(&mut self, number: u64, disp: &[f64]) {
        if self.past.back().is_some_and(|(last, _)| *last >= number) {
            return;
        }
        if self.past.len() > MEMORY {
            self.past.pop_front();
        }
        self.past.push_back((number, disp.to_vec()));
    }
}

/// Those of `faults` that happen.
fn happening<'a>(faults: &'a [Fault], happen: &'a [bool]) -> impl Iterator<Item = &'a Fault> {
    let pairs = faults.iter().zip(happen);
    pairs.filter_map(|(fault, happens)| happens.then_some(fault))
}

/// Describes a specimen that is not where the test expects it.
fn elsewhere(disp_m: f64, axis: Option<usize>) -> String {
    let which = axis.map_or_else(|| "every axis".to_owned(), |axis| format!("axis {axis}"));
    format!("the specimen is not where the test expects it: {which} is {disp_m} m away")
}

fn copy(to: &mut [f64], from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}

impl Bench {
    /// Sends the actuators where they go, with velocities that fit.
    fn drive(&mut self) -> Result<(), LinkFault> {
        let CommandAtHand {
            sequence,
            time,
            dt,
            disp: asked,
            vel: wanted,
            ..
        } = &self.command;
        let pairs = self.vel.iter_mut().zip(wanted).zip(&self.tried);
        for (((vel, wanted), to), (asked, place)) in pairs.zip(asked.iter().zip(&self.place)) {
            *vel = if to == asked {
                *wanted
            } else if *dt > 0.0 {
                (to - place) / dt
            } else {
                0.0
            };
        }
        self.specimen.issue(&Command {
            sequence: *sequence,
            time: *time,
            dt: *dt,
            disp: &self.tried,
            vel: &self.vel,
        })
    }
}

impl Substructure for Bench {
    fn axes(&self) -> usize {
        self.specimen.axes()
    }

    fn coupling(&self) -> Coupling {
        self.specimen.coupling()
    }

    fn is_remote(&self) -> bool {
        self.specimen.is_remote()
    }

    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        self.specimen.connect()
    }

    fn commanded_every(&mut self, seconds: f64) {
        self.period = (seconds > 0.0).then_some(seconds);
        self.specimen.commanded_every(seconds);
    }

    fn arm(
        &mut self,
        sequence: u64,
        start: &[f64],
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, LinkFault> {
        let found = self.faults.iter().find_map(|fault| match fault.kind {
            Kind::Elsewhere { disp_m } => Some(elsewhere(disp_m, fault.axis)),
            _ => None,
        });
        if found.is_some() {
            self.complaint = found;
            return Err(LinkFault::Refused);
        }
        self.first = sequence;
        self.committed = None;
        copy(&mut self.place, start);
        copy(&mut self.said.disp, start);
        self.said.force.fill(0.0);
        self.past.clear();
        self.specimen.arm(sequence, start, wanted)
    }

    fn at_rest(&mut self, into: &mut Measurement) -> bool {
        self.specimen.at_rest(into)
    }

    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        let number = command.sequence.saturating_sub(self.first);
        self.number = number;
        let is_concerned = self.throw(number);
        if self.happening().any(|fault| fault.kind == Kind::Goodbye) {
            self.complaint = Some("the specimen's end has been switched off".to_owned());
            return Err(LinkFault::Closed);
        }
        copy(&mut self.tried, command.disp);
        let at_hand = &mut self.command;
        (at_hand.sequence, at_hand.is_concerned) = (command.sequence, is_concerned);
        (at_hand.time, at_hand.dt) = (command.time, command.dt);
        copy(&mut at_hand.disp, command.disp);
        copy(&mut at_hand.vel, command.vel);
        let mut faults = self.faults.iter();
        if faults.any(|fault| matches!(fault.kind, Kind::Lag { .. })) {
            self.remember(number, command.disp);
        }
        if !is_concerned {
            return self.specimen.issue(command);
        }
        self.actuate(number, command.dt);
        self.drive()
    }

    fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        self.specimen.is_answered(wait_ns)
    }

    fn collect(&mut self, deadline: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        into.status = Status::default();
        let mut answer = self.specimen.collect(deadline, into)?;
        if self.command.is_concerned {
            if self.stalls(&into.force) {
                self.drive()?;
                answer = self.specimen.collect(deadline, into)?;
            }
            self.sense(self.number, into);
        }
        copy(&mut self.said.disp, &into.disp);
        copy(&mut self.said.force, &into.force);
        Ok(answer)
    }

    fn accepted(&mut self, sequence: u64) -> Result<(), LinkFault> {
        copy(&mut self.place, &self.tried);
        self.committed = Some(self.number);
        self.specimen.accepted(sequence)
    }

    fn revert(&mut self) {
        self.specimen.revert();
    }

    fn tangent(&self, stiffness: &mut [f64]) -> bool {
        self.specimen.tangent(stiffness)
    }

    fn attend(&mut self) -> Result<(), LinkFault> {
        self.specimen.attend()
    }

    fn pause(&mut self) -> Result<(), LinkFault> {
        self.specimen.pause()
    }

    fn halt(&mut self) -> Result<(), LinkFault> {
        self.specimen.halt()
    }

    fn stats(&self) -> LinkStats {
        self.specimen.stats()
    }

    fn complaint(&self) -> Option<String> {
        self.complaint.clone().or_else(|| self.specimen.complaint())
    }

    fn retire(&mut self, how: Retirement) {
        self.specimen.retire(how);
    }

    fn last_words(&self) -> Option<String> {
        self.specimen.last_words()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::served::Computed;
    use gusset_actuator::specimen::SpecimenLaw;
    use gusset_numerics::law::LawSpec;

    /// A spring of 1000 N/m in millimetres and newtons, played with these faults.
    fn play(kinds: &[(Option<u64>, Option<u64>, Kind)], commands: &[f64]) -> Vec<(f64, f64)> {
        let spec: LawSpec = toml::from_str("linear = { stiffness_n_per_m = 1.0 }").unwrap();
        let rig = Computed::new(SpecimenLaw::Law(spec).build(1).unwrap(), false);
        let fault = |(at, lasts, kind): &(Option<u64>, Option<u64>, Kind)| Fault {
            at: *at,
            lasts: *lasts,
            axis: None,
            on: None,
            probability: None,
            kind: *kind,
        };
        let script = Script {
            fault: kinds.iter().map(fault).collect(),
            ..Script::default()
        };
        gusset_config::check_script(&script, Some(1)).unwrap();
        let units = AxisUnits {
            metres: 1e-3,
            ..AxisUnits::SI
        };
        let mut bench = Bench::around(Box::new(rig), &script, vec![units]);
        bench.arm(5, &[0.0], &mut || true).unwrap();
        let mut into = Measurement::zeros(1);
        let each = commands.iter().zip(5..).map(|(disp, sequence)| {
            let command = Command {
                sequence,
                time: 0.0,
                dt: 0.1,
                disp: &[*disp],
                vel: &[0.0],
            };
            bench.issue(&command).unwrap();
            bench.collect(Nanos(0), &mut into).unwrap();
            bench.accepted(sequence).unwrap();
            (into.disp[0], into.force[0])
        });
        each.collect()
    }

    /// Result of the commands at 10 Hz, by a script of one fault, with a controller whose test time runs a tenth as
    /// fast.
    fn go(fault: Fault, commands: &[f64]) -> Result<Vec<f64>, String> {
        let spec: LawSpec = toml::from_str("linear = { stiffness_n_per_m = 1.0 }").unwrap();
        let law = SpecimenLaw::Law(spec).build(1).unwrap();
        let script = Script {
            seed: 3,
            fault: vec![fault],
            ..Script::default()
        };
        gusset_config::check_script(&script, Some(1)).unwrap();
        let rig = Box::new(Computed::new(law, false));
        let mut bench = Bench::around(rig, &script, vec![AxisUnits::SI]);
        bench.commanded_every(0.1);
        let complaint = |bench: &dyn Substructure| bench.complaint().unwrap_or_default();
        if bench.arm(0, &[0.0], &mut || true).is_err() {
            return Err(complaint(&*bench));
        }
        let mut into = Measurement::zeros(1);
        let mut went = Vec::new();
        for (disp, sequence) in commands.iter().zip(0..) {
            let command = Command {
                sequence,
                time: 0.0,
                dt: 0.01,
                disp: &[*disp],
                vel: &[0.0],
            };
            let tried = bench.issue(&command);
            if tried.is_err() {
                return Err(complaint(&*bench));
            }
            bench.collect(Nanos(0), &mut into).unwrap();
            bench.accepted(sequence).unwrap();
            went.push(into.disp[0]);
        }
        Ok(went)
    }

    fn certain(kind: Kind) -> Fault {
        Fault {
            at: None,
            lasts: None,
            axis: None,
            on: None,
            probability: None,
            kind,
        }
    }

    #[test]
    fn probabilistic_fault_hits_some_commands() {
        let commands: Vec<f64> = (1..=200).map(|k| 0.1 * f64::from(k)).collect();
        for kind in [
            Kind::Frozen,
            Kind::Stroke { disp_m: 1e-3 },
            Kind::Rate { vel_m_per_s: 1e-3 },
            Kind::ForceLimit { force_n: 1e-3 },
            Kind::Lag { commands: 1 },
        ] {
            let fault = Fault {
                probability: Some(0.25),
                ..certain(kind)
            };
            let went = go(fault, &commands).unwrap();
            let kept = went.iter().zip(&commands).filter(|(to, asked)| to == asked);
            // 150 of 200, with a deviation of 6.
            assert!((120..180).contains(&kept.count()), "{kind:?}");
        }
        let goodbye = Fault {
            probability: Some(0.01),
            ..certain(Kind::Goodbye)
        };
        assert!(go(goodbye, &commands[..1]).is_ok());
    }

    #[test]
    fn a_slow_actuator_is_slow_in_wall_time() {
        let slow = certain(Kind::Rate { vel_m_per_s: 0.5 });
        assert_eq!(
            go(slow.clone(), &[0.04, 0.08, 0.04]).unwrap(),
            [0.04, 0.08, 0.04]
        );
        assert_eq!(go(slow, &[0.04, 0.5]).unwrap(), [0.04, 0.04 + 0.05]);
    }

    #[test]
    fn wrong_place_is_reported() {
        let fault = Fault {
            axis: Some(1),
            ..certain(Kind::Elsewhere { disp_m: 0.005 })
        };
        let said = go(fault, &[0.0]).unwrap_err();
        assert!(said.ends_with("0.005 m away"), "{said}");
    }

    const WAY: [f64; 6] = [0.0, 1.0, 2.0, 3.0, 2.0, 0.0];

    #[test]
    fn failed_actuator_affects_the_specimen() {
        let disp = |kind| -> Vec<f64> {
            let said = play(&[(Some(1), Some(4), kind)], &WAY);
            assert!(said.iter().all(|(disp, force)| disp == force));
            said.iter().map(|(disp, _)| *disp).collect()
        };
        assert_eq!(disp(Kind::Frozen), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let stroke = Kind::Stroke { disp_m: 1.5e-3 };
        assert_eq!(disp(stroke), [0.0, 1.0, 1.5, 1.5, 1.5, 0.0]);
        let rate = Kind::Rate { vel_m_per_s: 5e-3 };
        assert_eq!(disp(rate), [0.0, 0.5, 1.0, 1.5, 2.0, 0.0]);
        let lag = Kind::Lag { commands: 2 };
        assert_eq!(disp(lag), [0.0, 0.0, 0.0, 1.0, 2.0, 0.0]);
        let weak = Kind::ForceLimit { force_n: 2.5 };
        assert_eq!(disp(weak), [0.0, 1.0, 2.0, 2.0, 2.0, 0.0]);
    }

    #[test]
    fn failed_sensor_leaves_the_specimen_alone() {
        let said = |kind| play(&[(Some(2), Some(2), kind)], &WAY);
        let true_one: Vec<_> = WAY.iter().map(|disp| (*disp, *disp)).collect();
        let changed = |kind, at_2: (f64, f64), at_3: (f64, f64)| {
            let mut expected = true_one.clone();
            (expected[2], expected[3]) = (at_2, at_3);
            assert_eq!(said(kind), expected, "{kind:?}");
        };
        let stuck = |channel| Kind::Stuck { channel };
        changed(stuck(Channel::Both), (1.0, 1.0), (1.0, 1.0));
        changed(stuck(Channel::Disp), (1.0, 2.0), (1.0, 3.0));
        let dropout = Kind::Dropout {
            channel: Channel::Force,
        };
        changed(dropout, (2.0, 0.0), (3.0, 0.0));
        let reversed = Kind::Reversed {
            channel: Channel::Both,
        };
        changed(reversed, (-2.0, -2.0), (-3.0, -3.0));
        let bias = Kind::Bias {
            disp_m: 1e-3,
            force_n: 7.0,
        };
        changed(bias, (3.0, 9.0), (4.0, 10.0));
        let drift = Kind::Drift {
            disp_m: 0.0,
            force_n: 0.5,
        };
        changed(drift, (2.0, 2.5), (3.0, 4.0));
        changed(Kind::Gain { factor: -2.0 }, (2.0, -4.0), (3.0, -6.0));
    }

    #[test]
    fn noise_is_bounded_and_repeatable() {
        let noise = [(
            None,
            None,
            Kind::Noise {
                disp_m: 0.0,
                force_n: 0.25,
            },
        )];
        let said = play(&noise, &WAY);
        assert_eq!(said, play(&noise, &WAY));
        for ((disp, force), true_one) in said.iter().zip(WAY) {
            assert!(*disp == true_one && (force - true_one).abs() <= 0.25);
        }
        assert!(
            said.iter()
                .zip(WAY)
                .any(|((_, force), other)| *force != other)
        );
    }
}
