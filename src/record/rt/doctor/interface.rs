//! Findings about a network interface that is to carry an EtherCAT bus.

use super::machine::Tree;
use super::{Finding, Verdict};
use crate::rt::os;

/// Kind of an Ethernet interface in the kernel's files (ARPHRD_ETHER).
const ETHERNET: &str = "1";
/// Longest delay in µs of an interrupt that does not hurt a tick.
const MOST_COALESCING_US: u32 = 5;

/// Examines the interface of this name: its kind, our rights, its delay of interrupts and the processors that take them.
#[must_use]
pub fn examine_interface(name: &str) -> Vec<Finding> {
    findings(
        &Tree::of_this_machine(),
        name,
        (os::privileges().net_raw, os::coalescing_us(name)),
    )
}

fn findings(
    tree: &Tree,
    name: &str,
    (may_send, coalescing_us): (bool, Option<u32>),
) -> Vec<Finding> {
    vec![
        interface(tree, name),
        rights(may_send),
        coalescing(name, coalescing_us),
        interrupts(tree, name),
    ]
}

fn interface(tree: &Tree, name: &str) -> Finding {
    const TOPIC: &str = "interface";
    let at = format!("sys/class/net/{name}");
    let Some(kind) = tree.text(&format!("{at}/type")) else {
        let known = tree.names("sys/class/net").join(", ");
        let advice = format!("use one of: {known}");
        return Finding::new(
            TOPIC,
            format!("{name} does not exist"),
            Verdict::Poor,
            &advice,
        );
    };
    if kind != ETHERNET || !tree.names(&format!("{at}/wireless")).is_empty() {
        let found = format!("{name} is no wired Ethernet interface");
        return Finding::new(TOPIC, found, Verdict::Poor, "EtherCAT needs a cable");
    }
    match tree.text(&format!("{at}/operstate")).as_deref() {
        Some("up" | "unknown") => Finding::new(TOPIC, format!("{name} is up"), Verdict::Good, ""),
        state => {
            let advice =
                format!("ip link set {name} up; then look at the cable and the first device");
            let state = state.unwrap_or("not known");
            Finding::new(TOPIC, format!("{name} is {state}"), Verdict::Poor, &advice)
        }
    }
}

fn rights(may_send: bool) -> Finding {
    const TOPIC: &str = "right to raw frames";
    if may_send {
        return Finding::new(TOPIC, "granted", Verdict::Good, "");
    }
    Finding::new(
        TOPIC,
        "refused (CAP_NET_RAW)",
        Verdict::Poor,
        "sudo setcap cap_net_raw,cap_sys_nice,cap_ipc_lock=ep $(command -v gusset)",
    )
}

fn coalescing(name: &str, micros: Option<u32>) -> Finding {
    const TOPIC: &str = "delay of interrupts";
    match micros {
        None => Finding::new(
            TOPIC,
            format!("the driver of {name} does not say"),
            Verdict::Unknown,
            "",
        ),
        Some(micros) if micros <= MOST_COALESCING_US => {
            Finding::new(TOPIC, format!("{micros} µs"), Verdict::Good, "")
        }
        Some(micros) => {
            let advice =
                format!("ethtool -C {name} adaptive-rx off rx-usecs 0 rx-frames 1 tx-usecs 0");
            Finding::new(TOPIC, format!("{micros} µs"), Verdict::Fair, &advice)
        }
    }
}

fn interrupts(tree: &Tree, name: &str) -> Finding {
    const TOPIC: &str = "processors of its interrupts";
    let isolated = tree
        .cpus("sys/devices/system/cpu/isolated")
        .unwrap_or_default();
    let numbers = tree.names(&format!("sys/class/net/{name}/device/msi_irqs"));
    let cpus: Vec<usize> = numbers
        .iter()
        .filter_map(|number| tree.cpus(&format!("proc/irq/{number}/smp_affinity_list")))
        .flatten()
        .collect();
    if cpus.is_empty() {
        let found = format!("the interrupts of {name} are not listed");
        return Finding::new(TOPIC, found, Verdict::Unknown, "");
    }
    let on_isolated = cpus.iter().any(|cpu| isolated.contains(cpu));
    let found = format!("{} interrupts on processors {cpus:?}", numbers.len());
    if isolated.is_empty() || !on_isolated {
        return Finding::new(TOPIC, found, Verdict::Good, "");
    }
    let advice = format!(
        "keep them off the loop's processor: echo 0 > /proc/irq/N/smp_affinity_list for N in {}",
        numbers.join(", ")
    );
    Finding::new(TOPIC, found, Verdict::Fair, &advice)
}

#[cfg(test)]
mod tests {
    use super::super::machine::tests::machine;
    use super::*;

    fn verdicts(tree: &Tree, name: &str, asked: (bool, Option<u32>)) -> Vec<Verdict> {
        let all = findings(tree, name, asked);
        for finding in &all {
            assert!(finding.verdict != Verdict::Poor || finding.advice.is_some());
        }
        all.iter().map(|finding| finding.verdict).collect()
    }

    #[test]
    fn tuned_interface_is_good() {
        let (_dir, tree) = machine(&[
            ("sys/class/net/enp3s0/type", "1\n"),
            ("sys/class/net/enp3s0/operstate", "up\n"),
            ("sys/class/net/enp3s0/device/msi_irqs/31", ""),
            ("proc/irq/31/smp_affinity_list", "0-1\n"),
            ("sys/devices/system/cpu/isolated", "3\n"),
        ]);
        assert_eq!(
            verdicts(&tree, "enp3s0", (true, Some(0))),
            [Verdict::Good; 4]
        );
    }

    #[test]
    fn every_fault_of_an_interface_is_found() {
        let (_dir, tree) = machine(&[
            ("sys/class/net/enp3s0/type", "1\n"),
            ("sys/class/net/enp3s0/operstate", "down\n"),
            ("sys/class/net/enp3s0/device/msi_irqs/31", ""),
            ("proc/irq/31/smp_affinity_list", "3\n"),
            ("sys/devices/system/cpu/isolated", "3\n"),
            ("sys/class/net/wlan0/type", "1\n"),
            ("sys/class/net/wlan0/wireless/link", ""),
            ("sys/class/net/lo/type", "772\n"),
        ]);
        let (fair, poor) = (Verdict::Fair, Verdict::Poor);
        assert_eq!(
            verdicts(&tree, "enp3s0", (false, Some(50))),
            [poor, poor, fair, fair]
        );
        for name in ["wlan0", "lo", "none"] {
            assert_eq!(verdicts(&tree, name, (false, None))[0], poor, "{name}");
        }
        let missing = &findings(&tree, "none", (false, None))[0];
        assert!(missing.advice.as_ref().unwrap().contains("enp3s0"));
    }
}
