//! The verdict of `gusset jitter`: which rates the measurement speaks for, and which against.
//!
//! The measured rate is judged by its deadline misses. Another rate is judged only as far as the same ticks speak for it.
//! A lower rate is expected to be kept if no tick took longer than its period. A higher rate is expected to be missed
//! if a tick took longer than its period; that it is kept is never inferred, because ticks between the measured ones are unknown.
//!
//! Without all real-time rights the ticks say nothing about the computer: no rate is judged. An interrupted or too short
//! measurement can show that a rate is missed, but not that it is kept.

use serde_json::{Value, json};

use gusset_quantity::units::{duration, number, rate};
use gusset_record::MissClasses;
use gusset_record::rt::timing::{Quantity, Timings};

/// Rates of usual hybrid tests, Hz.
const RATES: [f64; 5] = [256.0, 512.0, 1024.0, 2048.0, 4096.0];
/// A shorter measurement does not meet rare interruptions, s.
const ENOUGH_S: f64 = 60.0;

/// A measurement.
#[derive(Debug)]
pub struct Measured<'a> {
    /// Ticks per second.
    pub rate_hz: f64,
    /// Wall time, s.
    pub seconds: f64,
    /// Deadline misses.
    pub misses: u64,
    /// Their causes.
    pub causes: MissClasses,
    /// Histograms as in `timing.json`, in µs.
    pub bins: &'a Timings,
    /// Whether another core was under load.
    pub loaded: bool,
    /// Whether all real-time rights were granted.
    pub granted: bool,
    /// Whether it was completed.
    pub complete: bool,
}

/// An expectation for another rate.
struct Expected {
    rate_hz: f64,
    /// Ticks that took longer than its period.
    late: u64,
}

impl Measured<'_> {
    /// The verdict in one line.
    #[must_use]
    pub fn words(&self) -> String {
        let time = if self.seconds < 1.0 {
            duration(self.seconds)
        } else {
            format!("{} s", number(self.seconds))
        };
        let load = if self.loaded { "under" } else { "without" };
        let found = match self.misses {
            0 => format!("no miss in {time} {load} load"),
            1 => format!("1 miss in {time}, {}", self.causes_in_words()),
            misses => format!("{misses} misses in {time}, {}", self.causes_in_words()),
        };
        let fit = match self.fit(self.misses) {
            Some(true) => "yes",
            Some(false) => "no",
            None => "not known",
        };
        let mut parts = vec![format!("fit for {}: {fit}, {found}", rate(self.rate_hz))];
        let expected = self.expected();
        for (word, fit) in [("yes", true), ("no", false)] {
            let rates = expected
                .iter()
                .filter(|one| self.fit(one.late) == Some(fit));
            let rates: Vec<String> = rates.map(|one| format!("{:.0}", one.rate_hz)).collect();
            if !rates.is_empty() {
                parts.push(format!("expected for {} Hz: {word}", rates.join(", ")));
            }
        }
        parts.extend(self.reservations());
        parts.join("; ")
    }

    /// The verdict for programs. `fit` is null where it is not known.
    #[must_use]
    pub fn as_json(&self) -> Value {
        let expected = self.expected();
        let expected = expected.iter().map(|one| {
            json!({ "rate_hz": one.rate_hz, "fit": self.fit(one.late), "late_ticks": one.late })
        });
        json!({
            "text": self.words(),
            "rate_hz": self.rate_hz,
            "fit": self.fit(self.misses),
            "reservations": self.reservations(),
            "misses": self.misses,
            "seconds": self.seconds,
            "needed_seconds": ENOUGH_S,
            "complete": self.complete,
            "granted": self.granted,
            "loaded": self.loaded,
            "expected": expected.collect::<Vec<_>>(),
        })
    }

    /// Whether a rate with `late` late ticks is kept. `None` where the measurement cannot show it.
    fn fit(&self, late: u64) -> Option<bool> {
        match (self.granted, late) {
            (false, _) => None,
            (true, 0) => (self.complete && self.is_long_enough()).then_some(true),
            (true, _) => Some(false),
        }
    }

    fn is_long_enough(&self) -> bool {
        // The last tick begins one period before the end.
        self.seconds + self.rate_hz.recip() >= ENOUGH_S
    }

    /// Reasons that prevent a verdict.
    fn reservations(&self) -> Vec<String> {
        let unproven = self.misses == 0;
        let each = [
            (
                !self.granted,
                "not all real-time rights were granted".to_owned(),
            ),
            (
                !self.complete,
                "the measurement ended before its time".to_owned(),
            ),
            (
                unproven && !self.is_long_enough(),
                format!("measure {ENOUGH_S} s or more before you rely on it"),
            ),
        ];
        let each = each.into_iter().filter(|(holds, _)| *holds);
        each.map(|(_, words)| words).collect()
    }

    fn causes_in_words(&self) -> String {
        let known = &self.causes;
        let causes = [
            (known.taken_away, "by the hypervisor"),
            (known.preempted, "by other threads"),
            (known.stopped, "by a stop of the process"),
            (known.late_reply, "by late replies"),
            (known.ours, "by the loop itself"),
            (
                known.unknown + self.misses.saturating_sub(known.total()),
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

    /// The usual rates that the measured ticks can judge.
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
        [Quantity::Slack, Quantity::Miss]
            .iter()
            .any(|quantity| !self.bins.bins(*quantity).is_empty())
    }

    /// Ticks that took longer than `period_us` from their edge to their end, by the lower and the upper end of their bins.
    fn longer_than(&self, period_us: f64, own_us: f64) -> (u64, u64) {
        let early = self.bins.bins(Quantity::Slack).iter();
        let early = early.map(|(low, high, count)| (own_us - high, own_us - low, *count));
        let late = self.bins.bins(Quantity::Miss).iter();
        let late = late.map(|(low, high, count)| (own_us + low, own_us + high, *count));
        early
            .chain(late)
            .fold((0, 0), |(surely, perhaps), (low, high, count)| {
                let add = |sum: u64, end: f64| if end > period_us { sum + count } else { sum };
                (add(surely, low), add(perhaps, high))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(bins: &Timings, misses: u64, causes: MissClasses) -> Measured<'_> {
        Measured {
            rate_hz: 1024.0,
            seconds: 60.2,
            misses,
            causes,
            bins,
            loaded: false,
            granted: true,
            complete: true,
        }
    }

    #[test]
    fn rate_without_misses_is_fit() {
        // Ticks of 1024 Hz have 976.5625 µs. All ended within 477 µs: 2048 Hz has 488 µs, 4096 Hz has 244 µs.
        let bins =
            json!({ "slack": { "bins": [[500.0, 501.0, 7], [970.0, 971.0, 61_000]] } }).into();
        let found = measured(&bins, 0, MissClasses::default());
        let words = found.words();
        assert_eq!(
            words,
            "fit for 1024 Hz: yes, no miss in 60.2 s without load; expected for 256, 512 Hz: yes; expected for 4096 Hz: no"
        );
        let json = found.as_json();
        assert_eq!((&json["fit"], &json["text"]), (&true.into(), &words.into()));
        assert_eq!(json["expected"][2]["late_ticks"], 7);
    }

    #[test]
    fn miss_forbids_rates_with_shorter_periods() {
        // The end of the tick was 976.6 + 1500 µs after its edge: more than 512 Hz has, and less than 256 Hz has.
        let bins = json!({
            "slack": { "bins": [[970.0, 971.0, 61_000]] },
            "miss": { "bins": [[1500.0, 1501.0, 3]] },
        })
        .into();
        let causes = MissClasses {
            taken_away: 3,
            ..MissClasses::default()
        };
        let found = measured(&bins, 3, causes);
        let words = found.words();
        assert!(
            words.contains(": no, 3 misses") && words.contains("hypervisor"),
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
            words.contains("hypervisor, 1") && words.contains("1 of unknown"),
            "{words}"
        );
    }

    #[test]
    fn verdict_needs_rights_and_enough_time() {
        let bins = json!({ "slack": { "bins": [[500.0, 501.0, 7], [970.0, 971.0, 300]] } }).into();
        let whole = || measured(&bins, 0, MissClasses::default());
        let short = Measured {
            seconds: 0.2996,
            loaded: true,
            ..whole()
        };
        let text = short.words();
        assert!(
            text.contains("not known") && text.contains("299.6 ms"),
            "{text}"
        );
        // Ticks that are too long for a rate are enough to forbid it.
        let fits = |found: &Measured<'_>| {
            let json = found.as_json();
            let expected = json["expected"].as_array().unwrap();
            let of = |hz: f64| {
                let one = expected.iter().find(|one| one["rate_hz"] == hz);
                one.unwrap()["fit"].as_bool()
            };
            (json["fit"].as_bool(), of(256.0), of(4096.0))
        };
        assert_eq!(fits(&short), (None, None, Some(false)));
        let interrupted = Measured {
            complete: false,
            ..whole()
        };
        assert_eq!(fits(&interrupted), (None, None, Some(false)));
        let without_rights = Measured {
            granted: false,
            misses: 2,
            ..whole()
        };
        assert_eq!(fits(&without_rights), (None, None, None));
        assert_eq!(fits(&whole()), (Some(true), Some(true), Some(false)));
        let missed = Measured { misses: 1, ..short };
        assert_eq!(fits(&missed).0, Some(false));
        let json = missed.as_json();
        assert_eq!(json["seconds"], 0.2996);
        assert_eq!(
            (&json["granted"], &json["loaded"]),
            (&true.into(), &true.into())
        );
        assert_eq!(
            without_rights.as_json()["reservations"]
                .as_array()
                .unwrap()
                .len(),
            1
        );
    }

    #[test]
    fn one_minute_is_long_enough() {
        let bins = json!({}).into();
        let found = Measured {
            seconds: 60.0 - 0.9 / 1024.0,
            ..measured(&bins, 0, MissClasses::default())
        };
        assert_eq!(found.as_json()["fit"], true);
    }
}
