//! The equation of motion of a recorded test, for the energy balance and the damping error of its report: rebuilt from the
//! folder's configuration.

use std::path::Path;

use gusset_config::{self as config, RecordedFile};
use gusset_control::engine::Side;
use gusset_motion::Excitation;
use gusset_motion::metrics::energy::Model;
use gusset_motion::metrics::falsified::Mode;
use gusset_numerics::model::{Base, Structure};
use gusset_proof::Analysis;
use gusset_quantity::catalog::column::DISP;
use gusset_record::Column;
use gusset_setup as setup;

/// The numerical side of a test without its integrator.
pub(super) struct Energetics {
    structure: Structure,
    excitation: Excitation,
    analysis: Analysis,
    steps: usize,
}

/// Why a test has no energy balance.
pub(super) enum Without {
    /// It has no structure.
    Structure,
    /// The reason that prevents it, in words.
    Because(String),
}

/// Degrees of freedom of a chain; it is the one structure that is too large to be built for a picture that it cannot have.
fn chain(resolved: &RecordedFile) -> Option<usize> {
    Some(resolved.structure.as_ref()?.chain.as_ref()?.dofs)
}

/// The first line of a message that has something in it.
pub(super) fn first_line(text: &str) -> &str {
    let mut lines = text.lines().map(str::trim);
    lines.find(|line| !line.is_empty()).unwrap_or_default()
}

/// Properties of a structure for its report.
pub(super) struct Known {
    /// Input of the energy balance, or why there is no balance.
    pub balance: Result<Energetics, Without>,
    /// Its modes, or why they are not known.
    pub modes: Result<Vec<Mode>, String>,
    /// Why no margin to a critical delay was watched, if none was.
    pub no_margin: Option<String>,
    /// Motion of the ground up to the requested step, as in the rows; empty where it is not known.
    pub ground_before: Vec<Vec<f64>>,
}

/// The structure of the run in `folder`, with this `resolved.toml` and these columns, of which the steps up to `before` are in
/// another folder.
pub(super) fn known(
    folder: &Path,
    resolved: &RecordedFile,
    columns: &[Column],
    before: Option<u64>,
) -> Known {
    let without = |balance| Known {
        modes: match &balance {
            Without::Structure => Ok(Vec::new()),
            Without::Because(why) => Err(why.clone()),
        },
        no_margin: None,
        ground_before: Vec::new(),
        balance: Err(balance),
    };
    match structure(folder, resolved, columns) {
        Ok((energetics, is_absolute, no_margin)) => {
            let modes = energetics.modes();
            let ground = before.map(|step| energetics.grounds(step));
            let has_past = before.is_some() && !energetics.structure.is_linear();
            let why = if is_absolute {
                Some(
                    "the base or a support is displaced, and the force that does it is not recorded",
                )
            } else if has_past {
                Some("what its nonlinear elements went through before is in another folder")
            } else {
                None
            };
            Known {
                balance: match why {
                    Some(why) => Err(Without::Because(why.to_owned())),
                    None => Ok(energetics),
                },
                modes,
                no_margin,
                ground_before: ground.unwrap_or_default(),
            }
        }
        Err(why) => without(why),
    }
}

/// The structure, whether its base or a support is displaced, and why no margin to a critical delay was watched.
fn structure(
    folder: &Path,
    resolved: &RecordedFile,
    columns: &[Column],
) -> Result<(Energetics, bool, Option<String>), Without> {
    let because = |text: String| Without::Because(text);
    let recorded = columns.iter().filter(|c| DISP.fits(&c.name)).count();
    if recorded == 0 {
        return Err(Without::Structure);
    }
    if chain(resolved).is_some_and(|dofs| dofs > recorded) {
        return Err(because("not every DOF is recorded".to_owned()));
    }
    let path = folder.join("resolved.toml");
    if !path.exists() {
        return Err(because("resolved.toml is missing".to_owned()));
    }
    let loaded = config::load_recorded(&path).map_err(|e| {
        because(format!(
            "resolved.toml cannot be read again ({})",
            first_line(&e.to_string())
        ))
    })?;
    let prepared = setup::build_rehearsal(&loaded).map_err(|e| {
        because(format!(
            "the test cannot be made again of resolved.toml ({})",
            first_line(&e.to_string())
        ))
    })?;
    let Side::Structure(numerical) = prepared.experiment.side else {
        return Err(Without::Structure);
    };
    let facts = prepared.facts.structure;
    let (analysis, no_margin) =
        facts.map_or((None, None), |facts| (facts.analysis, facts.no_margin));
    let Some(analysis) = analysis else {
        return Err(because("the structure is too large".to_owned()));
    };
    let is_absolute = numerical.excitation.is_absolute();
    let energetics = Energetics {
        structure: numerical.structure,
        excitation: numerical.excitation,
        analysis,
        steps: prepared.experiment.steps as usize,
    };
    Ok((energetics, is_absolute, no_margin))
}

impl Energetics {
    /// Motion of the ground at the steps from 0 to `last`, for each of its columns: displacement of the base where that moves,
    /// else accelerations.
    fn grounds(&self, last: u64) -> Vec<Vec<f64>> {
        let excitation = &self.excitation;
        let last = usize::try_from(last).unwrap_or(usize::MAX).min(self.steps);
        if excitation.has_base() {
            return vec![(0..=last).map(|step| excitation.base(step).0).collect()];
        }
        let all = excitation.grounds().iter();
        all.map(|ground| (0..=last).map(|step| ground.at(step)).collect())
            .collect()
    }

    /// The modes at rest, and the damping that delays of the specimens add.
    fn modes(&self) -> Result<Vec<Mode>, String> {
        let modes: Vec<Mode> = self
            .analysis
            .delayed_modes()
            .into_iter()
            .map(|mode| Mode {
                frequency_hz: mode.frequency / std::f64::consts::TAU,
                damping_ratio: mode.ratio,
                per_second: mode.per_second,
            })
            .collect();
        if modes.is_empty() {
            return Err("the structure has no real modes at rest".to_owned());
        }
        Ok(modes)
    }
}

impl Model for Energetics {
    fn dofs(&self) -> usize {
        self.structure.dofs()
    }

    fn load(&self, step: u64, out: &mut [f64]) {
        let step = usize::try_from(step).unwrap_or(usize::MAX).min(self.steps);
        self.excitation.load_into(step, out);
    }

    fn damping(&self, vel: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        self.structure.damping().subtract_product(vel, out);
        out.iter_mut().for_each(|force| *force = -*force);
    }

    fn restoring(&mut self, disp: &[f64], vel: &[f64], dt: f64, out: &mut [f64]) {
        out.fill(0.0);
        let still = Base {
            disp: 0.0,
            vel: 0.0,
        };
        self.structure.subtract_internal(disp, vel, still, dt, out);
        out.iter_mut().for_each(|force| *force = -*force);
    }

    fn kinetic(&self, vel: &[f64]) -> f64 {
        0.5 * self.structure.mass().quadratic(vel)
    }

    fn strain(&self, disp: &[f64]) -> f64 {
        self.analysis.strain_energy(disp)
    }
}
