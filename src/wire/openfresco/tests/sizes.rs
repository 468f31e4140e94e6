//! The sizes that open a session, and the vectors that follow.

use super::*;
use crate::openfresco::vector::{read_matrix, write_action, write_matrix, write_vector};

#[test]
fn sizes_have_known_bytes() {
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
fn n_is_raised_to_the_need() {
    let n = |sizes: Result<Sizes, WireError>| sizes.unwrap().data_size();
    assert_eq!(n(Sizes::generic_client(1, 5)), 5);
    assert_eq!(n(Sizes::generic_client(4, 1)), 16);
    assert_eq!(n(Sizes::generic_client(2, 1)), 8);
    assert_eq!(n(Sizes::adapter(2, 1)), 4);
    assert_eq!(n(Sizes::adapter(1, 256)), 256);
    assert_eq!(n(Sizes::full(3, 1)), 13);
}

#[test]
fn bad_sizes_are_refused_with_the_number() {
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
                assert_eq!((found, number), (field, i128::from(value)));
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
    // OpenFresco's invertedVBrace: three displacements, six forces. A server with one force for each displacement refuses it.
    let equal = Interface::of_axes(3);
    let brace = Counts::new(3, 3, 3, 6, 1);
    let refused = equal.check(&Counts::new(3, 3, 3, 0, 1), &brace);
    assert_eq!(refused, Err(WireError::UnequalForces { disp: 3, found: 6 }));
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

#[test]
fn commanded_forces_are_refused_at_sizes() {
    let three = Interface { axes: 3, forces: 3 };
    let daq = Counts::new(3, 3, 3, 3, 1);
    // OpenFresco's bearing with and without force control.
    for (force, outcome) in [
        (0, Ok(())),
        (3, Err(WireError::CommandedForces { found: 3 })),
    ] {
        let ctrl = Counts::new(3, 3, 3, force, 1);
        assert_eq!(three.check(&ctrl, &daq), outcome);
    }
    // Force control alone, and one force beside one displacement, over every dialect.
    let refused = Err(WireError::CommandedForces { found: 1 });
    for ctrl in [[0, 0, 0, 1, 0], [1, 0, 0, 1, 0]] {
        let [d, v, a, f, t] = ctrl;
        let bytes = sizes_bytes([d, v, a, f, t, 1, 0, 0, 1, 0, 8]);
        for dialect in [ServerDialect::Application, ServerDialect::Controller] {
            let mut server = Server::new(dialect, Carrier::Stream, ONE);
            assert_eq!(server.feed(&bytes).map(|_| ()), refused);
        }
        let mut simulink = Simulink::new(Carrier::Stream, ONE);
        assert_eq!(simulink.feed(&bytes).map(|_| ()), refused);
    }
    let mut actor = Actor::new(Carrier::Stream, ONE, 7.0);
    actor.feed(&[1, 0, 0, 0]).unwrap();
    actor.feed(&vector(256, &[1.0, 5.0, 2.5])).unwrap();
    actor.feed(&vector(256, &[2.0, 8.0])).unwrap();
    let block = |counts: [i32; 5]| counts.into_iter().flat_map(i32::to_le_bytes);
    actor
        .feed(&block([1, 0, 0, 1, 0]).collect::<Vec<_>>())
        .unwrap();
    let daq: Vec<u8> = block([1, 0, 0, 1, 0]).collect();
    assert_eq!(actor.feed(&daq).map(|_| ()), refused);
}

// ---- vectors ---------------------------------------------------------------------------------------

#[test]
fn command_is_padded_with_zeros() {
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
