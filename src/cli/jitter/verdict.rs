//! The verdict of `gusset jitter`: which rates the measurement speaks for, and which against.
//!
//! The measured rate is judged by its deadline misses. Another rate is judged only as far as the same ticks speak for it.
//! A lower rate is expected to be kept if no tick took longer than its period. A higher rate is expected to be missed
//! if a tick took longer than its period; that it is kept is never inferred, because ticks between the measured ones are unknown.

use serde_json::{Value, json};

use crate::record::MissClasses;
use crate::units::{duration, rate};

/// Rates of usual hybrid tests, Hz.
const RATES: [f64; 5] = [256.0, 512.0, 1024.0, 2048.0, 4096.0];
/// A shorter measurement does not meet rare interruptions, s.
const ENOUGH_S: f64 = 60.0;

/// A measurement.
pub(super) struct Measured<'a> {
    /// Ticks per second.
    pub rate_hz: f64,
    /// Wall time, s.
    pub seconds: f64,
    /// Deadline misses.
    pub misses: u64,
    /// Their causes.
    pub causes: MissClasses,
    /// Histograms as in `timing.json`, in µs.
    pub bins: &'a Value,
    /// Whether another core was under load.
    pub loaded: bool,
    /// Whether all real-time rights were granted.
    pub granted: bool,
}

/// An expectation for another rate.
struct Expected {
    rate_hz: f64,
    /// Ticks that took longer than its period.
    late: u64,
}

impl Measured<'_> {
    /// The verdict in one line.
    pub(super) fn words(&self) -> String {
        let time = duration(self.seconds.round().max(0.001));
        let load = if self.loaded { "under" } else { "without" };
        let found = match self.misses {
            0 => format!("yes, no miss in {time} {load} load"),
            1 => format!("no, 1 miss in {time}, {}", self.causes_in_words()),
            misses => format!("no, {misses} misses in {time}, {}", self.causes_in_words()),
        };
        let mut parts = vec![format!("fit for {}: {found}", rate(self.rate_hz))];
        let expected = self.expected();
        for (word, kept) in [("yes", true), ("no", false)] {
            let rates = expected.iter().filter(|one| (one.late == 0) == kept);
            let rates: Vec<String> = rates.map(|one| format!("{:.0}", one.rate_hz)).collect();
            if !rates.is_empty() {
                parts.push(format!("expected for {} Hz: {word}", rates.join(", ")));
            }
        }
        if !self.granted {
            parts.push("not all real-time rights were granted".to_owned());
        }
        if self.misses == 0 && self.seconds < ENOUGH_S {
            parts.push(format!(
                "measure {ENOUGH_S} s or more before you rely on it"
            ));
        }
        parts.join("; ")
    }

    /// The verdict for programs.
    pub(super) fn as_json(&self) -> Value {
        let expected = self.expected();
        let expected = expected.iter().map(
            |one| json!({ "rate_hz": one.rate_hz, "fit": one.late == 0, "late_ticks": one.late }),
        );
        json!({
            "text": self.words(),
            "rate_hz": self.rate_hz,
            "fit": self.misses == 0,
            "misses": self.misses,
            "seconds": self.seconds,
            "expected": expected.collect::<Vec<_>>(),
        })
    }

    fn causes_in_words(&self) -> String {
        let known = &self.causes;
        let causes = [
            (known.taken_away, "by the hypervisor"),
            (known.preempted, "by other threads"),
            (known.late_reply, "by late replies"),
            (known.ours, "by the loop itself"),
            (
                self.misses.saturating_sub(known.total()),
                "of unknown cause",
            ),
        ];
        let causes: Vec<_> = causes.iter().filter(|(count, _)| *count > 0).collect();
        match causes[..] {
            [(_, words)] if self.misses > 1 => format!("all {words}"),
            [(_, words)] => (*words).to_owned(),
            _ => {
                let each = causes
                    .iter()
                    .map(|(count, words)| format!("{count} {words}"));
                each.collect::<Vec<_>>().join(", ")
            }
        }
    }

    /// The usual rates for which the measured ticks say something.
    fn expected(&self) -> Vec<Expected> {
        let own_us = 1e6 / self.rate_hz;
        let mut found = Vec::new();
        for rate_hz in RATES {
            let period_us = 1e6 / rate_hz;
            if (rate_hz - self.rate_hz).abs() < 1e-6 * rate_hz {
                continue;
            }
            let (surely, perhaps) = self.longer_than(period_us, own_us);
            let kept = perhaps == 0 && rate_hz < self.rate_hz && self.has_ticks();
            if kept || surely > 0 {
                found.push(Expected {
                    rate_hz,
                    late: surely,
                });
            }
        }
        found
    }

    fn has_ticks(&self) -> bool {
        ["slack", "miss"]
            .iter()
            .any(|key| self.cells(key).next().is_some())
    }

    /// Ticks that took longer than `period_us` from their edge to their end, by the near and by the far end of their bins.
    fn longer_than(&self, period_us: f64, own_us: f64) -> (u64, u64) {
        let early = self
            .cells("slack")
            .map(|(low, high, count)| (own_us - high, own_us - low, count));
        let late = self
            .cells("miss")
            .map(|(low, high, count)| (own_us + low, own_us + high, count));
        early
            .chain(late)
            .fold((0, 0), |(surely, perhaps), (low, high, count)| {
                let add = |sum: u64, end: f64| if end > period_us { sum + count } else { sum };
                (add(surely, low), add(perhaps, high))
            })
    }

    /// Ends in µs and count of every bin.
    fn cells(&self, key: &str) -> impl Iterator<Item = (f64, f64, u64)> {
        let bins = self.bins[key]["bins"].as_array().into_iter().flatten();
        bins.filter_map(|bin| {
            let number = |place: usize| bin.get(place)?.as_f64();
            Some((number(0)?, number(1)?, bin.get(2)?.as_u64()?))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(bins: &Value, misses: u64, causes: MissClasses) -> Measured<'_> {
        Measured {
            rate_hz: 1024.0,
            seconds: 60.2,
            misses,
            causes,
            bins,
            loaded: false,
            granted: true,
        }
    }

    #[test]
    fn rate_without_a_miss_is_fit_and_no_higher_rate_is_inferred() {
        // Ticks of 1024 Hz have 976.5625 µs. All ended within 477 µs: 2048 Hz has 488 µs, 4096 Hz has 244 µs.
        let bins = json!({ "slack": { "bins": [[500.0, 501.0, 7], [970.0, 971.0, 61_000]] } });
        let found = measured(&bins, 0, MissClasses::default());
        let words = found.words();
        assert_eq!(
            words,
            "fit for 1024 Hz: yes, no miss in 60 s without load; expected for 256, 512 Hz: yes; expected for 4096 Hz: no"
        );
        let json = found.as_json();
        assert_eq!((&json["fit"], &json["text"]), (&true.into(), &words.into()));
        assert_eq!(json["expected"][2]["late_ticks"], 7);
    }

    #[test]
    fn miss_is_told_with_its_cause_and_forbids_the_rates_with_shorter_periods() {
        // The end of the tick was 976.6 + 1500 µs after its edge: more than 512 Hz has, and less than 256 Hz has.
        let bins = json!({
            "slack": { "bins": [[970.0, 971.0, 61_000]] },
            "miss": { "bins": [[1500.0, 1501.0, 3]] },
        });
        let causes = MissClasses {
            taken_away: 3,
            ..MissClasses::default()
        };
        let found = measured(&bins, 3, causes);
        let words = found.words();
        assert!(
            words.starts_with("fit for 1024 Hz: no, 3 misses in 60 s, all by the hypervisor; "),
            "{words}"
        );
        let fit = |hz: f64| {
            let json = found.as_json();
            let all = json["expected"].as_array().unwrap().clone();
            let one = all.iter().find(|one| one["rate_hz"] == hz);
            one.map(|one| one["fit"] == true)
        };
        let all = [256.0, 512.0, 1024.0, 2048.0, 4096.0].map(fit);
        assert_eq!(
            all,
            [Some(true), Some(false), None, Some(false), Some(false)]
        );
        let mixed = MissClasses {
            taken_away: 1,
            ours: 1,
            ..MissClasses::default()
        };
        let words = measured(&bins, 3, mixed).words();
        assert!(
            words.contains("1 by the hypervisor, 1 by the loop itself, 1 of unknown cause"),
            "{words}"
        );
    }

    #[test]
    fn short_measurement_and_missing_rights_are_told() {
        let bins = json!({});
        let found = Measured {
            seconds: 2.0,
            granted: false,
            loaded: true,
            ..measured(&bins, 0, MissClasses::default())
        };
        assert_eq!(
            found.words(),
            "fit for 1024 Hz: yes, no miss in 2 s under load; not all real-time rights were granted; \
             measure 60 s or more before you rely on it"
        );
    }
}
