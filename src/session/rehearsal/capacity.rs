//! Needs of a test beside the declared capacity of the rig (`[specimen.capacity]`).

use super::{AxisNeed, Needs, Rehearsal, StandIn};
use gusset_config::{Finding, KeyPath};

/// One number of a capacity, and the test's need of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Used {
    /// The key of `[specimen.capacity]`.
    pub key: &'static str,
    /// SI.
    pub unit: &'static str,
    /// The largest need of the test in either direction.
    pub needed: f64,
    /// The available value.
    pub capacity: f64,
}

impl Used {
    /// True if the rig can give it; a NaN need is never within.
    #[must_use]
    pub fn is_within(&self) -> bool {
        self.needed <= self.capacity
    }

    /// The need as a share of the capacity; beyond 1 the rig cannot give it.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.needed / self.capacity
    }
}

/// Key, unit, and the most that one axis needs.
pub(crate) type Most = (&'static str, &'static str, fn(&AxisNeed) -> f64);

/// Needs that a capacity is compared with, in the order of its entries.
pub(crate) const NEEDS: [Most; 4] = [
    ("stroke_m", "m", |need| {
        need.command.low.abs().max(need.command.high.abs())
    }),
    ("velocity_m_per_s", "m/s", |need| need.vel.high),
    ("force_n", "N", |need| {
        need.force.low.abs().max(need.force.high.abs())
    }),
    ("power_w", "W", |need| need.power.high),
];

impl Needs {
    /// Used part of the declared capacity of axis `axis`; unknown needs are omitted.
    #[must_use]
    pub fn used(&self, axis: usize) -> Vec<Used> {
        let (Some(capacity), Some(need)) = (self.capacity, self.found.get(axis)) else {
            return Vec::new();
        };
        let pairs = NEEDS.into_iter().zip(capacity.entries());
        let used = pairs.filter_map(|((key, unit, most), (_, _, declared))| {
            let of_force = matches!(key, "force_n" | "power_w");
            let is_known = !(of_force && self.stand_in == StandIn::Nothing);
            declared.filter(|_| is_known).map(|capacity| Used {
                key,
                unit,
                needed: most(need),
                capacity,
            })
        });
        used.collect()
    }
}

impl Rehearsal {
    /// Every capacity that the test exceeds, at its place in the file.
    #[must_use]
    pub(crate) fn beyond_capacity(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        for (index, needs) in self.specimens.iter().enumerate() {
            for axis in 0..needs.found.len() {
                let beyond = needs.used(axis).into_iter();
                let beyond = beyond.filter(|used| !used.is_within());
                findings.extend(beyond.map(|used| finding(&used, needs, index, axis)));
            }
        }
        findings
    }
}

fn finding(used: &Used, needs: &Needs, specimen: usize, axis: usize) -> Finding {
    let at = KeyPath::root().key("specimen").index(specimen);
    let what = match used.key {
        "stroke_m" => "stroke",
        "velocity_m_per_s" => "velocity",
        "force_n" => "force",
        _ => "power",
    };
    let text = format!(
        "the test needs a {what} of {} on axis {} of `{}`, more than its rig can give",
        gusset_quantity::units::quantity(used.needed, used.unit),
        axis + 1,
        needs.name,
    );
    let words = needs.stand_in.words();
    Finding::error(at.key("capacity").key(used.key), text)
        .label(format!("{:.0} % of it", 100.0 * used.share()))
        .number("needed", used.needed)
        .number("capacity", used.capacity)
        .help(format!(
            "found in a rehearsal on the simulated clock; the specimen is replaced by {words}"
        ))
}
