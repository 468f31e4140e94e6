//! Bearings that slide or yield in the plane: both horizontal axes share one circle.
//!
//! Sources: Nagarajaiah, Reinhorn & Constantinou 1991, J. Struct. Eng. 117(7) (bearings in two directions); Constantinou, Mokha &
//! Reinhorn 1990, J. Struct. Eng. 116(2) (friction over velocity); Krieg & Krieg 1977, J. Pressure Vessel Technol. 99(4) (exact
//! plastic flow along a straight path).
//!
//! The hysteretic force q is elastic within a circle of radius Q. On the circle it turns towards the direction of motion: the angle
//! θ between both follows tan(θ/2) = tan(θ₀/2) exp(−k s/Q) over the way s. So one step equals any number of partial steps.
//!
//! A smooth core follows Park, Wen & Ang 1986, Earthquake Engng Struct. Dyn. 14(4), with the exponent 2 and β = γ = ½: z = q/Q has
//! dz = (k/Q) (I − z zᵀ) dx where z · dx > 0, and dz = (k/Q) dx elsewhere. Both have a closed form along a straight path.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::domain::{inside, not_negative, positive};
use super::{LawError, Reach};
use gusset_quantity::state;

/// Bearing whose horizontal axes share one circle. Its first two axes are the horizontal ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum BearingSpec {
    /// Lead-rubber or elastomeric bearing: a yielding core beside a spring. It has two axes.
    Elastomeric(ElastomericSpec),
    /// Friction pendulum. It has two axes, or a third one for the vertical displacement.
    FrictionPendulum(FrictionPendulumSpec),
}

/// Lead-rubber or elastomeric bearing. The force is that of the rubber, k₂ d, and that of the core, which yields at Q_d in every
/// direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ElastomericSpec {
    /// Stiffness before the core yields, greater than `post_yield_stiffness_n_per_m`.
    #[schemars(example = 1.0e7)]
    pub stiffness_n_per_m: f64,
    /// Characteristic strength Q_d, greater than 0: the force of the core when it yields.
    #[schemars(example = 5.0e4)]
    pub characteristic_strength_n: f64,
    /// Stiffness k₂ after the core has yielded. It must not be negative.
    #[schemars(example = 1.0e6)]
    pub post_yield_stiffness_n_per_m: f64,
    /// Damping of the rubber in each direction. It must not be negative. Default: 0.
    #[serde(default)]
    #[schemars(example = 1.0e4)]
    pub damping_n_s_per_m: f64,
    /// If true, the core yields gradually, after Bouc and Wen in two directions with the exponent 2 and β = γ = ½.
    /// Default: false, it is elastic up to Q_d.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schemars(example = true)]
    pub smooth: bool,
}

/// Friction pendulum: the restoring force is N d/R, and the friction μ N acts against the motion.
///
/// μ = μ_fast − (μ_fast − μ_slow) exp(−a |v|). Without axial force N there is no force: the bearing is lifted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrictionPendulumSpec {
    /// Effective radius R of the pendulum, greater than 0.
    #[schemars(example = 2.0)]
    pub radius_m: f64,
    /// Stiffness of the friction before it slides, greater than 0. N/R acts beside it.
    #[schemars(example = 5.0e7)]
    pub stiffness_n_per_m: f64,
    /// Friction coefficient at rest, greater than 0 and at most 1.
    #[schemars(example = 0.04)]
    pub friction_slow: f64,
    /// Friction coefficient at high velocity, from `friction_slow` to 1.
    #[schemars(example = 0.07)]
    pub friction_fast: f64,
    /// Rate a of the change between both, in s/m. It must not be negative.
    #[schemars(example = 50.0)]
    pub rate_s_per_m: f64,
    /// Axial force N, compression positive. With two axes it is constant. With three axes it is the largest one expected, and the
    /// proof of stability holds up to it.
    #[schemars(example = 1.0e6)]
    pub largest_axial_force_n: f64,
    /// Vertical stiffness in compression, greater than 0. It makes the third axis, whose positive displacement lifts the bearing.
    /// The axial force of a step then follows from the displacement of this axis in the same step. Default: two axes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 1.0e9)]
    pub vertical_stiffness_n_per_m: Option<f64>,
}

impl BearingSpec {
    /// Number of axes.
    #[must_use]
    pub const fn axes(&self) -> usize {
        match self {
            Self::FrictionPendulum(FrictionPendulumSpec {
                vertical_stiffness_n_per_m: Some(_),
                ..
            }) => 3,
            _ => 2,
        }
    }

    /// Force in N at which it begins to yield or slide.
    #[must_use]
    pub const fn yield_force(&self) -> f64 {
        match self {
            Self::Elastomeric(spec) => spec.characteristic_strength_n,
            Self::FrictionPendulum(spec) => spec.friction_slow * spec.largest_axial_force_n,
        }
    }

    /// True if its force depends on the velocity.
    #[must_use]
    pub fn resists_velocity(&self) -> bool {
        match self {
            Self::Elastomeric(spec) => spec.damping_n_s_per_m != 0.0,
            Self::FrictionPendulum(spec) => {
                spec.friction_fast > spec.friction_slow && spec.rate_s_per_m > 0.0
            }
        }
    }

    /// The bearing at rest.
    ///
    /// # Errors
    /// A parameter outside its domain, or another number of axes.
    pub fn build(&self, axes: usize) -> Result<Bearing, LawError> {
        if axes != self.axes() {
            return Err(LawError::Size {
                name: "bearing",
                what: "axes",
                found: self.axes(),
                wanted: axes,
            });
        }
        let kind = match self {
            Self::Elastomeric(spec) => spec.kind()?,
            Self::FrictionPendulum(spec) => spec.kind()?,
        };
        Ok(Bearing {
            kind,
            committed: Slider::default(),
            trial: Slider::default(),
            tangent: [[0.0; 2]; 2],
        }
        .at_rest())
    }
}

impl ElastomericSpec {
    fn kind(&self) -> Result<Kind, LawError> {
        let stiffness = positive("stiffness_n_per_m", self.stiffness_n_per_m)?;
        let rubber = not_negative(
            "post_yield_stiffness_n_per_m",
            self.post_yield_stiffness_n_per_m,
        )?;
        let allowed = "less than stiffness_n_per_m";
        inside(
            "post_yield_stiffness_n_per_m",
            rubber,
            rubber < stiffness,
            allowed,
        )?;
        Ok(Kind::Elastomeric {
            core: stiffness - rubber,
            strength: positive("characteristic_strength_n", self.characteristic_strength_n)?,
            rubber,
            damping: not_negative("damping_n_s_per_m", self.damping_n_s_per_m)?,
            smooth: self.smooth,
        })
    }
}

impl FrictionPendulumSpec {
    fn kind(&self) -> Result<Kind, LawError> {
        let slow = positive("friction_slow", self.friction_slow)?;
        inside(
            "friction_slow",
            slow,
            slow <= 1.0,
            "greater than 0 and at most 1",
        )?;
        let fast = self.friction_fast;
        inside(
            "friction_fast",
            fast,
            (slow..=1.0).contains(&fast),
            "from friction_slow to 1",
        )?;
        let vertical = match self.vertical_stiffness_n_per_m {
            Some(stiffness) => Some(positive("vertical_stiffness_n_per_m", stiffness)?),
            None => None,
        };
        Ok(Kind::Pendulum {
            radius: positive("radius_m", self.radius_m)?,
            stiffness: positive("stiffness_n_per_m", self.stiffness_n_per_m)?,
            slow,
            more: fast - slow,
            rate: not_negative("rate_s_per_m", self.rate_s_per_m)?,
            largest: positive("largest_axial_force_n", self.largest_axial_force_n)?,
            vertical,
        })
    }
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Elastomeric {
        /// Elastic stiffness of the core.
        core: f64,
        strength: f64,
        rubber: f64,
        damping: f64,
        smooth: bool,
    },
    Pendulum {
        radius: f64,
        stiffness: f64,
        slow: f64,
        /// Friction at high velocity less that at rest.
        more: f64,
        rate: f64,
        /// Largest axial force.
        largest: f64,
        vertical: Option<f64>,
    },
}

/// Displacement and elastic origin, in m.
#[derive(Debug, Clone, Copy, Default)]
struct Slider {
    disp: [f64; 2],
    /// Where the elastic line has no force.
    rest: [f64; 2],
}

state! { Slider { disp, rest } }

/// See [`BearingSpec`].
#[derive(Debug, Clone)]
pub struct Bearing {
    kind: Kind,
    committed: Slider,
    trial: Slider,
    /// Tangent of the horizontal axes at the last trial.
    tangent: [[f64; 2]; 2],
}

state! {
    Bearing as "bearing" { committed } keeps { kind, trial, tangent }
    restored { *trial = *committed; }
}

fn length(vector: [f64; 2]) -> f64 {
    libm::hypot(vector[0], vector[1])
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

impl Slider {
    /// The slider at `disp` with a hysteretic force in a circle, that force, and its direction where it is on the circle.
    fn moved(
        self,
        disp: [f64; 2],
        stiffness: f64,
        strength: f64,
    ) -> (Self, [f64; 2], Option<[f64; 2]>) {
        let of = |rest: [f64; 2]| [0, 1].map(|i| stiffness * (disp[i] - rest[i]));
        if strength <= 0.0 {
            return (Self { disp, rest: disp }, [0.0; 2], None);
        }
        let mut rest = self.rest;
        let travel = [0, 1].map(|i| disp[i] - self.disp[i]);
        let mut start = [0, 1].map(|i| stiffness * (self.disp[i] - rest[i]));
        let size = length(start);
        if size > strength {
            // The circle has become smaller.
            start = start.map(|force| force * (strength / size));
            rest = [0, 1].map(|i| self.disp[i] - start[i] / stiffness);
        }
        let end = of(rest);
        if length(end) <= strength {
            return (Self { disp, rest }, end, None);
        }
        // Elastic up to the circle, at the share t of the way. A repeated displacement may be beyond it by rounding.
        let way = travel.map(|travel| stiffness * travel);
        let whole = length(way);
        if whole == 0.0 {
            return (
                Self { disp, rest },
                end,
                Some(end.map(|force| force / length(end))),
            );
        }
        let ahead = way.map(|part| part / whole);
        let along = dot(start, ahead);
        let inside = (strength * strength - dot(start, start)).max(0.0);
        let root = (along * along + inside).sqrt();
        let elastic = if along > 0.0 {
            inside / (along + root)
        } else {
            root - along
        };
        let elastic = elastic.min(whole);
        let on = [0, 1].map(|i| (start[i] + elastic * ahead[i]) / strength);
        // Plastic: the force turns towards the motion.
        let cosine = dot(on, ahead).clamp(-1.0, 1.0);
        let across = [0, 1].map(|i| on[i] - cosine * ahead[i]);
        let sine = length(across);
        let half = sine / (1.0 + cosine) * libm::exp((elastic - whole) / strength);
        let scale = 1.0 / (1.0 + half * half);
        let normal = if sine > 0.0 && half.is_finite() {
            [0, 1].map(|i| scale * ((1.0 - half * half) * ahead[i] + 2.0 * half * across[i] / sine))
        } else {
            ahead
        };
        let force = normal.map(|component| strength * component);
        let rest = [0, 1].map(|i| disp[i] - force[i] / stiffness);
        (Self { disp, rest }, force, Some(normal))
    }
}

impl Slider {
    /// The slider at `disp` with the force of a smooth core, and z where it yields: the tangent is k (I − z zᵀ).
    fn flowed(
        self,
        disp: [f64; 2],
        stiffness: f64,
        strength: f64,
    ) -> (Self, [f64; 2], Option<[f64; 2]>) {
        let travel = [0, 1].map(|i| disp[i] - self.disp[i]);
        let whole = length(travel);
        let start = [0, 1].map(|i| stiffness * (self.disp[i] - self.rest[i]) / strength);
        let ahead = if whole > 0.0 {
            travel.map(|travel| travel / whole)
        } else {
            [1.0, 0.0]
        };
        // Elastic until z has no part against the motion; the rest of the way is τ = k s/Q.
        let (mut along, mut way) = (dot(start, ahead), stiffness * whole / strength);
        let across = [0, 1].map(|i| start[i] - along * ahead[i]);
        let elastic = way.min((-along).max(0.0));
        along += elastic;
        way -= elastic;
        let share = libm::tanh(way);
        let flowed = (along + share) / (1.0 + along * share);
        // Beyond 700 the hyperbolic functions are infinite.
        let far = way.min(700.0);
        let rest = 1.0 / (libm::cosh(far) + along * libm::sinh(far));
        let z = [0, 1].map(|i| flowed * ahead[i] + rest * across[i]);
        let force = z.map(|z| strength * z);
        let rest = [0, 1].map(|i| disp[i] - force[i] / stiffness);
        (Self { disp, rest }, force, (flowed >= 0.0).then_some(z))
    }
}

/// First two entries.
fn horizontal(values: &[f64]) -> [f64; 2] {
    [0, 1].map(|i| values.get(i).copied().unwrap_or(f64::NAN))
}

/// Writes an entry of an n × n matrix; one that does not exist is left.
fn set(matrix: &mut [f64], axes: usize, (row, column): (usize, usize), value: f64) {
    if let Some(entry) = matrix.get_mut(row + axes * column) {
        *entry = value;
    }
}

impl Bearing {
    /// Elastic tangent until the first motion.
    fn at_rest(mut self) -> Self {
        let stiffness = self.stiffness();
        self.tangent = [[stiffness, 0.0], [0.0, stiffness]];
        self
    }

    /// Horizontal stiffness before it yields or slides, under the largest axial force.
    fn stiffness(&self) -> f64 {
        match self.kind {
            Kind::Elastomeric { core, rubber, .. } => core + rubber,
            Kind::Pendulum {
                radius,
                stiffness,
                largest,
                ..
            } => stiffness + largest / radius,
        }
    }

    /// Largest damping of a horizontal axis.
    fn damping(&self) -> f64 {
        match self.kind {
            Kind::Elastomeric { damping, .. } => damping,
            Kind::Pendulum {
                more,
                rate,
                largest,
                ..
            } => more * rate * largest,
        }
    }

    fn vertical(&self) -> Option<f64> {
        match self.kind {
            Kind::Elastomeric { .. } => None,
            Kind::Pendulum { vertical, .. } => vertical,
        }
    }

    /// Writes a horizontal and a vertical value on the diagonal.
    fn diagonal(&self, matrix: &mut [f64], horizontal: f64, vertical: f64) {
        matrix.fill(0.0);
        let axes = self.axes();
        for axis in 0..axes {
            let value = if axis < 2 { horizontal } else { vertical };
            set(matrix, axes, (axis, axis), value);
        }
    }
}

impl Bearing {
    /// Number of axes n: two, or three with a vertical one.
    #[must_use]
    pub fn axes(&self) -> usize {
        2 + usize::from(self.vertical().is_some())
    }

    /// Resisting forces (n) in N at displacements in m and velocities in m/s, from the committed state. Real-time: yes.
    pub fn trial(&mut self, disp: &[f64], vel: &[f64], force: &mut [f64]) {
        let (at, speed) = (horizontal(disp), horizontal(vel));
        let (stiffness, strength, spring, damping, axial) = match self.kind {
            Kind::Elastomeric {
                core,
                strength,
                rubber,
                damping,
                ..
            } => (core, strength, rubber, damping, None),
            Kind::Pendulum {
                radius,
                stiffness,
                slow,
                more,
                rate,
                largest,
                vertical,
            } => {
                let axial = vertical.map(|vertical| {
                    let lift = disp.get(2).copied().unwrap_or(f64::NAN);
                    if lift >= 0.0 { 0.0 } else { -vertical * lift }
                });
                let normal = axial.unwrap_or(largest);
                let friction = slow - more * libm::expm1(-rate * length(speed));
                (stiffness, friction * normal, normal / radius, 0.0, axial)
            }
        };
        let (slider, core, normal) = match self.kind {
            Kind::Elastomeric { smooth: true, .. } => {
                self.committed.flowed(at, stiffness, strength)
            }
            _ => self.committed.moved(at, stiffness, strength),
        };
        self.trial = slider;
        let held = if strength > 0.0 { stiffness } else { 0.0 };
        let normal = normal.unwrap_or_default();
        for i in 0..2 {
            if let Some(force) = force.get_mut(i) {
                *force = spring * at[i] + core[i] + damping * speed[i];
            }
            for j in 0..2 {
                let unit = if i == j { 1.0 } else { 0.0 };
                self.tangent[i][j] = spring * unit + held * (unit - normal[i] * normal[j]);
            }
        }
        if let (Some(force), Some(axial)) = (force.get_mut(2), axial) {
            *force = -axial;
        }
    }

    /// The last trial becomes the committed state. Real-time: yes.
    pub fn commit(&mut self) {
        self.committed = self.trial;
    }

    /// Forgets the last trial. Real-time: yes.
    pub fn revert(&mut self) {
        self.trial = self.committed;
    }

    /// What enters K0 and C0, n × n each.
    pub fn reference(&self, stiffness: &mut [f64], damping: &mut [f64]) {
        let vertical = self.vertical().unwrap_or_default();
        self.diagonal(stiffness, self.stiffness(), vertical);
        self.diagonal(damping, self.damping(), 0.0);
    }

    /// Tangent stiffness at the last trial, n × n. Real-time: yes.
    pub fn tangent(&self, stiffness: &mut [f64]) {
        let axes = self.axes();
        self.diagonal(stiffness, 0.0, self.vertical().unwrap_or_default());
        for (row, line) in self.tangent.iter().enumerate() {
            for (column, value) in line.iter().enumerate() {
                set(stiffness, axes, (row, column), *value);
            }
        }
    }

    /// The friction grows with the velocity around rest alone.
    pub fn rest_damping(&self, damping: &mut [f64]) {
        let at_rest = match self.kind {
            Kind::Elastomeric { .. } => 0.0,
            Kind::Pendulum { .. } => self.damping(),
        };
        self.diagonal(damping, at_rest, 0.0);
    }

    /// With a vertical axis, the axial force adds e = |d|/R + μ to the horizontal force for each unit of it. The bound covers the
    /// coupling of both axes by half of k_v e² on the horizontal and half of k_v on the vertical axis.
    ///
    /// # Errors
    /// An axis whose reach is needed and not declared.
    pub fn bound(
        &self,
        reach: &[Reach],
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) -> Result<(), usize> {
        self.diagonal(stiffness, self.stiffness(), 0.0);
        self.diagonal(damping, self.damping(), 0.0);
        let Kind::Pendulum {
            radius,
            slow,
            more,
            vertical: Some(vertical),
            ..
        } = self.kind
        else {
            return Ok(());
        };
        let mut farthest = 0.0;
        for axis in 0..2 {
            let reach = reach.get(axis).and_then(|reach| reach.disp).ok_or(axis)?;
            farthest = libm::hypot(farthest, reach);
        }
        let each = farthest / radius + slow + more;
        let horizontal = self.stiffness() + 0.5 * vertical * each * each;
        self.diagonal(stiffness, horizontal, 1.5 * vertical);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const RUBBER: ElastomericSpec = ElastomericSpec {
        stiffness_n_per_m: 1.1e6,
        characteristic_strength_n: 1e3,
        post_yield_stiffness_n_per_m: 1e5,
        damping_n_s_per_m: 0.0,
        smooth: false,
    };
    const PENDULUM: FrictionPendulumSpec = FrictionPendulumSpec {
        radius_m: 2.0,
        stiffness_n_per_m: 1e6,
        friction_slow: 0.05,
        friction_fast: 0.08,
        rate_s_per_m: 20.0,
        largest_axial_force_n: 2e4,
        vertical_stiffness_n_per_m: None,
    };

    fn rubber() -> Bearing {
        BearingSpec::Elastomeric(RUBBER).build(2).unwrap()
    }

    fn smooth() -> Bearing {
        let spec = ElastomericSpec {
            smooth: true,
            ..RUBBER
        };
        BearingSpec::Elastomeric(spec).build(2).unwrap()
    }

    fn pendulum(vertical: Option<f64>) -> Bearing {
        let spec = FrictionPendulumSpec {
            vertical_stiffness_n_per_m: vertical,
            ..PENDULUM
        };
        let spec = BearingSpec::FrictionPendulum(spec);
        spec.build(spec.axes()).unwrap()
    }

    fn step<const N: usize>(bearing: &mut Bearing, disp: [f64; N], vel: [f64; N]) -> [f64; N] {
        let mut force = [0.0; N];
        bearing.trial(&disp, &vel, &mut force);
        bearing.commit();
        force
    }

    fn assert_near<const N: usize>(found: [f64; N], wanted: [f64; N]) {
        for (found, wanted) in found.iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-9 * 1e3, "{found} {wanted}");
        }
    }

    /// In one direction it is the bilinear law, whatever the direction.
    #[test]
    fn one_direction_is_bilinear() {
        for angle in [0.0, 0.7, 2.0] {
            let mut bearing = rubber();
            for (disp, force) in [
                (5e-4, 550.0),
                (3e-3, 1300.0),
                (2e-3, 200.0),
                (-2e-3, -1200.0),
            ] {
                let unit = [libm::cos(angle), libm::sin(angle)];
                let found = step(&mut bearing, unit.map(|u| u * disp), [0.0; 2]);
                assert_near(found, unit.map(|u| u * force));
            }
        }
    }

    /// A turn by a right angle on the circle: tan(θ/2) = exp(−k s/Q).
    #[test]
    fn core_turns_towards_the_motion() {
        let mut bearing = rubber();
        step(&mut bearing, [5e-3, 0.0], [0.0; 2]);
        let way = 1.3e-3;
        let found = step(&mut bearing, [5e-3, way], [0.0; 2]);
        let half = libm::exp(-1e6 * way / 1e3);
        let (cosine, sine) = (
            (1.0 - half * half) / (1.0 + half * half),
            2.0 * half / (1.0 + half * half),
        );
        assert_near(found, [500.0 + 1e3 * sine, 130.0 + 1e3 * cosine]);
    }

    /// From rest q = Q tanh(k x/Q); back it is elastic up to q = 0. A path across it turns the force.
    #[test]
    fn smooth_core_has_its_closed_form() {
        let mut bearing = smooth();
        let yielding = 1e3 * libm::tanh(1.5);
        assert_near(
            step(&mut bearing, [1.5e-3, 0.0], [0.0; 2]),
            [150.0 + yielding, 0.0],
        );
        let sideways = [1.5e-3, 0.8e-3];
        assert_near(
            step(&mut bearing, sideways, [0.0; 2]),
            [
                150.0 + yielding / libm::cosh(0.8),
                80.0 + 1e3 * libm::tanh(0.8),
            ],
        );
        let mut bearing = smooth();
        step(&mut bearing, [1.5e-3, 0.0], [0.0; 2]);
        assert_near(
            step(&mut bearing, [1.0e-3, 0.0], [0.0; 2]),
            [100.0 + yielding - 500.0, 0.0],
        );
        step(&mut bearing, [1.0, 0.0], [0.0; 2]);
        assert_near(
            step(&mut bearing, [-1.0, 1.0], [0.0; 2]),
            [
                -1e5 - 1e3 * 2.0 / f64::sqrt(5.0),
                1e5 + 1e3 / f64::sqrt(5.0),
            ],
        );
    }

    #[test]
    fn friction_depends_on_the_velocity() {
        let mut bearing = pendulum(None);
        let friction = |speed: f64| 0.08 - 0.03 * libm::exp(-20.0 * speed);
        assert_near(step(&mut bearing, [0.1, 0.0], [0.0; 2]), [1e3 + 1e3, 0.0]);
        let wanted = 1e3 + 2e4 * friction(0.1);
        assert_near(
            step(&mut bearing, [0.1 + 2e-3, 0.0], [0.06, 0.08])[..1]
                .try_into()
                .unwrap(),
            [wanted + 20.0],
        );
    }

    #[test]
    fn lifted_pendulum_has_no_force() {
        let mut bearing = pendulum(Some(1e8));
        // 1e4 N: N d/R + 0.05 N.
        assert_near(
            step(&mut bearing, [0.1, 0.0, -1e-4], [0.0; 3]),
            [500.0 + 500.0, 0.0, -1e4],
        );
        assert_near(step(&mut bearing, [0.1, 0.0, 1e-3], [0.0; 3]), [0.0; 3]);
        assert_near(step(&mut bearing, [0.05, 0.0, 1e-3], [0.0; 3]), [0.0; 3]);
        // Where it lands, the friction starts from zero.
        assert_near(
            step(&mut bearing, [0.05, 0.0, -1e-4], [0.0; 3]),
            [250.0, 0.0, -1e4],
        );
    }

    #[test]
    fn bearing_needs_its_axes() {
        let refused = |spec: &BearingSpec, axes| spec.build(axes).unwrap_err().key();
        assert_eq!(refused(&BearingSpec::Elastomeric(RUBBER), 1), "bearing");
        let mut spec = PENDULUM;
        spec.friction_fast = 0.04;
        assert_eq!(
            refused(&BearingSpec::FrictionPendulum(spec), 2),
            "friction_fast"
        );
        let mut spec = RUBBER;
        spec.post_yield_stiffness_n_per_m = 1.1e6;
        assert_eq!(
            refused(&BearingSpec::Elastomeric(spec), 2),
            "post_yield_stiffness_n_per_m"
        );
        let (mut stiffness, mut damping) = ([0.0; 9], [0.0; 9]);
        let free = [Reach::default(); 3];
        assert_eq!(
            pendulum(Some(1e8)).bound(&free, &mut stiffness, &mut damping),
            Err(0)
        );
    }

    /// Symmetric part of a tangent within a bound: no direction has more.
    fn is_within(tangent: &[[f64; 2]; 2], most: f64) -> bool {
        let [[a, b], [c, d]] = *tangent;
        let (mean, half) = (0.5 * (a + d), 0.5 * (b + c));
        mean + libm::hypot(0.5 * (a - d), half) <= most * (1.0 + 1e-9)
    }

    proptest! {
        /// The straight path decides, not the steps on it. A closed path gives nothing out.
        #[test]
        fn one_step_equals_its_parts(turns in prop::collection::vec((-0.02..0.02f64, -0.02..0.02f64), 1..20), pieces in 2..7u32) {
            for make in [rubber, smooth, || pendulum(None)] {
                let (mut whole, mut parts) = (make(), make());
                let (mut from, mut energy) = ([0.0; 2], 0.0);
                let mut last = [0.0; 2];
                for (x, y) in turns.iter().copied().chain([(0.0, 0.0)]) {
                    let force = step(&mut whole, [x, y], [0.0; 2]);
                    for i in 1..=40 * pieces {
                        let share = f64::from(i) / f64::from(40 * pieces);
                        let at = [from[0] + share * (x - from[0]), from[1] + share * (y - from[1])];
                        let before = parts.committed.disp;
                        let now = step(&mut parts, at, [0.0; 2]);
                        energy += (0..2).map(|i| 0.5 * (now[i] + last[i]) * (at[i] - before[i])).sum::<f64>();
                        last = now;
                        prop_assert!(is_within(&parts.tangent, parts.stiffness()));
                    }
                    prop_assert!((0..2).all(|i| (force[i] - last[i]).abs() < 1e-6), "{:?} {:?}", force, last);
                    from = [x, y];
                }
                prop_assert!(energy > -1e-3, "{}", energy);
            }
        }
    }
}
