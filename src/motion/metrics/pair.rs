//! Spectral acceleration of two horizontal components together: geometric mean, RotD50 and RotD100.
//!
//! Both components act on the same oscillator, u_x and u_y. In the direction θ the response is u_x cos θ + u_y sin θ. RotD50 is the
//! median of its largest values over θ = 0°, 1° … 179°, RotD100 the largest of them (Boore 2010). The geometric mean is that of
//! the unturned components. The oscillator is that of [`super::spectrum`].

use std::f64::consts::TAU;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::spectrum::{Bank, LANES, Lane, MOST_POINTS, Motion, NEAR, POINTS, response_spectrum};
use super::spectrum::{first_turn, turning_point};

/// Directions, one for each degree of half a turn.
const DIRECTIONS: usize = 180;

/// Measure of the spectral acceleration of two components together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PairMeasure {
    /// Square root of the product of both spectral accelerations.
    #[serde(rename = "geometric_mean")]
    GeometricMean,
    /// Median over all horizontal directions.
    RotD50,
    /// Largest of all horizontal directions.
    RotD100,
}

impl PairMeasure {
    /// The measure in words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::GeometricMean => "geometric mean",
            Self::RotD50 => "RotD50",
            Self::RotD100 => "RotD100",
        }
    }
}

/// Pseudo-spectral accelerations in m/s² of a pair of accelerations (m/s²) sampled every `dt` s at the same times, for each of these
/// `periods` (s) and this damping `ratio`. A component that ends first is zero after its end. Empty outside the domain of
/// [`response_spectrum`].
#[must_use]
pub fn pair_spectrum(
    measure: PairMeasure,
    pair: [&[f64]; 2],
    dt: f64,
    periods: &[f64],
    ratio: f64,
) -> Vec<f64> {
    let alone = pair.map(|accel| response_spectrum(accel, dt, periods, ratio));
    if alone.iter().any(|one| one.len() != periods.len()) {
        return Vec::new();
    }
    if measure == PairMeasure::GeometricMean {
        let [x, y] = &alone;
        let both = x.iter().zip(y);
        return both
            .map(|(x, y)| (x.pseudo_accel * y.pseudo_accel).sqrt())
            .collect();
    }
    let moving = |accel: &[f64]| accel.iter().rposition(|a| *a != 0.0 && a.is_finite());
    // One point more: the last step of both ends at zero.
    let points = pair
        .map(moving)
        .into_iter()
        .flatten()
        .max()
        .map_or(0, |last| last + 2);
    let mut found = Vec::with_capacity(periods.len());
    for group in periods.chunks(LANES) {
        let shortest = group.iter().copied().fold(f64::INFINITY, f64::min);
        let parts = (POINTS * dt / shortest).ceil().clamp(1.0, MOST_POINTS);
        let omega: Lane = std::array::from_fn(|i| TAU / group.get(i).copied().unwrap_or(shortest));
        let mut directions = Directions::new(Bank::new(&omega, ratio, dt / parts));
        directions.shake(pair, points, parts);
        for (lane, period) in group.iter().enumerate() {
            let omega = TAU / period;
            found.push(omega * omega * directions.measure(measure, lane));
        }
    }
    found
}

/// Largest displacements of the oscillators of a bank in every direction.
struct Directions {
    bank: Bank,
    /// Cosine and sine of each direction.
    turns: Vec<(f64, f64)>,
    /// Of each oscillator, the largest |displacement| in each direction.
    tops: Vec<[f64; DIRECTIONS]>,
    /// The least of them.
    least: Lane,
}

impl Directions {
    fn new(bank: Bank) -> Self {
        let turn = |degree: usize| {
            let (sine, cosine) = libm::sincos((degree as f64).to_radians());
            (cosine, sine)
        };
        Self {
            bank,
            turns: (0..DIRECTIONS).map(turn).collect(),
            tops: vec![[0.0; DIRECTIONS]; LANES],
            least: [0.0; LANES],
        }
    }

    /// From rest along `points` accelerations, with `parts` steps between two of them, and the free vibration after.
    fn shake(&mut self, pair: [&[f64]; 2], points: usize, parts: f64) {
        let load = |accel: &[f64], at: usize| {
            let found = accel.get(at).copied().filter(|a| a.is_finite());
            -found.unwrap_or(0.0)
        };
        let mut now = [Motion::rest(), Motion::rest()];
        for at in 1..points {
            let ends = pair.map(|accel| (load(accel, at - 1), load(accel, at)));
            for part in 0..parts as usize {
                let before = now;
                for (now, (from, to)) in now.iter_mut().zip(ends) {
                    let change = (to - from) / parts;
                    let start = from + change * part as f64;
                    self.bank.advance(now, start, change / self.bank.step);
                }
                for lane in 0..LANES {
                    self.note(lane, &before, &now);
                }
            }
        }
        for lane in 0..LANES {
            let [x, y] = now.map(|now| (now.disp[lane], now.vel[lane]));
            let (omega, ratio) = (self.bank.omega[lane], self.bank.ratio);
            for (top, (cosine, sine)) in self.tops[lane].iter_mut().zip(&self.turns) {
                let along = |x: f64, y: f64| x * cosine + y * sine;
                let first = first_turn([omega, ratio], along(x.0, y.0), along(x.1, y.1));
                *top = top.max(first.abs());
            }
        }
    }

    /// Keeps the largest displacements of an oscillator within a step.
    fn note(&mut self, lane: usize, before: &[Motion; 2], now: &[Motion; 2]) {
        let of = |motion: &[Motion; 2]| {
            let [x, y] = motion;
            let disp = [x.disp[lane], y.disp[lane]];
            (disp, [x.vel[lane], y.vel[lane]])
        };
        let ((disp_0, vel_0), (disp_1, vel_1)) = (of(before), of(now));
        let reach = |[x, y]: [f64; 2]| libm::hypot(x, y);
        // No direction moves further than both together.
        if reach(disp_0).max(reach(disp_1)) < NEAR * self.least[lane] {
            return;
        }
        let step = self.bank.step;
        let mut least = f64::INFINITY;
        for (top, (cosine, sine)) in self.tops[lane].iter_mut().zip(&self.turns) {
            let along = |[x, y]: [f64; 2]| x * cosine + y * sine;
            let ends = [along(disp_0), along(disp_1)];
            let rates = [along(vel_0), along(vel_1)];
            *top = top.max(ends[1].abs());
            let is_near = ends[0].abs().max(ends[1].abs()) >= NEAR * *top;
            if is_near && rates[0] * rates[1] < 0.0 {
                *top = top.max(turning_point(ends, rates, step).abs());
            }
            least = least.min(*top);
        }
        self.least[lane] = least;
    }

    /// The measure of one oscillator's displacements.
    fn measure(&mut self, measure: PairMeasure, lane: usize) -> f64 {
        let tops = &mut self.tops[lane];
        tops.sort_unstable_by(f64::total_cmp);
        match measure {
            PairMeasure::RotD100 => tops[DIRECTIONS - 1],
            _ => 0.5 * (tops[DIRECTIONS / 2 - 1] + tops[DIRECTIONS / 2]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use PairMeasure::{GeometricMean, RotD50, RotD100};

    /// Accelerations of a pair: sums of sines under half a sine, 801 values 2 ms apart.
    fn pair() -> [Vec<f64>; 2] {
        let of = |parts: [(f64, f64, f64); 3]| {
            let at = |i: u32| {
                let t = 0.002 * f64::from(i);
                let window = libm::sin(std::f64::consts::PI * t / 1.6);
                let part = |(a, w, p): (f64, f64, f64)| a * libm::sin(w * t + p);
                window * parts.into_iter().map(part).sum::<f64>()
            };
            (0..=800).map(at).collect()
        };
        [
            of([(1.7, 7.0, 0.3), (1.1, 13.0, 1.9), (0.4, 31.0, 0.0)]),
            of([(0.9, 6.0, 2.2), (1.6, 17.0, 0.7), (0.3, 41.0, 1.1)]),
        ]
    }

    #[test]
    fn measures_of_a_pair_are_independent_ones() {
        // From an independent script: the oscillator as one complex pole, q' = s q − a(t) with s = −ζω + iω_d and u = Im q/ω_d, exact
        // along the straight lines of a(t), at four points between two samples; after the record 6000 points of 1.2 periods of free
        // vibration; the peak of each direction from the quartic through five points. Sa = ω² max |u_x cos θ + u_y sin θ|.
        let wanted = [
            (0.5, [5.22475895059668, 5.70799200038122, 6.69288209473721]),
            (0.8, [3.57344889471053, 4.21870897332201, 5.72794123106215]),
            (1.5, [1.54643139893182, 1.55987864306397, 1.87757979546098]),
        ];
        let [x, y] = pair();
        for (period, each) in wanted {
            for (measure, wanted) in [GeometricMean, RotD50, RotD100].into_iter().zip(each) {
                let found = pair_spectrum(measure, [&x, &y], 0.002, &[period], 0.05)[0];
                assert!(
                    (found / wanted - 1.0).abs() < 1e-9,
                    "{period} {measure:?}: {found} {wanted}"
                );
            }
        }
    }

    #[test]
    fn equal_components_move_along_45_degrees() {
        // u_x = u_y = u: the response in the direction θ is u·√2·cos(θ − 45°). Its largest is √2 u; 45° away, both middle values of
        // the median are √2 u cos 45° = u.
        let x = &pair()[0];
        let alone = response_spectrum(x, 0.002, &[0.5], 0.05)[0].pseudo_accel;
        let of = |measure| pair_spectrum(measure, [x, x], 0.002, &[0.5], 0.05)[0] / alone;
        let root = std::f64::consts::SQRT_2;
        assert!((of(GeometricMean) - 1.0).abs() < 1e-12);
        assert!((of(RotD100) - root).abs() < 1e-9, "{}", of(RotD100));
        assert!((of(RotD50) - 1.0).abs() < 1e-12, "{}", of(RotD50));
    }

    #[test]
    fn turning_both_components_keeps_rotd100() {
        let [x, y] = pair();
        let (sine, cosine) = libm::sincos(37f64.to_radians());
        let both = || x.iter().zip(&y);
        let turned: [Vec<f64>; 2] = [
            both().map(|(x, y)| x * cosine - y * sine).collect(),
            both().map(|(x, y)| x * sine + y * cosine).collect(),
        ];
        for measure in [RotD50, RotD100] {
            let of = |x: &[f64], y: &[f64]| pair_spectrum(measure, [x, y], 0.002, &[0.4], 0.05)[0];
            let ratio = of(&turned[0], &turned[1]) / of(&x, &y);
            assert!((ratio - 1.0).abs() < 1e-12, "{measure:?} {ratio}");
        }
    }

    #[test]
    fn one_silent_component_leaves_the_other() {
        let x = &pair()[0];
        let alone = response_spectrum(x, 0.002, &[0.3, 0.9], 0.05);
        let found = pair_spectrum(RotD100, [x, &[0.0]], 0.002, &[0.3, 0.9], 0.05);
        for (found, alone) in found.iter().zip(alone) {
            assert!((found / alone.pseudo_accel - 1.0).abs() < 1e-12);
        }
        assert!(pair_spectrum(RotD50, [x, &[]], 0.002, &[0.3], 0.05).is_empty());
    }
}
