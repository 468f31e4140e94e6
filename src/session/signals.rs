//! SIGINT, SIGQUIT, SIGTERM, SIGHUP and the like become a request to the loop: a clean end, never a sudden one.

use std::future::poll_fn;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::task::Poll;

use crossbeam_channel::{Receiver, Sender};
use rustix::process::Signal as Raw;
use tokio::signal::unix::{self, SignalKind, signal};

use gusset_control::engine::Operator;
use gusset_record::rt::os;
use gusset_record::rt::sampler::count_continuation;

/// A signal that ended a test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    /// SIGINT or SIGQUIT: Ctrl-C, or Ctrl-\ beside it.
    Interrupt,
    /// SIGTERM, SIGHUP (the terminal, or its connection, is gone), or a stray signal.
    Terminate,
}

/// Signals of the keyboard.
const INTERRUPTING: [SignalKind; 2] = [SignalKind::interrupt(), SignalKind::quit()];

/// Those of signal(7) that the C library leaves to programs.
const REAL_TIME: std::ops::RangeInclusive<i32> = 34..=64;

/// These signals end a process as SIGTERM does: a stray SIGUSR1 or SIGALRM, the timers' SIGPROF, a failing power supply's SIGPWR,
/// all real-time signals, and SIGXCPU, the kernel's warning beyond RLIMIT_CPU or RLIMIT_RTTIME.
fn terminating() -> impl Iterator<Item = SignalKind> {
    let strays = [
        Raw::HUP,
        Raw::USR1,
        Raw::USR2,
        Raw::ALARM,
        Raw::VTALARM,
        Raw::PROF,
        Raw::IO,
        Raw::POWER,
        Raw::STKFLT,
        Raw::XCPU,
    ];
    let real_time = REAL_TIME.map(SignalKind::from_raw);
    let heard = strays
        .into_iter()
        .map(|stray| SignalKind::from_raw(stray.as_raw()))
        .chain(real_time)
        .filter(|stray| !os::is_ignored(stray.as_raw_value()));
    std::iter::once(SignalKind::terminate()).chain(heard)
}

/// Signals that would end the process without a fault, taken over from the system: SIGINT, SIGQUIT, SIGTERM and, unless they were
/// ignored before, SIGHUP (nohup(1) ignores it) and stray signals. Signals that would only stop the process, while it controls a
/// specimen, are ignored.
#[derive(Debug)]
pub struct Taken {
    ending: Vec<(Signal, unix::Signal)>,
    /// After a stop: it ends nothing, and is counted.
    continued: unix::Signal,
}

impl Taken {
    /// Within an asynchronous runtime, which receives them.
    ///
    /// # Errors
    /// The system gives no handler.
    pub(crate) fn over() -> io::Result<Self> {
        os::ignore_stops_of_the_terminal();
        let interrupting = INTERRUPTING.map(|kind| (Signal::Interrupt, kind));
        let terminating = terminating().map(|kind| (Signal::Terminate, kind));
        let taken = interrupting
            .into_iter()
            .chain(terminating)
            .map(|(what, kind)| Ok((what, signal(kind)?)));
        Ok(Self {
            ending: taken.collect::<io::Result<_>>()?,
            continued: signal(SignalKind::from_raw(Raw::CONT.as_raw()))?,
        })
    }

    /// The next of them.
    pub(crate) async fn next(&mut self) -> Signal {
        poll_fn(|context| {
            while let Poll::Ready(Some(())) = self.continued.poll_recv(context) {
                count_continuation();
            }
            let came = |taken: &mut (Signal, unix::Signal)| {
                taken.1.poll_recv(context).is_ready().then_some(taken.0)
            };
            match self.ending.iter_mut().find_map(came) {
                Some(which) => Poll::Ready(which),
                None => Poll::Pending,
            }
        })
        .await
    }
}

/// Listens on a separate thread for as long as the process lives.
#[derive(Debug)]
pub struct Signals {
    seen: Arc<AtomicU8>,
    sender: Sender<Operator>,
    receiver: Receiver<Operator>,
}

const INTERRUPT: u8 = 1;
const TERMINATE: u8 = 2;

impl Signals {
    /// Takes the signals over: see [`Taken`].
    ///
    /// # Errors
    /// The system gives no thread or no handler.
    pub fn listen() -> io::Result<Self> {
        let (sender, receiver) = crossbeam_channel::bounded(16);
        let seen = Arc::new(AtomicU8::new(0));
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .build()?;
        let mut taken = {
            let _inside = runtime.enter();
            Taken::over()?
        };
        let (noted, requests) = (Arc::clone(&seen), sender.clone());
        std::thread::Builder::new()
            .name("gusset-signals".into())
            .spawn(move || {
                runtime.block_on(async move {
                    loop {
                        let which = match taken.next().await {
                            Signal::Interrupt => INTERRUPT,
                            Signal::Terminate => TERMINATE,
                        };
                        // The first signal names the cause.
                        let _ =
                            noted.compare_exchange(0, which, Ordering::Relaxed, Ordering::Relaxed);
                        let _ = Operator::Interrupt.say_into(&requests);
                    }
                });
            })?;
        Ok(Self {
            seen,
            sender,
            receiver,
        })
    }

    /// The loop's end of the line.
    #[must_use]
    pub fn requests(&self) -> Receiver<Operator> {
        self.receiver.clone()
    }

    /// The operator's end of the line.
    #[must_use]
    pub fn operator(&self) -> Sender<Operator> {
        self.sender.clone()
    }

    /// The first signal that came, if one did.
    #[must_use]
    pub fn seen(&self) -> Option<Signal> {
        match self.seen.load(Ordering::Relaxed) {
            INTERRUPT => Some(Signal::Interrupt),
            TERMINATE => Some(Signal::Terminate),
            _ => None,
        }
    }
}
