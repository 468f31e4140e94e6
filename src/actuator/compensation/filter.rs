//! A low pass and backward differences make the regressors. The same filter on both sides of a fit does not change the fit.

use std::f64::consts::PI;

use gusset_quantity::state;

/// Butterworth low pass of order 4, as two sections by the bilinear transformation, prewarped so that the corner is exact.
#[derive(Debug, Clone, Copy)]
pub(super) struct LowPass {
    sections: [Section; 2],
    memory: u32,
}

state! { LowPass { sections } keeps { memory } }

/// A response that has decayed to e⁻¹⁴, 1e-6, counts as forgotten.
const FORGOTTEN: f64 = 14.0;

#[derive(Debug, Clone, Copy, Default)]
struct Section {
    /// Weight of the input; the middle one is twice as large.
    b: f64,
    a1: f64,
    a2: f64,
    x: [f64; 2],
    y: [f64; 2],
}

state! { Section { x, y } keeps { b, a1, a2 } }

impl LowPass {
    /// `corner` in Hz below half the rate of ticks, `dt` in s.
    pub(crate) fn new(corner: f64, dt: f64) -> Self {
        let warped = libm::tan(PI * corner * dt);
        let section = |pole: f64| {
            let damping = 2.0 * libm::cos(pole);
            let square = warped * warped;
            let norm = 1.0 / (1.0 + damping * warped + square);
            Section {
                b: square * norm,
                a1: 2.0 * (square - 1.0) * norm,
                a2: (1.0 - damping * warped + square) * norm,
                ..Section::default()
            }
        };
        let sections = [section(PI / 8.0), section(3.0 * PI / 8.0)];
        // a₂ is the square of the poles' distance from 0: those of the second section are nearer to 1.
        let per_tick = -0.5 * libm::log(sections[1].a2);
        Self {
            sections,
            memory: (FORGOTTEN / per_tick).ceil() as u32,
        }
    }

    /// Ticks after which an input has no effect.
    pub(crate) const fn memory(&self) -> u32 {
        self.memory
    }

    /// Real-time: yes.
    pub(crate) fn push(&mut self, value: f64) -> f64 {
        let mut value = value;
        for s in &mut self.sections {
            let out = s.b * (value + 2.0 * s.x[0] + s.x[1]) - s.a1 * s.y[0] - s.a2 * s.y[1];
            s.x = [value, s.x[0]];
            s.y = [out, s.y[0]];
            value = out;
        }
        value
    }

    /// It has always been `value`.
    pub(crate) fn reset(&mut self, value: f64) {
        for s in &mut self.sections {
            (s.x, s.y) = ([value; 2], [value; 2]);
        }
    }
}

/// Backward differences up to the third, over Δt, Δt², Δt³.
#[derive(Debug, Clone, Copy)]
pub(super) struct Differences {
    past: [f64; 3],
    per_dt: f64,
}

state! { Differences { past } keeps { per_dt } }

impl Differences {
    pub(crate) fn new(dt: f64) -> Self {
        Self {
            past: [0.0; 3],
            per_dt: 1.0 / dt,
        }
    }

    /// The value and its three derivatives. Real-time: yes.
    pub(crate) fn push(&mut self, value: f64) -> [f64; 4] {
        let [a, b, c] = self.past;
        self.past = [value, a, b];
        let r = self.per_dt;
        let (d1, e1, f1) = (value - a, a - b, b - c);
        let (d2, e2) = (d1 - e1, e1 - f1);
        [value, d1 * r, d2 * r * r, (d2 - e2) * r * r * r]
    }

    /// The last value was another.
    pub(crate) fn amend(&mut self, value: f64) {
        self.past[0] = value;
    }

    pub(crate) fn reset(&mut self, value: f64) {
        self.past = [value; 3];
    }
}

/// The last values, newest first.
#[derive(Debug, Clone)]
pub(super) struct History {
    ring: Vec<f64>,
    newest: usize,
}

state! { History { newest: index(ring.len()), ring } }

impl History {
    pub(crate) fn new(entries: usize) -> Self {
        Self {
            ring: vec![0.0; entries.max(1)],
            newest: 0,
        }
    }

    pub(crate) fn push(&mut self, value: f64) {
        self.newest = (self.newest + 1) % self.ring.len();
        if let Some(entry) = self.ring.get_mut(self.newest) {
            *entry = value;
        }
    }

    /// The last value was another.
    pub(crate) fn amend(&mut self, value: f64) {
        if let Some(entry) = self.ring.get_mut(self.newest) {
            *entry = value;
        }
    }

    /// The value `back` pushes ago; beyond the history the oldest.
    pub(crate) fn back(&self, back: usize) -> f64 {
        let n = self.ring.len();
        let at = (self.newest + n - back.min(n - 1)) % n;
        self.ring.get(at).copied().unwrap_or(f64::NAN)
    }

    /// The value `back` pushes ago, interpolated linearly between two of them.
    pub(crate) fn between(&self, back: f64) -> f64 {
        let whole = back.floor();
        let share = back - whole;
        let newer = self.back(whole as usize);
        if share == 0.0 {
            return newer;
        }
        newer + share * (self.back(whole as usize + 1) - newer)
    }

    pub(crate) fn reset(&mut self, value: f64) {
        self.ring.fill(value);
    }
}
