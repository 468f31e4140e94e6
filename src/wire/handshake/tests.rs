mod agreement;
mod messages;

use proptest::prelude::*;

use super::*;
use crate::key::{PreSharedKey, SessionKey};
use crate::native::{Decoder, Encoder, Frame, MAX_AXES};
use crate::{ControlFault, Side, WireError};
use gusset_quantity::substructure::Command;

fn axis(name: &str) -> Axis {
    Axis {
        name: name.into(),
        disp_unit: Unit::Metre,
        force_unit: Unit::Kilonewton,
        limits: Limits {
            disp_min: -0.1,
            disp_max: 0.2,
            speed_max: 0.5,
            force_max: 200.0,
        },
    }
}

fn hello() -> Hello {
    let axes = vec![axis("a"), axis("b")];
    Hello {
        proof: [0; 32],
        nonce: [3; 32],
        layout: layout_hash(&axes),
        versions: Versions::OURS,
        keyed: false,
        rate_numerator: 1024,
        rate_denominator: 1,
        watchdog_s: 0.1,
        sampling: Sampling::Reply,
        software: "test".into(),
        name: "t".into(),
        axes,
    }
}

fn welcome(hello: &Hello) -> Welcome {
    Welcome {
        proof: [0; 32],
        nonce: [4; 32],
        layout: hello.layout,
        session: 99,
        version: 1,
        keyed: hello.keyed,
        capabilities: Capabilities::INTERLOCK,
        watchdog_s: hello.watchdog_s,
        sampling: hello.sampling,
        stiffness: vec![1.0, 2.0, 3.0, 4.0],
        standing: vec![0.5, -0.25],
        software: "rig".into(),
        name: "s".into(),
        axes: hello.axes.clone(),
    }
}

fn terms() -> Terms {
    Terms {
        versions: Versions::OURS,
        axes: vec![axis("a"), axis("b")],
        rate_max_hz: 4096.0,
        watchdog_max_s: 1.0,
        timed_sampling: false,
        keyed: false,
    }
}

fn all() -> Vec<Control> {
    vec![
        Control::Hello(hello()),
        Control::Welcome(welcome(&hello())),
        Control::Refuse(Refuse {
            code: RefuseCode::Malformed,
            versions: Versions::OURS,
            text: String::new(),
        }),
        Control::Arm(Arm {
            session: 1,
            first_sequence: 2,
            disp: vec![0.5, -0.5],
        }),
        Control::Bye(Bye {
            cause: 3,
            text: "done".into(),
        }),
    ]
}
