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

use super::eight::Eight;
use super::power::{exponent_of, power};
use super::{MenegottoPintoSpec, Rows};
use crate::linalg::lanes::Isa;

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

    /// From a checked description.
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
    pub(super) fn respond<I: Isa>(
        &self,
        strain: Eight<I>,
        old: &Rows<{ Self::ROWS }>,
        new: &mut Rows<{ Self::ROWS }>,
    ) -> [Eight<I>; 2] {
        let x = strain * strain.fill(self.per_strain);
        let (zero, one) = (x.fill(0.0), x.fill(1.0));
        let hardening = x.fill(self.spec.hardening_ratio);
        let [from, from_stress, span, exponent] = self.branch(x, old, new);

        let distance = x - from;
        let (length, reach) = (distance.abs(), span.abs());
        let share = length.min(reach) / length.max(reach).max(x.fill(SHORTEST));
        // An upper bound of log₂ aᴿ. Below −54 the sum 1 + aᴿ is 1, and the root of it, too.
        let bound = exponent * (exponent_of(share) + one);
        let bound = reach.if_less(length, zero, bound);
        let (mut power_of_share, mut root) = (zero, one);
        if bound.array().iter().any(|bound| *bound > -54.0) {
            power_of_share = power(share, exponent);
            root = power(one + power_of_share, (zero - one) / exponent);
        }
        let rest = x.fill(self.rest) * root;
        let bent = reach.if_less(length, span, distance);
        let stress = from_stress + hardening * distance + rest * bent;
        let slope = reach.if_less(length, share * power_of_share, one);
        let tangent = hardening + rest * slope / (one + power_of_share);
        stress.store(&mut new[1]);
        [
            x.fill(self.spec.yield_pa) * stress,
            x.fill(self.spec.young_pa) * tangent,
        ]
    }

    /// The branch on which the fibres are at the strain `x`: strain and stress of its start, span, exponent. All rows but that of the
    /// stress are new.
    #[inline(always)]
    fn branch<I: Isa>(
        &self,
        x: Eight<I>,
        old: &Rows<{ Self::ROWS }>,
        new: &mut Rows<{ Self::ROWS }>,
    ) -> [Eight<I>; 4] {
        let isa = x.0;
        let (zero, one) = (x.fill(0.0), x.fill(1.0));
        let [last, stress, low, high, from, from_stress, span, exponent] = old;
        let (last, stress) = (Eight::load(isa, last), Eight::load(isa, stress));
        let (low, high) = (Eight::load(isa, low), Eight::load(isa, high));
        let (from, from_stress) = (Eight::load(isa, from), Eight::load(isa, from_stress));
        let (span, exponent) = (Eight::load(isa, span), Eight::load(isa, exponent));

        let step = x - last;
        let sign = zero.if_less(step, one, zero) - step.if_less(zero, one, zero);
        // A branch begins where the step is against the span of the last one.
        let against = step * span;
        let (new_low, new_high) = (low.min(last), high.max(last));
        let shift = self.shift(sign, new_high - new_low, against);
        let offset = stress - x.fill(self.spec.hardening_ratio) * last;
        let length = shift - sign * offset * x.fill(self.per_rest);
        let new_span = sign * length.max(x.fill(SHORTEST));
        let reached = zero.if_less(step, new_high, new_low);
        let plastic = (reached - (last + new_span)).abs();
        let loss = x.fill(self.spec.cr1) * plastic;
        let share = one - loss / (x.fill(self.spec.cr2) + plastic);
        let new_exponent = x.fill(self.spec.r0) * share;
        // The first motion finds no span.
        let old_span = zero.if_less(span.abs(), span, sign);

        let branch = [
            against.if_less(zero, last, from),
            against.if_less(zero, stress, from_stress),
            against.if_less(zero, new_span, old_span),
            against.if_less(zero, new_exponent, exponent),
        ];
        let [from, from_stress, span, exponent] = branch;
        let low = against.if_less(zero, new_low, low);
        let high = against.if_less(zero, new_high, high);
        x.store(&mut new[0]);
        low.store(&mut new[2]);
        high.store(&mut new[3]);
        from.store(&mut new[4]);
        from_stress.store(&mut new[5]);
        span.store(&mut new[6]);
        exponent.store(&mut new[7]);
        branch
    }

    /// Hardening line of a branch that begins now in the direction `sign`, in yield stresses.
    #[inline(always)]
    fn shift<I: Isa>(&self, sign: Eight<I>, range: Eight<I>, against: Eight<I>) -> Eight<I> {
        let (zero, one) = (sign.fill(0.0), sign.fill(1.0));
        let MenegottoPintoSpec { a1, a2, a3, a4, .. } = self.spec;
        if a1 + a3 == 0.0 || against.array().iter().all(|against| *against >= 0.0) {
            return one;
        }
        let most = zero.if_less(sign, sign.fill(a3), sign.fill(a1));
        let halves = zero.if_less(sign, sign.fill(0.5 / a4), sign.fill(0.5 / a2));
        one + most * power(range * halves, sign.fill(0.8))
    }
}
