//! Between the port and the specimen: everybody who came and has not said in full what he wants. Several are greeted at the
//! same time, and the first whose greeting is complete is the client; so nobody who only connects keeps others waiting. The others
//! wait until a computed specimen is free again. A specimen that moves turns them away: their commands would be old by then.
//!
//! Invariants: nobody here reaches the specimen; there are never more than [`SEATS`], and where more come whoever has said
//! the least for the longest gives way; nobody stays longer than the set-up may take. Over UDP a guest is an address: he has
//! no socket of his own before he is the client.

use std::collections::VecDeque;
use std::net::{SocketAddr, TcpStream};

use super::dialect::{Machine, Said};
use super::door::{Caller, Door, DoorError, Socket, socket_to, stream_to, watch_over};
use super::guest::{Guest, Heard, Line};
use super::host::Host;
use super::news::{End, News};
use super::role::Nature;
use super::settings::ServeSettings;
use super::tally::Tally;
use crate::link::Transport;
use crate::link::socket::SocketOptions;
use crate::rt::os::monotonic_ns;
use crate::wire::openfresco::{Carrier, Sizes};

/// Most guests at a time.
const SEATS: usize = 16;
/// The server looks for strangers and for the word to stop this often.
pub(super) const LOOK_NS: u64 = 50_000_000;
/// From one look at the guests to the next, while there are any.
const GLANCE_NS: u64 = 1_000_000;
/// Datagrams of others that are read in one look while a client is served.
const MOST_READS: u32 = 8;
/// Datagrams that are kept of one peer that waits.
const MOST_LETTERS: usize = 64;

/// Whose greeting is complete.
pub(super) struct Client {
    pub peer: SocketAddr,
    pub link: Box<dyn Transport>,
    pub machine: Machine,
    pub sizes: Sizes,
    /// What he has said beyond it, in pieces as they came.
    pub early: Vec<Vec<u8>>,
}

/// Clients that came and are not served.
pub(super) struct Hall<'a> {
    door: &'a Door,
    settings: &'a ServeSettings,
    /// In the order in which they came.
    guests: Vec<Guest>,
    /// The peer that was turned away last, so that it is reported once.
    turned_away: Option<SocketAddr>,
}

impl<'a> Hall<'a> {
    /// An empty hall.
    pub(super) const fn new(door: &'a Door, settings: &'a ServeSettings) -> Self {
        Self {
            door,
            settings,
            guests: Vec::new(),
            turned_away: None,
        }
    }

    /// Waits for a client; returns none if `stop` becomes true first.
    ///
    /// # Errors
    /// [`DoorError::Port`] if the port itself fails.
    pub(super) fn receive(
        &mut self,
        host: &mut Host,
        stop: &dyn Fn() -> bool,
        tell: &mut dyn FnMut(&News),
        buffer: &mut [u8],
    ) -> Result<Option<Client>, DoorError> {
        self.turned_away = None;
        for guest in &mut self.guests {
            // Their bytes were not read while another client was served.
            guest.came_ns = monotonic_ns();
        }
        while !stop() {
            let wait_ns = if self.guests.is_empty() {
                LOOK_NS
            } else {
                GLANCE_NS
            };
            if let Some(caller) = self.door.wait(buffer, wait_ns)? {
                self.admit(caller, host, tell, buffer);
            }
            if let Some(client) = self.listen(host, tell, buffer)? {
                if host.nature() == Nature::Physical {
                    for guest in self.guests.drain(..) {
                        tell(&News::TurnedAway(guest.peer));
                    }
                }
                return Ok(Some(client));
            }
        }
        for guest in self.guests.drain(..) {
            tell(&News::Ended(guest.peer, End::Stopped, Tally::default()));
        }
        Ok(None)
    }

    /// What others send while `client` is served. A specimen that moves turns them away. A computed one lets them wait: TCP
    /// connections in the backlog of the port, UDP clients of the same machine here.
    pub(super) fn meet_others(
        &mut self,
        client: SocketAddr,
        host: &mut Host,
        tell: &mut dyn FnMut(&News),
        buffer: &mut [u8],
    ) {
        match (host.nature(), self.door.carrier()) {
            (Nature::Simulated, Carrier::Stream) => {}
            (Nature::Simulated, Carrier::Datagrams) => {
                // Bounded: a flood must not keep the client waiting.
                for _ in 0..MOST_READS {
                    let Ok(Some(Caller::Datagram(count, from))) = self.door.wait(buffer, 0) else {
                        return;
                    };
                    let letter = buffer.get(..count).unwrap_or_default();
                    if from.ip() != client.ip() || !self.keep(from, letter, host) {
                        self.turn_away(from, tell);
                    }
                }
            }
            (Nature::Physical, _) => {
                let door = self.door;
                door.turn_away(buffer, &mut |from| self.turn_away(from, tell));
            }
        }
    }

    /// True if a client of the same machine as `client` came after `heard_ns`, the time of its last bytes.
    pub(super) fn has_successor(&self, client: SocketAddr, heard_ns: u64) -> bool {
        let mut guests = self.guests.iter();
        guests.any(|guest| {
            guest.peer.ip() == client.ip()
                && guest.came_ns > heard_ns
                && matches!(guest.line, Line::Letters(_))
        })
    }

    fn turn_away(&mut self, from: SocketAddr, tell: &mut dyn FnMut(&News)) {
        if self.turned_away.replace(from) != Some(from) {
            tell(&News::TurnedAway(from));
        }
    }

    /// Keeps a datagram for later: one that opens a test, or a further one of a peer that waits. False if it is neither.
    fn keep(&mut self, from: SocketAddr, letter: &[u8], host: &mut Host) -> bool {
        // A separate machine judges it, so a stranger's datagram opens nothing.
        let mut machine = self.machine(host);
        let opens = machine
            .hear(letter, host, &mut || true)
            .is_ok_and(|heard| !heard.reply.is_empty() || matches!(heard.said, Said::Ready(_)));
        if let Some(guest) = self.guests.iter_mut().find(|guest| guest.peer == from) {
            if opens {
                // A peer that opens again is there: it may follow a client that has fallen silent since it first came.
                guest.came_ns = monotonic_ns();
            }
            return post(guest, letter, opens);
        }
        if !opens || self.guests.len() >= SEATS {
            return false;
        }
        self.guests.push(Guest {
            peer: from,
            line: Line::Letters(VecDeque::from([letter.to_vec()])),
            machine: self.machine(host),
            came_ns: monotonic_ns(),
            has_spoken: false,
        });
        true
    }

    /// Somebody came, or a datagram.
    fn admit(
        &mut self,
        caller: Caller,
        host: &mut Host,
        tell: &mut dyn FnMut(&News),
        buffer: &[u8],
    ) {
        let (Caller::Stream(_, peer) | Caller::Datagram(_, peer)) = caller;
        if !self.door.admits(peer) {
            tell(&News::NotAdmitted(peer));
            return;
        }
        let line = match caller {
            Caller::Stream(stream, _) => {
                tell(&News::Connected(peer));
                self.line_to(stream)
            }
            Caller::Datagram(count, _) => {
                let letter = buffer.get(..count).unwrap_or_default().to_vec();
                let mut guests = self.guests.iter_mut();
                if let Some(guest) = guests.find(|guest| guest.peer == peer)
                    && post(guest, &letter, false)
                {
                    return;
                }
                // Judged by a machine of its own: a stranger's datagram must open nothing.
                let mut machine = self.machine(host);
                if machine.hear(&letter, host, &mut || true).is_err() {
                    tell(&News::Stray(peer, count));
                    return;
                }
                tell(&News::Connected(peer));
                Ok(Line::Letters(VecDeque::from([letter])))
            }
        };
        match line {
            Ok(line) => {
                self.make_room(tell);
                self.guests.push(Guest {
                    peer,
                    line,
                    machine: self.machine(host),
                    came_ns: monotonic_ns(),
                    has_spoken: false,
                });
            }
            Err(end) => tell(&News::Ended(peer, end, Tally::default())),
        }
    }

    fn machine(&self, host: &Host) -> Machine {
        let ServeSettings {
            role, signal_order, ..
        } = *self.settings;
        Machine::new(role, signal_order, self.door.carrier(), host.axes())
    }

    fn line_to(&self, stream: TcpStream) -> Result<Line, End> {
        // A kernel that refuses to watch serves all the same.
        let _ = watch_over(&stream);
        match &self.door.tls {
            None => stream_to(stream)
                .map(|link| Line::Open(Box::new(link)))
                .ok(),
            Some(tls) => tls
                .accept(stream, SocketOptions::default())
                .map(|session| Line::Shaking(Box::new(session)))
                .ok(),
        }
        .ok_or(End::Vanished)
    }

    /// A seat for one more.
    fn make_room(&mut self, tell: &mut dyn FnMut(&News)) {
        if self.guests.len() < SEATS {
            return;
        }
        let silent = self.guests.iter().position(|guest| !guest.has_spoken);
        let guest = self.guests.remove(silent.unwrap_or(0));
        tell(&News::Ended(guest.peer, End::GaveWay, Tally::default()));
    }

    /// Hears every guest; the first whose greeting is complete.
    fn listen(
        &mut self,
        host: &mut Host,
        tell: &mut dyn FnMut(&News),
        buffer: &mut [u8],
    ) -> Result<Option<Client>, DoorError> {
        let mut index = 0;
        while let Some(guest) = self.guests.get_mut(index) {
            let limit_s = self.settings.setup_limit_s;
            match guest.hear(self.door, host, tell, buffer, limit_s) {
                Ok(Heard::Nothing) => index += 1,
                Ok(Heard::Ready(sizes, early)) => {
                    let guest = self.guests.remove(index);
                    return self.client(guest, sizes, early, tell, buffer);
                }
                Err(end) => {
                    let guest = self.guests.remove(index);
                    tell(&News::Ended(guest.peer, end, Tally::default()));
                }
            }
        }
        Ok(None)
    }

    fn client(
        &self,
        guest: Guest,
        sizes: Sizes,
        mut early: Vec<Vec<u8>>,
        tell: &mut dyn FnMut(&News),
        buffer: &mut [u8],
    ) -> Result<Option<Client>, DoorError> {
        let Guest {
            peer,
            line,
            machine,
            ..
        } = guest;
        let link: Box<dyn Transport> = match (line, &self.door.socket) {
            (Line::Open(link), _) => link,
            (Line::Letters(_), Socket::Udp(socket)) => {
                let link = socket_to(socket, peer)?;
                // What he sent before he had a socket of his own.
                while let Ok((count, from)) = socket.recv_from(buffer) {
                    if from == peer {
                        early.push(buffer.get(..count).unwrap_or_default().to_vec());
                    } else {
                        tell(&News::TurnedAway(from));
                    }
                }
                Box::new(link)
            }
            // Nobody is ready before his handshake is done, and letters come over UDP.
            (Line::Shaking(_), _) | (Line::Letters(_), Socket::Tcp(_)) => return Ok(None),
        };
        Ok(Some(Client {
            peer,
            link,
            machine,
            sizes,
            early,
        }))
    }
}

/// Keeps a further datagram of a peer that waits; false if its bytes do not come in datagrams. More than [`MOST_LETTERS`] are
/// dropped. One that opens a test and repeats the datagram before it needs no second place.
fn post(guest: &mut Guest, letter: &[u8], opens: bool) -> bool {
    let Line::Letters(letters) = &mut guest.line else {
        return false;
    };
    let is_again = opens && letters.back().is_some_and(|last| last == letter);
    if !is_again && letters.len() < MOST_LETTERS {
        letters.push_back(letter.to_vec());
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::openfresco::Role;
    use crate::specimen::SpecimenLaw;

    const PEER: ([u8; 4], u16) = ([127, 0, 0, 1], 9);

    /// Calls `test` with an empty hall over UDP.
    fn with_hall(test: impl FnOnce(&mut Hall<'_>, &mut Host)) {
        let law: SpecimenLaw =
            toml::from_str("law = { linear = { stiffness_n_per_m = 8000.0 } }").unwrap();
        let mut host = Host::new(law.build(1).unwrap(), Nature::Simulated, None);
        let door = Door::bind(Carrier::Datagrams, "127.0.0.1:0", []).unwrap();
        let settings = ServeSettings::new(Role::Application, None);
        test(&mut Hall::new(&door, &settings), &mut host);
    }

    #[test]
    fn a_peer_that_opens_again_came_later_and_one_that_says_other_things_did_not() {
        with_hall(|hall, host| {
            let peer = PEER.into();
            assert!(hall.keep(peer, b"a", host));
            let came_ns = hall.guests[0].came_ns;
            let heard_ns = monotonic_ns();
            assert!(!hall.has_successor(peer, heard_ns));
            assert!(hall.keep(peer, &[7; 16], host));
            assert_eq!(hall.guests[0].came_ns, came_ns);
            assert!(!hall.has_successor(peer, heard_ns));
            assert!(hall.keep(peer, b"a", host));
            assert!(hall.has_successor(peer, heard_ns));
            assert!(!hall.has_successor(peer, monotonic_ns()));
            assert_eq!(hall.guests.len(), 1);
        });
    }

    #[test]
    fn a_hello_that_is_repeated_takes_no_room_from_what_follows() {
        with_hall(|hall, host| {
            let peer = PEER.into();
            for _ in 0..200 {
                assert!(hall.keep(peer, b"a", host));
            }
            let Line::Letters(letters) = &hall.guests[0].line else {
                panic!("over UDP a guest has letters");
            };
            assert_eq!(letters.len(), 1);
        });
    }

    #[test]
    fn no_peer_fills_the_memory_while_it_waits_or_while_it_is_greeted() {
        for is_served in [false, true] {
            with_hall(|hall, host| {
                let peer = PEER.into();
                let mut buffer = vec![7; 16];
                buffer[0] = b'a';
                for k in 0..200 {
                    let count = if k == 0 { 1 } else { 16 };
                    if is_served {
                        assert!(hall.keep(peer, &buffer[..count], host));
                    } else {
                        let caller = Caller::Datagram(count, peer);
                        hall.admit(caller, host, &mut |_| {}, &buffer);
                    }
                }
                let Line::Letters(letters) = &hall.guests[0].line else {
                    panic!("over UDP a guest has letters");
                };
                assert_eq!(letters.len(), MOST_LETTERS);
            });
        }
    }
}
