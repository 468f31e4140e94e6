//! OpenFresco and OpenSees across a socket, in every role, over TCP, UDP and TLS.
//!
//! | item | dialect | speaks with |
//! |---|---|---|
//! | [`Server`](super::server::Server), [`Role::Application`] | A | OpenSees `genericClient`, OpenFresco's elements with `-server`, the C library |
//! | [`Server`](super::server::Server), [`Role::Actor`] | B | OpenFresco `expSite ShadowSite` |
//! | [`Server`](super::server::Server), [`Role::Controller`] | D | OpenFresco `expControl GenericTCP` or `SimFEAdapter` |
//! | [`Server`](super::server::Server), [`Role::Simulink`] | D | OpenFresco `expControl SimSimulink` |
//! | [`Remote`], `Peer::Element`, `Peer::Site` | A | `startSimAppElemServer`, `startSimAppSiteServer` |
//! | [`Remote`], `Peer::Actor` | B | `expSite ActorSite` |
//! | [`Remote`], `Peer::Adapter` | C | OpenSees `adapter`, `actuator`, `corotActuator` |
//!
//! Run against the real OpenSees: dialect A as a server, dialect C as a client, TCP and UDP. Dialects B and D and the
//! client of dialect A were not run against the real program here, nor was TLS: recorded exchanges and our own two
//! ends are their tests.
//!
//! Limits of these protocols: no sequence numbers, no checksums, no time limits, no error messages, no resume. Our side
//! adds time limits and checks of every size; a lost UDP datagram still ends the test.

mod asking;
mod below;
mod client;
mod client_end;
mod codec;
mod error;
mod host;
mod matrices;
mod motion;
mod remarks;
mod role;
mod settings;
mod tally;
mod transformation;
mod trials;
mod updated_tangent;

pub use client::Remote;
pub(crate) use client_end::lost;
pub use client_end::{End, ExchangeFault};
pub(crate) use codec::{Codec, Request};
pub use error::RemoteError;
pub use host::{Host, HostFault};
pub(crate) use remarks::Remarks;
pub use role::{Nature, Role};
pub use settings::{RemoteSettings, ServeSettings};
pub use tally::Tally;
pub use transformation::Transformation;
