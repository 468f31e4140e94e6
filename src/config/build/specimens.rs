//! The specimens of a test file: their rows of B, their laws, and what they add to K0, C0 and their bounds.

use nalgebra::DMatrix;

use super::{Refused, Site, path};
use crate::config::{AxisTable, Finding, KeyPath, MatrixValue, SpecimenTable};
use crate::control::{Axis, Port};
use crate::law::Reach;
use crate::linalg::SymMatrix;
use crate::model::{Part, StructureSpec};
use crate::specimen::{InProcess, InUnits, Specimen};

/// A square matrix by rows, one row per axis.
type Rows = Vec<Vec<f64>>;

/// One specimen with everything that is known of it, in the structure's units and at its scale.
#[derive(Debug)]
struct Entry {
    name: String,
    law: Box<dyn Specimen>,
    axes: Vec<Axis>,
    units: Vec<(f64, f64)>,
    /// k̂ and ĉ, by rows.
    stiffness: Rows,
    damping: Rows,
    /// Upper bounds of the tangents; the axis (from 0) whose reach is missing otherwise.
    bounds: Result<(Rows, Rows), usize>,
    mass_in_force: f64,
}

/// What one specimen adds to the structure, by rows.
pub(super) struct Loop<'a> {
    pub name: &'a str,
    pub rows: Vec<&'a [(usize, f64)]>,
    pub stiffness: &'a [Vec<f64>],
    pub damping: &'a [Vec<f64>],
}

/// All specimens of a test, in order.
#[derive(Debug)]
pub(super) struct Specimens(Vec<Entry>);

/// Reads all specimens.
pub(super) fn specimens(site: &mut Site<'_>) -> Result<Specimens, Refused> {
    let tables = &site.loaded.file.specimen;
    let mut entries = Vec::with_capacity(tables.len());
    for (index, table) in tables.iter().enumerate() {
        entries.push(entry(site, &path("specimen").index(index), table)?);
    }
    Ok(Specimens(entries))
}

fn entry(site: &mut Site<'_>, at: &KeyPath, table: &SpecimenTable) -> Result<Entry, Refused> {
    let rows = rows(site, at, table)?;
    let n = rows.len();
    let Some((key, source)) = table.sources().into_iter().next() else {
        return site.refuse(Finding::error(
            at.clone(),
            "nothing stands for the specimen",
        ));
    };
    let law = match source.build(n) {
        Ok(law) => law,
        Err(error) => return site.refuse_key(&at.key(key), error.key(), &error),
    };
    let mut axes = Vec::with_capacity(n);
    let mut units = Vec::with_capacity(n);
    let mut reach = Vec::with_capacity(n);
    for (index, row) in rows.into_iter().enumerate() {
        let gear = table.axis.get(index).cloned().unwrap_or_default();
        let (axis, to_si) = axis(table, &gear, row);
        // What the law sees at its own scale when the structure moves as far as is declared.
        let scale = gear.scale / table.similitude.length;
        reach.push(Reach {
            disp: table.reach_disp_m.map(|reach| reach * scale),
            vel: table
                .reach_vel_m_per_s
                .map(|reach| reach * scale * table.similitude.time),
        });
        axes.push(axis);
        units.push(to_si);
    }
    let (mut k, mut c, mut m) = (vec![0.0; n * n], vec![0.0; n * n], vec![0.0; n * n]);
    law.reference(&mut k, &mut c, &mut m);
    let scaled = |flat: &[f64], motion: fn(&Axis) -> f64| scaled(flat, &axes, &units, motion);
    let stiffness = match &table.stiffness_n_per_m {
        Some(given) => estimate(site, &at.key("stiffness_n_per_m"), given, n)?,
        None => scaled(&k, |axis| axis.disp_gain),
    };
    let damping = match &table.damping_n_s_per_m {
        Some(given) => estimate(site, &at.key("damping_n_s_per_m"), given, n)?,
        None => scaled(&c, |axis| axis.vel_gain),
    };
    let bounds = law.bound(&reach, &mut k, &mut c).map(|()| {
        (
            scaled(&k, |axis| axis.disp_gain),
            scaled(&c, |axis| axis.vel_gain),
        )
    });
    Ok(Entry {
        name: table.name.clone(),
        law,
        axes,
        units,
        stiffness,
        damping,
        bounds,
        mass_in_force: table.mass_in_force_kg,
    })
}

/// Rows of B: of a storey, given, or one without any entry for a test without a structure.
fn rows(
    site: &mut Site<'_>,
    at: &KeyPath,
    table: &SpecimenTable,
) -> Result<Vec<Vec<(usize, f64)>>, Refused> {
    let kinds = site
        .loaded
        .file
        .structure
        .as_ref()
        .map(|structure| structure.kinds());
    let spec: Option<&StructureSpec> = kinds.and_then(|kinds| kinds.first().map(|kind| kind.1));
    match (table.storey, &table.rows, spec) {
        (Some(storey), _, Some(spec)) => match spec.storey_row(storey) {
            Ok(row) => Ok(vec![row]),
            Err(error) => {
                let finding = Finding::error(at.key("storey"), error.to_string());
                site.refuse(finding.label("no such storey"))
            }
        },
        (None, Some(rows), _) => {
            let sparse = |row: &Vec<f64>| {
                let entries = row.iter().copied().enumerate();
                entries.filter(|(_, entry)| *entry != 0.0).collect()
            };
            Ok(rows.iter().map(sparse).collect())
        }
        // Without a structure there is nothing to transform: as many axes as the laws or the axis tables say.
        (_, _, None) => {
            let laws = match &table.laws {
                Some(crate::specimen::SpecimenLaw::Laws(laws)) => laws.len(),
                _ => match &table.coupled {
                    Some(crate::specimen::SpecimenLaw::Coupled(coupled)) => {
                        coupled.stiffness_n_per_m.len()
                    }
                    _ => 1,
                },
            };
            Ok(vec![Vec::new(); laws.max(table.axis.len()).max(1)])
        }
        (None, None, Some(_)) => {
            let text = "which deformation does the specimen see: `storey` or `rows`";
            site.refuse(Finding::error(at.clone(), text))
        }
    }
}

/// The map of one axis, and metres and newtons in one unit of it.
fn axis(table: &SpecimenTable, gear: &AxisTable, row: Vec<(usize, f64)>) -> (Axis, (f64, f64)) {
    let (metres, newtons) = (gear.unit_disp.metres(), gear.unit_force.newtons());
    let ratio = f64::from(gear.sign) * gear.scale;
    let scale = &table.similitude;
    let axis = Axis {
        row,
        base: 0.0,
        disp_gain: ratio / (scale.length * metres),
        disp_offset: gear.offset_m / metres,
        vel_gain: ratio * scale.time / (scale.length * metres),
        force_gain: scale.force * ratio * newtons,
        force_offset: gear.offset_n / newtons,
    };
    (axis, (metres, newtons))
}

/// A matrix of the law (by columns, SI, specimen's scale) as the structure sees it (by rows).
fn scaled(flat: &[f64], axes: &[Axis], units: &[(f64, f64)], motion: fn(&Axis) -> f64) -> Rows {
    let n = axes.len();
    let value = |i: usize, j: usize| {
        let (force, moved) = (
            axes[i].force_gain / units[i].1,
            motion(&axes[j]) * units[j].0,
        );
        force * flat[j * n + i] * moved
    };
    (0..n)
        .map(|i| (0..n).map(|j| value(i, j)).collect())
        .collect()
}

fn estimate(
    site: &mut Site<'_>,
    at: &KeyPath,
    given: &MatrixValue,
    n: usize,
) -> Result<Rows, Refused> {
    let rows = given.rows();
    if rows.len() != n || rows.iter().any(|row| row.len() != n) {
        let text = format!("the estimate is not {n} × {n}, one row and column per axis");
        return site.refuse(Finding::error(at.clone(), text));
    }
    let matrix = DMatrix::from_fn(n, n, |i, j| rows[i][j]);
    match SymMatrix::from_dense(&matrix) {
        Ok(_) => Ok(rows),
        Err(error) => site.refuse(Finding::error(at.clone(), error.to_string())),
    }
}

impl Specimens {
    /// True if no specimen closes the loop.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Names, in order.
    pub(super) fn names(&self) -> Vec<String> {
        self.0.iter().map(|entry| entry.name.clone()).collect()
    }

    /// Name and number of axes, in order.
    pub(super) fn axes(&self) -> impl Iterator<Item = (&str, usize)> {
        self.0
            .iter()
            .map(|entry| (entry.name.as_str(), entry.axes.len()))
    }

    /// Name, rows of B, k̂ and ĉ of every specimen.
    pub(super) fn loops(&self) -> impl Iterator<Item = Loop<'_>> {
        self.0.iter().map(|entry| Loop {
            name: &entry.name,
            rows: entry.axes.iter().map(|axis| axis.row.as_slice()).collect(),
            stiffness: &entry.stiffness,
            damping: &entry.damping,
        })
    }

    /// Every DOF (from 0) that a specimen sees.
    pub(super) fn dofs(&self) -> Vec<usize> {
        let rows = self
            .0
            .iter()
            .flat_map(|entry| &entry.axes)
            .flat_map(|axis| &axis.row);
        rows.map(|(dof, _)| *dof).collect()
    }

    /// Rows of B that reach beyond the structure are refused.
    pub(super) fn check_rows(&self, site: &mut Site<'_>, dofs: usize) -> Result<(), Refused> {
        let tables = site.loaded.file.specimen.iter().enumerate();
        for (index, table) in tables {
            let at = path("specimen").index(index).key("rows");
            for (row, entries) in table.rows.iter().flatten().enumerate() {
                if entries.len() != dofs {
                    let found = entries.len();
                    let text = format!(
                        "row {} of B has {found} entries, but the structure has {dofs} DOFs",
                        row + 1
                    );
                    return site.refuse(Finding::error(at.index(row), text));
                }
            }
        }
        Ok(())
    }

    /// Σ Bᵀ k̂ B.
    pub(super) fn stiffness(&self, dofs: usize) -> SymMatrix {
        self.gathered(dofs, |entry| Some(&entry.stiffness))
    }

    /// Σ Bᵀ ĉ B.
    pub(super) fn damping(&self, dofs: usize) -> SymMatrix {
        self.gathered(dofs, |entry| Some(&entry.damping))
    }

    /// Upper bounds of the tangents, or the specimen (from 0) whose law needs a declared reach.
    pub(super) fn bounds(&self, dofs: usize) -> Result<(SymMatrix, SymMatrix), usize> {
        if let Some(index) = self.0.iter().position(|entry| entry.bounds.is_err()) {
            return Err(index);
        }
        let bound = |entry: &Entry| entry.bounds.clone().ok();
        let stiffness: Vec<_> = self.0.iter().map(|e| bound(e).map(|b| b.0)).collect();
        let damping: Vec<_> = self.0.iter().map(|e| bound(e).map(|b| b.1)).collect();
        let gather = |all: &[Option<Rows>]| {
            let mut index = 0;
            self.gathered(dofs, |_| {
                index += 1;
                all.get(index - 1).and_then(Option::as_ref)
            })
        };
        Ok((gather(&stiffness), gather(&damping)))
    }

    /// Named shares of K_max and C_max, one per axis.
    pub(super) fn parts(&self) -> Vec<Part> {
        let mut parts = Vec::new();
        for entry in &self.0 {
            let Ok((stiffness, damping)) = &entry.bounds else {
                continue;
            };
            for (j, axis) in entry.axes.iter().enumerate() {
                let several = entry.axes.len() > 1;
                let name = if several {
                    format!("specimen \"{}\" axis {}", entry.name, j + 1)
                } else {
                    format!("specimen \"{}\"", entry.name)
                };
                parts.push(Part {
                    name,
                    row: axis.row.clone(),
                    stiffness_bound: stiffness[j][j],
                    damping: entry.damping[j][j],
                    damping_bound: damping[j][j],
                });
            }
        }
        parts
    }

    /// Σ Bᵀ m B of the masses whose inertia is inside the measured forces.
    pub(super) fn mass_in_force(&self, dofs: usize) -> SymMatrix {
        let masses: Vec<Rows> = self
            .0
            .iter()
            .map(|entry| {
                let n = entry.axes.len();
                let diagonal = |i, j| if i == j { entry.mass_in_force } else { 0.0 };
                (0..n)
                    .map(|i| (0..n).map(|j| diagonal(i, j)).collect())
                    .collect()
            })
            .collect();
        let mut index = 0;
        self.gathered(dofs, |_| {
            index += 1;
            masses.get(index - 1)
        })
    }

    fn gathered<'a>(
        &'a self,
        dofs: usize,
        mut of: impl FnMut(&'a Entry) -> Option<&'a Rows>,
    ) -> SymMatrix {
        let mut triplets = Vec::new();
        for entry in &self.0 {
            let Some(matrix) = of(entry) else { continue };
            for (i, row_i) in entry.axes.iter().enumerate() {
                for (j, row_j) in entry.axes.iter().enumerate() {
                    for &(p, a) in &row_i.row {
                        for &(q, b) in &row_j.row {
                            // One half of the symmetric whole: the other is mirrored.
                            if p < q || (p == q && p < dofs) {
                                triplets.push((p, q, a * b * matrix[i][j]));
                            }
                        }
                    }
                }
            }
        }
        SymMatrix::from_triplets(
            dofs,
            triplets.into_iter().filter(|t| t.0 < dofs && t.1 < dofs),
        )
    }

    /// One port per specimen.
    pub(super) fn into_ports(self, site: &mut Site<'_>, dofs: usize) -> Result<Vec<Port>, Refused> {
        let influence = match &site.loaded.file.structure {
            Some(structure) => structure
                .matrices
                .as_ref()
                .and_then(|spec| match spec {
                    StructureSpec::Matrices(matrices) => matrices.influence.clone(),
                    _ => None,
                })
                .unwrap_or_else(|| vec![1.0; dofs]),
            None => Vec::new(),
        };
        let mut ports = Vec::with_capacity(self.0.len());
        for (index, mut entry) in self.0.into_iter().enumerate() {
            for axis in &mut entry.axes {
                let iota = |dof: usize| influence.get(dof).copied().unwrap_or(0.0);
                axis.base = axis.row.iter().map(|&(dof, b)| b * iota(dof)).sum();
            }
            let diagonal = (0..entry.axes.len())
                .map(|i| entry.stiffness[i][i])
                .collect();
            let specimen = InProcess::new(InUnits::new(entry.law, &entry.units));
            match Port::new(
                entry.name,
                entry.axes,
                Box::new(specimen),
                dofs.max(1),
                diagonal,
            ) {
                Ok(port) => ports.push(port),
                Err(error) => {
                    let at = path("specimen").index(index);
                    return site.refuse(Finding::error(at, error.to_string()));
                }
            }
        }
        Ok(ports)
    }
}
