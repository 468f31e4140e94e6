//! A session: one client and the specimen that it commands.
//!
//! Every session takes the same course, whatever protocol its client speaks, on real and on simulated time. It does its
//! due work, waits for bytes, and ends for the client, for a fault or for the stop request. A [`Conversation`] supplies
//! the difference: its codec turns bytes into requests, and it obeys them at the specimen. The specimen stays reserved
//! until the records of the test are closed. Then the server is free for the next client.

use super::channel::Channel;
use super::connection::ClientLink;
use super::shared::Shared;
use gusset_quantity::time::Nanos;

/// The part of one protocol in a session.
pub(super) trait Conversation {
    /// Why a session ends.
    type End;

    /// Does everything that is due. Returns the time until which there is nothing to do without new bytes. Real-time: yes.
    fn turn(&mut self, channel: &mut Channel, shared: &Shared) -> Result<Nanos, Self::End>;

    /// Waits for bytes until a time. Real-time: yes.
    fn listen(&mut self, channel: &mut Channel, until: Nanos) -> Result<(), Self::End>;

    /// Says goodbye to the client because the server stops.
    fn stopped(&mut self, channel: &mut Channel) -> Self::End;

    /// Closes the records of the test and reports its end.
    fn finish(self, channel: &mut Channel, end: Self::End, shared: &Shared);
}

/// One client and the specimen that it commands.
pub(super) struct Session<C> {
    channel: Channel,
    conversation: C,
}

impl<C: Conversation> Session<C> {
    pub(crate) const fn new(channel: Channel, conversation: C) -> Self {
        Self {
            channel,
            conversation,
        }
    }

    /// Runs to the end of the test.
    pub(crate) fn run(mut self, shared: &Shared) {
        let end = loop {
            if shared.is_stopped() {
                break self.conversation.stopped(&mut self.channel);
            }
            match self.turn(shared).and_then(|until| self.listen(until)) {
                Ok(()) => {}
                Err(end) => break end,
            }
        };
        self.finish(end, shared);
    }

    /// One turn: everything that is due.
    pub(crate) fn turn(&mut self, shared: &Shared) -> Result<Nanos, C::End> {
        self.conversation.turn(&mut self.channel, shared)
    }

    /// Waits for bytes until a time.
    pub(crate) fn listen(&mut self, until: Nanos) -> Result<(), C::End> {
        self.conversation.listen(&mut self.channel, until)
    }

    /// Ends the test, and returns the connection. The specimen is still reserved.
    pub(crate) fn finish(mut self, end: C::End, shared: &Shared) -> ClientLink {
        shared.close();
        self.conversation.finish(&mut self.channel, end, shared);
        self.channel.link
    }

    pub(crate) const fn link(&mut self) -> &mut ClientLink {
        &mut self.channel.link
    }
}
