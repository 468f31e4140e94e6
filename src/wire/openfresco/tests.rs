use proptest::prelude::*;

use super::*;
use crate::substructure::{Command, Measurement};
use crate::wire::WireError;

const ONE: Interface = Interface { axes: 1, forces: 1 };

fn sizes_bytes(counts: [i32; 11]) -> Vec<u8> {
    counts.into_iter().flat_map(i32::to_le_bytes).collect()
}

/// N doubles: these, and stale ones behind.
fn vector(n: usize, values: &[f64]) -> Vec<u8> {
    let stale = std::iter::repeat(1234.5);
    values
        .iter()
        .copied()
        .chain(stale)
        .take(n)
        .flat_map(f64::to_le_bytes)
        .collect()
}

fn doubles(bytes: &[u8]) -> Vec<f64> {
    bytes
        .chunks_exact(8)
        .map(|word| f64::from_le_bytes(word.try_into().unwrap()))
        .collect()
}

/// A server behind `genericClient` with one degree of freedom and N = 8.
fn generic() -> Server {
    let mut server = Server::new(ServerDialect::Application, Carrier::Stream, ONE);
    let sizes = sizes_bytes([1, 1, 1, 0, 1, 0, 0, 0, 1, 0, 8]);
    assert!(matches!(server.feed(&sizes), Ok((44, Event::Ready(_)))));
    server
}

fn message(server: &mut Server, values: &[f64]) -> Event {
    let (used, event) = server.feed(&vector(8, values)).unwrap();
    assert_eq!(used, 64);
    event
}

fn trial(server: &mut Server, disp: f64, time: f64) -> Course {
    match message(server, &[3.0, disp, 0.0, 0.0, time]) {
        Event::Trial(course) => course,
        other => panic!("{other:?}"),
    }
}

fn commit(server: &mut Server, time: f64) -> u32 {
    match message(server, &[5.0, 7.7, 7.7, 7.7, time]) {
        Event::Commit { trials } => trials,
        other => panic!("{other:?}"),
    }
}

// ---- sizes -----------------------------------------------------------------------------------------

#[test]
fn the_sizes_are_these_44_bytes() {
    let sizes = Sizes::generic_client(1, 256).unwrap();
    let mut out = [0xAA; 50];
    assert_eq!(sizes.write(&mut out), Ok(44));
    let mut expected = [0xAA; 50];
    expected[..44].fill(0);
    for at in [0, 4, 8, 16, 32] {
        expected[at] = 1;
    }
    expected[41] = 1; // 256
    assert_eq!(out, expected);
    assert_eq!(Sizes::parse(&out[..44]), Ok(sizes));
    assert_eq!(sizes.vector_len(), 2048);
}

#[test]
fn n_is_raised_to_what_commands_answers_and_matrices_need() {
    let n = |sizes: Result<Sizes, WireError>| sizes.unwrap().data_size();
    assert_eq!(n(Sizes::generic_client(1, 5)), 5);
    assert_eq!(n(Sizes::generic_client(4, 1)), 16);
    assert_eq!(n(Sizes::generic_client(2, 1)), 8);
    assert_eq!(n(Sizes::adapter(2, 1)), 4);
    assert_eq!(n(Sizes::adapter(1, 256)), 256);
    assert_eq!(n(Sizes::full(3, 1)), 13);
}

#[test]
fn nonsense_in_the_sizes_is_refused_with_the_number_that_is_wrong() {
    let good = [2, 2, 2, 0, 1, 2, 0, 0, 2, 0, 16];
    assert!(Sizes::parse(&sizes_bytes(good)).is_ok());
    for (index, value, field) in [
        (0, -1, "number of displacements"),
        (1, i32::MIN, "number of velocities"),
        (2, 4097, "number of accelerations"),
        (3, i32::MAX, "number of forces"),
        (4, 2, "number of times"),
        (8, -7, "number of forces"),
        (9, -1, "number of times"),
        (10, -1, "data size N"),
        (10, 0, "data size N"),
        (10, 7, "data size N"),
        (10, 65_537, "data size N"),
        (10, i32::MAX, "data size N"),
    ] {
        let mut counts = good;
        counts[index] = value;
        match Sizes::parse(&sizes_bytes(counts)) {
            Err(WireError::Bounds {
                field: found,
                found: number,
                ..
            }) => {
                assert_eq!((found, number), (field, i64::from(value)));
            }
            other => panic!("{index} {value}: {other:?}"),
        }
        let mut server = Server::new(
            ServerDialect::Application,
            Carrier::Stream,
            Interface::of_axes(2),
        );
        assert!(server.feed(&sizes_bytes(counts)).is_err());
        assert_eq!(server.feed(&vector(16, &[3.0])), Err(WireError::Failed));
    }
    let mut counts = good;
    counts[10] = 8; // 1 + 2 + 2 + 2 + 1
    assert!(Sizes::parse(&sizes_bytes(counts)).is_ok());
}

#[test]
fn sizes_must_fit_the_interface() {
    let interface = Interface { axes: 3, forces: 6 };
    let check = |ctrl: [usize; 5], daq: [usize; 5]| {
        let counts = |[d, v, a, f, t]: [usize; 5]| Counts::new(d, v, a, f, t);
        interface.check(&counts(ctrl), &counts(daq))
    };
    // OpenFresco's invertedVBrace: three displacements, six forces.
    assert_eq!(check([3, 3, 3, 0, 1], [3, 3, 3, 6, 1]), Ok(()));
    assert_eq!(check([3, 0, 0, 0, 0], [0, 0, 0, 6, 0]), Ok(()));
    let field = |outcome: Result<(), WireError>| match outcome {
        Err(WireError::Count { field, .. }) => field,
        other => panic!("{other:?}"),
    };
    assert_eq!(
        field(check([2, 0, 0, 0, 0], [0, 0, 0, 6, 0])),
        "commanded displacements"
    );
    assert_eq!(
        field(check([0, 3, 0, 0, 0], [0, 0, 0, 6, 0])),
        "commanded displacements"
    );
    assert_eq!(
        field(check([3, 1, 0, 0, 0], [0, 0, 0, 6, 0])),
        "commanded velocities"
    );
    assert_eq!(
        field(check([3, 0, 0, 0, 0], [0, 0, 0, 3, 0])),
        "measured forces"
    );
    assert_eq!(
        field(check([3, 0, 0, 0, 0], [0, 0, 0, 0, 0])),
        "measured forces"
    );
}

// ---- vectors ---------------------------------------------------------------------------------------

#[test]
fn a_command_has_these_doubles_and_zeros_behind_whatever_the_buffer_held() {
    let counts = Counts::new(2, 2, 2, 0, 1);
    let response = Response {
        disp: &[1.0, 2.0],
        vel: &[3.0, 4.0],
        accel: &[5.0, 6.0],
        force: &[],
        time: 0.02,
    };
    let mut out = [0xAA; 8 * 12];
    write_vector(&mut out, Some(3.0), &counts, &response).unwrap();
    assert_eq!(
        doubles(&out),
        [3.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.02, 0.0, 0.0, 0.0, 0.0]
    );
    assert_eq!(
        out[..16],
        [0, 0, 0, 0, 0, 0, 8, 0x40, 0, 0, 0, 0, 0, 0, 0xF0, 0x3F]
    );
    let mut out = [0xAA; 24];
    write_action(&mut out, Action::Die).unwrap();
    assert_eq!(doubles(&out), [99.0, 0.0, 0.0]);
}

#[test]
fn matrices_travel_column_by_column() {
    let rows = [11.0, 12.0, 13.0, 21.0, 22.0, 23.0, 31.0, 32.0, 33.0];
    let mut out = [0xAA; 80];
    write_matrix(&mut out, 3, &rows).unwrap();
    assert_eq!(
        doubles(&out),
        [11.0, 21.0, 31.0, 12.0, 22.0, 32.0, 13.0, 23.0, 33.0, 0.0]
    );
    let mut back = [0.0; 9];
    read_matrix(&out, 3, &mut back).unwrap();
    assert_eq!(back, rows);
    assert!(matches!(
        write_matrix(&mut out[..71], 3, &rows),
        Err(WireError::Room { needed: 72, .. })
    ));
    assert!(write_matrix(&mut out, 2, &rows).is_err());
}

// ---- section 5.7, with a server of one degree of freedom -------------------------------------------

#[test]
fn several_trials_between_two_commits_are_iterations_of_one_step() {
    let mut server = generic();
    assert_eq!(trial(&mut server, 0.0, 0.0), Course::First);
    assert_eq!(message(&mut server, &[15.0]), Event::Matrix(Matrix::Mass));
    assert_eq!(trial(&mut server, 0.0, 0.02), Course::Step);
    assert_eq!(server.dt(), Some(0.02));
    assert_eq!(trial(&mut server, 0.1, 0.02), Course::Iteration);
    assert_eq!(trial(&mut server, 0.11, 0.02), Course::Iteration);
    assert_eq!(trial(&mut server, 0.11, 0.02), Course::Repeat);
    assert_eq!(commit(&mut server, 0.02), 5);
    assert_eq!(trial(&mut server, 0.11, 0.04), Course::Step);
    assert_eq!(server.dt(), Some(0.04 - 0.02));
    assert_eq!(commit(&mut server, 0.04), 1);
    assert_eq!(message(&mut server, &[99.0]), Event::Finished);
}

#[test]
fn a_request_may_come_before_the_first_command_and_any_number_of_times() {
    let mut server = generic();
    assert_eq!(
        message(&mut server, &[10.0, 9.9]),
        Event::Read(Reading::Force)
    );
    assert_eq!(server.trial().unwrap().disp, [0.0]);
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
        // The stale doubles of a request are not looked at.
        assert_eq!(server.trial().unwrap().disp, [0.5]);
        server.answer(&response).unwrap();
    }
    commit(&mut server, 0.01);
    assert_eq!(message(&mut server, &[10.0]), Event::Read(Reading::Force));
    assert_eq!(server.trial().unwrap().disp, [0.5]);
}

#[test]
fn a_commit_without_a_new_command_moves_time_on() {
    let mut server = generic();
    trial(&mut server, 0.1, 0.01);
    assert_eq!(commit(&mut server, 0.01), 1);
    assert_eq!(commit(&mut server, 0.02), 0);
    assert_eq!(trial(&mut server, 0.2, 0.03), Course::Step);
    assert!((server.dt().unwrap() - 0.01).abs() < 1e-15);
    // A command and its commit without a request in between.
    assert_eq!(commit(&mut server, 0.03), 1);
}

#[test]
fn a_step_that_is_taken_back_is_told_apart() {
    let mut server = generic();
    trial(&mut server, 0.0, 0.0);
    trial(&mut server, 0.1, 0.02);
    commit(&mut server, 0.02);
    assert_eq!(trial(&mut server, 0.3, 0.04), Course::Step);
    assert_eq!(trial(&mut server, 9.0, 0.04), Course::Iteration);
    // Old displacement and old time, no commit: then on with another step length.
    assert_eq!(trial(&mut server, 0.1, 0.02), Course::TakenBack);
    assert_eq!(server.dt(), Some(0.0));
    assert_eq!(trial(&mut server, 0.15, 0.025), Course::Step);
    assert!((server.dt().unwrap() - 0.005).abs() < 1e-15);
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
fn time_that_begins_anew_after_a_commit_is_no_step_back() {
    let mut server = generic();
    trial(&mut server, 0.1, 1.0);
    commit(&mut server, 1.0);
    // loadConst -time 0.0, then a transient analysis.
    assert_eq!(trial(&mut server, 0.1, 0.01), Course::NewOrigin);
    assert_eq!(server.dt(), None);
    assert_eq!(trial(&mut server, 0.12, 0.01), Course::Iteration);
    assert_eq!(trial(&mut server, 0.1, 0.0), Course::TakenBack);
    assert_eq!(trial(&mut server, 0.12, 0.01), Course::Step);
    commit(&mut server, 0.01);
    assert_eq!(trial(&mut server, 0.2, 0.02), Course::Step);
    assert_eq!(server.dt(), Some(0.01));
    // In the middle of a step it is nothing that can be followed.
    assert_eq!(trial(&mut server, 0.0, 0.005), Course::Reversed);
    assert!(server.dt().unwrap() < 0.0);
}

#[test]
fn without_a_time_a_step_back_shows_in_the_displacement() {
    let mut server = Server::new(ServerDialect::Application, Carrier::Stream, ONE);
    server
        .feed(&sizes_bytes([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2]))
        .unwrap();
    let mut trial = |disp: f64| match server.feed(&vector(2, &[3.0, disp])).unwrap().1 {
        Event::Trial(course) => course,
        other => panic!("{other:?}"),
    };
    assert_eq!(trial(0.1), Course::First);
    assert_eq!(trial(0.2), Course::Iteration);
    assert_eq!(trial(0.0), Course::TakenBack);
    assert_eq!(trial(0.05), Course::Step);
    server.feed(&vector(2, &[5.0])).unwrap();
    assert_eq!(server.dt(), None);
    let mut trial = |disp: f64| match server.feed(&vector(2, &[3.0, disp])).unwrap().1 {
        Event::Trial(course) => course,
        other => panic!("{other:?}"),
    };
    assert_eq!(trial(0.05), Course::Repeat);
    assert_eq!(trial(0.07), Course::Iteration);
    assert_eq!(trial(0.05), Course::TakenBack);
}

#[test]
fn an_answer_holds_the_complete_layout_whatever_was_asked() {
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
    // One request, one answer; and only of the kind that was asked for.
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
fn a_matrix_that_does_not_fit_into_n_ends_the_connection() {
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
fn unknown_actions_are_reported_and_not_answered_and_nonsense_ends_the_connection() {
    let mut server = generic();
    for code in [1.0, 2.0, 4.0, 4.1, 16.0, 50.0, 98.0] {
        assert_eq!(message(&mut server, &[code]), Event::Ignored(code));
        assert!(server.reply().is_empty());
    }
    assert_eq!(message(&mut server, &[10.9]), Event::Read(Reading::Force));
    assert!(matches!(
        server.feed(&vector(8, &[0.0])),
        Err(WireError::Action { found: 0.0 })
    ));
    assert_eq!(server.feed(&vector(8, &[10.0])), Err(WireError::Failed));
}

#[test]
fn a_command_that_is_not_a_number_never_reaches_the_specimen() {
    let mut server = generic();
    trial(&mut server, 0.25, 0.01);
    assert_eq!(
        server.feed(&vector(8, &[3.0, f64::NAN, 0.0, 0.0, 0.02])),
        Err(WireError::NotFinite {
            field: "trial response",
            index: 0
        })
    );
    assert_eq!(server.trial().unwrap().disp, [0.25]);
}

#[test]
fn after_the_end_nothing_is_understood_any_more() {
    let mut server = generic();
    assert_eq!(message(&mut server, &[99.0]), Event::Finished);
    assert_eq!(server.feed(&vector(8, &[99.0])), Ok((64, Event::NeedMore)));
    assert_eq!(server.feed(&vector(3, &[3.0])), Ok((24, Event::NeedMore)));
}

#[test]
fn messages_may_be_cut_and_joined_anywhere_on_a_stream() {
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

// ---- dialect D -------------------------------------------------------------------------------------

#[test]
fn generic_tcp_commits_by_moving_on() {
    let mut server = Server::new(ServerDialect::Controller, Carrier::Stream, ONE);
    server
        .feed(&sizes_bytes([1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 4]))
        .unwrap();
    let mut send = |values: &[f64]| server.feed(&vector(4, values)).unwrap().1;
    assert_eq!(send(&[3.0, 0.0]), Event::Trial(Course::First));
    assert_eq!(send(&[6.0]), Event::Read(Reading::All));
    assert_eq!(send(&[3.0, 0.0]), Event::Trial(Course::Repeat));
    for disp in [0.1, 0.2, 0.1, 0.0, 0.1] {
        assert_eq!(send(&[3.0, disp]), Event::Trial(Course::Step));
    }
    assert_eq!(send(&[99.0]), Event::Finished);
}

#[test]
fn lines_of_an_init_file_are_passed_over_and_kept_for_the_log() {
    let mut line = vec![0xEE; 16_385];
    line[0] = 2;
    line[1..14].copy_from_slice(b"gain=1.25 mm\0");
    let mut stream = sizes_bytes([1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 4]);
    stream.extend(&line);
    stream.extend(&line);
    stream.extend(vector(4, &[3.0, 0.5]));
    for piece in [1, 1000, 16_385, 100_000] {
        let mut server = Server::new(ServerDialect::Controller, Carrier::Stream, ONE);
        let mut events = Vec::new();
        for chunk in stream.chunks(piece) {
            let mut rest = chunk;
            while !rest.is_empty() {
                let (used, event) = server.feed(rest).unwrap();
                rest = &rest[used..];
                if event == Event::InitLine {
                    assert_eq!(server.init_line(), b"gain=1.25 mm");
                }
                if !matches!(event, Event::NeedMore | Event::Ready(_)) {
                    events.push(event);
                }
            }
        }
        assert_eq!(
            events,
            [
                Event::InitLine,
                Event::InitLine,
                Event::Trial(Course::First)
            ]
        );
    }
}

#[test]
fn simulink_polls_are_told_apart_by_the_exact_double() {
    let mut machine = Simulink::new(Carrier::Stream, ONE);
    let sizes = sizes_bytes([1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 4]);
    assert!(matches!(
        machine.feed(&sizes),
        Ok((44, SimulinkEvent::Ready(_)))
    ));
    let send = |machine: &mut Simulink, values: &[f64]| machine.feed(&vector(4, values)).unwrap().1;
    assert_eq!(send(&mut machine, &[6.0]), SimulinkEvent::AtTarget);
    assert_eq!(
        doubles(machine.answer_signals(true, &[0.5, 1.4]).unwrap()),
        [1.0, 0.5, 1.4, 0.0]
    );
    assert_eq!(send(&mut machine, &[3.0, 0.25]), SimulinkEvent::Target);
    assert_eq!(machine.signals(), [0.25]);
    assert_eq!(send(&mut machine, &[4.0]), SimulinkEvent::Execute);
    assert_eq!(send(&mut machine, &[4.1]), SimulinkEvent::TargetTaken);
    assert_eq!(
        doubles(machine.answer_switch(true).unwrap()),
        [1.0, 0.0, 0.0, 0.0]
    );
    assert_eq!(send(&mut machine, &[4.2]), SimulinkEvent::TargetDone);
    assert!(machine.answer_switch(true).is_err());
    assert_eq!(send(&mut machine, &[4.3]), SimulinkEvent::SwitchedBack);
    assert!(machine.answer_signals(true, &[0.0, 0.0]).is_err());
    assert_eq!(doubles(machine.answer_switch(false).unwrap()), [0.0; 4]);
    assert_eq!(send(&mut machine, &[5.0]), SimulinkEvent::Commit);
    assert_eq!(send(&mut machine, &[10.0]), SimulinkEvent::Ignored(10.0));
    assert_eq!(send(&mut machine, &[99.0]), SimulinkEvent::Finished);
    assert_eq!(send(&mut machine, &[99.0]), SimulinkEvent::NeedMore);
    // N must leave room for the flag.
    let mut tight = Simulink::new(Carrier::Stream, ONE);
    assert!(
        tight
            .feed(&sizes_bytes([1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 2]))
            .is_err()
    );
}

// ---- UDP -------------------------------------------------------------------------------------------

#[test]
fn a_server_recognises_the_hello_and_does_without_it() {
    let sizes = sizes_bytes([1, 1, 1, 0, 1, 0, 0, 0, 1, 0, 8]);
    let mut with = Server::new(ServerDialect::Application, Carrier::Datagrams, ONE);
    for _ in 0..2 {
        assert_eq!(with.feed(b"a"), Ok((1, Event::Greeted)));
        assert_eq!(with.reply(), b"b");
    }
    assert!(matches!(with.feed(&sizes), Ok((44, Event::Ready(_)))));
    assert!(with.reply().is_empty());
    assert!(matches!(with.feed(b"a"), Ok((1, Event::Ignored(_)))));
    let mut without = Server::new(ServerDialect::Application, Carrier::Datagrams, ONE);
    assert!(matches!(without.feed(&sizes), Ok((44, Event::Ready(_)))));
}

#[test]
fn pieces_are_added_up_and_answers_go_in_the_same_pieces() {
    let mut server = Server::new(ServerDialect::Application, Carrier::Datagrams, ONE);
    server
        .feed(&sizes_bytes([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 256]))
        .unwrap();
    assert_eq!(server.piece(), DATAGRAM_LIMIT);
    let command = vector(256, &[3.0, 0.5]);
    let mut events = Vec::new();
    for piece in datagrams(&command, 2048, 512) {
        events.push(server.feed(piece).unwrap());
    }
    assert_eq!(events.len(), 4);
    assert_eq!(events[2], (512, Event::NeedMore));
    assert_eq!(events[3], (512, Event::Trial(Course::First)));
    assert_eq!(server.piece(), 512);
    // A datagram that holds more than the message misses is not of this protocol.
    assert!(matches!(
        server.feed(&vector(257, &[3.0])),
        Err(WireError::Count {
            field: "bytes of a datagram",
            expected: 2048,
            found: 2056
        })
    ));
    let lengths = |bytes: usize, message, piece| {
        datagrams(&vec![0; bytes], message, piece)
            .map(<[u8]>::len)
            .collect::<Vec<_>>()
    };
    assert_eq!(lengths(16_000, 16_000, 9126), [9126, 6874]);
    assert_eq!(lengths(4096, 2048, 9126), [2048, 2048]);
}

#[test]
fn the_table_of_udp_greetings() {
    let greeting = UdpGreeting::expected_by;
    let hello = UdpGreeting {
        hello: true,
        endian: false,
    };
    let both = UdpGreeting {
        hello: true,
        endian: true,
    };
    assert_eq!(greeting(Peer::OpenSees), hello);
    assert_eq!(greeting(Peer::OpenFrescoServer), UdpGreeting::NONE);
    assert_eq!(greeting(Peer::OpenFrescoSite), hello);
    assert_eq!(greeting(Peer::OldOpenFrescoServer), hello);
    assert_eq!(greeting(Peer::OldOpenFrescoSite), both);
    assert_eq!(greeting(Peer::CLibrary), UdpGreeting::NONE);
}

// ---- our two ends against each other ---------------------------------------------------------------

/// Feeds bytes to a server the way its carrier brings them, and returns the events.
fn deliver(server: &mut Server, bytes: &[u8], message: usize) -> Vec<Event> {
    let mut events = Vec::new();
    for piece in datagrams(bytes, message, DATAGRAM_LIMIT) {
        let mut rest = piece;
        while !rest.is_empty() {
            let (used, event) = server.feed(rest).unwrap();
            rest = &rest[used..];
            events.push(event);
        }
    }
    events
}

fn command<'a>(sequence: u64, disp: &'a [f64], vel: &'a [f64]) -> Command<'a> {
    Command {
        sequence,
        time: sequence as f64 * 0.01,
        dt: 0.01,
        disp,
        vel,
    }
}

#[test]
fn our_client_and_our_server_understand_each_other_at_the_smallest_n() {
    for carrier in [Carrier::Stream, Carrier::Datagrams] {
        for greeting in [UdpGreeting::NONE, UdpGreeting::expected_by(Peer::OpenSees)] {
            let sizes = Sizes::generic_client(2, 1).unwrap();
            let settings = ClientSettings {
                dialect: ClientDialect::Application,
                carrier,
                sizes,
                greeting,
            };
            let interface = Interface::of_axes(2);
            let mut client = Client::new(settings).unwrap();
            let mut server = Server::new(ServerDialect::Application, carrier, interface);
            let opening = client.open().unwrap().to_vec();
            let (_, mut event) = server.feed(&opening).unwrap();
            if event == Event::Greeted {
                let reply = server.reply().to_vec();
                assert_eq!(client.feed(&reply), Ok((1, ClientEvent::Greeted)));
                event = server.feed(client.reply()).unwrap().1;
            }
            assert_eq!(event, Event::Ready(sizes));

            let mut measured = Measurement::zeros(2);
            for sequence in 1..50 {
                let disp = [0.1 * sequence as f64, -0.2];
                let out = client
                    .command(&command(sequence, &disp, &[1.0, 2.0]))
                    .unwrap()
                    .to_vec();
                let events = deliver(&mut server, &out, client.vector_len());
                assert!(matches!(
                    events[..],
                    [Event::Trial(_), Event::Read(Reading::Force)]
                ));
                let got = server.trial().unwrap();
                assert_eq!(
                    (got.disp, got.vel, got.accel),
                    (&disp[..], &[1.0, 2.0][..], &[0.0; 2][..])
                );
                let force = [sequence as f64, 5.0];
                let response = Response {
                    force: &force,
                    ..Response::default()
                };
                let answer = server.answer(&response).unwrap().to_vec();
                assert_eq!(
                    client.feed(&answer),
                    Ok((answer.len(), ClientEvent::Answer(Asked::Signals)))
                );
                client.measurement(&mut measured).unwrap();
                assert_eq!(measured.sequence, sequence);
                assert_eq!(measured.force, force);
                assert!(!client.measures_disp());
                assert_eq!(measured.disp, disp);
                let out = client.commit(sequence as f64 * 0.01).unwrap().to_vec();
                let events = deliver(&mut server, &out, client.vector_len());
                assert_eq!(events, [Event::Commit { trials: 1 }]);
            }
            for kind in [
                Matrix::InitialStiffness,
                Matrix::TangentStiffness,
                Matrix::Damping,
                Matrix::Mass,
            ] {
                let out = client.request_matrix(kind).unwrap().to_vec();
                assert_eq!(
                    deliver(&mut server, &out, client.vector_len()),
                    [Event::Matrix(kind)]
                );
                let answer = server
                    .answer_matrix(&[1.0, 2.0, 3.0, 4.0])
                    .unwrap()
                    .to_vec();
                client.feed(&answer).unwrap();
                let mut rows = [0.0; 4];
                client.matrix(&mut rows).unwrap();
                assert_eq!(rows, [1.0, 2.0, 3.0, 4.0]);
            }
            let out = client.die().unwrap().to_vec();
            assert_eq!(
                deliver(&mut server, &out, client.vector_len()),
                [Event::Finished]
            );
            assert!(client.die().is_err());
        }
    }
}

#[test]
fn a_client_sends_nothing_while_an_answer_is_owed_and_takes_nothing_unasked() {
    let settings = ClientSettings {
        dialect: ClientDialect::Application,
        carrier: Carrier::Stream,
        sizes: Sizes::full(1, 1).unwrap(),
        greeting: UdpGreeting::NONE,
    };
    let mut client = Client::new(settings).unwrap();
    let order = |outcome: Result<&[u8], WireError>| matches!(outcome, Err(WireError::Order { .. }));
    assert!(order(client.command(&command(1, &[0.0], &[0.0]))));
    client.open().unwrap();
    assert!(order(client.open()));
    client.command(&command(1, &[0.0], &[0.0])).unwrap();
    assert!(order(client.command(&command(2, &[0.0], &[0.0]))));
    assert!(order(client.commit(0.1)));
    let answer = vector(5, &[0.5, 0.0, 0.0, 7.0, 0.25]);
    assert_eq!(client.feed(&answer[..39]), Ok((39, ClientEvent::NeedMore)));
    assert_eq!(
        client.feed(&answer[39..]),
        Ok((1, ClientEvent::Answer(Asked::Signals)))
    );
    let mut measured = Measurement::zeros(1);
    client.measurement(&mut measured).unwrap();
    assert_eq!(
        (measured.disp[0], measured.force[0], measured.time),
        (0.5, 7.0, 0.25)
    );
    assert!(matches!(
        client.feed(&answer),
        Err(WireError::Order {
            expected: "nothing",
            ..
        })
    ));
    assert_eq!(client.feed(&answer), Err(WireError::Failed));

    let mut client = Client::new(settings).unwrap();
    client.open().unwrap();
    client.command(&command(1, &[0.0], &[0.0])).unwrap();
    assert_eq!(
        client.feed(&vector(5, &[0.0, 0.0, 0.0, f64::NAN, 0.0])),
        Err(WireError::NotFinite {
            field: "measured response",
            index: 3
        })
    );
}

#[test]
fn an_adapter_gets_commands_and_force_requests_and_nothing_else() {
    let settings = ClientSettings {
        dialect: ClientDialect::Adapter,
        carrier: Carrier::Stream,
        sizes: Sizes::adapter(1, 1).unwrap(),
        greeting: UdpGreeting::NONE,
    };
    let mut client = Client::new(settings).unwrap();
    client.open().unwrap();
    let answer = vector(2, &[0.1, 0.28]);
    assert_eq!(
        doubles(client.command(&command(1, &[0.1], &[0.0])).unwrap()),
        [3.0, 0.1, 10.0, 0.0]
    );
    client.feed(&answer).unwrap();
    // After an answered 10 only a 3 may come.
    assert!(matches!(
        client.request(Reading::Force),
        Err(WireError::Order { .. })
    ));
    assert!(client.commit(0.1).is_err());
    assert!(client.request_matrix(Matrix::Mass).is_err());
    let response = Response {
        disp: &[0.2],
        ..Response::default()
    };
    client.trial(&response).unwrap();
    client.request(Reading::Force).unwrap();
    client.feed(&answer).unwrap();
    assert!(client.request(Reading::All).is_err());
    assert!(client.die().is_ok());
    // Sizes that crash the element are not sent.
    let blind = Sizes::new(Counts::new(1, 0, 0, 0, 0), Counts::new(0, 0, 0, 1, 0), 4).unwrap();
    assert!(
        Client::new(ClientSettings {
            sizes: blind,
            ..settings
        })
        .is_err()
    );
}

fn shadow_settings(carrier: Carrier, greeting: UdpGreeting) -> ShadowSettings {
    ShadowSettings {
        carrier,
        sizes: Sizes::new(Counts::new(1, 0, 0, 0, 1), Counts::new(1, 0, 0, 1, 0), 3).unwrap(),
        site: 5.0,
        version: 2.8,
        greeting,
    }
}

#[test]
fn our_shadow_and_our_actor_understand_each_other() {
    let none = UdpGreeting::NONE;
    let both = UdpGreeting::expected_by(Peer::OldOpenFrescoSite);
    let hello = UdpGreeting::expected_by(Peer::OpenFrescoSite);
    for (carrier, greeting) in [
        (Carrier::Stream, none),
        (Carrier::Datagrams, none),
        (Carrier::Datagrams, hello),
        (Carrier::Datagrams, both),
    ] {
        let mut shadow = Shadow::new(shadow_settings(carrier, greeting)).unwrap();
        let mut actor = Actor::new(carrier, ONE, 7.0);
        let mut out = vec![shadow.open().unwrap().to_vec()];
        let mut ready = 0;
        while !out.is_empty() {
            let mut back = Vec::new();
            for message in &out {
                let (used, event) = actor.feed(message).unwrap();
                assert_eq!(used, message.len());
                ready += usize::from(matches!(event, ActorEvent::Ready(_)));
                if !actor.reply().is_empty() {
                    back.push(actor.reply().to_vec());
                }
            }
            out.clear();
            for message in back {
                shadow.feed(&message).unwrap();
                out.extend(shadow.reply_messages().map(<[u8]>::to_vec));
            }
        }
        assert_eq!(ready, 1);
        let mut measured = Measurement::zeros(1);
        for sequence in 1..20 {
            let disp = [sequence as f64];
            let out = shadow
                .command(&command(sequence, &disp, &[0.0]))
                .unwrap()
                .to_vec();
            let events: Vec<_> = out
                .chunks(24)
                .map(|one| actor.feed(one).unwrap().1)
                .collect();
            assert!(matches!(
                events[..],
                [ActorEvent::Trial(_), ActorEvent::Read]
            ));
            let force = [2.0 * disp[0]];
            let response = Response {
                disp: &disp,
                force: &force,
                ..Response::default()
            };
            let answer = actor.answer(&response).unwrap().to_vec();
            assert_eq!(shadow.feed(&answer), Ok((24, ShadowEvent::Answer)));
            shadow.measurement(&mut measured).unwrap();
            assert_eq!((measured.disp[0], measured.force[0]), (disp[0], force[0]));
            let out = shadow.commit(sequence as f64 * 0.01).unwrap().to_vec();
            assert_eq!(actor.feed(&out), Ok((24, ActorEvent::Commit { trials: 1 })));
        }
        let out = shadow.die().unwrap().to_vec();
        assert_eq!(doubles(&out), [99.0, 5.0, 0.0]);
        assert_eq!(actor.feed(&out), Ok((24, ActorEvent::Finished)));
        assert_eq!(doubles(actor.reply()), [4.0, 7.0, 0.0]);
        let farewell = actor.reply().to_vec();
        assert_eq!(shadow.feed(&farewell), Ok((24, ShadowEvent::Finished)));
    }
}

#[test]
fn a_shadow_of_another_version_says_which() {
    let mut shadow = Shadow::new(shadow_settings(Carrier::Stream, UdpGreeting::NONE)).unwrap();
    shadow.open().unwrap();
    shadow.feed(&[1, 0, 0, 0]).unwrap();
    assert_eq!(doubles(shadow.reply())[..4], [1.0, 5.0, 2.8, 0.0]);
    let error = shadow.feed(&vector(256, &[0.0, 7.0, 2.7])).unwrap_err();
    assert_eq!(
        error,
        WireError::SiteVersion {
            expected: 2.8,
            found: 2.7
        }
    );
    assert_eq!(error.fault(), crate::substructure::LinkFault::Version);
}

/// An actor behind its set-up, with N = 3.
fn actor() -> Actor {
    let mut actor = Actor::new(Carrier::Stream, ONE, 7.0);
    actor.feed(&[1, 0, 0, 0]).unwrap();
    actor.feed(&vector(256, &[1.0, 5.0, 2.5])).unwrap();
    assert_eq!(doubles(actor.reply())[..4], [0.0, 7.0, 2.5, 0.0]);
    actor.feed(&vector(256, &[2.0, 3.0])).unwrap();
    let block = |counts: [i32; 5]| {
        counts
            .into_iter()
            .flat_map(i32::to_le_bytes)
            .collect::<Vec<_>>()
    };
    actor.feed(&block([1, 0, 0, 0, 0])).unwrap();
    let (_, event) = actor.feed(&block([0, 0, 0, 1, 0])).unwrap();
    assert!(matches!(event, ActorEvent::Ready(_)));
    actor
}

#[test]
fn an_actor_takes_a_later_setup_in_the_length_that_holds() {
    let mut actor = actor();
    assert!(matches!(
        actor.feed(&vector(3, &[3.0, 0.5])),
        Ok((24, ActorEvent::Trial(Course::First)))
    ));
    actor.feed(&vector(3, &[2.0, 16.0])).unwrap();
    let block: Vec<u8> = [1, 0, 0, 0, 0]
        .into_iter()
        .flat_map(i32::to_le_bytes)
        .collect();
    actor.feed(&block).unwrap();
    let block: Vec<u8> = [1, 0, 0, 1, 0]
        .into_iter()
        .flat_map(i32::to_le_bytes)
        .collect();
    actor.feed(&block).unwrap();
    assert!(matches!(
        actor.feed(&vector(16, &[3.0, 0.75])),
        Ok((128, ActorEvent::Trial(_)))
    ));
    assert_eq!(actor.trial().unwrap().disp, [0.75]);
}

#[test]
fn an_actor_refuses_what_the_real_one_would_die_of() {
    for wish in [0.0, -1.0, 2.5, 65_537.0, 1e300, f64::NAN] {
        let mut actor = Actor::new(Carrier::Stream, ONE, 7.0);
        actor.feed(&[1, 0, 0, 0]).unwrap();
        assert!(matches!(
            actor.feed(&vector(256, &[2.0, wish])),
            Err(WireError::Range {
                field: "data size N",
                ..
            })
        ));
    }
    let mut early = Actor::new(Carrier::Stream, ONE, 7.0);
    early.feed(&[1, 0, 0, 0]).unwrap();
    assert!(matches!(
        early.feed(&vector(256, &[3.0, 0.1])),
        Err(WireError::Order { .. })
    ));
    let mut http = Actor::new(Carrier::Stream, ONE, 7.0);
    assert!(matches!(
        http.feed(b"GET /"),
        Err(WireError::Foreign { .. })
    ));
    let mut noise = Actor::new(Carrier::Stream, ONE, 1.0);
    assert!(matches!(noise.feed(b"noise"), Err(WireError::Magic { .. })));
    let mut swapped = Actor::new(Carrier::Stream, ONE, 7.0);
    assert_eq!(swapped.feed(&[0, 0, 0, 1]), Ok((4, ActorEvent::Greeted)));
    assert_eq!(swapped.reply(), [1, 0, 0, 0]);
    let mut known = actor();
    for code in [7.0, 10.0, 12.0, 50.0] {
        assert_eq!(
            known.feed(&vector(3, &[code])),
            Ok((24, ActorEvent::Ignored(code)))
        );
    }
}

// ---- no allocation, no panic -----------------------------------------------------------------------

#[test]
fn the_exchange_allocates_nothing_after_the_set_up() {
    let sizes = Sizes::full(2, 1).unwrap();
    let settings = ClientSettings {
        dialect: ClientDialect::Application,
        carrier: Carrier::Stream,
        sizes,
        greeting: UdpGreeting::NONE,
    };
    let mut client = Client::new(settings).unwrap();
    let mut server = Server::new(
        ServerDialect::Application,
        Carrier::Stream,
        Interface::of_axes(2),
    );
    server.feed(client.open().unwrap()).unwrap();
    let mut measured = Measurement::zeros(2);
    let mut sum = 0.0;
    let info = allocation_counter::measure(|| {
        for sequence in 1..200 {
            let disp = [sequence as f64, 0.5];
            let mut rest = client
                .command(&command(sequence, &disp, &[0.0; 2]))
                .unwrap();
            while !rest.is_empty() {
                let (used, _) = server.feed(rest).unwrap();
                rest = &rest[used..];
            }
            let response = Response {
                disp: &disp,
                vel: &[0.0; 2],
                accel: &[0.0; 2],
                force: &disp,
                time: 0.5,
            };
            client.feed(server.answer(&response).unwrap()).unwrap();
            client.measurement(&mut measured).unwrap();
            sum += measured.force[0];
            server.feed(client.commit(0.5).unwrap()).unwrap();
        }
    });
    assert_eq!(info.count_total, 0);
    assert_eq!(sum, (199 * 200 / 2) as f64);
}

/// Bytes that often begin like a message, so that the depths are reached.
fn plausible() -> impl Strategy<Value = Vec<u8>> {
    let code = prop_oneof![
        prop::sample::select(vec![
            1.0, 2.0, 3.0, 4.0, 4.1, 4.2, 4.3, 5.0, 6.0, 10.0, 12.0, 99.0
        ]),
        any::<f64>(),
    ];
    let number = prop_oneof![any::<f64>(), -1.0..1.0, Just(0.0), Just(3.0), Just(256.0)];
    let message = (code, prop::collection::vec(number, 0..8))
        .prop_map(|(code, values)| [vec![code], values].concat())
        .prop_map(|values| {
            values
                .into_iter()
                .flat_map(f64::to_le_bytes)
                .collect::<Vec<_>>()
        });
    let integers = prop::collection::vec(-2_i32..6, 1..12)
        .prop_map(|values| values.into_iter().flat_map(i32::to_le_bytes).collect());
    prop_oneof![
        4 => message,
        1 => integers,
        1 => prop::collection::vec(any::<u8>(), 0..90),
    ]
}

/// Runs bytes through a machine; whatever it makes of them, it uses them up or fails, and stays failed.
fn drain<E>(bytes: &[u8], mut feed: impl FnMut(&[u8]) -> Result<(usize, E), WireError>) {
    let mut rest = bytes;
    while !rest.is_empty() {
        match feed(rest) {
            Ok((used, _)) => {
                assert!(used > 0 && used <= rest.len());
                rest = &rest[used..];
            }
            Err(_) => {
                assert!(feed(rest).is_err());
                return;
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn arbitrary_bytes_never_panic_in_any_machine(
        set_up: bool,
        chunks in prop::collection::vec(plausible(), 1..30),
        udp: bool,
        d_dialect: bool,
    ) {
        let carrier = if udp { Carrier::Datagrams } else { Carrier::Stream };
        let dialect = if d_dialect { ServerDialect::Controller } else { ServerDialect::Application };
        let sizes = sizes_bytes([1, 0, 0, 0, 1, 1, 0, 0, 1, 0, 4]);
        let mut server = Server::new(dialect, carrier, ONE);
        let mut simulink = Simulink::new(carrier, ONE);
        let mut site = if set_up { actor() } else { Actor::new(carrier, ONE, 1.0) };
        let settings = ClientSettings {
            dialect: ClientDialect::Application,
            carrier,
            sizes: Sizes::full(1, 1).unwrap(),
            greeting: UdpGreeting { hello: d_dialect, endian: false },
        };
        let mut client = Client::new(settings).unwrap();
        client.open().unwrap();
        let mut shadow = Shadow::new(shadow_settings(carrier, settings.greeting)).unwrap();
        shadow.open().unwrap();
        if set_up {
            server.feed(&sizes).unwrap();
            simulink.feed(&sizes).unwrap();
        }
        // 8 kB of first vectors, 44 bytes of sizes that are at most 4 kB of vectors.
        let limit = 8 * 65_536 * 4;
        let info = allocation_counter::measure(|| {
            for chunk in &chunks {
                drain(chunk, |bytes| server.feed(bytes));
                drain(chunk, |bytes| simulink.feed(bytes));
                drain(chunk, |bytes| site.feed(bytes));
                let _ = client.request(Reading::All);
                drain(chunk, |bytes| client.feed(bytes));
                drain(chunk, |bytes| shadow.feed(bytes));
                let response = Response::default();
                let _ = server.answer(&response);
                let _ = server.answer_matrix(&[1.0]);
                let _ = simulink.answer_switch(true);
                let _ = site.answer(&response);
            }
        });
        prop_assert!(info.bytes_max < limit);
    }

    #[test]
    fn commands_and_answers_come_back_as_they_were(
        n in 1_usize..20,
        spare in 0_usize..20,
        disp in prop::collection::vec(-1e9_f64..1e9, 20),
        force in prop::collection::vec(any::<f64>().prop_filter("finite", |f| f.is_finite()), 20),
        time in 0.0_f64..1e6,
        junk: u8,
    ) {
        let counts = Counts::new(n, n, 0, n, 1);
        let sizes = Sizes::new(counts, counts, 2 + 3 * n + spare).unwrap();
        let response = Response {
            disp: &disp[..n],
            vel: &force[..n],
            accel: &[],
            force: &force[..n],
            time,
        };
        let mut out = vec![junk; sizes.vector_len()];
        write_vector(&mut out, Some(3.0), &counts, &response).unwrap();
        let mut server = Server::new(ServerDialect::Application, Carrier::Stream, Interface::of_axes(n));
        let mut bytes = [0; 44];
        sizes.write(&mut bytes).unwrap();
        prop_assert_eq!(server.feed(&bytes).unwrap().1, Event::Ready(sizes));
        server.feed(&out).unwrap();
        prop_assert_eq!(server.trial().unwrap(), response);
        prop_assert!(out[8 * (2 + 3 * n)..].iter().all(|byte| *byte == 0));
    }
}
