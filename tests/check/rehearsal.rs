//! `gusset check` rehearses a test: the test then needs of each axis what the rehearsal found, and trips at a limit that the
//! rehearsal calls too narrow.

use std::f64::consts::TAU;
use std::path::Path;

use crate::common::test_file::TestFile;
use crate::common::{FRAME, Said, run, say, write};
use gusset_session::rehearsal::{Budget, rehearse};
use serde_json::Value;

const LIMITS: &str = "[specimen.limits]\ncommand_disp_m = { trip = [-0.5, 0.5] }\nmeasured_force_n = { trip = [-1e6, 1e6] }\n";

fn check(folder: &Path, text: &str, more: &[&str]) -> Said {
    let test = write(folder, "test.toml", text);
    let mut arguments = vec!["check".as_ref(), test.as_os_str(), "--verbose".as_ref()];
    arguments.extend(more.iter().map(std::ffi::OsStr::new));
    say(arguments)
}

/// The short page of `check` has these words, every finding completely, and the command that comes next.
#[track_caller]
fn short_page_shows(folder: &Path, words: &[&str]) {
    let test = folder.join("test.toml");
    let page = say(["check".as_ref(), test.as_os_str()]).stdout;
    let json = say(["check".as_ref(), test.as_os_str(), "--json".as_ref()]).stdout;
    let json: Value = serde_json::from_str(&json).unwrap();
    let one_line: Vec<&str> = page.split_whitespace().collect();
    let one_line = one_line.join(" ");
    for words in words {
        assert!(one_line.contains(words), "{words}: {page}");
    }
    let findings = json["verdict"]["findings"].as_array().unwrap();
    assert!(!findings.is_empty());
    for finding in findings {
        let text = finding["text"].as_str().unwrap().split_whitespace();
        let text = text.collect::<Vec<_>>().join(" ");
        assert!(one_line.contains(&text), "{text}: {page}");
    }
    assert!(
        page.contains("\nnext\n") && page.contains("  gusset "),
        "{page}"
    );
}

/// The rehearsal's findings about axis 1 of the only specimen.
struct Found(Value);

impl Found {
    fn of(text: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let said = check(folder.path(), text, &["--json"]);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        let found: Value = serde_json::from_str(&said.stdout).unwrap();
        assert_eq!(found["rehearsal"]["complete"], true, "{found}");
        Self(found["rehearsal"]["specimens"][0].clone())
    }

    fn need(&self, quantity: &str) -> Option<[f64; 2]> {
        let axis = self.0["axes"][0].as_array().unwrap();
        let need = axis.iter().find(|need| need["quantity"] == quantity)?;
        Some(["low", "high"].map(|key| need[key].as_f64().unwrap()))
    }

    fn size(&self, quantity: &str) -> f64 {
        let [low, high] = self.need(quantity).unwrap();
        assert_eq!(low, 0.0);
        high
    }
}

fn near(found: f64, wanted: f64) {
    // Sums of a few thousand terms of double precision at most.
    assert!(
        (found - wanted).abs() <= 1e-10 * wanted.abs(),
        "{found} {wanted}"
    );
}

/// d = A cos ωt, reached by a ramp that is slower than all that follows; an axis in mm and kN, mounted the other way round.
#[test]
fn harmonic_motion_matches_the_closed_form() {
    let (amplitude, frequency, rate, stiffness) = (0.02, 2.0, 1000.0, 1e6);
    let found = Found::of(&format!(
        "[time]\nrate_hz = {rate}\nduration_s = 1\nclock = \"simulated\"\n\
         [[excitation.prescribed_displacement]]\nspecimen = \"s\"\n\
         signal.sine = {{ amplitude = {amplitude}, frequency_hz = {frequency}, phase_rad = {} }}\n\
         [safety]\nramp_s = 1\n[[specimen]]\nname = \"s\"\nlaw.linear = {{ stiffness_n_per_m = {stiffness} }}\n\
         limits.command_step_m = {{ trip = 1 }}\n\
         [[specimen.axis]]\nsign = -1\nunit_disp = \"mm\"\nunit_force = \"kN\"\n",
        TAU / 4.0
    ));
    assert_eq!(found.0["stand_in"], "law");
    let angle = TAU * frequency / rate;
    let [low, high] = found.need("command_disp_m").unwrap();
    near(low, -amplitude);
    near(high, amplitude);
    let [low, high] = found.need("measured_force_n").unwrap();
    near(low, -stiffness * amplitude);
    near(high, stiffness * amplitude);
    // cos((k+1)a) − cos(ka) = −2 sin(a/2) sin((k+½)a); half a period is a whole number of ticks, so the largest sine is
    // that half a tick from the crest.
    let step = 2.0 * amplitude * libm::sin(angle / 2.0) * libm::cos(angle / 2.0);
    near(found.size("command_step_m"), step);
    near(found.size("command_vel_m_per_s"), step * rate);
    // The second difference is −4 sin²(a/2) cos(ka). Differences of numbers of 20 mm lose 1e-16 · 20 mm · 1000² Hz².
    let accel = 4.0 * amplitude * libm::sin(angle / 2.0).powi(2) * rate * rate;
    let off = found.size("command_accel_m_per_s2") - accel;
    assert!(off.abs() < 1e-7, "{off}");
}

/// With one tick a step the pace falls from 1 to 1/2 at once, and rises so: the velocity V changes by V/2 within a tick.
#[test]
fn half_velocity_hold_is_a_warning() {
    let (amplitude, frequency, rate) = (0.1, 0.25, 1000.0);
    // Steepest at 1 s and 3 s; within the easing of 0.02 s the velocity changes by 5e-4 of itself.
    let fastest = amplitude * TAU * frequency;
    let needed = 0.5 * fastest * rate;
    let text = |trip: f64| {
        format!(
            "[time]\nrate_hz = {rate}\nduration_s = 4\nclock = \"simulated\"\n\
             [[excitation.prescribed_displacement]]\nspecimen = \"s\"\n\
             signal.sine = {{ amplitude = {amplitude}, frequency_hz = {frequency}, phase_rad = {} }}\n\
             [safety]\nease_s = 0.02\n[[specimen]]\nname = \"s\"\nlaw.linear = {{ stiffness_n_per_m = 1e6 }}\n\
             limits.command_accel_m_per_s2 = {{ trip = {trip} }}\n",
            TAU / 4.0
        )
    };
    let folder = tempfile::tempdir().unwrap();
    for (share, trips) in [(0.9, true), (1.1, false)] {
        let said = check(folder.path(), &text(share * needed), &["--json"]);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        let found: Value = serde_json::from_str(&said.stdout).unwrap();
        let hold = &found["rehearsal"]["hold"];
        let at = hold["time_s"].as_f64().unwrap();
        assert!((at - 1.0).abs() < 0.01 || (at - 3.0).abs() < 0.01, "{hold}");
        let needs = hold["needs"].as_array().unwrap();
        let accel = needs
            .iter()
            .find(|need| need["quantity"] == "command_accel_m_per_s2");
        let high = accel.unwrap()["high"].as_f64().unwrap();
        assert!((high / needed - 1.0).abs() < 0.01, "{high} {needed}");
        let findings = found["rehearsal"]["findings"].to_string();
        assert_eq!(findings.contains("hold at"), trips, "{findings}");
        assert_eq!(said.stderr.contains("hold at"), trips, "{}", said.stderr);
    }
}

/// The rehearsal and the limits in the loop agree on every quantity, to a millionth.
#[test]
fn limit_trips_where_the_rehearsal_says() {
    let limits = "limits = { command_step_m = { trip = 1 }, force_step_n = { trip = 1e9 } }\n";
    let text = FRAME.with(&format!("[specimen]\n{limits}"));
    let found = Found::of(&text);
    let ranges = [
        "command_disp_m",
        "measured_disp_m",
        "sensor_force_n",
        "measured_force_n",
    ];
    let sizes = [
        "command_step_m",
        "command_vel_m_per_s",
        "command_accel_m_per_s2",
        "force_step_n",
    ];
    for quantity in ranges.into_iter().chain(sizes) {
        let known = match quantity {
            "measured_disp_m" => "command_disp_m",
            "sensor_force_n" => "measured_force_n",
            other => other,
        };
        let [low, high] = found.need(known).unwrap();
        assert!(high > low, "{quantity}");
        for (share, code) in [(1.0 - 1e-6, 1), (1.0 + 1e-6, 0)] {
            let level = if ranges.contains(&quantity) {
                format!("[{:e}, {:e}]", low * share, high * share)
            } else {
                format!("{:e}", high * share)
            };
            let limits = format!("specimen.limits.{quantity}.trip = {level}");
            let text = FRAME.with(&limits);
            let folder = tempfile::tempdir().unwrap();
            let said = check(folder.path(), &text, &[]);
            assert_eq!(said.code, Some(code), "{quantity} {}", said.stderr);
            let out = folder.path().join("out");
            let ran = run(&folder.path().join("test.toml"), &out, &[]);
            if code == 0 {
                assert_eq!(ran.code, Some(0), "{quantity} {}", ran.stderr);
                continue;
            }
            // At its place in the file, with the value found and the value allowed.
            for words in ["test.toml:", quantity, "would trip", "of `storey`"] {
                assert!(said.stderr.contains(words), "{words}: {}", said.stderr);
            }
            assert!(said.stdout.contains("NOT POSSIBLE"), "{}", said.stdout);
            assert!(said.stdout.contains("WOULD TRIP"), "{}", said.stdout);
            short_page_shows(folder.path(), &["NOT POSSIBLE", quantity, "WOULD TRIP"]);
            assert_eq!(ran.code, Some(1), "{quantity} {}", ran.stderr);
            assert!(ran.stderr.contains(", allowed "), "{}", ran.stderr);
        }
    }
}

/// The frame with its specimen behind a link to an address without a server.
fn behind_a_link(stand_in: &str) -> String {
    let (test, _) = FRAME.split_once("[specimen.law").unwrap();
    format!(
        "{test}stiffness_n_per_m = 5e5\n{stand_in}[specimen.link]\naddress = \"127.0.0.1:9\"\nprobe = \"none\"\n{LIMITS}"
    )
}

#[test]
fn declared_stand_in_replaces_link_specimen() {
    let laws = |key: &str| {
        let (_, law) = FRAME.split_once("[specimen.law").unwrap();
        format!("[specimen.{key}{law}")
    };
    let (test, _) = FRAME.split_once("[specimen.law").unwrap();
    let same = |one: &Found, other: &Found| {
        for quantity in [
            "command_disp_m",
            "command_vel_m_per_s",
            "command_accel_m_per_s2",
            "measured_force_n",
        ] {
            let (one, other) = (one.need(quantity).unwrap(), other.need(quantity).unwrap());
            near(one[0], other[0]);
            near(one[1], other[1]);
        }
    };
    let itself = Found::of(&format!(
        "{test}stiffness_n_per_m = 5e5\n{}{LIMITS}",
        laws("law")
    ));
    let far = Found::of(&behind_a_link("").with(&laws("law")));
    assert_eq!(far.0["stand_in"], "stand_in");
    same(&itself, &far);
    let linear = Found::of(&format!(
        "{test}law.linear = {{ stiffness_n_per_m = 5e5 }}\n{LIMITS}"
    ));
    let far = Found::of(&behind_a_link(""));
    assert_eq!(far.0["stand_in"], "linear");
    same(&linear, &far);
    assert!(linear.need("measured_force_n") != itself.need("measured_force_n"));
}

/// A stand-in has its zero where the specimen's axis has its own, whatever its estimate.
#[test]
fn stand_ins_begin_at_zero_deformation() {
    let behind = |belief: &str, offsets: &str| {
        let gear = "scale = 2\nsign = -1\nunit_disp = \"mm\"\nunit_force = \"kN\"";
        let text = behind_a_link(&format!("{belief}\n"));
        let wide = "measured_force_n = { trip = [-1e6, 1e6] }";
        assert!(text.contains(wide));
        Found::of(&format!("{text}[[specimen.axis]]\n{gear}\n{offsets}"))
    };
    let offsets = "offset_m = 0.02\noffset_n = 7\n";
    let linear = behind("", offsets);
    let zero = behind("", "");
    let force = |found: &Found| found.need("measured_force_n").unwrap();
    let (off, at_zero) = (force(&linear), force(&zero));
    let size = at_zero[1] - at_zero[0];
    let shift = off[0] - at_zero[0];
    let same = |one: [f64; 2], other: [f64; 2], what: &str| {
        for (a, b) in one.iter().zip(other) {
            assert!((a - b).abs() < 1e-5 * size, "{what}: {one:?} {other:?}");
        }
    };
    // Through a lever of 2 the specimen has a quarter of the stiffness that the structure sees.
    for belief in [
        "law.linear = { stiffness_n_per_m = 1.25e5 }",
        "identified = { noise_disp_m = 1e-12 }",
        "transfer = { delay_s = 0.0 }",
    ] {
        same(force(&behind(belief, offsets)), off, belief);
    }
    // A specimen with an offset yields where it would without one.
    let plastic =
        "law.bilinear = { post_yield_ratio = 0, stiffness_n_per_m = 1.25e5, yield_force_n = 150 }";
    let (far, near) = (
        force(&behind(plastic, offsets)),
        force(&behind(plastic, "")),
    );
    same(far, near.map(|force| force + shift), "plastic");
    assert!(near[1] - near[0] < 0.99 * size, "it yields");
}

/// A specimen whose position is known, and its stand-in, take one second for the startup ramp where no speed limit applies. Any
/// other specimen takes `ramp_s`. The test itself is slower.
#[test]
fn startup_ramp_is_rehearsed_at_its_speed() {
    let (amplitude, tick) = (0.02, 1e-3);
    for (link, time) in [
        ("", 1.0),
        (
            "protocol = \"openfresco\"\nopenfresco = { answer_signals = [1, 1, 1, 1, 1] }\n",
            1.0,
        ),
        (
            "protocol = \"openfresco-adapter\"\nstands_at_m = [0.0]\n",
            1.0,
        ),
        ("protocol = \"openfresco-adapter\"\ncomputed = true\n", 0.25),
    ] {
        let found = Found::of(&format!(
            "[time]\nrate_hz = 1000\nduration_s = 1\n[[excitation.prescribed_displacement]]\nspecimen = \"s\"\n\
             signal.sine = {{ amplitude = {amplitude}, frequency_hz = 0.1, phase_rad = {} }}\n\
             [safety]\nramp_s = 0.25\n[[specimen]]\nname = \"s\"\nstiffness_n_per_m = 1e6\n\
             [specimen.link]\naddress = \"127.0.0.1:9\"\nprobe = \"none\"\n{link}{LIMITS}",
            TAU / 4.0
        ));
        // Differences of A/2·(1 − cos(πk/N)); N is even.
        let angle = 0.5 * TAU / (time / tick) / 2.0;
        let fastest = amplitude * libm::sin(angle) * libm::cos(angle) / tick;
        near(found.size("command_vel_m_per_s"), fastest);
    }
}

#[test]
fn check_reports_a_missing_stand_in() {
    let text = format!(
        "[time]\nrate_hz = 100\nduration_s = 1\nclock = \"simulated\"\n[[excitation.prescribed_displacement]]\n\
         specimen = \"s\"\nsignal.sine = {{ amplitude = 0.01, frequency_hz = 1 }}\n[[specimen]]\nname = \"s\"\n\
         stiffness_n_per_m = 0\n[specimen.link]\naddress = \"127.0.0.1:9\"\nprobe = \"none\"\n{LIMITS}"
    );
    let found = Found::of(&text);
    assert_eq!(found.0["stand_in"], "nothing");
    assert_eq!(found.need("measured_force_n"), None);
    near(found.need("command_disp_m").unwrap()[1], 0.01);
    let folder = tempfile::tempdir().unwrap();
    let said = check(folder.path(), &text, &[]);
    assert!(said.stdout.contains("Its force"), "{}", said.stdout);
}

#[test]
fn warning_level_and_rehearsal_off_work() {
    let folder = tempfile::tempdir().unwrap();
    let text = FRAME.with("specimen.limits.command_vel_m_per_s = { warn = 1e-3, trip = 10 }");
    let said = check(folder.path(), &text, &[]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(
        said.stderr.contains("warning: ") && said.stderr.contains("commanded velocity"),
        "{}",
        said.stderr
    );
    // The message shows the argument of `--set`.
    let narrow = ["--set", "specimen.0.limits.command_vel_m_per_s.trip=2e-3"];
    let said = check(folder.path(), &text, &narrow);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    assert!(
        said.stderr.contains("error: ") && said.stderr.contains("commanded velocity"),
        "{}",
        said.stderr
    );
    let said = check(
        folder.path(),
        &text,
        &[&narrow[..], &["--no-rehearsal", "--json"]].concat(),
    );
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let found: Value = serde_json::from_str(&said.stdout).unwrap();
    assert_eq!(
        (&found["valid"], &found["rehearsal"]),
        (&true.into(), &Value::Null)
    );
}

/// d = A sin ωt on a spring k: stroke A, velocity A ω, force k A, and the peak of |f v|, half of k A² ω to within a tick.
#[test]
fn demand_beyond_the_rig_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (amplitude, omega, stiffness) = (0.01, 4.0 * TAU, 1e6);
    let of = |capacity: &str| {
        format!(
            "[time]\nrate_hz = 1000\nduration_s = 0.5\nclock = \"simulated\"\n[[excitation.prescribed_displacement]]\n\
             specimen = \"s\"\nsignal.sine = {{ amplitude = {amplitude}, frequency_hz = 4 }}\n[[specimen]]\nname = \"s\"\n\
             law.linear = {{ stiffness_n_per_m = {stiffness} }}\n{capacity}\n"
        )
    };
    for (key, need) in [
        ("stroke_m", amplitude),
        ("velocity_m_per_s", amplitude * omega),
        ("force_n", stiffness * amplitude),
        ("power_w", stiffness * amplitude * amplitude * omega / 2.0),
    ] {
        let with = |share: f64| of(&format!("capacity.{key} = {}", share * need));
        let enough = check(folder.path(), &with(1.05), &["--json"]);
        assert_eq!(enough.code, Some(0), "{key}: {}", enough.stderr);
        let found: Value = serde_json::from_str(&enough.stdout).unwrap();
        let used = &found["rehearsal"]["specimens"][0]["capacity"][0][0];
        assert_eq!(used["key"], key, "{found:#}");
        let share = used["share"].as_f64().unwrap();
        assert!((share - 1.0 / 1.05).abs() < 0.02, "{key}: {share}");
        let scarce = check(folder.path(), &with(0.95), &[]);
        assert_eq!(scarce.code, Some(1), "{key}: {}", scarce.stderr);
        for words in ["its rig", &format!("capacity.{key} = ")] {
            assert!(scarce.stderr.contains(words), "{key}: {}", scarce.stderr);
        }
        let table = &scarce.stdout;
        assert!(
            table.contains("NOT POSSIBLE") && table.contains("TOO MUCH"),
            "{table}"
        );
        short_page_shows(folder.path(), &["NOT POSSIBLE", key, "TOO MUCH"]);
    }
    // Without a declaration there is no message.
    let said = check(folder.path(), &of(""), &[]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(!said.stdout.contains("of the rig"), "{}", said.stdout);
}

/// Quantities that only the loop computes are tried with every limit: check and run agree.
#[test]
fn loop_only_limits_are_tried() {
    let folder = tempfile::tempdir().unwrap();
    let actuator = format!("{FRAME}[specimen.transfer]\ndelay_s = 0.002\n");
    for (limit, place) in [
        ("following_error_m = { trip = 1e-6 }", "following_error_m"),
        ("added_energy_j = { trip = 1e-3 }", "added_energy_j"),
    ] {
        let text = format!("{actuator}[specimen.limits]\n{limit}\n");
        let said = check(folder.path(), &text, &[]);
        assert_eq!(said.code, Some(1), "{limit}: {}", said.stderr);
        assert!(said.stderr.contains("would stop"), "{}", said.stderr);
        assert!(said.stderr.contains(place), "{}", said.stderr);
    }
    let wide = "following_error_m = { trip = 1 }\nadded_energy_j = { trip = 1e9 }\n";
    let text = format!("{actuator}[specimen.limits]\n{wide}");
    let said = check(folder.path(), &text, &[]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    // This specimen has no stand-in: a limit that requires a force is no finding.
    let loaded = "measured_force_n = { trip = [1e3, 1e6] }\nfollowing_error_m = { trip = 1 }\n";
    let text = format!(
        "[time]\nrate_hz = 1000\nduration_s = 0.1\n[[excitation.prescribed_displacement]]\nspecimen = \"s\"\n\
         signal.sine = {{ amplitude = 0.01, frequency_hz = 1 }}\n[safety]\nunlimited = \"none is known\"\n\
         [[specimen]]\nname = \"s\"\nstiffness_n_per_m = 0\n[specimen.link]\naddress = \"127.0.0.1:9\"\n\
         probe = \"none\"\n[specimen.limits]\n{loaded}"
    );
    let said = check(folder.path(), &text, &[]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
}

#[test]
fn late_dead_sensor_detection_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    for (travel, told) in [(500.0, true), (1e-4, false)] {
        let limits = format!("stuck_ticks = {{ trip = 10 }}\nstuck_travel_m = {travel}\n");
        let said = check(
            folder.path(),
            &format!("{FRAME}[specimen.limits]\n{limits}"),
            &[],
        );
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        assert_eq!(said.stderr.contains("500 m"), told, "{}", said.stderr);
    }
    // Two cycles of 20 mm go 80 mm, though they reach over 20 only.
    for (travel, told) in [(0.05, false), (0.12, true)] {
        let text = format!(
            "[time]\nrate_hz = 1000\nduration_s = 2\nclock = \"simulated\"\n[[excitation.prescribed_displacement]]\n\
             specimen = \"s\"\nsignal.sine = {{ amplitude = 0.01, frequency_hz = 1 }}\n[[specimen]]\nname = \"s\"\n\
             law.linear = {{ stiffness_n_per_m = 1e6 }}\n\
             limits = {{ stuck_ticks = {{ trip = 10 }}, stuck_travel_m = {travel} }}\n"
        );
        let said = check(folder.path(), &text, &[]);
        let words = " noticed ";
        assert_eq!(said.stderr.contains(words), told, "{}", said.stderr);
    }
}

#[test]
fn test_that_would_stop_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("{FRAME}[safety]\ndivergence_m = 1e-4\n");
    let said = check(folder.path(), &text, &[]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    for words in ["divergence_m = 1e-4", "would stop", "diverged"] {
        assert!(said.stderr.contains(words), "{words}: {}", said.stderr);
    }
}

#[test]
fn runaway_without_a_bound_is_refused() {
    // λ = ∞ at Ω = 2.5: the sawtooth of a mode grows fourfold with every step.
    let text = "[time]\nstep_s = 0.1\nduration_s = 5\nclock = \"simulated\"\n[integrator]\nlambda = inf\n\
                [structure.shear_building]\nmass_kg = [1000]\nstiffness_n_per_m = [3.25e5]\n\
                [excitation.ground_acceleration.signal.sine]\namplitude = 1\nfrequency_hz = 1\n\
                [[specimen]]\nname = \"s\"\nstorey = 1\nlaw.linear = { stiffness_n_per_m = 3e5 }\n";
    let folder = tempfile::tempdir().unwrap();
    let said = check(folder.path(), text, &[]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    for words in ["would stop", "diverged"] {
        assert!(said.stderr.contains(words), "{words}: {}", said.stderr);
    }
}

/// `check` reports the time of a tick, and warns if it leaves little time on the real clock.
#[test]
fn slow_machine_gives_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let text = FRAME.with("time.duration_s = 5");
    let warned = |text: &str, tick_s: f64| {
        let test = write(folder.path(), "test.toml", text);
        let loaded = gusset_config::load(&test, &[]).unwrap();
        let built = gusset_setup::build(&loaded).unwrap();
        let mut found = rehearse(&loaded, Some(built.experiment), &mut Budget::default()).unwrap();
        let measured = found.tick_s.unwrap();
        assert!(
            measured > 0.0 && 500.0 * measured < found.wall_s,
            "{measured}"
        );
        found.tick_s = Some(tick_s);
        let findings = found.findings(&loaded);
        let texts: Vec<_> = findings.into_iter().map(|found| found.headline).collect();
        texts.join("; ")
    };
    let real = text.with("time.clock = 'real'");
    // A tick has 5 ms.
    assert_eq!(warned(&real, 2.4e-3), "");
    let little = warned(&real, 2.6e-3);
    assert!(
        little.contains("little time") && little.contains("2.6 ms"),
        "{little}"
    );
    let cannot = warned(&real, 5.1e-3);
    assert!(
        cannot.contains("cannot keep") && cannot.contains("5 ms"),
        "{cannot}"
    );
    assert_eq!(warned(&text, 5.1e-3), "");
    let scaled = real.with("time.scale = 2");
    assert_eq!(warned(&scaled, 4.9e-3), "");
}

#[test]
fn impossible_stand_in_is_refused() {
    let refused = |text: &str, words: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let said = check(folder.path(), text, &[]);
        assert_eq!(said.code, Some(2), "{}", said.stderr);
        for words in words {
            assert!(said.stderr.contains(words), "{words}: {}", said.stderr);
        }
    };
    refused(
        &format!("{FRAME}[specimen.stand_in.law.linear]\nstiffness_n_per_m = 1e5\n"),
        &["`specimen[0].stand_in` was removed", "`link`"],
    );
    refused(
        &behind_a_link("law.linear = { stiffness_n_per_m = -1e5 }\n"),
        &["stiffness_n_per_m = -1e5"],
    );
    refused(
        &behind_a_link("stand_in.lore.linear = { stiffness_n_per_m = 1e5 }\n"),
        &["`specimen[0].stand_in` was removed", "`coupled`"],
    );
}

#[test]
fn our_own_virtual_laboratory_is_possible() {
    let test = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/faults/laboratory.toml");
    let said = say(["check".as_ref(), test.as_os_str(), "--verbose".as_ref()]);
    assert_eq!(said.code, Some(0), "{}{}", said.stdout, said.stderr);
}
