//! From `[safety]` to how the loop begins and leaves.

use super::gear::Rows;
use super::{Refused, Site, path};
use gusset_config::{
    AxisTable, BoundSpec, ExitChoice, Finding, LimitsSpec, ShareSpec, SpecimenTable, TestFile,
    Time, ZeroChoice,
};
use gusset_control::engine::{InitialForce, Intake, Numerical, StartupSettings, TestLimits};
use gusset_control::port::limits::Bound;
use gusset_control::port::{Axis, Exit, Exits, Reference, Zero};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::AtAxis;

/// Default wall time in s over which sensors are averaged.
const ZERO_S: f64 = 0.2;

/// Wall time in s over which every sensor is read before anything moves; 0: not at all.
fn zero_s(file: &TestFile) -> f64 {
    let remote = file.specimen.iter().any(|specimen| specimen.link.is_some());
    let usual = if remote || is_relative(file) {
        ZERO_S
    } else {
        0.0
    };
    file.safety.zero_s.unwrap_or(usual)
}

/// How a test begins, with ticks of `period` seconds.
pub(super) fn opening(file: &TestFile, period: f64) -> StartupSettings {
    StartupSettings {
        zero_ticks: (zero_s(file) / period).ceil() as u32,
        confirm: confirms(file),
        ramp_s: file.safety.ramp_s,
        takes_force_drift: file.safety.resume_takes_force_drift,
        initial_forces: file.specimen.iter().map(initial_forces).collect(),
    }
}

/// Share of a specimen's yield force, or else of its limit, beyond which a force at t = 0 is warned about.
const INITIAL_SHARE: f64 = 0.01;

/// The largest force at t = 0 of each axis that is not warned about.
fn initial_forces(table: &SpecimenTable) -> Vec<InitialForce> {
    let axes = table.axes_by_itself();
    let limits = table.limits_of(axes);
    let of_axis = |(axis, limits): (usize, &LimitsSpec)| {
        let yields = table.stand_in().and_then(|(_, law)| law.yield_force(axis));
        let trip = limits.trip(Limit::MeasuredForce);
        let limit = trip.map(|levels| levels[0].abs().min(levels[1].abs()));
        let (of, force) = match (yields, limit.filter(|limit| limit.is_finite())) {
            (Some(force), _) => ("yield_force_n", force),
            (None, Some(force)) => ("measured_force_n", force),
            (None, None) => ("noise", 0.0),
        };
        InitialForce {
            of,
            most_n: INITIAL_SHARE * force,
        }
    };
    limits.iter().enumerate().map(of_axis).collect()
}

/// Root mean square of the noise that the load cells of each specimen are declared to have, in N at the specimen.
pub(super) fn force_noise_n(file: &TestFile, time: &Time) -> Vec<f64> {
    let tick = time.step.value() / f64::from(time.ticks_per_step);
    let noise = |specimen: &SpecimenTable| {
        let known = specimen.believed_transfer(1.0);
        known.map_or(0.0, |known| known.force_sensor.noise_rms(tick))
    };
    file.specimen.iter().map(noise).collect()
}

/// True if readings must be confirmed and exist.
fn confirms(file: &TestFile) -> bool {
    zero_s(file) > 0.0 && (file.safety.confirm || is_relative(file))
}

/// True if an operator must check the readings before anything moves.
pub(super) fn needs_confirmation(file: &TestFile) -> bool {
    !file.specimen.is_empty() && confirms(file)
}

fn is_relative(file: &TestFile) -> bool {
    let relative = |axis: &AxisTable| {
        axis.zero_disp == ZeroChoice::Relative || axis.zero_force == ZeroChoice::Relative
    };
    let mut axes = file.specimen.iter().flat_map(|specimen| &specimen.axis);
    axes.any(relative)
}

/// Largest structure whose steps are audited by default: the product with M_eff costs as much as the solve.
const AUDITED_DOFS: usize = 64;
/// Roundoff of a test stays below the first by far; no fault of a program is as small as the second.
const AUDIT: Bound = Bound {
    warn: 1e-9,
    trip: 1e-6,
};
/// In an ordinary test the rows without mass balance far better.
const UNBALANCE: Bound = Bound {
    warn: 1e-3,
    trip: 1e-2,
};
/// Beyond the stability margin a sawtooth may grow.
const STABILITY_USED: Bound = Bound {
    warn: 1.0,
    trip: f64::INFINITY,
};

/// Beyond its critical delay a test grows.
const DELAY_USED: Bound = Bound {
    warn: 1.0,
    trip: f64::INFINITY,
};

/// Levels of limits that belong to no specimen alone.
pub(super) fn test_limits(file: &TestFile, time: &Time) -> TestLimits {
    let (safety, timing) = (&file.safety, &file.timing);
    let or = |spec: Option<BoundSpec>, usual| spec.map_or(usual, Bound::of);
    // A count without a level is the largest number.
    let counts = |warn: Option<u64>, most: u64| {
        let level = |count: u64| match count {
            u64::MAX => f64::INFINITY,
            count => count as f64,
        };
        Bound {
            warn: level(warn.unwrap_or(most / 2)),
            trip: level(most),
        }
    };
    let (misses, share) = (&timing.misses, safety.added_energy_share);
    let ticks = time.steps.saturating_mul(u64::from(time.ticks_per_step));
    let window_ticks = timing.window_ticks(time.period.value());
    let most_in_window = timing.window_bound(window_ticks);
    let mut limits = TestLimits::NONE;
    limits.window_ticks = window_ticks;
    for limit in Limit::OF_TEST {
        let levels = match limit {
            Limit::StabilityUsed => or(safety.stability_used, STABILITY_USED),
            Limit::DelayUsed => or(safety.delay_used, DELAY_USED),
            Limit::StepAudit => or(safety.step_audit, AUDIT),
            Limit::StaticUnbalance => or(safety.static_unbalance, UNBALANCE),
            Limit::AddedEnergyShare => or(share.map(ShareSpec::levels), Bound::NONE),
            Limit::MissesInARow => counts(misses.in_a_row.warn, misses.max_in_a_row()),
            Limit::MissesInWindow => counts(misses.in_window.warn, most_in_window),
            Limit::Misses => counts(misses.in_total.warn, timing.miss_bound(ticks)),
            _ => Bound::NONE,
        };
        limits.set(limit, levels);
    }
    limits
}

/// Warns of bounds of the test that are given but cannot trip in it.
pub(super) fn unkept(site: &mut Site<'_>, kept: &[Limit]) {
    let safety = &site.loaded.file.safety;
    for (quantity, given, why) in [
        (
            Limit::StabilityUsed,
            safety.stability_used.is_some(),
            "it needs a proof of stability, and this test has no proof",
        ),
        (
            Limit::StepAudit,
            safety.step_audit.is_some(),
            "the step audit needs the method \"gui\"",
        ),
        (
            Limit::StaticUnbalance,
            safety.static_unbalance.is_some(),
            "every degree of freedom of the structure has mass, or the method is not \"gui\"",
        ),
    ] {
        if given && !kept.contains(&quantity) {
            let at = path("safety").key(quantity.key());
            let headline = format!("`{at}` has no effect: it cannot trip in this test");
            site.warnings
                .push(Finding::warning(at, headline).at_key().label(why));
        }
    }
}

/// Whether the steps of a structure of `dofs` degrees of freedom are audited.
pub(super) fn audits(file: &TestFile, dofs: usize) -> bool {
    file.safety.step_audit.is_some() || dofs <= AUDITED_DOFS
}

/// The structure with an account of the energy that it takes in, if the test limits the added energy.
pub(super) fn counted(file: &TestFile, numerical: Numerical) -> Numerical {
    let Some(share) = file.safety.added_energy_share else {
        return numerical;
    };
    let structure = &numerical.structure;
    let influence = if numerical.excitation.has_base() {
        structure.influence().to_vec()
    } else {
        Vec::new()
    };
    let intake = Intake::new(structure.dofs(), influence, share.floor_j);
    numerical.counted(intake)
}

/// Channels that take their zero from their reading.
pub(super) fn references(table: &SpecimenTable, axes: usize) -> Vec<Reference> {
    let zero = |choice| match choice {
        ZeroChoice::Absolute => Zero::Absolute,
        ZeroChoice::Relative => Zero::Relative,
    };
    (0..axes)
        .map(|index| {
            let gear = table.axis.get(index).cloned().unwrap_or_default();
            Reference {
                disp: zero(gear.zero_disp),
                force: zero(gear.zero_force),
            }
        })
        .collect()
}

/// End positions of a specimen whose axes have these metres per unit and this k̂ in N/m.
pub(super) fn exits(
    site: &mut Site<'_>,
    index: usize,
    metres: &[f64],
    stiffness: &[f64],
) -> Result<Exits, Refused> {
    let safety = &site.loaded.file.safety;
    for (key, choice) in [("on_trip", safety.on_trip), ("at_end", safety.at_end)] {
        let unknown = stiffness.iter().position(|k| !(*k > 0.0 && k.is_finite()));
        if let (ExitChoice::ZeroForce, Some(axis)) = (choice, unknown) {
            let name = site
                .loaded
                .file
                .specimen
                .get(index)
                .map(|table| &table.name);
            let text = format!(
                "unloading to zero force needs a stiffness, and specimen \"{}\" has no stiffness on axis {}",
                name.map_or("", String::as_str),
                axis + 1
            );
            let finding = Finding::error(path("safety").key(key), text)
                .label("the distance and direction to zero force are unknown")
                .help(
                    "give `stiffness_n_per_m` of the specimen, or use \"freeze\", which holds it",
                );
            return site.refuse(finding);
        }
    }
    let safe = site
        .loaded
        .file
        .specimen
        .get(index)
        .and_then(|table| table.safe_disp_m.as_deref());
    if let Some(safe) = safe
        && safe.len() != metres.len()
    {
        let text = format!(
            "{} displacements for a specimen with {} axes",
            safe.len(),
            metres.len()
        );
        let at = path("specimen").index(index).key("safe_disp_m");
        return site.refuse(Finding::error(at, text));
    }
    let exit = |choice| match choice {
        ExitChoice::Freeze => Exit::Freeze,
        ExitChoice::ZeroForce => Exit::ZeroForce,
        ExitChoice::ZeroDisplacement => Exit::ZeroDisp,
        ExitChoice::SafeDisplacement => {
            let axes = safe.unwrap_or_default().iter().zip(metres);
            Exit::Safe(AtAxis(axes.map(|(disp, metres)| disp / metres).collect()))
        }
    };
    Ok(Exits {
        comes_to_rest: site.loaded.file.specimen.get(index).is_some_and(|table| {
            let axes = table.bus.iter().flat_map(|bus| &bus.axis);
            axes.into_iter().any(|axis| axis.drive.is_some())
        }),
        on_trip: exit(safety.on_trip),
        at_end: exit(safety.at_end),
        // Only "freeze" does without; that was checked.
        speed: safety.exit_speed_m_per_s.unwrap_or(0.0),
    })
}

/// Warns if a specimen's force at its safe position after a trip exceeds its limit or the capacity of its rig, by k̂ (by
/// rows). A return move at the end is rehearsed. `units` are metres and newtons per unit of each axis.
pub(super) fn warn_of_force(
    site: &mut Site<'_>,
    index: usize,
    axes: &[Axis],
    units: &[(f64, f64)],
    stiffness: &Rows,
) {
    let file = &site.loaded.file;
    let Some(table) = file.specimen.get(index) else {
        return;
    };
    let relative = |axis: &AxisTable| axis.zero_disp == ZeroChoice::Relative;
    let (ExitChoice::SafeDisplacement, Some(safe)) = (file.safety.on_trip, &table.safe_disp_m)
    else {
        return;
    };
    // Where an axis takes its zero from its reading, its deformation there is not known.
    if table.axis.iter().any(relative) {
        return;
    }
    let deformed = safe.iter().zip(axes).zip(units);
    let deformed: Vec<f64> = deformed
        .map(|((disp, axis), (metres, _))| axis.deformation(AtAxis(disp / metres)).0)
        .collect();
    let at = path("specimen").index(index);
    let limits = table.limits_of(axes.len());
    let most = table.capacity.and_then(|capacity| capacity.force_n);
    let mut warnings = Vec::new();
    for (number, ((axis, (_, newtons)), row)) in axes.iter().zip(units).zip(stiffness).enumerate() {
        let force: f64 = row.iter().zip(&deformed).map(|(k, d)| k * d).sum();
        let force = force * newtons / axis.force_gain;
        let trip = limits
            .get(number)
            .and_then(|limits| limits.trip(Limit::MeasuredForce));
        let is_within = |[low, high]: [f64; 2]| low <= force && force <= high;
        let beyond = match (trip, most) {
            (Some(range), _) if !is_within(range) => "this limit trips first",
            (_, Some(most)) if !is_within([-most, most]) => "the rig cannot apply this force",
            _ => continue,
        };
        let text = format!(
            "at its `safe_disp_m`, axis {} of specimen \"{}\" carries {force:.1} N by its initial stiffness",
            number + 1,
            table.name
        );
        let finding = Finding::warning(at.key("safe_disp_m"), text).label(beyond);
        warnings.push(finding.beside(path("safety").key("on_trip"), "after a trip it moves there"));
    }
    site.warnings.extend(warnings);
}
