//! How a gateway that paces makes up for the lag of its specimen, and how it sees whether that follows: as the loop of a test does.

use super::super::specimens::compensation::{TRACKED, usual_gain};
use gusset_actuator::compensation::{CompensationSpec, Compensator};
use gusset_config::{Finding, KeyPath, LimitsSpec, ServedFile, SpecimenTable};
use gusset_control::port::{Compensation, NeedsMeasuredDisp, PortSpec, TrackingSpec};

/// Ticks of a steady motion after which a compensator leads steadily.
const RAMP_TICKS: u32 = 2000;

/// Compensators and tracking of a port whose commands come every `tick` s of wall time.
#[derive(Debug, Clone)]
pub(super) struct Following {
    compensation: Option<CompensationSpec>,
    tick: f64,
}

impl Following {
    /// None if the file asks for neither.
    ///
    /// # Errors
    /// A compensator that cannot be built or that this server lacks; a limit of tracking without evenly spaced commands.
    pub(crate) fn of(
        source: &ServedFile,
        table: &SpecimenTable,
        at: &KeyPath,
    ) -> Result<Option<Self>, Box<Finding>> {
        let axes = table.axes();
        let limits = table.limits_of(axes);
        let is_limited = |limits: &LimitsSpec| TRACKED.iter().any(|limit| limits.has(*limit));
        let is_limited = limits.iter().any(is_limited);
        if source.is_test || (table.compensation.is_none() && !is_limited) {
            return Ok(None);
        }
        let Some(pace) = &source.file.serve.pace else {
            let text = "a limit of lag or gain needs evenly spaced commands";
            let finding = Finding::error(at.key("limits"), text)
                .help("give `pace` in [serve], or leave out `lag_s` and `gain_error`");
            return Err(Box::new(finding));
        };
        let following = Self {
            compensation: table.compensation.clone(),
            tick: pace.period_ns() as f64 * 1e-9,
        };
        following.check(&at.key("compensation"))?;
        Ok(Some(following))
    }

    /// Time in s by which the compensators lead a steady motion, before they have learnt anything.
    pub(super) fn lead_s(&self) -> f64 {
        let built = self.compensation.as_ref();
        let Some(mut built) = built.and_then(|spec| spec.build(self.tick).ok()) else {
            return 0.0;
        };
        built.reset(0.0);
        let mut led = 0.0;
        for k in 1..=RAMP_TICKS {
            led = built.lead(f64::from(k) * self.tick, 1.0, 0.0);
        }
        let target = f64::from(RAMP_TICKS) * self.tick;
        (led - built.stands(1.0) * target).abs()
    }

    fn check(&self, at: &KeyPath) -> Result<(), Box<Finding>> {
        let Some(spec) = &self.compensation else {
            return Ok(());
        };
        if matches!(spec, CompensationSpec::Newton(_)) {
            let text = "`newton` needs velocity and acceleration targets, which the client of a gateway does not send";
            let finding = Finding::error(at.key("newton"), text)
                .at_key()
                .help("use `polynomial` with order = 2");
            return Err(Box::new(finding));
        }
        let built = spec
            .build(self.tick)
            .map_err(|error| Box::new(Finding::error(at.key(error.key()), error.to_string())))?;
        let gain = built.stands(1.0);
        if usual_gain(gain) {
            return Ok(());
        }
        let text = format!("a constant target of 1 mm gives a first command of {gain} mm");
        let finding = Finding::error(at.clone(), text).label("from 0.5 mm to 2 mm is allowed");
        Err(Box::new(finding.help(
            "the first coefficient must be 1/A for an actuator whose static gain is A",
        )))
    }

    /// Adds compensators for the lag of its axes to a port.
    ///
    /// # Errors
    /// A compensator that cannot be built.
    pub(crate) fn add_to(&self, spec: &mut PortSpec) -> Result<(), String> {
        if let Some(of) = &self.compensation {
            let built = spec.axes.iter().map(|_| of.build(self.tick));
            let built: Result<Vec<Box<dyn Compensator>>, _> = built.collect();
            spec.compensation = Some(Compensation {
                compensators: built.map_err(|error| error.to_string())?,
                tick: self.tick,
                pace: 1.0,
                delay_in_test_time: false,
                base_moves: false,
            });
        }
        spec.tracking = Some(TrackingSpec {
            dt: self.tick,
            ..TrackingSpec::default()
        });
        let adapts = self.compensation.as_ref();
        let adapts = adapts.filter(|spec| spec.uses_measured_disp());
        let own = adapts.map(|spec| format!("compensation.{}", spec.kind()));
        spec.needs_measured_disp = NeedsMeasuredDisp {
            own: own.into_iter().collect(),
            of_the_test: Vec::new(),
        };
        Ok(())
    }
}
