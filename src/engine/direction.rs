//! Before anything of the test moves a specimen: which way round is it wired?
//!
//! A specimen with a probe is moved a little and back, one after the other. Of a computation nothing of that is accepted, and
//! afterwards it is armed anew, so that it forgets it. The others hold. Where there is a static load, the motion that
//! brings it on is listened to instead.

use super::operator::Control;
use super::phase::Phase;
use super::tick::Tick;
use super::{Ending, Engine, Side, Stop};
use crate::integrate::State;
use crate::record::{Event, GridOf};
use crate::rt::timing::TickStamps;
use crate::time::Schedule;

/// Readings at rest before the static load comes on: at most so many, within this time in s.
const AT_REST: f64 = 16.0;
const AT_REST_S: f64 = 1.0;

/// A tick in which test time stands still.
const STILL: Tick = Tick {
    step: 0,
    sub_tick: 0,
    time: 0.0,
    dt: 0.0,
};

impl Engine {
    /// Tries every specimen that is to be tried. Does nothing if there is none.
    ///
    /// # Errors
    /// One of them is wired the wrong way round, or is lost.
    pub(super) fn try_directions(&mut self, control: &Control) -> Result<(), Stop> {
        if !self.ports.iter().any(|port| port.probe().is_some()) {
            return Ok(());
        }
        self.enter(Phase::Probing, Ending::Completed);
        self.aim_where_it_stands();
        self.take_their_word();
        self.arm(control)?;
        self.begin_grid(GridOf::Directions);
        for index in 0..self.ports.len() {
            self.try_direction(index, control)?;
        }
        // They are back where they stood; what stands ready next is the test's.
        self.ports
            .iter_mut()
            .for_each(crate::port::Port::forget_trial);
        self.aim_at_start();
        self.timing.reset();
        Ok(())
    }

    /// A hold of the operator eases out and in as in the test: what it stretches is the time of the motion.
    fn try_direction(&mut self, index: usize, control: &Control) -> Result<(), Stop> {
        let Some(mut probe) = self.ports.get(index).and_then(crate::port::Port::probe) else {
            return Ok(());
        };
        let port = index as u32;
        self.report_now(Event::Probing { port });
        let mut pace = f64::from(u8::from(!self.hold_wanted));
        loop {
            pace = self.ride.tempo.eased(pace, self.hold_wanted);
            if pace == 0.0 {
                self.still_tick(Phase::Probing, control)?;
                continue;
            }
            let tried = self.ports.get_mut(index);
            if !tried.is_some_and(|tried| tried.aim_probe(&mut probe, pace)) {
                break;
            }
            self.clear_commands()?;
            let tick = Tick {
                dt: self.tick_passes() * pace,
                ..STILL
            };
            let mut stamps = TickStamps::default();
            self.wait_before_start(&mut stamps, control)?;
            self.exchange(&tick, &mut stamps, control)?;
            self.row_before_start(&tick, Phase::Probing, &stamps);
            let sequence = self.sequence;
            if let Some(tried) = self.ports.get_mut(index) {
                tried.take_probe(&mut probe);
                tried.accept_probe(sequence);
            }
            self.skip_numbers();
        }
        let found = probe.verdict().map_err(|misfit| Stop::Misfit {
            port: index,
            misfit,
        })?;
        for axis in found {
            self.report_now(Event::Direction {
                port,
                axis: axis.axis as u32,
                disp: axis.disp,
                force: axis.force,
            });
        }
        Ok(())
    }

    /// Where the specimens that do not say it stand before the test: where nothing is deformed, if it begins gently or brings
    /// a static load on; else where its first command is.
    fn aim_where_it_stands(&mut self) {
        self.aim_at_start();
        if self.settling.is_none() && !self.opening.is_gentle() {
            return;
        }
        match &self.side {
            Side::Structure(numerical) => {
                let at_rest = State::at_rest(numerical.state.disp.len());
                let base = numerical.base(0);
                for port in &mut self.ports {
                    port.aim(&at_rest.disp, &at_rest.vel, base.disp, 0.0);
                }
            }
            Side::Prescribed(_) => {
                for port in &mut self.ports {
                    port.aim_at(&mut std::iter::repeat((0.0, 0.0)));
                }
            }
        }
    }

    /// A grid that begins shortly after now.
    pub(super) fn begin_grid(&mut self, of: GridOf) {
        self.edge = 0;
        self.clock_now = self.clock.now();
        self.schedule = Schedule::new(self.clock_now.plus(super::run::LEAD_NS), self.period);
        self.first_edge = self.schedule.tick(0);
        self.report_grid(of);
    }

    /// Reads the specimens that are listened to while they stand, before the static load comes on.
    pub(super) fn read_before_static_load(&mut self, control: &Control) -> Result<(), Stop> {
        if !self
            .ports
            .iter()
            .any(crate::port::Port::is_checked_by_static_load)
        {
            return Ok(());
        }
        let readings = (AT_REST_S / self.period.value()).clamp(2.0, AT_REST) as u32;
        for _ in 0..readings {
            let mut stamps = TickStamps::default();
            self.wait_before_start(&mut stamps, control)?;
            self.exchange_again(&STILL, &mut stamps, control)?;
            self.row_before_start(&STILL, Phase::Settling, &stamps);
            for port in &mut self.ports {
                port.read_before_static_load();
                port.skip_number();
            }
        }
        Ok(())
    }

    /// Holds what was just measured against what the estimate expects. Real-time: yes.
    pub(super) fn listen(&mut self) -> Result<(), Stop> {
        for (index, port) in self.ports.iter_mut().enumerate() {
            port.check_by_static_load().map_err(|misfit| Stop::Misfit {
                port: index,
                misfit,
            })?;
        }
        Ok(())
    }

    /// Says whose direction the static load did not show.
    pub(super) fn report_unshown(&mut self) {
        for index in 0..self.ports.len() {
            let unshown = self
                .ports
                .get(index)
                .map(crate::port::Port::unchecked_by_static_load);
            for axis in unshown.unwrap_or_default() {
                self.report_now(Event::DirectionUnknown {
                    port: index as u32,
                    axis: axis as u32,
                });
            }
        }
    }
}
