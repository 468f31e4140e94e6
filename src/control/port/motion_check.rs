//! The motion check: does a specimen go where the static load sends it?
//!
//! A specimen that came to rest off its place is sent on. An actuator at its end, or cut off, would be sent on without end, and would
//! make the whole way at once when it is freed. So every place where it rests is held against all ways since it last showed that it
//! went. It shows that by its displacement, however small its scale is, or by its force. Play and sticking are overcome within a few
//! ways. Limits: the structure's units.

use gusset_quantity::frame::AtStructure;

/// So many ways in a row, all to one side, are not gone by one that does not follow.
const IN_A_ROW: u32 = 5;
/// It follows if its displacement has changed by this share of the ways ...
const GONE: f64 = 0.1;
/// ... or its force by this share of what k̂ expects of them. What moves beside it changes its force, too, but less.
const FELT: f64 = 0.5;

/// An axis at rest.
#[derive(Debug, Clone, Copy, Default)]
struct AtRest {
    target: f64,
    disp: f64,
    force: f64,
}

/// One axis.
#[derive(Debug, Clone, Copy, Default)]
struct AxisFollows {
    /// Where it followed last, or turned.
    from: AtRest,
    last: AtRest,
    /// The last way, and how many since then were not gone.
    way: f64,
    not_gone: u32,
}

impl AxisFollows {
    /// It was sent to a target and is at rest. Ways shorter than `least` are not judged. False if it does not follow.
    fn rested(&mut self, now: AtRest, stiffness: f64, least: f64) -> bool {
        let before = std::mem::replace(&mut self.last, now);
        self.way = now.target - before.target;
        if self.way.abs() < least {
            return true;
        }
        if self.way * (before.target - self.from.target) < 0.0 {
            (self.from, self.not_gone) = (before, 0);
        }
        let ways = (now.target - self.from.target).abs();
        let gone = (now.disp - self.from.disp).abs();
        let felt = (now.force - self.from.force).abs();
        let has_felt = stiffness > 0.0 && felt >= FELT * stiffness * ways;
        if gone >= GONE * ways || has_felt {
            (self.from, self.not_gone) = (now, 0);
        } else {
            self.not_gone += 1;
        }
        self.not_gone < IN_A_ROW
    }
}

/// One specimen. Real-time: yes, after its making.
#[derive(Debug, Clone)]
pub(crate) struct MotionCheck {
    axes: Vec<AxisFollows>,
    has_begun: bool,
}

impl MotionCheck {
    /// Before it was sent anywhere.
    #[must_use]
    pub(crate) fn new(axes: usize) -> Self {
        Self {
            axes: vec![AxisFollows::default(); axes],
            has_begun: false,
        }
    }

    /// Size of the longest way that it was sent last, in the structure's units.
    #[must_use]
    pub(crate) fn longest_way(&self) -> f64 {
        let ways = self.axes.iter().map(|axis| axis.way.abs());
        ways.fold(0.0, f64::max)
    }

    /// The specimen rests where it was sent, or as near as it comes: target, displacement and force of each axis. Returns the first
    /// axis (from 0) that does not follow; ways shorter than `least` are not judged. All in the structure's units. Real-time: yes.
    pub(super) fn rests(
        &mut self,
        [target, disp, force]: [AtStructure<&[f64]>; 3],
        stiffness: AtStructure<&[f64]>,
        least: f64,
    ) -> Option<usize> {
        let values = target.iter().zip(*disp).zip(*force);
        let at = values.map(|((target, disp), force)| AtRest {
            target: *target,
            disp: *disp,
            force: *force,
        });
        self.rested(at.zip(stiffness.iter().copied()), least)
    }

    /// It rests; the first axis (from 0) that does not follow.
    fn rested(&mut self, at: impl Iterator<Item = (AtRest, f64)>, least: f64) -> Option<usize> {
        let mut stands = None;
        for (index, (axis, (now, stiffness))) in self.axes.iter_mut().zip(at).enumerate() {
            if !self.has_begun {
                (axis.from, axis.last) = (now, now);
            } else if !axis.rested(now, stiffness, least) {
                stands = stands.or(Some(index));
            }
        }
        self.has_begun = true;
        stands
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const K: f64 = 1e6;

    /// Sent on in ways of 1 mm, or as `target` says; the first way (from 1) at which it is found not to follow.
    fn stops(
        target: impl Fn(u32) -> f64,
        mut answer: impl FnMut(f64) -> (f64, f64),
    ) -> Option<u32> {
        let mut follows = MotionCheck::new(1);
        (0..100).find(|&number| {
            let target = target(number);
            let (disp, force) = answer(target);
            let now = AtRest {
                target,
                disp,
                force,
            };
            follows.rested([(now, K)].into_iter(), 1e-5).is_some()
        })
    }

    fn on(number: u32) -> f64 {
        1e-3 * f64::from(number)
    }

    #[test]
    fn still_axis_is_found() {
        assert_eq!(stops(on, |_| (0.0, 0.0)), Some(5));
        // At its end, 10.5 mm away, where it goes half of one way yet.
        let at_end = |target: f64| (target.min(0.0105), K * target.min(0.0105));
        assert_eq!(stops(on, at_end), Some(16));
        assert_eq!(stops(|number| -on(number), |_| (3.0, 7e3)), Some(5));
        // What moves beside it changes its force, too.
        assert_eq!(stops(on, |target| (0.0, 0.3 * K * target)), Some(5));
    }

    /// A small scale of the sensor, one that counts backwards, a bias, a force that yields, a displacement that nobody reads,
    /// and one whose quantum is 8 ways.
    #[test]
    fn whoever_shows_that_it_goes_follows() {
        let answers: [fn(f64) -> (f64, f64); 6] = [
            |target| (0.2 * target, K * target),
            |target| (-0.9 * target, K * target),
            |target| (target + 0.1, K * target + 5e3),
            |target| (target, 2e3),
            |target| (0.0, 0.8 * K * target),
            |target| ((target / 8e-3).floor() * 8e-3, 0.8 * K * target),
        ];
        for (index, answer) in answers.into_iter().enumerate() {
            assert_eq!(stops(on, answer), None, "{index}");
        }
    }

    /// A play of 4 ways, and an actuator that sticks up to 4 ways and then goes all of them at once.
    #[test]
    fn play_and_sticking_are_waited_for() {
        let mut stands = 0.0f64;
        let play = |target: f64| {
            stands = stands.clamp(target - 4e-3, target);
            (stands, K * stands)
        };
        assert_eq!(stops(on, play), None);
        let mut stuck = 0.0f64;
        let sticks = |target: f64| {
            if (target - stuck).abs() > 3.5e-3 {
                stuck = target;
            }
            (stuck, K * stuck)
        };
        assert_eq!(stops(on, sticks), None);
    }

    #[test]
    fn to_and_fro_and_small_ways_are_no_ways() {
        let to_and_fro = |number| 1e-3 * f64::from(number % 3);
        assert_eq!(stops(to_and_fro, |_| (0.0, 0.0)), None);
        assert_eq!(
            stops(|number| 9e-6 * f64::from(number), |_| (0.0, 0.0)),
            None
        );
    }
}
