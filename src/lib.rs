//! Gusset: a real-time hybrid simulation controller. This package is its command line and its guide.
//!
//! A hybrid test joins a numerical substructure, which is integrated, and a physical one, which is commanded and measured. Each tick
//! of the loop sends the displacement that the explicit integrator knew before the tick, takes the measured force, and hands one row
//! to the recorder. At the end of a step equilibrium is closed. The loop does not know whether time is real, whether the specimen is
//! a formula, a process across a socket or a replayed file, or who reads the rows.
//!
//! The way of a sample:
//!
//! ```text
//! motion → model (load) → engine: issue k → substructure … collect k → equilibrium k → integrate → command k+1 → row k
//!                                                                                       record → report, export
//! ```
//!
//! The members of the workspace, each in `src/`. A member uses those above it:
//!
//! | member | holds |
//! |---|---|
//! | [`gusset_quantity`] | time, units, names, findings, state, and the hinge: command out, measurement back |
//! | [`gusset_numerics`] | force laws, matrices, the structure, the Gui-λ family, poles and bounds |
//! | [`gusset_motion`] | ground motions and other signals on the step grid; numbers read off histories; identification |
//! | [`gusset_actuator`] | loading units, simulated actuators, compensation, computed specimens |
//! | `gusset_wire` | codecs: our own frames and handshake, the dialects of OpenFresco |
//! | [`gusset_config`] | the files that a user writes: schema, reading, checks, diagnostics |
//! | [`gusset_proof`] | every proof of the stability of a loop, and the verdict of a test |
//! | [`gusset_record`] | rows, the run folder, exports; requests to the operating system |
//! | [`gusset_control`] | the specimens as the loop sees them, and the loop |
//! | [`gusset_link`] | transports, specimens across them, servers and gateways |
//! | [`gusset_setup`] | from a file to an experiment, or to the specimen of a server |
//! | [`gusset_view`] | what people look at: report, comparison, live page, status |
//! | [`gusset_evidence`] | published values obtained again; the benchmark; the largest structure |
//! | [`gusset_session`] | one test from the experiment to the run folder; rehearsal, replay, resume, campaigns |
//!
//! The user's guide is in [`guide`]. The commands are in [`cli`]. Begin reading with [`cli::main`].

pub mod cli;
pub mod guide;
pub mod program;
