//! The pages as a person sees them: headless Chromium opens them, looks and clicks. Where the browser is not installed these tests
//! print a clear message, and with CI=true they fail. `tools/test` installs it.

mod harness;
#[cfg(feature = "monitor")]
mod live;
mod manual;
mod report;
#[cfg(feature = "monitor")]
mod screen;
mod sections;
mod stage;
