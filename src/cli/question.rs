//! A question at the terminal whose answer lets something move.
//!
//! Only a line typed while the question is open answers it. Earlier input is discarded. A line that is neither yes nor empty
//! repeats the question. Input after an answer from elsewhere is not read. In the background the terminal belongs to the
//! foreground program: no input is taken from it.

use std::io::{self, IsTerminal};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::process::getpgrp;
use rustix::termios::{QueueSelector, tcflush, tcgetpgrp};

use super::log::remark;
use gusset_session::pause;

/// Time between two checks whether the question is still open.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Result of a question.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answered {
    /// Yes.
    Yes,
    /// The question is no longer open.
    Over,
    /// No user can answer here.
    Nobody,
}

/// The question, and the text where no user can answer.
pub struct Question<'a> {
    /// Text where a user can answer.
    pub here: &'a str,
    /// Text where no user can answer.
    pub elsewhere: &'a str,
}

impl Question<'_> {
    /// Asks at the terminal of this process while the question `stands`.
    pub fn ask(&self, stands: impl Fn() -> bool) -> Answered {
        self.ask_at(io::stdin().as_fd(), stands, |text| remark(text))
    }

    fn ask_at(
        &self,
        from: BorrowedFd<'_>,
        stands: impl Fn() -> bool,
        mut say: impl FnMut(&str),
    ) -> Answered {
        let mut line = Vec::new();
        let mut asked = None;
        while stands() {
            let in_front = is_in_front(from);
            if asked != Some(in_front) {
                asked = Some(in_front);
                line.clear();
                if in_front {
                    forget_typed(from);
                }
                say(if in_front { self.here } else { self.elsewhere });
            }
            if !in_front {
                pause(LOOK_EVERY);
                continue;
            }
            match typed(from) {
                Ok(typed) => line.extend(typed),
                // Hung up: that ends a test through its signal, or is to end nothing.
                Err(_) => {
                    say(self.elsewhere);
                    return Answered::Nobody;
                }
            }
            let Some(end) = line.iter().position(|byte| b"\r\n".contains(byte)) else {
                continue;
            };
            let said = String::from_utf8_lossy(line.get(..end).unwrap_or_default());
            let said = said.trim();
            // While the line was typed, the question may have been answered elsewhere.
            match said.to_lowercase().as_str() {
                "" | "y" | "yes" if stands() => return Answered::Yes,
                "" | "y" | "yes" => {}
                _ => {
                    say(&format!("{said:?} is no answer"));
                    asked = None;
                }
            }
        }
        Answered::Over
    }
}

/// True where the terminal, if it is one of ours, listens to this process.
fn is_in_front(terminal: BorrowedFd<'_>) -> bool {
    tcgetpgrp(terminal).map_or(true, |front| front == getpgrp())
}

/// Input typed before the question does not answer it.
fn forget_typed(terminal: BorrowedFd<'_>) {
    if terminal.is_terminal() {
        let _ = tcflush(terminal, QueueSelector::IFlush);
    }
}

/// Input within a moment.
fn typed(from: BorrowedFd<'_>) -> io::Result<Vec<u8>> {
    let moment = Timespec {
        tv_sec: 0,
        tv_nsec: i64::from(LOOK_EVERY.subsec_nanos()),
    };
    match poll(&mut [PollFd::new(&from, PollFlags::IN)], Some(&moment)) {
        Ok(0) | Err(Errno::INTR) => return Ok(Vec::new()),
        Ok(_) => {}
        Err(error) => return Err(error.into()),
    }
    let mut bytes = vec![0; 256];
    match rustix::io::read(from, &mut bytes) {
        Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
        Ok(count) => {
            bytes.truncate(count);
            Ok(bytes)
        }
        Err(Errno::INTR | Errno::AGAIN) => Ok(Vec::new()),
        Err(error) => Err(error.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;
    use std::fs::File;
    use std::io::Write;

    const QUESTION: Question<'_> = Question {
        here: "right?",
        elsewhere: "ask elsewhere",
    };

    /// Result of these lines, one typed after each question; the question stays open for `looks` polls.
    fn answered(typed: &[&str], looks: u32) -> (Answered, Vec<String>) {
        let (reader, mut writer) = io::pipe().unwrap();
        let looked = Cell::new(0);
        let stands = || looked.replace(looked.get() + 1) < looks;
        let (mut told, mut lines) = (Vec::new(), typed.iter());
        let say = |text: &str| {
            told.push(text.to_owned());
            if text == QUESTION.here
                && let Some(line) = lines.next()
            {
                writer.write_all(line.as_bytes()).unwrap();
            }
        };
        let answered = QUESTION.ask_at(reader.as_fd(), stands, say);
        (answered, told)
    }

    #[test]
    fn only_yes_or_an_empty_line_confirms() {
        for yes in ["\n", "y\n", " YES \n", "yes\r"] {
            assert_eq!(
                answered(&[yes], 100),
                (Answered::Yes, vec!["right?".to_owned()])
            );
        }
        // The empty line was typed before the question was repeated.
        let (end, told) = answered(&["no, wrong!\n\n", "n\n", "y", "es\n"], 8);
        assert_eq!(end, Answered::Over);
        let words = [
            "right?",
            "\"no, wrong!\" is no answer",
            "right?",
            "\"n\" is no answer",
            "right?",
        ];
        assert_eq!(told, words);
        assert_eq!(answered(&["no\n", "\n"], 100).0, Answered::Yes);
    }

    #[test]
    fn late_input_is_not_an_answer() {
        assert_eq!(answered(&["\n"], 0), (Answered::Over, Vec::new()));
        // It is over while the line comes.
        assert_eq!(answered(&["\n"], 1).0, Answered::Over);
        assert_eq!(answered(&[], 2).0, Answered::Over);
    }

    /// As a terminal in the background is (EIO), or one that has hung up.
    #[test]
    fn question_without_a_user_is_not_a_yes() {
        let words = ["right?".to_owned(), "ask elsewhere".to_owned()];
        let folder = tempfile::tempdir().unwrap();
        let unreadable = File::open(folder.path()).unwrap();
        let (ended, _) = io::pipe().unwrap();
        for from in [unreadable.as_fd(), ended.as_fd()] {
            let mut told = Vec::new();
            let end = QUESTION.ask_at(from, || true, |text| told.push(text.to_owned()));
            assert_eq!((end, told), (Answered::Nobody, words.to_vec()));
        }
    }
}
