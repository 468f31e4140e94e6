//! Errors of a test, before it runs: the effect of its method and its actuators on the largest drifts.
//!
//! Three courses are compared. The test as it will run is its rehearsal. The same test with ideal specimens, by the same method
//! and λ, shows the effect of the actuators. Newmark's average acceleration with iteration at a half and at a quarter of the
//! step, extrapolated after Richardson, shows the effect of the method. The full model of a reduced structure goes this way, too, at
//! half of the step: it shows the effect of the reduction. An error without a reference is not known, and the reason is given.

use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use super::budget::Budget;
use super::{Staging, StandIn, staged_with};
use gusset_config::{ConfigError, Loaded};
use gusset_control::engine::{Control, Ending, Experiment, Phase};
use gusset_motion::Excitation;
use gusset_numerics::frame::FrameSpec;
use gusset_numerics::model::StructureSpec;
use gusset_proof::{AddedDamping, DriftError, Errors, TestError};
use gusset_quantity::catalog::column;
use gusset_record::{Recorder, TimedEvent};
use gusset_reduction::Reduction;
use gusset_setup::{self as setup, Ideal, IdealCourse, NoCourse};

/// Most numbers of one course.
const MOST: u64 = 4_000_000;
/// A drift that is smaller than this share of the largest of its kind is not compared, unless it is one of a specimen.
const MOVES: f64 = 0.01;
/// This share for a specimen.
const SPECIMEN_MOVES: f64 = 1e-6;
/// Directions that are listed.
const LISTED: usize = 32;
/// Share of an error by which its reference may be off.
const SURE: f64 = 0.5;

/// A drift: entries of its row, the part of the base in it, and its name.
struct Direction {
    name: String,
    row: Vec<(usize, f64)>,
    base: f64,
    rotation: bool,
    /// It is the deformation of a specimen.
    specimen: bool,
}

impl Direction {
    /// Least size that is compared, as a share of the largest of its kind.
    const fn moves(&self) -> f64 {
        if self.specimen { SPECIMEN_MOVES } else { MOVES }
    }
}

/// Course of one direction.
type Series = Vec<f64>;

/// The errors of a test that runs with `lambda`; `None` for a test without a structure. `modes` are those with the damping of
/// the actuators. `unknown` is the first specimen whose actuator is not known.
///
/// # Errors
/// As [`setup::build`].
pub fn errors(
    loaded: &Loaded,
    lambda: Option<f64>,
    modes: Vec<AddedDamping>,
    unknown: Option<&str>,
) -> Result<Option<Errors>, ConfigError> {
    if loaded.file.structure.is_none() {
        return Ok(None);
    }
    let safety = &loaded.file.safety;
    let [warn, refuse] = [safety.error_warn, safety.error_refuse];
    Ok(Some(match both(loaded, lambda, unknown)? {
        Ok((method, coupling, reduction)) => Errors {
            method,
            coupling,
            reduction,
            modes,
            warn,
            refuse,
        },
        Err(why) => Errors {
            modes,
            ..Errors::not_known(&why, [warn, refuse])
        },
    }))
}

/// The errors of method and coupling, and that of a reduction.
type Found = (TestError, TestError, Option<TestError>);

/// The errors of a test, or why none is known.
fn both(
    loaded: &Loaded,
    lambda: Option<f64>,
    unknown: Option<&str>,
) -> Result<Result<Found, String>, ConfigError> {
    let silent = loaded.file.specimen.iter();
    let mut silent = silent.filter(|table| StandIn::of(table) == StandIn::Nothing);
    if let Some(table) = silent.next() {
        return Ok(Err(format!(
            "specimen \"{}\" has no stand-in `law` and no stiffness",
            table.name
        )));
    }
    let ideal = || setup::build_ideal(loaded, lambda);
    let by_method = match ideal() {
        Ok(ideal) => ideal,
        Err(error) => return Ok(Err(format!("no ideal specimens: {error}"))),
    };
    let (dofs, steps) = (by_method.dofs(), loaded.time.steps);
    let most = Budget::default().ticks(1);
    let is_long = steps.saturating_mul(by_method.work(0)) > most;
    if is_long || steps.saturating_mul(dofs as u64) > MOST {
        return Ok(Err(words(NoCourse::BeyondBudget).to_owned()));
    }
    let is_referred = steps.saturating_mul(by_method.work(2 + 4)) <= most;
    let beyond = || TestError::not_known(words(NoCourse::BeyondBudget));
    // The test as it will run, or what is known of its coupling without it.
    let running = if loaded.file.specimen.is_empty() {
        Err(TestError::none())
    } else if let Some(name) = unknown {
        let why = format!("the actuator of specimen \"{name}\" is not known");
        Err(TestError::not_known(why))
    } else {
        let test = setup::build_rehearsal(loaded)?.experiment;
        let is_long = super::expected(&test) > Budget::default().ticks(Budget::cost(&test));
        if is_long { Err(beyond()) } else { Ok(test) }
    };
    if !is_referred && running.is_err() {
        let coupling = running.err().unwrap_or_default();
        let reduction = by_method.reduction().map(|_| beyond());
        return Ok(Ok((beyond(), coupling, reduction)));
    }
    let directions = directions(loaded, &by_method);
    let excitation = by_method.excitation().clone();
    let reduction = by_method.reduction().map(|(reduction, _)| reduction);
    let initial = by_method.initial().to_vec();
    let full = match &reduction {
        Some(reduction) if is_referred => {
            let work = steps.saturating_mul(reduction.full() as u64);
            let is_short =
                work <= MOST && work.saturating_mul(by_method.work(2) / dofs as u64) <= most;
            is_short.then(|| full(loaded, lambda)).transpose()?
        }
        _ => None,
    };
    let references = match is_referred {
        true => [(2, Some(ideal()?)), (4, Some(ideal()?))],
        false => [(2, None), (4, None)],
    };
    // No course needs another one.
    let (own, [half, quarter], running, full) = thread::scope(|scope| {
        let full = full.map(|ideal| scope.spawn(move || ideal.by_newmark(2, most)));
        let references = references.map(|(divider, ideal)| {
            let refer = move |ideal: Ideal| ideal.by_newmark(divider, most / 2);
            scope.spawn(move || ideal.map_or(Err(NoCourse::BeyondBudget), refer))
        });
        let running = running.map(|test| as_it_runs(test, loaded.time.step.value(), dofs));
        let own = by_method.by_method();
        (own, references.map(joined), running, full.map(joined))
    });
    // One position under the static load serves all courses.
    let rest: Vec<f64> = match &own {
        Ok(course) if excitation.has_constant() => (course.disp.iter().take(dofs).enumerate())
            .map(|(dof, disp)| disp - initial[dof])
            .collect(),
        _ => vec![0.0; dofs],
    };
    let of = |course: &IdealCourse| Drifts::of(course, &directions, &excitation, &rest);
    let drifts = match own {
        Ok(course) => of(&course),
        Err(why) => return Ok(Err(format!("with ideal specimens {}", words(why)))),
    };
    let reduction = reduction.map(|reduction| match (&half, &full) {
        (Ok(half), Some(Ok(full))) => TestError {
            energy: None,
            ..compared(&of(half), &of(&kept(full, &reduction)), &directions)
        },
        (Err(why), _) | (_, Some(Err(why))) => {
            TestError::not_known(format!("in the full model {}", words(*why)))
        }
        (_, None) => beyond(),
    });
    let method = match (half, quarter) {
        (Ok(half), Ok(quarter)) => {
            let references = [of(&half), of(&quarter)];
            of_method(
                &drifts,
                references,
                &directions,
                loaded.file.safety.error_warn,
            )
        }
        (Err(NoCourse::BeyondBudget), _) | (_, Err(NoCourse::BeyondBudget)) => beyond(),
        (Err(why), _) | (_, Err(why)) => {
            TestError::not_known(format!("in the reference {}", words(why)))
        }
    };
    let coupling = match running {
        Ok(Ok((course, added))) => TestError {
            added_energy: (drifts.energy).map(|energy| share(added, energy).copysign(added)),
            ..compared(&of(&course), &drifts, &directions)
        },
        Ok(Err(why)) => TestError::not_known(why),
        Err(known) => known,
    };
    Ok(Ok((method, coupling, reduction)))
}

/// The test with ideal specimens and without a reduction.
fn full(loaded: &Loaded, lambda: Option<f64>) -> Result<Ideal, ConfigError> {
    let mut whole = loaded.clone();
    if let Some(table) = &mut whole.file.structure {
        table.reduce = None;
    }
    setup::build_ideal(&whole, lambda)
}

/// The course of a full model at the kept DOFs; the modes rest.
fn kept(full: &IdealCourse, reduction: &Reduction) -> IdealCourse {
    let dofs = reduction.coordinates().len();
    let rest = vec![0.0; dofs - reduction.kept().len()];
    let steps = full.disp.chunks_exact(full.dofs);
    let disp = steps.flat_map(|disp| {
        let kept = reduction.kept().iter().map(|&dof| disp[dof]);
        kept.chain(rest.iter().copied())
    });
    let disp = disp.collect();
    IdealCourse { dofs, disp }
}

/// The result of a thread. Its panic becomes one of this thread.
fn joined<T>(thread: thread::ScopedJoinHandle<'_, T>) -> T {
    let made = thread.join();
    made.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

const fn words(why: NoCourse) -> &'static str {
    match why {
        NoCourse::NoEquilibrium => {
            "no equilibrium is found: the structure collapses, or a law is too steep for the iteration"
        }
        NoCourse::Diverged => "the response grows without bound",
        NoCourse::BeyondBudget => "DOFs times steps are beyond the budget of the rehearsal",
    }
}

/// Storeys of a shear building or chain, otherwise DOFs without the modes of a reduced structure; then the other axes of specimens.
fn directions(loaded: &Loaded, ideal: &Ideal) -> Vec<Direction> {
    let structure = loaded.file.structure.as_ref();
    let kind = structure.and_then(|table| table.kind());
    let kind = kind.as_ref().map(|(_, spec)| spec);
    let frame = structure.and_then(|table| table.frame.as_ref());
    let places = frame.map(FrameSpec::places).unwrap_or_default();
    let reduced = ideal.reduction();
    let of_model = |dof: usize| match &reduced {
        Some((reduction, _)) => reduction.kept().get(dof).copied(),
        None => Some(dof),
    };
    let turns = |dof: usize| match of_model(dof).and_then(|dof| places.get(dof)) {
        Some((_, direction)) => direction.turns(),
        None => structure
            .zip(of_model(dof))
            .is_some_and(|(table, dof)| table.rotations.contains(&(dof + 1))),
    };
    let iota = ideal.influence();
    let base = |row: &[(usize, f64)]| -> f64 { row.iter().map(|(dof, b)| b * iota[*dof]).sum() };
    let n = match &reduced {
        Some((reduction, _)) => reduction.kept().len(),
        None => ideal.dofs(),
    };
    let mut found: Vec<Direction> = (0..n)
        .map(|dof| {
            let (name, row) = match kind {
                None | Some(StructureSpec::Matrices(_) | StructureSpec::Frame(_)) => {
                    let name = match (&reduced, places.get(dof)) {
                        (Some((_, words)), _) => words[dof].clone(),
                        (None, Some((node, direction))) => {
                            format!("{node} {}", direction.word())
                        }
                        (None, None) => format!("DOF {}", dof + 1),
                    };
                    (name, vec![(dof, 1.0)])
                }
                Some(_) if dof == 0 => ("storey 1".to_owned(), vec![(0, 1.0)]),
                Some(_) => (
                    format!("storey {}", dof + 1),
                    vec![(dof, 1.0), (dof - 1, -1.0)],
                ),
            };
            Direction {
                base: base(&row),
                name,
                rotation: turns(dof),
                specimen: false,
                row,
            }
        })
        .collect();
    let rows = loaded.file.specimen.iter().zip(ideal.rows());
    for (table, rows) in rows {
        let many = rows.len() > 1;
        for (axis, mut row) in rows.into_iter().enumerate() {
            row.sort_by_key(|(dof, _)| std::cmp::Reverse(*dof));
            if row.is_empty() {
                continue;
            }
            if let Some(one) = found.iter_mut().find(|one| one.row == row) {
                one.specimen = true;
                continue;
            }
            let axis = if many {
                format!(", axis {}", axis + 1)
            } else {
                String::new()
            };
            found.push(Direction {
                base: base(&row),
                name: format!("specimen {}{axis}", table.name),
                rotation: row.iter().all(|(dof, _)| turns(*dof)),
                specimen: true,
                row,
            });
        }
    }
    found
}

/// Drifts of a course, from the position under the static load, and its input energy; none with a moving base.
struct Drifts {
    each: Vec<Series>,
    energy: Option<f64>,
}

impl Drifts {
    fn of(
        course: &IdealCourse,
        directions: &[Direction],
        excitation: &Excitation,
        rest: &[f64],
    ) -> Self {
        let n = course.dofs;
        let steps = || course.disp.chunks_exact(n);
        let each = directions.iter().map(|direction| {
            let along = |disp: &[f64]| -> f64 {
                let each = direction.row.iter();
                each.map(|(dof, b)| b * disp[*dof]).sum()
            };
            let from = along(rest);
            let rows = steps().enumerate();
            let rows = rows
                .map(|(step, disp)| along(disp) - from - direction.base * excitation.base(step).0);
            rows.collect()
        });
        let mut energy = 0.0;
        let (mut before, mut load) = (vec![0.0; n], vec![0.0; n]);
        excitation.load_into(0, &mut before);
        for (step, (from, to)) in steps().zip(steps().skip(1)).enumerate() {
            excitation.load_into(step + 1, &mut load);
            for dof in 0..n {
                energy += 0.5 * (before[dof] + load[dof]) * (to[dof] - from[dof]);
            }
            std::mem::swap(&mut before, &mut load);
        }
        Self {
            each: each.collect(),
            // A test from its initial state takes in nothing.
            energy: (!excitation.is_absolute() && energy != 0.0).then_some(energy),
        }
    }
}

/// The step from which the largest drifts of a course and its reference count. A state from which both decay is given: they then count
/// from the first change of sign of the reference, if what comes is not negligible.
fn begin(course: &[f64], reference: &[f64]) -> usize {
    let given = reference.first().map_or(0.0, |value| value.abs());
    let most = |series: &[f64]| {
        series
            .iter()
            .fold(0.0, |most: f64, value| most.max(value.abs()))
    };
    if given == 0.0 || most(course).max(most(reference)) > given {
        return 0;
    }
    let sign = reference[0].signum();
    let back = reference.iter().position(|value| value * sign < 0.0);
    back.filter(|back| most(&reference[*back..]) >= MOVES * given)
        .unwrap_or(0)
}

/// Largest magnitude of a series, between its steps by a parabola.
fn peak(series: &[f64]) -> f64 {
    let sizes = series.iter().map(|value| value.abs()).enumerate();
    let (at, largest) = sizes.fold(
        (0, 0.0),
        |most, one| if one.1 > most.1 { one } else { most },
    );
    let (Some(before), Some(after)) = (
        at.checked_sub(1).and_then(|place| series.get(place)),
        series.get(at + 1),
    ) else {
        return largest;
    };
    let sign = series[at].signum();
    let (before, after) = (sign * before, sign * after);
    let bend = 2.0 * largest - before - after;
    if bend > 0.0 {
        largest + (after - before).powi(2) / (8.0 * bend)
    } else {
        largest
    }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| {
        (sum + value * value, count + 1.0)
    });
    f64::sqrt(sum / f64::max(count, 1.0))
}

fn share(difference: f64, reference: f64) -> f64 {
    if difference == 0.0 {
        0.0
    } else {
        (difference / reference).abs()
    }
}

/// The error of a course against a reference.
fn compared(course: &Drifts, reference: &Drifts, directions: &[Direction]) -> TestError {
    let pairs = course.each.iter().zip(&reference.each);
    // Peaks of the course and of the reference.
    let peaks: Vec<[f64; 2]> = { pairs.clone() }
        .map(|(own, reference)| {
            let begin = begin(own, reference);
            [peak(&own[begin..]), peak(&reference[begin..])]
        })
        .collect();
    let largest = |rotation: bool| {
        let of_kind = directions.iter().zip(&peaks);
        let of_kind = of_kind.filter(|(direction, _)| direction.rotation == rotation);
        of_kind.fold(0.0, |most: f64, (_, [own, of_reference])| {
            most.max(*own).max(*of_reference)
        })
    };
    let largest = [largest(false), largest(true)];
    let mut found: Vec<DriftError> = (pairs.zip(directions).zip(&peaks))
        .filter(|((_, direction), [own, of_reference])| {
            let most = largest[usize::from(direction.rotation)];
            most > 0.0 && own.max(*of_reference) >= direction.moves() * most
        })
        .map(|(((own, reference), direction), [of_own, of_reference])| {
            // A direction that rests in the reference is compared with the largest of its kind.
            let most = largest[usize::from(direction.rotation)];
            let [size, rms_size] = if *of_reference >= direction.moves() * most {
                [*of_reference, rms(reference.iter().copied())]
            } else {
                [most; 2]
            };
            let differences = own.iter().zip(reference).map(|(a, b)| a - b);
            DriftError {
                name: direction.name.clone(),
                unit: if direction.rotation { "rad" } else { "m" }.to_owned(),
                largest: *of_own,
                reference: *of_reference,
                error: share(of_own - of_reference, size),
                nrmse: share(rms(differences), rms_size),
            }
        })
        .collect();
    if found.iter().any(|one| !one.error.is_finite()) {
        return TestError::not_known("the response grows without bound");
    }
    found.sort_by(|a, b| b.error.total_cmp(&a.error));
    let energy = course.energy.zip(reference.energy);
    let nrmse = found.iter().map(|one| one.nrmse).fold(0.0, f64::max);
    let worst = found.first();
    let (drift, direction) = worst.map_or((0.0, None), |one| (one.error, Some(one.name.clone())));
    found.truncate(LISTED);
    TestError {
        not_known: None,
        drift: Some(drift),
        direction,
        nrmse: Some(nrmse),
        energy: energy.map(|(own, reference)| share(own - reference, reference)),
        added_energy: None,
        directions: found,
    }
}

/// The error of the method against the extrapolation of two references. It is not known where these differ by more than half of it,
/// in the largest drifts or in the NRMSE, unless it is small anyway.
fn of_method(
    course: &Drifts,
    [half, quarter]: [Drifts; 2],
    directions: &[Direction],
    warn: f64,
) -> TestError {
    let beyond = |half: f64, quarter: f64| quarter + (quarter - half) / 3.0;
    let series = half.each.iter().zip(&quarter.each);
    let extrapolated = Drifts {
        each: series
            .map(|(half, quarter)| {
                half.iter()
                    .zip(quarter)
                    .map(|(h, q)| beyond(*h, *q))
                    .collect()
            })
            .collect(),
        energy: half.energy.zip(quarter.energy).map(|(h, q)| beyond(h, q)),
    };
    let error = compared(course, &extrapolated, directions);
    let between = compared(&quarter, &extrapolated, directions);
    let doubt = |off: Option<f64>, found: Option<f64>| {
        let (off, found) = (off.unwrap_or(0.0), found.unwrap_or(0.0));
        off > SURE * found && off + found > warn
    };
    let is_doubtful = doubt(between.drift, error.drift) || doubt(between.nrmse, error.nrmse);
    if between.not_known.is_some() || is_doubtful {
        return TestError::not_known(
            "the reference still changes with its step: the response is too sensitive, or the step is too long",
        );
    }
    error
}

/// Displacements of all DOFs at the steps of the running test, and the energy that tracking errors add.
#[derive(Debug, Clone)]
struct Kept(Arc<Mutex<Course>>, Places);

#[derive(Debug, Default)]
struct Course {
    disp: Vec<f64>,
    /// Tracking error and force of each axis in the row before.
    before: Vec<(f64, f64)>,
    added_j: f64,
}

#[derive(Debug, Clone)]
struct Places {
    phase: usize,
    step: usize,
    dofs: Vec<usize>,
    /// Target, measured displacement and force of each axis.
    axes: Vec<[usize; 3]>,
}

impl Kept {
    fn of(experiment: &Experiment) -> Self {
        let columns = experiment.columns();
        let place = |name: &str| columns.iter().position(|column| column.name == name);
        let dofs = &experiment.record_dofs;
        let ports = experiment.ports.iter().enumerate();
        let axes = ports.flat_map(|(port, one)| (1..=one.axes()).map(move |axis| (port + 1, axis)));
        let axes = axes.filter_map(|(port, axis)| {
            let of = |kind: &column::Kind| place(&kind.of_axis(port, axis));
            Some([
                of(&column::TARGET)?,
                of(&column::MEASURED)?,
                of(&column::FORCE)?,
            ])
        });
        let places = Places {
            axes: axes.collect(),
            phase: place(column::STATE.name()).unwrap_or(0),
            step: place(column::STEP.name()).unwrap_or(0),
            dofs: (dofs.iter())
                .filter_map(|dof| place(&column::DISP.of_dof(dof + 1)))
                .collect(),
        };
        Self(Arc::default(), places)
    }
}

impl Recorder for Kept {
    fn row(&mut self, row: &[f64]) -> bool {
        let at = |column: usize| row.get(column).copied().unwrap_or(f64::NAN);
        let Self(kept, places) = self;
        if at(places.phase) == Phase::Running.code() {
            let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
            let Course {
                disp,
                before,
                added_j,
            } = &mut *kept;
            // The last tick of a step stays.
            disp.truncate(at(places.step) as usize * places.dofs.len());
            disp.extend(places.dofs.iter().map(|dof| at(*dof)));
            let now = places.axes.iter().map(|[target, measured, force]| {
                let error = at(*measured) - at(*target);
                (error, at(*force))
            });
            let now: Vec<(f64, f64)> = now.collect();
            for ((error, force), (error_before, force_before)) in now.iter().zip(&*before) {
                *added_j += 0.5 * (force + force_before) * (error - error_before);
            }
            *before = now;
        }
        true
    }

    fn event(&mut self, _: TimedEvent) -> bool {
        true
    }
}

/// The course of a test with this step in s, and the energy that its actuators add; or why its course is not known.
fn as_it_runs(
    mut experiment: Experiment,
    step: f64,
    dofs: usize,
) -> Result<(IdealCourse, f64), String> {
    experiment.opening.confirm = false;
    experiment.record_dofs = (0..dofs).collect();
    let recorder = Kept::of(&experiment);
    let kept = Arc::clone(&recorder.0);
    let (_nobody_speaks, requests) = crossbeam_channel::bounded(1);
    let control = Control::from(requests);
    let lifted = Staging::WithoutLimits;
    let (outcome, ..) = staged_with(experiment, Box::new(recorder), lifted, &control);
    if outcome.ending != Ending::Completed {
        let at = super::findings::short(outcome.steps as f64 * step);
        return Err(format!("the rehearsal ends at {at} s, before the test"));
    }
    let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
    let course = IdealCourse {
        dofs,
        disp: std::mem::take(&mut kept.disp),
    };
    Ok((course, kept.added_j))
}
