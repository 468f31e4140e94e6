//! `gusset check --rehearse`: its go or no-go agrees with a long simulation, and its numbers with closed forms.

use crate::common::test_file::TestFile;
use std::f64::consts::TAU;
use std::path::Path;

use crate::common::{Said, say, write};
use gusset_actuator::compensation::CompensationSpec;
use gusset_evidence::benchmark::{Frame, Plant, RATE_HZ, Setup, Wiring, run};
use gusset_motion::{Grid, Motion, Quantity};
use gusset_session::rehearsal::{Budget, carry_out};
use serde_json::Value;

fn certify(folder: &Path, text: &str, more: &[&str]) -> (Option<i32>, Value) {
    let said = certified(folder, text, &[&["--json"], more].concat());
    let found: Value = serde_json::from_str(&said.stdout)
        .unwrap_or_else(|_| panic!("{}{}", said.stdout, said.stderr));
    (said.code, found["certificate"].clone())
}

fn certified(folder: &Path, text: &str, more: &[&str]) -> Said {
    let test = write(folder, "test.toml", text);
    let mut arguments = vec![
        "check".as_ref(),
        "--rehearse".as_ref(),
        test.as_os_str(),
        "--verbose".as_ref(),
    ];
    arguments.extend(more.iter().map(std::ffi::OsStr::new));
    say(arguments)
}

fn line<'a>(certificate: &'a Value, about: &str) -> &'a Value {
    let mut lines = certificate["lines"].as_array().unwrap().iter();
    lines
        .find(|line| line["about"].as_str().unwrap().starts_with(about))
        .unwrap_or_else(|| panic!("no line about {about} in {certificate:#}"))
}

/// A benchmark case as an ordinary test of 20 s.
fn vrths(case: usize, compensation: &str) -> String {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/vrths-case-1.toml");
    let text = std::fs::read_to_string(config).unwrap();
    let part = Frame::case(case).unwrap().numerical();
    let rows = |value: &dyn Fn(usize, usize) -> f64| {
        [0, 1, 2].map(|row| [0, 1, 2].map(|column| value(row, column)))
    };
    let mass = rows(&|row, column| if row == column { part.mass[row] } else { 0.0 });
    let damping = rows(&|row, column| part.damping[(row, column)]);
    // The bound on the added energy is chosen by the study for its own compensator, which others need not keep.
    text.without("safety.added_energy_share")
        .without("specimen.0.compensation")
        .without("uncertainty")
        .with(&format!(
            "time.duration_s = 20\nspecimen.compensation.{compensation}\n\
             structure.matrices = {{ mass = {mass:?}, damping = {damping:?} }}\n\
             certificate = {{ trials = 4, trip_probability = 0.7, tracking_error = 0.5, response_error = 1.0 }}"
        ))
}

const CONTROLLERS: [&str; 6] = [
    "none = {}",
    "polynomial = { order = 2, delay_s = 0.024 }",
    "inverse = { delay_s = 0.026 }",
    "pi_lead = {}",
    "amb = {}",
    "ats = { start = [1.0, 0.0249, 1.07e-4] }",
];

#[test]
fn it_is_right_about_the_benchmark() {
    let text = vrths(1, CONTROLLERS[0]);
    let test: toml::Table = text.parse().unwrap();
    let motion: Motion = test["excitation"]["ground_acceleration"]
        .clone()
        .try_into()
        .unwrap();
    let none = |_: &str| Err(std::io::ErrorKind::NotFound.into());
    let grid = Grid::new(1.0 / RATE_HZ, 41 * 4096).unwrap();
    let ground = motion
        .evaluate(Quantity::Acceleration, grid, &none)
        .unwrap()
        .values;
    // The cases are independent: two threads share them.
    let ground = &ground[..];
    let wrong = std::thread::scope(|scope| {
        let halves = [[1, 4], [2, 3]];
        let halves =
            halves.map(|cases| scope.spawn(move || cases.map(|case| misjudged(case, ground))));
        halves.map(|half| half.join().unwrap().concat()).concat()
    });
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Compares the certificate of a benchmark case with the run of the benchmark, for every controller. Returns the differences.
fn misjudged(case: usize, ground: &[f64]) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let mut wrong = Vec::new();
    for controller in CONTROLLERS {
        // The runner of the benchmark plays 41 s.
        let spec: CompensationSpec = toml::from_str(controller).unwrap();
        let mut compensator = spec.build(1.0 / RATE_HZ).unwrap();
        compensator.reset(0.0);
        let setup = Setup {
            frame: &Frame::case(case).unwrap(),
            plant: Plant::default(),
            wiring: Wiring::InTick(gusset_actuator::transfer::BetweenTicks::Ramped),
            quantum: 0.0,
            noise: Some(1),
            ground,
            late: 0,
            force_limit: 8900.0,
        };
        let truth = run(&setup, compensator.as_mut()).saturated == 0;
        let (code, found) = certify(folder.path(), &vrths(case, controller), &[]);
        // Four trials establish no GO, but no line may forbid it.
        let go = !is_forbidden(&found);
        // The trials by themselves, without any proof.
        let carried = found["trips"] == 0;
        if go != truth || carried != truth || code != Some(1) {
            wrong.push(format!("{case} {controller}: {truth}, but {found:#}"));
        }
        assert_eq!(
            truth,
            !controller.starts_with("none") && !controller.starts_with("poly")
        );
    }
    wrong
}

/// True if a line of a certificate is a no-go.
fn is_forbidden(found: &Value) -> bool {
    let lines = found["lines"].as_array().unwrap();
    lines.iter().any(|line| line["verdict"] == "no-go")
}

/// A motion of one axis that is prescribed: half a second of a sine of 4 Hz.
fn prescribed(specimen: &str, more: &str) -> String {
    format!(
        "{more}\n[time]\nrate_hz = 1000\nduration_s = 0.5\nclock = \"simulated\"\n[[excitation.prescribed_displacement]]\n\
         specimen = \"s\"\nsignal.sine = {{ amplitude = 0.01, frequency_hz = 4 }}\n[safety]\nzero_s = 0\n[[specimen]]\n\
         name = \"s\"\nlaw.linear = {{ stiffness_n_per_m = 1e6 }}\n{specimen}"
    )
}

#[test]
fn trip_probability_is_that_of_its_cause() {
    // The amplitude is normal, its limit half a standard deviation above: P = 1 − Φ(½) = 0.3085.
    let text = prescribed(
        "limits.command_disp_m = { trip = [-0.0105, 0.0105] }\n[[uncertainty]]\n\
         key = \"excitation.prescribed_displacement[0].signal.sine.amplitude\"\nstd_share = 0.1\n[certificate]\ntrials = 300\n",
        "",
    );
    let folder = tempfile::tempdir().unwrap();
    let (code, found) = certify(folder.path(), &text, &[]);
    assert_eq!(code, Some(1), "{found:#}");
    let bounds = found["trip_probability_95"].as_array().unwrap();
    let (low, high) = (bounds[0].as_f64().unwrap(), bounds[1].as_f64().unwrap());
    assert!(
        low < 0.3085 && high > 0.3085 && high - low < 0.12,
        "{low} {high}"
    );
    assert_eq!(
        found["trips"],
        found["trip_reasons"]["specimen 1, commanded displacement beyond its limit"]
    );
    assert_eq!(line(&found, "probability")["verdict"], "no-go");
    // 95 % of the trials need 0.01·(1 + 0.1·1.645) less the noise of the sample.
    let stroke = line(&found, "stroke");
    assert_eq!(stroke["verdict"], "not known", "{stroke}");

    // A seed always gives its own certificate; another seed gives a different one.
    let again = |seed: &str| {
        let (_, mut found) = certify(folder.path(), &text, &["--trials", "40", "--seed", seed]);
        let _ = found.as_object_mut().unwrap().remove("wall_s");
        assert_eq!(
            (found["trials"].as_u64(), found["seed"].to_string().as_str()),
            (Some(40), seed)
        );
        found
    };
    assert_eq!(again("7"), again("7"));
    assert_ne!(again("7")["trips"], again("8")["trips"]);
}

#[test]
fn tracking_errors_are_delay_and_gain() {
    let folder = tempfile::tempdir().unwrap();
    let p50 = |transfer: &str| {
        let text = prescribed(&format!("[specimen.transfer]\n{transfer}\n"), "");
        let (_, found) = certify(folder.path(), &text, &["--trials", "500"]);
        assert_eq!(found["trials"], 1, "nothing is uncertain: {found:#}");
        assert_eq!(found["varied"].as_array().unwrap().len(), 0);
        found["tracking_error"][0]["p50"].as_f64().unwrap()
    };
    assert_eq!(p50(""), 0.0);
    let gain = p50("actuator.proportional.gain = 0.9");
    assert!((gain - 0.1).abs() < 1e-12, "{gain}");
    // Two periods of the sine; before it moves there is nothing to be late for, which costs the delay's share of them.
    let (tau, omega) = (0.004, 4.0 * TAU);
    let delay = p50("delay_s = 0.004");
    let steady = 2.0 * libm::sin(omega * tau / 2.0_f64);
    assert!((delay / steady - 1.0).abs() < tau / 0.5, "{delay} {steady}");
}

/// The controllers of a trial and of the test use the same estimate: a gap that is open at rest adds no damping.
#[test]
fn a_trial_has_the_damping_of_the_test() {
    let text = "[time]\nrate_hz = 500\nduration_s = 2\nclock = \"simulated\"\n[integrator]\nlambda = 4\n\
        [structure.shear_building]\nmass_kg = [1000]\nstiffness_n_per_m = [1e5]\n\
        [structure.damping.rayleigh]\nmass_coefficient_per_s = 0\nstiffness_coefficient_s = 0.002\n\
        [excitation.ground_acceleration.signal.sine]\namplitude = 1.0\nfrequency_hz = 1.6\n\
        [[specimen]]\nname = \"gap\"\nstorey = 1\nlaw.parallel = [ { linear.stiffness_n_per_m = 1e4 }, \
        { gap = { stiffness_n_per_m = 1e7, gap_m = 1.0, side = \"tension\" } } ]\n\
        [specimen.transfer]\ndelay_s = 0.001\n";
    let loaded = gusset_config::parse(Path::new("test.toml"), text.to_owned(), &[]).unwrap();
    let itself = gusset_setup::build(&loaded).unwrap();
    let trial = gusset_setup::Trial {
        believed: gusset_setup::estimates(&loaded).unwrap(),
        ..gusset_setup::Trial::default()
    };
    let trial = gusset_setup::build_trial(&loaded, &trial).unwrap();
    let moves = |test: gusset_setup::Prepared| {
        let found = carry_out(test.experiment, &mut Budget::default());
        found.specimens[0].found[0].command
    };
    let (nominal, tried) = (moves(itself), moves(trial));
    assert!(nominal.high > 0.05, "{nominal:?}");
    assert_eq!(nominal, tried);
}

/// One storey whose specimen is behind a link; ω = 2π·3 Hz, half of the stiffness in the specimen, 4 % damping.
fn storey(more: &str) -> String {
    let stiffness = 500.0 * (3.0 * TAU) * (3.0 * TAU);
    let damping = 0.08 * 1000.0 * 3.0 * TAU;
    format!(
        "[time]\nrate_hz = 500\nduration_s = 40\nclock = \"simulated\"\n[structure.shear_building]\nmass_kg = [1000]\n\
         stiffness_n_per_m = [{stiffness}]\ndamping_n_s_per_m = [{damping}]\n[integrator]\nlambda = 4\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = 0.5\nfrequency_hz = 1\n[safety]\nzero_s = 0\n\
         [[specimen]]\nname = \"s\"\nstorey = 1\nstiffness_n_per_m = {stiffness}\n\
         limits = {{ command_disp_m = {{ trip = [-0.05, 0.05] }}, measured_force_n = {{ trip = [-2e4, 2e4] }} }}\n\
         [specimen.link]\naddress = \"127.0.0.1:9\"\nprobe = \"none\"\n{more}"
    )
}

#[test]
fn identified_delay_acts_in_the_trials() {
    let folder = tempfile::tempdir().unwrap();
    // About 2ξ/(pω) = 8.5 ms.
    let critical = 0.00852466667504179;
    for (share, spread, go, carried) in [
        (0.8, 0.0, true, true),
        (1.2, 0.0, false, false),
        // Twice the spread is too much, though the nominal test would do.
        (0.8, 0.15, false, true),
    ] {
        let (delay, std) = (share * critical, spread * critical);
        let known =
            format!("[specimen.identified]\ndelay_s = {delay}\ndelay_std_s = {std}\ngain = 1\n");
        let (code, found) = certify(folder.path(), &storey(&known), &["--trials", "6"]);
        let of_delay = line(&found, "delay");
        let text = of_delay["text"].as_str().unwrap();
        assert_eq!(of_delay["verdict"] == "go", go, "{share} {spread}: {text}");
        assert!(text.contains("recursion"), "{text}");
        assert_eq!(line(&found, "stability")["verdict"] == "go", carried);
        if spread == 0.0 {
            assert_eq!(found["trips"], if carried { 0 } else { 1 }, "{found:#}");
            // One trial that is certain is too few for a GO, and no capacity is known.
            assert_eq!(is_forbidden(&found), !go, "{found:#}");
            assert_eq!(
                found["not_established"].as_array().unwrap().len(),
                if go { 5 } else { 6 }
            );
            assert_eq!((code, &found["go"]), (Some(1), &false.into()));
        } else {
            assert_eq!(
                found["varied"][0],
                format!("delay ± {:.3} ms of s", 1e3 * std)
            );
        }
    }
    // With its whole delay compensated, no delay remains.
    let known = format!(
        "[specimen.identified]\ndelay_s = {}\n[specimen.compensation]\n\
                         polynomial = {{ order = 1, delay_s = {0} }}\n",
        1.2 * critical
    );
    let (_, found) = certify(folder.path(), &storey(&known), &[]);
    assert_eq!(line(&found, "delay")["verdict"], "go", "{found:#}");
    assert_eq!(found["trips"], 0);
    let text = line(&found, "delay")["text"].as_str().unwrap();
    assert!(text.contains("left after \"polynomial\""), "{text}");
}

#[test]
fn rig_capacity_is_compared_with_demand() {
    let folder = tempfile::tempdir().unwrap();
    let (amplitude, omega, stiffness) = (0.01, 4.0 * TAU, 1e6);
    // |f v| = k A² ω |sin x cos(x − δ)| has the peak k A² ω (1 + sin δ)/2, where δ is half a tick: a velocity of two commands is
    // that of half a tick ago.
    let half: f64 = omega * 0.5e-3;
    let needs = [
        ("stroke_m", amplitude),
        ("velocity_m_per_s", amplitude * omega),
        ("force_n", stiffness * amplitude),
        (
            "power_w",
            stiffness * amplitude * amplitude * omega * (1.0 + libm::sin(half)) / 2.0,
        ),
    ];
    for (key, need) in needs {
        for (share, verdict, missing) in [(1.01, "go", 1), (0.98, "no-go", 2)] {
            let text = prescribed(&format!("capacity.{key} = {}\n", share * need), "");
            let (found_code, found) = certify(folder.path(), &text, &[]);
            let word = key.split('_').next().unwrap();
            assert_eq!(
                line(&found, word)["verdict"],
                verdict,
                "{key} {share}: {found:#}"
            );
            // One trial that is certain is too few for a GO; beyond a capacity the verdict forbids it, too.
            let found = found["not_established"].as_array().unwrap();
            assert_eq!((found_code, found.len()), (Some(1), missing), "{found:?}");
        }
    }
}

#[test]
fn zero_trips_do_not_mean_probability_zero() {
    let folder = tempfile::tempdir().unwrap();
    let noisy = prescribed("[specimen.transfer]\ndisp_sensor.noise_rms_m = 1e-6\n", "");
    let said = certified(folder.path(), &noisy, &["--trials", "20"]);
    assert_eq!(said.code, Some(1), "{}", said.stdout);
    for words in ["0 of 20 trials", "0.0 to 16.9 %", "100 trials", "NO-GO"] {
        assert!(said.stdout.contains(words), "{words}: {}", said.stdout);
    }
    // The tracking error is the noise alone: 1 µm over 10 mm/√2.
    let said = certified(folder.path(), &noisy, &["--trials", "100"]);
    assert_eq!(said.code, Some(0), "{}{}", said.stdout, said.stderr);
    assert!(
        said.stdout.contains("certificate") && said.stdout.contains("  GO\n"),
        "{}",
        said.stdout
    );
}

#[test]
fn impossible_draws_are_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let text = prescribed(
        "[[uncertainty]]\nkey = \"specimen.0.law.linear.stiffness_n_per_m\"\nrange = [-1e300, 1e12]\n",
        "",
    );
    let said = certified(folder.path(), &text, &[]);
    assert_eq!(said.code, Some(2), "{}{}", said.stdout, said.stderr);
    for words in ["trial ", "drawn", "stiffness_n_per_m", "[[uncertainty]]"] {
        assert!(said.stderr.contains(words), "{words}: {}", said.stderr);
    }
    let said = say(["check", "--trials", "3", "config/vrths-case-1.toml"]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(said.stderr.contains("--rehearse"), "{}", said.stderr);
}

/// A specimen that may be stiffer than estimated keeps its position: an offset of its axis does not strain it.
#[test]
fn an_offset_of_the_axis_changes_no_verdict() {
    let folder = tempfile::tempdir().unwrap();
    for belief in [
        "stiffness_std_n_per_m = 1e3",
        "stiffness_std_n_per_m = 1e3, delay_s = 1e-4",
    ] {
        for (offset, reads) in [(0.0, 0.0), (0.02, 0.0), (-0.05, 100.0)] {
            let text = format!(
                "[time]\nstep_s = 0.01\nduration_s = 2\nclock = \"simulated\"\n[structure.shear_building]\nmass_kg = [1000]\n\
                 stiffness_n_per_m = [0]\n[structure.damping.modal]\nratios = [0.05]\n[excitation.ground_acceleration]\n\
                 signal.sine = {{ amplitude = 0.1, frequency_hz = 1 }}\n[certificate]\ntrials = 8\n[[specimen]]\nname = \"s\"\n\
                 storey = 1\nstiffness_n_per_m = 1e5\nidentified = {{ stiffness_n_per_m = 1e5, {belief} }}\n\
                 link = {{ address = \"127.0.0.1:9\" }}\naxis = [{{ offset_m = {offset:?}, offset_n = {reads:?} }}]\n\
                 limits = {{ command_disp_m = {{ trip = [{:?}, {:?}] }}, measured_force_n = {{ trip = [{:?}, {:?}] }} }}\n",
                offset - 0.008,
                offset + 0.008,
                reads - 400.0,
                reads + 400.0,
            );
            let (_, found) = certify(folder.path(), &text, &[]);
            assert_eq!(found["trips"], 0, "{belief} {offset} {reads}: {found:#}");
        }
    }
}

#[test]
fn uncertain_link_specimen_same_either_way() {
    let folder = tempfile::tempdir().unwrap();
    let stiffness = 500.0 * (3.0 * TAU) * (3.0 * TAU);
    let uncertain = |key: &str, share: f64| {
        format!("[[uncertainty]]\nkey = \"specimen.0.{key}\"\nstd_share = {share}\n")
    };
    let stand_in = format!("[specimen.law.linear]\nstiffness_n_per_m = {stiffness}\n");
    let own = storey(&uncertain("stiffness_n_per_m", 0.2));
    let other = uncertain("law.linear.stiffness_n_per_m", 0.2);
    let found = [own, storey(&format!("{stand_in}{other}"))].map(|text| {
        // Softer by half, or stiffer: the force is another, and in the reference, too.
        let more = ["--trials", "8", "--set", "time.duration_s=5"];
        certify(folder.path(), &text, &more).1
    });
    let spread = |found: &Value| {
        let force = line(found, "force")["text"].as_str().unwrap().to_owned();
        (force, found["response_error"].clone())
    };
    assert_eq!(spread(&found[0]), spread(&found[1]));
    let (force, _) = spread(&found[0]);
    let numbers: Vec<&str> = force
        .split(", ")
        .flat_map(|part| part.split(" in ").next())
        .collect();
    assert_ne!(numbers[0], numbers[1], "{force}");
    // The damping, too.
    let damped = storey(&uncertain("damping_n_s_per_m", 0.5));
    let damped = damped.with("specimen.damping_n_s_per_m = 800");
    let certain = damped.without("uncertainty");
    let force = |text: &str| {
        let more = ["--trials", "8", "--set", "time.duration_s=5"];
        let found = certify(folder.path(), text, &more).1;
        line(&found, "force")["text"].as_str().unwrap().to_owned()
    };
    assert_ne!(force(&damped), force(&certain));
}

#[test]
fn unstable_at_any_lambda_is_a_no_go() {
    let folder = tempfile::tempdir().unwrap();
    // Beyond its yield velocity the damper damps a thousand times as much: at that bound no λ holds the sawtooth.
    let slider = "[time]\nrate_hz = 100\nduration_s = 2\nclock = \"simulated\"\n[structure.shear_building]\n\
        mass_kg = [1000, 1000]\nstiffness_n_per_m = [0, 1e5]\ndamping_n_s_per_m = [0, 100]\n[integrator]\nlambda = 4\n\
        [excitation.ground_acceleration]\nsignal.sine = { amplitude = 0.2, frequency_hz = 1 }\n\
        [[specimen]]\nname = \"damper\"\nstorey = 1\n\
        law.biviscous = { damping_n_s_per_m = 1000, post_yield_damping_n_s_per_m = 1e6, yield_velocity_m_per_s = 0.2 }\n";
    let said = certified(folder.path(), slider, &[]);
    let words = "UNSTABLE: no lambda";
    assert_eq!(said.code, Some(1), "{}{}", said.stdout, said.stderr);
    assert_eq!(said.stdout.matches(words).count(), 2, "{}", said.stdout);
    assert!(
        !said.stdout.contains("no declared bound"),
        "{}",
        said.stdout
    );
    let (_, found) = certify(folder.path(), slider, &[]);
    assert_eq!(line(&found, "integration")["verdict"], "no-go");
    let said = certified(folder.path(), slider, &["--json"]);
    let facts: Value = serde_json::from_str(&said.stdout).unwrap();
    assert_eq!(facts["structure"]["stable"], false);
    let test = folder.path().join("test.toml");
    let out = folder.path().join("run");
    let run = say([
        "run".as_ref(),
        test.as_os_str(),
        "--out".as_ref(),
        out.as_os_str(),
    ]);
    assert!(run.stderr.contains(words), "{}", run.stderr);
}
