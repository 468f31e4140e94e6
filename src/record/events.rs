//! `events.jsonl`: one JSON object per line, in the order of arrival.
//!
//! Every line has `tick`, `time` (test time in s), `wall` (RFC 3339 UTC with nanoseconds), `clock_ns` (the loop's
//! clock) and `event` (a name in snake_case), then what belongs to the event: `specimen` and `dof` count from 1, as in the
//! columns.

mod encoding;
mod kinds;
mod line;
mod payload;
mod sentence;

pub use kinds::Event;
pub use line::EventLine;
pub use payload::{LimitReached, Ready, Standing, TripValue, WarmUp, Word};
