//! `limits` of `summary.json`: the limits of a test, who checks them and what they cause.

use serde::{Deserialize, Deserializer, Serialize};

use gusset_actuator::geometry::LawPlace;

/// All limits of a test.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LimitFacts {
    /// Per specimen, in order.
    pub specimens: Vec<SpecimenLimits>,
    /// Limits that belong to no specimen alone.
    pub test: Vec<LimitFact>,
    /// Causes of a trip that need no key.
    pub always: Vec<String>,
    /// Effect of a trip.
    pub on_trip: String,
    /// End position of the specimens after the last step, or when the operator ends the test.
    pub at_end: String,
    /// How the specimens reach the start of the test, and come to rest in a hold.
    pub way_in: String,
    /// Effect of a missed deadline that trips nothing.
    pub on_miss: String,
    /// Why a specimen behind a link may lack limits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unlimited: Option<String>,
}

/// The limits of one specimen.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SpecimenLimits {
    /// Its name.
    pub name: String,
    /// The loading unit whose actuators the axes are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub geometry: Option<LoadingFacts>,
    /// Program that keeps them.
    pub checked_by: String,
    /// One list per axis; a missing quantity has no limit.
    pub axes: Vec<Vec<LimitFact>>,
    /// Treatment of stale measurements.
    pub stale: String,
    /// When the specimen's end holds because no command comes, and which program does it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub watchdog: Option<String>,
    /// Bounds of a simulated actuator and its sensors, and their effect.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ends: Option<String>,
    /// Whether a reversed or dead channel is looked for before the test.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction: Option<String>,
    /// Its position for "safe_displacement", in m, one number per axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub safe_disp_m: Option<Vec<f64>>,
}

/// One limit: a size, or a smallest and a largest value.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LimitFact {
    /// The key of the test file.
    pub key: String,
    /// SI.
    pub unit: String,
    /// Warned of beyond; empty: never.
    #[serde(deserialize_with = "levels")]
    pub warn: Vec<f64>,
    /// Tripped beyond; empty: never.
    #[serde(deserialize_with = "levels")]
    pub trip: Vec<f64>,
    /// Whether the specimen's end also receives and keeps the limit.
    pub also_at_the_specimen: bool,
    /// How it is judged, where that depends on other keys of the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub judged: Option<String>,
}

/// Levels, of which null is an end without a limit.
fn levels<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let found = Vec::<Option<f64>>::deserialize(deserializer)?;
    let without = |place: usize| match place {
        0 if found.len() > 1 => f64::NEG_INFINITY,
        _ => f64::INFINITY,
    };
    let levels = found.iter().enumerate();
    Ok(levels
        .map(|(place, level)| level.unwrap_or(without(place)))
        .collect())
}

/// A loading unit, as shown to the person who checks a test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LoadingFacts {
    /// "plane", "space" or "matrix".
    pub form: String,
    /// Whether strokes are exact, or those of small displacements.
    pub exact: bool,
    /// Whether the law and the estimates are of actuators or coordinates.
    pub law_at: LawPlace,
    /// Driven coordinates of the platform.
    pub coordinates: Vec<String>,
    /// Condition number of the Jacobian at the reference pose, rotations measured at the farthest joint.
    pub condition: f64,
    /// One entry per actuator.
    pub actuators: Vec<ActuatorFacts>,
}

/// An actuator at the reference pose, at the specimen's scale.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ActuatorFacts {
    /// Pin to pin, m; a matrix has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length_m: Option<f64>,
    /// Shortest and longest stroke, m; empty where there is no bound.
    pub stroke_m: Vec<f64>,
    /// Stroke in m per m or rad of each coordinate.
    pub slope: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn end_without_a_limit_is_read_again() {
        let limit = |trip: &[f64]| LimitFact {
            key: "command_disp_m".to_owned(),
            trip: trip.to_vec(),
            ..LimitFact::default()
        };
        for trip in [
            &[f64::NEG_INFINITY, 0.2][..],
            &[-0.1, f64::INFINITY],
            &[0.3],
            &[],
        ] {
            let text = serde_json::to_string(&limit(trip)).unwrap();
            assert_eq!(
                serde_json::from_str::<LimitFact>(&text).unwrap(),
                limit(trip),
                "{text}"
            );
        }
    }
}
