//! A gateway between a controller and a specimen: limits, faults, records, and the same numbers.

#[path = "../link_common/mod.rs"]
mod link_common;

mod faults;
mod lasting;
mod limits;
mod records;
mod same_bits;
mod whole_matrix;

use link_common::PATIENCE;

/// Waits until something is so; `else_what` it is after the patience of a test.
fn waits_for(else_what: &str, mut is_so: impl FnMut() -> bool) {
    let pause = std::time::Duration::from_millis(2);
    for _ in 0..PATIENCE.as_millis() / pause.as_millis() {
        if is_so() {
            return;
        }
        gusset_session::pause(pause);
    }
    panic!("{else_what}");
}
