//! Identification: what is found of a simulated specimen behind a known actuator is what it is, and standard errors are what
//! they say; the command drives, refuses and writes what the other commands read.

#[path = "../common/mod.rs"]
mod common;
#[path = "../link_common/mod.rs"]
mod link_common;

mod actuators;
mod command;
mod refusals;
mod statistics;
