//! The operator's desk: a socket in the run folder, through which other programs speak to a running test.
//!
//! One line of JSON in, one out: `{"request": "hold"}` and `{"accepted": true, "phase": "running"}`. Nothing here can hold
//! the loop up: requests go through the bounded channel that it polls, the phase is a number that it leaves behind.
//! Only the user who started the test may speak (mode 0600).

use std::fs::{File, Permissions};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::Sender;
use serde::{Deserialize, Serialize};

use crate::engine::{Operator, Phase, PhaseCell};
use crate::record::{Roll, What};

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
    /// Go on, or confirm the offsets.
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
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Answer {
    /// False if the queue of requests is full.
    pub accepted: bool,
    /// Where the test was when it answered.
    pub phase: Phase,
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
    let accepted = match asked.request {
        Request::Stop => requests.try_send(Operator::Stop).is_ok(),
        Request::Hold => requests.try_send(Operator::Hold).is_ok(),
        Request::Continue => requests.try_send(Operator::Continue).is_ok(),
        Request::Phase => true,
    };
    let phase = phase.get();
    write_line(caller, &Answer { accepted, phase })
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
pub fn ask(folder: &Path, request: Request) -> io::Result<Answer> {
    let (_open, address) = short(folder)?;
    let stream = UnixStream::connect(address)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    write_line(&stream, &Asked { request })?;
    read_line(&stream)
}

#[cfg(test)]
mod tests {
    use super::*;
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
        let running = Answer {
            accepted: true,
            phase: Phase::Running,
        };
        assert_eq!(answer, running);
        let full = ask(&folder, Request::Stop).unwrap();
        assert!(!full.accepted, "one request fits");
        assert_eq!(receiver.try_recv(), Ok(Operator::Hold));
        drop(desk);
        assert!(ask(&folder, Request::Phase).is_err());
        assert!(!folder.join(SOCKET).exists());
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
