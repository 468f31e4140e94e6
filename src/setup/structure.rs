//! The numerical structure of a test file, its initial state and its natural frequencies.

use super::facts::RuleDamping;
use super::specimens::Specimens;
use super::{Refused, Site, frames, path, reduction};
use gusset_config::{Finding, KeyPath, Method, StructureTable};
use gusset_numerics::integrate::{GuiError, State};
use gusset_numerics::linalg::{self, Condensation, MatrixError, Spd, SymMatrix};
use gusset_numerics::model::{
    Base, BuildError, MatrixFiles, ModelError, SpecimenShare, Structure, StructureSpec,
    parse_matrix,
};

/// Number of frequencies that are looked for.
const FREQUENCIES: usize = 6;
/// Largest model whose frequencies are found by a dense solution.
const DENSE_MODES: usize = 300;

/// The structure, with the specimens' stiffness known to its damping rule.
pub(super) fn structure(
    site: &mut Site<'_>,
    specimens: &mut Specimens,
) -> Result<Structure, Refused> {
    let Some(table) = &site.loaded.file.structure else {
        return site.refuse(Finding::error(
            path("structure"),
            "the test has no `[structure]`",
        ));
    };
    let at = path("structure");
    for (index, element) in table.element.iter().enumerate() {
        if let Err(error) = element.law.build() {
            let law = at.key("element").index(index).key("law");
            return site.refuse_key(&law, error.key(), &error);
        }
    }
    let Some((kind, spec)) = table.kind() else {
        return site.refuse(Finding::error(at, "the structure has no masses"));
    };
    let files = matrix_files(site, &at.key(kind), &spec)?;
    // Without masses the specimens' rows cannot be judged.
    let linear = spec.linear(&files);
    let mut linear = linear.or_else(|error| site.refuse(build_finding(site, &at, kind, &error)))?;
    specimens.check_rows(site, linear.mass.n())?;
    let mut elements = table.element.clone();
    let mut mass = specimens.mass(linear.mass.n());
    if let Some(reduce) = &table.reduce {
        let made = reduction::reduced(site, reduce, &spec, linear, &mut elements, specimens)?;
        linear = made.or_else(|error| site.refuse(build_finding(site, &at, kind, &error)))?;
        // The mass of specimens is in that of the reduced structure.
        mass = SymMatrix::zeros(linear.mass.n());
    }
    let dofs = linear.mass.n();
    let at_rest = specimens.stiffness_at_rest(dofs);
    let mass_in_force = specimens.mass_in_force(dofs);
    let damped_stiffness = specimens.damped_stiffness(dofs);
    let share = SpecimenShare {
        stiffness_at_rest: &at_rest,
        damped_stiffness: &damped_stiffness,
        mass: &mass,
        mass_in_force: &mass_in_force,
    };
    let built = spec.build_from(linear, table.damping.as_ref(), &elements, Some(share));
    built.or_else(|error| site.refuse(build_finding(site, &at, kind, &error)))
}

fn matrix_files(
    site: &mut Site<'_>,
    at: &KeyPath,
    spec: &StructureSpec,
) -> Result<MatrixFiles, Refused> {
    let mut files = MatrixFiles::new();
    for name in spec.files() {
        let keys = ["mass_file", "stiffness_file", "damping_file"];
        let key = keys.into_iter().find(|key| names(spec, key) == Some(name));
        let place = at.key(key.unwrap_or("mass_file"));
        let bytes = site.read(place.clone(), name)?;
        let table = parse_matrix(name, &bytes);
        let table = table.or_else(|error| site.refuse(Finding::error(place, error.to_string())))?;
        files.insert(name.to_owned(), table);
    }
    Ok(files)
}

fn names<'a>(spec: &'a StructureSpec, key: &str) -> Option<&'a str> {
    let StructureSpec::Matrices(matrices) = spec else {
        return None;
    };
    match key {
        "mass_file" => matrices.mass_file.as_deref(),
        "stiffness_file" => matrices.stiffness_file.as_deref(),
        _ => matrices.damping_file.as_deref(),
    }
}

/// Damping that the rule of the file adds along the axes of specimens; none without a rule or a specimen.
pub(super) fn rule_damping(
    site: &Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
    rotations: &[usize],
) -> Option<RuleDamping> {
    let table = site.loaded.file.structure.as_ref()?;
    table.damping.as_ref().filter(|_| !specimens.is_empty())?;
    Some(match structure.stiffness_coefficient() {
        Some(b) => {
            let is_frame = table.frame.is_some();
            RuleDamping::Stiffness(specimens.damping_by_rule(b, is_frame, rotations))
        }
        None => RuleDamping::Modal,
    })
}

/// Place in the file of a mistake of the model.
fn build_finding(site: &Site<'_>, at: &KeyPath, kind: &str, error: &BuildError) -> Finding {
    let beneath = |key: &str| site.loaded.locator.beneath(&at.key(kind), key);
    let element = |name: &str| {
        let table = site.loaded.file.structure.as_ref();
        let elements = table
            .map(|table| table.element.as_slice())
            .unwrap_or_default();
        let named = |index: usize, given: Option<&str>| {
            given.map_or_else(|| format!("element {}", index + 1), str::to_owned)
        };
        let found = elements
            .iter()
            .enumerate()
            .position(|(index, element)| named(index, element.name.as_deref()) == name);
        found.map_or_else(|| at.key("element"), |index| at.key("element").index(index))
    };
    let place = match error {
        BuildError::Length { key, .. } => beneath(key),
        BuildError::Parameter(out) => beneath(out.name),
        BuildError::Value { key, number, .. } => beneath(key).index(number - 1),
        BuildError::NoMass => beneath("mass_kg"),
        BuildError::Source { key, .. } | BuildError::Ragged { key, .. } => beneath(key),
        BuildError::Matrix { key, source } => {
            let name = key
                .split(|c: char| !(c.is_alphanumeric() || c == '_'))
                .next();
            let matrix = beneath(name.unwrap_or("mass"));
            return matrix_finding(matrix, error, source);
        }
        BuildError::File { key, .. } => beneath(key),
        BuildError::DampingTwice { .. } | BuildError::Damping(_) => at.key("damping"),
        BuildError::Law { source, .. } if kind == "chain" => {
            let law = at.key(kind).key("absolute_damper");
            site.loaded.locator.beneath(&law, source.key())
        }
        BuildError::Law { element: name, .. } => element(name),
        BuildError::Model(
            ModelError::NoSuchDof { element: name, .. }
            | ModelError::Ends { element: name, .. }
            | ModelError::NoBound { element: name, .. },
        ) => element(name),
        BuildError::Model(ModelError::Declared {
            element: name, key, ..
        }) => element(name).key(key),
        BuildError::Model(ModelError::Entry {
            what,
            source: MatrixError::TooLarge { row, column, .. },
        }) => {
            let matrix = given(site, &at.key(kind), what);
            match matrix.last_key() {
                Some(key) if key == *what => matrix.index(*row).index(*column),
                _ if *what == "mass" => mass_of(site, *row),
                _ => matrix,
            }
        }
        BuildError::Model(ModelError::Size { what, .. } | ModelError::Entry { what, .. }) => {
            given(site, &at.key(kind), what)
        }
        BuildError::Model(ModelError::NegativeMass { dof, .. }) => mass_of(site, *dof),
        BuildError::Model(ModelError::Mass(error)) => mass_of(site, error.dof),
        BuildError::Model(ModelError::Influence { dof, .. }) => beneath("influence").index(*dof),
        BuildError::Frame(error) => frames::place(site, error),
        BuildError::Model(_) | BuildError::NoSuchStorey { .. } | BuildError::NoStoreys => {
            at.key(kind)
        }
    };
    Finding::error(place, error.to_string())
}

/// The matrix `what`, inline or by the name of its file.
fn given(site: &Site<'_>, at: &KeyPath, what: &str) -> KeyPath {
    let inline = site.loaded.locator.beneath(at, what);
    if inline != *at {
        return inline;
    }
    let file = format!("{what}_file");
    site.loaded.locator.beneath(at, &file)
}

/// An invalid matrix; its wrong entries are shown if they are in the file.
fn matrix_finding(matrix: KeyPath, error: &BuildError, source: &MatrixError) -> Finding {
    let text = error.to_string();
    match *source {
        MatrixError::Asymmetric {
            row,
            column,
            here,
            there,
        } => {
            let (first, second) = (
                matrix.index(row).index(column),
                matrix.index(column).index(row),
            );
            let help = "M, C and K must be symmetric";
            let finding = if matrix.last_key().is_some_and(|key| key.ends_with("_file")) {
                Finding::error(matrix, text)
            } else {
                Finding::error(first, text)
                    .label(format!("found {here}"))
                    .beside(second, format!("and {there} here"))
            };
            finding.help(help)
        }
        MatrixError::NotSquare { .. } => Finding::error(matrix, text)
            .help("a matrix has one row and one column per degree of freedom"),
        MatrixError::NotFinite { .. } | MatrixError::TooLarge { .. } => {
            Finding::error(matrix, text)
        }
    }
}

/// Place of the mass of DOF `dof` (from 0), as near as the file names it.
pub(super) fn mass_of(site: &Site<'_>, dof: usize) -> KeyPath {
    let at = path("structure");
    let structure = site.loaded.file.structure.as_ref();
    let Some((kind, _)) = structure.and_then(StructureTable::kind) else {
        return at;
    };
    let at = at.key(kind);
    let mass = match kind {
        "matrices" => given(site, &at, "mass"),
        _ => site.loaded.locator.beneath(&at, "mass_kg"),
    };
    // Rows of the file are those of the full model.
    if mass == at || kind == "chain" || site.reduced.is_some() {
        mass
    } else {
        mass.index(dof)
    }
}

/// Finds an M_eff that is not positive definite: the DOF without inertia, and a remedy.
pub(super) fn not_definite(site: &Site<'_>, mass: &SymMatrix, error: &GuiError) -> Finding {
    let GuiError::EffectiveMass(pivot) = error else {
        return Finding::error(path("structure"), error.to_string());
    };
    let found = mass.get(pivot.dof, pivot.dof);
    Finding::error(mass_of(site, pivot.dof), error.to_string())
        .label(format!("DOF {} has a mass of {found} kg", pivot.dof + 1))
        .help(
            "every massless degree of freedom needs a stiffness or damping, and no stiffness may be negative",
        )
}

/// `x[0]` and `v[0]`. Degrees of freedom without mass that follow statically must be where they balance, and move with the others.
pub(super) fn initial_state(
    site: &mut Site<'_>,
    structure: &mut Structure,
    at_rest: &SymMatrix,
) -> Result<State, Refused> {
    let dofs = structure.dofs();
    let table = site.loaded.file.structure.as_ref();
    let is_loaded = table.is_some_and(StructureTable::has_static_load);
    let disp = table.and_then(|table| table.initial_displacement_m.clone());
    let vel = table.and_then(|table| table.initial_velocity_m_per_s.clone());
    let given = site.dofs_of_file(dofs);
    let disp = vector(site, "initial_displacement_m", disp, given)?;
    let vel = vector(site, "initial_velocity_m_per_s", vel, given)?;
    let [disp, vel] = [disp, vel].map(|one| site.motion(one));
    let massless = followed(site.loaded.file.integrator.method, structure);
    let held = Condensation::new(at_rest, &massless).ok();
    if let Some(mut held) = held.filter(|_| !massless.is_empty()) {
        let mut forces = vec![0.0; dofs];
        let still = vec![0.0; dofs];
        structure.subtract_trial(&disp, &still, Base::default(), 0.0, &mut forces);
        let mut follows = vel.clone();
        held.follow(&mut follows);
        // Displacements count from the place under the static load, where forces are not known yet.
        let far = |dof: &&usize| {
            let own = at_rest.get(**dof, **dof);
            let largest = disp.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            !is_loaded && (forces[**dof] / own).abs() > 1e-6 * largest
        };
        let fast = |dof: &&usize| {
            let largest = vel.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
            (follows[**dof] - vel[**dof]).abs() > 1e-6 * largest
        };
        let wrong = massless.iter().find(far).map(|dof| {
            let text = format!(
                "DOF {} has no mass, and its forces do not balance at the start: {:.4e} N remain",
                dof + 1,
                forces[*dof]
            );
            ("initial_displacement_m", *dof, text)
        });
        let wrong = wrong.or_else(|| {
            let dof = massless.iter().find(fast)?;
            let text = format!(
                "DOF {} has no mass and moves with the others, at {:.6e} m/s, but it begins with {:.6e} m/s",
                dof + 1,
                follows[*dof],
                vel[*dof]
            );
            Some(("initial_velocity_m_per_s", *dof, text))
        });
        if let Some((key, dof, text)) = wrong {
            let reduced = site.reduced.as_ref();
            let dof = reduced.map_or(dof, |one| one.reduction.kept()[dof]);
            let at = path("structure").key(key).index(dof);
            return site.refuse(Finding::error(at, text));
        }
    }
    Ok(State::new(disp, vel))
}

/// Degrees of freedom without mass that follow statically: those of the family.
pub(super) fn followed(method: Method, structure: &Structure) -> Vec<usize> {
    match method {
        Method::Gui => structure.massless(),
        _ => Vec::new(),
    }
}

/// A vector of the structure with one entry per DOF; zeros if it is absent.
pub(super) fn vector(
    site: &mut Site<'_>,
    key: &str,
    given: Option<Vec<f64>>,
    dofs: usize,
) -> Result<Vec<f64>, Refused> {
    match given {
        None => Ok(vec![0.0; dofs]),
        Some(values) if values.len() == dofs => Ok(values),
        Some(values) => {
            let found = values.len();
            let text = format!("`{key}` has {found} entries, but the structure has {dofs} DOFs");
            site.refuse(Finding::error(path("structure").key(key), text))
        }
    }
}

/// Beyond this share of its own diagonal a negative stiffness comes neither from roundoff nor from six printed digits.
const INDEFINITE: f64 = 1e-6;

/// True if a stiffness or a damping has no negative eigenvalue; bodies that move freely have one of zero.
fn is_held(matrix: &SymMatrix) -> bool {
    let n = matrix.n();
    let largest = (0..n).fold(0.0, |most: f64, i| most.max(matrix.get(i, i).abs()));
    let little = |i: usize| match matrix.get(i, i).abs() {
        0.0 if matrix.row_is_zero(i) => largest.max(1.0),
        own => own,
    };
    let little: Vec<f64> = (0..n).map(|i| INDEFINITE * little(i)).collect();
    Spd::factor(&matrix.plus(1.0, &SymMatrix::diagonal(&little))).is_ok()
}

/// Finds a stiffness at rest at which a motion grows instead of oscillating. It is refused if it is a matrix of the structure
/// that no element and no specimen compensates. It is warned about if a law begins with a falling branch, or an open gap may hold
/// it.
pub(super) fn definite(
    site: &mut Site<'_>,
    structure: &Structure,
    [at_rest, initial]: [&SymMatrix; 2],
) -> Result<(), Refused> {
    if frames::are_held(site)? || is_held(at_rest) {
        return Ok(());
    }
    let kind = site.loaded.file.structure.as_ref();
    let kind = kind.and_then(StructureTable::kind).map(|(key, _)| key);
    let at = path("structure").key(kind.unwrap_or("matrices"));
    let is_refused = !is_held(structure.stiffness()) && !is_held(initial);
    let table = site.loaded.file.structure.as_ref();
    let building = table.and_then(|table| table.shear_building.as_ref());
    let leans = building.is_some_and(|building| building.p_delta.is_some());
    indefinite(
        site,
        is_refused.then(|| given(site, &at, "stiffness")),
        [
            "the stiffness has a negative eigenvalue: the structure is unstable",
            if leans {
                "`p_delta` lowers the stiffness of each storey by the weight above it over its height"
            } else {
                "a spring k between two DOFs adds +k to both diagonal entries and −k beside the diagonal"
            },
        ],
        [
            "the stiffness at rest has a negative eigenvalue: the response grows from rest",
            "the tangents of all laws at zero are included; the choice of lambda does not change this",
        ],
    )
}

/// Finds a damping at rest that adds energy. It is refused if it is a matrix of the structure that no element and no specimen
/// compensates. It is warned about if it comes from a falling stiffness or an estimate, or ends with motion.
pub(super) fn dissipative(
    site: &mut Site<'_>,
    structure: &Structure,
    [at_rest, initial]: [&SymMatrix; 2],
) -> Result<(), Refused> {
    if is_held(at_rest) {
        return Ok(());
    }
    let place = given(site, &path("structure").key("matrices"), "damping");
    let is_given = matches!(place.last_key(), Some("damping" | "damping_file"));
    let is_refused = is_given && !is_held(structure.damping()) && !is_held(initial);
    indefinite(
        site,
        is_refused.then_some(place),
        [
            "the damping has a negative eigenvalue: it adds energy to the structure",
            "a dashpot c between two DOFs adds +c to both diagonal entries and −c beside the diagonal",
        ],
        [
            "the damping at rest has a negative eigenvalue: it adds energy to the structure",
            "the tangents of all laws at zero and the estimates of specimens are included",
        ],
    )
}

/// A matrix with a negative eigenvalue: refused at this place of the file, if there is one, else warned of; each with its help.
fn indefinite(
    site: &mut Site<'_>,
    place: Option<KeyPath>,
    [refused, mend]: [&str; 2],
    [warned, reason]: [&str; 2],
) -> Result<(), Refused> {
    if let Some(place) = place {
        return site.refuse(Finding::error(place, refused).help(mend));
    }
    let finding = Finding::warning(path("structure"), warned);
    site.warnings.push(finding.at_key().help(reason));
    Ok(())
}

/// The lowest natural frequencies in rad/s; fewer, or none, where they are not cheap to find.
pub(super) fn frequencies(stiffness: &SymMatrix, mass: &SymMatrix) -> Vec<f64> {
    if mass.n() > DENSE_MODES {
        return Vec::new();
    }
    linalg::frequencies(stiffness, mass, FREQUENCIES).unwrap_or_default()
}
