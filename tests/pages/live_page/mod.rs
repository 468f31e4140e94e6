//! The live page from outside: viewers change nothing, however they behave; without a token a client neither sees nor moves
//! anything; the metrics for Prometheus are well formed.

mod exposition;
mod judged;
mod web;

use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::path::Path;

use crate::common::{FRAME, completed, json, names, run, same_physics, write};
use web::{Running, ask, call, keep_alive, until, watch};

/// The frame in real time, for this many seconds.
fn real(home: &Path, seconds: f64) -> std::path::PathBuf {
    let text = FRAME
        .replace("duration_s = 0.5", &format!("duration_s = {seconds:?}"))
        .replace("clock = \"simulated\"", "clock = \"real\"");
    write(home, "test.toml", &text)
}

#[test]
fn viewers_change_no_number_of_the_test() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let test = real(home, 4.0);
    let alone = home.join("alone");
    completed(&test, &alone, &["--clock", "simulated"]);
    let running = Running::start(home, "watched", &test, "127.0.0.1", &[]);
    let address = running.address.clone();
    // Requests everything and never reads a byte; connected to the end.
    let slow: Vec<_> = (0..2).map(|_| call(&address, "GET /stream", &[])).collect();
    let viewers: Vec<_> = (0..10)
        .map(|_| {
            let stream = call(&address, "GET /stream", &[]);
            std::thread::spawn(move || watch(stream))
        })
        .collect();
    for _ in 0..20 {
        // In mid-stream, in the head of a request, and before any byte.
        drop(call(&address, "GET /stream", &[]));
        drop(ask(&address, "GET /stream", &[]));
        drop(std::net::TcpStream::connect(&address).unwrap());
    }
    let folder = running.folder.clone();
    let (code, said) = running.end();
    assert_eq!(code, Some(0), "{said}");
    let rows = gusset_record::Run::open(&folder).unwrap();
    let rows = rows.columns(&["step"]).unwrap()[0].len() as f64;
    for viewer in viewers {
        let seen = viewer.join().unwrap();
        assert_eq!(seen.status.as_deref(), Some("completed"), "{seen:?}");
        assert_eq!(seen.skipped, 0, "{seen:?}");
        // 800 rows after the first, four to a bin.
        assert!(seen.events > 10 && seen.bins > 100, "{seen:?}");
        assert_eq!(seen.rows, rows, "{seen:?}");
    }
    drop(slow);
    same_physics(&alone, &folder);
    let summary = json(&folder, "summary.json");
    assert_eq!(summary["rows_lost"], 0);
    assert_eq!(summary["status"], "completed");
}

#[test]
fn fast_test_gives_its_viewers_the_end() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let test = write(
        home,
        "test.toml",
        &FRAME.replace("duration_s = 0.5", "duration_s = 100"),
    );
    let alone = home.join("alone");
    completed(&test, &alone, &[]);
    let running = Running::start(home, "watched", &test, "127.0.0.1", &[]);
    let viewer = call(&running.address, "GET /stream", &[]);
    let viewer = std::thread::spawn(move || watch(viewer));
    let folder = running.folder.clone();
    let (code, said) = running.end();
    assert_eq!(code, Some(0), "{said}");
    let seen = viewer.join().unwrap();
    assert_eq!(seen.status.as_deref(), Some("completed"), "{seen:?}");
    assert_eq!(seen.rows, 20_001.0, "{seen:?}");
    same_physics(&alone, &folder);
}

#[test]
fn commands_need_the_token() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let running = Running::start(home, "run", &real(home, 3600.0), "127.0.0.1", &["--json"]);
    running.until_phase("running");
    let bearer = format!("Bearer {}", running.token);
    let authorization = ("Authorization", bearer.as_str());
    for (headers, status) in [
        (vec![], 401),
        (
            vec![("Authorization", "Bearer abcd-efgh-jkmn-pqrs-tuvw")],
            401,
        ),
        (vec![("Authorization", running.token.as_str())], 401),
        (vec![authorization, ("Origin", "http://evil.example")], 403),
        (vec![authorization, ("Sec-Fetch-Site", "cross-site")], 403),
        (vec![authorization, ("Host", "evil.example:4824")], 421),
    ] {
        let reply = running.ask("POST /control/hold", &headers);
        assert_eq!(reply.status, status, "{headers:?} {reply:?}");
    }
    let in_address = format!("POST /control/hold?token={}", running.token);
    assert_eq!(running.ask(&in_address, &[]).status, 401);
    let by_form = ("Content-Type", "application/x-www-form-urlencoded");
    assert_eq!(running.ask("POST /control/hold", &[by_form]).status, 401);
    assert_eq!(
        running.ask("GET /control/hold", &[authorization]).status,
        405
    );
    assert_eq!(running.order("explode").status, 404);
    assert_eq!(
        running.metric("gusset_hold_requested"),
        0.0,
        "nothing of this holds"
    );

    let reply = running.order("hold");
    assert_eq!(reply.status, 202, "{reply:?}");
    running.until_phase("holding");
    // The phase is known at once; values of rows are up to a twentieth of a second late.
    let ticks = running.metric("gusset_ticks_total");
    until("rows of the hold", || {
        running.metric("gusset_ticks_total") > ticks + 40.0
    });
    let steps = running.metric("gusset_steps_total");
    let ticks = running.metric("gusset_ticks_total");
    let command = "gusset_command_displacement_meters{specimen=\"storey\",axis=\"1\"}";
    let held = running.metric(command);
    until("ticks go on", || {
        running.metric("gusset_ticks_total") > ticks + 40.0
    });
    assert_eq!(
        running.metric("gusset_steps_total"),
        steps,
        "test time does not change"
    );
    assert_eq!(running.metric(command), held, "and so does the command");
    let reply = running.order("confirm");
    assert_eq!(reply.status, 409, "ends no hold: {reply:?}");
    assert_eq!(reply.body.trim(), "nothing is to be confirmed");
    assert_eq!(running.order("continue").status, 202);
    running.until_phase("running");
    until("steps go on", || {
        running.metric("gusset_steps_total") > steps + 10.0
    });
    assert_eq!(running.order("stop").status, 202);
    let (folder, token) = (running.folder.clone(), running.token.clone());
    let (code, said) = running.end();
    assert_eq!(code, Some(130), "{said}");
    assert_eq!(json(&folder, "summary.json")["status"], "interrupted");

    let events = std::fs::read_to_string(folder.join("events.jsonl")).unwrap();
    let lines = |event: &str| {
        let wanted = format!("\"event\":\"{event}\"");
        events.lines().filter(|line| line.contains(&wanted)).count()
    };
    assert_eq!(lines("live_page"), 1);
    assert_eq!(lines("control_request"), 4, "{events}");
    assert_eq!(lines("control_refused"), 7, "{events}");
    for name in names(&folder)
        .iter()
        .filter(|name| !name.contains("inputs"))
    {
        let bytes = std::fs::read(folder.join(name)).unwrap();
        let text = String::from_utf8_lossy(&bytes);
        assert!(!text.contains(&token), "the token is in {name}");
    }
}

#[test]
fn continue_ends_only_the_hold_it_names() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let running = Running::start(home, "run", &real(home, 3600.0), "127.0.0.1", &[]);
    running.until_phase("running");
    for number in [1.0, 2.0] {
        assert_eq!(running.order("hold").status, 202);
        running.until_phase("holding");
        assert_eq!(running.metric("gusset_hold_number"), number);
        if number < 2.0 {
            assert_eq!(running.order("continue?hold=1").status, 202);
            running.until_phase("running");
        }
    }
    // A continue for the first hold arrives during the second.
    assert_eq!(running.order("continue?hold=1").status, 409);
    assert_eq!(running.order("continue?hold=3").status, 409);
    let bearer = format!("Bearer {}", running.token);
    let headers = [("Authorization", bearer.as_str())];
    assert_eq!(running.ask("POST /control/continue", &headers).status, 400);
    assert_eq!(running.metric("gusset_hold_requested"), 1.0);
    assert_eq!(running.order("continue?hold=2").status, 202);
    running.until_phase("running");
    assert_eq!(running.order("stop").status, 202);
    let folder = running.folder.clone();
    assert_eq!(running.end().0, Some(130));
    let events = std::fs::read_to_string(folder.join("events.jsonl")).unwrap();
    assert_eq!(events.matches("\"continue_requested\"").count(), 2);
}

/// They repeat requests on open connections, so that none of them is ever silent.
#[test]
fn too_many_clients_keep_no_stop_out() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let running = Running::start(home, "run", &real(home, 3600.0), "127.0.0.1", &[]);
    running.until_phase("running");
    let viewers: Vec<_> = (0..80)
        .map(|_| call(&running.address, "GET /stream", &[]))
        .collect();
    until("viewers have the places that they may have", || {
        running.metric("gusset_viewers") == 64.0
    });
    let clients: Vec<_> = (0..96).map(|_| keep_alive(&running.address)).collect();
    let is_over = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !is_over.load(std::sync::atomic::Ordering::Relaxed) {
                for mut client in &clients {
                    // A connection closed for a newcomer does not return.
                    let _ = std::io::Write::write_all(&mut client, web::KEEP_ALIVE);
                }
                gusset_session::pause(std::time::Duration::from_millis(50));
            }
        });
        assert_eq!(running.order("stop").status, 202);
        is_over.store(true, std::sync::atomic::Ordering::Relaxed);
    });
    drop(viewers);
    assert_eq!(running.end().0, Some(130));
}

#[test]
fn no_hold_is_accepted_in_the_shutdown() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let slowly = [
        "--set",
        "safety.at_end=\"zero_displacement\"",
        "--set",
        "safety.exit_speed_m_per_s=1e-6",
    ];
    let running = Running::start(home, "run", &real(home, 3600.0), "127.0.0.1", &slowly);
    running.until_phase("running");
    until("some ticks", || running.metric("gusset_ticks_total") > 50.0);
    assert_eq!(running.order("stop").status, 202);
    running.until_phase("leaving");
    for word in ["hold", "continue"] {
        let reply = running.order(word);
        assert_eq!(reply.status, 409, "{reply:?}");
        assert!(reply.body.contains("no effect"), "{reply:?}");
    }
    assert_eq!(running.order("stop").status, 202);
    assert_eq!(running.end().0, Some(130));
}

#[test]
fn viewers_need_a_token_beyond_loopback() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let given = write(home, "view.token", "a-token-of-the-lab-42\n");
    let more = ["--live-token", given.to_str().unwrap()];
    let running = Running::start(home, "run", &real(home, 3600.0), "0.0.0.0", &more);
    assert!(
        running.link.ends_with("/#view=a-token-of-the-lab-42"),
        "{}",
        running.link
    );
    assert_eq!(
        running.ask("GET /", &[]).status,
        200,
        "the empty page tells nothing"
    );
    let view = ("Authorization", "Bearer a-token-of-the-lab-42");
    for path in ["GET /stream", "GET /metrics"] {
        assert_eq!(running.ask(path, &[]).status, 401, "{path}");
        assert_eq!(
            running
                .ask(path, &[("Authorization", "Bearer nonsense")])
                .status,
            401
        );
        assert_eq!(running.ask(path, &[view]).status, 200, "{path}");
    }
    assert_eq!(
        running.ask("POST /control/stop", &[view]).status,
        401,
        "looking is not operating"
    );
    assert_eq!(running.order("stop").status, 202);
    assert_eq!(running.end().0, Some(130));
}

#[test]
fn port_in_use_is_refused_early() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let test = write(home, "test.toml", FRAME);
    let holder = TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = holder.local_addr().unwrap().to_string();
    let short = write(home, "short.token", "tiny\n");
    let short = short.to_str().unwrap();
    for (arguments, words) in [
        (vec!["--live", taken.as_str()], "any free port"),
        (
            vec!["--live", "192.0.2.1:1"],
            "this machine has no such address",
        ),
        (
            vec!["--live", "no-such-host.invalid:1"],
            "cannot be served at",
        ),
        (vec!["--live", "here:there"], "wanted ADDR:PORT"),
        (
            vec!["--live", "127.0.0.1:0", "--live-token", short],
            "holds no token",
        ),
    ] {
        let out = home.join("out");
        let said = run(&test, &out, &arguments);
        assert_eq!(said.code, Some(2), "{arguments:?} {}", said.stderr);
        assert!(
            said.stderr.contains(words),
            "{arguments:?}: {}",
            said.stderr
        );
        assert!(!out.exists() && said.stdout.is_empty(), "{arguments:?}");
    }
}

#[test]
fn prometheus_text_agrees_with_the_run() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let test = real(home, 3600.0);
    let text = std::fs::read_to_string(&test).unwrap();
    let text = text.replace("title = \"Frame\"", "title = 'A \"frame\" \\ of two'");
    let text = text.replace(
        "name = \"storey\"",
        "name = \"storey\"\nlimits = { measured_force_n = { trip = [-9e9, 9e9] } }",
    );
    let test = write(home, "test.toml", &text);
    let running = Running::start(home, "run", &test, "127.0.0.1", &[]);
    running.until_phase("running");
    until("some ticks", || running.metric("gusset_ticks_total") > 50.0);
    let reply = running.ask("GET /metrics", &[]);
    let head = reply.head.to_lowercase();
    assert!(
        head.contains("content-type: text/plain; version=0.0.4"),
        "{head}"
    );
    assert!(
        head.contains("content-security-policy: default-src 'none'"),
        "{head}"
    );
    let families = exposition::parse(&reply.body);
    for (name, kind) in [
        ("gusset_phase", "gauge"),
        ("gusset_ticks_total", "counter"),
        ("gusset_deadline_misses_total", "counter"),
        ("gusset_wakeup_lateness_seconds", "histogram"),
        ("gusset_compute_seconds", "histogram"),
        ("gusset_measured_force_newtons", "gauge"),
        ("gusset_limit_used_ratio", "gauge"),
        ("gusset_specimen_exchanges_total", "counter"),
        ("gusset_rows_lost_total", "counter"),
        ("gusset_lambda", "gauge"),
        ("gusset_lambda_limit", "gauge"),
    ] {
        let family = families.get(name).unwrap_or_else(|| panic!("no {name}"));
        assert_eq!(family.kind, kind, "{name}");
        assert!(!family.samples.is_empty(), "{name} has no sample");
    }
    let title = &families["gusset_info"].samples[0].labels["title"];
    assert_eq!(title, "A \"frame\" \\ of two");
    let force = &families["gusset_measured_force_newtons"].samples[0];
    let used = families["gusset_limit_used_ratio"].samples.iter();
    let used = used
        .filter(|sample| sample.labels["limit"] == "measured_force_n")
        .count();
    assert_eq!(used, 1);
    assert!(force.value.is_finite());
    assert_eq!(running.order("stop").status, 202);
    let (folder, (code, _)) = (running.folder.clone(), running.end());
    assert_eq!(code, Some(130));
    let resolved = std::fs::read_to_string(folder.join("resolved.toml")).unwrap();
    let lambda = families["gusset_lambda"].samples[0].value;
    assert!(resolved.contains("lambda = "), "{resolved}");
    let summary = json(&folder, "summary.json");
    assert_eq!(summary["lambda"].as_f64(), Some(lambda));
}

#[test]
fn report_is_served_to_viewers_at_the_end() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let running = Running::start(home, "run", &real(home, 3600.0), "127.0.0.1", &[]);
    let address = running.address.clone();
    let before = ask(&address, "GET /report/anything", &[]);
    let mut viewer = BufReader::new(call(&address, "GET /stream", &[]));
    running.until_phase("running");
    assert_eq!(running.order("stop").status, 202);
    // The last state has the address of the report.
    let mut path = None;
    let mut line = String::new();
    while path.is_none() && viewer.read_line(&mut line).unwrap() > 0 {
        let event = line.trim_end().strip_prefix("data: ");
        let event = event.map(|text| serde_json::from_str::<serde_json::Value>(text).unwrap());
        path = event.and_then(|event| event["state"]["report"].as_str().map(str::to_owned));
        line.clear();
    }
    let path = path.expect("the address of the report");
    let wrong = ask(&address, "GET /report/anything", &[]);
    let report = ask(&address, &format!("GET {path}"), &[]);
    assert_eq!(
        (before.status, wrong.status, report.status),
        (404, 404, 200)
    );
    let file = std::fs::read_to_string(home.join("run/report.html")).unwrap();
    assert_eq!(report.body, file);
    // Its scripts run apart from the page.
    assert!(
        report
            .head
            .contains("content-security-policy: sandbox allow-scripts;")
    );
    drop(viewer);
    assert_eq!(running.end().0, Some(130));
}
