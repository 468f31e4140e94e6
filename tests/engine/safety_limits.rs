//! Which limits exist, who checks them and the effect of a trip: a specimen behind a link needs some, both ends keep them, and
//! `gusset check` and the run folder show them.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::common::engine::run_on;
use crate::common::test_file::TestFile;
use crate::link_common::{
    Fake, ONE_AXIS, ONE_AXIS_LAW, Served, finish, gateway, gusset, linked, run, summary, test_file,
    write,
};
use gusset_config as config;
use gusset_control::engine::{Ending, Stop};
use gusset_control::port::limits::{AxisLimits, Bound};
use gusset_quantity::catalog::limit::{Kind, Limit, Scope};
use gusset_quantity::substructure::Status;
use gusset_quantity::time::{Clock, Nanos, SimClock};
use gusset_record::Event;
use gusset_wire::handshake::Limits;

const LIMITS: &str = "[specimen.limits]\ncommand_disp_m = { trip = [-0.5, 0.5] }\nmeasured_force_n = { trip = [-1e6, 1e6] }\n";

fn complaint(text: &str) -> String {
    match config::parse(Path::new("test.toml"), text.to_owned(), &[]) {
        Ok(_) => panic!("accepted"),
        Err(error) => error.to_string(),
    }
}

fn bare(address: &str, keys: &str) -> String {
    linked(200, address, keys).without("safety.unlimited")
}

#[test]
fn missing_limits_are_refused_with_template() {
    let text = bare("127.0.0.1:1", "");
    let said = complaint(&text);
    assert!(
        said.contains("`command_disp_m`, `measured_force_n`"),
        "{said}"
    );
    let table: String = said
        .lines()
        .map(str::trim)
        .filter(|line| line.starts_with("[specimen.limits]") || line.contains(" = { trip = "))
        .map(|line| format!("{line}\n"))
        .collect();
    let pasted = text.with(&table);
    assert!(
        config::parse(Path::new("test.toml"), pasted.clone(), &[]).is_ok(),
        "{pasted}"
    );
    let half = pasted.without("specimen.0.limits.measured_force_n");
    assert!(complaint(&half).contains("`measured_force_n`"));
    let warned = pasted.without("specimen.0.limits.command_disp_m");
    let warned = warned.with("specimen.limits.command_disp_m.warn = [-1, 1]");
    assert!(
        complaint(&warned).contains("`command_disp_m`"),
        "a warning holds nothing"
    );
    let silent = text.with("safety.unlimited = ' '");
    assert!(complaint(&silent).contains("no reason"));
    // A reason of invisible characters shows nothing to a person.
    for blank in ["\\u2800", "\\u00a0\\u2800"] {
        let silent = text.with(&format!("safety.unlimited = \"{blank}\""));
        assert!(complaint(&silent).contains("no reason"), "{blank}");
    }
    // A gateway, too: OpenSees has no limits.
    let folder = tempfile::tempdir().unwrap();
    let between = gateway("127.0.0.1:1", "stiffness_n_per_m = 4e5\n", "");
    let between = between.without("safety.unlimited");
    let path = write(folder.path(), "gateway.toml", &between);
    let said = gusset_setup::load_served(&path, None)
        .unwrap_err()
        .to_string();
    assert!(said.contains("trip level"), "{said}");
}

#[test]
fn reason_for_no_limits_is_in_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let local = test_file(200, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    let served = Served::start(folder, &local, &[]);
    let text = bare(&served.address, "").with("safety.unlimited = 'only a formula'");
    let (code, said) = run(folder, "run", &text);
    assert_eq!(code, 0, "{said}");
    assert!(
        said.contains("UNLIMITED") && said.contains("a formula"),
        "{said}"
    );
    let summary = summary(folder, "run");
    assert!(
        summary
            .warnings
            .iter()
            .any(|text| text.contains("a formula"))
    );
    let unlimited = summary.limits.unwrap().unlimited;
    assert_eq!(unlimited.as_deref(), Some("only a formula"));
    let resolved = std::fs::read_to_string(folder.join("run/resolved.toml")).unwrap();
    assert!(resolved.contains("unlimited = \"only a formula\""));
}

#[test]
fn contradicting_limits_show_both_places() {
    let with = |limits: &str, safety: &str, table: &str| {
        let keys = format!("[safety]\n{safety}\n[specimen]\n{table}{LIMITS}{limits}");
        complaint(&bare("127.0.0.1:1", "").with(&keys))
    };
    for (limits, safety, table, words) in [
        (
            "command_vel_m_per_s = { trip = 0.5 }\ncommand_step_m = { trip = 0.001 }",
            "",
            "",
            &["`command_step_m`", "trips first"][..],
        ),
        (
            "sensor_force_n = { trip = [-2e6, 9e5] }",
            "",
            "",
            &["`measured_force_n` is -1000000"],
        ),
        (
            "command_vel_m_per_s = { trip = 0.05 }",
            "on_trip = \"zero_force\"\nexit_speed_m_per_s = 0.1",
            "",
            &["0.1 m/s", "0.05 m/s"],
        ),
        (
            "command_step_m = { trip = 0.001 }",
            "on_trip = \"zero_force\"\nexit_speed_m_per_s = 100",
            "",
            &["100 m/s", "0.001 m"],
        ),
        ("", "", "safe_disp_m = [0.6]\n", &["axis 1", "0.6 m"]),
        (
            "stiffness_ratio = { warn = 1.3, trip = 1.2 }",
            "",
            "",
            &["`stiffness_ratio` warns at 1.3"],
        ),
        (
            "alternating_ticks = { trip = 2.7 }",
            "",
            "",
            &["`alternating_ticks` is 2.7"],
        ),
        (
            "",
            "step_audit = { trip = 0 }",
            "",
            &["`step_audit`", "greater than 0"],
        ),
    ] {
        let said = with(limits, safety, table);
        for words in words {
            assert!(said.contains(words), "{words:?} is not in {said}");
        }
        assert!(said.contains("--> test.toml:"), "{said}");
    }
    // An equal bound in other units contradicts nothing.
    let same = "command_vel_m_per_s = { trip = 1.0 }\ncommand_step_m = { trip = 0.001 }\n";
    let text = bare("127.0.0.1:1", "").with(&format!("{LIMITS}{same}"));
    assert!(config::parse(Path::new("test.toml"), text, &[]).is_ok());
}

#[test]
fn both_ends_know_the_others_limits() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let local = test_file(
        200,
        &format!(
            "{ONE_AXIS}[specimen.limits]\ncommand_disp_m = {{ trip = [-0.02, 0.02] }}\n{ONE_AXIS_LAW}"
        ),
    );
    let served = Served::start(folder, &local, &[]);
    // Wider: refused.
    let wide = bare(&served.address, "").with(LIMITS);
    let (code, said) = run(folder, "wide", &wide);
    assert_eq!(code, 3, "{said}");
    let reason = summary(folder, "wide").reason;
    assert!(reason.contains("-0.5 m"), "{reason}");
    assert!(reason.contains("was moved"), "{reason}");
    // Without limits of the test, the specimen's end keeps its own, and the test reports them.
    let (_, said) = run(folder, "none", &linked(200, &served.address, ""));
    let words = "\"axis 1\": displacement from -0.02 m";
    assert!(said.contains(words), "{said}");
    let reason = summary(folder, "none").reason;
    assert!(
        reason.contains("command_disp_m"),
        "its end has tripped: {reason}"
    );
    // Within: both keep it, and ours, which is narrower, trips first.
    let narrow = LIMITS.replace("0.5", "0.004");
    let narrow = bare(&served.address, "").with(&narrow);
    let (code, said) = run(folder, "narrow", &narrow);
    assert_eq!(code, 1, "{said}");
    let reason = summary(folder, "narrow").reason;
    assert!(
        reason.contains("commanded displacement") && reason.contains("allowed -4 mm"),
        "{reason}"
    );
    assert!(!reason.contains("interlock"), "{reason}");
}

/// A foreign end may accept limits that it will not keep.
#[test]
fn narrower_limits_at_the_end_are_refused() {
    type Change = fn(&mut Limits);
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let cases: [(Change, &str); 2] = [
        (
            |own| own.disp_max = 0.01,
            "axis \"axis 1\": largest displacement is 0.5 m here, beyond 0.01 m there (narrow [specimen.limits]",
        ),
        (
            |own| own.force_max = 5e3,
            "axis \"axis 1\": largest force is 1000000 N here, beyond 5000 N there",
        ),
    ];
    for (number, (change, words)) in cases.into_iter().enumerate() {
        for through in ["", "a gateway"] {
            let armed = Arc::new(AtomicBool::new(false));
            let is_armed = Arc::clone(&armed);
            let address = Fake::start_welcoming(
                move |welcome| change(&mut welcome.axes[0].limits),
                move |_| is_armed.store(true, Ordering::Relaxed),
            );
            let table = format!("stiffness_n_per_m = 4e5\n{LIMITS}");
            let file = gateway(&address, &table, "").without("safety.unlimited");
            let between = (!through.is_empty()).then(|| Served::start(folder, &file, &[]));
            let address = between
                .as_ref()
                .map_or(&address, |between| &between.address);
            let text = bare(address, "").with(LIMITS);
            let name = format!("narrow-{number}{}", through.len());
            let (code, said) = run(folder, &name, &text);
            assert_eq!(code, 3, "{said}");
            let reason = summary(folder, &name).reason;
            assert!(reason.contains(words), "{reason}");
            let unmoved = reason.ends_with("was moved") || between.is_some();
            assert!(unmoved && !armed.load(Ordering::Relaxed), "{reason}");
        }
    }
}

#[test]
fn check_shows_limits_and_their_effects() {
    let folder = tempfile::tempdir().unwrap();
    let more = "following_error_m = { warn = 0.001, trip = 0.002 }\nfollowing_time_s = 0.03\n\
                stuck_ticks = { trip = 20 }\nstuck_travel_m = 1e-4\nalternating_ticks = { trip = 9 }\n";
    let keys = "time.clock = 'real'\ntiming.misses.window_s = 7\n[safety]\nat_end = \"safe_displacement\"\nexit_speed_m_per_s = 0.004\nconfirm = true\nramp_s = 3\n\
                  ease_s = 0.75\nzero_s = 0.25\n[specimen]\nsafe_disp_m = [0.0125]\n";
    let text = bare("127.0.0.1:1", "watchdog_s = 0.5").with(&format!("{keys}{LIMITS}{more}"));
    let file = write(folder.path(), "test.toml", &text);
    let said = |json: bool| {
        let mut command = gusset();
        command.args(["check", "--verbose"]).arg(&file);
        if json {
            command.arg("--json");
        }
        String::from_utf8(finish(command).stdout).unwrap()
    };
    let table = said(false);
    for words in [
        "command_disp_m *",
        "trips -0.5 to 0.5",
        "following_error_m",
        "warns 0.001",
        "its server",
        "max_misses_in_window",
        "step_audit",
        "stability_used",
        "emergency stop",
        "last command",
        // How a bound is checked, the reaction of the other end, and the start and end of the test.
        "30 ms",
        "100 µm",
        "in 7 s",
        "500 ms",
        "wiring check",
        "0.004 m/s",
        "  12.5 mm\n",
        "250 ms",
        "ramp of 3 s",
        "0.75 s",
    ] {
        assert!(table.contains(words), "{words:?} is not in {table}");
    }
    let facts: serde_json::Value = serde_json::from_str(&said(true)).unwrap();
    let axis = &facts["limits"]["specimens"][0]["axes"][0];
    assert_eq!(axis[0]["key"], "command_disp_m");
    assert_eq!(axis[0]["trip"], serde_json::json!([-0.5, 0.5]));
    assert_eq!(axis[0]["also_at_the_specimen"], true);
    assert_eq!(axis[2]["key"], "following_error_m");
    assert_eq!(axis[2]["also_at_the_specimen"], false);
    assert_eq!(axis[2]["judged"], "at rest; in motion 30 ms of it more");
    let specimen = &facts["limits"]["specimens"][0];
    assert!(specimen["watchdog"].as_str().unwrap().contains("500 ms"));
    assert_eq!(specimen["safe_disp_m"][0], 0.0125);
    for (key, words) in [
        ("at_end", "safe_disp_m"),
        ("on_trip", "last command"),
        ("way_in", "ramp of 3 s"),
        ("on_miss", "whole ticks"),
    ] {
        let text = facts["limits"][key].as_str().unwrap();
        assert!(text.contains(words), "{key}: {text}");
    }
}

/// What `gusset check --json` says of the limits of a simulated specimen that has all of an axis but one.
fn limits_but(missing: Limit) -> serde_json::Value {
    let limits = Limit::OF_AXIS.into_iter().filter(|limit| *limit != missing);
    let limits = limits.map(|limit| match limit.row().kind {
        Kind::Range => format!("{} = {{ trip = [-1e3, 1e3] }}\n", limit.key()),
        Kind::Size => format!("{} = {{ warn = 10.0, trip = 20.0 }}\n", limit.key()),
        Kind::Count => format!("{} = {{ warn = 10, trip = 20 }}\n", limit.key()),
    });
    let limits = limits.collect::<String>();
    let text = format!(
        "[time]\nstep_s = 0.01\nduration_s = 1\n[safety]\nadded_energy_share = {{ trip = 0.1, floor_j = 1.0 }}\n\
         [structure.shear_building]\nmass_kg = [1000, 0, 10]\nstiffness_n_per_m = [0, 1e5, 1e5]\n\
         [excitation.ground_acceleration.signal.sine]\nfrequency_hz = 0.5\namplitude = 3.0\n\
         [integrator]\nlambda = 4\n[[specimen]]\nname = \"column\"\nstorey = 1\n[specimen.limits]\n{limits}\
         [specimen.transfer]\ndelay_s = 0.001\n\
         [specimen.law.linear]\nstiffness_n_per_m = 4e5\ndamping_n_s_per_m = 100\n"
    );
    let folder = tempfile::tempdir().unwrap();
    let file = write(folder.path(), "test.toml", &text);
    let mut command = gusset();
    command.args(["check", "--json"]).arg(&file);
    let said = finish(command);
    let errors = String::from_utf8_lossy(&said.stderr);
    let mut facts: serde_json::Value = serde_json::from_slice(&said.stdout).expect(&errors);
    facts["limits"].take()
}

#[test]
fn check_lists_every_limit_key_and_unit() {
    // A file may limit the change of a command in a tick or its velocity, not both.
    let facts = [Limit::CommandStep, Limit::CommandVel].map(limits_but);
    for limit in Limit::OF_AXIS.into_iter().chain(Limit::OF_TEST) {
        let limits = &facts[usize::from(limit == Limit::CommandStep)];
        let list = match limit.scope() {
            Scope::Axis => &limits["specimens"][0]["axes"][0],
            Scope::Test => &limits["test"],
        };
        let found = list.as_array().unwrap().iter();
        let found: Vec<_> = found.filter(|one| one["key"] == limit.key()).collect();
        assert_eq!(found.len(), 1, "{limit:?}: {list}");
        assert_eq!(found[0]["unit"], limit.unit());
        let trips = found[0]["trip"].as_array().unwrap().len();
        let wanted = match limit {
            // Their defaults only warn.
            Limit::StabilityUsed | Limit::DelayUsed => 0,
            limit if limit.is_range() => 2,
            _ => 1,
        };
        assert_eq!(trips, wanted, "{limit:?}");
    }
}

/// Two floors of 1000 kg at ten steps a second, so that λ has a limit; a spring at the first storey.
fn at_limit(lambda: f64, limits: &str) -> String {
    format!(
        "[time]\nstep_s = 0.1\nduration_s = 200\nclock = \"simulated\"\n[structure.shear_building]\n\
         mass_kg = [1000, 1000]\nstiffness_n_per_m = [0, 1e5]\n\
         [excitation.ground_acceleration.signal.sine]\nfrequency_hz = 0.5\namplitude = 3.0\n\
         [integrator]\nlambda = {lambda}\n[[specimen]]\nname = \"column\"\nstorey = 1\n{limits}\n\
         [specimen.law.linear]\nstiffness_n_per_m = 4e5\n"
    )
}

/// 4Ω²/(Ω² − 4) of the second mode (Gui et al. 2014, equation (33)): ω² from (5e5 − 1e3 ω²)(1e5 − 1e3 ω²) = 1e10.
fn limit() -> f64 {
    let half = 300.0f64;
    let square = (half + (half * half - 4e4).sqrt()) * 0.01;
    4.0 * square / (square - 4.0)
}

#[test]
fn sawtooth_trips_while_it_is_small() {
    let limits = "[specimen.limits]\nalternating_ticks = { warn = 6, trip = 12 }";
    let stable = crate::common::engine::run(&at_limit(0.9 * limit(), limits));
    assert_eq!(stable.outcome.ending, Ending::Completed);
    let unstable = crate::common::engine::run(&at_limit(1.2 * limit(), limits));
    let Ending::Stopped(Stop::Limit { hit, .. }) = unstable.outcome.ending else {
        panic!("{:?}", unstable.outcome.ending);
    };
    assert_eq!(hit.quantity.key(), "alternating_ticks");
    assert_eq!(hit.value, 13.0);
    let free = crate::common::engine::run(&at_limit(1.2 * limit(), ""));
    let largest = |column: &[f64]| column.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let (at_trip, at_end) = (largest(&unstable.column("x1")), largest(&free.column("x1")));
    assert!(1e3 * at_trip < at_end, "{at_trip} {at_end}");
    // The audit closes all the same: an unstable step is made as it should be.
    let audit = largest(&free.column("step_audit"));
    assert!(audit < 1e-11, "{audit}");
    let tangent = stable.column("kt_1_1");
    assert!(
        tangent.iter().all(|k| (k / 4e5 - 1.0).abs() < 1e-6),
        "a spring"
    );
    // The bound is the spring itself: only roundoff of the estimate is beyond it.
    assert!(largest(&stable.column("stability_used")) < 1e-9);
}

#[test]
fn stiffer_specimen_is_measured_and_trips() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let stiff = "[specimen.law.linear]\nstiffness_n_per_m = 6e5\n";
    let served = Served::start(folder, &test_file(200, &format!("{ONE_AXIS}{stiff}")), &[]);
    let with = |ratio: &str| {
        let limits = format!("{LIMITS}stiffness_ratio = {{ warn = 1.1, trip = {ratio} }}\n");
        bare(&served.address, "").with(&limits)
    };
    let (code, said) = run(folder, "trips", &with("1.49"));
    assert_eq!(code, 1, "{said}");
    let reason = summary(folder, "trips").reason;
    assert!(reason.contains("bound 1.5"), "{reason}");
    let (code, said) = run(folder, "passes", &with("1.51"));
    assert_eq!(code, 0, "{said}");
    let events = crate::link_common::events(folder, "passes");
    assert_eq!(
        events
            .iter()
            .filter(|event| *event == "limit_warning")
            .count(),
        1
    );
    let run = gusset_record::Run::open(&folder.join("passes")).unwrap();
    let columns = run.columns(&["kt_1_1", "stability_used", "state"]).unwrap();
    let (tangent, used) = (columns[0].last().unwrap(), columns[1].last().unwrap());
    assert!((tangent / 6e5 - 1.0).abs() < 1e-9, "{tangent}");
    // S = 4 M + (4/λ) Δt² K0 − Δt² K_max with all of K at its bound, by hand: Δt = 1 ms, λ = 11.5.
    let (c, k1, k2) = ((4.0 / 11.5 - 1.0) * 1e-6, 4e5, 1e5);
    let s = [[4e3 + c * (k1 + k2), -c * k2], [-c * k2, 4e3 + c * k2]];
    // Rayleigh damping is the same in C0 and C_max. b = (1, 0).
    let gain = s[1][1] / (s[0][0] * s[1][1] - s[0][1] * s[1][0]);
    let expected = 1e-6 * 2e5 * gain;
    assert!((used / expected - 1.0).abs() < 1e-6, "{used} {expected}");
}

/// A simulated clock that oversleeps two ticks at every n-th edge.
struct Late {
    clock: SimClock,
    waits: Arc<AtomicU64>,
    every: u64,
}

impl Clock for Late {
    fn now(&self) -> Nanos {
        self.clock.now()
    }

    fn sleep_until(&self, at: Nanos) {
        self.clock.sleep_until(at);
        if self.waits.fetch_add(1, Ordering::Relaxed) % self.every == self.every - 1 {
            self.clock.advance(2_100_000);
        }
    }
}

#[test]
fn misses_in_a_window_end_the_test() {
    let late = |every: u64| {
        let text = test_file(2000, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"))
            .with("timing.misses = { in_total.trip = 1000, in_window.trip = 9, window_s = 0.1 }");
        let clock = Late {
            clock: SimClock::new(),
            waits: Arc::default(),
            every,
        };
        run_on(crate::common::engine::prepare(&text).experiment, clock)
    };
    // Every tenth tick of 1 ms: ten in a window of 100.
    let often = late(10);
    let Ending::Stopped(Stop::TestLimit(hit)) = often.outcome.ending else {
        panic!("{:?}", often.outcome.ending);
    };
    assert_eq!((hit.quantity, hit.value), (Limit::MissesInWindow, 10.0));
    let warned = often.events.iter().filter(|event| {
        matches!(
            &event.kind,
            Event::LimitWarning(reached) if reached.limit == "max_misses_in_window"
        )
    });
    assert_eq!(warned.count(), 1, "beyond half of it");
    // Every twelfth: nine at the most.
    assert_eq!(late(12).outcome.ending, Ending::Completed);
}

#[test]
fn refused_displacement_is_no_peak() {
    let folder = tempfile::tempdir().unwrap();
    // Driven into a trip of the command at 20 mm, in steps of several mm.
    let text = "[time]\nstep_s = 0.05\nduration_s = 5\nclock = \"simulated\"\n[structure.shear_building]\nmass_kg = [1e3]\n\
        stiffness_n_per_m = [0]\n[excitation.ground_acceleration]\n\
        signal.sine = { amplitude = 3, frequency_hz = 0.5 }\n[[specimen]]\nname = \"s\"\nstorey = 1\n\
        law.linear = { stiffness_n_per_m = 1e5 }\nlimits = { command_disp_m = { trip = [-0.02, 0.02] } }\n";
    let (code, said) = run(folder.path(), "run", text);
    assert_eq!(code, 1, "{said}");
    let rows = gusset_record::Run::open(&folder.path().join("run")).unwrap();
    let rows = &rows.columns(&["x1"]).unwrap()[0];
    let largest = rows.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let peak = summary(folder.path(), "run").peak.displacement[0];
    assert_eq!(
        peak,
        Some(largest),
        "the command that was refused never was"
    );
}

#[test]
fn check_shows_limits_announced_differently() {
    let folder = tempfile::tempdir().unwrap();
    let limits = "[specimen.limits]\ncommand_disp_m = { trip = [-0.5, 0.5] }\ncommand_step_m = { trip = 0.01 }\n\
                  measured_force_n = { trip = [-1e5, 1e6] }\n";
    let text = bare("127.0.0.1:1", "").with(limits);
    let file = write(folder.path(), "test.toml", &text);
    let mut command = gusset();
    command.args(["check", "--verbose"]).arg(&file);
    let said = String::from_utf8(finish(command).stdout).unwrap();
    for (key, words) in [
        ("command_step_m *", "a speed"),
        ("measured_force_n *", "1 MN"),
    ] {
        let mut lines = said.lines();
        let line = lines.find(|line| line.contains(key)).unwrap_or_default();
        assert!(line.contains(words), "{said}");
    }
    assert!(!said.contains("command_disp_m * announced"));
}

/// Two jacks of one specimen that lag behind their commands: the first trips, and its remaining motion to its last command loads
/// the second, which is at rest.
const COUPLED: &str = "[time]\nrate_hz = 200\nduration_s = 2\nclock = \"simulated\"\n[safety]\nzero_s = 0.1\n\
    on_trip = \"zero_displacement\"\nexit_speed_m_per_s = 0.05\n[[excitation.prescribed_displacement]]\nspecimen = \"a\"\naxis = 1\n\
    signal.sine = { amplitude = 0.02, frequency_hz = 1 }\n[[specimen]]\nname = \"a\"\n\
    coupled = { stiffness_n_per_m = [[2e6, 1e6], [1e6, 2e6]] }\n\
    transfer = { actuator = { first_order = { time_constant_s = 0.05 } } }\n\
    [[specimen.axis]]\nlimits.measured_force_n = { trip = [-20e3, 20e3] }\n\
    [[specimen.axis]]\nlimits.measured_force_n = { trip = [-11e3, 11e3] }\n";

/// A specimen that lags, moves less from tick to tick than the noise of its sensor, and reaches its second limit after the first.
fn noisy(seed: u32) -> String {
    format!(
        "[time]\nrate_hz = 4096\nduration_s = 2\nclock = \"simulated\"\n[safety]\nzero_s = 0.1\non_trip = \"zero_displacement\"\n\
         exit_speed_m_per_s = 0.02\n[[excitation.prescribed_displacement]]\nspecimen = \"a\"\nease_in_s = 0.2\n\
         signal.sine = {{ amplitude = 0.02, frequency_hz = 0.3 }}\n[[specimen]]\nname = \"a\"\n\
         law.linear = {{ stiffness_n_per_m = 2e6 }}\n[specimen.transfer]\nseed = {seed}\n\
         actuator = {{ first_order = {{ time_constant_s = 0.03 }} }}\ndisp_sensor = {{ noise_rms_m = 1e-5 }}\n[specimen.limits]\n\
         measured_disp_m = {{ trip = [-0.010, 0.010] }}\nmeasured_force_n = {{ trip = [-20.5e3, 20.5e3] }}\n"
    )
}

#[test]
fn late_actuator_motion_keeps_the_shutdown() {
    let texts = (0..6).map(noisy);
    for text in texts.chain([COUPLED.to_owned()]) {
        let folder = tempfile::tempdir().unwrap();
        let (code, said) = run(folder.path(), "run", &text);
        assert_eq!(code, 1, "{said}");
        let found = summary(folder.path(), "run");
        assert_eq!(found.left["a"], "reached", "{said}");
        let found = gusset_session::replay(&folder.path().join("run")).unwrap();
        assert!(found.is_exact(), "{found:?}");
    }
}

/// Limit, port, axis and tick of every warning or trip of a specimen that was reported.
fn told(run: &crate::common::engine::Run, wanted: bool) -> Vec<(&str, u32, u32, u64)> {
    let hits = run.events.iter().filter_map(|event| {
        let reached = match &event.kind {
            Event::LimitTrip(reached) if wanted => reached,
            Event::LimitWarning(reached) if !wanted => reached,
            _ => return None,
        };
        let is_of_axis = !reached.is_of_test();
        let place = reached.port.zip(reached.axis).filter(|_| is_of_axis);
        place.map(|(port, axis)| (reached.limit.as_ref(), port, axis, event.tick))
    });
    hits.collect()
}

/// A sine of 12 mm, prescribed to each of these.
fn prescribed(specimens: &str, axes: &[(&str, u32)]) -> String {
    let signal = |(name, axis): &(&str, u32)| {
        format!(
            "[[excitation.prescribed_displacement]]\nspecimen = \"{name}\"\naxis = {axis}\nsignal.sine = {{ frequency_hz = 1, \
             amplitude = 12, unit = \"mm\" }}\n"
        )
    };
    let signals: String = axes.iter().map(signal).collect();
    format!("[time]\nrate_hz = 100\nduration_s = 2\nclock = \"simulated\"\n{signals}{specimens}")
}

#[test]
fn two_tripping_commands_are_both_reported() {
    let specimen = |name: &str| {
        format!(
            "[[specimen]]\nname = \"{name}\"\nlaw.linear = {{ stiffness_n_per_m = 1e6 }}\nlimits.command_disp_m = {{ trip = \
             [-0.01, 0.01] }}\n"
        )
    };
    let specimens = specimen("p") + &specimen("q");
    let run = crate::common::engine::run(&prescribed(&specimens, &[("p", 1), ("q", 1)]));
    let Ending::Stopped(Stop::Limit { port, hit }) = run.outcome.ending else {
        panic!("{:?}", run.outcome.ending);
    };
    assert_eq!((port, hit.quantity.key()), (0, "command_disp_m"));
    let trips = told(&run, true);
    let at = trips[0].3;
    assert_eq!(
        trips,
        [("command_disp_m", 0, 0, at), ("command_disp_m", 1, 0, at)]
    );
    for column in ["cmd_1_1", "cmd_2_1"] {
        assert!(run.all(column).iter().all(|disp| disp.abs() <= 0.01));
    }
}

#[test]
fn warnings_of_two_axes_are_both_reported() {
    let specimen = "[[specimen]]\nname = \"p\"\nlaws = [ { linear = { stiffness_n_per_m = 1e6 } }, { linear = { stiffness_n_per_m = 1e6 \
                    } } ]\nlimits.command_disp_m = { warn = [-0.0119, 0.0119], trip = [-0.02, 0.02] }\n";
    let run = crate::common::engine::run(&prescribed(specimen, &[("p", 1), ("p", 2)]));
    assert_eq!(run.outcome.ending, Ending::Completed);
    let warnings = told(&run, false);
    // Twice each way.
    assert_eq!(warnings.len(), 8, "{warnings:?}");
    for both in warnings.chunks(2) {
        assert_eq!((both[0].2, both[1].2), (0, 1));
        assert_eq!(both[0].3, both[1].3, "in one tick");
    }
}

#[test]
fn force_trip_shows_the_specimens_report() {
    use crate::common::rig::{Act, Log, Phase, attach_storey, two_floors};
    let port = 0;
    for (status, stop) in [
        (Status::SATURATED, Stop::Saturated { port }),
        (Status::INTERLOCK, Stop::Interlock { port }),
    ] {
        let mut experiment = two_floors(40, "timing.warmup_ticks = 0");
        let coupling = gusset_quantity::substructure::Coupling::Lockstep;
        let script = move |phase, sequence| match sequence {
            30 if phase == Phase::Collect => Act::Says(status),
            _ => Act::Serve,
        };
        attach_storey(&mut experiment, coupling, &Log::default(), script);
        let limits = AxisLimits::NONE.with(Limit::ForceStep, Bound::trip(1e3));
        experiment.ports[0].set_limits(1e-3, |_| (limits, (1.0, 1.0)));
        let run = run_on(experiment, SimClock::new());
        assert_eq!(run.outcome.ending, Ending::Stopped(stop));
        assert_eq!(told(&run, true), [("force_step_n", 0, 0, 30)]);
    }
}

/// Both trip at the first step with a known lag: by then the specimen has added more energy than ever before.
#[test]
fn all_trips_of_one_step_are_reported() {
    let with = |late: f64, added: f64| {
        let safety = format!(
            "[safety]\ndelay_used = {{ trip = {late:e} }}\nadded_energy_share = {{ trip = {added:e}, floor_j = 1e-9 }}\n\
             [structure.damping.rayleigh_ratio]\nratio = 0.05\nmodes = [1, 2]\n"
        );
        let faster = "time = { step_s = 0.01, duration_s = 2 }\nspecimen.transfer.delay_s = 0.005\n\
                      excitation.ground_acceleration.signal.sine.frequency_hz = 3.0\n";
        crate::common::engine::run(&at_limit(2.0, "").with(&format!("{faster}{safety}")))
    };
    let free = with(1e9, 1e9);
    let share = free.column("added_energy_share");
    let mut late = free.column("delay_used").into_iter();
    let at = late.position(|used| used > 0.1).unwrap();
    let before = share[..at].iter().fold(0.0, |m: f64, v| m.max(*v));
    assert!(share[at] > before, "{before} {}", share[at]);

    let run = with(0.1, 0.5 * (before + share[at]));
    let Ending::Stopped(Stop::TestLimit(hit)) = run.outcome.ending else {
        panic!("{:?}", run.outcome.ending);
    };
    assert_eq!(hit.quantity, Limit::DelayUsed);
    let trips = run.events.iter().filter_map(|event| match &event.kind {
        Event::LimitTrip(reached) if reached.is_of_test() => {
            Some((reached.limit.as_ref(), event.tick))
        }
        _ => None,
    });
    let at = at as u64;
    assert_eq!(
        trips.collect::<Vec<_>>(),
        [("delay_used", at), ("added_energy_share", at)]
    );
}
