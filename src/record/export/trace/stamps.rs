//! The stamps of a tick in its row.

use crate::export::ExportError;
use crate::layout::Layout;
use gusset_quantity::catalog::column;

/// Places of a tick's stamps in its row.
pub(crate) struct Stamps {
    step: usize,
    time: usize,
    sub_tick: Option<usize>,
    state: Option<usize>,
    stretched: Option<usize>,
    record_before: Option<usize>,
    durations: [usize; 5],
}

/// A tick by its row; µs, on the grid that the row counts from until [`super::grid::Grid`] has placed it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stamped {
    pub step: f64,
    pub time: f64,
    pub sub_tick: f64,
    pub state: f64,
    pub stretched: f64,
    /// How long the recording of the tick before took.
    pub record_before: f64,
    pub release: f64,
    pub woke: f64,
    pub sent: f64,
    pub decoded: f64,
    pub ready: f64,
}

impl Stamps {
    pub(crate) fn find(layout: &Layout, time: usize) -> Result<Self, ExportError> {
        let need = |name| {
            let place = layout.index_of(name);
            place.ok_or(ExportError::NoTimeline(name))
        };
        Ok(Self {
            step: need(column::STEP.name())?,
            time,
            sub_tick: layout.index_of(column::SUB_TICK.name()),
            state: layout.index_of(column::STATE.name()),
            stretched: layout.index_of(column::STRETCHED.name()),
            record_before: layout.index_of(column::RECORD_BEFORE.name()),
            durations: [
                need(column::RELEASE.name())?,
                need(column::WAKEUP.name())?,
                need(column::COMMAND_LATENESS.name())?,
                need(column::ROUND_TRIP.name())?,
                need(column::COMPUTE.name())?,
            ],
        })
    }

    pub(crate) fn read(&self, row: &[f64]) -> Stamped {
        let at = |place: usize| row.get(place).copied().unwrap_or(f64::NAN);
        let maybe = |place: Option<usize>| place.map_or(f64::NAN, at);
        let [release, woke, sent, answered, computed] = self.durations.map(|place| at(place) * 1e6);
        // A phase ends no earlier than it begins.
        let woke = release + woke;
        let sent = (release + sent).max(woke);
        let decoded = (sent + answered).max(sent);
        Stamped {
            step: at(self.step),
            time: at(self.time),
            sub_tick: maybe(self.sub_tick),
            state: maybe(self.state),
            stretched: maybe(self.stretched),
            record_before: maybe(self.record_before) * 1e6,
            release,
            woke,
            sent,
            decoded,
            ready: (decoded + computed).max(decoded),
        }
    }
}

impl Stamped {
    pub(crate) fn is_stamped(&self) -> bool {
        self.release.is_finite() && self.ready.is_finite() && self.woke >= self.release
    }

    /// The stamps, shifted later by `us`.
    pub(crate) fn later(self, us: f64) -> Self {
        Self {
            release: self.release + us,
            woke: self.woke + us,
            sent: self.sent + us,
            decoded: self.decoded + us,
            ready: self.ready + us,
            ..self
        }
    }
}
