//! The exchange of a native client's command with the specimen.

use super::{LOOK_NS, NativeConversation};
use crate::link::Transport;
use crate::link::served::{TestEnd, Trip};
use crate::link::server::ServerEvent;
use crate::link::server::channel::Channel;
use crate::link::server::connection::ClientLink;
use crate::link::server::native_codec::NativeCodec;
use crate::link::server::shared::Shared;
use crate::link::socket::LOOK;
use crate::substructure::LinkFault;
use crate::time::Nanos;

impl NativeConversation {
    /// The exchange of the command in force with the specimen.
    pub(super) fn exchange(
        &mut self,
        elapsed: f64,
        now: Nanos,
        channel: &mut Channel,
        shared: &Shared,
    ) -> Result<(), TestEnd> {
        self.served.now_is(now);
        let was_tripped = self.served.tripped().is_some();
        let mut gone = None;
        // Nothing shows that a client of datagrams has gone.
        let looks = self.codec.is_stream() && self.served.is_paced();
        let (link, codec) = (&mut channel.link, &mut self.codec);
        let mut look_at = now;
        let mut wanted = || {
            let now = link.now();
            if looks && gone.is_none() && now >= look_at {
                look_at = now.plus(LOOK_NS);
                gone = look(link, codec).err();
            }
            gone.is_none() && !shared.is_stopped()
        };
        let (command, measured) = self.commanded.exchange();
        let sequence = command.sequence;
        let outcome = (self.served).exchange(&command, elapsed, &mut wanted, measured);
        self.commanded.flags = self.commanded.measured.status;
        self.count.commands += 1;
        match outcome {
            Err(trip @ Trip::Lost(_)) => return Err(self.lost_specimen(trip, channel)),
            Err(trip) if !was_tripped => {
                let text = self.served.whole(trip);
                shared.tell(ServerEvent::Tripped { sequence, text });
                if let Some(text) = self.served.next_step() {
                    shared.tell(ServerEvent::Told { text });
                }
            }
            Ok(false) => {
                return Err(match gone {
                    Some(fault) => channel.lost(true, fault),
                    None => self.told_to_stop(channel),
                });
            }
            Err(_) | Ok(true) => {}
        }
        Ok(())
    }
}

/// Keeps what has come on a stream, as far as there is room for it: behind that nothing is seen. Real-time: yes.
///
/// # Errors
/// The client is gone.
fn look(link: &mut ClientLink, codec: &mut NativeCodec) -> Result<(), LinkFault> {
    loop {
        let room = codec.space();
        if room.is_empty() {
            return Ok(());
        }
        match link.recv(room, LOOK)? {
            Some(count) => codec.filled(count),
            None => return Ok(()),
        }
    }
}
