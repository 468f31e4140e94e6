//! What all members share: quantities, times, names, findings, and the hinge between the loop and every specimen.
//!
//! [`time`] holds exact rates, the tick grid, the clock and its simulated twin. [`units`] writes a number with its unit.
//! [`catalog`] is the one table of each kind of name that a user sees: limits, events, phases, causes and columns. [`finding`] is a
//! mistake or a doubt at its place in a file. [`domain`] refuses a number that a key does not allow. [`npy`] reads an
//! array of NumPy. [`mod@state`] takes, digests and restores the state of a test as a value.
//! [`substructure`] is the trait of every specimen: a command goes out, a measurement comes back. [`text`] makes foreign text safe
//! to show. [`work`] reports the progress of a long computation.
//!
//! This member knows no file, no thread, no structure and no actuator. All other members use it, and it uses none of them. Begin
//! reading with [`substructure`].

pub mod catalog;
pub mod domain;
pub mod finding;
pub mod frame;
pub mod npy;
pub mod state;
pub mod substructure;
pub mod text;
pub mod time;
pub mod units;
pub mod work;

/// Asserts that a value matches a pattern, and shows the value if not. For the tests of all members, which compare the kind and
/// the numbers of an error instead of its wording.
#[doc(hidden)]
#[macro_export]
macro_rules! assert_is {
    ($found:expr => $($wanted:tt)+) => {{
        let found = $found;
        assert!(matches!(&found, $($wanted)+), "{found:?}");
    }};
}
