//! Ground motions of a study, and the overrides that choose and scale them.

use std::fs;
use std::path::{Path, PathBuf};

use super::{CampaignError, at};
use crate::config::{Finding, Intensity, KeyPath, LoadedStudy, RecordsTable, read_input};
use crate::motion::{Signal, Unit};

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

/// The records of a table, with the digests of their files.
fn files(
    loaded: &LoadedStudy,
    table: &RecordsTable,
    place: &KeyPath,
) -> Result<Vec<Motion>, CampaignError> {
    let folder = loaded.folder();
    let paths: Vec<PathBuf> = match (&table.files, &table.folder) {
        (Some(files), _) => files.iter().map(|file| folder.join(file)).collect(),
        (None, Some(name)) => {
            let found = listed(&folder.join(name))?;
            if found.is_empty() {
                let text = format!("the folder {name} contains no records");
                let finding = Finding::error(place.key("folder"), text);
                return Err(loaded.refuse(finding).into());
            }
            found
        }
        (None, None) => Vec::new(),
    };
    let unit = table
        .record_unit
        .and_then(|unit| serde_json::to_value(unit).ok());
    let unit = unit.map_or_else(String::new, |unit| format!(",unit={unit}"));
    let motion = |path: PathBuf| {
        let bytes = read_input(&path).map_err(at(&path))?;
        let full = fs::canonicalize(&path).map_err(at(&path))?;
        let name = path
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        let quoted = toml::Value::from(full.to_string_lossy().as_ref());
        Ok(Motion {
            name: name.unwrap_or_default(),
            set: format!("{GROUND}.signal={{file={{path={quoted}{unit}}}}}"),
            digest: blake3::hash(&bytes).to_hex().to_string(),
        })
    };
    paths.into_iter().map(motion).collect()
}

/// The files of a folder that are not hidden, in the order of their names.
fn listed(folder: &Path) -> Result<Vec<PathBuf>, CampaignError> {
    let entries = fs::read_dir(folder).map_err(at(folder))?;
    let mut found = Vec::new();
    for entry in entries {
        let path = entry.map_err(at(folder))?.path();
        let is_hidden = path
            .file_name()
            .is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if path.is_file() && !is_hidden {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}
