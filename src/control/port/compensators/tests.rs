//! Commands of every kind of compensator while test time is stretched.

use nalgebra::ComplexField as _;
use std::f64::consts::TAU;

use super::*;
use crate::port::{Axis, AxisSpec, Order, Port, PortSpec, StepPacer};
use gusset_actuator::compensation::CompensationSpec;
use gusset_quantity::frame::AtStructure;
use gusset_quantity::substructure::Substructure;
use gusset_quantity::substructure::{Command, Freshness, LinkFault, Measurement, Retirement};
use gusset_quantity::time::Nanos;

/// Wall time of a tick, s.
const TICK: f64 = 1.0 / 1024.0;
/// Ticks of easing.
const EASE: u32 = 256;
/// Amplitude in m and frequency in Hz of the target.
const SIZE: f64 = 0.01;
const HERTZ: f64 = 0.5;

const ALL: [&str; 11] = [
    "none = {}",
    "polynomial = { order = 3, delay_s = 0.0205 }",
    "polynomial = { order = 2, delay_s = 0.02, nodes = \"step\" }",
    "newton = { delay_s = 0.02 }",
    "inverse = { delay_s = 0.02 }",
    "model_inverse = { coefficients = [1.0, 0.02, 8e-5, 1e-7] }",
    "model_inverse = { coefficients = [1.2, 0.024, 9.6e-5] }",
    "ats = { delay_s = 0.015 }",
    "amb = {}",
    "recursive_fir = { delay_s = 0.015 }",
    "pi_lead = {}",
];

/// In the names of what adapts or feeds back.
const ADAPTS: [&str; 4] = ["ats", "amb", "fir", "pi_lead"];

/// A spring behind a first-order lag that lives in wall time, and goes on while test time stands still.
#[derive(Debug)]
struct Lag {
    gain: f64,
    decay: f64,
    told: f64,
    disp: f64,
    /// True of a command whose answer is lost.
    loses: fn(u64) -> bool,
    number: u64,
    /// What was answered last.
    known: f64,
}

impl Substructure for Lag {
    fn axes(&self) -> usize {
        1
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        (self.told, self.number) = (command.disp[0], command.sequence);
        self.disp += (1.0 - self.decay) * (self.gain * self.told - self.disp);
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        let is_lost = (self.loses)(self.number);
        if !is_lost {
            (into.sequence, self.known) = (self.number, self.disp);
        }
        (into.disp[0], into.force[0]) = (self.known, 1e5 * self.known);
        Ok(if is_lost {
            Freshness::Stale
        } else {
            Freshness::Fresh
        })
    }
    fn retire(&mut self, _: Retirement) {}
}

/// The target at a time: it comes to its size over a second, without a jump of its acceleration.
fn target(time: f64) -> f64 {
    let s = time.clamp(0.0, 1.0);
    let share = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
    SIZE * share * libm::sin(TAU * HERTZ * time)
}

/// A hold is wanted from one tick to another.
type Hold = Option<(usize, usize)>;

/// Target, command and parameters of a tick, and whether test time stood still in it.
struct Row {
    target: f64,
    command: f64,
    vel: f64,
    target_vel: f64,
    parameters: Vec<f64>,
    pace: f64,
    stood: bool,
    ended: f64,
}

/// A port, and the loop that leads it: one partner that answers late in some steps is all that is not in it.
struct Drive {
    port: Port,
    tempo: StepPacer,
    stride: PacerTick,
    step: usize,
    reached: bool,
    waits: usize,
    stands: bool,
    n: u32,
}

fn made(spec: &CompensationSpec, delay_in_test_time: bool) -> Compensators {
    let spec = Compensation {
        compensators: vec![spec.build(TICK).unwrap()],
        tick: TICK,
        pace: 1.0,
        delay_in_test_time,
        base_moves: false,
    };
    Compensators::new(spec, vec![1.0])
}

impl Drive {
    fn new(kind: &str, n: u32, in_test_time: bool) -> Self {
        Self::losing(kind, n, in_test_time, |_| false)
    }

    /// The same of which some answers are lost.
    fn losing(kind: &str, n: u32, in_test_time: bool, loses: fn(u64) -> bool) -> Self {
        let spec: CompensationSpec = toml::from_str(kind).unwrap();
        let lag = Lag {
            gain: if kind.contains("1.2") { 1.0 / 1.2 } else { 1.0 },
            decay: libm::exp(-TICK / 0.02),
            told: 0.0,
            disp: 0.0,
            loses,
            number: 0,
            known: 0.0,
        };
        let axis = Axis::plain(vec![(0, 1.0)]);
        let axes = vec![AxisSpec::new(axis, 1e5)];
        let mut port = PortSpec::new("rig", Box::new(lag), 1, axes)
            .build()
            .unwrap();
        port.path.set_pace(false, Order::Quadratic);
        port.path.set_compensators(made(&spec, in_test_time));
        port.aim_at(&mut std::iter::once(AtStructure((0.0, 0.0))));
        port.begin_way();
        port.begin_compensation();
        let mut tempo = StepPacer::new(n, EASE);
        tempo.know();
        Self {
            port,
            tempo,
            stride: PacerTick::none(),
            step: 0,
            reached: false,
            waits: 0,
            stands: false,
            n,
        }
    }

    fn dt(&self) -> f64 {
        f64::from(self.n) * TICK
    }

    /// A tick as the engine makes it; `late` ticks pass before the target after this step is known.
    fn tick(&mut self, number: usize, hold: bool, late: impl Fn(usize) -> usize) -> Row {
        let dt = self.dt();
        let stood = self.stands;
        if stood {
            self.port.repeat(number as u64, 0.0).unwrap();
        } else {
            assert_eq!(self.port.clear().trip, None);
            self.port.issue(number as u64, 0.0, 0.0).unwrap();
        }
        self.port.collect(Nanos(0)).unwrap();
        let row = Row {
            target: self.port.target()[0],
            command: self.port.path().sent()[0],
            vel: self.port.path.command().vel[0],
            target_vel: self.port.target_vel()[0],
            parameters: self.port.path().compensation_parameters().collect(),
            pace: self.stride.pace,
            stood,
            ended: if self.stride.lands() {
                1.0
            } else {
                self.stride.share
            },
        };
        if stood && hold {
            return row;
        }
        if !stood {
            if self.stride.lands() && !self.reached {
                self.reached = true;
                self.waits = late(self.step);
                self.tempo.begin();
                self.port.path_mut().reach();
            }
            if self.reached && self.waits == 0 {
                self.step += 1;
                self.reached = false;
                let (now, before) = (
                    target(self.step as f64 * dt),
                    target((self.step as f64 - 1.0) * dt),
                );
                self.port.seek_at(&mut std::iter::once(AtStructure((
                    now,
                    (now - before) / dt,
                ))));
                let share = self.tempo.share();
                self.tempo.know();
                self.port.know(share);
            }
            self.waits = self.waits.saturating_sub(1);
        }
        self.stride = self.tempo.next(hold);
        self.stands = hold && self.tempo.stands();
        if self.stands {
            self.port.path_mut().hold();
        } else {
            self.port.advance(&self.stride, dt);
        }
        row
    }

    fn run(&mut self, ticks: usize, hold: Hold, late: impl Fn(usize) -> usize) -> Vec<Row> {
        (0..ticks)
            .map(|k| {
                let held = hold.is_some_and(|(from, to)| (from..to).contains(&k));
                self.tick(k, held, &late)
            })
            .collect()
    }
}

const PROMPT: fn(usize) -> usize = |_| 0;

/// Largest difference of a series from tick to tick.
fn largest(series: impl Iterator<Item = f64>) -> f64 {
    let series: Vec<f64> = series.collect();
    series
        .windows(2)
        .map(|w| (w[1] - w[0]).abs())
        .fold(0.0, f64::max)
}

/// What a command may change by in a tick. With a target d, a lead l, a gain g of what stands and a pace ρ it is
/// c = g d + ρ l: for ρ = 1 the undisturbed command, for ρ = 0 the place. A tick of stretched time is a part of one of the
/// undisturbed test, in which neither changes by more than the larger of both does there; and ρ changes by 1/E. In between it
/// is a straight line where the path is a cubic: 2 %. A lead is found where the target is fastest.
fn bound(kind: &str, n: u32) -> (f64, f64) {
    let rows = Drive::new(kind, n, false).run(4096, None, PROMPT);
    let settled = || rows.iter().skip(1024);
    let gain = if kind.contains("1.2") { 1.2 } else { 1.0 };
    let place = gain * largest(settled().map(|row| row.target));
    let led = largest(settled().map(|row| row.command));
    let lead = settled().map(|row| (row.command - gain * row.target).abs());
    let lead = lead.fold(0.0, f64::max);
    // What adapts, and the loop of PI, hold the command within some per cent of that of a place and a lead.
    assert!(led < 1.2 * place, "{kind} {n}: {led} {place}");
    // The loop of PI sees its target slow down while the specimen still comes: twice (K_p) the difference of both ways, which
    // is at most the target's own.
    let sees = if kind.contains("pi_lead") { 2.0 } else { 0.0 };
    let bound = 1.02 * led.max(place) + sees * place + lead / f64::from(EASE);
    (bound, lead)
}

/// At the full pace the velocity of a command is what commands change by, over the ticks of a step: within one, the lead of what
/// takes an acceleration bends where the path does. In a hold it becomes that of the target.
#[test]
fn velocity_is_that_of_the_command() {
    // PI adds what is in no lead.
    for kind in ALL.iter().filter(|kind| !kind.starts_with("pi_lead")) {
        for n in [1, 4] {
            let rows = Drive::new(kind, n, false).run(5000, Some((3072, 4000)), PROMPT);
            let most = TAU * HERTZ * SIZE;
            for (k, w) in rows.windows(n as usize + 1).enumerate().skip(1024) {
                let [first, .., last] = w else { continue };
                if kind.starts_with("none") {
                    assert_eq!(last.vel.to_bits(), last.target_vel.to_bits());
                }
                if k < 3000 {
                    let moved = (last.command - first.command) / (f64::from(n) * TICK);
                    let told = w[1..].iter().map(|row| row.vel).sum::<f64>() / f64::from(n);
                    // With one tick a step both are the same difference, but for coefficients that adapt; with several a slope at
                    // the end of a tick is half a tick ahead of the way it makes, ω Δt/2 = 1.5e-3 of the largest.
                    let within = if n == 1 { 2e-3 } else { 5e-3 } * most;
                    let off = (told - moved).abs();
                    assert!(off < within, "{kind} {n} {k}: {off} of {most}");
                }
                if last.stood {
                    let gain = if kind.contains("1.2") { 1.2 } else { 1.0 };
                    let ahead = (last.vel - gain * last.target_vel).abs();
                    let adapts = ADAPTS.iter().any(|word| kind.contains(word));
                    assert!(adapts || ahead < 0.01 * most, "{kind} {n} {k}: {ahead}");
                }
            }
        }
    }
}

#[test]
fn a_hold_kicks_no_command_of_any_kind() {
    let mut kicked = Vec::new();
    for n in [1, 4, 10] {
        for kind in ALL {
            let (bound, lead) = bound(kind, n);
            // Where the target is about as fast as it ever is.
            let rows = Drive::new(kind, n, false).run(5000, Some((2048, 2700)), PROMPT);
            let settled = || rows.iter().skip(1024);
            let found = largest(settled().map(|row| row.command));
            if found > bound {
                kicked.push(format!("{kind} {n}: {found} beyond {bound}"));
            }
            // It stands, and its lead with it but for the last of the eased ticks.
            let stood: Vec<_> = settled().filter(|row| row.stood).collect();
            assert_eq!(stood.len(), 2701 - 2048 - EASE as usize, "{kind} {n}");
            let gain = if kind.contains("1.2") { 1.2 } else { 1.0 };
            let ahead = (stood[0].command - gain * stood[0].target).abs();
            // What adapts has a gain of its own, and the loop of PI an error of its own.
            if !ADAPTS.iter().any(|word| kind.contains(word)) {
                assert!(ahead <= 1.1 * lead / f64::from(EASE), "{kind} {n}: {ahead}");
            }
            assert_eq!(settled().last().unwrap().pace, 1.0);
        }
    }
    assert!(kicked.is_empty(), "{kicked:#?}");
}

#[test]
fn late_target_makes_no_step() {
    let mut kicked = Vec::new();
    for n in [1, 4, 10] {
        for kind in ALL {
            let (bound, _) = bound(kind, n);
            // Late by some ticks, by more than a step, and for long.
            let late = |step: usize| match (step * n as usize) / 256 {
                8 if step.is_multiple_of(3) => 7,
                9 if step.is_multiple_of(7) => n as usize + 5,
                10 if step.is_multiple_of(16) => 400,
                _ => 0,
            };
            let rows = Drive::new(kind, n, false).run(12_000, None, late);
            let settled = || rows.iter().skip(1024);
            assert!(settled().any(|row| row.pace == 0.0), "{kind} {n}");
            assert_eq!(settled().last().unwrap().pace, 1.0);
            // A target that is known late turns the way: a prediction that is off by the third difference e of the targets is put
            // right over a fifth of the step, w ticks, along a cubic that bends by 6 e/w² a tick². What takes second and third
            // differences makes up to 250 times that of it: τ²/2 = 210 ticks² here, a₂ and a₃ of the models less.
            let third = libm::pow(TAU * HERTZ * f64::from(n) * TICK, 3.0) * SIZE;
            let over = (0.2 * f64::from(n)).max(1.0);
            let bound = bound + 250.0 * 6.0 * third / (over * over);
            let found = largest(settled().map(|row| row.command));
            if found > bound {
                kicked.push(format!("{kind} {n}: {found} beyond {bound}"));
            }
        }
    }
    assert!(kicked.is_empty(), "{kicked:#?}");
}

#[test]
fn undisturbed_test_has_equal_bits() {
    for n in [1, 4, 10] {
        for kind in ALL {
            let mut drive = Drive::new(kind, n, false);
            let spec: CompensationSpec = toml::from_str(kind).unwrap();
            let mut plain = spec.build(TICK).unwrap();
            plain.reset(0.0);
            let (mut last, mut last_vel, mut heard) = (0.0, 0.0, None);
            for k in 0..3000 {
                // Between two targets it is the difference of the points.
                let vel = match n {
                    1 => drive.port.target_vel()[0],
                    _ => (drive.port.target()[0] - last) / TICK,
                };
                let row = drive.tick(k, false, PROMPT);
                if let Some((command, measured)) = heard {
                    plain.observe(command, measured);
                    let command = plain.predict(row.target, vel, (vel - last_vel) / TICK);
                    assert_eq!(row.command.to_bits(), command.to_bits(), "{kind} {n} {k}");
                }
                (last, last_vel) = (row.target, vel);
                heard = Some((row.command, drive.port.feedback().disp()[0]));
            }
        }
    }
}

/// An actuator that lives in test time sees the same way at every pace: at each target its command is the undisturbed one.
#[test]
fn delay_is_compensated_at_every_pace() {
    for n in [1, 4, 10] {
        for kind in ALL {
            // What adapts is fed by a plant that lives in wall time here.
            if ADAPTS.iter().any(|word| kind.contains(word)) {
                continue;
            }
            let at_targets = |hold: Hold| -> Vec<(f64, f64)> {
                let rows = Drive::new(kind, n, true).run(5000, hold, PROMPT);
                let reached = rows.iter().filter(|row| row.ended == 1.0 && !row.stood);
                reached.map(|row| (row.target, row.command)).collect()
            };
            let held = at_targets(Some((2048, 2700)));
            let free = at_targets(None);
            assert!(held.len() > 4000 / n as usize && held.len() < free.len());
            for (k, (held, free)) in held.iter().zip(&free).enumerate() {
                assert_eq!(held.0, free.0);
                // Weights up to (τ/Δt)³ = 1e4 at their sums of the roundoff of 1 cm.
                let close = (held.1 - free.1).abs() < 1e-12;
                assert!(close, "{kind} {n} {k}: {} {}", held.1, free.1);
            }
        }
    }
}

#[test]
fn stretched_time_teaches_nothing() {
    for kind in [
        "ats = { delay_s = 0.015 }",
        "amb = {}",
        "recursive_fir = { delay_s = 0.015 }",
    ] {
        let spec: CompensationSpec = toml::from_str(kind).unwrap();
        let memory = spec.build(TICK).unwrap().memory() as usize;
        // Four poles of 20 Hz, the slowest of which fades with 48 per second, to 1e-6; and some ticks.
        assert!((280..400).contains(&memory), "{kind}: {memory}");
        let rows = Drive::new(kind, 1, false).run(5000, Some((2048, 2700)), PROMPT);
        let full = |row: &Row| row.pace == 1.0;
        let slow = rows.iter().position(|row| !full(row)).unwrap();
        let again = rows.iter().rposition(|row| !full(row)).unwrap() + 1;
        assert_eq!(slow, 2049);
        // The row of a tick has the parameters with what was heard in it.
        let learnt = |from: usize, to: usize| rows[from].parameters != rows[to].parameters;
        assert!(learnt(slow - 2, slow - 1), "{kind}");
        assert!(!learnt(slow - 1, again + memory - 1), "{kind}");
        assert!(learnt(again + memory - 1, again + memory), "{kind}");
    }
}

/// One answer in so many is lost, as by a hash of its number.
fn is_lost(number: u64, one_in: u64) -> bool {
    let mixed = (number + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 33).is_multiple_of(one_in)
}

const LEARN: [&str; 3] = [
    "ats = { delay_s = 0.015 }",
    "amb = {}",
    "recursive_fir = { delay_s = 0.015 }",
];

/// Delay in s that a kind makes up for by its parameters, at the target's frequency.
fn delay_of(kind: &str, parameters: &[f64]) -> f64 {
    let omega = TAU * HERTZ;
    let response: nalgebra::Complex<f64> = (0..)
        .zip(parameters)
        .map(|(j, a)| {
            let (sine, cosine) = libm::sincos(-omega * TICK * f64::from(j));
            if kind.contains("fir") {
                nalgebra::Complex::new(cosine, sine) * *a
            } else {
                nalgebra::Complex::new(0.0, omega).powi(j) * *a
            }
        })
        .sum();
    response.argument() / omega
}

/// What is learnt of a motion is learnt whether or not some of its answers are lost: the time base is that of the ticks.
#[test]
fn lost_measurements_keep_the_delay() {
    for kind in LEARN {
        let learns = |loses: fn(u64) -> bool| {
            let rows = Drive::losing(kind, 1, false, loses).run(16_000, None, PROMPT);
            delay_of(kind, &rows.last().unwrap().parameters)
        };
        let whole = learns(|_| false);
        // The lag is 20 ms.
        assert!((whole - 0.02).abs() < 1e-3, "{kind}: {whole}");
        let few: fn(u64) -> bool = |number| is_lost(number, 50);
        let many: fn(u64) -> bool = |number| is_lost(number, 5);
        for loses in [few, many] {
            let found = learns(loses);
            // A straight line across g ticks is off by (ω g Δt)²/8 of the motion, 1e-5 for g = 3.
            assert!(
                (found - whole).abs() < 2e-3 * whole,
                "{kind}: {found} {whole}"
            );
        }
    }
}

/// Frozen where an answer is missing: what is filled in later is filled in, too.
#[test]
fn gap_is_filled_with_equal_bits() {
    let loses: fn(u64) -> bool = |number| (2048..2060).contains(&number);
    for kind in LEARN {
        let mut one = Drive::losing(kind, 1, true, loses);
        let mut two = Drive::losing(kind, 1, true, loses);
        for k in 0..2055 {
            one.tick(k, false, PROMPT);
            two.tick(k, false, PROMPT);
        }
        let state = one.port.freeze_compensation().unwrap();
        let spec: CompensationSpec = toml::from_str(kind).unwrap();
        two.port.path.set_compensators(made(&spec, true));
        two.port.thaw_compensation(&state);
        let last = one.port.path().compensation_parameters().last();
        for k in 2055..2300 {
            let (one, two) = (one.tick(k, false, PROMPT), two.tick(k, false, PROMPT));
            assert_eq!(one.command.to_bits(), two.command.to_bits(), "{kind} {k}");
        }
        assert_ne!(
            one.port.path().compensation_parameters().last(),
            last,
            "{kind}"
        );
    }
}

/// After a gap that no straight line crosses nothing is learnt until what was before it is forgotten.
#[test]
fn a_long_gap_is_not_learnt_of() {
    for kind in LEARN {
        let spec: CompensationSpec = toml::from_str(kind).unwrap();
        let memory = spec.build(TICK).unwrap().memory() as usize;
        let end = 2048 + memory / 8;
        let short: fn(u64) -> bool = |number| (2048..2080).contains(&number);
        let long: fn(u64) -> bool = |number| (2048..2200).contains(&number);
        assert!((2080..2150).contains(&end), "{kind}: {end}");
        for (loses, last) in [(short, 2079), (long, 2199)] {
            let rows = Drive::losing(kind, 1, false, loses).run(5000, None, PROMPT);
            let learnt = |row: usize| rows[row - 1].parameters != rows[row].parameters;
            assert!(learnt(2047), "{kind}");
            assert!((2048..=last).all(|row| !learnt(row)), "{kind}");
            if last < end {
                assert!(learnt(last + 1), "{kind}");
            } else {
                assert!((last..=last + memory).all(|row| !learnt(row)), "{kind}");
                assert!(learnt(last + memory + 1), "{kind}");
            }
        }
    }
}

/// With the difference of its own points a Newton form is the polynomial of order 2 on nodes a tick apart, at every number of ticks
/// a step and every pace.
#[test]
fn newton_is_the_stated_polynomial() {
    for n in [1, 4, 10] {
        for hold in [None, Some((2048, 2700))] {
            let late = |step: usize| if step == 900 { 9 } else { 0 };
            let run = |kind| Drive::new(kind, n, false).run(4000, hold, late);
            let newton = run("newton = { delay_s = 0.02 }");
            let polynomial = run("polynomial = { order = 2, delay_s = 0.02, nodes = \"step\" }");
            for (k, (a, b)) in newton.iter().zip(&polynomial).enumerate() {
                // Weights of (τ/Δt)²/2 = 210 at roundoff of 1 cm.
                let off = (a.command - b.command).abs();
                assert!(off < 210.0 * 16.0 * f64::EPSILON * SIZE, "{n} {k}: {off}");
            }
        }
    }
}

/// Frozen in the middle of an ease, or of a wait, and gone on with by others: the same bits.
#[test]
fn stretched_time_continues_with_equal_bits() {
    for n in [1, 4, 10] {
        for kind in ALL {
            for at in [2100, 2500, 2800] {
                let hold = |k: usize| (2048..2700).contains(&k);
                let mut one = Drive::new(kind, n, false);
                for k in 0..at {
                    one.tick(k, hold(k), PROMPT);
                }
                let state = one.port.freeze_compensation().unwrap();
                let mut two = Drive::new(kind, n, false);
                // The way and the loop are others' to carry over: here they are made again.
                for k in 0..at {
                    two.tick(k, hold(k), PROMPT);
                }
                let spec: CompensationSpec = toml::from_str(kind).unwrap();
                two.port.path.set_compensators(made(&spec, false));
                two.port.thaw_compensation(&state);
                // To where what was measured before counts again.
                for k in at..3300 {
                    let (one, two) = (one.tick(k, hold(k), PROMPT), two.tick(k, hold(k), PROMPT));
                    let same = one.command.to_bits() == two.command.to_bits();
                    assert!(same, "{kind} {n} {at} {k}: {} {}", one.command, two.command);
                }
            }
        }
    }
}

/// A point that was foretold, and came out otherwise, is put right before the next is asked for: without that a tick behind a
/// late target would have 20 times the difference in it.
#[test]
fn a_target_that_was_foretold_is_put_right() {
    let mut drive = Drive::new("inverse = { delay_s = 0.02 }", 4, false);
    // What it remembers is its last target alone, at the end of its state.
    let remembers = |drive: &mut Drive| {
        let state = drive.port.freeze_compensation().unwrap();
        f64::from_bits(*state.words().last().unwrap())
    };
    let late = |step: usize| if step == 500 { 12 } else { 0 };
    let mut foretold = 0.0;
    for k in 0..3000 {
        if drive.step == 500 {
            foretold = remembers(&mut drive);
        }
        let row = drive.tick(k, false, late);
        if drive.step == 502 {
            // The tick in which the target of step 501 was reached: the next point is asked for already.
            break;
        }
        if drive.step == 501 && !drive.stride.lands() {
            assert_eq!(remembers(&mut drive), target(501.0 * drive.dt()));
            assert!(row.target != target(501.0 * drive.dt()));
        }
    }
    // A quadratic prediction is off by the third difference of the targets: (2π/2 · 4/1024)³ of 1 cm.
    let off = (foretold - target(501.0 * drive.dt())).abs();
    assert!(off > 1e-9, "{off}");
}
