//! Meaning of commands, tested with those of real analyses: displacements, velocities and times are those of OpenSees
//! 3.7.1, rounded.

use super::*;

fn moving(server: &mut Server, disp: f64, vel: f64, time: f64) -> Course {
    match message(server, &[3.0, disp, vel, 0.0, time]) {
        Event::Trial(course) => course,
        other => panic!("{other:?}"),
    }
}

/// A server whose last commit was at this displacement, velocity and time.
fn committed(disp: f64, vel: f64, time: f64) -> Server {
    let mut server = generic();
    moving(&mut server, 0.0, 0.0, 0.0);
    moving(&mut server, disp, vel, time);
    commit(&mut server, time);
    server
}

#[test]
fn scheme_between_steps_takes_back_to_later() {
    // HHT and GeneralizedAlpha: what was committed at 0.499 is the step to 0.5.
    for (base, ahead) in [(0.499, 0.509), (0.498, 0.508)] {
        let mut server = committed(0.0073, 0.20, base);
        assert_eq!(moving(&mut server, 0.0073, -0.16, ahead), Course::Step);
        assert_eq!(moving(&mut server, 0.0091, 0.21, ahead), Course::Iteration);
        assert_eq!(moving(&mut server, 0.0073, 0.20, 0.5), Course::TakenBack);
        assert_eq!(server.followed().unwrap().dt(), Some(0.0));
        let next = ahead - 0.0075;
        assert_eq!(moving(&mut server, 0.0073, -0.16, next), Course::Step);
        assert_eq!(server.followed().unwrap().dt(), Some(next - 0.5));
        assert_eq!(moving(&mut server, 0.0077, 0.20, next), Course::Iteration);
    }
}

#[test]
fn scheme_past_a_step_takes_back_to_earlier() {
    // WilsonTheta and Collocation: what was committed at 0.4942 is the step to 0.49, and a shorter one ends before 0.4942.
    let mut server = committed(0.0055, 0.19, 0.4942);
    assert_eq!(moving(&mut server, 0.0055, -0.38, 0.5042), Course::Step);
    assert_eq!(moving(&mut server, 0.0082, 0.20, 0.5042), Course::Iteration);
    assert_eq!(moving(&mut server, 0.0055, 0.19, 0.49), Course::TakenBack);
    assert_eq!(moving(&mut server, 0.0055, -0.38, 0.4936), Course::Step);
    assert_eq!(server.followed().unwrap().dt(), Some(0.4936 - 0.49));
    assert_eq!(moving(&mut server, 0.0061, 0.19, 0.4936), Course::Iteration);
    assert_eq!(moving(&mut server, 0.0055, 0.19, 0.49), Course::TakenBack);
}

#[test]
fn look_ahead_is_not_a_step_back() {
    let mut server = committed(0.0055, 0.19, 0.4942);
    assert_eq!(moving(&mut server, 0.0055, -0.38, 0.5042), Course::Step);
    assert_ne!(moving(&mut server, 0.0055, 0.19, 0.49), Course::TakenBack);
    // But the true time of the last step is known now.
    assert_eq!(moving(&mut server, 0.0061, 0.19, 0.4936), Course::Step);
    assert_eq!(server.followed().unwrap().dt(), Some(0.4936 - 0.49));
}

#[test]
fn unsent_displacement_is_the_last_commit() {
    let mut server = committed(0.1, 0.2, 0.02);
    assert_eq!(moving(&mut server, 0.3, 0.3, 0.04), Course::Step);
    let back = 0.1 + 2e-16;
    assert!(back != 0.1);
    assert_eq!(moving(&mut server, back, 0.2, 0.02), Course::TakenBack);
}

#[test]
fn load_factor_may_fall() {
    // DisplacementControl past the peak of a softening storey.
    let mut server = generic();
    trial(&mut server, 0.0, 0.0);
    trial(&mut server, 0.007, 49.0);
    commit(&mut server, 49.0);
    assert_eq!(trial(&mut server, 0.008, 56.0), Course::Step);
    // Below the last commit, above it, and at it.
    assert_eq!(trial(&mut server, 0.0081, 47.0), Course::Iteration);
    assert_eq!(trial(&mut server, 0.0079, 49.5), Course::Iteration);
    assert_eq!(trial(&mut server, 0.008, 49.0), Course::Iteration);
    assert_eq!(trial(&mut server, 0.008, 48.4), Course::Iteration);
    commit(&mut server, 48.4);
    assert_eq!(trial(&mut server, 0.009, 47.8), Course::NewOrigin);
    assert_eq!(server.followed().unwrap().dt(), None);
    assert_eq!(trial(&mut server, 0.009, 47.7), Course::Iteration);
    // Given up, although the load factor rises by it.
    assert_eq!(trial(&mut server, 0.008, 48.4), Course::TakenBack);
    commit(&mut server, 48.4);
}

#[test]
fn unmoved_steps_are_never_taken_back() {
    let mut server = generic();
    trial(&mut server, 0.0, 0.0);
    for load in [7.0, 5.0, 6.0, 4.0] {
        let course = trial(&mut server, 0.0, load);
        assert!(!matches!(course, Course::TakenBack | Course::Reversed));
    }
}

#[test]
fn reversal_past_a_commit_is_recognised() {
    let mut server = committed(0.1, 0.2, 0.02);
    moving(&mut server, 0.12, 0.3, 0.03);
    commit(&mut server, 0.03);
    assert_eq!(moving(&mut server, 0.15, 0.3, 0.04), Course::Step);
    assert_eq!(moving(&mut server, 0.1, 0.2, 0.02), Course::Reversed);
    assert_eq!(server.followed().unwrap().dt(), Some(0.0));
    // To its time, but not to its displacement.
    let mut server = committed(0.1, 0.2, 0.02);
    assert_eq!(moving(&mut server, 0.15, 0.3, 0.04), Course::Step);
    assert_eq!(moving(&mut server, 0.101, 0.2, 0.02), Course::TakenBack);
}

#[test]
fn held_command_is_a_step_if_time_moves() {
    let mut server = Server::new(ServerDialect::Application, Carrier::Stream, ONE);
    server
        .feed(&sizes_bytes([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2]))
        .unwrap();
    let mut send = |lead: f64| server.feed(&vector(2, &[lead, 0.1])).unwrap().1;
    assert_eq!(send(3.0), Event::Trial(Course::First));
    for _ in 0..3 {
        assert!(matches!(send(5.0), Event::Commit { .. }));
        assert_eq!(send(3.0), Event::Trial(Course::Step));
        assert_eq!(send(3.0), Event::Trial(Course::Repeat));
    }
    // With a time: the same one again is no step, whatever was committed, and the next one is.
    let mut server = committed(0.1, 0.0, 0.02);
    assert_eq!(trial(&mut server, 0.1, 0.02), Course::Repeat);
    assert_eq!(commit(&mut server, 0.02), 0);
    assert_eq!(trial(&mut server, 0.1, 0.03), Course::Step);
    assert_eq!(trial(&mut server, 0.1, 0.03), Course::Repeat);
    assert_eq!(commit(&mut server, 0.03), 2);
}
