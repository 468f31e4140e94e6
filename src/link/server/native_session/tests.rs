mod on_the_way;
mod records;

use std::sync::{Arc, Mutex};

use crate::Transport;
use crate::served::LinkBuild;
use crate::server::{Host, ServerEvent, Simulated, Tap, Tapped};
use gusset_actuator::specimen::SpecimenLaw;
use gusset_control::port::{Pace, WiringCheck};
use gusset_quantity::substructure::{
    Command, Freshness, Introduction, LinkFault, Measurement, Retirement, Status, Substructure,
    Unavailable,
};
use gusset_quantity::time::{Clock, Nanos, SimClock};
use gusset_wire::Side;
use gusset_wire::handshake::{
    self, Arm, Axis, Control, Hello, Limits, RefuseCode, Sampling, Unit, Versions, layout_hash,
};
use gusset_wire::native::{Cause, Decoder, Encoder, Frame, Heartbeat, LARGEST_FRAME, Notice};

/// A controller of 1000 commands a second, armed at zero for command 0, of a spring of 8 N/mm.
struct Controller {
    end: Simulated,
    clock: SimClock,
    encoder: Encoder,
    decoder: Decoder,
    session: u64,
    out: Vec<u8>,
    tap: Tap,
}

fn axis() -> Axis {
    Axis {
        name: "axis 1".to_owned(),
        disp_unit: Unit::Metre,
        force_unit: Unit::Newton,
        limits: Limits::NONE,
    }
}

fn hello(axis: Axis, rate: (u64, u64)) -> Hello {
    Hello {
        proof: [0; 32],
        nonce: [7; 32],
        layout: layout_hash(std::slice::from_ref(&axis)),
        versions: Versions::OURS,
        keyed: false,
        rate_numerator: rate.0,
        rate_denominator: rate.1,
        watchdog_s: (rate.1 as f64 / rate.0 as f64).max(0.5),
        sampling: Sampling::Reply,
        software: "test".to_owned(),
        name: "test".to_owned(),
        axes: vec![axis],
    }
}

/// A spring of 8 N/mm.
fn host() -> Host {
    let build = || {
        let text = "law = { linear = { stiffness_n_per_m = 8000.0 } }";
        let law: SpecimenLaw = toml::from_str(text).unwrap();
        Ok(law.build(1).unwrap())
    };
    Host::new("rig".into(), vec![axis()], Box::new(build)).unwrap()
}

impl Controller {
    fn armed(limits: &str) -> Self {
        let limits = vec![toml::from_str(limits).unwrap()];
        Self::of(host().limited(limits), axis())
    }

    /// A session with this host.
    fn of(host: Host, axis: Axis) -> Self {
        Self::over(host, axis, true)
    }

    /// A session over a stream or datagrams.
    fn over(host: Host, axis: Axis, stream: bool) -> Self {
        Self::at_rate(host, axis, stream, (1000, 1))
    }

    /// A session at another rate.
    fn at_rate(host: Host, axis: Axis, stream: bool, rate: (u64, u64)) -> Self {
        let mut one = Self::greeting(host, axis, stream, rate);
        assert!(matches!(one.arm(0, 0.0), Some(Control::Arm(_))));
        one
    }

    /// One that was welcomed.
    fn greeting(host: Host, axis: Axis, stream: bool, rate: (u64, u64)) -> Self {
        Self::greeting_in(Versions::OURS, host, axis, stream, rate)
    }

    /// One that speaks these versions.
    fn greeting_in(
        versions: Versions,
        host: Host,
        axis: Axis,
        stream: bool,
        rate: (u64, u64),
    ) -> Self {
        let (clock, tap) = (SimClock::new(), Tap::default());
        let mut one = Self {
            end: Simulated::new(host, clock.clone(), 0, stream, Some(Arc::clone(&tap))),
            clock,
            encoder: Encoder::greeting(Side::Controller),
            decoder: Decoder::greeting(Side::Specimen),
            session: 0,
            out: vec![0; LARGEST_FRAME],
            tap,
        };
        let mut hello = hello(axis, rate);
        hello.versions = versions;
        let Some(Control::Welcome(welcome)) = one.ask(&Control::Hello(hello)) else {
            panic!("not welcome");
        };
        // A gateway does not know it yet.
        assert!(welcome.standing.iter().all(|place| *place == 0.0));
        one.session = welcome.session;
        one.encoder = Encoder::new(Side::Controller, 1, welcome.session, None).unwrap();
        one.decoder = Decoder::new(Side::Specimen, 1, welcome.session, None).unwrap();
        one
    }

    fn send(&mut self, length: usize) {
        self.end.send(&self.out[..length]).unwrap();
    }

    fn hear(&mut self) -> Result<Option<Vec<u8>>, LinkFault> {
        let mut buffer = vec![0; LARGEST_FRAME];
        let until = self.clock.now().plus(1_000_000);
        let count = self.end.recv(&mut buffer, until)?;
        Ok(count.map(|count| buffer[..count].to_vec()))
    }

    fn ask(&mut self, control: &Control) -> Option<Control> {
        let message = handshake::encode(control).unwrap();
        let length = self.encoder.control(&message, &mut self.out).unwrap();
        self.send(length);
        let frame = self.hear().unwrap()?;
        match self.decoder.open(&frame).unwrap().frame {
            Frame::Control(message) => Some(handshake::decode(message).unwrap()),
            other => panic!("{other:?}"),
        }
    }

    fn arm(&mut self, first_sequence: u64, disp: f64) -> Option<Control> {
        self.ask(&Control::Arm(Arm {
            session: self.session,
            first_sequence,
            disp: vec![disp],
        }))
    }

    fn tell(&mut self, sequence: u64, disp: f64, dt: f64) {
        let command = Command {
            sequence,
            time: 0.0,
            dt,
            disp: &[disp],
            vel: &[0.0],
        };
        let length = self.encoder.command(&command, &mut self.out).unwrap();
        self.send(length);
    }

    /// The measurement that is answered, if anything is.
    fn told(
        &mut self,
        sequence: u64,
        disp: f64,
        dt: f64,
    ) -> Result<Option<Measurement>, LinkFault> {
        self.tell(sequence, disp, dt);
        let Some(frame) = self.hear()? else {
            return Ok(None);
        };
        let mut into = Measurement::zeros(1);
        match self.decoder.open(&frame).unwrap().frame {
            Frame::Measurement(measurement) => measurement.read(&mut into).unwrap(),
            other => panic!("{other:?}"),
        }
        Ok(Some(into))
    }

    /// The status that is answered, if anything is.
    fn command(&mut self, sequence: u64, disp: f64, dt: f64) -> Result<Option<Status>, LinkFault> {
        Ok(self.told(sequence, disp, dt)?.map(|into| {
            assert_eq!((into.sequence, into.disp[0]), (sequence, disp));
            into.status
        }))
    }
}

const FINE: Result<Option<Status>, LinkFault> = Ok(Some(Status(0)));

#[test]
fn second_arm_must_name_the_position() {
    for (before, place) in [(None, 0.05), (Some(0.0), 0.05), (Some(0.001), 0.0)] {
        let mut controller = Controller::armed("command_step_m = { trip = 0.002 }");
        if let Some(disp) = before {
            assert_eq!(controller.command(0, disp, 0.001), FINE);
        }
        match controller.arm(10, place) {
            Some(Control::Refuse(refuse)) => assert_eq!(refuse.code, RefuseCode::Position),
            other => panic!("{other:?}"),
        }
        assert_eq!(controller.hear(), Err(LinkFault::Closed));
    }
}

#[test]
fn command_before_the_second_arm_is_void() {
    let mut controller = Controller::armed("");
    assert_eq!(controller.command(0, 0.001, 0.001), FINE);
    let again = controller.arm(10, 0.001);
    assert!(matches!(again, Some(Control::Arm(_))), "{again:?}");
    assert_eq!(controller.command(9, 0.5, 0.001), Ok(None));
    let repeated = controller.arm(10, 0.001);
    assert!(matches!(repeated, Some(Control::Arm(_))), "{repeated:?}");
    assert_eq!(controller.arm(5, 0.001), None, "an earlier one, late");
    assert_eq!(controller.command(10, 0.001, 0.001), FINE);
}

#[test]
fn impossible_test_time_ends_the_session() {
    for dt in [-1e-3, 1e13, 2.0] {
        let mut controller = Controller::armed("");
        assert_eq!(controller.command(0, 0.0, 0.001), FINE);
        assert_eq!(
            controller.command(1, 0.0, dt),
            Err(LinkFault::Closed),
            "{dt}"
        );
    }
}

#[test]
fn speed_is_judged_by_the_announced_rate() {
    let mut controller = Controller::armed("command_vel_m_per_s = { trip = 0.1 }");
    assert_eq!(controller.command(0, 0.0, 0.9), FINE);
    assert_eq!(controller.command(1, 0.00009, 1e-6), FINE, "slow motion");
    assert_eq!(controller.command(2, 0.00018, 0.9), FINE);
    let into = controller.told(3, 0.00208, 0.9).unwrap().unwrap();
    assert!(into.status.has(Status::INTERLOCK));
    assert_eq!(into.disp, [0.00018], "it did not go there");
}

/// Messages that a specimen across another link receives, in order.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Told {
    Command(u64),
    Hold,
    Halt,
}

#[derive(Default)]
struct Beyond {
    told: Arc<Mutex<Vec<Told>>>,
    disp: f64,
    sequence: u64,
    last_words: Option<&'static str>,
    /// From this displacement on its interlock is open.
    opens_at: Option<f64>,
    /// From this displacement on the link is lost.
    lost_at: Option<f64>,
}

impl Substructure for Beyond {
    fn axes(&self) -> usize {
        1
    }
    fn is_remote(&self) -> bool {
        true
    }
    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        Ok(Introduction {
            standing: vec![0.0],
            ..Introduction::default()
        })
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        (self.disp, self.sequence) = (command.disp[0], command.sequence);
        if self.lost_at.is_some_and(|place| self.disp >= place) {
            return Err(LinkFault::Closed);
        }
        self.told
            .lock()
            .unwrap()
            .push(Told::Command(command.sequence));
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        into.sequence = self.sequence;
        (into.disp[0], into.force[0]) = (self.disp, 8000.0 * self.disp);
        let is_open = self.opens_at.is_some_and(|place| self.disp >= place);
        into.status = if is_open {
            Status::INTERLOCK
        } else {
            Status(0)
        };
        Ok(Freshness::Fresh)
    }
    fn pause(&mut self) -> Result<(), LinkFault> {
        self.told.lock().unwrap().push(Told::Hold);
        Ok(())
    }
    fn halt(&mut self) -> Result<(), LinkFault> {
        self.told.lock().unwrap().push(Told::Halt);
        Ok(())
    }
    fn retire(&mut self, _: Retirement) {}
    fn last_words(&self) -> Option<String> {
        self.last_words.map(str::to_owned)
    }
}

/// A gateway to a specimen with this final message, and the messages that it receives.
fn gateway(last_words: Option<&'static str>) -> (Host, Arc<Mutex<Vec<Told>>>) {
    let told = Arc::<Mutex<Vec<Told>>>::default();
    let heard = Arc::clone(&told);
    let host = gateway_to(move || Beyond {
        told: Arc::clone(&heard),
        last_words,
        opens_at: Some(0.004),
        ..Beyond::default()
    });
    (host, told)
}

fn gateway_to(beyond: impl Fn() -> Beyond + Send + Sync + 'static) -> Host {
    let build: LinkBuild = Arc::new(move |_| Ok(Box::new(beyond())));
    let stiffness = vec![8000.0];
    Host::gateway("far".into(), vec![axis()], stiffness, build, 1_000_000_000)
}

#[test]
fn hold_follows_the_command_before_it() {
    let (host, told) = gateway(None);
    let mut controller = Controller::of(host, axis());
    let hold = |controller: &mut Controller, sequence: u64| {
        controller.holds(sequence, Cause::Operator);
    };
    let first = |told: &[Told]| match told[0] {
        Told::Command(first) => first,
        Told::Hold | Told::Halt => panic!("{told:?}"),
    };
    controller.tell(0, 0.0, 0.0);
    hold(&mut controller, 0);
    controller.hear().unwrap().unwrap();
    let said = told.lock().unwrap().clone();
    assert_eq!(said, [Told::Command(first(&said)), Told::Hold]);
    // Missing frames that are not due do not alarm the watchdog.
    controller.clock.advance(600_000_000);
    assert!(controller.hear().unwrap().is_none());
    // One that was overtaken is over, and is not passed on at all.
    controller.tell(1, 0.0, 0.0);
    hold(&mut controller, 1);
    controller.tell(2, 0.0, 0.0);
    controller.hear().unwrap().unwrap();
    let all = told.lock().unwrap().clone();
    let newest = Told::Command(first(&all) + 2);
    assert_eq!(all[2..], [newest]);
}

/// The stop applies whether earlier commands were passed on or not, and in a hold, too: the motion after it starts from
/// rest.
#[test]
fn stop_precedes_the_return_command() {
    let (host, told) = gateway(None);
    let mut controller = Controller::of(host, axis());
    assert_eq!(controller.command(0, 0.0, 0.0), FINE);
    controller.tell(1, 0.0, 0.0);
    controller.holds(1, Cause::Operator);
    controller.hear().unwrap().unwrap();
    // Said more than once, over UDP: it is one.
    for _ in 0..3 {
        controller.holds(1, Cause::Orderly);
    }
    assert!(controller.hear().unwrap().is_none());
    // The gateway is a command behind.
    assert_eq!(controller.command(2, 0.0, 0.0), FINE);
    controller.tell(3, 0.0, 0.0);
    controller.holds(3, Cause::Orderly);
    controller.holds(3, Cause::Operator);
    controller.tell(4, 0.0, 0.0);
    controller.hear().unwrap().unwrap();
    let all = told.lock().unwrap().clone();
    let Told::Command(first) = all[0] else {
        panic!("{all:?}")
    };
    let [second, third, fifth] = [1, 2, 4].map(|later| Told::Command(first + later));
    assert_eq!(
        all[1..],
        [second, Told::Hold, Told::Halt, third, Told::Halt, fifth]
    );
}

/// The controller judges the command after an operator's hold as without it; after a stop it judges from rest.
#[test]
fn only_a_stop_before_a_return_allows_rest() {
    for (cause, trips) in [
        (None, false),
        (Some(Cause::Operator), false),
        (Some(Cause::Orderly), true),
    ] {
        let (host, _) = gateway(None);
        let limits = toml::from_str("command_accel_m_per_s2 = { trip = 50.0 }").unwrap();
        let mut controller = Controller::of(host.limited(vec![limits]), axis());
        // 0.1 m/s in ticks of 1 ms: 20 m/s² by and by, and 100 m/s² from rest.
        let mut disp = 0.0;
        for (sequence, step) in (0..).zip([0.0, 2e-5, 4e-5, 6e-5, 8e-5, 1e-4]) {
            disp += step;
            controller.clock.advance(1_000_000);
            let status = controller.command(sequence, disp, 0.001);
            assert_eq!(status, FINE, "{cause:?} {sequence}");
        }
        if let Some(cause) = cause {
            controller.holds(5, cause);
        }
        controller.clock.advance(1_000_000);
        let into = controller.told(6, disp + 1e-4, 0.001).unwrap().unwrap();
        assert_eq!(into.status.has(Status::INTERLOCK), trips, "{cause:?}");
    }
}

#[test]
fn refused_command_keeps_the_pending_one() {
    for dt in [-0.02, 1000.0, f64::MAX] {
        let (host, _) = gateway(None);
        let mut controller = Controller::over(host, axis(), false);
        assert_eq!(controller.command(0, 0.0, 0.0), FINE);
        // Both are there when the gateway looks: the first is pending when the second is judged.
        controller.tell(1, 0.001, 0.001);
        controller.tell(2, 0.009, dt);
        // Nor do these.
        controller.tell(1, 0.008, 0.001);
        controller.tell(0, 0.007, 0.001);
        let frame = controller.hear().unwrap().unwrap();
        let mut into = Measurement::zeros(1);
        match controller.decoder.open(&frame).unwrap().frame {
            Frame::Measurement(measurement) => measurement.read(&mut into).unwrap(),
            other => panic!("{other:?}"),
        }
        assert_eq!((into.sequence, into.disp[0]), (1, 0.001), "{dt}");
    }
}

#[test]
fn first_command_must_match_the_arm() {
    for (again, disp, lost) in [
        (false, 0.0, 0),
        (false, 2e-3, 0),
        (true, 0.0, 0),
        (true, 2e-3, 0),
        // The first step of a small motion.
        (false, 1e-4, 0),
        // The first is lost: the next has a distance.
        (false, 2e-3, 1),
    ] {
        let (host, told) = gateway(None);
        let limits = toml::from_str("command_step_m = { trip = 0.01 }").unwrap();
        let mut controller = Controller::of(host.limited(vec![limits]), axis());
        let mut first = 0;
        if again {
            assert_eq!(controller.command(0, 0.0, 0.0), FINE);
            first = 10;
            assert!(matches!(controller.arm(first, 0.0), Some(Control::Arm(_))));
        }
        let before = told.lock().unwrap().len();
        let into = controller.told(first + lost, disp, 0.001).unwrap().unwrap();
        let may = disp < 1e-3 || lost > 0;
        assert_eq!(into.status.has(Status::INTERLOCK), !may, "{again} {disp}");
        assert_eq!(told.lock().unwrap().len() - before, usize::from(may));
    }
}

#[test]
fn slow_rate_gives_no_extra_first_time() {
    // Ten seconds a command, of which 20 ms are there: 1 mm at 0.1 m/s is beyond.
    let (host, told) = gateway(None);
    let limits = toml::from_str("command_vel_m_per_s = { trip = 0.1 }").unwrap();
    let mut controller = Controller::at_rate(host.limited(vec![limits]), axis(), true, (1, 10));
    controller.clock.advance(1_000_000);
    let into = controller.told(1, 0.003, 0.001).unwrap().unwrap();
    assert!(into.status.has(Status::INTERLOCK), "the first was left out");
    assert!(told.lock().unwrap().is_empty());
}

#[test]
fn computed_trip_lasts_only_with_memory() {
    for remembers in [false, true] {
        let limits = toml::from_str("command_step_m = { trip = 0.002 }").unwrap();
        let first = host().limited(vec![limits]);
        let first = if remembers {
            first.remembering()
        } else {
            first
        };
        let latch = first.latch();
        let again = host().limited(vec![limits]).guarded_as(&first);
        let mut controller = Controller::of(first, axis());
        assert_eq!(controller.command(0, 0.0, 0.001), FINE);
        let into = controller.told(1, 0.003, 0.001).unwrap().unwrap();
        assert!(into.status.has(Status::INTERLOCK));
        assert_eq!(latch.trip().is_some(), remembers);
        drop(controller);
        let mut served = again.specimen(remembers).unwrap();
        let controller = crate::served::Controller::unnamed(([127, 0, 0, 1], 1).into());
        let begun = served.begin(&controller, &mut || Ok(()));
        assert_eq!(begun.is_err(), remembers);
        latch.clear().unwrap();
        assert!(served.begin(&controller, &mut || Ok(())).is_ok());
    }
}

#[test]
fn latched_specimen_refuses_a_hello() {
    let (host, told) = gateway(None);
    host.latch()
        .set("far", "interlock", "the interlock is open");
    let clock = SimClock::new();
    let mut end = Simulated::new(host, clock.clone(), 0, true, None);
    let message = handshake::encode(&Control::Hello(hello(axis(), (1000, 1)))).unwrap();
    let mut frame = vec![0; LARGEST_FRAME];
    let length = Encoder::greeting(Side::Controller).control(&message, &mut frame);
    end.send(&frame[..length.unwrap()]).unwrap();
    let until = clock.now().plus(1_000_000);
    let length = end.recv(&mut frame, until).unwrap().unwrap();
    let mut decoder = Decoder::greeting(Side::Specimen);
    let Frame::Control(message) = decoder.open(&frame[..length]).unwrap().frame else {
        panic!("no refusal");
    };
    let Control::Refuse(refuse) = handshake::decode(message).unwrap() else {
        panic!("no refusal");
    };
    assert_eq!(refuse.code, RefuseCode::NotReady);
    assert!(
        refuse.text.contains("the interlock is open"),
        "{}",
        refuse.text
    );
    assert!(told.lock().unwrap().is_empty());
}

impl Controller {
    /// A hold behind the command of this number.
    fn holds(&mut self, sequence: u64, cause: Cause) {
        let notice = Notice { sequence, cause };
        let length = self.encoder.hold(notice, &mut self.out).unwrap();
        self.send(length);
    }

    /// The next frames, in words.
    fn says(&mut self) -> Vec<String> {
        let mut said = Vec::new();
        while let Ok(Some(frame)) = self.hear() {
            said.push(match self.decoder.open(&frame).unwrap().frame {
                Frame::Control(message) => match handshake::decode(message).unwrap() {
                    Control::Bye(bye) => format!("bye {}: {}", bye.cause, bye.text),
                    other => other.name().to_owned(),
                },
                Frame::Goodbye(notice) => format!("goodbye {:?}", notice.cause),
                other => format!("{other:?}"),
            });
        }
        said
    }

    /// Cause and text of the far end's goodbye.
    fn ended(&self) -> String {
        let tap = self.tap.lock().unwrap();
        let ended = tap.iter().rev().find_map(|tapped| match tapped {
            Tapped::Event {
                event: ServerEvent::Ended { text, .. },
                ..
            } => Some(text.clone()),
            _ => None,
        });
        ended.unwrap_or_default()
    }
}

#[test]
fn gateway_passes_on_the_final_message() {
    for (last_words, told) in [
        (None, vec!["goodbye Orderly"]),
        (
            Some("it tripped: pump lost pressure"),
            vec!["bye 0: it tripped: pump lost pressure", "goodbye Orderly"],
        ),
    ] {
        let (host, _) = gateway(last_words);
        let mut controller = Controller::of(host, axis());
        assert_eq!(controller.command(0, 0.0, 0.0), FINE);
        let cause = Cause::Orderly;
        let notice = Notice { sequence: 0, cause };
        let length = controller.encoder.retire(notice, &mut controller.out);
        controller.send(length.unwrap());
        assert_eq!(controller.says(), told);
    }
}

const FORCE: &str = "it tripped: axis 1: measured force 40.0 N, allowed 30.0 N (measured_force)";
const OPEN: &str = "the interlock or emergency stop at the specimen is open";

#[test]
fn gateway_passes_on_the_cause_of_a_trip() {
    // In its own words, or in ours, without repetition.
    let once = ["bye 1: ", OPEN].concat();
    for (last_words, told) in [
        (
            FORCE.to_owned(),
            [&once, "; the specimen said: ", FORCE].concat(),
        ),
        (["it tripped: ", OPEN].concat(), once.clone()),
    ] {
        let root = tempfile::tempdir().unwrap();
        let (host, _) = gateway(Some(last_words.leak()));
        let host = host.recorded(records::kept(root.path()));
        let mut controller = Controller::of(host, axis());
        assert_eq!(controller.command(0, 0.0, 0.0), FINE);
        let into = controller.told(1, 0.005, 0.001).unwrap().unwrap();
        assert!(into.status.has(Status::INTERLOCK));
        let cause = Cause::Tripped;
        let notice = Notice { sequence: 1, cause };
        let length = controller.encoder.retire(notice, &mut controller.out);
        controller.send(length.unwrap());
        let is_news = told != once;
        let mut expected = vec![once.clone(), told, "goodbye Tripped".to_owned()];
        expected.dedup();
        assert_eq!(controller.says(), expected);
        let (events, _) = records::record(root.path());
        let is_told = events.iter().any(|(event, _)| event == "last_words");
        assert_eq!(is_told, is_news, "{events:?}");
    }
}

fn check() -> WiringCheck {
    WiringCheck::Probe {
        amplitude: vec![0.005],
        stiffness: vec![1e6],
        accepted: None,
        pace: Pace::of(0.001, 0.0001),
        units: Vec::new(),
    }
}

/// A controller that speaks version 1 alone does not know the cause of a lost specimen.
#[test]
fn lost_specimen_is_reported_by_its_code() {
    for (highest, told) in [(1, Cause::Tripped), (2, Cause::Lost)] {
        let gateway = || {
            gateway_to(|| Beyond {
                lost_at: Some(0.004),
                ..Beyond::default()
            })
        };
        let greeting = |host| {
            let lowest = 1;
            let versions = Versions { lowest, highest };
            Controller::greeting_in(versions, host, axis(), true, (1000, 1))
        };
        let mut controller = greeting(gateway());
        assert!(matches!(controller.arm(0, 0.0), Some(Control::Arm(_))));
        assert_eq!(controller.command(0, 0.0, 0.0), FINE);
        controller.tell(1, 0.005, 0.001);
        let said = controller.says();
        let begins = format!("bye {}: ", told.code());
        assert!(said[0].starts_with(&begins), "{said:?}");
        assert_eq!(said[1], format!("goodbye {told:?}"));
        // It is lost before the test.
        let mut controller = greeting(gateway().checked(check(), false));
        match controller.arm(0, 0.0) {
            Some(Control::Refuse(refuse)) if highest == 1 => {
                assert_eq!(refuse.code, RefuseCode::NotReady);
            }
            Some(Control::Bye(bye)) if highest == 2 => assert_eq!(bye.cause, told.code()),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn refusal_contains_the_cause_of_a_trip() {
    let (host, _) = gateway(Some(FORCE));
    let host = host.checked(check(), false);
    let refused = Controller::greeting(host, axis(), true, (1000, 1)).arm(0, 0.0);
    let Some(Control::Refuse(refuse)) = refused else {
        panic!("{refused:?}");
    };
    for words in ["direction", OPEN, FORCE, "led to"] {
        assert!(refuse.text.contains(words), "{}", refuse.text);
    }
}

#[test]
fn controller_without_retire_is_reported() {
    let leave = |with: &dyn Fn(&mut Controller) -> usize| {
        let mut controller = Controller::armed("");
        assert_eq!(controller.command(0, 0.0, 0.001), FINE);
        let length = with(&mut controller);
        controller.send(length);
        assert!(controller.says().is_empty(), "without an answer");
        controller.ended()
    };
    for (cause, told) in [
        (Cause::Orderly, " at the end of the test"),
        (Cause::Operator, ": its operator asked for it"),
        (Cause::Shutdown, ": its program ends"),
        (Cause::Tripped, ": it tripped"),
    ] {
        let goodbye = leave(&|controller| {
            let notice = Notice { sequence: 0, cause };
            let Controller { encoder, out, .. } = controller;
            encoder.goodbye(notice, out).unwrap()
        });
        assert_eq!(goodbye, format!("the controller said goodbye{told}"));
        let bye = leave(&|controller| {
            let message = handshake::encode(&Control::Bye(handshake::Bye {
                cause: cause.code(),
                text: "lunch".to_owned(),
            }));
            let Controller { encoder, out, .. } = controller;
            encoder.control(&message.unwrap(), out).unwrap()
        });
        assert_eq!(bye, format!("the controller said goodbye{told}: lunch"));
        let over = crate::server::channel::said_goodbye(cause.code(), "");
        assert_eq!(over.cause, cause.ending());
    }
}
