//! What is known of one axis on its way to zero force. Real-time: yes.

/// So many times the largest force so far is growth.
const GROWS: f64 = 1.1;

/// Where an axis began.
#[derive(Debug, Default)]
pub(super) struct UnloadStart {
    /// Force in N, and how far the forces of a block differed before it moved.
    pub force: f64,
    pub still: f64,
    /// Measured displacement in m, and how far it is to zero by K⁻¹.
    pub disp: f64,
    pub reach: f64,
    /// Largest force, also of what the motion of the other axes brings here; and a force that counts as none.
    pub scale: f64,
    pub small: f64,
}

/// One axis on its way.
#[derive(Debug, Default)]
pub(super) struct AxisUnloading {
    pub block: Vec<f64>,
    /// The last two answers.
    pub recent: [f64; 2],
    /// A glitch of one answer is not in it.
    pub force: f64,
    /// On which side of zero the force was last.
    pub side: f64,
    /// Mean of the forces of a block and how far they differ, without a tenth at either end.
    pub mean: f64,
    pub spread: f64,
    /// Displacement measured last.
    pub measured: f64,
    pub start: UnloadStart,
    pub longest_step: f64,
    pub farthest: f64,
    pub wanted: f64,
    pub gone: f64,
    pub step: f64,
}

impl AxisUnloading {
    pub(crate) fn take(&mut self, disp: f64, force: f64) {
        let [last, before] = self.recent;
        self.force = last.min(force).max(last.max(force).min(before));
        self.recent = [force, last];
        self.measured = disp;
    }

    /// True if the force has come out on the other side of zero.
    pub(crate) fn swings(&mut self) -> bool {
        let crosses = -self.force * self.side > self.start.small.max(self.start.still);
        if crosses {
            self.side = -self.side;
        }
        crosses
    }

    pub(crate) fn grows(&self) -> bool {
        self.mean.abs() > GROWS * self.start.scale + self.start.still
    }

    pub(crate) fn close_block(&mut self) {
        self.block.sort_unstable_by(f64::total_cmp);
        let last = self.block.len().saturating_sub(1);
        let tenth = (last / 10).max(usize::from(last >= 2));
        let middle = self.block.get(tenth..=last - tenth).unwrap_or_default();
        self.mean = middle.iter().sum::<f64>() / middle.len() as f64;
        let ends = middle.first().zip(middle.last());
        self.spread = ends.map_or(0.0, |(least, most)| most - least);
        self.block.clear();
    }
}
