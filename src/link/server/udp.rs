//! UDP: one socket hears everybody; a controller that arms gets a socket of its own on the same port, connected to it, so
//! that the datagrams of strangers never reach the data thread.

use std::collections::HashMap;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use tokio::net::UdpSocket;

use super::armed::Session;
use super::greet::{self, Greeted};
use super::line::Carried;
use super::{Desk, Heard};
use crate::link::inbox::Inbox;
use crate::link::socket::beside;
use crate::link::{SocketOptions, Transport, UdpTransport};
use crate::rt::os;
use crate::wire::handshake::{Arm, Refuse};
use crate::wire::native::{Decoder, Frame, LARGEST_FRAME};
use crate::wire::{Side, WireError};

/// Controllers that have been welcomed and not armed yet; the oldest of the address where most wait makes room.
const MOST_WAITING: usize = 64;
/// Of them at one address, where its own oldest makes room: one machine does not push out the others.
const MOST_OF_ONE: usize = 16;

/// A socket on `address` that hears everybody.
pub(super) fn bind(address: SocketAddr) -> io::Result<std::net::UdpSocket> {
    let socket = std::net::UdpSocket::bind(address)?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

struct Candidate {
    hello: Vec<u8>,
    since: u64,
    greeted: Greeted,
}

/// Hears everybody for as long as the runtime lives.
pub(super) async fn receive(socket: UdpSocket, desk: Arc<Desk>) {
    let mut buffer = vec![0; LARGEST_FRAME + 1];
    let mut candidates: HashMap<SocketAddr, Candidate> = HashMap::new();
    loop {
        let Ok((count, peer)) = socket.recv_from(&mut buffer).await else {
            // An error of an earlier datagram: its receiver is gone.
            tokio::task::yield_now().await;
            continue;
        };
        let datagram = buffer.get(..count).unwrap_or_default();
        let answer = hear(datagram, peer, &desk, &mut candidates, &socket);
        let last = match answer {
            Ok(answer) => answer,
            Err((refuse, last)) => {
                let text = refuse.text;
                // Nonsense of anybody, which is not answered, hides no controller that is turned away.
                if last.is_empty() {
                    desk.complain(peer, text);
                } else {
                    desk.tell(Heard::Refused { peer, text });
                }
                last
            }
        };
        for frame in desk.last_words(peer, datagram) {
            // It asks until it hears them.
            let _ = socket.send_to(&frame, peer).await;
        }
        if !last.is_empty() {
            // A lost answer is asked for again.
            let _ = socket.send_to(&last, peer).await;
        }
    }
}

/// What to send back; a refusal with its frame, which is empty where an answer would only help a stranger.
fn hear(
    datagram: &[u8],
    peer: SocketAddr,
    desk: &Desk,
    candidates: &mut HashMap<SocketAddr, Candidate>,
    socket: &UdpSocket,
) -> Result<Vec<u8>, (Refuse, Vec<u8>)> {
    let unsaid = |error: WireError| (greet::nonsense(error), Vec::new());
    let greeting = Decoder::greeting(Side::Controller)
        .open(datagram)
        .map(|r| r.frame);
    match greeting {
        Ok(Frame::Control(message)) => {
            if let Some(known) = candidates.get(&peer)
                && known.hello == message
            {
                return Ok(known.greeted.welcome.clone());
            }
            let greeted = greet::judge(desk, message)
                .map_err(|refuse| (refuse.clone(), greet::refusal(refuse, None)))?;
            desk.tell(Heard::Hello {
                peer,
                software: greeted.software.clone(),
                test: greeted.test.clone(),
            });
            let welcome = greeted.welcome.clone();
            make_room(candidates, peer);
            let candidate = Candidate {
                hello: message.to_vec(),
                since: os::monotonic_ns(),
                greeted,
            };
            candidates.insert(peer, candidate);
            Ok(welcome)
        }
        // Another version deserves an answer; the rest may be anything, with a forged sender.
        Err(error @ WireError::Version { .. }) => {
            let refuse = greet::nonsense(error);
            Err((refuse.clone(), greet::refusal(refuse, None)))
        }
        other => {
            let Some(candidate) = candidates.get_mut(&peer) else {
                return match other {
                    // The last words of a test that is over.
                    Err(WireError::Session { .. } | WireError::Keyed { .. }) | Ok(_) => {
                        Ok(Vec::new())
                    }
                    Err(error) => Err(unsaid(error)),
                };
            };
            let received = candidate.greeted.decoder.open(datagram).map_err(unsaid)?;
            let Frame::Control(message) = received.frame else {
                return Ok(Vec::new());
            };
            let outcome = match candidate.greeted.arming(message) {
                Ok(Some(_)) if !desk.take() => Err(greet::busy()),
                other => other,
            };
            match outcome {
                Ok(Some(arm)) => {
                    if let Some(candidate) = candidates.remove(&peer) {
                        hand_over(socket, peer, desk, candidate.greeted, arm);
                    }
                    Ok(Vec::new())
                }
                Ok(None) => {
                    candidates.remove(&peer);
                    Ok(Vec::new())
                }
                Err(refuse) => {
                    let encoder = Some(&mut candidate.greeted.encoder);
                    let last = greet::refusal(refuse.clone(), encoder);
                    candidates.remove(&peer);
                    Err((refuse, last))
                }
            }
        }
    }
}

/// Where there are too many, at the address of `peer` or in all, lets the oldest go: there, or where most wait.
fn make_room(candidates: &mut HashMap<SocketAddr, Candidate>, peer: SocketAddr) {
    let waiting = |ip: IpAddr| candidates.keys().filter(|other| other.ip() == ip).count();
    let crowd = if waiting(peer.ip()) >= MOST_OF_ONE {
        Some(peer.ip())
    } else if candidates.len() >= MOST_WAITING {
        let addresses = candidates.keys().map(SocketAddr::ip);
        addresses.max_by_key(|ip| waiting(*ip))
    } else {
        return;
    };
    let may_go = candidates
        .iter()
        .filter(|(other, _)| Some(other.ip()) == crowd);
    let oldest = may_go.min_by_key(|(_, candidate)| candidate.since);
    if let Some(oldest) = oldest.map(|(peer, _)| *peer) {
        candidates.remove(&oldest);
    }
}

/// The session has a socket of its own; from here on the kernel gives it the datagrams of its peer.
fn hand_over(socket: &UdpSocket, peer: SocketAddr, desk: &Desk, greeted: Greeted, arm: Arm) {
    let line = socket
        .local_addr()
        .and_then(|local| beside(socket, local, peer))
        .map_err(|error| error.to_string())
        .and_then(|own| {
            UdpTransport::from_socket(own, SocketOptions::default()).map_err(|e| e.to_string())
        })
        .map(|mut udp| {
            if desk.key.is_some() {
                udp.trust_only_frames();
            }
            Carried::Udp(udp).into()
        });
    match line {
        Ok(line) => {
            let inbox = Inbox::new(false);
            Session::start(desk, line, inbox, peer, greeted, arm);
        }
        Err(text) => {
            desk.give_back();
            desk.tell(Heard::Refused { peer, text });
        }
    }
}
