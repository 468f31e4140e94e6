//! A specimen of `gusset serve` over OpenFresco's protocols, as a client sees it: US units, a transformation between the client's
//! displacements and the axes, and the controller of SimFEAdapter.

use std::io::{Read, Write};
use std::net::{TcpStream, UdpSocket};
use std::path::Path;

use crate::link_common::{
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
    /// Place of the first force in an answer.
    force_at: usize,
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
            force_at: answer[..3].iter().sum::<i32>() as usize,
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
        let answer = self.ask(GET_FORCE)?;
        self.send(&[5.0]);
        Some(answer[self.force_at..self.force_at + self.dofs].to_vec())
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
fn inches_are_answered_in_kips_or_pounds() {
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
fn native_protocol_refuses_inches_and_kips() {
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
        assert!(said.contains(&format!("`{key}`")), "{said}");
        assert!(said.contains("rig.toml:3:"), "{said}");
    }
}

/// Both ends in inches and kips, which is the same test as in process.
#[test]
fn test_commands_in_inches_over_openfresco() {
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
    assert!(!said.contains("reports a"), "{said}");
    let column = |name: &str, column: &str| {
        let run = gusset_record::Run::open(&folder.join(name)).unwrap();
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

const BILINEAR: &str =
    "law.bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 }";

fn outer(row: &[f64], k: f64) -> Vec<f64> {
    let pairs = row.iter().flat_map(|a| row.iter().map(move |b| a * k * b));
    pairs.collect()
}

#[test]
fn free_nodes_get_their_force_and_tangent() {
    let folder = tempfile::tempdir().unwrap();
    let table = format!("rows = [[-1, 1]]\nlimits.command_disp_m.trip = [-0.05, 0.05]\n{BILINEAR}");
    let served = serve(folder.path(), &table);
    let mut client = Client::wanting(&served, 2, [2, 2, 0, 2, 0]);
    assert_eq!(client.matrix(12.0), outer(&[-1.0, 1.0], 8000.0));
    // Limits are those of the axis: both nodes go a metre, and 20 mm come between them.
    client.trial(&[1.0, 1.02], &[0.1, 0.3]);
    let answer = client.ask(GET_FORCE).unwrap();
    let force = 60.0 + 400.0 * (0.02 - 0.0075);
    near(&answer[..4], &[1.0, 1.02, 0.1, 0.3]);
    near(&answer[4..6], &[-force, force]);
    near(&client.matrix(GET_TANGENT), &outer(&[-1.0, 1.0], 400.0));
    for code in [14.0, 15.0] {
        assert_eq!(client.matrix(code), [0.0; 4]);
    }
    // An iteration of the same step starts from the committed state.
    client.time -= 0.01;
    near(
        &client.step(&[0.0, 0.005], &[0.0; 2]).unwrap(),
        &[-40.0, 40.0],
    );
    near(&client.matrix(GET_TANGENT), &outer(&[-1.0, 1.0], 8000.0));
    assert!(client.step(&[0.0, 0.06], &[0.0; 2]).is_none());
    served.hears("command_disp_m");
}

#[test]
fn inclined_brace_pulls_all_displacements() {
    let folder = tempfile::tempdir().unwrap();
    let row = [-0.6, -0.8, 0.6, 0.8];
    let table = format!(
        "rows = [{row:?}]\naxis = [{{ unit_disp = \"in\", unit_force = \"kip\" }}]\n{BILINEAR}"
    );
    let served = serve(folder.path(), &table);
    let mut client = Client::new(&served, 4);
    let force = client.step(&[0.0, 0.1, 0.2, 0.2], &[0.0; 4]).unwrap();
    // 0.12 + 0.08 in along the brace.
    let along = 8000.0 * 0.2 * INCH / KIP;
    near(&force, &row.map(|part| part * along));
    let tangent = client.matrix(GET_TANGENT);
    near(&tangent, &outer(&row, 8000.0 * INCH / KIP));
}

/// A fixed base: d1 = x1, d2 = x2 − x1.
#[test]
fn two_axes_are_coupled_by_their_rows() {
    let folder = tempfile::tempdir().unwrap();
    let table = "rows = [[1, 0], [-1, 1]]\n\
                 laws = [{ linear = { stiffness_n_per_m = 50.0 } }, { linear = { stiffness_n_per_m = 300.0 } }]";
    let served = serve(folder.path(), table);
    let mut client = Client::new(&served, 2);
    let force = client.step(&[0.1, 0.3], &[0.0; 2]).unwrap();
    near(&force, &[5.0 - 60.0, 60.0]);
    near(&client.matrix(GET_TANGENT), &[350.0, -300.0, -300.0, 300.0]);
}

#[test]
fn unservable_rows_are_refused_at_their_key() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |table: &str, arguments: &[&str]| {
        let text = format!("[[specimen]]\nname = \"rig\"\n{table}\n");
        let mut command = gusset();
        command
            .arg("serve")
            .arg(write(folder.path(), "rig.toml", &text))
            .args(arguments);
        let output = finish(command);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{said}");
        said
    };
    let said = refused(&format!("rows = [[-1, 1]]\n{BILINEAR}"), &[]);
    assert!(said.contains("rig.toml:3:"), "{said}");
    assert!(said.contains("--protocol openfresco"), "{said}");
    for (table, line) in [
        (format!("rows = [[-1, 1], [1]]\n{BILINEAR}"), "rig.toml:3:"),
        (format!("rows = [[0, 0]]\n{BILINEAR}"), "rig.toml:3:"),
        (format!("storey = 1\n{BILINEAR}"), "rig.toml:3:"),
        (
            format!(
                "rows = [[-1, 1], [1, 0]]\n{BILINEAR}\n[[specimen.axis]]\n[[specimen.axis]]\nunit_disp = \"mm\""
            ),
            "rig.toml:6:",
        ),
    ] {
        let said = refused(&table, OVER_OPENFRESCO);
        assert!(said.contains(line), "{said}");
    }
}

/// Its rows are those of its structure: the axes are served, as always.
#[test]
fn served_test_offers_its_axes() {
    let folder = tempfile::tempdir().unwrap();
    let table = format!("rows = [[-1, 1]]\nstiffness_n_per_m = 4e5\n{ONE_AXIS_LAW}");
    let served = Served::start(folder.path(), &test_file(10, &table), OVER_OPENFRESCO);
    let mut client = Client::new(&served, 1);
    near(&client.matrix(12.0), &[4e5]);
}

/// A recorded exchange: which end sent each message, and its bytes.
fn recorded(name: &str) -> Vec<(bool, Vec<u8>)> {
    let path = format!("{}/tests/captures/{name}.jsonl", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let messages = text.lines().skip(1).map(|line| {
        let line: serde_json::Value = serde_json::from_str(line).unwrap();
        let hex = line["hex"].as_str().unwrap_or_default();
        let digits = (0..hex.len()).step_by(2).map(|at| &hex[at..at + 2]);
        let mut bytes: Vec<u8> = digits
            .map(|digits| u8::from_str_radix(digits, 16).unwrap())
            .collect();
        bytes.resize(line["len"].as_u64().unwrap() as usize, 0);
        (line["dir"] == "c2s", bytes)
    });
    messages.filter(|(_, bytes)| !bytes.is_empty()).collect()
}

fn first_two(bytes: &[u8]) -> [f64; 2] {
    [0, 8].map(|at| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()))
}

/// OpenFresco's SimFEAdapter takes our controller for an adapter element: it commands, requests with 10, never commits, and sends
/// two goodbyes.
#[test]
fn simfeadapter_bytes_are_answered() {
    let folder = tempfile::tempdir().unwrap();
    let law =
        "law.bilinear = { stiffness_n_per_m = 2.8, yield_force_n = 1.5, post_yield_ratio = 0.02 }";
    let text = format!("[[specimen]]\nname = \"rig\"\n{law}\n");
    for (name, transport) in [
        ("openfresco-simfeadapter-to-opensees-adapter-tcp", "tcp"),
        (
            "openfresco-simfeadapter-to-opensees-adapter-udp-hello",
            "udp",
        ),
    ] {
        let arguments = [
            "--protocol",
            "openfresco-controller",
            "--transport",
            transport,
        ];
        let served = Served::start(folder.path(), &text, &arguments);
        let mut stream = (transport == "tcp").then(|| TcpStream::connect(&served.address).unwrap());
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        if let Some(stream) = &stream {
            stream.set_read_timeout(Some(PATIENCE)).unwrap();
        }
        socket.set_read_timeout(Some(PATIENCE)).unwrap();
        socket.connect(&served.address).unwrap();
        let mut commanded = 0.0;
        let mut forces = 0;
        for (from_client, bytes) in recorded(name) {
            if from_client {
                if let [3.0, disp] = first_two(&[&bytes[..], &[0; 16]].concat()) {
                    commanded = disp;
                }
                // The second goodbye may find the port closed.
                let _ = match &mut stream {
                    Some(stream) => stream.write_all(&bytes),
                    None => socket.send(&bytes).map(|_| ()),
                };
                continue;
            }
            let mut ours = vec![0; bytes.len()];
            match &mut stream {
                Some(stream) => stream.read_exact(&mut ours).unwrap(),
                None => assert_eq!(socket.recv(&mut ours).unwrap(), bytes.len()),
            }
            if bytes.len() == 1 {
                assert_eq!(ours, bytes, "the hello");
                continue;
            }
            // The spring of the recorded adapter, 1e12, gives the model 2.8 / 1e12 less, and the force to 1e-4.
            let ([disp, force], [their_disp, their_force]) = (first_two(&ours), first_two(&bytes));
            assert_eq!(disp, commanded);
            assert!((disp - their_disp).abs() < 1e-11, "{disp} {their_disp}");
            assert!((force - their_force).abs() < 1e-3, "{force} {their_force}");
            forces += 1;
        }
        assert_eq!(forces, 5);
        served.hears("the client ended the test; 5 commands");
    }
}
