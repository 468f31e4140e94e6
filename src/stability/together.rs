//! All actuators of a test together: a loop may be unstable although it tolerates each actuator alone.
//!
//! Each axis j of all specimens behind declared actuators follows its command by H_j. With Z the dynamic stiffness of the
//! whole, B the rows of these axes and Z_e their own dynamic stiffness, the loop is stable if
//! det(I + Z_e diag(H − 1) B Z⁻¹ Bᵀ) has no zero right of the imaginary axis.

use std::f64::consts::PI;

use nalgebra::{Complex, DMatrix};

use super::following::{Follows, HIGHEST, decides};
use crate::config::{Finding, KeyPath, Loaded};
use crate::record::Kind;
use crate::setup::{Facts, Loop};
use crate::spectral::delay::Delayed;
use crate::spectral::unstable_roots;
use crate::transfer::TransferSpec;

type Matrix = DMatrix<Complex<f64>>;

/// The finding on all actuators together; none for a single axis, and where the loop is stable.
pub(super) fn together(loaded: &Loaded, facts: &Facts) -> Option<(Kind, Finding)> {
    let analysis = facts.structure.as_ref()?.analysis.as_ref()?;
    let pairs = analysis.loops.iter().zip(&loaded.file.specimen).enumerate();
    let transfers: Vec<(usize, &Loop, TransferSpec)> = pairs
        .filter_map(|(index, (one, table))| Some((index, one, table.believed_transfer(1.0)?)))
        .collect();
    let axes = transfers.iter().map(|(_, one, _)| one.system.rows.nrows());
    if axes.sum::<usize>() < 2 {
        return None;
    }
    let roots = |of: fn(&Loop) -> &Delayed| {
        let each = transfers.iter().map(|(index, one, transfer)| {
            let follows = Follows {
                table: &loaded.file.specimen[*index],
                transfer,
                tick: facts.rate_hz.recip(),
            };
            (of(one), follows)
        });
        roots(&each.collect::<Vec<_>>(), facts.rate_hz.recip())
    };
    let at_rest = roots(|one| &one.system);
    let has_closed = transfers.iter().any(|(_, one, _)| one.closed.is_some());
    let closed = if has_closed {
        roots(|one| one.closed.as_ref().unwrap_or(&one.system))
    } else {
        at_rest
    };
    let names = transfers
        .iter()
        .map(|(_, one, _)| format!("\"{}\"", one.name));
    let names = names.collect::<Vec<_>>().join(" and ");
    let (first, ..) = transfers.first()?;
    let at = KeyPath::root().key("specimen").index(*first);
    let at = at.key(decides(loaded.file.specimen.get(*first)?));
    finding(at, &names, at_rest, closed)
}

fn finding(
    at: KeyPath,
    names: &str,
    at_rest: Option<u32>,
    closed: Option<u32>,
) -> Option<(Kind, Finding)> {
    let is_unstable = |roots: Option<u32>| roots.is_some_and(|roots| roots > 0);
    match (at_rest, closed) {
        (Some(0), Some(0)) => None,
        _ if is_unstable(at_rest) && closed != Some(0) => {
            let text =
                format!("the loop is unstable with the actuators of specimen {names} together");
            let roots = f64::from(at_rest.unwrap_or_default());
            let finding = Finding::error(at, text)
                .at_key()
                .label("each actuator alone may be tolerated")
                .number("unstable_roots", roots)
                .help("compensate the lag of every actuator with [specimen.compensation]");
            Some((Kind::Unstable, finding))
        }
        _ => {
            let text = format!(
                "the stability of the loop with the actuators of specimen {names} together is not known"
            );
            let label = if is_unstable(at_rest) || is_unstable(closed) {
                "unstable either at rest, or with closed gaps and dampers at their reference"
            } else {
                "no proof: a compensation adapts or feeds back, or the curve cannot be followed"
            };
            let finding = Finding::warning(at, text).at_key().label(label);
            let help = "`check --rehearse` tries it over everything that is uncertain";
            Some((Kind::Unknown, finding.help(help)))
        }
    }
}

/// Roots of the loop right of the imaginary axis; none if they cannot be counted. `tick` in s.
fn roots(actuated: &[(&Delayed, Follows<'_>)], tick: f64) -> Option<u32> {
    let (first, _) = actuated.first()?;
    let marks = first.marks();
    let chain = |omega: f64| {
        let whole = whole(first, omega).lu();
        let systems = actuated.iter().map(|(system, _)| *system);
        let rows = stacked(&systems.collect::<Vec<_>>());
        let compliance = &rows * whole.solve(&rows.transpose())?;
        let mut missing = Matrix::zeros(rows.nrows(), rows.nrows());
        let mut start = 0;
        for (system, follows) in actuated {
            let own = dynamic(system, omega);
            let axes = own.nrows();
            for column in 0..axes {
                let lack = follows.at(omega, system, column)? - 1.0;
                for row in 0..axes {
                    missing[(start + row, start + column)] = own[(row, column)] * lack;
                }
            }
            start += axes;
        }
        let chain = Matrix::identity(start, start) + missing * compliance;
        Some(chain.lu().determinant())
    };
    unstable_roots(chain, 1e-2, HIGHEST * PI / tick, &marks)
}

/// Z_e of a specimen at iω.
fn dynamic(system: &Delayed, omega: f64) -> Matrix {
    let axes = system.rows.nrows();
    let inertia = omega * omega * system.specimen_mass;
    Matrix::from_fn(axes, axes, |i, j| {
        let mass = if i == j { inertia } else { 0.0 };
        Complex::new(
            system.specimen_stiffness[(i, j)] - mass,
            omega * system.specimen_damping[(i, j)],
        )
    })
}

/// Z of the whole at iω, this specimen included.
fn whole(system: &Delayed, omega: f64) -> Matrix {
    let n = system.mass.nrows();
    let rows = stacked(&[system]);
    let own = Matrix::from_fn(n, n, |i, j| {
        Complex::new(
            system.stiffness[(i, j)] - omega * omega * system.mass[(i, j)],
            omega * system.damping[(i, j)],
        )
    });
    own + rows.transpose() * dynamic(system, omega) * rows
}

/// The rows of all specimens below each other.
fn stacked(systems: &[&Delayed]) -> Matrix {
    let n = systems.first().map_or(0, |system| system.mass.nrows());
    let all = systems.iter().flat_map(|system| system.rows.row_iter());
    let rows: Vec<_> = all.collect();
    Matrix::from_fn(rows.len(), n, |i, j| Complex::new(rows[i][j], 0.0))
}
