//! Measures of one simulated test, taken from its rows while it runs: nothing is kept but sums and peaks.

use std::sync::{Arc, Mutex, PoisonError};

use super::CampaignError;
use gusset_config::{Finding, KeyPath, LoadedStudy, nearest};
use gusset_control::engine::{Experiment, Phase};
use gusset_quantity::catalog::column;
use gusset_record::{Column, Recorder, TimedEvent};

/// Time at the end of a test over which a residual displacement is averaged, s.
const RESIDUAL_S: f64 = 1.0;
/// Most storeys with a drift.
const MOST_STOREYS: usize = 1000;

/// How the test of a task ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// At its last step.
    Whole,
    /// The response became infinite or exceeded the bound of divergence: a collapse.
    Diverged,
    /// A limit or a fault stopped it: the later response is not known.
    Stopped,
    /// There is no such test.
    Invalid,
}

/// One column of the table that is measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Measure {
    /// Name of the column.
    pub name: String,
    /// SI unit, "1" for a pure number.
    pub unit: String,
    /// One line of explanation.
    pub meaning: String,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    /// Test time at the end.
    Time,
    /// Largest absolute value of a column.
    Peak(String),
    /// Largest absolute difference of two columns, divided by a height.
    Drift(String, Option<String>, f64),
    /// Largest of the drifts.
    LargestDrift,
    /// Mean of a column over the last second.
    Residual(String),
    /// Integral of one column over another.
    Work(String, String),
    /// Tracking error between target and measured.
    Tracking(String, String),
    /// 1 if the structure has collapsed.
    Collapse { of: usize, above: f64 },
}

impl Measure {
    /// True if the value cannot become smaller in the rest of the test.
    pub(super) const fn grows(&self) -> bool {
        matches!(
            self.kind,
            Kind::Time | Kind::Peak(_) | Kind::Drift(..) | Kind::LargestDrift
        )
    }
}

/// The measures of a study, for a test with the columns of `experiment`.
pub(super) fn measures(
    loaded: &LoadedStudy,
    experiment: &Experiment,
) -> Result<Vec<Measure>, CampaignError> {
    let wanted = &loaded.study.measure;
    let mut all = vec![Measure {
        name: "end_s".to_owned(),
        unit: "s".to_owned(),
        meaning: "test time at the end".to_owned(),
        kind: Kind::Time,
    }];
    let columns = experiment.columns();
    if wanted.peaks {
        all.extend(peaks(&columns));
    }
    if wanted.drifts {
        all.extend(drifts(loaded)?);
    }
    if wanted.residual {
        let disps = columns.iter().filter(|one| column::DISP.fits(&one.name));
        all.extend(disps.map(|one| Measure {
            name: format!("residual_{}", one.name),
            unit: one.unit.clone(),
            meaning: format!("mean {} over the last {RESIDUAL_S} s", one.name),
            kind: Kind::Residual(one.name.clone()),
        }));
    }
    for (index, port) in experiment.ports.iter().enumerate() {
        for axis in 1..=port.axes() {
            let of = |kind: &column::Kind| kind.of_axis(index + 1, axis);
            let (target, force) = (of(&column::TARGET), of(&column::FORCE));
            let place = format!("{} axis {axis}", port.name());
            if wanted.energy {
                all.push(Measure {
                    name: format!("work_{}_{axis}", index + 1),
                    unit: "J".to_owned(),
                    meaning: format!("work that the structure does on {place}"),
                    kind: Kind::Work(force, target.clone()),
                });
            }
            if wanted.tracking {
                all.push(Measure {
                    name: format!("tracking_{}_{axis}", index + 1),
                    unit: "1".to_owned(),
                    meaning: format!(
                        "tracking error (std of measured − target / std of target), {place}"
                    ),
                    kind: Kind::Tracking(target, of(&column::MEASURED)),
                });
            }
        }
    }
    all.extend(collapse(loaded, &all)?);
    check_reported(loaded, &all)?;
    Ok(all)
}

/// Peaks of displacements, accelerations and forces.
fn peaks(columns: &[Column]) -> Vec<Measure> {
    let kinds = [&column::DISP, &column::ACCEL, &column::FORCE];
    let is_wanted = |one: &&Column| kinds.iter().any(|kind| kind.fits(&one.name));
    let peak = |one: &Column| Measure {
        name: format!("peak_{}", one.name),
        unit: one.unit.clone(),
        meaning: format!("largest absolute {}", one.name),
        kind: Kind::Peak(one.name.clone()),
    };
    columns.iter().filter(is_wanted).map(peak).collect()
}

/// Drifts of the storeys of a shear building. Other structures have none.
fn drifts(loaded: &LoadedStudy) -> Result<Vec<Measure>, CampaignError> {
    let storeys = storeys(loaded);
    let heights = &loaded.study.measure.storey_height_m;
    if !heights.is_empty() && heights.len() != storeys {
        let at = KeyPath::root().key("measure").key("storey_height_m");
        let text = format!(
            "`storey_height_m` has {} heights for {storeys} storeys",
            heights.len()
        );
        return Err(loaded.refuse(Finding::error(at, text)).into());
    }
    if storeys == 0 || storeys > MOST_STOREYS {
        return Ok(Vec::new());
    }
    let is_absolute = loaded.test.file.excitation.base_displacement.is_some();
    let (stem, unit, what) = match heights.is_empty() {
        true => ("drift", "m", "drift"),
        false => ("drift_ratio", "1", "drift ratio"),
    };
    let one = |storey: usize| {
        let below = match storey {
            1 => is_absolute.then(|| column::GROUND.name().to_owned()),
            _ => Some(column::DISP.of_dof(storey - 1)),
        };
        let height = heights.get(storey - 1).copied().unwrap_or(1.0);
        Measure {
            name: format!("{stem}{storey}"),
            unit: unit.to_owned(),
            meaning: format!("largest absolute {what} of storey {storey}"),
            kind: Kind::Drift(column::DISP.of_dof(storey), below, height),
        }
    };
    let mut all: Vec<Measure> = (1..=storeys).map(one).collect();
    all.push(Measure {
        name: format!("max_{stem}"),
        unit: unit.to_owned(),
        meaning: format!("largest absolute {what} of all storeys"),
        kind: Kind::LargestDrift,
    });
    Ok(all)
}

/// Storeys of a shear building whose drifts are measured; 0 of another structure.
pub(super) fn storeys(loaded: &LoadedStudy) -> usize {
    if !loaded.study.measure.drifts {
        return 0;
    }
    let structure = loaded.test.file.structure.as_ref();
    let building = structure.and_then(|structure| structure.shear_building.as_ref());
    let storeys = building.map_or(0, |building| building.mass_kg.len());
    if storeys > MOST_STOREYS { 0 } else { storeys }
}

fn collapse(loaded: &LoadedStudy, all: &[Measure]) -> Result<Option<Measure>, CampaignError> {
    let Some(wanted) = &loaded.study.measure.collapse else {
        return Ok(None);
    };
    let Some(of) = all.iter().position(|one| one.name == wanted.measure) else {
        let at = KeyPath::root()
            .key("measure")
            .key("collapse")
            .key("measure");
        return Err(unknown(loaded, at, &wanted.measure, all));
    };
    Ok(Some(Measure {
        name: "collapse".to_owned(),
        unit: "1".to_owned(),
        meaning: format!(
            "1 if {} is above {} or the response diverged; empty if something else stopped the test before",
            wanted.measure, wanted.above
        ),
        kind: Kind::Collapse {
            of,
            above: wanted.above,
        },
    }))
}

fn check_reported(loaded: &LoadedStudy, all: &[Measure]) -> Result<(), CampaignError> {
    for (index, name) in loaded.study.measure.report.iter().enumerate() {
        if all.iter().all(|one| one.name != *name) {
            let at = KeyPath::root().key("measure").key("report").index(index);
            return Err(unknown(loaded, at, name, all));
        }
    }
    Ok(())
}

fn unknown(loaded: &LoadedStudy, at: KeyPath, name: &str, all: &[Measure]) -> CampaignError {
    let names: Vec<&str> = all.iter().map(|one| one.name.as_str()).collect();
    let text = format!("this study has no measure `{name}`");
    let mut finding = Finding::error(at, text);
    if let Some(near) = nearest(name, &names) {
        finding = finding.label(format!("did you mean `{near}`?"));
    }
    let all = format!("measures of this study: {}", names.join(", "));
    loaded.refuse(finding.help(all)).into()
}

/// Mean and sum of squares of a series (Welford 1962).
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    count: f64,
    mean: f64,
    square: f64,
}

impl Moments {
    fn take(&mut self, value: f64) {
        self.count += 1.0;
        let before = value - self.mean;
        self.mean += before / self.count;
        self.square += before * (value - self.mean);
    }
}

/// Sums of one measure.
#[derive(Debug, Clone, Default)]
struct Sums {
    peak: f64,
    last: Option<(f64, f64)>,
    moments: [Moments; 2],
}

#[derive(Debug)]
struct Sheet {
    measures: Vec<Measure>,
    /// Places of the columns of each measure.
    places: Vec<[Option<usize>; 2]>,
    sums: Vec<Sums>,
    phase: usize,
    time: usize,
    residual_from_s: f64,
}

/// A recorder that takes the measures of a test.
#[derive(Debug, Clone)]
pub(super) struct Taker(Arc<Mutex<Sheet>>);

impl Taker {
    /// A taker for `experiment`.
    pub(crate) fn new(measures: &[Measure], experiment: &Experiment) -> Self {
        let columns = experiment.columns();
        let place = |name: &str| columns.iter().position(|one| one.name == name);
        let places = measures.iter().map(|measure| match &measure.kind {
            Kind::Peak(one) | Kind::Residual(one) => [place(one), None],
            Kind::Drift(one, other, _) => [place(one), other.as_deref().and_then(place)],
            Kind::Work(one, other) | Kind::Tracking(one, other) => [place(one), place(other)],
            Kind::Time | Kind::LargestDrift | Kind::Collapse { .. } => [None, None],
        });
        let end = experiment.steps as f64 * experiment.dt;
        Self(Arc::new(Mutex::new(Sheet {
            places: places.collect(),
            sums: vec![Sums::default(); measures.len()],
            measures: measures.to_vec(),
            phase: place(column::STATE.name()).unwrap_or(0),
            time: place(column::TIME.name()).unwrap_or(0),
            residual_from_s: end - RESIDUAL_S,
        })))
    }

    /// The values of a test that ended at `end_s`.
    pub(crate) fn values(&self, end_s: f64, end: End) -> Vec<f64> {
        let sheet = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let all = sheet.measures.iter().zip(&sheet.places).zip(&sheet.sums);
        let mut values: Vec<f64> = all
            .map(|((measure, places), sums)| match &measure.kind {
                Kind::Time => end_s,
                Kind::LargestDrift | Kind::Collapse { .. } => f64::NAN,
                _ if places[0].is_none() => f64::NAN,
                Kind::Peak(_) | Kind::Drift(..) | Kind::Work(..) => sums.peak,
                Kind::Residual(_) if sums.moments[0].count == 0.0 => f64::NAN,
                Kind::Residual(_) => sums.moments[0].mean,
                Kind::Tracking(..) => {
                    let [error, target] = sums.moments;
                    (error.square / target.square).sqrt()
                }
            })
            .collect();
        let drifts = sheet.measures.iter().zip(&values);
        let drifts = drifts.filter(|(measure, _)| matches!(measure.kind, Kind::Drift(..)));
        // A storey without a number has no largest drift.
        let larger = |a: f64, b: f64| if a.is_nan() || a > b { a } else { b };
        let largest = drifts.map(|(_, value)| *value).reduce(larger);
        let largest = largest.unwrap_or(f64::NAN);
        for index in 0..values.len() {
            match sheet.measures[index].kind {
                Kind::LargestDrift => values[index] = largest,
                Kind::Collapse { of, above } => {
                    let grows = sheet.measures[of].grows();
                    values[index] = match end {
                        End::Diverged => 1.0,
                        // The test has no answer, unless the measure was above already.
                        End::Stopped if !(grows && values[of] > above) => f64::NAN,
                        _ => f64::from(u8::from(values[of] > above || values[of].is_nan())),
                    };
                }
                _ => {}
            }
        }
        values
    }
}

impl Recorder for Taker {
    fn row(&mut self, row: &[f64]) -> bool {
        let mut sheet = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let sheet = &mut *sheet;
        if row.get(sheet.phase) != Some(&Phase::Running.code()) {
            return true;
        }
        let time = row.get(sheet.time).copied().unwrap_or(f64::NAN);
        let at = |place: Option<usize>| place.and_then(|place| row.get(place)).copied();
        let all = sheet
            .measures
            .iter()
            .zip(&sheet.places)
            .zip(&mut sheet.sums);
        for ((measure, places), sums) in all {
            let Some(first) = at(places[0]) else { continue };
            let second = at(places[1]);
            match &measure.kind {
                Kind::Peak(_) => raise(&mut sums.peak, first),
                Kind::Drift(.., height) => {
                    raise(&mut sums.peak, (first - second.unwrap_or(0.0)) / height);
                }
                Kind::Residual(_) if time > sheet.residual_from_s => sums.moments[0].take(first),
                Kind::Work(..) => {
                    let now = (first, second.unwrap_or(f64::NAN));
                    if let Some((force, disp)) = sums.last.replace(now) {
                        sums.peak += 0.5 * (force + now.0) * (now.1 - disp);
                    }
                }
                Kind::Tracking(..) => {
                    sums.moments[0].take(second.unwrap_or(f64::NAN) - first);
                    sums.moments[1].take(first);
                }
                _ => {}
            }
        }
        true
    }

    fn event(&mut self, _: TimedEvent) -> bool {
        true
    }
}

/// Raises a peak; a NaN value stays.
fn raise(peak: &mut f64, value: f64) {
    let size = value.abs();
    if size > *peak || size.is_nan() {
        *peak = size;
    }
}
