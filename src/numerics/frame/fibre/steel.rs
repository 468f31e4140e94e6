//! Steel of Menegotto and Pinto (1973) with the isotropic hardening of Filippou, Popov and Bertero (1983, report UCB/EERC-83/19).
//!
//! All is in yield strains and yield stresses. From the last reversal (x_r, s_r) a branch bends towards the hardening line. The elastic
//! line meets that after the span d, so that with the hardening ratio b, a = |(x − x_r)/d| and w = (1 + aᴿ)^(1/R)
//!
//! ```text
//! s = s_r + (x − x_r) (b + (1 − b)/w)        ds/dx = b + (1 − b)/(w (1 + aᴿ))
//! ```
//!
//! Beyond a = 1 both are written in q = 1/a, so that no power overflows: w = a (1 + qᴿ)^(1/R).

use super::power::{exponent_of, power};
use super::{MenegottoPintoSpec, Rows, lane, put};

/// The shortest span, in yield strains. Rounding alone could make one 0 or turn it round, where a branch begins on its own line.
const SHORTEST: f64 = 1e-12;

/// See [`MenegottoPintoSpec`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::frame) struct MenegottoPinto {
    spec: MenegottoPintoSpec,
    /// Yield strains in a strain of 1.
    per_strain: f64,
    /// 1 − b, and 1/(1 − b).
    rest: f64,
    per_rest: f64,
}

impl MenegottoPinto {
    /// Rows of a block: strain, stress; least and greatest strain of the reversals; strain and stress of the last reversal; span of
    /// the branch, negative towards compression and 0 before the first motion; exponent R.
    pub(super) const ROWS: usize = 8;

    /// Of a checked description.
    pub(super) fn new(spec: MenegottoPintoSpec) -> Self {
        let rest = 1.0 - spec.hardening_ratio;
        Self {
            spec,
            per_strain: spec.young_pa / spec.yield_pa,
            rest,
            per_rest: 1.0 / rest,
        }
    }

    pub(super) fn young(&self) -> f64 {
        self.spec.young_pa
    }

    pub(super) fn yield_strain(&self) -> f64 {
        self.spec.yield_pa / self.spec.young_pa
    }

    /// Each row before the first motion.
    pub(super) fn virgin(&self) -> [f64; Self::ROWS] {
        [0.0, 0.0, -1.0, 1.0, 0.0, 0.0, 0.0, self.spec.r0]
    }

    /// Stress and tangent of eight fibres on their way from the rows `old`. Real-time: yes.
    #[inline(always)]
    pub(super) fn respond(
        &self,
        strain: &[f64; 8],
        old: &Rows<{ Self::ROWS }>,
        new: &mut Rows<{ Self::ROWS }>,
    ) -> Rows<2> {
        let strain = strain.map(|strain| strain * self.per_strain);
        let shift = self.shift(&strain, old);
        let (mut shares, mut is_bent) = ([0.0; 8], false);
        for (k, share) in shares.iter_mut().enumerate() {
            let rows = self.branch(strain[k], shift[k], lane(old, k));
            put(rows, new, k);
            let [x, _, _, _, from, _, span, exponent] = rows;
            let (distance, span) = ((x - from).abs(), span.abs());
            let (short, long) = if distance > span {
                (span, distance)
            } else {
                (distance, span)
            };
            *share = short / if long > SHORTEST { long } else { SHORTEST };
            is_bent |= distance > span || exponent * (exponent_of(*share) + 1.0) > -54.0;
        }
        // Where aᴿ is below 2⁻⁵⁴ in all lanes, 1 + aᴿ is 1 and the root of it, too.
        let (mut powers, mut roots) = ([0.0; 8], [1.0; 8]);
        if is_bent {
            for k in 0..8 {
                let exponent = new[7][k];
                powers[k] = power(shares[k], exponent);
                roots[k] = power(1.0 + powers[k], -1.0 / exponent);
            }
        }
        let [mut stresses, mut tangents] = [[0.0; 8]; 2];
        for k in 0..8 {
            let [x, _, _, _, from, from_stress, span, _] = lane(new, k);
            let b = self.spec.hardening_ratio;
            let distance = x - from;
            let is_beyond = distance.abs() > span.abs();
            let bent = if is_beyond { span } else { distance };
            let stress = from_stress + b * distance + self.rest * bent * roots[k];
            let slope = if is_beyond {
                shares[k] * powers[k]
            } else {
                1.0
            };
            new[1][k] = stress;
            stresses[k] = self.spec.yield_pa * stress;
            tangents[k] =
                self.spec.young_pa * (b + self.rest * slope * roots[k] / (1.0 + powers[k]));
        }
        [stresses, tangents]
    }

    /// Hardening line of a branch that begins now, in yield stresses.
    #[inline(always)]
    fn shift(&self, strain: &[f64; 8], old: &Rows<{ Self::ROWS }>) -> [f64; 8] {
        let MenegottoPintoSpec { a1, a2, a3, a4, .. } = self.spec;
        let mut shift = [1.0; 8];
        let turns = |k: usize| (strain[k] - old[0][k]) * old[6][k] < 0.0;
        if a1 + a3 > 0.0 && (0..8).any(turns) {
            let (compression, tension) = ((a1, 0.5 / a2), (a3, 0.5 / a4));
            for (k, shift) in shift.iter_mut().enumerate() {
                let [last, _, low, high, ..] = lane(old, k);
                let (most, per_half) = if strain[k] > last {
                    tension
                } else {
                    compression
                };
                let range = greater(high, last) - less(low, last);
                *shift += most * power(range * per_half, 0.8);
            }
        }
        shift
    }

    /// The branch on which a fibre is at the strain `x`; the stress is still the old one.
    #[inline(always)]
    fn branch(&self, x: f64, shift: f64, old: [f64; Self::ROWS]) -> [f64; Self::ROWS] {
        let [last, stress, low, high, from, from_stress, span, exponent] = old;
        let MenegottoPintoSpec { r0, cr1, cr2, .. } = self.spec;
        let step = x - last;
        let sign = if step > 0.0 { 1.0 } else { -1.0 };
        let turns = step * span < 0.0;
        let first = if step == 0.0 { 0.0 } else { sign };
        let old_span = if span == 0.0 { first } else { span };

        let (new_low, new_high) = (less(low, last), greater(high, last));
        let offset = self.per_rest * (stress - self.spec.hardening_ratio * last);
        let new_span = sign * greater(shift - sign * offset, SHORTEST);
        let reached = if step > 0.0 { new_high } else { new_low };
        let plastic = (reached - (last + new_span)).abs();
        let new_exponent = r0 * (1.0 - cr1 * plastic / (cr2 + plastic));
        [
            x,
            stress,
            if turns { new_low } else { low },
            if turns { new_high } else { high },
            if turns { last } else { from },
            if turns { stress } else { from_stress },
            if turns { new_span } else { old_span },
            if turns { new_exponent } else { exponent },
        ]
    }
}

#[inline(always)]
fn less(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
