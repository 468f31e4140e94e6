//! Tests that are interrupted at any moment, most of them killed, and then resumed: each determined by its seed. Every invariant
//! holds for the resumed test, too. Where nothing failed, the response is that of the test without an interruption.
//!
//! GUSSET_FAULT_SEEDS and GUSSET_FAULT_SEED as for the campaign, of whose number it plays a twentieth.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;

use gusset_config::Loaded;
use gusset_config::fault_script::Script;
use gusset_control::engine::{Ending, Phase, Stop};
use gusset_link::NativeSetup;
use gusset_link::server::Host;
use gusset_record::{Journal, Layout, RunFolder};
use gusset_session::{ResumeError, replay, resume_over};
use gusset_setup::build_over;
use serde_json::json;
use sha2::{Digest, Sha256};

use crate::campaign::{
    Chance, from_environment, moves_by_itself, on_all_processors, operator, script, tests,
};
use crate::invariants;
use crate::lab::{Extra, Played, Recorded, Wires, perform};
use crate::rig::{self, Rig, Seen};

/// In CI.
const SEEDS: u64 = 600;
/// The allowed effect of a hold ramp at the start, as a share of the largest displacement.
const SLACK: f64 = 0.25;

/// The random choices of one test.
struct Course {
    loaded: Loaded,
    rigs: Vec<Rig>,
    /// Before and after the interruption.
    scripts: [Script; 2],
    /// How far somebody moves the first rig while no controller is connected, m.
    pushed: Option<f64>,
}

fn draw(tests: &[Loaded], seed: u64, chance: &mut Chance) -> Course {
    let loaded = &tests[chance.below(tests.len() as u64) as usize];
    let (mut loaded, places) = rig::draw(seed, loaded);
    if chance.one_in(2) {
        // The path to every target has the same bits as in the test without an interruption.
        loaded.file.safety.ease_s = 0.0;
    }
    let rigs = places.iter().enumerate();
    let rigs = rigs.map(|(index, place)| Rig::new(&loaded, index, place));
    let rigs = rigs.collect();
    let mut faults = |seed| {
        if chance.one_in(2) {
            return Script::default();
        }
        let mut script = script(seed, chance);
        // The position of a rig whose actuator drifts cannot be seen from outside.
        script.fault.retain(|fault| !moves_by_itself(&fault.kind));
        script
    };
    let scripts = [faults(seed), faults(!seed)];
    let pushed = chance.one_in(6).then(|| chance.between(-0.03, 0.03));
    Course {
        loaded,
        rigs,
        scripts,
        pushed,
    }
}

impl Course {
    /// The far ends for the first test, or for the resumed one.
    fn far_ends<'a>(
        &'a mut self,
        leg: usize,
        seen: &'a mut Vec<Seen>,
    ) -> impl FnMut(usize, &NativeSetup) -> Host + 'a {
        move |index, setup| {
            let (host, at) = self.rigs[index].host(setup);
            seen.push(at);
            if index == 0 {
                host.faulty(self.scripts[leg].clone()).unwrap()
            } else {
                host
            }
        }
    }

    /// Plays the test from its beginning.
    fn first(&mut self, extra: Extra<'_>) -> Result<Recorded, String> {
        let (loaded, mut seen) = (self.loaded.clone(), Vec::new());
        let mut host = self.far_ends(0, &mut seen);
        let mut wires = Wires::new(&loaded, false, &mut host);
        let prepared = build_over(&loaded, &mut |setup| wires.dial(setup));
        perform(prepared.map_err(|error| error.to_string())?, wires, extra)
    }

    /// Resumes the test in `from`, whatever tripped it, and records it in `to`. The error is the reason of a refusal.
    fn second(&mut self, from: &Path, to: &Path, extra: Extra<'_>) -> Result<Gone, String> {
        let (loaded, mut seen) = (self.loaded.clone(), Vec::new());
        let mut host = self.far_ends(1, &mut seen);
        let mut wires = Wires::new(&loaded, false, &mut host);
        let mut prepared = resume_over(from, false, &mut |setup| wires.dial(setup));
        if matches!(&prepared, Err(ResumeError::Tripped { .. })) {
            prepared = resume_over(from, true, &mut |setup| wires.dial(setup));
        }
        let prepared = match prepared {
            Ok(prepared) => prepared,
            // A test that tripped at a limit of its commands needs a wider one.
            Err(
                error @ (ResumeError::Complete(_)
                | ResumeError::NotBegun(_)
                | ResumeError::NextBeyond { .. }),
            ) => return Ok(Gone::Nowhere(error.to_string())),
            Err(error) => return Err(error.to_string()),
        };
        let step = prepared
            .experiment
            .resume
            .as_ref()
            .map_or(0, |from| from.step());
        let recorded = match perform(prepared, wires, extra) {
            Ok(recorded) => recorded,
            // The far end cannot be greeted, by its script.
            Err(text) => return Ok(Gone::Nowhere(text)),
        };
        drop(host);
        keep(&recorded, to)?;
        let mut proof = replay(to).map_err(|error| error.to_string())?;
        if recorded.samples.is_empty() {
            // The test was refused: there is nothing to prove.
            proof.short = None;
        }
        let played = recorded.played(step + 1, proof)?;
        Ok(Gone::On(Box::new(Played { seen, ..played })))
    }
}

/// Outcome of a test that should resume.
enum Gone {
    On(Box<Played>),
    /// For a good reason.
    Nowhere(String),
}

/// The run folder as a killed process leaves it.
fn keep(recorded: &Recorded, path: &Path) -> Result<(), String> {
    let wrong = |error: &dyn std::error::Error| error.to_string();
    let mut folder = RunFolder::create(path).map_err(|error| wrong(&error))?;
    let files = &recorded.files;
    folder
        .keep(&files.test, &files.resolved, &[])
        .map_err(|error| wrong(&error))?;
    if let Some((before, origin)) = &files.origin {
        let kept = folder.keep_before(before);
        kept.and_then(|()| folder.write("resumed.json", origin.as_bytes()))
            .map_err(|error| wrong(&error))?;
    }
    folder
        .open_samples(&recorded.layout)
        .map_err(|error| wrong(&error))?;
    std::fs::write(path.join("samples.bin"), &recorded.samples).map_err(|error| wrong(&error))?;
    let hash = |bytes: &[u8]| {
        let digest = Sha256::digest(bytes);
        digest
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect::<String>()
    };
    let hashes = json!({
        "test.toml": hash(&files.test),
        "resolved.toml": hash(files.resolved.as_bytes()),
    });
    let mut events = format!("{}\n", json!({"event": "files", "sha256": hashes}));
    for (index, stood) in recorded.stood.iter().enumerate() {
        if let Some(stood) = stood {
            let words: Vec<String> = stood.iter().map(|number| format!("{number:?}")).collect();
            let said =
                json!({"event": "connected", "specimen": index + 1, "standing": words.join(" ")});
            events += &format!("{said}\n");
        }
    }
    let mut events = events.into_bytes();
    events.extend_from_slice(&recorded.events_jsonl);
    std::fs::write(path.join("events.jsonl"), events).map_err(|error| wrong(&error))
}

/// Displacements of all storeys, by steps.
type Response = BTreeMap<u64, [f64; 3]>;

/// Displacements of all storeys at the end of every step on record.
fn response(layout: &Layout, samples: &[u8]) -> Response {
    let at = |name: &str| layout.index_of(name).unwrap();
    let (state, step) = (at("state"), at("step"));
    let places = [at("x1"), at("x2"), at("x3")];
    let mut journal = Journal::new(samples, layout.columns().len());
    let mut found = BTreeMap::new();
    while let Ok(Some(row)) = journal.next_row() {
        if row.values[state] == Phase::Running.code() {
            found.insert(
                row.values[step] as u64,
                places.map(|place| row.values[place]),
            );
        }
    }
    found
}

/// The value of the last row in this column.
fn last(recorded: &Recorded, column: &str) -> Option<f64> {
    let place = recorded.layout.index_of(column)?;
    let mut journal = Journal::new(&recorded.samples[..], recorded.layout.columns().len());
    let mut found = None;
    while let Ok(Some(row)) = journal.next_row() {
        found = row.values.get(place).copied();
    }
    found
}

/// Largest difference of two responses as a share of the largest displacement; infinite where steps differ.
fn difference(found: &Response, wanted: &Response) -> f64 {
    let peak = wanted
        .values()
        .flatten()
        .fold(0.0_f64, |peak, x| peak.max(x.abs()));
    if !found.keys().eq(wanted.keys()) {
        return f64::INFINITY;
    }
    let pairs = found.values().flatten().zip(wanted.values().flatten());
    pairs.fold(0.0_f64, |most, (x, y)| most.max((x - y).abs() / peak))
}

/// The test with this seed, and how it ended.
fn one(tests: &[Loaded], seed: u64, home: &Path) -> Result<String, String> {
    let mut chance = Chance::new(seed ^ 0x1A7E_44B7_ED00_0000);
    let mut course = draw(tests, seed, &mut chance);
    let confirms_after = seed % 7;
    let extra = |script| Extra {
        script,
        confirms_after,
        ..Extra::default()
    };
    // Reference: the test without an interruption, on separate rigs.
    let script = course.scripts[0].clone();
    let mut again = Chance::new(seed ^ 0x1A7E_44B7_ED00_0000);
    let whole = draw(tests, seed, &mut again).first(extra(Some(&script)))?;
    let killed_at = chance.below(whole.looks + whole.looks / 10);
    let stopped = chance.one_in(4);
    let interruption = if stopped {
        Extra {
            operator: operator(seed, &mut chance),
            ..extra(Some(&script))
        }
    } else {
        Extra {
            killed_at: Some(killed_at),
            ..extra(Some(&script))
        }
    };
    let first = course.first(interruption)?;
    let (from, to) = (
        home.join(format!("{seed}-1")),
        home.join(format!("{seed}-2")),
    );
    keep(&first, &from)?;
    if let Some(by) = course.pushed {
        course.rigs[0].push(by);
    }
    let script = course.scripts[1].clone();
    let gone = course.second(&from, &to, extra(Some(&script)));
    let gone = gone.map_err(|text| format!("after look {killed_at} of {}: {text}", whole.looks))?;
    for folder in [&from, &to] {
        let _it_may_not_be_there = std::fs::remove_dir_all(folder);
    }
    let played = match gone {
        Gone::Nowhere(reason) => return Ok(format!("    {reason}")),
        Gone::On(played) => played,
    };
    let (reason, exit) = played.verdict();
    let told = || {
        format!(
            "{:?}, exit {exit}: {reason}\n{}",
            played.path(),
            played.told()
        )
    };
    invariants::check(&course.loaded, &played).map_err(|text| format!("{text}\n{}", told()))?;
    let is_where_left = {
        let mut rigs = (1..).zip(&played.seen);
        rigs.all(|(rig, seen)| last(&first, &format!("cmd_{rig}_1")) == Some(seen.stood))
    };
    let nothing_wrong = course.scripts.iter().all(|script| script.fault.is_empty());
    if nothing_wrong && course.pushed.is_none() && !stopped {
        let [wanted, before, after] = [
            (&whole.layout, &whole.samples),
            (&first.layout, &first.samples),
            (&played.layout, &played.samples),
        ]
        .map(|(layout, samples)| response(layout, samples));
        let mut found = before;
        found.extend(after);
        let completes =
            whole.outcome.as_ref().map(|outcome| &outcome.ending) == Some(&Ending::Completed);
        // On a hold ramp a rig passes the peaks between two targets, too, and a law that yields remembers them. Or the last command
        // was sent but not recorded, and is sent again after a recorded one.
        let eased = course.loaded.file.safety.ease_s > 0.0;
        // The lead of a compensator builds up again.
        let leads = course
            .loaded
            .file
            .specimen
            .iter()
            .any(|one| one.compensation.is_some());
        let exact = is_where_left && !eased && !leads;
        let slack = if exact { 0.0 } else { SLACK };
        let off = difference(&found, &wanted);
        // Another way may come to a limit that was near.
        let comparable = slack == 0.0 || played.outcome.ending == Ending::Completed;
        if completes && comparable && off > slack {
            let differs = wanted.iter().find(|(step, x)| found.get(step) != Some(x));
            let found = differs.and_then(|(step, _)| found.get(step));
            return Err(format!(
                "another response, {off} of the peak off: {differs:?}, {found:?}\n{}",
                told()
            ));
        }
    }
    if let (Ending::Stopped(Stop::Moved { .. }), None) = (&played.outcome.ending, course.pushed)
        && nothing_wrong
    {
        return Err(format!("it stands where it was left\n{}", told()));
    }
    Ok(format!("{exit:3} {reason}"))
}

#[test]
fn what_goes_on_after_a_kill_is_safe() {
    let seeds = from_environment("GUSSET_FAULT_SEEDS", 20 * SEEDS).div_ceil(20);
    let first = from_environment("GUSSET_FAULT_SEED", 0);
    let tests = tests();
    let home = tempfile::tempdir().unwrap();
    let wrong = Mutex::new(Vec::new());
    let ends = Mutex::new(BTreeMap::<String, u64>::new());
    let enough = || wrong.lock().unwrap().len() >= 5;
    on_all_processors(seeds, enough, |number| {
        let seed = first + number;
        match one(&tests, seed, home.path()) {
            Ok(end) => {
                let sort = end.chars().filter(|c| !c.is_numeric()).take(48).collect();
                *ends.lock().unwrap().entry(sort).or_default() += 1;
            }
            Err(text) => wrong.lock().unwrap().push((seed, text)),
        }
    });
    for (end, count) in ends.into_inner().unwrap() {
        println!("{count:7} × {end}");
    }
    let mut wrong = wrong.into_inner().unwrap();
    wrong.sort();
    for (seed, text) in &wrong {
        println!(
            "SEED {seed}: {text}\nagain: GUSSET_FAULT_SEED={seed} GUSSET_FAULT_SEEDS=1 cargo test --test faults interrupted -- --nocapture\n"
        );
    }
    assert!(
        wrong.is_empty(),
        "{} tests went wrong, the first with seed {}",
        wrong.len(),
        wrong[0].0
    );
}
