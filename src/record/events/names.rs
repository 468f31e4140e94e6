//! The names of event kinds in `events.jsonl`; programs read them (guide: run-folder).

use crate::record::EventKind;
use crate::substructure::LinkFault;

/// The word of an event.
pub(super) const fn kind_name(kind: &EventKind) -> &'static str {
    match kind {
        EventKind::Started => "started",
        EventKind::Grid { .. } => "grid",
        EventKind::Ended => "ended",
        EventKind::Miss { .. } => "miss",
        EventKind::Gap { .. } => "gap",
        EventKind::Stale { .. } => "stale",
        EventKind::Recovered { .. } => "recovered",
        EventKind::Link { .. } => "link",
        EventKind::Unacknowledged { .. } => "unacknowledged",
        EventKind::Interlock { .. } => "interlock",
        EventKind::Saturated { .. } => "saturated",
        EventKind::Holds { .. } => "specimen_holds",
        EventKind::HoldsOn { .. } => "specimen_holds_on",
        EventKind::Unsettled { .. } => "unsettled",
        EventKind::RowLost => "row_lost",
        EventKind::Diverged { .. } => "diverged",
        EventKind::StopRequested => "stop_requested",
        EventKind::HoldRequested => "hold_requested",
        EventKind::ContinueRequested => "continue_requested",
        EventKind::ContinueDropped { .. } => "continue_dropped",
        EventKind::Confirmed => "confirmed",
        EventKind::Stands { .. } => "stands",
        EventKind::Moved { .. } => "moved",
        EventKind::Probing { .. } => "probing",
        EventKind::Direction { .. } => "direction",
        EventKind::DirectionUnknown { .. } => "direction_unknown",
        EventKind::ForceChanged { .. } => "force_changed",
        EventKind::Misfit { .. } => "misfit",
        EventKind::Geometry { .. } => "geometry",
        EventKind::Phase { .. } => "phase",
        EventKind::Pace { .. } => "pace",
        EventKind::Checkpoint { .. } => "checkpoint",
        EventKind::Limit { trip: true, .. } | EventKind::TestLimit { trip: true, .. } => {
            "limit_trip"
        }
        EventKind::Limit { .. } | EventKind::TestLimit { .. } => "limit_warning",
        EventKind::Readiness { go: true, .. } => "go",
        EventKind::Readiness { go: false, .. } => "no_go",
        EventKind::InitialForce { .. } => "initial_force",
        EventKind::Zeroed { .. } => "zeroed",
    }
}

/// The word of a lost link.
pub(super) const fn fault_name(fault: LinkFault) -> &'static str {
    match fault {
        LinkFault::Closed => "closed",
        LinkFault::Timeout => "timeout",
        LinkFault::Malformed => "malformed",
        LinkFault::Refused => "refused",
        LinkFault::Version => "version",
        LinkFault::Auth => "auth",
        LinkFault::Backpressure => "backpressure",
        LinkFault::NotFinite => "not_finite",
        LinkFault::Diverged => "diverged",
    }
}
