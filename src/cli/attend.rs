//! The operator at the terminal where a test was started: what was read while zeroing, and whether to go on.

use std::io::{BufRead, IsTerminal};

use crossbeam_channel::{Receiver, Sender};

use super::aside::remark;
use super::exit::{Exit, WithExit};
use crate::config::Facts;
use crate::engine::{Notice, Operator};
use crate::record::{Roll, What};

/// Refuses a test that needs a confirmation nobody can give; one that is given unseen is among its warnings.
pub fn can_confirm(facts: &mut Facts, yes: bool) -> anyhow::Result<()> {
    if facts.confirm && !yes && !std::io::stdin().is_terminal() {
        let text = "what the sensors read must be confirmed before anything moves, and there is no terminal; `--yes` \
                    confirms it unseen; nothing was moved";
        return Err(WithExit(Exit::Usage, text.to_owned()).into());
    }
    if facts.confirm && yes {
        let text = "`--yes`: what the sensors read before anything moves is confirmed unseen";
        facts.warnings.push(text.to_owned());
    }
    Ok(())
}

/// Listens to the loop's notices for as long as it sends any; asks for the confirmation, or gives it.
pub fn attend(
    names: Vec<String>,
    notices: Receiver<Notice>,
    operator: Sender<Operator>,
    yes: bool,
    roll: &Roll,
) -> std::io::Result<()> {
    let roll = roll.clone();
    std::thread::Builder::new()
        .name("gusset-attend".into())
        .spawn(move || {
            let stamper = roll.enter();
            for notice in notices {
                let began_ns = stamper.now();
                match notice {
                    Notice::Zeroed {
                        port,
                        axis,
                        reading,
                    } => {
                        let name = names.get(port).map_or("", String::as_str);
                        remark(format_args!(
                            "specimen \"{name}\" axis {}: displacement {:.6} (noise {:.1e}), force {:.6} (noise {:.1e}), \
                             in its own units",
                            axis + 1,
                            reading.disp,
                            reading.disp_noise,
                            reading.force,
                            reading.force_noise,
                        ));
                    }
                    Notice::AwaitingConfirmation => {
                        if !yes {
                            remark("Enter: these are right, go on. Ctrl-C: end.");
                            let mut line = String::new();
                            // A terminal that hangs up ends the test through its signal.
                            if std::io::stdin().lock().read_line(&mut line).unwrap_or(0) == 0 {
                                continue;
                            }
                        }
                        let _ = operator.try_send(Operator::Confirm);
                    }
                }
                stamper.since(What::Tell, began_ns, 0);
            }
        })
        .map(drop)
}
