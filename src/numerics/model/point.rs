//! Laws without memory, eight elements at a time.
//!
//! The operations are those of the law in the same order, so the bits are the same, one at a time or in lanes. The biviscous
//! law is written without a choice: with v held within ±v_y as u, c₀ u − c_y (u − v) adds nothing below the yield
//! velocity, and rounds beyond it what the law rounds.

use crate::linalg::lanes::{Isa, Kernel};

/// A force at a point.
pub(super) trait PointForce: Copy {
    /// Forces in N at `disp` (m) and `vel` (m/s). Real-time: yes.
    fn force<I: Isa>(self, isa: I, disp: I::V, vel: I::V) -> I::V;
}

/// No force.
#[derive(Debug, Clone, Copy)]
pub(super) struct NoForce;

impl PointForce for NoForce {
    #[inline(always)]
    fn force<I: Isa>(self, isa: I, _disp: I::V, _vel: I::V) -> I::V {
        isa.splat(0.0)
    }
}

/// k d + c v.
#[derive(Debug, Clone, Copy)]
pub(super) struct LinearForce(pub f64, pub f64);

impl PointForce for LinearForce {
    #[inline(always)]
    fn force<I: Isa>(self, isa: I, disp: I::V, vel: I::V) -> I::V {
        let spring = isa.mul(isa.splat(self.0), disp);
        isa.add(spring, isa.mul(isa.splat(self.1), vel))
    }
}

/// c₀, c_y, v_y.
#[derive(Debug, Clone, Copy)]
pub(super) struct BiviscousForce(pub f64, pub f64, pub f64);

impl PointForce for BiviscousForce {
    #[inline(always)]
    fn force<I: Isa>(self, isa: I, _disp: I::V, vel: I::V) -> I::V {
        let Self(damping, post_yield, yield_vel) = self;
        let within = isa.min(vel, isa.splat(yield_vel));
        let within = isa.max(within, isa.splat(-yield_vel));
        // Below the yield velocity this is −0, which changes no number, −0 included.
        let beyond = isa.mul(isa.splat(-post_yield), isa.sub(within, vel));
        isa.add(isa.mul(isa.splat(damping), within), beyond)
    }
}

/// k₀, θ.
#[derive(Debug, Clone, Copy)]
pub(super) struct SquareRootForce(pub f64, pub f64);

impl PointForce for SquareRootForce {
    #[inline(always)]
    fn force<I: Isa>(self, isa: I, disp: I::V, _vel: I::V) -> I::V {
        let root = isa.sqrt(isa.abs(disp));
        let linear = isa.mul(isa.splat(self.0), disp);
        isa.add(linear, isa.mul(linear, isa.mul(isa.splat(self.1), root)))
    }
}

/// k, k₃.
#[derive(Debug, Clone, Copy)]
pub(super) struct CubicForce(pub f64, pub f64);

impl PointForce for CubicForce {
    #[inline(always)]
    fn force<I: Isa>(self, isa: I, disp: I::V, _vel: I::V) -> I::V {
        let stiffness = isa.mul(isa.splat(self.1), isa.mul(disp, disp));
        isa.mul(disp, isa.add(isa.splat(self.0), stiffness))
    }
}

/// A loop over elements that waits for its law.
pub(super) trait OfForce {
    fn with<I: Isa, F: PointForce>(self, isa: I, force: F);
}

/// A loop with its law.
pub(super) struct With<O, F>(pub O, pub F);

impl<O: OfForce, F: PointForce> Kernel for With<O, F> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        self.0.with(isa, self.1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{LawSpec, Memoryless};
    use crate::linalg::Lanes;

    struct Probe<F>(F, [f64; 8], [f64; 8]);

    impl<F: PointForce> Kernel for Probe<F> {
        type Output = [f64; 8];

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> [f64; 8] {
            let mut out = [0.0; 8];
            let force = self.0.force(isa, isa.load(&self.1), isa.load(&self.2));
            isa.store(force, &mut out);
            out
        }
    }

    fn forces(form: Memoryless, lanes: Lanes, disp: [f64; 8], vel: [f64; 8]) -> [f64; 8] {
        match form {
            Memoryless::Linear { stiffness, damping } => {
                lanes.run(Probe(LinearForce(stiffness, damping), disp, vel))
            }
            Memoryless::Biviscous {
                damping,
                post_yield,
                yield_vel,
            } => {
                let law = BiviscousForce(damping, post_yield, yield_vel);
                lanes.run(Probe(law, disp, vel))
            }
            Memoryless::SquareRoot {
                stiffness,
                hardening,
            } => lanes.run(Probe(SquareRootForce(stiffness, hardening), disp, vel)),
            Memoryless::Cubic { stiffness, cubic } => {
                lanes.run(Probe(CubicForce(stiffness, cubic), disp, vel))
            }
        }
    }

    #[test]
    fn eight_at_a_time_give_equal_bits() {
        let specs = [
            "linear = { stiffness_n_per_m = 3.1, damping_n_s_per_m = 0.7 }",
            "linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 0.7 }",
            "biviscous = { damping_n_s_per_m = 180.0, post_yield_damping_n_s_per_m = 90.0, yield_velocity_m_per_s = 0.3333333333333333 }",
            "biviscous = { damping_n_s_per_m = 7.3, post_yield_damping_n_s_per_m = 0.0, yield_velocity_m_per_s = 0.041 }",
            "square_root = { stiffness_n_per_m = 1e7, hardening_per_sqrt_m = 1.3 }",
            "cubic = { stiffness_n_per_m = 2.5e4, cubic_n_per_m3 = 1e6 }",
        ];
        for text in specs {
            let spec: LawSpec = toml::from_str(text).unwrap();
            let mut law = spec.build().unwrap();
            let form = law.memoryless().expect(text);
            for lanes in Lanes::available() {
                for i in -20..=20 {
                    let at = |k: usize| f64::from(8 * i) + k as f64;
                    let disp: [f64; 8] = std::array::from_fn(|k| 0.0013 * at(k));
                    let vel: [f64; 8] = std::array::from_fn(|k| 0.041 * ((7.0 * at(k)) % 19.0));
                    let found = forces(form, lanes, disp, vel);
                    for ((x, v), found) in disp.into_iter().zip(vel).zip(found) {
                        let wanted = law.trial(x, v, 0.01);
                        assert_eq!(found.to_bits(), wanted.to_bits(), "{text}, {lanes}");
                        assert_eq!(form.tangent(x, v), law.tangent(), "{text}");
                    }
                }
            }
        }
    }

    #[test]
    fn lost_numbers_stay_lost() {
        for lanes in Lanes::available() {
            let vel = [
                f64::NAN,
                f64::INFINITY,
                -f64::INFINITY,
                0.0,
                1.0,
                2.0,
                3.0,
                4.0,
            ];
            let found = lanes.run(Probe(BiviscousForce(2.0, 1.0, 0.5), [0.0; 8], vel));
            assert!(found[0].is_nan(), "{lanes}");
            assert_eq!(found[1..4], [f64::INFINITY, -f64::INFINITY, 0.0], "{lanes}");
        }
    }
}
