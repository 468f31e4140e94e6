//! The family against closed forms, published values and independent formulations.

use super::*;

mod integrate;
