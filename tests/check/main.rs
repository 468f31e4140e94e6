//! `gusset check` and the verdict: mistakes in files, ground motions, stability, rehearsal and certificate.

#[path = "../common/mod.rs"]
mod common;
#[path = "../link_common/mod.rs"]
mod link_common;

mod bad_input;
mod bad_structure;
mod certificate;
mod components;
mod displacements;
mod errors;
mod frames;
mod gateway_config;
mod ground_motions;
mod link_config;
mod native_records;
mod reduction;
mod rehearsal;
mod served_files;
mod spectrum;
mod supports;
mod unstable_lambda;
mod verdict;
