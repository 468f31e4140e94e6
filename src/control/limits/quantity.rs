//! The quantities that have limits: their names, keys and units.

/// What is limited.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Quantity {
    /// Displacement that is about to be sent, m.
    CommandDisp,
    /// Its change in one tick, m.
    CommandStep,
    /// Its change in one tick over the tick's wall time, m/s.
    CommandVel,
    /// Its second difference over the tick's wall time squared, m/s².
    CommandAccel,
    /// Measured displacement, m.
    MeasuredDisp,
    /// Measured force, N.
    MeasuredForce,
    /// |measured − commanded| displacement, m.
    FollowingError,
    /// Change of the measured force from one measurement to the next, N.
    ForceStep,
    /// Ticks in a row in which a moving command left both sensors unchanged to the last bit.
    StuckSensor,
    /// Reading of the displacement sensor, m: at the end of its range it says nothing.
    SensorDisp,
    /// Reading of the load cell, N.
    SensorForce,
    /// Steps in a row in which the second difference of the command changed its sign and grew: the sawtooth of an unstable
    /// integration.
    Alternation,
    /// Tangent stiffness as estimated, over its declared upper bound.
    StiffnessRatio,
    /// Tangent damping as estimated, over its declared upper bound.
    DampingRatio,
    /// Energy that the transfer system has added to the structure, J.
    AddedEnergy,
    /// |Lag| of the measured displacement behind the target, s.
    Lag,
    /// |Gain − 1| of the measured displacement over the target.
    GainError,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Quantity; 17] = [
        Quantity::CommandDisp,
        Quantity::CommandStep,
        Quantity::CommandVel,
        Quantity::CommandAccel,
        Quantity::MeasuredDisp,
        Quantity::MeasuredForce,
        Quantity::FollowingError,
        Quantity::ForceStep,
        Quantity::StuckSensor,
        Quantity::SensorDisp,
        Quantity::SensorForce,
        Quantity::Alternation,
        Quantity::StiffnessRatio,
        Quantity::DampingRatio,
        Quantity::AddedEnergy,
        Quantity::Lag,
        Quantity::GainError,
    ];

    /// In words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Quantity::CommandDisp => "commanded displacement",
            Quantity::CommandStep => "change of the command in one tick",
            Quantity::CommandVel => "commanded velocity",
            Quantity::CommandAccel => "commanded acceleration",
            Quantity::MeasuredDisp => "measured displacement",
            Quantity::MeasuredForce => "measured force",
            Quantity::FollowingError => "following error",
            Quantity::ForceStep => "change of the measured force from one measurement to the next",
            Quantity::StuckSensor => "ticks with unchanged sensors under a moving command",
            Quantity::SensorDisp => "reading of the displacement sensor",
            Quantity::SensorForce => "reading of the load cell",
            Quantity::Alternation => "ticks of a growing sawtooth in the command",
            Quantity::StiffnessRatio => "tangent stiffness over its declared bound",
            Quantity::DampingRatio => "tangent damping over its declared bound",
            Quantity::AddedEnergy => "energy added by the transfer system",
            Quantity::Lag => "lag behind the target",
            Quantity::GainError => "error of the gain from target to measurement",
        }
    }

    /// As a key of the test file and of events.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Quantity::CommandDisp => "command_disp_m",
            Quantity::CommandStep => "command_step_m",
            Quantity::CommandVel => "command_vel_m_per_s",
            Quantity::CommandAccel => "command_accel_m_per_s2",
            Quantity::MeasuredDisp => "measured_disp_m",
            Quantity::MeasuredForce => "measured_force_n",
            Quantity::FollowingError => "following_error_m",
            Quantity::ForceStep => "force_step_n",
            Quantity::StuckSensor => "stuck_ticks",
            Quantity::SensorDisp => "sensor_disp_m",
            Quantity::SensorForce => "sensor_force_n",
            Quantity::Alternation => "alternating_ticks",
            Quantity::StiffnessRatio => "stiffness_ratio",
            Quantity::DampingRatio => "damping_ratio",
            Quantity::AddedEnergy => "added_energy_j",
            Quantity::Lag => "lag_s",
            Quantity::GainError => "gain_error",
        }
    }

    /// SI unit.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Quantity::CommandDisp
            | Quantity::CommandStep
            | Quantity::MeasuredDisp
            | Quantity::SensorDisp
            | Quantity::FollowingError => "m",
            Quantity::CommandVel => "m/s",
            Quantity::CommandAccel => "m/s2",
            Quantity::MeasuredForce | Quantity::SensorForce | Quantity::ForceStep => "N",
            Quantity::StuckSensor | Quantity::Alternation => "ticks",
            Quantity::StiffnessRatio | Quantity::DampingRatio => "×",
            Quantity::Lag => "s",
            Quantity::GainError => "1",
            Quantity::AddedEnergy => "J",
        }
    }

    /// Whether it is of what is commanded, and not of what is measured.
    #[must_use]
    pub const fn is_of_command(self) -> bool {
        matches!(
            self,
            Quantity::CommandDisp
                | Quantity::CommandStep
                | Quantity::CommandVel
                | Quantity::CommandAccel
                | Quantity::Alternation
        )
    }

    /// Whether only the loop knows it: no command and no measurement says it by itself.
    #[must_use]
    pub const fn is_of_loop(self) -> bool {
        matches!(
            self,
            Quantity::FollowingError
                | Quantity::StuckSensor
                | Quantity::Alternation
                | Quantity::StiffnessRatio
                | Quantity::DampingRatio
                | Quantity::AddedEnergy
                | Quantity::Lag
                | Quantity::GainError
        )
    }

    /// Whether our own protocol announces it to the specimen's end; a change in one tick as the speed that it is.
    #[must_use]
    pub const fn is_announced(self) -> bool {
        matches!(
            self,
            Quantity::CommandDisp
                | Quantity::CommandStep
                | Quantity::CommandVel
                | Quantity::MeasuredForce
        )
    }

    /// Its place in a set.
    pub(super) const fn bit(self) -> u32 {
        1 << self as u16
    }
}
