//! The sawtooth of an unstable integration, as it shows in a sequence of displacements. Pure; real-time.

use gusset_quantity::state;

/// A sequence of displacements whose second differences may alternate and grow.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sawtooth {
    /// The last, and the one before; as many as there were, up to two.
    disp: [f64; 2],
    seen: u8,
    /// Their second difference, and for how long it has changed its sign and grown.
    bend: f64,
    pub ticks: u32,
}

state! { Sawtooth { disp, seen: choice(&[0, 1, 2]), bend, ticks } }

impl Sawtooth {
    pub(crate) const fn at_rest(disp: f64) -> Self {
        Self {
            disp: [disp; 2],
            seen: 2,
            bend: 0.0,
            ticks: 0,
        }
    }

    /// With one more. Real-time: yes.
    #[inline]
    pub(crate) fn after(&self, disp: f64) -> Self {
        let [last, before] = self.disp;
        let mut next = Self {
            disp: [disp, last],
            seen: (self.seen + 1).min(2),
            ..Self::default()
        };
        if self.seen == 2 {
            next.bend = disp - 2.0 * last + before;
            // By sign and not by product, which underflows.
            let turns = self.bend != 0.0 && (self.bend > 0.0) != (next.bend > 0.0);
            if turns && next.bend.abs() > self.bend.abs() {
                next.ticks = self.ticks.saturating_add(1);
            }
        }
        next
    }
}
