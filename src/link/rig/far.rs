//! A specimen across another link: what makes a server a gateway.
//!
//! Each controller's test has a connection of its own, made when the controller arms and closed when its test is over: so
//! the next test finds a gateway that owes nothing to the last one, and a specimen that was restarted meanwhile. Every
//! exchange is waited for, up to the link's own time limit and for as long as it is wanted; commands are numbered anew, with
//! the controller's gaps.

use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::{Rig, TestEnd, Visitor, Wanted, elsewhere};
use crate::rt::os;
use crate::substructure::{
    Command, Freshness, Introduction, LISTEN_NS, LinkFault, LinkStats, Measurement, Retirement,
    Substructure,
};
use crate::time::Nanos;

/// How often it is asked whether a connection that is waited for is still wanted.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Why a specimen is not commanded whose place nobody knows: any first command might take it anywhere at once.
const NOBODY_KNOWS: &str = "its position is unknown: it does not report it, and no earlier test moved it; `stands_at_m` \
     in [specimen.link] says it, in m as each axis counts (or `computed = true`, that nothing moves there)";

/// Where a specimen across a link stands, as far as its last tests tell: shared by those who make its connections and those
/// who ask.
#[derive(Debug, Clone, Default)]
pub struct Whereabouts(Arc<Mutex<Known>>);

#[derive(Debug, Default)]
struct Known {
    /// Empty if it is not known.
    place: Vec<f64>,
    /// Where the last test found it, and where it left it.
    found: Vec<f64>,
    left: Vec<f64>,
    /// Whether it stays where a test leaves it: a formula may begin anew each time. None until it is known.
    stays: Option<bool>,
    /// It cannot tell where it stands, and stood here before the first test, as somebody says; empty if nobody does.
    said: Vec<f64>,
    /// Somebody says that it is a computation: nothing there can break.
    computed: bool,
}

impl Whereabouts {
    fn known(&self) -> MutexGuard<'_, Known> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Of what cannot tell where it stands: somebody says where that is before the first test. From then on it is where it was
    /// told to go last.
    #[must_use]
    pub fn said(place: Vec<f64>) -> Self {
        let known = Known {
            place: place.clone(),
            said: place,
            ..Known::default()
        };
        Self(Arc::new(Mutex::new(known)))
    }

    /// Of what somebody says to be a computation: it is believed at zero where nobody knows its place.
    #[must_use]
    pub fn of_a_computation(self) -> Self {
        self.known().computed = true;
        self
    }

    fn is_of_a_computation(&self) -> bool {
        self.known().computed
    }

    /// Where one stands that cannot tell; empty if nobody knows. One that could tell earlier is known to stay where it is left, or
    /// is not.
    fn stated(&self) -> Vec<f64> {
        let known = self.known();
        if known.said.is_empty() && known.stays != Some(true) {
            return Vec::new();
        }
        let latest = [&known.left, &known.found, &known.said];
        let latest = latest.into_iter().find(|place| !place.is_empty());
        latest.cloned().unwrap_or_default()
    }

    /// What a specimen says of itself before its first test, where the file says otherwise.
    fn contradicted_by(&self, standing: &[f64]) -> Option<String> {
        let known = self.known();
        let is_first = known.found.is_empty() && known.said.len() == standing.len();
        let differs = is_first && elsewhere(standing, &known.said).is_some();
        differs.then(|| {
            format!(
                "it reports the position {standing:?}, and `stands_at_m` gives {:?} (unit of the axis): the reported \
                 position is used",
                known.said
            )
        })
    }

    /// Where it stands; empty if nothing is known.
    #[must_use]
    pub fn place(&self) -> Vec<f64> {
        self.known().place.clone()
    }

    /// A test begins and hears this. What it finds shows whether the last one's end is where it stayed.
    fn begins(&self, introduction: &Introduction) {
        let mut known = self.known();
        let here = &introduction.standing;
        let from_left = distance(here, &known.left);
        let from_found = distance(here, &known.found);
        known.stays = if known.left.is_empty() || from_left == from_found {
            let moves = !(introduction.simulated || introduction.measured);
            known.stays.or(moves.then_some(true))
        } else {
            Some(from_left < from_found)
        };
        known.place.clone_from(here);
        known.found.clone_from(here);
        known.left.clear();
    }

    /// It was told to go there last.
    fn ends(&self, left: &[f64]) {
        let mut known = self.known();
        if !known.found.is_empty() {
            known.left = left.to_vec();
            match known.stays {
                Some(true) => known.place = left.to_vec(),
                Some(false) => {}
                // Its next connection shows it. Whoever goes on where the test ended, or begins anew, is held against that.
                None => known.place.clear(),
            }
        }
    }
}

fn distance(one: &[f64], other: &[f64]) -> f64 {
    let pairs = one.iter().zip(other);
    pairs.fold(0.0, |most, (one, other)| most.max((one - other).abs()))
}

/// Makes the link for a controller's test; it is not connected yet.
pub type FarBuild = Arc<dyn Fn(&Visitor) -> Result<Box<dyn Substructure>, String> + Send + Sync>;

/// A specimen across another link.
pub struct Far {
    build: FarBuild,
    /// What is believed of it, n × n by columns, in the units of the axes.
    stiffness: Vec<f64>,
    axes: usize,
    link: Option<Box<dyn Substructure>>,
    /// Where it stands, as far as it or somebody says so, and the force there; empty if nothing is known.
    standing: Vec<f64>,
    force: Vec<f64>,
    whereabouts: Whereabouts,
    /// The last command; empty before one.
    told: Vec<f64>,
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
            standing: Vec::new(),
            force: Vec::new(),
            whereabouts: Whereabouts::default(),
            told: Vec::new(),
            ours: 0,
            theirs: 0,
            unused: 0,
            reply_limit_ns,
        }
    }

    /// The same, remembering from test to test where it stands.
    #[must_use]
    pub fn remembering(mut self, whereabouts: Whereabouts) -> Self {
        self.whereabouts = whereabouts;
        self
    }

    fn link(&mut self) -> Result<&mut Box<dyn Substructure>, LinkFault> {
        self.link.as_mut().ok_or(LinkFault::Closed)
    }
}

/// Connects a link on a thread of its own, for it waits. One that is not wanted any more is left behind with its thread: its
/// far end was told of nothing that could move, and its connection closes with it.
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

impl Rig for Far {
    fn axes(&self) -> usize {
        self.axes
    }

    fn is_remote(&self) -> bool {
        true
    }

    fn connect(
        &mut self,
        visitor: &Visitor,
        wanted: &mut Wanted<'_>,
    ) -> Result<Introduction, TestEnd> {
        (self.ours, self.theirs, self.unused) = (0, 0, 0);
        let (link, mut introduction) = connected((self.build)(visitor)?, wanted)?;
        self.link = Some(link);
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
        self.standing.clone_from(&introduction.standing);
        self.force.clone_from(&introduction.force);
        self.whereabouts.begins(&introduction);
        self.told = Vec::with_capacity(self.axes);
        Ok(introduction)
    }

    /// A computation without a word of its own is believed to stand at zero.
    fn at_rest(&mut self, into: &mut Measurement) {
        into.disp.fill(0.0);
        into.force.fill(0.0);
        let disp = into.disp.iter_mut().zip(&self.standing);
        let force = into.force.iter_mut().zip(&self.force);
        for (to, stands) in disp.chain(force) {
            *to = *stands;
        }
    }

    fn pause(&mut self) -> Result<(), LinkFault> {
        self.link()?.pause()
    }

    fn halt(&mut self) -> Result<(), LinkFault> {
        self.link()?.halt()
    }

    fn arm(
        &mut self,
        sequence: u64,
        start: &[f64],
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, LinkFault> {
        (self.ours, self.theirs) = (self.unused, sequence);
        let first = self.ours;
        let link = self.link()?;
        link.ask_to_arm(first, start)?;
        link.arm(first, start, wanted)
    }

    fn trial(
        &mut self,
        command: &Command<'_>,
        _: f64,
        wanted: &mut dyn FnMut() -> bool,
        into: &mut Measurement,
    ) -> Result<bool, LinkFault> {
        // The last number of all is none of the protocol's.
        let sequence = (self.ours)
            .checked_add(command.sequence.saturating_sub(self.theirs))
            .filter(|sequence| *sequence < u64::MAX)
            .ok_or(LinkFault::Refused)?;
        self.unused = sequence + 1;
        let deadline = Nanos(os::monotonic_ns()).plus(self.reply_limit_ns);
        let link = self.link()?;
        link.issue(&Command {
            sequence,
            ..*command
        })?;
        // Within its capacity.
        self.told.clear();
        self.told.extend_from_slice(command.disp);
        let parts = self.reply_limit_ns.div_ceil(LISTEN_NS);
        let link = self.link()?;
        for _ in 0..parts {
            if link.is_answered(LISTEN_NS)? {
                break;
            }
            if !wanted() {
                return Ok(false);
            }
        }
        match link.collect(deadline, into)? {
            Freshness::Fresh => Ok(true),
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

    fn end(&mut self, how: Retirement) -> Option<String> {
        let mut link = self.link.take()?;
        link.retire(how);
        if !self.told.is_empty() {
            self.whereabouts.ends(&self.told);
        }
        link.last_words()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests that find the specimen here and leave it there; where it is believed to stand before each, and at the end.
    fn believed(simulated: bool, tests: &[(f64, f64)]) -> Vec<Vec<f64>> {
        let whereabouts = Whereabouts::default();
        let mut believed = vec![whereabouts.place()];
        for (found, left) in tests {
            whereabouts.begins(&Introduction {
                standing: vec![*found],
                simulated,
                ..Introduction::default()
            });
            whereabouts.ends(&[*left]);
            believed.push(whereabouts.place());
        }
        believed
    }

    #[test]
    fn what_cannot_tell_is_where_somebody_says_and_then_where_it_was_told_to_go() {
        let whereabouts = Whereabouts::said(vec![0.01]);
        assert_eq!(whereabouts.place(), [0.01]);
        let mut found = Vec::new();
        for left in [0.03, -0.02] {
            found.push(whereabouts.stated());
            whereabouts.begins(&Introduction {
                standing: whereabouts.stated(),
                ..Introduction::default()
            });
            whereabouts.ends(&[left]);
        }
        // Nobody told it anything in this one.
        whereabouts.begins(&Introduction {
            standing: whereabouts.stated(),
            ..Introduction::default()
        });
        found.push(whereabouts.stated());
        assert_eq!(found, [[0.01], [0.03], [-0.02]]);
        // Where a rig told once and does not now, it is where it was left; where it was moved meanwhile nobody knows.
        let rig = Whereabouts::default();
        let told = |place: f64| Introduction {
            standing: vec![place],
            ..Introduction::default()
        };
        rig.begins(&told(0.01));
        rig.ends(&[0.03]);
        assert_eq!(rig.stated(), [0.03]);
        rig.begins(&told(0.01));
        rig.ends(&[0.02]);
        assert!(rig.stated().is_empty());
        // Nobody says where a computation stands: it is believed at zero each time.
        let computed = Whereabouts::default();
        computed.begins(&Introduction::default());
        computed.ends(&[0.03]);
        assert!(computed.stated().is_empty());
    }

    #[test]
    fn a_rig_stays_where_it_was_left_and_a_formula_where_it_is_found_anew() {
        let rig = believed(false, &[(0.01, 0.04), (0.04, -0.02)]);
        assert_eq!(rig, [vec![], vec![0.04], vec![-0.02]]);
        let formula = believed(true, &[(0.0, 0.04), (0.0, -0.02)]);
        assert_eq!(formula, [vec![], vec![], vec![0.0]]);
        let stays = believed(true, &[(0.0, 0.04), (0.04, -0.02), (-0.02, 0.03)]);
        assert_eq!(stays, [vec![], vec![], vec![-0.02], vec![0.03]]);
        let driven_home = believed(false, &[(0.0, 0.04), (0.0, 0.03), (0.0, 0.02)]);
        assert_eq!(driven_home, [vec![], vec![0.04], vec![0.0], vec![0.0]]);
    }
}
