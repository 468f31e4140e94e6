//! Invariants of every test, whatever goes wrong. Each check reports its finding.

use gusset_config::{CommandPace, Loaded};
use gusset_control::engine::{Ending, Phase, Stop};
use gusset_control::port::limits::AxisLimits;
use gusset_link::server::Tapped;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::time::Nanos;
use gusset_record::{End, Event, Journal};
use gusset_wire::native::Kind;

use crate::lab::Played;

/// Roundoff of units: a limit in m is kept on commands in mm.
const SLACK: f64 = 1.0 + 1e-9;

macro_rules! ensure {
    ($condition:expr, $($words:tt)*) => {
        // Not `!$condition`: a comparison with NaN must fail, too.
        let holds: bool = $condition;
        if !holds {
            return Err(format!($($words)*));
        }
    };
}

/// All of them.
pub fn check(loaded: &Loaded, played: &Played) -> Result<(), String> {
    ends_as_planned(played)?;
    no_step_is_lost(played)?;
    log_is_readable(played)?;
    for (port, tap) in played.taps.iter().enumerate() {
        let wrong = |text| format!("specimen {}: {text}", port + 1);
        commands_are_kept_in_order(tap, played.first_step > 0).map_err(wrong)?;
        commands_respect_their_limits(loaded, port, played).map_err(wrong)?;
        moves_only_when_meant(loaded, port, played).map_err(wrong)?;
        is_driven_where_it_was_told(port, played).map_err(wrong)?;
        every_command_stands_in_a_row(port, played).map_err(wrong)?;
    }
    let replay = &played.replay;
    ensure!(
        replay.is_exact(),
        "the replay differs: {:?} {:?}",
        replay.difference,
        replay.short
    );
    Ok(())
}

fn ends_as_planned(played: &Played) -> Result<(), String> {
    let path = played.path();
    let phases: Vec<Phase> = path
        .iter()
        .filter_map(|word| Phase::ALL.into_iter().find(|phase| phase.word() == *word))
        .collect();
    ensure!(phases.len() == path.len(), "unknown phases in {path:?}");
    for pair in phases.windows(2) {
        ensure!(
            pair[0].may_become(pair[1]),
            "{path:?} is not an allowed path of phases"
        );
    }
    ensure!(path.last() == Some(&"safe"), "{path:?} does not end safe");
    let tripped = path.contains(&"tripped");
    let (reason, exit) = played.verdict();
    let orderly = matches!(
        played.outcome.ending,
        Ending::Completed | Ending::Stopped(Stop::Operator)
    );
    ensure!(tripped != orderly, "{path:?}, but {reason}");
    if let Ending::Stopped(stop) = played.outcome.ending
        && tripped
    {
        let told = played.events.iter().find_map(|event| match &event.kind {
            Event::Phase {
                to: Phase::Tripped,
                cause,
                port,
                ..
            } => Some((cause.as_ref(), *port)),
            _ => None,
        });
        let found = (stop.word(), stop.port().map(|port| port as u32));
        ensure!(
            told == Some(found),
            "{reason}, but the trip's cause is {told:?}"
        );
    }
    ensure!(!reason.is_empty() && exit != 5, "{reason:?}, exit {exit}");
    let started = path.contains(&"running");
    ensure!(
        started || played.outcome.ending != Ending::Completed,
        "completed without running"
    );
    Ok(())
}

/// Steps follow each other without a gap.
fn no_step_is_lost(played: &Played) -> Result<(), String> {
    let outcome = &played.outcome;
    ensure!(
        outcome.rows_lost == 0 && outcome.events_lost == 0,
        "{} rows and {} events lost",
        outcome.rows_lost,
        outcome.events_lost
    );
    let at = |name: &str| played.layout.index_of(name);
    let (Some(state), Some(step)) = (at("state"), at("step")) else {
        return Err("no columns `state` and `step`".to_owned());
    };
    let columns = played.columns().len();
    let mut journal = Journal::new(&played.samples[..], columns);
    let (first, mut rows) = (played.first_step as f64, 0);
    let mut next = first;
    while let Some(row) = journal.next_row().map_err(|error| error.to_string())? {
        ensure!(
            row.sequence == rows,
            "row {rows} has the number {}",
            row.sequence
        );
        rows += 1;
        if row.values[state] == Phase::Running.code() {
            let found = row.values[step];
            ensure!(found == next, "step {found} where {next} was due");
            next += 1.0;
        }
    }
    ensure!(journal.end() == Some(End::Clean), "{:?}", journal.end());
    ensure!(
        next == first && outcome.steps == 0 || next == outcome.steps as f64 + 1.0,
        "{next} rows of running steps, the last step done is {}",
        outcome.steps
    );
    Ok(())
}

fn log_is_readable(played: &Played) -> Result<(), String> {
    let mut count = 0;
    for line in played.events_jsonl.split(|byte| *byte == b'\n') {
        if line.is_empty() {
            continue;
        }
        count += 1;
        let event: serde_json::Value =
            serde_json::from_slice(line).map_err(|error| error.to_string())?;
        ensure!(
            event["event"].is_string(),
            "an event without a name: {event}"
        );
    }
    let made = played.events.len();
    ensure!(count == made, "{made} events, {count} lines");
    Ok(())
}

/// Every command appears once, or twice at most: none is left out, none comes back. A resumed test continues the count.
fn commands_are_kept_in_order(tap: &[Tapped], goes_on: bool) -> Result<(), String> {
    let (mut last, mut armed) = (None::<u64>, false);
    for tapped in tap {
        let Tapped::Sent { kind, sequence, .. } = tapped else {
            continue;
        };
        match kind {
            // The greeting, and then the request to arm.
            Kind::Control => armed = true,
            Kind::Command => {
                ensure!(armed, "command {sequence} before anything was agreed");
                let first = if goes_on { *sequence } else { 0 };
                let due = last.map_or(first, |last| last + 1);
                ensure!(
                    *sequence == due || Some(*sequence) == last,
                    "command {sequence} where {due} was due"
                );
                last = Some(*sequence);
            }
            _ => {}
        }
    }
    Ok(())
}

/// Each command's time, number and target.
fn commands(tap: &[Tapped]) -> impl Iterator<Item = (Nanos, u64, &Vec<f64>)> {
    tap.iter().filter_map(|tapped| match tapped {
        Tapped::Sent {
            at,
            kind: Kind::Command,
            sequence,
            disp,
        } => Some((*at, *sequence, disp)),
        _ => None,
    })
}

/// Limits of each axis of a specimen, and metres in one unit of its commands.
fn limits(loaded: &Loaded, port: usize, axes: usize) -> Vec<(AxisLimits, f64)> {
    let table = &loaded.file.specimen[port];
    let specs = table.limits_of(axes);
    let metres = |axis: usize| {
        table
            .axis
            .get(axis)
            .map_or(1.0, |gear| gear.unit_disp.row().si)
    };
    let each = specs.iter().map(AxisLimits::of).enumerate();
    each.map(|(axis, limits)| (limits, metres(axis))).collect()
}

fn commands_respect_their_limits(
    loaded: &Loaded,
    port: usize,
    played: &Played,
) -> Result<(), String> {
    let tick = loaded.time.period.value();
    let runs = played.entries().find(|(_, to)| *to == "running");
    let runs = runs.map_or(u64::MAX, |(at, _)| at);
    let leaves = played.entries().find(|(_, to)| *to == "leaving");
    let leaves = leaves.map_or(u64::MAX, |(at, _)| at);
    // In one command a per-step specimen moves only as far as others in as many ticks.
    let link = loaded.file.specimen[port].link.as_ref();
    let told_by_steps = link.is_some_and(|link| link.commands == CommandPace::EveryStep);
    let whole_step = tick * f64::from(loaded.time.ticks_per_step);
    let stood = played.stood(port);
    let mut last: Option<&Vec<f64>> = None;
    let mut of_axes = None;
    for (at, sequence, disp) in commands(&played.taps[port]) {
        let limits = of_axes.get_or_insert_with(|| limits(loaded, port, disp.len()));
        for (axis, ((limits, metres), to)) in limits.iter().zip(disp).enumerate() {
            let to = to * metres;
            let [low, high] = limits.get(Limit::CommandDisp).trip;
            ensure!(
                to >= low * SLACK && to <= high * SLACK,
                "command {sequence}, axis {axis}: {to} m is outside of {low} to {high} m"
            );
            // The first is a step from the rig's position.
            let from = last.and_then(|last| last.get(axis)).unwrap_or(&stood);
            let step = (to - from * metres).abs();
            let running = at.0 >= runs && at.0 <= leaves;
            let passes = if told_by_steps && running {
                whole_step
            } else {
                tick
            };
            let mut allowed = limits
                .size(Limit::CommandStep)
                .trip
                .min(limits.size(Limit::CommandVel).trip * passes);
            if at.0 < runs && allowed == f64::INFINITY {
                allowed = UNBOUNDED_M_PER_S * tick;
            }
            ensure!(
                step <= allowed * SLACK + ROUNDOFF_M,
                "command {sequence}, axis {axis}: a step of {step} m, allowed {allowed} m"
            );
        }
        last = Some(disp);
    }
    Ok(())
}

/// Speed before the test of a specimen without a limit of speed: half a cosine of 0.1 m in the second that it gets at least, the
/// largest wiring check, and the motion under a static load.
const UNBOUNDED_M_PER_S: f64 = 0.25;
/// In m, of differences of displacements in mm.
const ROUNDOFF_M: f64 = 1e-15;

/// The actuator of a specimen is driven to its first position or to a command that was sent, in the order of the commands. So no
/// step from one to the next is larger than the sum of the commands between them allows.
fn is_driven_where_it_was_told(port: usize, played: &Played) -> Result<(), String> {
    let Some(seen) = played.seen.get(port) else {
        return Ok(());
    };
    let sent = commands(&played.taps[port]).filter_map(|(_, _, disp)| disp.first().copied());
    let mut places = std::iter::once(seen.stood).chain(sent).peekable();
    for driven in seen.driven.lock().unwrap().iter() {
        while places.peek().is_some_and(|place| place != driven) {
            places.next();
        }
        ensure!(
            places.peek().is_some(),
            "driven to {driven}, which was not commanded, or not any more"
        );
    }
    Ok(())
}

/// Whatever ended the test: every place that was sent is on record, in this order, and the last row has the last of them.
fn every_command_stands_in_a_row(port: usize, played: &Played) -> Result<(), String> {
    let Some(place) = played.layout.index_of(&format!("cmd_{}_1", port + 1)) else {
        return Err("no column of its command".to_owned());
    };
    let recorded = Journal::new(&played.samples[..], played.columns().len()).columns(&[place]);
    let recorded = recorded.map_err(|error| error.to_string())?.swap_remove(0);
    let mut rows = recorded.iter().peekable();
    let mut last = None;
    for (_, sequence, disp) in commands(&played.taps[port]) {
        let Some(sent) = disp.first() else {
            continue;
        };
        while rows.peek().is_some_and(|row| *row != sent) {
            rows.next();
        }
        ensure!(
            rows.peek().is_some(),
            "command {sequence} to {sent} is in no row"
        );
        last = Some(sent);
    }
    ensure!(
        last.is_none() || last == recorded.last(),
        "the record ends at {:?}, the last command was {last:?}",
        recorded.last()
    );
    Ok(())
}

/// Nothing moves before the test is armed, after a trip that freezes, or after the end; in the shutdown, only slowly.
fn moves_only_when_meant(loaded: &Loaded, port: usize, played: &Played) -> Result<(), String> {
    let entered = |word: &str| {
        played
            .entries()
            .find(|(_, to)| *to == word)
            .map(|(at, _)| at)
    };
    let moving = ["probing", "ramping", "settling", "running", "leaving"];
    let first_motion = moving.iter().filter_map(|word| entered(word)).min();
    let first_motion = first_motion.unwrap_or(u64::MAX);
    let still_from = match entered("leaving") {
        Some(_) => u64::MAX,
        None => entered("tripped").unwrap_or(u64::MAX),
    };
    let leaving = entered("leaving").unwrap_or(u64::MAX);
    let safe = entered("safe").unwrap_or(0);
    let speed = loaded
        .file
        .safety
        .exit_speed_m_per_s
        .unwrap_or(f64::INFINITY);
    let allowed = speed * loaded.time.period.value() * SLACK;
    let stood = vec![played.stood(port)];
    // The first command must be at the rig's position, too.
    let mut last: Option<(&Vec<f64>, Option<u64>)> = played.seen.get(port).map(|_| (&stood, None));
    let mut of_axes = None;
    for tapped in &played.taps[port] {
        let Tapped::Sent {
            at,
            kind,
            sequence,
            disp,
        } = tapped
        else {
            continue;
        };
        ensure!(at.0 <= safe, "a {kind:?} at {} ns, safe at {safe} ns", at.0);
        if *kind != Kind::Command {
            continue;
        }
        let limits = of_axes.get_or_insert_with(|| limits(loaded, port, disp.len()));
        if let Some((from, number)) = last
            && number.is_none_or(|number| *sequence > number)
        {
            let steps = from.iter().zip(disp).zip(limits.iter());
            let far = steps.map(|((from, to), (_, metres))| (to - from).abs() * metres);
            let far = far.fold(0.0, f64::max);
            ensure!(
                far <= ROUNDOFF_M || (at.0 >= first_motion && at.0 <= still_from),
                "command {sequence} moves {far} m while nothing is to move"
            );
            ensure!(
                at.0 <= leaving || far <= allowed,
                "command {sequence} leaves by {far} m, allowed {allowed} m"
            );
        } else if let Some((from, _)) = last {
            ensure!(
                from == disp,
                "command {sequence} was sent again with another place"
            );
        }
        last = Some((disp, Some(*sequence)));
    }
    Ok(())
}
