//! The live page over HTTP, and all pages in a browser.

#[path = "../common/mod.rs"]
mod common;

mod browser;
#[cfg(feature = "monitor")]
mod live_page;
