//! How large a model keeps its deadlines at a given rate: the models, the search and the picture. Nothing here keeps time:
//! the caller of the search runs the trials.

mod models;
mod picture;
mod search;

pub use models::{ModelError, Scalable, moment_frame};
pub use picture::{Mark, csv, svg};
pub use search::{Length, Point, Search, Trial, largest};
