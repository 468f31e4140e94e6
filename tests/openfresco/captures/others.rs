//! Polls of a real-time target, shadows, and recordings cut short.

use super::*;

#[test]
fn simulink_polls_are_served_as_recorded() {
    let capture = load(SIMULINK);
    for piece in PIECES {
        let interface = Interface { axes: 1, forces: 1 };
        let mut machine = Simulink::new(capture.carrier, interface);
        let mut last = SimulinkEvent::NeedMore;
        let mut ended = false;
        let mut commits = 0;
        let mut courses = Vec::new();
        for message in &capture.messages {
            let values = doubles(&message.bytes);
            let context = format!("simulink: {}", message.what);
            if message.from_client {
                let event = feed(
                    &message.bytes,
                    capture.carrier,
                    piece,
                    &SimulinkEvent::NeedMore,
                    |bytes| machine.feed(bytes),
                );
                let Some(event) = event else {
                    assert!(ended && message.what == "DIE", "{context}");
                    continue;
                };
                let name = match event {
                    SimulinkEvent::Ready(_) => "sizes",
                    SimulinkEvent::Target(course) => {
                        assert_eq!(machine.followed().signals(), &values[1..2], "{context}");
                        courses.push(course);
                        "setTrialResponse"
                    }
                    SimulinkEvent::AtTarget => "getDaqResponse",
                    SimulinkEvent::TargetTaken => "action 4.1",
                    SimulinkEvent::TargetDone => "action 4.2",
                    SimulinkEvent::SwitchedBack => "action 4.3",
                    SimulinkEvent::Commit => {
                        commits += 1;
                        "commitState"
                    }
                    SimulinkEvent::Finished => {
                        ended = true;
                        "DIE"
                    }
                    other => panic!("{context}: {other:?}"),
                };
                assert_eq!(name, message.what);
                last = event;
                continue;
            }
            let flag = values[0] == 1.0;
            match last {
                SimulinkEvent::AtTarget => {
                    let ours = machine.answer_signals(flag, &values[1..3]).unwrap();
                    agree(&context, ours, &message.bytes, 3);
                }
                SimulinkEvent::TargetTaken | SimulinkEvent::SwitchedBack => {
                    let ours = machine.answer_switch(flag).unwrap();
                    agree(&context, ours, &message.bytes, 1);
                }
                other => panic!("{context}: an answer to {other:?}"),
            }
        }
        // Five steps; the commit of the fifth is in the gap of the recording.
        assert!(ended && commits == 4);
        assert_eq!(courses[..2], [Course::First, Course::Repeat]);
        assert_eq!(courses[2..], [Course::Step; 5]);
    }
}

#[test]
fn a_shadow_is_served_as_recorded() {
    for name in SITES {
        let capture = load(name);
        for piece in PIECES {
            let interface = Interface { axes: 1, forces: 1 };
            let mut actor = Actor::new(capture.carrier, interface, 7.0);
            let mut last = ActorEvent::NeedMore;
            let mut courses = Vec::new();
            for message in &capture.messages {
                let values = doubles(&message.bytes);
                let context = format!("{name}: {}", message.what);
                if message.from_client {
                    let event = feed(
                        &message.bytes,
                        capture.carrier,
                        piece,
                        &ActorEvent::NeedMore,
                        |bytes| actor.feed(bytes),
                    );
                    let whats: &[&str] = match event {
                        None => &["setup", "sizeTrial"],
                        Some(ActorEvent::Greeted) => {
                            &["endian check", "udp hello", "endian check (1 byte)"]
                        }
                        Some(ActorEvent::Opened { site, version }) => {
                            assert_eq!((site, version), (5.0, 2.8), "{context}");
                            &["open"]
                        }
                        Some(ActorEvent::Ready(_)) => &["sizeOut"],
                        Some(ActorEvent::Trial(course)) => {
                            assert_eq!(actor.followed().unwrap().trial().disp, &values[1..2]);
                            courses.push(course);
                            &["setTrialResponse"]
                        }
                        Some(ActorEvent::Commit { trials }) => {
                            assert_eq!(trials, 1, "{context}");
                            &["commitState"]
                        }
                        Some(ActorEvent::Read) => &["getDaqResponse"],
                        Some(ActorEvent::Finished) => &["DIE"],
                        Some(other) => panic!("{context}: {other:?}"),
                    };
                    assert!(whats.contains(&message.what.as_str()), "{context}");
                    last = event.unwrap_or(ActorEvent::NeedMore);
                    continue;
                }
                match last {
                    ActorEvent::Greeted => assert_eq!(actor.reply(), message.bytes, "{context}"),
                    ActorEvent::Opened { .. } => {
                        agree(&context, actor.reply(), &message.bytes, 3);
                    }
                    ActorEvent::Finished => agree(&context, actor.reply(), &message.bytes, 2),
                    ActorEvent::Read => {
                        let force = [values[0]];
                        let measured = Response {
                            force: &force,
                            ..Response::default()
                        };
                        agree(
                            &context,
                            actor.answer(&measured).unwrap(),
                            &message.bytes,
                            1,
                        );
                    }
                    other => panic!("{context}: an answer to {other:?}"),
                }
            }
            assert_eq!(last, ActorEvent::Finished);
            assert_eq!(courses[0], Course::First);
            assert_eq!(courses[1..], [Course::Step; 4]);
        }
    }
}

#[test]
fn our_shadow_sends_what_the_real_one_sent() {
    for name in SITES {
        let capture = load(name);
        let what = |part: &str| capture.messages.iter().any(|message| message.what == part);
        let setup = capture
            .messages
            .iter()
            .find(|message| message.what == "setup");
        let data_size = doubles(&setup.unwrap().bytes)[1] as usize;
        let sizes = Sizes::new(
            Counts::new(1, 0, 0, 0, 0),
            Counts::new(0, 0, 0, 1, 0),
            data_size,
        );
        for piece in PIECES {
            let mut shadow = Shadow::new(ShadowSettings {
                carrier: capture.carrier,
                sizes: sizes.unwrap(),
                site: 5.0,
                version: 2.8,
                greeting: UdpGreeting {
                    hello: what("udp hello"),
                    endian: what("endian check (1 byte)"),
                },
            })
            .unwrap();
            // The messages that our side must send before the next answer.
            let mut due = vec![shadow.open().unwrap().to_vec()];
            let mut ended = false;
            for message in &capture.messages {
                let values = doubles(&message.bytes);
                let context = format!("{name}: {}", message.what);
                if !message.from_client {
                    assert!(due.is_empty(), "{context}");
                    let event = feed(
                        &message.bytes,
                        capture.carrier,
                        piece,
                        &ShadowEvent::NeedMore,
                        |bytes| shadow.feed(bytes),
                    );
                    match event.unwrap() {
                        ShadowEvent::NeedMore => panic!("{context}"),
                        ShadowEvent::Greeted => {}
                        ShadowEvent::Ready { site } => assert_eq!(site, 7.0),
                        ShadowEvent::Answer => {
                            assert_eq!(shadow.measured().force, &values[..1], "{context}");
                        }
                        ShadowEvent::Finished => ended = true,
                    }
                    due = shadow.reply_messages().map(<[u8]>::to_vec).collect();
                    continue;
                }
                let defined = match message.what.as_str() {
                    "open" => 3,
                    "setup" | "setTrialResponse" | "DIE" => 2,
                    "getDaqResponse" | "commitState" => 1,
                    _ => {
                        // Greetings and sizes are compared byte by byte.
                        assert_eq!(due.remove(0), message.bytes, "{context}");
                        continue;
                    }
                };
                let ours = match message.what.as_str() {
                    "setTrialResponse" => {
                        let signals = response(&values[1..], &Counts::new(1, 0, 0, 0, 0));
                        shadow.trial(&signals).unwrap().to_vec()
                    }
                    "getDaqResponse" => shadow.request().unwrap().to_vec(),
                    "commitState" => shadow.commit(0.0).unwrap().to_vec(),
                    "DIE" => shadow.die().unwrap().to_vec(),
                    _ => due.remove(0),
                };
                agree(&context, &ours, &message.bytes, defined);
            }
            assert!(ended, "{name}");
        }
    }
}

#[test]
fn truncated_recording_waits_for_more() {
    for name in ["opensees-genericClient-tcp-1dof-alphaos", SIMULINK] {
        let capture = load(name);
        let stream: Vec<u8> = capture
            .messages
            .iter()
            .filter(|message| message.from_client)
            .flat_map(|message| message.bytes.clone())
            .collect();
        let interface = Interface { axes: 1, forces: 1 };
        for end in (0..stream.len().min(3000)).step_by(7) {
            let mut server = Server::new(ServerDialect::Application, Carrier::Stream, interface);
            let mut rest = &stream[..end];
            while !rest.is_empty() {
                let (used, _) = server.feed(rest).unwrap();
                assert!(used > 0);
                rest = &rest[used..];
            }
        }
    }
}

#[test]
fn command_and_request_leave_in_one_piece() {
    let capture = load(ADAPTER[1]);
    let pair: Vec<_> = capture
        .messages
        .windows(2)
        .find(|pair| pair[0].what == "setTrialResponse" && pair[1].what == "getForce")
        .unwrap()
        .iter()
        .map(|message| message.bytes.clone())
        .collect();
    let mut client = Client::new(ClientSettings {
        dialect: ClientDialect::Adapter,
        carrier: Carrier::Datagrams,
        sizes: Sizes::adapter(1, 256).unwrap(),
        greeting: UdpGreeting::NONE,
    })
    .unwrap();
    client.open().unwrap();
    let disp = [doubles(&pair[0])[1]];
    let command = gusset_quantity::substructure::Command {
        sequence: 1,
        time: 0.0,
        dt: 0.0,
        disp: &disp,
        vel: &[0.0],
    };
    let ours = client.command(&command).unwrap();
    let messages: Vec<_> = datagrams(ours, 2048, DATAGRAM_LIMIT).collect();
    assert_eq!(messages.len(), 2);
    agree("command", messages[0], &pair[0], 2);
    agree("request", messages[1], &pair[1], 1);
}
