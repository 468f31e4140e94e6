//! Long work: how far it is, for a watcher that shows it, and independent tasks on threads ([`each`]).
//!
//! Code that may take long begins a [`Work`] and counts what is done. A program that wants to show progress installs one
//! [`Watcher`] at its start ([`watch`]). Without a watcher nothing happens. Work that begins within other work is silent: a
//! watcher sees one work at a time. Not for the real-time loop.

mod threads;

pub use threads::{each, processors};

use std::fmt;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// Shows how far work is.
pub trait Watcher: Sync {
    /// `count` of `total` parts of `what` are done. Called often, from any thread.
    fn done(&self, what: &str, count: u64, total: u64);
    /// The work is over.
    fn end(&self);
}

static WATCHER: OnceLock<&'static dyn Watcher> = OnceLock::new();
static BUSY: AtomicBool = AtomicBool::new(false);

/// Installs the watcher of this process; a second one is ignored.
pub fn watch(watcher: &'static dyn Watcher) {
    let _there_is_one = WATCHER.set(watcher);
}

/// A piece of work that may take long. It is over when this is dropped.
pub struct Work {
    what: &'static str,
    total: u64,
    watcher: Option<&'static dyn Watcher>,
}

impl Work {
    /// Begins work of `total` parts. `what` is a noun for people, such as "rehearsal".
    #[must_use]
    pub fn begin(what: &'static str, total: u64) -> Self {
        let watcher = WATCHER.get().copied();
        let watcher = watcher.filter(|_| !BUSY.swap(true, Ordering::AcqRel));
        Self {
            what,
            total,
            watcher,
        }
    }

    /// Reports that `count` parts are done since the beginning.
    pub fn done(&self, count: u64) {
        if let Some(watcher) = self.watcher {
            watcher.done(self.what, count.min(self.total), self.total);
        }
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        if let Some(watcher) = self.watcher {
            watcher.end();
            BUSY.store(false, Ordering::Release);
        }
    }
}

impl fmt::Debug for Work {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Work")
            .field("what", &self.what)
            .field("total", &self.total)
            .field("is_watched", &self.watcher.is_some())
            .finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    struct Seen(Mutex<Vec<String>>);

    impl Watcher for Seen {
        fn done(&self, what: &str, count: u64, total: u64) {
            let text = format!("{what} {count}/{total}");
            self.0.lock().unwrap().push(text);
        }

        fn end(&self) {
            self.0.lock().unwrap().push("end".to_owned());
        }
    }

    #[test]
    fn watcher_sees_the_outer_work_only() {
        static SEEN: Seen = Seen(Mutex::new(Vec::new()));
        // The only test of this process that watches; other tests may work meanwhile.
        watch(&SEEN);
        let seen = loop {
            let outer = Work::begin("outer of this test", 2);
            outer.done(1);
            let inner = Work::begin("inner of this test", 5);
            inner.done(1);
            drop(inner);
            outer.done(7);
            let is_watched = outer.watcher.is_some();
            drop(outer);
            if is_watched {
                break SEEN.0.lock().unwrap().clone();
            }
            std::thread::yield_now();
        };
        let own: Vec<&str> = seen
            .iter()
            .map(String::as_str)
            .filter(|text| text.contains("of this test"))
            .collect();
        assert_eq!(own, ["outer of this test 1/2", "outer of this test 2/2"]);
        assert!(seen.iter().any(|text| text == "end"));
    }
}
