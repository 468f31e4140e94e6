//! `[time] scale` makes wall time longer and nothing else: the same bits in every column that does not depend on wall time.

use crate::common::engine::{Run, run};

fn frame(scale: &str) -> Run {
    run(&format!(
        r#"
        [time]
        rate_hz = 1024
        duration_s = 4
        scale = {scale}
        [timing]
        warmup_ticks = 200
        [safety]
        ramp_s = 0
        [structure]
        static_load_n = [10e3, 0]
        [structure.shear_building]
        mass_kg = [20e3, 18e3]
        stiffness_n_per_m = [0, 14e6]
        [structure.damping.rayleigh_ratio]
        ratio = 0.02
        modes = [1, 2]
        [excitation.ground_acceleration.signal.sine]
        amplitude = 3
        frequency_hz = 1.5
        [[specimen]]
        name = "s"
        storey = 1
        law = {{ parallel = [ {{ bouc_wen = {{ stiffness_n_per_m = 15e6, yield_force_n = 60e3, post_yield_ratio = 0.08,
                 beta = 0.55, gamma = 0.45, exponent = 1.6 }} }}, {{ linear = {{ stiffness_n_per_m = 0, damping_n_s_per_m = 1e5 }} }} ] }}"#
    ))
}

#[test]
fn ten_times_slower_test_has_the_same_bits() {
    let real = frame("1");
    // 1000/1024 of real time, too: the scale is exact, not only a whole number.
    for (scale, factor) in [("10", 10.0), ("\"125/128\"", 125.0 / 128.0)] {
        let slow = frame(scale);
        assert_eq!(real.columns, slow.columns);
        assert_eq!(real.rows.len(), slow.rows.len());
        let timing = |name: &str| real.columns.iter().any(|c| c.name == name && c.timing);
        assert!(timing("release_s") && !timing("x1") && !timing("force_1_1"));
        for (a, b) in real.rows.iter().zip(&slow.rows) {
            for ((a, b), column) in a.iter().zip(b).zip(&real.columns) {
                assert!(
                    column.timing || a.to_bits() == b.to_bits(),
                    "{}: {a} {b}",
                    column.name
                );
            }
        }
        // 4096 periods between the first edge and the last, each rounded down to a nanosecond at most once.
        let wall = slow.outcome.pace.wall_ns as f64;
        assert!((wall - 4e9 * factor).abs() <= 1.0, "{wall}");
        assert!((slow.column("release_s")[4096] - 4.0 * factor).abs() < 2e-9);
    }
}
