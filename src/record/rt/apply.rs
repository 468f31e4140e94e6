//! Asks the operating system for real-time conditions, one by one, and reports the outcome of each.
//!
//! Order: affinity → signals → policy → timers → processors awake → memory → stack. Memory is locked after the thread
//! sits on its processor, and the stack is touched last, so that its pages are locked where they are used. Every
//! request to the kernel goes through [`System`], so that tests can simulate refusals.

use std::fs::File;
use std::num::NonZeroU64;
use std::sync::Arc;

use super::os::{self, Errno, Privileges};
use super::throttle::{Spin, Throttle};
use super::{Feature, Granted, RtPlan, Want};

/// Stack that is touched before the first tick, in kB.
const PREFAULT_STACK_KB: u32 = 256;

/// The kernel as the calling thread meets it.
pub trait System {
    /// Processors the process may use, in rising order.
    fn cpus(&self) -> Vec<usize>;
    /// Privileges that the process has without further requests.
    fn privileges(&self) -> Privileges;
    /// The budget of real-time threads; none if unknown.
    fn throttle(&self) -> Option<Throttle>;
    /// Binds the thread to one processor.
    ///
    /// # Errors
    /// The kernel's refusal, as for all below.
    fn pin(&mut self, cpu: usize) -> Result<(), Errno>;
    /// Sends signals to other threads.
    ///
    /// # Errors
    /// The kernel's refusal.
    fn block_signals(&mut self) -> Result<(), Errno>;
    /// SCHED_FIFO.
    ///
    /// # Errors
    /// The kernel's refusal.
    fn set_fifo(&mut self, priority: u8) -> Result<(), Errno>;
    /// Timers that are not bundled.
    ///
    /// # Errors
    /// The kernel's refusal.
    fn tighten_timers(&mut self) -> Result<(), Errno>;
    /// Processors out of deep sleep while the file is open.
    ///
    /// # Errors
    /// The kernel's refusal.
    fn hold_awake(&mut self) -> Result<File, Errno>;
    /// All memory in RAM.
    ///
    /// # Errors
    /// The kernel's refusal.
    fn lock_memory(&mut self) -> Result<(), Errno>;
    /// Touches the stack.
    fn touch_stack(&mut self, kb: u32);
}

/// The running kernel.
#[derive(Debug, Clone, Copy, Default)]
pub struct Kernel;

impl System for Kernel {
    fn cpus(&self) -> Vec<usize> {
        os::process_cpus()
    }
    fn privileges(&self) -> Privileges {
        os::privileges()
    }
    fn throttle(&self) -> Option<Throttle> {
        Throttle::read()
    }
    fn pin(&mut self, cpu: usize) -> Result<(), Errno> {
        os::pin_to(&[cpu])
    }
    fn block_signals(&mut self) -> Result<(), Errno> {
        os::block_signals()
    }
    fn set_fifo(&mut self, priority: u8) -> Result<(), Errno> {
        os::set_fifo(priority)
    }
    fn tighten_timers(&mut self) -> Result<(), Errno> {
        os::set_timer_slack(NonZeroU64::MIN)
    }
    fn hold_awake(&mut self) -> Result<File, Errno> {
        os::hold_awake()
    }
    fn lock_memory(&mut self) -> Result<(), Errno> {
        os::lock_memory()
    }
    fn touch_stack(&mut self, kb: u32) {
        os::touch_stack(kb);
    }
}

/// Asks the running kernel, for the calling thread, for all that the plan wants.
#[must_use]
pub fn apply(plan: &RtPlan) -> Granted {
    apply_to(plan, &mut Kernel)
}

/// Asks `system` for all that the plan wants.
pub(crate) fn apply_to(plan: &RtPlan, system: &mut dyn System) -> Granted {
    let mut features = Vec::new();
    let privileges = system.privileges();
    let cpus = system.cpus();

    let chosen = plan.cpu.or_else(|| cpus.last().copied()).unwrap_or(0);
    let pinned = system.pin(chosen);
    features.push(feature(
        Want::Affinity,
        format!("processor {chosen}"),
        pinned,
        || format!("choose one of the processors that this process may use: {cpus:?}"),
    ));

    let blocked = system.block_signals();
    features.push(feature(
        Want::Signals,
        "signals go to other threads".into(),
        blocked,
        String::new,
    ));

    if let Some(priority) = plan.fifo_priority {
        let asked = format!("SCHED_FIFO, priority {priority}");
        let outcome = system.set_fifo(priority);
        features.push(feature(Want::Policy, asked, outcome, || {
            policy_advice(priority, &privileges)
        }));
    }

    let tightened = system.tighten_timers();
    features.push(feature(
        Want::TimerSlack,
        "timers not bundled".into(),
        tightened,
        String::new,
    ));

    let mut awake = None;
    if plan.hold_cpu_awake {
        let outcome = system.hold_awake().map(|file| awake = Some(Arc::new(file)));
        let asked = "processors kept out of deep sleep".into();
        features.push(feature(Want::CpuAwake, asked, outcome, awake_advice));
    }

    if plan.lock_memory {
        let asked = "all memory locked".into();
        features.push(lock(asked, system, &privileges));
    }
    system.touch_stack(PREFAULT_STACK_KB);
    let asked = format!("{PREFAULT_STACK_KB} kB of stack touched");
    features.push(feature(Want::Prefault, asked, Ok(()), String::new));

    Granted {
        complete: features.iter().all(|feature| feature.granted),
        required: plan.require,
        cpu: pinned.is_ok().then_some(chosen),
        features,
        spin: Spin::plan(plan.spin_ns, plan.period_ns, system.throttle()),
        _awake: awake,
    }
}

/// Keeps the calling thread off `cpu`, the loop's processor. Returns the processors it may use now.
///
/// # Errors
/// EINVAL if there is no other processor.
pub fn pin_away(cpu: usize) -> Result<Vec<usize>, Errno> {
    let mut others = others(os::process_cpus(), cpu);
    if others.is_empty() {
        // The main thread itself is bound to the loop's processor: fall back on all that are online.
        let online = std::fs::read_to_string("/sys/devices/system/cpu/online").unwrap_or_default();
        others = self::others(super::proc::cpu_list(&online).unwrap_or_default(), cpu);
    }
    os::pin_to(&others)?;
    Ok(others)
}

fn others(mut cpus: Vec<usize>, cpu: usize) -> Vec<usize> {
    cpus.retain(|other| *other != cpu);
    cpus
}

/// Memory is locked only where it can stay locked. Under a limit, a lock that succeeds now makes a later
/// allocation, or the growth of a stack, fail, which ends the process.
fn lock(asked: String, system: &mut dyn System, privileges: &Privileges) -> Feature {
    if let (false, Some(limit)) = (privileges.ipc_lock, privileges.memlock) {
        return Feature {
            want: Want::LockMemory,
            asked,
            granted: false,
            errno: None,
            reason: Some(format!(
                "not attempted: at most {} kB may be locked, and allocations beyond it would fail",
                limit / 1024
            )),
            advice: Some(memory_advice()),
        };
    }
    let outcome = system.lock_memory();
    feature(Want::LockMemory, asked, outcome, memory_advice)
}

fn feature(
    want: Want,
    asked: String,
    outcome: Result<(), Errno>,
    advice: impl FnOnce() -> String,
) -> Feature {
    let errno = outcome.err();
    Feature {
        want,
        asked,
        granted: errno.is_none(),
        errno: errno.map(Errno::raw_os_error),
        reason: errno.map(reason),
        advice: errno.map(|_| advice()).filter(|text| !text.is_empty()),
    }
}

fn reason(errno: Errno) -> String {
    let name = match errno {
        Errno::PERM => "EPERM",
        Errno::ACCESS => "EACCES",
        Errno::INVAL => "EINVAL",
        Errno::NOMEM => "ENOMEM",
        Errno::NOENT => "ENOENT",
        Errno::AGAIN => "EAGAIN",
        Errno::NODEV => "ENODEV",
        Errno::NOSYS => "ENOSYS",
        _ => "refused",
    };
    format!("{name}: {}", std::io::Error::from(errno))
}

fn policy_advice(priority: u8, privileges: &Privileges) -> String {
    match privileges.rtprio {
        _ if privileges.nice => "the process has CAP_SYS_NICE, so its control group or container forbids real-time \
            threads: give the group a real-time budget (cpu.rt_runtime_us) or start it with that right"
            .into(),
        Some(limit) if limit > 0 && limit < u64::from(priority) => format!(
            "the limit is priority {limit}: set [timing] priority = {limit}, or raise rtprio in \
             /etc/security/limits.conf"
        ),
        _ => format!(
            "add the line '@realtime - rtprio {priority}' to /etc/security/limits.conf, join the group realtime \
             and log in again; or: sudo setcap cap_sys_nice,cap_ipc_lock+ep $(command -v gusset); or run as root"
        ),
    }
}

fn memory_advice() -> String {
    "add the line '@realtime - memlock unlimited' to /etc/security/limits.conf, join the group realtime and log in \
     again; or: sudo setcap cap_sys_nice,cap_ipc_lock+ep $(command -v gusset); or run as root"
        .into()
}

fn awake_advice() -> String {
    format!(
        "give the group realtime write access to {}: a file /etc/udev/rules.d/99-realtime.rules with the line \
         'KERNEL==\"cpu_dma_latency\", GROUP=\"realtime\", MODE=\"0660\"'; or run as root; or set [timing] \
         hold_cpu_awake = false",
        os::DMA_LATENCY
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A simulated kernel: it grants or refuses as configured and records the requests.
    struct Told {
        privileges: Privileges,
        refusal: Option<Errno>,
        asked: Vec<&'static str>,
    }

    impl Told {
        fn new(
            refusal: Option<Errno>,
            nice: bool,
            rtprio: Option<u64>,
            memlock: Option<u64>,
        ) -> Self {
            let privileges = Privileges {
                nice,
                ipc_lock: nice,
                net_raw: false,
                rtprio,
                memlock,
            };
            Self {
                privileges,
                refusal,
                asked: Vec::new(),
            }
        }

        fn answer(&mut self, what: &'static str) -> Result<(), Errno> {
            self.asked.push(what);
            self.refusal.map_or(Ok(()), Err)
        }
    }

    impl System for Told {
        fn cpus(&self) -> Vec<usize> {
            vec![0, 1, 5]
        }
        fn privileges(&self) -> Privileges {
            self.privileges
        }
        fn throttle(&self) -> Option<Throttle> {
            Some(Throttle::USUAL)
        }
        fn pin(&mut self, _: usize) -> Result<(), Errno> {
            self.asked.push("pin");
            Ok(())
        }
        fn block_signals(&mut self) -> Result<(), Errno> {
            self.asked.push("signals");
            Ok(())
        }
        fn set_fifo(&mut self, _: u8) -> Result<(), Errno> {
            self.answer("policy")
        }
        fn tighten_timers(&mut self) -> Result<(), Errno> {
            self.asked.push("timers");
            Ok(())
        }
        fn hold_awake(&mut self) -> Result<File, Errno> {
            self.answer("awake")?;
            Ok(File::open("/dev/null").unwrap())
        }
        fn lock_memory(&mut self) -> Result<(), Errno> {
            self.answer("memory")
        }
        fn touch_stack(&mut self, _: u32) {
            self.asked.push("stack");
        }
    }

    fn plan() -> RtPlan {
        RtPlan {
            fifo_priority: Some(90),
            cpu: None,
            lock_memory: true,
            hold_cpu_awake: true,
            spin_ns: 60_000,
            period_ns: 1_000_000,
            require: false,
        }
    }

    fn of(granted: &Granted, want: Want) -> &Feature {
        granted.features.iter().find(|f| f.want == want).unwrap()
    }

    #[test]
    fn grants_are_complete_and_in_order() {
        let mut system = Told::new(None, true, None, None);
        let granted = apply_to(&plan(), &mut system);
        assert_eq!(
            system.asked,
            [
                "pin", "signals", "policy", "timers", "awake", "memory", "stack"
            ]
        );
        assert!(granted.complete && !granted.must_refuse() && granted.holds_cpu_awake());
        assert_eq!(granted.missing().count(), 0);
        // The last processor, so that 0 is left to the system.
        assert_eq!(granted.cpu, Some(5));
        assert_eq!(granted.clock().spin_ns, 60_000);
    }

    #[test]
    fn unprivileged_user_gets_advice() {
        let mut system = Told::new(Some(Errno::PERM), false, Some(0), Some(8 << 20));
        let granted = apply_to(&plan(), &mut system);
        assert!(!granted.complete && !granted.must_refuse());
        let policy = of(&granted, Want::Policy);
        assert_eq!(policy.asked, "SCHED_FIFO, priority 90");
        assert_eq!(policy.errno, Some(1));
        assert_eq!(
            policy.reason.as_deref(),
            Some("EPERM: Operation not permitted (os error 1)")
        );
        let advice = policy.advice.as_deref().unwrap();
        assert!(
            advice.contains("@realtime - rtprio 90") && advice.contains("cap_sys_nice"),
            "{advice}"
        );
        let memory = of(&granted, Want::LockMemory);
        assert!(
            memory.reason.as_deref().unwrap().contains("8192 kB"),
            "{memory:?}"
        );
        assert!(
            memory
                .advice
                .as_deref()
                .unwrap()
                .contains("memlock unlimited")
        );
        // Locking under a limit would end the process later: no request may be made.
        assert!(!system.asked.contains(&"memory"));
        let awake = of(&granted, Want::CpuAwake);
        assert!(awake.advice.as_deref().unwrap().contains("udev"));
        assert!(!granted.holds_cpu_awake());
        assert!(!granted.has(Want::Policy) && granted.has(Want::Affinity));
    }

    #[test]
    fn required_and_refused_means_no_start() {
        let required = RtPlan {
            require: true,
            ..plan()
        };
        assert!(
            apply_to(
                &required,
                &mut Told::new(Some(Errno::PERM), false, Some(0), None)
            )
            .must_refuse()
        );
        assert!(!apply_to(&required, &mut Told::new(None, true, None, None)).must_refuse());
    }

    #[test]
    fn limit_below_the_priority_is_named() {
        let mut system = Told::new(Some(Errno::PERM), false, Some(40), None);
        let granted = apply_to(&plan(), &mut system);
        assert!(
            of(&granted, Want::Policy)
                .advice
                .as_deref()
                .unwrap()
                .contains("priority = 40")
        );
    }

    #[test]
    fn privileged_refusal_blames_control_group() {
        let mut system = Told::new(Some(Errno::PERM), true, None, None);
        let granted = apply_to(&plan(), &mut system);
        assert!(
            of(&granted, Want::Policy)
                .advice
                .as_deref()
                .unwrap()
                .contains("control group")
        );
    }

    #[test]
    fn unwanted_features_are_not_requested() {
        let modest = RtPlan {
            fifo_priority: None,
            lock_memory: false,
            hold_cpu_awake: false,
            ..plan()
        };
        let mut system = Told::new(Some(Errno::PERM), false, Some(0), Some(0));
        let granted = apply_to(&modest, &mut system);
        assert_eq!(system.asked, ["pin", "signals", "timers", "stack"]);
        assert!(granted.complete);
    }

    #[test]
    fn report_serialises_with_its_reasons() {
        let mut system = Told::new(Some(Errno::PERM), false, Some(0), Some(0));
        let json = serde_json::to_value(apply_to(&plan(), &mut system)).unwrap();
        assert_eq!(json["complete"], false);
        assert_eq!(json["features"][2]["want"], "policy");
        assert_eq!(json["features"][2]["errno"], 1);
        assert_eq!(json["spin"]["throttle"]["runtime_us"], 950_000);
        assert!(json.get("awake").is_none());
    }

    #[test]
    fn running_kernel_answers_every_question() {
        // Without the memory lock: it would hold for the whole test process.
        let modest = RtPlan {
            lock_memory: false,
            ..plan()
        };
        let granted = std::thread::spawn(move || apply(&modest)).join().unwrap();
        assert!(
            granted.has(Want::Affinity)
                && granted.has(Want::Signals)
                && granted.has(Want::Prefault)
        );
        for feature in granted.missing() {
            assert!(
                feature.errno.is_some() && feature.reason.is_some(),
                "{feature:?}"
            );
        }
    }

    #[test]
    fn helper_keeps_off_the_loop_processor() {
        let cpus = os::process_cpus();
        let own = *cpus.last().unwrap();
        let outcome = std::thread::spawn(move || pin_away(own).map(|_| os::allowed_cpus()))
            .join()
            .unwrap();
        match outcome {
            Ok(left) => assert!(!left.is_empty() && !left.contains(&own)),
            // One processor only: there is nowhere else to go.
            Err(errno) => assert_eq!(errno, Errno::INVAL),
        }
    }
}
