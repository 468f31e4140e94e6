//! The operator's control socket in the run folder, through which other programs control a running test.
//!
//! One line of JSON in, one out: `{"request": "hold"}` and `{"accepted": true, "phase": "running"}`. A `continue` names
//! the hold that it ends: `{"request": "continue", "hold": 1}`. Nothing here can delay the loop: it polls a bounded
//! channel of requests and writes its phase into an atomic. No client waits for another, and closing waits for no client.
//! The client distinguishes a finished test from one that does not answer: the second may still move. Only the user who
//! started the test may connect ([`gusset_record::rt::control_socket`]).

use std::io::{self, BufRead, BufReader, ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::Sender;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use gusset_control::engine::{Glimpse, Operator, PhaseCell};
use gusset_record::is_claimed;
use gusset_record::rt::control_socket::{ControlSocket, connect};
use gusset_record::rt::os::monotonic_ns;

/// The socket's name in the run folder.
pub(super) const SOCKET: &str = "control.sock";
/// How long the other end may take for its line.
const PATIENCE: Duration = Duration::from_secs(2);
/// Longest request, and longest answer.
const LONGEST: usize = 256;
const LONGEST_ANSWER: u64 = 16_384;
/// Callers that are listened to at once. If one more comes, the one that has been here longest without a request is closed: no
/// caller waits for a silent one.
const MOST_CALLERS: usize = 64;
/// Pause before a failed operation is repeated.
const BREATH: Duration = Duration::from_millis(10);

/// Requests to a running test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "request", deny_unknown_fields)]
pub enum Request {
    /// End cleanly.
    Stop,
    /// Stop test time.
    Hold,
    /// Continue after a hold. It confirms nothing. Refused if another hold is active by now, and if its sender has
    /// disconnected.
    Continue {
        /// The hold that it ends ([`Glimpse::hold_number`]).
        hold: u32,
    },
    /// Confirms the readings of the sensors. Accepted only while the test waits for that. It ends no hold. Refused if its
    /// sender has disconnected.
    Confirm,
    /// Where in its life it is.
    Phase,
}

impl Request {
    /// True if specimens may move because of it. The test carries out such a request only while its sender is connected.
    #[must_use]
    pub const fn lets_move(self) -> bool {
        matches!(self, Self::Continue { .. } | Self::Confirm)
    }
}

/// Answer of the test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Answer {
    /// False if the queue of requests is full, the phase does not allow the request, or its hold is not the latest. A stop
    /// is always accepted.
    pub accepted: bool,
    /// Where the test was when it was asked.
    #[serde(flatten)]
    pub seen: Glimpse,
}

/// Why there is no answer.
#[derive(Debug, Error)]
pub enum Unanswered {
    /// Nothing listens there: no test runs, or no longer.
    #[error("no test is running here: {0}")]
    Over(io::Error),
    /// Another user's test may listen there.
    #[error("only who started the test may speak to it: {0}")]
    Barred(io::Error),
    /// A test may listen there, but did not answer.
    #[error("the test does not answer ({})", in_words(.error))]
    Silent {
        /// The request is in the socket. The test carries it out later, unless it lets specimens move.
        left: bool,
        /// The system's word.
        error: io::Error,
    },
}

/// The system calls an elapsed time limit a resource that is unavailable.
fn in_words(error: &io::Error) -> String {
    match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::TimedOut => format!("{} s", PATIENCE.as_secs()),
        ErrorKind::UnexpectedEof => "it hung up".to_owned(),
        ErrorKind::NotFound => format!("there is no {SOCKET}"),
        _ => error.to_string(),
    }
}

impl Unanswered {
    fn silent(left: bool) -> impl Fn(io::Error) -> Self {
        move |error| Self::Silent { left, error }
    }
}

/// The listening end; closed and removed when dropped.
#[derive(Debug)]
pub struct RequestSocket {
    /// The thread ends when this does.
    open: Option<UnixStream>,
    thread: Option<JoinHandle<()>>,
}

/// Makes the answer to a caller whose line is whole; an error closes the connection.
type Serve = Box<dyn FnMut(&Caller) -> io::Result<Vec<u8>> + Send>;

impl RequestSocket {
    /// Listens in `folder`.
    ///
    /// # Errors
    /// The system gives no socket or no thread.
    pub(crate) fn open(
        folder: &Path,
        requests: Sender<Operator>,
        phase: PhaseCell,
    ) -> io::Result<Self> {
        let socket = ControlSocket::bind(folder, SOCKET)?;
        Self::on(socket, requests, phase)
    }

    /// Answers operators on a socket that is open.
    fn on(socket: ControlSocket, requests: Sender<Operator>, phase: PhaseCell) -> io::Result<Self> {
        let serve = move |caller: &Caller| in_a_line(&told(caller, &requests, &phase)?);
        Self::serve_on(socket, Box::new(serve))
    }

    /// Listens at the socket of this name in `folder`, and answers every caller as `serve` does.
    ///
    /// # Errors
    /// The system gives no socket or no thread.
    pub(super) fn listen(folder: &Path, name: &str, serve: Serve) -> io::Result<Self> {
        Self::serve_on(ControlSocket::bind(folder, name)?, serve)
    }

    fn serve_on(socket: ControlSocket, serve: Serve) -> io::Result<Self> {
        let (open, closed) = UnixStream::pair()?;
        let work = move || {
            let mut counter = Counter {
                socket,
                closed,
                callers: Vec::new(),
                serve,
            };
            while counter.waits() {
                counter.turn();
            }
        };
        let thread = std::thread::Builder::new()
            .name("gusset-requests".into())
            .spawn(work)?;
        Ok(Self {
            open: Some(open),
            thread: Some(thread),
        })
    }
}

impl Drop for RequestSocket {
    fn drop(&mut self) {
        self.open = None;
        if let Some(thread) = self.thread.take() {
            // It only waits for this and for clients, and removes the socket.
            let _ = thread.join();
        }
    }
}

/// The thread of the control socket: it waits for all clients at once, and for each for a limited time.
struct Counter {
    socket: ControlSocket,
    /// Readable when the control socket closes.
    closed: UnixStream,
    callers: Vec<Caller>,
    serve: Serve,
}

/// A client that has not sent a whole line yet.
pub(super) struct Caller {
    stream: UnixStream,
    pub(super) line: Vec<u8>,
    until_ns: u64,
}

impl Counter {
    /// Waits until there is work; false if the control socket closes.
    fn waits(&self) -> bool {
        let mut ends = vec![PollFd::new(&self.closed, PollFlags::IN)];
        ends.push(PollFd::new(&self.socket, PollFlags::IN));
        let streams = self.callers.iter();
        ends.extend(streams.map(|caller| PollFd::new(&caller.stream, PollFlags::IN)));
        let now_ns = monotonic_ns();
        let patience = self.callers.iter().map(|caller| caller.until_ns);
        let longest = patience.min().map(|until_ns| {
            let wait_ns = until_ns.saturating_sub(now_ns);
            Timespec {
                tv_sec: (wait_ns / 1_000_000_000) as i64,
                tv_nsec: (wait_ns % 1_000_000_000) as _,
            }
        });
        // One that is interrupted has found nothing.
        let _ = poll(&mut ends, longest.as_ref());
        ends.first().is_none_or(|end| end.revents().is_empty())
    }

    /// Whatever can be done without waiting.
    fn turn(&mut self) {
        self.accept();
        let callers = std::mem::take(&mut self.callers);
        for mut caller in callers {
            match caller.hear() {
                Heard::Part if monotonic_ns() < caller.until_ns => self.callers.push(caller),
                // An invalid or silent client gets no answer.
                Heard::Part => {}
                Heard::Whole => {
                    let answer = (self.serve)(&caller);
                    let _ = answer.and_then(|line| (&caller.stream).write_all(&line));
                }
            }
        }
        // Only now: a caller whose request came with its connection has its answer.
        let more = self.callers.len().saturating_sub(MOST_CALLERS);
        self.callers.drain(..more);
    }

    fn accept(&mut self) {
        match self.socket.accept() {
            Ok(stream) if stream.set_nonblocking(true).is_ok() => {
                self.callers.push(Caller {
                    stream,
                    line: Vec::new(),
                    until_ns: monotonic_ns().saturating_add(nanos(PATIENCE)),
                });
            }
            Ok(_) => {}
            Err(error) => match error.kind() {
                // None waits, or it was another user's.
                ErrorKind::WouldBlock | ErrorKind::PermissionDenied => {}
                _ => super::pause(BREATH),
            },
        }
    }
}

/// Passes the request in a line to the running test, and returns the answer. An error closes the connection.
fn told(caller: &Caller, requests: &Sender<Operator>, phase: &PhaseCell) -> io::Result<Answer> {
    let request: Request = serde_json::from_slice(&caller.line)?;
    if request.lets_move() && caller.has_left() {
        return Err(io::ErrorKind::ConnectionAborted.into());
    }
    let seen = phase.glimpse();
    let heard = seen.phase.can_be_held();
    let is_taken = |word: Operator| word.say_into(requests).is_ok();
    let accepted = match request {
        Request::Stop => is_taken(Operator::Stop),
        Request::Hold => heard && is_taken(Operator::Hold),
        Request::Continue { hold } => {
            heard && hold == seen.hold_number && is_taken(Operator::EndHold(hold))
        }
        Request::Confirm => seen.unconfirmed && is_taken(Operator::Confirm),
        Request::Phase => true,
    };
    Ok(Answer { accepted, seen })
}

enum Heard {
    /// More may come.
    Part,
    /// A line, or all that there will be.
    Whole,
}

impl Caller {
    /// True if the other end is closed. A client that only sends nothing more still listens.
    fn has_left(&self) -> bool {
        let mut end = [PollFd::new(&self.stream, PollFlags::empty())];
        let looked = poll(&mut end, Some(&Timespec::default()));
        // An unknown state counts as closed.
        looked.is_err() || end.iter().any(|end| end.revents().contains(PollFlags::HUP))
    }

    /// Reads the bytes that have arrived.
    fn hear(&mut self) -> Heard {
        let mut bytes = [0; LONGEST];
        let room = bytes.get_mut(self.line.len()..).unwrap_or_default();
        match self.stream.read(room) {
            Ok(0) => Heard::Whole,
            Ok(count) => {
                let come = room.get(..count).unwrap_or_default();
                let end = come.iter().position(|byte| *byte == b'\n');
                self.line.extend(come.iter().take(end.unwrap_or(count)));
                if end.is_some() || self.line.len() == LONGEST {
                    Heard::Whole
                } else {
                    Heard::Part
                }
            }
            Err(error) => match error.kind() {
                ErrorKind::WouldBlock | ErrorKind::Interrupted => Heard::Part,
                _ => Heard::Whole,
            },
        }
    }
}

fn nanos(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

pub(super) fn read_line<T: serde::de::DeserializeOwned>(from: &UnixStream) -> io::Result<T> {
    let mut line = String::new();
    BufReader::new(from.take(LONGEST_ANSWER)).read_line(&mut line)?;
    serde_json::from_str(&line).map_err(io::Error::from)
}

pub(super) fn in_a_line(value: &impl Serialize) -> io::Result<Vec<u8>> {
    let mut line = serde_json::to_vec(value)?;
    line.push(b'\n');
    Ok(line)
}

pub(super) fn write_line(mut to: &UnixStream, value: &impl Serialize) -> io::Result<()> {
    to.write_all(&in_a_line(value)?)
}

/// Asks the test that runs into `folder`.
///
/// # Errors
/// Nothing runs there, or it does not answer.
pub fn ask(folder: &Path, request: Request) -> Result<Answer, Unanswered> {
    let stream = connect(folder, SOCKET, PATIENCE).map_err(|error| match error.kind() {
        ErrorKind::PermissionDenied => Unanswered::Barred(error),
        // The socket is removed with its test. After a kill it stays behind, but nothing listens. A test that has claimed
        // the folder may not listen yet, or its socket was deleted.
        ErrorKind::NotFound | ErrorKind::NotADirectory | ErrorKind::ConnectionRefused
            if !is_claimed(folder) =>
        {
            Unanswered::Over(error)
        }
        _ => Unanswered::silent(false)(error),
    })?;
    write_line(&stream, &request).map_err(Unanswered::silent(false))?;
    read_line(&stream).map_err(Unanswered::silent(true))
}

/// A connection to a control socket. It must be accepted in time.
pub(super) fn reach(folder: &Path, name: &str) -> io::Result<UnixStream> {
    connect(folder, name, PATIENCE)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::net::UnixListener;

    use super::*;
    use gusset_control::engine::Phase;
    use gusset_record::RunFolder;

    #[test]
    fn request_reaches_the_queue() {
        let home = tempfile::tempdir().unwrap();
        // Longer than an address of a socket may be.
        let folder = home.path().join("a".repeat(100)).join("b".repeat(100));
        std::fs::create_dir_all(&folder).unwrap();
        let (sender, receiver) = crossbeam_channel::bounded(4);
        let phase = PhaseCell::default();
        let request_socket = RequestSocket::open(&folder, sender, phase.clone()).unwrap();
        phase.set(Phase::Running);
        let answer = ask(&folder, Request::Hold).unwrap();
        assert!(answer.accepted);
        assert_eq!(answer.seen, Glimpse::of(Phase::Running));
        let end_hold = Request::Continue { hold: 0 };
        assert!(ask(&folder, end_hold).unwrap().accepted);
        let full = ask(&folder, Request::Hold).unwrap();
        assert!(!full.accepted, "the rest of the room is for ends");
        for _ in 0..2 {
            assert!(ask(&folder, Request::Stop).unwrap().accepted);
        }
        let heard: Vec<Operator> = receiver.try_iter().collect();
        let [hold, go_on, stop] = [Operator::Hold, Operator::EndHold(0), Operator::Stop];
        assert_eq!(heard, [hold, go_on, stop, stop]);
        drop(request_socket);
        let over = ask(&folder, Request::Phase).unwrap_err();
        assert!(matches!(over, Unanswered::Over(_)), "{over}");
        assert!(!folder.join(SOCKET).exists());
    }

    #[test]
    fn hold_is_visible_and_shutdown_is_not_held() {
        let folder = tempfile::tempdir().unwrap();
        let (sender, receiver) = crossbeam_channel::bounded(4);
        let cell = PhaseCell::default();
        let _socket = RequestSocket::open(folder.path(), sender, cell.clone()).unwrap();
        let held = Glimpse {
            phase: Phase::Ramping,
            hold: true,
            stands: true,
            unconfirmed: false,
            hold_number: 3,
        };
        cell.show(held);
        assert_eq!(ask(folder.path(), Request::Phase).unwrap().seen, held);
        for phase in [Phase::Leaving, Phase::Tripped, Phase::Safe] {
            cell.set(phase);
            for request in [Request::Hold, Request::Continue { hold: 0 }] {
                let refused = ask(folder.path(), request).unwrap();
                assert_eq!((refused.accepted, refused.seen.phase), (false, phase));
            }
            assert!(ask(folder.path(), Request::Stop).unwrap().accepted);
            assert_eq!(receiver.try_recv(), Ok(Operator::Stop));
            assert!(receiver.try_recv().is_err());
        }
    }

    #[test]
    fn only_confirm_confirms_readings() {
        let folder = tempfile::tempdir().unwrap();
        let (sender, receiver) = crossbeam_channel::bounded(4);
        let cell = PhaseCell::default();
        let _socket = RequestSocket::open(folder.path(), sender, cell.clone()).unwrap();
        for (hold, unconfirmed) in [(false, false), (true, false), (true, true), (false, true)] {
            let seen = Glimpse {
                phase: Phase::Zeroing,
                hold,
                stands: hold,
                unconfirmed,
                hold_number: 7,
            };
            cell.show(seen);
            let answer = ask(folder.path(), Request::Confirm).unwrap();
            assert_eq!((answer.accepted, answer.seen), (unconfirmed, seen));
            let said: Vec<Operator> = receiver.try_iter().collect();
            assert_eq!(said, vec![Operator::Confirm; usize::from(unconfirmed)]);
            let go_on = Request::Continue { hold: 7 };
            assert!(ask(folder.path(), go_on).unwrap().accepted);
            assert_eq!(receiver.try_recv(), Ok(Operator::EndHold(7)), "{seen:?}");
        }
    }

    #[test]
    fn silent_test_is_not_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        let over = ask(path, Request::Stop).unwrap_err();
        assert!(matches!(over, Unanswered::Over(_)), "nothing: {over}");
        // Listens, and does nothing, as a process that is stopped.
        let listener = UnixListener::bind(path.join(SOCKET)).unwrap();
        let silent = ask(path, Request::Stop).unwrap_err();
        assert!(
            matches!(silent, Unanswered::Silent { left: true, .. }),
            "{silent}"
        );
        let (lies_there, _) = listener.accept().unwrap();
        let asked: Request = read_line(&lies_there).unwrap();
        assert_eq!(asked, Request::Stop);
        drop(listener);
        // A killed one leaves its socket.
        let over = ask(path, Request::Stop).unwrap_err();
        assert!(matches!(over, Unanswered::Over(_)), "killed: {over}");
    }

    #[test]
    fn claimed_folder_without_socket_is_running() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("run");
        let folder = RunFolder::create(&path).unwrap();
        folder.claim();
        let silent = ask(&path, Request::Stop).unwrap_err();
        assert!(silent.to_string().contains("control.sock"), "{silent}");
        drop(folder);
        let over = ask(&path, Request::Stop).unwrap_err();
        assert!(matches!(over, Unanswered::Over(_)), "{over}");
    }

    #[test]
    fn nonsense_gets_no_answer() {
        let folder = tempfile::tempdir().unwrap();
        let (sender, receiver) = crossbeam_channel::bounded(4);
        let _socket = RequestSocket::open(folder.path(), sender, PhaseCell::default()).unwrap();
        for text in [
            "",
            "GET / HTTP/1.1\r\n\r\n",
            "{\"request\":\"explode\"}\n",
            "{\"request\":\"continue\"}\n",
            "{\"request\":\"continue\",\"hold\":0,\"now\":true}\n",
        ] {
            let stream = UnixStream::connect(folder.path().join(SOCKET)).unwrap();
            (&stream).write_all(text.as_bytes()).unwrap();
            stream.shutdown(std::net::Shutdown::Write).unwrap();
            let mut answer = String::new();
            (&stream).read_to_string(&mut answer).unwrap();
            assert_eq!(answer, "");
        }
        let go_on = Request::Continue { hold: 0 };
        assert!(ask(folder.path(), go_on).unwrap().accepted);
        assert_eq!(receiver.try_recv(), Ok(Operator::EndHold(0)));
    }

    #[test]
    fn continue_ends_only_the_hold_it_names() {
        let folder = tempfile::tempdir().unwrap();
        let (sender, receiver) = crossbeam_channel::bounded(4);
        let cell = PhaseCell::default();
        let _socket = RequestSocket::open(folder.path(), sender, cell.clone()).unwrap();
        let second = Glimpse {
            hold: true,
            stands: true,
            hold_number: 2,
            ..Glimpse::of(Phase::Holding)
        };
        cell.show(second);
        let answer = ask(folder.path(), Request::Continue { hold: 1 }).unwrap();
        assert_eq!((answer.accepted, answer.seen), (false, second));
        assert!(receiver.try_recv().is_err());
        assert!(
            ask(folder.path(), Request::Continue { hold: 2 })
                .unwrap()
                .accepted
        );
        assert_eq!(receiver.try_recv(), Ok(Operator::EndHold(2)));
    }

    /// A command that waits in a full queue until its sender has disconnected must not move a specimen later.
    #[test]
    fn command_of_a_lost_sender_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let (sender, receiver) = crossbeam_channel::bounded(8);
        let cell = PhaseCell::default();
        cell.show(Glimpse {
            unconfirmed: true,
            ..Glimpse::of(Phase::Zeroing)
        });
        let socket = ControlSocket::bind(folder.path(), SOCKET).unwrap();
        let mut here = Vec::new();
        for (line, stays) in [
            ("{\"request\":\"continue\",\"hold\":0}\n", false),
            ("{\"request\":\"confirm\"}\n", false),
            ("{\"request\":\"hold\"}\n", false),
            ("{\"request\":\"stop\"}\n", false),
            ("{\"request\":\"confirm\"}\n", true),
        ] {
            let stream = UnixStream::connect(folder.path().join(SOCKET)).unwrap();
            (&stream).write_all(line.as_bytes()).unwrap();
            // Says nothing more, and listens.
            stream.shutdown(std::net::Shutdown::Write).unwrap();
            here.extend(stays.then_some(stream));
        }
        let _socket = RequestSocket::on(socket, sender, cell).unwrap();
        let heard: Vec<_> = (0..3).map(|_| receiver.recv().unwrap()).collect();
        assert_eq!(heard, [Operator::Hold, Operator::Stop, Operator::Confirm]);
        assert!(receiver.try_recv().is_err());
    }

    #[test]
    fn moved_folder_keeps_its_own_socket() {
        let home = tempfile::tempdir().unwrap();
        let (path, moved) = (home.path().join("run"), home.path().join("moved"));
        let open = || {
            fs::create_dir(&path).unwrap();
            let (sender, receiver) = crossbeam_channel::bounded(4);
            let request_socket = RequestSocket::open(&path, sender, PhaseCell::default()).unwrap();
            (request_socket, receiver)
        };
        let (first, _first_hears) = open();
        fs::rename(&path, &moved).unwrap();
        let (_second, second_hears) = open();
        assert!(ask(&moved, Request::Hold).unwrap().accepted);
        // Ends: it waits for no word from the other.
        drop(first);
        assert!(!moved.join(SOCKET).exists());
        assert!(ask(&path, Request::Hold).unwrap().accepted);
        assert_eq!(second_hears.try_recv(), Ok(Operator::Hold));

        // Another file of that name is not its socket.
        let (third, _third_hears) = {
            fs::rename(&path, home.path().join("second")).unwrap();
            open()
        };
        fs::remove_file(path.join(SOCKET)).unwrap();
        fs::write(path.join(SOCKET), "").unwrap();
        drop(third);
        assert!(path.join(SOCKET).exists());
    }

    #[test]
    fn silent_clients_delay_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let (sender, receiver) = crossbeam_channel::bounded(4);
        let request_socket =
            RequestSocket::open(folder.path(), sender, PhaseCell::default()).unwrap();
        let call = || UnixStream::connect(folder.path().join(SOCKET)).unwrap();
        // Each of them alone would delay the next client until its own time limit.
        let silent: Vec<UnixStream> = (0..8).map(|_| call()).collect();
        assert!(ask(folder.path(), Request::Stop).unwrap().accepted);
        assert_eq!(receiver.try_recv(), Ok(Operator::Stop));
        // A client that keeps sending bytes, but no line, has no more time than others.
        let mut slow = call();
        let is_hung_up = (0..120).any(|_| {
            crate::pause(Duration::from_millis(100));
            slow.write_all(b" ").is_err()
        });
        assert!(is_hung_up, "he was listened to for 12 s");
        for mut silent in silent {
            assert_eq!(silent.read(&mut [0]).unwrap(), 0);
        }
        // More than are listened to at once. Each gives up its place to the next one, so that the last is answered.
        let crowd: Vec<UnixStream> = (0..189).map(|_| call()).collect();
        assert!(ask(folder.path(), Request::Stop).unwrap().accepted);
        assert_eq!(receiver.try_recv(), Ok(Operator::Stop));
        drop(crowd);
        let mut last = call();
        drop(request_socket);
        assert!(matches!(last.read(&mut [0]), Ok(0) | Err(_)));
    }
}
