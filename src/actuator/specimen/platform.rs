//! A law at a platform that actuators hold: strokes in, forces of the actuators out.
//!
//! The strokes have a pose, the law answers it, and the actuators share its forces so that the work is the same on both sides.
//! The pose is sought from the reference pose every time: it depends on the strokes alone, not on the path to them. With the
//! controller's own geometry on the other side this has no effect. With another one (small displacements there, exact pins here)
//! it shows the error.

use super::Specimen;
use crate::geometry::{Geometry, MOST, Placed};
use gusset_numerics::law::Reach;

/// Relation between an actuator's stroke and the command of its axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gear {
    /// Axis per stroke; not zero.
    pub ratio: f64,
    /// Axis at a stroke of zero, m.
    pub offset: f64,
}

/// A specimen with one axis per coordinate, behind the actuators of a geometry.
#[derive(Debug)]
pub struct Platform {
    specimen: Box<dyn Specimen>,
    geometry: Geometry,
    gears: Vec<Gear>,
    /// Where the last trial was.
    trial: Placed,
}

gusset_quantity::state! { Platform { specimen } keeps { geometry, gears, trial } }

/// Room for the largest matrix.
type Square = [f64; MOST * MOST];

impl Platform {
    /// `specimen` must have as many axes as the geometry has coordinates; a missing gear counts as one to one.
    #[must_use]
    pub fn new(specimen: Box<dyn Specimen>, geometry: Geometry, gears: &[Gear]) -> Self {
        let none = Gear {
            ratio: 1.0,
            offset: 0.0,
        };
        let mut gears = gears.to_vec();
        gears.resize(geometry.actuators(), none);
        let reference = geometry.reference();
        Self {
            specimen,
            geometry,
            gears,
            trial: reference,
        }
    }

    fn coordinates(&self) -> usize {
        self.geometry.coordinates().len()
    }

    /// Pᵀ M P with P = ∂ pose / ∂ axes at `placed`; `inner` and `outer` by columns. Real-time: yes.
    fn to_actuators(&self, placed: &Placed, inner: &Square, outer: &mut [f64]) {
        let (n, m) = (self.coordinates(), self.geometry.actuators());
        let mut by_axis = [[0.0; MOST]; MOST];
        for (axis, (motion, gear)) in by_axis.iter_mut().zip(&self.gears).enumerate() {
            let mut unit = [0.0; MOST];
            unit[axis] = 1.0 / gear.ratio;
            self.geometry.pose_rates(placed, &unit, &mut motion[..]);
        }
        for j in 0..m {
            for i in 0..m {
                // One half of the symmetric whole, mirrored.
                let (low, high) = (i.min(j), i.max(j));
                let mut sum = 0.0;
                for a in 0..n {
                    for b in 0..n {
                        let entry = inner.get(b * n + a).copied().unwrap_or(f64::NAN);
                        sum += by_axis[low][a] * entry * by_axis[high][b];
                    }
                }
                if let Some(to) = outer.get_mut(j * m + i) {
                    *to = sum;
                }
            }
        }
    }
}

impl Specimen for Platform {
    passed_on!(self => self.specimen);

    fn axes(&self) -> usize {
        self.geometry.actuators()
    }

    fn trial(&mut self, disp: &[f64], vel: &[f64], dt: f64, force: &mut [f64]) {
        let n = self.coordinates();
        let (mut strokes, mut rates) = ([0.0; MOST], [0.0; MOST]);
        let told = disp.iter().zip(vel).zip(&self.gears);
        for (((disp, vel), gear), (stroke, rate)) in told.zip(strokes.iter_mut().zip(&mut rates)) {
            *stroke = (disp - gear.offset) / gear.ratio;
            *rate = vel / gear.ratio;
        }
        self.trial = self.geometry.reference();
        if self.geometry.find(&strokes, &mut self.trial).is_err() {
            // No pose, no force: the caller receives NaN.
            self.trial = self.geometry.reference();
            force.fill(f64::NAN);
            return;
        }
        let (mut moving, mut felt, mut shared) = ([0.0; MOST], [0.0; MOST], [0.0; MOST]);
        self.geometry.pose_rates(&self.trial, &rates, &mut moving);
        let pose = self.trial.pose();
        self.specimen
            .trial(&pose[..n], &moving[..n], dt, &mut felt[..n]);
        self.geometry
            .stroke_forces(&self.trial, &felt[..n], &mut shared);
        for ((force, shared), gear) in force.iter_mut().zip(&shared).zip(&self.gears) {
            *force = shared / gear.ratio;
        }
    }

    /// At the reference pose.
    fn reference(&self, stiffness: &mut [f64], damping: &mut [f64], mass: &mut [f64]) {
        let size = self.coordinates() * self.coordinates();
        let [mut k, mut c, mut m] = [[0.0; MOST * MOST]; 3];
        self.specimen
            .reference(&mut k[..size], &mut c[..size], &mut m[..size]);
        let at = self.geometry.reference();
        self.to_actuators(&at, &k, stiffness);
        self.to_actuators(&at, &c, damping);
        self.to_actuators(&at, &m, mass);
    }

    /// Tangent of the law; it omits the change of its force as the actuators turn.
    fn tangent(&self, stiffness: &mut [f64]) {
        let size = self.coordinates() * self.coordinates();
        let mut k = [0.0; MOST * MOST];
        self.specimen.tangent(&mut k[..size]);
        self.to_actuators(&self.trial, &k, stiffness);
    }

    fn tangent_damping(&self, damping: &mut [f64]) {
        let size = self.coordinates() * self.coordinates();
        let mut c = [0.0; MOST * MOST];
        self.specimen.tangent_damping(&mut c[..size]);
        self.to_actuators(&self.trial, &c, damping);
    }

    /// At the reference pose. Every coordinate reaches as far as the farthest actuator: m, or rad for an angle.
    fn bound(
        &self,
        reach: &[Reach],
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) -> Result<(), usize> {
        let farthest = |of: fn(&Reach) -> Option<f64>| {
            let each = reach.iter().zip(&self.gears);
            let each = each.filter_map(|(reach, gear)| Some(of(reach)? / gear.ratio.abs()));
            each.reduce(f64::max)
        };
        let all = Reach {
            disp: farthest(|reach| reach.disp),
            vel: farthest(|reach| reach.vel),
        };
        let n = self.coordinates();
        let [mut k, mut c] = [[0.0; MOST * MOST]; 2];
        let reach = vec![all; n];
        self.specimen
            .bound(&reach, &mut k[..n * n], &mut c[..n * n])?;
        let at = self.geometry.reference();
        for (inner, outer) in [(k, stiffness), (c, damping)] {
            if inner[..n * n].iter().all(|entry| entry.is_finite()) {
                self.to_actuators(&at, &inner, outer);
                continue;
            }
            outer.fill(0.0);
            for entry in outer.iter_mut().step_by(self.geometry.actuators() + 1) {
                *entry = f64::INFINITY;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Coordinate, GeometrySpec, PlanePins};
    use crate::specimen::SpecimenLaw;
    use gusset_numerics::law::LawSpec;
    use gusset_quantity::state::{Stateful, TestState};

    fn geometry() -> Geometry {
        let pins = [
            ([-1.6, 0.1], [-0.4, 0.15]),
            ([-0.5, -1.2], [-0.5, -0.1]),
            ([0.6, -1.3], [0.5, -0.1]),
        ];
        let spec = GeometrySpec {
            coordinates: Some(vec![Coordinate::Ux, Coordinate::Uy, Coordinate::Rz]),
            plane: Some(
                pins.map(|(base_m, joint_m)| PlanePins {
                    base_m,
                    joint_m,
                    length_m: None,
                })
                .to_vec(),
            ),
            ..GeometrySpec::default()
        };
        spec.build(1.0).unwrap()
    }

    fn column() -> Box<dyn Specimen> {
        let text = "coupled = { stiffness_n_per_m = [[1.2e6, 0.0, 0.9e6], [0.0, 8e7, 0.0], [0.9e6, 0.0, 9e5]], \
                    damping_n_s_per_m = [[2e3, 0.0, 0.0], [0.0, 5e3, 0.0], [0.0, 0.0, 1e3]] }";
        let law: SpecimenLaw = toml::from_str(text).unwrap();
        law.build(3).unwrap()
    }

    /// A pose is commanded as strokes; the forces of the actuators, transformed back, are those of the law at the pose.
    #[test]
    fn actuator_forces_are_those_of_the_pose() {
        let geometry = geometry();
        let gears = [
            Gear {
                ratio: -2.0,
                offset: 0.3,
            },
            Gear {
                ratio: 1.0,
                offset: 0.0,
            },
            Gear {
                ratio: 0.5,
                offset: -0.1,
            },
        ];
        let mut platform = Platform::new(column(), geometry.clone(), &gears);
        let mut law = column();
        let mut at = geometry.reference();
        for k in 1..=20 {
            let share = f64::from(k) / 20.0;
            let pose = [0.08 * share, -0.03 * share, 0.1 * share];
            let rates = [0.5, -0.2, 0.3];
            geometry.place(&pose, &mut at).unwrap();
            let mut speeds = [0.0; 3];
            geometry.stroke_rates(&at, &rates, &mut speeds);
            let disp = [0, 1, 2].map(|i| at.strokes()[i] * gears[i].ratio + gears[i].offset);
            let vel = [0, 1, 2].map(|i| speeds[i] * gears[i].ratio);
            let (mut force, mut exact) = ([0.0; 3], [0.0; 3]);
            platform.trial(&disp, &vel, 0.01, &mut force);
            platform.commit();
            law.trial(&pose, &rates, 0.01, &mut exact);
            let felt = [0, 1, 2].map(|i| force[i] * gears[i].ratio);
            let mut found = [0.0; 3];
            geometry.pose_forces(&at, &felt, &mut found);
            for (found, exact) in found.iter().zip(exact) {
                // 8e7 N/m on poses that are known to 1e-15.
                assert!((found - exact).abs() < 1e-6, "{found} {exact}");
            }
        }
    }

    /// Pᵀ K P with P = J⁻¹: brought back by J it is K again, gears included.
    #[test]
    fn law_matrices_convert_to_actuators() {
        let geometry = geometry();
        let gears = [Gear {
            ratio: -2.0,
            offset: 0.3,
        }];
        let platform = Platform::new(column(), geometry.clone(), &gears);
        let (mut k, mut c, mut m) = ([0.0; 9], [0.0; 9], [1.0; 9]);
        platform.reference(&mut k, &mut c, &mut m);
        assert_eq!(m, [0.0; 9]);
        let (mut exact, mut other, mut none) = ([0.0; 9], [0.0; 9], [0.0; 9]);
        column().reference(&mut exact, &mut other, &mut none);
        let at = geometry.reference();
        let ratio = [-2.0, 1.0, 1.0];
        for a in 0..3 {
            for b in 0..3 {
                let mut sum = 0.0;
                for i in 0..3 {
                    for j in 0..3 {
                        let geared = k[j * 3 + i] * ratio[i] * ratio[j];
                        sum += at.slope(i, a) * geared * at.slope(j, b);
                    }
                }
                assert!((sum - exact[b * 3 + a]).abs() < 1e-6, "{sum}");
            }
        }
    }

    #[test]
    fn restored_platform_has_the_same_bits() {
        let law = "bouc_wen = { stiffness_n_per_m = 1e6, yield_force_n = 1e3, post_yield_ratio = 0.1, beta = 0.5, \
                   gamma = 0.5, exponent = 1.5 }";
        let law: LawSpec = toml::from_str(law).unwrap();
        let build = || {
            let inner = SpecimenLaw::Law(law.clone()).build(3).unwrap();
            Platform::new(inner, geometry(), &[])
        };
        let (mut one, mut other) = (build(), build());
        let drive = |platform: &mut Platform, from: i32, to: i32| {
            let mut force = [0.0; 3];
            for k in from..to {
                let t = 0.05 * f64::from(k);
                let disp = [
                    0.02 * libm::sin(t),
                    0.01 * libm::sin(1.3 * t),
                    0.015 * libm::sin(0.7 * t),
                ];
                platform.trial(&disp, &[0.1, 0.0, -0.1], 0.01, &mut force);
                platform.commit();
            }
            force
        };
        drive(&mut one, 0, 100);
        let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
        state.restore(|visit| other.visit_state(visit)).unwrap();
        let mut forces = [[0.0; 3]; 2];
        let count = allocation_counter::measure(|| {
            forces = [drive(&mut one, 100, 200), drive(&mut other, 100, 200)];
        });
        assert_eq!(forces[0].map(f64::to_bits), forces[1].map(f64::to_bits));
        assert_eq!(count.count_total, 0);
    }

    /// A hold, or a test that resumes after an interruption, commands the same strokes again: not a bit may change.
    #[test]
    fn force_depends_only_on_strokes() {
        let ask = |platform: &mut Platform, disp: [f64; 3]| {
            let mut force = [0.0; 3];
            platform.trial(&disp, &[0.0; 3], 0.0, &mut force);
            platform.commit();
            force.map(f64::to_bits)
        };
        let (mut one, mut other) = (
            Platform::new(column(), geometry(), &[]),
            Platform::new(column(), geometry(), &[]),
        );
        let there = [0.031, -0.007, 0.012];
        let once = ask(&mut one, there);
        assert_eq!(ask(&mut one, there), once);
        ask(&mut other, [-0.05, 0.02, 0.0]);
        assert_eq!(ask(&mut other, there), once);
    }

    #[test]
    fn strokes_without_a_pose_have_no_force() {
        let mut platform = Platform::new(column(), geometry(), &[]);
        let mut force = [0.0; 3];
        platform.trial(&[-5.0, 0.0, 0.0], &[0.0; 3], 0.01, &mut force);
        assert!(force.iter().all(|force| force.is_nan()));
        platform.trial(&[0.0; 3], &[0.0; 3], 0.01, &mut force);
        assert_eq!(force, [0.0; 3]);
    }
}
