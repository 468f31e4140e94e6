//! A force server that speaks OpenFresco: one client at a time, one test after another, until told to stop.
//!
//! Invariants: no wait is without a limit; who has not said what he wants keeps nobody out ([`super::hall`]); a client that
//! has gone (end of stream, a reset, a half-open connection, UDP silence) leaves a formula at its last committed state, what
//! moves where it is, and the port free; a computed specimen lets the next client wait, one that moves turns it away; after the word to stop nothing is carried out any more; every message is answered by
//! one write, with acknowledgements not delayed, and nothing is allocated for it once the sizes have come (but over TLS, where
//! encrypting allocates). What is not here: the meaning of bytes (`dialect`), of commands (`host`), and text on a terminal.

use std::net::SocketAddr;

use super::dialect::{ExchangeFault, Machine, Said};
use super::door::{Door, DoorError, Socket};
use super::guest::seconds;
use super::hall::{Client, Hall, LOOK_NS};
use super::host::{Host, HostFault};
use super::news::{End, News, lost};
use super::remarks::Remarks;
use super::settings::ServeSettings;
use super::tally::Tally;
use crate::link::Transport;
use crate::link::quota::{Allowance, Quota};
use crate::link::rig::{TestEnd, Visitor};
use crate::link::socket::LOOK;
use crate::rt::os::monotonic_ns;
use crate::substructure::LinkFault;
use crate::time::Nanos;
use crate::wire::openfresco::{Sizes, datagrams};

/// After the goodbye the client is given so long to close first.
const LINGER_NS: u64 = 500_000_000;
/// Longest chunk that is read at once; no datagram is longer.
const CHUNK: usize = 65_536;

/// Serves until `stop` says so; `tell` hears what happens.
///
/// # Errors
/// [`DoorError::Port`] if the port itself fails. How a client ends is not an error but [`News::Ended`].
pub fn serve_openfresco(
    door: &Door,
    host: &mut Host,
    settings: &ServeSettings,
    stop: &dyn Fn() -> bool,
    tell: &mut dyn FnMut(&News),
) -> Result<(), DoorError> {
    let mut buffer = vec![0; CHUNK];
    let mut waste = vec![0; CHUNK];
    let mut quotas: [Quota; News::KINDS] = Default::default();
    let tell = &mut |news: &News| tell_at_most(&mut quotas, news, tell);
    let mut hall = Hall::new(door, settings);
    while let Some(client) = hall.receive(host, stop, tell, &mut buffer)? {
        let peer = client.peer;
        let mut remarks = Remarks::of(settings.role, &client.sizes);
        let attendance = Attendance {
            door,
            hall: &mut hall,
            peer,
            settings,
            stop,
            tell,
            remarks: &mut remarks,
        };
        let end = attendance.attend(client, host, (&mut buffer, &mut waste));
        let tally = if host.has_begun() {
            host.tally()
        } else {
            Tally::default()
        };
        if let Some(remark) = remarks.at_end(tally) {
            host.warn(remark);
        }
        let whole = match end {
            End::Refused(ExchangeFault::Host(fault)) => host.whole(fault),
            end => end.to_string(),
        };
        host.end(end.cause(), &whole);
        // What is known of the specimen beyond the fault itself.
        let said = end.to_string();
        if !said.contains(&whole) {
            tell(&News::Told(peer, whole));
        }
        if let Some(next) = host.next_step() {
            tell(&News::Told(peer, next));
        }
        tell(&News::Ended(peer, end, tally));
    }
    Ok(())
}

/// Tells what is within the quota of its kind, and where more is not told.
fn tell_at_most(quotas: &mut [Quota], news: &News, tell: &mut dyn FnMut(&News)) {
    let Some(quota) = quotas.get_mut(news.kind()) else {
        return;
    };
    let Allowance { is_told, notice } = quota.take(monotonic_ns());
    if is_told {
        tell(news);
    }
    if let Some(text) = notice {
        let nobody = || ([0, 0, 0, 0], 0).into();
        tell(&News::Told(news.peer().unwrap_or_else(nobody), text));
    }
}

/// One client from its sizes to its end.
struct Attendance<'a, 'b> {
    door: &'a Door,
    hall: &'a mut Hall<'b>,
    peer: SocketAddr,
    settings: &'a ServeSettings,
    stop: &'a dyn Fn() -> bool,
    tell: &'a mut dyn FnMut(&News),
    remarks: &'a mut Remarks,
}

impl Attendance<'_, '_> {
    fn attend(
        mut self,
        client: Client,
        host: &mut Host,
        (buffer, waste): (&mut [u8], &mut [u8]),
    ) -> End {
        let Client {
            mut link,
            mut machine,
            sizes,
            early,
            ..
        } = client;
        let (link, machine) = (link.as_mut(), &mut machine);
        let mut heard_at = monotonic_ns();
        let mut look_at = heard_at + LOOK_NS;
        let mut early = early;
        if let Err(end) = self.begin(sizes, host, link, (buffer, &mut early)) {
            return end;
        }
        for bytes in early {
            match self.take(&bytes, link, machine, host) {
                Ok(false) => {}
                Ok(true) => return self.linger(link, buffer),
                Err(end) => return end,
            }
        }
        loop {
            match link.recv(buffer, Nanos(look_at)) {
                Ok(Some(count)) => {
                    heard_at = monotonic_ns();
                    let bytes = buffer.get(..count).unwrap_or_default();
                    match self.take(bytes, link, machine, host) {
                        Ok(false) => {}
                        Ok(true) => return self.linger(link, buffer),
                        Err(end) => return end,
                    }
                }
                Ok(None) => {}
                Err(fault) => return lost(link, fault).within(machine.partial()),
            }
            let now = monotonic_ns();
            if now < look_at {
                continue;
            }
            look_at = now + LOOK_NS;
            self.hall.meet_others(self.peer, host, self.tell, waste);
            if (self.stop)() {
                return End::Stopped;
            }
            let limit = self.settings.takeover_s;
            if seconds(now, heard_at) > limit && self.hall.has_successor(self.peer, heard_at) {
                return End::Replaced(limit);
            }
            if let Err(fault) = host.attend() {
                return fault.into();
            }
            if let Some(limit) = self.settings.idle_limit_s
                && seconds(now, heard_at) > limit
            {
                return End::Silent(limit);
            }
        }
    }

    /// The sizes have come: the test begins. What the client says meanwhile is kept in `early` for when it has.
    fn begin(
        &mut self,
        sizes: Sizes,
        host: &mut Host,
        link: &mut dyn Transport,
        (buffer, early): (&mut [u8], &mut Vec<Vec<u8>>),
    ) -> Result<(), End> {
        (self.tell)(&News::Ready(self.peer, sizes));
        let mut unwanted = None;
        let mut wanted = || {
            let end = if (self.stop)() {
                End::Stopped
            } else {
                match hear_early(link, buffer, early) {
                    Ok(()) => return Ok(()),
                    Err(fault) => lost(link, fault),
                }
            };
            unwanted = Some(end);
            let (cause, text) = (end.cause(), end.to_string());
            Err(TestEnd { cause, text })
        };
        // Only now: a stranger who merely connects must not make a specimen move.
        let begun = host.begin(&Visitor::unnamed(self.peer), &mut wanted);
        let told = begun.map_err(|over| {
            unwanted.unwrap_or_else(|| {
                (self.tell)(&News::Told(self.peer, over.text));
                HostFault::Unavailable.into()
            })
        })?;
        for text in told {
            (self.tell)(&News::Told(self.peer, text));
        }
        Ok(())
    }

    /// Does what some bytes say, up to the word to stop: what a client has queued is carried out no more then. True at the
    /// goodbye. Real-time: yes, after the sizes.
    fn take(
        &mut self,
        bytes: &[u8],
        link: &mut dyn Transport,
        machine: &mut Machine,
        host: &mut Host,
    ) -> Result<bool, End> {
        let mut rest = bytes;
        while !rest.is_empty() {
            if (self.stop)() {
                return Err(End::Stopped);
            }
            let piece = match self.door.socket {
                Socket::Tcp(_) => usize::MAX,
                Socket::Udp(_) => machine.piece(),
            };
            let mut wanted = || !(self.stop)();
            let heard = machine.hear(rest, host, &mut wanted);
            let heard = heard.map_err(|fault| match fault {
                ExchangeFault::Host(HostFault::Unwanted) => End::Stopped,
                fault => End::Refused(fault),
            })?;
            for part in datagrams(heard.reply, heard.reply.len(), piece) {
                if let Err(fault) = link.send(part) {
                    return Err(lost(link, fault));
                }
            }
            match heard.said {
                Said::Nothing => {}
                Said::Ready(sizes) => (self.tell)(&News::Ready(self.peer, sizes)),
                Said::InitLine => (self.tell)(&News::InitLine),
                Said::Ignored(code) => (self.tell)(&News::Ignored(code)),
                Said::Reset => {
                    if let Some(remark) = self.remarks.reset() {
                        host.warn(remark);
                    }
                }
                Said::Finished => return Ok(true),
            }
            let used = heard.used;
            if let Some(remark) = self.remarks.after(host.tally()) {
                host.warn(remark);
            }
            if used == 0 {
                break;
            }
            rest = rest.get(used..).unwrap_or_default();
        }
        Ok(false)
    }

    /// Lets the client close first, so that its last answer is not torn away by a reset.
    fn linger(self, link: &mut dyn Transport, buffer: &mut [u8]) -> End {
        if matches!(self.door.socket, Socket::Tcp(_)) {
            let until = Nanos(monotonic_ns() + LINGER_NS);
            while let Ok(Some(_)) = link.recv(buffer, until) {}
        }
        End::Finished
    }
}

/// What a client says before its specimen is ready, as far as there is room for it.
fn hear_early(
    link: &mut dyn Transport,
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
