//! Specimens are connected before the loop starts: all at the same time, each within its own time limits, and nothing
//! moves.
//!
//! Invariant: nobody is left connected and untold. If one specimen cannot take part, the others are told that nothing
//! will come, as soon as the last of them has said what it has to say.

use serde_json::Value;

use crate::config::ClockChoice;
use crate::control::Port;
use crate::engine::Experiment;
use crate::record::{Note, NoteLevel, Roll, What, Writer};
use crate::substructure::{Introduction, LinkFault, Retirement, Unavailable};

/// Where a specimen said that it stands, in the note on its connection: numbers in its own unit, one per axis, in words,
/// since JSON's numbers need not come back to the last bit.
const STANDING: &str = "standing";

fn in_words(numbers: &[f64]) -> String {
    let words: Vec<String> = numbers.iter().map(|number| format!("{number:?}")).collect();
    words.join(" ")
}

/// Specimens say again where they stood when a recorded test was connected to them.
pub(super) fn put_standing(events: &[Value], ports: &mut [Port]) {
    // What they said to an interrupted test was true then.
    for port in &mut *ports {
        port.says_it_stands_at(&[]);
    }
    for event in events {
        let said = event.get(STANDING).and_then(Value::as_str);
        let number = event.get("specimen").and_then(Value::as_u64);
        let (Some(said), Some(number)) = (said, number) else {
            continue;
        };
        let standing: Result<Vec<f64>, _> = said.split(' ').map(str::parse).collect();
        let index = usize::try_from(number).ok().and_then(|n| n.checked_sub(1));
        if let (Ok(standing), Some(port)) = (standing, index.and_then(|i| ports.get_mut(i))) {
            port.says_it_stands_at(&standing);
        }
    }
}

/// Connects every specimen and notes what each says of itself: N of them take as long as the slowest. Nothing moves
/// yet. Returns what the user should know, or who cannot take part.
pub(super) fn connect(
    experiment: &mut Experiment,
    clock: ClockChoice,
    writer: &Writer,
    roll: &Roll,
) -> Result<Vec<String>, String> {
    let ports = &mut experiment.ports;
    let outcomes = connect_all(ports, roll);
    let mut warnings = Vec::new();
    let mut refusals = Vec::new();
    for (number, (port, outcome)) in (1u64..).zip(ports.iter().zip(outcomes)) {
        let about = |level, event| {
            Note::new(level, event)
                .with("specimen", number)
                .with("name", port.name.as_str())
        };
        let outcome = outcome.and_then(|found| fit_for(clock, port, found));
        match outcome {
            Ok(introduction) => {
                for warning in &introduction.warnings {
                    let note = Note::new(NoteLevel::Warning, "warning");
                    writer.note(note.with("text", warning.as_str()));
                }
                warnings.extend(introduction.warnings);
                if port.is_remote() {
                    let note = about(NoteLevel::Info, "connected");
                    let note = note.with("peer", introduction.peer.as_str());
                    writer.note(match port.standing() {
                        Some(standing) => note.with(STANDING, in_words(standing).as_str()),
                        None => note,
                    });
                }
            }
            Err(error) => {
                refusals.push(format!("specimen \"{}\": {error}", port.name));
                let note = about(NoteLevel::Error, "link");
                writer.note(note.with("message", error.text.as_str()));
            }
        }
    }
    if refusals.is_empty() {
        return Ok(warnings);
    }
    for port in ports {
        port.retire(Retirement::Orderly);
    }
    Err(refusals.join("; "))
}

/// On the simulated clock commands follow each other as fast as they are answered: that is for computations.
fn fit_for(
    clock: ClockChoice,
    port: &Port,
    found: Introduction,
) -> Result<Introduction, Unavailable> {
    let computed = !port.is_remote() || port.computed || found.simulated;
    if clock == ClockChoice::Real || computed {
        return Ok(found);
    }
    Err(Unavailable {
        fault: LinkFault::Refused,
        text: format!(
            "{}: on the simulated clock it would be commanded as fast as it answers, and it does not say that it is a \
             computation and no machine: run it with `clock = \"real\"`, or, if you know that nothing there can break, say \
             `computed = true` in [specimen.link]",
            found.peer
        ),
    })
}

/// Each on a thread of its own, for they wait; those of this process have nothing to wait for. The threads that their links
/// start stand on the roll, too.
fn connect_all(ports: &mut [Port], roll: &Roll) -> Vec<Result<Introduction, Unavailable>> {
    std::thread::scope(|scope| {
        let waiting: Vec<_> = ports
            .iter_mut()
            .map(|port| {
                if !port.is_remote() {
                    return Waiting::Done(port.connect());
                }
                let thread = std::thread::Builder::new().name("gusset-connect".into());
                let work = || {
                    let stamper = roll.enter();
                    let began_ns = stamper.now();
                    let outcome = roll.within(|| port.connect());
                    stamper.since(What::Connect, began_ns, 0);
                    outcome
                };
                match thread.spawn_scoped(scope, work) {
                    Ok(thread) => Waiting::Thread(thread),
                    Err(error) => Waiting::Done(Err(Unavailable {
                        fault: LinkFault::Closed,
                        text: format!("the system gives no thread to connect it on: {error}"),
                    })),
                }
            })
            .collect();
        waiting.into_iter().map(Waiting::outcome).collect()
    })
}

enum Waiting<'scope> {
    Thread(std::thread::ScopedJoinHandle<'scope, Result<Introduction, Unavailable>>),
    Done(Result<Introduction, Unavailable>),
}

impl Waiting<'_> {
    fn outcome(self) -> Result<Introduction, Unavailable> {
        match self {
            Self::Done(outcome) => outcome,
            Self::Thread(thread) => thread.join().unwrap_or_else(|_| {
                Err(Unavailable {
                    fault: LinkFault::Closed,
                    text: "internal error: its connection panicked".to_owned(),
                })
            }),
        }
    }
}
