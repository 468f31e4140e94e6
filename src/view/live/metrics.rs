//! Metrics for Prometheus: the text exposition format 0.0.4.
//!
//! Base units, counters that end in `_total`, one HELP and one TYPE per family. An unknown value is omitted, not 0. Made
//! from the board alone.

use super::board::{Board, Snapshot};
use super::exposition::Text;
use super::marks::share;
use gusset_control::engine::Phase;
use gusset_quantity::substructure::Status;

/// The metrics at `now_ns` on the monotonic clock, with the number of viewers.
#[must_use]
pub fn metrics(board: &Board, now_ns: u64, viewers: usize) -> String {
    let latest = board.latest();
    let mut text = Text(String::with_capacity(16 << 10));
    test(&mut text, board, &latest, now_ns, viewers);
    timing(&mut text, &latest);
    specimens(&mut text, board, &latest);
    whole(&mut text, board, &latest);
    trips(&mut text, board, &latest);
    links(&mut text, board, &latest);
    lambda(&mut text, board, now_ns);
    text.0
}

fn test(text: &mut Text, board: &Board, latest: &Snapshot, now_ns: u64, viewers: usize) {
    let subject = &board.subject;
    text.family("gusset_info", "gauge", "The test that runs.");
    let clock = if subject.real_clock {
        "real"
    } else {
        "simulated"
    };
    let version = env!("CARGO_PKG_VERSION");
    text.sample(
        "gusset_info",
        &[
            ("title", &subject.title),
            ("clock", clock),
            ("version", version),
        ],
        1.0,
    );
    let now = board.phase();
    let name = "gusset_phase";
    text.family(
        name,
        "gauge",
        "1 for the present phase of the test, 0 for all others. The phase \"tripped\" ends when the shutdown begins; see gusset_tripped.",
    );
    for phase in Phase::ALL {
        let here = f64::from(u8::from(phase == now));
        text.sample(name, &[("phase", phase.word())], here);
    }
    if let Some(ended) = board.ended() {
        let name = "gusset_outcome";
        text.family(name, "gauge", "How the test has ended; absent before.");
        text.sample(name, &[("status", &ended.status)], 1.0);
    }
    let gauge = "gauge";
    let seen = board.glimpse();
    text.one(
        "gusset_hold_requested",
        gauge,
        "1 while the operator wants a hold.",
        f64::from(u8::from(seen.hold)),
    );
    text.one(
        "gusset_hold_number",
        gauge,
        "Number of the latest hold: CONTINUE names it.",
        seen.hold_number,
    );
    text.one("gusset_test_time_seconds", gauge, "Test time.", latest.time);
    let duration = subject.steps as f64 * subject.dt;
    let help = "Test time at which the test is over.";
    text.one("gusset_test_duration_seconds", gauge, help, duration);
    text.one(
        "gusset_step_seconds",
        gauge,
        "Step of the integration.",
        subject.dt,
    );
    let help = "Period of the controller in wall time.";
    text.one("gusset_tick_period_seconds", gauge, help, subject.tick_s);
    if latest.row_ns > 0 {
        let age = now_ns.saturating_sub(latest.row_ns) as f64 * 1e-9;
        let help = "Wall time since the last row came from the loop; 0 in the warm-up, whose rows are held back.";
        text.one("gusset_last_row_age_seconds", gauge, help, age);
    }
    text.one(
        "gusset_viewers",
        gauge,
        "Viewers of the live page.",
        viewers as f64,
    );
    for (name, help, value) in [
        (
            "gusset_ticks_total",
            "Rows of the loop, one per tick.",
            latest.rows,
        ),
        (
            "gusset_steps_total",
            "Steps of the integration that were made.",
            latest.steps,
        ),
        (
            "gusset_rows_written_total",
            "Rows in the file.",
            latest.rows_written,
        ),
        (
            "gusset_rows_lost_total",
            "Rows lost to a full queue or disk.",
            latest.rows_lost,
        ),
        (
            "gusset_events_total",
            "Lines of the event log.",
            latest.events,
        ),
    ] {
        text.one(name, "counter", help, value as f64);
    }
}

fn timing(text: &mut Text, latest: &Snapshot) {
    let name = "gusset_deadline_misses_total";
    text.family(name, "counter", "Deadlines missed, by class.");
    let misses = latest.misses;
    for (class, count) in misses.each() {
        text.sample(name, &[("class", class.key())], count as f64);
    }
    let help = "Whole ticks by which the grid was moved.";
    text.one(
        "gusset_stretched_ticks_total",
        "counter",
        help,
        latest.stretched,
    );
    let helps = [
        "From the edge to the first instruction after the wait.",
        "From the edge to the end of the last send.",
        "From the last send to the last decoded reply.",
        "From the last decoded reply to the next command ready.",
    ];
    for (view, help) in latest.timing.iter().zip(helps) {
        text.histogram(&format!("gusset_{}_seconds", view.key), help, view);
    }
}

fn specimens(text: &mut Text, board: &Board, latest: &Snapshot) {
    let subject = &board.subject;
    let mut family = |name: &str, help: &str, value: &dyn Fn(&super::AxisView) -> f64| {
        text.family(name, "gauge", help);
        for ((specimen, index, _), view) in subject.axes().zip(&latest.axes) {
            let axis = (index + 1).to_string();
            let labels = [
                ("specimen", specimen.name.as_str()),
                ("axis", axis.as_str()),
            ];
            text.sample(name, &labels, value(view));
        }
    };
    let (cmd, meas) = (
        "gusset_command_displacement_meters",
        "gusset_measured_displacement_meters",
    );
    family(
        cmd,
        "Displacement that was sent, at the specimen.",
        &|view| view.command,
    );
    family(
        meas,
        "Displacement that was measured, at the specimen.",
        &|view| view.measured,
    );
    let help = "Force that was measured, at the specimen.";
    family("gusset_measured_force_newtons", help, &|view| view.force);
    let help = "Measured minus sent displacement less what the sensor reads beyond it at its zero, at the specimen.";
    family("gusset_following_error_meters", help, &|view| view.error);
    let help = "Tangent stiffness as estimated, at the structure.";
    family(
        "gusset_tangent_stiffness_newtons_per_meter",
        help,
        &|view| view.stiffness,
    );
    let help = "Energy that the transfer system has added.";
    family("gusset_added_energy_joules", help, &|view| view.added);
    if subject.axes().any(|(_, _, axis)| axis.has_margin) {
        let help = "Critical delay at the stiffness of the last seconds less their lag; +Inf if every delay is stable.";
        family("gusset_delay_margin_seconds", help, &|view| view.margin[0]);
        let help = "The smallest of these so far.";
        family("gusset_delay_margin_lowest_seconds", help, &|view| {
            view.margin[1]
        });
    }
    let used = "gusset_limit_used_ratio";
    let worst = "gusset_limit_used_worst_ratio";
    for (name, help, peak) in [
        (
            used,
            "Present value over the level at which the limit trips.",
            false,
        ),
        (
            worst,
            "Worst value so far over the level at which the limit trips.",
            true,
        ),
    ] {
        text.family(name, "gauge", help);
        for ((specimen, index, axis), view) in subject.axes().zip(&latest.axes) {
            let number = (index + 1).to_string();
            let marks = axis.marks.iter().zip(&view.limits);
            for (mark, [value, low, high]) in marks.filter(|(mark, _)| !mark.end.is_finite()) {
                let labels = [
                    ("specimen", specimen.name.as_str()),
                    ("axis", number.as_str()),
                    ("limit", mark.key),
                ];
                let share = if peak {
                    share(mark.trip, *low).max(share(mark.trip, *high))
                } else {
                    share(mark.trip, *value)
                };
                text.sample(name, &labels, share);
            }
        }
    }
}

/// Metrics that belong to no specimen alone.
fn whole(text: &mut Text, board: &Board, latest: &Snapshot) {
    let marks = || board.subject.test.iter().zip(&latest.test);
    for (name, help, place) in [
        (
            "gusset_test_limit_used_ratio",
            "Limit of the whole test: present value over the level at which it trips.",
            0,
        ),
        (
            "gusset_test_limit_used_worst_ratio",
            "Limit of the whole test: worst value so far over the level at which it trips.",
            1,
        ),
    ] {
        text.family(name, "gauge", help);
        for (mark, values) in marks() {
            let used = share(mark.trip, values[place]);
            text.sample(name, &[("limit", mark.key)], used);
        }
    }
}

fn trips(text: &mut Text, board: &Board, latest: &Snapshot) {
    if latest.trips.is_empty() {
        return;
    }
    let name = "gusset_tripped";
    let help =
        "1 for every limit or fault that the test has tripped for, to its end; absent before.";
    text.family(name, "gauge", help);
    for trip in &latest.trips {
        let specimen = trip.specimen.and_then(|at| board.subject.specimens.get(at));
        let axis = trip.axis.map(|axis| (axis + 1).to_string());
        let labels = [
            specimen.map(|specimen| ("specimen", specimen.name.as_str())),
            axis.as_deref().map(|axis| ("axis", axis)),
            Some(("limit", trip.limit.as_ref())),
        ];
        let labels: Vec<_> = labels.into_iter().flatten().collect();
        text.sample(name, &labels, 1.0);
    }
}

fn links(text: &mut Text, board: &Board, latest: &Snapshot) {
    let specimens = || board.subject.specimens.iter().zip(&latest.specimens);
    let total =
        |text: &mut Text, name: &str, help: &str, count: &dyn Fn(&super::SpecimenView) -> u64| {
            text.family(name, "counter", help);
            for (specimen, view) in specimens() {
                text.sample(name, &[("specimen", &specimen.name)], count(view) as f64);
            }
        };
    let (exchanges, stale) = (
        "gusset_specimen_exchanges_total",
        "gusset_specimen_stale_total",
    );
    total(
        text,
        exchanges,
        "Ticks in which the specimen was commanded.",
        &|view| view.exchanges,
    );
    total(
        text,
        stale,
        "Of these, without a fresh answer in time.",
        &|view| view.stale,
    );
    let name = "gusset_specimen_flag";
    text.family(
        name,
        "gauge",
        "1 while the flag is set in the specimen's status.",
    );
    for (specimen, view) in specimens() {
        for (flag, word) in FLAGS {
            let set = f64::from(u8::from(Status(view.status).has(flag)));
            text.sample(name, &[("specimen", &specimen.name), ("flag", word)], set);
        }
    }
}

/// Status flags and their words.
pub(super) const FLAGS: [(Status, &str); 7] = [
    (Status::INTERLOCK, "interlock"),
    (Status::HOLDING, "holding"),
    (Status::SATURATED, "saturated"),
    (Status::UNSETTLED, "unsettled"),
    (Status::LOST, "lost"),
    (Status::UNSENT, "unsent"),
    (Status::STALE, "stale"),
];

fn lambda(text: &mut Text, board: &Board, now_ns: u64) {
    let Some(lambda) = board.subject.lambda else {
        return;
    };
    let gauge = "gauge";
    text.one(
        "gusset_lambda",
        gauge,
        "Parameter of the integration in use.",
        lambda.used,
    );
    if lambda.proven {
        let help =
            "Largest stable lambda at the declared bounds; +Inf if every one is, 0 if none is.";
        text.one(
            "gusset_lambda_limit_declared",
            gauge,
            help,
            lambda.declared_limit,
        );
    }
    if let Some(margin) = board.margin(now_ns) {
        let help =
            "Largest stable lambda with the tangents of the last while; +Inf if every one is.";
        text.one("gusset_lambda_limit", gauge, help, margin.limit);
        let help = "The smallest of these so far.";
        text.one("gusset_lambda_limit_lowest", gauge, help, margin.lowest);
    }
}
