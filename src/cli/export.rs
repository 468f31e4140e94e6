//! `gusset export`.

use anyhow::Context;

use super::args::{ExportArgs, FormatArg, RateArg};
use super::exit::Exit;
use super::tell;
use crate::record::Run;
use crate::record::export::{Rows, export_csv};

/// Writes a run in a form that other programs read.
pub fn export(args: &ExportArgs) -> anyhow::Result<Exit> {
    let run = Run::open(&args.run)?;
    anyhow::ensure!(!args.out.exists(), "{} exists already", args.out.display());
    let rows = match args.rate {
        RateArg::Step => Rows::Step,
        RateArg::Tick => Rows::Tick,
    };
    let exported = match args.format {
        FormatArg::Csv => export_csv(&run, rows, &args.out),
    }
    .context("the run cannot be exported")?;
    for notice in &exported.notices {
        tell(format_args!("warning: {notice}"));
    }
    tell(format_args!(
        "{} rows in {}",
        exported.rows,
        args.out.display()
    ));
    Ok(Exit::Done)
}
