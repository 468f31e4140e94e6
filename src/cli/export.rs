//! `gusset export`.

use std::path::Path;

use anyhow::{Context, anyhow, bail};

use super::args::{DerivedArg, ExportArgs, FormatArg, RateArg};
use super::exit::Exit;
use super::tell;
use gusset_record::Run;
use gusset_record::export::{self, Choice, Extra, Format, Rows};
use gusset_session::{self as session, Derived};

/// Writes a run in a form that other programs read.
pub fn export(args: &ExportArgs) -> anyhow::Result<Exit> {
    let run = Run::open(&args.run)?;
    anyhow::ensure!(
        args.out.as_os_str() != "-",
        "--out -: an export is a file and is not written to the terminal; ./- is a file of that name"
    );
    // A link that leads nowhere is there, too.
    let is_free = args.out.symlink_metadata().is_err();
    anyhow::ensure!(is_free, "{} exists already", args.out.display());
    let choice = Choice {
        rows: match args.rate {
            RateArg::Step => Rows::Step,
            RateArg::Tick => Rows::Tick,
        },
        from: args.from,
        to: args.to,
    };
    let format = match args.format {
        FormatArg::Csv => Format::Csv,
        FormatArg::Npz => Format::Npz,
        FormatArg::Mat => Format::Mat,
        FormatArg::Mat73 => Format::Mat73,
        FormatArg::Hdf5 => Format::Hdf5,
        FormatArg::Parquet => Format::Parquet,
        FormatArg::Mcap => Format::Mcap,
        FormatArg::Trace => Format::Trace,
        FormatArg::DesignSafe => Format::DesignSafe,
    };
    // A folder that holds a copy of the run does not belong to the run.
    let parent = args.out.parent().map(|parent| match parent.as_os_str() {
        here if here.is_empty() => Path::new("."),
        _ => parent,
    });
    let home = parent.and_then(|parent| parent.canonicalize().ok());
    let is_inside = home
        .zip(args.run.canonicalize().ok())
        .is_some_and(|(home, run)| home.starts_with(run));
    anyhow::ensure!(
        !(format == Format::DesignSafe && is_inside),
        "{} is inside of the run that it would copy",
        args.out.display()
    );
    let extra = extra(args, format, &run, choice.rows)?;
    let exported = export::export(&run, format, &choice, &extra, &args.out)
        .context("the run cannot be exported")?;
    // Units and names of the exported columns come from a file that anyone may have edited.
    if let Some(error) = session::altered(&run) {
        tell(format_args!("warning: {error}"));
    }
    for notice in &exported.notices {
        tell(format_args!("warning: {notice}"));
    }
    let version = exported.version.map(|version| format!(" ({version})"));
    tell(format_args!(
        "{} rows in {}{}",
        exported.rows,
        args.out.display(),
        version.unwrap_or_default()
    ));
    Ok(if exported.is_of_damaged_rows() {
        Exit::Stopped
    } else {
        Exit::Done
    })
}

/// The columns and lines that were asked for beside those of every export.
fn extra(args: &ExportArgs, format: Format, run: &Run, rows: Rows) -> anyhow::Result<Extra> {
    if format == Format::Trace && !args.with.is_empty() {
        bail!("--with adds columns to a table, and a trace has no columns: use another --format");
    }
    if args.no_units_line && !matches!(format, Format::Csv | Format::DesignSafe) {
        bail!(
            "--no-units-line is for --format csv and designsafe: other formats have units beside the values",
        );
    }
    let mut wanted: Vec<Derived> = Vec::new();
    for one in &args.with {
        let one = match one {
            DerivedArg::AbsoluteAcceleration => Derived::AbsoluteAcceleration,
            DerivedArg::StoreyDrift => Derived::StoreyDrift,
            DerivedArg::StoreyShear => Derived::StoreyShear,
        };
        if !wanted.contains(&one) {
            wanted.push(one);
        }
    }
    let sums = session::derived(run, &wanted, rows).map_err(|error| anyhow!("--with: {error}"))?;
    Ok(Extra {
        sums,
        units_line: !args.no_units_line,
    })
}
