//! dz/dτ = A − c zⁿ from z = 0 on, forwards and backwards: the plain Bouc–Wen law between two sign changes.
//!
//! The equation is autonomous, so it is solved by its clock: `elapsed(z)` = the τ at which the solution from 0 passes
//! z, and its inverse. In u = z/r, r = (A/|c|)^(1/n), the clock is ∫₀ᵘ dx/(1 ∓ xⁿ): −ln(1 − u), artanh u,
//! ln(1 + u), arctan u for n = 1 and 2, and for other n a hypergeometric function, here by two power series that meet
//! in the middle of the range, each with ratio ≤ 1/2; its inverse by Newton's method from the side on which it
//! converges monotonically. No step size, no tolerance but roundoff, and a bounded number of operations.

/// Terms of a series with ratio 1/2: the first term left out is below 2⁻⁶⁴.
const TERMS: usize = 64;
/// More than Newton's method ever takes here (quadratic, but for a geometric approach when the exponent is large).
const ROUNDS: usize = 100;

/// Solutions of dz/dτ = A − c zⁿ. Real-time: yes, but for `new`.
#[derive(Debug, PartialEq)]
pub(super) struct Branch {
    /// r: z = r u. 1 for c = 0.
    scale: f64,
    /// σ = rate · τ is the clock of u: A/r.
    rate: f64,
    clock: Clock,
}

#[derive(Debug, PartialEq)]
enum Clock {
    /// c = 0: u = σ.
    Even,
    /// c > 0: u' = 1 − uⁿ.
    Saturating(Exponent<Saturation>),
    /// c < 0: u' = 1 + uⁿ.
    Steepening(Exponent<Steepening>),
}

#[derive(Debug, PartialEq)]
enum Exponent<S> {
    One,
    Two,
    Other(Box<S>),
}

impl<S> Exponent<S> {
    fn of(exponent: f64, other: fn(f64) -> S) -> Self {
        if exponent == 1.0 {
            Self::One
        } else if exponent == 2.0 {
            Self::Two
        } else {
            Self::Other(Box::new(other(exponent)))
        }
    }
}

impl Branch {
    /// A > 0, any c, n ≥ 1.
    pub(super) fn new(a: f64, c: f64, exponent: f64) -> Self {
        let clock = if c > 0.0 {
            Clock::Saturating(Exponent::of(exponent, Saturation::new))
        } else if c < 0.0 {
            Clock::Steepening(Exponent::of(exponent, Steepening::new))
        } else {
            Clock::Even
        };
        let scale = if c == 0.0 {
            1.0
        } else {
            libm::pow(a / c.abs(), 1.0 / exponent)
        };
        Self {
            scale,
            rate: a / scale,
            clock,
        }
    }

    /// z after the path `tau` of growth from `z` ≥ 0.
    #[inline]
    pub(super) fn grow(&self, z: f64, tau: f64) -> f64 {
        let u = z / self.scale;
        if let Some(end) = self.moved(u, self.rate * tau) {
            return self.scale * end;
        }
        let elapsed = self.elapsed(u);
        if elapsed == f64::INFINITY {
            return z;
        }
        self.scale * self.reached(elapsed + self.rate * tau, u, self.rate * tau)
    }

    /// z after the path `tau` of decay from `z` > 0, and the remaining path when z vanishes before its end.
    #[inline]
    pub(super) fn shrink(&self, z: f64, tau: f64) -> (f64, f64) {
        let u = z / self.scale;
        if let Some(end) = self.moved(u, -self.rate * tau)
            && end > 0.0
        {
            return (self.scale * end, 0.0);
        }
        let elapsed = self.elapsed(u);
        let rest = tau - elapsed / self.rate;
        if rest >= 0.0 {
            return (0.0, rest);
        }
        let ago = self.rate * tau;
        (self.scale * self.reached(elapsed - ago, u, -ago), 0.0)
    }

    /// u when the clock has gone on by `by` (back where it is negative), without its reading: n = 1 is linear.
    #[inline]
    fn moved(&self, u: f64, by: f64) -> Option<f64> {
        match &self.clock {
            Clock::Saturating(Exponent::One) if u < 1.0 => Some(u - (1.0 - u) * libm::expm1(-by)),
            Clock::Steepening(Exponent::One) => Some(u + (1.0 + u) * libm::expm1(by)),
            _ => None,
        }
    }

    #[inline]
    fn elapsed(&self, u: f64) -> f64 {
        match &self.clock {
            Clock::Even => u,
            Clock::Saturating(_) if u >= 1.0 => f64::INFINITY,
            Clock::Saturating(Exponent::One) => -libm::log1p(-u),
            Clock::Saturating(Exponent::Two) => libm::atanh(u),
            Clock::Saturating(Exponent::Other(series)) => series.elapsed(u),
            Clock::Steepening(Exponent::One) => libm::log1p(u),
            Clock::Steepening(Exponent::Two) => libm::atan(u),
            Clock::Steepening(Exponent::Other(series)) => series.elapsed(u),
        }
    }

    /// u at σ ≥ 0, where `from` is known to belong to σ − `by`.
    #[inline]
    fn reached(&self, sigma: f64, from: f64, by: f64) -> f64 {
        match &self.clock {
            Clock::Even => sigma,
            Clock::Saturating(Exponent::One) => -libm::expm1(-sigma),
            Clock::Saturating(Exponent::Two) => libm::tanh(sigma),
            Clock::Saturating(Exponent::Other(series)) => series.reached(sigma, from, by),
            Clock::Steepening(Exponent::One) => libm::expm1(sigma),
            Clock::Steepening(Exponent::Two) => libm::tan(sigma),
            Clock::Steepening(Exponent::Other(series)) => series.reached(sigma, from, by),
        }
    }
}

/// The clock of u' = 1 − uⁿ. Up to q = uⁿ = 1/2: u Σ qᵏ/(n k + 1). Beyond, with m = 1 − q and a = 1 − 1/n, by
/// dσ = −(1 − m)⁻ᵃ dm/(n m): (T(m) − T(1/2))/n more, T(m) = −ln m − Σ bₖ mᵏ/k, bₖ the binomial series of (1 − m)⁻ᵃ.
#[derive(Debug, PartialEq)]
struct Saturation {
    exponent: f64,
    near: [f64; TERMS],
    far: [f64; TERMS],
    /// u, σ and T where the two series meet.
    edge: f64,
    edge_sigma: f64,
    edge_far: f64,
}

impl Saturation {
    fn new(exponent: f64) -> Self {
        let mut near = [0.0; TERMS];
        for (k, term) in near.iter_mut().enumerate() {
            *term = 1.0 / (exponent * k as f64 + 1.0);
        }
        let mut far = binomial(1.0 - 1.0 / exponent);
        far[0] = 0.0;
        for (k, term) in far.iter_mut().enumerate().skip(1) {
            *term /= k as f64;
        }
        let edge = libm::pow(0.5, 1.0 / exponent);
        Self {
            exponent,
            edge,
            edge_sigma: edge * series(&near, 0.5),
            edge_far: std::f64::consts::LN_2 - series(&far, 0.5),
            near,
            far,
        }
    }

    #[inline]
    fn elapsed(&self, u: f64) -> f64 {
        if u <= self.edge {
            return u * series(&self.near, libm::pow(u, self.exponent));
        }
        let m = -libm::expm1(self.exponent * libm::log(u));
        let far = -libm::log(m) - series(&self.far, m);
        self.edge_sigma + (far - self.edge_far) / self.exponent
    }

    #[inline]
    fn reached(&self, sigma: f64, from: f64, by: f64) -> f64 {
        if sigma <= self.edge_sigma {
            // Convex clock: the tangent from a known point, u = σ and the edge all lie at or beyond the root.
            let tangent = from + by * (1.0 - libm::pow(from, self.exponent));
            let mut u = tangent.min(sigma).min(self.edge);
            for _ in 0..ROUNDS {
                let q = libm::pow(u, self.exponent);
                let step = (u * series(&self.near, q) - sigma) * (1.0 - q);
                u -= step;
                let moving = step > f64::EPSILON * u;
                if !moving {
                    break;
                }
            }
            return if u < 0.0 { 0.0 } else { u };
        }
        // In l = −ln m the clock T is concave with a slope between 1 and 2; l = T lies before the root.
        let target = self.edge_far + self.exponent * (sigma - self.edge_sigma);
        let slope = 1.0 - 1.0 / self.exponent;
        let mut l = target.max(std::f64::consts::LN_2);
        for _ in 0..ROUNDS {
            let m = libm::exp(-l);
            let step = (target - l + series(&self.far, m)) * libm::exp(slope * libm::log1p(-m));
            l += step;
            let moving = step > f64::EPSILON * l;
            if !moving {
                break;
            }
        }
        libm::exp(libm::log1p(-libm::exp(-l)) / self.exponent)
    }
}

/// The clock of u' = 1 + uⁿ. Up to q = uⁿ = 1, with x = q/(1 + q) and Pfaff's transformation of the hypergeometric
/// series: u/(1 + q) Σ cₖ xᵏ, cₖ = k!/((1 + 1/n)…(k + 1/n)). Beyond, with m = 1/(1 + q) and a = 1 − 1/n, by
/// dσ = −(1 − m)⁻ᵃ mᵃ⁻¹ dm/n: (R(1/2) − R(m))/n more, R(m) = (mᵃ − 1)/a + Σ bₖ mᵏ⁺ᵃ/(k + a).
#[derive(Debug, PartialEq)]
struct Steepening {
    exponent: f64,
    near: [f64; TERMS],
    far: [f64; TERMS],
    edge_sigma: f64,
    edge_far: f64,
}

impl Steepening {
    fn new(exponent: f64) -> Self {
        let mut near = [1.0; TERMS];
        for k in 1..TERMS {
            near[k] = near[k - 1] * k as f64 / (k as f64 + 1.0 / exponent);
        }
        let slope = 1.0 - 1.0 / exponent;
        let mut far = binomial(slope);
        far[0] = 0.0;
        for (k, term) in far.iter_mut().enumerate().skip(1) {
            *term /= k as f64 + slope;
        }
        let mut made = Self {
            exponent,
            edge_sigma: 0.5 * series(&near, 0.5),
            edge_far: 0.0,
            near,
            far,
        };
        made.edge_far = made.beyond(0.5);
        made
    }

    /// R(m).
    fn beyond(&self, m: f64) -> f64 {
        let slope = 1.0 - 1.0 / self.exponent;
        let log = slope * libm::log(m);
        libm::expm1(log) / slope + libm::exp(log) * series(&self.far, m)
    }

    #[inline]
    fn elapsed(&self, u: f64) -> f64 {
        let q = libm::pow(u, self.exponent);
        if q <= 1.0 {
            u / (1.0 + q) * series(&self.near, q / (1.0 + q))
        } else {
            self.edge_sigma + (self.edge_far - self.beyond(1.0 / (1.0 + q))) / self.exponent
        }
    }

    #[inline]
    fn reached(&self, sigma: f64, from: f64, by: f64) -> f64 {
        // Concave clock: the tangent from a known point and u = σ lie before the root, and Newton stays there.
        let tangent = from + by * (1.0 + libm::pow(from, self.exponent));
        let mut u = tangent.max(sigma);
        for _ in 0..ROUNDS {
            let step = (sigma - self.elapsed(u)) * (1.0 + libm::pow(u, self.exponent));
            u += step;
            let moving = step > f64::EPSILON * u;
            if !moving {
                break;
            }
        }
        // Not max, which would turn NaN into 0.
        if u < 0.0 { 0.0 } else { u }
    }
}

/// Coefficients of (1 − m)⁻ᵃ.
fn binomial(a: f64) -> [f64; TERMS] {
    let mut out = [1.0; TERMS];
    for k in 1..TERMS {
        out[k] = out[k - 1] * (k as f64 - 1.0 + a) / k as f64;
    }
    out
}

/// Σ cₖ xᵏ for 0 ≤ x ≤ 1/2 and 0 ≤ cₖ ≤ 1, as many terms as matter.
fn series(coefficients: &[f64; TERMS], x: f64) -> f64 {
    let mut sum = 0.0;
    let mut power = 1.0;
    for coefficient in coefficients {
        sum += coefficient * power;
        power *= x;
        if power < 1e-19 {
            break;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The general series, also for exponents that have a closed form.
    fn forced(c: f64, exponent: f64) -> Branch {
        let mut branch = Branch::new(1.0, c, exponent);
        branch.clock = if c > 0.0 {
            Clock::Saturating(Exponent::Other(Box::new(Saturation::new(exponent))))
        } else {
            Clock::Steepening(Exponent::Other(Box::new(Steepening::new(exponent))))
        };
        branch
    }

    #[test]
    fn series_match_artanh_and_arctan() {
        // Roundoff: some tens of rounded terms, all positive, hence some 1e-15 relative.
        for i in 1..200 {
            let u = f64::from(i) / 200.0;
            let (got, want) = (forced(1.0, 2.0).elapsed(u), libm::atanh(u));
            assert!((got - want).abs() < 4e-15 * want, "{u}: {got} {want}");
            let u = f64::from(i) / 20.0;
            let (got, want) = (forced(-1.0, 2.0).elapsed(u), libm::atan(u));
            assert!((got - want).abs() < 4e-15 * want, "{u}: {got} {want}");
        }
    }

    #[test]
    fn inverse_of_the_clock_is_its_inverse() {
        for exponent in [1.0, 1.01, 1.5, 2.0, 2.5, 3.0, 7.3, 20.0, 100.0] {
            for i in 0..=60 {
                // Saturating: u from 0 to 1 − 1e-3; an error of σ of 1e-15 is one of u of 1e-15 (1 − uⁿ).
                let u = 0.999 * f64::from(i) / 60.0;
                let branch = Branch::new(1.0, 1.0, exponent);
                let sigma = branch.elapsed(u);
                for from in [0.0, 0.3, 0.9] {
                    let by = sigma - branch.elapsed(from);
                    let back = branch.reached(sigma, from, by);
                    assert!((back - u).abs() < 1e-14, "{exponent} {from}: {u} {back}");
                }
                // Steepening, backwards from u = q^(1/n), q = 1000: 1e-15 of σ is 1e-15 (1 + uⁿ) of u.
                let top = libm::pow(1000.0, 1.0 / exponent);
                let u = top * f64::from(i) / 60.0;
                let branch = Branch::new(1.0, -1.0, exponent);
                let sigma = branch.elapsed(u);
                let back = branch.reached(sigma, top, sigma - branch.elapsed(top));
                let tolerance = 2e-14 * (1.0 + libm::pow(u, exponent)) * (1.0 + sigma);
                assert!((back - u).abs() < tolerance, "{exponent}: {u} {back}");
            }
        }
    }

    #[test]
    fn nan_stays_nan_and_time_is_bounded() {
        for (c, exponent) in [(1.0, 2.5), (-0.3, 2.5), (0.0, 3.0), (1.0, 1.0), (-1.0, 2.0)] {
            let branch = Branch::new(1.0, c, exponent);
            assert!(branch.grow(f64::NAN, 0.1).is_nan());
            assert!(branch.grow(0.1, f64::NAN).is_nan());
            assert!(branch.shrink(0.1, f64::NAN).0.is_nan());
        }
        // However long the path, it ends at the limit (A/c)^(1/n).
        for exponent in [1.0, 1.5, 2.0, 2.5, 30.0] {
            let z = Branch::new(1.0, 1.0, exponent).grow(0.0, 1e9);
            assert!((z - 1.0).abs() < 1e-15, "{exponent} {z}");
        }
    }
}
