//! Specimens are connected before the loop starts: on the caller's thread, with time limits, and nothing moves.

use crate::engine::Experiment;
use crate::record::{Note, NoteLevel, Writer};
use crate::substructure::Retirement;

/// Connects every specimen, one after the other, and notes what each says of itself. Nothing moves yet. Returns what
/// the user should know.
pub(super) fn connect(experiment: &mut Experiment, writer: &Writer) -> Result<Vec<String>, String> {
    let mut warnings = Vec::new();
    for index in 0..experiment.ports.len() {
        let Some(port) = experiment.ports.get_mut(index) else {
            break;
        };
        match port.connect() {
            Ok(introduction) => {
                for warning in &introduction.warnings {
                    let note = Note::new(NoteLevel::Warning, "warning");
                    writer.note(note.with("text", warning.as_str()));
                }
                warnings.extend(introduction.warnings);
                if port.is_remote() {
                    let note = Note::new(NoteLevel::Info, "connected");
                    writer.note(
                        note.with("specimen", index as u64 + 1)
                            .with("name", port.name.as_str())
                            .with("peer", introduction.peer.as_str()),
                    );
                }
            }
            Err(error) => {
                let text = format!("specimen \"{}\": {error}", port.name);
                let note = Note::new(NoteLevel::Error, "link");
                writer.note(
                    note.with("specimen", index as u64 + 1)
                        .with("name", port.name.as_str())
                        .with("message", error.text.as_str()),
                );
                // Those that are connected already are told that nothing will come.
                for port in &mut experiment.ports {
                    port.retire(Retirement::Orderly);
                }
                return Err(text);
            }
        }
    }
    Ok(warnings)
}
