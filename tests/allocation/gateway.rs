//! An exchange on a server allocates nothing: limits, formula, log.

use gusset_actuator::specimen::SpecimenLaw;
use gusset_config::LimitsSpec;
use gusset_link::served::{Computed, Controller, RecordSettings, ServedSpecimen};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::substructure::{Command, Measurement};
use gusset_quantity::units::AxisUnits;
use gusset_record::Run;

#[test]
fn exchange_allocates_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let text = "law = { bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }";
    let law: SpecimenLaw = toml::from_str(text).unwrap();
    let law = Computed::new(law.build(2).unwrap(), false);
    let (stiffness, mass) = law.reference();
    let limits: LimitsSpec = toml::from_str(
        "command_disp_m = { warn = [-0.9, 0.9], trip = [-1, 1] }\nmeasured_force_n = { trip = [-1e6, 1e6] }\n\
         command_vel_m_per_s = { trip = 100 }\nfollowing_error_m = { trip = 1 }\nforce_step_n = { trip = 1e6 }\n",
    )
    .unwrap();
    let units = vec![AxisUnits::SI; 2];
    let mut served = ServedSpecimen::new("rig".into(), Box::new(law), units, stiffness, mass)
        .limited(&[limits, limits])
        .recorded(Some(RecordSettings {
            root: folder.path().into(),
            file: Vec::new(),
            resolved: String::new(),
            about: None,
            inputs: Vec::new(),
            queue_s: 4.0,
            required: false,
            accepted: Default::default(),
            verdict: None,
            ended: None,
        }));
    served.begin(&Controller::nobody(), &mut || Ok(())).unwrap();
    let mut measured = Measurement::zeros(2);
    let count = allocation_counter::measure(|| {
        for sequence in 0..500 {
            let way = 0.03 * libm::sin(0.1 * sequence as f64);
            let command = Command {
                sequence,
                time: 0.01 * sequence as f64,
                dt: 0.01,
                disp: &[way, -way],
                vel: &[0.0, 0.0],
            };
            served
                .exchange(&command, 0.01, &mut || true, &mut measured)
                .unwrap();
            served.commit();
        }
    });
    assert_eq!(count.count_total, 0);
    served.end(Cause::Done, "end of the test");
    let run = Run::open(&folder.path().join("test-0001")).unwrap();
    let steps = run.columns(&["step"]).unwrap().remove(0);
    assert_eq!(steps.len(), 500);
    assert_eq!(run.summary().unwrap().steps, 500);
}
