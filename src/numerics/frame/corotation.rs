//! Large motions of a member: its deformations against a frame that goes and turns with it, and their derivatives.
//!
//! In a plane these are closed forms (Crisfield 1991, Non-linear Finite Element Analysis of Solids and Structures, volume 1, section 7.3).
//! In space the rotations of a node are its rotation vector. Axis x of the moving frame lies along the chord, and the mean of the axes
//! y of both ends is in its plane x–y (Battini & Pacoste 2002, Comput. Methods Appl. Mech. Eng. 191). The derivatives are those of
//! the formulas themselves, carried along by dual numbers, so the forces at the nodes do the work of the deformations exactly.

use super::member::{Chord, ChordInSpace};

/// Deformations, and their derivatives with respect to the displacements and rotations of both nodes: six in a plane, twelve in space.
pub(super) type Deformed = ([f64; 6], [[f64; 12]; 6]);

/// A member that may move far.
#[derive(Debug, Clone, Copy)]
pub(super) enum Corotation {
    Plane(Chord),
    Space(ChordInSpace),
}

impl Corotation {
    /// At displacements and rotations of both nodes. Real-time: yes.
    pub(super) fn at(&self, moved: &[f64; 12]) -> Deformed {
        match self {
            Self::Plane(chord) => in_plane(chord, moved),
            Self::Space(chord) => in_space(chord, moved),
        }
    }

    /// Length of the chord at this elongation. Real-time: yes.
    pub(super) const fn length(&self, stretch: f64) -> f64 {
        stretch
            + match self {
                Self::Plane(chord) => chord.length,
                Self::Space(chord) => chord.length,
            }
    }

    /// Cosine of the rotation of its axis since rest, from the derivatives of the elongation. Real-time: yes.
    pub(super) fn cosine(&self, slopes: &[[f64; 12]; 6]) -> f64 {
        let [along, ..] = slopes;
        match self {
            Self::Plane(chord) => along[3] * chord.cosines[0] + along[4] * chord.cosines[1],
            Self::Space(chord) => (along.iter().skip(6).zip(&chord.axes[0]))
                .map(|(now, rest)| now * rest)
                .sum(),
        }
    }

    /// t: how much less than its ends the chord turns about z, and about y, for each displacement of both nodes. With a, the
    /// derivatives of the elongation, the forces of a member of length l add N l t tᵀ − (M₁ + M₂)/l (a tᵀ + t aᵀ) to its stiffness for
    /// each of both, which is complete in a plane. Real-time: yes.
    pub(super) fn turns(&self, slopes: &[[f64; 12]; 6]) -> [[f64; 12]; 2] {
        let [_, start, end, weak_start, weak_end, _] = slopes;
        [(start, end), (weak_start, weak_end)].map(|(start, end)| {
            let mut turn = [0.0; 12];
            for (k, (turn, (start, end))) in turn.iter_mut().zip(start.iter().zip(end)).enumerate()
            {
                let displaces = match self {
                    Self::Plane(_) => k % 3 < 2,
                    Self::Space(_) => k % 6 < 3,
                };
                if displaces {
                    *turn = 0.5 * (start + end);
                }
            }
            turn
        })
    }
}

fn in_plane(chord: &Chord, moved: &[f64; 12]) -> Deformed {
    let [x0, y0, first, x1, y1, second, ..] = *moved;
    let [ex, ey] = chord.cosines;
    let length = chord.length;
    let (dx, dy) = (x1 - x0, y1 - y0);
    let (wx, wy) = (length * ex + dx, length * ey + dy);
    let now = libm::hypot(wx, wy);
    let (c, s) = (wx / now, wy / now);
    // Without the difference of two lengths.
    let stretch = (2.0 * length * (ex * dx + ey * dy) + dx * dx + dy * dy) / (now + length);
    let (cosine, sine) = (ex * c + ey * s, ex * s - ey * c);
    let from_chord = |turn: f64| {
        let (sin, cos) = libm::sincos(turn);
        libm::atan2(sin * cosine - cos * sine, cos * cosine + sin * sine)
    };
    let mut rows = [[0.0; 12]; 6];
    let (zx, zy) = (-s / now, c / now);
    let [along, start, end, ..] = &mut rows;
    [along[0], along[1], along[3], along[4]] = [-c, -s, c, s];
    [start[0], start[1], start[2], start[3], start[4]] = [zx, zy, 1.0, -zx, -zy];
    [end[0], end[1], end[3], end[4], end[5]] = [zx, zy, -zx, -zy, 1.0];
    let disp = [
        stretch,
        from_chord(first),
        from_chord(second),
        0.0,
        0.0,
        0.0,
    ];
    (disp, rows)
}

/// A number and its derivatives.
#[derive(Debug, Clone, Copy)]
struct Dual {
    value: f64,
    slopes: [f64; 12],
}

impl Dual {
    const fn fixed(value: f64) -> Self {
        let slopes = [0.0; 12];
        Self { value, slopes }
    }

    /// value + Σ factor · of
    fn combined(value: f64, [a, b]: [(f64, &Self); 2]) -> Self {
        let mut slopes = [0.0; 12];
        for (to, (x, y)) in slopes.iter_mut().zip(a.1.slopes.iter().zip(&b.1.slopes)) {
            *to = a.0 * x + b.0 * y;
        }
        Self { value, slopes }
    }

    /// A function of it, by value and derivative.
    fn map(&self, value: f64, slope: f64) -> Self {
        Self {
            value,
            slopes: self.slopes.map(|x| slope * x),
        }
    }

    fn plus(&self, other: &Self) -> Self {
        Self::combined(self.value + other.value, [(1.0, self), (1.0, other)])
    }

    fn minus(&self, other: &Self) -> Self {
        Self::combined(self.value - other.value, [(1.0, self), (-1.0, other)])
    }

    fn times(&self, other: &Self) -> Self {
        let value = self.value * other.value;
        Self::combined(value, [(other.value, self), (self.value, other)])
    }

    fn scaled(&self, factor: f64) -> Self {
        self.map(factor * self.value, factor)
    }

    fn sqrt(&self) -> Self {
        let root = self.value.sqrt();
        self.map(root, 0.5 / root)
    }

    fn inverse(&self) -> Self {
        let inverse = 1.0 / self.value;
        self.map(inverse, -inverse * inverse)
    }
}

type Vector = [Dual; 3];

fn dot(a: &Vector, b: &Vector) -> Dual {
    let [x, y, z] = [0, 1, 2].map(|k| a[k].times(&b[k]));
    x.plus(&y).plus(&z)
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i].times(&b[j]).minus(&a[j].times(&b[i])))
}

fn unit(of: &Vector) -> Vector {
    let inverse = dot(of, of).sqrt().inverse();
    of.each_ref().map(|x| x.times(&inverse))
}

/// Below this square of an angle its functions are their series, to the last digits.
const SMALL: f64 = 1e-3;

/// sin t/t and (1 − cos t)/t² with their derivatives, of s = t².
fn of_angle(s: f64) -> [(f64, f64); 2] {
    if s < SMALL {
        return [
            (
                1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0)),
                -1.0 / 6.0 + s / 60.0 * (1.0 - s / 28.0 * (1.0 - s / 54.0)),
            ),
            (
                0.5 - s / 24.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0)),
                -1.0 / 24.0 + s / 360.0 * (1.0 - 3.0 * s / 112.0 * (1.0 - s / 67.5)),
            ),
        ];
    }
    let t = s.sqrt();
    let (sin, cos) = libm::sincos(t);
    let (a, b) = (sin / t, (1.0 - cos) / s);
    [(a, (cos - a) / (2.0 * s)), (b, (a - 2.0 * b) / (2.0 * s))]
}

/// asin(t)/t with its derivative, of s = t²; no number for an angle of 90° or more.
fn of_sine(s: f64) -> (f64, f64) {
    if s < SMALL {
        return (
            1.0 + s / 6.0 * (1.0 + 0.45 * s * (1.0 + 25.0 / 42.0 * s)),
            1.0 / 6.0 + 0.15 * s * (1.0 + 25.0 / 28.0 * s * (1.0 + 49.0 / 54.0 * s)),
        );
    }
    let t = s.sqrt();
    let g = libm::asin(t) / t;
    (g, (1.0 / (1.0 - s).sqrt() - g) / (2.0 * s))
}

/// The vector turned by a rotation vector: v + A θ × v + B θ × (θ × v).
fn turned(by: &Vector, [a, b]: &[Dual; 2], of: [f64; 3]) -> Vector {
    let of = of.map(Dual::fixed);
    let once = cross(by, &of);
    let twice = cross(by, &once);
    [0, 1, 2].map(|k| of[k].plus(&a.times(&once[k])).plus(&b.times(&twice[k])))
}

fn in_space(chord: &ChordInSpace, moved: &[f64; 12]) -> Deformed {
    let mut at = [Dual::fixed(0.0); 12];
    for (k, (at, value)) in at.iter_mut().zip(moved).enumerate() {
        at.value = *value;
        if let Some(own) = at.slopes.get_mut(k) {
            *own = 1.0;
        }
    }
    let [x0, y0, z0, rx0, ry0, rz0, x1, y1, z1, rx1, ry1, rz1] = at;
    let axes = chord.axes;
    let length = Dual::fixed(chord.length);
    let apart = [x1.minus(&x0), y1.minus(&y0), z1.minus(&z0)];
    let way = axes[0].map(|x| Dual::fixed(x * chord.length));
    let now = [0, 1, 2].map(|k| way[k].plus(&apart[k]));
    let square = dot(&way, &apart).scaled(2.0).plus(&dot(&apart, &apart));
    let sum = dot(&now, &now).sqrt().plus(&length);
    let stretch = square.times(&sum.inverse());
    let ends = [[rx0, ry0, rz0], [rx1, ry1, rz1]].map(|turn| {
        let s = dot(&turn, &turn);
        let functions = of_angle(s.value).map(|(value, slope)| s.map(value, slope));
        axes.map(|axis| turned(&turn, &functions, axis))
    });
    let along = unit(&now);
    let mean = [0, 1, 2].map(|k| ends[0][1][k].plus(&ends[1][1][k]));
    let aside = unit(&cross(&along, &mean));
    let across = cross(&aside, &along);
    let frame = [along, across, aside];
    let [first, second] = ends.map(|own| {
        // Half of the skew part of the rotation against the frame: the sine of the angle times its axis.
        let skew = |i: usize, j: usize| dot(&frame[i], &own[j]).minus(&dot(&frame[j], &own[i]));
        let sine = [(2, 1), (0, 2), (1, 0)].map(|(i, j)| skew(i, j).scaled(0.5));
        let s = dot(&sine, &sine);
        let (value, slope) = of_sine(s.value);
        let factor = s.map(value, slope);
        sine.map(|x| x.times(&factor))
    });
    let all = [
        stretch,
        first[2],
        second[2],
        first[1],
        second[1],
        second[0].minus(&first[0]),
    ];
    (all.map(|x| x.value), all.map(|x| x.slopes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chords() -> [Corotation; 2] {
        let flat = Chord::new([[0.0; 2]; 2], [[1.0, 2.0], [3.0, 5.0]]).unwrap();
        let space = ChordInSpace::new(
            [[0.0; 3]; 2],
            [[1.0, 2.0, 3.0], [3.0, 5.0, 4.0]],
            Some([0.2, 0.1, 1.0]),
        );
        [Corotation::Plane(flat), Corotation::Space(space.unwrap())]
    }

    fn place(scale: f64) -> [f64; 12] {
        [
            0.3, -0.2, 0.15, 0.4, -0.3, 0.2, -0.1, 0.25, 0.35, 0.1, -0.45, 0.5,
        ]
        .map(|x: f64| scale * x)
    }

    /// Central differences of the deformations, near rest and far from it.
    #[test]
    fn slopes_are_derivatives() {
        for chord in chords() {
            for scale in [1e-3, 0.05, 1.0] {
                let at = place(scale);
                let (_, slopes) = chord.at(&at);
                for k in 0..12 {
                    let h = 1e-5;
                    let [lower, upper] = [-h, h].map(|by| {
                        let mut moved = at;
                        moved[k] += by;
                        chord.at(&moved).0
                    });
                    for (row, (upper, lower)) in slopes.iter().zip(upper.iter().zip(lower)) {
                        let found = (upper - lower) / (2.0 * h);
                        assert!(
                            (row[k] - found).abs() < 1e-9,
                            "{scale} {k}: {} {found}",
                            row[k]
                        );
                    }
                }
            }
        }
    }

    /// A rigid motion deforms nothing, however far it goes, and small motions have the rows of linear geometry.
    #[test]
    fn rigid_motions_deform_nothing() {
        for angle in [0.1, 1.0, 3.0] {
            let (s, c) = libm::sincos(angle);
            let turn = |[x, y]: [f64; 2]| [c * x - s * y - x, s * x + c * y - y];
            let (a, b) = (turn([1.0, 2.0]), turn([3.0, 5.0]));
            let [plane, space] = chords();
            let flat = [
                a[0], a[1], angle, b[0], b[1], angle, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
            ];
            assert!(plane.at(&flat).0.iter().all(|v| v.abs() < 1e-12));
            let whole = [
                a[0], a[1], 0.0, 0.0, 0.0, angle, b[0], b[1], 0.0, 0.0, 0.0, angle,
            ];
            assert!(space.at(&whole).0.iter().all(|v| v.abs() < 1e-12));
        }
        let [Corotation::Plane(flat), Corotation::Space(space)] = chords() else {
            panic!("one of each");
        };
        let (_, rows) = Corotation::Plane(flat).at(&[0.0; 12]);
        for (row, wanted) in rows.iter().zip(flat.deformations()) {
            assert!(row.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-14));
        }
        let (_, rows) = Corotation::Space(space).at(&[0.0; 12]);
        for (row, wanted) in rows.iter().zip(space.deformations()) {
            assert!(
                row.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-14),
                "{row:?} {wanted:?}"
            );
        }
    }

    /// In a plane the stiffness of the forces is complete: that of the derivatives at constant forces.
    #[test]
    fn geometric_stiffness_is_the_change_of_the_forces() {
        let [plane, _] = chords();
        let forces = [2.0, 0.7, -0.4, 0.0, 0.0, 0.0];
        let pull = |at: &[f64; 12]| {
            let (_, rows) = plane.at(at);
            let of = |k: usize| {
                rows.iter()
                    .zip(forces)
                    .map(|(row, q)| row[k] * q)
                    .sum::<f64>()
            };
            [0, 1, 2, 3, 4, 5].map(of)
        };
        let at = place(0.7);
        let (deformed, rows) = plane.at(&at);
        let ([turn, _], length) = (plane.turns(&rows), plane.length(deformed[0]));
        let (along, shear) = (rows[0], (forces[1] + forces[2]) / length);
        let found = |i: usize, k: usize| {
            forces[0] * length * turn[i] * turn[k]
                - shear * (along[i] * turn[k] + turn[i] * along[k])
        };
        for k in 0..6 {
            let h = 1e-5;
            let [lower, upper] = [-h, h].map(|by| {
                let mut moved = at;
                moved[k] += by;
                pull(&moved)
            });
            for (i, (upper, lower)) in upper.iter().zip(lower).enumerate() {
                let wanted = (upper - lower) / (2.0 * h);
                let found = found(i, k);
                assert!((found - wanted).abs() < 1e-8, "{i} {k}: {found} {wanted}");
            }
        }
    }
}
