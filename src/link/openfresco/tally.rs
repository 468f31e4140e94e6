//! Counts of one client.

/// Messages that a host has handled for one client.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tally {
    /// Commands, repeats included.
    pub commands: u64,
    /// Commands that repeat the one before them.
    pub repeats: u64,
    /// Commands at a test time further from 0 than all before them: a load factor may fall from there.
    pub later_times: u64,
    /// Accepted steps.
    pub commits: u64,
    /// Steps taken back.
    pub taken_back: u64,
    /// Requests answered.
    pub answers: u64,
}
