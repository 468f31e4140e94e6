//! One actuator in space. Rotations are a vector r: about its direction, by its length.
//!
//! ```text
//! R a = a + A r×a + B r×(r×a),          A = sin θ / θ,  B = (1 − cos θ)/θ²,  θ = |r|
//! ∂/∂r_k = C r_k (r×a) + A e_k×a + D r_k r×(r×a) + B (e_k×(r×a) + r×(e_k×a)),
//!          C = (cos θ − A)/θ²,  D = (A − 2B)/θ²
//! ```
//!
//! Where only one component is not zero that is the rotation about its axis, as in the plane.

use super::{MOST, Six};

type Vector = [f64; 3];

/// Below this θ² the series are exact to roundoff: they omit θ⁸/9! of the first term.
const SMALL: f64 = 1e-3;

/// A rotation and the functions of its size.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turn {
    vector: Vector,
    a: f64,
    b: f64,
    c: f64,
    d: f64,
}

impl Turn {
    /// By this vector, rad. Real-time: yes.
    pub(crate) fn new(vector: Vector) -> Self {
        let square = dot(vector, vector);
        let (a, b, c, d) = if square < SMALL {
            let q = square;
            (
                1.0 - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0)),
                0.5 - q / 24.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0)),
                -1.0 / 3.0 + q / 30.0 * (1.0 - q / 28.0 * (1.0 - q / 54.0)),
                -1.0 / 12.0 + q / 180.0 * (1.0 - 3.0 * q / 112.0 * (1.0 - 2.0 * q / 135.0)),
            )
        } else {
            let angle = square.sqrt();
            let (s, c) = libm::sincos(0.5 * angle);
            let (a, b) = (2.0 * s * c / angle, 2.0 * s * s / square);
            let cosine = 1.0 - 2.0 * s * s;
            (a, b, (cosine - a) / square, (a - 2.0 * b) / square)
        };
        Self { vector, a, b, c, d }
    }
}

/// Pins of one actuator.
#[derive(Debug, Clone, Copy)]
pub(super) struct SpaceArm {
    /// Pin on the platform, from the control point, m.
    joint: Vector,
    /// From the pin on the frame to it at the reference pose, and how long that is.
    span: Vector,
    length: f64,
}

impl SpaceArm {
    /// Between these pins, in m from the control point at the reference pose.
    pub(crate) fn new(base: Vector, joint: Vector) -> Self {
        let span = [joint[0] - base[0], joint[1] - base[1], joint[2] - base[2]];
        Self {
            joint,
            span,
            length: dot(span, span).sqrt(),
        }
    }

    /// Pin to pin at the reference pose.
    pub(crate) const fn length(&self) -> f64 {
        self.length
    }

    /// Stroke at a full pose, and its derivatives by all coordinates; none where the pins meet. Real-time: yes.
    pub(crate) fn at(&self, pose: &Six, turn: &Turn) -> Option<(f64, Six)> {
        let r = turn.vector;
        let once = cross(r, self.joint);
        let twice = cross(r, once);
        let mut moved = [0.0; 3];
        let mut now = [0.0; 3];
        for (k, (moved, now)) in moved.iter_mut().zip(&mut now).enumerate() {
            // How far the pin moves: p + (R − I) a.
            *moved = pose[k] + turn.a * once[k] + turn.b * twice[k];
            *now = self.span[k] + *moved;
        }
        let length = dot(now, now).sqrt();
        if length == 0.0 {
            return None;
        }
        // l − l₀ without the cancellation of two lengths.
        let mut square = 0.0;
        for (moved, span) in moved.iter().zip(&self.span) {
            square += moved * (2.0 * span + moved);
        }
        let both = length + self.length;
        // One division for 1/l and 1/(l + l₀).
        let once_over = 1.0 / (length * both);
        let stroke = square * (length * once_over);
        let inverse = both * once_over;
        let e = now.map(|value| value * inverse);
        let along = turn.c * dot(e, once) + turn.d * dot(e, twice);
        let (ae, se) = (cross(self.joint, e), cross(once, e));
        let aer = cross(self.joint, cross(e, r));
        let mut by_all = [0.0; MOST];
        for k in 0..3 {
            by_all[k] = e[k];
            by_all[3 + k] = along * r[k] + turn.a * ae[k] + turn.b * (se[k] + aer[k]);
        }
        Some((stroke, by_all))
    }
}

/// Real-time: yes.
fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Real-time: yes.
fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
