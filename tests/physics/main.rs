//! Computed responses against closed forms, other methods, published values and known actuators.

#[path = "../common/mod.rs"]
mod common;
#[path = "../link_common/mod.rs"]
mod link_common;

mod companions;
mod components;
mod frames;
mod frames_of_reference;
mod geometry;
mod hybrid_is_monolithic;
mod identify;
mod independent;
mod massless;
mod paper;
mod prescribed;
mod reduction;
mod supports;
mod tracking_effect;
mod transfer;
