//! The introduction: a specimen's own description when it is connected, compared with the test file.

use super::axis::Axis;
use super::exchange::{OnStale, WaitRules};
use super::startup::{SAME, Startup};
use super::stiffness::{Opinion, compare_stiffness};
use super::wiring_check::WiringCheck;
use gusset_quantity::frame::{AtAxis, AtStructure};
use gusset_quantity::substructure::{Introduction, LinkFault, Unavailable};
use gusset_quantity::units::quantity;

/// The test file's side of an introduction.
pub(super) struct Expectation<'a> {
    pub name: &'a str,
    pub axes: &'a [Axis],
    pub stiffness: AtStructure<&'a [f64]>,
    pub startup: &'a Startup,
    pub wait: Option<WaitRules>,
    pub is_remote: bool,
    /// The test resumes an interrupted one.
    pub is_resumed: bool,
}

impl Expectation<'_> {
    /// Warnings about position, wiring and stale forces. The startup has learned the reported position already.
    pub(crate) fn warnings(&self, found: &Introduction) -> Vec<String> {
        let name = self.name;
        let mut warnings: Vec<String> = self
            .contradiction(AtAxis(&found.standing))
            .into_iter()
            .collect();
        if matches!(self.startup.wiring(), WiringCheck::Unchecked) && !found.simulated {
            warnings.push(format!(
                "specimen \"{name}\": NOTHING CHECKS WHICH WAY ROUND IT IS WIRED before the test moves it: give `probe_m` in \
                 [specimen.link] for a small motion and back, or say `probe = \"none\"`"
            ));
        }
        if self.is_remote && self.startup.standing().is_none() && !found.simulated {
            warnings.push(self.unknown_position());
        }
        if found.repeats_the_command {
            warnings.extend(self.extrapolates_from_the_command());
        }
        warnings
    }

    /// Compares the stiffness that the specimen reports with k̂: more than 10 % apart is a warning. `units`: N/m in the unit of an axis.
    ///
    /// # Errors
    /// An axis reports another sign.
    pub(crate) fn compare_stiffness(
        &self,
        reported: &[f64],
        units: impl Fn(usize) -> f64,
    ) -> Result<Vec<String>, Unavailable> {
        let n = self.axes.len();
        let mut warnings = Vec::new();
        if reported.len() != n * n {
            return Ok(warnings);
        }
        for (j, (axis, ours)) in self.axes.iter().zip(*self.stiffness).enumerate() {
            let reported = reported.get(j * n + j).copied();
            let theirs = reported.unwrap_or(0.0) * axis.force_gain * axis.disp_gain;
            let number = j + 1;
            let [theirs, ours] = [theirs, *ours].map(|stiffness| stiffness * units(j));
            match compare_stiffness(theirs, ours) {
                Opinion::Agrees => {}
                Opinion::Differs => warnings.push(format!(
                    "specimen \"{}\", axis {number}: it reports a stiffness of {} at the structure's \
                     scale, the test file says {}",
                    self.name,
                    quantity(theirs, "N/m"),
                    quantity(ours, "N/m")
                )),
                Opinion::Reversed => {
                    return Err(Unavailable {
                        fault: LinkFault::Refused,
                        text: format!(
                            "axis {number} reports a stiffness of {theirs:e} N/m where the test expects {ours:e} \
                             N/m: a channel is reversed; look at the wiring and at `sign`"
                        ),
                    });
                }
            }
        }
        Ok(warnings)
    }

    /// What needs a measured displacement, where the end of the link does not say that it measures one: why the test cannot begin.
    pub(crate) fn lacks_measured_disp(&self, found: &Introduction) -> Option<String> {
        let needs = &self.startup.needs_measured_disp().own;
        (found.repeats_the_command && !needs.is_empty()).then(|| {
            format!(
                "specimen \"{}\", {}: its end does not say that it measures displacement. What it sends as such may be the command, and \
                 {} would compare the command with itself: let the end of the link measure displacement and announce it, or do without",
                self.name,
                found.peer,
                needs.join(", ")
            )
        })
    }

    /// The effect of the first command on a specimen whose position is unknown. In a resumed test the file cannot state it: its
    /// position is the one before the test.
    fn unknown_position(&self) -> String {
        let name = self.name;
        let leads = if self.is_resumed {
            "where it was left, should it stand elsewhere by now"
        } else {
            "where the test begins, whatever limits of step and speed it has: say it by `stands_at_m` in [specimen.link], and it \
             is led from there"
        };
        format!(
            "specimen \"{name}\": ITS POSITION IS UNKNOWN: its link does not tell, so its first command takes it at once to \
             {leads}"
        )
    }

    /// Warns that a stale force is extrapolated from the command.
    fn extrapolates_from_the_command(&self) -> Option<String> {
        let rules = self.wait?;
        (rules.on_stale == OnStale::Extrapolate).then(|| {
            format!(
                "specimen \"{}\": its end does not say that it measures displacement, and if it sends back the command, \
                 `on_stale = \"extrapolate\"` moves the force from the command, not from where the specimen is",
                self.name
            )
        })
    }

    /// The specimen reports a position, and the test file states another.
    fn contradiction(&self, reported: AtAxis<&[f64]>) -> Option<String> {
        let stated = self.startup.stated()?;
        let mut axes = reported.iter().zip(*stated);
        let is_elsewhere = axes.any(|(reported, stated)| {
            // Written as "is there", so that NaN is elsewhere.
            let is_there = (reported - stated).abs() <= SAME * reported.abs().max(stated.abs());
            !is_there
        });
        is_elsewhere.then(|| {
            format!(
                "specimen \"{}\": it reports the position {:?}, and `stands_at_m` gives {:?} (unit of the axis): the \
                 reported position is used",
                self.name, *reported, *stated
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::{AxisSpec, PortSpec};
    use gusset_quantity::substructure::{
        Command, Freshness, Measurement, Retirement, Substructure,
    };
    use gusset_quantity::time::Nanos;

    /// A specimen of one axis with this introduction, in this process or behind a link.
    struct Partner {
        introduction: Introduction,
        is_remote: bool,
    }

    impl Substructure for Partner {
        fn axes(&self) -> usize {
            1
        }
        fn is_remote(&self) -> bool {
            self.is_remote
        }
        fn connect(&mut self) -> Result<Introduction, Unavailable> {
            Ok(self.introduction.clone())
        }
        fn issue(&mut self, _: &Command<'_>) -> Result<(), LinkFault> {
            Ok(())
        }
        fn collect(&mut self, _: Nanos, _: &mut Measurement) -> Result<Freshness, LinkFault> {
            Ok(Freshness::Fresh)
        }
        fn retire(&mut self, _: Retirement) {}
    }

    /// In this process; it reports this stiffness, in N/m.
    fn reports(stiffness: f64) -> Box<Partner> {
        Box::new(Partner {
            introduction: Introduction {
                stiffness: vec![stiffness],
                ..Introduction::default()
            },
            is_remote: false,
        })
    }

    /// Behind a link, and perhaps able to say where it stands.
    fn far(standing: Vec<f64>) -> Box<Partner> {
        Box::new(Partner {
            introduction: Introduction {
                standing,
                ..Introduction::default()
            },
            is_remote: true,
        })
    }

    /// A port with k̂ = 1e6 N/m, through an axis that counts backwards in mm and kN.
    fn meets(reported: f64) -> Result<Introduction, Unavailable> {
        let mut axis = Axis::plain(vec![(0, 1.0)]);
        axis.disp_gain = -1e3;
        axis.force_gain = -1e3;
        PortSpec::new("rig", reports(reported), 1, vec![AxisSpec::new(axis, 1e6)])
            .build()
            .unwrap()
            .connect()
    }

    #[test]
    fn estimate_beyond_a_tenth_is_a_warning() {
        // 1 kN/mm is 1e6 N/m.
        assert!(meets(1.0).unwrap().warnings.is_empty());
        assert!(meets(1.09).unwrap().warnings.is_empty());
        let warned = meets(1.2).unwrap().warnings;
        assert!(warned[0].contains("1.2 MN/m") && warned[0].contains("1 MN/m"));
        assert_eq!(meets(f64::NAN).unwrap().warnings.len(), 1);
    }

    #[test]
    fn unknown_position_is_reported() {
        let warned = |standing| {
            let port = PortSpec::new(
                "rig",
                far(standing),
                1,
                vec![AxisSpec::new(Axis::plain(vec![(0, 1.0)]), 1e6)],
            )
            .build();
            port.unwrap().connect().unwrap().warnings
        };
        assert!(warned(vec![0.0]).is_empty());
        let words = warned(Vec::new());
        assert!(words.len() == 1 && words[0].contains("UNKNOWN"));
        // The user is warned if the specimen reports another position than the file states.
        let warned = |standing| {
            let mut spec = PortSpec::new(
                "rig",
                far(standing),
                1,
                vec![AxisSpec::new(Axis::plain(vec![(0, 1.0)]), 1e6)],
            );
            spec.stands_at_m = Some(vec![0.01]);
            let mut port = spec.build().unwrap();
            let warnings = port.connect().unwrap().warnings;
            (port.startup().standing().unwrap()[0], warnings)
        };
        assert_eq!(warned(Vec::new()), (0.01, Vec::new()));
        assert_eq!(warned(vec![0.01]), (0.01, Vec::new()));
        let (stands, words) = warned(vec![0.03]);
        assert!(stands == 0.03 && words.len() == 1 && words[0].contains("reported position"));
    }

    /// Times by the clock of a retraced test mean nothing in the resumed test.
    #[test]
    fn resumed_link_owes_no_answer() {
        let port = || {
            PortSpec::new(
                "rig",
                far(Vec::new()),
                1,
                vec![AxisSpec::new(Axis::plain(vec![(0, 1.0)]), 1e6)],
            )
            .build()
            .unwrap()
        };
        let mut retraced = port();
        retraced.repeat(0, 0.0).unwrap();
        retraced
            .exchange_mut()
            .state_mut()
            .look_for_answer(Nanos(5));
        retraced.exchange_mut().count_stale();
        assert_eq!(
            (
                retraced.exchange().state().asked_at(),
                retraced.exchange().stale_in_a_row()
            ),
            (Some(Nanos(5)), 1)
        );
        retraced.go_live(port());
        assert_eq!(
            (
                retraced.exchange().state().asked_at(),
                retraced.exchange().stale_in_a_row()
            ),
            (None, 0)
        );
    }

    #[test]
    fn reversed_channel_is_refused_first() {
        let refused = meets(-1.0).unwrap_err();
        assert!(refused.text.contains("reversed"));
    }
}
