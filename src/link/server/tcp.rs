//! TCP: accept, greet, hand over.

use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::net::{TcpListener, TcpStream};
use tokio::task::AbortHandle;
use tokio::time::timeout;

use super::armed::Session;
use super::caller::{Caller, Lost};
use super::greet::{self, Greeted};
use super::{Desk, Heard};
use crate::link::inbox::Inbox;
use crate::link::tls::is_client_hello;
use crate::wire::handshake::Arm;
use crate::wire::native::{Decoder, Frame};
use crate::wire::{Side, WireError};

/// A hello must come within this time.
const HELLO_LIMIT: Duration = Duration::from_secs(5);
/// From the welcome to the arming: a large model takes a while to get ready.
const ARM_LIMIT: Duration = Duration::from_secs(60);
/// Connections that have not armed yet. Where more come, one gives way ([`gives_way`]): a greeting proves nothing, for it may be
/// a copy of another one.
const MOST_WAITING: usize = 64;
/// Of them from one address: one machine does not keep out the others.
const MOST_OF_ONE: usize = 16;
/// Pause after a failed accept, for instance without file descriptors left.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Who waits, in the order in which they came.
#[derive(Debug, Default)]
struct Waiting(Mutex<Vec<Guest>>);

#[derive(Debug)]
struct Guest {
    peer: SocketAddr,
    task: AbortHandle,
    /// It said who it is, and was welcomed.
    has_spoken: bool,
}

/// Who gives way to one more from `newcomer`, if anybody must: of the address where most wait, who has said nothing for the longest,
/// or else who has said hello for the longest and has not armed.
fn gives_way(all: &[Guest], newcomer: IpAddr) -> Option<usize> {
    let waiting = |ip: IpAddr| all.iter().filter(|guest| guest.peer.ip() == ip).count();
    let crowd = if waiting(newcomer) >= MOST_OF_ONE {
        newcomer
    } else if all.len() >= MOST_WAITING {
        let addresses = all.iter().map(|guest| guest.peer.ip());
        addresses.max_by_key(|ip| waiting(*ip))?
    } else {
        return None;
    };
    let at_home = |guest: &Guest| guest.peer.ip() == crowd;
    let silent = all
        .iter()
        .position(|guest| at_home(guest) && !guest.has_spoken);
    silent.or_else(|| all.iter().position(at_home))
}

impl Waiting {
    fn all(&self) -> MutexGuard<'_, Vec<Guest>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes room for `peer`; who was sent away for it.
    fn make_room(&self, peer: SocketAddr) -> Option<SocketAddr> {
        let mut all = self.all();
        let guest = gives_way(&all, peer.ip()).map(|index| all.remove(index))?;
        guest.task.abort();
        Some(guest.peer)
    }

    fn enter(&self, peer: SocketAddr, task: AbortHandle) {
        self.all().push(Guest {
            peer,
            task,
            has_spoken: false,
        });
    }

    fn has_spoken(&self, peer: SocketAddr) {
        let mut all = self.all();
        if let Some(guest) = all.iter_mut().find(|guest| guest.peer == peer) {
            guest.has_spoken = true;
        }
    }

    fn leave(&self, peer: SocketAddr) {
        self.all().retain(|guest| guest.peer != peer);
    }
}

/// Accepts for as long as the runtime lives.
pub(super) async fn accept(listener: TcpListener, desk: Arc<Desk>) {
    let waiting = Arc::new(Waiting::default());
    loop {
        match listener.accept().await {
            Ok((stream, peer)) => {
                if let Some(peer) = waiting.make_room(peer) {
                    let text = "it had not armed when more came than may wait: it gave way";
                    desk.complain(peer, text.to_owned());
                }
                let (desk, theirs) = (Arc::clone(&desk), Arc::clone(&waiting));
                let task = tokio::spawn(async move {
                    attend(stream, peer, &desk, &theirs).await;
                    theirs.leave(peer);
                });
                // On this thread: it has not begun yet.
                waiting.enter(peer, task.abort_handle());
            }
            Err(_) => tokio::time::sleep(ACCEPT_PAUSE).await,
        }
    }
}

/// Why a connection ended before it was armed.
enum Ended {
    /// It closed, or said goodbye.
    Gone,
    /// It was turned away, with these last bytes.
    Refused(String, Vec<u8>),
    /// It was turned away for nonsense, with these last bytes.
    Nonsense(String, Vec<u8>),
}

impl From<Lost> for Ended {
    fn from(lost: Lost) -> Self {
        match lost {
            Lost::Gone => Ended::Gone,
            Lost::Tls(text) => Ended::Nonsense(text, Vec::new()),
        }
    }
}

async fn attend(stream: TcpStream, peer: SocketAddr, desk: &Desk, waiting: &Waiting) {
    let let_in = Caller::let_in(stream, desk.tls.as_ref());
    let ended = match timeout(HELLO_LIMIT, let_in).await {
        Ok(Ok(caller)) => return greet(caller, peer, desk, waiting).await,
        Ok(Err(lost)) => lost.into(),
        Err(_) => silent("end of the TLS handshake", HELLO_LIMIT),
    };
    if let Ended::Refused(text, _) | Ended::Nonsense(text, _) = ended {
        desk.complain(peer, text);
    }
}

async fn greet(mut stream: Caller, peer: SocketAddr, desk: &Desk, waiting: &Waiting) {
    let mut inbox = Inbox::new(true);
    let outcome = async {
        let greeted = match timeout(HELLO_LIMIT, hello(&mut stream, &mut inbox, desk)).await {
            Ok(outcome) => outcome?,
            Err(_) => return Err(silent("hello", HELLO_LIMIT)),
        };
        waiting.has_spoken(peer);
        desk.tell(Heard::Hello {
            peer,
            software: greeted.software.clone(),
            test: greeted.test.clone(),
        });
        match timeout(ARM_LIMIT, arming(&mut stream, &mut inbox, desk, greeted)).await {
            Ok(outcome) => outcome,
            Err(_) => Err(silent("arm message", ARM_LIMIT)),
        }
    };
    let last = match outcome.await {
        Ok((greeted, arm)) => return hand_over(stream, peer, desk, inbox, greeted, arm),
        Err(Ended::Gone) => return,
        Err(Ended::Refused(text, last)) => {
            desk.tell(Heard::Refused { peer, text });
            last
        }
        Err(Ended::Nonsense(text, last)) => {
            desk.complain(peer, text);
            last
        }
    };
    // A peer that does not take the reason does without it.
    let _ = timeout(HELLO_LIMIT, async {
        let _ = stream.write_all(&last).await;
        stream.shutdown().await;
    })
    .await;
}

fn silent(what: &str, limit: Duration) -> Ended {
    let text = format!("no {what} within {} s", limit.as_secs());
    Ended::Nonsense(text, Vec::new())
}

/// The next whole frame of the stream, given to `open`.
async fn next<R>(
    stream: &mut Caller,
    inbox: &mut Inbox,
    mut open: impl FnMut(&[u8]) -> Result<Option<R>, Ended>,
) -> Result<R, Ended> {
    loop {
        while let Some(place) = inbox.next().map_err(malformed)? {
            if let Some(found) = open(inbox.frame(place))? {
                return Ok(found);
            }
        }
        let count = stream.read(inbox.space()).await?;
        inbox.filled(count);
    }
}

fn malformed(error: WireError) -> Ended {
    if let WireError::Magic { found, .. } = error
        && is_client_hello(&found)
    {
        // What a TLS client understands is that this is none.
        let text = "it speaks TLS, and plain TCP is served here (--transport tls)";
        return Ended::Nonsense(
            text.to_owned(),
            greet::refusal(greet::nonsense(error), None),
        );
    }
    let refuse = greet::nonsense(error);
    let text = refuse.text.clone();
    Ended::Nonsense(text, greet::refusal(refuse, None))
}

fn refused(refuse: crate::wire::handshake::Refuse) -> Ended {
    let text = refuse.text.clone();
    Ended::Refused(text, greet::refusal(refuse, None))
}

async fn hello(stream: &mut Caller, inbox: &mut Inbox, desk: &Desk) -> Result<Greeted, Ended> {
    let mut decoder = Decoder::greeting(Side::Controller);
    let greeted = next(stream, inbox, |frame| {
        let received = decoder.open(frame).map_err(malformed)?;
        let Frame::Control(message) = received.frame else {
            return Ok(None);
        };
        greet::judge(desk, message).map(Some).map_err(refused)
    })
    .await?;
    stream.write_all(&greeted.welcome).await?;
    Ok(greeted)
}

/// Waits for the request to arm; on return the specimen is reserved for this controller, which is still owed an answer.
async fn arming(
    stream: &mut Caller,
    inbox: &mut Inbox,
    desk: &Desk,
    mut greeted: Greeted,
) -> Result<(Greeted, Arm), Ended> {
    let arm = next(stream, inbox, |frame| {
        let received = greeted.decoder.open(frame).map_err(malformed)?;
        let Frame::Control(message) = received.frame else {
            return Ok(None);
        };
        let outcome = match greeted.arming(message) {
            Ok(Some(_)) if !desk.take() => Err(greet::busy()),
            Ok(Some(arm)) => return Ok(Some(arm)),
            Ok(None) => return Err(Ended::Gone),
            Err(refuse) => Err(refuse),
        };
        outcome.map_err(|refuse| {
            let text = refuse.text.clone();
            Ended::Refused(text, greet::refusal(refuse, Some(&mut greeted.encoder)))
        })
    })
    .await?;
    Ok((greeted, arm))
}

fn hand_over(
    stream: Caller,
    peer: SocketAddr,
    desk: &Desk,
    inbox: Inbox,
    greeted: Greeted,
    arm: Arm,
) {
    let line = stream.into_line();
    match line {
        Ok(line) => Session::start(desk, line, inbox, peer, greeted, arm),
        Err(text) => {
            desk.give_back();
            desk.tell(Heard::Refused { peer, text });
        }
    }
}
