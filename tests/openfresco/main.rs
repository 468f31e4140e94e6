//! The protocols of OpenFresco: client, server, and messages recorded between the real programs.

#[path = "../link_common/mod.rs"]
mod link_common;
#[path = "../openfresco_ends/mod.rs"]
mod openfresco_ends;
#[path = "../common/test_file.rs"]
mod test_file;

mod bad_input;
mod captures;
mod clients;
mod initial_position;
mod loopback;
mod paced;
mod refusals;
mod served;
mod strangers;
mod wiring_check;
