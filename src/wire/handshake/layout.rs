//! The layout in one canonical text, and its hash: both ends mean the same numbers in the same order.

use std::fmt::Write as _;

use sha2::{Digest, Sha256};

use super::Axis;
use crate::native::{HISTORY, VERSION};

/// The canonical text: one line for the frame layout, one for each axis, each ended by one line feed.
#[must_use]
pub(crate) fn layout_text(axes: &[Axis]) -> String {
    let mut text = format!(
        "gusset frames {VERSION} axes {} history {HISTORY}\n",
        axes.len()
    );
    for axis in axes {
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{}|{}|{}",
            axis.name,
            axis.disp_unit.symbol(),
            axis.force_unit.symbol()
        );
    }
    text
}

/// SHA-256 of [`layout_text`].
#[must_use]
pub fn layout_hash(axes: &[Axis]) -> [u8; 32] {
    Sha256::digest(layout_text(axes).as_bytes()).into()
}
