//! A specimen of a test file: its law or link, its rows of B, its estimates and bounds.

use nalgebra::DMatrix;

use super::super::gear::{Rows, axis, scaled};
use super::super::{Estimate, Refused, Site, bus, frames, links, path, speed};
use super::loading::{at_actuators, behind_actuators, loading, offsets, own_offsets};
use super::{Entry, Stand, order, rest, stand_in};
use gusset_actuator::specimen::{Specimen, SpecimenLaw};
use gusset_config::echo::number;
use gusset_config::{
    Finding, KeyPath, LinkSpec, Loaded, MatrixValue, Protocol, SpecimenTable, StructureTable,
};
use gusset_control::port::LoadingUnitSpec;
use gusset_control::port::{Axis, shares};
use gusset_numerics::law::Reach;
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::model::BuildError;
use gusset_numerics::spectral::delay::Weights;
use gusset_proof::Kind;
use gusset_quantity::units::{compared, quantity};

/// A ratio of an estimate to the known value, or its inverse, that must be a mistake.
const FAR: f64 = 10.0;

/// Everything that is known of one specimen.
pub(super) fn entry(
    site: &mut Site<'_>,
    number: usize,
    table: &SpecimenTable,
) -> Result<Entry, Refused> {
    let at = &path("specimen").index(number);
    let drawn = site
        .trial
        .and_then(|trial| trial.specimens.get(number).copied());
    let drawn = drawn.unwrap_or_default();
    let rows = rows(site, at, table)?;
    let (rows, loading) = loading(site, at, table, rows)?;
    let n = rows.len();
    let laws = loading.as_ref().map_or(n, |_| table.law_axes());
    let mut law = match (table.source(), &table.link) {
        (_, Some(_)) => None,
        (Some((key, source)), None) => {
            let mut law = built(site, at, table, (key, &source), laws)?;
            if site.trial.is_none() {
                rest::says_its_force(site, at, table, (key, law.as_mut()));
            }
            let (at, spec) = (at.key("transfer"), table.transfer.as_ref());
            let offsets = own_offsets(table, n);
            let law = stand_in::behind_transfer(site, &at, spec, law, (&offsets, &drawn))?;
            Some(law)
        }
        (None, None) => {
            let text = "the specimen has neither a law nor a link";
            return site.refuse(Finding::error(at.clone(), text));
        }
    };
    let pace = speed::pace(site, table);
    if site.trial.is_none() {
        site.doubts
            .extend(speed::of_test(site.loaded, table, at).map(|found| (Kind::Speed, found)));
    }
    let mut axes = Vec::with_capacity(n);
    let mut units = Vec::with_capacity(n);
    let mut reach = Vec::with_capacity(n);
    for (index, row) in rows.into_iter().enumerate() {
        let gear = table.axis.get(index).cloned().unwrap_or_default();
        let (axis, to_si) = axis(table, &gear, row);
        // Motion of the law at its own scale when the structure moves as far as declared.
        let scale = gear.scale / table.similitude.length;
        reach.push(Reach {
            disp: table.reach_disp_m.map(|reach| reach * scale),
            vel: table
                .reach_vel_m_per_s
                .map(|reach| reach * scale * table.similitude.time),
        });
        axes.push(Axis {
            vel_gain: pace * axis.vel_gain,
            ..axis
        });
        units.push(to_si);
    }
    let (mut k, mut c, mut m) = (vec![0.0; n * n], vec![0.0; n * n], vec![0.0; n * n]);
    if let Some(law) = &law {
        law.reference(&mut k, &mut c, &mut m);
    }
    let scaled = |flat: &[f64], motion: fn(&Axis) -> f64| scaled(flat, &axes, &units, motion);
    let said_stiffness = match &table.stiffness_n_per_m {
        Some(given) => {
            let at = at.key("stiffness_n_per_m");
            let given = seen(table, &loading, estimate(site, &at, given, laws)?);
            if law.is_some() {
                let own = scaled(&k, |axis| axis.disp_gain);
                let help = "without this key the stiffness of the law is used";
                warn_of_distance(site, at, &given, &own, help);
            }
            given
        }
        None => scaled(&k, |axis| axis.disp_gain),
    };
    let said_damping = match &table.damping_n_s_per_m {
        Some(given) => {
            let mut given = estimate(site, &at.key("damping_n_s_per_m"), given, laws)?;
            for value in given.iter_mut().flatten() {
                *value *= pace;
            }
            seen(table, &loading, given)
        }
        None => scaled(&c, |axis| axis.vel_gain),
    };
    let mut mass = scaled(&m, |axis| axis.vel_gain * axis.vel_gain / axis.disp_gain);
    let mut mass_in_force = table.mass_in_force_kg;
    if site.trial.is_some_and(|trial| trial.ideal) {
        for (axis, row) in mass.iter_mut().enumerate() {
            row[axis] += mass_in_force;
        }
        mass_in_force = 0.0;
    }
    let mut estimate = Estimate {
        stiffness: said_stiffness.clone(),
        damping: said_damping.clone(),
        rest_damping: vec![vec![0.0; n]; n],
        stiffness_at_rest: said_stiffness.clone(),
        damping_at_rest: said_damping.clone(),
    };
    if let Some(known) = site.trial.and_then(|trial| trial.believed.get(number)) {
        // The drawn values are the truth, which the controller does not know.
        estimate.clone_from(known);
    } else if let Some(law) = &mut law {
        if table.damping_n_s_per_m.is_none() {
            law.rest_damping(&mut c);
            estimate.rest_damping = scaled(&c, |axis| axis.vel_gain);
        }
        let (still, mut force) = (vec![0.0; n], vec![0.0; n]);
        let stands: Vec<f64> = offsets(table, n).iter().map(|(disp, _)| *disp).collect();
        law.trial(&stands, &still, 0.0, &mut force);
        law.tangent(&mut k);
        law.tangent_damping(&mut c);
        law.revert();
        if table.stiffness_n_per_m.is_none() {
            estimate.stiffness_at_rest = scaled(&k, |axis| axis.disp_gain);
        }
        if table.damping_n_s_per_m.is_none() {
            estimate.damping_at_rest = scaled(&c, |axis| axis.vel_gain);
        }
    }
    let bounds = match &law {
        Some(law) => law.bound(&reach, &mut k, &mut c).map(|()| {
            (
                scaled(&k, |axis| axis.disp_gain),
                scaled(&c, |axis| axis.vel_gain),
            )
        }),
        None => {
            let ratio = table.hardening_bound.unwrap_or(1.0);
            let times = |row: &Vec<f64>| row.iter().map(|value| ratio * value).collect();
            let stiffness = estimate.stiffness.iter().map(times).collect();
            Ok((stiffness, estimate.damping.clone()))
        }
    };
    if let Ok((largest, _)) = &bounds {
        warn_of_identified(site, at, table, largest);
    }
    let stand_in = match table.stand_in() {
        Some((key, source)) => Some(built(site, at, table, (key, &source), laws)?),
        None => None,
    };
    if let (Some(law), true) = (&stand_in, table.stiffness_n_per_m.is_some()) {
        law.reference(&mut k, &mut c, &mut m);
        let own = scaled(&k, |axis| axis.disp_gain);
        let help = "this law is its stand-in in rehearsals";
        warn_of_distance(
            site,
            at.key("stiffness_n_per_m"),
            &said_stiffness,
            &own,
            help,
        );
    }
    let stand = match (law, &table.link) {
        (Some(law), _) => Stand::Law(law),
        (None, Some(_)) if site.trial.is_some() => {
            let known = stand_in::Known {
                table,
                axes: &axes,
                units: &units,
                stiffness: &said_stiffness,
                damping: &said_damping,
                is_believed: (&said_stiffness, &said_damping)
                    == (&estimate.stiffness, &estimate.damping),
            };
            stand_in::stand_in(site, at, &known, stand_in, &drawn)?
        }
        (None, Some(link)) if link.protocol == Protocol::Ethercat => {
            let plant = if bus::is_simulated(site.loaded) {
                let known = stand_in::Known {
                    table,
                    axes: &axes,
                    units: &units,
                    stiffness: &said_stiffness,
                    damping: &said_damping,
                    is_believed: false,
                };
                stand_in::plant(site, at, &known, stand_in)?
            } else {
                None
            };
            let (port, rules) = bus::on_bus(site, at, (table, link), &units, plant)?;
            Stand::Bus(Box::new(port), rules)
        }
        (None, Some(link)) if link.protocol == Protocol::Gusset => {
            let (native, rules) = links::native(site, at, table, link, n)?;
            Stand::Native(Box::new(native), rules)
        }
        (None, Some(link)) => {
            let (remote, rules) = links::openfresco(site, at, link, n)?;
            Stand::OpenFresco(Box::new(remote), rules)
        }
        // Refused above.
        (None, None) => return Err(Refused),
    };
    let ticks = ticks(site.loaded, table);
    Ok(Entry {
        name: table.name.clone(),
        stand,
        axes,
        loading,
        units,
        estimate,
        damped: table.damped.unwrap_or(false),
        mass,
        bounds,
        sawtooth: sawtooth(&ticks),
        ticks,
        mass_in_force,
    })
}

/// An estimate that is far from the initial stiffness of the law beside it, which is known, is probably a slip of the unit.
fn warn_of_distance(
    site: &mut Site<'_>,
    at: KeyPath,
    estimate: &Rows,
    law: &Rows,
    help: &'static str,
) {
    // The draws and the stand-in of a trial were judged with the file.
    if site.trial.is_some() {
        return;
    }
    let axes = estimate.iter().zip(law).enumerate();
    let ratios = axes.map(|(axis, (given, own))| given[axis] / own[axis]);
    // A law without an initial stiffness has no ratio.
    let far = |ratio: &f64| ratio.is_finite() && !(1.0 / FAR..=FAR).contains(ratio);
    if let Some((axis, ratio)) = ratios.enumerate().find(|(_, ratio)| far(ratio)) {
        let text = format!(
            "the stiffness estimate of axis {} is {} times the initial stiffness of its law",
            axis + 1,
            number(rest::rounded(ratio))
        );
        let finding = Finding::warning(at, text).label("K0 of the integrator uses this estimate");
        site.warnings.push(finding.help(help));
    }
}

/// Warns of a specimen behind a link that was identified as stiffer than the stability proof assumes. `largest` is the stiffness
/// that the proof allows. `identified` has the stiffness of the first axis.
fn warn_of_identified(site: &mut Site<'_>, at: &KeyPath, table: &SpecimenTable, largest: &Rows) {
    if site.trial.is_some() || table.link.is_none() {
        return;
    }
    let Some(identified) = &table.identified else {
        return;
    };
    let assumed = largest.first().and_then(|row| row.first());
    let (Some(found), Some(&assumed)) = (identified.stiffness_n_per_m, assumed) else {
        return;
    };
    let spread = identified.stiffness_std_n_per_m.unwrap_or(0.0);
    let is_stiffer = found - assumed > spread;
    if !is_stiffer {
        return;
    }
    let [measured, allowed] = compared(found, assumed, "N/m");
    let axis = if largest.len() > 1 { " of axis 1" } else { "" };
    let key = at.key("stiffness_n_per_m");
    let text = format!(
        "`identified.stiffness_n_per_m`{axis} is {measured} ± {}, but the stability proof assumes {allowed} at most",
        quantity(spread, "N/m")
    );
    let finding = Finding::warning(at.key("identified").key("stiffness_n_per_m"), text);
    site.warnings.push(
        finding
            .label(format!(
                "`{key}` times `hardening_bound` is the assumed stiffness"
            ))
            .help(format!(
                "the proof does not hold for so stiff a specimen: increase `stiffness_n_per_m` or `hardening_bound` until their \
                 product is {} or more, or identify again",
                quantity(found + spread, "N/m")
            )),
    );
}

/// Weights of the commands of a step, from that at its target back, where every target is known at once. Empty for a specimen
/// that receives its target alone.
fn ticks(loaded: &Loaded, table: &SpecimenTable) -> Vec<Weights> {
    let told_once = table.link.as_ref().is_some_and(LinkSpec::is_per_step);
    let ticks = loaded.time.ticks_per_step;
    if ticks == 1 || told_once {
        return Vec::new();
    }
    let each = (0..ticks).map(|back| {
        let share = f64::from(ticks - back) / f64::from(ticks);
        let points = shares(order(loaded), share);
        Weights {
            disp: points.map(|point| point.disp),
            slope: points.map(|point| point.slope),
        }
    });
    each.collect()
}

/// How much of a specimen's damping counts in a sawtooth, by the weights of its commands: the slope at the target over the
/// velocity ∇ of the integrator. A specimen that receives its target alone receives this velocity.
fn sawtooth(ticks: &[Weights]) -> f64 {
    ticks.first().map_or(1.0, |at_target| {
        let newest_last = at_target.slope.iter().rev();
        0.5 * newest_last.fold(0.0, |sum, weight| weight - sum)
    })
}

/// A law for this many axes, at the platform of its actuators if the table has one.
fn built(
    site: &mut Site<'_>,
    at: &KeyPath,
    table: &SpecimenTable,
    (key, source): (&str, &SpecimenLaw),
    laws: usize,
) -> Result<Box<dyn Specimen>, Refused> {
    let law = source.build(laws);
    let law = law.or_else(|error| site.refuse_key(&at.key(key), error.key(), &error))?;
    behind_actuators(table, law)
        .or_else(|error| site.refuse_key(&at.key("geometry"), error.key(), &error))
}

/// An estimate as the axes see it.
fn seen(table: &SpecimenTable, loading: &Option<LoadingUnitSpec>, estimate: Rows) -> Rows {
    match loading {
        Some(loading) => at_actuators(table, &loading.geometry, estimate),
        None => estimate,
    }
}

/// Rows of B: of a storey, given, or one without any entry for a test without a structure.
fn rows(
    site: &mut Site<'_>,
    at: &KeyPath,
    table: &SpecimenTable,
) -> Result<Vec<Vec<(usize, f64)>>, Refused> {
    let structure = site.loaded.file.structure.as_ref();
    let spec = structure.and_then(StructureTable::kind);
    match (table.storey, &table.rows, spec) {
        (Some(storey), _, Some((kind, spec))) => match spec.storey_row(storey) {
            Ok(row) => Ok(vec![row]),
            Err(BuildError::Model(error)) => {
                let at = path("structure").key(kind);
                site.refuse(Finding::error(at, error.to_string()))
            }
            Err(error) => {
                let finding = Finding::error(at.key("storey"), error.to_string());
                site.refuse(finding.label("no such storey"))
            }
        },
        (None, Some(rows), _) => {
            let sparse = |row: &Vec<f64>| {
                let entries = row.iter().copied().enumerate();
                entries.filter(|(_, entry)| *entry != 0.0).collect()
            };
            Ok(rows.iter().map(sparse).collect())
        }
        (None, None, Some((_, spec))) if table.deformations.is_some() => frames::rows(
            site,
            at,
            table.deformations.as_deref().unwrap_or_default(),
            &spec,
        ),
        // Without a structure there is nothing to transform: the laws or the axis tables give the number of axes.
        (_, _, None) => Ok(vec![Vec::new(); table.axes_by_itself()]),
        (None, None, Some(_)) => {
            let text = "give `storey`, `rows` or `deformations`: the deformation of the structure that the specimen follows";
            site.refuse(Finding::error(at.clone(), text))
        }
    }
}

fn estimate(
    site: &mut Site<'_>,
    at: &KeyPath,
    given: &MatrixValue,
    n: usize,
) -> Result<Rows, Refused> {
    let rows = given.rows();
    if rows.len() != n || rows.iter().any(|row| row.len() != n) {
        let text = format!("the estimate must be {n} × {n}, with one row and column per axis");
        return site.refuse(Finding::error(at.clone(), text));
    }
    let matrix = DMatrix::from_fn(n, n, |i, j| rows[i][j]);
    SymMatrix::from_dense(&matrix)
        .map(|_| rows)
        .or_else(|error| site.refuse(Finding::error(at.clone(), error.to_string())))
}
