//! Specimens in process: deformations in, resisting forces out, with commit and revert.
//!
//! A [`Specimen`] is pure mathematics, so the same object serves in the loop, behind a server and in a
//! simulated link. `InProcess` makes a [`Substructure`](crate::substructure::Substructure) of it.

/// What can stand behind a command: one or more axes with memory. Matrices are n × n, stored by columns.
///
/// All methods but `freeze` are on the real-time path.
pub trait Specimen: Send + std::fmt::Debug {
    /// Number of axes n.
    fn axes(&self) -> usize;

    /// Resisting force in N at `disp` (m), `vel` (m/s), reached from the committed state in `dt` seconds. Always
    /// starts from the committed state; slices have n entries.
    fn trial(&mut self, disp: &[f64], vel: &[f64], dt: f64, force: &mut [f64]);

    /// The last trial becomes the committed state.
    fn commit(&mut self);

    /// Forgets the last trial.
    fn revert(&mut self);

    /// Stiffness, damping and mass that enter K0, C0 and M_eff (OpenFresco 12, 14, 15), n × n each.
    fn reference(&self, stiffness: &mut [f64], damping: &mut [f64], mass: &mut [f64]);

    /// Tangent stiffness at the last trial, n × n (OpenFresco 13).
    fn tangent(&self, stiffness: &mut [f64]);

    /// Appends the committed state to `out`.
    fn freeze(&self, out: &mut Vec<f64>);

    /// Takes the committed state from the front of `from` and returns the rest.
    fn thaw<'a>(&mut self, from: &'a [f64]) -> &'a [f64];
}
