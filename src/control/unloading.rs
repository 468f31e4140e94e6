//! The way to zero force: a specimen is unloaded along its own stiffness, K⁻¹·F, by what is measured on the way.
//!
//! First it stands, until its forces do: their means over a block of answers, without the extremes, are where the way begins, so that
//! no glitch and no motion that is not over yet decides of it. Then every tick goes a share of what is left, so slowly that it does not swing behind
//! an actuator that is late; where it swings nevertheless (a resonance), the share is halved at each swing. It has arrived where the
//! means of two blocks in a row are small, and the forces keep as still as they did before it moved. All axes go together: what
//! one of them feels is the doing of all.
//!
//! A load cell that has broken leads nobody: the force must not have jumped before, must follow what is moved, may not grow, and is
//! does not go all at once. Everything here is at the structure, in m and N. Real-time after [`Unloading::new`].

use nalgebra::DMatrix;

/// Time constant in s of the approach, and the largest share of the way, by k̂, that one tick goes. Behind a delay of up to 1/e of it
/// the approach does not go beyond, and it dies out behind one of up to π/2 of it.
const APPROACH_S: f64 = 0.1;
const SHARE: f64 = 0.05;
/// The share is halved so many times at most.
const HALVINGS: u32 = 6;
/// A block takes this time in s, or so many answers while it still stands; so many at most are looked at.
const BLOCK_S: f64 = 0.05;
const FEWEST: usize = 3;
const MOST: usize = 256;
/// Blocks in which it stands at most, until its forces do.
const STANDING: u32 = 40;
/// So many blocks in a row that are small are an arrival.
const BLOCKS: u32 = 2;
/// Share of the largest force so far, that on the way out included, that counts as none; and of one that may be off.
const SMALL: f64 = 0.01;
const STILL: f64 = 0.05;
/// So many times the noise of that mean, by what was read while zeroing, counts as none, too.
const NOISE: f64 = 3.0;
/// The forces of a block may differ by so many times what they did before it moved.
const STIR: f64 = 1.5;
/// The way may be so many times as long as k̂ says.
const STRAY: f64 = 3.0;
/// Share of the forces that must be gone where they all should be, by what is measured of the way; or twice that far, by the commands.
const FOLLOWS: f64 = 0.1;
const AT_MOST_SENT: f64 = 2.0;
/// So many times the largest force so far is growth, with so much of it more than at first.
const GROWS: f64 = 1.1;
const GREW: f64 = 0.1;
/// A share of the force that is gone from one answer to the next is no unloading if it is also so many times that of the way.
const FELL: f64 = 0.1;
const TIMES: f64 = 10.0;
/// Shortest bound of its time in s, and its time constants behind the way at full speed.
const LONGEST_S: f64 = 120.0;
const SETTLES: f64 = 20.0;

/// Why a way to zero force has ended somewhere else.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Astray {
    /// Its load cell is at the end of its range.
    Unfelt,
    /// The force has jumped by more than its limit allows, and has not come back.
    Jumped,
    /// It moved as far as the stiffness says, and nearly all of the force is still there.
    DoesNotFollow,
    /// The force is larger than it ever was.
    Grows,
    /// The force was gone at once, in a tick that hardly moved the specimen.
    Fell,
    /// It went three times as far as the stiffness says.
    TooFar,
    /// Without a stiffness nobody knows how far it is, nor which way.
    Unknown,
    /// It was not there after so many s of wall time.
    TooLong {
        /// The time.
        seconds: u32,
    },
}

impl std::fmt::Display for Astray {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Unfelt => "its load cell is out of its range, so it was not led by force",
            Self::Jumped => {
                "its force has jumped and not come back, so it was not led by force: its load cell may be broken, or the \
                 specimen"
            }
            Self::DoesNotFollow => {
                "it was sent as far as its stiffness says, and its force has not followed: its load cell or its actuator may be stuck, \
                 or it is much softer"
            }
            Self::Grows => "its force grew on the way to zero",
            Self::Fell => {
                "its force was gone at once, and not by its motion: its load cell may be dead, or the specimen broken"
            }
            Self::TooFar => {
                "it went three times as far as its stiffness says, and there is still a force"
            }
            Self::Unknown => "without a stiffness nobody knows where its force is zero",
            Self::TooLong { seconds } => {
                return write!(f, "there is still a force after {seconds} s on the way to zero");
            }
        })
    }
}

/// What is known of one axis before it is moved.
#[derive(Debug, Clone, Copy)]
pub struct Leg {
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

/// One axis on its way.
#[derive(Debug, Default)]
struct Way {
    block: Vec<f64>,
    /// The last two answers.
    recent: [f64; 2],
    /// A glitch of one answer is not in it.
    force: f64,
    /// On which side of zero the force was last.
    side: f64,
    /// Mean of the forces of a block and how far they differ, without a tenth at either end; and the latter before it moved.
    mean: f64,
    spread: f64,
    still: f64,
    /// The force in N where it began, how far in m it is to zero by K⁻¹, and where it was measured.
    first: f64,
    reach: f64,
    measured: f64,
    began_at: f64,
    small: f64,
    /// The largest force, also of what the motion of the others makes here.
    scale: f64,
    longest_step: f64,
    farthest: f64,
    wanted: f64,
    gone: f64,
    step: f64,
    is_at_its_end: bool,
}

/// A specimen on its way to zero force.
#[derive(Debug)]
pub struct Unloading {
    legs: Vec<Leg>,
    ways: Vec<Way>,
    /// By rows; where they do not say what K⁻¹ is, without what is beside the diagonal.
    stiffness: Vec<f64>,
    compliance: Vec<f64>,
    tick: f64,
    share: f64,
    halvings: u32,
    /// Answers of a block, every how manieth is looked at, and those of this one.
    of_a_block: usize,
    every: usize,
    answers: usize,
    stood: u32,
    begun: bool,
    /// Nobody moves while the last block was small.
    rests: bool,
    small_blocks: u32,
    /// Σ first·reach.
    work: f64,
    /// The shares of the way of the last ticks, and blocks for which a force that was gone at once is remembered.
    strides: [f64; 4],
    fell: u32,
    ticks: f64,
    most: f64,
    outcome: Option<Result<(), Astray>>,
}

impl Unloading {
    /// With the stiffness of `legs` by rows in N/m, and ticks of `tick` s of wall time.
    pub fn new(legs: Vec<Leg>, stiffness: Vec<f64>, tick: f64) -> Self {
        let n = legs.len();
        let of_a_block = (BLOCK_S / tick).ceil().max(1.0) as usize;
        let room = of_a_block.clamp(FEWEST, MOST);
        let way = |_: &Leg| Way {
            block: Vec::with_capacity(room),
            ..Way::default()
        };
        let (stiffness, compliance) = compliance(stiffness, n);
        Self {
            ways: legs.iter().map(way).collect(),
            legs,
            stiffness,
            compliance,
            tick,
            share: SHARE.min(tick / APPROACH_S),
            halvings: 0,
            of_a_block,
            every: of_a_block.div_ceil(MOST),
            answers: 0,
            stood: 0,
            begun: false,
            rests: false,
            small_blocks: 0,
            work: 0.0,
            strides: [0.0; 4],
            fell: 0,
            ticks: 0.0,
            most: LONGEST_S / tick,
            outcome: None,
        }
    }

    /// True if the specimen is where its forces are small.
    pub fn has_arrived(&self) -> bool {
        self.outcome == Some(Ok(()))
    }

    /// Why it ended somewhere else.
    pub fn astray(&self) -> Option<Astray> {
        self.outcome.and_then(Result::err)
    }

    /// True before the first tick: what was measured last is of the test.
    pub fn is_new(&self) -> bool {
        self.ticks == 0.0
    }

    /// How far each axis goes back in this tick, in m.
    pub fn steps(&self) -> impl Iterator<Item = f64> {
        self.ways.iter().map(|way| way.step)
    }

    /// The next tick, with displacement and force of each axis if they are the answer to the last; without, it comes to rest. False
    /// when there is no further to go.
    pub fn go_on(&mut self, answers: Option<impl Iterator<Item = (f64, f64)>>) -> bool {
        self.ticks += 1.0;
        if self.ticks > self.most && self.outcome.is_none() {
            let seconds = (self.most * self.tick).round() as u32;
            self.outcome = Some(Err(Astray::TooLong { seconds }));
        }
        let is_known = answers.is_some();
        if let Some(answers) = answers.filter(|_| self.outcome.is_none()) {
            self.take(answers);
        }
        let goes = is_known && self.begun && !self.rests && self.outcome.is_none();
        self.stride(goes);
        self.outcome.is_none() || self.ways.iter().any(|way| way.step != 0.0)
    }

    /// A share of the way that is left by K⁻¹, in one direction for all axes: what is too long for one of them is shorter for all.
    fn stride(&mut self, goes: bool) {
        let n = self.ways.len();
        let mut scale: f64 = 1.0;
        for index in 0..n {
            let forces = self.ways.iter().map(|way| way.force);
            let left = self.share * row_times(&self.compliance, index, n, forces);
            if let Some(way) = self.ways.get_mut(index) {
                way.wanted = if goes && left.is_finite() { left } else { 0.0 };
                scale = scale.min(way.longest_step / way.wanted.abs());
            }
        }
        for (way, leg) in self.ways.iter_mut().zip(&self.legs) {
            let wanted = way.wanted * scale;
            let is_near = (way.gone + wanted).abs() <= way.farthest;
            way.is_at_its_end |= !is_near;
            let wanted = if is_near { wanted } else { 0.0 };
            way.step = wanted.clamp(way.step - leg.slew, way.step + leg.slew);
            way.gone += way.step;
        }
        let step = self
            .ways
            .iter()
            .map(|way| way.first * way.step)
            .sum::<f64>()
            / self.work;
        self.strides.rotate_right(1);
        if let Some(last) = self.strides.first_mut() {
            *last = step;
        }
    }

    fn take(&mut self, answers: impl Iterator<Item = (f64, f64)>) {
        let is_looked_at = self.answers.is_multiple_of(self.every);
        let (mut swings, mut gone, mut noise) = (false, 0.0, 0.0);
        for (way, (disp, force)) in self.ways.iter_mut().zip(answers) {
            let before = way.force;
            way.take(disp, force);
            gone += way.reach * (before - way.force);
            noise += 2.0 * (way.reach * way.still).abs();
            if is_looked_at && way.block.len() < way.block.capacity() {
                way.block.push(force);
            }
            swings |= self.begun && way.swings();
        }
        let longest = self.strides.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        if self.begun && (gone - noise) / self.work > FELL.max(TIMES * longest) {
            self.fell = BLOCKS;
        }
        if swings && self.halvings < HALVINGS {
            self.halvings += 1;
            self.share *= 0.5;
            self.most = self.most.max(self.ticks + SETTLES / self.share);
        }
        self.answers += 1;
        let fewest = if self.begun { 1 } else { FEWEST };
        if self.answers < self.of_a_block.max(fewest) {
            return;
        }
        self.answers = 0;
        let mut still = self.stood > 0;
        for (way, leg) in self.ways.iter_mut().zip(&self.legs) {
            let before = way.mean;
            way.close_block();
            let same = (STILL * way.mean.abs()).max(SMALL * leg.largest);
            still &= (way.mean - before).abs() <= same.max(way.spread);
        }
        if self.begun {
            self.judge();
            return;
        }
        self.stood += 1;
        if still || self.stood >= STANDING {
            self.begin();
        }
    }

    /// The forces stand still: how far it is, and beside what they must be small.
    fn begin(&mut self) {
        let n = self.ways.len();
        let meant = |(way, leg): (&Way, &Leg)| {
            let [least, most] = leg.meant;
            way.mean.max(least).min(most)
        };
        for index in 0..n {
            let forces = self.ways.iter().zip(&self.legs).map(meant);
            let reach = row_times(&self.compliance, index, n, forces);
            if let Some(way) = self.ways.get_mut(index) {
                way.reach = if reach.is_finite() { reach } else { 0.0 };
            }
        }
        let answers = self.of_a_block.min(MOST) as f64;
        let mut jumped = false;
        for index in 0..n {
            // What the motion of each axis takes away or brings here.
            let row = self.stiffness.get(index * n..).unwrap_or_default();
            let parts = row.iter().zip(&self.ways);
            let parts = parts.map(|(stiffness, way)| (stiffness * way.reach).abs());
            let scale = parts.fold(0.0, f64::max);
            if let (Some(way), Some(leg)) = (self.ways.get_mut(index), self.legs.get(index)) {
                way.first = way.mean;
                way.began_at = way.measured;
                way.still = way.spread;
                way.side = way.mean.signum();
                way.scale = scale.max(leg.largest).max(meant((way, leg)).abs());
                way.small = (SMALL * way.scale).max(NOISE * leg.noise / answers.sqrt());
                jumped |= leg
                    .jump
                    .is_some_and(|[before, allowed]| (way.mean - before).abs() > allowed);
            }
        }
        let mut longest: f64 = 0.0;
        for index in 0..n {
            let row = self.compliance.get(index * n..).unwrap_or_default();
            let spare = row.iter().zip(&self.ways);
            let spare: f64 = spare.map(|(c, way)| (c * STILL * way.scale).abs()).sum();
            if let (Some(way), Some(leg)) = (self.ways.get_mut(index), self.legs.get(index)) {
                // The approach slows down by a share of its step from tick to tick.
                way.longest_step = leg.by_speed.min(leg.slew / self.share);
                way.farthest = STRAY * (way.reach.abs() + spare);
                longest = longest.max(way.farthest / way.longest_step);
            }
        }
        self.work = self.ways.iter().map(|way| way.first * way.reach).sum();
        self.rests = self.is_small();
        self.most = self.most.max(self.ticks + longest + SETTLES / self.share);
        self.begun = true;
        self.outcome = if jumped {
            Some(Err(Astray::Jumped))
        } else if !self.rests && self.work == 0.0 {
            Some(Err(Astray::Unknown))
        } else {
            None
        };
    }

    fn is_small(&self) -> bool {
        self.ways.iter().all(|way| way.mean.abs() <= way.small)
    }

    /// A block on the way is over.
    fn judge(&mut self) {
        self.rests = self.is_small();
        let is_still = |way: &Way| way.spread <= (STIR * way.still).max(2.0 * way.small);
        let arrives = self.rests && self.ways.iter().all(is_still);
        self.small_blocks = if arrives { self.small_blocks + 1 } else { 0 };
        // As work, in which all axes are one: shares of the way by the command and as measured, and of the force that is gone.
        let share =
            |of: fn(&Way) -> f64| -> f64 { self.ways.iter().map(of).sum::<f64>() / self.work };
        let sent = share(|way| way.first * way.gone);
        let measured = share(|way| way.first * (way.began_at - way.measured));
        let noise = share(|way| (way.reach * way.still).abs()).abs();
        let relief = 1.0 - share(|way| way.reach * way.mean);
        let had_none = self.ways.iter().all(|way| way.first.abs() <= way.small);
        self.outcome = if self.small_blocks >= BLOCKS {
            let is_gone = self.fell == 0 || had_none;
            Some(if is_gone { Ok(()) } else { Err(Astray::Fell) })
        } else if self.rests {
            None
        } else if !had_none && relief + noise < -GREW && self.ways.iter().any(Way::grows) {
            Some(Err(Astray::Grows))
        } else if !had_none && relief + noise < FOLLOWS && (measured >= 1.0 || sent >= AT_MOST_SENT)
        {
            Some(Err(Astray::DoesNotFollow))
        } else if self.ways.iter().any(Way::is_stuck) {
            Some(Err(Astray::TooFar))
        } else {
            None
        };
        if !self.rests {
            self.fell = self.fell.saturating_sub(1);
        }
        for way in &mut self.ways {
            way.is_at_its_end = false;
        }
    }
}

impl Way {
    fn take(&mut self, disp: f64, force: f64) {
        let [last, before] = self.recent;
        self.force = last.min(force).max(last.max(force).min(before));
        self.recent = [force, last];
        self.measured = disp;
    }

    /// True if the force has come out on the other side of zero.
    fn swings(&mut self) -> bool {
        let crosses = -self.force * self.side > self.small.max(self.still);
        if crosses {
            self.side = -self.side;
        }
        crosses
    }

    fn is_stuck(&self) -> bool {
        self.is_at_its_end && self.mean.abs() > self.small
    }

    fn grows(&self) -> bool {
        self.mean.abs() > GROWS * self.scale + self.still
    }

    fn close_block(&mut self) {
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

/// A row of a matrix of `n` columns times a vector. Real-time: yes.
fn row_times(matrix: &[f64], row: usize, n: usize, vector: impl Iterator<Item = f64>) -> f64 {
    let row = matrix.get(row * n..(row + 1) * n).unwrap_or_default();
    row.iter().zip(vector).map(|(a, b)| a * b).sum()
}

/// A stiffness and its inverse. Where it is not positive definite, both go without what is beside the diagonal, and an axis without
/// a stiffness does not move.
fn compliance(stiffness: Vec<f64>, n: usize) -> (Vec<f64>, Vec<f64>) {
    let matrix = DMatrix::from_row_iterator(n, n, stiffness.iter().copied());
    let symmetric = 0.5 * (&matrix + matrix.transpose());
    if let Some(factor) = symmetric.cholesky() {
        // Symmetric: by columns as by rows.
        return (stiffness, factor.inverse().as_slice().to_vec());
    }
    let of_diagonal = |of: fn(f64) -> f64| {
        let diagonal = matrix.diagonal().map(of);
        DMatrix::from_diagonal(&diagonal).as_slice().to_vec()
    };
    let inverse = |stiffness: f64| {
        if stiffness == 0.0 {
            0.0
        } else {
            1.0 / stiffness
        }
    };
    (of_diagonal(|stiffness| stiffness), of_diagonal(inverse))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    const TICK: f64 = 1e-3;
    const STIFFNESS: f64 = 2e5;

    const LEG: Leg = Leg {
        largest: 0.0,
        noise: 0.0,
        meant: [f64::NEG_INFINITY, f64::INFINITY],
        jump: None,
        by_speed: 0.05 * TICK,
        slew: f64::INFINITY,
    };

    /// How a way went: where it ended, of how many ticks, the largest forces on it, and why it ended.
    struct End {
        at: Vec<f64>,
        ticks: u32,
        peaks: Vec<f64>,
        outcome: Result<(), Astray>,
    }

    /// From `at` with these axes and stiffness; `specimen` answers a command in a tick with displacements and forces as measured.
    fn unload(
        legs: &[Leg],
        stiffness: &[f64],
        tick: f64,
        mut at: Vec<f64>,
        mut specimen: impl FnMut(u32, &[f64]) -> Vec<(f64, f64)>,
    ) -> End {
        let mut unloading = Unloading::new(legs.to_vec(), stiffness.to_vec(), tick);
        let (mut ticks, mut peaks) = (0, vec![0.0_f64; at.len()]);
        let mut answer: Option<Vec<(f64, f64)>> = None;
        while unloading.go_on(answer.take().map(Vec::into_iter)) {
            for (at, step) in at.iter_mut().zip(unloading.steps()) {
                *at -= step;
            }
            let measured = specimen(ticks, &at);
            for (peak, (_, force)) in peaks.iter_mut().zip(&measured) {
                *peak = peak.max(force.abs());
            }
            answer = Some(measured);
            ticks += 1;
        }
        End {
            at,
            ticks,
            peaks,
            outcome: unloading.astray().map_or(Ok(()), Err),
        }
    }

    /// One spring, from 10 mm, whose load cell says something else: of the tick and the force.
    fn spring(leg: Leg, cell: impl Fn(u32, f64) -> f64) -> End {
        unload(&[leg], &[STIFFNESS], TICK, vec![0.01], |tick, at| {
            vec![(at[0], cell(tick, STIFFNESS * at[0]))]
        })
    }

    #[test]
    fn no_single_answer_decides_where_it_goes() {
        for glitch in [0.0, -5e3, 2e5] {
            for at in [0, 1, 60, 110, 111, 400] {
                let end = spring(LEG, |tick, force| if tick == at { glitch } else { force });
                assert_eq!(end.outcome, Ok(()), "{glitch} in tick {at}");
                assert!(
                    end.at[0].abs() <= 2e-4,
                    "{glitch} in tick {at}: {}",
                    end.at[0]
                );
            }
        }
    }

    #[test]
    fn a_load_cell_that_is_stuck_leads_no_further_than_the_stiffness_says() {
        let end = spring(LEG, |_, _| 2e3);
        assert_eq!(end.outcome, Err(Astray::DoesNotFollow));
        assert!(end.at[0] <= 0.0 && end.at[0] >= -0.003, "{}", end.at[0]);
        // It hangs on the way.
        let end = spring(LEG, |_, force| force.max(1.9e3));
        assert_eq!(end.outcome, Err(Astray::DoesNotFollow));
    }

    #[test]
    fn a_force_that_grows_is_followed_no_further() {
        let end = spring(LEG, |_, force| -force);
        assert_eq!(end.outcome, Err(Astray::Grows));
        assert!(end.at[0] <= 0.014, "{}", end.at[0]);
    }

    #[test]
    fn a_force_that_is_gone_at_once_is_no_arrival() {
        for last in [150, 163, 200, 250] {
            let end = spring(LEG, |tick, force| if tick < last { force } else { 0.0 });
            assert_eq!(end.outcome, Err(Astray::Fell), "{last}");
        }
        // Ten times as stiff as believed, and thirty.
        for times in [10.0, 30.0] {
            let end = unload(&[LEG], &[STIFFNESS / times], TICK, vec![0.01], |_, at| {
                vec![(at[0], STIFFNESS * at[0])]
            });
            assert_eq!(end.outcome, Ok(()), "{times}");
            assert!(end.at[0].abs() <= 2e-4, "{times}: {}", end.at[0]);
        }
    }

    #[test]
    fn a_force_that_has_jumped_leads_nobody_unless_it_comes_back() {
        let leg = Leg {
            jump: Some([2e3, 500.0]),
            ..LEG
        };
        for offset in [-2e3, 5e3, -4e3] {
            let end = spring(leg, |_, force| force + offset);
            assert_eq!((end.outcome, end.at[0]), (Err(Astray::Jumped), 0.01));
        }
        let back = spring(leg, |tick, force| if tick < 3 { 0.0 } else { force });
        assert_eq!(back.outcome, Ok(()));
    }

    /// An actuator of second order that resonates at `hz`: the loop gain of the first approach is far above one.
    #[test]
    fn a_resonance_is_not_driven_and_is_no_arrival() {
        for (hz, damping) in [(10.0, 0.03), (10.0, 0.05), (5.0, 0.1), (20.0, 0.02)] {
            let (omega, mut disp, mut vel) = (TAU * hz, 0.01, 0.0);
            let end = unload(&[LEG], &[STIFFNESS], TICK, vec![0.01], |_, at| {
                for _ in 0..20 {
                    let dt = TICK / 20.0;
                    vel += dt * omega * (omega * (at[0] - disp) - 2.0 * damping * vel);
                    disp += dt * vel;
                }
                vec![(disp, STIFFNESS * disp)]
            });
            assert_eq!(end.outcome, Ok(()), "{hz} Hz");
            assert!(end.peaks[0] <= 2.01e3, "{hz} Hz: {}", end.peaks[0]);
            let swing = disp.hypot(vel / omega);
            assert!(swing <= 3e-4, "{hz} Hz: {swing}");
        }
    }

    /// Two storeys, [[2k, −k], [−k, k]], with a force on the upper one alone: on the way of the stiffness none comes on the lower.
    #[test]
    fn coupled_axes_go_together() {
        let k = STIFFNESS;
        let stiffness = [2.0 * k, -k, -k, k];
        let end = unload(&[LEG; 2], &stiffness, TICK, vec![0.01, 0.02], |_, at| {
            let lower = k * at[0] - k * (at[1] - at[0]);
            vec![(at[0], lower), (at[1], k * (at[1] - at[0]))]
        });
        assert_eq!(end.outcome, Ok(()));
        assert!(
            end.peaks[0] <= 1.0 && end.peaks[1] <= 2e3 + 1.0,
            "{:?}",
            end.peaks
        );
        assert!(end.at.iter().all(|at| at.abs() <= 5e-4), "{:?}", end.at);
        // One that knows of no other, and is not loaded, stays.
        let alone = unload(
            &[LEG; 2],
            &[k, 0.0, 0.0, k],
            TICK,
            vec![0.0, 0.01],
            |_, at| vec![(at[0], k * at[0]), (at[1], k * at[1])],
        );
        assert_eq!((alone.outcome, alone.at[0]), (Ok(()), 0.0));
    }

    #[test]
    fn a_slow_way_has_the_time_that_it_takes() {
        // 150 mm at 1 mm/s with ticks of 10 ms, and 10 mm with ticks of 5 s.
        for (by_speed, tick, from) in [(1e-5, 0.01, 0.15), (0.25, 5.0, 0.01)] {
            let leg = Leg { by_speed, ..LEG };
            let end = unload(&[leg], &[STIFFNESS], tick, vec![from], |_, at| {
                vec![(at[0], STIFFNESS * at[0])]
            });
            assert_eq!(end.outcome, Ok(()), "{tick}: {} ticks", end.ticks);
            assert!(end.at[0] <= 0.011 * from, "{tick}: {}", end.at[0]);
        }
        // A force that no motion takes away is not followed for ever.
        let end = spring(LEG, |tick, force| {
            force + 0.5 * f64::from(tick) * LEG.by_speed * STIFFNESS
        });
        assert!(end.outcome.is_err() && end.ticks < 130_000, "{}", end.ticks);
    }
}
