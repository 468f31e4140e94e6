//! A test in the background.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use super::{PATIENCE, gusset, not_for_ever, write};

/// A test that runs until it ends, or is ended.
pub struct Running {
    child: Option<Child>,
    rows: PathBuf,
}

impl Running {
    pub fn start(folder: &Path, name: &str, text: &str) -> Self {
        let file = write(folder, &format!("{name}.toml"), text);
        let out = folder.join(name);
        let arguments = [
            "run".as_ref(),
            file.as_os_str(),
            "--out".as_ref(),
            out.as_os_str(),
        ];
        Self::with(&arguments, &out)
    }

    /// The program with these arguments, which records into `out`.
    pub fn with(arguments: &[&OsStr], out: &Path) -> Self {
        let child = gusset()
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        Self {
            child: Some(child),
            rows: out.join("samples.bin"),
        }
    }

    /// Sends it a signal by name; it must still be there.
    pub fn signal(&self, name: &str) {
        super::signal(self.child.as_ref().unwrap().id(), name);
    }

    /// Waits until it has recorded more than now: it runs.
    pub fn moves(&self) {
        let size = || std::fs::metadata(&self.rows).map_or(0, |file| file.len());
        let (_nobody, look) = mpsc::channel::<()>();
        let (before, pause) = (size(), Duration::from_millis(10));
        let looks = PATIENCE.as_millis() / pause.as_millis();
        for _ in 0..looks {
            if size() > before {
                return;
            }
            let _ = look.recv_timeout(pause);
        }
        panic!("it does not move");
    }

    /// Ends it as an operator does. It must still be running. Returns its exit code and its output.
    pub fn interrupt(mut self) -> (i32, String) {
        let child = self.child.as_mut().unwrap();
        let over = child.try_wait().unwrap();
        assert_eq!(over, None, "it ended by itself");
        super::signal(child.id(), "INT");
        self.wait()
    }

    /// Waits until it ends. Returns its exit code and its output.
    pub fn wait(mut self) -> (i32, String) {
        let child = self.child.take().unwrap();
        let output = not_for_ever(child);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code().unwrap(), said)
    }

    pub fn kill(&mut self) {
        let mut child = self.child.take().unwrap();
        child.kill().unwrap();
        child.wait().unwrap();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
