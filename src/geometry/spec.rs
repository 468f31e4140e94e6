//! What the test file says of a loading unit.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::plane::PlaneArm;
use super::space::SpaceArm;
use super::{Coordinate, Form, Geometry, GeometryError, MOST, Six};

/// Where the actuators of a specimen are. Exactly one of `plane`, `space` and `matrix` is given.
///
/// With it, the axes of the specimen are actuators: commands, measurements, limits, compensation and `[[specimen.axis]]` are
/// of strokes in m, positive when an actuator gets longer, and of its force in N, positive as the resistance of a spring that
/// it stretches. `rows` (or `storey`) give the pose of the platform, one row per coordinate.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GeometrySpec {
    /// Which coordinates of the platform `rows` are, in their order: "ux", "uy", "uz" in m, "rx", "ry", "rz" in rad; in the
    /// plane "ux", "uy" and "rz". All others stay at zero. At most as many as actuators. Default: all of the plane for three
    /// actuators or more, all of space for six, "ux" for one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coordinates: Option<Vec<Coordinate>>,
    /// One to six actuators in the plane, one table each.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plane: Option<Vec<PlanePins>>,
    /// One to six actuators in space, one table each.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub space: Option<Vec<SpacePins>>,
    /// A transformation of your own: strokes = matrix · pose, one row per actuator and one column per coordinate, in m per m
    /// or per rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub matrix: Option<Vec<Vec<f64>>>,
    /// true: strokes are the changes of the distances between the pins, whatever the displacement. false: small
    /// displacements, by the Jacobian of the reference pose. Default: true; a matrix knows only small ones.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exact: Option<bool>,
    /// Whether `law`, `laws`, `coupled`, `stand_in`, `stiffness_n_per_m` and `damping_n_s_per_m` are of the platform's
    /// coordinates or of the single actuators.
    pub law_at: LawPlace,
}

/// Where a law stands, and what estimates are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LawPlace {
    /// At the platform, one axis per coordinate: the actuators feel it through their geometry.
    #[default]
    Platform,
    /// One axis per actuator.
    Actuators,
}

/// Pins of one actuator in the plane, at the specimen's scale.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanePins {
    /// Pin on the reaction frame: x and y from the control point at the reference pose, m.
    pub base_m: [f64; 2],
    /// Pin on the platform: x and y from the control point at the reference pose, m. Default: at the control point.
    #[serde(default)]
    pub joint_m: [f64; 2],
    /// Shortest and longest distance of the pins that the actuator allows, m. Default: unbounded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length_m: Option<[f64; 2]>,
}

/// Pins of one actuator in space, at the specimen's scale.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpacePins {
    /// Pin on the reaction frame: x, y and z from the control point at the reference pose, m.
    pub base_m: [f64; 3],
    /// Pin on the platform: x, y and z from the control point at the reference pose, m. Default: at the control point.
    #[serde(default)]
    pub joint_m: [f64; 3],
    /// Shortest and longest distance of the pins that the actuator allows, m. Default: unbounded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
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
    /// Number of actuators, as far as it is said.
    #[must_use]
    pub fn actuators(&self) -> usize {
        let plane = self.plane.as_ref().map(Vec::len);
        let space = self.space.as_ref().map(Vec::len);
        let matrix = self.matrix.as_ref().map(Vec::len);
        plane.or(space).or(matrix).unwrap_or(0)
    }

    /// Number of coordinates, as far as it is said.
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
            (Some(pins), ..) => in_plane(pins, coordinates, scale)?,
            (_, Some(pins), _) => in_space(pins, coordinates, scale)?,
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

fn in_plane(
    given: &[PlanePins],
    coordinates: Vec<Coordinate>,
    scale: f64,
) -> Result<Geometry, GeometryError> {
    let pins = given.iter().enumerate();
    let pins = pins.map(|(i, p)| Pins::new(i, scale, p.base_m, p.joint_m, p.length_m));
    between(
        pins,
        coordinates,
        PlaneArm::new,
        PlaneArm::length,
        Form::Plane,
    )
}

fn in_space(
    given: &[SpacePins],
    coordinates: Vec<Coordinate>,
    scale: f64,
) -> Result<Geometry, GeometryError> {
    let pins = given.iter().enumerate();
    let pins = pins.map(|(i, p)| Pins::new(i, scale, p.base_m, p.joint_m, p.length_m));
    between(
        pins,
        coordinates,
        SpaceArm::new,
        SpaceArm::length,
        Form::Space,
    )
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
