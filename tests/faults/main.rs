//! The virtual laboratory: the real loop, link, far end, records and replay on simulated time, and everything that goes
//! wrong in a laboratory, by script and by chance.

mod campaign;
mod invariants;
mod lab;
mod scripts;
