//! A specimen behind the native protocol: connection, faults of the network, wire format.

#[path = "../link_common/mod.rs"]
mod link_common;

mod addresses;
mod bad_network;
mod faults;
mod fuzz;
mod fuzz_codecs;
mod protocol_page;
mod refusals;
mod same_bits;
mod sample_specimens;
mod together;
