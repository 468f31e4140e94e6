//! The axes of a page, with their names and forces.

use super::RunView;
use super::axes::AxisDigest;
use super::chart::Scale as Axis;
use super::columns::SpecimenAxis;
use super::digest::Digest;
use super::scale::{AS_SEEN, Scale};
use super::tested::axis_name;
use super::text::{lag_words, percent, quantity};

/// All values of the page for one axis.
pub(super) struct Tracked<'a> {
    pub name: String,
    pub disp_unit: &'a str,
    pub force_unit: &'a str,
    pub digest: &'a AxisDigest,
    /// Magnitude of the largest force from the summary, which includes steps in another folder.
    told_force: Option<f64>,
    /// None where the numbers of the specimen's own end are those of the structure.
    pub scale: Option<Scale>,
    /// Force of largest magnitude in the startup and in the shutdown, if there was one.
    pub way_in: Option<f64>,
    pub way_out: Option<f64>,
}

impl Tracked<'_> {
    /// Largest force of all known parts of the test; without a sign if only the summary contains it.
    pub(crate) fn largest_force(&self) -> Option<f64> {
        let own = self.digest.peak_force;
        let told = self.told_force;
        let told = told.filter(|told| own.is_none_or(|own| *told > own.abs()));
        told.or(own)
    }

    /// Its name, with the end of a force where that is needed.
    pub(crate) fn force_of(&self) -> String {
        self.name.clone() + self.scale.map_or("", |_| AS_SEEN)
    }

    /// Lag of measured behind target in s.
    pub(crate) fn lag(&self) -> Option<f64> {
        self.digest.lag()
    }

    /// Delay of measured behind target in s.
    pub(crate) fn delay(&self) -> Option<f64> {
        Some(self.digest.tracking?.delay_s?.value)
    }

    /// Amplitude of measured over target, less one.
    pub(crate) fn amplitude_error(&self) -> Option<f64> {
        Some(self.digest.tracking?.amplitude_error.value)
    }

    /// Energy error in words, with its share where that is known.
    pub(crate) fn energy_error(&self) -> Option<String> {
        let tracking = self.digest.tracking?;
        let share = tracking.energy_error_share;
        let share = share.map(|share| format!(" ({})", percent(share.value)));
        let joule = quantity(tracking.energy_error_j.value, self.work_unit());
        Some(joule + &share.unwrap_or_default())
    }

    /// True where the measured displacement equals the target in every sample.
    pub(crate) fn is_ideal(&self) -> bool {
        let tracking = self.digest.tracking.as_ref();
        tracking.is_some_and(|tracking| tracking.peak_error_m.value == 0.0)
    }

    /// Unit of force times displacement.
    pub(crate) fn work_unit(&self) -> &'static str {
        if self.disp_unit.starts_with("rad") {
            "N m"
        } else {
            "J"
        }
    }

    /// The label of a picture of this axis.
    pub(crate) fn label(&self, what: &str) -> String {
        format!("{}: {what}", self.name)
    }

    /// An axis of a chart with displacements of this axis.
    pub(crate) const fn disp<'b>(&'b self, words: &'b str) -> Axis<'b> {
        Axis::new(words, self.disp_unit)
    }

    /// The plain figures of tracking: name and value.
    pub(crate) fn figures(&self) -> [(&'static str, Option<String>); 4] {
        let largest = self
            .digest
            .tracking
            .map(|t| quantity(t.peak_error_m.value, self.disp_unit));
        [
            ("delay", self.delay().map(lag_words)),
            ("amplitude error", self.amplitude_error().map(percent)),
            ("energy error", self.energy_error()),
            ("largest error", largest),
        ]
    }
}

/// Every axis with its name, which comes from the configuration.
pub(super) fn tracking<'a>(run: &RunView, rows: &'a Digest) -> Vec<Tracked<'a>> {
    let test = &run.test.file;
    let axes = rows.axes.iter();
    let end = |axis| {
        let mut ends = rows.ends.iter();
        ends.find(|end| end.axis == axis)
    };
    let told_force = |axis: SpecimenAxis| {
        let forces = &run.summary.as_ref()?.peak.force;
        let own = forces.get(&test.specimen_name(axis.specimen))?;
        *own.get(axis.axis.checked_sub(1)? as usize)?
    };
    axes.map(|digest| Tracked {
        name: axis_name(test, digest.axis, &rows.all_axes),
        disp_unit: rows.unit(&digest.axis.column("meas")),
        force_unit: rows.unit(&digest.axis.column("force")),
        told_force: told_force(digest.axis),
        scale: Scale::of(rows, test, digest.axis),
        way_in: end(digest.axis).and_then(|end| end.on_the_way_in),
        way_out: end(digest.axis).and_then(|end| end.on_the_way_out),
        digest,
    })
    .collect()
}

/// The axis of which a force is largest, with that force.
pub(super) fn largest<'a, 'b>(
    axes: &'b [Tracked<'a>],
    force: impl Fn(&Tracked<'a>) -> Option<f64>,
) -> Option<(&'b Tracked<'a>, f64)> {
    let forces = axes.iter().filter_map(|axis| Some((axis, force(axis)?)));
    forces.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
}
