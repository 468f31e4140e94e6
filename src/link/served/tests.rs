//! A server before a specimen across a link: its position, its force there, and its introduction.

use std::sync::{Arc, Mutex};

use super::{GuardStore, Latch, Pacing, ServedSpecimen, simulated_pace};
use crate::served::{Controller, LinkMaker, TestEnd, Trip, Whereabouts};
use gusset_config::LimitsSpec;
use gusset_control::port::{Pace, WiringCheck};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::substructure::{
    Command, Freshness, Introduction, LinkFault, Measurement, Retirement, Status, Substructure,
    Unavailable,
};
use gusset_quantity::time::Nanos;
use gusset_quantity::units::AxisUnits;
use gusset_quantity::units::position;
use gusset_record::lasting::{LastingRecord, SpecimenKey};

const K: f64 = 8000.0;

/// A spring that may report its position, and may report a status from the command with this number on.
#[derive(Clone, Default)]
struct Spring {
    tells: Vec<f64>,
    measured: bool,
    simulated: bool,
    says: (u64, Status),
    told: Arc<Mutex<Vec<f64>>>,
    sequence: u64,
    /// The link is lost when the command with this number is to leave.
    loses: Option<u64>,
    /// The link refuses the answer to the command with this number: a number in it is not finite.
    refuses: Option<u64>,
    /// Its stiffness in the unit of the axis, if it is not the usual one.
    stiffness: Option<f64>,
    goodbyes: Arc<Mutex<Vec<Retirement>>>,
}

impl Substructure for Spring {
    fn axes(&self) -> usize {
        1
    }
    fn is_remote(&self) -> bool {
        true
    }
    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        Ok(Introduction {
            standing: self.tells.clone(),
            measured: self.measured,
            simulated: self.simulated,
            ..Introduction::default()
        })
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        if self.loses == Some(command.sequence) {
            return Err(LinkFault::Closed);
        }
        self.sequence = command.sequence;
        self.told.lock().unwrap().push(command.disp[0]);
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        if self.refuses == Some(self.sequence) {
            return Err(LinkFault::NotFinite);
        }
        let disp = *self.told.lock().unwrap().last().unwrap();
        let (from, status) = self.says;
        into.sequence = self.sequence;
        into.status = if self.sequence >= from {
            status
        } else {
            Status::default()
        };
        (into.disp[0], into.force[0]) = (disp, self.stiffness.unwrap_or(K) * disp);
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, how: Retirement) {
        self.goodbyes.lock().unwrap().push(how);
    }
}

fn served(spring: &Spring, whereabouts: &Whereabouts) -> ServedSpecimen {
    served_in(AxisUnits::SI, spring, whereabouts)
}

fn served_in(unit: AxisUnits, spring: &Spring, whereabouts: &Whereabouts) -> ServedSpecimen {
    let spring = spring.clone();
    let build = Arc::new(move |_: &Controller| {
        let link: Box<dyn Substructure> = Box::new(spring.clone());
        Ok(link)
    });
    let links = LinkMaker::new(build, whereabouts.clone(), 1_000_000_000);
    let units = vec![unit];
    ServedSpecimen::linked("rig".into(), links, units, vec![K], vec![0.0])
        .checked(WiringCheck::Known, false)
}

/// The wiring check along one axis.
fn check(amplitude: f64, pace: Pace) -> WiringCheck {
    WiringCheck::Probe {
        amplitude: vec![amplitude],
        stiffness: vec![K],
        accepted: None,
        pace,
        units: vec![AxisUnits::SI],
    }
}

fn begin(served: &mut ServedSpecimen) -> Result<Vec<String>, TestEnd> {
    let controller = Controller::unnamed(([127, 0, 0, 1], 1).into());
    served.begin(&controller, &mut || Ok(()))
}

/// One command; the force that is answered.
fn goes_to(served: &mut ServedSpecimen, sequence: u64, disp: f64) -> Result<f64, Trip> {
    let command = Command {
        sequence,
        time: 0.0,
        dt: 0.01,
        disp: &[disp],
        vel: &[0.0],
    };
    let mut into = Measurement::zeros(1);
    served.exchange(&command, 0.01, &mut || true, &mut into)?;
    Ok(into.force[0])
}

#[test]
fn unknown_place_is_refused_before_commands() {
    let spring = Spring::default();
    let probe = check(1e-3, Pace::of(0.01, 0.001));
    let mut refused = served(&spring, &Whereabouts::default()).checked(probe, false);
    let over = begin(&mut refused).unwrap_err();
    for words in ["its position is unknown", "`stands_at_m`"] {
        assert!(over.text.contains(words), "{}", over.text);
    }
    assert!(spring.told.lock().unwrap().is_empty());
    assert_eq!(*spring.goodbyes.lock().unwrap(), [Retirement::Tripped]);
    // A computation counts as at zero, even if only the operator declares it one.
    let computed = Whereabouts::default().of_a_computation();
    assert_eq!(begin(&mut served(&spring, &computed)).err(), None);
    let simulated = Spring {
        simulated: true,
        ..Spring::default()
    };
    let nowhere = Whereabouts::default();
    assert_eq!(begin(&mut served(&simulated, &nowhere)).err(), None);
    assert!(spring.told.lock().unwrap().is_empty());
}

#[test]
fn place_comes_from_the_file_then_commands() {
    let spring = Spring::default();
    let whereabouts = Whereabouts::said(vec![0.004]);
    let mut one = served(&spring, &whereabouts);
    assert_eq!(begin(&mut one).err(), None);
    assert_eq!(one.measured().disp, [0.004]);
    goes_to(&mut one, 0, 0.0045).unwrap();
    drop(one);
    // Another test, another connection.
    let mut next = served(&spring, &whereabouts);
    let told = begin(&mut next).unwrap();
    assert!(
        told.iter().any(|text| text.contains("is at 4.5 mm")),
        "{told:?}"
    );
    assert!(goes_to(&mut next, 0, 0.0).is_err(), "too far at once");
    assert_eq!(spring.told.lock().unwrap().last(), Some(&0.0045));
}

#[test]
fn unsent_command_does_not_set_the_place() {
    // The first command on the link asks for the force at rest.
    for (loses, stands) in [(2, 0.0045), (1, 0.004)] {
        let spring = Spring {
            loses: Some(loses),
            ..Spring::default()
        };
        let whereabouts = Whereabouts::said(vec![0.004]);
        let mut one = served(&spring, &whereabouts);
        begin(&mut one).unwrap();
        let lost = (0..2)
            .find_map(|number| goes_to(&mut one, number, 0.0045 + 0.0005 * number as f64).err());
        assert_eq!(lost, Some(Trip::Lost(LinkFault::Closed)));
        drop(one);
        assert_eq!(whereabouts.stated(), [stands]);
    }
}

#[test]
fn refused_answer_changes_no_measurement() {
    let spring = Spring {
        tells: vec![0.004],
        refuses: Some(0),
        ..Spring::default()
    };
    let mut served = served(&spring, &Whereabouts::default());
    let controller = Controller {
        start: vec![0.004],
        ..Controller::unnamed(([127, 0, 0, 1], 1).into())
    };
    served.begin(&controller, &mut || Ok(())).unwrap();
    let refused = goes_to(&mut served, 0, 0.0045).unwrap_err();
    let (axis, measured) = (None, true);
    assert_eq!(refused, Trip::NotFinite { axis, measured });
    assert_eq!(served.measured().disp, [0.004]);
    assert_eq!(latched(&served), Some("measured_not_finite".to_owned()));
}

/// The trip that is latched.
fn latched(served: &ServedSpecimen) -> Option<String> {
    served.latch().trip().map(|trip| trip.what)
}

#[test]
fn too_large_number_is_latched() {
    for (stiffness, trips) in [
        (K, false),
        (f64::NAN, true),
        (f64::INFINITY, true),
        (1e308, true),
    ] {
        let spring = Spring {
            tells: vec![0.004],
            stiffness: Some(stiffness),
            ..Spring::default()
        };
        let kilonewtons = AxisUnits {
            newtons: 1e3,
            force: "kN",
            ..AxisUnits::SI
        };
        let mut served = served_in(kilonewtons, &spring, &Whereabouts::default());
        let controller = Controller {
            start: vec![0.004],
            ..Controller::unnamed(([127, 0, 0, 1], 1).into())
        };
        served.begin(&controller, &mut || Ok(())).unwrap();
        let outcome = goes_to(&mut served, 0, 0.0045);
        assert_eq!(outcome.is_err(), trips, "{stiffness}: {outcome:?}");
        let what = trips.then(|| "measured_not_finite".to_owned());
        assert_eq!(latched(&served), what);
        served.end(Cause::Done, "");
        assert_eq!(served.begin(&controller, &mut || Ok(())).is_err(), trips);
    }
}

#[test]
fn a_lost_link_is_not_latched() {
    let spring = Spring {
        tells: vec![0.004],
        loses: Some(1),
        ..Spring::default()
    };
    let mut served = served(&spring, &Whereabouts::default());
    begin(&mut served).unwrap();
    let lost = goes_to(&mut served, 0, 0.0045);
    assert_eq!(lost, Err(Trip::Lost(LinkFault::Closed)));
    assert_eq!(latched(&served), None);
}

#[test]
fn first_request_returns_a_measurement() {
    let spring = Spring {
        tells: vec![0.004],
        ..Spring::default()
    };
    let mut served = served(&spring, &Whereabouts::default());
    begin(&mut served).unwrap();
    let measured = served.measured();
    assert_eq!((measured.disp[0], measured.force[0]), (0.004, K * 0.004));
    assert_eq!(*spring.told.lock().unwrap(), [0.004], "nothing has moved");
    assert_eq!(goes_to(&mut served, 0, 0.0045), Ok(K * 0.0045));
}

/// Half a metre from where its controller expects it.
#[test]
fn first_command_steps_from_the_measurement() {
    let spring = Spring {
        tells: vec![0.5],
        measured: true,
        ..Spring::default()
    };
    let limits: LimitsSpec = toml::from_str("command_step_m = { trip = 0.01 }").unwrap();
    let mut served = served(&spring, &Whereabouts::default()).limited(&[limits]);
    let controller = Controller {
        start: vec![0.0],
        ..Controller::unnamed(([127, 0, 0, 1], 1).into())
    };
    served.begin(&controller, &mut || Ok(())).unwrap();
    let Err(Trip::Limit(hit)) = goes_to(&mut served, 0, 0.0) else {
        panic!("it leaves");
    };
    assert_eq!((hit.quantity, hit.value), (Limit::CommandStep, 0.5));
    assert!(spring.told.lock().unwrap().is_empty());
}

/// A controller with another position of the specimen does not lead it there by the wiring check.
#[test]
fn check_begins_at_the_measured_position() {
    for (limit, start, begins) in [
        ("", 9e-4, true),
        ("", 1.1e-3, false),
        ("command_disp_m = { trip = [-0.1, 0.1] }", 9e-3, true),
        ("command_disp_m = { trip = [-0.1, 0.1] }", 0.011, false),
        ("command_accel_m_per_s2 = { trip = 9 }", 1.1e-3, false),
        ("command_step_m = { trip = 5e-4 }", 4e-4, true),
        ("command_step_m = { trip = 5e-4 }", 6e-4, false),
    ] {
        let spring = Spring {
            tells: vec![0.0],
            measured: true,
            ..Spring::default()
        };
        let limits: LimitsSpec = toml::from_str(limit).unwrap();
        let probe = check(1e-4, Pace::of(0.01, 0.001));
        let mut served = served(&spring, &Whereabouts::default())
            .checked(probe, false)
            .limited(&[limits]);
        let controller = Controller {
            start: vec![start],
            ..Controller::unnamed(([127, 0, 0, 1], 1).into())
        };
        let begun = served.begin(&controller, &mut || Ok(()));
        assert_eq!(begun.is_ok(), begins, "{limit} {start}: {begun:?}");
        assert_eq!(spring.told.lock().unwrap().is_empty(), !begins);
        assert_eq!(latched(&served), None);
    }
}

/// At which of twenty commands of a test, from 0, it trips if this status is reported from the fifth on.
fn says(status: Status) -> Option<(usize, Trip)> {
    // Its first command is ours.
    let spring = Spring {
        tells: vec![0.0],
        says: (5, status),
        ..Spring::default()
    };
    let mut served = served(&spring, &Whereabouts::default());
    begin(&mut served).unwrap();
    let tripped = (0..20).find_map(|sequence| {
        let trip = goes_to(&mut served, sequence, 0.0).err()?;
        Some((sequence as usize, trip))
    });
    if let Some((last, _)) = tripped {
        assert!(goes_to(&mut served, 20, 0.0).is_err());
        assert_eq!(spring.told.lock().unwrap().len(), last + 2, "not passed on");
    }
    tripped
}

#[test]
fn lasting_hold_of_the_specimen_ends_a_test() {
    assert_eq!(says(Status::HOLDING), Some((14, Trip::Holds(11))));
    // Each command of a slow client finds it holding, and moves it.
    assert_eq!(says(Status(Status::HOLDING.0 | Status::HELD.0)), None);
    assert_eq!(says(Status::default()), None);
}

#[test]
fn one_interlock_report_ends_the_test() {
    assert_eq!(says(Status::SATURATED), Some((4, Trip::Saturated)));
    assert_eq!(says(Status::INTERLOCK), Some((4, Trip::Interlock)));
}

/// A client that disconnects after this number of questions, in the middle of a wiring check from 4 mm; `at_once`: the server is
/// stopped for the second time. Returns the commands, and the end.
fn leaves_the_check(asked: usize, at_once: bool, stands: f64) -> (Vec<f64>, Option<TestEnd>) {
    let spring = Spring {
        tells: vec![stands],
        ..Spring::default()
    };
    let motion = check(1e-3, Pace::of(0.001, 0.0005));
    let mut served = served(&spring, &Whereabouts::default()).checked(motion, false);
    let controller = Controller::unnamed(([127, 0, 0, 1], 1).into());
    let mut questions = 0;
    let mut wanted = || {
        questions += 1;
        match (questions > asked, at_once) {
            (false, _) => Ok(()),
            (true, false) => Err(TestEnd::vanished("it is gone")),
            (true, true) => Err(TestEnd::told_to_stop_at_once()),
        }
    };
    let over = served.begin(&controller, &mut wanted).err();
    let told = spring.told.lock().unwrap().clone();
    (told, over)
}

/// The check keeps to its own pace, and the paths after it to theirs.
#[test]
fn path_after_a_check_keeps_its_pace() {
    const PERIOD_NS: u64 = 20_000_000;
    let spring = Spring {
        tells: vec![0.0],
        ..Spring::default()
    };
    let pacing = Pacing {
        ticks: 4,
        settle_ticks: 0,
        period_ns: PERIOD_NS,
        clock: simulated_pace::CLOCK,
        predict: None,
    };
    let mut served = served(&spring, &Whereabouts::default())
        .checked(check(1e-3, Pace::of(0.001, 0.0005)), false)
        .paced(Some(pacing));
    assert_eq!(begin(&mut served).err(), None);
    let began = simulated_pace::now_ns();
    for (sequence, disp) in [(0, 0.0), (1, 1e-4)] {
        goes_to(&mut served, sequence, disp).unwrap();
    }
    let passed = simulated_pace::now_ns() - began;
    assert!(passed >= 7 * PERIOD_NS, "{passed}");
}

#[test]
fn unneeded_check_moves_back() {
    const STANDS: f64 = 0.004;
    let (whole, ended) = leaves_the_check(usize::MAX, false, STANDS);
    assert_eq!(ended, None);
    let mut displaced = 0;
    for asked in 0..2 * whole.len() {
        let (told, over) = leaves_the_check(asked, false, STANDS);
        let Some(over) = over else {
            break;
        };
        assert_eq!(over.cause, Cause::ControllerVanished);
        let last = told.last().copied().unwrap_or(STANDS);
        assert_eq!(last.to_bits(), STANDS.to_bits(), "{asked}: {told:?}");
        assert!(told.iter().all(|at| (STANDS..=STANDS + 1e-3).contains(at)));
        assert!(!over.text.contains("it was led to"), "{}", over.text);
        displaced += usize::from(told.iter().any(|at| *at != STANDS));
    }
    assert!(displaced > 10, "{displaced} were ended away from the start");
}

#[test]
fn check_stopped_twice_rests() {
    let (whole, _) = leaves_the_check(usize::MAX, false, 0.004);
    let top = whole.iter().position(|at| *at > 0.0049).unwrap();
    let (told, over) = leaves_the_check(top + 4, true, 0.004);
    let left = *told.last().unwrap();
    assert!(left > 0.004);
    let words = format!("it was led to {}, from 4 mm", position(left, "m"));
    let text = over.unwrap().text;
    assert!(text.contains(&words), "{text}");
}

/// Each client disconnects at another place of the check, and the next one finds the specimen at the same position.
#[test]
fn leaving_clients_do_not_walk_a_specimen() {
    let mut stands = 0.0;
    for session in 0..27 {
        let (told, over) = leaves_the_check(20 + session, false, stands);
        assert!(over.is_some());
        assert!(
            told.iter().any(|at| *at != stands) || session < 8,
            "{session}"
        );
        stands = told.last().copied().unwrap_or(stands);
        assert_eq!(stands.to_bits(), 0.0_f64.to_bits(), "{session}");
    }
}

/// A specimen at zero that is moved by one client.
struct Led {
    served: ServedSpecimen,
    controller: Controller,
    now: Nanos,
    sequence: u64,
    disp: f64,
}

impl Led {
    fn at(limits: &str, rate: Option<(u64, u64)>) -> Self {
        let spring = Spring {
            tells: vec![0.0],
            ..Spring::default()
        };
        let limits: LimitsSpec = toml::from_str(limits).unwrap();
        let mut led = Self {
            served: served(&spring, &Whereabouts::default()).limited(&[limits]),
            controller: Controller {
                rate,
                ..Controller::unnamed(([127, 0, 0, 1], 1).into())
            },
            now: Nanos(1_000_000_000),
            sequence: 0,
            disp: 0.0,
        };
        led.connects();
        led
    }

    fn connects(&mut self) {
        self.sequence = 0;
        if self.controller.rate.is_some() {
            self.controller.start = vec![self.disp];
        }
        self.served.end(Cause::ControllerVanished, "gone");
        self.served.now_is(self.now);
        // The specimen is at its last command.
        self.served.answered_by(Standing {
            disp: self.disp,
            reads: None,
            measures: true,
        });
        self.served.begin(&self.controller, &mut || Ok(())).unwrap();
        self.served.starts(self.now);
    }

    fn arms(&mut self) {
        self.sequence += 10;
        let (first, start) = (self.sequence, [self.disp]);
        let armed = self.served.begin_again(first, &start, &mut || Ok(()));
        armed.unwrap();
        self.served.starts(self.now);
    }

    fn waits(&mut self, seconds: f64) {
        self.now = self.now.plus((1e9 * seconds) as u64);
        self.served.now_is(self.now);
    }

    /// One command that moves the specimen by `metres`; the limit that trips.
    fn goes(&mut self, metres: f64) -> Option<Limit> {
        let disp = self.disp + metres;
        let command = Command {
            sequence: self.sequence,
            time: 0.0,
            dt: 0.02,
            disp: &[disp],
            vel: &[0.0],
        };
        self.sequence += 1;
        let mut into = Measurement::zeros(1);
        match (self.served).exchange(&command, 0.02, &mut || true, &mut into) {
            Ok(_) => {
                self.disp = disp;
                None
            }
            Err(Trip::Limit(hit)) => Some(hit.quantity),
            Err(other) => panic!("{other}"),
        }
    }
}

/// A specimen behind a link, without the link.
struct Standing {
    disp: f64,
    /// The displacement sensor reads this instead of the command.
    reads: Option<f64>,
    /// Its end reports that it measures displacement.
    measures: bool,
}

impl Substructure for Standing {
    fn axes(&self) -> usize {
        1
    }
    fn is_remote(&self) -> bool {
        true
    }
    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        Ok(Introduction {
            standing: vec![self.disp],
            force: vec![0.0],
            repeats_the_command: !self.measures,
            ..Introduction::default()
        })
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.disp = command.disp[0];
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        into.disp[0] = self.reads.unwrap_or(self.disp);
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
}

impl ServedSpecimen {
    /// This specimen answers from here on, without a link.
    fn answered_by(&mut self, standing: Standing) {
        self.links = None;
        self.guarded.reply_limit_ns = 0;
        drop(self.guarded.port.swap_partner(Box::new(standing)));
    }
}

const SLOW: &str = "command_vel_m_per_s = { trip = 0.1 }";

#[test]
fn new_session_keeps_the_speed_allowance() {
    for rate in [Some((100, 1)), None] {
        for again in [Led::arms, Led::connects] {
            let mut led = Led::at(SLOW, rate);
            // In 2 ms for each turn: 1 m/s.
            let trips = (0..100).find_map(|_| {
                again(&mut led);
                let trip = [0.0, 0.99e-3, 0.99e-3]
                    .into_iter()
                    .find_map(|step| led.goes(step));
                led.waits(0.002);
                trip
            });
            assert_eq!(trips, Some(Limit::CommandVel), "{rate:?}");
            // The burst, and the elapsed time.
            assert!(led.disp <= 0.1 * (0.02 + 0.2), "{rate:?}: {}", led.disp);
            assert!(led.disp < 0.004, "{rate:?}: {}", led.disp);
        }
    }
}

#[test]
fn silence_leaves_a_command_the_burst() {
    for (step, trip) in [(1.99e-3, None), (2.1e-3, Some(Limit::CommandVel))] {
        let mut led = Led::at(SLOW, Some((1000, 1)));
        assert_eq!(led.goes(0.0), None);
        led.waits(0.5);
        // 499 commands were lost.
        led.sequence += 499;
        assert_eq!(led.goes(step), trip);
    }
}

#[test]
fn slow_client_moves_a_tenth_of_a_second() {
    for rate in [Some((1, 4)), Some((1, 1))] {
        for (step, trip) in [(9.9e-3, None), (10.1e-3, Some(Limit::CommandVel))] {
            let mut led = Led::at(SLOW, rate);
            assert_eq!(led.goes(0.0), None);
            let found = (0..5).find_map(|_| {
                led.waits(rate.map_or(1.0, |(commands, seconds)| seconds as f64 / commands as f64));
                led.goes(step)
            });
            assert_eq!(found, trip, "{rate:?} {step}");
            if let Some(trip) = led.served.latch().trip() {
                assert!(trip.text.contains("0.1 s"), "{}", trip.text);
            }
        }
    }
}

#[test]
fn arm_in_motion_shows_the_speed_change() {
    for (again, silence, trip) in [
        (false, 0.001, true),
        (true, 0.001, true),
        // It has come to rest.
        (true, 0.1, false),
    ] {
        let mut led = Led::at("command_accel_m_per_s2 = { trip = 150.0 }", Some((1000, 1)));
        let steps = [0.0, 1e-4, 2e-4];
        for step in steps {
            assert_eq!(led.goes(step), None);
            led.waits(0.001);
        }
        led.waits(silence - 0.001);
        if again {
            led.arms();
        }
        // From 0.2 m/s to none: 200 m/s2.
        let found = led.goes(0.0);
        assert_eq!(found.is_some(), trip, "{again} {silence}: {found:?}");
    }
}

#[test]
fn check_motion_uses_its_own_time() {
    for (rate, own_s, trips) in [
        // 1 mm in 4 commands of 10 ms is 0.025 m/s; in 1 ms it would be 0.25 m/s.
        ((1000, 1), 0.01, false),
        // 1 mm in 4 commands of 1 ms is too fast, whatever the client before announced.
        ((1, 1), 0.001, true),
    ] {
        let mut led = Led::at(SLOW, Some(rate));
        led.waits(1.0);
        assert_eq!(led.goes(0.0), None);
        led.waits(rate.1 as f64 / rate.0 as f64);
        assert_eq!(led.goes(1e-6), None);
        let motion = check(1e-3, Pace::of(4.0 * own_s, own_s));
        *led.served.guarded.port.startup_mut().wiring_mut() = motion;
        led.served.end(Cause::ControllerVanished, "gone");
        led.served.answered_by(Standing {
            disp: led.disp,
            reads: None,
            measures: true,
        });
        led.controller.start = vec![led.disp];
        // A specimen without a force is refused; the limits judge the motion before.
        let over = led.served.begin(&led.controller, &mut || Ok(()));
        let trip = led.served.latch().trip().map(|trip| trip.what);
        assert_eq!(trip.is_some(), trips, "{rate:?}: {trip:?} {over:?}");
    }
}

#[test]
fn impossible_displacement_always_trips() {
    for (reads, trips) in [(999.0, false), (-1001.0, true), (1e308, true)] {
        let mut led = Led::at("", Some((1000, 1)));
        assert_eq!(led.goes(0.0), None);
        led.served.answered_by(Standing {
            disp: led.disp,
            reads: Some(reads),
            measures: true,
        });
        let trip = led.goes(0.0);
        let wanted = trips.then_some(Limit::MeasuredDisp);
        assert_eq!(trip, wanted, "{reads}");
    }
}

#[test]
fn trip_lasts_lost_link_does_not() {
    let mut led = Led::at("command_step_m = { trip = 0.001 }", Some((1000, 1)));
    assert_eq!(led.goes(0.0), None);
    assert_eq!(led.goes(0.002), Some(Limit::CommandStep));
    led.served.end(Cause::ControllerTripped, "tripped");
    for _ in 0..2 {
        let over = led
            .served
            .begin(&led.controller, &mut || Ok(()))
            .unwrap_err();
        let told = over.text.contains("command_step_m") && over.text.contains("allowed 1 mm");
        assert!(told, "{}", over.text);
    }
    let cleared = led.served.latch().clear().unwrap().trip.unwrap();
    assert_eq!(cleared.what, "command_step_m");
    led.connects();
    led.served.guarded.trip(Trip::Lost(LinkFault::Closed));
    led.connects();
    assert_eq!(led.goes(0.0), None);
}

/// A specimen that does not report a measured displacement is not armed behind a limit of it.
#[test]
fn missing_displacement_skips_its_limit() {
    let begun = |limits: &str| {
        let limits: LimitsSpec = toml::from_str(limits).unwrap();
        let spring = Spring::default();
        let mut served = served(&spring, &Whereabouts::default()).limited(&[limits]);
        served.answered_by(Standing {
            disp: 0.0,
            reads: None,
            measures: false,
        });
        let controller = Controller::unnamed(([127, 0, 0, 1], 1).into());
        served.begin(&controller, &mut || Ok(()))
    };
    let refused = begun("measured_disp_m = { trip = [-1, 1] }\nstuck_ticks = { trip = 9 }");
    let text = refused.unwrap_err().text;
    assert!(text.contains("measured_disp_m, stuck_ticks"), "{text}");
    assert!(begun("force_step_n = { trip = 1 }").is_ok());
}

/// Two springs of 10 N/m; from the command with this number on the load cell of the second gives NaN.
#[derive(Debug)]
struct Broken {
    from: u64,
    sequence: u64,
    disp: [f64; 2],
}

impl Broken {
    fn from(from: u64) -> Box<Self> {
        let (sequence, disp) = (0, [0.0; 2]);
        Box::new(Self {
            from,
            sequence,
            disp,
        })
    }
}

impl Substructure for Broken {
    fn axes(&self) -> usize {
        2
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.sequence = command.sequence;
        self.disp.copy_from_slice(command.disp);
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        into.disp.copy_from_slice(&self.disp);
        into.force = self.disp.iter().map(|disp| 10.0 * disp).collect();
        if self.sequence >= self.from {
            into.force[1] = f64::NAN;
        }
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
}

#[test]
fn sensor_without_a_number_is_marked() {
    let units = vec![AxisUnits::SI; 2];
    let mut served = ServedSpecimen::new(
        "rig".into(),
        Broken::from(3),
        units,
        vec![0.0; 4],
        vec![0.0; 4],
    );
    let controller = Controller::unnamed(([127, 0, 0, 1], 1).into());
    served.begin(&controller, &mut || Ok(())).unwrap();
    let mut into = Measurement::zeros(2);
    let mut exchange = |sequence: u64| {
        let disp = [0.5 * sequence as f64, 0.25 * sequence as f64];
        let command = Command {
            sequence,
            time: 0.0,
            dt: 0.01,
            disp: &disp,
            vel: &[0.0; 2],
        };
        let trip = served
            .exchange(&command, 0.01, &mut || true, &mut into)
            .err();
        (trip, into.clone())
    };
    for sequence in 0..=2 {
        assert_eq!(exchange(sequence).0, None);
    }
    let (axis, measured) = (1, true);
    let is_none = Some(Trip::NotFinite {
        axis: Some(axis),
        measured,
    });
    // And so it stays.
    for sequence in 3..=4 {
        let (trip, into) = exchange(sequence);
        assert_eq!(trip, is_none);
        assert_eq!((into.disp, into.force), (vec![1.5, 0.5], vec![15.0, 5.0]));
        assert!(into.status.has(Status::INTERLOCK) && into.status.has(Status::SATURATED));
    }
}

/// Rests for three commands at test time `from`, and then moves by 0.1 m in each 0.01 s, with a limit that bounds any change
/// of that speed. Whether it trips, and where.
fn goes_on(from: f64, vel: f64, steps: &[f64]) -> Option<u64> {
    let limits: LimitsSpec = toml::from_str("command_accel_m_per_s2 = { trip = 50.0 }").unwrap();
    let units = vec![AxisUnits::SI; 2];
    let rig = Broken::from(u64::MAX);
    let served = ServedSpecimen::new("rig".into(), rig, units, vec![0.0; 4], vec![0.0; 4]);
    let mut served = served.limited(&[limits; 2]);
    let controller = Controller::unnamed(([127, 0, 0, 1], 1).into());
    served.begin(&controller, &mut || Ok(())).unwrap();
    let mut into = Measurement::zeros(2);
    let (mut time, mut disp) = (from, [0.0; 2]);
    let still = [0.0; 3];
    (0..)
        .zip(still.iter().chain(steps))
        .find_map(|(sequence, step)| {
            let dt = if sequence < 3 { 0.0 } else { 0.01 };
            time += dt;
            disp = disp.map(|disp| disp + step);
            let command = Command {
                sequence,
                time,
                dt,
                disp: &disp,
                vel: &[if dt > 0.0 { vel } else { 0.0 }; 2],
            };
            let trip = served
                .exchange(&command, 0.01, &mut || true, &mut into)
                .err();
            trip.map(|_| sequence)
        })
}

#[test]
fn resumed_first_step_uses_announced_speed() {
    let steady = [0.1; 5];
    assert_eq!(goes_on(2.0, 10.0, &steady), None);
    // It begins, or comes faster than announced, or changes its speed later.
    assert_eq!(goes_on(0.0, 10.0, &steady), Some(3));
    assert_eq!(goes_on(2.0, 0.0, &steady), Some(3));
    assert_eq!(goes_on(2.0, 10.0, &[0.1, 0.1, 0.0]), Some(5));
    assert_eq!(goes_on(2.0, 10.0, &[0.1, 0.2]), Some(4));
    // The first command repeats its position.
    assert_eq!(goes_on(2.0, 10.0, &[0.0, 0.1, 0.1]), None);
}

/// After each of 50 sessions with random endings the specimen is where the session began, the session had a regular end, or the next
/// session is refused before it commands anything.
#[test]
fn irregular_end_refuses_the_next_session() {
    let folder = tempfile::tempdir().unwrap();
    let key = SpecimenKey::of_link("gusset", "127.0.0.1:4823").unwrap();
    let record = LastingRecord::hold(folder.path(), &key).unwrap();
    let latch = Latch::in_record(record, std::path::Path::new("x")).unwrap();
    let mut seed = 1_u64;
    let mut random = |below: u64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 33) % below
    };
    let (mut stands, mut refusals) = (0.0, 0);
    for session in 0..50 {
        let spring = Spring {
            tells: vec![stands],
            loses: (random(5) == 0).then(|| random(60)),
            ..Spring::default()
        };
        let serve = || {
            let probe = check(1e-3, Pace::of(2e-3, 2e-4));
            served(&spring, &Whereabouts::default())
                .checked(probe, false)
                .guarded(GuardStore::default(), latch.clone())
        };
        let mut one = serve();
        let mut patience = if random(2) == 0 { random(80) } else { 1 << 40 };
        let controller = Controller::unnamed(([127, 0, 0, 1], 1).into());
        let begun = one.begin(&controller, &mut || {
            patience = patience.saturating_sub(1);
            let gone = || TestEnd::vanished("gone");
            if patience == 0 { Err(gone()) } else { Ok(()) }
        });
        let mut is_regular = begun.is_ok();
        for sequence in 0..random(4) {
            let disp = stands + 1e-4 * (sequence as f64 + 1.0);
            is_regular &= is_regular && goes_to(&mut one, sequence, disp).is_ok();
        }
        let cause = [
            Cause::Done,
            Cause::Operator,
            Cause::ControllerVanished,
            Cause::Shutdown,
            Cause::ControllerTripped,
        ][random(5) as usize];
        one.end(cause, "over");
        is_regular &= cause == Cause::Done;
        let began = stands;
        stands = spring.told.lock().unwrap().last().copied().unwrap_or(began);
        let is_back = (stands - began).abs() < 1e-9;
        // The position of a specimen whose link was lost is unknown.
        let is_lost = matches!(one.tripped(), Some(Trip::Lost(_)));
        let is_refused = latch.refusal().is_some();
        assert!(is_regular || is_back || is_refused, "session {session}");
        let is_known = !is_lost && (is_regular || is_back);
        assert!(!(is_known && is_refused), "session {session}");
        if is_refused {
            refusals += 1;
            let before = spring.told.lock().unwrap().len();
            assert!(begin(&mut serve()).is_err());
            assert_eq!(spring.told.lock().unwrap().len(), before);
            let place = latch.clear().unwrap().place.unwrap();
            let left = if is_lost { vec![] } else { vec![stands] };
            assert_eq!((place.began, place.left), (vec![began], left));
        }
    }
    assert!((5..45).contains(&refusals), "{refusals}");
}
