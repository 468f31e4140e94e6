//! Codecs of the bus: bytes in, values out. Arbitrary bytes never panic, and nothing allocates on the path of a tick.

pub(crate) mod coe;
pub(crate) mod datagram;
pub(crate) mod drive;
pub(crate) mod register;
pub(crate) mod sii;
