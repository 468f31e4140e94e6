//! Identification: what is found of a simulated specimen behind a known actuator is what it is, and standard errors are what
//! they say; the command drives, refuses and writes what the other commands read.

mod actuators;
mod command;
mod refusals;
mod statistics;
