//! `gusset report`.

use super::args::ReportArgs;
use super::exit::Exit;
use super::tell;
use crate::record::Run;
use crate::record::export::Notice;
use crate::session;

/// Writes report.html again, from the run folder alone.
pub fn report(args: &ReportArgs) -> anyhow::Result<Exit> {
    let page = session::write_report(&args.run)?;
    if Run::open(&args.run)?.summary().is_none() {
        tell(format_args!(
            "warning: {}: {}",
            args.run.display(),
            Notice::Unfinished
        ));
    }
    tell(page.path.display());
    if let Some(picture) = &args.picture {
        anyhow::ensure!(!picture.exists(), "{} exists already", picture.display());
        tell(session::hero(&args.run, picture)?.display());
    }
    Ok(Exit::Done)
}
