//! The opening of a native session: the specimen gets ready, and then the client learns that it is armed.
//!
//! A client that leaves meanwhile, or a stop request, ends the opening.

use super::ServerEvent;
use super::channel::{Channel, said_goodbye};
use super::hosted::Host;
use super::native_handshake::NativeOpening;
use super::native_session::NativeConversation;
use super::session::Session;
use super::shared::Shared;
use crate::Transport;
use crate::served::{Controller, ServedSpecimen, TestEnd};
use crate::socket::LOOK;
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::time::Nanos;
use gusset_record::rt::throttle::Throttle;
use gusset_wire::handshake::{self, Control};
use gusset_wire::native::Frame;

/// Over UDP a client repeats its Arm until it is answered. A client that is silent for this time, and for the time of its
/// watchdog, is lost: many repetitions would have been lost in a row.
const SILENT_NS: u64 = 2_000_000_000;

/// The processor and the busy loop of the data thread.
#[derive(Debug, Clone, Copy)]
pub(super) struct DataThread {
    pub cpu: Option<usize>,
    pub spin_ns: u64,
}

impl DataThread {
    /// The busy loop for this period, ns. A thread with a reserved processor leaves the kernel its share of it.
    fn spin_ns(self, period_ns: u64) -> u64 {
        match self.cpu {
            None => self.spin_ns,
            Some(_) => {
                let around = self.spin_ns.saturating_mul(2);
                Throttle::USUAL.fit_spin(around, period_ns) / 2
            }
        }
    }
}

/// Gets the specimen ready and arms it. Otherwise reports why the test does not begin, and returns its channel.
pub(super) fn open(
    mut channel: Channel,
    mut opening: NativeOpening,
    host: &Host,
    thread: DataThread,
    shared: &Shared,
) -> Result<Session<NativeConversation>, Box<Channel>> {
    if let Some(script) = &host.faults {
        let text = script.words();
        shared.tell(ServerEvent::Told { text });
        channel.link = channel.link.played(
            script,
            opening.greeted.period_ns,
            opening.arm.first_sequence,
        );
    }
    let peer = channel.peer;
    let mut served = match begin(&mut channel, &mut opening, host, thread, shared) {
        Ok(served) => served,
        Err((text, is_lost)) => {
            let frame = opening.greeted.not_armed(&text, is_lost);
            // A client that does not receive it sees the connection close.
            let _ = channel.link.send(&frame);
            shared.tell(ServerEvent::Refused { peer, text });
            return Err(Box::new(channel));
        }
    };
    let armed = opening.greeted.armed(opening.arm.clone());
    if let Err(fault) = channel.link.send(&armed) {
        let text = fault.to_string();
        served.end(Cause::ControllerVanished, &text);
        shared.tell(ServerEvent::Refused { peer, text });
        return Err(Box::new(channel));
    }
    shared.tell(ServerEvent::Armed {
        peer,
        test: opening.greeted.test.clone(),
    });
    let spin_ns = thread.spin_ns(opening.greeted.period_ns);
    let now = channel.now();
    let starts_anew = host.starts_anew();
    let conversation = NativeConversation::new(opening, served, now, spin_ns, starts_anew);
    Ok(Session::new(channel, conversation))
}

/// The specimen of an armed test; or why it is not armed, and whether it was lost.
fn begin(
    channel: &mut Channel,
    opening: &mut NativeOpening,
    host: &Host,
    thread: DataThread,
    shared: &Shared,
) -> Result<ServedSpecimen, (String, bool)> {
    let mut served = host.specimen(false).map_err(|text| (text, false))?;
    served.keep_record_away_from(thread.cpu);
    served.now_is(channel.now());
    let controller = controller(channel, opening);
    let mut heard_at = channel.now();
    let mut wanted = || is_wanted(channel, opening, &mut heard_at, shared);
    let told = served.begin(&controller, &mut wanted);
    for text in told.map_err(|over| (over.text, served.has_lost_it()))? {
        shared.tell(ServerEvent::Told { text });
    }
    Ok(served)
}

fn controller(channel: &Channel, opening: &NativeOpening) -> Controller {
    let NativeOpening { greeted, arm, .. } = opening;
    Controller {
        peer: channel.peer,
        test: greeted.test.clone(),
        software: greeted.software.clone(),
        rate: Some(greeted.rate),
        watchdog_s: Some(greeted.watchdog_s),
        sampling: greeted.sampling,
        first_sequence: arm.first_sequence,
        start: arm.disp.clone(),
        limits: greeted.limits.clone(),
    }
}

/// Checks that the client is still connected and that the server does not stop. Before it is armed, other messages of the client are
/// repeated questions and signs of life.
fn is_wanted(
    channel: &mut Channel,
    opening: &mut NativeOpening,
    heard_at: &mut Nanos,
    shared: &Shared,
) -> Result<(), TestEnd> {
    if shared.is_stopped_at_once() {
        return Err(TestEnd::told_to_stop_at_once());
    }
    if shared.is_stopped() {
        return Err(TestEnd::told_to_stop());
    }
    let NativeOpening { inbox, greeted, .. } = opening;
    let is_stream = inbox.is_stream();
    match channel.link.recv(inbox.space(), LOOK) {
        Ok(count) => inbox.filled(count.unwrap_or(0)),
        Err(fault) => return Err(channel.lost(is_stream, fault)),
    }
    loop {
        let place = match inbox.next() {
            Ok(Some(place)) => place,
            Ok(None) => break,
            Err(error) if is_stream => return Err(TestEnd::failed(error)),
            // A datagram of a stranger.
            Err(_) => continue,
        };
        match greeted.decoder.open(inbox.frame(place)) {
            Ok(received) => {
                *heard_at = channel.now();
                if let Some(over) = parting(&received.frame) {
                    return Err(over);
                }
            }
            Err(error) if is_stream => return Err(TestEnd::failed(error)),
            Err(_) => {}
        }
    }
    // Without a connection only its silence shows that a client is lost.
    let silent_ns = channel.now().since(*heard_at);
    if is_stream || silent_ns < SILENT_NS.max(greeted.watchdog_ns) {
        return Ok(());
    }
    Err(channel.silent(silent_ns))
}

/// The end of the opening, if this frame is a goodbye.
fn parting(frame: &Frame<'_>) -> Option<TestEnd> {
    let over = match frame {
        Frame::Retire(notice) | Frame::Goodbye(notice) => said_goodbye(notice.cause.code(), ""),
        Frame::Control(message) => match handshake::decode(message) {
            Ok(Control::Bye(bye)) => said_goodbye(bye.cause, &bye.text),
            _ => return None,
        },
        _ => return None,
    };
    // Nothing was completed: the client was not armed.
    let cause = match over.cause {
        Cause::Done => Cause::Operator,
        cause => cause,
    };
    Some(TestEnd { cause, ..over })
}
