//! The real OpenSees as client, specimen and reference. `tools/test` installs it.

#[path = "../link_common/mod.rs"]
mod link_common;

mod bearings;
mod client;
mod courses;
mod devices;
mod frames;
mod gateway;
mod hinges;
mod integrators;
mod laws;
mod programs;
mod rig;
mod run;
mod specimen;
