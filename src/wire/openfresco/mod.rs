//! The four dialects of OpenFresco and OpenSees, as pure machines: bytes in, events and answers out.
//!
//! | machine | dialect | takes the place of |
//! |---|---|---|
//! | [`Server`] | A, application | `startSimAppElemServer`: serves OpenSees `genericClient`, OpenFresco elements, the C library |
//! | [`Server`] | D, controller | a laboratory controller behind OpenFresco's `GenericTCP` |
//! | [`Simulink`] | D, Simulink | the model behind OpenFresco's `SimSimulink` |
//! | [`Actor`] | B | `expSite ActorSite` |
//! | [`Shadow`] | B | `expSite ShadowSite` |
//! | [`Client`] | A, application | an application client: commands a site or element server |
//! | [`Client`] | C, adapter | `expControl SimFEAdapter`: commands OpenSees `adapter`, `actuator`, `corotActuator` |
//!
//! Everything on the wire is little-endian: 4-byte integers during the set-up, then vectors of N doubles with an
//! action in double 0 of a client's message. There is no header, no length, no checksum and no sequence number; both
//! sides must know the length from the set-up. The offsets are in [`Sizes`], [`Counts`], `vector` and
//! [`Action`].
//!
//! Use of a machine: `feed` it what came and do what the event says, until all bytes are used; after each event
//! send what `reply` holds. A stream may be cut anywhere. A datagram is fed as one piece. An error is final: the
//! machine stays failed, the connection is to be closed.
//!
//! Memory is allocated when a machine is made and when the sizes arrive (bounded by [`MAX_DATA_SIZE`]), never
//! by a command or a request. What the machines do not do: they answer no request by themselves, know no
//! specimen, no time limit and no socket.

mod action;
mod actor;
mod client;
mod course;
mod exchange;
mod followed;
mod hello;
mod inbox;
mod opening;
mod order;
mod peer;
mod server;
mod shadow;
mod simulink;
mod sizes;
mod vector;

pub use action::{Action, Matrix, Reading};
pub use actor::{Actor, ActorEvent};
pub use client::{Asked, Client, ClientDialect, ClientEvent, ClientSettings};
pub use course::Course;
pub use followed::Followed;
pub use hello::{Program, UdpGreeting};
pub use inbox::{Carrier, DATAGRAM_LIMIT, Inbox, datagrams};
pub use order::SignalOrder;
pub use peer::Peer;
pub use server::{Event, Server, ServerDialect};
pub use shadow::{Shadow, ShadowEvent, ShadowSettings};
pub use simulink::{Simulink, SimulinkEvent};
pub use sizes::{Counts, DEFAULT_DATA_SIZE, Interface, MAX_COUNT, MAX_DATA_SIZE, Sizes};
pub use vector::Response;

/// Port of the examples for dialect A.
pub const APPLICATION_PORT: u16 = 8090;
/// Port of the examples for dialect B.
pub const SITE_PORT: u16 = 8091;
/// Port of the examples for dialects C and D.
pub const CONTROLLER_PORT: u16 = 44_000;

#[cfg(test)]
mod tests;
