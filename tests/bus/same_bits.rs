//! The bus changes no bit of a test where its process data are doubles.

use gusset_control::engine::Control;
use gusset_record::{Run, RunFolder};
use gusset_session::{self as session, Watches};

use super::{OUTPUT, load, text};

/// The named columns of the running test.
fn columns(text: &str) -> Vec<Vec<u64>> {
    let folder = tempfile::tempdir().unwrap();
    let loaded = load(folder.path(), text);
    let prepared = gusset_setup::build(&loaded).unwrap();
    let out = folder.path().join("run");
    let run = RunFolder::create(&out).unwrap();
    let control = Control::from(crossbeam_channel::never());
    let done = session::run(prepared, run, control, Watches::default(), &mut |_| {}).unwrap();
    assert_eq!(done.exit(None).code(), 0);
    let run = Run::open(&out).unwrap();
    let names = [
        "state",
        "x1",
        "x2",
        "cmd_1_1",
        "raw_disp_1_1",
        "raw_force_1_1",
    ];
    let values = run.columns(&names).unwrap();
    let running: Vec<usize> = (0..values[0].len())
        .filter(|row| values[0][*row] == 3.0)
        .collect();
    assert!(running.len() >= 500);
    let bits = |column: &Vec<f64>| running.iter().map(|row| column[*row].to_bits()).collect();
    values[1..].iter().map(bits).collect()
}

/// This test with its law in this process, behind an actuator with this delay.
pub(super) fn in_process(text: &str, delay_s: f64) -> String {
    let (before, rest) = text.split_once("[bus.rig]").unwrap();
    let (_, specimen) = rest.split_once("[[specimen]]").unwrap();
    let (specimen, _) = specimen.split_once("[specimen.bus]").unwrap();
    format!("{before}[[specimen]]{specimen}\n[specimen.transfer]\ndelay_s = {delay_s}\n")
}

#[test]
fn doubles_on_the_bus_keep_every_bit() {
    for (sample, delay_s) in [("same_tick", 0.0), ("next_tick", 0.002)] {
        let on_bus = text(
            OUTPUT,
            &format!("sample = \"{sample}\"\nstands_at_m = [0.0]"),
        );
        assert_eq!(
            columns(&on_bus),
            columns(&in_process(&on_bus, delay_s)),
            "{sample}"
        );
    }
}

#[test]
fn counts_stay_within_half_a_count() {
    const DISP: f64 = 2e-6;
    const FORCE: f64 = 4.0;
    let doubles = text(OUTPUT, "stands_at_m = [0.0]");
    let counts = doubles
        .replace("7000:01 f64 command", "7000:01 i16 command")
        .replace("6000:11 f64 force", "6000:11 i16 force")
        .replace(
            "\"servo.command\", m_per_count = 1.0",
            "\"servo.command\", m_per_count = 2e-6",
        )
        .replace("n_per_count = 1.0", "n_per_count = 4.0");
    let [_, _, commands, disps, forces]: [Vec<u64>; 5] = columns(&counts).try_into().unwrap();
    let mut worst = 0.0f64;
    for ((command, disp), force) in commands.iter().zip(&disps).zip(&forces) {
        let [command, disp, force] = [command, disp, force].map(|bits| f64::from_bits(*bits));
        worst = worst.max((command - disp).abs() / DISP);
        assert!((force / FORCE).fract() == 0.0);
    }
    assert!(worst <= 0.5 * (1.0 + 1e-9) && worst > 0.4, "{worst}");
}
