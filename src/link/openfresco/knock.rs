//! From an accepted connection to a transport: with TLS, the handshake comes first, and has a time limit. Strangers are
//! turned away meanwhile, and the word to stop is heard.

use std::net::{SocketAddr, TcpStream};

use super::door::{Door, stream_to};
use super::news::{End, News};
use super::server::{LOOK_NS, ServeSettings};
use crate::link::Transport;
use crate::link::socket::SocketOptions;
use crate::link::tls::TlsFault;
use crate::rt::os::monotonic_ns;
use crate::time::Nanos;

/// Our end of a connection.
pub(super) fn line_to(
    door: &Door,
    stream: TcpStream,
    settings: &ServeSettings,
    stop: &dyn Fn() -> bool,
    tell: &mut dyn FnMut(&News),
    waste: &mut [u8],
) -> Result<Box<dyn Transport>, End> {
    let Some(tls) = &door.tls else {
        return match stream_to(stream) {
            Ok(link) => Ok(Box::new(link)),
            Err(_) => Err(End::Vanished),
        };
    };
    let mut session = tls
        .accept(stream, SocketOptions::default())
        .map_err(|_| End::Vanished)?;
    let until = Nanos(monotonic_ns()).plus((settings.setup_limit_s * 1e9) as u64);
    let mut last_stranger: Option<SocketAddr> = None;
    loop {
        let now = Nanos(monotonic_ns());
        match session.handshake(until.min(now.plus(LOOK_NS))) {
            Ok(true) => return Ok(Box::new(session)),
            Ok(false) if now >= until => return Err(End::Tls(TlsFault::SlowHandshake)),
            Ok(false) => {}
            Err(fault) => return Err(End::Tls(fault)),
        }
        door.turn_away(waste, &mut |from| {
            if last_stranger != Some(from) {
                tell(&News::TurnedAway(from));
            }
            last_stranger = Some(from);
        });
        if stop() {
            return Err(End::Stopped);
        }
    }
}
