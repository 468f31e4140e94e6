//! Gusset: a real-time hybrid simulation controller.
//!
//! A hybrid test joins a numerical substructure, which is integrated, and a physical one, which is commanded
//! and measured. Each tick of the loop ([`engine`]) sends the displacement that the explicit integrator knew before the tick,
//! takes the measured force, and hands one row to the recorder. At the end of a step equilibrium is closed. The loop does not know whether time is real, whether the specimen is a formula, a process across a
//! socket or a replayed file, or who reads the rows.
//!
//! The user's guide is in [`guide`]: how to prepare, run and evaluate a test.
//!
//! The way of a sample:
//!
//! ```text
//! motion → model (load) → engine: issue k → substructure … collect k → equilibrium k → integrate → command k+1 → row k
//!                                                                                       record → report, export
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`time`] | nanoseconds, exact rates, the tick grid, the clock and its simulated twin |
//! | [`law`] | uniaxial force laws, shared by numerical elements and specimens |
//! | [`linalg`] | symmetric matrices and their factors; no allocation in a solve |
//! | [`model`] | the numerical substructure: M, C, K, nonlinear elements |
//! | [`motion`] | ground motions and other signals on the step grid |
//! | [`identify`] | what an actuator and its specimen are, from one recorded motion |
//! | [`integrate`] | the Gui-λ family and the choice of λ |
//! | [`spectral`] | what a method does to one mode: poles, period error, bounds, critical delay |
//! | [`state`] | the state of a test as a value: taken, digested, restored |
//! | [`substructure`] | the hinge: command out, measurement back |
//! | [`specimen`] | specimens in process |
//! | [`transfer`] | what lies between a command and a specimen: delay, actuators, limits, sensors |
//! | [`compensation`] | commands that make up for an actuator |
//! | [`geometry`] | loading units: from a pose to the strokes of its actuators, and back |
//! | [`port`] | one specimen as the loop sees it: axes, command path, exchange, guard |
//! | [`engine`] | the loop |
//! | [`record`] | rows, the run folder, exports |
//! | [`link`] | transports, and specimens across them |
//! | [`wire`] | codecs: our own frames and handshake, OpenFresco's dialects; bytes in, values out |
//! | [`rt`] | what is asked of the operating system; the real clock; timing histograms |
//! | [`catalog`] | the names of limits, events, phases and columns, one table each |
//! | [`config`] | the files that a user writes: schema, reading, checks, diagnostics; knows no engine |
//! | [`setup`] | from a file to an experiment, or to the specimen of a server |
//! | [`metrics`] | numbers read off recorded histories |
//! | [`view`] | what people look at: typed files of a run, report, comparison; live page, status and metrics of a running test |
//! | [`text`] | text that is shown to people, with what a terminal would obey or hide spelled out |
//! | [`assets`] | the chart script that our pages carry |
//! | [`verify`] | the published values of the family, obtained anew and judged |
//! | [`frontier`] | how large a model keeps its deadlines: models of any size, the search, the picture |
//! | [`benchmark`] | the virtual hybrid simulation benchmark, natively |
//! | [`stability`] | every proof of the stability of a loop, and the verdict of a test |
//! | [`units`] | quantities and times in words |
//! | [`work`] | how far long work is, for a watcher that shows it |
//! | [`session`] | one test from the prepared experiment to the finished run folder: the threads |
//! | [`guide`] | the user's guide: pages, plain text, web pages |
//! | [`cli`] | the commands |

#![deny(unsafe_code)]
#![warn(missing_docs, missing_debug_implementations)]

pub mod cli;
pub mod guide;
