//! `gusset completions` and `gusset man`: from the same definitions as `--help`.

use std::fs;

use anyhow::Context;
use clap::CommandFactory;
use clap_complete::{Shell, generate};
use clap_mangen::Man;

use super::args::{Cli, CompletionsArgs, ManArgs, ShellArg};
use super::exit::Exit;
use super::{answer, tell};
use gusset_record::atomic;

/// Prints the completions of a shell.
pub fn completions(args: &CompletionsArgs) -> anyhow::Result<Exit> {
    let shell = match args.shell {
        ShellArg::Bash => Shell::Bash,
        ShellArg::Zsh => Shell::Zsh,
        ShellArg::Fish => Shell::Fish,
    };
    let mut script = Vec::new();
    generate(shell, &mut Cli::command(), "gusset", &mut script);
    answer(String::from_utf8(script)?.trim_end())?;
    Ok(Exit::Done)
}

/// Writes a man page per command.
pub fn man(args: &ManArgs) -> anyhow::Result<Exit> {
    let at = || args.dir.display().to_string();
    fs::create_dir_all(&args.dir).with_context(at)?;
    let mut whole = Cli::command().disable_help_subcommand(true);
    whole.build();
    let mut pages = Vec::new();
    collect(&whole, "gusset", &mut pages)?;
    for (name, page) in &pages {
        let path = args.dir.join(name);
        atomic::write(&path, page).with_context(|| path.display().to_string())?;
    }
    tell(format_args!(
        "{} man pages in {}",
        pages.len(),
        args.dir.display()
    ));
    Ok(Exit::Done)
}

/// The page of a command, then the pages of its subcommands.
fn collect(
    command: &clap::Command,
    name: &str,
    pages: &mut Vec<(String, Vec<u8>)>,
) -> anyhow::Result<()> {
    // A command knows only its own name; a page is called by the whole one.
    let named = command.clone().display_name(name.to_owned());
    let mut page = Vec::new();
    Man::new(named).render(&mut page)?;
    pages.push((format!("{name}.1"), page));
    for below in command.get_subcommands() {
        collect(below, &format!("{name}-{}", below.get_name()), pages)?;
    }
    Ok(())
}
