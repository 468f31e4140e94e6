//! Identification: the numbers found for a simulated specimen behind a known actuator are true within their standard errors. The
//! command drives the motion, refuses bad input and writes files for the other commands.

mod actuators;
mod command;
mod refusals;
mod statistics;
