//! Poles of the family, equations (13), (27), (28), and the rows of Table 1.

use super::Pole;

/// α of equation (13) for Ω, ξ and λ; λ = ∞ is 1/(1 + Ω ξ).
#[must_use]
pub fn alpha(omega: f64, ratio: f64, lambda: f64) -> f64 {
    1.0 / (1.0 + omega * ratio + omega * omega / lambda)
}

/// A1, A2, A3 of equation (27), divided by λ so that λ = ∞ is a value like any other.
#[must_use]
pub fn coefficients(omega: f64, ratio: f64, lambda: f64) -> [f64; 3] {
    let square = omega * omega;
    let added = square / lambda;
    [
        1.0 + omega * ratio + added,
        square - 2.0 * added - 2.0,
        1.0 - omega * ratio + added,
    ]
}

/// A2² − 4 A1 A3 over λ²: Ω² (Ω² − 4 Ω²/λ − 4 + 4 ξ²). Negative where the poles are complex.
#[must_use]
pub fn discriminant(omega: f64, ratio: f64, lambda: f64) -> f64 {
    let square = omega * omega;
    square * (square - 4.0 * square / lambda - 4.0 + 4.0 * ratio * ratio)
}

/// Both poles, equation (28). Complex: the one with positive imaginary part first. Real: the larger modulus first.
#[must_use]
pub fn poles(omega: f64, ratio: f64, lambda: f64) -> [Pole; 2] {
    let [a, b, c] = coefficients(omega, ratio, lambda);
    from_discriminant(a, b, c, discriminant(omega, ratio, lambda))
}

/// Roots of a z² + b z + c, in the order of [`poles`].
#[must_use]
pub fn quadratic(a: f64, b: f64, c: f64) -> [Pole; 2] {
    from_discriminant(a, b, c, b * b - 4.0 * a * c)
}

fn from_discriminant(a: f64, b: f64, c: f64, discriminant: f64) -> [Pole; 2] {
    if discriminant < 0.0 {
        let z = Pole::new(-b / (2.0 * a), (-discriminant).sqrt() / (2.0 * a));
        return if z.im > 0.0 {
            [z, z.conj()]
        } else {
            [z.conj(), z]
        };
    }
    // The root without cancellation first; the other from the product.
    let far = -(b + discriminant.sqrt().copysign(b)) / 2.0;
    let first = far / a;
    let second = if far == 0.0 { 0.0 } else { c / far };
    let (first, second) = if second.abs() > first.abs() {
        (second, first)
    } else {
        (first, second)
    };
    [Pole::new(first, 0.0), Pole::new(second, 0.0)]
}

/// A row of Table 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tabulated {
    /// γ = 1/2, β = 1/4.
    AverageAcceleration,
    /// γ = 1/2, β = 1/6.
    LinearAcceleration,
    /// γ = 1/2, β = 0.
    ExplicitNewmark,
}

impl Tabulated {
    /// All rows, in the order of the table.
    pub const ALL: [Self; 3] = [
        Self::AverageAcceleration,
        Self::LinearAcceleration,
        Self::ExplicitNewmark,
    ];

    /// λ = 1/β of the member of the family with the same poles.
    #[must_use]
    pub const fn lambda(self) -> f64 {
        match self {
            Self::AverageAcceleration => 4.0,
            Self::LinearAcceleration => 6.0,
            Self::ExplicitNewmark => f64::INFINITY,
        }
    }

    /// Name as in the table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::AverageAcceleration => "average acceleration",
            Self::LinearAcceleration => "linear acceleration",
            Self::ExplicitNewmark => "explicit Newmark",
        }
    }
}

/// The poles as Table 1 prints them, + before −; the square root of a negative number is imaginary.
#[must_use]
pub fn table_1(row: Tabulated, omega: f64, ratio: f64) -> [Pole; 2] {
    let square = omega * omega;
    let (centre, factor, radicand, below) = match row {
        Tabulated::AverageAcceleration => (
            4.0 - square,
            4.0 * omega,
            ratio * ratio - 1.0,
            4.0 + square + 4.0 * omega * ratio,
        ),
        Tabulated::LinearAcceleration => (
            6.0 - 2.0 * square,
            omega,
            3.0 * square + 36.0 * ratio * ratio - 36.0,
            6.0 + square + 6.0 * omega * ratio,
        ),
        Tabulated::ExplicitNewmark => (
            2.0 - square,
            omega,
            square + 4.0 * ratio * ratio - 4.0,
            2.0 + 2.0 * omega * ratio,
        ),
    };
    let root = match radicand.is_sign_negative() {
        true => Pole::new(0.0, (-radicand).sqrt()),
        false => Pole::new(radicand.sqrt(), 0.0),
    } * factor;
    [(root + centre) / below, (-root + centre) / below]
}
