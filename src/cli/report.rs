//! `gusset report`.

use std::path::Path;

use super::args::ReportArgs;
use super::exit::Exit;
use super::tell;
use crate::record::Run;
use crate::record::export::Notice;
use crate::session;

/// Writes report.html again, from the run folder alone; or the page of two runs.
pub fn report(args: &ReportArgs) -> anyhow::Result<Exit> {
    if let Some(second) = &args.against {
        return compare(&args.run, second, args.out.as_deref());
    }
    let page = session::write_report(&args.run)?;
    if_unfinished(&args.run)?;
    for what in &page.damaged {
        tell(format_args!("warning: {}: {what}", args.run.display()));
    }
    tell(page.path.display());
    if let Some(picture) = &args.picture {
        anyhow::ensure!(!picture.exists(), "{} exists already", picture.display());
        tell(session::hero(&args.run, picture)?.display());
    }
    Ok(Exit::Done)
}

fn compare(first: &Path, second: &Path, out: Option<&Path>) -> anyhow::Result<Exit> {
    let named = session::compared_name(first, second);
    let compared = session::compare(first, second, out.unwrap_or(&named))?;
    for what in &compared.damages {
        tell(format_args!("warning: {what}"));
    }
    tell(compared.verdict);
    tell(compared.path.display());
    Ok(Exit::Done)
}

/// Says so where a run came to no orderly end, or its summary cannot be read.
pub(super) fn if_unfinished(folder: &Path) -> anyhow::Result<()> {
    if let Some(notice) = Notice::without_summary(&Run::open(folder)?) {
        tell(format_args!("warning: {}: {notice}", folder.display()));
    }
    Ok(())
}
