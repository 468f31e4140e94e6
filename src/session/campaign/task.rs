//! A task: the overrides of one simulated test, and its identity.

use super::design::{Draws, again, point};
use super::program::Program;
use super::random::bits;
use super::study::Study;
use gusset_config::Scalar;

/// One simulated test of a campaign.
#[derive(Debug, Clone)]
pub(crate) struct Task {
    /// Number, from 0.
    pub index: u64,
    /// Value of each axis; none where the test file decides.
    pub values: Vec<Option<Scalar>>,
    /// Name of the ground motion and its level.
    pub motion: Option<(String, Option<f64>)>,
    /// Number of the draw, from 0.
    pub replicate: u64,
    /// Overrides that the controller knows: axes and ground motion.
    pub sets: Vec<String>,
    /// Overrides that were drawn. The controller does not know them.
    pub drawn: Vec<String>,
    /// The drawn numbers.
    pub draws: Vec<f64>,
    /// Seed of the noise of each specimen; none: as in the test file.
    pub noise_seed: Option<u64>,
    /// Digest of the file of the ground motion.
    motion_digest: String,
}

impl Task {
    /// Task `index`, from 0. Replicates vary fastest, then levels, motions, and points of the design.
    #[must_use]
    pub fn of(study: &Study, index: u64) -> Self {
        let campaign = &study.loaded.study.campaign;
        let replicate = index % campaign.replicates;
        let rest = index / campaign.replicates;
        let (shots, at) = (study.shots(), rest / study.shots());
        let chosen = point(campaign.design, &study.axes, at);
        let axes = study.axes.iter().zip(&chosen);
        let mut sets: Vec<String> = axes
            .filter_map(|(axis, value)| Some(format!("{}={}", axis.key, (*value)?.toml())))
            .collect();
        let mut shot = rest % shots;
        let mut motion = None;
        let mut motion_digest = String::new();
        for motions in &study.motions {
            if shot >= motions.count() {
                shot -= motions.count();
                continue;
            }
            if let Some((one, level)) = motions.at(shot) {
                sets.extend(one.sets.iter().cloned());
                sets.extend(level.map(|level| motions.scaled(level)));
                motion = Some((one.name.clone(), level));
                motion_digest.clone_from(&one.digest);
            }
            break;
        }
        let (mut drawn, mut draws) = (Vec::new(), Vec::new());
        let all = Draws {
            sampling: campaign.sampling,
            seed: campaign.seed,
            count: campaign.replicates,
        };
        for (place, sample) in study.samples.iter().enumerate() {
            let draw = all.normal(&sample.key.to_string(), place, replicate);
            drawn.push(sample.set(draw));
            draws.push(sample.value(draw));
        }
        let redraws_noise = study.is_noisy && campaign.replicates > 1;
        Self {
            index,
            values: chosen.into_iter().map(|value| value.cloned()).collect(),
            motion,
            replicate,
            sets,
            drawn,
            draws,
            noise_seed: redraws_noise.then(|| bits(campaign.seed, "noise", replicate) >> 2),
            motion_digest,
        }
    }

    /// The task with numbers that are drawn again; attempt 0 has the first ones. All points of the design have equal draws.
    #[must_use]
    pub(crate) fn attempted(mut self, study: &Study, attempt: u64) -> Self {
        if attempt > 0 {
            let seed = study.loaded.study.campaign.seed;
            let samples = study.samples.iter();
            let normal = samples.map(|one| {
                let draw = again(seed, &one.key.to_string(), self.replicate, attempt);
                (one.set(draw), one.value(draw))
            });
            (self.drawn, self.draws) = normal.unzip();
        }
        self
    }

    /// Identity of a task: a digest of the files, the overrides, the seed and the program.
    #[must_use]
    pub(crate) fn identity(&self, study: &Study, program: &Program) -> String {
        let mut hasher = blake3::Hasher::new();
        let mut part = |text: &str| {
            hasher.update(&(text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        };
        part(&program.digest());
        part(&study.digest);
        part(&self.motion_digest);
        part(&study.loaded.study.campaign.seed.to_string());
        part(&format!("{:?}", self.noise_seed));
        for set in self.sets.iter().chain(&self.drawn) {
            part(set);
        }
        hasher.finalize().to_hex()[..32].to_owned()
    }
}
