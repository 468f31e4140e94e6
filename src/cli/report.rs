//! `gusset report`.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use super::args::ReportArgs;
use super::exit::Exit;
use super::tell;
use gusset_record::export::Notice;
use gusset_record::{Run, Summary};
use gusset_session as session;

/// Writes report.html again, from the run folder alone; or the page of several runs.
pub fn report(args: &ReportArgs) -> anyhow::Result<Exit> {
    if !args.against.is_empty() {
        return compare(&args.run, &args.against, args.out.as_deref());
    }
    let page = session::write_report(&args.run)?;
    if_unfinished(&args.run)?;
    if let Some(error) = session::altered(&Run::open(&args.run)?) {
        tell(format_args!("warning: {error}"));
    }
    for what in &page.damaged {
        tell(format_args!("warning: {}: {what}", args.run.display()));
    }
    for what in &page.contradicted {
        let level = if page.is_of_an_earlier_version {
            "warning"
        } else {
            "error"
        };
        tell(format_args!("{level}: {}: {what}", args.run.display()));
    }
    // The summary of a served test has no tracking metrics.
    let is_told = |summary: &Summary| summary.metrics.is_some();
    if !Run::open(&args.run)?.summary().is_some_and(is_told) {
        for line in &page.followed {
            tell(line);
        }
    }
    tell(page.path.display());
    if let Some(picture) = &args.picture {
        anyhow::ensure!(!picture.exists(), "{} exists already", picture.display());
        tell(session::hero(&args.run, picture)?.display());
    }
    // Earlier versions counted otherwise.
    let is_contradicted = !page.contradicted.is_empty() && !page.is_of_an_earlier_version;
    Ok(if is_contradicted || page.has_damaged_rows {
        Exit::Stopped
    } else {
        Exit::Done
    })
}

fn compare(first: &Path, others: &[PathBuf], out: Option<&Path>) -> anyhow::Result<Exit> {
    let named = session::compared_name(first, others);
    let out = out.unwrap_or(&named);
    replaceable(out)?;
    let compared = session::compare(first, others, out)?;
    for what in &compared.damages {
        tell(format_args!("warning: {what}"));
    }
    for (verdict, folder) in compared.verdicts.iter().zip(others) {
        match others.len() {
            1 => tell(verdict),
            _ => tell(format_args!("{}: {verdict}", folder.display())),
        }
    }
    tell(compared.path.display());
    Ok(Exit::Done)
}

/// A page is written over an older page, and over nothing else: not over a record, not over a test file.
fn replaceable(out: &Path) -> anyhow::Result<()> {
    const PAGE: &[u8] = b"<!DOCTYPE html>";
    let mut start = [0; PAGE.len()];
    let is_page = match File::open(out).and_then(|mut file| file.read_exact(&mut start)) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        found => found.is_ok() && start == PAGE,
    };
    if is_page {
        return Ok(());
    }
    anyhow::bail!("--out {}: it exists and is no page", out.display())
}

/// Warns if a run did not end cleanly, or its summary cannot be read.
pub(super) fn if_unfinished(folder: &Path) -> anyhow::Result<()> {
    if let Some(notice) = Notice::without_summary(&Run::open(folder)?) {
        tell(format_args!("warning: {}: {notice}", folder.display()));
    }
    Ok(())
}
