//! [`Structure`]: the matrices, the elements, and the internal force of one instant.

use super::element::{Connection, Facts, at, bound, row, split, stamp};
use super::{Acceleration, Base, Element, ModelError, Part};
use crate::law::{Law, Tangent};
use crate::linalg::{MatrixError, SymMatrix};

/// The numerical substructure.
#[derive(Debug)]
pub struct Structure {
    mass: SymMatrix,
    damping: SymMatrix,
    stiffness: SymMatrix,
    influence: Vec<f64>,
    /// Rows of K ι and C ι that are not zero: (degree of freedom, N/m, N s/m).
    tied_to_base: Vec<(usize, f64, f64)>,
    /// What the loop walks over, in the order of `facts`.
    connections: Vec<Connection>,
    facts: Vec<Facts>,
    linear_parts: Vec<Part>,
}

impl Structure {
    /// Joins matrices (n × n, SI units), influence vector ι (n) and elements.
    ///
    /// # Errors
    /// See [`ModelError`].
    pub fn new(
        mass: SymMatrix,
        damping: SymMatrix,
        stiffness: SymMatrix,
        influence: Vec<f64>,
        elements: Vec<Element>,
    ) -> Result<Self, ModelError> {
        let n = mass.n();
        if n == 0 {
            return Err(ModelError::Empty);
        }
        for (what, matrix) in [
            ("mass", &mass),
            ("damping", &damping),
            ("stiffness", &stiffness),
        ] {
            check_matrix(what, matrix, n)?;
        }
        if influence.len() != n {
            return Err(ModelError::Size {
                what: "influence",
                expected: n,
                found: influence.len(),
            });
        }
        for (dof, &found) in influence.iter().enumerate() {
            if !found.is_finite() {
                return Err(ModelError::Influence { dof, found });
            }
        }
        for dof in 0..n {
            let found = mass.get(dof, dof);
            // Entries are finite here.
            if found < 0.0 {
                return Err(ModelError::NegativeMass { dof, found });
            }
        }
        Acceleration::new(&mass).map_err(ModelError::Mass)?;
        let tied_to_base = tied_to_base(&stiffness, &damping, &influence);
        let (mut connections, mut facts) = (Vec::new(), Vec::new());
        for element in elements {
            let (hot, cold) = split(element, n)?;
            connections.push(hot);
            facts.push(cold);
        }
        Ok(Self {
            mass,
            damping,
            stiffness,
            influence,
            tied_to_base,
            connections,
            facts,
            linear_parts: Vec::new(),
        })
    }

    /// Names the parts that make up the linear K and C (storeys, springs of a chain), for reports on stability.
    #[must_use]
    pub fn with_linear_parts(mut self, parts: Vec<Part>) -> Self {
        self.linear_parts = parts;
        self
    }

    /// Number of degrees of freedom n.
    #[must_use]
    pub fn dofs(&self) -> usize {
        self.mass.n()
    }

    /// M; a zero row is a massless degree of freedom.
    #[must_use]
    pub fn mass(&self) -> &SymMatrix {
        &self.mass
    }

    /// The linear C, without elements.
    #[must_use]
    pub fn damping(&self) -> &SymMatrix {
        &self.damping
    }

    /// The linear K, without elements.
    #[must_use]
    pub fn stiffness(&self) -> &SymMatrix {
        &self.stiffness
    }

    /// ι: displacement of each degree of freedom per unit displacement of a rigid base.
    #[must_use]
    pub fn influence(&self) -> &[f64] {
        &self.influence
    }

    /// Names of the elements.
    pub fn element_names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.facts.iter().map(|facts| facts.name.as_str())
    }

    /// −M ι: the load per unit ground acceleration in relative coordinates, in kg.
    #[must_use]
    pub fn ground_load(&self) -> Vec<f64> {
        let mut load = vec![0.0; self.dofs()];
        self.mass.subtract_product(&self.influence, &mut load);
        load
    }

    /// K0 of the numerical side: K and the reference stiffness of the elements.
    #[must_use]
    pub fn reference_stiffness(&self) -> SymMatrix {
        self.assemble(&self.stiffness, |law| law.reference().stiffness)
    }

    /// C0 of the numerical side: C and the reference damping of the elements.
    #[must_use]
    pub fn reference_damping(&self) -> SymMatrix {
        self.assemble(&self.damping, |law| law.reference().damping)
    }

    /// Names of everything that has a share of K0 of its own: storeys or springs, then elements.
    pub fn part_names(&self) -> impl Iterator<Item = &str> {
        let linear = self.linear_parts.iter().map(|part| part.name.as_str());
        linear.chain(self.element_names())
    }

    /// The share of K0 of everything that is called `name`, n × n in N/m; none if nothing is.
    #[must_use]
    pub fn stiffness_of(&self, name: &str) -> Option<SymMatrix> {
        let linear = self.linear_parts.iter().filter(|part| part.name == name);
        let linear = linear.map(|part| stamp(&part.row, part.stiffness_bound));
        let elements = self.facts.iter().zip(&self.connections);
        let elements = elements.filter(|(facts, _)| facts.name == name);
        let elements = elements.map(|(facts, connection)| {
            let stiffness = connection.law.reference().stiffness;
            stamp(&row(facts.from, facts.to), stiffness)
        });
        let stamps: Vec<_> = linear.chain(elements).collect();
        let entries = stamps.iter().flatten().copied();
        (!stamps.is_empty()).then(|| SymMatrix::from_triplets(self.dofs(), entries))
    }

    /// Tangent stiffness at the last internal force.
    #[must_use]
    pub fn tangent_stiffness(&self) -> SymMatrix {
        self.assemble(&self.stiffness, |law| law.tangent().stiffness)
    }

    /// Tangent damping at the last internal force.
    #[must_use]
    pub fn tangent_damping(&self) -> SymMatrix {
        self.assemble(&self.damping, |law| law.tangent().damping)
    }

    /// Tangent stiffness of the undeformed structure: what damping by ratios refers to. Takes a trial of every law
    /// at zero and forgets it.
    #[must_use]
    pub fn stiffness_at_rest(&mut self) -> SymMatrix {
        let at_rest: Vec<Tangent> = self
            .connections
            .iter_mut()
            .map(|connection| {
                connection.law.trial(0.0, 0.0, 0.0);
                let tangent = connection.law.tangent();
                connection.law.revert();
                tangent
            })
            .collect();
        let ends = self.facts.iter().zip(&at_rest);
        let entries =
            ends.flat_map(|(facts, tangent)| stamp(&row(facts.from, facts.to), tangent.stiffness));
        self.stiffness
            .plus(1.0, &SymMatrix::from_triplets(self.dofs(), entries))
    }

    /// Replaces the linear C, such as by Rayleigh or modal damping.
    ///
    /// # Errors
    /// Another size, or an entry that is not finite.
    pub fn set_damping(&mut self, damping: SymMatrix) -> Result<(), ModelError> {
        check_matrix("damping", &damping, self.dofs())?;
        self.tied_to_base = tied_to_base(&self.stiffness, &damping, &self.influence);
        self.damping = damping;
        Ok(())
    }

    /// K_max: upper bound of the tangent stiffness.
    ///
    /// # Errors
    /// [`ModelError::NoBound`] for an element whose bound needs a declared reach that is missing.
    pub fn bound_stiffness(&self) -> Result<SymMatrix, ModelError> {
        let bounds = self.bounds()?;
        Ok(self.stamped(&self.stiffness, bounds.iter().map(|bound| bound.stiffness)))
    }

    /// C_max: upper bound of the tangent damping.
    ///
    /// # Errors
    /// [`ModelError::NoBound`] for an element whose bound needs a declared reach that is missing.
    pub fn bound_damping(&self) -> Result<SymMatrix, ModelError> {
        let bounds = self.bounds()?;
        Ok(self.stamped(&self.damping, bounds.iter().map(|bound| bound.damping)))
    }

    /// The named parts of K_max and C_max: storeys or springs, then elements.
    ///
    /// # Errors
    /// As [`Structure::bound_stiffness`].
    pub fn parts(&self) -> Result<Vec<Part>, ModelError> {
        let mut parts = self.linear_parts.clone();
        let elements = self.facts.iter().zip(&self.connections);
        for ((facts, connection), bound) in elements.zip(self.bounds()?) {
            parts.push(Part {
                name: facts.name.clone(),
                row: row(facts.from, facts.to),
                stiffness_bound: bound.stiffness,
                damping: connection.law.reference().damping,
                damping_bound: bound.damping,
            });
        }
        Ok(parts)
    }

    /// residual ← residual − R_d(v) − R_s(x) in N, everything counted from the base: one trial and one commit of every
    /// element, so call it once per accepted tick. `dt` is the time in s since the last call, 0 for the first or a
    /// hold. Slices have n entries. Under ground acceleration (relative coordinates) `base` is zero.
    /// Real-time: yes.
    pub fn subtract_internal(
        &mut self,
        disp: &[f64],
        vel: &[f64],
        base: Base,
        dt: f64,
        residual: &mut [f64],
    ) {
        self.walk::<true>(disp, vel, base, dt, residual);
    }

    /// As [`Structure::subtract_internal`], without the commit: a trial from the committed state, however often it is
    /// asked for. [`Structure::commit`] keeps the last one.
    pub fn subtract_trial(
        &mut self,
        disp: &[f64],
        vel: &[f64],
        base: Base,
        dt: f64,
        residual: &mut [f64],
    ) {
        self.walk::<false>(disp, vel, base, dt, residual);
    }

    /// The last trial of every element becomes its committed state.
    pub fn commit(&mut self) {
        for connection in &mut self.connections {
            connection.law.commit();
        }
    }

    /// Forgets the last trial of every element.
    pub fn revert(&mut self) {
        for connection in &mut self.connections {
            connection.law.revert();
        }
    }

    /// Real-time: yes.
    fn walk<const COMMIT: bool>(
        &mut self,
        disp: &[f64],
        vel: &[f64],
        base: Base,
        dt: f64,
        residual: &mut [f64],
    ) {
        self.stiffness.subtract_product(disp, residual);
        self.damping.subtract_product(vel, residual);
        if base != Base::default() {
            for &(dof, stiffness, damping) in &self.tied_to_base {
                if let Some(r) = residual.get_mut(dof) {
                    *r += stiffness * base.disp + damping * base.vel;
                }
            }
        }
        for Connection { law, from, to } in &mut self.connections {
            let deformation = at(*to, disp, base.disp) - at(*from, disp, base.disp);
            let rate = at(*to, vel, base.vel) - at(*from, vel, base.vel);
            let force = law.trial(deformation, rate, dt);
            if COMMIT {
                law.commit();
            }
            if let Some(r) = residual.get_mut(*to as usize) {
                *r -= force;
            }
            if let Some(r) = residual.get_mut(*from as usize) {
                *r += force;
            }
        }
    }

    /// Appends the committed state of every element to `out`.
    pub fn freeze(&self, out: &mut Vec<f64>) {
        for connection in &self.connections {
            connection.law.freeze(out);
        }
    }

    /// Takes the committed states from the front of `from` and returns the rest.
    pub fn thaw<'a>(&mut self, mut from: &'a [f64]) -> &'a [f64] {
        for connection in &mut self.connections {
            from = connection.law.thaw(from);
        }
        from
    }

    fn bounds(&self) -> Result<Vec<Tangent>, ModelError> {
        let elements = self.facts.iter().zip(&self.connections);
        elements
            .map(|(facts, connection)| bound(facts, connection.law.as_ref()))
            .collect()
    }

    fn assemble(&self, linear: &SymMatrix, value: impl Fn(&dyn Law) -> f64) -> SymMatrix {
        let values = self.connections.iter().map(|c| value(c.law.as_ref()));
        self.stamped(linear, values)
    }

    /// `linear` plus one value per element.
    fn stamped(&self, linear: &SymMatrix, values: impl Iterator<Item = f64>) -> SymMatrix {
        if self.facts.is_empty() {
            return linear.clone();
        }
        let ends = self.facts.iter().zip(values);
        let entries = ends.flat_map(|(facts, value)| stamp(&row(facts.from, facts.to), value));
        linear.plus(1.0, &SymMatrix::from_triplets(self.dofs(), entries))
    }
}

fn check_matrix(what: &'static str, matrix: &SymMatrix, n: usize) -> Result<(), ModelError> {
    if matrix.n() != n {
        return Err(ModelError::Size {
            what,
            expected: n,
            found: matrix.n(),
        });
    }
    match matrix.entries().find(|(_, _, value)| !value.is_finite()) {
        None => Ok(()),
        Some((row, column, found)) => Err(ModelError::Entry {
            what,
            source: MatrixError::NotFinite { row, column, found },
        }),
    }
}

/// Rows of K ι and C ι above the roundoff of their own sums.
fn tied_to_base(
    stiffness: &SymMatrix,
    damping: &SymMatrix,
    influence: &[f64],
) -> Vec<(usize, f64, f64)> {
    let product = |matrix: &SymMatrix, dof: usize| {
        let (mut sum, mut size) = (0.0, 0.0);
        for (column, value) in matrix.row(dof) {
            let term = value * influence[column];
            sum += term;
            size += f64::abs(term);
        }
        if f64::abs(sum) > 1e-13 * size {
            sum
        } else {
            0.0
        }
    };
    (0..stiffness.n())
        .map(|dof| (dof, product(stiffness, dof), product(damping, dof)))
        .filter(|&(_, k, c)| k != 0.0 || c != 0.0)
        .collect()
}
