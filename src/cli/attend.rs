//! The operator at the terminal of the test: shows the readings of the zeroing, and asks whether to continue.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Duration;

use crossbeam_channel::{Receiver, Sender, TrySendError};

use super::log::remark;
use super::question::{Answered, Question};
use gusset_control::engine::{Notice, Operator, PhaseCell};
use gusset_control::port::Reading;
use gusset_quantity::units;
use gusset_session::pause;
use gusset_setup::Facts;

/// Time between two looks for room on the operator's line.
const ROOM: Duration = Duration::from_millis(5);

/// The texts of a question that the operator confirms.
struct Confirmable {
    here: &'static str,
    elsewhere: &'static str,
}

const READINGS: Confirmable = Confirmable {
    here: "Enter, y or yes: these are right, go on. Ctrl-C: end.",
    elsewhere: "what was read is to be confirmed",
};

const RELEASE: Confirmable = Confirmable {
    here: "torque or outputs hold the specimen. Unload every axis, then press Enter, y or yes: they end.",
    elsewhere: "torque or outputs hold the specimen; unload every axis, then confirm",
};

/// Refuses a test that needs a confirmation without a terminal; adds a warning if `--yes` confirms it unseen.
pub fn can_confirm(facts: &mut Facts, yes: bool) -> anyhow::Result<()> {
    if facts.confirm && !yes && !std::io::stdin().is_terminal() {
        anyhow::bail!(
            "what the sensors read must be confirmed before anything moves, and there is no terminal; `--yes` \
             confirms it unseen; nothing was moved"
        );
    }
    if facts.confirm && yes {
        let text = "`--yes`: what the sensors read before anything moves is confirmed unseen";
        facts.warnings.push(text.to_owned());
    }
    Ok(())
}

/// Helper at the terminal where a test was started.
pub struct Attendant {
    /// The specimens'.
    pub names: Vec<String>,
    /// Units of displacement and force of each of their axes.
    pub units: Vec<Vec<[&'static str; 2]>>,
    /// The run folder.
    pub run: PathBuf,
    /// State of the test.
    pub phase: PhaseCell,
    /// The operator's end of the line.
    pub operator: Sender<Operator>,
    /// Readings are confirmed unseen.
    pub yes: bool,
}

impl Attendant {
    /// Listens to the loop's notices for as long as it sends any; asks for the confirmation, or gives it.
    pub fn attend(self, notices: Receiver<Notice>) -> std::io::Result<()> {
        std::thread::Builder::new()
            .name("gusset-attend".into())
            .spawn(move || {
                for notice in notices {
                    match notice {
                        Notice::Zeroed {
                            port,
                            axis,
                            reading,
                        } => self.tell(port, axis, reading),
                        Notice::AwaitingConfirmation => {
                            if self.yes || self.is_confirmed_here(&READINGS) {
                                self.confirm();
                            }
                        }
                        // `--yes` confirms readings, and never that an axis is unloaded.
                        Notice::AwaitingRelease => {
                            if self.is_confirmed_here(&RELEASE) {
                                self.confirm();
                            }
                        }
                    }
                }
            })
            .map(drop)
    }

    fn tell(&self, port: usize, axis: usize, reading: Reading) {
        let name = self.names.get(port).map_or("", String::as_str);
        let units = self.units.get(port).and_then(|axes| axes.get(axis));
        remark(format_args!(
            "specimen \"{name}\", axis {}, at rest: {}",
            axis + 1,
            in_words(&reading, *units.unwrap_or(&[""; 2]))
        ));
    }

    /// Asks at the terminal until the confirmation comes from elsewhere.
    fn is_confirmed_here(&self, texts: &Confirmable) -> bool {
        let run = self.run.display();
        let question = Question {
            here: texts.here,
            elsewhere: &format!(
                "{}: from another terminal, with `gusset continue {run}`",
                texts.elsewhere
            ),
        };
        let answered = question.ask(|| self.phase.glimpse().unconfirmed);
        if answered == Answered::Over && self.phase.get().can_be_held() {
            remark("another operator has confirmed: no answer is needed here");
        }
        answered == Answered::Yes
    }

    /// Confirms the readings, and nothing else: an active hold continues.
    fn confirm(&self) {
        while self.phase.glimpse().unconfirmed
            && matches!(
                Operator::Confirm.say_into(&self.operator),
                Err(TrySendError::Full(_))
            )
        {
            // The loop makes room, a word a tick.
            pause(ROOM);
        }
        if self.phase.glimpse().hold {
            let run = self.run.display();
            remark(format_args!(
                "confirmed; the test is held until `gusset continue {run}`"
            ));
        }
    }
}

fn in_words(reading: &Reading, units: [&str; 2]) -> String {
    let [of_disp, of_force] = units;
    let noise = reading.noise();
    let [disp, disp_noise] = units::reading(reading.disp, noise.map(|[disp, _]| disp));
    let [force, force_noise] = units::reading(reading.force, noise.map(|[_, force]| force));
    if noise.is_some() {
        format!(
            "displacement {disp} {of_disp} (noise {disp_noise} {of_disp}), force {force} {of_force} (noise {force_noise} {of_force})"
        )
    } else {
        let count = reading.count;
        let readings = if count == 1 { "reading" } else { "readings" };
        format!(
            "displacement {disp} {of_disp}, force {force} {of_force} (noise not known: {count} {readings})"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_control::engine::{Glimpse, Phase};

    #[test]
    fn noise_of_one_reading_is_unknown() {
        let mut reading = Reading {
            count: 1,
            disp: 0.5,
            force: -3.25,
            ..Reading::default()
        };
        assert_eq!(
            in_words(&reading, ["mm", "kN"]),
            "displacement 0.5 mm, force -3.25 kN (noise not known: 1 reading)"
        );
        reading.count = 7;
        assert!(in_words(&reading, ["mm", "kN"]).contains("noise not known: 7 readings"));
        (reading.count, reading.disp_noise) = (8, 2e-6);
        assert_eq!(
            in_words(&reading, ["mm", "kN"]),
            "displacement 0.5 mm (noise 2e-6 mm), force -3.25 kN (noise 0 kN)"
        );
    }

    #[test]
    fn readings_show_the_digits_of_their_noise() {
        let reading = Reading {
            count: 100,
            disp: 123.456_789_4,
            force: -63_464.371,
            disp_noise: 2.345e-5,
            force_noise: 251.7,
        };
        assert_eq!(
            in_words(&reading, ["mm", "N"]),
            "displacement 123.456789 mm (noise 2.3e-5 mm), force -63464.4 N (noise 252 N)"
        );
    }

    #[test]
    fn confirmation_ends_no_hold() {
        let (operator, heard) = crossbeam_channel::bounded(4);
        let attendant = Attendant {
            names: Vec::new(),
            units: Vec::new(),
            run: PathBuf::from("run"),
            phase: PhaseCell::default(),
            operator,
            yes: true,
        };
        for (hold, unconfirmed) in [(false, true), (true, true), (false, false), (true, false)] {
            attendant.phase.show(Glimpse {
                phase: Phase::Zeroing,
                hold,
                stands: hold,
                unconfirmed,
                hold_number: 0,
            });
            attendant.confirm();
            let said: Vec<Operator> = heard.try_iter().collect();
            let wanted = [Operator::Confirm];
            assert_eq!(said, wanted[..usize::from(unconfirmed)]);
        }
    }
}
