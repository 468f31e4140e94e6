//! State of the record after the test: other programs may have moved, deleted or changed its files meanwhile.

use gusset_record::{FolderError, Meddled, Recorded, Run, RunFolder, Whereabouts};
use gusset_setup::Facts;

/// Finds the folder again and counts unreadable parts as lost.
pub(super) fn look_over(folder: &mut RunFolder, facts: &mut Facts, recorded: &mut Recorded) {
    match folder.find_again() {
        Whereabouts::There => {}
        Whereabouts::Moved(place) => {
            let place = place.display();
            let text = format!("the run folder was moved to {place} while the test ran");
            tracing::warn!("{text}");
            facts.warnings.push(text);
        }
        Whereabouts::Gone => {
            let text = "the run folder was deleted while the test ran";
            tracing::error!("{text}");
            recorded.damaged.push(text.to_owned());
            recorded.lose(recorded.rows_written, text);
            return;
        }
    }
    let damaged = meddled(folder, recorded);
    let Some(first) = damaged.first() else {
        return;
    };
    let readable = readable(folder).unwrap_or(0);
    recorded.lose(recorded.rows_written.saturating_sub(readable), first);
    for text in &damaged {
        tracing::error!("{text}");
    }
    recorded.damaged = damaged;
}

/// Changes by others to the files, in sentences: to those of the writer, compared with their last state, and to those that are
/// needed to read or repeat a run.
fn meddled(folder: &RunFolder, recorded: &Recorded) -> Vec<String> {
    let at = |name: &str| folder.path().join(name);
    let written = recorded.files.iter().filter_map(|(name, extent)| {
        let meddled = extent.meddled_at(&at(name))?;
        Some(format!("{name} {meddled}"))
    });
    let needed = ["samples.json", "test.toml", "resolved.toml"];
    let inputs = folder.inputs().iter().map(|input| input.path.as_str());
    let gone = needed.into_iter().chain(inputs);
    let gone = gone.filter(|name| !at(name).exists());
    let gone = gone.map(|name| format!("{name} {}", Meddled::Deleted));
    written.chain(gone).collect()
}

/// Rows that a reader of the folder gets.
fn readable(folder: &RunFolder) -> Result<u64, FolderError> {
    let mut journal = Run::open(folder.path())?.journal()?;
    let mut rows = 0;
    // An unreadable row ends the rows, too.
    while let Ok(Some(_)) = journal.next_row() {
        rows += 1;
    }
    Ok(rows)
}
