//! The links of a gateway: each controller's test has its own connection.
//!
//! It is made when the controller arms, and closed when its test is over. So the next test finds a gateway without unanswered
//! commands, and a specimen that was restarted meanwhile.

use std::sync::mpsc::RecvTimeoutError;
use std::sync::{Arc, mpsc};
use std::time::Duration;

use super::{Controller, TestEnd, Wanted, Whereabouts};
use gusset_quantity::substructure::{
    Command, Freshness, Introduction, LinkFault, Measurement, Retirement, Substructure,
};
use gusset_quantity::time::Nanos;
use gusset_record::rt::os;

/// Interval at which a wait for a connection checks that the test is still wanted.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Refusal of a specimen at an unknown position: a first command could move it by any distance at once.
const NOBODY_KNOWS: &str = "its position is unknown: it does not report it, and no earlier test moved it; `stands_at_m` \
     in [specimen.link] says it, in m as each axis counts (or `computed = true`, that nothing moves there)";

/// Makes the link for a controller's test; it is not connected yet.
pub type LinkBuild =
    Arc<dyn Fn(&Controller) -> Result<Box<dyn Substructure>, String> + Send + Sync>;

/// Makes and connects the links to one specimen.
#[derive(Clone)]
pub struct LinkMaker {
    build: LinkBuild,
    whereabouts: Whereabouts,
    /// An answer is waited for so long, ns.
    reply_limit_ns: u64,
}

impl std::fmt::Debug for LinkMaker {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LinkMaker").finish_non_exhaustive()
    }
}

impl LinkMaker {
    /// Links that `build` makes to a specimen at the position of `whereabouts`; an answer may take up to `reply_limit_ns`.
    #[must_use]
    pub const fn new(build: LinkBuild, whereabouts: Whereabouts, reply_limit_ns: u64) -> Self {
        Self {
            build,
            whereabouts,
            reply_limit_ns,
        }
    }

    /// How long an answer is waited for, ns.
    pub(super) const fn reply_limit_ns(&self) -> u64 {
        self.reply_limit_ns
    }

    /// A new link, connected, and the introduction of the specimen. Blocks as long as the test is `wanted`.
    ///
    /// # Errors
    /// The specimen cannot take part.
    pub(super) fn connect(
        &self,
        controller: &Controller,
        wanted: &mut Wanted<'_>,
    ) -> Result<(Box<dyn Substructure>, Introduction), TestEnd> {
        connected((self.build)(controller)?, wanted)
    }

    /// The introduction with the position of the specimen, as far as the file or earlier tests give it.
    ///
    /// # Errors
    /// The position is unknown.
    pub(super) fn located(&self, mut introduction: Introduction) -> Result<Introduction, TestEnd> {
        if introduction.standing.is_empty() {
            introduction.standing = self.whereabouts.stated();
            introduction.measured = false;
            let computed = introduction.simulated || self.whereabouts.is_of_a_computation();
            if introduction.standing.is_empty() && !computed {
                return Err(TestEnd::failed(NOBODY_KNOWS));
            }
        } else {
            let doubt = self.whereabouts.contradicted_by(&introduction.standing);
            introduction.warnings.extend(doubt);
        }
        self.whereabouts.begins(&introduction);
        Ok(introduction)
    }

    /// True if the operator declares the specimen a computation.
    pub(super) fn is_of_a_computation(&self) -> bool {
        self.whereabouts.is_of_a_computation()
    }

    /// The position that the specimen reports now, in the units of its axes; empty if it does not. Nothing is armed, so nothing moves.
    ///
    /// # Errors
    /// The specimen cannot be connected within `limit`.
    pub fn report(&self, limit: Duration) -> Result<Vec<f64>, String> {
        let nobody = Controller::unnamed((std::net::Ipv4Addr::LOCALHOST, 0).into());
        let link = (self.build)(&nobody)?;
        let until = os::monotonic_ns().saturating_add(limit.as_nanos() as u64);
        let mut wanted = || {
            let is_late = os::monotonic_ns() > until;
            let late = || TestEnd::failed("it cannot be connected in time");
            if is_late { Err(late()) } else { Ok(()) }
        };
        let (mut link, introduction) = connected(link, &mut wanted).map_err(|end| end.text)?;
        link.retire(Retirement::Orderly);
        Ok(introduction.standing)
    }

    /// The test is over. The last command to the specimen was this one.
    pub(super) fn left_at(&self, disp: &[f64]) {
        self.whereabouts.ends(disp);
    }
}

/// Connects a link on a separate thread, because connecting waits. An abandoned connection stays with its thread: its far end
/// received no command, and the connection closes when the thread ends.
fn connected(
    mut link: Box<dyn Substructure>,
    wanted: &mut Wanted<'_>,
) -> Result<(Box<dyn Substructure>, Introduction), TestEnd> {
    let (done, said) = mpsc::channel();
    let work = move || {
        let outcome = link.connect();
        let _ = done.send((link, outcome));
    };
    let thread = std::thread::Builder::new().name("gusset-connect".into());
    thread
        .spawn(work)
        .map_err(|error| TestEnd::failed(format_args!("no thread to connect it on: {error}")))?;
    loop {
        match said.recv_timeout(LOOK_EVERY) {
            Ok((link, outcome)) => {
                let introduction = outcome.map_err(|error| TestEnd::failed(error.text))?;
                return Ok((link, introduction));
            }
            Err(RecvTimeoutError::Timeout) => wanted()?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(TestEnd::failed("internal error: its connection panicked"));
            }
        }
    }
}

/// In place of a link between two tests: nothing leaves.
pub(crate) struct Unconnected {
    pub axes: usize,
}

impl Substructure for Unconnected {
    fn axes(&self) -> usize {
        self.axes
    }

    fn is_remote(&self) -> bool {
        true
    }

    fn arm(&mut self, _: u64, _: &[f64], _: &mut dyn FnMut() -> bool) -> Result<bool, LinkFault> {
        Err(LinkFault::Closed)
    }

    fn issue(&mut self, _: &Command<'_>) -> Result<(), LinkFault> {
        Err(LinkFault::Closed)
    }

    fn collect(&mut self, _: Nanos, _: &mut Measurement) -> Result<Freshness, LinkFault> {
        Err(LinkFault::Closed)
    }

    fn attend(&mut self) -> Result<(), LinkFault> {
        Err(LinkFault::Closed)
    }

    fn retire(&mut self, _: Retirement) {}
}
