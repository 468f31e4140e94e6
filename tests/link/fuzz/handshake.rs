//! Control messages: they agree on everything before anything moves.

use gusset_wire::handshake::{
    Arm, Axis, Bye, Capabilities, Control, Hello, Limits, Refuse, RefuseCode, Sampling, Terms,
    Unit, Versions, Welcome, agree, check_welcome, decode, encode, layout_hash, verify_hello,
    verify_welcome,
};
use gusset_wire::key::PreSharedKey;

use super::{Dice, Target, mutate};

fn axes(count: usize) -> Vec<Axis> {
    let axis = |number| Axis {
        name: format!("axis {number}"),
        disp_unit: Unit::Metre,
        force_unit: Unit::Newton,
        limits: Limits {
            disp_min: -0.1,
            disp_max: 0.2,
            speed_max: 0.5,
            force_max: 200.0,
        },
    };
    (1..=count).map(axis).collect()
}

fn hello(count: usize) -> Hello {
    Hello {
        proof: [0; 32],
        nonce: [3; 32],
        layout: layout_hash(&axes(count)),
        versions: Versions::OURS,
        keyed: true,
        rate_numerator: 1024,
        rate_denominator: 1,
        watchdog_s: 0.1,
        sampling: Sampling::Fraction(0.5),
        software: "fuzz".into(),
        name: "a test".into(),
        axes: axes(count),
    }
}

fn seeds(count: usize) -> [Control; 5] {
    let hello = hello(count);
    let welcome = Welcome {
        proof: [0; 32],
        nonce: [4; 32],
        layout: hello.layout,
        session: 99,
        version: 1,
        keyed: true,
        capabilities: Capabilities::INTERLOCK,
        watchdog_s: hello.watchdog_s,
        sampling: hello.sampling,
        stiffness: vec![1.0; count * count],
        standing: vec![0.25; count],
        software: "rig".into(),
        name: "specimen".into(),
        axes: hello.axes.clone(),
    };
    [
        Control::Hello(hello),
        Control::Welcome(welcome),
        Control::Refuse(Refuse {
            code: RefuseCode::Malformed,
            versions: Versions::OURS,
            text: "no".into(),
        }),
        Control::Arm(Arm {
            session: 1,
            first_sequence: 2,
            disp: vec![0.5; count],
        }),
        Control::Bye(Bye {
            cause: 3,
            text: "done".into(),
        }),
    ]
}

pub struct Handshake {
    seeds: Vec<Vec<u8>>,
    hello: Hello,
    terms: Terms,
    key: PreSharedKey,
    accepted: u64,
}

impl Handshake {
    pub fn new() -> Self {
        let all = [1, 2, 5].into_iter().flat_map(seeds);
        Self {
            seeds: all.map(|message| encode(&message).unwrap()).collect(),
            hello: hello(2),
            terms: Terms {
                versions: Versions::OURS,
                axes: axes(2),
                rate_max_hz: 4096.0,
                watchdog_max_s: 1.0,
                timed_sampling: true,
                keyed: true,
            },
            key: PreSharedKey::new(&[9; 32]).unwrap(),
            accepted: 0,
        }
    }
}

impl Target for Handshake {
    fn name(&self) -> &'static str {
        "handshake"
    }

    fn input(&mut self, dice: &mut Dice) -> Vec<u8> {
        let mut bytes = dice.pick(&self.seeds).clone();
        let other = dice.pick(&self.seeds);
        mutate(dice, &mut bytes, other);
        bytes
    }

    fn check(&mut self, _: &mut Dice, input: &[u8]) {
        let mut decoded = None;
        let info = allocation_counter::measure(|| decoded = decode(input).ok());
        assert!(
            info.bytes_max <= 64_000,
            "{} bytes allocated for {}",
            info.bytes_max,
            input.len()
        );
        // No client has the key.
        assert!(verify_hello(input, &self.key).is_err());
        let session = self.key.session(&[1; 32], &[2; 32], 3);
        assert!(verify_welcome(input, &self.seeds[1], &session).is_err());
        assert!(verify_welcome(&self.seeds[0], input, &session).is_err());
        let Some(message) = decoded else {
            return;
        };
        self.accepted += 1;
        assert_eq!(encode(&message).unwrap(), input, "{message:?}");
        match &message {
            Control::Hello(hello) => {
                if let Err(refuse) = agree(hello, &self.terms) {
                    // A refusal can always be sent.
                    encode(&Control::Refuse(refuse)).unwrap();
                }
            }
            Control::Welcome(welcome) => {
                let _ = check_welcome(&self.hello, welcome);
            }
            _ => {}
        }
    }

    fn accepted(&self) -> u64 {
        self.accepted
    }
}
