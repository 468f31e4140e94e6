//! SIGINT, SIGQUIT, SIGTERM and SIGHUP become a request to the loop: an orderly end, never a sudden one.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use crossbeam_channel::{Receiver, Sender};
use tokio::signal::unix::{self, SignalKind, signal};

use crate::engine::Operator;
use crate::record::{Roll, What};
use crate::rt::os;

/// A signal that ended a test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    /// SIGINT or SIGQUIT: Ctrl-C, or Ctrl-\ beside it.
    Interrupt,
    /// SIGTERM, or SIGHUP: the terminal, or the connection it came through, is gone.
    Terminate,
}

/// SIGINT, SIGQUIT, SIGTERM and SIGHUP, taken over from the system's default, which would end the process at once. A SIGHUP that was
/// ignored before stays so: that is asked for when somebody leaves what he has started (nohup(1)). What would only stop the
/// process, with a specimen in its hands, is not heard.
#[derive(Debug)]
pub struct Taken {
    interrupt: unix::Signal,
    quit: unix::Signal,
    terminate: unix::Signal,
    hang_up: Option<unix::Signal>,
}

impl Taken {
    /// Within an asynchronous runtime, which hears them.
    ///
    /// # Errors
    /// The system gives no handler.
    pub fn over() -> io::Result<Self> {
        os::ignore_stops_of_the_terminal();
        let hang_up = !os::is_hang_up_ignored();
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            quit: signal(SignalKind::quit())?,
            terminate: signal(SignalKind::terminate())?,
            hang_up: hang_up.then(|| signal(SignalKind::hangup())).transpose()?,
        })
    }

    /// The next of them.
    pub async fn next(&mut self) -> Signal {
        let hang_up = async {
            match &mut self.hang_up {
                Some(signal) => signal.recv().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            _ = self.interrupt.recv() => Signal::Interrupt,
            _ = self.quit.recv() => Signal::Interrupt,
            _ = self.terminate.recv() => Signal::Terminate,
            _ = hang_up => Signal::Terminate,
        }
    }
}

/// Listens on a thread of its own for as long as the process lives.
#[derive(Debug)]
pub struct Signals {
    seen: Arc<AtomicU8>,
    sender: Sender<Operator>,
    receiver: Receiver<Operator>,
    roll: Roll,
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
        let roll = super::roll();
        let for_thread = roll.clone();
        std::thread::Builder::new()
            .name("gusset-signals".into())
            .spawn(move || {
                let stamper = for_thread.enter();
                runtime.block_on(async move {
                    loop {
                        let which = match taken.next().await {
                            Signal::Interrupt => INTERRUPT,
                            Signal::Terminate => TERMINATE,
                        };
                        let began_ns = stamper.now();
                        // The first signal names the cause.
                        let _ =
                            noted.compare_exchange(0, which, Ordering::Relaxed, Ordering::Relaxed);
                        let _ = Operator::Stop.say_into(&requests);
                        stamper.since(What::Signal, began_ns, 0);
                    }
                });
            })?;
        Ok(Self {
            seen,
            sender,
            receiver,
            roll,
        })
    }

    /// The roll on which the listening thread stands: for the first test, and whoever attends that.
    #[must_use]
    pub fn roll(&self) -> Roll {
        self.roll.clone()
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
