//! Straight member between two points: its geometry, and its stiffness if it is elastic.

use super::MemberEnd;
use super::section::Rigidity;

/// Matrix of both ends: x, y, rz of the start, then of the end.
pub(super) type Matrix = [[f64; 6]; 6];

/// A member between two points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chord {
    pub(super) length: f64,
    /// Direction cosines of its axis.
    cosines: [f64; 2],
    /// From each node to the end of the member.
    offsets: [[f64; 2]; 2],
}

impl Chord {
    /// Between nodes at these places; `None` for a member without length.
    pub(super) fn new(offsets: [[f64; 2]; 2], [start, end]: [[f64; 2]; 2]) -> Option<Self> {
        let along = |k: usize| end[k] + offsets[1][k] - start[k] - offsets[0][k];
        let (dx, dy) = (along(0), along(1));
        let length = libm::hypot(dx, dy);
        (length > 0.0 && length.is_finite()).then(|| Self {
            length,
            cosines: [dx / length, dy / length],
            offsets,
        })
    }

    /// Stiffness of an elastic member of Bernoulli and Euler at its nodes.
    pub(super) fn stiffness(&self, of: Rigidity, release: &[MemberEnd]) -> Matrix {
        let Rigidity { axial, bending } = of;
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
        for (end, row) in [(MemberEnd::Start, 2), (MemberEnd::End, 5)] {
            if release.contains(&end) {
                condense(&mut local, row);
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

    /// Rows: elongation, and rotation of both ends from the chord; columns: displacements of the nodes.
    pub(super) fn deformations(&self) -> [[f64; 6]; 3] {
        let local = self.local_from_nodes();
        let across = |j: usize| (local[4][j] - local[1][j]) / self.length;
        let columns = [0, 1, 2, 3, 4, 5];
        [
            columns.map(|j| local[3][j] - local[0][j]),
            columns.map(|j| local[2][j] - across(j)),
            columns.map(|j| local[5][j] - across(j)),
        ]
    }

    /// Moments at both ends of the member, from the forces at its nodes.
    pub(super) fn moments(&self, at_nodes: [f64; 6]) -> [f64; 2] {
        let [x0, y0, start, x1, y1, end] = at_nodes;
        let [[ax, ay], [bx, by]] = self.offsets;
        [start - ax * y0 + ay * x0, end - bx * y1 + by * x1]
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
fn condense(matrix: &mut Matrix, row: usize) {
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
