//! `[specimen.geometry]`: a loading unit in the test file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::plane::PlaneArm;
use super::space::SpaceArm;
use super::{Coordinate, Form, Geometry, GeometryError, MOST, Six};

/// Positions of the actuators of a loading unit. Give exactly one of `plane`, `space` and `matrix`.
///
/// The axes of the specimen are then the actuators. Strokes are in m, positive when the actuator
/// extends. Forces are in N, positive if they resist the extension. Commands, measurements, limits,
/// compensation and `[[specimen.axis]]` refer to the actuators. `rows` or `storey` give the pose of
/// the platform, one row for each coordinate.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GeometrySpec {
    /// Coordinates of the platform, in the order of `rows`. All other coordinates stay zero.
    /// Default: "ux" for one actuator, the plane for three or more, all of space for six. Required
    /// in other cases.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!(["ux", "uy", "rz"]))]
    pub coordinates: Option<Vec<Coordinate>>,
    /// Actuators in the plane, one to six tables.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plane: Option<Vec<PlanePins>>,
    /// Actuators in space, one to six tables.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!([{"base_m": [-1.5, 0.0, 0.0], "joint_m": [-0.25, 0.0, 0.0]}]))]
    pub space: Option<Vec<SpacePins>>,
    /// Transformation from the pose to the strokes, for small displacements. Give one row for each
    /// actuator and one column for each coordinate, in m per m or m per rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = [[1.0, 0.0, 0.5], [0.0, 1.0, -0.6], [0.0, 1.0, 0.6]])]
    pub matrix: Option<Vec<Vec<f64>>>,
    /// If true, strokes follow from the exact distances between the pins. If false, they follow
    /// from the Jacobian at the reference pose, for small displacements. Default: true; false with
    /// `matrix`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = false)]
    pub exact: Option<bool>,
    /// Reference of the law and of the estimates of stiffness and damping: the platform or the
    /// actuators. It applies to `law`, `laws`, `coupled`, `stiffness_n_per_m` and
    /// `damping_n_s_per_m`.
    #[schemars(example = &"actuators")]
    pub law_at: LawPlace,
}

/// Reference of the law and of the estimates of a loading unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LawPlace {
    /// Coordinates of the platform, one law axis for each coordinate.
    #[default]
    Platform,
    /// Actuators, one law axis for each actuator.
    Actuators,
}

/// Pins of one actuator in the plane, at the specimen's scale.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanePins {
    /// Pin on the reaction frame, x and y from the control point at the reference pose.
    #[schemars(example = [-1.65, 0.05])]
    pub base_m: [f64; 2],
    /// Pin on the platform, x and y from the control point at the reference pose.
    #[serde(default)]
    #[schemars(example = [-0.25, 0.0])]
    pub joint_m: [f64; 2],
    /// Smallest and largest distance between the pins that the actuator allows. Default: unlimited.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [1.2, 1.6])]
    pub length_m: Option<[f64; 2]>,
}

/// Pins of one actuator in space, at the specimen's scale.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpacePins {
    /// Pin on the reaction frame, x, y and z from the control point at the reference pose.
    #[schemars(example = [-1.5, 0.0, 0.2])]
    pub base_m: [f64; 3],
    /// Pin on the platform, x, y and z from the control point at the reference pose.
    #[serde(default)]
    #[schemars(example = [-0.25, 0.0, 0.0])]
    pub joint_m: [f64; 3],
    /// Smallest and largest distance between the pins that the actuator allows. Default: unlimited.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [1.1, 1.5])]
    pub length_m: Option<[f64; 2]>,
}

/// Pins in m at the structure's scale, whatever the space.
struct Pins<const N: usize> {
    base: [f64; N],
    joint: [f64; N],
    length: Option<[f64; 2]>,
}

impl<const N: usize> Pins<N> {
    fn new(
        index: usize,
        scale: f64,
        base: [f64; N],
        joint: [f64; N],
        length: Option<[f64; 2]>,
    ) -> Result<Self, GeometryError> {
        let actuator = index + 1;
        for (key, pin) in [("base_m", base), ("joint_m", joint)] {
            if !pin.iter().all(|value| value.is_finite()) {
                return Err(GeometryError::NotFinite { actuator, key });
            }
        }
        if base == joint {
            return Err(GeometryError::NoLength { actuator });
        }
        Ok(Self {
            base: base.map(|value| value * scale),
            joint: joint.map(|value| value * scale),
            length: length.map(|range| range.map(|value| value * scale)),
        })
    }

    fn arm(&self) -> f64 {
        self.joint
            .iter()
            .map(|value| value * value)
            .sum::<f64>()
            .sqrt()
    }

    /// Strokes that `length_m` allows an actuator that is `length` long at the reference pose.
    fn strokes(&self, index: usize, length: f64) -> Result<[f64; 2], GeometryError> {
        match self.length {
            None => Ok([f64::NEG_INFINITY, f64::INFINITY]),
            Some([least, most]) if least > 0.0 && least <= length && length <= most => {
                Ok([least - length, most - length])
            }
            Some(range) => Err(GeometryError::Length {
                actuator: index + 1,
                length,
                range,
            }),
        }
    }
}

impl GeometrySpec {
    /// Number of actuators in the file.
    #[must_use]
    pub fn actuators(&self) -> usize {
        let plane = self.plane.as_ref().map(Vec::len);
        let space = self.space.as_ref().map(Vec::len);
        let matrix = self.matrix.as_ref().map(Vec::len);
        plane.or(space).or(matrix).unwrap_or(0)
    }

    /// Number of coordinates in the file.
    #[must_use]
    pub fn width(&self) -> usize {
        self.driven().map_or(0, |coordinates| coordinates.len())
    }

    /// The geometry with all lengths `scale` times as large.
    ///
    /// # Errors
    /// [`GeometryError`].
    pub fn build(&self, scale: f64) -> Result<Geometry, GeometryError> {
        let coordinates = self.driven()?;
        let exact = match (&self.plane, &self.space, &self.matrix) {
            (Some(given), ..) => {
                let each = given.iter().enumerate();
                let pins =
                    |(i, p): (_, &PlanePins)| Pins::new(i, scale, p.base_m, p.joint_m, p.length_m);
                let (arm, length) = (PlaneArm::new, PlaneArm::length);
                between(each.map(pins), coordinates, arm, length, Form::Plane)?
            }
            (_, Some(given), _) => {
                let each = given.iter().enumerate();
                let pins =
                    |(i, p): (_, &SpacePins)| Pins::new(i, scale, p.base_m, p.joint_m, p.length_m);
                let (arm, length) = (SpaceArm::new, SpaceArm::length);
                between(each.map(pins), coordinates, arm, length, Form::Space)?
            }
            (.., Some(rows)) => {
                if self.exact == Some(true) {
                    return Err(GeometryError::ExactMatrix);
                }
                return by_matrix(rows, coordinates, scale);
            }
            _ => return Err(GeometryError::Forms { found: 0 }),
        };
        if self.exact == Some(false) {
            return exact.small().map_err(GeometryError::Fault);
        }
        Ok(exact)
    }

    /// The coordinates that are driven.
    fn driven(&self) -> Result<Vec<Coordinate>, GeometryError> {
        let forms = [
            self.plane.as_ref().map(|pins| ("plane", pins.len())),
            self.space.as_ref().map(|pins| ("space", pins.len())),
            self.matrix.as_ref().map(|rows| ("matrix", rows.len())),
        ];
        let mut given = forms.into_iter().flatten();
        let (Some((key, actuators)), None) = (given.next(), given.next()) else {
            let found = forms.iter().flatten().count();
            return Err(GeometryError::Forms { found });
        };
        if !(1..=MOST).contains(&actuators) {
            let found = actuators;
            return Err(GeometryError::Count { key, found });
        }
        let is_plane = self.plane.is_some();
        let all: Vec<Coordinate> = if is_plane {
            vec![Coordinate::Ux, Coordinate::Uy, Coordinate::Rz]
        } else {
            Coordinate::ALL.to_vec()
        };
        let columns = self.matrix.as_ref().and_then(|rows| rows.first());
        let columns = columns.map_or(all.len(), Vec::len);
        let Some(named) = &self.coordinates else {
            return match actuators {
                _ if self.matrix.is_some() && columns == 1 => Ok(vec![Coordinate::Ux]),
                n if n >= columns && columns == all.len() => Ok(all),
                1 => Ok(vec![Coordinate::Ux]),
                _ => Err(GeometryError::Unsaid { key, actuators }),
            };
        };
        let refuse =
            |found: String, wanted: String| Err(GeometryError::Coordinates { found, wanted });
        let entries = |n: usize| format!("{n} {}", if n == 1 { "entry" } else { "entries" });
        if named.is_empty() || named.len() > actuators {
            let wanted = format!("{actuators} actuators can hold 1 to {actuators} coordinates");
            return refuse(entries(named.len()), wanted);
        }
        for (index, one) in named.iter().enumerate() {
            if named[..index].contains(one) {
                return refuse(format!("\"{}\" twice", one.key()), "once is enough".into());
            }
            if !all.contains(one) {
                let wanted = "the plane has \"ux\", \"uy\" and \"rz\"".into();
                return refuse(format!("\"{}\"", one.key()), wanted);
            }
        }
        Ok(named.clone())
    }
}

const OPEN: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// Actuators between `pins`, each made an arm of the `form`.
fn between<A, const N: usize>(
    pins: impl Iterator<Item = Result<Pins<N>, GeometryError>>,
    coordinates: Vec<Coordinate>,
    arm: impl Fn([f64; N], [f64; N]) -> A,
    length: impl Fn(&A) -> f64,
    form: impl FnOnce(Vec<A>) -> Form,
) -> Result<Geometry, GeometryError> {
    let (mut arms, mut lengths, mut strokes) = (Vec::new(), [f64::INFINITY; MOST], [OPEN; MOST]);
    let mut radius = 0.0f64;
    for (index, pins) in pins.enumerate() {
        let pins = pins?;
        let arm = arm(pins.base, pins.joint);
        lengths[index] = length(&arm);
        strokes[index] = pins.strokes(index, length(&arm))?;
        radius = radius.max(pins.arm());
        arms.push(arm);
    }
    let actuators = arms.len();
    Geometry::new(form(arms), coordinates, actuators, lengths, strokes, radius)
        .map_err(GeometryError::Fault)
}

fn by_matrix(
    given: &[Vec<f64>],
    coordinates: Vec<Coordinate>,
    scale: f64,
) -> Result<Geometry, GeometryError> {
    let mut rows: Vec<Six> = Vec::with_capacity(given.len());
    let mut radius = 0.0f64;
    for (index, row) in given.iter().enumerate() {
        if row.len() != coordinates.len() {
            return Err(GeometryError::Row {
                row: index + 1,
                found: row.len(),
                wanted: coordinates.len(),
            });
        }
        let mut six = [0.0; MOST];
        for ((to, from), coordinate) in six.iter_mut().zip(row).zip(&coordinates) {
            if !from.is_finite() {
                return Err(GeometryError::NotFinite {
                    actuator: index + 1,
                    key: "matrix",
                });
            }
            *to = if coordinate.is_rotation() {
                radius = radius.max(from.abs() * scale);
                from * scale
            } else {
                *from
            };
        }
        rows.push(six);
    }
    Geometry::linear(
        &rows,
        coordinates,
        [f64::INFINITY; MOST],
        [OPEN; MOST],
        radius,
    )
    .map_err(GeometryError::Fault)
}
