//! The page a run leaves behind, and the pictures that go with it.
//!
//! [`render`] makes one self-contained HTML file from a [`RunView`]: no network, light and dark, prints well. [`hero_svg`]
//! is one wide picture of a run, [`jitter_svg`] the histogram of the loop's own timing. [`metrics`] are the numbers
//! in them.
//!
//! Invariant: nothing here fails. A run without rows, with NaN in them, without a summary or killed in the middle still
//! gives a page that names the missing parts; a user's text never becomes markup. Physics comes only from rows in which
//! the test was running: a structure's from ends of steps, a specimen's from all ticks (see `row_filter`). No file is read or
//! written: the caller owns the run folder.
//!
//! | file | holds |
//! |---|---|
//! | `page`, `html`, `page.css`, `script.js` | the order of the page; its pieces; its looks; zooming of histories |
//! | `outcome`, `end_positions`, `figures` | the verdict in words; end positions of specimens; key figures |
//! | `response`, `specimens`, `following`, `indices`, `courses`, `effect`, `identified`, `balance`, `timing` | sections of results |
//! | `tested`, `sketch`, `scale`, `ground`, `limits`, `events`, `timeline` | sections of the test: model, ends, ground motion, limits, events |
//! | `compare`, `paired`, `overlays`, `matched` | the page of two runs: values side by side, pictures; their rows, number against number |
//! | `source`, `row_filter`, `holder`, `stale`, `digest`, `passes`, `first` | rows read in blocks, and the kept results |
//! | `axes`, `axis_end`, `tracked`, `shaking`, `worst`, `table` | kept results of axes, specimens and columns |
//! | `columns` | columns a digest reads |
//! | `pictures` | the separate pictures |
//! | `plots`, `charts`, `lines`, `bars` | histories that can be zoomed; the frame of every picture; histories and loops; histograms |
//! | `curves`, `scatter` | several curves over one pair of axes; scatter pictures of all pairs |
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
mod effect;
mod end_positions;
mod events;
mod figures;
mod first;
mod following;
mod ground;
mod histogram;
mod holder;
mod html;
mod identified;
mod indices;
mod limits;
mod lines;
mod matched;
#[cfg(test)]
mod missing_rows;
mod outcome;
mod overlays;
mod page;
mod paired;
mod passes;
mod pictures;
mod plots;
mod response;
mod row_filter;
mod rows;
mod scale;
mod scatter;
mod shaking;
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
mod timing;
mod tracked;
mod worst;

pub use columns::Combination;
pub use compare::{compare, damages, doubts, verdict};
pub use curves::{Curve, Curves, Look, Scale};
pub use digest::Digest;
pub use effect::effect;
pub use html::{banner, definitions, details, note, section, table, tiles};
pub use identified::{
    IdentifiedAxis, followed, identified, missing_metrics, told, tracking_metrics,
};
pub use matched::{FirstDifference, Matched, Matcher, Next};
pub use page::frame;
pub use page::render;
pub use pictures::{hero_svg, jitter_svg};
pub use scatter::{ScatterMatrix, Variable};
pub use source::{BLOCK, Earlier, Source};
pub use tested::{storeys, without_disp};
pub use text::{count, escape};

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
            step_s: self.progress().dt,
            ticks_per_step: self.test.file.ticks_per_step(),
            without_disp: without_disp(&self.events),
        };
        // Reading memory does not fail.
        Cow::Owned(Digest::of(&memory, &storeys(&self.test.file), None).unwrap_or_default())
    }
}
