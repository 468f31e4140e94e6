//! A test continues from each state that it saved as if it had never been interrupted: with the same rows, events and states.

use std::path::Path;
use std::sync::{Arc, Mutex};

use crate::common::engine::prepare;
use crossbeam_channel::{Receiver, Sender, bounded};
use gusset_actuator::compensation::CompensationSpec;
use gusset_control::engine::{Connected, Control, Ending, Experiment, Operator, Phase};
use gusset_control::port::{Axis, AxisSpec, Compensation, PortSpec, TrackingSpec};
use gusset_quantity::state::{StateError, Stateful, TestState, Visit};
use gusset_quantity::substructure::{
    Command, Coupling, Freshness, LinkFault, Measurement, Retirement, Status, Substructure,
};
use gusset_quantity::time::{Nanos, SimClock};
use gusset_record::{Column, Event, Recorder, TimedEvent};

/// A state, and how many rows and events there were before it.
type Saved = (usize, usize, TestState);

/// Rows, events and states of a test.
#[derive(Default)]
struct Record {
    rows: Vec<Vec<f64>>,
    events: Vec<TimedEvent>,
    states: Vec<Saved>,
}

/// Largest |force| of each axis of each specimen.
type Peaks = Vec<Vec<f64>>;

/// The operator's command after a row of this step, tick and phase.
type Says = fn(u64, u64, Phase) -> Option<Operator>;

/// A recorder that keeps everything, and speaks for the operator.
struct Keeper {
    record: Arc<Mutex<Record>>,
    room: Option<TestState>,
    says: Says,
    line: Sender<Operator>,
}

impl Recorder for Keeper {
    fn row(&mut self, row: &[f64]) -> bool {
        let phases = [Phase::Zeroing, Phase::Holding];
        let phase = phases.into_iter().find(|phase| phase.code() == row[2]);
        let phase = phase.unwrap_or(Phase::Running);
        if let Some(word) = (self.says)(row[0] as u64, row[1] as u64, phase) {
            self.line.send(word).unwrap();
        }
        let rows = &mut self.record.lock().unwrap().rows;
        rows.push(row.to_vec());
        assert!(rows.len() < 50_000, "the test does not end");
        true
    }

    fn event(&mut self, event: TimedEvent) -> bool {
        self.record.lock().unwrap().events.push(event);
        true
    }

    fn allocate_states(&mut self, room: &TestState) {
        self.room = Some(room.with_same_room());
    }

    fn state(
        &mut self,
        _: u64,
        take: &mut dyn FnMut(&mut TestState) -> Result<(), StateError>,
    ) -> bool {
        let mut state = self.room.as_ref().unwrap().with_same_room();
        take(&mut state).unwrap();
        let record = &mut *self.record.lock().unwrap();
        let place = (record.rows.len(), record.events.len(), state);
        record.states.push(place);
        true
    }
}

/// A test that can be begun again and again, with a checkpoint every `checkpoint_ticks` ticks.
struct Test<'a> {
    make: &'a dyn Fn() -> Experiment,
    checkpoint_ticks: u64,
    says: Says,
}

impl Test<'_> {
    fn connect(&self) -> (Connected, Arc<Mutex<Record>>, Receiver<Operator>) {
        let mut experiment = (self.make)();
        experiment.pacing.checkpoint_ticks = self.checkpoint_ticks;
        let record = Arc::new(Mutex::new(Record::default()));
        let (line, requests) = bounded(8);
        let keeper = Keeper {
            record: Arc::clone(&record),
            room: None,
            says: self.says,
            line,
        };
        let test = Connected::new(experiment, Box::new(SimClock::new()), Box::new(keeper));
        (test, record, requests)
    }

    /// The whole test, its columns, and the largest forces of each specimen in it.
    fn whole(&self) -> (Record, Vec<Column>, Peaks) {
        let (test, record, requests) = self.connect();
        let columns = test.columns().to_vec();
        let outcome = test.run(&Control::from(requests)).into_outcome();
        assert_eq!(outcome.ending, Ending::Completed);
        let peaks = outcome.ports.into_iter().map(|(_, forces, _)| forces);
        let record = std::mem::take(&mut *record.lock().unwrap());
        (record, columns, peaks.collect())
    }

    /// The rest of the test after a saved state.
    fn rest(&self, state: &TestState) -> (Record, Peaks) {
        let (test, record, requests) = self.connect();
        let retraced = test.retrace_from(state, &Control::from(requests)).unwrap();
        assert_eq!(retraced.ending, Ending::Completed);
        let (_, ports, _) = retraced.state.unwrap();
        let peaks = ports.iter().map(|port| port.feedback().peak().to_vec());
        let record = std::mem::take(&mut *record.lock().unwrap());
        (record, peaks.collect())
    }

    /// Continues from some of its states. Returns the record of the whole test.
    #[track_caller]
    fn continues_from_its_states(&self) -> (Record, Vec<Column>) {
        let (whole, columns, peaks) = self.whole();
        let count = whole.states.len();
        assert!(count >= 4, "{count} states");
        for place in [0, count / 3, count / 2, count - 2] {
            let (rest, peaks_of_rest) = self.rest(&whole.states[place].2);
            assert_same(&whole, place, &rest, &columns);
            assert_eq!(peaks_of_rest, peaks);
        }
        (whole, columns)
    }
}

/// The rest of a test after its state at `place` is what came after it in the whole test.
#[track_caller]
fn assert_same(whole: &Record, place: usize, rest: &Record, columns: &[Column]) {
    let (rows, events, _) = &whole.states[place];
    let expected = &whole.rows[*rows..];
    assert!(!rest.rows.is_empty() && rest.rows.len() <= expected.len());
    for (row, (found, expected)) in rest.rows.iter().zip(expected).enumerate() {
        for (column, (found, expected)) in columns.iter().zip(found.iter().zip(expected)) {
            assert!(
                column.timing || found.to_bits() == expected.to_bits(),
                "state {place}, row {row}, {}: {found} {expected}",
                column.name
            );
        }
    }
    let last = rest.rows.last().unwrap()[0];
    let is_running = |row: &&Vec<f64>| row[2] == Phase::Running.code();
    let end = whole.rows.iter().rfind(is_running).unwrap()[0];
    assert_eq!(last, end, "it continues to the last step");
    // The event of the checkpoint itself follows the state.
    let expected = &whole.events[events + 1..];
    for (found, expected) in rest.events.iter().zip(expected) {
        assert_eq!((found.tick, &found.kind), (expected.tick, &expected.kind));
    }
    let later = &whole.states[place + 1..];
    assert_eq!(rest.states.len(), later.len());
    for ((.., found), (.., expected)) in rest.states.iter().zip(later) {
        let pairs = found.words().iter().zip(expected.words()).enumerate();
        let differ: Vec<_> = pairs.filter(|(_, (a, b))| a != b).map(|(k, _)| k).collect();
        // The wall time in the row of the checkpoint.
        assert!(differ.len() <= 1, "{differ:?} of {}", found.words().len());
    }
}

const SILENT: Says = |_, _, _| None;

/// The operator confirms the sensor readings.
const CONFIRMS: Says = |_, _, phase| (phase == Phase::Zeroing).then_some(Operator::Confirm);

/// Half a second into the test the operator holds it for a while.
const HOLDS: Says = |step, sub_tick, phase| match (step, sub_tick, phase) {
    (_, 300, Phase::Holding) => Some(Operator::Continue),
    (50, 0, Phase::Running) => Some(Operator::Hold),
    _ => None,
};

/// A file of `config/` on the simulated clock, shorter.
fn shipped(name: &str, duration_s: f64, more: &[&str]) -> Experiment {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("config")
        .join(name);
    let mut sets = vec![
        "time.clock=simulated".to_owned(),
        format!("time.duration_s={duration_s}"),
    ];
    sets.extend(more.iter().map(|set| (*set).to_owned()));
    let loaded = gusset_config::load(&path, &sets).unwrap_or_else(|error| panic!("{error}"));
    let prepared = gusset_setup::build(&loaded).unwrap_or_else(|error| panic!("{error}"));
    prepared.experiment
}

fn warnings(record: &Record) -> Vec<&str> {
    let events = record.events.iter();
    let mut limits: Vec<&str> = events
        .filter_map(|event| match &event.kind {
            Event::LimitWarning(reached) => Some(&*reached.limit),
            _ => None,
        })
        .collect();
    limits.sort_unstable();
    limits.dedup();
    limits
}

/// A Bouc–Wen storey behind an actuator with noisy sensors, whose zero is read, and which crosses every warning level it has.
const WATCHED: &str = r#"
[time]
rate_hz = 256
duration_s = 6
clock = "simulated"
[structure.shear_building]
mass_kg = [2e3, 2e3]
stiffness_n_per_m = [0, 6e5]
[structure.damping.rayleigh_ratio]
ratio = 0.03
modes = [1, 2]
[excitation.ground_acceleration.signal.sine]
amplitude = 3.0
frequency_hz = 1.5
[safety]
zero_s = 0.1
step_audit = { warn = 1e-15 }
stability_used = { warn = 1e-3 }
delay_used = { warn = 1e-3 }
added_energy_share = { warn = 1e-6, trip = 100, floor_j = 1 }
[[specimen]]
name = "storey"
storey = 1
damping_n_s_per_m = 2e3
[[specimen.axis]]
zero_disp = "relative"
zero_force = "relative"
unit_disp = "mm"
unit_force = "kN"
[[specimen.laws]]
parallel = [
    { bouc_wen = { stiffness_n_per_m = 5e5, yield_force_n = 3e3, post_yield_ratio = 0.1, beta = 0.5, gamma = 0.5, exponent = 1.5 } },
    { linear = { stiffness_n_per_m = 1e4, damping_n_s_per_m = 2e3 } },
]
[specimen.transfer]
actuator.first_order = { time_constant_s = 0.004 }
seed = 3
disp_sensor = { noise_rms_m = 1e-6 }
force_sensor = { noise_rms_n = 1.0 }
[specimen.compensation.ats]
delay_s = 0.003
[specimen.limits]
command_disp_m = { warn = [-0.01, 0.01], trip = [-1, 1] }
command_step_m = { trip = 0.1 }
command_vel_m_per_s = { warn = 0.1 }
command_accel_m_per_s2 = { warn = 1.0, trip = 1e5 }
measured_disp_m = { warn = [-0.01, 0.01], trip = [-1, 1] }
measured_force_n = { warn = [-2e3, 2e3], trip = [-1e6, 1e6] }
sensor_disp_m = { warn = [-0.01, 0.01], trip = [-1, 1] }
sensor_force_n = { warn = [-2e3, 2e3], trip = [-1e6, 1e6] }
following_error_m = { warn = 1e-5, trip = 1 }
following_time_s = 0.02
force_step_n = { warn = 100.0, trip = 1e6 }
stuck_ticks = { warn = 1, trip = 100 }
alternating_ticks = { warn = 1, trip = 100 }
stiffness_ratio = { warn = 0.5, trip = 1e6 }
damping_ratio = { warn = 0.5, trip = 1e6 }
added_energy_j = { warn = 1e-3, trip = 1e6 }
lag_s = { warn = 1e-5, trip = 1.0 }
gain_error = { warn = 1e-4, trip = 10.0 }
"#;

#[test]
fn test_with_all_limits_continues() {
    let test = Test {
        make: &|| prepare(WATCHED).experiment,
        checkpoint_ticks: 37,
        says: CONFIRMS,
    };
    let (whole, _) = test.continues_from_its_states();
    assert!(warnings(&whole).len() >= 16, "{:?}", warnings(&whole));
}

#[test]
fn hold_between_states_changes_no_result() {
    let test = Test {
        make: &|| shipped("multi-rate.toml", 2.0, &["safety.ease_s=0.2"]),
        checkpoint_ticks: 41,
        says: HOLDS,
    };
    let (whole, _) = test.continues_from_its_states();
    let holds = whole
        .rows
        .iter()
        .filter(|row| row[2] == Phase::Holding.code());
    assert!(holds.count() > 100);
}

#[test]
fn every_compensator_continues() {
    for ease in ["safety.ease_s=0", "safety.ease_s=0.1"] {
        let test = Test {
            make: &|| shipped("compensators.toml", 2.0, &[ease]),
            checkpoint_ticks: 61,
            says: HOLDS,
        };
        test.continues_from_its_states();
    }
}

#[test]
fn a_loading_unit_continues_from_its_states() {
    for name in ["loading-unit.toml", "three-actuators.toml"] {
        let test = Test {
            make: &|| shipped(name, 4.0, &[]),
            checkpoint_ticks: 83,
            says: SILENT,
        };
        test.continues_from_its_states();
    }
}

#[test]
fn static_load_and_given_motion_continue() {
    for name in [
        "two-specimens.toml",
        "static-load.toml",
        "cyclic.toml",
        "base-isolated.toml",
        "vrths-case-1.toml",
    ] {
        let test = Test {
            make: &|| shipped(name, 3.0, &[]),
            checkpoint_ticks: 150,
            says: SILENT,
        };
        test.continues_from_its_states();
    }
}

#[test]
fn rows_without_mass_continue() {
    let text = "[time]\nrate_hz = 256\nduration_s = 4\nclock = \"simulated\"\n[structure.matrices]\n\
        mass = [[1000.0, 0], [0, 0]]\nstiffness = [[1e6, -1e6], [-1e6, 1e6]]\n[[structure.element]]\nfrom = \"ground\"\n\
        to = 2\nlaw.bilinear = { stiffness_n_per_m = 1e7, yield_force_n = 5e3, post_yield_ratio = 0.01 }\n\
        [excitation.ground_acceleration]\nsignal.sine = { amplitude = 4.0, frequency_hz = 2.3 }\n";
    let test = Test {
        make: &|| prepare(text).experiment,
        checkpoint_ticks: 41,
        says: SILENT,
    };
    test.continues_from_its_states();
}

/// A spring behind a lag that takes some polls for its answer, or loses answers and finds some of them later.
struct Partner {
    coupling: Coupling,
    late: &'static [u32],
    loses: fn(u64) -> bool,
    /// It holds by its own watchdog in the answers to these.
    holds: fn(u64) -> bool,
    disp: f64,
    told: f64,
    sequence: u64,
    known: [f64; 2],
    count: u64,
    looks: u32,
    /// The last answer that was lost.
    lost: Option<[f64; 2]>,
}

impl Partner {
    const fn new(coupling: Coupling) -> Self {
        Self {
            coupling,
            late: &[0],
            loses: |_| false,
            holds: |_| false,
            disp: 0.0,
            told: 0.0,
            sequence: 0,
            known: [0.0; 2],
            count: 0,
            looks: 0,
            lost: None,
        }
    }
}

const PARTNER_N_PER_M: f64 = 1e5;

impl Substructure for Partner {
    fn axes(&self) -> usize {
        1
    }
    fn coupling(&self) -> Coupling {
        self.coupling
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        (self.told, self.sequence) = (command.disp[0], command.sequence);
        self.disp += 0.7 * (self.told - self.disp);
        (self.count, self.looks) = (self.count + 1, 0);
        Ok(())
    }
    fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        self.looks = self.looks.saturating_add(1);
        let late = self.late[self.count as usize % self.late.len()];
        Ok(wait_ns > 0 || self.looks > late)
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        let force = PARTNER_N_PER_M * self.disp;
        if (self.loses)(self.sequence) {
            self.lost = Some([self.sequence as f64, force]);
            return Ok(Freshness::Stale);
        }
        self.known = [self.disp, force];
        into.sequence = self.sequence;
        into.status = if (self.holds)(self.sequence) {
            Status::HOLDING
        } else {
            Status::default()
        };
        (into.disp[0], into.force[0]) = (self.disp, force);
        Ok(Freshness::Fresh)
    }
    fn recover(&mut self, force: &mut [f64]) -> Option<u64> {
        let [number, lost] = self.lost.take()?;
        force[0] = lost;
        Some(number as u64)
    }
    fn visit_state(&mut self, visit: &mut dyn Visit) -> bool {
        visit.number(&mut self.disp);
        visit.number(&mut self.told);
        visit.count(&mut self.sequence);
        visit.numbers(&mut self.known);
        visit.count(&mut self.count);
        self.looks.visit_state(visit);
        self.lost.visit_state(visit);
        true
    }
    fn retire(&mut self, _: Retirement) {}
}

/// A frame of two storeys with a spring in the lower one and a [`Partner`] in the upper one.
fn with_partner(ticks: u32, partner: Partner, change: impl Fn(&mut PortSpec)) -> Experiment {
    let mut experiment = prepare(&format!(
        "[time]\nstep_s = 0.01\nduration_s = 2\nclock = \"simulated\"\nticks_per_step = {ticks}\n[integrator]\nlambda = 2\n\
         [safety]\nease_s = 0.1\n[structure.shear_building]\nmass_kg = [2e3, 2e3]\nstiffness_n_per_m = [3e5, 3e5]\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = 5\nfrequency_hz = 1\n[timing]\nwarmup_ticks = 3\n\
         [[specimen]]\nname = \"near\"\nstorey = 1\nlaw.linear = {{ stiffness_n_per_m = 2e5 }}\n"
    ))
    .experiment;
    let axis = Axis::plain(vec![(0, -1.0), (1, 1.0)]);
    let axes = vec![AxisSpec::new(axis, PARTNER_N_PER_M)];
    let mut far = PortSpec::new("far", Box::new(partner), 2, axes);
    change(&mut far);
    experiment.ports.push(far.build().unwrap());
    experiment
}

#[test]
fn per_step_specimen_gets_pending_target() {
    let make = || {
        let partner = Partner {
            late: &[13, 0, 17, 5, 40, 9, 12],
            ..Partner::new(Coupling::Lockstep)
        };
        with_partner(10, partner, |far| {
            (far.per_step, far.tick, far.step) = (true, 0.001, Some(0.01));
        })
    };
    for says in [SILENT, HOLDS] {
        let test = Test {
            make: &make,
            checkpoint_ticks: 47,
            says,
        };
        test.continues_from_its_states();
    }
}

#[test]
fn stale_measurements_continue() {
    for ticks in [1, 4] {
        for stale in [false, true] {
            let make = || {
                let partner = Partner {
                    loses: |number| number % 20 > 16,
                    holds: |number| number % 50 == 3,
                    ..Partner::new(Coupling::Sampled)
                };
                let tick = 0.01 / f64::from(ticks);
                let spec: CompensationSpec = toml::from_str("ats = { delay_s = 0.005 }").unwrap();
                let mut experiment = with_partner(ticks, partner, |far| {
                    far.compensation = Some(Compensation {
                        compensators: vec![spec.build(tick).unwrap()],
                        tick,
                        pace: 1.0,
                        delay_in_test_time: false,
                        base_moves: false,
                    });
                    far.tracking = Some(TrackingSpec {
                        dt: tick,
                        age: 0.5,
                        ..TrackingSpec::default()
                    });
                });
                experiment.limits.extrapolate_stale = stale;
                experiment
            };
            let test = Test {
                make: &make,
                checkpoint_ticks: 19,
                says: HOLDS,
            };
            let (whole, columns) = test.continues_from_its_states();
            let place = columns.iter().position(|column| column.name == "force_2_1");
            assert!(whole.rows.iter().any(|row| row[place.unwrap()] != 0.0));
        }
    }
}
