//! The page a run leaves behind, and the pictures that go with it.
//!
//! [`render`] makes one self-contained HTML file from a [`RunData`]: no network, light and dark, prints well. [`hero_svg`]
//! is one wide picture of a run, [`jitter_svg`] the histogram of the loop's own timing. [`metrics`] are the numbers
//! in them.
//!
//! Invariant: nothing here fails. A run without rows, with NaN in them, without a summary or killed in the middle still
//! gives a page that says what is missing; a user's text never becomes markup. Physics comes only from rows in
//! which the test was running: a structure's of ends of steps, a specimen's of all ticks (see `sieve`). No file is read or
//! written: the caller owns the run folder.
//!
//! | file | holds |
//! |---|---|
//! | `page`, `html`, `page.css`, `script.js` | the order of the page; its pieces; its looks; what makes histories zoomable |
//! | `outcome`, `left`, `tested`, `sketch`, `scale`, `limits` | the verdict in words; how specimens were left; what was tested; a picture of it; which numbers are of which end; what would have ended it |
//! | `ground`, `response`, `specimens`, `identified`, `courses`, `judged`, `falsified`, `balance`, `loops`, `timeline` | sections |
//! | `compare`, `overlays`, `matched` | the page of two runs; their rows, number against number |
//! | `source`, `sieve`, `holder`, `stale`, `digest`, `passes`, `first`, `axes`, `axis_end`, `tracked`, `shaking`, `worst`, `table` | rows read in blocks, and what is kept of them |
//! | `columns` | columns a digest reads |
//! | `pictures` | the pictures that stand alone |
//! | `plots`, `charts`, `lines`, `bars` | histories that can be zoomed; the frame of every picture; histories and loops; histograms |
//! | `curves` | several curves over one pair of axes |
//! | `axis`, `thin`, `canvas` | ranges and ticks; fewer points; SVG |
//! | `rows`, `histogram`, `text` | columns by name; timing counts; numbers as text |

mod axes;
mod axis;
mod axis_end;
mod balance;
mod bars;
mod canvas;
mod charts;
mod columns;
mod compare;
mod courses;
mod curves;
mod digest;
mod falsified;
mod first;
mod ground;
mod histogram;
mod holder;
#[cfg(test)]
mod holes;
mod html;
mod identified;
mod judged;
mod left;
mod limits;
mod lines;
mod loops;
mod matched;
mod outcome;
mod overlays;
mod page;
mod passes;
mod pictures;
mod plots;
mod response;
mod rows;
mod scale;
mod shaking;
mod sieve;
mod sketch;
mod source;
mod specimens;
mod stale;
#[cfg(test)]
mod synthetic;
mod table;
mod tested;
#[cfg(test)]
mod tests;
mod text;
mod thin;
mod timeline;
mod tracked;
mod worst;

pub use columns::Difference;
pub use compare::{compare, damages, verdict};
pub(crate) use curves::{Curve, Curves, Scale};
pub use digest::Digest;
pub use falsified::falsified;
pub use histogram::Percentiles;
pub(crate) use html::note;
pub use identified::{IdentifiedAxis, identified, missing_metrics, told, tracking_metrics};
pub use matched::{FirstDifference, Matched, Matcher, Next};
pub(crate) use page::frame;
pub use page::render;
pub use pictures::{hero_svg, jitter_svg};
pub use source::{BLOCK, Earlier, Source};
pub use tested::{drifts, ticks_per_step, without_disp};
pub(crate) use text::{count, escape};

use std::borrow::Cow;

pub use crate::metrics;
use crate::metrics::falsified::Mode;
use crate::record::{Column, EventLine};

/// Everything a report is made from: what a run folder holds, already read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RunData {
    /// Title of the test, as the user wrote it.
    pub title: String,
    /// The columns of the rows.
    pub columns: Vec<Column>,
    /// One vector per column, all rows in order; what does not exist is NaN. Empty where `digest` is given.
    pub data: Vec<Vec<f64>>,
    /// What a page needs of rows that are not held in memory.
    pub digest: Option<Digest>,
    /// Why there is no energy balance, if something is in its way.
    pub no_balance: Option<String>,
    /// Modes of the structure with what delays do to their damping; none without a structure.
    pub modes: Vec<Mode>,
    /// Why they are not known, if something is in the way.
    pub no_modes: Option<String>,
    /// Why no margin to a critical delay was watched, if none was.
    pub no_margin: Option<String>,
    /// `summary.json`, if there is one.
    pub summary: Option<serde_json::Value>,
    /// `timing.json`, if there is one.
    pub timing: Option<serde_json::Value>,
    /// The lines of `events.jsonl`.
    pub events: Vec<EventLine>,
    /// Lines of it that cannot be read.
    pub unreadable_events: usize,
    /// Why the folder counts as unfinished, if it does.
    pub unfinished: Option<String>,
    /// What of the rows is not there any more: damaged, cut off, cut out. Empty where all of them are as they were recorded.
    pub damaged: Vec<String>,
    /// Keys of the summary that the rows and events contradict, and a run that names itself as an ancestor, in words.
    pub contradicted: Vec<String>,
    /// Rows that are missing between the others.
    pub missing_rows: u64,
    /// Text of `resolved.toml`.
    pub resolved: String,
}

impl RunData {
    /// The digest: the one that is given, or that of the rows in memory.
    fn digested(&self) -> Cow<'_, Digest> {
        if let Some(digest) = &self.digest {
            return Cow::Borrowed(digest);
        }
        let memory = source::Memory {
            columns: &self.columns,
            data: &self.data,
            step_s: outcome::number(self, "dt"),
            ticks_per_step: ticks_per_step(&self.resolved),
            without_disp: without_disp(&self.events),
        };
        // Reading memory does not fail.
        Cow::Owned(Digest::of(&memory, &drifts(&self.resolved), None).unwrap_or_default())
    }
}
