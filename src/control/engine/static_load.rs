//! The static load of a test, as data.

use gusset_numerics::linalg::Spd;

/// How the static load is applied.
#[derive(Debug)]
pub struct StaticLoad {
    /// Factor of an upper bound of the total tangent stiffness at the start.
    pub stiffness: Spd,
    /// Static load in N, one entry per DOF; it acts from here to the end of the test.
    pub load: Vec<f64>,
    /// Number of equal parts.
    pub parts: u32,
    /// Unbalanced displacement, relative to the largest displacement, at which the load is in equilibrium. The last part
    /// continues beyond it while the balance gets better, down to roundoff.
    pub tolerance: f64,
    /// Corrections after which the load counts as impossible to carry.
    pub most_exchanges: u32,
}
