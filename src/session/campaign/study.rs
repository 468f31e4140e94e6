//! A study expanded: axes, motions, draws, and the number of its tasks.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use super::design::{Axis, points};
use super::measure::{Measure, measures};
use super::motions::{Motions, motions};
use super::sobol;
use super::{CampaignError, at};
use gusset_config::{
    ConfigError, Finding, InputStore, KeyPath, LoadedStudy, Sampling, Scalar, Uncertain, load_study,
};
use gusset_setup as setup;

/// Most tasks of a campaign.
pub(super) const MOST_TASKS: u64 = 100_000_000;

/// A study with everything that its tasks are made of.
#[derive(Debug)]
pub struct Study {
    /// The files.
    pub loaded: LoadedStudy,
    /// Number of tasks.
    pub tasks: u64,
    /// Measures of the table.
    pub measures: Vec<Measure>,
    pub(super) axes: Vec<Axis>,
    pub(super) motions: Vec<Motions>,
    pub(super) samples: Vec<Uncertain>,
    /// True if a sensor of a specimen has noise.
    pub(super) is_noisy: bool,
    /// Digest of the study, the test, and the files that the test reads.
    pub(super) digest: String,
    /// Files with their digests, for the plan.
    pub(super) files: Vec<(String, String)>,
}

impl Study {
    /// Reads and expands the study at `path`. The test is built once.
    ///
    /// # Errors
    /// [`CampaignError::Config`]: the study or the test is wrong. [`CampaignError::File`]: a record cannot be read.
    pub fn load(path: &Path) -> Result<Self, CampaignError> {
        let path = &fs::canonicalize(path).map_err(at(path))?;
        let mut loaded = load_study(path)?;
        let store = Arc::new(InputStore::default());
        loaded.test.store = Some(Arc::clone(&store));
        let prepared = setup::build_rehearsal(&loaded.test)?;
        let frequencies = prepared.facts.structure.as_ref();
        let first = frequencies.and_then(|facts| facts.frequencies.first());
        let first_period = first.map(|omega| std::f64::consts::TAU / omega);
        let motions = motions(&loaded, &store, first_period)?;
        let vary = loaded.study.vary.iter();
        let axes: Vec<Axis> = vary
            .map(|vary| Axis {
                key: vary.key.clone(),
                values: vary.all(),
            })
            .collect();
        check_axes(&loaded, &axes)?;
        read_files(&loaded, &axes)?;
        check_levels(&loaded, &motions)?;
        let mut samples = loaded.test.uncertain_by(&loaded.study.sample);
        if loaded.study.campaign.sample_uncertainty {
            let more = loaded.test.uncertain().into_iter();
            let is_new = |one: &Uncertain| samples.iter().all(|other| other.key != one.key);
            let more: Vec<_> = more.filter(is_new).collect();
            samples.extend(more);
        }
        check_sobol(&loaded, samples.len())?;
        let measures = measures(&loaded, &prepared.experiment)?;
        store.close();
        let (digest, files) = digests(&loaded, &store);
        let transfers = loaded.test.file.specimen.iter();
        let is_noisy = transfers
            .filter_map(|table| table.believed_transfer(1.0))
            .any(|transfer| transfer.is_noisy());
        let mut study = Self {
            tasks: 0,
            measures,
            axes,
            motions,
            samples,
            is_noisy,
            digest,
            files,
            loaded,
        };
        study.tasks = study.counted()?;
        Ok(study)
    }

    /// Motions, each level counted; 1 without motions.
    pub(super) fn shots(&self) -> u64 {
        let all = self.motions.iter().map(Motions::count);
        all.fold(0_u64, u64::saturating_add).max(1)
    }

    /// Point of the design of a task.
    pub(super) fn point_of(&self, index: u64) -> u64 {
        index / self.loaded.study.campaign.replicates / self.shots()
    }

    /// Number of points of the design.
    pub(super) fn points(&self) -> u64 {
        self.point_of(self.tasks - 1) + 1
    }

    /// Values of the axes at a point, as for `--set`; empty without axes.
    pub(super) fn point_words(&self, point: u64) -> String {
        let values = super::design::point(self.loaded.study.campaign.design, &self.axes, point);
        let each = self.axes.iter().zip(values);
        let each =
            each.filter_map(|(axis, value)| Some(format!("{} = {}", axis.key, value?.toml())));
        match each.collect::<Vec<_>>().join(", ") {
            words if words.is_empty() && !self.axes.is_empty() => "the test file".to_owned(),
            words => words,
        }
    }

    fn counted(&self) -> Result<u64, CampaignError> {
        let campaign = &self.loaded.study.campaign;
        let points = points(campaign.design, &self.axes);
        let tasks = points
            .and_then(|points| points.checked_mul(self.shots()))
            .and_then(|tasks| tasks.checked_mul(campaign.replicates))
            .filter(|tasks| *tasks <= MOST_TASKS);
        tasks.ok_or_else(|| {
            let text = format!("this study has more than {MOST_TASKS} tasks, which is the most");
            let at = match campaign.replicates > MOST_TASKS {
                true => KeyPath::root().key("campaign").key("replicates"),
                false => KeyPath::root(),
            };
            let help = "use fewer values, motions, levels or replicates";
            self.loaded
                .refuse(Finding::error(at, text).help(help))
                .into()
        })
    }

    /// Title of the report.
    #[must_use]
    pub(crate) fn title(&self) -> String {
        let title = self.loaded.study.campaign.title.trim();
        let stem = self.loaded.path.file_stem();
        match title {
            "" => stem.map_or_else(String::new, |stem| stem.to_string_lossy().into_owned()),
            title => title.to_owned(),
        }
    }

    /// The first motions with levels: all levels are of their measure of intensity.
    pub(super) fn levelled(&self) -> Option<&Motions> {
        self.motions.iter().find(|one| !one.levels.is_empty())
    }

    /// Place of the measure with this name.
    pub(super) fn measure_at(&self, name: &str) -> Option<usize> {
        self.measures.iter().position(|one| one.name == name)
    }

    /// Places of the measures with pictures.
    pub(super) fn reported(&self) -> Vec<usize> {
        let wanted = self.loaded.study.measure.report.iter();
        let places: Vec<usize> = wanted.filter_map(|name| self.measure_at(name)).collect();
        if !places.is_empty() {
            return places;
        }
        let usual = ["max_drift_ratio", "max_drift"];
        let usual = usual.iter().find_map(|name| self.measure_at(name));
        let second = (self.measures.len() > 1).then_some(1);
        usual.or(second).into_iter().collect()
    }
}

/// Tries the first value of each axis: a key that the test does not know is a mistake of the study.
fn check_axes(loaded: &LoadedStudy, axes: &[Axis]) -> Result<(), CampaignError> {
    for (index, axis) in axes.iter().enumerate() {
        let Some(value) = axis.values.first() else {
            continue;
        };
        let set = format!("{}={}", axis.key, value.toml());
        if let Err(error) = loaded.test.varied(&[set]) {
            let at = KeyPath::root().key("vary").index(index).key("key");
            let ConfigError::Invalid(all) = &error else {
                return Err(error.into());
            };
            let Some(first) = all.0.first() else {
                return Err(error.into());
            };
            let mut finding = Finding::error(at, &first.headline).label(&first.place.1);
            for help in &first.help {
                finding = finding.help(help);
            }
            let tried = format!("tried with `{}` = {}", axis.key, value.toml());
            return Err(loaded.refuse(finding.help(tried)).into());
        }
    }
    Ok(())
}

/// A Sobol sequence has a limited number of keys and of points.
fn check_sobol(loaded: &LoadedStudy, keys: usize) -> Result<(), CampaignError> {
    let campaign = &loaded.study.campaign;
    if campaign.sampling != Sampling::Sobol {
        return Ok(());
    }
    let other = "use sampling = \"latin_hypercube\" or \"random\"";
    let at = |key: &str| KeyPath::root().key("campaign").key(key);
    if keys > sobol::MOST_KEYS {
        let most = sobol::MOST_KEYS;
        let text = format!("a Sobol sequence has at most {most} keys, and this study draws {keys}");
        let finding = Finding::error(at("sampling"), text).help(other);
        return Err(loaded.refuse(finding).into());
    }
    if campaign.replicates > sobol::MOST_POINTS {
        let most = sobol::MOST_POINTS;
        let text = format!("a Sobol sequence has at most {most} replicates");
        let finding = Finding::error(at("replicates"), text).help(other);
        return Err(loaded.refuse(finding).into());
    }
    Ok(())
}

/// Reads the files that values of the axes name: every task has the bytes of this moment.
fn read_files(loaded: &LoadedStudy, axes: &[Axis]) -> Result<(), CampaignError> {
    for axis in axes {
        for value in axis
            .values
            .iter()
            .filter(|value| matches!(value, Scalar::Text(_)))
        {
            let test = loaded
                .test
                .varied(&[format!("{}={}", axis.key, value.toml())])?;
            setup::build_rehearsal(&test)?;
        }
    }
    Ok(())
}

/// All levels are of one measure of intensity: they share a column of the table.
fn check_levels(loaded: &LoadedStudy, motions: &[Motions]) -> Result<(), CampaignError> {
    let all = motions
        .iter()
        .enumerate()
        .filter(|(_, one)| !one.levels.is_empty());
    let meaning = |one: &Motions| format!("{} in {}", one.words(), one.unit());
    let mut all = all.map(|(index, one)| (index, meaning(one)));
    let Some((_, first)) = all.next() else {
        return Ok(());
    };
    if let Some((index, other)) = all.find(|(_, other)| *other != first) {
        let place = KeyPath::root().key("records").index(index);
        let text = format!(
            "the levels of this table are of another measure than those of the first: {other}"
        );
        let help = format!("use {first} for all tables with levels, or plan two campaigns");
        return Err(loaded.refuse(Finding::error(place, text).help(help)).into());
    }
    Ok(())
}

/// One digest of all files, and the digest of each.
fn digests(loaded: &LoadedStudy, store: &InputStore) -> (String, Vec<(String, String)>) {
    let hex = |bytes: &[u8]| blake3::hash(bytes).to_hex().to_string();
    let full = |path: &Path| {
        let full = fs::canonicalize(path);
        full.as_deref().unwrap_or(path).display().to_string()
    };
    let test = &loaded.test;
    let mut files = vec![
        (full(&loaded.path), hex(loaded.text.as_bytes())),
        (full(&test.path), hex(test.text.as_bytes())),
    ];
    let inputs = store.digests().into_iter();
    files.extend(inputs.map(|(path, digest)| (path.display().to_string(), digest)));
    let mut whole = blake3::Hasher::new();
    for (path, digest) in &files {
        whole.update(path.as_bytes());
        whole.update(digest.as_bytes());
    }
    (whole.finalize().to_hex().to_string(), files)
}
