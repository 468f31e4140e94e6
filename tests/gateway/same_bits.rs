//! A gateway changes no number: controller → gateway → specimen takes the course of the same test in process, to the last bit, with
//! any pair of protocols.

use crate::link_common::{
    ONE_AXIS, ONE_AXIS_LAW, Served, TWO_AXES, TWO_AXES_LAW, columns, gateway, run, summary,
    test_file,
};

const STEPS: u32 = 400;

/// The protocol of one of the two links: arguments of the server, and link keys of its client.
#[derive(Clone, Copy)]
struct Speech {
    serve: &'static [&'static str],
    link: &'static str,
}

const TCP: Speech = Speech {
    serve: &["--transport", "tcp"],
    link: "transport = \"tcp\"\nwatchdog_s = 20",
};
const UDP: Speech = Speech {
    serve: &["--transport", "udp"],
    link: "transport = \"udp\"\nwatchdog_s = 20",
};
const ELEMENT: Speech = Speech {
    serve: &["--protocol", "openfresco"],
    link: "protocol = \"openfresco\"\nopenfresco = { answer_signals = [1, 1, 1, 1, 1] }",
};
const ELEMENT_UDP: Speech = Speech {
    serve: &["--protocol", "openfresco", "--transport", "udp"],
    link: "protocol = \"openfresco\"\ntransport = \"udp\"\nopenfresco = { answer_signals = [1, 1, 1, 1, 1] }",
};
const SITE: Speech = Speech {
    serve: &["--protocol", "openfresco-actor"],
    link: "protocol = \"openfresco-shadow\"\n[specimen.link.openfresco]\ncommand_signals = [1, 1, 0, 0, 1]",
};

/// All three files have these `units` of the axes.
fn passes_through(up: Speech, down: Speech, seen: &str, law: &str, units: &str) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let local = test_file(STEPS, &format!("{seen}{units}{law}"));
    assert_eq!(run(folder, "local", &local).0, 0);
    let specimen = Served::start(folder, &local, down.serve);
    // The estimate is what a gateway must know of its specimen; the rows are the controller's.
    let known: String = seen
        .lines()
        .filter(|line| line.starts_with("stiffness"))
        .map(|line| format!("{line}\n"))
        .collect();
    let file = gateway(&specimen.address, &format!("{known}{units}"), down.link);
    let between = Served::start(folder, &file, up.serve);
    for name in ["first", "second"] {
        let link = format!(
            "[specimen.link]\naddress = \"{}\"\n{}\n",
            between.address, up.link
        );
        let (code, said) = run(
            folder,
            name,
            &test_file(STEPS, &format!("{seen}{units}{link}")),
        );
        assert_eq!(code, 0, "{said}");
        assert_eq!(columns(folder, "local", ""), columns(folder, name, ""));
        let counts = summary(folder, name).link["column"];
        assert_eq!(counts.sent, u64::from(STEPS) + 1 + 5);
        assert_eq!((counts.received, counts.lost), (counts.sent, 0));
    }
}

#[test]
fn native_gateway_keeps_bits_on_tcp_and_udp() {
    for (up, down) in [(TCP, TCP), (UDP, UDP), (TCP, UDP)] {
        passes_through(up, down, ONE_AXIS, ONE_AXIS_LAW, "");
    }
}

#[test]
fn two_axes_in_different_units() {
    let units = "[[specimen.axis]]\nunit_disp = \"mm\"\nunit_force = \"kN\"\n[[specimen.axis]]\n";
    passes_through(TCP, TCP, TWO_AXES, TWO_AXES_LAW, units);
    passes_through(UDP, TCP, TWO_AXES, TWO_AXES_LAW, units);
}

#[test]
fn openfresco_on_the_specimens_side() {
    for down in [ELEMENT, ELEMENT_UDP, SITE] {
        passes_through(TCP, down, ONE_AXIS, ONE_AXIS_LAW, "");
    }
}

#[test]
fn openfresco_gateway_passes_the_bits() {
    for up in [ELEMENT, ELEMENT_UDP, SITE] {
        passes_through(up, TCP, ONE_AXIS, ONE_AXIS_LAW, "");
    }
    passes_through(ELEMENT, ELEMENT, ONE_AXIS, ONE_AXIS_LAW, "");
}

#[test]
fn a_gateway_behind_a_gateway() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let local = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    assert_eq!(run(folder, "local", &local).0, 0);
    let specimen = Served::start(folder, &local, &[]);
    let known = "stiffness_n_per_m = 4e5\n";
    let near = Served::start(folder, &gateway(&specimen.address, known, ""), &[]);
    let nearer = Served::start(folder, &gateway(&near.address, known, ""), &[]);
    let link = format!("[specimen.link]\naddress = \"{}\"\n", nearer.address);
    let (code, said) = run(
        folder,
        "far",
        &test_file(STEPS, &format!("{ONE_AXIS}{link}")),
    );
    assert_eq!(code, 0, "{said}");
    assert_eq!(columns(folder, "local", ""), columns(folder, "far", ""));
}
