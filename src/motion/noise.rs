//! Random motions: band-limited noise, and earthquakes after Kanai–Tajimi and Clough–Penzien.
//!
//! Both are sums of harmonics with random phases on a separate time grid, which the description alone
//! determines; the step grid reads them through the band-limited kernel. So a seed is one function of time, whatever
//! the step. Both hold nothing above a stated frequency, at most half the Nyquist frequency of that grid.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{MotionError, inside, not_negative, positive};
use super::peak;
use super::random::{Random, sum_of_lines};
use super::resample::{HALF_WIDTH, Kernel, Resample};
use super::sampled::{Origin, Sampled};
use super::shapes::{OneOf, check_taper, factor, one_of, taper};
use super::unit::{Quantity, Unit};

/// Samples beyond each end of the motion, so that the kernel sees no end.
const MARGIN: usize = HALF_WIDTH as usize + 1;
/// Halvings in the search for a turn between two samples; beside it the motion is flat.
const TURN_ROUNDS: u32 = 30;
/// Most samples of a synthetic motion.
const MOST_SAMPLES: f64 = (1_u64 << 24) as f64;

/// Noise with constant spectral density between two frequencies. It is a sum of harmonics of
/// 1/duration with equal amplitudes and random phases. Its mean is zero, and its rms before the
/// taper is exact.
///
/// Its time grid does not depend on the step of the test: duration / n, where n is a power of two.
/// The shortest period has at least 8 points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct BandLimitedNoise {
    /// Root mean square before the taper, in `unit` or the SI unit of the quantity.
    #[schemars(example = 0.5)]
    pub rms: f64,
    /// Unit of the rms. Default: the SI unit of the quantity.
    #[schemars(example = &"g")]
    pub unit: Option<Unit>,
    /// Lower frequency of the band. 0 begins with the first harmonic.
    #[schemars(example = 0.2)]
    pub from_hz: f64,
    /// Upper frequency of the band.
    #[schemars(example = 20.0)]
    pub to_hz: f64,
    /// Duration of the noise.
    #[schemars(example = 30.0)]
    pub duration_s: f64,
    /// Seed of the random phases. Equal seeds give equal motions.
    #[schemars(example = 1)]
    pub seed: u64,
    /// Test time at which the noise begins.
    #[serde(default)]
    #[schemars(example = 1.0)]
    pub start_s: f64,
    /// Length of the half-cosine taper at each end of the noise.
    #[serde(default)]
    #[schemars(example = 2.0)]
    pub taper_s: f64,
}

impl BandLimitedNoise {
    pub(super) fn sampled(&self, quantity: Quantity) -> Result<Sampled, MotionError> {
        let rms = positive("rms", self.rms)? * factor(self.unit, quantity)?;
        let from = not_negative("from_hz", self.from_hz)?;
        let to = self.to_hz;
        inside("to_hz", to, to > from, "finite and greater than from_hz")?;
        let duration = positive("duration_s", self.duration_s)?;
        let start = not_negative("start_s", self.start_s)?;
        let rise = check_taper(self.taper_s, duration)?;
        let points = 8.0 * to * duration;
        let few = points <= MOST_SAMPLES;
        inside(
            "to_hz · duration_s",
            to * duration,
            few,
            "at most 2^21 (two million cycles)",
        )?;

        // Rounding must not lose a line that lies on the edge.
        let first = (from * duration * (1.0 - 1e-12)).ceil().max(1.0) as usize;
        let last = (to * duration * (1.0 + 1e-12)).floor() as usize;
        if last < first {
            return Err(MotionError::EmptyBand {
                from_hz: from,
                to_hz: to,
                line_hz: 1.0 / duration,
            });
        }
        let amplitude = rms * (2.0 / (last - first + 1) as f64).sqrt();
        let mut random = Random::new(self.seed);
        let mut lines = vec![(0.0, 0.0); first];
        lines.extend((first..=last).map(|_| {
            let (sine, cosine) = libm::sincos(2.0 * PI * random.uniform());
            (amplitude * cosine, amplitude * sine)
        }));
        let n = (points.ceil() as usize).next_power_of_two().max(16);
        let period = sum_of_lines(&lines, n);
        let dt = duration / n as f64;
        let values = around(&period, n + 1)
            .enumerate()
            .map(|(i, value)| {
                let time = (i as f64 - MARGIN as f64) * dt;
                if rise == 0.0 {
                    value
                } else if (0.0..=duration).contains(&time) {
                    value * taper(time, duration, rise).0
                } else {
                    0.0
                }
            })
            .collect();
        Ok(synthetic(values, dt, start, duration, to))
    }
}

/// Synthetic earthquake: white noise through the filter of the ground and an envelope. Only for
/// accelerations. Source: Kanai 1957, Tajimi 1960, optionally with the second filter of Clough &
/// Penzien 1975.
///
/// The spectral density is S(ω) = S₀ (1 + 4ζ²r²) / ((1 − r²)² + 4ζ²r²), r = ω/ω_g, two-sided in
/// rad/s, up to `cutoff_hz`. The motion is Gaussian. Its time step is 1 / (4 `cutoff_hz`), whatever
/// the step of the test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct KanaiTajimi {
    /// Natural frequency of the ground, for example 2.4 Hz for firm soil. Give this or
    /// `ground_angular_frequency_rad_per_s`.
    pub ground_frequency_hz: Option<f64>,
    /// Natural angular frequency ω_g of the ground, for example 15 rad/s for firm soil. Give this
    /// or `ground_frequency_hz`.
    pub ground_angular_frequency_rad_per_s: Option<f64>,
    /// Damping ratio ζ of the ground, for example 0.6 for firm soil.
    pub ground_damping_ratio: f64,
    /// Second filter, which removes low frequencies. Default: none.
    pub clough_penzien: Option<CloughPenzien>,
    /// Change of the intensity with time.
    pub envelope: Envelope,
    /// Duration of the earthquake. The motion is zero after it.
    pub duration_s: f64,
    /// Seed of the random amplitudes. Equal seeds give equal motions.
    pub seed: u64,
    /// Peak acceleration of the continuous motion, in `unit` or m/s². The peak at the steps of the
    /// test may be slightly smaller. Give this or `s0_m2_per_s3`.
    pub peak: Option<f64>,
    /// Unit of the peak. Default: m/s².
    pub unit: Option<Unit>,
    /// Two-sided spectral density S₀ of the white noise, over the angular frequency. Its unit is
    /// m²/s³. Give this or `peak`.
    #[schemars(example = 0.01)]
    pub s0_m2_per_s3: Option<f64>,
    /// Highest frequency of the motion.
    #[serde(default = "default_cutoff")]
    #[schemars(example = 25.0)]
    pub cutoff_hz: f64,
    /// Test time at which the earthquake begins.
    #[serde(default)]
    #[schemars(example = 1.0)]
    pub start_s: f64,
}

const fn default_cutoff() -> f64 {
    50.0
}

/// Second filter of Clough and Penzien: a factor r⁴ / ((1 − r²)² + 4ζ²r²) with r = ω/ω_f. Source:
/// Clough & Penzien 1975.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct CloughPenzien {
    /// Angular frequency ω_f, for example 1.5 rad/s for firm soil.
    pub angular_frequency_rad_per_s: f64,
    /// Damping ratio ζ_f, for example 0.6 for firm soil.
    pub damping_ratio: f64,
}

/// Change of the intensity of a synthetic earthquake with time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Envelope {
    /// Constant intensity from start to end.
    None,
    /// Parabolic rise, constant part and exponential decay.
    JenningsHousner(JenningsHousner),
    /// Power of time multiplied by an exponential decay.
    SaragoniHart(SaragoniHart),
}

/// Envelope (t/t₁)² up to t₁ = `rise_s`, 1 for `strong_s`, then e^{−c t}. Source: Jennings, Housner
/// & Tsai 1969.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct JenningsHousner {
    /// Length t₁ of the rise.
    pub rise_s: f64,
    /// Length of the part with constant intensity.
    pub strong_s: f64,
    /// Decay c.
    pub decay_per_s: f64,
}

/// Envelope (t/t₀)^b e^{b(1 − t/t₀)}, which is 1 at t₀ = `peak_s`. Source: Saragoni & Hart 1974.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct SaragoniHart {
    /// Exponent b.
    #[schemars(example = 2.0)]
    pub power: f64,
    /// Time t₀ of the largest intensity.
    #[schemars(example = 5.0)]
    pub peak_s: f64,
}

impl Envelope {
    fn check(&self) -> Result<(), MotionError> {
        match self {
            Self::None => {}
            Self::JenningsHousner(e) => {
                not_negative("rise_s", e.rise_s)?;
                not_negative("strong_s", e.strong_s)?;
                not_negative("decay_per_s", e.decay_per_s)?;
            }
            Self::SaragoniHart(e) => {
                positive("power", e.power)?;
                positive("peak_s", e.peak_s)?;
            }
        }
        Ok(())
    }

    /// Factor at `time` after the start. Only the kernel uses times before the start.
    fn at(&self, time: f64) -> f64 {
        match self {
            Self::None => 1.0,
            Self::JenningsHousner(e) => {
                if time < 0.0 {
                    0.0
                } else if time < e.rise_s {
                    let s = time / e.rise_s;
                    s * s
                } else {
                    let after = time - e.rise_s - e.strong_s;
                    libm::exp(-e.decay_per_s * after.max(0.0))
                }
            }
            Self::SaragoniHart(e) => {
                if time <= 0.0 {
                    return 0.0;
                }
                let s = time / e.peak_s;
                libm::exp(e.power * (libm::log(s) + 1.0 - s))
            }
        }
    }
}

impl KanaiTajimi {
    /// Spectral density for S₀ = 1, two-sided in rad/s.
    fn density(&self, omega_g: f64, omega: f64) -> f64 {
        let damping = |ratio: f64, r: f64| 4.0 * ratio * ratio * r * r;
        let r = omega / omega_g;
        let ground = damping(self.ground_damping_ratio, r);
        let density = (1.0 + ground) / ((1.0 - r * r) * (1.0 - r * r) + ground);
        match self.clough_penzien {
            None => density,
            Some(filter) => {
                let r = omega / filter.angular_frequency_rad_per_s;
                let square = r * r;
                density * square * square
                    / ((1.0 - square) * (1.0 - square) + damping(filter.damping_ratio, r))
            }
        }
    }

    /// One period of the stationary motion for S₀ = 1, at least `duration` long, and its step.
    fn stationary(&self, omega_g: f64, duration: f64) -> (Vec<f64>, f64) {
        let dt = 0.25 / self.cutoff_hz;
        let needed = (duration / dt).ceil() as usize + 1;
        // A quarter more than needed: the end of the motion must not be the neighbour of its beginning.
        let n = (needed + needed / 4 + 2 * MARGIN).next_power_of_two();
        let line = 2.0 * PI / (n as f64 * dt);
        // cutoff · n dt = n / 4 lines.
        let mut random = Random::new(self.seed);
        let mut lines = vec![(0.0, 0.0)];
        lines.extend((1..=n / 4).map(|k| {
            let deviation = (2.0 * self.density(omega_g, k as f64 * line) * line).sqrt();
            let (a, b) = random.normal_pair();
            (deviation * a, deviation * b)
        }));
        (sum_of_lines(&lines, n), dt)
    }

    pub(super) fn sampled(&self, quantity: Quantity) -> Result<Sampled, MotionError> {
        if quantity != Quantity::Acceleration {
            return Err(MotionError::NotApplicable {
                key: "kanai_tajimi",
                what: "anything but an acceleration",
            });
        }
        let omega_g = self.checked_ground()?;
        let amplitude = one_of("peak, s0_m2_per_s3", self.peak, self.s0_m2_per_s3)?;
        let duration = positive("duration_s", self.duration_s)?;
        let start = not_negative("start_s", self.start_s)?;
        let few = 4.0 * self.cutoff_hz * duration <= MOST_SAMPLES / 4.0;
        inside("duration_s", duration, few, "at most 2^20 / cutoff_hz")?;
        self.envelope.check()?;

        let (period, dt) = self.stationary(omega_g, duration);
        let points = (duration / dt).ceil() as usize + 1;
        let mut values: Vec<f64> = around(&period, points)
            .enumerate()
            .map(|(i, v)| v * self.envelope.at((i as f64 - MARGIN as f64) * dt))
            .collect();
        let scale = match amplitude {
            OneOf::First(wanted) => {
                let wanted = positive("peak", wanted)? * factor(self.unit, quantity)?;
                let found = peak_between(&values, MARGIN as f64 + duration / dt);
                if found == 0.0 {
                    return Err(MotionError::ZeroMotion { wanted });
                }
                wanted / found
            }
            OneOf::Second(s0) => positive("s0_m2_per_s3", s0)?.sqrt(),
        };
        values.iter_mut().for_each(|v| *v *= scale);
        Ok(synthetic(values, dt, start, duration, self.cutoff_hz))
    }

    /// ω_g, with all that shapes the spectrum checked.
    fn checked_ground(&self) -> Result<f64, MotionError> {
        let frequency = one_of(
            "ground_frequency_hz, ground_angular_frequency_rad_per_s",
            self.ground_frequency_hz,
            self.ground_angular_frequency_rad_per_s,
        )?;
        positive("ground_damping_ratio", self.ground_damping_ratio)?;
        positive("cutoff_hz", self.cutoff_hz)?;
        if let Some(filter) = self.clough_penzien {
            positive(
                "angular_frequency_rad_per_s",
                filter.angular_frequency_rad_per_s,
            )?;
            positive("damping_ratio", filter.damping_ratio)?;
        }
        Ok(match frequency {
            OneOf::First(hz) => 2.0 * PI * positive("ground_frequency_hz", hz)?,
            OneOf::Second(omega) => positive("ground_angular_frequency_rad_per_s", omega)?,
        })
    }
}

/// Largest absolute value of the motion that the kernel reconstructs from samples, from the one behind the margin to position
/// `last`, also between samples. The motion holds nothing above half the Nyquist frequency. So a peak is at most 1/cos(π/4)
/// times the nearer sample beside it, and neighbours have at most one turn between them.
fn peak_between(values: &[f64], last: f64) -> f64 {
    let kernel = Kernel::without_filter();
    let at = |place: f64| kernel.value_and_slope(values, place);
    let first = MARGIN as f64;
    let places = MARGIN..=last.floor() as usize;
    let of_samples = peak(values.get(places.clone()).unwrap_or(values));
    let mut largest = of_samples.max(at(last).0.abs());
    for place in places {
        let size = |place: usize| values.get(place).map_or(0.0, |v| v.abs());
        if size(place).max(size(place + 1)) < 0.6 * of_samples {
            continue;
        }
        // Where |x| rises at one end and falls at the other, it turns.
        let (mut low, mut high) = (place as f64, (place as f64 + 1.0).min(last));
        let rises = |place: f64| {
            let (value, slope) = at(place);
            value * slope > 0.0
        };
        if !(low >= first && rises(low) && !rises(high)) {
            continue;
        }
        for _ in 0..TURN_ROUNDS {
            let middle = 0.5 * (low + high);
            if rises(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        largest = largest.max(at(low).0.abs());
    }
    largest
}

/// `points` samples of a periodic motion with a margin on both sides.
fn around(period: &[f64], points: usize) -> impl Iterator<Item = f64> + '_ {
    let n = period.len();
    // n − (MARGIN mod n) is the place of −MARGIN.
    let first = n - MARGIN % n;
    (0..points + 2 * MARGIN).map(move |i| period[(first + i) % n])
}

fn synthetic(values: Vec<f64>, dt: f64, start: f64, duration: f64, top_hz: f64) -> Sampled {
    Sampled {
        dt,
        first_time: start - MARGIN as f64 * dt,
        span: (start, start + duration),
        values,
        resample: Resample::BandLimited,
        origin: Origin::Synthetic { top_hz },
        record: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::OutOfDomain;
    use crate::{Grid, Motion, Processing, Signal};
    use gusset_quantity::assert_is;

    fn noise() -> BandLimitedNoise {
        BandLimitedNoise {
            rms: 0.5,
            unit: None,
            from_hz: 1.0,
            to_hz: 10.0,
            duration_s: 20.0,
            seed: 11,
            start_s: 0.0,
            taper_s: 0.0,
        }
    }

    fn quake() -> KanaiTajimi {
        KanaiTajimi {
            ground_frequency_hz: None,
            ground_angular_frequency_rad_per_s: Some(15.0),
            ground_damping_ratio: 0.6,
            clough_penzien: None,
            envelope: Envelope::None,
            duration_s: 20.0,
            seed: 3,
            peak: None,
            unit: None,
            s0_m2_per_s3: Some(0.01),
            cutoff_hz: 50.0,
            start_s: 0.0,
        }
    }

    fn evaluated(signal: Signal, dt: f64, steps: usize) -> Vec<f64> {
        let motion = Motion {
            signal,
            processing: Processing::default(),
            delay_s: 0.0,
        };
        motion
            .evaluate(
                Quantity::Acceleration,
                Grid::new(dt, steps).unwrap(),
                &|_| Err(std::io::ErrorKind::NotFound.into()),
            )
            .unwrap()
            .values
    }

    /// |Σ x_j e^{−2πijk/n}|² by the definition.
    fn power(x: &[f64], k: usize) -> f64 {
        let (mut re, mut im) = (0.0, 0.0);
        for (j, v) in x.iter().enumerate() {
            let angle = 2.0 * PI * (j * k % x.len()) as f64 / x.len() as f64;
            re += v * libm::cos(angle);
            im += v * libm::sin(angle);
        }
        re * re + im * im
    }

    #[test]
    fn noise_has_its_rms_inside_its_band() {
        // 20 s at 1/64 s: 1280 points, one whole period; Nyquist 32 Hz, lines of 0.05 Hz.
        let x = &evaluated(Signal::BandLimitedNoise(noise()), 1.0 / 64.0, 1280)[..1280];
        let n = x.len() as f64;
        let rms = (x.iter().map(|v| v * v).sum::<f64>() / n).sqrt();
        // The kernel is good to 1e-6 up to half its Nyquist frequency (resample.rs).
        assert!((rms / 0.5 - 1.0).abs() < 1e-6, "{rms}");
        let (mut inside, mut outside) = (0.0, 0.0);
        for k in 0..=640 {
            let p = power(x, k);
            if (20..=200).contains(&k) {
                inside += p;
                // 181 equal lines.
                let share = 2.0 * p / (n * n * 0.25 / 181.0);
                assert!((share - 1.0).abs() < 1e-4, "line {k}: {share}");
            } else {
                outside += p;
            }
        }
        assert!(outside < 1e-12 * inside, "{:e}", outside / inside);
    }

    #[test]
    fn noise_does_not_depend_on_the_step() {
        for signal in [
            Signal::BandLimitedNoise(noise()),
            Signal::KanaiTajimi(quake()),
        ] {
            // Steps that are powers of two have the same times to the bit.
            let coarse = evaluated(signal.clone(), 1.0 / 128.0, 2560);
            let fine = evaluated(signal.clone(), 1.0 / 1024.0, 20_480);
            assert!(coarse.iter().enumerate().all(|(i, v)| fine[8 * i] == *v));
            let again = evaluated(signal.clone(), 1.0 / 128.0, 2560);
            assert!(
                coarse
                    .iter()
                    .zip(&again)
                    .all(|(a, b)| a.to_bits() == b.to_bits())
            );
            // Others differ in the last bits of the time, 20 s · 2e-16, times the slope of the motion, below 100.
            let (hundredths, thousandths) = (
                evaluated(signal.clone(), 0.01, 2000),
                evaluated(signal, 0.001, 20_000),
            );
            for (i, v) in hundredths.iter().enumerate() {
                assert!((thousandths[10 * i] - v).abs() < 1e-11, "{i}");
            }
        }
    }

    #[test]
    fn another_seed_is_another_motion() {
        let other = BandLimitedNoise {
            seed: 12,
            ..noise()
        };
        let a = evaluated(Signal::BandLimitedNoise(noise()), 0.01, 1000);
        let b = evaluated(Signal::BandLimitedNoise(other), 0.01, 1000);
        let product: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum::<f64>() / 1000.0;
        // 90 independent lines over 10 s: correlation 0.25/√90 = 0.026 of standard error, times four.
        assert!(product.abs() < 0.11, "{product}");
    }

    #[test]
    fn tapered_noise_starts_and_ends_at_rest() {
        let tapered = BandLimitedNoise {
            taper_s: 2.0,
            start_s: 1.0,
            ..noise()
        };
        let x = evaluated(Signal::BandLimitedNoise(tapered), 0.01, 2300);
        assert!(x[..=100].iter().all(|v| v.abs() < 1e-9));
        assert!(x[2100..].iter().all(|v| v.abs() < 1e-9));
        assert!(x[300..1900].iter().any(|v| v.abs() > 0.5));
    }

    #[test]
    fn kanai_tajimi_variance_is_exact() {
        // σ² = π S₀ ω_g (1 + 4ζ²) / 2ζ, less the part above the cutoff: S → 4ζ²ω_g²/ω² there, so that
        // 2 ∫_Ω^∞ S dω = 8 ζ² ω_g² / Ω (1 + O(ω_g²/Ω²)).
        let quake = quake();
        let (omega_g, zeta) = (15.0, 0.6_f64);
        let (x, dt) = quake.stationary(omega_g, 2000.0);
        let whole = PI * omega_g * (1.0 + 4.0 * zeta * zeta) / (2.0 * zeta);
        let top = 2.0 * PI * 50.0;
        let lost = 8.0 * zeta * zeta * omega_g * omega_g / top;
        let found = x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64;
        // The mean square over a period is ½ Σ (a² + b²) of normal a, b: mean Σσ², variance Σσ⁴, σ² = 2SΔω.
        let line = 2.0 * PI / (x.len() as f64 * dt);
        let spread: f64 = (1..=x.len() / 4)
            .map(|k| (2.0 * quake.density(omega_g, k as f64 * line) * line).powi(2))
            .sum::<f64>()
            .sqrt();
        assert!(
            spread < 0.02 * whole,
            "the realisation is long enough: {spread}"
        );
        let error = found - (whole - lost);
        // Four standard errors and the next term of the tail, (ω_g/Ω)² of it.
        let tail = lost * (omega_g / top).powi(2) * 10.0;
        assert!(
            error.abs() < 4.0 * spread + tail,
            "{error} {spread} {whole}"
        );
        // And the lost part is really lost: without the correction the formula is 2 % off.
        assert!((lost / whole - 0.0216).abs() < 0.001);
    }

    #[test]
    fn spectrum_of_a_realisation_is_correct() {
        let with = KanaiTajimi {
            clough_penzien: Some(CloughPenzien {
                angular_frequency_rad_per_s: 1.5,
                damping_ratio: 0.6,
            }),
            ..quake()
        };
        for quake in [quake(), with] {
            let (x, dt) = quake.stationary(15.0, 120.0);
            let n = x.len();
            let line = 2.0 * PI / (n as f64 * dt);
            // Bands of m lines around rest, the ground's frequency and above; the mean of m exponential
            // numbers scatters by 1/√m.
            let m = 100;
            for first in [1, 250, 1200] {
                let (mut found, mut wanted) = (0.0, 0.0);
                for k in first..first + m {
                    // (a² + b²)/4 n² at line k, with a², b² of mean 2SΔω.
                    found += power(&x, k) / (n as f64 * n as f64) / line;
                    let omega = k as f64 * line;
                    // Written out once more, on its own.
                    let kt = (15.0_f64.powi(4) + (2.0 * 0.6 * 15.0 * omega).powi(2))
                        / ((225.0 - omega * omega).powi(2) + (2.0 * 0.6 * 15.0 * omega).powi(2));
                    let cp = quake.clough_penzien.map_or(1.0, |_| {
                        omega.powi(4)
                            / ((2.25 - omega * omega).powi(2) + (2.0 * 0.6 * 1.5 * omega).powi(2))
                    });
                    wanted += kt * cp;
                }
                let ratio = found / wanted;
                assert!(
                    (ratio - 1.0).abs() < 4.0 / (m as f64).sqrt(),
                    "{first}: {ratio}"
                );
            }
        }
    }

    #[test]
    fn earthquake_has_its_peak_and_envelope() {
        let quake = KanaiTajimi {
            envelope: Envelope::JenningsHousner(JenningsHousner {
                rise_s: 3.0,
                strong_s: 6.0,
                decay_per_s: 0.5,
            }),
            s0_m2_per_s3: None,
            peak: Some(0.3),
            unit: Some(Unit::Gravity),
            ..quake()
        };
        // Its own grid is 5 ms: the peak lies between its samples. Nowhere is it passed, and 1/80 of a sample misses at most
        // (2π · 50 Hz · 0.005 s/80/2)²/2 = 5e-5 of it.
        let fine = peak(&evaluated(
            Signal::KanaiTajimi(quake.clone()),
            0.005 / 80.0,
            400_000,
        ));
        let wanted = 0.3 * 9.806_65;
        assert!(fine <= wanted * (1.0 + 1e-12), "{fine}");
        assert!(fine >= wanted * (1.0 - 5e-5), "{fine}");
        let x = evaluated(Signal::KanaiTajimi(quake.clone()), 0.005, 5000);
        let found = peak(&x);
        assert!(found < 0.999 * wanted, "not at a sample: {found}");
        assert_eq!(x[0], 0.0);
        assert!(peak(&x[3600..4000]) < 0.1 * found);
        assert!(x[4001..].iter().all(|v| *v == 0.0));

        let jennings = quake.envelope;
        for (t, factor) in [
            (1.5, 0.25),
            (3.0, 1.0),
            (9.0, 1.0),
            (11.0, libm::exp(-1.0_f64)),
        ] {
            assert!((jennings.at(t) - factor).abs() < 1e-15);
        }
        // Without a rise it begins at once; what the kernel looks at before the start is nothing.
        let sudden = Envelope::JenningsHousner(JenningsHousner {
            rise_s: 0.0,
            strong_s: 1.0,
            decay_per_s: 0.5,
        });
        for (t, factor) in [(-0.5, 0.0), (0.0, 1.0), (0.5, 1.0)] {
            assert_eq!(sudden.at(t), factor);
        }
        let saragoni = Envelope::SaragoniHart(SaragoniHart {
            power: 2.0,
            peak_s: 4.0,
        });
        // t² e^{−t/2}, divided by its value at 4.
        for t in [0.0_f64, 1.0, 4.0, 12.0] {
            let exact = t * t * libm::exp(-t / 2.0) / (16.0 * libm::exp(-2.0_f64));
            assert!((saragoni.at(t) - exact).abs() < 1e-15);
        }
    }

    #[test]
    fn invalid_noise_is_refused() {
        let refuse = |noise: BandLimitedNoise| noise.sampled(Quantity::Force).err().unwrap();
        assert_is!(
            refuse(BandLimitedNoise { to_hz: 1.0, ..noise() })
            => MotionError::Parameter(OutOfDomain { name: "to_hz", found: 1.0, .. })
        );
        assert_is!(
            refuse(BandLimitedNoise { from_hz: 1.01, to_hz: 1.04, ..noise() })
            => MotionError::EmptyBand { line_hz: 0.05, .. }
        );
        assert_is!(
            refuse(BandLimitedNoise { rms: f64::NAN, ..noise() })
            => MotionError::Parameter(OutOfDomain { name: "rms", .. })
        );
        assert_is!(
            refuse(BandLimitedNoise { taper_s: 11.0, ..noise() })
            => MotionError::Parameter(OutOfDomain { name: "taper_s", found: 11.0, .. })
        );
        assert_is!(
            refuse(BandLimitedNoise { duration_s: 1e12, ..noise() })
            => MotionError::Parameter(OutOfDomain { name: "to_hz · duration_s", .. })
        );
        let refuse = |quake: KanaiTajimi| quake.sampled(Quantity::Acceleration).err().unwrap();
        assert_is!(
            refuse(KanaiTajimi { peak: Some(1.0), ..quake() })
            => MotionError::ExactlyOne { names: "peak, s0_m2_per_s3", found: 2 }
        );
        assert_is!(
            refuse(KanaiTajimi { s0_m2_per_s3: None, ..quake() })
            => MotionError::ExactlyOne { found: 0, .. }
        );
        assert_is!(
            refuse(KanaiTajimi { ground_damping_ratio: 0.0, ..quake() })
            => MotionError::Parameter(OutOfDomain { name: "ground_damping_ratio", found: 0.0, .. })
        );
        assert_is!(
            refuse(KanaiTajimi { duration_s: 1e9, ..quake() })
            => MotionError::Parameter(_)
        );
        assert!(quake().sampled(Quantity::Displacement).is_err());
    }
}
