//! The integration method of a test file, made of the initial matrices.

use super::{Refused, Site, path};
use crate::config::{Finding, Method, Start, Weighting};
use crate::integrate::{
    self, AlphaWeights, Apart, CentralDifference, Chang2002, Gui, Integrator, KrAlpha,
    KrAlphaAtState, Lambda, MethodError, Newmark, NewmarkBeta, NewtonSettings, Offline, Stepper,
};
use crate::linalg::SymMatrix;
use crate::model::Structure;

/// What a method is made of, besides M.
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
    pub(super) fn effective_mass(
        &self,
        mass: &SymMatrix,
        lambda: Lambda,
        apart: Option<&Apart>,
    ) -> SymMatrix {
        let square = self.dt * self.dt;
        let damped = mass.plus(self.dt / 2.0, self.damping);
        match apart {
            Some(apart) => damped.plus(square, &apart.weighted(self.stiffness, lambda)),
            None => damped.plus(square * lambda.inverse(), self.stiffness),
        }
    }
}

/// A member of the family, and how its effective mass is stored.
pub(super) fn family(
    site: &mut Site<'_>,
    structure: &Structure,
    initial: &Initial<'_>,
    lambda: Lambda,
    apart: Option<&Apart>,
) -> Result<(Stepper, String), Refused> {
    let start = match site.loaded.file.integrator.start {
        Start::Published => integrate::Start::Published,
        Start::SecondOrder => integrate::Start::SecondOrder,
    };
    let made = Gui::with_apart(
        structure.mass(),
        initial.damping,
        initial.stiffness,
        initial.dt,
        lambda,
        start,
        apart,
    );
    match made {
        Ok(gui) => {
            let storage = gui.storage().to_string();
            let method: Box<dyn Integrator> = Box::new(gui);
            Ok((method.into(), storage))
        }
        Err(error) => {
            let finding = super::structure::not_definite(site, structure.mass(), &error);
            site.refuse(finding)
        }
    }
}

/// Any other method; none if the family is asked for.
pub(super) fn companion(
    site: &mut Site<'_>,
    structure: &Structure,
    initial: &Initial<'_>,
) -> Result<Option<Stepper>, Refused> {
    make(site, structure, initial).or_else(|error| {
        let at = match &error {
            MethodError::Rho { .. } => path("integrator").key("rho_infinity"),
            MethodError::Newton { name, .. } => path("integrator").key(name),
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
) -> Result<Option<Stepper>, MethodError> {
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
        Ok(offline(method))
    };
    let rho = table.rho_infinity.unwrap_or(f64::NAN);
    let alpha = |weights| match table.weighting.unwrap_or_default() {
        Weighting::Forces => {
            let method: Box<dyn Integrator> =
                Box::new(KrAlpha::new(mass, damping, stiffness, dt, weights)?);
            Ok(method.into())
        }
        Weighting::State => {
            let method = KrAlphaAtState::new(mass, damping, stiffness, dt, weights)?;
            Ok(offline(method))
        }
    };
    let stepper = match table.method {
        Method::Gui => return Ok(None),
        Method::NewmarkAverage => newmark(NewmarkBeta::Average),
        Method::NewmarkLinear => newmark(NewmarkBeta::Linear),
        Method::NewmarkExplicit => newmark(NewmarkBeta::Explicit),
        Method::CentralDifference => {
            let method = CentralDifference::new(mass, damping, stiffness, dt, newton)?;
            Ok(offline(method))
        }
        Method::Chang2002 => {
            let method = Chang2002::new(mass, damping, stiffness, dt, newton)?;
            Ok(offline(method))
        }
        Method::KrAlpha => alpha(AlphaWeights::kr(rho)?),
        Method::MkrAlpha => alpha(AlphaWeights::mkr(rho)?),
    };
    stepper.map(Some)
}

fn offline(method: impl Offline + 'static) -> Stepper {
    let method: Box<dyn Offline> = Box::new(method);
    method.into()
}
