//! What can be wrong with a frame. Places are keys of the test file beneath `structure.frame`, list entries from 0.

use thiserror::Error;

use super::Direction;

/// Why a description does not make a frame.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FrameError {
    /// No node with a free direction.
    #[error("a frame needs a node with a free direction")]
    Empty,
    /// A number outside its range.
    #[error("`{key}` is {found}, but must be {allowed}")]
    Value {
        /// List of the entry, and its place from 0.
        at: (&'static str, usize),
        /// The key.
        key: &'static str,
        /// The number.
        found: f64,
        /// The range, in words.
        allowed: &'static str,
    },
    /// A number of a section outside its range.
    #[error("`{key}` of section \"{section}\" is {found}, but must be finite and greater than 0")]
    Section {
        /// Name of the section.
        section: String,
        /// The key.
        key: &'static str,
        /// The number.
        found: f64,
    },
    /// Two nodes with one name.
    #[error("two nodes have the name \"{name}\"")]
    SameName {
        /// Place of the second, from 0.
        index: usize,
        /// The name.
        name: String,
    },
    /// A node that does not exist.
    #[error("there is no node \"{name}\"; the nodes are {known}")]
    NoNode {
        /// List of the entry, and its place from 0.
        at: (&'static str, usize),
        /// The name given.
        name: String,
        /// Names that exist.
        known: String,
    },
    /// A section that does not exist.
    #[error("there is no section \"{name}\"; the sections are {known}")]
    NoSection {
        /// Place of the member, from 0.
        index: usize,
        /// The name given.
        name: String,
        /// Names that exist.
        known: String,
    },
    /// A member without length.
    #[error("{member} has no length: its ends lie at one place")]
    NoLength {
        /// Place of the member, from 0.
        index: usize,
        /// Its name.
        member: String,
    },
    /// A direction that follows twice, or is fixed and follows.
    #[error("direction {} of node \"{node}\" {why}", direction.word())]
    Constrained {
        /// Place of the constraint, from 0.
        index: usize,
        /// The node.
        node: String,
        /// The direction.
        direction: Direction,
        /// Why it cannot follow.
        why: &'static str,
    },
    /// Members with P-Δ effect in a frame that does not stand by itself.
    #[error(
        "the axial forces of members with `p_delta` are not known: direction {} of node \"{node}\" is held by no member",
        direction.word()
    )]
    Loose {
        /// The node.
        node: String,
        /// The direction.
        direction: Direction,
    },
    /// A frame that buckles.
    #[error(
        "the frame buckles at {share:.3} of its static loads: direction {} of node \"{node}\" moves most",
        direction.word()
    )]
    Buckles {
        /// Share of the loads.
        share: f64,
        /// The node.
        node: String,
        /// The direction.
        direction: Direction,
    },
}
