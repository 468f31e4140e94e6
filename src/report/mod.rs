//! The page a run leaves behind, and the pictures that go with it.
//!
//! [`render`] makes one self-contained HTML file from a [`RunData`]: no network, light and dark, prints well. [`hero_svg`]
//! is one wide picture of a run, [`jitter_svg`] the histogram of the loop's own timing. [`metrics`] are the numbers
//! in them.
//!
//! Invariant: nothing here fails. A run without rows, with NaN in them, without a summary or killed in the middle still
//! gives a page that says what is missing; a user's text never becomes markup. Physics comes only from rows in
//! which the test was running (`state` 3). No file is read or written: the caller owns the run folder.
//!
//! | file | holds |
//! |---|---|
//! | `page`, `html`, `page.css` | the order of the page; its pieces; its looks |
//! | `outcome`, `tested` | the verdict in words; what was tested |
//! | `response`, `specimens`, `loops` | sections: computed side, measured side, the loop's timing and events |
//! | `pictures` | the pictures that stand alone |
//! | `charts`, `lines`, `bars` | the frame of every picture; histories and loops; histograms |
//! | `curves` | several curves over one pair of axes, for other pages than a run's |
//! | `axis`, `thin`, `canvas` | ranges and ticks; fewer points; SVG |
//! | `rows`, `histogram`, `text` | columns by name; timing counts; numbers as text |

mod axis;
mod bars;
mod canvas;
mod charts;
mod curves;
mod histogram;
mod html;
mod lines;
mod loops;
pub mod metrics;
mod outcome;
mod page;
mod pictures;
mod response;
mod rows;
mod specimens;
#[cfg(test)]
mod synthetic;
mod tested;
#[cfg(test)]
mod tests;
mod text;
mod thin;

pub(crate) use curves::{Curve, Curves, Scale};
pub use histogram::Percentiles;
pub(crate) use html::note;
pub(crate) use page::frame;
pub use page::render;
pub use pictures::{hero_svg, jitter_svg};
pub use specimens::{IdentifiedAxis, identified};
pub(crate) use text::escape;

use crate::record::Column;

/// Everything a report is made from: what a run folder holds, already read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RunData {
    /// Title of the test, as the user wrote it.
    pub title: String,
    /// The columns of the rows.
    pub columns: Vec<Column>,
    /// One vector per column, all rows in order; what does not exist is NaN.
    pub data: Vec<Vec<f64>>,
    /// `summary.json`, if there is one.
    pub summary: Option<serde_json::Value>,
    /// `timing.json`, if there is one.
    pub timing: Option<serde_json::Value>,
    /// The lines of `events.jsonl`.
    pub events: Vec<serde_json::Value>,
    /// Why the folder counts as unfinished, if it does.
    pub unfinished: Option<String>,
    /// Text of `resolved.toml`.
    pub resolved: String,
}
