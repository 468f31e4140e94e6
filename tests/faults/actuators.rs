//! Actuators, sensors and compensators in the virtual laboratory. A specimen behind a server and a link gives the same bits as in
//! process, whatever fault of the link can be repaired. A fault that cannot be repaired has the same effect each time.

use std::path::Path;

use gusset_config::fault_script::Script;
use gusset_config::{Loaded, parse};
use gusset_record::Journal;

use crate::invariants;
use crate::lab::{Extra, Played, play};

/// Everything that may depend on the time and the number of its calls.
const RIGS: [&str; 4] = [
    "delay_s = 0.0137\n",
    "actuator.first_order = { time_constant_s = 0.012, gain = 0.97 }\nrate_limit_m_per_s = 0.05\n",
    "delay_s = 0.002\nactuator.second_order = { frequency_hz = 12, damping_ratio = 0.6 }\nstroke_m = 0.5\n",
    "actuator.servo_hydraulic = {}\nforce_limit_n = 8900\n",
];

const COMPENSATIONS: [&str; 4] = [
    "polynomial = { order = 2, nodes = \"step\", delay_s = 0.0137 }",
    "recursive_fir = { delay_s = 0.012 }",
    "ats = { delay_s = 0.02, window_s = 0.2, least_motion_m = 1e-6 }",
    "amb = {}",
];

const SENSORS: &str = "seed = 11\ndisp_sensor = { noise_rms_m = 2e-6, bias_m = 1e-5, quantum_m = 1e-7 }\n\
                       force_sensor = { noise_power_n2_s = 1e-4, drift_n_per_s = 0.5 }\n";

const LAW: &str = "law.bouc_wen = { stiffness_n_per_m = 6e5, yield_force_n = 1.2e3, post_yield_ratio = 0.1, beta = 0.5, \
                   gamma = 0.5, exponent = 2 }\n";

fn specimen(rig: &str) -> String {
    format!("[[specimen]]\nname = \"column\"\n{LAW}[specimen.transfer]\n{rig}{SENSORS}")
}

/// The specimen in process, or behind a lockstep link.
fn test(compensation: &str, rig: Option<&str>) -> Loaded {
    let behind = match rig {
        Some(rig) => format!("{LAW}[specimen.transfer]\n{rig}{SENSORS}"),
        None => "[specimen.link]\naddress = \"rig:1\"\ntransport = \"udp\"\ncoupling = \"lockstep\"\nprobe = \"none\"\n\
                 connect_timeout_s = 1\nreply_timeout_s = 5\n"
            .to_owned(),
    };
    let text = format!(
        "title = \"Behind a wire\"\n[time]\nrate_hz = 1000\nduration_s = 0.6\nclock = \"simulated\"\n\
         [structure.shear_building]\nmass_kg = [1000.0, 900.0]\nstiffness_n_per_m = [0, 4e5]\n\
         [structure.damping.rayleigh_ratio]\nratio = 0.1\nmodes = [1, 2]\n[integrator]\nlambda = 4\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = 2.0\nfrequency_hz = 3.0\n[timing]\nwarmup_ticks = 5\nmisses.in_total.trip = 1000000\nmisses.in_a_row.trip = 1000000\nmisses.in_window.trip = 1000000\n\
         [safety]\nzero_s = 0.02\nramp_s = 0.01\n[[specimen]]\nname = \"column\"\nstorey = 1\nstiffness_n_per_m = 6e5\n\
         damping_n_s_per_m = 0\nlimits = {{ command_disp_m = {{ trip = [-0.5, 0.5] }}, measured_force_n = {{ trip = [-1e5, 1e5] }} }}\n\
         compensation = {{ {compensation} }}\n{behind}"
    );
    parse(Path::new("wire.toml"), text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

fn played(compensation: &str, rig: &str, script: &Script) -> (Loaded, Played) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("rig.toml");
    std::fs::write(&file, specimen(rig)).unwrap();
    let loaded = test(compensation, None);
    let extra = Extra {
        script: Some(script),
        ..Extra::default()
    };
    let played = play(&loaded, extra, |_, _| {
        let host = gusset_setup::load_served(&file, None)
            .unwrap_or_else(|error| panic!("{error}"))
            .host;
        host.faulty(script.clone()).unwrap()
    });
    let played = played.unwrap_or_else(|error| panic!("{error}"));
    (loaded, played)
}

/// The columns of the running test that time does not touch, by name, as bits.
fn rows(played: &Played) -> Vec<(String, Vec<u64>)> {
    let columns = played.columns();
    let wanted: Vec<usize> = (0..columns.len()).collect();
    let values = Journal::new(&played.samples[..], columns.len())
        .columns(&wanted)
        .unwrap();
    let state = columns.iter().position(|c| c.name == "state").unwrap();
    let runs: Vec<bool> = values[state].iter().map(|state| *state == 3.0).collect();
    let kept = columns
        .iter()
        .zip(&values)
        .filter(|(column, _)| !column.timing);
    let bits = |values: &Vec<f64>| {
        let running = values.iter().zip(&runs).filter(|(_, runs)| **runs);
        running.map(|(value, _)| value.to_bits()).collect()
    };
    kept.map(|(column, values)| (column.name.clone(), bits(values)))
        .collect()
}

fn script(fault: &str) -> Script {
    toml::from_str(&format!("title = \"wire\"\nseed = 5\n{fault}")).unwrap()
}

#[test]
fn rig_behind_a_host_gives_the_same_bits() {
    // Nothing; what is late; what comes again; what is lost, and asked for again.
    let wires = [
        "",
        "[[fault]]\nkind = { jitter = { ticks = 0.6 } }\n",
        "[[fault]]\nkind = { duplicated = { times = 2 } }\n[[fault]]\non = \"commands\"\nkind = { duplicated = { times = 2 } }\n",
        "[[fault]]\nprobability = 0.1\nkind = \"lost\"\n[[fault]]\non = \"commands\"\nprobability = 0.1\nkind = \"lost\"\n",
    ];
    for (rig, compensation) in RIGS.into_iter().zip(COMPENSATIONS) {
        let here = test(compensation, Some(rig));
        let here = play(&here, Extra::default(), |_, _| unreachable!("no link")).unwrap();
        assert_eq!(here.verdict().1, 0, "{rig}{}", here.verdict().0);
        assert!(here.replay.is_exact(), "{rig}{:?}", here.replay.difference);
        let here = rows(&here);
        let count = here[0].1.len();
        assert_eq!(count, 601);
        assert!(here.iter().any(|(name, _)| name.starts_with("comp_")));
        for wire in wires {
            let (loaded, there) = played(compensation, rig, &script(wire));
            assert_eq!(there.verdict().1, 0, "{rig}{wire}{}", there.verdict().0);
            invariants::check(&loaded, &there).unwrap_or_else(|text| panic!("{rig}{wire}{text}"));
            assert!(
                there.replay.is_exact(),
                "{rig}{:?}",
                there.replay.difference
            );
            let there = rows(&there);
            assert_eq!(here.len(), there.len());
            for (here, there) in here.iter().zip(&there) {
                // Numbers of commands count all that was sent, ramps included; repetitions belong to the link.
                if here.0.starts_with("seq_") && !wire.is_empty() {
                    continue;
                }
                let row = here.1.iter().zip(&there.1).position(|(a, b)| a != b);
                let same = here.1.len() == there.1.len();
                assert!(
                    same && row.is_none(),
                    "{rig}{wire}{} in row {row:?}",
                    here.0
                );
            }
        }
    }
}

#[test]
fn actuator_faults_repeat_exactly() {
    let faults = [
        "[[fault]]\nat = 200\nkind = \"frozen\"\n",
        "[[fault]]\nat = 100\nkind = { rate = { vel_m_per_s = 0.01 } }\n",
        "[[fault]]\nat = 150\nfor = 50\nkind = { noise = { disp_m = 1e-3, force_n = 50 } }\n",
        "[[fault]]\nat = 300\nkind = { hangs = { ticks = 60.0 } }\n",
        "[[fault]]\nat = 300\nkind = \"saturated\"\n",
    ];
    for ((rig, compensation), fault) in RIGS.into_iter().zip(COMPENSATIONS).cycle().zip(faults) {
        let script = script(fault);
        let (loaded, one) = played(compensation, rig, &script);
        invariants::check(&loaded, &one).unwrap_or_else(|text| panic!("{rig}{fault}{text}"));
        let (_, other) = played(compensation, rig, &script);
        assert_eq!(one.samples, other.samples, "{rig}{fault}");
        assert_eq!(one.verdict(), other.verdict(), "{rig}{fault}");
        // It is seen in the rows.
        let (_, healthy) = played(compensation, rig, &Script::default());
        assert_ne!(one.samples, healthy.samples, "{rig}{fault}");
    }
}
