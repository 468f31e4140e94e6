//! What `gusset serve` offers over OpenFresco's protocols, as a client sees it: US units, and a transformation between the
//! client's displacements and the axes.

mod link_common;

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;

use link_common::{
    ONE_AXIS, ONE_AXIS_LAW, PATIENCE, Served, finish, gusset, run, test_file, write,
};

const INCH: f64 = 0.0254;
const KIP: f64 = 4448.2216152605;
const POUND: f64 = 4.4482216152605;
const GET_FORCE: f64 = 10.0;
const GET_TANGENT: f64 = 13.0;
const OVER_OPENFRESCO: &[&str] = &["--protocol", "openfresco"];

/// Doubles in a vector.
const N: usize = 32;

/// A client that speaks as OpenSees' `genericClient` does: displacements, velocities, accelerations and time out, forces in.
struct Client {
    stream: TcpStream,
    dofs: usize,
    time: f64,
}

impl Client {
    fn new(served: &Served, dofs: usize) -> Self {
        let n = dofs as i32;
        Self::wanting(served, dofs, [0, 0, 0, n, 0])
    }

    fn wanting(served: &Served, dofs: usize, answer: [i32; 5]) -> Self {
        let mut stream = TcpStream::connect(&served.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let n = dofs as i32;
        let counts = [&[n, n, n, 0, 1], &answer[..], &[N as i32]].concat();
        let sizes: Vec<u8> = counts.into_iter().flat_map(i32::to_le_bytes).collect();
        stream.write_all(&sizes).unwrap();
        Self {
            stream,
            dofs,
            time: 0.0,
        }
    }

    fn send(&mut self, values: &[f64]) {
        let mut vector = values.to_vec();
        vector.resize(N, 0.0);
        let bytes: Vec<u8> = vector.into_iter().flat_map(f64::to_le_bytes).collect();
        self.stream.write_all(&bytes).unwrap();
    }

    fn ask(&mut self, code: f64) -> Option<Vec<f64>> {
        self.send(&[code]);
        let mut answer = [0; 8 * N];
        self.stream.read_exact(&mut answer).ok()?;
        let words = answer.chunks_exact(8);
        Some(
            words
                .map(|word| f64::from_le_bytes(word.try_into().unwrap()))
                .collect(),
        )
    }

    fn trial(&mut self, disp: &[f64], vel: &[f64]) {
        self.time += 0.01;
        let (zeros, time) = (vec![0.0; self.dofs], self.time);
        self.send(&[&[3.0], disp, vel, &zeros, &[time]].concat());
    }

    /// The forces of one step, which is committed.
    fn step(&mut self, disp: &[f64], vel: &[f64]) -> Option<Vec<f64>> {
        self.trial(disp, vel);
        let mut force = self.ask(GET_FORCE)?;
        force.truncate(self.dofs);
        self.send(&[5.0]);
        Some(force)
    }

    fn matrix(&mut self, code: f64) -> Vec<f64> {
        let mut matrix = self.ask(code).unwrap();
        matrix.truncate(self.dofs * self.dofs);
        matrix
    }
}

#[track_caller]
fn near(found: &[f64], wanted: &[f64]) {
    assert_eq!(found.len(), wanted.len());
    let largest = wanted.iter().fold(0.0, |m: f64, w| m.max(w.abs()));
    for (found_one, wanted_one) in found.iter().zip(wanted) {
        let difference = (found_one - wanted_one).abs();
        assert!(
            difference <= 1e-12 * largest,
            "{found:?}, wanted {wanted:?}"
        );
    }
}

fn serve(folder: &Path, table: &str) -> Served {
    let text = format!("[[specimen]]\nname = \"rig\"\n{table}\n");
    Served::start(folder, &text, OVER_OPENFRESCO)
}

#[test]
fn commands_in_inches_are_answered_in_kips_or_pounds() {
    let folder = tempfile::tempdir().unwrap();
    let (k, c) = (8000.0, 50.0);
    for (unit, newtons) in [("kip", KIP), ("lbf", POUND)] {
        let table = format!(
            "axis = [{{ unit_disp = \"in\", unit_force = \"{unit}\" }}]\n\
             limits.command_disp_m.trip = [-0.05, 0.05]\n\
             law.linear = {{ stiffness_n_per_m = {k}, damping_n_s_per_m = {c} }}"
        );
        let served = serve(folder.path(), &table);
        let mut client = Client::new(&served, 1);
        let force = client.step(&[1.0], &[2.0]).unwrap();
        near(&force, &[(k * INCH + c * 2.0 * INCH) / newtons]);
        for code in [12.0, GET_TANGENT] {
            near(&client.matrix(code), &[k * INCH / newtons]);
        }
        // Limits stay in m: 1.96 in are 49.8 mm, and 2 in are 50.8 mm.
        assert!(client.step(&[1.96], &[0.0]).is_some());
        assert!(client.step(&[2.0], &[0.0]).is_none());
        served.hears("command_disp_m");
    }
}

#[test]
fn the_protocol_of_gusset_refuses_inches_and_kips_at_their_key() {
    let folder = tempfile::tempdir().unwrap();
    for (key, unit) in [
        ("unit_disp", "in"),
        ("unit_force", "lbf"),
        ("unit_force", "kip"),
    ] {
        let text = format!(
            "[[specimen]]\nname = \"rig\"\naxis = [{{ {key} = \"{unit}\" }}]\n{ONE_AXIS_LAW}"
        );
        let mut command = gusset();
        command
            .arg("serve")
            .arg(write(folder.path(), "rig.toml", &text));
        let output = finish(command);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(&format!("no such `{key}`")), "{said}");
        assert!(said.contains("rig.toml:3:"), "{said}");
    }
}

/// Both ends in inches and kips, which is the same test as in process.
#[test]
fn a_test_commands_in_inches_over_openfresco() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let units = "[[specimen.axis]]\nunit_disp = \"in\"\nunit_force = \"kip\"\n";
    let local = test_file(400, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    assert_eq!(run(folder, "local", &local).0, 0);
    let served = Served::start(
        folder,
        &test_file(400, &format!("{ONE_AXIS}{units}{ONE_AXIS_LAW}")),
        OVER_OPENFRESCO,
    );
    let link = format!(
        "[specimen.link]\naddress = \"{}\"\nprotocol = \"openfresco\"\n",
        served.address
    );
    let text = test_file(400, &format!("{ONE_AXIS}{units}{link}"));
    let (code, said) = run(folder, "far", &text);
    assert_eq!(code, 0, "{said}");
    // The estimates of both ends agree in N/m.
    assert!(!said.contains("reports a stiffness"), "{said}");
    let column = |name: &str, column: &str| {
        let run = gusset::record::Run::open(&folder.join(name)).unwrap();
        run.columns(&[column]).unwrap().remove(0)
    };
    for name in ["target_1_1", "force_1_1"] {
        let (near, far) = (column("local", name), column("far", name));
        let peak = near.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        assert!(peak > 0.0);
        let worst = near.iter().zip(&far).map(|(a, b)| (a - b).abs());
        assert!(worst.fold(0.0, f64::max) < 1e-9 * peak, "{name}");
    }
}
