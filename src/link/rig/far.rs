//! A specimen across another link: what makes a server a gateway.
//!
//! Each controller's test has a connection of its own, made when the controller arms and closed when its test is over: so
//! the next test finds a gateway that owes nothing to the last one, and a specimen that was restarted meanwhile. Every
//! exchange is waited for, up to the link's own time limit; commands are numbered anew, with the controller's gaps.

use std::sync::Arc;

use super::{Rig, Visitor};
use crate::rt::os;
use crate::substructure::{
    Command, Freshness, Introduction, LinkFault, LinkStats, Measurement, Retirement, Substructure,
};
use crate::time::Nanos;

/// Makes the link for a controller's test; it is not connected yet.
pub type FarBuild = Arc<dyn Fn(&Visitor) -> Result<Box<dyn Substructure>, String> + Send + Sync>;

/// A specimen across another link.
pub struct Far {
    build: FarBuild,
    /// What is believed of it, n × n by columns, in the units of the axes.
    stiffness: Vec<f64>,
    axes: usize,
    link: Option<Box<dyn Substructure>>,
    /// Our number of the controller's command number `theirs`.
    ours: u64,
    theirs: u64,
    /// Our first number that was not used yet.
    unused: u64,
    reply_limit_ns: u64,
}

impl std::fmt::Debug for Far {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Far")
            .field("axes", &self.axes)
            .field("connected", &self.link.is_some())
            .finish_non_exhaustive()
    }
}

impl Far {
    /// A specimen of `axes` axes across the link that `build` makes, whose stiffness is believed to be `stiffness`; an
    /// answer is waited for up to `reply_limit_ns`.
    #[must_use]
    pub fn new(build: FarBuild, axes: usize, stiffness: Vec<f64>, reply_limit_ns: u64) -> Self {
        Self {
            build,
            stiffness,
            axes,
            link: None,
            ours: 0,
            theirs: 0,
            unused: 0,
            reply_limit_ns,
        }
    }

    fn link(&mut self) -> Result<&mut Box<dyn Substructure>, LinkFault> {
        self.link.as_mut().ok_or(LinkFault::Closed)
    }
}

impl Rig for Far {
    fn axes(&self) -> usize {
        self.axes
    }

    fn is_remote(&self) -> bool {
        true
    }

    fn connect(&mut self, visitor: &Visitor) -> Result<Introduction, String> {
        (self.ours, self.theirs, self.unused) = (0, 0, 0);
        let mut link = (self.build)(visitor)?;
        let introduction = link.connect().map_err(|error| error.text)?;
        self.link = Some(link);
        Ok(introduction)
    }

    fn arm(&mut self, sequence: u64, start: &[f64]) -> Result<(), LinkFault> {
        (self.ours, self.theirs) = (self.unused, sequence);
        let first = self.ours;
        let link = self.link()?;
        link.ask_to_arm(first, start)?;
        link.arm(first, start)
    }

    fn trial(
        &mut self,
        command: &Command<'_>,
        _: f64,
        into: &mut Measurement,
    ) -> Result<(), LinkFault> {
        let sequence = self.ours + command.sequence.saturating_sub(self.theirs);
        self.unused = sequence + 1;
        let deadline = Nanos(os::monotonic_ns()).plus(self.reply_limit_ns);
        let link = self.link()?;
        link.issue(&Command {
            sequence,
            ..*command
        })?;
        match link.collect(deadline, into)? {
            Freshness::Fresh => Ok(()),
            // The time limit of a link that does not keep one itself.
            Freshness::Stale => Err(LinkFault::Timeout),
        }
    }

    fn commit(&mut self) -> Result<(), LinkFault> {
        match self.unused.checked_sub(1) {
            Some(newest) => self.link()?.accepted(newest),
            None => Ok(()),
        }
    }

    /// What has moved cannot.
    fn revert(&mut self) {}

    fn tangent(&mut self, stiffness: &mut [f64]) {
        for (to, from) in stiffness.iter_mut().zip(&self.stiffness) {
            *to = *from;
        }
    }

    fn attend(&mut self) -> Result<(), LinkFault> {
        self.link()?.attend()
    }

    fn stats(&self) -> LinkStats {
        self.link
            .as_ref()
            .map_or_else(LinkStats::default, |link| link.stats())
    }

    fn complaint(&self) -> Option<String> {
        self.link.as_ref().and_then(|link| link.complaint())
    }

    fn end(&mut self, how: Retirement) {
        if let Some(mut link) = self.link.take() {
            link.retire(how);
        }
    }
}
