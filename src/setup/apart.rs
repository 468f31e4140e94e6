//! Elements and modes that a test file gives a λ of their own.

use super::specimens::Specimens;
use super::{Refused, Site, path};
use crate::config::{Finding, KeyPath, LambdaValue, nearest};
use crate::integrate::{Apart, Lambda};
use crate::linalg::{self, SymMatrix};
use crate::model::Structure;

/// What has a λ of its own: its names and values for reports, and its share of K0.
#[derive(Debug)]
pub(super) struct Own {
    /// Elements by name, or "mode 1" and so on.
    pub named: Vec<(String, Lambda)>,
    /// Its share of K0.
    pub apart: Apart,
}

/// What the test file gives a λ of its own, if anything. `stiffness` is K0, specimens included.
pub(super) fn own(
    site: &mut Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
    stiffness: &SymMatrix,
) -> Result<Option<Own>, Refused> {
    let table = &site.loaded.file.integrator;
    if !table.lambda_of_element.is_empty() {
        elements(site, structure, specimens).map(Some)
    } else if !table.lambda_of_mode.is_empty() {
        modes(site, structure, stiffness).map(Some)
    } else {
        Ok(None)
    }
}

fn elements(
    site: &mut Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
) -> Result<Own, Refused> {
    let at = path("integrator").key("lambda_of_element");
    let n = structure.dofs();
    let (mut named, mut shares) = (Vec::new(), Vec::new());
    for (name, value) in &site.loaded.file.integrator.lambda_of_element {
        let here = at.key(name);
        let lambda = number(site, &here, *value)?;
        let own = [
            structure.stiffness_of(name),
            specimens.stiffness_of(name, n),
        ];
        let share = own.into_iter().flatten().reduce(|a, b| a.plus(1.0, &b));
        let Some(share) = share else {
            let parts: Vec<_> = structure.part_names().collect();
            let parts = parts.iter().map(|part| part.as_ref());
            let names: Vec<&str> = parts.chain(specimens.each_name()).collect();
            let mut finding = Finding::error(here, format!("this test has no part \"{name}\""))
                .at_key()
                .label("not the name of a storey, spring, element or specimen");
            if let Some(meant) = nearest(name, &names) {
                finding = finding.help(format!("did you mean \"{meant}\"?"));
            } else if let Some(first) = names.first() {
                finding = finding.help(format!("one of the names is \"{first}\""));
            }
            return site.refuse(finding);
        };
        if share.entries().all(|(_, _, value)| value == 0.0) {
            let text =
                format!("\"{name}\" has no initial stiffness, so a separate lambda has no effect");
            return site.refuse(Finding::error(here, text));
        }
        named.push((name.clone(), lambda));
        shares.push((share, lambda));
    }
    let apart = Apart::elements(n, &shares);
    Ok(Own { named, apart })
}

fn modes(
    site: &mut Site<'_>,
    structure: &Structure,
    stiffness: &SymMatrix,
) -> Result<Own, Refused> {
    let at = path("integrator").key("lambda_of_mode");
    let modes = match linalg::modes(stiffness, structure.mass()) {
        Ok(modes) => modes,
        Err(error) => {
            let text = format!("the modes cannot be computed: {error}");
            return site.refuse(Finding::error(at, text));
        }
    };
    let values = site.loaded.file.integrator.lambda_of_mode.clone();
    let (given, known) = (values.len(), modes.frequencies.len());
    if given > known {
        let text = format!("{given} modes have a lambda, but the structure has {known} modes");
        return site.refuse(Finding::error(at.index(known), text));
    }
    let mut named = Vec::with_capacity(given);
    for (index, value) in values.into_iter().enumerate() {
        let lambda = number(site, &at.index(index), value)?;
        named.push((format!("mode {}", index + 1), lambda));
    }
    let lambdas: Vec<Lambda> = named.iter().map(|(_, lambda)| *lambda).collect();
    let apart = Apart::modes(&modes, structure.mass(), &lambdas);
    Ok(Own { named, apart })
}

fn number(site: &mut Site<'_>, at: &KeyPath, value: LambdaValue) -> Result<Lambda, Refused> {
    match value {
        LambdaValue::Number(value) => match Lambda::new(value) {
            Ok(lambda) => Ok(lambda),
            Err(error) => site.refuse(Finding::error(at.clone(), error.to_string())),
        },
        LambdaValue::Infinite => Ok(Lambda::Infinite),
        LambdaValue::Auto => {
            let finding = Finding::error(at.clone(), "a lambda by name must be a number");
            site.refuse(finding.help("`lambda = \"auto\"` chooses the lambda of all other parts"))
        }
    }
}
