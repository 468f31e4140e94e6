//! The admission of waiting clients: how many may wait, and which one gives way to a newcomer.
//!
//! A client waits from its first byte until its handshake is complete. A handshake proves nothing, because it may be a copy
//! of another one. So the number of waiting clients is limited, in all and for each address. One machine cannot keep out
//! the others: a client of the address with the most waiting clients gives way.

use std::net::{IpAddr, SocketAddr};

/// Largest number of waiting clients.
pub(super) const MOST_WAITING: usize = 64;
/// Largest number of waiting clients of one address.
pub(super) const MOST_OF_ONE: usize = 16;

/// A waiting client, as the admission sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    pub peer: SocketAddr,
    /// The client sent something that its protocol allows.
    pub has_spoken: bool,
}

/// The place of the client that gives way to a newcomer, if one must. `all` is in order of arrival. The oldest silent client
/// gives way first.
pub(super) fn gives_way(all: &[Candidate], newcomer: IpAddr) -> Option<usize> {
    let waiting = |ip: IpAddr| all.iter().filter(|other| other.peer.ip() == ip).count();
    let crowd = if waiting(newcomer) >= MOST_OF_ONE {
        newcomer
    } else if all.len() >= MOST_WAITING {
        let addresses = all.iter().map(|other| other.peer.ip());
        addresses.max_by_key(|ip| waiting(*ip))?
    } else {
        return None;
    };
    let is_of_crowd = |other: &Candidate| other.peer.ip() == crowd;
    let silent = all
        .iter()
        .position(|other| is_of_crowd(other) && !other.has_spoken);
    silent.or_else(|| all.iter().position(is_of_crowd))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waiting(clients: &[(u8, bool)]) -> Vec<Candidate> {
        let candidate = |(machine, has_spoken): &(u8, bool)| Candidate {
            peer: ([10, 0, 0, *machine], 1).into(),
            has_spoken: *has_spoken,
        };
        clients.iter().map(candidate).collect()
    }

    #[test]
    fn oldest_silent_client_gives_way() {
        let newcomer = IpAddr::from([10, 0, 0, 9]);
        let few = waiting(&[(9, false); 15]);
        assert_eq!(gives_way(&few, newcomer), None);
        let mut own = waiting(&[(9, true); MOST_OF_ONE]);
        assert_eq!(gives_way(&own, newcomer), Some(0));
        own[3].has_spoken = false;
        assert_eq!(gives_way(&own, newcomer), Some(3));
        // The address of the newcomer is not the crowd.
        let clients: Vec<_> = (0..MOST_WAITING)
            .map(|k| (if k < 10 { 8 } else { k as u8 + 10 }, true))
            .collect();
        assert_eq!(gives_way(&waiting(&clients), newcomer), Some(0));
        assert_eq!(gives_way(&waiting(&clients[1..]), newcomer), None);
    }
}
