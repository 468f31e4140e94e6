//! Tests of the status: its content, at every width.

use super::*;
use gusset_control::engine::{Glimpse, Phase, PhaseCell};
use gusset_record::{Event, LimitReached, Onlooker, Progress, TimedEvent};
use gusset_view::live::{About, LambdaUse, Subject, Tap};

/// A frame of two storeys with limits on its specimen, watched for `rows` rows.
fn board(rows: u64) -> Arc<Board> {
    board_seen(rows, Glimpse::of(Phase::Running))
}

fn board_seen(rows: u64, seen: Glimpse) -> Arc<Board> {
    board_of(rows, seen, &[])
}

fn board_of(rows: u64, seen: Glimpse, events: &[Event]) -> Arc<Board> {
    let text = include_str!("../../config/frame-bouc-wen.toml").replace(
        "name = \"ground-storey\"",
        "name = \"ground-storey\"\nlimits = { command_disp_m = { warn = [-0.05, 0.05], trip = [-0.1, 0.1] }, \
         measured_force_n = { trip = [-1e5, 2e5] }, command_vel_m_per_s = { trip = 2 } }",
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.toml");
    std::fs::write(&path, text).unwrap();
    let loaded = gusset_config::load(&path, &[]).unwrap();
    let prepared = gusset_setup::build(&loaded).unwrap();
    let about = About {
        title: "Frame".into(),
        run: "runs/frame".into(),
        real_clock: true,
        lambda: Some(LambdaUse {
            used: 11.5,
            declared_limit: f64::INFINITY,
            proven: true,
        }),
        ..About::default()
    };
    let subject = Subject::new(&prepared.experiment, about);
    let online = prepared.facts.structure.unwrap().online_limit;
    let phase = PhaseCell::default();
    phase.show(seen);
    let board = Arc::new(Board::new(subject, phase, online));
    let (_notes, written) = crossbeam_channel::bounded(1);
    let mut tap = Tap::new(Arc::clone(&board), written);
    let columns = prepared.experiment.columns();
    let now = monotonic_ns();
    for k in 0..rows {
        let row: Vec<f64> = columns
            .iter()
            .map(|column| match column.name.as_str() {
                "step" => k as f64,
                "state" => 3.0,
                "time" => k as f64 / 1024.0,
                "cmd_1_1" => 0.03,
                "raw_disp_1_1" => 0.029,
                "raw_force_1_1" => -9e4,
                "kt_1_1" => 15e6,
                "wakeup_lateness_s" => 2e-6,
                _ => 0.0,
            })
            .collect();
        tap.row(k, &row);
    }
    for kind in events {
        tap.event(&TimedEvent {
            tick: rows,
            time: 0.0,
            clock_ns: 0,
            kind: kind.clone(),
        });
    }
    tap.turn(now, &Progress::default());
    tap.finish(now, &Progress::default());
    board
}

#[test]
fn hold_and_confirmation_are_named() {
    for (phase, stands, unconfirmed, wanted) in [
        (Phase::Ramping, false, false, "RAMPING  "),
        (Phase::Ramping, true, false, "RAMPING, HELD  "),
        (Phase::Holding, true, false, "HOLDING  "),
        (Phase::Zeroing, false, true, "ZEROING, TO BE CONFIRMED  "),
        (
            Phase::Zeroing,
            true,
            true,
            "ZEROING, TO BE CONFIRMED, HELD  ",
        ),
    ] {
        let board = board_seen(
            8,
            Glimpse {
                phase,
                hold: true,
                stands,
                unconfirmed,
                hold_number: 1,
            },
        );
        let line = Sight::of(&board, 1024.0).line(200);
        assert!(line.starts_with(wanted), "{line}");
    }
}

#[test]
fn line_shows_remaining_time_if_it_fits() {
    let board = board(512);
    let mut sight = Sight::of(&board, 1024.0);
    sight.remaining = Some("about 19 s left".to_owned());
    assert!(sight.line(200).contains("  about 19 s left"));
    assert!(sight.line(60).chars().count() <= 60);
    assert!(sight.block(100, 30)[0].contains("20.000 s, about 19 s left"));
}

#[test]
fn line_starts_with_the_most_important() {
    let board = board(512);
    let sight = Sight::of(&board, 1024.0);
    let wide = sight.line(200);
    assert!(wide.starts_with("RUNNING  0.50 of 20.00 s"), "{wide}");
    // 90 kN of 100 kN on that side is closer than 30 mm of 100 mm.
    assert!(
        wide.contains("90 % of trip: ground-storey measured_force_n"),
        "{wide}"
    );
    assert!(wide.contains("late p99 2.0"), "{wide}");
    assert!(wide.contains("lambda 11.5, limit none"), "{wide}");
    for columns in 1..200 {
        let line = sight.line(columns);
        assert!(line.chars().count() <= columns, "{columns}: {line}");
    }
    // A usual terminal has room for the required parts, but not for a bar.
    let usual = "RUNNING  0.50 of 20.00 s  misses 0  90 % of trip: ground-storey measured_force_n";
    assert_eq!(sight.line(80), usual);
    let more = sight.line(100);
    assert!(
        more.starts_with(usual) && more[usual.len()..].starts_with("  late p99 2.0"),
        "{more}"
    );
}

#[test]
fn tripped_test_shows_its_cause_to_the_end() {
    let board = board_of(
        8,
        Glimpse::of(Phase::Leaving),
        &[Event::LimitTrip(LimitReached {
            port: Some(0),
            axis: Some(0),
            limit: "command_disp_m".into(),
            value: 0.12,
            bound: 0.1,
        })],
    );
    let sight = Sight::of(&board, 1024.0);
    let line = sight.line(200);
    let why = "ground-storey, axis 1: commanded displacement 120 mm";
    assert!(line.starts_with("LEAVING, TRIPPED  "), "{line}");
    assert!(line.contains(why), "{line}");
    let block = sight.block(100, 40).join("\n");
    assert!(block.contains(&format!("TRIPPED  {why}")), "{block}");
    // A refused command is in no row, but exceeded its limit.
    assert!(block.contains("120 % of trip, worst 120 %"), "{block}");
}

#[test]
fn block_fits_every_terminal() {
    let board = board(512);
    let sight = Sight::of(&board, 1024.0);
    let text = sight.block(100, 40).join("\n");
    for wanted in [
        "RUNNING  test time 0.499 of 20.000 s  step 511",
        "ground-storey  command 30.00 mm  measured 29.00 mm  force -90.00 kN",
        "90 % of trip, worst 90 %",
        "deadline misses 0 (own 0, preempted 0, hypervisor 0, stopped 0, late reply 0, not known 0)",
        "wakeup_lateness",
        "lambda 11.5",
        "gusset hold runs/frame",
    ] {
        assert!(text.contains(wanted), "{wanted:?} in\n{text}");
    }
    for (columns, rows) in [(20, 3), (40, 8), (80, 24), (200, 60), (1, 1)] {
        let lines = sight.block(columns, rows);
        assert!(lines.len() <= rows.max(1), "{columns} × {rows}: {lines:?}");
        assert!(lines.iter().all(|line| line.chars().count() <= columns));
    }
}

#[test]
fn gauge_marks_are_in_order() {
    let board = board(1);
    let mark = |key: &str| {
        let axes = &board.subject.specimens[0].axes[0];
        axes.marks.iter().find(|mark| mark.key == key).unwrap()
    };
    let disp = mark("command_disp_m");
    // ±110 mm over 22 cells: 10 mm a cell, −110 … at the left.
    assert_eq!(
        gauge(disp, 0.0, [-0.02, 0.03], 22),
        format!("[ │    ┊  ··●··· ┊    │]")
    );
    assert!(
        gauge(disp, f64::NAN, [f64::NAN; 2], 22)
            .chars()
            .all(|c| c != '●')
    );
    assert!((used(disp, -0.08) - 0.8).abs() < 1e-12);
    let force = mark("measured_force_n");
    assert!(
        (used(force, -9e4) - 0.9).abs() < 1e-12,
        "each side has its own level"
    );
    assert!((used(force, 9e4) - 0.45).abs() < 1e-12);
}

#[test]
fn lost_updates_are_reported_first() {
    let board = board(10);
    let mut sight = Sight::of(&board, 1024.0);
    sight.age_s = 7.0;
    assert!(sight.line(60).starts_with("NO ROWS SINCE 7 s (running)"));
}
