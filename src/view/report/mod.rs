//! The page a run leaves behind, and the pictures that go with it.
//!
//! [`render`] makes one self-contained HTML file from a [`RunView`]: no network, light and dark, prints well. [`hero_svg`]
//! is one wide picture of a run, [`jitter_svg`] the histogram of the loop's own timing. [`metrics`] are the numbers
//! in them.
//!
//! Invariant: nothing here fails. A run without rows, with NaN in them, without a summary or killed in the middle still
//! gives a page that names the missing parts; a user's text never becomes markup (its type escapes it). Physics comes only from rows in which
//! the test was running: a structure's from ends of steps, a specimen's from all ticks (see `row_filter`). No file is read or
//! written: the caller owns the run folder.
//!
//! | file | holds |
//! |---|---|
//! | `page`, `html`, `page.css`, `script.js` | the order of the page; the pieces of all pages; their looks; zoom, cursors and CSV |
//! | `chart`, `axis`, `thin` | all drawing: layers over two axes as SVG; ranges and ticks; fewer points |
//! | `outcome`, `end_positions`, `figures` | the verdict in words; end positions of specimens; key figures |
//! | `response`, `frame_shape`, `tracking`, `effect`, `identified`, `balance`, `timing` | sections of results |
//! | `tested`, `sketch`, `scale`, `ground`, `limits`, `events` | sections of the test: model, ends, ground motion, limits, events |
//! | `compare`, `matched` | the page of several runs; their rows, number against number |
//! | `source`, `row_filter`, `stale`, `digest`, `passes`, `first`, `series` | rows read in blocks, and the kept results |
//! | `axes`, `axis_end`, `tracked`, `shaking`, `farthest`, `worst`, `table` | kept results of axes, specimens and columns |
//! | `columns`, `rows`, `text` | columns a digest reads; columns by name; numbers as text |
//! | `pictures` | the separate pictures |

mod axes;
mod axis;
mod axis_end;
mod balance;
mod chart;
mod columns;
mod compare;
mod digest;
mod effect;
mod end_positions;
mod even;
mod events;
mod farthest;
mod figures;
mod first;
mod frame_shape;
mod ground;
mod html;
mod identified;
mod limits;
mod loop_line;
mod matched;
mod member_loops;
#[cfg(test)]
mod missing_rows;
mod outcome;
mod page;
mod passes;
mod pictures;
mod response;
mod row_filter;
mod rows;
mod scale;
mod series;
mod shaking;
mod sketch;
mod source;
mod stale;
#[cfg(test)]
mod synthetic;
mod table;
mod tested;
#[cfg(test)]
mod tests;
mod text;
mod thin;
mod timing;
mod tracked;
mod tracking;
mod worst;

pub use chart::{Chart, Look, Scale};
pub use compare::{compare, damages, doubts, verdict};
pub use digest::Digest;
pub use effect::effect;
pub use html::{
    banner, beside, definitions, details, filed, frame, header, note, section, table, table_of,
    tiles,
};
pub use identified::{
    IdentifiedAxis, followed, identified, missing_metrics, told, tracking_metrics,
};
pub use matched::{FirstDifference, Matched, Matcher, Next};
pub use page::render;
pub use pictures::{hero_svg, jitter_svg};
pub use source::{BLOCK, Earlier, Source};
pub use tested::without_disp;
pub use text::count;

use std::borrow::Cow;

pub use super::RunView;
pub use gusset_motion::metrics;

impl RunView {
    /// The digest: the one that is given, or that of the rows in memory.
    fn digested(&self) -> Cow<'_, Digest> {
        if let Some(digest) = &self.digest {
            return Cow::Borrowed(digest);
        }
        let memory = source::Memory {
            columns: &self.columns,
            data: &self.data,
            step_s: self.summary.as_ref().map(|summary| summary.dt),
            ticks_per_step: self.test.file.ticks_per_step(),
            without_disp: without_disp(&self.events),
        };
        // Reading memory does not fail.
        Cow::Owned(Digest::of(&memory, &self.test.file, None).unwrap_or_default())
    }
}
