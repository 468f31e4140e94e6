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
    if_unfinished(first)?;
    if_unfinished(second)?;
    tell(compared.verdict);
    tell(compared.path.display());
    Ok(Exit::Done)
}

/// Says so where a run came to no orderly end.
fn if_unfinished(folder: &Path) -> anyhow::Result<()> {
    if Run::open(folder)?.summary().is_none() {
        tell(format_args!(
            "warning: {}: {}",
            folder.display(),
            Notice::Unfinished
        ));
    }
    Ok(())
}
