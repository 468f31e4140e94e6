//! The course of a test, thinned: the last minute finely, the whole of it coarsely. Both are bounded.
//!
//! A bin holds smallest and largest of every channel, so that no peak is lost by thinning. A hysteresis loop is thinned to its
//! corners in the bin ([`corners`]).

use std::collections::VecDeque;
use std::sync::Arc;

/// Bins of the last while: a minute at sixty bins a second.
pub(crate) const RECENT: usize = 3600;
/// Bins of the whole test; reached, two become one.
pub const WHOLE: usize = 2048;

/// Some rows in a row.
#[derive(Debug, Clone, PartialEq)]
pub struct Bin {
    /// Periods of the controller from the first row to its last, s.
    pub until: f64,
    /// Test time of its last row.
    pub time: f64,
    /// The column `state` of its last row.
    pub state: f64,
    /// Smallest and largest of every channel; NaN where it has no value.
    pub values: Vec<[f32; 2]>,
    /// The corners of every hysteresis loop: displacement and force, in order of time.
    pub loops: Vec<Vec<[f32; 2]>>,
}

impl Bin {
    /// Both as one; `later` follows.
    fn join(&mut self, later: &Bin) {
        (self.until, self.time, self.state) = (later.until, later.time, later.state);
        for (mine, other) in self.values.iter_mut().zip(&later.values) {
            // A number wins against none.
            *mine = [mine[0].min(other[0]), mine[1].max(other[1])];
        }
        for (mine, other) in self.loops.iter_mut().zip(&later.loops) {
            mine.extend(other);
            *mine = corners(mine);
        }
    }
}

/// Least distance of a corner from the chord, relative to the ranges of both quantities.
const FLAT: f32 = 1e-3;

/// The points that keep the shape of a piece of a hysteresis loop, at most six, in order of time: smallest and largest
/// displacement, smallest and largest force, and on each side the point farthest from the chord between the first two.
/// All points are finite.
pub(super) fn corners(points: &[[f32; 2]]) -> Vec<[f32; 2]> {
    let Some(first) = points.first() else {
        return Vec::new();
    };
    let ends_of = |value: &dyn Fn([f32; 2]) -> f32| {
        let mut ends = [(0, value(*first)); 2];
        for (place, point) in points.iter().enumerate() {
            let value = value(*point);
            if value < ends[0].1 {
                ends[0] = (place, value);
            }
            if value > ends[1].1 {
                ends[1] = (place, value);
            }
        }
        ends
    };
    let disp = ends_of(&|point| point[0]);
    let force = ends_of(&|point| point[1]);
    let [start, end] = disp.map(|(place, _)| points[place]);
    let chord = [end[0] - start[0], end[1] - start[1]];
    let beside =
        ends_of(&|point| chord[0] * (point[1] - start[1]) - chord[1] * (point[0] - start[0]));
    let flat = FLAT * (disp[1].1 - disp[0].1) * (force[1].1 - force[0].1);
    let beside = beside.into_iter().filter(|(_, area)| area.abs() > flat);
    let mut kept: Vec<usize> = disp
        .into_iter()
        .chain(force)
        .chain(beside)
        .map(|(place, _)| place)
        .collect();
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|place| points[place]).collect()
}

/// Past values, finely and coarsely.
#[derive(Debug, Default)]
pub struct History {
    recent: VecDeque<Arc<Bin>>,
    /// Number of the bin after the last.
    next: u64,
    whole: Vec<Bin>,
    /// Fine bins in one coarse one.
    stride: u64,
    open: Option<(u64, Bin)>,
}

impl History {
    /// One more bin.
    pub(crate) fn push(&mut self, bin: Bin) {
        let stride = self.stride.max(1);
        match &mut self.open {
            Some((count, open)) => {
                open.join(&bin);
                *count += 1;
            }
            None => self.open = Some((1, bin.clone())),
        }
        if let Some((_, full)) = self.open.take_if(|(count, _)| *count >= stride) {
            self.whole.push(full);
        }
        if self.whole.len() >= WHOLE {
            self.whole = halved(&self.whole);
            self.stride = 2 * stride;
        }
        if self.recent.len() == RECENT {
            self.recent.pop_front();
        }
        self.recent.push_back(Arc::new(bin));
        self.next += 1;
    }

    /// Number of the bin that comes next.
    #[must_use]
    #[cfg(test)]
    pub(crate) const fn next(&self) -> u64 {
        self.next
    }

    /// The bins from number `from` on, if they are still kept, and the number of the first of them.
    #[cfg(any(test, feature = "monitor"))]
    pub(crate) fn since(&self, from: u64) -> (u64, impl Iterator<Item = &Arc<Bin>>) {
        let first = self.next - self.recent.len() as u64;
        let from = from.clamp(first, self.next);
        let skipped = usize::try_from(from - first).unwrap_or(usize::MAX);
        (from, self.recent.iter().skip(skipped))
    }

    /// The whole test, coarsely.
    #[cfg(any(test, feature = "monitor"))]
    pub(crate) fn whole(&self) -> impl Iterator<Item = &Bin> {
        self.whole
            .iter()
            .chain(self.open.iter().map(|(_, open)| open))
    }
}

fn halved(bins: &[Bin]) -> Vec<Bin> {
    bins.chunks(2)
        .filter_map(|pair| {
            let (first, rest) = pair.split_first()?;
            let mut joined = first.clone();
            rest.iter().for_each(|later| joined.join(later));
            Some(joined)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bin(k: u32, value: f32) -> Bin {
        Bin {
            until: f64::from(k),
            time: f64::from(k) / 2.0,
            state: 3.0,
            values: vec![[value, value]],
            loops: vec![vec![[value, 10.0 * value]]],
        }
    }

    #[test]
    fn peak_of_one_bin_stays_in_long_tests() {
        let mut history = History::default();
        let n = 5 * WHOLE as u32 + 3;
        for k in 0..n {
            history.push(bin(k, if k == 1234 { 9.0 } else { (k % 7) as f32 * 0.1 }));
        }
        let whole: Vec<_> = history.whole().collect();
        assert!(whole.len() <= WHOLE + 1, "{}", whole.len());
        assert!(whole.len() > WHOLE / 4);
        assert_eq!(
            whole.iter().map(|b| b.values[0][1]).fold(0.0, f32::max),
            9.0
        );
        assert_eq!(
            whole
                .iter()
                .flat_map(|b| &b.loops[0])
                .map(|p| p[1])
                .fold(0.0, f32::max),
            90.0,
            "with its force"
        );
        assert_eq!(whole.last().unwrap().until, f64::from(n - 1));
        assert!(whole.windows(2).all(|pair| pair[0].until < pair[1].until));
    }

    #[test]
    fn recent_bins_are_bounded() {
        let mut history = History::default();
        for k in 0..RECENT as u32 + 100 {
            history.push(bin(k, 1.0));
        }
        let (first, bins) = history.since(3);
        assert_eq!((first, bins.count()), (100, RECENT));
        let (first, bins) = history.since(history.next() - 2);
        assert_eq!(first, history.next() - 2);
        assert_eq!(
            bins.map(|b| b.until as u32).collect::<Vec<_>>(),
            [3698, 3699]
        );
        assert_eq!(history.since(u64::MAX).1.count(), 0);
    }

    #[test]
    fn thinning_keeps_bilinear_corners() {
        // Elastic to (1, 1), yielding to (3, 1.2), unloading to (1, -0.8), yielding back to (-1, -1).
        let corner = [
            [0.0, 0.0],
            [1.0, 1.0],
            [3.0, 1.2],
            [1.0, -0.8],
            [-1.0, -1.0],
        ];
        let line = |a: [f32; 2], b: [f32; 2]| {
            (0..50).map(move |k| {
                let share = k as f32 / 50.0;
                [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
            })
        };
        let all = corner.windows(2).flat_map(|pair| line(pair[0], pair[1]));
        let points: Vec<_> = all.chain([corner[4]]).collect();
        for length in [17, 30, 60] {
            let bins = points.chunks(length).map(corners);
            let kept: Vec<_> = bins.flatten().collect();
            assert!(kept.len() < points.len() / 2 || length == 17, "{length}");
            for corner in &corner[1..] {
                assert!(kept.contains(corner), "{length}: {corner:?}");
            }
        }
        assert!(corners(&points).len() <= 6);
    }

    #[test]
    fn line_points_are_thinned_to_its_ends() {
        let down: Vec<[f32; 2]> = (0..40).rev().map(|k| [k as f32, 3.0 * k as f32]).collect();
        assert_eq!(corners(&down), [[39.0, 117.0], [0.0, 0.0]]);
        assert_eq!(corners(&[[2.0, 5.0]; 7]), [[2.0, 5.0]]);
        assert!(corners(&[]).is_empty());
    }
}
