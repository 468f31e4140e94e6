//! No client moves a specimen faster than its limit allows.
//!
//! With a limit v of the commanded speed, no sequence of commands, bursts, silences, holds, Arms and sessions moves a specimen by
//! more than v·(T + burst) in any T seconds. The burst is 0.02 s, or two announced periods where that is longer, and 0.1 s at
//! most. Each sequence is drawn from its seed, and is played on simulated time.

use std::sync::{Arc, Mutex};

use gusset_config::LimitsSpec;
use gusset_link::Transport;
use gusset_link::served::{Controller, Latch, LinkBuild, ServedSpecimen};
use gusset_link::server::{Host, Simulated};
use gusset_quantity::catalog::ending;
use gusset_quantity::substructure::{
    Command, Freshness, Introduction, LinkFault, Measurement, Retirement, Substructure, Unavailable,
};
use gusset_quantity::time::{Clock, Nanos, SimClock};
use gusset_quantity::units::AxisUnits;
use gusset_wire::Side;
use gusset_wire::handshake::{
    self, Arm, Axis, Control, Hello, Limits, Sampling, Unit, Versions, layout_hash,
};
use gusset_wire::native::{Cause, Decoder, Encoder, Frame, LARGEST_FRAME, Notice};

use crate::campaign::Chance;

/// The limit of the commanded speed, m/s.
const SPEED: f64 = 0.1;
/// Longest silence that the client announces, s.
const WATCHDOG_S: f64 = 0.5;
const SEEDS: u64 = 40;
const ACTIONS: usize = 400;

fn limits() -> LimitsSpec {
    toml::from_str(&format!("command_vel_m_per_s = {{ trip = {SPEED} }}")).unwrap()
}

/// The burst at this rate, s.
fn burst((commands, seconds): (u64, u64)) -> f64 {
    (2.0 * seconds as f64 / commands as f64).clamp(0.02, 0.1)
}

/// Positions of a specimen over time.
#[derive(Clone, Default)]
struct Led(Arc<Mutex<Vec<(Nanos, f64)>>>);

impl Led {
    fn to(&self, now: Nanos, disp: f64) {
        self.0.lock().unwrap().push((now, disp));
    }

    fn place(&self) -> f64 {
        self.0.lock().unwrap().last().map_or(0.0, |led| led.1)
    }

    /// The largest excess of the distance in any T seconds, both ends included, over v·T.
    fn beyond_its_speed(&self) -> f64 {
        let (mut last, mut beyond, mut most) = ((Nanos(0), 0.0), 0.0_f64, 0.0_f64);
        for (now, disp) in self.0.lock().unwrap().iter() {
            let passed = now.since(last.0) as f64 * 1e-9;
            beyond = (beyond - SPEED * passed).max(0.0) + (disp - last.1).abs();
            most = most.max(beyond);
            last = (*now, *disp);
        }
        most
    }

    /// The excess for windows that begin after a command and end with one.
    fn beyond_its_own_time(&self) -> f64 {
        let (mut last, mut beyond, mut most) = ((Nanos(0), 0.0), 0.0_f64, 0.0_f64);
        for (now, disp) in self.0.lock().unwrap().iter() {
            let passed = now.since(last.0) as f64 * 1e-9;
            beyond = (beyond + (disp - last.1).abs() - SPEED * passed).max(0.0);
            most = most.max(beyond);
            last = (*now, *disp);
        }
        most
    }
}

/// A specimen behind a link that follows each command; without a clock the test leads it.
struct Specimen {
    clock: Option<SimClock>,
    led: Led,
    sequence: u64,
    disp: f64,
}

impl Substructure for Specimen {
    fn axes(&self) -> usize {
        1
    }
    fn is_remote(&self) -> bool {
        true
    }
    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        Ok(Introduction {
            standing: vec![self.led.place()],
            force: vec![0.0],
            ..Introduction::default()
        })
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        (self.sequence, self.disp) = (command.sequence, command.disp[0]);
        if let Some(clock) = &self.clock {
            self.led.to(clock.now(), self.disp);
        }
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        into.sequence = self.sequence;
        (into.disp[0], into.force[0]) = (self.disp, 0.0);
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
}

fn axis() -> Axis {
    Axis {
        name: "axis 1".to_owned(),
        disp_unit: Unit::Metre,
        force_unit: Unit::Newton,
        limits: Limits::NONE,
    }
}

/// A client of Gusset's protocol, and the gateway that it commands.
struct Client {
    clock: SimClock,
    led: Led,
    rate: (u64, u64),
    /// Every session uses its guard and latch.
    first: Host,
    end: Simulated,
    encoder: Encoder,
    decoder: Decoder,
    session: u64,
    sequence: u64,
    out: Vec<u8>,
}

impl Client {
    fn new(rate: (u64, u64)) -> Self {
        let (clock, led) = (SimClock::new(), Led::default());
        clock.advance(1_000_000_000);
        let first = host(&clock, &led);
        let mut client = Self {
            end: Simulated::new(
                host(&clock, &led).guarded_as(&first),
                clock.clone(),
                0,
                true,
                None,
            ),
            clock,
            led,
            rate,
            first,
            encoder: Encoder::greeting(Side::Controller),
            decoder: Decoder::greeting(Side::Specimen),
            session: 0,
            sequence: 0,
            out: vec![0; LARGEST_FRAME],
        };
        client.connect();
        client
    }

    /// A new session. The old one ends without a goodbye.
    fn connect(&mut self) {
        let host = host(&self.clock, &self.led).guarded_as(&self.first);
        // The old one is dropped first: it returns what it borrowed.
        self.end = Simulated::new(unused(), self.clock.clone(), 0, true, None);
        self.end = Simulated::new(host, self.clock.clone(), 0, true, None);
        self.encoder = Encoder::greeting(Side::Controller);
        self.decoder = Decoder::greeting(Side::Specimen);
        let axis = axis();
        let hello = Hello {
            proof: [0; 32],
            nonce: [7; 32],
            layout: layout_hash(std::slice::from_ref(&axis)),
            versions: Versions::OURS,
            keyed: false,
            rate_numerator: self.rate.0,
            rate_denominator: self.rate.1,
            watchdog_s: WATCHDOG_S.max(self.rate.1 as f64 / self.rate.0 as f64),
            sampling: Sampling::Reply,
            software: "test".to_owned(),
            name: "test".to_owned(),
            axes: vec![axis],
        };
        let answer = self.ask(&Control::Hello(hello));
        let Some(Control::Welcome(welcome)) = answer else {
            panic!("not welcome: {answer:?}");
        };
        self.session = welcome.session;
        self.encoder = Encoder::new(Side::Controller, 1, welcome.session, None).unwrap();
        self.decoder = Decoder::new(Side::Specimen, 1, welcome.session, None).unwrap();
        self.sequence = 0;
        self.arm();
    }

    fn arm(&mut self) {
        let arm = Control::Arm(Arm {
            session: self.session,
            first_sequence: self.sequence,
            disp: vec![self.led.place()],
        });
        self.ask(&arm);
    }

    fn send(&mut self, length: usize) {
        // A client whose connection is closed connects again.
        let _ = self.end.send(&self.out[..length]);
    }

    fn hear(&mut self) -> Result<Option<Vec<u8>>, LinkFault> {
        let mut buffer = vec![0; LARGEST_FRAME];
        let count = self.end.recv(&mut buffer, self.clock.now())?;
        Ok(count.map(|count| buffer[..count].to_vec()))
    }

    fn ask(&mut self, control: &Control) -> Option<Control> {
        let message = handshake::encode(control).unwrap();
        let length = self.encoder.control(&message, &mut self.out).unwrap();
        self.send(length);
        while let Ok(Some(frame)) = self.hear() {
            if let Ok(received) = self.decoder.open(&frame)
                && let Frame::Control(message) = received.frame
            {
                return handshake::decode(message).ok();
            }
        }
        None
    }

    fn command(&mut self, disp: f64) {
        let command = Command {
            sequence: self.sequence,
            time: 0.0,
            dt: 0.0,
            disp: &[disp],
            vel: &[0.0],
        };
        let length = self.encoder.command(&command, &mut self.out).unwrap();
        self.sequence += 1;
        self.send(length);
    }

    /// Takes every answer. After a trip the operator clears it, and the client connects again.
    fn settle(&mut self) {
        let is_lost = loop {
            match self.hear() {
                Ok(Some(_)) => {}
                Ok(None) => break false,
                Err(_) => break true,
            }
        };
        let tripped = self.first.latch().clear().unwrap().trip.is_some();
        if tripped || is_lost {
            self.connect();
        }
    }
}

fn host(clock: &SimClock, led: &Led) -> Host {
    let (clock, led) = (clock.clone(), led.clone());
    let build: LinkBuild = Arc::new(move |_| {
        Ok(Box::new(Specimen {
            clock: Some(clock.clone()),
            led: led.clone(),
            sequence: 0,
            disp: led.place(),
        }))
    });
    let stiffness = vec![1e5];
    let host = Host::gateway("rig".into(), vec![axis()], stiffness, build, 1_000_000_000);
    host.limited(vec![limits()])
}

/// A host that no session uses.
fn unused() -> Host {
    host(&SimClock::new(), &Led::default())
}

/// A step that may just pass, or may not; `silent_s` have passed since the last.
fn a_step(chance: &mut Chance, rate: (u64, u64), silent_s: f64) -> f64 {
    let period = rate.1 as f64 / rate.0 as f64;
    let seconds = match chance.below(8) {
        0 => 0.0,
        1 | 2 => period,
        3 => burst(rate),
        4 => burst(rate) + period,
        5 => silent_s,
        // As far as a first command may be from the place of its Arm.
        6 => 1e-3 / SPEED,
        _ => chance.between(0.0, 2.0) * period,
    };
    let step = SPEED * seconds * [0.5, 0.999, 1.0][chance.below(3) as usize];
    if chance.one_in(4) { -step } else { step }
}

/// Plays one sequence; returns how far beyond its speed the specimen moved, in m, and in how many commands.
fn played(seed: u64, rates: &[(u64, u64)]) -> (f64, usize) {
    let mut chance = Chance::new(seed);
    let mut client = Client::new(rates[0]);
    let mut silent_since = client.clock.now();
    for _ in 0..ACTIONS {
        let rate = client.rate;
        let period_ns = 1_000_000_000 * rate.1 / rate.0;
        match chance.below(16) {
            0..=6 => {
                let silent_s = client.clock.now().since(silent_since) as f64 * 1e-9;
                let step = a_step(&mut chance, rate, silent_s);
                client.command(client.led.place() + step);
                silent_since = client.clock.now();
            }
            7 | 8 => client.clock.advance(period_ns),
            9 => client.clock.advance(chance.below(period_ns)),
            10 => client.clock.advance(chance.below(3_000_000_000)),
            // Lost commands, as many as there was time for or not.
            11 => client.sequence += [1, 3, 30, 600, 100_000][chance.below(5) as usize],
            12 => {
                let cause = [Cause::Operator, Cause::Orderly][chance.below(2) as usize];
                let sequence = client.sequence.saturating_sub(1);
                let notice = Notice { sequence, cause };
                let length = client.encoder.hold(notice, &mut client.out).unwrap();
                client.send(length);
            }
            13 | 14 => {
                client.sequence += 1;
                client.arm();
            }
            _ => {
                client.rate = rates[chance.below(rates.len() as u64) as usize];
                client.connect();
            }
        }
        client.settle();
    }
    let commands = client.led.0.lock().unwrap().len();
    (client.led.beyond_its_speed(), commands)
}

#[test]
fn rated_client_keeps_speed_and_one_burst() {
    const FAST: (u64, u64) = (1000, 1);
    const SLOW: (u64, u64) = (2, 1);
    let mut commands = 0;
    for rates in [&[FAST][..], &[(100, 1)], &[SLOW], &[FAST, SLOW]] {
        let most = rates.iter().map(|rate| burst(*rate)).fold(0.0, f64::max);
        for seed in 0..SEEDS {
            let (beyond, count) = played(seed, rates);
            assert!(
                beyond <= SPEED * most * (1.0 + 1e-6),
                "seed {seed}, {rates:?}: {beyond} m beyond, allowed {} m",
                SPEED * most
            );
            commands += count;
        }
    }
    // It was commanded at all.
    assert!(commands > 4 * SEEDS as usize * 20, "{commands}");
}

#[test]
fn unrated_client_never_outruns_the_clocks() {
    let controller = Controller::nobody();
    for seed in 0..SEEDS {
        let (mut chance, led) = (Chance::new(seed), Led::default());
        let units = vec![AxisUnits::SI];
        let rig = Box::new(Specimen {
            clock: None,
            led: led.clone(),
            sequence: 0,
            disp: 0.0,
        });
        let mut served = ServedSpecimen::new("rig".into(), rig, units, vec![1e5], vec![0.0])
            .limited(&[limits()])
            .guarded(Default::default(), Latch::default());
        let mut now = Nanos(1_000_000_000);
        served.simulated_now_is(now);
        served.begin(&controller, &mut || Ok(())).unwrap();
        let (mut silent_since, mut into) = (now, Measurement::zeros(1));
        for sequence in 0..ACTIONS as u64 {
            match chance.below(8) {
                0..=3 => {
                    let said = [0.0, 1e-3, 0.02, 0.02, 1.0, 100.0][chance.below(6) as usize];
                    let silent_s = now.since(silent_since) as f64 * 1e-9;
                    let step = a_step(&mut chance, (100, 1), silent_s.min(said));
                    silent_since = now;
                    let disp = led.place() + step;
                    let command = Command {
                        sequence,
                        time: 0.0,
                        dt: said,
                        disp: &[disp],
                        vel: &[0.0],
                    };
                    let went = served.exchange(&command, said, &mut || true, &mut into);
                    if went.is_ok() {
                        // Without a test time a command counts as 0.01 s of it.
                        let said = if said > 0.0 { said } else { 0.01 };
                        assert!(step.abs() <= SPEED * said * (1.0 + 1e-6), "{step} {said}");
                        led.to(now, disp);
                    }
                    served.commit();
                }
                4 | 5 => now = now.plus(chance.below(40_000_000)),
                6 => now = now.plus(chance.below(3_000_000_000)),
                _ => {
                    served.end(ending::Cause::ControllerVanished, "gone");
                    served.begin(&controller, &mut || Ok(())).unwrap();
                }
            }
            served.simulated_now_is(now);
            if served.tripped().is_some() {
                served.end(ending::Cause::ControllerTripped, "tripped");
                served.latch().clear().unwrap();
                served.begin(&controller, &mut || Ok(())).unwrap();
            }
        }
        let beyond = led.beyond_its_own_time();
        let most = SPEED * burst((100, 1));
        assert!(beyond <= most * (1.0 + 1e-6), "seed {seed}: {beyond} m");
        assert!(led.0.lock().unwrap().len() > 20, "seed {seed}");
    }
}
