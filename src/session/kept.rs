//! What became of the record while the test ran: others may have moved, deleted or changed what was being written.

use crate::config::Facts;
use crate::record::{Recorded, RunFolder, Whereabouts};

/// Finds the folder again; what was in one that is gone is lost.
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
            recorded.lose_all("the run folder was deleted while the test ran");
        }
    }
}
