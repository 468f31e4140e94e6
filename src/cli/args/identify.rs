//! Arguments of `gusset identify`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::TestRunArgs;
use gusset_motion::identify::Shape;

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset identify config/vrths-case-1.toml --amplitude 0.002 --out runs/floor-1\n  \
    gusset check runs/floor-1/identified.toml\n\n\
    The limits of the test file apply. Axes move one after the other. identified.toml in the run folder is a test file with \
    the identified specimen.\n\n\
    Exits with 1 if the motion was stopped or if a measured displacement does not follow the command.\n\n\
    More: gusset guide actuators"
)]
pub(in crate::cli) struct IdentifyArgs {
    /// The test file.
    pub test: PathBuf,
    /// The specimen to identify. The others are neither connected nor moved [default: all, one after the other].
    #[arg(long, value_name = "NAME")]
    pub specimen: Option<String>,
    /// Amplitude of the motion in m, at the specimen [default: 5 % of the free range of `command_disp_m`, or less to stay below half
    /// of the other limits].
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub amplitude: Option<f64>,
    /// Lowest and highest frequency in Hz [default: 0.2 and 10, at most a fifth of the ticks per second].
    #[arg(
        long,
        value_name = "F1,F2",
        value_delimiter = ',',
        num_args = 1,
        allow_negative_numbers = true
    )]
    pub band: Option<Vec<f64>>,
    /// Duration of the motion of each axis in s.
    #[arg(
        long,
        value_name = "S",
        default_value_t = 30.0,
        allow_negative_numbers = true
    )]
    pub duration: f64,
    /// Kind of motion.
    #[arg(long, value_enum, default_value_t = MotionArg::Sweep)]
    pub motion: MotionArg,
    /// Seed of the random numbers of noise and steps.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    #[command(flatten)]
    pub test_run: TestRunArgs,
    /// Print the results as JSON on stdout.
    #[arg(long)]
    pub json: bool,
    /// Do not print the progress line.
    #[arg(long)]
    pub quiet: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(in crate::cli) enum MotionArg {
    /// A sine whose frequency sweeps through the band.
    Sweep,
    /// Noise within the band.
    Noise,
    /// Steps between random levels.
    Steps,
}

impl From<MotionArg> for Shape {
    fn from(arg: MotionArg) -> Self {
        match arg {
            MotionArg::Sweep => Self::Sweep,
            MotionArg::Noise => Self::Noise,
            MotionArg::Steps => Self::Steps,
        }
    }
}
