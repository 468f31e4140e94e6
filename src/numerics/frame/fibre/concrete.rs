//! Concrete in compression and tension.
//!
//! Strains count in the strain at the compressive strength, stresses in that strength, compression positive: Young's modulus is 2.
//! Both laws follow the envelope of Kent and Park (1971): s = x (2 − x), from x = 1 a line down to the crushing point, then
//! constant. Their stress is a function of the strain and of the extremes so far (and, between the two unloading lines of
//! Mohd Yassin, of the last stress by a slope of 2), so that one step equals any number of partial steps.

use super::eight::Eight;
use super::{Concrete01Spec, Concrete02Spec, Rows, lane, put};
use crate::linalg::lanes::Isa;

/// The elastic slope.
const YOUNG: f64 = 2.0;

/// See [`Concrete01Spec`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::frame) struct Concrete01 {
    strength: f64,
    strain: f64,
    /// Crushing point.
    crushed: [f64; 2],
    /// Slope from the strength to the crushing point.
    softening: f64,
}

impl Concrete01 {
    /// Rows of a block: greatest compressive strain.
    pub(super) const ROWS: usize = 1;

    /// From a checked description.
    pub(super) fn new(spec: Concrete01Spec) -> Self {
        let crushed = [
            spec.crushing_strain / spec.strain_at_strength,
            spec.crushing_strength_pa / spec.strength_pa,
        ];
        let [strain, stress] = crushed;
        Self {
            strength: spec.strength_pa,
            strain: spec.strain_at_strength,
            crushed,
            softening: (stress - 1.0) / (strain - 1.0),
        }
    }

    pub(super) fn young(&self) -> f64 {
        YOUNG * self.strength / self.strain
    }

    pub(super) fn yield_strain(&self) -> f64 {
        self.strain
    }

    /// Stress and slope of the first loading.
    #[inline(always)]
    fn envelope(&self, x: f64) -> [f64; 2] {
        let [crushing, remaining] = self.crushed;
        if x < 1.0 {
            [x * (2.0 - x), YOUNG * (1.0 - x)]
        } else if x < crushing {
            [1.0 + self.softening * (x - 1.0), self.softening]
        } else {
            [remaining, 0.0]
        }
    }

    /// End and slope of the unloading line from the greatest strain: residual strain after Karsan and Jirsa (1969), continued by a
    /// line beyond twice the strain at the strength, as in OpenSees; no slope exceeds the elastic one.
    #[inline(always)]
    fn unloading(&self, peak: f64) -> [f64; 2] {
        let [stress, _] = self.envelope(peak);
        let x = peak.min(self.crushed[0]);
        let residual = if x < 2.0 {
            (0.145 * x + 0.13) * x
        } else {
            0.707 * (x - 2.0) + 0.834
        };
        let length = (peak - residual).max(stress / YOUNG);
        [peak - length, stress / length]
    }

    #[inline(always)]
    fn at(&self, x: f64, peak: f64) -> ([f64; 1], [f64; 2]) {
        if x >= peak {
            return ([x], self.envelope(x));
        }
        let [end, slope] = self.unloading(peak);
        let response = if x <= end {
            [0.0; 2]
        } else {
            [slope * (x - end), slope]
        };
        ([peak], response)
    }

    /// Stress and tangent of eight fibres on their way from the rows `old`. Real-time: yes.
    #[inline(always)]
    pub(super) fn respond<I: Isa>(
        &self,
        strain: Eight<I>,
        old: &Rows<{ Self::ROWS }>,
        new: &mut Rows<{ Self::ROWS }>,
    ) -> [Eight<I>; 2] {
        self.by_lane(strain, old, new, |x, [peak]| self.at(x, peak))
    }

    /// Runs a law lane by lane, in the units of concrete.
    #[inline(always)]
    fn by_lane<I: Isa, const ROWS: usize>(
        &self,
        strain: Eight<I>,
        old: &Rows<ROWS>,
        new: &mut Rows<ROWS>,
        law: impl Fn(f64, [f64; ROWS]) -> ([f64; ROWS], [f64; 2]),
    ) -> [Eight<I>; 2] {
        let (mut stresses, mut tangents) = ([0.0; 8], [0.0; 8]);
        for (k, strain) in strain.array().into_iter().enumerate() {
            let (rows, [stress, slope]) = law(-strain / self.strain, lane(old, k));
            put(rows, new, k);
            stresses[k] = -self.strength * stress;
            tangents[k] = self.strength / self.strain * slope;
        }
        [
            Eight::load(strain.0, &stresses),
            Eight::load(strain.0, &tangents),
        ]
    }
}

/// See [`Concrete02Spec`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::frame) struct Concrete02 {
    compression: Concrete01,
    /// Strain of the focal point, at most 0: the elastic line and all reloading lines pass it.
    focus: f64,
    tensile_strength: f64,
    tension_softening: f64,
}

impl Concrete02 {
    /// Rows of a block: greatest compressive strain, greatest opening in tension, strain, stress.
    pub(super) const ROWS: usize = 4;

    /// From a checked description.
    pub(super) fn new(compression: Concrete01, spec: &Concrete02Spec) -> Self {
        let [strain, stress] = compression.crushed;
        let ratio = spec.unloading_ratio;
        Self {
            compression,
            focus: (stress - YOUNG * ratio * strain) / (YOUNG * (1.0 - ratio)),
            tensile_strength: spec.tensile_strength_pa / spec.strength_pa,
            tension_softening: spec.tension_softening_pa * spec.strain_at_strength
                / spec.strength_pa,
        }
    }

    pub(super) fn young(&self) -> f64 {
        self.compression.young()
    }

    pub(super) fn yield_strain(&self) -> f64 {
        self.compression.yield_strain()
    }

    /// Tensile stress and slope at an opening that was not exceeded before.
    #[inline(always)]
    fn tension(&self, opening: f64) -> [f64; 2] {
        let cracking = self.tensile_strength / YOUNG;
        let softened = self.tensile_strength - self.tension_softening * (opening - cracking);
        if opening <= cracking {
            [YOUNG * opening, YOUNG]
        } else if softened <= 0.0 {
            [0.0; 2]
        } else {
            [softened, -self.tension_softening]
        }
    }

    #[inline(always)]
    fn at(
        &self,
        x: f64,
        [peak, opening, last, stress]: [f64; Self::ROWS],
    ) -> ([f64; Self::ROWS], [f64; 2]) {
        if x >= peak {
            let [stress, slope] = self.compression.envelope(x);
            return ([x, opening, x, stress], [stress, slope]);
        }
        let [top, _] = self.compression.envelope(peak);
        let slope = if peak > 0.0 {
            (top - YOUNG * self.focus) / (peak - self.focus)
        } else {
            YOUNG
        };
        let end = if top > 0.0 { peak - top / slope } else { peak };
        if x >= end {
            let upper = slope * (x - end);
            let elastic = stress + YOUNG * (x - last);
            let [stress, slope] = if elastic > upper {
                [upper, slope]
            } else if elastic < 0.5 * upper {
                [0.5 * upper, 0.5 * slope]
            } else {
                [elastic, YOUNG]
            };
            return ([peak, opening, x, stress], [stress, slope]);
        }
        let now = end - x;
        let [tension, slope] = if now < opening {
            let secant = self.tension(opening)[0] / opening;
            [secant * now, secant]
        } else {
            self.tension(now)
        };
        ([peak, opening.max(now), x, -tension], [-tension, slope])
    }

    /// Stress and tangent of eight fibres on their way from the rows `old`. Real-time: yes.
    #[inline(always)]
    pub(super) fn respond<I: Isa>(
        &self,
        strain: Eight<I>,
        old: &Rows<{ Self::ROWS }>,
        new: &mut Rows<{ Self::ROWS }>,
    ) -> [Eight<I>; 2] {
        self.compression
            .by_lane(strain, old, new, |x, rows| self.at(x, rows))
    }
}
