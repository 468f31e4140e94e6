//! No compensation: the command is the target.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Compensator;
use gusset_quantity::state;

/// No compensation.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoneSpec {}

/// See [`NoneSpec`].
#[derive(Debug)]
pub(super) struct Plain;

state! { Plain as "none" {} }

impl Compensator for Plain {
    fn lead(&mut self, disp: f64, _: f64, _: f64) -> f64 {
        disp
    }

    fn reset(&mut self, _: f64) {}
}
