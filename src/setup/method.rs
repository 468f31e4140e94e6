//! The integration method of a test file, made of the initial matrices.

use super::{Refused, Site, path};
use gusset_config::{Finding, Method, Start, Weighting};
use gusset_numerics::integrate::{
    self, AlphaWeights, CentralDifference, Chang2002, Explicit, Gui, Integrator, KrAlpha,
    KrAlphaAtState, Lambda, Massless, MethodError, Newmark, NewmarkBeta, NewtonSettings, Offline,
    Stepper,
};
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::model::Structure;

/// Input of a method, besides M.
pub(super) struct Initial<'a> {
    /// C0, specimens included.
    pub damping: &'a SymMatrix,
    /// K0, specimens included.
    pub stiffness: &'a SymMatrix,
    /// Δt in s.
    pub dt: f64,
}

impl Initial<'_> {
    /// M_eff of a member of the family, whole.
    pub(super) fn effective_mass(&self, mass: &SymMatrix, lambda: Lambda) -> SymMatrix {
        let square = self.dt * self.dt;
        let damped = mass.plus(self.dt / 2.0, self.damping);
        damped.plus(square * lambda.inverse(), self.stiffness)
    }
}

/// A member of the family, how its effective mass is stored, and 1/κ of it.
pub(super) fn family(
    site: &mut Site<'_>,
    structure: &Structure,
    initial: &Initial<'_>,
    lambda: Lambda,
    massless: Option<Massless>,
) -> Result<(Stepper, String, f64), Refused> {
    let start = match site.loaded.file.integrator.start {
        Start::Published => integrate::Start::Published,
        Start::SecondOrder => integrate::Start::SecondOrder,
    };
    let made = Gui::new(
        structure.mass(),
        initial.damping,
        initial.stiffness,
        initial.dt,
        lambda,
        start,
    );
    let gui = made.or_else(|error| {
        let finding = super::structure::not_definite(site, structure.mass(), &error);
        site.refuse(finding)
    })?;
    let (storage, condition) = (gui.storage().to_string(), gui.reciprocal_condition());
    let stepper = Stepper::Explicit(Explicit {
        integrator: Box::new(gui),
        massless: massless.map(Box::new),
    });
    Ok((stepper, storage, condition))
}

/// Any other method, and 1/κ of the matrix that it factors for α, if any; `None` for the family.
pub(super) fn companion(
    site: &mut Site<'_>,
    structure: &Structure,
    initial: &Initial<'_>,
) -> Result<Option<(Stepper, Option<f64>)>, Refused> {
    make(site, structure, initial).or_else(|error| {
        let at = match &error {
            MethodError::Parameter(out) => path("integrator").key(out.name),
            MethodError::Massless { dof } => super::structure::mass_of(site, *dof),
            MethodError::Factor { source, .. } => super::structure::mass_of(site, source.dof),
            _ => path("structure"),
        };
        site.refuse(Finding::error(at, error.to_string()))
    })
}

fn make(
    site: &Site<'_>,
    structure: &Structure,
    initial: &Initial<'_>,
) -> Result<Option<(Stepper, Option<f64>)>, MethodError> {
    let table = &site.loaded.file.integrator;
    let (mass, damping, stiffness) = (structure.mass(), initial.damping, initial.stiffness);
    let dt = initial.dt;
    let usual = NewtonSettings::default();
    let newton = NewtonSettings {
        tolerance: table.newton_tolerance.unwrap_or(usual.tolerance),
        iterations: table.newton_iterations.unwrap_or(usual.iterations),
    };
    let newmark = |member| {
        let method = Newmark::new(mass, damping, stiffness, dt, member, newton)?;
        Ok((offline(method), None))
    };
    let rho = table.rho_infinity.unwrap_or(f64::NAN);
    let alpha = |weights| match table.weighting.unwrap_or_default() {
        Weighting::Forces => {
            let method = KrAlpha::new(mass, damping, stiffness, dt, weights)?;
            let condition = method.reciprocal_condition();
            let method: Box<dyn Integrator> = Box::new(method);
            Ok((method.into(), Some(condition)))
        }
        Weighting::State => {
            let method = KrAlphaAtState::new(mass, damping, stiffness, dt, weights)?;
            Ok((offline(method), None))
        }
    };
    let stepper = match table.method {
        Method::Gui => return Ok(None),
        Method::NewmarkAverage => newmark(NewmarkBeta::Average),
        Method::NewmarkLinear => newmark(NewmarkBeta::Linear),
        Method::NewmarkExplicit => newmark(NewmarkBeta::Explicit),
        Method::CentralDifference => {
            let method = CentralDifference::new(mass, damping, stiffness, dt, newton)?;
            Ok((offline(method), None))
        }
        Method::Chang2002 => {
            let method = Chang2002::new(mass, damping, stiffness, dt, newton)?;
            Ok((offline(method), None))
        }
        Method::KrAlpha => alpha(AlphaWeights::kr(rho)?),
        Method::MkrAlpha => alpha(AlphaWeights::mkr(rho)?),
    };
    stepper.map(Some)
}

/// Digits of sixteen that a solve may lose without a word.
const DIGITS: f64 = 8.0;

/// Says that a solve loses digits, where it loses many.
pub(super) fn warn_of_digits(site: &mut Site<'_>, reciprocal_condition: f64) {
    let lost = -libm::log10(reciprocal_condition);
    // Written so that NaN is reported.
    if lost <= DIGITS {
        return;
    }
    let kept = (-libm::log10(f64::EPSILON) - lost).max(0.0);
    let text = format!(
        "the factored matrix of the alpha method has a reciprocal condition number of {reciprocal_condition:.1e}: a solution \
         keeps about {kept:.0} of 16 digits"
    );
    site.warnings.push(
        Finding::warning(path("structure"), text)
            .at_key()
            .label("parts of very different stiffness")
            .help(
                "a very stiff part costs digits in the others: make it softer, or join its two degrees of freedom to one",
            ),
    );
}

fn offline(method: impl Offline + 'static) -> Stepper {
    let method: Box<dyn Offline> = Box::new(method);
    method.into()
}
