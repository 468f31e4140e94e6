//! A gateway between a controller and a specimen: limits, faults, records, and the same numbers.

#[path = "../link_common/mod.rs"]
mod link_common;

mod faults;
mod lasting;
mod limits;
mod records;
mod same_bits;
mod whole_matrix;
