//! Thousands of tests in which anything can go wrong, each determined by its seed; the invariants hold in each.
//!
//! GUSSET_FAULT_SEEDS is their number, GUSSET_FAULT_SEED the first of them; `tools/faults` sets both.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use gusset_config::fault_script::{Channel, Fault, Kind, Script, Way};
use gusset_config::{Loaded, load};
use gusset_control::engine::Operator;

use crate::invariants;
use crate::lab::{Extra, Played, play};
use crate::rig;

/// In CI.
const SEEDS: u64 = 10_000;
/// Seeds that once showed a mistake: a shutdown beyond the limit, a replay that ended before its test, a hold requested after a
/// stop, a test that was given up in its last tick, a refused first command after the confirmation.
const AGAIN: [u64; 12] = [
    1_004_879, 1_021_428, 1_000_923, 1_004_909, 1_020_436, 2_001_360, 2_007_826, 2_020_391,
    2_027_915, 2_045_720, 20_953_153, 90_015_247,
];

/// The number of tests to draw from at that time.
const KNOWN_THEN: usize = 10;

/// SplitMix64.
pub struct Chance(u64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0xD134_2543_DE82_EF95))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn below(&mut self, count: u64) -> u64 {
        self.next() % count
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.share()
    }

    pub fn one_in(&mut self, count: u64) -> bool {
        self.below(count) == 0
    }
}

/// The tests that are played, with short openings: those of the folder beside this file, by name, and then those with several
/// ticks a step and with compensators.
pub fn tests() -> Vec<Loaded> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults/campaign");
    let mut tests = tests_in(&folder);
    tests.extend(tests_in(&folder.join("paced")));
    tests
}

fn tests_in(folder: &Path) -> Vec<Loaded> {
    let entries = std::fs::read_dir(folder).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    let mut paths: Vec<_> = paths.filter(|path| path.is_file()).collect();
    paths.sort();
    let read = |path: PathBuf| load(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
    paths.into_iter().map(read).collect()
}

/// Frames that fail a check, or arrive in another way than they were sent.
fn a_frame_fault(chance: &mut Chance) -> Kind {
    match chance.below(13) {
        0..=2 => Kind::Lost,
        3 => Kind::Late {
            ticks: chance.between(0.1, 3.0),
        },
        4 => Kind::Jitter {
            ticks: chance.between(0.1, 2.5),
        },
        5 => Kind::Duplicated {
            times: 1 + chance.below(3) as u32,
        },
        6 => Kind::Reordered,
        7 => Kind::OldAgain {
            age: 1 + chance.below(64) as usize,
        },
        8 => Kind::Corrupted {
            bits: 1 + chance.below(8) as u32,
        },
        9 => Kind::WrongLength,
        10 => Kind::Truncated,
        11 => Kind::Garbage,
        _ => match chance.below(3) {
            0 => Kind::NotANumberSent,
            _ => Kind::AnswersTheFuture {
                by: 1 + chance.below(5),
            },
        },
    }
}

fn a_rig_fault(chance: &mut Chance) -> Kind {
    let channel = match chance.below(3) {
        0 => Channel::Disp,
        1 => Channel::Force,
        _ => Channel::Both,
    };
    match chance.below(17) {
        0 => Kind::Frozen,
        1 => Kind::Stroke {
            disp_m: chance.between(0.001, 0.02),
        },
        2 => Kind::Rate {
            vel_m_per_s: chance.between(0.01, 0.3),
        },
        3 => Kind::ForceLimit {
            force_n: chance.between(1e4, 2e5),
        },
        4 => Kind::Lag {
            commands: 1 + chance.below(5) as usize,
        },
        5 => Kind::Stuck { channel },
        6 => Kind::Bias {
            disp_m: chance.between(-0.01, 0.01),
            force_n: chance.between(-2e5, 2e5),
        },
        7 => Kind::Drift {
            disp_m: chance.between(-1e-4, 1e-4),
            force_n: chance.between(-5e3, 5e3),
        },
        8 => Kind::Noise {
            disp_m: chance.between(0.0, 1e-3),
            force_n: chance.between(0.0, 2e4),
        },
        9 => Kind::Dropout { channel },
        10 => Kind::Reversed { channel },
        11 => Kind::Gain {
            factor: chance.between(-3.0, 4.0),
        },
        12 => Kind::NotANumber,
        13 => Kind::Interlock,
        14 => Kind::Saturated,
        15 => Kind::Goodbye,
        _ => Kind::Elsewhere { disp_m: 0.003 },
    }
}

fn a_fault(chance: &mut Chance) -> Fault {
    let (mut on, mut probability) = (None, None);
    let kind = match chance.below(20) {
        0..=9 => {
            on = chance.one_in(3).then_some(Way::Commands);
            probability = (!chance.one_in(3)).then(|| chance.between(0.01, 0.6));
            a_frame_fault(chance)
        }
        10..=15 => a_rig_fault(chance),
        16 => Kind::Closed,
        17 => Kind::Hangs {
            ticks: chance.between(0.5, 60.0),
        },
        18 if chance.one_in(4) => Kind::ArmingUnanswered,
        18 => Kind::ClockDrift {
            ppm: chance.between(-1e5, 1e5),
        },
        _ => Kind::ControllerStalls {
            ticks: 1 + chance.below(50),
        },
    };
    if matches!(kind, Kind::NotANumberSent | Kind::AnswersTheFuture { .. }) {
        on = None;
    }
    let timeless = matches!(
        kind,
        Kind::ClockDrift { .. } | Kind::ArmingUnanswered | Kind::Elsewhere { .. }
    );
    let moment = matches!(
        kind,
        Kind::Closed | Kind::Hangs { .. } | Kind::Goodbye | Kind::ControllerStalls { .. }
    );
    let lasts = match chance.below(3) {
        0 => None,
        1 => Some(1),
        _ => Some(1 + chance.below(20)),
    };
    Fault {
        at: (!timeless).then(|| chance.below(130)),
        lasts: lasts.filter(|_| !timeless && !moment),
        axis: None,
        on,
        probability,
        kind,
    }
}

/// The faults in the test with this seed.
pub fn script(seed: u64, chance: &mut Chance) -> Script {
    let faults = chance.below(5);
    let script = Script {
        title: format!("seed {seed}"),
        seed,
        fault: (0..faults).map(|_| a_fault(chance)).collect(),
        ..Script::default()
    };
    assert_eq!(
        gusset_config::check_script(&script, Some(1)),
        Ok(()),
        "{script:?}"
    );
    script
}

pub fn operator(seed: u64, chance: &mut Chance) -> Vec<(u64, Operator)> {
    if !chance.one_in(4) {
        // Known seeds repeat their test: the operator spoke less at the time.
        return if AGAIN.contains(&seed) {
            Vec::new()
        } else {
            hasty_operator(&mut Chance::new(!seed))
        };
    }
    let hold = 90 + chance.below(60);
    let mut says = vec![
        (hold, Operator::Hold),
        (hold + 1 + chance.below(40), Operator::Continue),
    ];
    if chance.one_in(2) {
        says.push((chance.below(200), Operator::Stop));
    }
    says
}

/// An operator who commands at random, twice in one tick, too: during zeroing, the warm-up and the shutdown.
fn hasty_operator(chance: &mut Chance) -> Vec<(u64, Operator)> {
    if !chance.one_in(4) {
        return Vec::new();
    }
    let words = 1 + chance.below(6);
    let mut at = chance.below(120);
    let mut says = Vec::new();
    for _ in 0..words {
        says.push(match chance.below(5) {
            0 | 1 => (at, Operator::Hold),
            2 | 3 => (at, Operator::Continue),
            _ => (at, Operator::Stop),
        });
        at += chance.below(4) * chance.below(10);
    }
    // The last command continues every hold.
    says.push((at + chance.below(30), Operator::Continue));
    says
}

/// One test of the campaign.
pub struct Case {
    pub script: Script,
    /// Without the deliberate errors.
    pub loaded: Loaded,
    pub played: Result<Played, String>,
}

/// Whether the rigs start where the test begins, as all once did, or anywhere.
#[derive(Clone, Copy, PartialEq)]
enum Stand {
    AtZero,
    Anywhere,
}

/// The test with this seed and its faults. `as_played` changes the test that is played, not the one that is checked.
fn one_as(
    tests: &[Loaded],
    seed: u64,
    stand: Stand,
    as_played: impl Fn(&Loaded) -> Option<Loaded>,
) -> Case {
    let mut chance = Chance::new(seed);
    let known = if AGAIN.contains(&seed) {
        KNOWN_THEN
    } else {
        tests.len()
    };
    let loaded = &tests[chance.below(known as u64) as usize];
    let (loaded, places) = match stand {
        Stand::AtZero => (loaded.clone(), Vec::new()),
        Stand::Anywhere => rig::draw(seed, loaded),
    };
    // One test out of two has limits at the far end, too.
    let limited = chance.one_in(2);
    let script = script(seed, &mut chance);
    let second = Script {
        title: "the second specimen".to_owned(),
        fault: if chance.one_in(3) {
            vec![a_fault(&mut chance)]
        } else {
            Vec::new()
        },
        ..Script::default()
    };
    let extra = Extra {
        script: Some(&script),
        operator: operator(seed, &mut chance),
        confirms_after: seed % 7,
        ..Extra::default()
    };
    let other = as_played(&loaded);
    let mut seen = Vec::new();
    let played = play(other.as_ref().unwrap_or(&loaded), extra, |index, setup| {
        let faults = if index == 0 { &script } else { &second };
        let place = places.get(index).copied().unwrap_or_default();
        let (host, mut at) = rig::Rig::new(&loaded, index, &place).host(setup);
        if faults
            .fault
            .iter()
            .any(|fault| moves_by_itself(&fault.kind))
        {
            // An actuator fault moves it elsewhere.
            at.driven = Arc::default();
        }
        seen.push(at);
        let own = limited.then(|| rig::own_limits(&place));
        host.limited(own.into_iter().collect())
            .faulty(faults.clone())
            .unwrap()
    });
    let played = played.map(|played| Played { seen, ..played });
    Case {
        script,
        loaded,
        played,
    }
}

/// True for a fault between a command and the actuator.
pub const fn moves_by_itself(kind: &Kind) -> bool {
    matches!(
        kind,
        Kind::Frozen
            | Kind::Stroke { .. }
            | Kind::Rate { .. }
            | Kind::ForceLimit { .. }
            | Kind::Lag { .. }
    )
}

fn one(tests: &[Loaded], seed: u64) -> Case {
    one_as(tests, seed, Stand::Anywhere, |_| None)
}

pub fn from_environment(name: &str, usual: u64) -> u64 {
    match std::env::var(name) {
        Ok(text) => text
            .parse()
            .unwrap_or_else(|_| panic!("{name} is {text:?}, wanted a number")),
        Err(_) => usual,
    }
}

/// Plays the tests with the numbers below `count`, each once, until it is `enough`.
pub fn on_all_processors(count: u64, enough: impl Fn() -> bool + Sync, play: impl Fn(u64) + Sync) {
    let next = AtomicU64::new(0);
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= count || enough() {
                        return;
                    }
                    play(number);
                }
            });
        }
    });
}

#[test]
fn whatever_goes_wrong_what_must_hold_holds() {
    let seeds = from_environment("GUSSET_FAULT_SEEDS", SEEDS);
    let first = from_environment("GUSSET_FAULT_SEED", 0);
    let tests = tests();
    // Once as drawn then, and once more with rigs at any position.
    let again: Vec<(u64, Stand)> = if first == 0 {
        let both = |seed: &u64| [(*seed, Stand::AtZero), (*seed, Stand::Anywhere)];
        AGAIN.iter().flat_map(both).collect()
    } else {
        Vec::new()
    };
    let wrong = Mutex::new(Vec::new());
    let ends = Mutex::new(std::collections::BTreeMap::<String, u64>::new());
    let steps = AtomicU64::new(0);
    let enough = || wrong.lock().unwrap().len() >= 5;
    on_all_processors(seeds + again.len() as u64, enough, |number| {
        let (seed, stand) = match again.get(number as usize) {
            Some(again) => *again,
            None => (first + number - again.len() as u64, Stand::Anywhere),
        };
        let case = one_as(&tests, seed, stand, |_| None);
        let Case {
            script,
            loaded,
            played,
        } = case;
        let outcome = played.and_then(|played| {
            steps.fetch_add(played.outcome.steps, Ordering::Relaxed);
            let (reason, exit) = played.verdict();
            let sort: String = reason
                .chars()
                .filter(|c| !c.is_numeric())
                .take(48)
                .collect();
            *ends
                .lock()
                .unwrap()
                .entry(format!("{exit:3} {sort}"))
                .or_default() += 1;
            invariants::check(&loaded, &played).map_err(|text| {
                format!(
                    "{text}\n{:?}, exit {exit}: {reason}\n{}",
                    played.path(),
                    played.told()
                )
            })
        });
        if let Err(text) = outcome {
            wrong.lock().unwrap().push((seed, text, script));
        }
    });
    for (end, count) in ends.into_inner().unwrap() {
        println!("{count:7} × {end}");
    }
    println!(
        "{seeds} tests from seed {first}, {} steps",
        steps.into_inner()
    );
    let mut wrong = wrong.into_inner().unwrap();
    wrong.sort_by_key(|(seed, ..)| *seed);
    for (seed, text, script) in &wrong {
        println!(
            "SEED {seed}: {text}\n{:#?}\nagain: GUSSET_FAULT_SEED={seed} GUSSET_FAULT_SEEDS=1 cargo test --test faults campaign -- --nocapture\n",
            script.fault
        );
    }
    assert!(
        wrong.is_empty(),
        "{} tests went wrong, the first with seed {}",
        wrong.len(),
        wrong[0].0
    );
}

#[test]
fn controller_without_limits_is_detected() {
    let forgetful = |loaded: &Loaded| {
        let mut other = loaded.clone();
        for specimen in &mut other.file.specimen {
            specimen.limits = None;
        }
        Some(other)
    };
    let tests = tests();
    let found = (0..300).filter(|seed| {
        let case = one_as(&tests, *seed, Stand::AtZero, forgetful);
        let played = case.played.unwrap();
        invariants::check(&case.loaded, &played).is_err_and(|text| text.contains("command"))
    });
    let found = found.count();
    assert!(found >= 3, "only {found} of 300");
}

#[test]
fn rig_at_a_wrong_place_is_detected() {
    let tests = tests();
    let (mut elsewhere, mut uncommanded) = (0, 0);
    for seed in 0..60 {
        let case = one(&tests, seed);
        let mut played = case.played.unwrap();
        let says = |played: &Played, words: &str| {
            invariants::check(&case.loaded, played).is_err_and(|text| text.contains(words))
        };
        let units = case.loaded.file.specimen[0].units_of(1)[0];
        let is_driven = !played.seen[0].driven.lock().unwrap().is_empty();
        if is_driven {
            let place = played.seen[0].stood + 0.001 / units.metres;
            played.seen[0].driven.lock().unwrap().push(place);
            uncommanded += u32::from(says(&played, "not commanded"));
        }
        played.seen[0].stood += 0.02 / units.metres;
        elsewhere += u32::from(says(&played, "command 0"));
    }
    assert!(
        elsewhere >= 30 && uncommanded >= 25,
        "only {elsewhere} moved and {uncommanded} lost of 60"
    );
}

#[test]
fn two_plays_of_a_seed_are_equal() {
    let tests = tests();
    for seed in [3, 5, 11, 17] {
        let (one_play, other) = (one(&tests, seed), one(&tests, seed));
        let (one_play, other) = (one_play.played.unwrap(), other.played.unwrap());
        assert_eq!(one_play.samples, other.samples, "seed {seed}");
        assert_eq!(one_play.events_jsonl, other.events_jsonl, "seed {seed}");
        assert_eq!(one_play.taps, other.taps, "seed {seed}");
    }
}
