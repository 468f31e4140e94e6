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
    pub(super) fn text(&self, path: &str) -> Option<String> {
        let bytes = std::fs::read(self.root.join(path)).ok()?;
        Some(String::from_utf8_lossy(&bytes).trim().to_owned())
    }

    /// Sorted names in a directory; empty without one.
    pub(super) fn names(&self, path: &str) -> Vec<String> {
        let Ok(entries) = std::fs::read_dir(self.root.join(path)) else {
            return Vec::new();
        };
        let mut names: Vec<String> = entries
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .collect();
        names.sort();
        names
    }

    pub(super) fn cpus(&self, path: &str) -> Option<Vec<usize>> {
        proc::cpu_list(&self.text(path)?)
    }
}

const CPU: &str = "sys/devices/system/cpu";

/// The finding about a topic, and the advice; `None` if the machine does not say.
type Found = Option<(String, Verdict, &'static str)>;

fn good(found: impl Into<String>) -> Found {
    Some((found.into(), Verdict::Good, ""))
}

fn fair(found: impl Into<String>, advice: &'static str) -> Found {
    Some((found.into(), Verdict::Fair, advice))
}

fn poor(found: impl Into<String>, advice: &'static str) -> Found {
    Some((found.into(), Verdict::Poor, advice))
}

/// All findings of this file, in the order of a report; `allowed`: the processors that the process may run on, if they are to
/// be assessed.
#[must_use]
pub(crate) fn findings(tree: &Tree, allowed: Option<&[usize]>) -> Vec<Finding> {
    let each = [
        ("kernel", kernel(tree)),
        ("real-time throttling", throttling(tree)),
        ("processors", processors(tree, allowed)),
        ("isolated processors", isolation(tree)),
        ("tickless processors", tickless(tree)),
        ("simultaneous multithreading", threads_per_core(tree)),
        ("frequency governor", governor(tree)),
        ("idle states", idle(tree)),
        ("clock source", clock_source(tree)),
        ("hypervisor", hypervisor(tree)),
        ("steal", steal(tree)),
        ("swap", swap(tree)),
        ("transparent huge pages", huge_pages(tree)),
    ];
    let unknown = || ("the machine does not say".to_owned(), Verdict::Unknown, "");
    let findings = each.into_iter().map(|(topic, found)| {
        let (found, verdict, advice) = found.unwrap_or_else(unknown);
        Finding::new(topic, found, verdict, advice)
    });
    findings.collect()
}

fn kernel(tree: &Tree) -> Found {
    const ADVICE: &str =
        "for bounded latency install a PREEMPT_RT kernel (Debian: linux-image-rt-amd64)";
    let version = tree.text("proc/version")?;
    let release = version
        .split_whitespace()
        .nth(2)
        .unwrap_or("of unknown release");
    if version.contains("PREEMPT_RT") || tree.text("sys/kernel/realtime").as_deref() == Some("1") {
        return good(format!("{release}, PREEMPT_RT"));
    }
    if version.contains("PREEMPT_DYNAMIC") {
        let mode = tree
            .text("sys/kernel/debug/sched/preempt")
            .and_then(|modes| Some(modes.split_once('(')?.1.split_once(')')?.0.to_owned()));
        let mode = mode.map_or_else(
            || "mode not readable".to_owned(),
            |mode| format!("mode {mode}"),
        );
        let found = format!("{release}, PREEMPT_DYNAMIC ({mode}), no PREEMPT_RT");
        return fair(found, ADVICE);
    }
    if version.contains("PREEMPT") {
        return fair(format!("{release}, PREEMPT, no PREEMPT_RT"), ADVICE);
    }
    poor(format!("{release}, kernel code is not preempted"), ADVICE)
}

fn throttling(tree: &Tree) -> Found {
    let file = |name| tree.text(&format!("proc/sys/kernel/{name}"));
    let (runtime, period) = file("sched_rt_runtime_us").zip(file("sched_rt_period_us"))?;
    let throttle = Throttle::parse(&runtime, &period)?;
    let period = throttle.period_us;
    match throttle.runtime_us {
        None => good("off: real-time threads may run without end"),
        Some(runtime) if throttle.permille() >= 500 => good(format!(
            "real-time threads may run {runtime} of {period} µs ({:.1} %); the loop sleeps in every tick and stays below",
            throttle.permille() as f64 / 10.0
        )),
        Some(runtime) => poor(
            format!("real-time threads may run only {runtime} of {period} µs"),
            "sysctl kernel.sched_rt_runtime_us=950000",
        ),
    }
}

fn processors(tree: &Tree, allowed: Option<&[usize]>) -> Found {
    let mut cpus = tree.cpus(&format!("{CPU}/online"))?;
    let online = cpus.len();
    cpus.retain(|cpu| allowed.is_none_or(|allowed| allowed.contains(cpu)));
    let mut found = format!("{online} online");
    if cpus.len() < online {
        found += &format!(", {} may be used", cpus.len());
    }
    match cpus.as_slice() {
        [] => None,
        [_] => {
            let advice = if online > 1 {
                "let this program have two processors or more (taskset, cpuset, container)"
            } else {
                "use a machine with two processors or more"
            };
            found += ": the loop shares it with everything else";
            poor(found, advice)
        }
        [.., last] => {
            found += &format!("; the loop takes {last} unless told otherwise");
            good(found)
        }
    }
}

fn isolation(tree: &Tree) -> Found {
    match tree.cpus(&format!("{CPU}/isolated"))?.as_slice() {
        [] => fair(
            "none: ordinary threads and interrupts may run on the loop's processor",
            "boot with isolcpus=managed_irq,domain,N and irqaffinity=0, and set [timing] cpu = N",
        ),
        cpus => Some((
            format!("{cpus:?}"),
            Verdict::Good,
            "set [timing] cpu to one of them",
        )),
    }
}

fn tickless(tree: &Tree) -> Found {
    match tree.cpus(&format!("{CPU}/nohz_full")).as_deref() {
        None | Some([]) => fair(
            "none: the kernel's tick interrupts the loop",
            "for rates above 10 kHz boot a kernel with NO_HZ_FULL and nohz_full=N rcu_nocbs=N",
        ),
        Some(cpus) => good(format!("{cpus:?}")),
    }
}

fn threads_per_core(tree: &Tree) -> Found {
    match tree.text(&format!("{CPU}/smt/active"))?.as_str() {
        "0" => good("off"),
        "1" => fair(
            "on: the loop may share its core with another thread",
            "keep the sibling of the loop's processor idle, or echo off > /sys/devices/system/cpu/smt/control",
        ),
        _ => None,
    }
}

fn governor(tree: &Tree) -> Found {
    let mut governors: Vec<String> = tree
        .cpus(&format!("{CPU}/online"))
        .unwrap_or_default()
        .iter()
        .filter_map(|cpu| tree.text(&format!("{CPU}/cpu{cpu}/cpufreq/scaling_governor")))
        .collect();
    governors.sort();
    governors.dedup();
    match governors.as_slice() {
        [] => Some((
            "none visible: this machine does not let programs choose the frequency".to_owned(),
            Verdict::Unknown,
            "",
        )),
        [one] if one == "performance" => good(one),
        some => fair(some.join(", "), "cpupower frequency-set -g performance"),
    }
}

fn idle(tree: &Tree) -> Found {
    let driver = tree.text(&format!("{CPU}/cpuidle/current_driver"));
    let deepest = tree
        .names(&format!("{CPU}/cpu0/cpuidle"))
        .iter()
        .map(|state| format!("{CPU}/cpu0/cpuidle/{state}"))
        .filter(|state| tree.text(&format!("{state}/disable")).as_deref() != Some("1"))
        .filter_map(|state| {
            let latency: u64 = tree.text(&format!("{state}/latency"))?.parse().ok()?;
            Some((latency, tree.text(&format!("{state}/name"))?))
        })
        .max();
    let Some((driver, (latency, name))) = driver.zip(deepest) else {
        return Some(("none visible".to_owned(), Verdict::Unknown, ""));
    };
    let found = format!("{driver}; the deepest state in use is {name}, {latency} µs to leave");
    if latency <= 10 {
        return good(found);
    }
    let advice = "let the run write /dev/cpu_dma_latency ([timing] hold_cpu_awake), or boot with \
                  processor.max_cstate=1 intel_idle.max_cstate=0";
    fair(found, advice)
}

fn clock_source(tree: &Tree) -> Found {
    let name = tree.text("sys/devices/system/clocksource/clocksource0/current_clocksource")?;
    match name.as_str() {
        "tsc" | "arch_sys_counter" => good(format!("{name}: read without a system call")),
        "kvm-clock" | "hyperv_clocksource_tsc_page" => good(format!(
            "{name}: the hypervisor's, read without a system call"
        )),
        _ => poor(
            format!("{name}: slow, every reading is a system call"),
            "boot with clocksource=tsc tsc=reliable if the processor's counter is constant and synchronised",
        ),
    }
}

fn hypervisor(tree: &Tree) -> Found {
    let info = tree.text("proc/cpuinfo")?;
    let flags = info.lines().find(|line| line.starts_with("flags"))?;
    if flags.split_whitespace().any(|flag| flag == "hypervisor") {
        return poor(
            "this is a virtual machine: the hypervisor can stop a core for milliseconds, and no program can prevent it",
            "run tests with a real specimen on a physical machine, or have the host pin and isolate this machine's cores",
        );
    }
    good("none: a physical machine")
}

fn steal(tree: &Tree) -> Found {
    let share = proc::steal_share(tree.text("proc/stat")?.as_bytes())?;
    if share == 0.0 {
        return good("none since boot");
    }
    let found = format!(
        "the hypervisor took {:.3} % of all time since boot",
        share * 100.0
    );
    if share < 1e-3 {
        let advice = "misses of that origin are counted under \"hypervisor or interrupt\"";
        return fair(found, advice);
    }
    poor(found, "use a machine, or a host, with less competition")
}

fn swap(tree: &Tree) -> Found {
    match tree.text("proc/swaps")?.lines().skip(1).count() {
        0 => good("none"),
        areas => fair(
            format!("{areas} in use: memory that is not locked can be a disk access away"),
            "see that memory can be locked (below), or swapoff -a during tests",
        ),
    }
}

fn huge_pages(tree: &Tree) -> Found {
    let modes = tree.text("sys/kernel/mm/transparent_hugepage/enabled")?;
    match modes.split_once('[')?.1.split_once(']')?.0 {
        "always" => fair(
            "always: the kernel may stop the process to merge pages",
            "echo madvise > /sys/kernel/mm/transparent_hugepage/enabled",
        ),
        mode => good(mode),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A machine made of these files and no others.
    pub(in crate::rt::doctor) fn machine(files: &[(&str, &str)]) -> (tempfile::TempDir, Tree) {
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
            let (found, verdict, _) = processors(&tree, Some(allowed)).unwrap();
            (found, verdict)
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
        assert!(kernel(&tree).unwrap().0.contains("mode voluntary"));
        assert!(idle(&tree).unwrap().0.contains("C3, 350 µs"));
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
