//! From a description to a [`Structure`]. Values are checked here, where their storey or file can be named.

use std::collections::BTreeMap;

use super::damping::damping_matrix;
use super::{
    BuildError, ChainSpec, DampingSpec, Element, ElementSpec, End, MatricesSpec, MatrixTable,
    ModelError, ShearBuildingSpec, StiffnessPart, Storey, Structure, StructureSpec,
};
use crate::frame::{FrameSpec, Members};
use crate::law::Reach;
use crate::linalg::{Condensation, SymMatrix};
use gusset_quantity::domain::{OutOfDomain, not_negative, positive};

/// Parsed matrix files by the name that the description uses.
pub type MatrixFiles = BTreeMap<String, MatrixTable>;

/// As for matrices from files: beyond it a typing error is more likely than a model.
const MOST_DOFS: usize = 1_000_000;

/// Contribution of a test's specimens to the numerical structure, besides their forces. All n × n.
#[derive(Debug, Clone, Copy)]
pub struct SpecimenShare<'a> {
    /// Σ Bᵀ k B at rest, in N/m.
    pub stiffness_at_rest: &'a SymMatrix,
    /// The part of it that a damping rule of a frame refers to: of specimens with `damped`.
    pub damped_stiffness: &'a SymMatrix,
    /// Σ Bᵀ m B of the masses that the structure carries for them, in kg: their inertia is not in the measured force.
    pub mass: &'a SymMatrix,
    /// Σ Bᵀ m B of the masses whose inertia is in the measured force, in kg: they move as well, and a damping rule refers to them.
    pub mass_in_force: &'a SymMatrix,
}

/// M, C, K with the names of their parts, before a damping rule and elements.
#[derive(Debug)]
pub struct Linear {
    /// M.
    pub mass: SymMatrix,
    /// C.
    pub damping: SymMatrix,
    /// K.
    pub stiffness: SymMatrix,
    /// ι.
    pub influence: Vec<f64>,
    /// Those of a frame that are not part of K.
    pub members: Members,
    storeys: (&'static str, Vec<Storey>),
    /// As [`crate::frame::FrameModel::damped`]; `None` where a damping rule refers to all stiffness at rest.
    pub damped: Option<[SymMatrix; 2]>,
    /// Key under which damping was given, if it was.
    damping_given: Option<&'static str>,
}

impl StructureSpec {
    /// Names of the matrix files that [`StructureSpec::build`] will look for.
    #[must_use]
    pub fn files(&self) -> Vec<&str> {
        match self {
            StructureSpec::Matrices(spec) => {
                let named = [&spec.mass_file, &spec.stiffness_file, &spec.damping_file];
                named.into_iter().filter_map(|f| f.as_deref()).collect()
            }
            StructureSpec::ShearBuilding(_) | StructureSpec::Chain(_) | StructureSpec::Frame(_) => {
                Vec::new()
            }
        }
    }

    /// Number of degrees of freedom.
    ///
    /// # Errors
    /// The mass matrix is missing or not valid, or the chain too long.
    pub fn dofs(&self, files: &MatrixFiles) -> Result<usize, BuildError> {
        match self {
            StructureSpec::ShearBuilding(spec) => Ok(spec.mass_kg.len()),
            StructureSpec::Chain(spec) => spec.count(),
            StructureSpec::Matrices(spec) => Ok(spec.mass(files)?.n()),
            StructureSpec::Frame(spec) => Ok(spec.model()?.dofs.len()),
        }
    }

    /// The row b of the drift of storey `storey`, counted from 1: +1 at its upper floor, −1 at its lower one. Entries
    /// are (degree of freedom from 0, coefficient). In a chain, spring `n` counts as storey `n`.
    ///
    /// # Errors
    /// The storey does not exist, the structure has no storeys, or it is given by matrices.
    pub fn storey_row(&self, storey: usize) -> Result<Vec<(usize, f64)>, BuildError> {
        let storeys = match self {
            StructureSpec::ShearBuilding(spec) => spec.mass_kg.len(),
            StructureSpec::Chain(spec) => spec.dofs,
            StructureSpec::Matrices(_) | StructureSpec::Frame(_) => {
                return Err(BuildError::NoStoreys);
            }
        };
        match storey {
            _ if storeys == 0 => Err(ModelError::Empty.into()),
            1 => Ok(vec![(0, 1.0)]),
            2.. if storey <= storeys => Ok(vec![(storey - 2, -1.0), (storey - 1, 1.0)]),
            _ => Err(BuildError::NoSuchStorey { storey, storeys }),
        }
    }

    /// The influence vector ι that the description gives, one number for each degree of freedom; `None` for ones.
    #[must_use]
    pub fn influence(&self) -> Option<Vec<f64>> {
        match self {
            StructureSpec::Matrices(spec) => spec.influence.clone(),
            StructureSpec::Frame(spec) => Some(spec.influence()),
            StructureSpec::ShearBuilding(_) | StructureSpec::Chain(_) => None,
        }
    }

    /// Builds the structure. `specimens` add to its mass and to the stiffness that a damping rule refers to.
    ///
    /// # Errors
    /// See [`BuildError`].
    pub fn build(
        &self,
        damping: Option<&DampingSpec>,
        elements: &[ElementSpec],
        specimens: Option<SpecimenShare<'_>>,
        files: &MatrixFiles,
    ) -> Result<Structure, BuildError> {
        self.build_from(self.linear(files)?, damping, elements, specimens)
    }

    /// The matrices of the description.
    ///
    /// # Errors
    /// See [`BuildError`].
    pub fn linear(&self, files: &MatrixFiles) -> Result<Linear, BuildError> {
        match self {
            StructureSpec::ShearBuilding(spec) => spec.linear(),
            StructureSpec::Matrices(spec) => spec.linear(files),
            StructureSpec::Chain(spec) => spec.linear(),
            StructureSpec::Frame(spec) => of_frame(spec),
        }
    }

    /// [`StructureSpec::build`] from matrices that may have been reduced.
    ///
    /// # Errors
    /// See [`BuildError`].
    pub fn build_from(
        &self,
        mut linear: Linear,
        damping: Option<&DampingSpec>,
        elements: &[ElementSpec],
        specimens: Option<SpecimenShare<'_>>,
    ) -> Result<Structure, BuildError> {
        if let (Some(given), Some(_)) = (linear.damping_given, damping) {
            return Err(BuildError::DampingTwice { given });
        }
        if let Some(share) = &specimens {
            for (what, matrix) in [
                ("specimen stiffness", share.stiffness_at_rest),
                ("damped specimen stiffness", share.damped_stiffness),
                ("specimen mass", share.mass),
                ("mass in the specimen's force", share.mass_in_force),
            ] {
                if matrix.n() != linear.mass.n() {
                    return Err(BuildError::Model(ModelError::Size {
                        what,
                        expected: linear.mass.n(),
                        found: matrix.n(),
                    }));
                }
            }
            linear.mass = linear.mass.plus(1.0, share.mass);
        }
        // One at a time: a long chain has as many dampers as masses.
        let mut failure = None;
        let dampers = match self {
            StructureSpec::Chain(spec) => spec.dofs,
            _ => 0,
        };
        let chain = (0..dampers).filter_map(|dof| match self {
            StructureSpec::Chain(spec) => spec.absolute_damper(dof),
            _ => None,
        });
        let listed = elements.iter().enumerate();
        let listed = listed.map(|(i, element)| element.build(i + 1));
        let built = chain.chain(listed).map_while(|element| match element {
            Ok(element) => Some(element),
            Err(error) => {
                failure = Some(error);
                None
            }
        });
        let structure = Structure::new(
            linear.mass,
            linear.damping,
            linear.stiffness,
            linear.influence,
            built,
        );
        if let Some(error) = failure {
            return Err(error);
        }
        let mut structure = structure?
            .with_storeys(linear.storeys.0, linear.storeys.1)
            .with_members(linear.members);
        if let Some(rule) = damping {
            let mut at_rest = structure.stiffness_at_rest();
            let mut mass = structure.mass().clone();
            let mut damped = linear.damped;
            if let Some(share) = specimens {
                at_rest = at_rest.plus(1.0, share.stiffness_at_rest);
                mass = mass.plus(1.0, share.mass_in_force);
                damped =
                    damped.map(|[of_rule, own]| [of_rule.plus(1.0, share.damped_stiffness), own]);
            }
            let of_rule = damped.as_ref().map_or(&at_rest, |[of_rule, _]| of_rule);
            let (mut damping, coefficient) = damping_matrix(rule, &mass, [&at_rest, of_rule])?;
            if let (Some([_, own]), Some(_)) = (&damped, coefficient) {
                damping = damping.plus(1.0, own);
            }
            let massless = structure.massless();
            // A rule damps the motion of masses: where nothing has mass, it makes no force (Chopra & McKenna 2016).
            let on_all = matches!(rule, DampingSpec::Rayleigh(rule) if rule.stiffness_part == StiffnessPart::Initial);
            if !on_all
                && !massless.is_empty()
                && let Ok(mut held) = Condensation::new(&at_rest, &massless)
            {
                let seen = held.seen_by(&damping);
                let kept = held.kept();
                let entries = seen.entries().map(|(i, j, c)| (kept[i], kept[j], c));
                damping = SymMatrix::from_triplets(damping.n(), entries);
            }
            structure.set_damping(damping, coefficient)?;
        }
        Ok(structure)
    }
}

fn of_frame(spec: &FrameSpec) -> Result<Linear, BuildError> {
    let model = spec.model()?;
    if model.mass.is_zero() {
        return Err(BuildError::NoMass);
    }
    Ok(Linear {
        damping: SymMatrix::zeros(model.dofs.len()),
        influence: spec.influence(),
        mass: model.mass,
        stiffness: model.linear,
        members: model.members,
        storeys: ("", Vec::new()),
        damped: Some(model.damped),
        damping_given: None,
    })
}

impl ElementSpec {
    /// Builds element `number`, counted from 1.
    ///
    /// # Errors
    /// The law's parameters are out of range.
    pub(crate) fn build(&self, number: usize) -> Result<Element, BuildError> {
        let name = match &self.name {
            Some(name) => name.clone(),
            None => format!("element {number}"),
        };
        let law = self.law.build().map_err(|source| BuildError::Law {
            element: name.clone(),
            source,
        })?;
        Ok(Element {
            name,
            from: self.from,
            to: self.to,
            law,
            reach: Reach {
                disp: self.reach_disp_m,
                vel: self.reach_vel_m_per_s,
            },
            hardening_ratio: self.hardening_ratio,
            damping_ratio: self.damping_ratio,
        })
    }
}

impl ShearBuildingSpec {
    fn linear(&self) -> Result<Linear, BuildError> {
        let n = self.mass_kg.len();
        let zeros = vec![0.0; n];
        let damping = self.damping_n_s_per_m.as_ref().unwrap_or(&zeros);
        for (key, place, values) in [
            ("mass_kg", "floor", &self.mass_kg),
            ("stiffness_n_per_m", "storey", &self.stiffness_n_per_m),
            ("damping_n_s_per_m", "storey", damping),
        ] {
            if values.len() != n {
                return Err(BuildError::Length {
                    key,
                    expected: n,
                    found: values.len(),
                });
            }
            for (i, &found) in values.iter().enumerate() {
                if !(found >= 0.0 && found.is_finite()) {
                    return Err(BuildError::Value {
                        key,
                        place,
                        number: i + 1,
                        found,
                    });
                }
            }
        }
        if n > 0 && self.mass_kg.iter().all(|&m| m == 0.0) {
            return Err(BuildError::NoMass);
        }
        let mut stiffness = self.stiffness_n_per_m.clone();
        for (stiffness, less) in stiffness.iter_mut().zip(self.geometric_stiffness()?) {
            *stiffness -= less;
        }
        Ok(Linear {
            mass: SymMatrix::diagonal(&self.mass_kg),
            damping: tied_chain(damping),
            stiffness: tied_chain(&stiffness),
            influence: vec![1.0; n],
            members: Members::default(),
            storeys: ("storey", storeys(&stiffness, damping)),
            damped: None,
            damping_given: self.damping_n_s_per_m.as_ref().map(|_| "damping_n_s_per_m"),
        })
    }
}

/// Standard gravity in m/s².
const GRAVITY: f64 = 9.80665;

impl ShearBuildingSpec {
    /// Weight above each storey over its height, in N/m; empty without P-Δ effect. For a storey whose floors stay level this is the
    /// whole effect of the weight on a small drift (Wilson & Habibullah 1987, Earthquake Spectra 3(1)).
    fn geometric_stiffness(&self) -> Result<Vec<f64>, BuildError> {
        let Some(p_delta) = &self.p_delta else {
            return Ok(Vec::new());
        };
        let own = || self.mass_kg.iter().map(|mass| mass * GRAVITY).collect();
        let weights: Vec<f64> = p_delta.weight_n.clone().unwrap_or_else(own);
        let heights = &p_delta.storey_height_m;
        let expected = self.mass_kg.len();
        for (key, values) in [("weight_n", &weights), ("storey_height_m", heights)] {
            if values.len() != expected {
                return Err(BuildError::Length {
                    key,
                    expected,
                    found: values.len(),
                });
            }
        }
        for (number, &found) in (1..).zip(&weights) {
            if !(found >= 0.0 && found.is_finite()) {
                return Err(BuildError::Value {
                    key: "weight_n",
                    place: "floor",
                    number,
                    found,
                });
            }
        }
        let mut above: f64 = weights.iter().sum();
        let each = weights.iter().zip(heights).map(|(weight, height)| {
            let lowered = above / positive("storey_height_m", *height)?;
            above -= weight;
            Ok(lowered)
        });
        each.collect()
    }
}

impl ChainSpec {
    /// Number of masses, if a machine can hold as many.
    fn count(&self) -> Result<usize, BuildError> {
        if (1..=MOST_DOFS).contains(&self.dofs) {
            return Ok(self.dofs);
        }
        Err(BuildError::Parameter(OutOfDomain {
            name: "dofs",
            found: self.dofs as f64,
            allowed: "1 to 1000000",
        }))
    }

    /// The damper of a mass, if there is one.
    fn absolute_damper(&self, dof: usize) -> Option<Result<Element, BuildError>> {
        let element = ElementSpec {
            name: Some(format!("absolute damper {}", dof + 1)),
            from: End::Fixed,
            to: End::Dof(dof),
            law: self.absolute_damper.clone()?,
            reach_disp_m: None,
            reach_vel_m_per_s: None,
            hardening_ratio: None,
            damping_ratio: None,
        };
        Some(element.build(dof + 1))
    }

    fn linear(&self) -> Result<Linear, BuildError> {
        let damping = self.damping_n_s_per_m.unwrap_or(0.0);
        self.count()?;
        let mass = positive("mass_kg", self.mass_kg)?;
        let stiffness = not_negative("stiffness_n_per_m", self.stiffness_n_per_m)?;
        not_negative("damping_n_s_per_m", damping)?;
        let (springs, dashpots) = (vec![stiffness; self.dofs], vec![damping; self.dofs]);
        Ok(Linear {
            mass: SymMatrix::diagonal(&vec![mass; self.dofs]),
            damping: tied_chain(&dashpots),
            stiffness: tied_chain(&springs),
            influence: vec![1.0; self.dofs],
            members: Members::default(),
            storeys: ("spring", storeys(&springs, &dashpots)),
            damped: None,
            damping_given: self.damping_n_s_per_m.map(|_| "damping_n_s_per_m"),
        })
    }
}

/// Matrix of springs in a row, the first one between the base and degree of freedom 0.
fn tied_chain(values: &[f64]) -> SymMatrix {
    let entries = values.iter().enumerate().flat_map(|(i, &value)| {
        let own = [(i, i, value)];
        let below = (i > 0).then(|| [(i - 1, i - 1, value), (i - 1, i, -value)]);
        own.into_iter().chain(below.into_iter().flatten())
    });
    SymMatrix::from_triplets(values.len(), entries)
}

fn storeys(stiffness: &[f64], damping: &[f64]) -> Vec<Storey> {
    let both = stiffness.iter().zip(damping);
    both.map(|(&stiffness, &damping)| Storey { stiffness, damping })
        .collect()
}

impl MatricesSpec {
    fn mass(&self, files: &MatrixFiles) -> Result<SymMatrix, BuildError> {
        let given = given("mass", "mass_file", &self.mass, &self.mass_file, files)?;
        given.ok_or(BuildError::Source {
            key: "mass",
            both: false,
        })
    }

    fn linear(&self, files: &MatrixFiles) -> Result<Linear, BuildError> {
        let mass = self.mass(files)?;
        let n = mass.n();
        let stiffness = given(
            "stiffness",
            "stiffness_file",
            &self.stiffness,
            &self.stiffness_file,
            files,
        )?
        .ok_or(BuildError::Source {
            key: "stiffness",
            both: false,
        })?;
        let damping = given(
            "damping",
            "damping_file",
            &self.damping,
            &self.damping_file,
            files,
        )?;
        if mass.is_zero() && n > 0 {
            return Err(BuildError::NoMass);
        }
        Ok(Linear {
            damping_given: damping.as_ref().map(|_| match self.damping {
                Some(_) => "damping",
                None => "damping_file",
            }),
            damping: damping.unwrap_or_else(|| SymMatrix::zeros(n)),
            mass,
            stiffness,
            influence: self.influence.clone().unwrap_or_else(|| vec![1.0; n]),
            members: Members::default(),
            storeys: ("", Vec::new()),
            damped: None,
        })
    }
}

/// One matrix, inline or from a file; `None` if it is given neither way.
fn given(
    key: &'static str,
    file_key: &'static str,
    inline: &Option<Vec<Vec<f64>>>,
    file: &Option<String>,
    files: &MatrixFiles,
) -> Result<Option<SymMatrix>, BuildError> {
    match (inline, file) {
        (None, None) => Ok(None),
        (Some(_), Some(_)) => Err(BuildError::Source { key, both: true }),
        (Some(rows), None) => {
            let columns = rows.first().map_or(0, Vec::len);
            if let Some((i, row)) = rows.iter().enumerate().find(|(_, r)| r.len() != columns) {
                return Err(BuildError::Ragged {
                    key,
                    row: i + 1,
                    expected: columns,
                    found: row.len(),
                });
            }
            let entries = rows
                .iter()
                .enumerate()
                .flat_map(|(i, row)| row.iter().enumerate().map(move |(j, &v)| (i, j, v)));
            SymMatrix::from_entries(rows.len(), columns, entries)
                .map(Some)
                .map_err(|source| BuildError::Matrix {
                    key: key.to_owned(),
                    source,
                })
        }
        (None, Some(name)) => {
            let table = files.get(name).ok_or_else(|| BuildError::File {
                key: file_key,
                file: name.clone(),
            })?;
            table
                .to_symmetric()
                .map(Some)
                .map_err(|source| BuildError::Matrix {
                    key: format!("{file_key} {name}"),
                    source,
                })
        }
    }
}
