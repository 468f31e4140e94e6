//! The way to zero force: a specimen is unloaded along its own stiffness, K⁻¹·F, by the forces that are measured on the way.
//!
//! First it stands until the means of its forces over blocks of answers do. Then every tick goes a share of the way that is left, so
//! slowly that a late actuator does not swing. Where it swings nevertheless, the share is halved. It has arrived where the means of
//! two blocks in a row are small, and the forces are as still as before it moved. All axes go together, since each feels the others.
//! Invariant: a broken load cell leads no specimen. The force must not have jumped before, must follow the motion, must not grow, and
//! must not vanish at once. Everything here is at the structure, in m and N. Real-time after [`Unloading::new`].

mod axis_unloading;
mod compliance;
mod platform_unloading;
mod unload_failure;

use axis_unloading::AxisUnloading;
use compliance::Elasticity;
pub(crate) use platform_unloading::PlatformUnloading;
pub use unload_failure::UnloadFailure;

use super::row_product::row_times;

/// Time constant in s of the approach, and the largest share of the way, by k̂, that one tick goes. Behind a delay of up to 1/e of it
/// the approach does not go beyond, and it dies out behind one of up to π/2 of it.
const APPROACH_S: f64 = 0.1;
const SHARE: f64 = 0.05;
/// The share is halved at most this many times.
const HALVINGS: u32 = 6;
/// A block takes this time in s, or at least this many answers while the specimen stands; at most this many are looked at.
const BLOCK_S: f64 = 0.05;
const FEWEST: usize = 3;
const MOST: usize = 256;
/// Blocks in which it stands at most, until its forces do.
const STANDING: u32 = 40;
/// Small blocks in a row that are an arrival.
const BLOCKS: u32 = 2;
/// Share of the largest force so far, that on the way out included, that counts as none; and of one that may be off. For one who feels
/// what others move, a force that they bring counts as its own, as long as an axis has carried as much.
const SMALL: f64 = 0.01;
const STILL: f64 = 0.05;
/// So many times the noise of that mean, by what was read while zeroing, counts as none, too.
const NOISE: f64 = 3.0;
/// The forces of a block may differ by this factor more than before it moved.
const STIR: f64 = 1.5;
/// The way may be longer than k̂ says by this factor.
const STRAY: f64 = 3.0;
/// Share of the forces that must be gone where they all should be, by what is measured of the way; or twice that far, by the commands.
const FOLLOWS: f64 = 0.1;
const AT_MOST_SENT: f64 = 2.0;
/// Beyond the largest force so far, so much of it more than at first is growth.
const GREW: f64 = 0.1;
/// A share of the force that is gone from one answer to the next is no unloading if it is also so many times that of the way.
const FELL: f64 = 0.1;
const TIMES: f64 = 10.0;
/// Shortest bound of its time in s, and its time constants behind the way at full speed.
const LONGEST_S: f64 = 120.0;
const SETTLES: f64 = 20.0;

/// What is known of one axis before it is moved.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leg {
    /// Largest |force| so far in N, without what stopped the test.
    pub largest: f64,
    /// Root mean square in N of the noise of the force, as it was read while zeroing.
    pub noise: f64,
    /// The forces in N that it was meant to carry: what is beyond is more likely the sensor.
    pub meant: [f64; 2],
    /// The force before a jump that tripped, and the largest jump that was allowed, in N.
    pub jump: Option<[f64; 2]>,
    /// Ways in m: the longest of one tick by its speed and by its acceleration, by which that may change from tick to tick.
    pub by_speed: f64,
    pub slew: f64,
}

/// How the answers are counted into blocks.
#[derive(Debug)]
struct Blocks {
    /// Answers of a block, and the distance of those that are looked at.
    length: usize,
    every: usize,
    /// Answers of this block.
    answers: usize,
}

impl Blocks {
    fn new(tick: f64) -> Self {
        let length = (BLOCK_S / tick).ceil().max(1.0) as usize;
        Self {
            length,
            every: length.div_ceil(MOST),
            answers: 0,
        }
    }

    /// True if the next answer is looked at.
    const fn looks(&self) -> bool {
        self.answers.is_multiple_of(self.every)
    }

    /// One more answer; true if the block, of `fewest` at least, is over.
    fn count(&mut self, fewest: usize) -> bool {
        self.answers += 1;
        let is_over = self.answers >= self.length.max(fewest);
        if is_over {
            self.answers = 0;
        }
        is_over
    }
}

/// The share of the way that a tick goes.
#[derive(Debug)]
struct Approach {
    share: f64,
    halvings: u32,
}

impl Approach {
    /// Halves the share; false if it was halved too often.
    const fn halve(&mut self) -> bool {
        let may = self.halvings < HALVINGS;
        if may {
            self.halvings += 1;
            self.share *= 0.5;
        }
        may
    }
}

/// Ticks of wall time.
#[derive(Debug)]
struct UnloadTime {
    /// One tick in s.
    tick: f64,
    passed: f64,
    most: f64,
}

impl UnloadTime {
    /// It may take at least this many ticks from now, for a way and to settle after it.
    fn allow(&mut self, way: f64, settling: f64) {
        self.most = self.most.max(self.passed + way + settling);
    }
}

/// Progress of an unloading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum UnloadStage {
    /// It stands until its forces do, for this many blocks so far.
    Standing { blocks: u32 },
    /// It goes.
    Going,
    /// It does not move while the last block was small.
    Resting,
}

/// A specimen on its way to zero force.
#[derive(Debug)]
pub(crate) struct Unloading {
    legs: Vec<Leg>,
    ways: Vec<AxisUnloading>,
    elasticity: Elasticity,
    approach: Approach,
    blocks: Blocks,
    stage: UnloadStage,
    small_blocks: u32,
    /// In this block an axis would have gone too far.
    is_at_its_end: bool,
    /// Σ first force · reach.
    work: f64,
    /// The shares of the way of the last ticks, and blocks for which a force that was gone at once is remembered.
    strides: [f64; 4],
    fell: u32,
    time: UnloadTime,
    outcome: Option<Result<(), UnloadFailure>>,
}

impl Unloading {
    /// With the stiffness of `legs` by rows in N/m, and ticks of `tick` s of wall time.
    pub(crate) fn new(legs: Vec<Leg>, stiffness: Vec<f64>, tick: f64) -> Self {
        let n = legs.len();
        let blocks = Blocks::new(tick);
        let room = blocks.length.clamp(FEWEST, MOST);
        let way = |_: &Leg| AxisUnloading {
            block: Vec::with_capacity(room),
            ..AxisUnloading::default()
        };
        Self {
            ways: legs.iter().map(way).collect(),
            legs,
            elasticity: Elasticity::new(stiffness, n),
            approach: Approach {
                share: SHARE.min(tick / APPROACH_S),
                halvings: 0,
            },
            blocks,
            stage: UnloadStage::Standing { blocks: 0 },
            small_blocks: 0,
            is_at_its_end: false,
            work: 0.0,
            strides: [0.0; 4],
            fell: 0,
            time: UnloadTime {
                tick,
                passed: 0.0,
                most: LONGEST_S / tick,
            },
            outcome: None,
        }
    }

    /// Its end: where the forces are small, or why it is somewhere else.
    pub(crate) const fn end(&self) -> Option<Result<(), UnloadFailure>> {
        self.outcome
    }

    /// True before the first tick: what was measured last is of the test.
    pub(crate) fn is_new(&self) -> bool {
        self.time.passed == 0.0
    }

    /// How far each axis goes back in this tick, in m.
    pub(crate) fn steps(&self) -> impl Iterator<Item = f64> {
        self.ways.iter().map(|way| way.step)
    }

    /// The next tick, with displacement and force of each axis if they are the answer to the last; without, it comes to rest. False
    /// when there is no further to go.
    pub(crate) fn go_on(&mut self, answers: Option<impl Iterator<Item = (f64, f64)>>) -> bool {
        self.time.passed += 1.0;
        if self.time.passed > self.time.most && self.outcome.is_none() {
            let seconds = (self.time.most * self.time.tick).round() as u32;
            self.outcome = Some(Err(UnloadFailure::TooLong { seconds }));
        }
        let is_known = answers.is_some();
        if let Some(answers) = answers.filter(|_| self.outcome.is_none()) {
            self.take(answers);
        }
        let goes = is_known && self.stage == UnloadStage::Going && self.outcome.is_none();
        self.stride(goes);
        self.outcome.is_none() || self.ways.iter().any(|way| way.step != 0.0)
    }

    /// A share of the way that is left by K⁻¹, in one direction for all axes: what is too long or too sudden for one of them is so
    /// for all, and where one is at its end, all are.
    fn stride(&mut self, goes: bool) {
        let n = self.ways.len();
        let mut scale: f64 = 1.0;
        for index in 0..n {
            let forces = self.ways.iter().map(|way| way.force);
            let left =
                self.approach.share * row_times(&self.elasticity.compliance, index, n, forces);
            if let Some(way) = self.ways.get_mut(index) {
                way.wanted = if goes && left.is_finite() { left } else { 0.0 };
                scale = scale.min(way.longest_step / way.wanted.abs());
            }
        }
        let mut is_near = true;
        for way in &mut self.ways {
            way.wanted *= scale;
            is_near &= (way.gone + way.wanted).abs() <= way.farthest;
        }
        self.is_at_its_end |= !is_near;
        let mut part: f64 = 1.0;
        for (way, leg) in self.ways.iter_mut().zip(&self.legs) {
            way.wanted = if is_near { way.wanted } else { 0.0 };
            part = part.min(leg.slew / (way.wanted - way.step).abs());
        }
        for way in &mut self.ways {
            way.step += part * (way.wanted - way.step);
            way.gone += way.step;
        }
        let step = self
            .ways
            .iter()
            .map(|way| way.start.force * way.step)
            .sum::<f64>()
            / self.work;
        self.strides.rotate_right(1);
        if let Some(last) = self.strides.first_mut() {
            *last = step;
        }
    }

    fn take(&mut self, answers: impl Iterator<Item = (f64, f64)>) {
        let is_looked_at = self.blocks.looks();
        let begun = self.has_begun();
        let (mut swings, mut gone, mut noise) = (false, 0.0, 0.0);
        for (way, (disp, force)) in self.ways.iter_mut().zip(answers) {
            let before = way.force;
            way.take(disp, force);
            gone += way.start.reach * (before - way.force);
            noise += 2.0 * (way.start.reach * way.start.still).abs();
            if is_looked_at && way.block.len() < way.block.capacity() {
                way.block.push(force);
            }
            swings |= begun && way.swings();
        }
        let longest = self.strides.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        if begun && (gone - noise) / self.work > FELL.max(TIMES * longest) {
            self.fell = BLOCKS;
        }
        if swings && self.approach.halve() {
            self.time.allow(0.0, SETTLES / self.approach.share);
        }
        if self.blocks.count(if begun { 1 } else { FEWEST }) {
            self.close_block();
        }
    }

    /// True if the specimen has begun to move.
    fn has_begun(&self) -> bool {
        !matches!(self.stage, UnloadStage::Standing { .. })
    }

    fn close_block(&mut self) {
        let mut still = self.stage != UnloadStage::Standing { blocks: 0 };
        for (way, leg) in self.ways.iter_mut().zip(&self.legs) {
            let before = way.mean;
            way.close_block();
            let same = (STILL * way.mean.abs()).max(SMALL * leg.largest);
            still &= (way.mean - before).abs() <= same.max(way.spread);
        }
        let UnloadStage::Standing { blocks } = &mut self.stage else {
            return self.judge();
        };
        *blocks += 1;
        if still || *blocks >= STANDING {
            self.begin();
        }
    }

    /// The forces stand still: how far it is, and beside what they must be small.
    fn begin(&mut self) {
        let n = self.ways.len();
        let meant = |(way, leg): (&AxisUnloading, &Leg)| {
            let [least, most] = leg.meant;
            way.mean.max(least).min(most)
        };
        for index in 0..n {
            let forces = self.ways.iter().zip(&self.legs).map(meant);
            let reach = row_times(&self.elasticity.compliance, index, n, forces);
            if let Some(way) = self.ways.get_mut(index) {
                way.start.reach = if reach.is_finite() { reach } else { 0.0 };
            }
        }
        let carried = |(way, leg): (&AxisUnloading, &Leg)| leg.largest.max(meant((way, leg)).abs());
        let of_all = self.ways.iter().zip(&self.legs).map(carried);
        let of_all = of_all.fold(0.0, f64::max);
        let answers = self.blocks.length.min(MOST) as f64;
        let mut jumped = false;
        for index in 0..n {
            // What the motion of each axis takes away or brings here: where they nearly cancel, far more than any force that was.
            let row = self
                .elasticity
                .stiffness
                .get(index * n..)
                .unwrap_or_default();
            let parts = row.iter().zip(&self.ways);
            let parts = parts.map(|(stiffness, way)| (stiffness * way.start.reach).abs());
            let brought = parts.fold(0.0, f64::max).min(of_all);
            if let (Some(way), Some(leg)) = (self.ways.get_mut(index), self.legs.get(index)) {
                way.start.force = way.mean;
                way.start.disp = way.measured;
                way.start.still = way.spread;
                way.side = way.mean.signum();
                way.start.scale = brought.max(carried((way, leg)));
                way.start.small = (SMALL * way.start.scale).max(NOISE * leg.noise / answers.sqrt());
                jumped |= leg
                    .jump
                    .is_some_and(|[before, allowed]| (way.mean - before).abs() > allowed);
            }
        }
        let mut longest: f64 = 0.0;
        for index in 0..n {
            let row = self
                .elasticity
                .compliance
                .get(index * n..)
                .unwrap_or_default();
            let spare = row.iter().zip(&self.ways);
            let spare: f64 = spare
                .map(|(c, way)| (c * STILL * way.start.scale).abs())
                .sum();
            if let (Some(way), Some(leg)) = (self.ways.get_mut(index), self.legs.get(index)) {
                // The approach slows down by a share of its step from tick to tick.
                way.longest_step = leg.by_speed.min(leg.slew / self.approach.share);
                way.farthest = STRAY * (way.start.reach.abs() + spare);
                longest = longest.max(way.farthest / way.longest_step);
            }
        }
        self.work = self
            .ways
            .iter()
            .map(|way| way.start.force * way.start.reach)
            .sum();
        let rests = self.rest_if_small();
        self.time.allow(longest, SETTLES / self.approach.share);
        self.outcome = if jumped {
            Some(Err(UnloadFailure::Jumped))
        } else if !rests && self.work == 0.0 {
            Some(Err(UnloadFailure::Unknown))
        } else {
            None
        };
    }

    /// Rests if the forces of the last block are small, and goes if not; true if it rests.
    fn rest_if_small(&mut self) -> bool {
        let mut ways = self.ways.iter();
        let is_small = ways.all(|way| way.mean.abs() <= way.start.small);
        self.stage = if is_small {
            UnloadStage::Resting
        } else {
            UnloadStage::Going
        };
        is_small
    }

    /// A block on the way is over.
    fn judge(&mut self) {
        let rests = self.rest_if_small();
        let is_still =
            |way: &AxisUnloading| way.spread <= (STIR * way.start.still).max(2.0 * way.start.small);
        let arrives = rests && self.ways.iter().all(is_still);
        self.small_blocks = if arrives { self.small_blocks + 1 } else { 0 };
        // As work, in which all axes are one: shares of the way by the command and as measured, and of the force that is gone.
        let share = |of: fn(&AxisUnloading) -> f64| -> f64 {
            self.ways.iter().map(of).sum::<f64>() / self.work
        };
        let sent = share(|way| way.start.force * way.gone);
        let measured = share(|way| way.start.force * (way.start.disp - way.measured));
        let noise = share(|way| (way.start.reach * way.start.still).abs()).abs();
        let relief = 1.0 - share(|way| way.start.reach * way.mean);
        let had_none = self
            .ways
            .iter()
            .all(|way| way.start.force.abs() <= way.start.small);
        self.outcome = if self.small_blocks >= BLOCKS {
            let is_gone = self.fell == 0 || had_none;
            Some(if is_gone {
                Ok(())
            } else {
                Err(UnloadFailure::Fell)
            })
        } else if rests {
            None
        } else if !had_none && relief + noise < -GREW && self.ways.iter().any(AxisUnloading::grows)
        {
            Some(Err(UnloadFailure::Grows))
        } else if !had_none && relief + noise < FOLLOWS && (measured >= 1.0 || sent >= AT_MOST_SENT)
        {
            Some(Err(UnloadFailure::DoesNotFollow))
        } else if self.is_at_its_end {
            Some(Err(UnloadFailure::TooFar))
        } else {
            None
        };
        if !rests {
            self.fell = self.fell.saturating_sub(1);
        }
        self.is_at_its_end = false;
    }
}

#[cfg(test)]
mod tests;
