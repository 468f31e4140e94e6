//! Damage of the unloading stiffness, of the reloading and of the strength.

/// One kind of damage: g1 (d/d_u)^g3 + g2 s^g4, at most its limit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mode {
    /// g1 and g2.
    pub(super) factors: [f64; 2],
    /// g3 and g4.
    pub(super) exponents: [f64; 2],
    pub(super) limit: f64,
}

impl Mode {
    fn at(&self, shares: [f64; 2]) -> f64 {
        let mut sum = 0.0;
        for ((factor, exponent), share) in self.factors.iter().zip(self.exponents).zip(shares) {
            if *factor > 0.0 {
                sum += factor * libm::pow(share, exponent);
            }
        }
        sum.min(self.limit)
    }
}

/// Constants of all kinds.
#[derive(Debug, Clone)]
pub(super) struct Damage {
    /// Stiffness, reloading and strength.
    pub(super) modes: [Mode; 3],
    /// Energy at which each damage is at its limit.
    pub(super) capacity: f64,
    pub(super) by_cycles: bool,
    /// Displacement beyond which no damage grows.
    pub(super) ultimate: f64,
}

impl Damage {
    /// The three damages, after the largest displacement `largest`, `dissipated` of all the `energy`, and `cycles`. Real-time: yes.
    pub(super) fn after(
        &self,
        largest: f64,
        energy: f64,
        dissipated: f64,
        cycles: f64,
    ) -> [f64; 3] {
        if energy >= self.capacity {
            return self.modes.map(|mode| mode.limit);
        }
        let spent = if self.by_cycles {
            cycles
        } else {
            dissipated.max(0.0) / self.capacity
        };
        let shares = [largest / self.ultimate, spent];
        self.modes.map(|mode| mode.at(shares))
    }
}
