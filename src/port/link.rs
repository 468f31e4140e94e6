//! What a port keeps about its link: counts, the rules of waiting, and the comparison of estimates at connect.

use super::opening::SAME;
use super::{Direction, Opinion, Port, compare_stiffness};
use crate::substructure::{Holder, Introduction, LinkFault, LinkStats, Unavailable};
use crate::time::Nanos;

/// What went over one link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinkCount {
    /// Commands sent.
    pub sent: u64,
    /// Fresh measurements taken.
    pub received: u64,
    /// Commands whose measurement was not there at the deadline.
    pub stale: u64,
    /// Measurements of a simulated actuator that did not come to terms with what it moves.
    pub unsettled: u64,
    /// Times that the specimen said that it holds by its own watchdog.
    pub holds: u64,
    /// What the link itself counts.
    pub stats: LinkStats,
}

/// What the loop knows of who stands behind a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Partner {
    /// It is not commanded any more.
    pub lost: bool,
    /// That is because its link is gone: nobody here knows what it does.
    pub gone: bool,
    /// Its load cell is out of its range: what it reads leads nobody.
    pub unfelt: bool,
    /// It owed an answer when the test ended, and is told nothing before that is here.
    pub owes_the_last: bool,
    /// A measurement of it has come since it was armed: before that what is known of it is made up.
    pub measured: bool,
    /// Stale measurements in a row.
    pub stale: u64,
    /// Answers in a row in which it says that it holds by its own watchdog.
    pub holding: u64,
    /// When one that is commanded once a step was seen to owe its answer.
    pub asked_at: Option<Nanos>,
}

impl Partner {
    /// True of one that may still give the answer that it owed when the test ended. Real-time: yes.
    #[inline]
    #[must_use]
    pub const fn is_waited_for(&self) -> bool {
        self.owes_the_last && !self.lost
    }
}

/// What needs the measured displacement of a specimen: places in the test file.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct NeedsMeasuredDisp {
    /// Keys of the specimen.
    pub own: Vec<String>,
    /// Keys of the test, which judge all of its specimens together.
    pub of_the_test: Vec<String>,
}

/// What is done with a stale force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnStale {
    /// It is used as it is.
    Hold,
    /// It is moved along the estimate k̂.
    Extrapolate,
    /// The test stops.
    Stop,
}

/// How long one specimen is waited for, and what happens when it is late.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WaitRules {
    /// How long a lockstep partner is waited for, in ns.
    pub reply_timeout_ns: u64,
    /// What is done with a stale force.
    pub on_stale: OnStale,
    /// Stale measurements in a row after which the test stops.
    pub stale_in_a_row: u64,
}

impl Port {
    /// How long this specimen is waited for in ns: by its own rules, or as long as others. Real-time: yes.
    #[inline]
    pub(crate) fn patience_ns(&self, others: u64) -> u64 {
        self.wait.map_or(others, |own| own.reply_timeout_ns)
    }

    /// Connects the substructure and compares its own estimate of its stiffness with k̂: more than 10 % apart is a
    /// warning, another sign is refused. Nothing moves.
    ///
    /// # Errors
    /// The specimen cannot take part.
    pub fn connect(&mut self) -> Result<Introduction, Unavailable> {
        let mut introduction = self.substructure.connect()?;
        let n = self.axes.len();
        introduction
            .warnings
            .extend(self.contradicted_by(&introduction.standing));
        self.learns_where_it_stands(&introduction.standing);
        if matches!(self.direction, Direction::Unchecked) && !introduction.simulated {
            introduction.warnings.push(format!(
                "specimen \"{}\": NOTHING CHECKS WHICH WAY ROUND IT IS WIRED before the test moves it: give `probe_m` in \
                 [specimen.link] for a small motion and back, or say `probe = \"none\"`",
                self.name
            ));
        }
        if self.is_remote() && self.standing().is_none() && !introduction.simulated {
            introduction.warnings.push(self.stands_anywhere());
        }
        if introduction.repeats_the_command {
            let warning = self.goes_on_from_the_command();
            introduction.warnings.extend(warning);
        }
        if introduction.stiffness.len() != n * n {
            return Ok(introduction);
        }
        for (j, (axis, ours)) in self.axes.iter().zip(&self.stiffness).enumerate() {
            let reported = introduction.stiffness.get(j * n + j).copied();
            let theirs = reported.unwrap_or(0.0) * axis.force_gain * axis.disp_gain;
            let number = j + 1;
            match compare_stiffness(theirs, *ours) {
                Opinion::Agrees => {}
                Opinion::Differs => introduction.warnings.push(format!(
                    "specimen \"{}\", axis {number}: it reports a stiffness of {theirs:e} N/m at the structure's \
                     scale, the test file says {ours:e} N/m",
                    self.name
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
        Ok(introduction)
    }

    /// What its first command does to one of which nobody says where it stands. In a test that goes on the file cannot: what it
    /// says is of the time before the test.
    fn stands_anywhere(&self) -> String {
        let name = &self.name;
        let leads = if self.goes_on_from_before() {
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

    /// What of the test file needs a measured displacement, where the end of the link does not say that it measures one: why the
    /// test cannot begin.
    #[must_use]
    pub fn lacks_measured_disp(&self, introduction: &Introduction) -> Option<String> {
        let needs = &self.needs_measured_disp.own;
        (introduction.repeats_the_command && !needs.is_empty()).then(|| {
            format!(
                "specimen \"{}\", {}: its end does not say that it measures displacement. What it sends as such may be the command, and \
                 {} would compare the command with itself: let the end of the link measure displacement and announce it, or do without",
                self.name,
                introduction.peer,
                needs.join(", ")
            )
        })
    }

    /// Warns that a stale force is extrapolated from the command.
    fn goes_on_from_the_command(&self) -> Option<String> {
        let rules = self.wait?;
        (rules.on_stale == OnStale::Extrapolate).then(|| {
            format!(
                "specimen \"{}\": its end does not say that it measures displacement, and if it sends back the command, \
                 `on_stale = \"extrapolate\"` moves the force from the command, not from where the specimen is",
                self.name
            )
        })
    }

    /// The specimen says where it stands, and the test file says otherwise.
    fn contradicted_by(&self, said: &[f64]) -> Option<String> {
        let stated = self.stated.as_ref()?;
        let mut axes = said.iter().zip(stated);
        let is_elsewhere = axes.any(|(said, stated)| {
            // Written as "is there", so that NaN is elsewhere.
            let is_there = (said - stated).abs() <= SAME * said.abs().max(stated.abs());
            !is_there
        });
        is_elsewhere.then(|| {
            format!(
                "specimen \"{}\": it reports the position {said:?}, and `stands_at_m` gives {stated:?} (unit of the axis): the \
                 reported position is used",
                self.name
            )
        })
    }

    /// Asks what [`Port::arm`] waits for, and does not wait.
    ///
    /// # Errors
    /// The specimen is gone.
    pub fn ask_to_arm(&mut self, sequence: u64) -> Result<(), LinkFault> {
        let number = self.pursuit.first_number(sequence, self.ahead);
        self.substructure.ask_to_arm(number, &self.command)
    }

    /// The last word before commands move the specimen: command `sequence` stands ready. False if that was not `wanted` any
    /// more while it was waited for.
    ///
    /// # Errors
    /// The specimen is not ready, stands elsewhere, or is gone.
    pub fn arm(
        &mut self,
        sequence: u64,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, LinkFault> {
        self.partner.measured = false;
        let number = self.pursuit.first_number(sequence, self.ahead);
        self.substructure.arm(number, &self.command, wanted)
    }

    /// Everything that was counted.
    #[must_use]
    pub fn link_count(&self) -> LinkCount {
        LinkCount {
            stats: self.substructure.stats(),
            ..self.link
        }
    }

    /// Who holds the specimen if commands stay away.
    #[must_use]
    pub fn holder(&self) -> Holder {
        self.substructure.holder()
    }

    /// The same after the last words, when it is known whether it was armed.
    #[must_use]
    pub fn left_to(&self) -> Holder {
        match self.holder() {
            Holder::ItsWatchdog if self.is_left_unasked() => Holder::NeverArmed,
            holder => holder,
        }
    }

    /// More than the fault says about why the link was lost.
    #[must_use]
    pub fn complaint(&self) -> Option<String> {
        self.substructure.complaint()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::Axis;
    use crate::substructure::{
        Command, Coupling, Freshness, Measurement, Retirement, Substructure,
    };
    use crate::time::Nanos;

    /// Says of itself what it is told to say, in N/m.
    struct Says(f64);

    impl Substructure for Says {
        fn axes(&self) -> usize {
            1
        }
        fn coupling(&self) -> Coupling {
            Coupling::Lockstep
        }
        fn connect(&mut self) -> Result<Introduction, Unavailable> {
            Ok(Introduction {
                stiffness: vec![self.0],
                ..Introduction::default()
            })
        }
        fn issue(&mut self, _: &Command<'_>) -> Result<(), LinkFault> {
            Ok(())
        }
        fn collect(&mut self, _: Nanos, _: &mut Measurement) -> Result<Freshness, LinkFault> {
            Ok(Freshness::Fresh)
        }
        fn retire(&mut self, _: Retirement) {}
    }

    /// A port that believes in 1e6 N/m, through an axis that counts backwards in mm and kN.
    fn meets(reported: f64) -> Result<Introduction, Unavailable> {
        let mut axis = Axis::plain(vec![(0, 1.0)]);
        axis.disp_gain = -1e3;
        axis.force_gain = -1e3;
        Port::new("rig", vec![axis], Box::new(Says(reported)), 1, vec![1e6])
            .unwrap()
            .connect()
    }

    #[test]
    fn an_estimate_within_a_tenth_is_silent_and_one_beyond_is_a_warning() {
        // 1 kN/mm is 1e6 N/m.
        assert!(meets(1.0).unwrap().warnings.is_empty());
        assert!(meets(1.09).unwrap().warnings.is_empty());
        let warned = meets(1.2).unwrap().warnings;
        assert!(warned[0].contains("1.2e6 N/m") && warned[0].contains("1e6 N/m"));
        assert_eq!(meets(f64::NAN).unwrap().warnings.len(), 1);
    }

    /// Behind a link, and perhaps able to say where it stands.
    struct Far(Vec<f64>);

    impl Substructure for Far {
        fn axes(&self) -> usize {
            1
        }
        fn coupling(&self) -> Coupling {
            Coupling::Lockstep
        }
        fn is_remote(&self) -> bool {
            true
        }
        fn connect(&mut self) -> Result<Introduction, Unavailable> {
            Ok(Introduction {
                standing: self.0.clone(),
                ..Introduction::default()
            })
        }
        fn issue(&mut self, _: &Command<'_>) -> Result<(), LinkFault> {
            Ok(())
        }
        fn collect(&mut self, _: Nanos, _: &mut Measurement) -> Result<Freshness, LinkFault> {
            Ok(Freshness::Fresh)
        }
        fn retire(&mut self, _: Retirement) {}
    }

    #[test]
    fn of_a_specimen_that_cannot_say_where_it_stands_everybody_is_told() {
        let warned = |standing| {
            let axes = vec![Axis::plain(vec![(0, 1.0)])];
            let port = Port::new("rig", axes, Box::new(Far(standing)), 1, vec![1e6]);
            port.unwrap().connect().unwrap().warnings
        };
        assert!(warned(vec![0.0]).is_empty());
        let words = warned(Vec::new());
        assert!(words.len() == 1 && words[0].contains("ITS POSITION IS UNKNOWN"));
        // Whoever says it in its place is told if it says otherwise itself.
        let warned = |standing| {
            let axes = vec![Axis::plain(vec![(0, 1.0)])];
            let mut port = Port::new("rig", axes, Box::new(Far(standing)), 1, vec![1e6]).unwrap();
            port.is_said_to_stand_at(&[0.01]);
            let warnings = port.connect().unwrap().warnings;
            (port.standing().unwrap()[0], warnings)
        };
        assert_eq!(warned(Vec::new()), (0.01, Vec::new()));
        assert_eq!(warned(vec![0.01]), (0.01, Vec::new()));
        let (stands, words) = warned(vec![0.03]);
        assert!(
            stands == 0.03
                && words.len() == 1
                && words[0].contains("the reported position is used")
        );
    }

    /// When its answer was due by the clock of a retraced test says nothing in the test that goes on.
    #[test]
    fn a_partner_of_a_test_that_goes_on_owes_nothing_of_the_one_before() {
        let port = || {
            let axes = vec![Axis::plain(vec![(0, 1.0)])];
            Port::new("rig", axes, Box::new(Far(Vec::new())), 1, vec![1e6]).unwrap()
        };
        let mut retraced = port();
        retraced.partner = Partner {
            asked_at: Some(Nanos(5)),
            stale: 3,
            ..Partner::default()
        };
        retraced.go_live(port());
        assert_eq!(retraced.partner, Partner::default());
    }

    #[test]
    fn a_reversed_channel_is_refused_before_anything_moves() {
        let refused = meets(-1.0).unwrap_err();
        assert!(refused.text.contains("a channel is reversed"));
    }
}
