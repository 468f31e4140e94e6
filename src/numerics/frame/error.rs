//! What can be wrong with a frame. Places are keys of the test file beneath `structure.frame`, list entries from 0.

use thiserror::Error;

use super::Direction;
use crate::law::LawError;
use gusset_quantity::domain::OutOfDomain;

/// Why a description does not make a frame.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FrameError {
    /// No node with a free direction.
    #[error("a frame needs a node with a free direction")]
    Empty,
    /// Neither a plane nor a space frame.
    #[error("`dimension` is {0}, but must be 2 or 3")]
    Dimension(usize),
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
    #[error("`{key}` of section \"{section}\" is {found}, but must be {allowed}")]
    Section {
        /// Name of the section.
        section: String,
        /// The key.
        key: &'static str,
        /// The number.
        found: f64,
        /// The range, in words.
        allowed: &'static str,
    },
    /// A number that only a space frame needs.
    #[error("`{key}` of section \"{section}\" is missing: a space frame needs it")]
    NeededInSpace {
        /// Name of the section.
        section: String,
        /// The key.
        key: &'static str,
    },
    /// A list that does not have one number for each axis.
    #[error(
        "`{key}` has {found} numbers, but must have {wanted}: the frame has `dimension = {wanted}`"
    )]
    Coordinates {
        /// List of the entry, and its place from 0.
        at: (&'static str, usize),
        /// The key.
        key: &'static str,
        /// Numbers that it has.
        found: usize,
        /// Numbers that it needs.
        wanted: usize,
    },
    /// A direction that only a space frame has.
    #[error("`{key}` names the direction \"{}\", which only a frame with `dimension = 3` has", direction.word())]
    NotInPlane {
        /// List of the entry, and its place from 0.
        at: (&'static str, usize),
        /// The key.
        key: &'static str,
        /// The direction.
        direction: Direction,
    },
    /// A solid shape without a material, or with two.
    #[error(
        "section \"{section}\" has {} `young_pa` {} `material`: give one of them",
        if *both { "both" } else { "neither" },
        if *both { "and" } else { "nor" }
    )]
    OneMaterial {
        /// Name of the section.
        section: String,
        /// Both are given.
        both: bool,
    },
    /// A material that does not exist.
    #[error("there is no material \"{name}\"; the materials are {known}")]
    NoMaterial {
        /// Name of the section.
        section: String,
        /// The key.
        key: &'static str,
        /// The name given.
        name: String,
        /// Names that exist.
        known: String,
    },
    /// A number of a material outside its range.
    #[error("material \"{material}\": {source}")]
    Material {
        /// Name of the material.
        material: String,
        /// The number.
        source: OutOfDomain,
    },
    /// A law that cannot be built.
    #[error("\"{name}\": {source}")]
    Law {
        /// The table of hinges, or the list of links and the place in it.
        at: (&'static str, Option<usize>),
        /// Name of the hinge or link.
        name: String,
        /// Why.
        source: LawError,
    },
    /// A hinge whose law has no stiffness at rest, may be stiffer later, or damps.
    #[error(
        "hinge \"{name}\" needs the law `linear`, `bilinear`, `bouc_wen` or `imk`, with a stiffness at rest that no later one exceeds, and without damping"
    )]
    NotAHinge {
        /// Its name.
        name: String,
    },
    /// A hinge that does not exist.
    #[error("there is no hinge \"{name}\"; the hinges are {known}")]
    NoHinge {
        /// List of the entry, and its place from 0.
        at: (&'static str, usize),
        /// The key.
        key: &'static str,
        /// The name given.
        name: String,
        /// Names that exist.
        known: String,
    },
    /// A hinge that loses its moment faster than its member gives way.
    #[error(
        "the hinge of {name} softens with {found:.4e} N m/rad, but its member with 2 E I/L = {most:.4e} N m/rad must be stiffer: the moment would fall \
         without a motion of the nodes (snap-back)"
    )]
    SnapBack {
        /// Place of the member, from 0.
        index: usize,
        /// The key of the hinge.
        key: &'static str,
        /// Name of the member.
        name: String,
        /// Slope of the hinge in N m/rad.
        found: f64,
        /// 2 E I/L in N m/rad.
        most: f64,
    },
    /// A key that does not suit its member or link.
    #[error("{name} {why}")]
    Unfit {
        /// List of the entry, and its place from 0.
        at: (&'static str, usize),
        /// The key.
        key: &'static str,
        /// Name of the member or link.
        name: String,
        /// Why not.
        why: &'static str,
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
    /// A motion that no stiffness resists.
    #[error(
        "nothing holds direction {} of node \"{node}\": fix it, add a member, or release all but one of the members that meet there",
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

/// A number that must be finite.
pub(super) fn finite(
    at: (&'static str, usize),
    key: &'static str,
    found: f64,
) -> Result<f64, FrameError> {
    if found.is_finite() {
        return Ok(found);
    }
    Err(FrameError::Value {
        at,
        key,
        found,
        allowed: "finite",
    })
}

/// Names for a message.
pub(super) fn listed<'a>(names: impl Iterator<Item = &'a String>) -> String {
    let names: Vec<&str> = names.map(String::as_str).take(12).collect();
    names.join(", ")
}
