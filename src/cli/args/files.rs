//! Arguments of `new`, `list`, `schema`, `completions` and `man`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset new --list\n  gusset new first\n  gusset new lab --template remote\n\n\
                  An existing file is never overwritten.\n\nMore: gusset guide first-test"
)]
pub(in crate::cli) struct NewArgs {
    /// Name of the test; the file is NAME.toml in the current folder [default: name of the template].
    #[arg(value_name = "NAME")]
    pub name: Option<String>,
    /// Which kind of test.
    #[arg(long, value_enum, value_name = "TEMPLATE", default_value_t = TemplateArg::ShearBuilding)]
    pub template: TemplateArg,
    /// List the templates and write nothing.
    #[arg(long, conflicts_with = "name")]
    pub list: bool,
}

/// The templates of `gusset new`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum TemplateArg {
    /// Five storeys with a yielding specimen as first storey, and an earthquake record.
    ShearBuilding,
    /// Five storeys with a simulated actuator that lags, and ATS compensation.
    Actuator,
    /// A displacement protocol for a specimen alone, without a structure.
    Prescribed,
    /// Case 1 of the virtual real-time hybrid simulation benchmark.
    Benchmark,
    /// A plane frame of two storeys with a brace as specimen.
    Frame,
    /// A building with a tuned mass damper as specimen.
    TunedMassDamper,
    /// A building on lead-rubber bearings that yield in two directions.
    IsolatedBuilding,
    /// A specimen behind a network, and a second file that serves one.
    Remote,
    /// A specimen on an EtherCAT bus, with simulated devices to begin with.
    Bus,
    /// A specimen with your own force law, as a program in Python.
    Python,
    /// A specimen that OpenSees commands, and an OpenSeesPy model.
    Opensees,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset list\n  gusset list /data/tests --json\n\nMore: gusset guide run-folder"
)]
pub(in crate::cli) struct ListArgs {
    /// Folder whose runs are listed, with those in its subfolders.
    #[arg(value_name = "DIR", default_value = "runs")]
    pub dir: PathBuf,
    /// Print the runs as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset schema > gusset-schema.json\n  gusset schema --serve > gusset-serve-schema.json\n  \
                  gusset schema --study > gusset-study-schema.json\n\n\
                  An editor with a TOML language server completes and checks a file that begins with\n  \
                  #:schema ./gusset-schema.json\n\nMore: gusset guide configuration"
)]
pub(in crate::cli) struct SchemaArgs {
    /// Print the schema of the file that `gusset serve` takes.
    #[arg(long, conflicts_with = "study")]
    pub serve: bool,
    /// Print the schema of the study file of `gusset campaign`.
    #[arg(long)]
    pub study: bool,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset completions bash > ~/.local/share/bash-completion/completions/gusset\n  \
                  gusset completions zsh > ~/.zsh/completions/_gusset\n  \
                  gusset completions fish > ~/.config/fish/completions/gusset.fish"
)]
pub(in crate::cli) struct CompletionsArgs {
    /// Which shell.
    #[arg(value_enum)]
    pub shell: ShellArg,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(in crate::cli) enum ShellArg {
    /// GNU Bash.
    Bash,
    /// Z shell.
    Zsh,
    /// Fish.
    Fish,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  gusset man ~/.local/share/man/man1\n  man gusset-run")]
pub(in crate::cli) struct ManArgs {
    /// Folder for gusset.1 and one page per command. It is made if necessary; older pages are replaced.
    pub dir: PathBuf,
}
