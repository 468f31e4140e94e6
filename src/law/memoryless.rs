//! Laws as plain numbers: no memory, no transcendental function, so that many equal ones can be evaluated side by side.
//!
//! The operations are those of the law, in the same order: the same bits, one at a time or in vector lanes. Branches are
//! written as choices between two results for that reason.

use super::Tangent;

/// A law whose force follows from the deformation and the velocity of the moment alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Memoryless {
    /// k d + c v.
    Linear {
        /// k in N/m.
        stiffness: f64,
        /// c in N s/m.
        damping: f64,
    },
    /// c₀ v up to the yield velocity, parallel to c_y v beyond.
    Biviscous {
        /// c₀ in N s/m.
        damping: f64,
        /// c_y in N s/m.
        post_yield: f64,
        /// v_y in m/s.
        yield_vel: f64,
    },
    /// k₀ d (1 + θ √|d|).
    SquareRoot {
        /// k₀ in N/m.
        stiffness: f64,
        /// θ in 1/√m.
        hardening: f64,
    },
    /// k d + k₃ d³.
    Cubic {
        /// k in N/m.
        stiffness: f64,
        /// k₃ in N/m³.
        cubic: f64,
    },
}

/// A force at a point, for loops that the compiler may spread over lanes.
pub(crate) trait PointForce: Copy {
    /// Force in N at `disp` (m) and `vel` (m/s). Real-time: yes.
    fn force(self, disp: f64, vel: f64) -> f64;
}

/// k d + c v.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LinearForce(pub f64, pub f64);

impl PointForce for LinearForce {
    #[inline(always)]
    fn force(self, disp: f64, vel: f64) -> f64 {
        self.0 * disp + self.1 * vel
    }
}

/// c₀, c_y, v_y.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BiviscousForce(pub f64, pub f64, pub f64);

impl PointForce for BiviscousForce {
    #[inline(always)]
    fn force(self, _disp: f64, vel: f64) -> f64 {
        let Self(damping, post_yield, yield_vel) = self;
        let speed = vel.abs();
        let beyond = damping * yield_vel + post_yield * (speed - yield_vel);
        let below = damping * vel;
        if speed > yield_vel {
            beyond.copysign(vel)
        } else {
            below
        }
    }
}

/// k₀, θ.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SquareRootForce(pub f64, pub f64);

impl PointForce for SquareRootForce {
    #[inline(always)]
    fn force(self, disp: f64, _vel: f64) -> f64 {
        let root = disp.abs().sqrt();
        let linear = self.0 * disp;
        linear + linear * (self.1 * root)
    }
}

/// k, k₃.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CubicForce(pub f64, pub f64);

impl PointForce for CubicForce {
    #[inline(always)]
    fn force(self, disp: f64, _vel: f64) -> f64 {
        let square = disp * disp;
        disp * (self.0 + self.1 * square)
    }
}

impl Memoryless {
    /// Tangent at `disp` (m) and `vel` (m/s).
    #[must_use]
    pub fn tangent(self, disp: f64, vel: f64) -> Tangent {
        match self {
            Self::Linear { stiffness, damping } => Tangent { stiffness, damping },
            Self::Biviscous {
                damping,
                post_yield,
                yield_vel,
            } => Tangent {
                stiffness: 0.0,
                damping: if vel.abs() > yield_vel {
                    post_yield
                } else {
                    damping
                },
            },
            Self::SquareRoot {
                stiffness,
                hardening,
            } => Tangent {
                stiffness: stiffness * (1.0 + 1.5 * hardening * disp.abs().sqrt()),
                damping: 0.0,
            },
            Self::Cubic { stiffness, cubic } => Tangent {
                stiffness: stiffness + 3.0 * cubic * (disp * disp),
                damping: 0.0,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::LawSpec;
    use super::*;

    fn force(form: Memoryless, disp: f64, vel: f64) -> f64 {
        match form {
            Memoryless::Linear { stiffness, damping } => {
                LinearForce(stiffness, damping).force(disp, vel)
            }
            Memoryless::Biviscous {
                damping,
                post_yield,
                yield_vel,
            } => BiviscousForce(damping, post_yield, yield_vel).force(disp, vel),
            Memoryless::SquareRoot {
                stiffness,
                hardening,
            } => SquareRootForce(stiffness, hardening).force(disp, vel),
            Memoryless::Cubic { stiffness, cubic } => CubicForce(stiffness, cubic).force(disp, vel),
        }
    }

    #[test]
    fn plain_numbers_give_the_bits_of_the_law_and_its_tangents() {
        let specs = [
            "linear = { stiffness_n_per_m = 3.1, damping_n_s_per_m = 0.7 }",
            "linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 0.7 }",
            "biviscous = { damping_n_s_per_m = 180.0, post_yield_damping_n_s_per_m = 90.0, yield_velocity_m_per_s = 0.3333333333333333 }",
            "square_root = { stiffness_n_per_m = 1e7, hardening_per_sqrt_m = 1.3 }",
            "cubic = { stiffness_n_per_m = 2.5e4, cubic_n_per_m3 = 1e6 }",
        ];
        for text in specs {
            let spec: LawSpec = toml::from_str(text).unwrap();
            let mut law = spec.build().unwrap();
            let form = law.memoryless().expect(text);
            for i in -20..=20 {
                let (disp, vel) = (0.013 * f64::from(i), 0.041 * f64::from(7 * i % 19));
                let wanted = law.trial(disp, vel, 0.01);
                assert_eq!(force(form, disp, vel).to_bits(), wanted.to_bits(), "{text}");
                assert_eq!(form.tangent(disp, vel), law.tangent(), "{text}");
            }
        }
    }

    #[test]
    fn laws_with_memory_are_none_of_them() {
        let text = "bilinear = { stiffness_n_per_m = 1.19e6, yield_force_n = 1190.0, post_yield_ratio = 0.1 }";
        let spec: LawSpec = toml::from_str(text).unwrap();
        assert_eq!(spec.build().unwrap().memoryless(), None);
    }
}
