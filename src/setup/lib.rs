//! From a file that has been read and checked to something that can run: the experiment of a test, or the specimen of a server.
//!
//! This module judges everything that needs more than the words of the file. It reads the files that the test names, makes laws and
//! matrices, chooses λ, and translates each table into the settings of the module that uses it. A mistake becomes a [`Finding`]
//! at its place in the file. Nothing moves here, nothing is connected and nothing is written.
//!
//! [`build`] makes the experiment, [`build_rehearsal`] the same experiment without its links. [`load_served`] makes the specimen
//! that `gusset serve` offers.
//!
//! This member is the only one that knows both the file and the controller. Begin reading with [`build`].

#[cfg(feature = "ethercat")]
mod bus;
#[cfg(feature = "ethercat")]
mod bus_line;
mod case;
mod excitation;
mod facts;
mod frames;
mod gateway;
mod gear;
mod ground;
mod held;
mod histories;
mod ideal;
#[cfg(feature = "ethercat")]
mod lent_bus;
mod limits;
mod links;
mod margin;
mod method;
mod pace;
mod plausible;
mod prescribed;
mod proof;
mod recorded;
mod reduced;
mod reduction;
mod remote;
mod safety;
mod served;
mod served_limits;
mod settle;
mod site;
mod specimens;
mod speed;
mod structure;
mod supports;
mod trial;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

#[cfg(feature = "ethercat")]
pub use bus::{bus_of, bus_source};
#[cfg(feature = "ethercat")]
pub use bus_line::open as open_bus_line;
pub use facts::{Facts, FrameFacts, GroundFacts, ReductionFacts, RuleDamping, StructureFacts};
pub use gateway::position_reader;
use gear::Rows;
use gusset_config::{ConfigError, Diagnostics, Finding, KeyPath, Loaded, SpecimenTable, TestFile};
use gusset_control::engine::{Experiment, Numerical, Side, StaticLoad, StepAudit};
use gusset_link::{NativeSetup, Transport};
use gusset_proof::{Analysis, AtRest, Kind, Matrices, Stability};
use gusset_record::rt;
pub use held::Held;
pub use ideal::{Ideal, IdealCourse, NoCourse, build_ideal};
use method::Initial;
pub use pace::{rt_plan, set_divergence};
use recorded::{record_dofs, rotations};
pub use served::{Served, load_served, load_served_record, openfresco_role};
pub use served_limits::{ServedLimit, served_limits};
use settle::settle;
use site::{Refused, Site, path};
use specimens::Specimens;
pub use speed::speed_ratio;
pub use trial::{Drawn, Trial};

/// A test that is ready to run.
#[derive(Debug)]
pub struct Prepared {
    /// Input of the loop.
    pub experiment: Experiment,
    /// Facts about the experiment before it runs.
    pub facts: Facts,
    /// Files that the run folder archives.
    pub files: Files,
    /// The warnings of the facts, with their places in the file.
    pub warnings: Diagnostics,
    /// Findings of stability that the build made, with their kinds: its verdict weighs them.
    pub doubts: Vec<(Kind, Finding)>,
    /// Its test file; `None` for a trial, and for a loop that has no file.
    pub loaded: Option<Box<Loaded>>,
}

/// Files that the run folder archives.
#[derive(Debug, Clone)]
pub struct Files {
    /// The test file, byte for byte.
    pub test: Vec<u8>,
    /// The complete configuration.
    pub resolved: String,
    /// Path and bytes of every file that the test read.
    pub inputs: Vec<(PathBuf, Vec<u8>)>,
    /// Where a resumed test comes from: the folder to keep, and the text of `resumed.json`.
    pub origin: Option<(PathBuf, String)>,
}

/// Makes the experiment that a test file describes.
///
/// # Errors
/// [`ConfigError::Invalid`] with everything that was found wrong before the build had to give up.
pub fn build(loaded: &Loaded) -> Result<Prepared, ConfigError> {
    build_as(loaded, None, None)
}

/// Builds the experiment without its links: the declared stand-in replaces each specimen behind one. Nothing else is
/// different.
///
/// # Errors
/// As [`build`].
pub fn build_rehearsal(loaded: &Loaded) -> Result<Prepared, ConfigError> {
    build_trial(loaded, &trial::NOMINAL)
}

/// Makes the rehearsal with specimens behind links that move at the velocities of the test. `None` if no force differs by
/// that.
///
/// # Errors
/// As [`build`].
pub fn build_at_test_speed(loaded: &Loaded) -> Result<Option<Prepared>, ConfigError> {
    let tables = &loaded.file.specimen;
    let is_slowed = |table| speed_ratio(loaded, table).is_some();
    let trial = Trial {
        at_test_speed: true,
        ..Trial::default()
    };
    let built = || build_trial(loaded, &trial);
    tables.iter().any(is_slowed).then(built).transpose()
}

/// Builds the experiment with the draws of one rehearsal.
///
/// # Errors
/// As [`build`].
pub fn build_trial(loaded: &Loaded, trial: &Trial) -> Result<Prepared, ConfigError> {
    build_as(loaded, Some(trial), None)
}

/// The controller's estimate of a specimen, by rows, at the structure's scale.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// k̂ in N/m.
    pub stiffness: Vec<Vec<f64>>,
    /// ĉ in N s/m.
    pub damping: Vec<Vec<f64>>,
    /// Part of ĉ that acts around rest only, in N s/m.
    pub rest_damping: Vec<Vec<f64>>,
    /// Stiffness before anything moves, in N/m: k̂ if it was given, else the tangent of the law, which is 0 for an open gap.
    pub stiffness_at_rest: Vec<Vec<f64>>,
    /// Damping before anything moves, in N s/m, or the reference of the law where that is less: 0 for a damper of a power
    /// beyond 1.
    pub damping_at_rest: Vec<Vec<f64>>,
}

/// The controller's estimates of all specimens.
///
/// # Errors
/// As [`build`].
pub fn estimates(loaded: &Loaded) -> Result<Vec<Estimate>, ConfigError> {
    site::build(loaded, Some(&trial::NOMINAL), None, |site| {
        Ok(specimens::specimens(site)?.estimates())
    })
}

/// Makes the transport of a link of our protocol, instead of a connection.
pub type Dial<'a> = dyn FnMut(&NativeSetup) -> Box<dyn Transport> + 'a;

/// Builds the experiment with links over transports that are connected already: those that `dial` makes, one after the
/// other.
///
/// # Errors
/// As [`build`].
#[cfg(any(test, feature = "test-doubles"))]
pub fn build_over<'a>(loaded: &'a Loaded, dial: &'a mut Dial<'a>) -> Result<Prepared, ConfigError> {
    build_as(loaded, None, Some(dial))
}

/// The devices of a test file on the simulated clock, with the stand-ins of its specimens and the faults of a script.
///
/// # Errors
/// As `build`; or the script does not fit the devices.
#[cfg(feature = "ethercat")]
pub fn simulated_bus(
    loaded: &Loaded,
    faults: Vec<gusset_ethercat::simulated::Fault>,
) -> Result<gusset_ethercat::simulated::SimulatedBus, ConfigError> {
    use gusset_ethercat::simulated::SimulatedBus;
    site::build(loaded, None, None, |site| {
        specimens::specimens(site)?;
        let Some(draft) = &site.bus else {
            return site.refuse(Finding::error(path("bus"), "no specimen is on a bus"));
        };
        let plants = draft.plants.lock().map(|mut all| std::mem::take(&mut *all));
        let bus = SimulatedBus::new(draft.shared.plan(), plants.unwrap_or_default(), faults);
        bus.or_else(|error| site.refuse(Finding::error(path("bus"), error.to_string())))
    })
}

/// Builds the experiment on the simulated clock with the faults of a script on its bus.
///
/// # Errors
/// As [`build`].
#[cfg(all(any(test, feature = "test-doubles"), feature = "ethercat"))]
pub fn build_with_bus_faults(
    loaded: &Loaded,
    faults: Vec<gusset_ethercat::simulated::Fault>,
) -> Result<Prepared, ConfigError> {
    site::build(loaded, None, None, |site| {
        site.bus_faults = faults;
        assemble(site)
    })
}

fn build_as<'a>(
    loaded: &'a Loaded,
    trial: Option<&'a Trial>,
    dial: Option<&'a mut Dial<'a>>,
) -> Result<Prepared, ConfigError> {
    site::build(loaded, trial, dial, assemble)
}

fn assemble(site: &mut Site<'_>) -> Result<Prepared, Refused> {
    let file = &site.loaded.file;
    // A rehearsal has no real-time thread.
    if site.trial.is_none()
        && let Err(text) = file.timing.check_cpu(&rt::os::process_cpus())
    {
        return site.refuse(Finding::error(path("timing").key("cpu"), text));
    }
    let mut specimens = specimens::specimens(site)?;
    let (side, settling, mut structure) = match &file.structure {
        Some(_) => {
            let (mut numerical, settling, mut facts) = numerical(site, &mut specimens)?;
            if let Some(frame) = &mut facts.frame {
                frame.share_of_tick = frames::share_of_tick(site, &mut numerical)?;
            }
            (Side::Structure(Box::new(numerical)), settling, Some(facts))
        }
        None => (
            Side::Prescribed(prescribed::prescribed(site, &specimens)?),
            None,
            None,
        ),
    };
    let dofs = structure
        .as_ref()
        .map_or(0, |facts: &StructureFacts| facts.dofs);
    let record_dofs = record_dofs(site, dofs, &specimens)?;
    let rotations = structure.as_ref().map(|facts| facts.rotations.clone());
    let names = specimens.names();
    let gains = structure
        .as_mut()
        .map(|facts| std::mem::take(&mut facts.gains));
    let gains = gains.unwrap_or_default();
    let mut specs = specimens.into_specs(site, dofs, settling.is_some(), gains)?;
    margin::watched(site, structure.as_mut(), &mut specs)?;
    let ports = specimens::build(site, specs)?;
    let time = site.loaded.time;
    let kept = gusset_control::engine::kept_limits(&side, &ports);
    if structure.is_some() && !names.is_empty() {
        safety::unkept(site, &kept);
    }
    let found = site.warnings.drain(..);
    let found = found.map(|finding| site.loaded.locator.diagnose(finding));
    let warnings: Vec<_> = site.loaded.warnings.iter().cloned().chain(found).collect();
    let of_loop = pace::limits(file, time);
    let facts = Facts {
        limits: limits::facts(file, &time, &ports, &of_loop, &kept),
        title: file.title.clone(),
        about: file.about.as_json(),
        dt: time.step.value(),
        steps: time.steps,
        rate_hz: time.period.inverse().value(),
        ticks_per_step: time.ticks_per_step,
        clock: time.clock,
        structure,
        specimens: names,
        units: file.specimen.iter().map(SpecimenTable::units).collect(),
        scaled: (file.specimen.iter())
            .filter(|table| table.is_scaled())
            .map(|table| table.name.clone())
            .collect(),
        timing: file.timing.clone(),
        record_required: file.record.required,
        queue_s: file.record.queue_s,
        resume_within: file.safety.resume_within_m,
        resume_within_n: file.safety.resume_within_n,
        force_noise_n: safety::force_noise_n(file, &time),
        resumed: None,
        announced: announced(file),
        moved: moved(file),
        records: std::mem::take(&mut site.records),
        corrected: std::mem::take(&mut site.corrected),
        confirm: safety::needs_confirmation(file),
        warnings: warnings.iter().map(|w| w.headline.clone()).collect(),
        accepted: BTreeMap::new(),
    };
    let mut named = links::with_keys_from_anywhere(file, &site.loaded.path);
    if let Some(share) = facts.structure.as_ref().and_then(|s| s.rest_damping_share) {
        named.integrator.rest_damping_share = Some(share);
    }
    let reduce = named
        .structure
        .as_mut()
        .and_then(|table| table.reduce.as_mut());
    if let (Some(reduce), Some(reduced)) = (reduce, &site.reduced) {
        reduce.keep.clone_from(&reduced.keep);
    }
    let resolved = gusset_config::resolve(&named, facts.lambda(), &site.inputs)
        .or_else(|error| site.refuse(Finding::error(KeyPath::root(), error.to_string())))?;
    let inputs = site.inputs.files().iter();
    let inputs = inputs
        .map(|input| (PathBuf::from(&input.name), input.bytes.clone()))
        .collect();
    let files = Files {
        test: site.loaded.text.clone().into_bytes(),
        resolved,
        inputs,
        origin: None,
    };
    let experiment = Experiment {
        dt: facts.dt,
        period: time.period,
        steps: time.steps,
        side,
        opening: safety::opening(file, time.period.value()),
        settling,
        ports,
        record_dofs,
        rotations: rotations.unwrap_or_default(),
        limits: of_loop,
        pacing: pace::pacing(file, time),
        resume: None,
        retraces: false,
        #[cfg(feature = "ethercat")]
        followed: bus::followed(site),
        #[cfg(not(feature = "ethercat"))]
        followed: None,
    };
    Ok(Prepared {
        experiment,
        facts,
        files,
        warnings: Diagnostics(warnings),
        doubts: std::mem::take(&mut site.doubts),
        loaded: site.trial.is_none().then(|| Box::new(site.loaded.clone())),
    })
}

/// Motions before the test, in sentences.
fn announced(file: &TestFile) -> Vec<String> {
    let probed = file.specimen.iter().filter_map(|specimen| {
        let metres = specimen.link.as_ref()?.probe_m?;
        Some(format!(
            "wiring check before the test: specimen \"{}\" moves by {} mm and back, one axis after another",
            specimen.name,
            1e3 * metres
        ))
    });
    let untried = (file.time.clock != gusset_config::ClockChoice::Simulated
        && file.specimen.iter().any(|specimen| specimen.bus.is_some()))
    .then(|| {
        "a bus: Gusset was never tried on an EtherCAT bus with real devices (guide: ethercat)"
            .to_owned()
    });
    probed.chain(untried).collect()
}

/// Specimens behind links that have a law, too, in sentences: a test may have been meant for the law alone.
fn moved(file: &TestFile) -> Vec<String> {
    let is_simulated = file.time.clock == gusset_config::ClockChoice::Simulated;
    let with_law = file.specimen.iter().filter_map(|specimen| {
        if is_simulated && specimen.bus.is_some() {
            return None;
        }
        let (link, (key, _)) = (specimen.link.as_ref()?, specimen.stand_in()?);
        Some(format!(
            "specimen \"{}\" is behind the link to {} and will move; its `{key}` is used in rehearsals only",
            specimen.name, link.address
        ))
    });
    with_law.collect()
}

/// The numerical side: structure, loads, integrator, initial state, and the static load before t = 0.
fn numerical(
    site: &mut Site<'_>,
    specimens: &mut Specimens,
) -> Result<(Numerical, Option<StaticLoad>, StructureFacts), Refused> {
    let mut structure = structure::structure(site, specimens)?;
    let n = structure.dofs();
    let dt = site.loaded.time.step.value();
    let initial_stiffness = structure
        .reference_stiffness()
        .plus(1.0, &specimens.stiffness(n));
    let (initial_damping, rest_damping_share) =
        proof::damping(site, &structure, specimens, &initial_stiffness);
    let specimens = &*specimens;
    let at_rest = structure
        .stiffness_at_rest()
        .plus(1.0, &specimens.stiffness_at_rest(n));
    structure::definite(site, &structure, [&at_rest, &initial_stiffness])?;
    let damping_at_rest = structure
        .damping_at_rest()
        .plus(1.0, &specimens.damping_at_rest(n));
    structure::dissipative(site, &structure, [&damping_at_rest, &initial_damping])?;
    let frequencies = match specimens.late_mass(n) {
        Some(late) => structure::frequencies(&at_rest, &structure.mass().plus(1.0, &late)),
        None => structure::frequencies(&at_rest, structure.mass()),
    };
    plausible::check(site, specimens);
    let method = site.loaded.file.integrator.method;
    let initial = Initial {
        damping: &initial_damping,
        stiffness: &initial_stiffness,
        dt,
    };
    let mut of_companion = Stability::NoProof;
    let (mut proof, stepper, storage, condition, audit) =
        match method::companion(site, &structure, &initial)? {
            Some((stepper, condition)) => {
                proof::warn_of_limit(site, &structure, specimens, method);
                of_companion = proof::of_alpha(site, &structure, specimens, method, &initial);
                (None, stepper, None, condition, None)
            }
            None => {
                let proof = proof::choose(site, &structure, specimens, &initial)?;
                let massless = proof::massless(site, &structure, specimens, dt)?;
                let (stepper, storage, condition) =
                    method::family(site, &structure, &initial, proof.lambda, massless)?;
                let audit = safety::audits(&site.loaded.file, n).then(|| {
                    let mass = initial.effective_mass(structure.mass(), proof.lambda);
                    let massless = structure.massless();
                    StepAudit::new(mass, &massless, site.loaded.time.step.value())
                });
                (Some(proof), stepper, Some(storage), Some(condition), audit)
            }
        };
    if let Some(condition) = condition {
        method::warn_of_digits(site, condition);
    }
    let (excitation, loads) =
        excitation::excitation(site, &structure, specimens, &initial_stiffness)?;
    let given = loads.as_ref().map(|[given, _]| &given[..]);
    let frame = frames::facts(site, given, &specimens.stiffness_at_rest(n))?;
    let settling = match loads {
        Some([_, load]) => Some(settle(
            site,
            load,
            &initial_stiffness,
            proof
                .as_ref()
                .and_then(|proof| proof.stiffness_bound.as_ref()),
        )?),
        None => None,
    };
    let state = structure::initial_state(site, &mut structure, &at_rest)?;
    let reduction = site.reduced.as_ref().map(|one| ReductionFacts {
        reduction: Arc::clone(&one.reduction),
        named: one.named,
        modes: one.modes(),
        at_rest: at_rest.clone(),
        mass: match specimens.late_mass(n) {
            Some(late) => structure.mass().plus(1.0, &late),
            None => structure.mass().clone(),
        },
        grounds: one.grounds.clone(),
    });
    let matrices = Matrices {
        mass: structure.mass().clone(),
        at_rest: AtRest {
            stiffness: at_rest,
            damping: damping_at_rest,
        },
        stiffness: initial_stiffness.clone(),
        damping: initial_damping.clone(),
        massless: structure::followed(method, &structure),
    };
    let analysis = Analysis::new(
        matrices,
        specimens.attached(),
        proof.as_ref().map(|proof| (dt, proof.lambda)),
    );
    let grounds = excitation.grounds().iter();
    let grounds: Vec<GroundFacts> = grounds.map(GroundFacts::of).collect();
    let rotations = rotations(site, n)?;
    let facts = StructureFacts {
        dofs: n,
        rule_damping: structure::rule_damping(site, &structure, specimens, &rotations),
        rotations,
        places: match &site.reduced {
            Some(one) => one.places(),
            None => frames::places(site),
        },
        frame,
        reduction,
        method,
        storage,
        reciprocal_condition: condition,
        lambda: proof.as_ref().map(|proof| proof.lambda),
        rest_damping_share,
        lambda_by_number: proof.as_ref().is_some_and(|proof| proof.by_number),
        gain: proof.as_ref().map_or(f64::INFINITY, |proof| proof.gain),
        gains: proof
            .as_mut()
            .map(|proof| std::mem::take(&mut proof.gains))
            .unwrap_or_default(),
        online_limit: proof.as_mut().and_then(|proof| proof.online.take()),
        stability: proof.map_or(of_companion, |proof| proof.stability),
        frequencies,
        analysis,
        no_margin: None,
        peak_nodal_force: excitation.peak_of_table(),
        peak_ground_accel: grounds.iter().map(|ground| ground.peak).reduce(f64::max),
        grounds,
        scaled: site.scaled.take(),
    };
    plausible::units(site, specimens, &facts);
    let accel = gusset_numerics::model::Acceleration::new(structure.mass());
    let accel = accel.or_else(|error| {
        let at = structure::mass_of(site, error.dof);
        site.refuse(Finding::error(at, format!("the mass matrix is {error}")))
    })?;
    let numerical = Numerical::new(structure, accel, excitation, stepper, state);
    let numerical = match audit {
        Some(audit) => numerical.audited(audit),
        None => numerical,
    };
    let numerical = safety::counted(&site.loaded.file, numerical);
    Ok((numerical, settling, facts))
}

#[cfg(test)]
mod tests;
