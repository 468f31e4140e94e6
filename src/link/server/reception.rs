//! The thread that receives clients: it accepts them, leads their handshakes and hands over the first one that is ready.
//!
//! Several handshakes proceed at the same time, so a peer that only connects keeps no other client waiting.
//! No peer reaches the specimen or the data thread before its handshake is complete.
//! While a client is served, the protocol decides about the others.
//! The native protocol answers them that the server is busy.
//! OpenFresco's protocols have no such answer: a specimen that moves turns them away, because their commands would be old
//! later. A computed specimen lets them wait.
//! Each wait has a time limit, and [`super::admission`] limits the number of waiting clients.

use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::time::Duration;

use crossbeam_channel::Sender;

use super::ServerEvent;
use super::admission::{Candidate, gives_way};
use super::channel::Channel;
use super::connection::{ClientLink, Connection};
use super::greeter::{Greeter, Others};
use super::handshake::Opening;
use super::handshake_step::Step;
use super::listener::{Arrival, Listener, pause, probe_silence};
use super::shared::{Occupancy, Shared};
use super::waiting::{Route, WaitingClient};
use gusset_record::rt::os::monotonic_ns;
use gusset_wire::native::LARGEST_FRAME;

/// Longest wait for a socket: the stop flag and the time limits are checked this often.
const LOOK: Duration = Duration::from_millis(50);
/// Pause between two checks whether the specimen is free again.
const PAUSE: Duration = Duration::from_millis(10);
/// Pause after a failed accept, for instance when no file descriptors are left.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);
/// Arrivals that are received in one turn.
const MOST_ARRIVALS: u32 = 64;
/// Size of the largest UDP datagram.
const LARGEST_DATAGRAM: usize = 65_536;

/// A client whose handshake is complete, sent to the data thread.
pub(super) struct Client {
    pub channel: Channel,
    pub opening: Opening,
}

/// The receiving thread.
pub(super) struct Reception {
    listener: Listener,
    greeter: Greeter,
    shared: Arc<Shared>,
    clients: Sender<Client>,
    /// In order of arrival.
    waiting: Vec<WaitingClient>,
    /// The peer that was turned away last: it is reported once.
    turned_away: Option<SocketAddr>,
    buffer: Vec<u8>,
}

impl Reception {
    pub(crate) fn new(
        listener: Listener,
        greeter: Greeter,
        shared: Arc<Shared>,
        clients: Sender<Client>,
    ) -> Self {
        Self {
            listener,
            greeter,
            shared,
            clients,
            waiting: Vec::new(),
            turned_away: None,
            buffer: vec![0; LARGEST_DATAGRAM.max(LARGEST_FRAME + 1)],
        }
    }

    /// Receives clients until the server stops.
    pub(crate) fn run(mut self) {
        while !self.shared.is_stopped() {
            if self.shared.occupancy() == Occupancy::Free
                || self.greeter.others() == Others::AreAnswered
            {
                self.receive();
            } else {
                self.wait_until_free();
            }
        }
        for client in self.waiting.drain(..) {
            let failure = client.handshake().stopped();
            failure.report(client.peer(), &self.shared);
        }
    }

    /// One turn: received bytes, then each waiting client.
    fn receive(&mut self) {
        let fds = self.waiting.iter().filter_map(WaitingClient::fd);
        self.listener.wait(fds, LOOK);
        for _ in 0..MOST_ARRIVALS {
            match self.listener.next(&mut self.buffer) {
                Ok(Some(Arrival::Stream(stream, peer))) => self.accept(stream, peer),
                Ok(Some(Arrival::Datagram(count, peer))) => {
                    let datagram = self.buffer.get(..count).unwrap_or_default().to_vec();
                    self.take_datagram(&datagram, peer);
                }
                Ok(None) => break,
                Err(_) => {
                    pause(ACCEPT_PAUSE);
                    break;
                }
            }
            if self.is_closed_to_others() {
                return;
            }
        }
        self.attend_waiting();
    }

    /// True while a client is served whose protocol has no answer for others.
    fn is_closed_to_others(&self) -> bool {
        self.greeter.others() != Others::AreAnswered && self.shared.occupancy() != Occupancy::Free
    }

    fn attend_waiting(&mut self) {
        let mut index = 0;
        while let Some(client) = self.waiting.get_mut(index) {
            match client.attend(&self.listener, &self.shared, &mut self.buffer) {
                Ok(Step::More) => index += 1,
                Ok(Step::Complete) => {
                    let client = self.waiting.remove(index);
                    self.hand_over(client);
                    if self.is_closed_to_others() {
                        return;
                    }
                }
                Err(failure) => {
                    let client = self.waiting.remove(index);
                    failure.report(client.peer(), &self.shared);
                }
            }
        }
    }

    fn accept(&mut self, stream: TcpStream, peer: SocketAddr) {
        if !self.admits(peer) {
            return;
        }
        if self.greeter.is_openfresco() {
            self.shared.tell(ServerEvent::Connected(peer));
            // A kernel that refuses to probe serves all the same.
            let _ = probe_silence(&stream);
        }
        match self.listener.open(stream) {
            Ok(opened) => self.enter(peer, opened.into()),
            // The peer has already disconnected.
            Err(_) => self.greeter.handshake().left().report(peer, &self.shared),
        }
    }

    fn admits(&self, peer: SocketAddr) -> bool {
        let is_admitted = self.listener.admits(peer);
        if !is_admitted {
            self.shared.tell(ServerEvent::NotAdmitted(peer));
        }
        is_admitted
    }

    /// A datagram of the common socket.
    fn take_datagram(&mut self, datagram: &[u8], peer: SocketAddr) {
        if !self.admits(peer) {
            return;
        }
        for frame in self.shared.last_frames(peer, datagram) {
            let _ = self.listener.send_to(&frame, peer);
        }
        let known = self.waiting.iter_mut().find(|client| client.peer() == peer);
        if let Some(client) = known {
            client.keep(datagram, false);
            return;
        }
        if !self.greeter.allows(datagram) {
            self.shared.tell(ServerEvent::Stray(peer, datagram.len()));
            return;
        }
        if self.greeter.is_openfresco() {
            self.shared.tell(ServerEvent::Connected(peer));
        }
        let route = Route::Datagrams([datagram.to_vec()].into());
        let mut client = WaitingClient::new(peer, route, self.greeter.handshake());
        match client.attend(&self.listener, &self.shared, &mut self.buffer) {
            // The datagram of a stranger takes no place.
            Ok(Step::More) if !client.candidate().has_spoken => {}
            Ok(Step::More) => {
                self.make_room(peer);
                self.waiting.push(client);
            }
            Ok(Step::Complete) => self.hand_over(client),
            Err(failure) => failure.report(peer, &self.shared),
        }
    }

    fn enter(&mut self, peer: SocketAddr, route: Route) {
        self.make_room(peer);
        let client = WaitingClient::new(peer, route, self.greeter.handshake());
        self.waiting.push(client);
    }

    fn candidates(&self) -> Vec<Candidate> {
        self.waiting.iter().map(WaitingClient::candidate).collect()
    }

    fn make_room(&mut self, newcomer: SocketAddr) {
        if let Some(index) = gives_way(&self.candidates(), newcomer.ip()) {
            let client = self.waiting.remove(index);
            let failure = client.handshake().gave_way();
            failure.report(client.peer(), &self.shared);
        }
    }

    /// Gives a client to the data thread.
    fn hand_over(&mut self, client: WaitingClient) {
        let Some((peer, route, mut opening)) = client.into_parts() else {
            self.shared.release();
            return;
        };
        let connection = match route {
            Route::Connected(connection) => Ok(connection),
            Route::Datagrams(kept) => self.own_socket(peer, kept, &mut opening),
            Route::Encrypting(_) => Err("the TLS session is not complete".to_owned()),
        };
        let link = match connection {
            Ok(connection) => ClientLink::Plain(connection),
            Err(text) => {
                self.shared.release();
                self.shared.tell(ServerEvent::Refused { peer, text });
                return;
            }
        };
        if self.greeter.others() == Others::AreTurnedAway {
            for other in self.waiting.drain(..) {
                self.shared.tell(ServerEvent::TurnedAway(other.peer()));
            }
        }
        let channel = Channel { link, peer };
        let client = Client { channel, opening };
        // The reservation makes room in the queue certain; a lost data thread ends the server.
        if self.clients.try_send(client).is_err() {
            self.shared.release();
        }
    }

    /// The socket of a UDP client. The datagrams that came before it belong to the session, too.
    fn own_socket(
        &mut self,
        peer: SocketAddr,
        kept: impl IntoIterator<Item = Vec<u8>>,
        opening: &mut Opening,
    ) -> Result<Connection, String> {
        let mut connection = self.listener.own_socket(peer)?;
        let mut early: Vec<Vec<u8>> = kept.into_iter().collect();
        let mut others = Vec::new();
        while let Ok(Some(Arrival::Datagram(count, from))) = self.listener.next(&mut self.buffer) {
            let datagram = self.buffer.get(..count).unwrap_or_default().to_vec();
            if from == peer {
                early.push(datagram);
            } else {
                others.push((datagram, from));
            }
        }
        match opening {
            Opening::OpenFresco(openfresco) => {
                openfresco.early.extend(early);
                for (datagram, from) in others {
                    self.meet(&datagram, from, peer);
                }
            }
            // A native client repeats a message that was not answered.
            Opening::Native(_) => {
                for (datagram, from) in others {
                    self.take_datagram(&datagram, from);
                }
            }
        }
        if self.greeter.has_key() {
            crate::Transport::trust_only_frames(&mut connection);
        }
        Ok(connection)
    }

    /// While a client is served whose protocol has no answer for others.
    fn wait_until_free(&mut self) {
        self.turned_away = None;
        let mut look_ns = monotonic_ns() + LOOK.as_nanos() as u64;
        while !self.shared.is_stopped() {
            match self.shared.occupancy() {
                Occupancy::Free => break,
                // The others may be clients of the next test.
                Occupancy::Closing => {}
                Occupancy::Served(client) if monotonic_ns() >= look_ns => {
                    self.meet_others(client);
                    look_ns = monotonic_ns() + LOOK.as_nanos() as u64;
                }
                Occupancy::Served(_) => {}
            }
            pause(PAUSE);
        }
        for client in &mut self.waiting {
            client.restart();
        }
    }

    fn meet_others(&mut self, client: SocketAddr) {
        if self.greeter.others() == Others::Wait && self.listener.is_stream() {
            // They wait in the backlog of the port.
            return;
        }
        for _ in 0..MOST_ARRIVALS {
            match self.listener.next(&mut self.buffer) {
                Ok(Some(Arrival::Stream(_, peer))) => self.turn_away(peer),
                Ok(Some(Arrival::Datagram(count, peer))) => {
                    let datagram = self.buffer.get(..count).unwrap_or_default().to_vec();
                    self.meet(&datagram, peer, client);
                }
                Ok(None) | Err(_) => return,
            }
        }
    }

    /// A datagram of another peer while `client` is served.
    fn meet(&mut self, datagram: &[u8], peer: SocketAddr, client: SocketAddr) {
        let may_wait = self.greeter.others() == Others::Wait && peer.ip() == client.ip();
        if !(may_wait && self.keep(datagram, peer)) {
            self.turn_away(peer);
        }
    }

    fn turn_away(&mut self, peer: SocketAddr) {
        if self.turned_away.replace(peer) != Some(peer) {
            self.shared.tell(ServerEvent::TurnedAway(peer));
        }
    }

    /// Keeps a datagram until the specimen is free: one that opens a test, or a further one of a waiting client. False if it is
    /// neither.
    fn keep(&mut self, datagram: &[u8], peer: SocketAddr) -> bool {
        let opens = self.greeter.opens(datagram);
        let has_room = gives_way(&self.candidates(), peer.ip()).is_none();
        let known = self.waiting.iter_mut().find(|client| client.peer() == peer);
        let is_kept = match known {
            Some(client) => client.keep(datagram, opens),
            None if opens && has_room => {
                let route = Route::Datagrams([datagram.to_vec()].into());
                let client = WaitingClient::new(peer, route, self.greeter.handshake());
                self.waiting.push(client);
                true
            }
            None => false,
        };
        if is_kept && opens {
            self.shared.succeed(monotonic_ns());
        }
        is_kept
    }
}

#[cfg(test)]
mod tests {
    use crossbeam_channel::{Receiver, bounded, unbounded};

    use super::*;
    use crate::openfresco::{Nature, Role, ServeSettings};
    use crate::server::ServeOptions;
    use crate::server::listener::Access;
    use gusset_config as config;
    use gusset_wire::openfresco::Carrier;

    const PEER: ([u8; 4], u16) = ([127, 0, 0, 1], 9);

    /// The reception of a computed specimen of one axis over UDP, with its events.
    fn reception() -> (Reception, Receiver<ServerEvent>) {
        let options = ServeOptions {
            listen: "127.0.0.1:0".into(),
            carrier: config::Carrier::Udp,
            key: None,
            plan: None,
            spin_ns: 0,
        };
        let greeter = Greeter::OpenFresco {
            settings: ServeSettings::new(Role::Application, None),
            carrier: Carrier::Datagrams,
            axes: 1,
            nature: Nature::Simulated,
        };
        let listener = Listener::bind(&options, Access::default()).unwrap();
        let (events_in, events) = unbounded();
        let shared = Arc::new(Shared::new(events_in));
        let reception = Reception::new(listener, greeter, shared, bounded(1).0);
        (reception, events)
    }

    #[test]
    fn only_an_opening_datagram_makes_a_peer() {
        let (mut reception, _events) = reception();
        let peer = PEER.into();
        assert!(!reception.keep(&[7; 16], peer));
        assert!(reception.keep(b"a", peer));
        let heard_ns = monotonic_ns();
        assert!(!reception.shared.has_successor(heard_ns));
        assert!(reception.keep(&[7; 16], peer));
        assert!(!reception.shared.has_successor(heard_ns));
        assert!(reception.keep(b"a", peer));
        assert!(reception.shared.has_successor(heard_ns));
        assert!(!reception.shared.has_successor(monotonic_ns()));
        assert_eq!(reception.waiting.len(), 1);
    }

    #[test]
    fn a_repeated_hello_takes_one_place() {
        let (mut reception, _events) = reception();
        for _ in 0..200 {
            assert!(reception.keep(b"a", PEER.into()));
        }
        assert_eq!(reception.waiting[0].kept(), 1);
    }

    #[test]
    fn datagrams_of_one_peer_are_limited() {
        for is_served in [false, true] {
            let (mut reception, _events) = reception();
            for k in 0..200 {
                let datagram: &[u8] = if k == 0 { b"a" } else { &[7; 16] };
                if is_served {
                    assert!(reception.keep(datagram, PEER.into()));
                } else {
                    reception.take_datagram(datagram, PEER.into());
                }
            }
            assert_eq!(reception.waiting[0].kept(), 64);
        }
    }

    #[test]
    fn waiting_clients_are_limited() {
        let (mut reception, events) = reception();
        for port in 1..=40 {
            reception.take_datagram(b"a", (PEER.0, port).into());
        }
        assert_eq!(reception.waiting.len(), 16);
        let left = events
            .try_iter()
            .filter(|event| matches!(event, ServerEvent::ClientLeft(..)));
        assert_eq!(left.count(), 24);
    }
}
