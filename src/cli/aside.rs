//! Messages on stderr while something runs: their reader is perhaps not reading.
//!
//! A terminal that is halted (Ctrl-S), a sleeping connection, or a pipe or socket without a reader takes no more than its buffer
//! holds, and then blocks its writer. It must block neither a specimen's end, nor the writer of the rows, nor a loop that panics
//! before retirement. So a message waits [`PATIENCE_MS`] once; later ones are dropped until the reader is back. Then a line
//! reports how many it missed. A regular file is always written to.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::sync::{Mutex, OnceLock, PoisonError};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::OFlags;
use rustix::net::SendFlags;

/// So long a reader is waited for, ms: well below the shortest watchdog.
const PATIENCE_MS: i64 = 5;

/// Where words go, and how many of them did not.
struct Aside<W> {
    out: W,
    missed: u64,
    /// A line was written halfway.
    broken: bool,
}

/// A writer that reports that it is full instead of waiting.
trait Hasty {
    /// As [`Write::write`]; [`io::ErrorKind::WouldBlock`] where there is no room.
    fn offer(&mut self, bytes: &[u8]) -> io::Result<usize>;
    /// Waits a moment for room.
    fn wait(&mut self);
}

impl<W: Hasty> Aside<W> {
    const fn new(out: W) -> Self {
        Self {
            out,
            missed: 0,
            broken: false,
        }
    }

    fn say(&mut self, text: &[u8]) {
        let mut whole = Vec::new();
        if self.missed > 0 {
            let start = if self.broken { "\n" } else { "" };
            let words = format!(
                "{start}[{} messages are missing here: the terminal did not take them]\n",
                self.missed
            );
            whole.extend_from_slice(words.as_bytes());
        }
        whole.extend_from_slice(text);
        let mut rest = whole.as_slice();
        let mut patient = self.missed == 0;
        while !rest.is_empty() {
            match self.out.offer(rest) {
                Ok(count) if count > 0 => rest = rest.get(count..).unwrap_or_default(),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if error.kind() == io::ErrorKind::WouldBlock && patient => {
                    patient = false;
                    self.out.wait();
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    self.missed += 1;
                    self.broken |= rest.len() < whole.len();
                    return;
                }
                // Hung up: no reader will come back.
                Ok(_) | Err(_) => return,
            }
        }
        (self.missed, self.broken) = (0, false);
    }
}

/// Stderr, so that it does not make its writer wait. All users of a file share its blocking mode, which is not ours to
/// change.
enum Stderr {
    /// A regular file, which has no reader; and a file that cannot be opened.
    Plain,
    /// A pipe or a terminal, opened again.
    Anew(File),
    /// A socket, which cannot be opened, but asked each time not to wait.
    Socket(File),
}

impl Stderr {
    fn open() -> Self {
        Self::of(io::stderr().as_fd()).unwrap_or(Self::Plain)
    }

    fn of(stderr: BorrowedFd<'_>) -> io::Result<Self> {
        let file = File::from(stderr.try_clone_to_owned()?);
        let kind = file.metadata()?.file_type();
        if kind.is_socket() {
            return Ok(Self::Socket(file));
        }
        if !(kind.is_fifo() || kind.is_char_device()) {
            return Ok(Self::Plain);
        }
        let flags = OFlags::NONBLOCK | OFlags::NOCTTY;
        let anew = OpenOptions::new()
            .write(true)
            .custom_flags(flags.bits().cast_signed())
            .open("/proc/self/fd/2")?;
        Ok(Self::Anew(anew))
    }
}

impl Hasty for Stderr {
    fn offer(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Plain => io::stderr().write(bytes),
            Self::Anew(file) => file.write(bytes),
            Self::Socket(file) => {
                let flags = SendFlags::DONTWAIT | SendFlags::NOSIGNAL;
                Ok(rustix::net::send(file, bytes, flags)?)
            }
        }
    }

    fn wait(&mut self) {
        if let Self::Anew(file) | Self::Socket(file) = self {
            let patience = Timespec {
                tv_sec: 0,
                tv_nsec: PATIENCE_MS * 1_000_000,
            };
            let _ = poll(&mut [PollFd::new(file, PollFlags::OUT)], Some(&patience));
        }
    }
}

/// Says `text`, or counts it as missed.
pub fn write(text: &[u8]) {
    static ASIDE: OnceLock<Mutex<Aside<Stderr>>> = OnceLock::new();
    let aside = ASIDE.get_or_init(|| Mutex::new(Aside::new(Stderr::open())));
    let mut aside = aside.lock().unwrap_or_else(PoisonError::into_inner);
    aside.say(text);
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    /// A pipe with this much room.
    #[derive(Default)]
    struct Pipe {
        room: usize,
        shown: Vec<u8>,
        waits: u32,
        /// Room that comes while it is waited for.
        comes: usize,
    }

    impl Hasty for Pipe {
        fn offer(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let count = bytes.len().min(self.room);
            if count == 0 {
                return Err(io::ErrorKind::WouldBlock.into());
            }
            self.room -= count;
            self.shown.extend_from_slice(&bytes[..count]);
            Ok(count)
        }

        fn wait(&mut self) {
            self.waits += 1;
            self.room += self.comes;
        }
    }

    #[test]
    fn silent_reader_is_waited_for_once() {
        let mut aside = Aside::new(Pipe {
            room: 8,
            ..Pipe::default()
        });
        aside.say(b"one\n");
        for _ in 0..3 {
            aside.say(b"second\n");
        }
        assert_eq!(aside.out.shown, b"one\nseco");
        assert_eq!((aside.out.waits, aside.missed), (1, 3));

        aside.out.room = 1000;
        aside.say(b"last\n");
        aside.say(b"more\n");
        let shown = String::from_utf8(aside.out.shown).unwrap();
        let words = "[3 messages are missing here: the terminal did not take them]";
        assert_eq!(shown, format!("one\nseco\n{words}\nlast\nmore\n"));
    }

    #[test]
    fn full_socket_is_not_waited_for() {
        let (writer, mut reader) = std::os::unix::net::UnixStream::pair().unwrap();
        writer.set_nonblocking(true).unwrap();
        while (&writer).write(b".").is_ok() {}
        writer.set_nonblocking(false).unwrap();
        let mut aside = Aside::new(Stderr::of(writer.as_fd()).unwrap());
        for _ in 0..2 {
            aside.say(b"unheard\n");
        }
        assert_eq!(aside.missed, 2);

        reader.set_nonblocking(true).unwrap();
        let mut heard = Vec::new();
        let _it_is_empty = reader.read_to_end(&mut heard);
        aside.say(b"heard\n");
        heard.clear();
        let _it_is_empty = reader.read_to_end(&mut heard);
        let words = "[2 messages are missing here: the terminal did not take them]";
        let heard = String::from_utf8(heard).unwrap();
        assert_eq!(heard, format!("{words}\nheard\n"));
    }

    #[test]
    fn a_slow_reader_misses_nothing() {
        let mut aside = Aside::new(Pipe {
            room: 2,
            comes: 10,
            ..Pipe::default()
        });
        aside.say(b"one\n");
        aside.say(b"two\n");
        assert_eq!(aside.out.shown, b"one\ntwo\n");
        assert_eq!((aside.out.waits, aside.missed), (1, 0));
    }
}
