//! The page shows limits as the loop checks them: the peak shown is the level from which on the loop warns.

use std::sync::Arc;

use gusset_control::engine::{Experiment, Glimpse, Phase, PhaseCell, StartupSettings};
use gusset_control::port::limits::{AxisLimits, Bound, Range};
use gusset_control::port::{Axis, AxisSpec, PortSpec, Reference, Zero};
use gusset_quantity::catalog::limit::{Kind, Limit};
use gusset_quantity::substructure::{
    Command, Freshness, LinkFault, Measurement, Retirement, Substructure,
};
use gusset_quantity::time::{Nanos, SimClock};
use gusset_record::{Event, Onlooker, Progress};
use gusset_view::live::{About, Board, Snapshot, Subject, Tap, metrics};

use super::exposition;
use crate::common::engine::{prepare, run_on};

const RATE_HZ: f64 = 200.0;
const STIFFNESS: f64 = 2e5;

/// A spring in millimetres whose displacement sensor has an offset of 5 mm and a gain of 0.9.
struct Crooked {
    /// Polls that it takes for an answer.
    takes: u32,
    left: u32,
    disp: f64,
    sequence: u64,
    /// Commands without a reply, and commands for which its sensors keep their reading.
    misses: std::ops::Range<u64>,
    sticks: std::ops::Range<u64>,
    last: [f64; 2],
}

impl Substructure for Crooked {
    fn axes(&self) -> usize {
        1
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        (self.disp, self.sequence) = (command.disp[0], command.sequence);
        self.left = self.takes;
        Ok(())
    }
    fn is_answered(&mut self, _: u64) -> Result<bool, LinkFault> {
        self.left = self.left.saturating_sub(1);
        Ok(self.left == 0)
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        if self.misses.contains(&self.sequence) {
            return Ok(Freshness::Stale);
        }
        if !self.sticks.contains(&self.sequence) {
            self.last = [0.9 * self.disp + 5.0, 1e-3 * STIFFNESS * self.disp];
        }
        into.sequence = self.sequence;
        [into.disp[0], into.force[0]] = self.last;
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
}

/// Without a level that matters, but with all that are shown.
fn open() -> AxisLimits {
    let (size, range) = (Bound::trip(1e30), [-1e30, 1e30]);
    let range = Range {
        trip: range,
        ..Range::NONE
    };
    let mut limits = AxisLimits::NONE
        .with(Limit::CommandDisp, range)
        .with(Limit::CommandStep, size)
        .with(Limit::CommandVel, size)
        .with(Limit::CommandAccel, size)
        .with(Limit::MeasuredDisp, range)
        .with(Limit::MeasuredForce, range)
        .with(Limit::FollowingError, size)
        .with(Limit::ForceStep, size)
        .with(Limit::StuckSensor, size);
    limits.following_time = 0.002;
    limits.stuck_travel = 1e-5;
    limits
}

/// Those limits with a warning of one quantity from `size` on.
fn warned(quantity: Limit, size: f64) -> AxisLimits {
    let range = Range {
        warn: [-size, size],
        trip: [-1e30, 1e30],
    };
    let bound = Bound {
        warn: size,
        trip: 1e30,
    };
    match quantity.row().kind {
        Kind::Range => open().with(quantity, range),
        Kind::Size | Kind::Count => open().with(quantity, bound),
    }
}

const SHOWN: [Limit; 9] = [
    Limit::CommandDisp,
    Limit::CommandStep,
    Limit::CommandVel,
    Limit::CommandAccel,
    Limit::MeasuredDisp,
    Limit::MeasuredForce,
    Limit::FollowingError,
    Limit::ForceStep,
    Limit::StuckSensor,
];

/// Two floors that are shaken, the upper storey the specimen; commanded once a step of ten ticks, or every tick.
fn shaken(per_step: bool, limits: AxisLimits) -> Experiment {
    let ticks = if per_step { 10 } else { 1 };
    let more = format!("ticks_per_step = {ticks}\n");
    let mut experiment = prepare(&format!(
        "[time]\nrate_hz = {}\nduration_s = 3\n{}[integrator]\nlambda = 2\n\
         [structure.shear_building]\nmass_kg = [2e3, 2e3]\nstiffness_n_per_m = [3e5, 3e5]\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = 2\nfrequency_hz = 1\n\
         [safety]\nzero_s = 0\nramp_s = 0\nease_s = 0\n",
        if per_step { RATE_HZ / 4.0 } else { RATE_HZ },
        if per_step { more } else { String::new() },
    ))
    .experiment;
    experiment.opening = StartupSettings {
        zero_ticks: 8,
        ..StartupSettings::default()
    };
    experiment.limits.warmup_ticks = 10;
    experiment.limits.stale_in_a_row = 100;
    experiment.limits.extrapolate_stale = true;
    let mut axis = Axis::plain(vec![(0, -1.0), (1, 1.0)]);
    (axis.disp_gain, axis.vel_gain) = (1e3, 1e3);
    let specimen = Crooked {
        takes: if per_step { 4 } else { 1 },
        left: 0,
        disp: 0.0,
        sequence: 0,
        misses: if per_step { 0..0 } else { 150..158 },
        sticks: if per_step { 60..65 } else { 215..220 },
        last: [5.0, 0.0],
    };
    let axis = AxisSpec {
        units: (1e-3, 1.0),
        limits,
        reference: Reference {
            disp: Zero::Relative,
            force: Zero::Absolute,
        },
        ..AxisSpec::new(axis, STIFFNESS)
    };
    let mut spec = PortSpec::new("upper", Box::new(specimen), 2, vec![axis]);
    spec.tick = experiment.period.value();
    spec.step = Some(spec.tick * f64::from(ticks));
    spec.per_step = per_step;
    experiment.ports.push(spec.build().unwrap());
    experiment
}

fn about() -> About {
    About {
        title: "Judged".into(),
        run: "runs/judged".into(),
        real_clock: true,
        lambda: None,
        ..About::default()
    }
}

/// A board, and the tap that updates it with rows.
fn looked_at(experiment: &Experiment, phase: &PhaseCell) -> (Arc<Board>, Tap) {
    let subject = Subject::new(experiment, about());
    let board = Arc::new(Board::new(subject, phase.clone(), None));
    let (_, notes) = crossbeam_channel::bounded(1);
    let tap = Tap::new(Arc::clone(&board), notes);
    (board, tap)
}

/// The page of such a test after its last row, its snapshot, and the loop's warnings.
fn shown(per_step: bool, limits: AxisLimits) -> (Arc<Board>, Arc<Snapshot>, Vec<(String, f64)>) {
    let experiment = shaken(per_step, limits);
    let (board, mut tap) = looked_at(&experiment, &PhaseCell::default());
    let run = run_on(experiment, SimClock::new());
    assert!(run.rows.len() > 250, "{:?}", run.outcome.ending);
    for (number, row) in (0..).zip(&run.rows) {
        tap.row(number, row);
    }
    tap.finish(1, &Progress::default());
    let warnings = run.events.iter().filter_map(|event| match &event.kind {
        Event::LimitWarning(reached) | Event::LimitTrip(reached) if !reached.is_of_test() => {
            Some((reached.limit.to_string(), reached.value))
        }
        _ => None,
    });
    let warnings = warnings.collect();
    let latest = board.latest();
    (board, latest, warnings)
}

#[test]
fn peak_shown_is_the_one_the_loop_checked() {
    for per_step in [false, true] {
        let (board, latest, warnings) = shown(per_step, open());
        assert_eq!(warnings, []);
        let marks = &board.subject.specimens[0].axes[0].marks;
        for quantity in SHOWN {
            let place = marks.iter().position(|mark| mark.key == quantity.key());
            let [_, low, high] = latest.axes[0].limits[place.unwrap()];
            let peak = high.max(-low);
            let at = format!("{} of {peak}, once a step: {per_step}", quantity.key());
            assert!(peak > 0.0, "{at}");
            // Beyond the last digit that the units leave.
            let [below, above] = [1.0 - 1e-9, 1.0 + 1e-9].map(|share| {
                let (.., warnings) = shown(per_step, warned(quantity, share * peak));
                warnings
            });
            assert_eq!(above, [], "{at}");
            assert!(!below.is_empty(), "{at}");
            assert!(below.iter().all(|(key, _)| key == quantity.key()), "{at}");
        }
    }
}

#[test]
fn unmeasured_values_are_no_points() {
    let (_, latest, _) = shown(false, open());
    // A tenth of the way, and not the 5 mm of the sensor.
    let axis = &latest.axes[0];
    let command = axis.command;
    assert!((axis.error + 0.1 * command).abs() < 1e-12, "{axis:?}");
    assert_eq!(latest.specimens[0].stale, 8);
}

#[test]
fn exchanges_shown_are_those_counted() {
    for per_step in [false, true] {
        let experiment = shaken(per_step, open());
        let columns = experiment.columns();
        let (board, mut tap) = looked_at(&experiment, &PhaseCell::default());
        let run = run_on(experiment, SimClock::new());
        // A lost row changes no count.
        let rows = (0..).zip(&run.rows);
        let kept: Vec<_> = rows.filter(|(number, _)| number % 7 != 3).collect();
        for (number, row) in &kept {
            tap.row(*number, row);
        }
        tap.finish(1, &Progress::default());
        let shown = &board.latest().specimens[0];
        let counts = ["exchanges_1", "stale_1"].map(|name| {
            let place = columns.iter().position(|column| column.name == name);
            kept.last().unwrap().1[place.unwrap()]
        });
        assert_eq!([shown.exchanges, shown.stale].map(|n| n as f64), counts);
        assert!(shown.exchanges > 100, "{per_step}");
    }
}

#[test]
fn every_limit_of_the_test_is_shown() {
    let text = format!(
        "{}\n[safety]\nadded_energy_share = {{ warn = 0.1, trip = 0.2, floor_j = 1.0 }}\n[timing]\nmisses.in_window.trip = 9\n",
        crate::common::FRAME
    );
    let experiment = prepare(&text).experiment;
    let (board, mut tap) = looked_at(&experiment, &PhaseCell::default());
    let keys: Vec<_> = board.subject.test.iter().map(|mark| mark.key).collect();
    for key in [
        "added_energy_share",
        "max_consecutive_misses",
        "max_misses_in_window",
        "max_total_misses",
    ] {
        assert!(keys.contains(&key), "{key} in {keys:?}");
    }
    let names: Vec<_> = experiment.columns().into_iter().map(|c| c.name).collect();
    // Two deadlines are missed, and then none. After a while both are outside the window.
    for (k, misses) in [[0.0; 2], [1.0; 2], [2.0; 2], [0.0, 2.0], [0.0; 2]]
        .into_iter()
        .enumerate()
    {
        let value = |name: &String| match name.as_str() {
            "state" => Phase::Running.code(),
            "misses_in_a_row" => misses[0],
            "misses_in_window" => misses[1],
            "added_energy_share" => 0.1,
            _ => 0.0,
        };
        let row: Vec<_> = names.iter().map(value).collect();
        tap.row(k as u64, &row);
    }
    tap.finish(1, &Progress::default());
    let text = metrics(&board, 1, 0);
    let families = exposition::parse(&text);
    let worst = |key: &str| {
        let samples = &families["gusset_test_limit_used_worst_ratio"].samples;
        let found = samples.iter().find(|sample| sample.labels["limit"] == key);
        found.unwrap_or_else(|| panic!("no {key}")).value
    };
    assert_eq!(worst("added_energy_share"), 0.5);
    assert!((worst("max_misses_in_window") - 2.0 / 9.0).abs() < 1e-12);
    let place = keys.iter().position(|key| *key == "max_consecutive_misses");
    assert_eq!(board.latest().test[place.unwrap()], [0.0, 2.0]);
}

/// Rows of the warm-up are delayed: that is no silence, and the page shows the hold without them.
#[test]
fn long_warm_up_raises_no_alarm() {
    let experiment = shaken(false, open());
    let phase = PhaseCell::default();
    let (board, mut tap) = looked_at(&experiment, &phase);
    let row = vec![0.0; experiment.columns().len()];
    tap.row(0, &row);
    let progress = Progress::default();
    let second = 1_000_000_000;
    tap.turn(second, &progress);
    phase.show(Glimpse {
        phase: Phase::Armed,
        hold: true,
        stands: true,
        unconfirmed: false,
        hold_number: 1,
    });
    tap.turn(9 * second, &progress);
    assert_eq!(board.latest().row_ns, 9 * second);
    let scraped = metrics(&board, 9 * second, 0);
    assert!(scraped.contains("gusset_hold_requested 1"));
    assert!(scraped.contains("gusset_hold_number 1"));
    phase.set(Phase::Running);
    tap.turn(13 * second, &progress);
    assert_eq!(board.latest().row_ns, 9 * second, "here silence is one");
}
