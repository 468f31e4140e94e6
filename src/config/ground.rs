//! Components of a ground acceleration: one table or a list, their directions, and the names of their columns.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use super::document::KeyPath;
use gusset_motion::{Motion, Processing, Signal};
use gusset_numerics::frame::Direction;
use gusset_numerics::model::StructureSpec;

/// Components of the ground acceleration, as one table or as a list of tables.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum GroundMotions {
    /// One table.
    One(Box<GroundComponent>),
    /// A list of tables; none without a ground acceleration.
    List(Vec<GroundComponent>),
}

impl Default for GroundMotions {
    fn default() -> Self {
        Self::List(Vec::new())
    }
}

/// Component of the ground acceleration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GroundComponent {
    /// Direction of the component. A frame knows the influence vector of each direction. For other
    /// structures give `influence` too. Default: x for a frame, none for others.
    #[schemars(example = &"x")]
    pub direction: Option<GroundDirection>,
    /// Influence vector ι, one number for each DOF. Default: that of the direction of a frame, or the
    /// influence vector of the structure for a single component.
    #[schemars(example = [1.0, 1.0, 0.0])]
    pub influence: Option<Vec<f64>>,
    /// Time history of the acceleration.
    pub signal: Signal,
    /// Processing of the time history before the test, for example scaling.
    #[serde(default)]
    pub processing: Processing,
    /// Time by which the component starts later than the test. It is zero before.
    #[serde(default)]
    #[schemars(example = 0.4)]
    pub delay_s: f64,
}

/// Direction of a component of the ground acceleration.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum GroundDirection {
    /// First horizontal direction.
    X,
    /// Second direction: vertical in a plane frame, else horizontal.
    Y,
    /// Vertical direction of a structure that is not a plane frame.
    Z,
}

impl GroundDirection {
    /// The direction as a test file spells it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
        }
    }

    /// The direction of the nodes of a frame; a plane one has no z.
    #[must_use]
    pub const fn of_frame(self) -> Direction {
        match self {
            Self::X => Direction::X,
            Self::Y => Direction::Y,
            Self::Z => Direction::Z,
        }
    }

    /// True for a vertical direction of the structure, which may be a plane frame.
    #[must_use]
    pub(crate) fn is_vertical(self, is_plane_frame: bool) -> bool {
        self == Self::Z || (is_plane_frame && self == Self::Y)
    }
}

/// A recorded column of the ground acceleration: the sum of the components of one direction, or one component.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GroundTrack {
    /// End of the name of the column: empty for a single ground motion, else a direction or the number of the component.
    pub suffix: String,
    /// Its components, from 0.
    pub components: Vec<usize>,
}

impl GroundMotions {
    /// The components.
    #[must_use]
    pub fn all(&self) -> &[GroundComponent] {
        match self {
            Self::One(one) => std::slice::from_ref(one),
            Self::List(list) => list,
        }
    }

    /// True without a ground acceleration.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.all().is_empty()
    }

    /// Place of a component, from 0; `at` is that of `[excitation]`.
    #[must_use]
    pub fn place(&self, at: &KeyPath, component: usize) -> KeyPath {
        let at = at.key("ground_acceleration");
        match self {
            Self::One(_) => at,
            Self::List(_) => at.index(component),
        }
    }

    /// The recorded columns, in the order of the components.
    #[must_use]
    pub fn tracks(&self) -> Vec<GroundTrack> {
        let all = self.all();
        let mut tracks: Vec<GroundTrack> = Vec::new();
        let by_direction = all.iter().all(|one| one.direction.is_some());
        for (index, component) in all.iter().enumerate() {
            let suffix = match component.direction.filter(|_| by_direction) {
                Some(direction) => direction.word().to_owned(),
                None => (index + 1).to_string(),
            };
            match tracks.iter_mut().find(|known| known.suffix == suffix) {
                Some(known) => known.components.push(index),
                None => tracks.push(GroundTrack {
                    suffix,
                    components: vec![index],
                }),
            }
        }
        if let [only] = tracks.as_mut_slice() {
            only.suffix.clear();
        }
        tracks
    }

    /// Components that are not vertical, from 0.
    #[must_use]
    pub fn horizontal(&self, is_plane_frame: bool) -> Vec<usize> {
        let is_vertical = |one: &GroundComponent| {
            one.direction
                .is_some_and(|direction| direction.is_vertical(is_plane_frame))
        };
        let all = self.all().iter().enumerate();
        all.filter(|(_, one)| !is_vertical(one))
            .map(|(index, _)| index)
            .collect()
    }
}

impl GroundComponent {
    /// The motion of the component.
    #[must_use]
    pub fn motion(&self) -> Motion {
        Motion {
            signal: self.signal.clone(),
            processing: self.processing.clone(),
            delay_s: self.delay_s,
        }
    }

    /// The influence vector that the component or its direction gives; none for the default of the structure.
    #[must_use]
    pub fn influence_in(&self, structure: &StructureSpec) -> Option<Vec<f64>> {
        if self.influence.is_some() {
            return self.influence.clone();
        }
        let StructureSpec::Frame(frame) = structure else {
            return None;
        };
        Some(frame.influence_in(self.direction?.of_frame()))
    }
}

impl<'de> Deserialize<'de> for GroundMotions {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrList;
        impl<'de> Visitor<'de> for OneOrList {
            type Value = GroundMotions;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a table, or a list of tables with one for each component")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<GroundMotions, A::Error> {
                let one = GroundComponent::deserialize(MapAccessDeserializer::new(map))?;
                Ok(GroundMotions::One(Box::new(one)))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<GroundMotions, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(seq)).map(GroundMotions::List)
            }
        }
        deserializer.deserialize_any(OneOrList)
    }
}

impl JsonSchema for GroundMotions {
    fn schema_name() -> Cow<'static, str> {
        "GroundMotions".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let one = generator.subschema_for::<GroundComponent>();
        json_schema!({
            "anyOf": [one, { "type": "array", "items": one }],
        })
    }
}
