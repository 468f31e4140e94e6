//! Elastic member of Bernoulli and Euler, and its section.

use super::{FrameError, MemberEnd, MemberSpec, SectionSpec};

/// Matrix of both ends: x, y, rz of the start, then of the end.
pub(super) type Matrix = [[f64; 6]; 6];

/// Stiffness along and across a member: E A and E I.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rigidity {
    pub axial: f64,
    pub bending: f64,
}

impl SectionSpec {
    pub(super) fn rigidity(&self, name: &str) -> Result<Rigidity, FrameError> {
        let positive = |key: &'static str, found: f64| {
            if found > 0.0 && found.is_finite() {
                return Ok(found);
            }
            Err(FrameError::Section {
                section: name.to_owned(),
                key,
                found,
            })
        };
        let (young, area, inertia) = match self {
            Self::Elastic(section) => (
                section.young_pa,
                positive("area_m2", section.area_m2)?,
                positive("inertia_m4", section.inertia_m4)?,
            ),
            Self::Rectangle(section) => {
                let width = positive("width_m", section.width_m)?;
                let depth = positive("depth_m", section.depth_m)?;
                (
                    section.young_pa,
                    width * depth,
                    width * depth * depth * depth / 12.0,
                )
            }
            Self::IShape(section) => {
                let depth = positive("depth_m", section.depth_m)?;
                let width = positive("flange_width_m", section.flange_width_m)?;
                let flange = positive("flange_thickness_m", section.flange_thickness_m)?;
                let web = positive("web_thickness_m", section.web_thickness_m)?;
                // A web remains between the flanges.
                let clear = positive("depth_m", depth - 2.0 * flange)?;
                let beside = positive("flange_width_m", width - web)?;
                let cube = |value: f64| value * value * value;
                (
                    section.young_pa,
                    width * depth - beside * clear,
                    (width * cube(depth) - beside * cube(clear)) / 12.0,
                )
            }
        };
        let young = positive("young_pa", young)?;
        Ok(Rigidity {
            axial: young * area,
            bending: young * inertia,
        })
    }
}

/// A member between two points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Member {
    length: f64,
    /// Direction cosines of its axis.
    cosines: [f64; 2],
    /// From each node to the end of the member.
    offsets: [[f64; 2]; 2],
    rigidity: Rigidity,
    released: [bool; 2],
}

impl Member {
    /// Between nodes at these places; `None` for a member without length.
    pub(super) fn new(
        spec: &MemberSpec,
        [start, end]: [[f64; 2]; 2],
        rigidity: Rigidity,
    ) -> Option<Self> {
        let offsets = [spec.offset_start_m, spec.offset_end_m];
        let along = |k: usize| end[k] + offsets[1][k] - start[k] - offsets[0][k];
        let (dx, dy) = (along(0), along(1));
        let length = libm::hypot(dx, dy);
        (length > 0.0 && length.is_finite()).then(|| Self {
            length,
            cosines: [dx / length, dy / length],
            offsets,
            rigidity,
            released: [MemberEnd::Start, MemberEnd::End].map(|end| spec.release.contains(&end)),
        })
    }

    /// Stiffness at its nodes.
    pub(super) fn stiffness(&self) -> Matrix {
        let Rigidity { axial, bending } = self.rigidity;
        let l = self.length;
        let (a, b, c) = (
            axial / l,
            12.0 * bending / (l * l * l),
            6.0 * bending / (l * l),
        );
        let (d, e) = (4.0 * bending / l, 2.0 * bending / l);
        let mut local = [
            [a, 0.0, 0.0, -a, 0.0, 0.0],
            [0.0, b, c, 0.0, -b, c],
            [0.0, c, d, 0.0, -c, e],
            [-a, 0.0, 0.0, a, 0.0, 0.0],
            [0.0, -b, -c, 0.0, b, -c],
            [0.0, c, e, 0.0, -c, d],
        ];
        for (released, row) in self.released.into_iter().zip([2, 5]) {
            if released {
                release(&mut local, row);
            }
        }
        self.at_nodes(&local)
    }

    /// Stiffness that an axial force (tension positive) adds at the displaced ends, N/L across the member.
    pub(super) fn geometric_stiffness(&self, force: f64) -> Matrix {
        let k = force / self.length;
        let mut local = [[0.0; 6]; 6];
        for (i, j, value) in [(1, 1, k), (1, 4, -k), (4, 1, -k), (4, 4, k)] {
            local[i][j] = value;
        }
        self.at_nodes(&local)
    }

    /// Axial force for displacements of its nodes, tension positive.
    pub(super) fn axial_force(&self, nodes: &[f64; 6]) -> f64 {
        let rows = self.local_from_nodes();
        let local = |row: usize| -> f64 { (0..6).map(|j| rows[row][j] * nodes[j]).sum() };
        self.rigidity.axial / self.length * (local(3) - local(0))
    }

    /// Rows: displacements along and across the member and rotation of both ends; columns: those of the nodes.
    fn local_from_nodes(&self) -> Matrix {
        let [c, s] = self.cosines;
        let mut rows = [[0.0; 6]; 6];
        for (end, [ox, oy]) in self.offsets.into_iter().enumerate() {
            let at = 3 * end;
            // The end moves by x − oy rz and y + ox rz.
            rows[at][at] = c;
            rows[at][at + 1] = s;
            rows[at][at + 2] = s * ox - c * oy;
            rows[at + 1][at] = -s;
            rows[at + 1][at + 1] = c;
            rows[at + 1][at + 2] = c * ox + s * oy;
            rows[at + 2][at + 2] = 1.0;
        }
        rows
    }

    fn at_nodes(&self, local: &Matrix) -> Matrix {
        let t = self.local_from_nodes();
        let mut out = [[0.0; 6]; 6];
        for (i, row) in out.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                for (p, t_p) in t.iter().enumerate() {
                    for (q, t_q) in t.iter().enumerate() {
                        *value += t_p[i] * local[p][q] * t_q[j];
                    }
                }
            }
        }
        out
    }
}

/// Takes the moment of one end out by static condensation.
fn release(matrix: &mut Matrix, row: usize) {
    let pivot = matrix[row][row];
    // Both ends released: nothing is left to turn this one.
    if pivot <= 0.0 {
        return;
    }
    let own = matrix[row];
    for other in matrix.iter_mut() {
        let share = other[row] / pivot;
        for (value, from) in other.iter_mut().zip(own) {
            *value -= share * from;
        }
        other[row] = 0.0;
    }
    matrix[row] = [0.0; 6];
}
