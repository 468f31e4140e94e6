//! Specimens are connected before the loop starts: all at the same time, each within its own time limits, and nothing
//! moves.
//!
//! Invariant: no specimen stays connected without notice. If one specimen cannot take part, the others learn that
//! nothing will come, as soon as the last of them has answered.

use std::sync::mpsc;
use std::time::Duration;

use crossbeam_channel::{Receiver, Sender};

use super::origin::ACCEPT;
use gusset_config::ClockChoice;
use gusset_control::engine::{Control, Experiment, Operator};
use gusset_control::port::Port;
use gusset_quantity::catalog::event::Remark;
use gusset_quantity::frame::AtAxis;
use gusset_quantity::substructure::{Introduction, LinkFault, Retirement, Unavailable};
use gusset_record::{Event, FolderError, Run, Writer};

/// How often the operator's line is looked at meanwhile.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// The position that a specimen reports, one number per axis in its own unit, as text: JSON's numbers need not come back to the
/// last bit.
fn in_words(numbers: &[f64]) -> String {
    let words: Vec<String> = numbers.iter().map(|number| format!("{number:?}")).collect();
    words.join(" ")
}

/// Makes specimens report the positions that they had when a recorded test connected them.
pub(super) fn put_standing(run: &Run, ports: &mut [Port]) -> Result<(), FolderError> {
    // Positions reported to an interrupted test were valid then only.
    for port in &mut *ports {
        port.startup_mut().report_position(AtAxis(&[]));
    }
    for event in run.event_lines()? {
        let Some(event) = event? else {
            continue;
        };
        let Event::Connected {
            port,
            standing: Some(said),
            ..
        } = event.event
        else {
            continue;
        };
        let standing: Result<Vec<f64>, _> = said.split(' ').map(str::parse).collect();
        if let (Ok(standing), Some(port)) = (standing, ports.get_mut(port as usize)) {
            port.startup_mut().report_position(AtAxis(&standing));
        }
    }
    Ok(())
}

/// Why there is no loop.
#[derive(Debug)]
pub(super) enum Unconnected {
    /// The specimens that cannot take part, in words.
    Refused(String),
    /// Which specimen does not do for this test, in words: it measures no displacement, or has lost its state since the interruption.
    Unfit(String),
    /// The operator asked for an end.
    Stopped,
}

/// Specimens that are connected.
pub(super) struct Connections {
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Specimens (from 0) that do not declare themselves computed.
    pub moving: Vec<usize>,
}

/// Lets connected specimens go: nothing will come.
pub(super) fn let_go(experiment: &mut Experiment, why: String) -> Unconnected {
    for port in &mut experiment.ports {
        port.exchange_mut().retire(Retirement::Orderly);
    }
    Unconnected::Unfit(why)
}

/// Connects every specimen and records its introduction: N of them take as long as the slowest. Nothing moves yet.
/// Returns warnings for the user, or why the test cannot begin. An operator's stop takes effect.
pub(super) fn connect(
    experiment: &mut Experiment,
    clock: ClockChoice,
    writer: &Writer,
    mut line: Line,
) -> Result<Connections, Unconnected> {
    let ports = std::mem::take(&mut experiment.ports);
    let names: Vec<String> = ports.iter().map(|port| port.name().to_owned()).collect();
    let all = connect_all(ports, &mut line);
    if line.asks_for_the_end() {
        let connected = all.into_iter().flatten();
        for (mut port, _) in connected {
            port.exchange_mut().retire(Retirement::Operator);
        }
        return Err(Unconnected::Stopped);
    }
    line.put_back();
    let (mut warnings, mut moving) = (Vec::new(), Vec::new());
    let (mut refusals, mut unfit, mut without_disp) = (Vec::new(), Vec::new(), Vec::new());
    let resumed = experiment.resume.as_ref();
    let must_keep_state = resumed.is_some_and(|resumed| !resumed.accepts_changed);
    for (number, (name, said)) in (0u32..).zip(names.iter().zip(all)) {
        let Some((port, outcome)) = said else {
            let text =
                "internal error: its connection panicked, or the system gives no thread for it";
            refusals.push(format!("specimen \"{name}\": {text}"));
            continue;
        };
        let outcome = outcome.and_then(|found| fit_for(clock, &port, found));
        match outcome {
            Ok(introduction) => {
                for warning in &introduction.warnings {
                    writer.note(Event::said(Remark::Warning, warning.as_str()));
                }
                if port.exchange().is_remote()
                    && !port.startup().is_computed()
                    && !introduction.simulated
                {
                    moving.push(number as usize);
                }
                unfit.extend(port.lacks_measured_disp(&introduction));
                if introduction.repeats_the_command {
                    without_disp.push(name.as_str());
                }
                if must_keep_state && introduction.simulated && !introduction.keeps_state {
                    unfit.push(format!(
                        "specimen \"{name}\", {}: it is computed, but does not report that an earlier test left its state: it was \
                         restarted since the interruption, or is made anew for each test. Start its server with `[serve] \
                         remembers = true`, or its bus with `gusset bus simulate`, before the first test, and leave it running until \
                         the test is complete; {ACCEPT}",
                        introduction.peer
                    ));
                }
                warnings.extend(introduction.warnings);
                if port.exchange().is_remote() {
                    writer.note(Event::Connected {
                        port: number,
                        peer: introduction.peer.clone(),
                        measures_disp: introduction.repeats_the_command.then_some(false),
                        standing: port
                            .startup()
                            .standing()
                            .map(|standing| in_words(&standing)),
                    });
                }
            }
            Err(error) => {
                refusals.push(format!("specimen \"{}\": {error}", port.name()));
                writer.note(Event::Link {
                    port: number,
                    fault: None,
                    message: error.text.into(),
                });
            }
        }
        experiment.ports.push(port);
    }
    match unjudged(&experiment.ports, &without_disp) {
        Some((text, true)) => unfit.push(text),
        Some((text, false)) => {
            writer.note(Event::said(Remark::Warning, text.as_str()));
            warnings.push(text);
        }
        None => {}
    }
    let why = match (refusals.as_slice(), unfit.as_slice()) {
        ([], []) => return Ok(Connections { warnings, moving }),
        ([], _) => Unconnected::Unfit(unfit.join("; ")),
        _ => Unconnected::Refused(refusals.join("; ")),
    };
    for port in &mut experiment.ports {
        port.exchange_mut().retire(Retirement::Orderly);
    }
    Err(why)
}

/// Checks of the test that apply to no specimen of `without`, which measure no displacement, in words. True if none remains.
fn unjudged(ports: &[Port], without: &[&str]) -> Option<(String, bool)> {
    let keys = &ports.first()?.startup().needs_measured_disp().of_the_test;
    if without.is_empty() || keys.is_empty() {
        return None;
    }
    let names: Vec<String> = without.iter().map(|name| format!("\"{name}\"")).collect();
    let (keys, names) = (keys.join(", "), names.join(", "));
    let text = format!(
        "{keys} cannot judge a specimen whose end does not say that it measures displacement: {names}"
    );
    Some(if without.len() == ports.len() {
        (
            format!(
                "{text}; no other specimen is there: let the end of the link measure displacement and announce it, or do without"
            ),
            true,
        )
    } else {
        (text, false)
    })
}

/// On the simulated clock commands follow each other as fast as they are answered: only computations may receive them.
fn fit_for(
    clock: ClockChoice,
    port: &Port,
    found: Introduction,
) -> Result<Introduction, Unavailable> {
    let computed = !port.exchange().is_remote() || port.startup().is_computed() || found.simulated;
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

/// The operator's line while the loop does not listen to it yet.
pub(super) struct Line {
    requests: Receiver<Operator>,
    /// Its other end; without it no command is taken, because it could not be returned.
    request_socket: Option<Sender<Operator>>,
    /// Commands that must wait for the loop.
    heard: Vec<Operator>,
}

impl Line {
    pub(crate) fn of(control: &Control) -> Self {
        Self {
            requests: control.requests.clone(),
            request_socket: control.request_socket.clone(),
            heard: Vec::new(),
        }
    }

    /// True once an end of the test was asked for.
    fn asks_for_the_end(&mut self) -> bool {
        if self.request_socket.is_some() {
            self.heard.extend(self.requests.try_iter());
        }
        self.heard.iter().any(|word| word.is_end())
    }

    /// Returns all commands to the loop.
    fn put_back(&mut self) {
        if let Some(request_socket) = &self.request_socket {
            for word in self.heard.drain(..) {
                // A command beyond the available room is dropped: a stop always has room.
                let _ = word.say_into(request_socket);
            }
        }
    }
}

/// A port with its introduction.
type Said = (Port, Result<Introduction, Unavailable>);

/// Connects each linked specimen on a separate thread, because connecting waits. When the operator asks for an end, a thread that
/// still waits is abandoned: it has sent nothing that moves a specimen, and its connection closes with it. Such a thread, and
/// one that panicked, gives no result.
fn connect_all(ports: Vec<Port>, line: &mut Line) -> Vec<Option<Said>> {
    let mut all: Vec<Option<Said>> = ports.iter().map(|_| None).collect();
    let (done, said) = mpsc::channel::<(usize, Said)>();
    let mut owed = 0;
    for (index, mut port) in ports.into_iter().enumerate() {
        if !port.exchange().is_remote() {
            let outcome = port.connect();
            all[index] = Some((port, outcome));
            continue;
        }
        let done = done.clone();
        let work = move || {
            let outcome = port.connect();
            let _ = done.send((index, (port, outcome)));
        };
        // If the system gives no thread, the result is as after a panic: the specimen was not connected.
        let thread = std::thread::Builder::new().name("gusset-connect".into());
        owed += usize::from(thread.spawn(work).is_ok());
    }
    drop(done);
    while owed > 0 && !line.asks_for_the_end() {
        match said.recv_timeout(LOOK_EVERY) {
            Ok((index, said)) => {
                all[index] = Some(said);
                owed -= 1;
            }
            Err(mpsc::RecvTimeoutError::Timeout) => {}
            Err(mpsc::RecvTimeoutError::Disconnected) => break,
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn early_commands_are_not_lost() {
        let (request_socket, requests) = crossbeam_channel::bounded(4);
        let control = Control {
            request_socket: Some(request_socket.clone()),
            ..Control::from(requests.clone())
        };
        let mut line = Line::of(&control);
        request_socket.try_send(Operator::Hold).unwrap();
        request_socket.try_send(Operator::Continue).unwrap();
        assert!(!line.asks_for_the_end());
        assert!(requests.is_empty());
        line.put_back();
        let heard: Vec<Operator> = requests.try_iter().collect();
        assert_eq!(heard, [Operator::Hold, Operator::Continue]);
        request_socket.try_send(Operator::Stop).unwrap();
        assert!(line.asks_for_the_end());
    }
}
