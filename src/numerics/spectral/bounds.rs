//! Bounds of stability of one mode: (33) for a linear one, (40) and (41) for changed tangents.

/// Largest stable Ω of λ, equation (33); infinite for λ ≤ 4. Damping plays no part.
#[must_use]
pub fn omega_limit(lambda: f64) -> f64 {
    if lambda <= 4.0 {
        f64::INFINITY
    } else {
        // 4λ/(λ − 4), written so that λ = ∞ gives 2.
        (4.0 / (1.0 - 4.0 / lambda)).sqrt()
    }
}

/// Largest stable λ at Ω, equation (33); infinite for Ω ≤ 2.
#[must_use]
pub fn lambda_limit(omega: f64) -> f64 {
    lambda_limit_changed(omega, omega, 0.0)
}

/// Largest stable λ of a mode whose frequency changed from Ω0 to Ωt, equation (41), and whose damping changed by
/// `damping` = 2 Δt (c_t − c_0)/m: λ (Ωt² − 4 + damping) ≤ 4 Ω0². Infinite if every λ is stable.
#[must_use]
pub fn lambda_limit_changed(omega_0: f64, omega_t: f64, damping: f64) -> f64 {
    let excess = omega_t * omega_t - 4.0 + damping;
    if excess > 0.0 {
        4.0 * omega_0 * omega_0 / excess
    } else {
        f64::INFINITY
    }
}

/// Largest λ that is stable for every Δt when the frequency changes by the factor `ratio` = ω_t/ω_0: 4/ratio². The
/// paper recommends it for hardening, and 4 for linear and softening systems (section 3.3).
#[must_use]
pub fn unconditional_lambda(ratio: f64) -> f64 {
    4.0 / (ratio.max(1.0) * ratio.max(1.0))
}

/// k_t/k_0 at which a root of (39) leaves the unit circle through z = −1, equation (40), whatever the unchanged
/// damping: 4/λ + 4/Ω0².
#[must_use]
pub fn crossing_stiffness(omega_0: f64, lambda: f64) -> f64 {
    4.0 / lambda + 4.0 / (omega_0 * omega_0)
}
