//! Straight member between two points: its geometry, and its stiffness if it is elastic.

use super::MemberEnd;
use super::section::Rigidity;
use super::symmetric::Sym;

/// Matrix of both ends: x, y, rz of the start, then of the end.
pub(super) type Matrix = [[f64; 6]; 6];

/// A member between two points of a plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chord {
    pub(super) length: f64,
    /// Direction cosines of its axis.
    pub(super) cosines: [f64; 2],
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
        let Rigidity { axial, bending, .. } = of;
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

/// What stays linear in space beside the axial force and the bending about the strong axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beside {
    /// E I/L about the local axis y; 0 where that bending is not linear.
    pub(super) weak: f64,
    /// G J/L.
    pub(super) torsion: f64,
}

impl Beside {
    /// Adds its forces to q. Real-time: yes.
    pub(super) fn add(&self, disp: &[f64; 6], force: &mut [f64; 6]) {
        let [.., start, end, twist] = *disp;
        let [.., to_start, to_end, torque] = force;
        *to_start += self.weak * (4.0 * start + 2.0 * end);
        *to_end += self.weak * (2.0 * start + 4.0 * end);
        *torque += self.torsion * twist;
    }

    /// Adds its stiffness. Real-time: yes.
    pub(super) fn stiffen(&self, stiffness: &mut Sym<6>) {
        let [.., start, end, twist] = stiffness;
        let [.., own, other, _] = start;
        *own += 4.0 * self.weak;
        *other += 2.0 * self.weak;
        let [.., other, own, _] = end;
        *own += 4.0 * self.weak;
        *other += 2.0 * self.weak;
        twist[5] += self.torsion;
    }
}

/// A member between two points in space. Its local axis x goes from start to end, y is the direction of the depth of its section, and
/// z = x × y.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChordInSpace {
    pub(super) length: f64,
    /// Local axes.
    pub(super) axes: [[f64; 3]; 3],
    /// From each node to the end of the member.
    offsets: [[f64; 3]; 2],
}

/// Sine of the angle between a member and its `orientation` below which they are one line.
const ONE_LINE: f64 = 1e-6;

impl ChordInSpace {
    /// Between nodes at these places; `None` for a member without length, or along its `orientation`. By default that is the global z,
    /// or x for a member along z.
    pub(super) fn new(
        offsets: [[f64; 3]; 2],
        [start, end]: [[f64; 3]; 2],
        orientation: Option<[f64; 3]>,
    ) -> Option<Self> {
        let way = [0, 1, 2].map(|k| end[k] + offsets[1][k] - start[k] - offsets[0][k]);
        let (along, length) = unit(way)?;
        let across = |to: [f64; 3]| {
            let (to, _) = unit(to)?;
            let (normal, sine) = unit(cross(along, to))?;
            (sine > ONE_LINE).then(|| cross(normal, along))
        };
        let y = match orientation {
            Some(to) => across(to),
            None => across([0.0, 0.0, 1.0]).or_else(|| across([1.0, 0.0, 0.0])),
        }?;
        Some(Self {
            length,
            axes: [along, y, cross(along, y)],
            offsets,
        })
    }

    /// Rows: displacement of both ends along a local axis, or rotation about it; columns: displacements and rotations of both nodes.
    fn local(&self, end: usize, axis: usize, turns: bool) -> [f64; 12] {
        let mut row = [0.0; 12];
        let (to, offset) = (self.axes[axis], self.offsets[end]);
        // The end moves by u + θ × o.
        let lever = cross(offset, to);
        for k in 0..3 {
            if turns {
                row[6 * end + 3 + k] = to[k];
            } else {
                row[6 * end + k] = to[k];
                row[6 * end + 3 + k] = lever[k];
            }
        }
        row
    }

    /// Displacement of the end from the start along each local axis.
    pub(super) fn drifts(&self) -> [[f64; 12]; 3] {
        [0, 1, 2].map(|axis| {
            let (start, mut end) = (self.local(0, axis, false), self.local(1, axis, false));
            end.iter_mut()
                .zip(start)
                .for_each(|(end, start)| *end -= start);
            end
        })
    }

    /// Elongation; rotations of both ends from the chord about z, then about y; twist.
    pub(super) fn deformations(&self) -> [[f64; 12]; 6] {
        let [stretch, across, aside] = self.drifts();
        let turn = |end: usize, axis: usize, drift: [f64; 12], sign: f64| {
            let mut row = self.local(end, axis, true);
            let each = row.iter_mut().zip(drift);
            each.for_each(|(row, drift)| *row += sign * drift / self.length);
            row
        };
        let mut twist = self.local(1, 0, true);
        let each = twist.iter_mut().zip(self.local(0, 0, true));
        each.for_each(|(end, start)| *end -= start);
        [
            stretch,
            turn(0, 2, across, -1.0),
            turn(1, 2, across, -1.0),
            turn(0, 1, aside, 1.0),
            turn(1, 1, aside, 1.0),
            twist,
        ]
    }

    /// Stiffness of an elastic member of Bernoulli and Euler over its deformations; released ends bear no bending moment.
    pub(super) fn stiffness(&self, of: Rigidity, release: &[MemberEnd]) -> Sym<6> {
        let l = self.length;
        let mut k = [[0.0; 6]; 6];
        k[0][0] = of.axial / l;
        k[5][5] = of.torsion / l;
        for (at, bending) in [(1, of.bending / l), (3, of.weak / l)] {
            let pair = match [MemberEnd::Start, MemberEnd::End].map(|end| release.contains(&end)) {
                [false, false] => [4.0, 2.0, 4.0],
                [true, false] => [0.0, 0.0, 3.0],
                [false, true] => [3.0, 0.0, 0.0],
                [true, true] => [0.0; 3],
            };
            let [own, other, last] = pair.map(|factor| factor * bending);
            (k[at][at], k[at + 1][at + 1]) = (own, last);
            (k[at][at + 1], k[at + 1][at]) = (other, other);
        }
        k
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// The direction of a vector, and its length; none without length.
fn unit(of: [f64; 3]) -> Option<([f64; 3], f64)> {
    let length = libm::hypot(libm::hypot(of[0], of[1]), of[2]);
    (length > 0.0 && length.is_finite()).then(|| (of.map(|x| x / length), length))
}
