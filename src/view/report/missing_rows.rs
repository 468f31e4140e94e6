//! Tests of a page with missing rows, with ticks between two steps, and with the row that tripped.

use super::synthetic::{RATE, columns, hybrid};
use super::*;

/// A hybrid test from whose rows 2000 were lost in the middle.
fn holey() -> RunView {
    let mut run = hybrid(8.0, 6);
    for column in &mut run.data {
        column.drain(3000..5000);
    }
    run
}

#[test]
fn missing_steps_drop_dependent_parts() {
    let (whole, run) = (hybrid(8.0, 6), holey());
    let digest = run.digested();
    assert_eq!(digest.passed.missing_steps, 2000);
    assert_eq!(
        (digest.interval, digest.passed.step_s),
        (None, Some(1.0 / RATE))
    );
    assert!(
        digest.shaking.is_empty()
            && digest.spectra.is_empty()
            && digest.energy == table::Table::default()
    );
    let page = render(&run);
    let of_whole = render(&whole);
    for word in ["Arias intensity", "FEI delay", "Frequency content"] {
        assert!(of_whole.contains(word) && !page.contains(word), "{word}");
    }
    assert!(page.contains("STEPS ARE MISSING between the first and the last"));
    assert!(page.contains("Rows are missing in the record: lag"));
    assert!(of_whole.contains("no step is missing between"));
}

#[test]
fn missing_steps_give_null_metrics() {
    let run = holey();
    let none = ("bottom column".to_owned(), vec![None]);
    assert_eq!(tracking_metrics(&run).0, [none]);
    let why = missing_metrics(&run);
    assert!(
        why.len() == 1 && why[0].starts_with("bottom column: rows are missing"),
        "{why:?}"
    );
    let false_of_it = effect(&run).unwrap();
    assert_eq!(false_of_it.energy_error_j, None);
    assert!(false_of_it.missing.join(" ").contains("rows are missing"));
    let whole = hybrid(8.0, 6);
    assert!(missing_metrics(&whole).is_empty() && tracking_metrics(&whole).0[0].1[0].is_some());
}

/// The record of a served test: the controller commands the first place sixteen times, and then one step after the other, at
/// these times.
fn served(time_of: impl Fn(u32) -> f64) -> RunView {
    let names = [
        "step",
        "state",
        "time",
        "commits",
        "target_1_1",
        "meas_1_1",
        "force_1_1",
    ];
    let mut data = vec![Vec::new(); names.len()];
    for row in 0..216u32 {
        let step = row.saturating_sub(15);
        let at = |step: u32| 0.01 * libm::sin(0.15 * f64::from(step));
        let (target, meas) = (at(step), at(step.saturating_sub(1)));
        let row = [
            f64::from(row),
            3.0,
            time_of(step),
            f64::from(step),
            target,
            meas,
            1e6 * meas,
        ];
        data.iter_mut()
            .zip(row)
            .for_each(|(column, v)| column.push(v));
    }
    RunView {
        columns: columns(&names),
        data,
        summary: Some(serde_json::json!({
            "status": "completed", "steps": 201, "dt": 0.01, "realtime": {"role": "served to a controller"},
            "clock": "real", "deadline_misses": 0, "wall_seconds": 2.5,
        }).into()),
        ..RunView::default()
    }
}

#[test]
fn waiting_controller_leaves_no_row_out() {
    let run = served(|step| 0.01 * f64::from(step));
    let axis = run.digested().axes[0].clone();
    assert_eq!(axis.dt, Some(0.01));
    assert!((axis.lag().unwrap() - 0.01).abs() < 1e-4, "{axis:?}");
    assert!(missing_metrics(&run).is_empty());
    let page = render(&run);
    for part in [
        "216\u{a0}rows: 216\u{a0}commands of a controller; no command is missing between",
        "201\u{a0}commands accepted, 10\u{a0}ms of test time from one to the next, in 2.5 s of wall time.",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("Rows are missing") && !page.contains("left out"));
    // A server knows of no deadline.
    assert!(!page.contains("No deadline") && !page.contains("<span>deadline misses"));
}

#[test]
fn kept_back_commands_are_no_motion() {
    let whole = served(|step| 0.01 * f64::from(step));
    let mut tripped = served(|step| 0.01 * f64::from(step));
    // From here on its controller moved freely; old measurements were repeated.
    let kept_back = [8.0, f64::NAN, 0.0, 0.3, 0.0, 1e5];
    for row in 180..216 {
        let places = [1, 2, 3, 4, 5, 6];
        for (place, value) in places.into_iter().zip(kept_back) {
            if value.is_finite() {
                tripped.data[place][row] = value;
            }
        }
    }
    let axis = |run: &RunView| run.digested().axes[0].clone();
    let (lag, error) = (axis(&tripped).lag(), axis(&whole).lag().unwrap());
    assert!((lag.unwrap() - error).abs() < 1e-3, "{lag:?} {error}");
    let page = render(&tripped);
    let told = "180\u{a0}commands of a controller; 36\u{a0}rows not passed on to the specimen";
    assert!(page.contains(told));
    assert!(!page.contains("shutdown"));
}

#[test]
fn uneven_rows_are_not_missing() {
    // A controller that slows down and continues.
    let slow = |step: u32| 0.01 * f64::from(step) - 0.005 * f64::from(u8::from(step > 100));
    let run = served(slow);
    assert_eq!(run.digested().axes[0].dt, None);
    let page = render(&run);
    assert!(page.contains("No row is missing, but the rows are not at even times: lag"));
    assert!(!page.contains("Rows are missing"));
}

#[test]
fn lines_and_loops_break_at_missing_steps() {
    let run = holey();
    let digest = run.digested();
    let rows = &*digest;
    for name in ["x1", "ground", "meas_1_1"] {
        let (time, values) = (rows.time_of(name).unwrap(), rows.get(name).unwrap());
        let gaps: Vec<f64> = time
            .iter()
            .zip(values.iter())
            .filter(|(_, v)| v.is_nan())
            .map(|(t, _)| *t)
            .collect();
        assert_eq!(gaps, [(2999.0 + 5000.0) / 2.0 / RATE], "{name}");
    }
    let axis = &digest.axes[0];
    assert_eq!(axis.hysteresis.0.iter().filter(|x| x.is_nan()).count(), 1);
    assert_eq!(axis.absorbed, None);
}

/// Ten steps of 0.1 s in four ticks each; at tick 21 the specimen is where no end of a step is; then it trips.
fn in_ticks() -> RunView {
    let names = [
        "step",
        "sub_tick",
        "state",
        "time",
        "x1",
        "target_1_1",
        "meas_1_1",
        "force_1_1",
    ];
    let mut data = vec![Vec::new(); names.len()];
    for tick in 0..=40u32 {
        let (step, sub) = (tick / 4, tick % 4);
        let state = match (tick, sub) {
            (40, _) => 8.0,
            (_, 0) => 3.0,
            _ => 11.0,
        };
        let at = 0.01 * libm::sin(0.15 * f64::from(tick));
        let meas = if tick == 21 { 0.05 } else { at };
        let force = if tick == 40 { -9e4 } else { 1e6 * at };
        let row = [
            f64::from(step),
            f64::from(sub),
            state,
            f64::from(tick) * 0.025,
            at,
            at,
            meas,
            force,
        ];
        data.iter_mut()
            .zip(row)
            .for_each(|(column, v)| column.push(v));
    }
    RunView {
        columns: columns(&names),
        data,
        summary: Some(serde_json::json!({"dt": 0.1}).into()),
        test: "[time]\nstep_s = 0.1\nduration_s = 1.0\nticks_per_step = 4\n".into(),
        ..RunView::default()
    }
}

#[test]
fn every_tick_judges_a_specimen() {
    let run = in_ticks();
    let digest = run.digested();
    let axis = &digest.axes[0];
    assert_eq!(axis.peak_disp.unwrap(), 0.05);
    assert_eq!(axis.peak_force.unwrap(), -9e4);
    assert_eq!(axis.dt, Some(0.025));
    assert_eq!(axis.tracking.unwrap().samples, 41);
    assert!(axis.hysteresis.0.contains(&0.05), "between two steps");
    assert_eq!(axis.hysteresis.1.last(), Some(&-9e4));
    let rows = &*digest;
    // The trip is at the end of a step: the structure came there, and made no step of it.
    assert_eq!(rows.get("x1").unwrap().len(), 11);
    assert_eq!(rows.marks("x1").last, Some(0.01 * libm::sin(6.0)));
    assert_eq!(rows.get("force_1_1").unwrap().len(), 41);
    let page = render(&run);
    assert!(
        page.contains(
            "41\u{a0}rows: 10\u{a0}steps of the running test and 31\u{a0}ticks between two of them"
        ),
        "{}",
        &page[page.find("Recorded").unwrap()..][..300]
    );
}

#[test]
fn trip_without_a_tick_keeps_all_ticks() {
    // At the time of the last tick, or, as in older recordings, at the end of the last step.
    for back in [0.0, 0.075] {
        let mut run = in_ticks();
        let time = run.data[3][39];
        for column in &mut run.data {
            column[40] = column[39];
        }
        run.data[2][40] = 8.0;
        run.data[3][40] = time - back;
        let axis = &run.digested().axes[0];
        assert_eq!(axis.dt, Some(0.025), "{back} s back");
        assert_eq!(axis.tracking.unwrap().samples, 40, "{back} s back");
    }
}

#[test]
fn hold_is_in_the_loops_not_in_the_grid() {
    let mut run = in_ticks();
    let whole = run.digested().axes[0].tracking;
    for _ in 0..5 {
        for column in &mut run.data {
            let held = column[17];
            column.insert(18, held);
        }
        run.data[2][18] = 6.0;
    }
    run.data[7][20] = -2e5;
    let digest = run.digested();
    let axis = &digest.axes[0];
    assert_eq!(axis.tracking, whole);
    assert_eq!(axis.peak_force.unwrap(), -2e5);
    assert_eq!(digest.passed.missing_ticks, 0);
}

#[test]
fn many_storeys_report_what_is_omitted() {
    let mut names = vec!["state".to_owned(), "step".to_owned(), "time".to_owned()];
    for letter in ["x", "v", "a"] {
        names.extend((1..=30).map(|dof| format!("{letter}{dof}")));
    }
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let data = names.iter().enumerate().map(|(at, name)| {
        let of = |k: u32| match at {
            0 => 3.0,
            1 => f64::from(k),
            2 => 0.1 * f64::from(k),
            // The drift of storey 29 is by far the largest.
            _ if matches!(*name, "x29" | "x30") => 0.9,
            _ => 0.001 * f64::from(k),
        };
        (0..50).map(of).collect()
    });
    let run = RunView {
        data: data.collect(),
        columns: columns(&names),
        test: format!(
            "[structure.shear_building]\nmass_kg = {0:?}\nstiffness_n_per_m = {0:?}\n",
            [1.0; 30]
        )
        .into(),
        ..RunView::default()
    };
    let page = render(&run);
    assert!(
        page.contains("24 of 30 storeys are listed") && page.contains("largest drift, storey 29")
    );
    let digest = run.digested();
    let rows = &*digest;
    for dof in columns::spread(&digest.dofs, columns::MOST_LINES) {
        for letter in ["x", "v", "a"] {
            assert!(
                rows.get(&format!("{letter}{dof}")).is_some(),
                "{letter}{dof}"
            );
        }
    }
}

#[test]
fn residual_is_a_mean_of_the_last_rows() {
    let names = ["state", "step", "time", "x1"];
    let rows = 200_000u32;
    // A spike in every ten rows: extremes are ten times too large.
    let of = |name: &str, k: u32| match name {
        "state" => 3.0,
        "step" => f64::from(k),
        "time" => 0.01 * f64::from(k),
        _ => f64::from(u8::from(k.is_multiple_of(10))),
    };
    let data = names.map(|name| (0..rows).map(|k| of(name, k)).collect());
    let run = RunView {
        columns: columns(&names),
        data: data.into(),
        ..RunView::default()
    };
    let digest = run.digested();
    assert!(digest.every > 1);
    assert!(
        (digest.residuals[0].1 - 0.1).abs() < 1e-12,
        "{:?}",
        digest.residuals
    );
}

/// A mass of 2 kg, free.
struct Mass;

impl metrics::energy::Model for Mass {
    fn dofs(&self) -> usize {
        1
    }
    fn load(&self, _: u64, out: &mut [f64]) {
        out.fill(0.0);
    }
    fn damping(&self, _: &[f64], out: &mut [f64]) {
        out.fill(0.0);
    }
    fn restoring(&mut self, _: &[f64], _: &[f64], _: f64, out: &mut [f64]) {
        out.fill(0.0);
    }
    fn kinetic(&self, vel: &[f64]) -> f64 {
        vel[0] * vel[0]
    }
    fn strain(&self, _: &[f64]) -> f64 {
        0.0
    }
}

#[test]
fn long_tests_count_single_rows() {
    let names = [
        "state",
        "step",
        "time",
        "x1",
        "target_1_1",
        "meas_1_1",
        "force_1_1",
        "margin_1_1",
    ];
    let (rows, dt) = (200_000u32, 1.0 / 1024.0);
    let disp = |k: u32| 0.01 * libm::sin(0.7 * f64::from(k));
    let (lowest, highest) = (55_555, 77_777);
    let of = |name: &str, k: u32| match name {
        "state" => 3.0,
        "step" => f64::from(k),
        "time" => dt * f64::from(k),
        "x1" if k == highest => 0.5,
        "force_1_1" => 0.0,
        "margin_1_1" if k == lowest => 0.001,
        "margin_1_1" => 0.02,
        _ => disp(k),
    };
    let columns = columns(&names);
    let data = names.map(|name| (0..rows).map(|k| of(name, k)).collect::<Vec<_>>());
    let memory = source::Memory {
        without_disp: Vec::new(),
        columns: &columns,
        data: &data,
        step_s: Some(dt),
        ticks_per_step: 1,
    };
    let digest = Digest::of(&memory, &crate::TestFile::default(), Some(&mut Mass)).unwrap();
    assert!(digest.every > 1);
    let run = RunView {
        columns: columns.clone(),
        digest: Some(digest),
        ..RunView::default()
    };
    let margin = &effect(&run).unwrap().delay_margins[0];
    assert_eq!(margin.at_s, Some(dt * f64::from(lowest)));
    assert_eq!(margin.smallest_s, Some(0.001));
    let page = render(&run);
    let vel = (disp(rows - 1) - disp(rows - 3)) / (2.0 * dt);
    let end = text::quantity(vel * vel, "J");
    assert!(
        page.contains(&format!("kinetic: ½ vᵀM v</td><td>{end}</td>")),
        "{end}"
    );
    assert!(page.contains("<td>DOF 1</td><td>500\u{a0}mm</td><td>75.9541\u{a0}s</td>"));
}

#[test]
fn simulated_run_has_no_timing_picture() {
    let mut run = hybrid(2.0, 0);
    assert!(hero_svg(&run).contains("Wake-up lateness"));
    run.summary = Some(serde_json::json!({"clock": "simulated"}).into());
    assert!(!hero_svg(&run).contains("Wake-up lateness"));
}
