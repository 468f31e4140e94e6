//! The energy balance of a structure and its specimens, step by step, from recorded displacements and forces.
//!
//! With x of three steps, the work of a force r in the middle one is `½ (x[i+1] − x[i−1])ᵀ r[i]`: the sum in which the
//! equation of motion of the integrator closes. Kinetic energy uses the velocity (x[i+1] − x[i−1])/(2Δt) and M alone, so
//! the remainder is of order Δt²: an approximation for plots. The exact audit is the column `step_audit`.

use super::falsified::Scale;

/// The equation of motion: what is needed of a structure.
pub trait Model {
    /// Number of degrees of freedom.
    fn dofs(&self) -> usize;
    /// Load at a step, N per degree of freedom; of the ground in relative coordinates too.
    fn load(&self, step: u64, out: &mut [f64]);
    /// C·v of the linear damping, N.
    fn damping(&self, vel: &[f64], out: &mut [f64]);
    /// All restoring forces of the numerical side, damping among them, N; called once per step, in order, `dt` s apart.
    fn restoring(&mut self, disp: &[f64], vel: &[f64], dt: f64, out: &mut [f64]);
    /// ½ vᵀ M v in J.
    fn kinetic(&self, vel: &[f64]) -> f64;
    /// ½ xᵀ K x in J, K the tangent stiffness of the structure and its specimens at rest.
    fn strain(&self, disp: &[f64]) -> f64;
}

/// Energies at one step in J, counted from the beginning of the record; work done on each part is positive.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Energies {
    /// Work of the loads, and the kinetic energy at the beginning.
    pub input: f64,
    /// Kinetic energy.
    pub kinetic: f64,
    /// Work into the linear damping.
    pub damping: f64,
    /// Work into springs and nonlinear elements of the numerical side, stored or dissipated.
    pub springs: f64,
    /// Work into the specimens, stored or dissipated.
    pub specimens: f64,
}

impl Energies {
    /// Energy that the sum leaves unexplained.
    #[must_use]
    pub fn remainder(&self) -> f64 {
        self.input - self.kinetic - self.damping - self.springs - self.specimens
    }

    fn plus(&self, more: &Self) -> Self {
        Self {
            input: self.input + more.input,
            kinetic: self.kinetic + more.kinetic,
            damping: self.damping + more.damping,
            springs: self.springs + more.springs,
            specimens: self.specimens + more.specimens,
        }
    }
}

#[derive(Debug, Clone, Default)]
struct Row {
    step: u64,
    disp: Vec<f64>,
    /// Deformation and force of every axis.
    axes: Vec<(f64, f64)>,
}

/// A balance that is fed with one row a step.
pub struct Balance<'a> {
    model: &'a mut dyn Model,
    dt: f64,
    rows: [Row; 3],
    known: usize,
    so_far: Energies,
    /// What energy errors are measured by, of the steps so far.
    pub scale: Scale,
    pending: Energies,
    begun: bool,
    vel: Vec<f64>,
    half: Vec<f64>,
    force: Vec<f64>,
    damping: Vec<f64>,
}

impl std::fmt::Debug for Balance<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Balance")
            .field("so_far", &self.so_far)
            .finish_non_exhaustive()
    }
}

impl<'a> Balance<'a> {
    /// The balance of `model`, with steps of `dt` s and `axes` axes of specimens.
    #[must_use]
    pub fn new(model: &'a mut dyn Model, dt: f64, axes: usize) -> Self {
        let n = model.dofs();
        let row = Row {
            step: 0,
            disp: vec![0.0; n],
            axes: vec![(0.0, 0.0); axes],
        };
        Self {
            model,
            dt,
            rows: [row.clone(), row.clone(), row],
            known: 0,
            so_far: Energies::default(),
            scale: Scale::default(),
            pending: Energies::default(),
            begun: false,
            vel: vec![0.0; n],
            half: vec![0.0; n],
            force: vec![0.0; n],
            damping: vec![0.0; n],
        }
    }

    /// One more step: displacements of all DOFs, deformation (m) and force (N) of every axis. Gives the energies of the step
    /// before it, once three are known; steps that are missing are left out of every sum.
    pub fn take(
        &mut self,
        step: u64,
        disp: impl Iterator<Item = f64>,
        axes: impl Iterator<Item = (f64, f64)>,
    ) -> Option<Energies> {
        let follows = self.known > 0 && step == self.rows[2].step + 1;
        if self.known > 0 && step == self.rows[2].step {
            return None;
        }
        self.known = if follows { (self.known + 1).min(3) } else { 1 };
        self.rows.rotate_left(1);
        let newest = &mut self.rows[2];
        newest.step = step;
        newest
            .disp
            .iter_mut()
            .zip(disp)
            .for_each(|(to, from)| *to = from);
        newest
            .axes
            .iter_mut()
            .zip(axes)
            .for_each(|(to, from)| *to = from);
        // A missing sample is passed over.
        let strain = self.model.strain(&newest.disp);
        self.scale.strain_energy_j = self.scale.strain_energy_j.max(strain);
        if self.known < 3 {
            return None;
        }
        let now = self.close();
        self.scale.input_energy_j = self.scale.input_energy_j.max(now.input);
        Some(now)
    }

    fn close(&mut self) -> Energies {
        let [older, middle, newer] = &self.rows;
        for ((half, vel), (new, old)) in self
            .half
            .iter_mut()
            .zip(&mut self.vel)
            .zip(newer.disp.iter().zip(&older.disp))
        {
            *half = 0.5 * (new - old);
            *vel = *half / self.dt;
        }
        let work = |force: &[f64], half: &[f64]| -> f64 {
            force.iter().zip(half).map(|(f, d)| f * d).sum()
        };
        self.model.load(middle.step, &mut self.force);
        let input = work(&self.force, &self.half);
        self.model.damping(&self.vel, &mut self.damping);
        let damping = work(&self.damping, &self.half);
        self.model
            .restoring(&middle.disp, &self.vel, self.dt, &mut self.force);
        let restoring = work(&self.force, &self.half);
        let axes = newer.axes.iter().zip(&older.axes).zip(&middle.axes);
        let specimens: f64 = axes
            .map(|((new, old), now)| 0.5 * (new.0 - old.0) * now.1)
            .sum();
        let kinetic = self.model.kinetic(&self.vel);
        // The work of a step lies half before and half after its middle, where the kinetic energy is taken.
        // A missing sample leaves its work out.
        let half = |work: f64| if work.is_finite() { 0.5 * work } else { 0.0 };
        let now = Energies {
            input: half(input),
            kinetic: 0.0,
            damping: half(damping),
            springs: half(restoring - damping),
            specimens: half(specimens),
        };
        if self.begun {
            self.so_far = self.so_far.plus(&self.pending).plus(&now);
        } else {
            // The count begins at the first step received.
            self.begun = true;
            self.so_far.input = if kinetic.is_finite() { kinetic } else { 0.0 };
        }
        self.pending = now;
        self.so_far.kinetic = kinetic;
        self.so_far
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One mass on a spring and a dashpot, under a sine; its spring is the numerical side's, the specimen a second spring.
    struct Oscillator {
        mass: f64,
        damping: f64,
        stiffness: f64,
    }

    const DT: f64 = 1e-3;

    fn load(step: u64) -> f64 {
        300.0 * libm::sin(9.0 * step as f64 * DT)
    }

    impl Model for Oscillator {
        fn dofs(&self) -> usize {
            1
        }
        fn load(&self, step: u64, out: &mut [f64]) {
            out[0] = load(step);
        }
        fn damping(&self, vel: &[f64], out: &mut [f64]) {
            out[0] = self.damping * vel[0];
        }
        fn restoring(&mut self, disp: &[f64], vel: &[f64], _dt: f64, out: &mut [f64]) {
            out[0] = self.damping * vel[0] + self.stiffness * disp[0];
        }
        fn kinetic(&self, vel: &[f64]) -> f64 {
            0.5 * self.mass * vel[0] * vel[0]
        }
        fn strain(&self, disp: &[f64]) -> f64 {
            0.5 * (self.stiffness + 2e3) * disp[0] * disp[0]
        }
    }

    /// Central differences of the oscillator with a specimen of stiffness `k`: x and the specimen's force.
    fn history(model: &Oscillator, k: f64, steps: u64) -> Vec<(f64, f64)> {
        let (m, c, ks) = (model.mass, model.damping, model.stiffness);
        let mut out = vec![(0.01, k * 0.01)];
        let (mut before, mut now) = (0.01, 0.01);
        for step in 0..steps {
            let r = load(step) - (ks + k) * now
                + c * before / (2.0 * DT)
                + m * (2.0 * now - before) / (DT * DT);
            let next = r / (m / (DT * DT) + c / (2.0 * DT));
            (before, now) = (now, next);
            out.push((now, k * now));
        }
        out
    }

    #[test]
    fn input_energy_equals_the_parts() {
        let mut model = Oscillator {
            mass: 50.0,
            damping: 40.0,
            stiffness: 3e3,
        };
        let rows = history(&model, 2e3, 6000);
        let mut balance = Balance::new(&mut model, DT, 1);
        let mut last = Energies::default();
        let mut largest: f64 = 0.0;
        for (step, (x, f)) in rows.iter().enumerate() {
            if let Some(now) =
                balance.take(step as u64, std::iter::once(*x), std::iter::once((*x, *f)))
            {
                largest = largest.max(now.remainder().abs());
                last = now;
            }
        }
        // ½ v² of the mean of two half-step velocities misses the mean of their squares by (a dt)²/8: (ω dt)²/4 = 2.5e-5 of it.
        assert!(
            last.input > 5.0 && last.damping > 0.5 * last.input,
            "{last:?}"
        );
        assert!(largest < 2e-4 * last.input, "{largest} {last:?}");
        // A spring keeps ½ k x², counted from the beginning: of both in proportion.
        assert!((last.springs / last.specimens - 1.5).abs() < 1e-9);
        // The scale of errors: the most that went in, and ½ k x² of both springs where x is largest.
        let most = rows
            .iter()
            .fold(0.0, |most: f64, row| most.max(row.0.abs()));
        let scale = balance.scale;
        assert!((scale.strain_energy_j / (2.5e3 * most * most) - 1.0).abs() < 1e-12);
        // Input starts at zero here. It went into the damping and into the energy still stored or in motion.
        let input = last.damping + last.kinetic + last.springs + last.specimens;
        assert!(scale.input_energy_j >= last.input && last.input > 0.99 * input);
    }

    #[test]
    fn missing_force_opens_the_balance() {
        let mut model = Oscillator {
            mass: 50.0,
            damping: 40.0,
            stiffness: 3e3,
        };
        let rows = history(&model, 2e3, 6000);
        let mut balance = Balance::new(&mut model, DT, 1);
        let mut last = Energies::default();
        for (step, (x, f)) in rows.iter().enumerate() {
            let axis = std::iter::once((*x, 0.9 * f));
            last = balance
                .take(step as u64, std::iter::once(*x), axis)
                .unwrap_or(last);
        }
        assert!(last.specimens.abs() > 0.0 && last.remainder().abs() > 1e-3 * last.specimens.abs());
    }

    #[test]
    fn missing_and_repeated_steps_are_left_out() {
        let mut model = Oscillator {
            mass: 1.0,
            damping: 0.0,
            stiffness: 1.0,
        };
        let mut balance = Balance::new(&mut model, DT, 0);
        let mut take = |step| {
            balance
                .take(step, std::iter::once(1.0), std::iter::empty())
                .is_some()
        };
        assert_eq!(
            [0, 1, 1, 2, 5, 6, 7].map(&mut take),
            [false, false, false, true, false, false, true]
        );
    }
}
