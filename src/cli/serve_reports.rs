//! Reports and metrics of served tests: a separate thread writes them at the end of each test.

use std::thread::JoinHandle;

use crossbeam_channel::{Sender, unbounded};

use super::tell;
use gusset_link::served::EndedTest;
use gusset_session as session;

/// Writes the report of every folder that it receives; at its end it has written all of them.
pub(super) struct Reports {
    sender: Sender<Option<EndedTest>>,
    thread: Option<JoinHandle<()>>,
}

impl Reports {
    /// Starts the thread.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn begin() -> std::io::Result<Self> {
        let (sender, folders) = unbounded::<Option<EndedTest>>();
        let write = move || {
            while let Ok(Some((folder, mut summary))) = folders.recv() {
                if let Err(error) = session::conclude(&folder, &mut summary) {
                    tell(format_args!("warning: no report: {error}"));
                }
            }
        };
        let builder = std::thread::Builder::new().name("gusset-report".into());
        Ok(Self {
            sender,
            thread: Some(builder.spawn(write)?),
        })
    }

    /// Where folders of tests that have ended go to.
    pub fn sender(&self) -> Sender<Option<EndedTest>> {
        self.sender.clone()
    }
}

impl Drop for Reports {
    fn drop(&mut self) {
        // Nothing after the last folder; a thread that panicked has nothing more to write.
        let _ = self.sender.send(None);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
