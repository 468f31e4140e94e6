//! Frames that a specimen's end sends instead of an answer, and after the goodbye, over a wire that a test controls.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::*;
use crate::SocketOptions;
use gusset_quantity::substructure::{Command, Freshness, Holder, Measurement, Status};
use gusset_wire::Side;
use gusset_wire::handshake::{
    self, Bye, Capabilities, Control, Hello, Limits, Refuse, RefuseCode, Sampling, Unit, Versions,
    Welcome,
};
use gusset_wire::native::{
    Cause, Decoder, Encoder, Frame, Heartbeat, LARGEST_FRAME, Moment, Notice,
};

const SESSION: u64 = 7;
const TEXT: &str = "pump lost pressure";

/// A scripted reaction of the specimen's end at a point of the session.
#[derive(Debug, Clone)]
enum Word {
    /// The expected message.
    Fits,
    Says(Box<Control>),
    Goodbye(Cause),
    /// A heartbeat with this status, and then a goodbye.
    Beats(Status, Cause),
    Byes(Bye, Cause),
}

/// A change to the usual welcome.
type Change = fn(&mut Welcome);

/// A scripted specimen's end, on a clock that advances with each wait.
struct Scripted {
    words: [Word; 3],
    welcome: Change,
    encoder: Encoder,
    decoder: Decoder,
    waiting: VecDeque<Vec<u8>>,
    /// How long in ns its answer to a command takes, and the force that it gives.
    answers: (u64, f64),
    /// The answer that comes next, and when.
    due: Option<(Nanos, Vec<u8>)>,
    now: Nanos,
    heard: Arc<Mutex<Vec<&'static str>>>,
}

impl Scripted {
    fn frame(&mut self, write: impl FnOnce(&mut Encoder, &mut [u8]) -> usize) {
        let mut out = vec![0; LARGEST_FRAME];
        let length = write(&mut self.encoder, &mut out);
        self.waiting.push_back(out[..length].to_vec());
    }

    fn control(&mut self, control: &Control) {
        let message = handshake::encode(control).unwrap();
        self.frame(|encoder, out| encoder.control(&message, out).unwrap());
    }

    fn goodbye(&mut self, cause: Cause) {
        let notice = Notice { sequence: 0, cause };
        self.frame(|encoder, out| encoder.goodbye(notice, out).unwrap());
    }

    fn say(&mut self, word: Word, fits: impl FnOnce(&mut Self)) {
        match word {
            Word::Fits => fits(self),
            Word::Says(control) => self.control(&control),
            Word::Goodbye(cause) => self.goodbye(cause),
            Word::Beats(status, cause) => {
                let beat = Heartbeat {
                    sequence: 0,
                    time: 0.0,
                    status,
                };
                self.frame(|encoder, out| encoder.heartbeat(beat, out).unwrap());
                self.goodbye(cause);
            }
            Word::Byes(bye, cause) => {
                self.control(&Control::Bye(bye));
                self.goodbye(cause);
            }
        }
    }

    fn answer(&mut self, sequence: u64) {
        let (takes_ns, force) = self.answers;
        let measured = Measurement {
            sequence,
            ..Measurement::zeros(1)
        };
        let moment = Moment {
            sampled_after: 0.0,
            missed: 0,
        };
        let mut out = vec![0; LARGEST_FRAME];
        let length = self.encoder.measurement(&measured, moment, &mut out);
        let (frame, _) = out.split_at_mut(length.unwrap());
        // Byte 72: the force, which an encoder writes only if it is a number.
        frame[72..80].copy_from_slice(&force.to_le_bytes());
        let (covered, crc) = frame.split_at_mut(frame.len() - 4);
        crc.copy_from_slice(&crc32fast::hash(covered).to_le_bytes());
        let at = self.now.plus(takes_ns);
        self.due.get_or_insert((at, frame.to_vec()));
    }

    fn hears(&mut self, control: Control) {
        let [hello, arm, _] = self.words.clone();
        self.heard.lock().unwrap().push(control.name());
        match control {
            Control::Hello(heard) => {
                let mut welcome = welcome(&heard);
                (self.welcome)(&mut welcome);
                self.say(hello, |one| one.control(&Control::Welcome(welcome)));
                self.encoder = Encoder::new(Side::Specimen, 1, SESSION, None).unwrap();
                self.decoder = Decoder::new(Side::Controller, 1, SESSION, None).unwrap();
            }
            heard @ Control::Arm(_) => self.say(arm, |one| one.control(&heard)),
            _ => {}
        }
    }
}

impl Transport for Scripted {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        let control = match self.decoder.open(frame).unwrap().frame {
            Frame::Control(message) => Some(handshake::decode(message).unwrap()),
            Frame::Retire(_) => None,
            Frame::Command(command) => {
                self.answer(command.sequence);
                return Ok(());
            }
            Frame::Heartbeat(_) => return Ok(()),
            other => panic!("{other:?}"),
        };
        match control {
            Some(control) => self.hears(control),
            None => {
                let last = self.words[2].clone();
                self.say(last, |one| one.goodbye(Cause::Orderly));
            }
        }
        Ok(())
    }

    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        if let Some((at, frame)) = self.due.take_if(|(at, _)| *at <= deadline.max(self.now)) {
            self.now = self.now.max(at);
            self.waiting.push_back(frame);
        }
        let Some(frame) = self.waiting.pop_front() else {
            self.now = self.now.max(deadline);
            return Ok(None);
        };
        buffer[..frame.len()].copy_from_slice(&frame);
        Ok(Some(frame.len()))
    }

    fn now(&self) -> Nanos {
        self.now
    }

    fn is_simulated(&self) -> bool {
        true
    }
}

fn welcome(hello: &Hello) -> Welcome {
    Welcome {
        proof: [0; 32],
        nonce: [9; 32],
        layout: hello.layout,
        session: SESSION,
        version: 1,
        keyed: false,
        capabilities: Capabilities::MEASURES_DISP,
        watchdog_s: hello.watchdog_s,
        sampling: hello.sampling,
        stiffness: Vec::new(),
        standing: vec![0.0],
        software: "a test".into(),
        name: "rig".into(),
        axes: hello.axes.clone(),
    }
}

/// A link to an end that sends these frames for welcome, arming and goodbye, and the list of frames that it received.
fn link(
    carrier: Carrier,
    words: [Word; 3],
    change: Change,
) -> (NativeLink, Arc<Mutex<Vec<&'static str>>>) {
    link_that_answers(carrier, words, change, (0, 0.0))
}

fn link_that_answers(
    carrier: Carrier,
    words: [Word; 3],
    change: Change,
    answers: (u64, f64),
) -> (NativeLink, Arc<Mutex<Vec<&'static str>>>) {
    let heard = Arc::<Mutex<Vec<&'static str>>>::default();
    let wire = Scripted {
        words,
        welcome: change,
        encoder: Encoder::greeting(Side::Specimen),
        decoder: Decoder::greeting(Side::Controller),
        waiting: VecDeque::new(),
        answers,
        due: None,
        now: Nanos(0),
        heard: Arc::clone(&heard),
    };
    let setup = NativeSetup {
        address: "rig".into(),
        carrier,
        key: None,
        test: "test".into(),
        axes: vec![handshake::Axis {
            name: "axis 1".into(),
            disp_unit: Unit::Metre,
            force_unit: Unit::Newton,
            limits: Limits::NONE,
        }],
        rate: (100, 1),
        watchdog_s: 0.5,
        sampling: Sampling::Reply,
        coupling: Coupling::Lockstep,
        connect_limit: Duration::from_secs(5),
        reply_timeout: Duration::from_secs(1),
        options: SocketOptions::default(),
    };
    (NativeLink::over(setup, Box::new(wire)), heard)
}

fn bye(cause: Cause, text: &str) -> Bye {
    Bye {
        cause: cause.code(),
        text: text.into(),
    }
}

const CARRIERS: [Carrier; 2] = [Carrier::Tcp, Carrier::Udp];

#[test]
fn goodbye_instead_of_welcome_is_reported() {
    for carrier in CARRIERS {
        let word = Word::Says(Box::new(Control::Bye(bye(Cause::Tripped, TEXT))));
        let (mut link, heard) = link(carrier, [word, Word::Fits, Word::Fits], |_| {});
        let text = link.connect().unwrap_err().text;
        assert!(text.starts_with("rig: ") && text.ends_with(TEXT), "{text}");
        assert_eq!(*heard.lock().unwrap(), ["hello"], "final");
    }
}

#[test]
fn message_instead_of_arming_is_reported() {
    let refuse = |code, text: &str| {
        Word::Says(Box::new(Control::Refuse(Refuse {
            code,
            versions: Versions::OURS,
            text: text.into(),
        })))
    };
    let cases = [
        (
            Word::Says(Box::new(Control::Bye(bye(Cause::Tripped, TEXT)))),
            "it said goodbye where the arming was due: it tripped: pump lost pressure",
        ),
        (
            Word::Says(Box::new(Control::Bye(bye(Cause::Shutdown, "")))),
            "it said goodbye where the arming was due: its program ends",
        ),
        (
            Word::Goodbye(Cause::Interlock),
            "it said goodbye where the arming was due: its interlock opened",
        ),
        (
            refuse(RefuseCode::NotReady, TEXT),
            "refused: pump lost pressure",
        ),
        (
            refuse(RefuseCode::NotReady, ""),
            "refused: it is not ready: its interlock is open, or its pumps are off",
        ),
    ];
    for carrier in CARRIERS {
        for (word, told) in &cases {
            let words = [Word::Fits, word.clone(), Word::Fits];
            let (mut link, heard) = link(carrier, words, |_| {});
            link.connect().unwrap();
            link.arm(0, &[0.0], &mut || true).unwrap_err();
            assert_eq!(link.complaint().as_deref(), Some(*told));
            assert_eq!(*heard.lock().unwrap(), ["hello", "arm"], "final");
            link.retire(Retirement::Tripped);
            assert_eq!(link.has_acknowledged(), None);
        }
    }
}

#[test]
fn text_of_the_goodbye_is_kept() {
    let beats = |status, cause| Word::Beats(status, cause);
    let orderly = Retirement::Orderly;
    let cases = [
        (orderly, Word::Fits, None),
        (Retirement::Operator, Word::Goodbye(Cause::Operator), None),
        (Retirement::Tripped, Word::Goodbye(Cause::Tripped), None),
        (orderly, Word::Goodbye(Cause::Tripped), Some("it tripped")),
        (
            orderly,
            Word::Goodbye(Cause::Interlock),
            Some("its interlock opened"),
        ),
        (
            orderly,
            Word::Byes(bye(Cause::Tripped, TEXT), Cause::Tripped),
            Some("it tripped: pump lost pressure"),
        ),
        (
            orderly,
            Word::Byes(bye(Cause::Orderly, TEXT), Cause::Orderly),
            Some(TEXT),
        ),
        (
            orderly,
            beats(Status::INTERLOCK, Cause::Orderly),
            Some("its interlock opened"),
        ),
        (orderly, beats(Status::HOLDING, Cause::Orderly), None),
    ];
    for carrier in CARRIERS {
        for (how, word, told) in &cases {
            let words = [Word::Fits, Word::Fits, word.clone()];
            let (mut link, _) = link(carrier, words, |_| {});
            link.connect().unwrap();
            assert!(link.arm(0, &[0.0], &mut || true).unwrap());
            link.retire(*how);
            assert_eq!(link.has_acknowledged(), Some(true));
            assert_eq!(link.last_words().as_deref(), *told, "{word:?}");
        }
    }
}

/// Version 2 has a code for a lost specimen. Version 1 has only a sentence, so only the server may know.
#[test]
fn holder_follows_the_code_of_the_goodbye() {
    let refuse = |code| {
        Word::Says(Box::new(Control::Refuse(Refuse {
            code,
            versions: Versions::OURS,
            text: TEXT.into(),
        })))
    };
    let says = |cause| Word::Says(Box::new(Control::Bye(bye(cause, TEXT))));
    let byes = |cause| Word::Byes(bye(cause, TEXT), cause);
    // Message instead of the arming, answer to the retire, and whether the holder is unknown in versions 1 and 2.
    let cases = [
        (says(Cause::Tripped), Word::Fits, [true, false]),
        (says(Cause::Shutdown), Word::Fits, [false, false]),
        (says(Cause::Lost), Word::Fits, [true, true]),
        (Word::Goodbye(Cause::Lost), Word::Fits, [true, true]),
        (refuse(RefuseCode::NotReady), Word::Fits, [true, false]),
        (refuse(RefuseCode::Position), Word::Fits, [false, false]),
        (Word::Fits, byes(Cause::Tripped), [true, false]),
        (Word::Fits, byes(Cause::Lost), [true, true]),
        (Word::Fits, Word::Goodbye(Cause::Tripped), [false, false]),
        (Word::Fits, Word::Fits, [false, false]),
    ];
    let versions: [Change; 2] = [|welcome| welcome.version = 1, |welcome| welcome.version = 2];
    for carrier in CARRIERS {
        for (arm, last, unknown) in &cases {
            for (change, unknown) in versions.into_iter().zip(unknown) {
                let words = [Word::Fits, arm.clone(), last.clone()];
                let (mut link, _) = link(carrier, words, change);
                link.connect().unwrap();
                if link.arm(0, &[0.0], &mut || true).is_ok() {
                    link.retire(Retirement::Tripped);
                }
                let is_unknown = link.holder() == Holder::Unknown;
                assert_eq!(is_unknown, *unknown, "{arm:?} {last:?}");
            }
        }
    }
}

/// Results of three commands whose answers take this long and give this force.
fn three_answers(carrier: Carrier, answers: (u64, f64)) -> Vec<Result<Freshness, LinkFault>> {
    let words = [Word::Fits, Word::Fits, Word::Fits];
    let (mut link, _) = link_that_answers(carrier, words, |_| {}, answers);
    link.connect().unwrap();
    link.ask_to_arm(0, &[0.0]).unwrap();
    assert!(link.arm(0, &[0.0], &mut || true).unwrap());
    let mut measured = Measurement::zeros(1);
    let answer = |sequence| {
        link.issue(&Command {
            sequence,
            time: 0.0,
            dt: 0.0,
            disp: &[0.0],
            vel: &[0.0],
        })?;
        link.collect(Nanos(0), &mut measured)
    };
    (0..3).map(answer).collect()
}

/// A second each, and not for all of them.
#[test]
fn each_answer_has_its_time_limit() {
    let silent = Err(LinkFault::Timeout);
    for carrier in CARRIERS {
        let in_time = three_answers(carrier, (700_000_000, 1e3));
        assert_eq!(in_time, [Ok(Freshness::Fresh); 3], "{carrier:?}");
        assert_eq!(three_answers(carrier, (1_100_000_000, 1e3))[0], silent);
    }
}

/// A damaged datagram counts as lost. An intact one whose force is NaN is a fault.
#[test]
fn nan_force_is_a_fault_on_both_carriers() {
    for carrier in CARRIERS {
        for force in [f64::NAN, f64::INFINITY] {
            let found = three_answers(carrier, (0, force));
            assert_eq!(found, [Err(LinkFault::NotFinite); 3], "{carrier:?}");
        }
    }
}

#[test]
fn short_watchdog_is_warned_about() {
    // Commands come every 0.01 s.
    let changes: [(Change, &str, bool); 3] = [
        (|_| {}, "watchdog 0.5 s", false),
        (
            |welcome| welcome.watchdog_s = 0.02,
            "watchdog 0.02 s",
            false,
        ),
        (
            |welcome| welcome.watchdog_s = 0.001,
            "watchdog 0.001 s",
            true,
        ),
    ];
    for (change, told, warned) in changes {
        let words = [Word::Fits, Word::Fits, Word::Fits];
        let (mut link, _) = link(Carrier::Tcp, words, change);
        let introduction = link.connect().unwrap();
        assert!(introduction.peer.contains(told), "{}", introduction.peer);
        let early = introduction
            .warnings
            .iter()
            .any(|text| text.contains(" 0.001 s") && text.contains("`watchdog_s`"));
        assert_eq!(early, warned, "{:?}", introduction.warnings);
    }
}

#[test]
fn missing_measured_displacement_is_known() {
    let changes: [(Change, bool); 3] = [
        (|_| {}, false),
        (
            |welcome| welcome.capabilities = Capabilities::SIMULATED,
            false,
        ),
        (
            |welcome| welcome.capabilities = Capabilities::INTERLOCK,
            true,
        ),
    ];
    for (change, repeats) in changes {
        let words = [Word::Fits, Word::Fits, Word::Fits];
        let (mut link, _) = link(Carrier::Tcp, words, change);
        assert_eq!(link.connect().unwrap().repeats_the_command, repeats);
    }
}
