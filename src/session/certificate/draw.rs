//! Draws of a trial: uncertain numbers of the file, the spread of identified values, and the seeds of noise.
//!
//! Every number is a function of the seed, the trial and its own place, so that a trial is the same whichever thread runs it.

use gusset_actuator::transfer::noise::normal_pair;
use gusset_config::{Loaded, Uncertain};
use gusset_setup::{Drawn, Trial};

/// Channel of the numbers of the file, of identified values (one per specimen), and of seeds.
const OF_KEYS: u64 = 1 << 32;
const OF_SPECIMENS: u64 = 2 << 32;
const OF_SEEDS: u64 = 3 << 32;

/// All that is uncertain in a test.
#[derive(Debug, Clone)]
pub struct Plan {
    seed: u64,
    /// Numbers of the file.
    pub numbers: Vec<Uncertain>,
    /// Standard deviations of each specimen: stiffness as a share, delay in s of wall time, gain as a share.
    spreads: Vec<[f64; 3]>,
    /// Test time in a second of wall time.
    pace: f64,
    noisy: bool,
}

impl Plan {
    /// The plan of a test.
    #[must_use]
    pub(crate) fn of(loaded: &Loaded, seed: u64) -> Self {
        let specimens = &loaded.file.specimen;
        let spreads = specimens.iter().map(|table| {
            let known = table.identified.unwrap_or_default();
            let gain = match (known.gain, known.gain_std) {
                (Some(gain), Some(std)) => std / gain,
                _ => 0.0,
            };
            [
                known.stiffness_share(),
                known.delay_std_s.unwrap_or(0.0),
                gain,
            ]
        });
        let time = loaded.time;
        let tick = time.step.value() / f64::from(time.ticks_per_step);
        let noisy = specimens.iter().any(|table| {
            let transfer = table.believed_transfer(1.0);
            transfer.is_some_and(|transfer| transfer.is_noisy())
        });
        Self {
            seed,
            numbers: loaded.uncertain(),
            spreads: spreads.collect(),
            pace: tick / time.period.value(),
            noisy,
        }
    }

    /// True if no two trials differ.
    #[must_use]
    pub(crate) fn is_certain(&self) -> bool {
        let spreads = self.spreads.iter().flatten();
        self.numbers.is_empty() && !self.noisy && spreads.into_iter().all(|std| *std == 0.0)
    }

    /// True if every trial has the same reference: nothing but actuators and sensors is uncertain.
    #[must_use]
    pub(crate) fn has_one_reference(&self) -> bool {
        let is_of_transfer = |one: &Uncertain| one.is_of_transfer();
        self.numbers.iter().all(is_of_transfer) && self.spreads.iter().all(|[k, ..]| *k == 0.0)
    }

    /// The varied values, in words.
    #[must_use]
    pub(crate) fn words(&self, loaded: &Loaded) -> Vec<String> {
        let mut words: Vec<_> = self.numbers.iter().map(Uncertain::words).collect();
        for (table, spread) in loaded.file.specimen.iter().zip(&self.spreads) {
            let [stiffness, delay, gain] = spread;
            let mut say = |std: f64, text: String| {
                if std > 0.0 {
                    words.push(format!("{text} of {}", table.name));
                }
            };
            say(
                *stiffness,
                format!("stiffness ± {:.2} %", 100.0 * stiffness),
            );
            say(*delay, format!("delay ± {:.3} ms", 1e3 * delay));
            say(*gain, format!("gain ± {:.2} %", 100.0 * gain));
        }
        if self.noisy {
            words.push("noise of the sensors".to_owned());
        }
        words
    }

    /// Overrides and other draws for the trial `number` from 1; another `attempt` draws other numbers of the file.
    #[must_use]
    pub(crate) fn draw(&self, number: u64, attempt: u64) -> (Vec<String>, Trial) {
        let normal = |channel: u64| normal_pair(self.seed, channel, number, attempt).0;
        let numbers = self.numbers.iter().enumerate();
        let sets = numbers.map(|(index, one)| one.set(normal(OF_KEYS + index as u64)));
        let specimens = self.spreads.iter().enumerate();
        let drawn = specimens.map(|(index, [stiffness, delay, gain])| {
            let at = OF_SPECIMENS + 2 * index as u64;
            let (of_stiffness, of_delay) = normal_pair(self.seed, at, number, attempt);
            let of_gain = normal(at + 1);
            let bits = normal(OF_SEEDS + index as u64).to_bits();
            Drawn {
                // At least a twentieth of the identified stiffness.
                stiffness: (1.0 + stiffness * of_stiffness).max(0.05),
                delay_s: delay * of_delay * self.pace,
                gain: (1.0 + gain * of_gain).max(0.05),
                // As large as a file may write it.
                seed: Some(bits >> 1),
            }
        });
        let trial = Trial {
            specimens: drawn.collect(),
            ..Trial::default()
        };
        (sets.collect(), trial)
    }
}
