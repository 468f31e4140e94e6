//! Arguments of `gusset guide`.

use std::path::PathBuf;

use clap::Args;

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset guide first-test\n  gusset guide limits.command_disp_m\n  gusset guide --html manual"
)]
pub(in crate::cli) struct GuideArgs {
    /// A page of the guide, a table of a test file, or one of its keys [default: the contents].
    pub topic: Option<String>,
    /// Write the guide as web pages into this folder. They open without a network. The folder must be new or empty, or have
    /// an earlier manual.
    #[arg(long, value_name = "DIR", conflicts_with = "topic")]
    pub html: Option<PathBuf>,
}
