//! The startup: from the agreed connection to the tick before the first of the test.
//!
//! The wiring check, zeroing, the static load, the ramp and the warm-up follow each other. Zeroing commands every specimen to where
//! it stands and reads; the ramp goes from there to where the test begins, slower than any speed limit. Nothing jumps.

use super::cycle::Engine;
use super::loading::Loading;
use super::numerical::Side;
use super::ramping::Ramp;
use super::standing::{Confirmation, Zeroing};
use super::warm_up::WarmUp;
use super::wiring_check::WiringCheck;
use super::{Resumption, Stop};
use crate::port::Port;
use gusset_quantity::frame::AtAxis;
use gusset_record::{Event, GridOf};

/// Repetitions of the numerical path on scratch state before the first edge.
const REHEARSALS: usize = 300;
/// Multiple of the load cell's noise, and displacement in m, whose force is added to the allowed force.
const NOISE: f64 = 5.0;
const RESOLUTION_M: f64 = 1e-9;
/// The initial stiffness is known to this share.
const STIFFNESS_SHARE: f64 = 0.1;

/// The startup of a test.
pub(super) struct Startup;

impl Startup {
    /// Brings the specimens to the first target, or to the target where a resumed test continues.
    ///
    /// # Errors
    /// The test ends before its first tick.
    pub(crate) fn perform(resume: Option<Resumption>, engine: &mut Engine<'_>) -> Result<(), Stop> {
        if let Side::Structure(numerical) = &*engine.side
            && numerical.is_offline()
            && !engine.ports.is_empty()
        {
            return Err(Stop::CannotCommand);
        }
        match resume {
            Some(resumption) => resumption.perform(engine),
            None => Self::open(engine),
        }
    }

    fn open(engine: &mut Engine<'_>) -> Result<(), Stop> {
        engine.aim_at_start();
        Self::rehearse(engine);
        WiringCheck::perform(engine)?;
        if engine.plan.opening.is_gentle() {
            engine.ports.iter_mut().for_each(Port::stand_still);
        }
        engine
            .ports
            .iter_mut()
            .for_each(Port::take_reported_position);
        engine.arm()?;
        engine.environment.begin_grid(GridOf::Opening);
        Self::zero(engine)?;
        engine.aim_at_start();
        Loading::perform(engine)?;
        engine.aim_at_start();
        Ramp::perform(engine)?;
        engine.aim_at_start();
        engine.ports.iter_mut().for_each(Port::begin_way);
        WarmUp::perform(engine)?;
        Self::report_initial_forces(engine, |port, axis| {
            let raw = port.feedback().raw();
            [raw.disp.get(axis), raw.force.get(axis)]
                .map(|value| value.copied().unwrap_or(f64::NAN))
        });
        Ok(())
    }

    /// Runs the numerical path on scratch state, so that the first ticks find warm caches.
    fn rehearse(engine: &mut Engine<'_>) {
        if let Side::Structure(numerical) = &mut *engine.side
            // On simulated time nothing need be warm.
            && !engine.environment.pace.is_simulated()
            && let Some(scratch) = numerical.scratch()
        {
            for _ in 0..REHEARSALS {
                numerical.rehearse(&scratch, engine.ports);
            }
        }
    }

    /// Reads every sensor while the specimens hold where they stand, and takes what is declared as relative for zero.
    fn zero(engine: &mut Engine<'_>) -> Result<(), Stop> {
        let ticks = engine.plan.opening.zero_ticks;
        if ticks == 0 || engine.ports.is_empty() {
            return Ok(());
        }
        // A specimen at rest shows its noise and no stiffness.
        engine.ports.iter_mut().for_each(Port::pause_estimates);
        let mut zeroing = Zeroing::begin(ticks, engine)?;
        engine.perform(&mut zeroing)?;
        engine.ports.iter_mut().for_each(Port::take_zero);
        Zeroing::report_readings(engine);
        // Under a static load a force at t = 0 is as it must be: what counts is the force before it.
        if engine.settling.is_some() {
            Self::report_initial_forces(engine, |port, axis| {
                let reading = port.startup().reading(axis);
                [reading.disp, reading.force]
            });
        }
        Confirmation::perform(engine)
    }

    /// Reports each axis of a specimen behind a link that bears a force beyond what its displacement explains: it has yielded
    /// before, or something holds it. `measured`: displacement and force of an axis in its own units.
    fn report_initial_forces(engine: &mut Engine<'_>, measured: impl Fn(&Port, usize) -> [f64; 2]) {
        let bounds = &engine.plan.opening.initial_forces;
        for (index, (port, bounds)) in engine.ports.iter().zip(bounds).enumerate() {
            // A law of this process begins in its virgin state; of one that has not replied nothing is known.
            if port.exchange().is_formula() || !port.exchange().has_answered() {
                continue;
            }
            let all: Vec<[f64; 2]> = (0..port.axes()).map(|axis| measured(port, axis)).collect();
            for (axis, bound) in bounds.iter().enumerate().take(all.len()) {
                let newtons = port.guard().newtons_of(axis);
                let noise = port.startup().reading(axis).force_noise * newtons;
                let AtAxis((force, slack)) =
                    port.unexplained_force(axis, AtAxis(&all), STIFFNESS_SHARE);
                let resolution = port.stiffness_at_specimen(axis).0 * RESOLUTION_M;
                let most = bound.most_n + NOISE * noise + resolution + slack * newtons;
                let force = force * newtons;
                if force.abs() > most {
                    engine.environment.report_now(Event::InitialForce {
                        port: index as u32,
                        axis: axis as u32,
                        of: bound.of.into(),
                        force,
                        most,
                    });
                }
            }
        }
    }
}
