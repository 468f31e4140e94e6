//! Errors that late specimens introduce into a test: damping, energy, and the stability margin.

use crate::common::engine::prepare;
use crate::common::test_file::TestFile;
use crate::common::{FRAME, completed, json, write};
use gusset_control::engine::{Ending, Phase, Stop};
use gusset_quantity::catalog::limit::Limit;
use gusset_record::{Event, Run};
use nalgebra::{Complex, ComplexField as _, DMatrix};

/// Three floors by matrices, with two specimens of one and of two axes: one carries mass in its force, the axes of the other
/// stiffen each other.
const FLOORS: &str = r#"[time]
rate_hz = 1024
duration_s = 1
clock = "simulated"

[structure.matrices]
mass = [[1000, 0, 0], [0, 900, 0], [0, 0, 800]]
stiffness = [[6e5, -3e5, 0], [-3e5, 5e5, -2e5], [0, -2e5, 2e5]]
damping = [[900, -360, 0], [-360, 780, -240], [0, -240, 400]]

[integrator]
lambda = 4

[excitation.ground_acceleration.signal.sine]
amplitude = 3.0
frequency_hz = 2.0

[[specimen]]
name = "first"
rows = [[1, 0, 0]]
mass_in_force_kg = 40
law.linear = { stiffness_n_per_m = 2e5, damping_n_s_per_m = 0 }

[[specimen]]
name = "second"
rows = [[-1, 1, 0], [0, -1, 1]]
stiffness_n_per_m = [[1.5e5, 2e4], [2e4, 1e5]]
laws = [{ linear = { stiffness_n_per_m = 1.5e5 } }, { linear = { stiffness_n_per_m = 1e5 } }]
"#;

type Matrix = DMatrix<Complex<f64>>;

/// The root near `start` of det(s² M + s C + K + Σ Bᵀ (k + m s²) e^(−s τ) B), by Newton on the determinant's logarithm.
fn complex_mode(start: Complex<f64>, delays: [f64; 3]) -> Complex<f64> {
    complex_mode_at(start, delays, (0, 2e5), 2e4)
}

/// [`complex_mode`] with another stiffness of one axis, and between those of the second specimen.
fn complex_mode_at(
    start: Complex<f64>,
    delays: [f64; 3],
    axis: (usize, f64),
    between: f64,
) -> Complex<f64> {
    let real = |values: [f64; 9]| DMatrix::from_row_slice(3, 3, &values);
    let mass = real([1000., 0., 0., 0., 900., 0., 0., 0., 800.]);
    let stiffness = real([6e5, -3e5, 0., -3e5, 5e5, -2e5, 0., -2e5, 2e5]);
    let damping = real([900., -360., 0., -360., 780., -240., 0., -240., 400.]);
    let rows = real([1., 0., 0., -1., 1., 0., 0., -1., 1.]);
    let mut specimens = real([2e5, 0., 0., 0., 1.5e5, between, 0., between, 1e5]);
    specimens[(axis.0, axis.0)] = axis.1;
    let inertia = real([40., 0., 0., 0., 0., 0., 0., 0., 0.]);
    let complex = |m: &DMatrix<f64>| m.map(|v| Complex::new(v, 0.0));
    let mut s = start;
    for _ in 0..100 {
        // Each axis passes its command on after a delay, and its forces follow from that.
        let late = Matrix::from_diagonal(&nalgebra::DVector::from_iterator(
            3,
            delays
                .iter()
                .map(|delay| nalgebra::ComplexField::exp(-s * *delay)),
        ));
        let change = Matrix::from_diagonal(&nalgebra::DVector::from_iterator(
            3,
            delays
                .iter()
                .map(|delay| nalgebra::ComplexField::exp(-s * *delay) * -*delay),
        ));
        let force = complex(&specimens) + complex(&inertia) * (s * s);
        let (b, bt) = (complex(&rows), complex(&rows.transpose()));
        let whole = complex(&mass) * (s * s)
            + complex(&damping) * s
            + complex(&stiffness)
            + &bt * &force * &late * &b;
        let slope = complex(&mass) * (s * 2.0)
            + complex(&damping)
            + &bt * (complex(&inertia) * (s * 2.0)) * &late * &b
            + &bt * &force * &change * &b;
        // At a root to the last bit there is no inverse.
        let Some(change) = whole.lu().solve(&slope) else {
            return s;
        };
        let step = Complex::new(1.0, 0.0) / change.trace();
        s -= step;
        if step.modulus() < 1e-13 * s.modulus() {
            return s;
        }
    }
    panic!("no root near {start}");
}

#[test]
fn damping_error_is_first_order_of_modes() {
    let analysis = prepare(FLOORS).facts.structure.unwrap().analysis.unwrap();
    let modes = analysis.delayed_modes();
    assert_eq!(modes.len(), 3);
    let ratio = |s: Complex<f64>| -s.re / s.modulus();
    for mode in &modes {
        let start = Complex::new(-mode.ratio * mode.frequency, mode.frequency);
        let on_time = complex_mode(start, [0.0; 3]);
        // C is nearly classical: its ratio is that of the complex mode to the second order.
        assert!((ratio(on_time) / mode.ratio - 1.0).abs() < 2e-3, "{mode:?}");
        assert!((on_time.modulus() / mode.frequency - 1.0).abs() < 1e-3);
        let slopes = mode.per_second.concat();
        for delays in [
            [1e-4, 0.0, 0.0],
            [0.0, 1e-4, 0.0],
            [0.0, 0.0, 1e-4],
            [1e-4, 5e-5, 2e-4],
        ] {
            let first = slopes.iter().zip(delays).map(|(s, d)| s * d).sum::<f64>();
            let off = |scale: f64| {
                let exact = ratio(complex_mode(on_time, delays.map(|d| scale * d)));
                exact - ratio(on_time) - scale * first
            };
            // The residual is of second order in the delay, except for the share ζ of the slope by which the damping of the mode
            // itself changes.
            let size = slopes
                .iter()
                .zip(delays)
                .map(|(s, d)| (s * d).abs())
                .sum::<f64>();
            assert!(off(1.0).abs() < 0.05 * size, "{} of {first}", off(1.0));
            assert!(off(0.5).abs() < 0.6 * off(1.0).abs() + 1e-3 * size);
        }
    }
    // A specimen that is late takes damping from every mode that moves it, unless its inertia outweighs its spring.
    assert!(
        modes[0]
            .per_second
            .concat()
            .iter()
            .all(|slope| *slope < 0.0)
    );
}

/// Rows of a run while the test ran.
fn rows<const N: usize>(run: &Run, names: [&str; N]) -> [Vec<f64>; N] {
    let mut wanted = vec!["state"];
    wanted.extend(names);
    let found = run.columns(&wanted).unwrap();
    let running = |column: &Vec<f64>| {
        let both = column.iter().zip(&found[0]);
        both.filter(|(_, state)| **state == 3.0)
            .map(|(v, _)| *v)
            .collect()
    };
    std::array::from_fn(|index| running(&found[index + 1]))
}

/// Sum of ½ (f + f') (x − x') and the largest it came to.
fn work(force: &[f64], way: &[f64]) -> (f64, f64) {
    let steps = force.windows(2).zip(way.windows(2));
    steps.fold((0.0, 0.0f64), |(sum, most), (f, x)| {
        let sum = sum + 0.5 * (f[0] + f[1]) * (x[1] - x[0]);
        (sum, most.max(sum))
    })
}

#[test]
fn late_specimen_shows_energy_and_damping() {
    let folder = tempfile::tempdir().unwrap();
    let delay = 0.012;
    let text = format!(
        "{}\n[specimen.transfer]\ndelay_s = {delay}\nseed = 5\ndisp_sensor = {{ noise_rms_m = 1e-5 }}\nforce_sensor = {{ noise_rms_n = 5.0 }}\n[safety]\nzero_s = 5.0\n",
        // It stays elastic.
        FRAME.with(
            "time = { duration_s = 6.0, rate_hz = 500 }\nspecimen.law.bouc_wen.yield_force_n = 1e9"
        )
    );
    let out = folder.path().join("late");
    completed(&write(folder.path(), "late.toml", &text), &out, &[]);
    let summary = json(&out, "summary.json");
    let number = |path: &str| {
        let found = summary.pointer(path).and_then(serde_json::Value::as_f64);
        found.unwrap_or_else(|| panic!("{path}: {:#}", summary["falsified"]))
    };

    // From the rows again: work of the load −m a_g, strain energy of K0 = 5e5 and 4e5 N/m, and the work of the specimen's deviation
    // from its target.
    let run = Run::open(&out).unwrap();
    let [ground, x1, x2, target, meas, force] = rows(
        &run,
        ["ground", "x1", "x2", "target_1_1", "meas_1_1", "force_1_1"],
    );
    let of_floor = |mass: f64, x: &[f64]| {
        let load: Vec<f64> = ground.iter().map(|a| -mass * a).collect();
        let steps = load.windows(2).zip(x.windows(2));
        steps
            .map(|(f, x)| 0.5 * (f[0] + f[1]) * (x[1] - x[0]))
            .collect::<Vec<_>>()
    };
    let (one, two) = (of_floor(1000.0, &x1), of_floor(900.0, &x2));
    let mut so_far = 0.0;
    let inputs = one.iter().zip(&two).map(|(a, b)| {
        so_far += a + b;
        so_far
    });
    let input = inputs.fold(0.0, f64::max);
    let strains = x1.iter().zip(&x2);
    let strain = strains.map(|(a, b)| 0.5 * (5e5 * a * a + 4e5 * (b - a) * (b - a)));
    let strain = strain.fold(0.0, f64::max);
    let error: Vec<f64> = meas.iter().zip(&target).map(|(m, c)| m - c).collect();
    let (added, _) = work(&force, &error);
    let scale = "/falsified/energy_scale";
    // The sums differ by half a step at the ends.
    assert!((number(&format!("{scale}/input_energy_j")) / input - 1.0).abs() < 0.01);
    assert!((number(&format!("{scale}/strain_energy_j")) / strain - 1.0).abs() < 1e-9);
    let share = "/falsified/energy_error_share";
    let expected = added / (input + strain);
    assert!(
        added > 0.0 && expected > 0.05,
        "a lag adds energy: {expected}"
    );
    let value = number(&format!("{share}/value"));
    assert!((value / expected - 1.0).abs() < 0.01, "{value} {expected}");
    assert_eq!(number("/metrics/storey/0/energy_error_share/value"), value);
    let floor = number(&format!("{share}/floor"));
    let of_error = number("/falsified/energy_error_j/floor");
    assert!(floor > 0.0 && (floor * (input + strain) / of_error - 1.0).abs() < 0.01);
    assert_eq!(number(&format!("{share}/corrected")), value);

    // Modes of [[9e5, −4e5], [−4e5, 4e5]] over (1000, 900), by the quadratic: φ1² at the first floor.
    let (a, b, c) = (900e3, -(9e5 * 900.0 + 4e5 * 1000.0), 9e5 * 4e5 - 16e10);
    let root: f64 = f64::sqrt(b * b - 4.0 * a * c);
    let [tau, noise] =
        ["value", "floor"].map(|key| number(&format!("/metrics/storey/0/fei/delay_s/{key}")));
    assert!((tau / delay - 1.0).abs() < 0.1, "{tau}");
    for (index, square) in [(-b - root) / (2.0 * a), (-b + root) / (2.0 * a)]
        .into_iter()
        .enumerate()
    {
        let omega = square.sqrt();
        let ratio = (9e5 - 1000.0 * square) / 4e5;
        let phi = 1.0 / (1000.0 + 900.0 * ratio * ratio);
        let slope = -5e5 * phi / (2.0 * omega);
        let at = format!("/falsified/modes/{index}");
        let hertz = omega / std::f64::consts::TAU;
        assert!((number(&format!("{at}/frequency_hz")) / hertz - 1.0).abs() < 1e-9);
        assert!((number(&format!("{at}/damping_ratio")) / 0.02 - 1.0).abs() < 1e-9);
        let error = number(&format!("{at}/damping_error/value"));
        assert!((error / (slope * tau) - 1.0).abs() < 1e-9, "{error}");
        let floor = number(&format!("{at}/damping_error/floor"));
        assert!(noise > 0.0 && (floor / (-slope * noise) - 1.0).abs() < 1e-9);
    }

    let [margin, time] = rows(&run, ["margin_1_1", "time"]);
    let known = margin
        .iter()
        .zip(&time)
        .filter(|(margin, _)| margin.is_finite());
    let (smallest, at) = known.min_by(|a, b| a.0.total_cmp(b.0)).unwrap();
    assert_eq!(number("/falsified/delay_margins/0/smallest_s"), *smallest);
    assert_eq!(number("/falsified/delay_margins/0/at_s"), *at);
    assert!(number("/falsified/delay_margins/0/floor_s") > noise);
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    for words in [
        "delay margin",
        "Margin: critical delay",
        "tracking errors",
        "the delays",
        "energy error",
    ] {
        assert!(page.contains(words), "{words}");
    }
}

#[test]
fn no_structure_no_damping_error() {
    let folder = tempfile::tempdir().unwrap();
    let text = "title = \"P\"\n[time]\nrate_hz = 200\nduration_s = 0.5\nclock = \"simulated\"\n\
        [[excitation.prescribed_displacement]]\nspecimen = \"it\"\nease_in_s = 0.1\n\
        signal.cyclic = { amplitudes = [0.002], cycles_per_amplitude = 1, shape = \"sine\", frequency_hz = 2.0 }\n\
        [[specimen]]\nname = \"it\"\nlaw.linear = { stiffness_n_per_m = 1e5 }\n[specimen.transfer]\ndelay_s = 0.01\n";
    let out = folder.path().join("run");
    completed(&write(folder.path(), "p.toml", text), &out, &[]);
    let summary = json(&out, "summary.json");
    assert!(summary["falsified"].is_null());
    let axis = &summary["metrics"]["it"][0];
    assert!(
        axis["energy_error_share"].is_null()
            && axis["energy_error_j"]["value"].as_f64() > Some(0.0)
    );
}

/// One floor of 1000 kg on 1e5 N/m and a specimen of 2e5 N/m, with 3 % of damping.
fn one_floor(more: &str) -> String {
    format!(
        "[time]\nrate_hz = 1000\nduration_s = 8\nclock = \"simulated\"\n[structure.matrices]\nmass = [[1000]]\n\
         stiffness = [[1e5]]\ndamping = [[1039.2]]\n[integrator]\nlambda = 4\n\
         [excitation.ground_acceleration.signal.sine]\nfrequency_hz = 2.2\namplitude = 0.5\n\
         [[specimen]]\nname = \"it\"\nrows = [[1]]\nlaw.linear = {{ stiffness_n_per_m = 2e5 }}\n{more}"
    )
}

fn delayed(share: f64, safety: &str) -> crate::common::engine::Run {
    let delay = share * critical();
    crate::common::engine::run(&one_floor(&format!(
        "[specimen.transfer]\ndelay_s = {delay}\n[safety]\n{safety}\n"
    )))
}

/// Commands after the end of the test follow none of its targets.
#[test]
fn lag_and_gain_stay_during_shutdown() {
    let run = delayed(
        0.1,
        "at_end = \"zero_displacement\"\nexit_speed_m_per_s = 0.01",
    );
    let states = run.all("state");
    let end = states.iter().position(|s| *s == Phase::Leaving.code());
    let end = end.unwrap();
    for name in ["lag_1_1", "gain_1_1"] {
        let values = run.all(name);
        let last = values[end - 1];
        assert!(last.is_finite() && values.len() > end + 20);
        assert!(values[end..].iter().all(|value| *value == last), "{name}");
    }
}

/// Lag and gain of one specimen: too little is as wrong as too much.
#[test]
fn lag_and_gain_beyond_limits_end_the_test() {
    let limits = "[specimen.limits]\nlag_s = { trip = 0.004 }\ngain_error = { trip = 0.08 }\n";
    for (transfer, quantity, value) in [
        ("delay_s = 0.005", Limit::Lag, 0.005),
        (
            "actuator.proportional = { gain = 0.9 }",
            Limit::GainError,
            0.1,
        ),
        (
            "actuator.proportional = { gain = 1.1 }",
            Limit::GainError,
            0.1,
        ),
        ("delay_s = 0.003", Limit::StuckSensor, 0.0),
    ] {
        let text = one_floor(&format!("[specimen.transfer]\n{transfer}\n{limits}"));
        let ending = crate::common::engine::run(&text).outcome.ending;
        let Ending::Stopped(Stop::Limit { hit, .. }) = ending else {
            assert_eq!((ending, value), (Ending::Completed, 0.0), "{transfer}");
            continue;
        };
        assert_eq!(hit.quantity, quantity, "{transfer}");
        assert!(
            (hit.value / value - 1.0).abs() < 0.1,
            "{transfer}: {}",
            hit.value
        );
    }
}

/// The critical delay of the floor: ω² = 300, ξ = 0.03, two thirds of the stiffness in the specimen.
fn critical() -> f64 {
    0.005203173855437584
}

#[test]
fn delay_margin_is_negative_before_growth() {
    let largest = |values: &[f64]| values.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let on_time = largest(&delayed(0.02, "").column("x1"));
    // The first two periods of 2.2 Hz do not count: a new fit overshoots.
    let early = delayed(0.9, "").column("margin_1_1");
    assert!(early[..600].iter().all(|margin| margin.is_nan()) && early[1200].is_finite());
    for (share, warned) in [(0.5, false), (0.9, false), (1.4, true)] {
        let run = delayed(share, "");
        assert_eq!(run.outcome.ending, Ending::Completed);
        let margin = run.column("margin_1_1");
        let used = run.column("delay_used");
        let at_end = *margin.last().unwrap();
        let expected = (1.0 - share) * critical();
        // The lag is known to some per cent: the window ripples with the motion, and holds transients.
        assert!(
            (at_end - expected).abs() < 0.04 * critical(),
            "{share}: {at_end} {expected}"
        );
        assert!((used.last().unwrap() - share).abs() < 0.04);
        for ((margin, used), lag) in margin.iter().zip(&used).zip(run.column("lag_1_1")) {
            let both = margin + lag;
            assert!(
                both.is_nan() || (both / critical() - 1.0).abs() < 1e-3,
                "{both}"
            );
            assert!(both.is_nan() || (used - lag.max(0.0) / both).abs() < 1e-12);
        }
        let told = run.events.iter().filter(|event| {
            matches!(
                &event.kind,
                Event::LimitWarning(reached) if reached.limit == "delay_used"
            )
        });
        // Each time that the level is crossed.
        assert_eq!(told.count() > 0, warned, "{share}");
        if share > 1.0 {
            let first = margin.iter().position(|margin| *margin < 0.0).unwrap();
            let grown = run
                .column("x1")
                .iter()
                .position(|x| x.abs() > 1.5 * on_time);
            let grown = grown.expect("beyond its critical delay a test grows");
            assert!(
                first + 1000 < grown,
                "known at row {first}, seen at row {grown}"
            );
        } else {
            assert!(margin.iter().all(|margin| margin.is_nan() || *margin > 0.0));
        }
    }
}

#[test]
fn delay_share_warns_and_trips_at_levels() {
    let run = delayed(0.8, "delay_used = { warn = 0.3, trip = 0.6 }");
    let Ending::Stopped(Stop::TestLimit(hit)) = run.outcome.ending else {
        panic!("{:?}", run.outcome.ending);
    };
    assert_eq!((hit.quantity, hit.bound), (Limit::DelayUsed, 0.6));
    assert_eq!(hit.worst.unwrap().axis(), Some((0, 0)));
    let used = run.column("delay_used");
    assert_eq!(*used.last().unwrap(), hit.value);
    assert!(
        used[..used.len() - 1]
            .iter()
            .all(|used| used.is_nan() || *used <= 0.6)
    );
    let warned = run.events.iter().filter(|event| {
        matches!(
            &event.kind,
            Event::LimitWarning(reached) if reached.limit == "delay_used"
        )
    });
    assert!(warned.count() <= 1);
    assert_eq!(
        delayed(0.8, "delay_used = { trip = 0.9 }").outcome.ending,
        Ending::Completed
    );
}

#[test]
fn benchmark_has_its_published_delay() {
    let config = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("config/vrths-case-1.toml");
    let text = std::fs::read_to_string(config).unwrap();
    let run = crate::common::engine::run(&text.with("time.duration_s = 6"));
    let [margin, lag, stiffness] =
        ["margin_1_1", "lag_1_1", "stiffness_1_1"].map(|name| run.column(name));
    let mut seen = 0;
    // Motions within ten times its declared noise give no value.
    let first = lag.iter().position(|lag| !lag.is_nan()).unwrap();
    assert!(first < 4 * 4096, "{first}");
    for ((margin, lag), stiffness) in margin.iter().zip(&lag).zip(&stiffness).skip(first) {
        // The fit sees k − m ω², which is a hundredth less, through the published noise. 14.64 ms, and 1/τ is nearly in proportion.
        assert!((stiffness / 1.19e6 - 1.0).abs() < 0.04, "{stiffness}");
        let critical = (margin + lag) * stiffness / 1.19e6;
        assert!((critical / 14.64e-3 - 1.0).abs() < 0.02, "{critical}");
        seen += 1;
    }
    assert!(seen > 100, "{seen}");
}

#[test]
fn late_axis_grows_at_its_tables_delay() {
    // The table treats the coupling between axes as on time: here the axes are not coupled.
    let floors =
        FLOORS.with("specimen.stiffness_n_per_m = [[1.5e5, 0], [0, 1e5]]\ntime.duration_s = 4");
    let run = crate::common::engine::run(&floors.with("safety.delay_used.trip = 10.0"));
    for (axis, name) in ["1_1", "2_1", "2_2"].into_iter().enumerate() {
        let last = |kind: &str| *run.column(&format!("{kind}_{name}")).last().unwrap();
        let (critical, stiffness) = (last("margin") + last("lag"), last("stiffness"));
        assert!(critical.is_finite() && critical > 0.0, "{name}: {critical}");
        // All modes, followed from on time to late.
        let growth = |share: f64| {
            let analysis = prepare(&floors).facts.structure.unwrap().analysis.unwrap();
            let modes = analysis.delayed_modes().into_iter();
            let ends = modes.map(|mode| {
                let mut s = Complex::new(-mode.ratio * mode.frequency, mode.frequency);
                for step in 0..=100 {
                    let mut delays = [0.0; 3];
                    delays[axis] = share * critical * f64::from(step) / 100.0;
                    s = complex_mode_at(s, delays, (axis, stiffness), 0.0);
                }
                s.re / s.modulus()
            });
            ends.fold(f64::NEG_INFINITY, f64::max)
        };
        let (before, after) = (growth(0.97), growth(1.03));
        assert!(
            before < 0.0 && after > 0.0,
            "{name}: {critical} {before} {after}"
        );
    }
}

#[test]
fn unknown_critical_delay_gives_its_reason() {
    let refused = |text: &str, words: &str| {
        let path = std::path::Path::new("test.toml");
        let said = gusset_config::parse(path, text.to_owned(), &[])
            .and_then(|loaded| gusset_setup::build(&loaded).map(|_| ()));
        let said = said.unwrap_err().to_string();
        assert!(
            said.contains(words) && said.contains("delay_used"),
            "{said}"
        );
    };
    refused(
        &one_floor("[safety]\ndelay_used = { warn = 0.9, trip = 0.5 }\n"),
        "`delay_used` warns at 0.9",
    );
    refused(
        "[time]\nrate_hz = 100\nduration_s = 1\n[[specimen]]\nname = \"a\"\nlaw.linear = { stiffness_n_per_m = 1e5 }\n\
         [[excitation.prescribed_displacement]]\nspecimen = \"a\"\n\
         signal.cyclic = { amplitudes = [0.002], cycles_per_amplitude = 1, shape = \"sine\", frequency_hz = 2.0 }\n\
         [safety]\ndelay_used = { trip = 0.5 }\n",
        "no structure",
    );
    let chain = |safety: &str| {
        format!(
            "[time]\nrate_hz = 200\nduration_s = 1\nclock = \"simulated\"\n[structure.chain]\ndofs = 20\nmass_kg = 1000\n\
             stiffness_n_per_m = 4e5\ndamping_n_s_per_m = 300\n[integrator]\nlambda = 4\n\
             [excitation.ground_acceleration.signal.sine]\nfrequency_hz = 1\namplitude = 1\n[[specimen]]\nname = \"a\"\n\
             rows = [[1{}]]\nlaw.linear = {{ stiffness_n_per_m = 1e5 }}\n[specimen.transfer]\ndelay_s = 0.001\n[safety]\n{safety}\n",
            ", 0".repeat(19)
        )
    };
    refused(&chain("delay_used = { trip = 0.5 }"), "20 DOFs");
    // Not asked for: it runs, without the column, and says why.
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    completed(&write(folder.path(), "chain.toml", &chain("")), &out, &[]);
    let falsified = &json(&out, "summary.json")["falsified"];
    let said = falsified["missing"].to_string();
    assert!(
        said.contains("delay_margins") && said.contains("20 DOFs"),
        "{said}"
    );
    let names = Run::open(&out).unwrap();
    assert_eq!(names.layout().index_of("margin_1_1"), None);
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("tabulate"));
}
