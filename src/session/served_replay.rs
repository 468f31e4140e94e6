//! A controller's test at a server once more: its targets and the measurements come from the record, and the served specimen makes
//! each command again.
//!
//! The record has what came from outside: the targets and their times, what happened between two commands, and how much time each had
//! by the wall clock. Pacing, conversion, compensation, the limits, the wiring check and the rows are those of the server.

use std::sync::Arc;

use super::checksum::check_inputs;
use super::playback::{Comparing, Course, Playback, Recording, Shared, at, with};
use super::replay_error::ReplayError;
use gusset_config::is_for_a_server;
use gusset_control::engine::Between;
use gusset_link::served::{ServedSpecimen, TrialFault, Trip};
use gusset_quantity::catalog::column::{
    ALLOWED, ALLOWED_BY_CONTROLLER, ASKED, ASKED_ELAPSED, ASKED_TIME, ASKED_VEL, BETWEEN,
    COMMAND_NUMBER, COMMITS, Kind, RAW_DISP, RAW_FORCE, RAW_STATUS, SERVER_STATE, SERVER_STATUS,
    TRIP,
};
use gusset_quantity::catalog::phase::{Phase, Stage};
use gusset_quantity::substructure::{
    Command, Freshness, Introduction, LinkFault, Measurement, Retirement, Status, Substructure,
    Unavailable,
};
use gusset_quantity::time::Nanos;
use gusset_record::{Event, Layout, Ready, Run};
use gusset_setup::load_served_record;

/// Code of a specimen that is lost, in the column `trip`.
const LOST: u32 = Trip::Lost(LinkFault::Closed).code();
/// Code of a measurement that is not finite.
const NOT_FINITE: u32 = Trip::NotFinite {
    axis: None,
    measured: true,
}
.code();

/// Places of a server's columns in its rows.
#[derive(Debug, Clone)]
struct Places {
    state: usize,
    number: usize,
    commits: usize,
    trip: usize,
    time: usize,
    elapsed: usize,
    between: usize,
    allowed: [usize; 2],
    asked: Vec<[usize; 2]>,
    raw: Vec<[usize; 2]>,
    raw_status: usize,
    status: usize,
}

impl Places {
    fn of(layout: &Layout) -> Self {
        let place = |name: &str| layout.index_of(name).unwrap_or(usize::MAX);
        let pairs = |kinds: [&Kind; 2]| {
            let pair = |number: usize| kinds.map(|kind| layout.index_of(&kind.of_axis(1, number)));
            let pairs = (1..).map_while(move |number| match pair(number) {
                [Some(one), Some(other)] => Some([one, other]),
                _ => None,
            });
            pairs.collect()
        };
        Self {
            state: place(SERVER_STATE.name()),
            number: place(COMMAND_NUMBER.name()),
            commits: place(COMMITS.name()),
            trip: place(TRIP.name()),
            time: place(ASKED_TIME.name()),
            elapsed: place(ASKED_ELAPSED.name()),
            between: place(BETWEEN.name()),
            allowed: [ALLOWED, ALLOWED_BY_CONTROLLER].map(|kind| place(kind.name())),
            asked: pairs([&ASKED, &ASKED_VEL]),
            raw: pairs([&RAW_DISP, &RAW_FORCE]),
            raw_status: place(&RAW_STATUS.of_specimen(1)),
            status: place(&SERVER_STATUS.of_specimen(1)),
        }
    }
}

/// The record in place of the specimen: it answers as in the row that comes.
struct Recorded {
    playback: Shared,
    places: Places,
    introduction: Introduction,
    at_rest: Vec<[f64; 2]>,
    is_remote: bool,
    issued: u64,
}

impl Recorded {
    /// A number of the row that comes.
    fn next(&self, place: usize) -> f64 {
        with(&self.playback, |playback| at(playback.next(), place))
    }

    /// Fails after the last row, or if the specimen was lost in the row that comes: before its command left, if `unsent`.
    fn is_lost(&self, unsent: bool) -> Result<(), LinkFault> {
        if with(&self.playback, |playback| playback.is_over()) {
            return Err(LinkFault::Closed);
        }
        let was_before = Between::of_column(self.next(self.places.between)).has(Between::TRIPPED);
        let is_unsent = self.next(self.places.state) == Phase::Tripped.code();
        let is_lost = self.next(self.places.trip) == f64::from(LOST);
        if is_lost && !was_before && is_unsent == unsent {
            return Err(LinkFault::Closed);
        }
        Ok(())
    }
}

impl Substructure for Recorded {
    fn axes(&self) -> usize {
        self.places.raw.len()
    }

    fn is_remote(&self) -> bool {
        self.is_remote
    }

    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        Ok(self.introduction.clone())
    }

    fn arm(&mut self, _: u64, _: &[f64], _: &mut dyn FnMut() -> bool) -> Result<bool, LinkFault> {
        Ok(true)
    }

    fn at_rest(&mut self, into: &mut Measurement) -> bool {
        let places = into.disp.iter_mut().zip(&mut into.force);
        for ((disp, force), [disp_at_rest, force_at_rest]) in places.zip(&self.at_rest) {
            (*disp, *force) = (*disp_at_rest, *force_at_rest);
        }
        true
    }

    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.issued = command.sequence;
        self.is_lost(true)
    }

    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        self.is_lost(false)?;
        let axes = into.disp.iter_mut().zip(&mut into.force);
        let mut is_new = false;
        for ((disp, force), place) in axes.zip(&self.places.raw) {
            let [raw_disp, raw_force] = place.map(|place| self.next(place));
            is_new |=
                raw_disp.to_bits() != disp.to_bits() || raw_force.to_bits() != force.to_bits();
            (*disp, *force) = (raw_disp, raw_force);
        }
        if !is_new && self.next(self.places.trip) == f64::from(NOT_FINITE) {
            // The link refused the numbers, which no row has.
            return Err(LinkFault::NotFinite);
        }
        into.status = Status(self.next(self.places.raw_status) as u32);
        into.sequence = self.issued;
        Ok(Freshness::Fresh)
    }

    /// An answer that its controller did not want to wait for never comes.
    fn is_answered(&mut self, _: u64) -> Result<bool, LinkFault> {
        self.is_lost(false)?;
        Ok(!Status(self.next(self.places.status) as u32).has(Status::OWED))
    }

    /// Lost between two commands.
    fn accepted(&mut self, _: u64) -> Result<(), LinkFault> {
        let between = Between::of_column(self.next(self.places.between));
        let is_lost = self.next(self.places.trip) == f64::from(LOST);
        if is_lost && between.has(Between::TRIPPED) {
            return Err(LinkFault::Closed);
        }
        Ok(())
    }

    fn attend(&mut self) -> Result<(), LinkFault> {
        Ok(())
    }

    fn retire(&mut self, _: Retirement) {}
}

/// Facts of the events of a record.
struct Told {
    /// Each time that the test began: before which row, and with what. An armed test may begin again.
    beginnings: Vec<(u64, Ready)>,
    /// The newest exchange that an event names.
    newest: Option<u64>,
}

impl Told {
    fn by(run: &Run) -> Result<Self, ReplayError> {
        let (mut beginnings, mut newest) = (Vec::new(), None);
        for line in run.event_lines()? {
            let Some(line) = line? else { continue };
            newest = newest.max(line.tick);
            if let Event::Ready(ready) = line.event {
                // The position of an event is that of the exchange before it.
                let next = line.tick.map_or(0, |exchange| exchange + 1);
                beginnings.push((next, *ready));
            }
        }
        Ok(Self { beginnings, newest })
    }
}

/// A replayed test at its end.
pub(super) struct Followed {
    pub playback: Shared,
    pub served: ServedSpecimen,
    /// The newest exchange that an event names.
    pub newest: Option<u64>,
}

/// Replays the test of a server's run folder.
pub(super) fn follow(run: &Run, recording: Recording) -> Result<Followed, ReplayError> {
    check_inputs(run)?;
    let Told { beginnings, newest } = Told::by(run)?;
    let Some((_, ready)) = beginnings.first() else {
        return Err(ReplayError::NeverBegan(run.path().to_owned()));
    };
    // A test file that was served is served again unchanged.
    let file = run.path().join("test.toml");
    let file = if is_for_a_server(&file) {
        run.path().join("resolved.toml")
    } else {
        file
    };
    let hosted = load_served_record(&file, Some(&ready.specimen))?;
    let served = hosted.host.specimen(ready.remembers);
    let served = served.map_err(|text| ReplayError::Host(run.path().to_owned(), text))?;
    let layout = run.layout();
    let columns = served.columns();
    super::retrace::same_columns(layout.columns(), &columns)?;
    let course = Course::of_a_server(&columns);
    // Nothing hears what the playback tells an operator.
    let (operator, _) = crossbeam_channel::bounded(1);
    let rows = 0..u64::MAX;
    let playback = Playback::new(recording, layout, &course, operator, rows, false);
    let playback: Shared = Arc::new(playback.into());
    let places = Places::of(layout);
    let partner = Recorded {
        playback: Arc::clone(&playback),
        places: places.clone(),
        introduction: Introduction {
            standing: ready.standing.clone(),
            measured: ready.measured,
            force: ready.force.clone(),
            ..Introduction::default()
        },
        at_rest: ready.at_rest.clone(),
        is_remote: hosted.host.is_gateway(),
        issued: 0,
    };
    let comparing = Box::new(Comparing(Arc::clone(&playback)));
    let served = served.replaying(ready, Box::new(partner), comparing)?;
    let mut driver = Driver {
        served,
        playback: &playback,
        places: &places,
        number: f64::NAN,
        asked: Vec::new(),
    };
    driver.drive(&beginnings);
    let served = driver.served;
    Ok(Followed {
        playback,
        served,
        newest,
    })
}

/// Gives a served specimen the targets of the record, one after the other.
struct Driver<'a> {
    served: ServedSpecimen,
    playback: &'a Shared,
    places: &'a Places,
    /// Number of the target of the row before, and its displacements.
    number: f64,
    asked: Vec<f64>,
}

impl Driver<'_> {
    /// A number of the row that comes.
    fn next(&self, place: usize) -> f64 {
        with(self.playback, |playback| at(playback.next(), place))
    }

    fn drive(&mut self, beginnings: &[(u64, Ready)]) {
        let mut beginnings = beginnings.iter();
        let begun = beginnings
            .next()
            .map(|(_, ready)| self.served.begin_as(ready));
        if let Some(Err(end)) = begun {
            return self.ends(&end.text);
        }
        let mut beginnings = beginnings.peekable();
        loop {
            let is_over = with(self.playback, |playback| {
                playback.is_over() || playback.difference.is_some()
            });
            if is_over {
                return;
            }
            let row = with(self.playback, |playback| playback.row);
            let goes_on = self.goes_on();
            self.commit();
            while let Some((_, ready)) = beginnings.next_if(|(next, _)| *next <= row) {
                let again = (self.served).begin_again(ready.first, &ready.start, &mut || Ok(()));
                if let Err(end) = again {
                    return self.ends(&end.text);
                }
            }
            if goes_on {
                self.go_on();
            } else {
                self.exchange();
            }
            if with(self.playback, |playback| {
                playback.row == row && playback.difference.is_none()
            }) {
                return self.ends("the replay makes no command here");
            }
        }
    }

    /// The proof ends here, because of this.
    fn ends(&self, text: &str) {
        with(self.playback, |playback| {
            playback.short = Some(format!("row {}: {text}", playback.row));
        });
    }

    /// Accepts what was accepted before the row that comes.
    fn commit(&mut self) {
        let commits = self.next(self.places.commits);
        while (self.served.commits() as f64) < commits && self.served.tripped().is_none() {
            self.served.commit();
        }
    }

    /// True if the row that comes is one between two targets, and not on the way to the next. A target that was sent again before it was
    /// accepted is sent again; another one was refused there.
    fn goes_on(&mut self) -> bool {
        let state = self.next(self.places.state);
        let number = self.next(self.places.number);
        let disp = self.places.asked.iter().map(|[disp, _]| self.next(*disp));
        let disp: Vec<f64> = disp.collect();
        let is_new = std::mem::replace(&mut self.number, number) != number;
        let is_same = std::mem::replace(&mut self.asked, disp) == self.asked;
        let is_between = state == Stage::Predict.code() || state == Stage::SlowDown.code();
        let is_kept_back = state == Phase::Tripped.code() && self.served.predicts() && !is_new;
        if !is_between && !is_kept_back {
            return false;
        }
        if is_new && is_same {
            // It made no row.
            self.exchange();
        }
        !is_new || is_same
    }

    /// A tick between two targets, or the way to rest at the end.
    fn go_on(&mut self) {
        let between = Between::of_column(self.next(self.places.between));
        self.served.foretell(Between::default(), None);
        if between.has(Between::UNWANTED) {
            self.served.come_to_rest();
        } else {
            // The rows show how it ended.
            let _ = self.served.go_on();
        }
    }

    /// The target of the row that comes.
    fn exchange(&mut self) {
        let between = Between::of_column(self.next(self.places.between));
        if between.has(Between::HALTED) {
            self.served.halt();
        }
        if between.has(Between::TRIPPED) {
            let code = self.next(self.places.trip);
            self.served.trip(if code == f64::from(LOST) {
                Trip::Lost(LinkFault::Closed)
            } else if code == f64::from(NOT_FINITE) {
                LinkFault::NotFinite.into()
            } else {
                // The program that has the client judges its trials.
                Trip::Trial(TrialFault {
                    signal: 0,
                    distance: f64::NAN,
                    within: None,
                })
            });
        }
        let allowed = self.places.allowed.map(|place| self.next(place));
        let is_known = allowed.iter().all(|time| !time.is_nan());
        self.served.foretell(between, is_known.then_some(allowed));
        let motion = self.places.asked.iter();
        let (disp, vel): (Vec<f64>, Vec<f64>) = motion
            .map(|[disp, vel]| (self.next(*disp), self.next(*vel)))
            .unzip();
        let number = self.next(self.places.number);
        let elapsed = self.next(self.places.elapsed);
        let command = Command {
            sequence: number as u64,
            time: self.next(self.places.time),
            dt: elapsed,
            disp: &disp,
            vel: &vel,
        };
        let (playback, places) = (self.playback, self.places);
        let mut wanted = || with(playback, |playback| is_wanted(playback, places, number));
        let mut into = Measurement::zeros(disp.len());
        // Its rows show how it ended.
        let _ = self
            .served
            .exchange(&command, elapsed, &mut wanted, &mut into);
    }
}

/// Whether the controller still wants the answer to the target `number`, of which rows may come.
fn is_wanted(playback: &Playback, places: &Places, number: f64) -> bool {
    let row = playback.next();
    let between = Between::of_column(at(row, places.between));
    if at(row, places.number) != number {
        return !between.has(Between::GIVEN_UP);
    }
    let is_owed = Status(at(row, places.status) as u32).has(Status::OWED);
    !between.has(Between::UNWANTED) && !is_owed
}
