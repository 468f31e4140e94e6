//! The wiring check: before anything of the test moves a specimen, a small motion and back shows which way round it is wired.
//!
//! Specimens are checked one after another, and the others hold. A computed specimen accepts nothing of it, and is armed again
//! afterwards, so that it forgets it. Where there is a static load, its motion is judged instead.

use super::cycle::{Engine, Maneuver};
use super::order::Order;
use super::phase::Phase;
use super::ramping::HoldRamp;
use super::stop::port_at;
use super::tick::Tick;
use super::{Ending, Side, Stop};
use crate::port::{Port, Probe, Wiring};
use gusset_numerics::integrate::State;
use gusset_quantity::frame::AtStructure;
use gusset_record::rt::timing::TickStamps;
use gusset_record::{Event, GridOf};

/// The check of one specimen.
pub(super) struct WiringCheck {
    port: usize,
    probe: Probe,
    hold: HoldRamp,
}

impl WiringCheck {
    /// Checks every specimen that is to be checked.
    ///
    /// # Errors
    /// A specimen is wired the wrong way round, or is lost.
    pub(crate) fn perform(engine: &mut Engine<'_>) -> Result<(), Stop> {
        if !engine.ports.iter().any(|port| port.probe().is_some()) {
            return Ok(());
        }
        engine.environment.enter(Phase::Probing, Ending::Completed);
        Self::aim_where_it_stands(engine);
        engine
            .ports
            .iter_mut()
            .for_each(Port::take_reported_position);
        engine.arm()?;
        Self::of_armed(engine)?;
        engine.aim_at_start();
        Ok(())
    }

    /// Checks specimens that are armed where they stand.
    ///
    /// # Errors
    /// As [`WiringCheck::perform`].
    pub(crate) fn of_armed(engine: &mut Engine<'_>) -> Result<Vec<Wiring>, Stop> {
        engine.environment.begin_grid(GridOf::Directions);
        let mut found = Vec::new();
        for index in 0..engine.ports.len() {
            found.extend(Self::check(index, engine)?);
        }
        // They are back where they stood; the next command is the test's.
        engine.ports.iter_mut().for_each(Port::forget_trial);
        engine.environment.deadlines.forget_timing();
        Ok(found)
    }

    fn check(index: usize, engine: &mut Engine<'_>) -> Result<Option<Wiring>, Stop> {
        let Some(probe) = port_at(engine.ports, index)?.probe() else {
            return Ok(None);
        };
        let port = index as u32;
        engine.environment.report_now(Event::Probing { port });
        let mut check = Self {
            port: index,
            probe,
            hold: HoldRamp::new(engine),
        };
        if let Err(stop) = engine.perform(&mut check) {
            return Err(check.go_back(stop, engine));
        }
        let verdict = check.probe.verdict();
        let wiring = verdict.map_err(|misfit| Stop::Misfit {
            port: index,
            misfit,
        })?;
        for fault in &wiring.accepted {
            engine.ends.accept_wiring();
            engine.environment.report_now(Event::WiringAccepted {
                port,
                axis: fault.axis() as u32,
                what: fault.name().into(),
            });
        }
        for axis in &wiring.found {
            let (metres, newtons) = match &*engine.side {
                Side::Received(received) => received.units_of(axis.axis),
                _ => (1.0, 1.0),
            };
            engine.environment.report_now(Event::Direction {
                port,
                axis: axis.axis as u32,
                disp: metres * axis.disp,
                force: newtons * axis.force,
            });
        }
        Ok(Some(wiring))
    }

    /// Retraces the motion of a check that a signal has ended. Returns why the test ends: a trip on the return comes first.
    fn go_back(mut self, stop: Stop, engine: &mut Engine<'_>) -> Stop {
        let port = engine.ports.get(self.port);
        let turns = stop == Stop::Operator
            && engine.environment.supervision.goes_back()
            && port.is_some_and(|port| port.turn_back(&mut self.probe));
        if !turns {
            return stop;
        }
        self.hold = HoldRamp::new(engine);
        let ended = engine.perform(&mut self);
        engine.ends.way_back = Some((self.probe.axis(), self.probe.way_back()));
        engine.environment.report_now(Event::Retraced {
            port: self.port as u32,
            what: self.probe.way_back().word().into(),
        });
        ended.err().unwrap_or(stop)
    }

    /// Where specimens that do not report it stand before the test: where nothing is deformed, if it begins gently or brings
    /// a static load on; else where the first command is.
    fn aim_where_it_stands(engine: &mut Engine<'_>) {
        engine.aim_at_start();
        if engine.settling.is_none() && !engine.plan.opening.is_gentle() {
            return;
        }
        match &*engine.side {
            Side::Structure(numerical) => {
                let at_rest = State::at_rest(numerical.state.disp.len());
                let base = numerical.base(0);
                for port in &mut *engine.ports {
                    port.aim(&at_rest.disp, &at_rest.vel, base.disp, 0.0);
                }
            }
            Side::Prescribed(_) => {
                for port in &mut *engine.ports {
                    port.aim_at(&mut std::iter::repeat(AtStructure((0.0, 0.0))));
                }
            }
            Side::Received(_) => {}
        }
    }
}

impl Maneuver for WiringCheck {
    fn next(&mut self, engine: &mut Engine<'_>) -> Result<Option<Order>, Stop> {
        let Some(pace) = self.hold.next(engine) else {
            return Ok(Some(engine.still(Phase::Probing)));
        };
        let port = port_at(engine.ports, self.port)?;
        if !port.aim_probe(&mut self.probe, pace) {
            return Ok(None);
        }
        engine.judge_commands()?;
        let tick = Tick::before_start(engine.tick_passes() * pace);
        Ok(Some(Order::moving(tick, Phase::Probing)))
    }

    fn recorded(
        &mut self,
        engine: &mut Engine<'_>,
        order: &Order,
        _: &mut TickStamps,
    ) -> Result<(), Stop> {
        if !order.is_still() {
            let sequence = engine.exchanges.sequence();
            let port = port_at(engine.ports, self.port)?;
            port.take_probe(&mut self.probe);
            // A link that is lost shows at the next command.
            let _ = port.accept_probe(sequence);
        }
        engine.reuse_number();
        Ok(())
    }
}
