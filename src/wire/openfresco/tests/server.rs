//! A server of one degree of freedom, message by message (section 5.7 of the protocol notes).

use super::*;

#[test]
fn trials_between_commits_are_iterations() {
    let mut server = generic();
    assert_eq!(trial(&mut server, 0.0, 0.0), Course::First);
    assert_eq!(message(&mut server, &[15.0]), Event::Matrix(Matrix::Mass));
    assert_eq!(trial(&mut server, 0.0, 0.02), Course::Step);
    assert_eq!(server.followed().unwrap().dt(), Some(0.02));
    assert_eq!(trial(&mut server, 0.1, 0.02), Course::Iteration);
    assert_eq!(trial(&mut server, 0.11, 0.02), Course::Iteration);
    assert_eq!(trial(&mut server, 0.11, 0.02), Course::Repeat);
    assert_eq!(commit(&mut server, 0.02), 5);
    assert_eq!(trial(&mut server, 0.11, 0.04), Course::Step);
    assert_eq!(server.followed().unwrap().dt(), Some(0.04 - 0.02));
    assert_eq!(commit(&mut server, 0.04), 1);
    assert_eq!(message(&mut server, &[99.0]), Event::Finished);
}

#[test]
fn requests_may_come_at_any_time() {
    let mut server = generic();
    assert_eq!(
        message(&mut server, &[10.0, 9.9]),
        Event::Read(Reading::Force)
    );
    assert_eq!(server.followed().unwrap().trial().disp, [0.0]);
    let response = Response {
        force: &[2.5],
        ..Response::default()
    };
    assert_eq!(doubles(server.answer(&response).unwrap())[..2], [2.5, 0.0]);
    trial(&mut server, 0.5, 0.01);
    for _ in 0..3 {
        assert_eq!(
            message(&mut server, &[10.0, 9.9]),
            Event::Read(Reading::Force)
        );
        // The stale doubles of a request are ignored.
        assert_eq!(server.followed().unwrap().trial().disp, [0.5]);
        server.answer(&response).unwrap();
    }
    commit(&mut server, 0.01);
    assert_eq!(message(&mut server, &[10.0]), Event::Read(Reading::Force));
    assert_eq!(server.followed().unwrap().trial().disp, [0.5]);
}

#[test]
fn commit_alone_moves_time_on() {
    let mut server = generic();
    trial(&mut server, 0.1, 0.01);
    assert_eq!(commit(&mut server, 0.01), 1);
    assert_eq!(commit(&mut server, 0.02), 0);
    assert_eq!(trial(&mut server, 0.2, 0.03), Course::Step);
    assert!((server.followed().unwrap().dt().unwrap() - 0.01).abs() < 1e-15);
    // A command and its commit without a request in between.
    assert_eq!(commit(&mut server, 0.03), 1);
}

#[test]
fn step_taken_back_is_recognised() {
    let mut server = generic();
    trial(&mut server, 0.0, 0.0);
    trial(&mut server, 0.1, 0.02);
    commit(&mut server, 0.02);
    assert_eq!(trial(&mut server, 0.3, 0.04), Course::Step);
    assert_eq!(trial(&mut server, 9.0, 0.04), Course::Iteration);
    // Old displacement and old time, no commit: then on with another step length.
    assert_eq!(trial(&mut server, 0.1, 0.02), Course::TakenBack);
    assert_eq!(server.followed().unwrap().dt(), Some(0.0));
    assert_eq!(trial(&mut server, 0.15, 0.025), Course::Step);
    assert!((server.followed().unwrap().dt().unwrap() - 0.005).abs() < 1e-15);
    assert_eq!(trial(&mut server, 0.16, 0.025), Course::Iteration);
    assert_eq!(trial(&mut server, 0.1, 0.02), Course::TakenBack);
    assert_eq!(trial(&mut server, 0.11, 0.021), Course::Step);
    assert_eq!(commit(&mut server, 0.021), 7);
    // The first step of a test, taken back to the beginning.
    let mut server = generic();
    trial(&mut server, 0.0, 0.0);
    trial(&mut server, 0.1, 0.02);
    assert_eq!(trial(&mut server, 0.0, 0.0), Course::TakenBack);
}

#[test]
fn time_restart_is_no_step_back() {
    let mut server = generic();
    trial(&mut server, 0.1, 1.0);
    commit(&mut server, 1.0);
    // loadConst -time 0.0, then a transient analysis.
    assert_eq!(trial(&mut server, 0.1, 0.01), Course::NewOrigin);
    assert_eq!(server.followed().unwrap().dt(), None);
    assert_eq!(trial(&mut server, 0.12, 0.01), Course::Iteration);
    assert_eq!(trial(&mut server, 0.1, 0.0), Course::TakenBack);
    assert_eq!(trial(&mut server, 0.12, 0.01), Course::Step);
    commit(&mut server, 0.01);
    assert_eq!(trial(&mut server, 0.2, 0.02), Course::Step);
    assert_eq!(server.followed().unwrap().dt(), Some(0.01));
}

#[test]
fn untimed_step_back_shows_in_displacement() {
    let mut server = Server::new(ServerDialect::Application, Carrier::Stream, ONE);
    server
        .feed(&sizes_bytes([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2]))
        .unwrap();
    let mut trial = |disp: f64| match server.feed(&vector(2, &[3.0, disp])).unwrap().1 {
        Event::Trial(course) => course,
        other => panic!("{other:?}"),
    };
    // Before its first commit a client has no step to take back.
    assert_eq!(trial(0.1), Course::First);
    assert_eq!(trial(0.2), Course::Iteration);
    assert_eq!(trial(0.0), Course::Iteration);
    assert_eq!(trial(0.05), Course::Iteration);
    server.feed(&vector(2, &[5.0])).unwrap();
    assert_eq!(server.followed().unwrap().dt(), None);
    let mut trial = |disp: f64| match server.feed(&vector(2, &[3.0, disp])).unwrap().1 {
        Event::Trial(course) => course,
        other => panic!("{other:?}"),
    };
    assert_eq!(trial(0.05), Course::Step);
    assert_eq!(trial(0.05), Course::Repeat);
    assert_eq!(trial(0.07), Course::Iteration);
    assert_eq!(trial(0.05), Course::TakenBack);
}

#[test]
fn untimed_client_may_go_through_zero() {
    let mut server = Server::new(ServerDialect::Application, Carrier::Stream, ONE);
    server
        .feed(&sizes_bytes([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2]))
        .unwrap();
    let path = [0.0, 0.005, 0.01, 0.005, 0.0, -0.005, 0.0];
    let courses = path.map(|disp| server.feed(&vector(2, &[3.0, disp])).unwrap().1);
    assert!(!courses.contains(&Event::Trial(Course::TakenBack)));
    // From its first commit on it is classified like every other.
    server.feed(&vector(2, &[5.0])).unwrap();
    for (disp, course) in [(0.005, Course::Step), (0.0, Course::TakenBack)] {
        let (_, event) = server.feed(&vector(2, &[3.0, disp])).unwrap();
        assert_eq!(event, Event::Trial(course));
    }
}

#[test]
fn commit_time_before_command_is_ignored() {
    // Matlab's elements commit with zeros behind the action.
    let mut server = generic();
    trial(&mut server, 0.0, 0.0);
    for k in 1..5 {
        let time = 0.01 * f64::from(k);
        assert_eq!(trial(&mut server, time, time), Course::Step);
        let dt = server.followed().unwrap().dt().unwrap();
        assert!((dt - 0.01).abs() < 1e-15, "{k}: {dt}");
        commit(&mut server, 0.0);
    }
    // One that comes again moves time neither on nor back, also after a commit of a later time.
    commit(&mut server, 0.05);
    commit(&mut server, 0.0);
    trial(&mut server, 0.2, 0.06);
    assert!((server.followed().unwrap().dt().unwrap() - 0.01).abs() < 1e-15);
}

#[test]
fn return_to_start_after_commit_is_a_reset() {
    let mut server = generic();
    assert_eq!(trial(&mut server, 0.0, 0.0), Course::First);
    assert_eq!(trial(&mut server, 0.1, 0.02), Course::Step);
    assert_eq!(trial(&mut server, 0.0, 0.0), Course::TakenBack);
    assert!(!server.followed().unwrap().is_reset());
    trial(&mut server, 0.1, 0.02);
    commit(&mut server, 0.02);
    assert!(!server.followed().unwrap().is_reset());
    trial(&mut server, 0.0, 0.0);
    assert!(server.followed().unwrap().is_reset());
    trial(&mut server, 0.1, 0.02);
    assert!(!server.followed().unwrap().is_reset());
    // In the middle of a step, too.
    commit(&mut server, 0.02);
    trial(&mut server, 0.15, 0.04);
    trial(&mut server, 0.0, 0.0);
    assert!(server.followed().unwrap().is_reset());
    // `loadConst -time 0` sets the time back and leaves the structure where it is.
    let mut server = generic();
    trial(&mut server, 0.1, 1.0);
    commit(&mut server, 1.0);
    for (disp, time) in [(0.1, 0.01), (0.12, 0.01), (0.1, 0.0)] {
        trial(&mut server, disp, time);
        assert!(!server.followed().unwrap().is_reset());
    }
}

#[test]
fn zeros_before_any_motion_are_no_reset() {
    // The client announces a time and always sends 0.
    let mut server = generic();
    for disp in [0.0, 0.005, 0.01, 0.005, 0.0] {
        trial(&mut server, disp, 0.0);
        assert!(!server.followed().unwrap().is_reset(), "{disp}");
        commit(&mut server, 0.0);
    }
    // Only the time changes.
    let mut server = generic();
    for time in [0.2, 0.4, 0.6, 0.8, 1.0] {
        trial(&mut server, 0.0, time);
        commit(&mut server, time);
    }
    trial(&mut server, 0.0, 0.0);
    assert!(!server.followed().unwrap().is_reset());
    // A client that was elsewhere and came home can begin again.
    let mut server = generic();
    for (disp, time) in [(0.1, 0.02), (0.0, 0.04)] {
        trial(&mut server, disp, time);
        commit(&mut server, time);
    }
    trial(&mut server, 0.0, 0.0);
    assert!(server.followed().unwrap().is_reset());
}

#[test]
fn answer_always_holds_the_whole_layout() {
    let mut server = Server::new(ServerDialect::Application, Carrier::Stream, ONE);
    let sizes = sizes_bytes([1, 1, 1, 0, 1, 1, 1, 1, 1, 1, 6]);
    server.feed(&sizes).unwrap();
    let response = Response {
        disp: &[0.1],
        vel: &[0.2],
        accel: &[0.3],
        force: &[0.4],
        time: 0.5,
    };
    for code in 6..=11 {
        let (_, event) = server.feed(&vector(6, &[f64::from(code)])).unwrap();
        assert!(matches!(event, Event::Read(_)));
        let answer = doubles(server.answer(&response).unwrap());
        assert_eq!(answer, [0.1, 0.2, 0.3, 0.4, 0.5, 0.0]);
    }
    // One request, one answer; and only of the requested kind.
    assert!(matches!(
        server.answer(&response),
        Err(WireError::Order { .. })
    ));
    server.feed(&vector(6, &[12.0])).unwrap();
    assert!(matches!(
        server.answer(&response),
        Err(WireError::Order { .. })
    ));
    let answer = doubles(server.answer_matrix(&[2.8]).unwrap());
    assert_eq!(answer, [2.8, 0.0, 0.0, 0.0, 0.0, 0.0]);
    server.feed(&vector(6, &[6.0])).unwrap();
    let nan = Response {
        force: &[f64::NAN],
        ..response
    };
    assert_eq!(
        server.answer(&nan),
        Err(WireError::NotFinite {
            field: "forces",
            index: 0
        })
    );
}

#[test]
fn too_large_matrix_ends_the_connection() {
    let mut server = Server::new(
        ServerDialect::Application,
        Carrier::Stream,
        Interface::of_axes(4),
    );
    server
        .feed(&sizes_bytes([4, 0, 0, 0, 0, 0, 0, 0, 4, 0, 15]))
        .unwrap();
    assert!(matches!(
        server.feed(&vector(15, &[12.0])),
        Err(WireError::Bounds {
            field: "data size N",
            lowest: 16,
            found: 15,
            ..
        })
    ));
}

#[test]
fn unknown_actions_are_reported() {
    let mut server = generic();
    for code in [1.0, 2.0, 4.0, 4.1, 16.0, 50.0, 98.0] {
        assert_eq!(message(&mut server, &[code]), Event::Ignored(code));
        assert!(server.reply().is_empty());
    }
    for found in [0.0, 3.5, 10.9] {
        let mut server = generic();
        assert_eq!(
            server.feed(&vector(8, &[found])),
            Err(WireError::Action { found })
        );
        assert_eq!(server.feed(&vector(8, &[10.0])), Err(WireError::Failed));
    }
}

#[test]
fn nan_command_never_reaches_the_specimen() {
    let mut server = generic();
    trial(&mut server, 0.25, 0.01);
    assert_eq!(
        server.feed(&vector(8, &[3.0, f64::NAN, 0.0, 0.0, 0.02])),
        Err(WireError::NotFinite {
            field: "trial response",
            index: 0
        })
    );
    assert_eq!(server.followed().unwrap().trial().disp, [0.25]);
}

#[test]
fn messages_after_the_end_are_ignored() {
    let mut server = generic();
    assert_eq!(message(&mut server, &[99.0]), Event::Finished);
    assert_eq!(server.feed(&vector(8, &[99.0])), Ok((64, Event::NeedMore)));
    assert_eq!(server.feed(&vector(3, &[3.0])), Ok((24, Event::NeedMore)));
}

#[test]
fn messages_may_be_split_anywhere() {
    let mut stream = sizes_bytes([1, 1, 1, 0, 1, 0, 0, 0, 1, 0, 8]);
    for values in [
        [3.0, 0.5, 0.0, 0.0, 0.1],
        [10.0, 0.0, 0.0, 0.0, 0.0],
        [5.0, 0.0, 0.0, 0.0, 0.1],
    ] {
        stream.extend(vector(8, &values));
    }
    let mut courses = Vec::new();
    for piece in [1, 2, 7, 44, 63, 64, 65, 1000] {
        let mut server = Server::new(ServerDialect::Application, Carrier::Stream, ONE);
        let mut events = Vec::new();
        for chunk in stream.chunks(piece) {
            let mut rest = chunk;
            while !rest.is_empty() {
                let (used, event) = server.feed(rest).unwrap();
                assert!(used > 0);
                rest = &rest[used..];
                if event != Event::NeedMore {
                    events.push(event);
                }
            }
        }
        courses.push(events);
    }
    assert_eq!(courses[0].len(), 4);
    assert!(courses.iter().all(|events| *events == courses[0]));
}
