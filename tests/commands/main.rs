//! The commands as users and scripts call them.

#[path = "../common/mod.rs"]
mod common;
#[path = "../tls_common/mod.rs"]
mod tls_common;

mod campaign;
mod campaign_faults;
mod campaign_study;
mod engines;
mod every_command;
mod every_study;
mod hyperqueue;
mod import;
mod new_and_list;
mod operator;
mod privileges;
mod slurm;
mod studies_with_a_server;
mod verify;
