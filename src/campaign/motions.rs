//! Ground motions of a study, and the overrides that choose and scale them.

use std::path::Path;
use std::{fs, io};

use super::CampaignError;
use crate::config::{Finding, Inputs, Intensity, KeyPath, LoadedStudy, RecordsTable};
use crate::motion::{ReadOptions, Signal, Unit, parse_record};

const GROUND: &str = "excitation.ground_acceleration";

/// One motion: its name, the override that chooses it, and the digest of its file.
#[derive(Debug, Clone)]
pub(super) struct Motion {
    pub name: String,
    pub set: String,
    pub digest: String,
}

/// The motions of one table, each scaled to each level.
#[derive(Debug, Clone)]
pub(super) struct Motions {
    pub motions: Vec<Motion>,
    pub levels: Vec<f64>,
    scale: Scale,
}

/// How motions are scaled.
#[derive(Debug, Clone, Copy)]
struct Scale {
    intensity: Intensity,
    unit: Option<Unit>,
    period_s: f64,
    damping_ratio: f64,
}

impl Motions {
    /// Number of motions, each level counted.
    pub fn count(&self) -> u64 {
        self.motions.len() as u64 * self.levels.len().max(1) as u64
    }

    /// The motion and level at `index`; the level varies fastest.
    pub fn at(&self, index: u64) -> Option<(&Motion, Option<f64>)> {
        let levels = self.levels.len().max(1) as u64;
        let motion = self.motions.get((index / levels) as usize)?;
        Some((motion, self.levels.get((index % levels) as usize).copied()))
    }

    /// The override that scales a motion to `level`.
    pub fn scaled(&self, level: f64) -> String {
        let unit = self.unit();
        let Scale {
            period_s,
            damping_ratio,
            ..
        } = self.scale;
        match self.scale.intensity {
            Intensity::Pga => {
                format!("{GROUND}.processing.target_peak={{value={level:?},unit=\"{unit}\"}}")
            }
            Intensity::Sa => format!(
                "{GROUND}.processing.target_sa={{period_s={period_s:?},damping_ratio={damping_ratio:?},value={level:?},\
                 unit=\"{unit}\"}}"
            ),
        }
    }

    /// Unit of the levels as files spell it.
    pub fn unit(&self) -> String {
        let unit = self
            .scale
            .unit
            .and_then(|unit| serde_json::to_value(unit).ok());
        unit.and_then(|unit| unit.as_str().map(str::to_owned))
            .unwrap_or_else(|| "m/s2".to_owned())
    }

    /// The measure of intensity in words.
    pub fn words(&self) -> String {
        match self.scale.intensity {
            Intensity::Pga => "peak ground acceleration".to_owned(),
            Intensity::Sa => format!(
                "Sa({:.3} s, {:.0} %)",
                self.scale.period_s,
                100.0 * self.scale.damping_ratio
            ),
        }
    }
}

/// The motions of each table of a study. `first_period` is that of the structure of the test.
pub(super) fn motions(
    loaded: &LoadedStudy,
    first_period: Option<f64>,
) -> Result<Vec<Motions>, CampaignError> {
    let ground = loaded.test.file.excitation.ground_acceleration.as_ref();
    let mut all = Vec::new();
    for (index, table) in loaded.study.records.iter().enumerate() {
        let place = KeyPath::root().key("records").index(index);
        let refuse = |text: &str| loaded.refuse(Finding::error(place.clone(), text));
        let Some(ground) = ground else {
            let text = "`records` needs a test with `excitation.ground_acceleration`";
            return Err(refuse(text).into());
        };
        let is_scaled =
            ground.processing.target_sa.is_some() || ground.processing.target_peak.is_some();
        if is_scaled && !table.levels().is_empty() {
            let text =
                "the test file scales the motion already: remove its `target_peak` or `target_sa`";
            return Err(refuse(text).into());
        }
        let period_s = match (table.intensity, table.period_s, first_period) {
            (Intensity::Pga, ..) => 0.0,
            (_, Some(period), _) | (_, None, Some(period)) => period,
            (Intensity::Sa, None, None) => {
                return Err(refuse("this test has no first period: give `period_s`").into());
            }
        };
        let motions = match &table.synthetic {
            Some(synthetic) => {
                let kind = match &ground.signal {
                    Signal::KanaiTajimi(_) => "kanai_tajimi",
                    Signal::BandLimitedNoise(_) => "band_limited_noise",
                    _ => {
                        let text = "`synthetic` needs a test with the signal `kanai_tajimi` or `band_limited_noise`";
                        return Err(refuse(text).into());
                    }
                };
                let seeds = (0..synthetic.count).map(|i| synthetic.seed.wrapping_add(i));
                let motion = |seed: u64| Motion {
                    name: format!("seed-{seed}"),
                    set: format!("{GROUND}.signal.{kind}.seed={seed}"),
                    digest: String::new(),
                };
                seeds.map(motion).collect()
            }
            None => files(loaded, table, &place)?,
        };
        all.push(Motions {
            motions,
            levels: table.levels(),
            scale: Scale {
                intensity: table.intensity,
                unit: table.unit,
                period_s,
                damping_ratio: table.damping_ratio.unwrap_or(0.05),
            },
        });
    }
    Ok(all)
}

/// The records of a table, with the digests of their files. Each record is read once.
fn files(
    loaded: &LoadedStudy,
    table: &RecordsTable,
    place: &KeyPath,
) -> Result<Vec<Motion>, CampaignError> {
    let names: Vec<(KeyPath, String)> = match (&table.files, &table.folder) {
        (Some(files), _) => {
            let at = |index| place.key("files").index(index);
            let files = files.iter().enumerate();
            files
                .map(|(index, file)| (at(index), file.clone()))
                .collect()
        }
        (None, Some(name)) => {
            let at = place.key("folder");
            let found = listed(&loaded.folder().join(name)).map_err(|error| {
                let text = format!("cannot read the folder {name}: {error}");
                let finding =
                    Finding::error(at.clone(), text).label("a folder of records is wanted");
                loaded.refuse(finding.help("the path is relative to the folder of the study"))
            })?;
            if found.is_empty() {
                let text = format!("the folder {name} contains no records");
                return Err(loaded.refuse(Finding::error(at, text)).into());
            }
            let path = |file: String| format!("{name}/{file}");
            found
                .into_iter()
                .map(|file| (at.clone(), path(file)))
                .collect()
        }
        (None, None) => Vec::new(),
    };
    let mut inputs = Inputs::new(loaded.folder());
    let each = names.into_iter();
    each.map(|(at, name)| motion(loaded, table, &mut inputs, (at, &name)))
        .collect()
}

/// The record `name`, which the study names at `at`.
fn motion(
    loaded: &LoadedStudy,
    table: &RecordsTable,
    inputs: &mut Inputs,
    (at, name): (KeyPath, &str),
) -> Result<Motion, CampaignError> {
    let bytes = inputs
        .read(name)
        .map_err(|error| loaded.refuse(error.finding(at.clone())))?;
    let record = parse_record(name, bytes, &ReadOptions::default());
    let record = record.map_err(|error| {
        let finding = Finding::error(at.clone(), format!("{name} is no record: {error}"));
        loaded.refuse(finding.help("remove it from the study, or convert it"))
    })?;
    let Some(unit) = table.record_unit.or(record.unit) else {
        let finding = Finding::error(at, format!("the record {name} has no unit"));
        return Err(loaded
            .refuse(finding.help("for example record_unit = \"g\""))
            .into());
    };
    let digest = blake3::hash(bytes).to_hex().to_string();
    let path = loaded.folder().join(name);
    let full = fs::canonicalize(&path).map_err(super::at(&path))?;
    let name = Path::new(name)
        .file_name()
        .map(|name| name.to_string_lossy().into_owned());
    let quoted = toml::Value::from(full.to_string_lossy().as_ref());
    let of_table = table.record_unit.map(|_| format!(",unit=\"{unit}\""));
    Ok(Motion {
        name: name.unwrap_or_default(),
        set: format!(
            "{GROUND}.signal={{file={{path={quoted}{}}}}}",
            of_table.unwrap_or_default()
        ),
        digest,
    })
}

/// Names of the files of a folder that are not hidden, sorted.
fn listed(folder: &Path) -> io::Result<Vec<String>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        let name = name.filter(|name| !name.starts_with('.') && path.is_file());
        found.extend(name);
    }
    found.sort();
    Ok(found)
}
