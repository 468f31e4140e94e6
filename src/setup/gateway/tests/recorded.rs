//! Rows of a gateway that paces: the numbers of targets, and a target that is refused.

use super::*;
use gusset_link::served::RecordSettings;
use gusset_quantity::catalog::ending::Cause;
use gusset_record::Run;

#[test]
fn refused_target_has_a_row() {
    let root = tempfile::tempdir().unwrap();
    let table = PLATFORM.replace(
        "limits = { command_step_m = { trip = 0.5 } }",
        "limits = { command_disp_m = { trip = [-0.02, 0.02] }, command_step_m = { trip = 0.5 } }",
    );
    let Behind { told, host } = behind_paced(&table);
    let host = host.recorded(RecordSettings {
        root: root.path().into(),
        file: Vec::new(),
        resolved: String::new(),
        about: None,
        inputs: Vec::new(),
        queue_s: 4.0,
        required: true,
        accepted: Default::default(),
        verdict: None,
        ended: None,
    });
    let rig = Behind { told, host };
    let mut served = rig.begun();
    // The numbers of this client have gaps.
    goes(&mut served, 7, &[0.0, 0.01, 0.0], &[0.0; 3]).unwrap();
    served.commit();
    goes(&mut served, 9, &[0.0, 0.02, 0.0], &[0.0; 3]).unwrap();
    served.commit();
    let refused = goes(&mut served, 12, &[0.0, 0.05, 0.0], &[0.0; 3]);
    assert!(matches!(refused, Err(Trip::Limit(_))), "{refused:?}");
    goes(&mut served, 13, &[f64::NAN, 0.0, 0.0], &[0.0; 3]).unwrap_err();
    goes(&mut served, 14, &[0.0, 0.03, 0.0], &[0.0; 3]).unwrap_err();
    served.end(Cause::Protocol, "");
    let run = Run::open(&root.path().join("test-0001")).unwrap();
    let names = ["state", "command", "target_1_3", "cmd_1_3", "trip"];
    let columns = run.columns(&names).unwrap();
    let [state, number, target, command, trip] = &columns[..] else {
        panic!("{columns:?}")
    };
    let of_targets: Vec<f64> = (0..state.len())
        .filter(|row| state[*row] != 2.0)
        .map(|row| number[row])
        .collect();
    let wanted = [[7.0; 20], [9.0; 20]].concat();
    assert_eq!(of_targets, [wanted, vec![12.0, 13.0, 14.0]].concat());
    let last = state.len() - 3;
    // 0.05 m of the structure is the target, although the third actuator never received it.
    assert!((target[last] - 0.05).abs() < 1e-3, "{}", target[last]);
    assert!((target[last - 1] - 0.02).abs() < 1e-3);
    assert!(command[last].is_nan() && target[last + 1].is_nan());
    // After the trip, too.
    assert!((target[last + 2] - 0.03).abs() < 1e-3);
    assert_eq!((state[last], trip[last]), (8.0, 1.0));
}
