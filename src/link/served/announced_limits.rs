//! Second check: the limits that a controller announced in the handshake, kept by the specimen's end as well.

use super::{Controller, Trip, USUAL_TICK_S};
use crate::announce;
use gusset_control::port::limits::{AxisLimits, Watch};
use gusset_quantity::frame::AtSpecimen;
use gusset_quantity::units::AxisUnits;

/// Limits that one controller has announced.
#[derive(Debug)]
pub(super) struct AnnouncedLimits {
    limits: Vec<AxisLimits>,
    watch: Watch,
}

impl AnnouncedLimits {
    /// None if the protocol has no limits.
    pub(crate) fn by(controller: &Controller, units: &[AxisUnits]) -> Option<Self> {
        if controller.limits.len() != units.len() {
            return None;
        }
        let axes = controller.limits.iter().zip(units);
        let limits: Vec<_> = axes
            .map(|(limits, units)| announce::kept(limits, units))
            .collect();
        Some(Self {
            watch: Watch::new(limits.clone(), USUAL_TICK_S),
            limits,
        })
    }

    /// The next command continues the history of the specimen's own guard.
    pub(crate) fn begin(&mut self, guard: &Watch) {
        self.watch = Watch::new(self.limits.clone(), USUAL_TICK_S);
        self.watch.goes_on_from(guard);
    }

    /// The next command leads away from here, from rest; displacements in m.
    pub(crate) fn begin_at(&mut self, disp: impl Iterator<Item = AtSpecimen<f64>>) {
        self.watch = Watch::new(self.limits.clone(), USUAL_TICK_S);
        self.watch.stands_at(disp);
    }

    /// The last command counts as one at rest.
    pub(crate) fn rests(&mut self) {
        self.watch.rests();
    }

    /// Judges a command of the controller, which has `time` for its motion. Real-time: yes.
    pub(crate) fn command(
        &mut self,
        time: f64,
        disp: impl Iterator<Item = AtSpecimen<f64>> + Clone,
    ) -> Result<(), Trip> {
        self.watch.tick_is(time);
        let found = self.watch.command(disp.clone());
        if let Some(hit) = found.trip {
            return Err(Trip::Announced(hit));
        }
        self.watch.sent(disp);
        Ok(())
    }

    /// Judges measured values. Real-time: yes.
    pub(crate) fn measured(
        &mut self,
        values: impl Iterator<Item = AtSpecimen<(f64, f64)>> + Clone,
    ) -> Result<(), Trip> {
        let found = self.watch.measured(values);
        found.trip.map_or(Ok(()), |hit| Err(Trip::Announced(hit)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::served::{Computed, ServedSpecimen};
    use gusset_actuator::specimen::SpecimenLaw;
    use gusset_quantity::catalog::limit::Limit;
    use gusset_quantity::substructure::{Command, Measurement, Status};
    use gusset_wire::handshake::Limits;

    /// A spring of 1 MN/m in mm and kN, which is 1 kN/mm, for a controller that announces 50 mm, 500 mm/s and 30 kN.
    fn served() -> ServedSpecimen {
        let law: SpecimenLaw =
            toml::from_str("law = { linear = { stiffness_n_per_m = 1.0 } }").unwrap();
        let units = vec![AxisUnits {
            metres: 1e-3,
            newtons: 1e3,
            disp: "mm",
            force: "kN",
        }];
        let rig = Box::new(Computed::new(law.build(1).unwrap(), false));
        let mut served = ServedSpecimen::new("rig".into(), rig, units, vec![1.0], vec![0.0]);
        let controller = Controller {
            rate: Some((1000, 1)),
            limits: vec![Limits {
                disp_min: -50.0,
                disp_max: 50.0,
                speed_max: 500.0,
                force_max: 30.0,
            }],
            ..Controller::unnamed(([127, 0, 0, 1], 1).into())
        };
        served.begin(&controller, &mut || Ok(())).unwrap();
        served
    }

    /// Sends these commands, (sequence, displacement in mm) each; the trip of the last.
    fn told(commands: &[(u64, f64)]) -> (Option<Limit>, Status) {
        let (mut served, mut into) = (served(), Measurement::zeros(1));
        let mut trip = None;
        for &(sequence, disp) in commands {
            assert_eq!(trip, None, "only the last may trip");
            let command = Command {
                sequence,
                time: 0.0,
                // Test time runs a hundred times slower than the wall: speeds are the wall's.
                dt: 1e-5,
                disp: &[disp],
                vel: &[0.0],
            };
            trip = match served.exchange(&command, 1e-5, &mut || true, &mut into) {
                Ok(_) => None,
                Err(Trip::Announced(hit)) => Some(hit.quantity),
                Err(other) => panic!("{other}"),
            };
        }
        (trip, into.status)
    }

    #[test]
    fn command_beyond_the_announcement_holds() {
        let way: Vec<(u64, f64)> = (0..=100).map(|k| (k, 0.5 * k as f64)).collect();
        assert_eq!(told(&way[..38]), (None, Status::default()), "18.5 kN");
        let (trip, status) = told(&[(0, 0.4), (1, 0.90001)]);
        assert_eq!(trip, Some(Limit::CommandVel), "500.01 mm/s");
        assert!(status.has(Status::INTERLOCK));
        assert_eq!(
            told(&[(0, 0.4), (3, 1.9)]).0,
            None,
            "two were lost on the way"
        );
        let back: Vec<(u64, f64)> = (0..=75).map(|k| (k, -0.5 * k as f64)).collect();
        assert_eq!(
            told(&back).0,
            None,
            "37.5 kN, 1.25 times what was announced"
        );
        let farther = [&back[..], &[(76, -37.6)]].concat();
        assert_eq!(told(&farther).0, Some(Limit::MeasuredForce));
        assert_eq!(
            told(&[(3, 1.9)]).0,
            None,
            "the first three were lost on the way"
        );
        let (trip, _) = told(&[(0, 0.0), (1_000_000_000_000, 45.0)]);
        assert_eq!(trip, Some(Limit::CommandVel), "no time for this many");
        let (trip, _) = told(&[(0, 0.0), (200, 50.1)]);
        assert_eq!(trip, Some(Limit::CommandDisp));
    }
}
