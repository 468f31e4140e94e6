//! Findings from the kernel's files: read and assessed, without requests.

use std::path::PathBuf;

use super::{Finding, Verdict};
use crate::rt::proc;
use crate::rt::throttle::Throttle;

/// The directory tree that the kernel's files are read from.
#[derive(Debug, Clone)]
pub(crate) struct Tree {
    root: PathBuf,
}

impl Tree {
    /// The real one.
    #[must_use]
    pub(crate) fn of_this_machine() -> Self {
        Self::at("/")
    }

    /// A copy of another machine's files under `root`.
    #[must_use]
    pub(crate) fn at(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// Trimmed text of a file, if it exists. The path has no leading slash.
    fn text(&self, path: &str) -> Option<String> {
        let bytes = std::fs::read(self.root.join(path)).ok()?;
        Some(String::from_utf8_lossy(&bytes).trim().to_owned())
    }

    /// Sorted names in a directory; empty without one.
    fn names(&self, path: &str) -> Vec<String> {
        let Ok(entries) = std::fs::read_dir(self.root.join(path)) else {
            return Vec::new();
        };
        let mut names: Vec<String> = entries
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .collect();
        names.sort();
        names
    }

    fn cpus(&self, path: &str) -> Option<Vec<usize>> {
        proc::cpu_list(&self.text(path)?)
    }
}

const CPU: &str = "sys/devices/system/cpu";

/// All findings of this file, in the order of a report; `allowed`: the processors that the process may run on, if they are to
/// be assessed.
#[must_use]
pub(crate) fn findings(tree: &Tree, allowed: Option<&[usize]>) -> Vec<Finding> {
    vec![
        kernel(tree),
        throttling(tree),
        processors(tree, allowed),
        isolation(tree),
        tickless(tree),
        threads_per_core(tree),
        governor(tree),
        idle(tree),
        clock_source(tree),
        hypervisor(tree),
        steal(tree),
        swap(tree),
        huge_pages(tree),
    ]
}

fn kernel(tree: &Tree) -> Finding {
    const TOPIC: &str = "kernel";
    const ADVICE: &str =
        "for bounded latency install a PREEMPT_RT kernel (Debian: linux-image-rt-amd64)";
    let Some(version) = tree.text("proc/version") else {
        return Finding::unknown(TOPIC);
    };
    let release = version
        .split_whitespace()
        .nth(2)
        .unwrap_or("of unknown release");
    if version.contains("PREEMPT_RT") || tree.text("sys/kernel/realtime").as_deref() == Some("1") {
        return Finding::new(TOPIC, format!("{release}, PREEMPT_RT"), Verdict::Good, "");
    }
    if version.contains("PREEMPT_DYNAMIC") {
        // "none voluntary (full) lazy": the mode in use is in brackets; debugfs may be unreadable.
        let mode = tree
            .text("sys/kernel/debug/sched/preempt")
            .and_then(|modes| Some(modes.split_once('(')?.1.split_once(')')?.0.to_owned()));
        let mode = mode.map_or_else(
            || "mode not readable".to_owned(),
            |mode| format!("mode {mode}"),
        );
        return Finding::new(
            TOPIC,
            format!("{release}, PREEMPT_DYNAMIC ({mode}), no PREEMPT_RT"),
            Verdict::Fair,
            ADVICE,
        );
    }
    if version.contains("PREEMPT") {
        return Finding::new(
            TOPIC,
            format!("{release}, PREEMPT, no PREEMPT_RT"),
            Verdict::Fair,
            ADVICE,
        );
    }
    Finding::new(
        TOPIC,
        format!("{release}, kernel code is not preempted"),
        Verdict::Poor,
        ADVICE,
    )
}

fn throttling(tree: &Tree) -> Finding {
    const TOPIC: &str = "real-time throttling";
    let file = |name| tree.text(&format!("proc/sys/kernel/{name}"));
    let read = file("sched_rt_runtime_us").zip(file("sched_rt_period_us"));
    match read.and_then(|(runtime, period)| Throttle::parse(&runtime, &period)) {
        None => Finding::unknown(TOPIC),
        Some(throttle) => match throttle.runtime_us {
            None => Finding::new(
                TOPIC,
                "off: real-time threads may run without end",
                Verdict::Good,
                "",
            ),
            Some(runtime) if throttle.permille() >= 500 => {
                let found = format!(
                    "real-time threads may run {runtime} of {} µs ({:.1} %); the loop sleeps in every tick and stays below",
                    throttle.period_us,
                    throttle.permille() as f64 / 10.0
                );
                Finding::new(TOPIC, found, Verdict::Good, "")
            }
            Some(runtime) => Finding::new(
                TOPIC,
                format!(
                    "real-time threads may run only {runtime} of {} µs",
                    throttle.period_us
                ),
                Verdict::Poor,
                "sysctl kernel.sched_rt_runtime_us=950000",
            ),
        },
    }
}

fn processors(tree: &Tree, allowed: Option<&[usize]>) -> Finding {
    const TOPIC: &str = "processors";
    let Some(mut cpus) = tree.cpus(&format!("{CPU}/online")) else {
        return Finding::unknown(TOPIC);
    };
    let online = cpus.len();
    cpus.retain(|cpu| allowed.is_none_or(|allowed| allowed.contains(cpu)));
    let mut found = format!("{online} online");
    if cpus.len() < online {
        found += &format!(", {} may be used", cpus.len());
    }
    match cpus.as_slice() {
        [] => Finding::unknown(TOPIC),
        [_] => {
            let advice = if online > 1 {
                "let this program have two processors or more (taskset, cpuset, container)"
            } else {
                "use a machine with two processors or more"
            };
            found += ": the loop shares it with everything else";
            Finding::new(TOPIC, found, Verdict::Poor, advice)
        }
        [.., last] => {
            found += &format!("; the loop takes {last} unless told otherwise");
            Finding::new(TOPIC, found, Verdict::Good, "")
        }
    }
}

fn isolation(tree: &Tree) -> Finding {
    const TOPIC: &str = "isolated processors";
    match tree.cpus(&format!("{CPU}/isolated")).as_deref() {
        None => Finding::unknown(TOPIC),
        Some([]) => Finding::new(
            TOPIC,
            "none: ordinary threads and interrupts may run on the loop's processor",
            Verdict::Fair,
            "boot with isolcpus=managed_irq,domain,N and irqaffinity=0, and set [timing] cpu = N",
        ),
        Some(cpus) => {
            let found = format!("{cpus:?}");
            Finding::new(
                TOPIC,
                found,
                Verdict::Good,
                "set [timing] cpu to one of them",
            )
        }
    }
}

fn tickless(tree: &Tree) -> Finding {
    const TOPIC: &str = "tickless processors";
    let advice = "for rates above 10 kHz boot a kernel with NO_HZ_FULL and nohz_full=N rcu_nocbs=N";
    match tree.cpus(&format!("{CPU}/nohz_full")).as_deref() {
        // "(null)" where the kernel supports it but has no list.
        None | Some([]) => Finding::new(
            TOPIC,
            "none: the kernel's tick interrupts the loop",
            Verdict::Fair,
            advice,
        ),
        Some(cpus) => Finding::new(TOPIC, format!("{cpus:?}"), Verdict::Good, ""),
    }
}

fn threads_per_core(tree: &Tree) -> Finding {
    const TOPIC: &str = "simultaneous multithreading";
    match tree.text(&format!("{CPU}/smt/active")).as_deref() {
        Some("0") => Finding::new(TOPIC, "off", Verdict::Good, ""),
        Some("1") => Finding::new(
            TOPIC,
            "on: the loop may share its core with another thread",
            Verdict::Fair,
            "keep the sibling of the loop's processor idle, or echo off > /sys/devices/system/cpu/smt/control",
        ),
        _ => Finding::unknown(TOPIC),
    }
}

fn governor(tree: &Tree) -> Finding {
    const TOPIC: &str = "frequency governor";
    let mut governors: Vec<String> = tree
        .cpus(&format!("{CPU}/online"))
        .unwrap_or_default()
        .iter()
        .filter_map(|cpu| tree.text(&format!("{CPU}/cpu{cpu}/cpufreq/scaling_governor")))
        .collect();
    governors.sort();
    governors.dedup();
    match governors.as_slice() {
        [] => Finding::new(
            TOPIC,
            "none visible: this machine does not let programs choose the frequency",
            Verdict::Unknown,
            "",
        ),
        [one] if one == "performance" => Finding::new(TOPIC, one.as_str(), Verdict::Good, ""),
        some => Finding::new(
            TOPIC,
            some.join(", "),
            Verdict::Fair,
            "cpupower frequency-set -g performance",
        ),
    }
}

fn idle(tree: &Tree) -> Finding {
    const TOPIC: &str = "idle states";
    let driver = tree.text(&format!("{CPU}/cpuidle/current_driver"));
    let deepest = tree
        .names(&format!("{CPU}/cpu0/cpuidle"))
        .iter()
        .filter(|state| {
            tree.text(&format!("{CPU}/cpu0/cpuidle/{state}/disable"))
                .as_deref()
                != Some("1")
        })
        .filter_map(|state| {
            let state = format!("{CPU}/cpu0/cpuidle/{state}");
            let latency: u64 = tree.text(&format!("{state}/latency"))?.parse().ok()?;
            Some((latency, tree.text(&format!("{state}/name"))?))
        })
        .max();
    match (driver, deepest) {
        (Some(driver), Some((latency, name))) => {
            let found =
                format!("{driver}; the deepest state in use is {name}, {latency} µs to leave");
            let advice = "let the run write /dev/cpu_dma_latency ([timing] hold_cpu_awake), or boot with \
                          processor.max_cstate=1 intel_idle.max_cstate=0";
            if latency <= 10 {
                Finding::new(TOPIC, found, Verdict::Good, "")
            } else {
                Finding::new(TOPIC, found, Verdict::Fair, advice)
            }
        }
        _ => Finding::new(TOPIC, "none visible", Verdict::Unknown, ""),
    }
}

fn clock_source(tree: &Tree) -> Finding {
    const TOPIC: &str = "clock source";
    let advice = "boot with clocksource=tsc tsc=reliable if the processor's counter is constant and synchronised";
    match tree
        .text("sys/devices/system/clocksource/clocksource0/current_clocksource")
        .as_deref()
    {
        None => Finding::unknown(TOPIC),
        Some(name @ ("tsc" | "arch_sys_counter")) => Finding::new(
            TOPIC,
            format!("{name}: read without a system call"),
            Verdict::Good,
            "",
        ),
        Some(name @ ("kvm-clock" | "hyperv_clocksource_tsc_page")) => Finding::new(
            TOPIC,
            format!("{name}: the hypervisor's, read without a system call"),
            Verdict::Good,
            "",
        ),
        Some(name) => Finding::new(
            TOPIC,
            format!("{name}: slow, every reading is a system call"),
            Verdict::Poor,
            advice,
        ),
    }
}

fn hypervisor(tree: &Tree) -> Finding {
    const TOPIC: &str = "hypervisor";
    let Some(info) = tree.text("proc/cpuinfo") else {
        return Finding::unknown(TOPIC);
    };
    let flags = info.lines().find(|line| line.starts_with("flags"));
    match flags.map(|line| line.split_whitespace().any(|flag| flag == "hypervisor")) {
        Some(true) => Finding::new(
            TOPIC,
            "this is a virtual machine: the hypervisor can stop a core for milliseconds, and no program can prevent it",
            Verdict::Poor,
            "run tests with a real specimen on a physical machine, or have the host pin and isolate this machine's cores",
        ),
        Some(false) => Finding::new(TOPIC, "none: a physical machine", Verdict::Good, ""),
        None => Finding::unknown(TOPIC),
    }
}

fn steal(tree: &Tree) -> Finding {
    const TOPIC: &str = "steal";
    let share = tree
        .text("proc/stat")
        .and_then(|stat| proc::steal_share(stat.as_bytes()));
    match share {
        None => Finding::unknown(TOPIC),
        Some(share) => {
            let found = format!(
                "the hypervisor took {:.3} % of all time since boot",
                share * 100.0
            );
            if share == 0.0 {
                Finding::new(TOPIC, "none since boot", Verdict::Good, "")
            } else if share < 1e-3 {
                Finding::new(
                    TOPIC,
                    found,
                    Verdict::Fair,
                    "misses of that origin are counted under \"hypervisor or interrupt\"",
                )
            } else {
                Finding::new(
                    TOPIC,
                    found,
                    Verdict::Poor,
                    "use a machine, or a host, with less competition",
                )
            }
        }
    }
}

fn swap(tree: &Tree) -> Finding {
    const TOPIC: &str = "swap";
    let Some(swaps) = tree.text("proc/swaps") else {
        return Finding::unknown(TOPIC);
    };
    // The first line is a heading.
    match swaps.lines().skip(1).count() {
        0 => Finding::new(TOPIC, "none", Verdict::Good, ""),
        areas => Finding::new(
            TOPIC,
            format!("{areas} in use: memory that is not locked can be a disk access away"),
            Verdict::Fair,
            "see that memory can be locked (below), or swapoff -a during tests",
        ),
    }
}

fn huge_pages(tree: &Tree) -> Finding {
    const TOPIC: &str = "transparent huge pages";
    let modes = tree.text("sys/kernel/mm/transparent_hugepage/enabled");
    match modes
        .as_deref()
        .and_then(|modes| Some(modes.split_once('[')?.1.split_once(']')?.0))
    {
        None => Finding::unknown(TOPIC),
        Some("always") => Finding::new(
            TOPIC,
            "always: the kernel may stop the process to merge pages",
            Verdict::Fair,
            "echo madvise > /sys/kernel/mm/transparent_hugepage/enabled",
        ),
        Some(mode) => Finding::new(TOPIC, mode, Verdict::Good, ""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A machine made of these files and no others.
    fn machine(files: &[(&str, &str)]) -> (tempfile::TempDir, Tree) {
        let dir = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = dir.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let tree = Tree::at(dir.path());
        (dir, tree)
    }

    fn verdicts(tree: &Tree) -> Vec<(&'static str, Verdict)> {
        findings(tree, None)
            .iter()
            .map(|f| (f.topic, f.verdict))
            .collect()
    }

    #[test]
    fn tuned_machine_is_good_throughout() {
        let (_dir, tree) = machine(&[
            (
                "proc/version",
                "Linux version 6.1.0-18-rt-amd64 (a@b) #1 SMP PREEMPT_RT Debian",
            ),
            ("proc/sys/kernel/sched_rt_runtime_us", "950000\n"),
            ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
            ("sys/devices/system/cpu/online", "0-3\n"),
            ("sys/devices/system/cpu/isolated", "2-3\n"),
            ("sys/devices/system/cpu/nohz_full", "2-3\n"),
            ("sys/devices/system/cpu/smt/active", "0\n"),
            (
                "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor",
                "performance\n",
            ),
            (
                "sys/devices/system/cpu/cpu3/cpufreq/scaling_governor",
                "performance\n",
            ),
            (
                "sys/devices/system/cpu/cpuidle/current_driver",
                "intel_idle\n",
            ),
            ("sys/devices/system/cpu/cpu0/cpuidle/state0/name", "POLL\n"),
            ("sys/devices/system/cpu/cpu0/cpuidle/state0/latency", "0\n"),
            ("sys/devices/system/cpu/cpu0/cpuidle/state1/name", "C6\n"),
            (
                "sys/devices/system/cpu/cpu0/cpuidle/state1/latency",
                "133\n",
            ),
            ("sys/devices/system/cpu/cpu0/cpuidle/state1/disable", "1\n"),
            (
                "sys/devices/system/clocksource/clocksource0/current_clocksource",
                "tsc\n",
            ),
            ("proc/cpuinfo", "processor\t: 0\nflags\t\t: fpu vme tsc\n"),
            ("proc/stat", "cpu  10 0 10 1000 0 0 0 0 0 0\n"),
            ("proc/swaps", "Filename Type Size Used Priority\n"),
            (
                "sys/kernel/mm/transparent_hugepage/enabled",
                "always [madvise] never\n",
            ),
        ]);
        for (topic, verdict) in verdicts(&tree) {
            assert_eq!(verdict, Verdict::Good, "{topic}");
        }
    }

    #[test]
    fn forbidden_processor_does_not_count() {
        let (_dir, tree) = machine(&[("sys/devices/system/cpu/online", "0-3\n")]);
        let told = |allowed: &[usize]| {
            let finding = processors(&tree, Some(allowed));
            (finding.found, finding.verdict)
        };
        let (found, verdict) = told(&[0]);
        assert_eq!(verdict, Verdict::Poor);
        assert!(found.starts_with("4 online, 1 "), "{found}");
        let (found, verdict) = told(&[0, 1]);
        assert_eq!(verdict, Verdict::Good);
        assert!(found.starts_with("4 online, 2 "), "{found}");
        let (found, _) = told(&[0, 1, 2, 3]);
        assert!(found.contains(" 3 "), "{found}");
    }

    #[test]
    fn virtual_desktop_gets_poor_findings() {
        let (_dir, tree) = machine(&[
            (
                "proc/version",
                "Linux version 6.8.0 (a@b) #1 SMP PREEMPT_DYNAMIC Tue",
            ),
            ("sys/kernel/debug/sched/preempt", "none (voluntary) full\n"),
            ("proc/sys/kernel/sched_rt_runtime_us", "100000\n"),
            ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
            ("sys/devices/system/cpu/online", "0\n"),
            ("sys/devices/system/cpu/isolated", "\n"),
            ("sys/devices/system/cpu/nohz_full", "(null)\n"),
            ("sys/devices/system/cpu/smt/active", "1\n"),
            (
                "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor",
                "powersave\n",
            ),
            (
                "sys/devices/system/cpu/cpuidle/current_driver",
                "acpi_idle\n",
            ),
            ("sys/devices/system/cpu/cpu0/cpuidle/state3/name", "C3\n"),
            (
                "sys/devices/system/cpu/cpu0/cpuidle/state3/latency",
                "350\n",
            ),
            (
                "sys/devices/system/clocksource/clocksource0/current_clocksource",
                "acpi_pm\n",
            ),
            (
                "proc/cpuinfo",
                "processor\t: 0\nflags\t\t: fpu hypervisor tsc\n",
            ),
            ("proc/stat", "cpu  10 0 10 1000 0 0 0 50 0 0\n"),
            (
                "proc/swaps",
                "Filename Type Size Used Priority\n/dev/sda2 partition 100 0 -2\n",
            ),
            (
                "sys/kernel/mm/transparent_hugepage/enabled",
                "[always] madvise never\n",
            ),
        ]);
        for finding in findings(&tree, None) {
            assert!(
                matches!(finding.verdict, Verdict::Fair | Verdict::Poor),
                "{finding:?}"
            );
            assert!(finding.advice.is_some(), "{finding:?}");
        }
        assert!(kernel(&tree).found.contains("mode voluntary"));
        assert!(idle(&tree).found.contains("C3, 350 µs"));
    }

    #[test]
    fn silent_machine_is_unknown_not_an_error() {
        let (_dir, tree) = machine(&[]);
        for (topic, verdict) in verdicts(&tree) {
            // Without a list no processor is tickless.
            let expected = if topic == "tickless processors" {
                Verdict::Fair
            } else {
                Verdict::Unknown
            };
            assert_eq!(verdict, expected, "{topic}");
        }
    }
}
