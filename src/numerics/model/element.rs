//! An [`Element`] inside a structure: what the loop walks over, kept small, apart from what only reports need.

use super::{Element, End, ModelError};
use crate::law::{Law, Reach};
use gusset_quantity::state;

/// The hot half of an element.
#[derive(Debug)]
pub(super) struct Connection {
    pub(super) law: Box<dyn Law>,
    pub(super) from: u32,
    pub(super) to: u32,
}

state! { Connection { law } keeps { from, to } }

/// The cold half.
#[derive(Debug)]
pub(super) struct Facts {
    pub(super) name: String,
    pub(super) from: End,
    pub(super) to: End,
    pub(super) declared: Declared,
}

/// The user's declarations about an element beyond its law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Declared {
    pub(super) reach: Reach,
    pub(super) hardening_ratio: Option<f64>,
    pub(super) damping_ratio: Option<f64>,
}

/// Ends that are no degree of freedom, as indices beyond every vector.
const GROUND: u32 = u32::MAX - 1;
const FIXED: u32 = u32::MAX;

/// Displacement or velocity of an end. Real-time: yes.
pub(super) fn at(end: u32, of_dofs: &[f64], of_base: f64) -> f64 {
    match of_dofs.get(end as usize) {
        Some(value) => *value,
        None if end == GROUND => of_base,
        None => 0.0,
    }
}

/// b with deformation = b · x in relative coordinates.
pub(super) fn row(from: End, to: End) -> Vec<(usize, f64)> {
    let mut row = Vec::with_capacity(2);
    for (end, sign) in [(from, -1.0), (to, 1.0)] {
        if let End::Dof(dof) = end {
            row.push((dof, sign));
        }
    }
    row
}

/// Upper-triangle entries of value · b bᵀ.
pub(super) fn stamp(row: &[(usize, f64)], value: f64) -> Vec<(usize, usize, f64)> {
    let pairs = row
        .iter()
        .enumerate()
        .flat_map(|(k, a)| row[k..].iter().map(move |b| (a.0, b.0, value * a.1 * b.1)));
    pairs.collect()
}

/// Checks an element against a structure of `n` degrees of freedom and parts it into hot and cold.
pub(super) fn split(element: Element, n: usize) -> Result<(Connection, Facts), ModelError> {
    let Element {
        name,
        from,
        to,
        law,
        reach,
        hardening_ratio,
        damping_ratio,
    } = element;
    for end in [from, to] {
        if let End::Dof(dof) = end
            && dof >= n
        {
            return Err(ModelError::NoSuchDof {
                element: name,
                dof,
                dofs: n,
            });
        }
    }
    if from == to || row(from, to).is_empty() {
        return Err(ModelError::Ends {
            element: name,
            from,
            to,
        });
    }
    const POSITIVE: &str = "finite and greater than 0";
    const RATIO: &str = "finite and at least 1";
    for (key, value, least, allowed) in [
        ("reach_disp_m", reach.disp, f64::MIN_POSITIVE, POSITIVE),
        ("reach_vel_m_per_s", reach.vel, f64::MIN_POSITIVE, POSITIVE),
        ("hardening_ratio", hardening_ratio, 1.0, RATIO),
        ("damping_ratio", damping_ratio, 1.0, RATIO),
    ] {
        if let Some(found) = value
            && !(found >= least && found.is_finite())
        {
            return Err(ModelError::Declared {
                element: name,
                key,
                found,
                allowed,
            });
        }
    }
    let index = |end| match end {
        End::Dof(dof) => dof as u32,
        End::Ground => GROUND,
        End::Fixed => FIXED,
    };
    let hot = Connection {
        law,
        from: index(from),
        to: index(to),
    };
    let cold = Facts {
        name,
        from,
        to,
        declared: Declared {
            reach,
            hardening_ratio,
            damping_ratio,
        },
    };
    Ok((hot, cold))
}
