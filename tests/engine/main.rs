//! The loop in process, with specimens written for each test: startup, steps and ticks, limits, shutdown.

#[path = "../common/mod.rs"]
mod common;
#[path = "../link_common/mod.rs"]
mod link_common;

mod between_steps;
mod every_exit_retires;
mod lateness;
mod life_cycle;
mod pace;
mod retrace;
mod safety_limits;
mod shutdown;
mod slower_time;
mod stale_measurements;
mod startup;
mod static_load;
mod steps_by_rows;
mod wiring_check;
mod wiring_check_same_bits;
