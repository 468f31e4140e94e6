//! One degree of freedom, in closed form.

use std::f64::consts::TAU;

/// Critical delay in s of one degree of freedom with natural frequency `omega` (rad/s, of the total stiffness),
/// damping ratio `ratio` and the share `share` of its stiffness in the specimen. None if every delay is stable.
pub(crate) fn sdof(ratio: f64, share: f64, omega: f64) -> Option<f64> {
    let half = 1.0 - share - 2.0 * ratio * ratio;
    let radicand = half * half - (1.0 - 2.0 * share);
    if !(radicand >= 0.0 && share > 0.0 && omega > 0.0) {
        return None;
    }
    let roots = [half + radicand.sqrt(), half - radicand.sqrt()];
    let delays = roots
        .into_iter()
        .filter(|square| *square > 0.0)
        .map(|square| {
            let r = square.sqrt();
            let angle = libm::atan2(2.0 * ratio * r / share, (square - 1.0 + share) / share);
            let angle = if angle < 0.0 { angle + TAU } else { angle };
            angle / (r * omega)
        });
    delays.reduce(f64::min)
}

/// τ_cr ≈ 2 ξ/(p ω): what a small delay's negative damping takes.
pub(crate) fn sdof_estimate(ratio: f64, share: f64, omega: f64) -> f64 {
    2.0 * ratio / (share * omega)
}

/// Critical time constant T in s of a first-order lag: the smaller positive root of
/// c k_n T² + (c² − m k_e) T + m c = 0, with mass m, damping c, numerical stiffness k_n and specimen stiffness k_e.
/// None if every T is stable.
pub(crate) fn critical_lag(mass: f64, damping: f64, numerical: f64, specimen: f64) -> Option<f64> {
    let (a, b, c) = (
        damping * numerical,
        damping * damping - mass * specimen,
        mass * damping,
    );
    if b >= 0.0 {
        return None;
    }
    let radicand = b * b - 4.0 * a * c;
    // The smaller root, written without cancellation and valid for a = 0.
    (radicand >= 0.0).then(|| 2.0 * c / (-b + radicand.sqrt()))
}
