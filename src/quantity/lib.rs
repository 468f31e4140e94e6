//! quantity

pub mod catalog;
pub mod finding;
pub mod state;
pub mod substructure;
pub mod text;
pub mod time;
pub mod units;
pub mod work;
