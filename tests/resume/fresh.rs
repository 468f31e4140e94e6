//! A new test on a specimen that already carries a force, for example because it yielded in an earlier test.

use super::changed::Cell;
use super::rigs::built;
use super::*;

/// The events that report such a force.
fn told(run: &Path) -> Vec<(String, f64, f64)> {
    let events = Run::open(run).unwrap().events().unwrap().to_json();
    let told = events
        .iter()
        .filter(|event| event["event"] == "initial_force");
    told.map(|event| {
        let number = |key: &str| event[key].as_f64().unwrap();
        let of = event["of"].as_str().unwrap().to_owned();
        (of, number("force"), number("most"))
    })
    .collect()
}

#[test]
fn new_test_warns_of_a_yielded_specimen() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let law =
        "bilinear = { stiffness_n_per_m = 4e5, yield_force_n = 400.0, post_yield_ratio = 0.1 }";
    let serve = format!("[serve]\nremembers = true\n[[specimen]]\nname = \"column\"\nlaw.{law}\n");
    for (more, of) in [
        ("", "noise"),
        (
            "[specimen.limits]\nmeasured_force_n = { trip = [-5e3, 5e3] }\n",
            "measured_force_n",
        ),
        (&format!("[specimen.law]\n{law}\n"), "yield_force_n"),
    ] {
        let served = link_common::Served::start(home.path(), &serve, &[]);
        let text = link_common::linked(300, &served.address, "watchdog_s = 20\n") + more;
        let test = write(home.path(), "test.toml", &text);
        let [first, second] = ["first", "second"].map(|name| at(&format!("{name}-{of}")));
        completed(&test, &first, &[]);
        assert_eq!(told(&first), []);
        let said = common::run(&test, &second, &[]);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        let told = told(&second);
        assert_eq!((told.len(), told[0].0.as_str()), (1, of), "{told:?}");
        assert!(told[0].1.abs() > told[0].2, "{told:?}");
        let summary = common::json(&second, "summary.json");
        let warnings = summary["warnings"].as_array().unwrap();
        let sentence = warnings.iter().find_map(|warning| {
            let text = warning.as_str().unwrap();
            text.contains("carries a").then_some(text)
        });
        assert!(sentence.unwrap().contains("column"), "{warnings:?}");
        let logged = said.stderr.lines().find(|line| line.contains("carries a"));
        let reference = match of {
            "yield_force_n" => "yield force of its stand-in",
            "measured_force_n" => "`measured_force_n`",
            _ => "noise",
        };
        assert!(
            logged.is_some_and(|line| line.contains(reference)),
            "{logged:?}"
        );
        let page = std::fs::read_to_string(second.join("report.html")).unwrap();
        assert!(page.contains("carries a"));
    }
}

/// 1 % of a limit of 10 kN. A static load does not count, and neither does a force that the displacement explains.
#[test]
fn initial_force_warns_beyond_1_percent() {
    for (structure, extra, is_told) in [
        ("", 99.0, false),
        ("", 101.0, true),
        ("", -101.0, true),
        ("[structure]\nstatic_load_n = [2e3]\n", 99.0, false),
        ("[structure]\nstatic_load_n = [2e3]\n", 101.0, true),
        (
            "[structure]\ninitial_displacement_m = [1e-4]\n",
            90.0,
            false,
        ),
        (
            "[structure]\ninitial_displacement_m = [1e-4]\n",
            150.0,
            true,
        ),
    ] {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("run");
        let text = format!(
            "[time]\nrate_hz = 200\nduration_s = 0.1\nclock = \"simulated\"\n{structure}[structure.shear_building]\nmass_kg = [1000]\n\
             stiffness_n_per_m = [0]\n[excitation.ground_acceleration.signal.sine]\namplitude = 4\nfrequency_hz = 1.4\n\
             [timing]\nwarmup_ticks = 4\n[safety]\nunlimited = \"a spring\"\nzero_s = 0.05\nramp_s = 0.2\nease_s = 0\n\
             [[specimen]]\nname = \"cell\"\nstorey = 1\nstiffness_n_per_m = 3e5\n\
             limits.measured_force_n = {{ trip = [-1e4, 2e4] }}\nlink = {{ address = \"127.0.0.1:9\", \
             coupling = \"lockstep\", probe = \"none\" }}\n"
        );
        let mut test = built(&write(home.path(), "test.toml", &text));
        test.experiment.ports[0]
            .put_recording(Box::new(Cell::with(extra)))
            .unwrap();
        test.experiment.ports[0].startup_mut().set_computed(true);
        let folder = RunFolder::create(&out).unwrap();
        let (_says, requests) = crossbeam_channel::bounded(1);
        session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap();
        assert_eq!(
            !told(&out).is_empty(),
            is_told,
            "{structure} {extra}: {:?}",
            told(&out)
        );
    }
}
