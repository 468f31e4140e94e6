//! Our two ends against each other.

use super::*;

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

#[test]
fn client_and_server_agree_at_smallest_n() {
    for carrier in [Carrier::Stream, Carrier::Datagrams] {
        for greeting in [
            UdpGreeting::NONE,
            UdpGreeting::expected_by(Program::OpenSees),
        ] {
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
                let got = server.followed().unwrap().trial();
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
fn client_is_silent_while_an_answer_is_owed() {
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
fn adapter_gets_commands_and_force_requests() {
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

#[test]
fn shadow_and_actor_understand_each_other() {
    let none = UdpGreeting::NONE;
    let both = UdpGreeting::expected_by(Program::OldOpenFrescoSite);
    let hello = UdpGreeting::expected_by(Program::OpenFrescoSite);
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
fn shadow_of_another_version_is_refused() {
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
    assert_eq!(
        error.fault(),
        gusset_quantity::substructure::LinkFault::Version
    );
}

#[test]
fn actor_takes_a_later_setup() {
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
    assert_eq!(actor.followed().unwrap().trial().disp, [0.75]);
}

#[test]
fn actor_refuses_fatal_messages() {
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
