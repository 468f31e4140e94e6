//! Laws as plain numbers: no memory, no transcendental function, so that many equal ones can be evaluated side by side.
//!
//! Here is what they are; `crate::model` evaluates them side by side with the bits of the law.

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

impl Memoryless {
    /// Tangent at `disp` (m) and `vel` (m/s).
    #[must_use]
    pub(crate) fn tangent(self, disp: f64, vel: f64) -> Tangent {
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
            } => Tangent::elastic(stiffness * (1.0 + 1.5 * hardening * disp.abs().sqrt())),
            Self::Cubic { stiffness, cubic } => {
                Tangent::elastic(stiffness + 3.0 * cubic * (disp * disp))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::LawSpec;

    #[test]
    fn laws_with_memory_are_none_of_them() {
        let text = "bilinear = { stiffness_n_per_m = 1.19e6, yield_force_n = 1190.0, post_yield_ratio = 0.1 }";
        let spec: LawSpec = toml::from_str(text).unwrap();
        assert_eq!(spec.build().unwrap().memoryless(), None);
    }
}
