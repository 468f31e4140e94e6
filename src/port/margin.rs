//! The delay that each axis has left before the test becomes unstable: its critical delay less its lag.
//!
//! The critical delays are tabulated before the test, one axis at a time: the others on time, with their initial stiffness.
//! The loop looks them up by the stiffness that is fitted over the same last seconds as the lag. A tangent from tick to tick
//! would drown in the noise of real sensors and make the margin look larger than it is. The margin is unknown until the fit
//! has seen two periods of motion. It moves nothing: it feeds columns and a limit only.

use super::Port;
use crate::stability::CriticalDelay;

impl Port {
    /// Knows the critical delays of its axes, one table per axis.
    #[must_use]
    pub fn with_critical_delays(mut self, tables: Vec<CriticalDelay>) -> Self {
        if tables.len() == self.axes() {
            self.critical = tables;
        }
        self
    }

    /// True if [`Port::delay_margins`] are known as soon as the lag is. Real-time: yes.
    #[inline]
    #[must_use]
    pub fn knows_margin(&self) -> bool {
        self.tracks() && !self.critical.is_empty()
    }

    /// Lag and critical delay in s of test time, per axis; not a number where it is not known. Empty without tables.
    fn lags(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let axes = self.critical.iter().zip(self.tracking());
        axes.map(|(table, [lag, _, stiffness, _])| (lag, table.at(stiffness)))
    }

    /// Critical delay at the stiffness of the last seconds less their lag, s of test time, per axis: negative where the test is expected to
    /// grow, infinite where every delay is stable, not a number where nothing is known yet. Real-time: yes.
    pub fn delay_margins(&self) -> impl Iterator<Item = f64> + '_ {
        self.lags().map(|(lag, critical)| critical - lag)
    }

    /// The largest share of its critical delay that an axis uses up; not a number while nothing is known. Real-time: yes.
    #[must_use]
    pub fn delay_used(&self) -> f64 {
        // A number wins against none.
        self.delay_used_by_axis().fold(f64::NAN, f64::max)
    }

    /// The share of each axis. Real-time: yes.
    pub fn delay_used_by_axis(&self) -> impl Iterator<Item = f64> + '_ {
        let lags = self.lags();
        lags.map(|(lag, critical)| lag.max(0.0) / critical + 0.0 * lag)
    }
}
