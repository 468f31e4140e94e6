//! The session of one client of OpenFresco's protocols, from its sizes to its end.
//!
//! When a client disconnects, a computed specimen stays at its last committed state, and a physical one where it is.
//! After the stop request no message is carried out any more. Each message is answered by one write, with
//! acknowledgements that are not delayed. An exchange allocates nothing after the sizes, except that TLS encrypts.

use super::ServerEvent;
use super::channel::Channel;
use super::connection::ClientLink;
use super::openfresco_handshake::OpenFrescoOpening;
use super::session::{Conversation, Session};
use super::shared::Shared;
use crate::Transport;
use crate::openfresco::{
    Codec, End, ExchangeFault, Host, HostFault, Nature, Remarks, Request, ServeSettings, Tally,
    lost,
};
use crate::served::{Controller, TestEnd};
use crate::socket::LOOK;
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::time::Nanos;
use gusset_record::rt::os::monotonic_ns;
use gusset_wire::openfresco::{Action, Course, Sizes, datagrams};

/// After its goodbye the client has this time to close first.
const LINGER_NS: u64 = 500_000_000;
/// Longest piece that is read at once; no datagram is longer.
const CHUNK: usize = 65_536;
/// The limits of time are checked this often.
const LOOK_NS: u64 = 50_000_000;

/// The conversation with one client.
pub(super) struct OpenFrescoConversation<'a> {
    codec: Codec,
    host: &'a mut Host,
    settings: &'a ServeSettings,
    is_stream: bool,
    remarks: Remarks,
    /// Bytes that came while the specimen got ready.
    early: Vec<Vec<u8>>,
    buffer: Vec<u8>,
    /// Bytes of the buffer that were received and not read.
    received: usize,
    ahead: Ahead,
    heard_ns: u64,
    look_ns: u64,
}

/// Bytes of a stream that came during the specimen's path to a target.
struct Ahead {
    buffer: Vec<u8>,
    received: usize,
}

/// Why a specimen comes to rest on its path to a target.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Interruption {
    /// The client is lost, or does not wait for answers.
    Ended(End),
    /// The goodbye of the client has come.
    Goodbye,
}

/// Targets that may wait behind the present one. AlphaOS sends two at the end of a step and one of the next step without a
/// request.
const MOST_WAITING: usize = 3;

impl Ahead {
    /// Keeps the bytes of a stream, as far as there is room. `rest` came with the target, and each message has `length` bytes.
    /// Real-time: yes.
    ///
    /// # Errors
    /// Why the specimen must come to rest.
    fn look(
        &mut self,
        link: &mut ClientLink,
        rest: &[u8],
        length: usize,
    ) -> Result<(), Interruption> {
        // Its last bytes came before it closed, and are read first.
        let mut gone = link.has_hung_up().then(|| lost(link, LinkFault::Closed));
        loop {
            let room = self.buffer.get_mut(self.received..).unwrap_or_default();
            if room.is_empty() {
                break;
            }
            match link.recv(room, LOOK) {
                Ok(None) => break,
                Ok(Some(count)) => self.received += count,
                Err(fault) => {
                    gone = Some(lost(link, fault));
                    break;
                }
            }
        }
        let came = self.buffer.get(..self.received).unwrap_or_default();
        let (mut waiting, mut has_asked) = (0, false);
        for action in actions([rest, came], length) {
            match action {
                Some(Action::Die) => return Err(Interruption::Goodbye),
                Some(Action::Trial) => waiting += 1,
                Some(Action::Read(_) | Action::Give(_)) => has_asked = true,
                _ => {}
            }
            // A client waits for the answer to each request.
            let is_behind = has_asked && action == Some(Action::Trial);
            if is_behind || waiting > MOST_WAITING {
                let fault = ExchangeFault::TooFarAhead;
                return Err(Interruption::Ended(End::Refused(fault)));
            }
        }
        gone.map_or(Ok(()), |end| Err(Interruption::Ended(end)))
    }
}

/// The actions of messages of `length` bytes in two pieces of a stream. Real-time: yes.
fn actions(pieces: [&[u8]; 2], length: usize) -> impl Iterator<Item = Option<Action>> {
    let [first, second] = pieces;
    let byte = move |at: usize| {
        let behind = at.checked_sub(first.len());
        behind
            .map_or_else(|| first.get(at), |at| second.get(at))
            .copied()
    };
    let lead = move |message: usize| {
        let at = message.checked_mul(length)?;
        let mut word = [0; 8];
        for (to, at) in word.iter_mut().zip(at..) {
            *to = byte(at)?;
        }
        Some(f64::from_le_bytes(word))
    };
    (0..)
        .map_while(lead)
        .map(|code| Action::exact(code).ok().flatten())
}

/// Serves a client whose handshake is complete.
pub(super) fn attend(
    mut channel: Channel,
    opening: OpenFrescoOpening,
    host: &mut Host,
    settings: &ServeSettings,
    is_stream: bool,
    shared: &Shared,
) {
    let OpenFrescoOpening {
        codec,
        sizes,
        early,
    } = opening;
    let mut conversation = OpenFrescoConversation {
        codec,
        host,
        settings,
        is_stream,
        remarks: Remarks::of(settings.role, &sizes),
        early,
        buffer: vec![0; CHUNK],
        received: 0,
        ahead: Ahead {
            buffer: vec![0; CHUNK],
            received: 0,
        },
        heard_ns: monotonic_ns(),
        look_ns: 0,
    };
    match conversation.begin(sizes, &mut channel, shared) {
        Ok(()) => Session::new(channel, conversation).run(shared),
        Err(end) => {
            Session::new(channel, conversation).finish(end, shared);
        }
    }
}

impl OpenFrescoConversation<'_> {
    /// Gets the specimen ready. Messages of the client are kept meanwhile. A peer that only connects must not make a specimen
    /// move, so this happens after the sizes.
    fn begin(&mut self, sizes: Sizes, channel: &mut Channel, shared: &Shared) -> Result<(), End> {
        let peer = channel.peer;
        shared.tell(ServerEvent::Sizes(peer, sizes));
        let mut unwanted = None;
        let (buffer, early) = (&mut self.buffer, &mut self.early);
        let mut wanted = || {
            let end = if shared.is_stopped() {
                End::Stopped
            } else {
                match receive_early(&mut channel.link, buffer, early) {
                    Ok(()) => return Ok(()),
                    Err(fault) => lost(&channel.link, fault),
                }
            };
            unwanted = Some(end);
            let (cause, text) = (end.cause(), end.to_string());
            Err(TestEnd {
                is_at_once: shared.is_stopped_at_once(),
                ..TestEnd::of(cause, text)
            })
        };
        let begun = self.host.begin(&Controller::unnamed(peer), &mut wanted);
        let told = begun.map_err(|over| {
            unwanted.unwrap_or_else(|| {
                shared.tell(ServerEvent::Told { text: over.text });
                HostFault::Unavailable.into()
            })
        })?;
        for text in told {
            shared.tell(ServerEvent::Told { text });
        }
        for bytes in std::mem::take(&mut self.early) {
            self.take(&bytes, channel, shared)?;
        }
        self.heard_ns = monotonic_ns();
        self.look_ns = self.heard_ns + LOOK_NS;
        Ok(())
    }

    /// Obeys the requests in some bytes, up to the stop request. The goodbye is an error. Real-time: yes, after the sizes.
    fn take(&mut self, bytes: &[u8], channel: &mut Channel, shared: &Shared) -> Result<(), End> {
        let mut rest = bytes;
        while !rest.is_empty() {
            if shared.is_stopped() {
                return Err(End::Stopped);
            }
            let (used, request) = self.codec.feed(rest).map_err(ExchangeFault::Wire)?;
            let piece = if self.is_stream {
                usize::MAX
            } else {
                self.codec.inbox().piece()
            };
            rest = rest.get(used..).unwrap_or_default();
            let mut interruption = None;
            let length = self.codec.inbox().message().len();
            // Nothing shows that a client of datagrams is lost.
            let looks = self.is_stream && self.host.is_paced();
            let moves = self.is_stream && self.host.nature() == Nature::Physical;
            let (link, ahead) = (&mut channel.link, &mut self.ahead);
            if moves
                && !looks
                && matches!(request, Request::Command(_))
                && link.has_hung_up()
                && let Err(Interruption::Ended(end)) = ahead.look(link, rest, length)
            {
                return Err(end);
            }
            let mut wanted = || {
                if looks && interruption.is_none() {
                    interruption = ahead.look(link, rest, length).err();
                }
                interruption.is_none() && !shared.is_stopped()
            };
            let obeyed = obey(&mut self.codec, request, self.host, &mut wanted);
            let reply = match (obeyed, interruption) {
                (Err(End::Stopped), Some(Interruption::Ended(end))) => return Err(end),
                (Err(End::Stopped), Some(Interruption::Goodbye)) => {
                    return Err(self.leave(rest, channel));
                }
                (obeyed, _) => obeyed?,
            };
            send(&mut channel.link, reply, piece)?;
            match request {
                Request::Sizes(sizes) => shared.tell(ServerEvent::Sizes(channel.peer, sizes)),
                Request::InitLine => shared.tell(ServerEvent::InitLine),
                Request::Unknown(code) => shared.tell(ServerEvent::UnknownAction(code)),
                Request::Command(_) if self.codec.is_reset() => {
                    if let Some(remark) = self.remarks.reset() {
                        self.host.warn(remark);
                    }
                }
                Request::Goodbye => return Err(End::Finished),
                _ => {}
            }
            if let Some(remark) = self.remarks.after(self.host.tally()) {
                self.host.warn(remark);
            }
            if used == 0 {
                break;
            }
        }
        Ok(())
    }

    /// The client sent a goodbye during the specimen's path, which rests now. `rest` and the bytes read ahead are passed over up
    /// to the goodbye, which may have an answer.
    fn leave(&mut self, rest: &[u8], channel: &mut Channel) -> End {
        let came = self.ahead.buffer.get(..self.ahead.received);
        for mut bytes in [rest, came.unwrap_or_default()] {
            while let Ok((used @ 1.., request)) = self.codec.feed(bytes) {
                if request == Request::Goodbye {
                    // A client that does not take the answer is lost all the same.
                    let _ = send(&mut channel.link, self.codec.goodbye(), usize::MAX);
                    return End::Finished;
                }
                bytes = bytes.get(used..).unwrap_or_default();
            }
        }
        End::Finished
    }

    /// Everything that happens because time passes.
    fn keep_time(&mut self, shared: &Shared) -> Result<(), End> {
        let now = monotonic_ns();
        if now < self.look_ns {
            return Ok(());
        }
        self.look_ns = now + LOOK_NS;
        let silent_s = now.saturating_sub(self.heard_ns) as f64 * 1e-9;
        let limit = self.settings.takeover_s;
        if silent_s > limit && shared.has_successor(self.heard_ns) {
            return Err(End::Replaced(limit));
        }
        self.host.attend()?;
        match self.settings.idle_limit_s {
            Some(limit) if silent_s > limit => Err(End::Silent(limit)),
            _ => Ok(()),
        }
    }
}

impl Conversation for OpenFrescoConversation<'_> {
    type End = End;

    fn turn(&mut self, channel: &mut Channel, shared: &Shared) -> Result<Nanos, End> {
        if self.received == 0 && self.ahead.received > 0 {
            std::mem::swap(&mut self.buffer, &mut self.ahead.buffer);
            self.received = std::mem::take(&mut self.ahead.received);
        }
        let count = std::mem::take(&mut self.received);
        if count > 0 {
            self.heard_ns = monotonic_ns();
            let buffer = std::mem::take(&mut self.buffer);
            let bytes = buffer.get(..count).unwrap_or_default();
            let taken = self.take(bytes, channel, shared);
            self.buffer = buffer;
            taken?;
            // The client was not silent while it waited for the specimen.
            self.heard_ns = monotonic_ns();
        }
        self.keep_time(shared)?;
        let due = self.host.go_on()?;
        Ok(due.map_or(Nanos(self.look_ns), |due| due.min(Nanos(self.look_ns))))
    }

    fn listen(&mut self, channel: &mut Channel, until: Nanos) -> Result<(), End> {
        if self.ahead.received > 0 {
            return Ok(());
        }
        match channel.link.recv(&mut self.buffer, until) {
            Ok(count) => {
                self.received = count.unwrap_or(0);
                Ok(())
            }
            Err(fault) => Err(lost(&channel.link, fault).within(self.codec.inbox().partial())),
        }
    }

    fn stopped(&mut self, _channel: &mut Channel) -> End {
        // These protocols have no goodbye of a server.
        End::Stopped
    }

    fn finish(mut self, channel: &mut Channel, end: End, shared: &Shared) {
        self.host.come_to_rest();
        if end == End::Finished && self.is_stream {
            // The client closes first, so that a reset does not tear away its last answer.
            let until = Nanos(monotonic_ns() + LINGER_NS);
            while let Ok(Some(_)) = channel.link.recv(&mut self.buffer, until) {}
        }
        let tally = if self.host.has_begun() {
            self.host.tally()
        } else {
            Tally::default()
        };
        if let Some(remark) = self.remarks.at_end(tally) {
            self.host.warn(remark);
        }
        let whole = match end {
            End::Refused(ExchangeFault::Host(fault)) => self.host.whole(fault),
            end => end.to_string(),
        };
        self.host.end(end.cause(), &whole);
        // The link to the specimen may know more than the fault itself.
        if !end.to_string().contains(&whole) {
            shared.tell(ServerEvent::Told { text: whole });
        }
        if let Some(text) = self.host.next_step() {
            shared.tell(ServerEvent::Told { text });
        }
        shared.tell(ServerEvent::ClientLeft(channel.peer, end, tally));
    }
}

/// Obeys one request at the specimen. Returns the answer, which is empty for most requests. Real-time: yes, after the sizes.
fn obey<'a>(
    codec: &'a mut Codec,
    request: Request,
    host: &mut Host,
    wanted: &mut dyn FnMut() -> bool,
) -> Result<&'a [u8], End> {
    Ok(match request {
        Request::Reply => codec.reply(),
        Request::Command(course) => {
            let is_same_step = matches!(course, Course::Repeat | Course::Iteration);
            if codec.commits_implicitly() && !is_same_step && host.tally().commands > 0 {
                host.commit();
            }
            if let Some(target) = codec.target() {
                host.trial(course, &target.response, target.dt, wanted)
                    .map_err(|fault| match fault {
                        HostFault::Unwanted => End::Stopped,
                        fault => fault.into(),
                    })?;
            }
            &[]
        }
        Request::Commit => {
            host.commit();
            &[]
        }
        Request::Read => codec
            .answer(&host.response())
            .map_err(ExchangeFault::Wire)?,
        Request::Matrix(which) => codec
            .answer_matrix(host.matrix(which))
            .map_err(ExchangeFault::Wire)?,
        Request::Switch(is_on) => codec.answer_switch(is_on).map_err(ExchangeFault::Wire)?,
        Request::Goodbye => codec.goodbye(),
        Request::More | Request::Sizes(_) | Request::InitLine | Request::Unknown(_) => &[],
    })
}

/// Sends an answer: a stream in one write, datagrams in pieces of the client's size.
fn send(link: &mut ClientLink, reply: &[u8], piece: usize) -> Result<(), End> {
    for part in datagrams(reply, reply.len(), piece) {
        link.send(part).map_err(|fault| lost(link, fault))?;
    }
    Ok(())
}

/// Keeps messages that a client sends before its specimen is ready, as far as there is room.
fn receive_early(
    link: &mut ClientLink,
    buffer: &mut [u8],
    early: &mut Vec<Vec<u8>>,
) -> Result<(), LinkFault> {
    if early.iter().map(Vec::len).sum::<usize>() < CHUNK
        && let Some(count) = link.recv(buffer, LOOK)?
    {
        early.push(buffer.get(..count).unwrap_or_default().to_vec());
    }
    Ok(())
}

#[cfg(test)]
mod tests;
