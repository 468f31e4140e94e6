//! One actuator in the plane.

use super::{MOST, Six};

/// A rotation about z: its sine, and one minus its cosine, which is exact where it is small.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turn {
    sine: f64,
    versine: f64,
}

impl Turn {
    /// By `angle` in rad. Real-time: yes.
    pub(crate) fn new(angle: f64) -> Self {
        let (s, c) = libm::sincos(0.5 * angle);
        Self {
            sine: 2.0 * s * c,
            versine: 2.0 * s * s,
        }
    }
}

/// Pins of one actuator.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlaneArm {
    /// Pin on the platform, from the control point, m.
    joint: [f64; 2],
    /// From the pin on the frame to it at the reference pose, and how long that is.
    span: [f64; 2],
    length: f64,
}

impl PlaneArm {
    /// Between these pins, in m from the control point at the reference pose.
    pub(crate) fn new(base: [f64; 2], joint: [f64; 2]) -> Self {
        let span = [joint[0] - base[0], joint[1] - base[1]];
        Self {
            joint,
            span,
            length: libm::hypot(span[0], span[1]),
        }
    }

    /// Pin to pin at the reference pose.
    pub(crate) const fn length(&self) -> f64 {
        self.length
    }

    /// Stroke at a full pose, and its derivatives by all coordinates; none where the pins meet. Real-time: yes.
    pub(crate) fn at(&self, pose: &Six, turn: &Turn) -> Option<(f64, Six)> {
        let [ax, ay] = self.joint;
        let (sine, versine) = (turn.sine, turn.versine);
        // How far the pin moves: p + (R − I) a.
        let dx = pose[0] - versine * ax - sine * ay;
        let dy = pose[1] + sine * ax - versine * ay;
        let [sx, sy] = self.span;
        let (x, y) = (sx + dx, sy + dy);
        let now = (x * x + y * y).sqrt();
        if now == 0.0 {
            return None;
        }
        // l − l₀ without the cancellation of two lengths.
        let both = now + self.length;
        // One division for 1/l and 1/(l + l₀).
        let once = 1.0 / (now * both);
        let stroke = (dx * (2.0 * sx + dx) + dy * (2.0 * sy + dy)) * (now * once);
        let inverse = both * once;
        let (ex, ey) = (x * inverse, y * inverse);
        // e · ∂(R a)/∂θ, with the arm where it is now.
        let (rx, ry) = (ax - versine * ax - sine * ay, ay + sine * ax - versine * ay);
        let mut by_all = [0.0; MOST];
        by_all[0] = ex;
        by_all[1] = ey;
        by_all[5] = ey * rx - ex * ry;
        Some((stroke, by_all))
    }
}
