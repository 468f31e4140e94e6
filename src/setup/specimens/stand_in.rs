//! Stand-ins of specimens in a rehearsal, and laws behind simulated actuators.

use super::super::trial::Drawn;
use super::super::{Refused, Rows, Site};
use super::loading::offsets;
use super::{Stand, compensation};
use gusset_actuator::specimen::{CoupledSpec, Mounted, Specimen, Stiffened};
use gusset_actuator::transfer::{ActuatorSpec, ProportionalSpec, Transfer, TransferSpec};
use gusset_config::{KeyPath, SpecimenTable};
use gusset_control::port::Axis;

/// The law as drawn, mounted off the zero of its axes by `offsets` (m, N), behind the actuator and the sensors of its table,
/// if any.
pub(super) fn behind_transfer(
    site: &mut Site<'_>,
    at: &KeyPath,
    spec: Option<&TransferSpec>,
    law: Box<dyn Specimen>,
    (offsets, drawn): (&[(f64, f64)], &Drawn),
) -> Result<Box<dyn Specimen>, Refused> {
    let law = if drawn.stiffness == 1.0 {
        law
    } else {
        Box::new(Stiffened::new(law, drawn.stiffness))
    };
    // Outside: a stiffer specimen is at the same place as a softer one.
    let law = Mounted::around(law, offsets);
    let Some(spec) = spec else {
        return Ok(law);
    };
    let time = site.loaded.time;
    if let Some(finding) = compensation::slower_time(at, time) {
        return site.refuse(finding);
    }
    let spec = drawn_transfer(spec, drawn);
    let transfer = Transfer::new(&spec, law, Some(compensation::test_time(time)));
    let mut transfer = transfer.or_else(|error| site.refuse_key(at, error.key(), &error))?;
    transfer.commanded_every(time.period.value());
    Ok(Box::new(transfer))
}

fn drawn_transfer(spec: &TransferSpec, drawn: &Drawn) -> TransferSpec {
    let mut spec = spec.clone();
    // A drawn delay cannot become negative; a negative delay in the file is refused at its key.
    if drawn.delay_s != 0.0 {
        spec.delay_s = (spec.delay_s + drawn.delay_s).max(0.0);
    }
    spec.seed = drawn.seed.unwrap_or(spec.seed);
    match &mut spec.actuator {
        None if drawn.gain == 1.0 => {}
        None => {
            let gain = drawn.gain;
            spec.actuator = Some(ActuatorSpec::Proportional(ProportionalSpec { gain }));
        }
        Some(ActuatorSpec::Proportional(own)) => own.gain *= drawn.gain,
        Some(ActuatorSpec::FirstOrder(own)) => own.gain *= drawn.gain,
        Some(ActuatorSpec::SecondOrder(own)) => own.gain *= drawn.gain,
        Some(ActuatorSpec::ServoHydraulic(own)) => own.gain *= drawn.gain,
    }
    spec
}

/// Known properties of a specimen behind a link.
pub(super) struct Known<'a> {
    pub table: &'a SpecimenTable,
    pub axes: &'a [Axis],
    pub units: &'a [(f64, f64)],
    /// The file's stiffness, with its draws.
    pub stiffness: &'a Rows,
    pub damping: &'a Rows,
    /// Whether the controller's estimate is the same.
    pub is_believed: bool,
}

/// The load of a simulated bus: the stand-in as declared, without the delay of the bus, which is there already.
#[cfg(feature = "ethercat")]
pub(super) fn plant(
    site: &mut Site<'_>,
    at: &KeyPath,
    known: &Known<'_>,
    law: Option<Box<dyn Specimen>>,
) -> Result<Option<Box<dyn Specimen>>, Refused> {
    let stand = stand_in(site, at, known, law, &Drawn::default())?;
    Ok(match stand {
        Stand::Law(law) => Some(law),
        _ => None,
    })
}

/// The stand-in of a specimen behind a link: `law` as declared, else a linear one; behind its estimated actuator.
pub(super) fn stand_in(
    site: &mut Site<'_>,
    at: &KeyPath,
    known: &Known<'_>,
    law: Option<Box<dyn Specimen>>,
    drawn: &Drawn,
) -> Result<Stand, Refused> {
    let time = site.loaded.time;
    // The identified delays are wall time; a slower test sees less of them.
    let pace = compensation::test_time(time) / time.period.value();
    let tick = compensation::test_time(time);
    let transfer = match site.trial {
        // Even an actuator without lag answers a tick later where inputs are read with the outputs.
        Some(trial) if !trial.ideal => {
            let late = known.table.answers_late().then(|| TransferSpec {
                delay_s: tick,
                ..TransferSpec::default()
            });
            known.table.transfer_in_the_loop(pace, tick).or(late)
        }
        _ => known.table.believed_transfer(pace),
    };
    if law.is_none() && transfer.is_none() && drawn.stiffness == 1.0 && known.is_believed {
        return Ok(Stand::LinearStandIn);
    }
    let law = match law {
        Some(law) => law,
        None => {
            let n = known.axes.len();
            let linear = CoupledSpec {
                stiffness_n_per_m: unscaled(known, known.stiffness, |axis| axis.disp_gain),
                damping_n_s_per_m: Some(unscaled(known, known.damping, |axis| axis.vel_gain)),
                mass_kg: None,
            };
            let linear = linear.build(n);
            let linear = linear.or_else(|error| site.refuse_key(at, error.key(), &error))?;
            Box::new(linear) as Box<dyn Specimen>
        }
    };
    let key = if known.table.transfer.is_some() {
        "transfer"
    } else {
        "identified"
    };
    let spec = transfer.as_ref();
    let offsets = offsets(known.table, known.axes.len());
    behind_transfer(site, &at.key(key), spec, law, (&offsets, drawn)).map(Stand::Law)
}

/// A matrix of the structure's side as the law sees it, the inverse of `scaled`.
fn unscaled(known: &Known<'_>, rows: &Rows, motion: fn(&Axis) -> f64) -> Rows {
    let n = known.axes.len();
    let value = |i: usize, j: usize| {
        let (force, moved) = (
            known.axes[i].force_gain / known.units[i].1,
            motion(&known.axes[j]) * known.units[j].0,
        );
        rows[i][j] / (force * moved)
    };
    (0..n)
        .map(|i| (0..n).map(|j| value(i, j)).collect())
        .collect()
}
