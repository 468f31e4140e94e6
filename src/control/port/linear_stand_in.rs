//! The linear stand-in for a specimen in a rehearsal: f = k̂·d + ĉ·v, seen through the units of its axes.
//!
//! It follows every command at once and never yields. So its force is too large for a specimen that yields, and too small for one
//! that hardens.

use super::axis::Axis;
use super::row_product::product;
use gusset_quantity::frame::AtAxis;
use gusset_quantity::substructure::{
    Command, Freshness, LinkFault, Measurement, Retirement, Status, Substructure,
};
use gusset_quantity::time::Nanos;

/// A linear stand-in for a specimen that is not there.
#[derive(Debug, Clone)]
pub struct LinearStandIn {
    axes: Vec<Axis>,
    stiffness: Vec<Vec<f64>>,
    damping: Vec<Vec<f64>>,
    sequence: u64,
    time: f64,
    disp: Vec<f64>,
    /// Deformation in m and its velocity in m/s, as the structure sees them.
    deformation: Vec<f64>,
    rate: Vec<f64>,
}

impl LinearStandIn {
    /// For these axes; k̂ in N/m and ĉ in N s/m at the structure's scale, one row per axis. Rows and entries that are missing
    /// count as 0.
    #[must_use]
    pub fn new(axes: Vec<Axis>, stiffness: Vec<Vec<f64>>, damping: Vec<Vec<f64>>) -> Self {
        let n = axes.len();
        let disp = axes.iter().map(|axis| axis.disp_offset).collect();
        Self {
            axes,
            stiffness,
            damping,
            sequence: 0,
            time: 0.0,
            disp,
            deformation: vec![0.0; n],
            rate: vec![0.0; n],
        }
    }
}

impl Substructure for LinearStandIn {
    fn axes(&self) -> usize {
        self.axes.len()
    }

    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        if command.disp.len() != self.disp.len() || command.vel.len() != self.disp.len() {
            return Err(LinkFault::Refused);
        }
        (self.sequence, self.time) = (command.sequence, command.time);
        self.disp.copy_from_slice(command.disp);
        let moved = self.deformation.iter_mut().zip(&mut self.rate);
        let told = command.disp.iter().zip(command.vel);
        for ((axis, (deformation, rate)), (disp, vel)) in self.axes.iter().zip(moved).zip(told) {
            *deformation = axis.deformation(AtAxis(*disp)).0;
            *rate = vel / axis.vel_gain;
        }
        Ok(())
    }

    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        (into.sequence, into.time) = (self.sequence, self.time);
        into.status = Status::default();
        for (to, from) in into.disp.iter_mut().zip(&self.disp) {
            *to = *from;
        }
        for (index, (force, axis)) in into.force.iter_mut().zip(&self.axes).enumerate() {
            let of = |rows: &[Vec<f64>], values: &[f64]| {
                rows.get(index)
                    .map_or(0.0, |row| product(row, values.iter().copied()))
            };
            let sum = of(&self.stiffness, &self.deformation) + of(&self.damping, &self.rate);
            *force = sum / axis.force_gain + axis.force_offset;
        }
        Ok(Freshness::Fresh)
    }

    fn retire(&mut self, _: Retirement) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::{AxisSpec, PortSpec};

    /// Reversed, in millimetres and kilonewtons, off its zero, coupled: the port brings back exactly k̂ d + ĉ v.
    #[test]
    fn stand_in_has_the_declared_stiffness() {
        let axis = |dof, gain: f64| Axis {
            row: vec![(dof, 1.0)],
            base: 0.0,
            disp_gain: 1000.0 * gain,
            disp_offset: 7.0,
            measured_offset: 0.0,
            vel_gain: 500.0 * gain,
            force_gain: 1000.0 * gain,
            force_offset: -3.0,
        };
        let axes = vec![axis(0, -2.0), axis(1, 1.0)];
        let stiffness = vec![vec![4e5, -1e5], vec![-1e5, 2e5]];
        let damping = vec![vec![300.0, 0.0], vec![0.0, 0.0]];
        let believed = LinearStandIn::new(axes.clone(), stiffness, damping);
        let mut port = PortSpec::new(
            "rig",
            Box::new(believed),
            2,
            axes.into_iter()
                .zip(vec![4e5, 2e5])
                .map(|(axis, k)| AxisSpec::new(axis, k))
                .collect(),
        )
        .build()
        .unwrap();
        port.aim(&[0.01, -0.02], &[0.5, 0.25], 0.0, 0.0);
        assert!(port.clear().trip.is_none());
        port.issue(0, 0.0, 0.0).unwrap();
        port.collect(Nanos(0)).unwrap();
        let wanted = [
            4e5 * 0.01 - 1e5 * -0.02 + 300.0 * 0.5,
            -1e5 * 0.01 + 2e5 * -0.02,
        ];
        for (axis, wanted) in wanted.into_iter().enumerate() {
            // A dozen operations on numbers of 1e4: 1e-16 · 12 · 1e4.
            assert!(
                (port.feedback().force()[axis] - wanted).abs() < 1e-9,
                "{axis}"
            );
        }
        assert!((port.feedback().disp()[1] + 0.02).abs() < 1e-15);
    }
}
