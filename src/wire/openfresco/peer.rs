//! The servers that a controller may have at the other end, and the signals that each exchanges.

use super::hello::Program;
use super::sizes::Counts;

/// What listens at the other end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Peer {
    /// A: OpenFresco's `startSimAppElemServer`, or a server of ours. Answers requests for matrices.
    Element,
    /// A: OpenFresco's `startSimAppSiteServer`. Knows no matrices.
    Site,
    /// B: OpenFresco's `expSite ActorSite` with `startLabServer`.
    Actor,
    /// C: an OpenSees `adapter`, `actuator` or `corotActuator`.
    Adapter,
}

impl std::fmt::Display for Peer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Element => "OpenFresco element server",
            Self::Site => "OpenFresco site server",
            Self::Actor => "OpenFresco actor site",
            Self::Adapter => "OpenSees adapter",
        })
    }
}

impl Peer {
    /// Numbers of signals of a command and of an answer that the current programs accept, for `n` axes.
    #[must_use]
    pub const fn usual_signals(self, n: usize) -> (Counts, Counts) {
        match self {
            // Its displacements, velocities, accelerations and times are always zero.
            Self::Element => (Counts::new(n, n, n, 0, 1), Counts::new(0, 0, 0, n, 0)),
            Self::Site => (Counts::new(n, n, n, 0, 1), Counts::new(n, n, n, n, 1)),
            // A bank of uniaxial materials accepts no other numbers.
            Self::Actor => (Counts::new(n, n, 0, 0, 0), Counts::new(n, n, 0, n, 0)),
            Self::Adapter => (Counts::new(n, 0, 0, 0, 0), Counts::new(n, 0, 0, n, 0)),
        }
    }

    /// True if it reports the position of a specimen before the first command. It then measures on request, and its answers hold
    /// the displacement and the force of each of `axes` axes.
    ///
    /// An actor only repeats what it measured after a command. An adapter takes no request before one.
    #[must_use]
    pub fn reports_position(self, answer: Counts, axes: usize) -> bool {
        let can = matches!(self, Self::Element | Self::Site);
        can && answer.disp == axes && answer.force == axes
    }

    /// The program and version that is expected there.
    #[must_use]
    pub const fn program(self) -> Program {
        match self {
            Self::Element | Self::Site => Program::OpenFrescoServer,
            Self::Actor => Program::OpenFrescoSite,
            Self::Adapter => Program::OpenSees,
        }
    }
}
