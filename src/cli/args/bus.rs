//! Arguments of `gusset bus`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

#[derive(Debug, Subcommand)]
pub(in crate::cli) enum BusCommand {
    /// List the devices of a bus as `[bus]` tables. Nothing moves, and no outputs are written.
    Scan(ScanArgs),
    /// Simulate the devices of a test file, for a test without hardware.
    Simulate(SimulateArgs),
    /// Reset the faults of the drives of a test file. No drive gets torque by it.
    Reset(BusResetArgs),
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  gusset bus scan enp3s0\n\nMore: gusset guide ethercat")]
pub(in crate::cli) struct ScanArgs {
    /// Network interface that the first device is connected to.
    #[arg(value_name = "INTERFACE")]
    pub interface: String,
    /// Also bring devices to INIT that are in operation. Their outputs may end: unload every axis first.
    #[arg(long)]
    pub release: bool,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset bus simulate test.toml --pair -- gusset run test.toml\n  \
    gusset bus simulate test.toml --interface veth1 --faults faults.toml\n\nMore: gusset guide ethercat"
)]
pub(in crate::cli) struct SimulateArgs {
    /// Test file with the bus and its specimens.
    #[arg(value_name = "TEST.toml")]
    pub test: PathBuf,
    /// Answer on this network interface until Ctrl-C: one end of a pair (veth) whose other end the test file names.
    #[arg(long, value_name = "NAME", required_unless_present = "pair")]
    pub interface: Option<String>,
    /// Make such a pair in a separate network, and run the command there. It needs no rights.
    #[arg(long, conflicts_with = "interface", requires = "command")]
    pub pair: bool,
    /// Faults that happen, as `[[fault]]` tables.
    #[arg(long, value_name = "FILE")]
    pub faults: Option<PathBuf>,
    /// Change a key of the test file, for example `time.rate_hz=500`.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// Command to run beside the simulated devices.
    #[arg(last = true, value_name = "COMMAND", requires = "pair")]
    pub command: Vec<String>,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  gusset bus reset test.toml\n\nMore: gusset guide ethercat")]
pub(in crate::cli) struct BusResetArgs {
    /// Test file with the bus.
    #[arg(value_name = "TEST.toml")]
    pub test: PathBuf,
}
