//! What a port estimates of its axes while the test runs: tangents, the room that they leave for stability, and the energy
//! that the transfer system adds.
//!
//! All of it is at the structure, where the proof of stability is. Estimates come of fresh measurements only. They
//! stand in the row and are judged by the limits; nothing else depends on them.

use super::axis::Axis;
use super::command_path::CommandPath;
use super::feedback::Feedback;
use super::initial_stiffness::InitialStiffness;
use super::limits::Estimated;
use super::tangent::{Point, Tangent};
use gusset_quantity::frame::AtStructure;
use gusset_quantity::state;

/// Noise levels that a change must exceed to count for a tangent.
const ABOVE_NOISE: f64 = 10.0;

/// What is declared of one axis, at the structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Declared {
    /// ĉ, the initial damping, N s/m.
    pub damping: f64,
    /// Upper bound of the tangent stiffness, N/m; NaN if there is none.
    pub stiffness_bound: f64,
    /// Upper bound of the tangent damping, N s/m; NaN if there is none.
    pub damping_bound: f64,
    /// b·S⁻¹·bᵀ with S(λ) at the declared bounds, per kg; NaN if it is not known.
    pub gain: f64,
    /// How often damping counts in a sawtooth of period 2 steps, as in that S: more than once where ticks come between the
    /// targets.
    pub sawtooth: f64,
    /// Motion in m below which no tangent is taken; 0: by the noise that is read while zeroing.
    pub step: f64,
}

impl Declared {
    /// Nothing.
    pub const NONE: Declared = Declared {
        damping: 0.0,
        stiffness_bound: f64::NAN,
        damping_bound: f64::NAN,
        gain: f64::NAN,
        sawtooth: 1.0,
        step: 0.0,
    };
}

/// Memory of one axis.
#[derive(Debug, Clone, Copy)]
struct Estimate {
    tangent: Tangent,
    declared: Declared,
    /// J, and the error and force of the measurement before.
    added_energy: f64,
    error: f64,
    force: f64,
}

state! { Estimate { tangent, added_energy, error, force } keeps { declared } }

/// Whether the energy is counted that the transfer system adds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum EnergyCount {
    /// Beside the test.
    Off,
    /// The next measurement is the first to count from.
    FromNext,
    On,
}

state! { enum EnergyCount { Off, FromNext, On } }

/// The estimates of a specimen.
#[derive(Debug)]
pub struct Estimates {
    axes: Vec<Estimate>,
    /// Δt of the integration.
    dt: f64,
    energy: EnergyCount,
    /// Nothing is estimated for now.
    is_resting: bool,
}

state! { Estimates as "estimates" { axes, energy, is_resting } keeps { dt } }

/// A fresh measurement of all axes at the structure, and the command that it answers.
pub(crate) struct Observation<'a> {
    pub axes: &'a [Axis],
    pub path: &'a CommandPath,
    pub feedback: &'a Feedback,
    pub stiffness: &'a InitialStiffness,
}

impl Estimates {
    /// Of axes with this k̂ and what is declared of them, in an integration with the step `dt`.
    pub(crate) fn new(stiffness: AtStructure<&[f64]>, declared: &[Declared], dt: f64) -> Self {
        let estimate = |(stiffness, declared): (&f64, &Declared)| Estimate {
            tangent: Tangent::new(*stiffness, declared.damping, declared.damping_bound > 0.0),
            declared: *declared,
            added_energy: 0.0,
            error: 0.0,
            force: 0.0,
        };
        let mut estimates = Self {
            axes: stiffness.iter().zip(declared).map(estimate).collect(),
            dt,
            energy: EnergyCount::Off,
            is_resting: false,
        };
        estimates.begin(std::iter::repeat_n((0.0, 0.0), stiffness.len()));
        estimates
    }

    /// Restarts with the declared values: the wiring check is not part of the test.
    pub(crate) fn restart(&mut self, stiffness: AtStructure<&[f64]>) {
        for (axis, stiffness) in self.axes.iter_mut().zip(*stiffness) {
            let with_damping = axis.tangent.with_damping();
            axis.tangent = Tangent::new(*stiffness, axis.declared.damping, with_damping);
        }
        self.begin(std::iter::repeat_n((0.0, 0.0), self.axes.len()));
    }

    /// Nothing is estimated from here on, or everything again.
    pub(crate) const fn rest(&mut self, rests: bool) {
        self.is_resting = rests;
    }

    #[inline]
    pub(crate) const fn is_resting(&self) -> bool {
        self.is_resting
    }

    /// The test begins or is resumed: energy counts from the next measurement on.
    pub(crate) const fn begin_test(&mut self) {
        self.is_resting = false;
        self.energy = EnergyCount::FromNext;
    }

    /// The test is interrupted: no energy counts, and no sample belongs to the next.
    pub(crate) fn leave_test(&mut self) {
        self.energy = EnergyCount::Off;
        for axis in &mut self.axes {
            axis.tangent.forget_samples();
        }
    }

    /// The tangent stiffness of each axis in N/m, between 0 and the larger of k̂ and the declared bound; k̂ where there is no
    /// number. Real-time: yes.
    pub(crate) fn bounded<'a>(
        &'a self,
        stiffness: AtStructure<&'a [f64]>,
    ) -> impl Iterator<Item = AtStructure<f64>> + 'a {
        self.axes.iter().zip(*stiffness).map(|(axis, initial)| {
            // NaN, where no bound is declared, is passed over.
            let most = initial.max(axis.declared.stiffness_bound);
            let tangent = axis.tangent.stiffness();
            AtStructure(if tangent.is_finite() && most >= 0.0 {
                tangent.clamp(0.0, most)
            } else {
                *initial
            })
        })
    }

    /// Changes of at least this size count from now on: as declared, or above the noise of (displacement, force) in m
    /// and N.
    pub(crate) fn begin(&mut self, noise: impl Iterator<Item = (f64, f64)>) {
        for (axis, (disp, force)) in self.axes.iter_mut().zip(noise) {
            let stiffness = axis.tangent.stiffness().abs();
            let of_force = if stiffness > 0.0 {
                force / stiffness
            } else {
                0.0
            };
            let step = if axis.declared.step > 0.0 {
                axis.declared.step
            } else {
                ABOVE_NOISE * disp.max(of_force)
            };
            axis.tangent
                .begin(if step.is_finite() { step } else { 0.0 });
        }
    }

    /// Takes a fresh measurement. Real-time: yes.
    #[inline]
    pub(crate) fn take(&mut self, observed: &Observation<'_>) {
        let Observation {
            axes,
            path,
            feedback,
            stiffness,
        } = observed;
        let moves = path.moves();
        let counts = self.energy == EnergyCount::On;
        let measured = feedback.disp();
        let values = measured.iter().zip(*feedback.force());
        let values = values.zip(&path.target().disp);
        let motion = path.command().vel.iter().zip(*axes);
        for (index, ((estimate, ((disp, force), target)), (vel, axis))) in
            self.axes.iter_mut().zip(values).zip(motion).enumerate()
        {
            // The specimen is where the target is by now, not where the command is led.
            let own = path.own_vel(index, *vel);
            let vel = if moves { own / axis.vel_gain } else { 0.0 };
            estimate.tangent.take(Point {
                disp: *disp,
                vel,
                force: force - stiffness.force_of_others(index, measured),
            });
            let error = disp - target;
            if counts {
                // The force on the way is taken as the mean of both ends.
                estimate.added_energy += 0.5 * (force + estimate.force) * (error - estimate.error);
            }
            (estimate.error, estimate.force) = (error, *force);
        }
        if self.energy == EnergyCount::FromNext {
            self.energy = EnergyCount::On;
        }
    }

    /// Values of each axis for the limits. Real-time: yes.
    #[inline]
    pub(crate) fn judged(&self) -> impl Iterator<Item = Estimated> + '_ {
        self.axes.iter().map(Estimate::judged)
    }

    /// Tangent stiffness, tangent damping and added energy of each axis. Real-time: yes.
    #[inline]
    pub(crate) fn values(&self) -> impl Iterator<Item = (f64, Option<f64>, f64)> + '_ {
        self.axes.iter().map(|axis| {
            let tangent = &axis.tangent;
            let damping = tangent.with_damping().then_some(tangent.damping());
            (tangent.stiffness(), damping, axis.added_energy)
        })
    }

    /// `others` J and the energy that the transfer system has added to each axis, one after the other. Real-time: yes.
    #[inline]
    pub(crate) fn added_energy(&self, others: f64) -> f64 {
        let axes = self.axes.iter();
        axes.fold(others, |sum, axis| sum + axis.added_energy)
    }

    /// Declared upper bounds of the tangent stiffness in N/m and of the tangent damping in N s/m, per axis at the structure; NaN
    /// without one.
    pub fn tangent_bounds(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let axes = self.axes.iter();
        axes.map(|axis| (axis.declared.stiffness_bound, axis.declared.damping_bound))
    }

    /// Stability margin that each axis uses. Real-time: yes.
    #[inline]
    pub(crate) fn stability_used(&self) -> impl Iterator<Item = f64> + '_ {
        let axes = self.axes.iter();
        axes.map(|axis| axis.stability_used(self.dt))
    }

    /// Stability margin that tangents beyond their declared bounds use: 0 within the bounds; below 1 stable; exactly 1 is the limit
    /// of one axis alone. None if there is no proof to start from. Real-time: yes.
    #[inline]
    pub(crate) fn total_stability_used(&self) -> Option<f64> {
        let used = self.stability_used().fold(-0.0, |sum, axis| sum + axis);
        used.is_finite().then_some(used)
    }

    /// True if there is a proof of stability to start from. Real-time: yes.
    pub(crate) fn knows_stability(&self) -> bool {
        let mut axes = self.axes.iter();
        axes.all(|axis| {
            let declared = &axis.declared;
            !declared.gain.is_nan() && !declared.stiffness_bound.is_nan()
        })
    }
}

impl Estimate {
    /// (k − k_max)Δt² + 2 r (c − c_max)Δt, over what S has left in this direction: 1 is the limit of stability for an axis
    /// alone. r is how often damping counts in a sawtooth. NaN if it is not known. Real-time: yes.
    #[inline]
    fn stability_used(&self, dt: f64) -> f64 {
        let Declared {
            stiffness_bound,
            damping_bound,
            gain,
            sawtooth,
            ..
        } = self.declared;
        let damping = if self.tangent.with_damping() {
            sawtooth * (2.0 * dt * (self.tangent.damping() - damping_bound))
        } else {
            0.0
        };
        let excess = dt * dt * (self.tangent.stiffness() - stiffness_bound) + damping;
        if excess.is_nan() || gain.is_nan() {
            f64::NAN
        } else {
            excess.max(0.0) * gain
        }
    }

    #[inline]
    fn judged(&self) -> Estimated {
        let Declared {
            stiffness_bound,
            damping_bound,
            ..
        } = self.declared;
        let damping = if self.tangent.with_damping() {
            self.tangent.damping() / damping_bound
        } else {
            f64::NAN
        };
        [
            self.tangent.stiffness() / stiffness_bound,
            damping,
            self.added_energy,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::limits::{AxisLimits, Bound, Found};
    use crate::port::{Axis, AxisSpec, Port, PortSpec};
    use gusset_quantity::catalog::limit::Limit;
    use gusset_quantity::substructure::{
        Command, Freshness, LinkFault, Measurement, Retirement, Substructure,
    };
    use gusset_quantity::time::Nanos;

    /// A spring and dashpot in mm and kN, counted the other way, whose actuator is some ticks late.
    #[derive(Debug)]
    struct Late {
        stiffness: f64,
        damping: f64,
        told: Vec<f64>,
        vel: f64,
        ticks: usize,
    }

    impl Substructure for Late {
        fn axes(&self) -> usize {
            1
        }
        fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
            self.told.push(command.disp[0]);
            self.vel = command.vel[0];
            Ok(())
        }
        fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
            let last = self.told.len() - 1;
            let disp = self.told[last.saturating_sub(self.ticks)];
            into.disp[0] = disp;
            into.force[0] = 1e-6 * (self.stiffness * disp + self.damping * self.vel);
            Ok(Freshness::Fresh)
        }
        fn retire(&mut self, _: Retirement) {}
    }

    fn port(late: Late, declared: Declared, limits: AxisLimits, dt: f64) -> Port {
        let axis = Axis {
            disp_gain: -1000.0,
            vel_gain: -1000.0,
            force_gain: -1000.0,
            ..Axis::plain(vec![(0, 1.0)])
        };
        let axis = AxisSpec {
            units: (1e-3, 1e3),
            limits,
            declared,
            ..AxisSpec::new(axis, 1e5)
        };
        let mut spec = PortSpec::new("rig", Box::new(late), 1, vec![axis]);
        (spec.tick, spec.dt) = (dt, dt);
        spec.build().unwrap()
    }

    /// Goes along `disp` and `vel`; what the last measurement found.
    fn go(port: &mut Port, ticks: usize, motion: impl Fn(usize) -> (f64, f64)) -> Found {
        let mut found = Found::default();
        for k in 0..ticks {
            let (disp, vel) = motion(k);
            port.aim(&[disp], &[vel], 0.0, 0.0);
            assert_eq!(port.clear().trip, None);
            port.issue(k as u64, 0.0, 0.0).unwrap();
            port.collect(Nanos(0)).unwrap();
            found = port.judge();
        }
        found
    }

    fn spring(stiffness: f64, ticks: usize) -> Late {
        Late {
            stiffness,
            damping: 0.0,
            told: Vec::new(),
            vel: 0.0,
            ticks,
        }
    }

    const DT: f64 = 1e-3;
    const OMEGA: f64 = 12.0;

    /// Two whole periods of 2π/12 s are 1047.2 ticks: the sine is stretched to 1000 per two periods.
    fn swing(k: usize) -> (f64, f64) {
        let phase = 4.0 * std::f64::consts::PI * k as f64 / 1000.0;
        (0.02 * libm::sin(phase), 0.02 * OMEGA * libm::cos(phase))
    }

    #[test]
    fn late_actuator_adds_its_loops_energy() {
        let added = |ticks: usize, reversed: bool| {
            let stiffness = if reversed { -3e5 } else { 3e5 };
            let mut port = port(
                spring(stiffness, ticks),
                Declared::NONE,
                AxisLimits::NONE,
                DT,
            );
            // From where the delay line is full.
            go(&mut port, 500, swing);
            port.begin_test();
            let counted = |port: &Port| port.estimates().values().next().unwrap().2;
            assert_eq!(counted(&port), 0.0, "nothing before the test");
            go(&mut port, 1001, |k| swing(k + 500));
            // What happens while it is interrupted does not count, and what was counted stays.
            let found = counted(&port);
            port.leave_test();
            go(&mut port, 250, |k| swing(k + 250));
            port.begin_test();
            assert_eq!(counted(&port), found);
            found
        };
        // ∮ f d(d_m − d) with d_m late by the phase φ: π k A² sin φ per period, two of them. The trapezoids of a sine with
        // 500 ticks a period are off by (2π/500)²/12 = 1.3e-5 of it.
        for ticks in [1, 10, 40] {
            let phase = 4.0 * std::f64::consts::PI * ticks as f64 / 1000.0;
            let ellipse = 2.0 * std::f64::consts::PI * 3e5 * 4e-4 * libm::sin(phase);
            let found = added(ticks, false);
            assert!(
                (found / ellipse - 1.0).abs() < 1e-4,
                "{ticks}: {found} {ellipse}"
            );
            assert!(
                (added(ticks, true) / ellipse + 1.0).abs() < 1e-4,
                "it takes"
            );
        }
        assert!(added(0, false).abs() < 1e-12);
    }

    /// Not below nothing, and not beyond what is declared or, without that, expected.
    #[test]
    fn extrapolated_force_has_two_bounds() {
        let bounded = |stiffness: f64, stiffness_bound: f64| {
            let declared = Declared {
                stiffness_bound,
                ..Declared::NONE
            };
            let mut port = port(spring(stiffness, 0), declared, AxisLimits::NONE, DT);
            go(&mut port, 200, swing);
            let mut tangents = port.estimates.bounded(port.stiffness.own());
            tangents.next().unwrap().0
        };
        assert_eq!(bounded(-3e5, f64::NAN), 0.0);
        assert_eq!(bounded(3e5, 2e5), 2e5);
        assert_eq!(bounded(3e5, f64::NAN), 1e5);
    }

    #[test]
    fn tangents_are_in_structure_units() {
        let declared = Declared {
            damping: 1e3,
            damping_bound: 1e3,
            ..Declared::NONE
        };
        let late = Late {
            damping: 2e3,
            ..spring(3e5, 0)
        };
        let mut port = port(late, declared, AxisLimits::NONE, DT);
        go(&mut port, 200, swing);
        let (stiffness, damping, _) = port.estimates().values().next().unwrap();
        assert!((stiffness / 3e5 - 1.0).abs() < 1e-6, "{stiffness}");
        assert!((damping.unwrap() / 2e3 - 1.0).abs() < 1e-6, "{damping:?}");
    }

    #[test]
    fn stability_margin_ends_at_equation_41() {
        // One degree of freedom, λ = 8, Ω0² = k0 Δt²/m = 6.25: stable up to k = 4 m/Δt² + 4 k0/λ (41).
        let (mass, k0, dt, lambda) = (160.0, 1e5, 0.1, 8.0);
        let limit = 4.0 * mass / (dt * dt) + 4.0 * k0 / lambda;
        let bound = 1.05e5;
        let stability = 4.0 * mass + 4.0 * dt * dt * k0 / lambda - dt * dt * bound;
        let declared = Declared {
            stiffness_bound: bound,
            damping_bound: 0.0,
            gain: 1.0 / stability,
            ..Declared::NONE
        };
        let used = |stiffness: f64| {
            let mut port = port(spring(stiffness, 0), declared, AxisLimits::NONE, dt);
            assert!(port.estimates().knows_stability());
            go(&mut port, 10, swing);
            port.estimates().total_stability_used().unwrap()
        };
        assert_eq!(used(1.04e5), 0.0, "within the declared bound");
        assert!((used(limit) - 1.0).abs() < 1e-9);
        assert!(used(0.999 * limit) < 1.0 && used(1.001 * limit) > 1.0);
        let unproven = port(spring(1e5, 0), Declared::NONE, AxisLimits::NONE, dt);
        assert!(!unproven.estimates().knows_stability());
    }

    /// Largest modulus of a root of M_eff ∇²x⁺/Δt² + c (∇x + ∇²x/2 + ∇³x/3 …)/Δt + k x = 0, up to the difference of this
    /// order: what the specimen feels of a way whose slope at each target is that of the polynomial through the last ones.
    fn spectral_radius(order: usize, effective: f64, k: f64, c: f64, dt: f64) -> f64 {
        // In powers of z, from that of x⁺ down: ∇ᵖ x is (1 − 1/z)ᵖ.
        let mut powers = [0.0; 5];
        let second = effective / (dt * dt);
        for (at, value) in [(0, second), (1, -2.0 * second), (2, second), (1, k)] {
            powers[at] += value;
        }
        let differences: [&[f64]; 3] = [&[1.0, -1.0], &[1.0, -2.0, 1.0], &[1.0, -3.0, 3.0, -1.0]];
        for (weights, p) in differences.iter().zip(1u32..).take(order) {
            for (at, weight) in weights.iter().enumerate() {
                powers[at + 1] += c / dt * weight / f64::from(p);
            }
        }
        let companion = nalgebra::DMatrix::from_fn(4, 4, |i, j| match i {
            0 => -powers[j + 1] / powers[0],
            _ if j + 1 == i => 1.0,
            _ => 0.0,
        });
        let roots = companion.complex_eigenvalues();
        roots
            .iter()
            .map(|root| nalgebra::ComplexField::modulus(*root))
            .fold(0.0, f64::max)
    }

    /// With ticks between the targets the damping of a specimen counts more in a sawtooth: the room is used up where the
    /// spectral radius passes one, and not at 2 or 10/3 times as much damping.
    #[test]
    fn stability_margin_counts_damping() {
        let (mass, k0, c0, dt, lambda) = (160.0, 1e5, 400.0, 0.1, 8.0);
        let effective = mass + 0.5 * dt * c0 + dt * dt * k0 / lambda;
        for (order, sawtooth) in [(1, 1.0), (2, 2.0), (3, 10.0 / 3.0)] {
            let (k, c_max) = (3e4, 500.0);
            let stability = 4.0 * effective - dt * dt * k - 2.0 * dt * sawtooth * c_max;
            assert!(stability > 0.0);
            let declared = Declared {
                damping: c0,
                stiffness_bound: k,
                damping_bound: c_max,
                gain: 1.0 / stability,
                sawtooth,
                ..Declared::NONE
            };
            let used = |damping: f64| {
                let late = Late {
                    damping,
                    ..spring(k, 0)
                };
                let mut port = port(late, declared, AxisLimits::NONE, dt);
                go(&mut port, 200, swing);
                port.estimates().total_stability_used().unwrap()
            };
            let radius = |c: f64| spectral_radius(order, effective, k, c, dt);
            // By halving: up to here the recursion is stable.
            let (mut low, mut high) = (c_max, 100.0 * c_max);
            assert!(radius(low) <= 1.0 + 1e-9 && radius(high) > 1.0, "{order}");
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if radius(middle) > 1.0 + 1e-9 {
                    high = middle;
                } else {
                    low = middle;
                }
            }
            // The tangent is exact to 1e-6; 1e-9 of a root is less.
            let found = used(low);
            assert!((found - 1.0).abs() < 1e-5, "{order}: {found} at {low}");
            assert!(used(0.99 * low) < 1.0 && used(1.01 * low) > 1.0, "{order}");
            assert_eq!(used(0.99 * c_max), 0.0, "within the declared bound");
        }
    }

    #[test]
    fn tangent_and_energy_bounds_trip() {
        let declared = Declared {
            stiffness_bound: 2e5,
            ..Declared::NONE
        };
        let limits = AxisLimits::NONE
            .with(Limit::StiffnessRatio, Bound::trip(1.5))
            .with(Limit::AddedEnergy, Bound::trip(100.0));
        let tripped = |stiffness, ticks| {
            let mut port = port(spring(stiffness, ticks), declared, limits, DT);
            port.begin_test();
            let found = go(&mut port, 1000, swing);
            found.trip.map(|hit| hit.quantity)
        };
        assert_eq!(tripped(2.99e5, 0), None);
        assert_eq!(tripped(3.01e5, 0), Some(Limit::StiffnessRatio));
        // 2 π 1e5 · 4e-4 sin φ = 100 at φ = 0.409, 32.6 ticks; the delay line fills over a part of the first ellipse.
        assert_eq!(tripped(1e5, 25), None);
        assert_eq!(tripped(1e5, 45), Some(Limit::AddedEnergy));
    }
}
