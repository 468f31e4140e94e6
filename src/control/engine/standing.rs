//! Maneuvers in which the specimens hold where they are: reading the sensors, and waiting for the operator's confirmation.

use super::cycle::{Engine, Maneuver};
use super::operator::Notice;
use super::order::Order;
use super::phase::Phase;
use super::{Ending, Stop};
use crate::port::Port;
use gusset_record::Event;
use gusset_record::rt::timing::TickStamps;

/// Most readings of a specimen before the static load is applied, and the longest time in s that they may take.
const AT_REST: f64 = 16.0;
const AT_REST_S: f64 = 1.0;

/// Reads every sensor a number of times. Missing replies make it longer; the limit of stale replies in a row bounds it.
pub(super) struct Zeroing {
    readings: u32,
}

impl Zeroing {
    /// Begins the phase, in which every specimen holds.
    ///
    /// # Errors
    /// A limit of a command that repeats the position.
    pub(crate) fn begin(readings: u32, engine: &mut Engine<'_>) -> Result<Self, Stop> {
        engine.environment.enter(Phase::Zeroing, Ending::Completed);
        engine.ports.iter_mut().for_each(Port::stand_still);
        engine.judge_commands()?;
        Ok(Self { readings })
    }

    /// Reports the sensor readings, to the record and to the operator.
    pub(crate) fn report_readings(engine: &mut Engine<'_>) {
        for (index, port) in engine.ports.iter().enumerate() {
            for axis in 0..port.axes() {
                let reading = port.startup().reading(axis);
                let [disp_noise, force_noise] = reading.noise().unwrap_or([f64::NAN; 2]);
                engine.environment.report_now(Event::Zeroed {
                    port: index as u32,
                    axis: axis as u32,
                    disp: reading.disp,
                    force: reading.force,
                    disp_noise_rms: disp_noise,
                    force_noise_rms: force_noise,
                });
                // An operator who does not read finds it in the record.
                let notices = &engine.environment.supervision.control().notices;
                let _ = notices.try_send(Notice::Zeroed {
                    port: index,
                    axis,
                    reading,
                });
            }
        }
    }
}

impl Maneuver for Zeroing {
    fn next(&mut self, engine: &mut Engine<'_>) -> Result<Option<Order>, Stop> {
        let mut ports = engine.ports.iter();
        let complete = ports.all(|port| port.startup().has_read(self.readings));
        Ok((!complete).then(|| engine.still(Phase::Zeroing)))
    }

    fn recorded(
        &mut self,
        engine: &mut Engine<'_>,
        _: &Order,
        _: &mut TickStamps,
    ) -> Result<(), Stop> {
        engine.reuse_number();
        engine.ports.iter_mut().for_each(Port::take_reading);
        Ok(())
    }
}

/// Waits until the operator has confirmed the readings. A hold that is requested meanwhile takes effect in the next motion.
pub(super) struct Confirmation;

impl Confirmation {
    /// Performs it, if the test asks for it.
    ///
    /// # Errors
    /// The test ends.
    pub(crate) fn perform(engine: &mut Engine<'_>) -> Result<(), Stop> {
        if !engine.plan.opening.confirm {
            return Ok(());
        }
        let supervision = &mut engine.environment.supervision;
        supervision.ask_for_confirmation();
        let notices = &supervision.control().notices;
        let _ = notices.try_send(Notice::AwaitingConfirmation);
        // However long it takes: a specimen at rest shows its noise and no stiffness.
        engine.ports.iter_mut().for_each(Port::pause_estimates);
        engine.perform(&mut Self)?;
        engine.environment.report_now(Event::Confirmed);
        engine.ports.iter_mut().for_each(Port::resume_estimates);
        Ok(())
    }
}

impl Maneuver for Confirmation {
    fn next(&mut self, engine: &mut Engine<'_>) -> Result<Option<Order>, Stop> {
        let awaited = engine.environment.supervision.is_unconfirmed();
        Ok(awaited.then(|| engine.still(Phase::Zeroing)))
    }
}

/// Reads the specimens whose wiring the static load will show, while they stand before it is applied.
pub(super) struct Listening {
    left: u32,
}

impl Listening {
    /// A few readings, if there is such a specimen.
    pub(crate) fn new(engine: &Engine<'_>) -> Self {
        let is_needed = engine
            .ports
            .iter()
            .any(|port| port.startup().wiring().is_by_static_load());
        let period = engine.environment.pace.period_s();
        let readings = (AT_REST_S / period).clamp(2.0, AT_REST) as u32;
        Self {
            left: if is_needed { readings } else { 0 },
        }
    }
}

impl Maneuver for Listening {
    fn next(&mut self, engine: &mut Engine<'_>) -> Result<Option<Order>, Stop> {
        Ok((self.left > 0).then(|| engine.still(Phase::Settling)))
    }

    fn recorded(
        &mut self,
        engine: &mut Engine<'_>,
        _: &Order,
        _: &mut TickStamps,
    ) -> Result<(), Stop> {
        self.left -= 1;
        engine
            .ports
            .iter_mut()
            .for_each(Port::read_before_static_load);
        engine.reuse_number();
        Ok(())
    }
}
