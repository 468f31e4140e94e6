//! The server answers clients as recorded, and our clients send the recorded bytes.

use super::*;

/// Plays the server of a capture: the client's bytes give the recorded events, and the recorded answers, taken
/// apart and encoded again, are the recorded bytes. Returns the courses of the commands and the number of commits.
fn serve(capture: &Capture, dialect: ServerDialect, piece: usize) -> (Vec<Course>, usize) {
    let sizes = capture
        .messages
        .iter()
        .find(|message| message.what == "sizes");
    let sizes = Sizes::parse(&sizes.unwrap().bytes).unwrap();
    let interface = Interface {
        axes: sizes.ctrl().disp,
        forces: sizes.daq().force,
    };
    let mut server = Server::new(dialect, capture.carrier, interface);
    let (mut last, mut ended) = (Event::NeedMore, false);
    let (mut courses, mut commits) = (Vec::new(), 0);
    for message in &capture.messages {
        let context = format!("{}: {}", capture.name, message.what);
        let values = doubles(&message.bytes);
        if message.from_client {
            let event = feed(
                &message.bytes,
                capture.carrier,
                piece,
                &Event::NeedMore,
                |bytes| server.feed(bytes),
            );
            let Some(event) = event else {
                assert!(ended && message.what == "DIE", "{context}");
                continue;
            };
            assert_eq!(name_of(&event), message.what, "{context}");
            match event {
                Event::Trial(course) => {
                    let expected = response(&values[1..], sizes.ctrl());
                    assert_eq!(server.followed().unwrap().trial(), expected, "{context}");
                    courses.push(course);
                }
                Event::Commit { .. } => commits += 1,
                Event::Finished => ended = true,
                _ => {}
            }
            last = event;
            continue;
        }
        match last {
            Event::Greeted => assert_eq!(server.reply(), message.bytes, "{context}"),
            Event::Read(_) => {
                let measured = response(&values, sizes.daq());
                let ours = server.answer(&measured).unwrap();
                agree(&context, ours, &message.bytes, sizes.daq().total());
            }
            Event::Matrix(_) => {
                let n = sizes.ctrl().disp;
                let ours = server.answer_matrix(&rows(&values, n)).unwrap();
                agree(&context, ours, &message.bytes, n * n);
            }
            other => panic!("{context}: an answer to {other:?}"),
        }
    }
    assert!(ended, "{}", capture.name);
    (courses, commits)
}

#[test]
fn application_clients_match_the_recording() {
    for name in APPLICATION {
        let capture = load(name);
        for piece in PIECES {
            let (courses, commits) = serve(&capture, ServerDialect::Application, piece);
            // No recorded test takes a step back, and every commit ends one step that began with a first try.
            let first_moves = name.contains("element") || name.contains("c-client");
            let steps = courses
                .iter()
                .filter(|course| match course {
                    Course::First => first_moves,
                    Course::Step => true,
                    Course::Iteration | Course::Repeat => false,
                    other => panic!("{name}: {other:?}"),
                })
                .count();
            assert_eq!(steps, commits, "{name}: {courses:?}");
        }
    }
}

#[test]
fn adapter_clients_match_the_recording() {
    for piece in PIECES {
        for name in ADAPTER {
            serve(&load(name), ServerDialect::Application, piece);
        }
        let (courses, commits) = serve(&load(GENERIC_TCP), ServerDialect::Controller, piece);
        assert_eq!(commits, 0);
        assert_eq!(courses[0], Course::First);
        assert!(courses[1..].iter().all(|course| *course == Course::Step));
    }
}

/// Plays the client of a capture: it sends the recorded bytes, and understands the recorded answers.
fn command(capture: &Capture, dialect: ClientDialect, piece: usize) {
    let sizes = capture
        .messages
        .iter()
        .find(|message| message.what == "sizes");
    let sizes = Sizes::parse(&sizes.unwrap().bytes).unwrap();
    let hello = capture.messages[0].what == "udp hello";
    let mut client = Client::new(ClientSettings {
        dialect,
        carrier: capture.carrier,
        sizes,
        greeting: UdpGreeting {
            hello,
            endian: false,
        },
    })
    .unwrap();
    let (ctrl, daq) = (*sizes.ctrl(), *sizes.daq());
    let mut matrix = false;
    let mut ended = false;
    for message in &capture.messages {
        let context = format!("{}: {}", capture.name, message.what);
        let values = doubles(&message.bytes);
        if !message.from_client {
            let event = feed(
                &message.bytes,
                capture.carrier,
                piece,
                &ClientEvent::NeedMore,
                |bytes| client.feed(bytes),
            );
            match event.unwrap() {
                ClientEvent::NeedMore => panic!("{context}"),
                ClientEvent::Greeted => {}
                ClientEvent::Answer(Asked::Signals) => {
                    assert!(!matrix, "{context}");
                    assert_eq!(client.measured(), response(&values, &daq), "{context}");
                }
                ClientEvent::Answer(Asked::Matrix(_)) => {
                    assert!(matrix, "{context}");
                    let mut ours = vec![0.0; ctrl.disp * ctrl.disp];
                    client.matrix(&mut ours).unwrap();
                    assert_eq!(ours, rows(&values, ctrl.disp), "{context}");
                }
            }
            continue;
        }
        if let "udp hello" | "sizes" = message.what.as_str() {
            if client.reply().is_empty() {
                assert_eq!(client.open().unwrap(), message.bytes, "{context}");
            } else {
                assert_eq!(client.reply(), message.bytes, "{context}");
            }
            continue;
        }
        let action = Action::whole(values[0]).unwrap().unwrap();
        matrix = matches!(action, Action::Give(_));
        match action {
            Action::Trial => {
                let signals = response(&values[1..], &ctrl);
                let ours = client.trial(&signals).unwrap();
                agree(&context, ours, &message.bytes, 1 + ctrl.total());
            }
            Action::Commit => {
                let at = 1 + ctrl.total() - ctrl.time;
                let time = if ctrl.time == 1 { values[at] } else { 0.0 };
                let ours = doubles(client.commit(time).unwrap());
                assert_eq!(ours[0], 5.0, "{context}");
                if ctrl.time == 1 {
                    assert_eq!(ours[at], values[at], "{context}");
                }
            }
            Action::Read(reading) => {
                agree(
                    &context,
                    client.request(reading).unwrap(),
                    &message.bytes,
                    1,
                );
            }
            Action::Give(kind) => {
                let ours = client.request_matrix(kind).unwrap();
                agree(&context, ours, &message.bytes, 1);
            }
            // OpenFresco sends it twice; our client sends it once.
            Action::Die if ended => assert!(client.die().is_err()),
            Action::Die => {
                agree(&context, client.die().unwrap(), &message.bytes, 1);
                ended = true;
            }
            other => panic!("{context}: {other:?}"),
        }
    }
    assert!(ended, "{}", capture.name);
}

#[test]
fn our_client_sends_what_real_clients_sent() {
    for piece in PIECES {
        for name in APPLICATION {
            command(&load(name), ClientDialect::Application, piece);
        }
        for name in ADAPTER {
            command(&load(name), ClientDialect::Adapter, piece);
        }
        command(&load(GENERIC_TCP), ClientDialect::Application, piece);
    }
}
