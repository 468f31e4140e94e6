//! The operator's desk: a socket in the run folder, through which other programs speak to a running test.
//!
//! One line of JSON in, one out: `{"request": "hold"}` and `{"accepted": true, "phase": "running"}`. Nothing here can hold
//! the loop up: requests go through the bounded channel that it polls, the phase is a number that it leaves behind. Who asks
//! keeps apart a test that is over from one that does not answer: of the second nothing is known but that it may still move.
//! Only the user who started the test may speak (mode 0600).

use std::fs::{File, Permissions};
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::Sender;
use rustix::net::sockopt::{Timeout, set_socket_timeout};
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::engine::{Glimpse, Operator, PhaseCell};
use crate::record::{Roll, What, is_claimed};

/// The socket's name in the run folder.
const SOCKET: &str = "control.sock";
/// How long the other end may take for its line.
const PATIENCE: Duration = Duration::from_secs(2);
/// Longest line.
const LONGEST: u64 = 256;

/// What can be asked of a running test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Request {
    /// End in an orderly way.
    Stop,
    /// Let test time stand still.
    Hold,
    /// Go on after a hold; where there is none, confirm what the sensors read: as the answer has it seen.
    Continue,
    /// Where in its life it is.
    Phase,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Asked {
    request: Request,
}

/// What the test answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Answer {
    /// False if the queue of requests is full, or the phase one in which this is not heard.
    pub accepted: bool,
    /// Where the test was when it was asked.
    #[serde(flatten)]
    pub seen: Glimpse,
}

/// Why there is no answer.
#[derive(Debug, Error)]
pub enum Unanswered {
    /// Nobody listens there: no test runs, or none any more.
    #[error("no test is running here: {0}")]
    Over(io::Error),
    /// Somebody may listen there, and speaks to others only.
    #[error("only who started the test may speak to it: {0}")]
    Barred(io::Error),
    /// Somebody may listen there who did not answer.
    #[error("the test does not answer ({})", in_words(.error))]
    Silent {
        /// The request lies in the socket, and whoever comes to it carries it out.
        left: bool,
        /// The system's word.
        error: io::Error,
    },
}

/// What the system calls a resource that is not there just now is time that has passed.
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
pub struct Desk {
    path: PathBuf,
    closing: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// A path of any length, short enough for a socket's address: through the folder's descriptor.
fn short(folder: &Path) -> io::Result<(File, PathBuf)> {
    let open = File::open(folder)?;
    let through = format!("/proc/self/fd/{}/{SOCKET}", open.as_raw_fd());
    Ok((open, PathBuf::from(through)))
}

impl Desk {
    /// Listens in `folder`.
    ///
    /// # Errors
    /// The system gives no socket or no thread.
    pub fn open(
        folder: &Path,
        requests: Sender<Operator>,
        phase: PhaseCell,
        roll: &Roll,
    ) -> io::Result<Self> {
        let (_open, address) = short(folder)?;
        let listener = UnixListener::bind(address)?;
        let path = folder.join(SOCKET);
        std::fs::set_permissions(&path, Permissions::from_mode(0o600))?;
        let closing = Arc::new(AtomicBool::new(false));
        let (closed, roll) = (Arc::clone(&closing), roll.clone());
        let thread = std::thread::Builder::new()
            .name("gusset-desk".into())
            .spawn(move || {
                let stamper = roll.enter();
                for caller in listener.incoming() {
                    if closed.load(Ordering::Relaxed) {
                        return;
                    }
                    let began_ns = stamper.now();
                    // Whoever speaks nonsense or not at all gets no answer.
                    let _ = caller.and_then(|caller| serve(&caller, &requests, &phase));
                    stamper.since(What::Request, began_ns, 0);
                }
            })?;
        Ok(Self {
            path,
            closing,
            thread: Some(thread),
        })
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        self.closing.store(true, Ordering::Relaxed);
        // Wakes the thread up.
        let woken = self
            .path
            .parent()
            .map(short)
            .and_then(Result::ok)
            .is_some_and(|(_open, address)| UnixStream::connect(address).is_ok());
        let _ = std::fs::remove_file(&self.path);
        if let Some(thread) = self.thread.take()
            && woken
        {
            let _ = thread.join();
        }
    }
}

fn serve(caller: &UnixStream, requests: &Sender<Operator>, phase: &PhaseCell) -> io::Result<()> {
    caller.set_read_timeout(Some(PATIENCE))?;
    caller.set_write_timeout(Some(PATIENCE))?;
    let asked: Asked = read_line(caller)?;
    let seen = phase.glimpse();
    let heard = seen.phase.can_be_held();
    let accepted = match asked.request {
        Request::Stop => requests.try_send(Operator::Stop).is_ok(),
        Request::Hold => heard && requests.try_send(Operator::Hold).is_ok(),
        Request::Continue => heard && requests.try_send(Operator::to_go_on(seen)).is_ok(),
        Request::Phase => true,
    };
    write_line(caller, &Answer { accepted, seen })
}

fn read_line<T: serde::de::DeserializeOwned>(from: &UnixStream) -> io::Result<T> {
    let mut line = String::new();
    BufReader::new(from.take(LONGEST)).read_line(&mut line)?;
    serde_json::from_str(&line).map_err(io::Error::from)
}

fn write_line(mut to: &UnixStream, value: &impl Serialize) -> io::Result<()> {
    let mut line = serde_json::to_vec(value)?;
    line.push(b'\n');
    to.write_all(&line)
}

/// Asks the test that runs into `folder`.
///
/// # Errors
/// Nothing runs there, or it does not answer.
pub fn ask(folder: &Path, request: Request) -> Result<Answer, Unanswered> {
    let stream = reach(folder).map_err(|error| match error.kind() {
        ErrorKind::PermissionDenied => Unanswered::Barred(error),
        // The socket goes with its test; where that was killed it stays behind, and nobody listens. One that has claimed the
        // folder does not listen yet, or its socket was deleted.
        ErrorKind::NotFound | ErrorKind::NotADirectory | ErrorKind::ConnectionRefused
            if !is_claimed(folder) =>
        {
            Unanswered::Over(error)
        }
        _ => Unanswered::silent(false)(error),
    })?;
    write_line(&stream, &Asked { request }).map_err(Unanswered::silent(false))?;
    read_line(&stream).map_err(Unanswered::silent(true))
}

/// A connection. One that is not taken up in time because too many wait before it is not waited for, either.
fn reach(folder: &Path) -> io::Result<UnixStream> {
    let (_open, address) = short(folder)?;
    let socket = rustix::net::socket_with(
        AddressFamily::UNIX,
        SocketType::STREAM,
        SocketFlags::CLOEXEC,
        None,
    )?;
    set_socket_timeout(&socket, Timeout::Send, Some(PATIENCE))?;
    set_socket_timeout(&socket, Timeout::Recv, Some(PATIENCE))?;
    rustix::net::connect(&socket, &SocketAddrUnix::new(&address)?)?;
    Ok(UnixStream::from(socket))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Phase;
    use crate::record::RunFolder;
    use crate::session::roll;

    #[test]
    fn a_request_reaches_the_queue_and_the_socket_goes_with_the_desk() {
        let home = tempfile::tempdir().unwrap();
        // Longer than an address of a socket may be.
        let folder = home.path().join("a".repeat(100)).join("b".repeat(100));
        std::fs::create_dir_all(&folder).unwrap();
        let (sender, receiver) = crossbeam_channel::bounded(1);
        let phase = PhaseCell::default();
        let desk = Desk::open(&folder, sender, phase.clone(), &roll()).unwrap();
        phase.set(Phase::Running);
        let answer = ask(&folder, Request::Hold).unwrap();
        assert!(answer.accepted);
        assert_eq!(answer.seen, Glimpse::of(Phase::Running));
        let full = ask(&folder, Request::Stop).unwrap();
        assert!(!full.accepted, "one request fits");
        assert_eq!(receiver.try_recv(), Ok(Operator::Hold));
        drop(desk);
        let over = ask(&folder, Request::Phase).unwrap_err();
        assert!(matches!(over, Unanswered::Over(_)), "{over}");
        assert!(!folder.join(SOCKET).exists());
    }

    #[test]
    fn what_is_held_is_seen_and_the_way_out_is_not_held() {
        let folder = tempfile::tempdir().unwrap();
        let (sender, receiver) = crossbeam_channel::bounded(4);
        let cell = PhaseCell::default();
        let _desk = Desk::open(folder.path(), sender, cell.clone(), &roll()).unwrap();
        let held = Glimpse {
            phase: Phase::Ramping,
            hold: true,
            stands: true,
            unconfirmed: false,
        };
        cell.show(held);
        assert_eq!(ask(folder.path(), Request::Phase).unwrap().seen, held);
        for phase in [Phase::Leaving, Phase::Tripped, Phase::Safe] {
            cell.set(phase);
            for request in [Request::Hold, Request::Continue] {
                let refused = ask(folder.path(), request).unwrap();
                assert_eq!((refused.accepted, refused.seen.phase), (false, phase));
            }
            assert!(ask(folder.path(), Request::Stop).unwrap().accepted);
            assert_eq!(receiver.try_recv(), Ok(Operator::Stop));
            assert!(receiver.try_recv().is_err());
        }
    }

    /// Said before the question, or to a test that is held, it is no answer to it.
    #[test]
    fn what_was_read_is_confirmed_by_who_was_asked_and_holds_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let (sender, receiver) = crossbeam_channel::bounded(4);
        let cell = PhaseCell::default();
        let _desk = Desk::open(folder.path(), sender, cell.clone(), &roll()).unwrap();
        for (hold, unconfirmed, word) in [
            (false, false, Operator::Continue),
            (true, true, Operator::Continue),
            (false, true, Operator::Confirm),
        ] {
            let seen = Glimpse {
                phase: Phase::Zeroing,
                hold,
                stands: hold,
                unconfirmed,
            };
            cell.show(seen);
            assert_eq!(ask(folder.path(), Request::Continue).unwrap().seen, seen);
            assert_eq!(receiver.try_recv(), Ok(word), "{seen:?}");
        }
    }

    #[test]
    fn who_does_not_answer_is_not_over_and_who_is_over_does_not_answer() {
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
        assert_eq!(silent.to_string(), "the test does not answer (2 s)");
        let (lies_there, _) = listener.accept().unwrap();
        let asked: Asked = read_line(&lies_there).unwrap();
        assert_eq!(asked.request, Request::Stop);
        drop(listener);
        // A killed one leaves its socket.
        let over = ask(path, Request::Stop).unwrap_err();
        assert!(matches!(over, Unanswered::Over(_)), "killed: {over}");
    }

    #[test]
    fn a_test_whose_socket_is_gone_is_not_over_as_long_as_it_has_claimed_its_folder() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("run");
        let folder = RunFolder::create(&path).unwrap();
        folder.claim();
        let silent = ask(&path, Request::Stop).unwrap_err();
        assert_eq!(
            silent.to_string(),
            "the test does not answer (there is no control.sock)"
        );
        drop(folder);
        let over = ask(&path, Request::Stop).unwrap_err();
        assert!(matches!(over, Unanswered::Over(_)), "{over}");
    }

    #[test]
    fn nonsense_gets_no_answer_and_the_desk_stays_open() {
        let folder = tempfile::tempdir().unwrap();
        let (sender, receiver) = crossbeam_channel::bounded(4);
        let _desk = Desk::open(folder.path(), sender, PhaseCell::default(), &roll()).unwrap();
        for text in ["", "GET / HTTP/1.1\r\n\r\n", "{\"request\":\"explode\"}\n"] {
            let stream = UnixStream::connect(folder.path().join(SOCKET)).unwrap();
            (&stream).write_all(text.as_bytes()).unwrap();
            stream.shutdown(std::net::Shutdown::Write).unwrap();
            let mut answer = String::new();
            (&stream).read_to_string(&mut answer).unwrap();
            assert_eq!(answer, "");
        }
        assert!(ask(folder.path(), Request::Continue).unwrap().accepted);
        assert_eq!(receiver.try_recv(), Ok(Operator::Continue));
    }
}
