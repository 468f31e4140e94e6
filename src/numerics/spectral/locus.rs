//! The root locus of equation (39): where the poles go as the tangent stiffness changes and α stays.

use super::{Pole, quadratic};

/// One degree of freedom whose α was made with m, c, k0, Δt and λ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Locus {
    /// Mass in kg.
    pub mass: f64,
    /// Damping in N s/m, unchanged.
    pub damping: f64,
    /// Initial stiffness k0 in N/m.
    pub stiffness: f64,
    /// Δt in s.
    pub dt: f64,
    /// λ; infinity is a value.
    pub lambda: f64,
}

impl Locus {
    /// α of (18) for one degree of freedom.
    #[must_use]
    pub fn alpha(&self) -> f64 {
        let Self {
            mass,
            damping,
            stiffness,
            dt,
            lambda,
        } = *self;
        mass / (mass + dt / 2.0 * damping + dt * dt / lambda * stiffness)
    }

    /// Both roots of (39) at the tangent stiffness `tangent` (N/m).
    #[must_use]
    pub fn roots(&self, tangent: f64) -> [Pole; 2] {
        let alpha = self.alpha();
        let viscous = alpha * self.damping * self.dt;
        let b = tangent * alpha * self.dt * self.dt + viscous - 2.0 * self.mass;
        quadratic(self.mass, b, self.mass - viscous)
    }

    /// Tangent stiffness at which a root passes z = −1, equation (40): (4 m − 2 α c Δt)/(α Δt²) in N/m.
    #[must_use]
    pub fn crossing(&self) -> f64 {
        let alpha = self.alpha();
        (4.0 * self.mass - 2.0 * alpha * self.damping * self.dt) / (alpha * self.dt * self.dt)
    }
}
