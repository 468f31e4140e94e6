//! The acceleration as an output: a = M⁻¹ r, missing (NaN) where there is no mass.
//!
//! The integrator does not need it; this is for rows and reports.

use crate::linalg::{NotPositiveDefinite, Spd, SymMatrix};

/// a = M⁻¹ r for the degrees of freedom that have mass.
#[derive(Debug)]
pub struct Acceleration {
    operator: Operator,
}

#[derive(Debug)]
enum Operator {
    /// 1/mᵢ, NaN where mᵢ = 0.
    Diagonal(Vec<f64>),
    Full {
        massive: Vec<usize>,
        factor: Box<Spd>,
        work: Vec<f64>,
    },
}

impl Acceleration {
    /// From the mass matrix; a zero row marks a massless degree of freedom.
    ///
    /// # Errors
    /// The block of the degrees of freedom with mass is not positive definite.
    pub fn new(mass: &SymMatrix) -> Result<Self, NotPositiveDefinite> {
        let n = mass.n();
        let massive: Vec<usize> = (0..n).filter(|&i| !mass.row_is_zero(i)).collect();
        let factor = Spd::factor(&mass.block(&massive)).map_err(|failure| NotPositiveDefinite {
            dof: massive.get(failure.dof).copied().unwrap_or(failure.dof),
            ..failure
        })?;
        let operator = if mass.is_diagonal() {
            let inverse = |i| {
                let m = mass.get(i, i);
                if m > 0.0 { 1.0 / m } else { f64::NAN }
            };
            Operator::Diagonal((0..n).map(inverse).collect())
        } else {
            Operator::Full {
                work: vec![0.0; massive.len()],
                massive,
                factor: Box::new(factor),
            }
        };
        Ok(Self { operator })
    }

    /// out ← M⁻¹ residual, NaN for massless degrees of freedom. Real-time: yes.
    #[inline]
    pub fn accel_into(&mut self, residual: &[f64], out: &mut [f64]) {
        match &mut self.operator {
            Operator::Diagonal(inverse) => {
                for ((out, r), inverse) in out.iter_mut().zip(residual).zip(inverse) {
                    *out = *r * *inverse;
                }
            }
            Operator::Full {
                massive,
                factor,
                work,
            } => {
                for (w, &dof) in work.iter_mut().zip(massive.iter()) {
                    *w = residual.get(dof).copied().unwrap_or(f64::NAN);
                }
                factor.solve_in_place(work);
                out.fill(f64::NAN);
                for (w, &dof) in work.iter().zip(massive.iter()) {
                    if let Some(out) = out.get_mut(dof) {
                        *out = *w;
                    }
                }
            }
        }
    }
}
