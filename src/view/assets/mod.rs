//! Files that our pages carry with them, so that they open without a network: an external chart script, unchanged, with its
//! licence.
//!
//! Nothing here is fetched, at build time or later. The report's and the live page's own script and style live with them.

/// uPlot 1.6.32, a chart script (MIT, Leon Sorokin): <https://github.com/leeoniya/uPlot>.
pub(crate) const CHART_SCRIPT: &str = include_str!("uplot.min.js");

/// The style that belongs to [`CHART_SCRIPT`].
pub(crate) const CHART_STYLE: &str = include_str!("uplot.min.css");

/// The licence of [`CHART_SCRIPT`]; every page with the script contains it.
pub(crate) const CHART_LICENCE: &str = include_str!("LICENSE-uplot.txt");
