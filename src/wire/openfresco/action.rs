//! The action codes: double 0 of a client's message.

use crate::WireError;

/// A request for measured signals. The answer always holds all of them; the code only says what is wanted most.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reading {
    /// 6: everything.
    All,
    /// 7: displacement.
    Disp,
    /// 8: velocity.
    Vel,
    /// 9: acceleration.
    Accel,
    /// 10: force.
    Force,
    /// 11: time.
    Time,
}

/// A request for a matrix.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Matrix {
    /// 12: initial stiffness.
    InitialStiffness,
    /// 13: tangent stiffness.
    TangentStiffness,
    /// 14: damping.
    Damping,
    /// 15: mass.
    Mass,
}

/// Request of a client.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// 1: greeting of dialect B.
    Open,
    /// 2: sizes of dialect B follow.
    Setup,
    /// 3: command.
    Trial,
    /// 4: only SimSimulink up to 2.7, right after 3.
    Execute,
    /// 4.1: is the target taken?
    TargetTaken,
    /// 4.2: take `newTarget` back.
    TargetDone,
    /// 4.3: has the switch gone back?
    SwitchedBack,
    /// 5: the last command is accepted.
    Commit,
    /// 6 to 11.
    Read(Reading),
    /// 12 to 15.
    Give(Matrix),
    /// 98: internal to OpenFresco, never sent.
    Shutdown,
    /// 99: end of the test.
    Die,
}

const TABLE: [(f64, Action); 20] = [
    (1.0, Action::Open),
    (2.0, Action::Setup),
    (3.0, Action::Trial),
    (4.0, Action::Execute),
    (4.1, Action::TargetTaken),
    (4.2, Action::TargetDone),
    (4.3, Action::SwitchedBack),
    (5.0, Action::Commit),
    (6.0, Action::Read(Reading::All)),
    (7.0, Action::Read(Reading::Disp)),
    (8.0, Action::Read(Reading::Vel)),
    (9.0, Action::Read(Reading::Accel)),
    (10.0, Action::Read(Reading::Force)),
    (11.0, Action::Read(Reading::Time)),
    (12.0, Action::Give(Matrix::InitialStiffness)),
    (13.0, Action::Give(Matrix::TangentStiffness)),
    (14.0, Action::Give(Matrix::Damping)),
    (15.0, Action::Give(Matrix::Mass)),
    (98.0, Action::Shutdown),
    (99.0, Action::Die),
];

impl Action {
    /// The double on the wire.
    #[must_use]
    pub(crate) fn code(self) -> f64 {
        TABLE
            .iter()
            .find(|(_, action)| *action == self)
            .map_or(f64::NAN, |(code, _)| *code)
    }

    /// Compares the code as a double, as the Simulink server does. `None` for a plausible code that is not in the
    /// table: the real servers warn and read on. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Action`] for a number that is no possible code.
    pub fn exact(code: f64) -> Result<Option<Self>, WireError> {
        // "is inside", so that NaN fails; 100 is no code, 99.9 would be cut to one.
        if !(1.0..100.0).contains(&code) {
            return Err(WireError::Action { found: code });
        }
        Ok(TABLE
            .iter()
            .find(|(known, _)| *known == code)
            .map(|(_, action)| *action))
    }

    /// Reads the code as an integer, as all other servers do. They truncate fractions; here a fractional code is an
    /// error, so that nothing moves for a number that no client meant. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Action`] for a number that is no possible code.
    pub fn whole(code: f64) -> Result<Option<Self>, WireError> {
        match Self::exact(code)? {
            None if code.fract() != 0.0 => Err(WireError::Action { found: code }),
            known => Ok(known),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn action_codes_have_known_bytes() {
        let bytes = |action: Action| {
            action
                .code()
                .to_le_bytes()
                .iter()
                .map(|byte| format!("{byte:02x}"))
                .collect::<Vec<_>>()
                .join(" ")
        };
        assert_eq!(bytes(Action::Open), "00 00 00 00 00 00 f0 3f");
        assert_eq!(bytes(Action::Setup), "00 00 00 00 00 00 00 40");
        assert_eq!(bytes(Action::Trial), "00 00 00 00 00 00 08 40");
        assert_eq!(bytes(Action::Execute), "00 00 00 00 00 00 10 40");
        assert_eq!(bytes(Action::TargetTaken), "66 66 66 66 66 66 10 40");
        assert_eq!(bytes(Action::TargetDone), "cd cc cc cc cc cc 10 40");
        assert_eq!(bytes(Action::SwitchedBack), "33 33 33 33 33 33 11 40");
        assert_eq!(bytes(Action::Commit), "00 00 00 00 00 00 14 40");
        assert_eq!(bytes(Action::Read(Reading::All)), "00 00 00 00 00 00 18 40");
        assert_eq!(
            bytes(Action::Read(Reading::Force)),
            "00 00 00 00 00 00 24 40"
        );
        assert_eq!(
            bytes(Action::Give(Matrix::InitialStiffness)),
            "00 00 00 00 00 00 28 40"
        );
        assert_eq!(bytes(Action::Give(Matrix::Mass)), "00 00 00 00 00 00 2e 40");
        assert_eq!(bytes(Action::Shutdown), "00 00 00 00 00 80 58 40");
        assert_eq!(bytes(Action::Die), "00 00 00 00 00 c0 58 40");
    }

    #[test]
    fn only_simulink_has_fractional_actions() {
        assert_eq!(Action::exact(4.1), Ok(Some(Action::TargetTaken)));
        assert_eq!(Action::whole(4.1), Ok(Some(Action::TargetTaken)));
        for found in [3.5, 10.9, 98.000_000_1] {
            assert_eq!(Action::whole(found), Err(WireError::Action { found }));
            assert_eq!(Action::exact(found), Ok(None));
            let told = WireError::Action { found }.to_string();
            let known = "there are 1 to 15, 98 and 99, all whole, and 4.1, 4.2 and 4.3";
            assert_eq!(told, format!("the action is {found}; {known}"));
        }
        for (code, action) in TABLE {
            assert_eq!(Action::exact(code), Ok(Some(action)));
            assert_eq!(action.code(), code);
        }
    }

    #[test]
    fn only_impossible_codes_are_errors() {
        for code in [0.0, -3.0, 0.99, 100.0, 1e300, f64::INFINITY] {
            assert_eq!(Action::whole(code), Err(WireError::Action { found: code }));
        }
        assert!(Action::whole(f64::NAN).is_err());
        assert!(Action::exact(f64::NAN).is_err());
        assert_eq!(Action::whole(50.0), Ok(None));
        assert_eq!(Action::whole(16.0), Ok(None));
    }
}
