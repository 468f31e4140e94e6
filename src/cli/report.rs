//! `gusset report`.

use super::ReportArgs;
use super::exit::Exit;
use crate::session;

/// Writes report.html again, from the run folder alone.
pub fn report(args: &ReportArgs) -> anyhow::Result<Exit> {
    let page = session::write_report(&args.run)?;
    eprintln!("{}", page.path.display());
    if let Some(picture) = &args.picture {
        anyhow::ensure!(!picture.exists(), "{} exists already", picture.display());
        eprintln!("{}", session::hero(&args.run, picture)?.display());
    }
    Ok(Exit::Done)
}
