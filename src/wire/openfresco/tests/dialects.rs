//! Dialects that differ from it, and what UDP adds.

use super::*;

#[test]
fn generic_tcp_commits_by_moving_on() {
    let mut server = Server::new(ServerDialect::Controller, Carrier::Stream, ONE);
    server
        .feed(&sizes_bytes([1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 4]))
        .unwrap();
    let mut send = |values: &[f64]| server.feed(&vector(4, values)).unwrap().1;
    assert_eq!(send(&[3.0, 0.0]), Event::Trial(Course::First));
    assert_eq!(send(&[6.0]), Event::Read(Reading::All));
    for disp in [0.0, 0.1, 0.2, 0.2, 0.1, 0.0, 0.1] {
        assert_eq!(send(&[3.0, disp]), Event::Trial(Course::Step));
    }
    assert_eq!(send(&[99.0]), Event::Finished);
}

#[test]
fn init_file_lines_are_skipped() {
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
fn simulink_polls_differ_by_exact_doubles() {
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
    assert_eq!(
        send(&mut machine, &[3.0, 0.25]),
        SimulinkEvent::Target(Course::First)
    );
    assert_eq!(machine.followed().signals(), [0.25]);
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

/// Sizes of two axes with displacement and velocity out, displacement and force back.
const TWO_BY_TWO: [i32; 11] = [2, 2, 0, 0, 0, 2, 0, 0, 2, 0, 8];

fn two_axes(order: Option<SignalOrder>) -> Simulink {
    Simulink::new(Carrier::Stream, Interface::of_axes(2)).in_order(order)
}

#[test]
fn simulink_signals_follow_the_named_order() {
    for (order, disp, vel, answer) in [
        (
            SignalOrder::ByAxis,
            [0.001, 0.002],
            [0.5, 0.7],
            [1.0, 10.0, 30.0, 20.0, 40.0],
        ),
        (
            SignalOrder::ByQuantity,
            [0.001, 0.5],
            [0.002, 0.7],
            [1.0, 10.0, 20.0, 30.0, 40.0],
        ),
    ] {
        let mut machine = two_axes(Some(order));
        machine.feed(&sizes_bytes(TWO_BY_TWO)).unwrap();
        let command = vector(8, &[3.0, 0.001, 0.5, 0.002, 0.7]);
        let (_, event) = machine.feed(&command).unwrap();
        assert_eq!(event, SimulinkEvent::Target(Course::First));
        assert_eq!(
            (
                machine.followed().trial().disp,
                machine.followed().trial().vel
            ),
            (&disp[..], &vel[..])
        );
        assert_eq!(machine.followed().signals(), [disp, vel].concat());
        machine.feed(&vector(8, &[6.0])).unwrap();
        // d1 d2 f1 f2.
        let signals = [10.0, 20.0, 30.0, 40.0];
        let found = doubles(machine.answer_signals(true, &signals).unwrap());
        assert_eq!(found[..5], answer);
        assert_eq!(found[5..], [0.0; 3]);
    }
}

#[test]
fn simulink_signals_need_an_order() {
    let mut commanded = TWO_BY_TWO;
    commanded[5..10].copy_from_slice(&[0, 0, 0, 2, 0]);
    let mut measured = TWO_BY_TWO;
    measured[1] = 0;
    for counts in [TWO_BY_TWO, commanded, measured] {
        let outcome = two_axes(None).feed(&sizes_bytes(counts)).map(|_| ());
        let refused = Err(WireError::SignalOrder {
            axes: 2,
            quantities: 2,
        });
        assert_eq!(outcome, refused, "{counts:?}");
    }
    // One quantity each way: there is but one order.
    let mut plain = commanded;
    plain[1] = 0;
    assert!(two_axes(None).feed(&sizes_bytes(plain)).is_ok());
    // The others arrange their signals by quantity.
    for dialect in [ServerDialect::Application, ServerDialect::Controller] {
        let mut server = Server::new(dialect, Carrier::Stream, Interface::of_axes(2));
        server.feed(&sizes_bytes(TWO_BY_TWO)).unwrap();
        server
            .feed(&vector(8, &[3.0, 0.001, 0.002, 0.5, 0.7]))
            .unwrap();
        assert_eq!(server.followed().unwrap().trial().disp, [0.001, 0.002]);
    }
}

/// OpenFresco's user may put the time into any control point: d1 t d2.
#[test]
fn time_is_placed_by_quantity_or_refused() {
    let commanded = [2, 0, 0, 0, 1, 2, 0, 0, 0, 0, 8];
    let measured = [2, 0, 0, 0, 0, 0, 0, 0, 2, 1, 8];
    for counts in [commanded, measured] {
        let feed = |order| two_axes(order).feed(&sizes_bytes(counts)).map(|_| ());
        let unknown = Err(WireError::SignalOrder {
            axes: 2,
            quantities: 2,
        });
        assert_eq!(feed(None), unknown, "{counts:?}");
        let refused = Err(WireError::TimePlace { axes: 2 });
        assert_eq!(feed(Some(SignalOrder::ByAxis)), refused, "{counts:?}");
        assert_eq!(feed(Some(SignalOrder::ByQuantity)), Ok(()), "{counts:?}");
    }
    let mut machine = two_axes(Some(SignalOrder::ByQuantity));
    machine.feed(&sizes_bytes(commanded)).unwrap();
    machine
        .feed(&vector(8, &[3.0, 0.001, 0.0005, 0.01]))
        .unwrap();
    assert_eq!(machine.followed().trial().disp, [0.001, 0.0005]);
    assert_eq!(machine.followed().trial().time, 0.01);
}

#[test]
fn misannounced_old_simulink_is_refused() {
    let by_axis = Some(SignalOrder::ByAxis);
    let by_quantity = Some(SignalOrder::ByQuantity);
    for (order, counts, is_served) in [
        // One axis: displacement, force and time, then velocity, then acceleration in the answer.
        (None, [1, 0, 0, 0, 1, 1, 0, 0, 1, 1, 8], true),
        (None, [1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 8], false),
        (None, [1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 8], false),
        // Two axes.
        (by_quantity, [2, 0, 0, 0, 0, 2, 0, 0, 2, 0, 8], true),
        (by_axis, [2, 0, 0, 0, 0, 2, 0, 0, 2, 0, 8], false),
    ] {
        let axes = usize::try_from(counts[0]).unwrap();
        let mut machine = Simulink::new(Carrier::Stream, Interface::of_axes(axes)).in_order(order);
        machine.feed(&sizes_bytes(counts)).unwrap();
        machine.feed(&vector(8, &[3.0, 0.0, 0.0])).unwrap();
        let outcome = machine.feed(&vector(8, &[4.0])).map(|(_, event)| event);
        if is_served {
            assert_eq!(outcome, Ok(SimulinkEvent::Execute), "{counts:?}");
        } else {
            assert_eq!(outcome, Err(WireError::OldSimulink), "{counts:?}");
        }
    }
}

// ---- UDP -------------------------------------------------------------------------------------------

#[test]
fn server_works_with_or_without_hello() {
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
fn pieces_are_joined_and_answered_alike() {
    let mut server = Server::new(ServerDialect::Application, Carrier::Datagrams, ONE);
    server
        .feed(&sizes_bytes([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 256]))
        .unwrap();
    assert_eq!(server.inbox().piece(), DATAGRAM_LIMIT);
    let command = vector(256, &[3.0, 0.5]);
    let mut events = Vec::new();
    for piece in datagrams(&command, 2048, 512) {
        events.push(server.feed(piece).unwrap());
    }
    assert_eq!(events.len(), 4);
    assert_eq!(events[2], (512, Event::NeedMore));
    assert_eq!(events[3], (512, Event::Trial(Course::First)));
    assert_eq!(server.inbox().piece(), 512);
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
fn udp_greetings_match_the_table() {
    let greeting = UdpGreeting::expected_by;
    let hello = UdpGreeting {
        hello: true,
        endian: false,
    };
    let both = UdpGreeting {
        hello: true,
        endian: true,
    };
    assert_eq!(greeting(Program::OpenSees), hello);
    assert_eq!(greeting(Program::OpenFrescoServer), UdpGreeting::NONE);
    assert_eq!(greeting(Program::OpenFrescoSite), hello);
    assert_eq!(greeting(Program::OldOpenFrescoServer), hello);
    assert_eq!(greeting(Program::OldOpenFrescoSite), both);
    assert_eq!(greeting(Program::CLibrary), UdpGreeting::NONE);
}
