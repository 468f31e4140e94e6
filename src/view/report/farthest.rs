//! The end of a step at which a node of a frame is farthest from its place.

use super::axis::is_drawable;
use crate::TestFile;
use gusset_numerics::frame::{Direction, FrameSpec};

/// Share of the largest vertical displacement below which a horizontal one is no drift: a beam only bends.
const NO_DRIFT: f64 = 1e-3;

/// Displacements of a frame, relative to its supports, at the end of one step.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Farthest {
    /// The node, in which direction it moved, and how far, m.
    pub node: String,
    pub direction: Direction,
    pub value: f64,
    /// Test time; NaN where it is not recorded.
    pub time: f64,
    /// By DOF.
    pub disp: Vec<f64>,
}

/// A direction of a node and its terms: DOF from 0, coefficient.
type Motion = (String, Direction, Vec<(usize, f64)>);

/// Looks for it while the rows pass.
pub(super) struct FarthestPass {
    time: Option<usize>,
    /// Place of the ground in a block where coordinates are absolute.
    ground: Option<usize>,
    /// Place of each DOF in a block, and its displacement for a unit displacement of the ground.
    disp: Vec<(usize, f64)>,
    /// The motions of the nodes, each once.
    motions: Vec<Motion>,
    /// The direction upwards.
    up: Direction,
    /// Sideways and upwards.
    most: [Option<Farthest>; 2],
}

/// The frame of a test, if it has one.
pub(super) fn frame(test: &TestFile) -> Option<&FrameSpec> {
    test.structure.as_ref()?.frame.as_ref()
}

impl FarthestPass {
    /// For blocks with the columns at these places; `None` unless the test has a frame and all of its displacements are there.
    pub(crate) fn new(test: &TestFile, at: impl Fn(&str) -> Option<usize>) -> Option<Self> {
        let spec = frame(test)?;
        // A reduced structure does not have the displacements of all nodes.
        if test.structure.as_ref()?.reduce.is_some() {
            return None;
        }
        let model = spec.model().ok()?;
        let influence = spec.influence().into_iter().zip(1..);
        let disp = influence.map(|(share, dof)| Some((at(&format!("x{dof}"))?, share)));
        let ground = match test.excitation.base_displacement {
            Some(_) => Some(at("ground")?),
            None => None,
        };
        let mut motions: Vec<Motion> = Vec::new();
        for node in model.nodes() {
            for &direction in spec.directions().iter().filter(|one| !one.turns()) {
                let motion = model.motion(node, direction).unwrap_or_default();
                if !motions.iter().any(|(_, _, known)| known == motion) {
                    motions.push((node.clone(), direction, motion.to_vec()));
                }
            }
        }
        Some(Self {
            time: at("time"),
            ground,
            disp: disp.collect::<Option<_>>()?,
            motions,
            up: spec.upwards(),
            most: [None, None],
        })
    }

    /// Takes ends of steps: one slice per column of a block.
    pub(crate) fn take(&mut self, block: &[&[f64]]) {
        let mut disp = vec![0.0; self.disp.len()];
        let rows = 0..block.first().map_or(0, |column| column.len());
        for row in rows {
            let ground = self.ground.map_or(0.0, |at| block[at][row]);
            for (to, (at, share)) in disp.iter_mut().zip(&self.disp) {
                *to = block[*at][row] - share * ground;
            }
            if !disp.iter().all(|value| is_drawable(*value)) {
                continue;
            }
            for (node, direction, motion) in &self.motions {
                let value = moved(motion, &disp);
                let most = &mut self.most[usize::from(*direction == self.up)];
                if most
                    .as_ref()
                    .is_none_or(|most| value.abs() > most.value.abs())
                {
                    *most = Some(Farthest {
                        node: node.clone(),
                        direction: *direction,
                        value,
                        time: self.time.map_or(f64::NAN, |at| block[at][row]),
                        disp: disp.clone(),
                    });
                }
            }
        }
    }

    /// Sideways; of a frame that does not drift, upwards.
    pub(crate) fn finish(self) -> Option<Farthest> {
        let [across, up] = self.most;
        let least = up.as_ref().map_or(0.0, |up| NO_DRIFT * up.value.abs());
        across.filter(|most| most.value.abs() >= least).or(up)
    }
}

/// Displacement or rotation of a node with these terms.
pub(super) fn moved(motion: &[(usize, f64)], disp: &[f64]) -> f64 {
    let terms = motion.iter();
    terms.map(|(dof, share)| share * disp[*dof]).sum()
}
