//! Thin, safe functions over the system calls that real-time work needs.
//!
//! Invariant: the only file of the crate with `unsafe`; every function here is safe to call with any argument and
//! reports a refusal as the error number that the kernel gave. Nothing here decides anything: [`mod@super::apply`]
//! chooses the requests and their order, and interprets a refusal.
#![expect(
    unsafe_code,
    reason = "scheduling policy and signal masks have no safe wrapper in our dependencies"
)]

use std::fs::File;
use std::io::Write;
use std::num::NonZeroU64;
use std::os::fd::{AsRawFd, OwnedFd};

use rustix::mm::MlockAllFlags;
use rustix::process::{Resource, Rlimit, getpid, getrlimit, setrlimit};
use rustix::thread::{CapabilitySet, ClockId, CpuSet, Timespec};

pub use rustix::io::Errno;

/// File that, held open with a zero inside, keeps processors out of deep sleep.
pub(crate) const DMA_LATENCY: &str = "/dev/cpu_dma_latency";

/// CLOCK_MONOTONIC in nanoseconds. Real-time: yes.
#[must_use]
#[inline]
pub fn monotonic_ns() -> u64 {
    let now = rustix::time::clock_gettime(ClockId::Monotonic);
    // Both are non-negative: the clock starts at zero at boot.
    (now.tv_sec as u64) * 1_000_000_000 + now.tv_nsec as u64
}

/// Sleeps until CLOCK_MONOTONIC reads `at_ns` or later; signals do not shorten it. Real-time: yes.
pub fn sleep_until_ns(at_ns: u64) {
    let at = Timespec {
        tv_sec: i64::try_from(at_ns / 1_000_000_000).unwrap_or(i64::MAX),
        tv_nsec: (at_ns % 1_000_000_000) as _,
    };
    // An absolute sleep that a signal cuts short is simply begun again; it cannot drift. Any other error would
    // mean a malformed request, which the two lines above exclude; then the caller's own check of the clock holds.
    while rustix::thread::clock_nanosleep_absolute(ClockId::Monotonic, &at) == Err(Errno::INTR) {}
}

/// Length of the kernel's scheduler tick in nanoseconds: the resolution of the coarse clock is 1/HZ.
#[must_use]
pub(crate) fn kernel_tick_ns() -> u64 {
    let tick = rustix::time::clock_getres(ClockId::MonotonicCoarse);
    (tick.tv_sec as u64) * 1_000_000_000 + tick.tv_nsec as u64
}

/// Resolution of the timers behind [`sleep_until_ns`]: 1 ns with high-resolution timers, else a tick.
#[must_use]
pub(crate) fn timer_resolution_ns() -> u64 {
    let tick = rustix::time::clock_getres(ClockId::Monotonic);
    (tick.tv_sec as u64) * 1_000_000_000 + tick.tv_nsec as u64
}

/// Kernel's number of the calling thread, as in /proc/self/task.
#[must_use]
pub fn thread_id() -> i32 {
    rustix::thread::gettid().as_raw_nonzero().get()
}

/// Lets another runnable thread have the processor.
#[cfg(test)]
pub(crate) fn yield_now() {
    rustix::thread::sched_yield();
}

/// Processors that the calling thread may run on, in rising order; empty if the kernel does not say.
#[must_use]
#[cfg(test)]
pub(crate) fn allowed_cpus() -> Vec<usize> {
    rustix::thread::sched_getaffinity(None).map_or_else(|_| Vec::new(), |set| listed(&set))
}

/// Processors that the process was started with: those of its main thread.
#[must_use]
pub fn process_cpus() -> Vec<usize> {
    rustix::thread::sched_getaffinity(Some(getpid()))
        .map_or_else(|_| Vec::new(), |set| listed(&set))
}

fn listed(set: &CpuSet) -> Vec<usize> {
    (0..CpuSet::MAX_CPU)
        .filter(|cpu| set.is_set(*cpu))
        .collect()
}

/// Binds the calling thread to `cpus`.
///
/// # Errors
/// EINVAL if none of them exists or is allowed.
pub(crate) fn pin_to(cpus: &[usize]) -> Result<(), Errno> {
    let mut set = CpuSet::new();
    for &cpu in cpus.iter().filter(|cpu| **cpu < CpuSet::MAX_CPU) {
        set.set(cpu);
    }
    rustix::thread::sched_setaffinity(None, &set)
}

/// Gives the calling thread SCHED_FIFO. Threads that it starts are ordinary again.
///
/// # Errors
/// EPERM without the privilege, EINVAL for a priority outside 1 to 99.
pub(crate) fn set_fifo(priority: u8) -> Result<(), Errno> {
    set_policy(
        libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK,
        i32::from(priority),
    )
}

/// Gives the calling thread the ordinary policy back.
///
/// # Errors
/// The kernel's, in theory; leaving a real-time policy needs no privilege.
#[cfg(test)]
pub(crate) fn set_ordinary() -> Result<(), Errno> {
    // The flag that set_fifo set stays: clearing it needs a separate privilege.
    set_policy(libc::SCHED_OTHER | libc::SCHED_RESET_ON_FORK, 0)
}

fn set_policy(policy: i32, priority: i32) -> Result<(), Errno> {
    // Zeroed rather than written as a literal: some C libraries have more fields.
    // SAFETY: sched_param is a plain struct of integers, for which all bits zero is a value.
    let mut param: libc::sched_param = unsafe { std::mem::zeroed() };
    param.sched_priority = priority;
    // The system call and not the C library's function, which some libraries refuse to implement.
    // SAFETY: thread 0 is the caller; `param` is alive and initialised for the length of the call and only read.
    let outcome = unsafe {
        libc::syscall(
            libc::SYS_sched_setscheduler,
            0,
            policy,
            std::ptr::from_ref(&param),
        )
    };
    if outcome == 0 {
        Ok(())
    } else {
        Err(last_error())
    }
}

/// True if the calling thread runs under SCHED_FIFO now.
#[must_use]
#[cfg(test)]
pub(crate) fn is_fifo() -> bool {
    // SAFETY: the call takes a number (0: the calling thread) and returns one; no memory is passed.
    let policy = unsafe { libc::syscall(libc::SYS_sched_getscheduler, 0) };
    policy & !i64::from(libc::SCHED_RESET_ON_FORK) == i64::from(libc::SCHED_FIFO)
}

/// Keeps every signal that is sent to the process away from the calling thread; its own faults still arrive.
///
/// # Errors
/// The kernel's, in theory.
pub fn block_signals() -> Result<(), Errno> {
    // SAFETY: sigset_t is plain integers; sigfillset initialises all of it before it is read.
    let mut set: libc::sigset_t = unsafe { std::mem::zeroed() };
    // SAFETY: `set` is a valid sigset_t that outlives the call.
    unsafe { libc::sigfillset(&raw mut set) };
    for fault in [
        libc::SIGSEGV,
        libc::SIGBUS,
        libc::SIGFPE,
        libc::SIGILL,
        libc::SIGTRAP,
    ] {
        // SAFETY: `set` is initialised, `fault` is a valid signal number.
        unsafe { libc::sigdelset(&raw mut set, fault) };
    }
    // SAFETY: `set` is initialised and only read; the null pointer requests no old mask.
    match unsafe { libc::pthread_sigmask(libc::SIG_BLOCK, &raw const set, std::ptr::null_mut()) } {
        0 => Ok(()),
        number => Err(Errno::from_raw_os_error(number)),
    }
}

/// True if a signal, by its number, is ignored, as the parent process may have requested (nohup(1)).
#[must_use]
pub fn is_ignored(signal: libc::c_int) -> bool {
    // SAFETY: sigaction is plain integers and a handler's address, for which all bits zero is a value.
    let mut action: libc::sigaction = unsafe { std::mem::zeroed() };
    // SAFETY: no new disposition is given; `action` is alive and of the type that is filled in.
    let outcome = unsafe { libc::sigaction(signal, std::ptr::null(), &raw mut action) };
    outcome == 0 && action.sa_sigaction == libc::SIG_IGN
}

/// Raises the number of files that the process may open at once (RLIMIT_NOFILE) up to `wanted`, as far as that is allowed; what it is
/// then, none if unlimited.
#[must_use]
pub fn raise_open_files(wanted: u64) -> Option<u64> {
    let limit = getrlimit(Resource::Nofile);
    let soft = limit.current?;
    let raised = limit.maximum.map_or(wanted, |most| most.min(wanted));
    if raised <= soft {
        return Some(soft);
    }
    let limit = Rlimit {
        current: Some(raised),
        ..limit
    };
    match setrlimit(Resource::Nofile, limit) {
        Ok(()) => Some(raised),
        Err(_) => Some(soft),
    }
}

/// A file at its size limit (RLIMIT_FSIZE) gives an error to the writer instead of ending the process.
pub fn ignore_file_size_signal() {
    // SAFETY: SIG_IGN is a valid disposition of SIGXFSZ; no handler of ours runs and no memory is passed.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}

/// The terminal stops no process that holds a specimen: neither Ctrl-Z (SIGTSTP), nor reading (SIGTTIN) or, after `stty
/// tostop`, writing (SIGTTOU) from the background. SIGSTOP still does.
pub fn ignore_stops_of_the_terminal() {
    for signal in [libc::SIGTSTP, libc::SIGTTIN, libc::SIGTTOU] {
        // SAFETY: SIG_IGN is a valid disposition of these; no handler of ours runs and no memory is passed.
        unsafe { libc::signal(signal, libc::SIG_IGN) };
    }
}

/// Asks the kernel to poll the network card for up to `us` microseconds while a read on this socket finds nothing
/// (SO_BUSY_POLL, socket(7)).
///
/// # Errors
/// EPERM beyond the system's own setting without CAP_NET_ADMIN; ENOPROTOOPT on a kernel without it.
pub fn set_busy_poll(socket: std::os::fd::BorrowedFd<'_>, us: u32) -> Result<(), Errno> {
    let value = libc::c_int::try_from(us).unwrap_or(libc::c_int::MAX);
    // SAFETY: the descriptor is open for the length of the borrow; `value` is alive, only read, and its size is given.
    let outcome = unsafe {
        libc::setsockopt(
            socket.as_raw_fd(),
            libc::SOL_SOCKET,
            libc::SO_BUSY_POLL,
            (&raw const value).cast(),
            size_of::<libc::c_int>() as libc::socklen_t,
        )
    };
    if outcome == 0 {
        Ok(())
    } else {
        Err(last_error())
    }
}

fn last_error() -> Errno {
    let number = std::io::Error::last_os_error().raw_os_error();
    Errno::from_raw_os_error(number.unwrap_or(libc::EINVAL))
}

/// Keeps all present and future memory of the process in RAM.
///
/// # Errors
/// EPERM or ENOMEM without the privilege or beyond the limit.
pub(crate) fn lock_memory() -> Result<(), Errno> {
    rustix::mm::mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE)
}

/// Takes [`lock_memory`] back.
///
/// # Errors
/// The kernel's, in theory.
pub(crate) fn unlock_memory() -> Result<(), Errno> {
    rustix::mm::munlockall()
}

const PAGE: usize = 4096;

/// Touches the next `kb` kilobytes of the calling thread's stack, so that the loop finds them mapped.
///
/// The caller guarantees that the stack is that large: beyond its end lies the guard page.
pub(crate) fn touch_stack(kb: u32) {
    let _ = touch_pages(kb as usize * 1024 / PAGE);
}

/// Touches `left` pages and returns the address of the deepest.
#[inline(never)]
fn touch_pages(left: usize) -> usize {
    let mut page = [0u8; PAGE];
    // Opaque to the optimiser: the page is written, and the frame cannot be folded into the next one.
    std::hint::black_box(&mut page);
    let deepest = if left > 1 {
        touch_pages(left - 1)
    } else {
        page.as_ptr().addr()
    };
    std::hint::black_box(&mut page);
    deepest
}

/// Asks for a wake-up latency of zero from idle processors, for as long as the file is held.
///
/// # Errors
/// ENOENT where the kernel has no such file, EACCES without the right to it.
pub(crate) fn hold_awake() -> Result<File, Errno> {
    let open = || -> std::io::Result<File> {
        let mut file = std::fs::OpenOptions::new().write(true).open(DMA_LATENCY)?;
        file.write_all(&0i32.to_ne_bytes())?;
        Ok(file)
    };
    open().map_err(|error| Errno::from_io_error(&error).unwrap_or(Errno::IO))
}

/// Sets by how much the kernel may delay the calling thread's timers to bundle them (ordinary policy only).
///
/// # Errors
/// The kernel's, in theory.
pub(crate) fn set_timer_slack(ns: NonZeroU64) -> Result<(), Errno> {
    rustix::thread::set_current_timer_slack(Some(ns))
}

/// Privileges that the process has without further requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Privileges {
    /// CAP_SYS_NICE is effective.
    pub nice: bool,
    /// CAP_IPC_LOCK is effective.
    pub ipc_lock: bool,
    /// CAP_NET_RAW is effective.
    pub net_raw: bool,
    /// RLIMIT_RTPRIO, none if unlimited.
    pub rtprio: Option<u64>,
    /// RLIMIT_MEMLOCK in bytes, none if unlimited.
    pub memlock: Option<u64>,
}

/// Reads the privileges of the calling thread.
#[must_use]
pub(crate) fn privileges() -> Privileges {
    let effective =
        rustix::thread::capabilities(None).map_or(CapabilitySet::empty(), |sets| sets.effective);
    Privileges {
        nice: effective.contains(CapabilitySet::SYS_NICE),
        ipc_lock: effective.contains(CapabilitySet::IPC_LOCK),
        net_raw: effective.contains(CapabilitySet::NET_RAW),
        rtprio: getrlimit(Resource::Rtprio).current,
        memlock: getrlimit(Resource::Memlock).current,
    }
}

/// Asks the kernel about a network interface. `fill` writes into the request, whose name is set.
fn ask_interface(
    name: &str,
    question: u32,
    fill: impl FnOnce(&mut libc::ifreq),
) -> Result<libc::ifreq, Errno> {
    // SAFETY: ifreq is a plain struct of bytes, integers and pointers, for which all bits zero is a value.
    let mut request: libc::ifreq = unsafe { std::mem::zeroed() };
    // The last byte stays the end of the text.
    if name.len() >= request.ifr_name.len() {
        return Err(Errno::NODEV);
    }
    for (to, from) in request.ifr_name.iter_mut().zip(name.bytes()) {
        *to = from as _;
    }
    fill(&mut request);
    let kind = rustix::net::SocketType::DGRAM;
    let socket = rustix::net::socket(rustix::net::AddressFamily::INET, kind, None)?;
    // SAFETY: the socket is open, and `request` is alive for the length of the call. The questions of this file read and write the
    // request, and memory that the caller has put into it and keeps alive.
    let outcome = unsafe {
        libc::ioctl(
            socket.as_raw_fd(),
            question as _,
            std::ptr::from_mut(&mut request),
        )
    };
    if outcome == 0 {
        Ok(request)
    } else {
        Err(last_error())
    }
}

/// Facts about a network interface of this network namespace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct InterfaceFacts {
    pub is_up: bool,
    pub is_ethernet: bool,
    pub is_wireless: bool,
    /// Largest content of a frame in bytes.
    pub mtu: i32,
}

/// Facts about the interface of this name.
///
/// # Errors
/// ENODEV without such an interface.
pub(crate) fn interface_facts(name: &str) -> Result<InterfaceFacts, Errno> {
    // SIOCGIWNAME of linux/wireless.h: only wireless drivers answer.
    const WIRELESS_NAME: u32 = 0x8b01;
    let flags = ask_interface(name, libc::SIOCGIFFLAGS as u32, |_| {})?;
    let address = ask_interface(name, libc::SIOCGIFHWADDR as u32, |_| {})?;
    let mtu = ask_interface(name, libc::SIOCGIFMTU as u32, |_| {})?;
    // SAFETY: the kernel has filled these members of the unions in answer to these questions.
    let (flags, family, mtu) = unsafe {
        (
            i32::from(flags.ifr_ifru.ifru_flags),
            address.ifr_ifru.ifru_hwaddr.sa_family,
            mtu.ifr_ifru.ifru_mtu,
        )
    };
    Ok(InterfaceFacts {
        is_up: flags & libc::IFF_UP != 0,
        is_ethernet: family == libc::ARPHRD_ETHER,
        is_wireless: ask_interface(name, WIRELESS_NAME, |_| {}).is_ok(),
        mtu,
    })
}

/// A raw socket for the frames of one Ethernet type of the interface of this name. It never blocks, and does not receive its own
/// frames.
///
/// # Errors
/// EPERM without CAP_NET_RAW, ENODEV if there is no such interface.
pub(crate) fn packet_socket(name: &str, ether_type: u16) -> Result<OwnedFd, Errno> {
    // PACKET_IGNORE_OUTGOING of linux/if_packet.h.
    const IGNORE_OUTGOING: i32 = 23;
    // Without a protocol it receives nothing until it is bound: no frames of other interfaces.
    let socket = rustix::net::socket_with(
        rustix::net::AddressFamily::PACKET,
        rustix::net::SocketType::RAW,
        rustix::net::SocketFlags::NONBLOCK | rustix::net::SocketFlags::CLOEXEC,
        None,
    )?;
    let index = rustix::net::netdevice::name_to_index(&socket, name)?;
    // SAFETY: sockaddr_ll is a plain struct of integers, for which all bits zero is a value.
    let mut address: libc::sockaddr_ll = unsafe { std::mem::zeroed() };
    address.sll_family = libc::AF_PACKET as u16;
    address.sll_protocol = ether_type.to_be();
    address.sll_ifindex = i32::try_from(index).map_err(|_| Errno::NODEV)?;
    let on: i32 = 1;
    // SAFETY: the socket is open; `on` is alive and initialised for the length of the call and only read.
    let ignores = unsafe {
        libc::setsockopt(
            socket.as_raw_fd(),
            libc::SOL_PACKET,
            IGNORE_OUTGOING,
            std::ptr::from_ref(&on).cast(),
            size_of::<i32>() as libc::socklen_t,
        )
    };
    if ignores != 0 {
        return Err(last_error());
    }
    // SAFETY: the socket is open; `address` is alive and initialised for the length of the call and only read.
    let bound = unsafe {
        libc::bind(
            socket.as_raw_fd(),
            std::ptr::from_ref(&address).cast(),
            size_of::<libc::sockaddr_ll>() as libc::socklen_t,
        )
    };
    if bound == 0 {
        Ok(socket)
    } else {
        Err(last_error())
    }
}

/// Delay in µs after a frame before the interface of this name interrupts; `None` if its driver does not say. It may be adaptive: then
/// the delay is that of the present setting.
#[must_use]
pub(crate) fn coalescing_us(name: &str) -> Option<u32> {
    // ETHTOOL_GCOALESCE of linux/ethtool.h: a command and 22 numbers, of which the second is `rx_coalesce_usecs`.
    const GET_COALESCING: u32 = 0x0e;
    const ETHTOOL: u32 = 0x8946;
    let mut settings = [0u32; 23];
    settings[0] = GET_COALESCING;
    let place = settings.as_mut_ptr();
    let answered = ask_interface(name, ETHTOOL, |request| {
        request.ifr_ifru.ifru_data = place.cast();
    });
    answered.is_ok().then_some(settings[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernel_refuses_with_its_own_number() {
        assert_eq!(pin_to(&[CpuSet::MAX_CPU - 1]), Err(Errno::INVAL));
        assert_eq!(pin_to(&[CpuSet::MAX_CPU + 1]), Err(Errno::INVAL));
        let refused = std::thread::spawn(|| set_fifo(100)).join().unwrap();
        // EINVAL for the number; EPERM where the kernel checks the privilege first.
        assert!(matches!(refused, Err(Errno::INVAL | Errno::PERM)));
    }

    #[test]
    fn pinned_thread_sees_one_processor() {
        std::thread::spawn(|| {
            let last = *allowed_cpus().last().unwrap();
            pin_to(&[last]).unwrap();
            assert_eq!(allowed_cpus(), [last]);
            assert!(process_cpus().contains(&last));
        })
        .join()
        .unwrap();
    }

    #[test]
    fn children_of_a_fifo_thread_are_ordinary() {
        std::thread::spawn(|| {
            if set_fifo(1).is_ok() {
                assert!(is_fifo());
                assert!(!std::thread::spawn(is_fifo).join().unwrap());
                set_ordinary().unwrap();
            }
            assert!(!is_fifo());
        })
        .join()
        .unwrap();
    }

    #[test]
    fn blocked_thread_still_gets_faults() {
        std::thread::spawn(|| {
            block_signals().unwrap();
            let status =
                std::fs::read_to_string(format!("/proc/self/task/{}/status", thread_id())).unwrap();
            let mask = status
                .lines()
                .find_map(|l| l.strip_prefix("SigBlk:"))
                .unwrap();
            let mask = u64::from_str_radix(mask.trim(), 16).unwrap();
            let blocks = |signal: i32| mask & 1 << (signal - 1) != 0;
            assert!(blocks(libc::SIGINT) && blocks(libc::SIGTERM));
            assert!(!blocks(libc::SIGSEGV) && !blocks(libc::SIGBUS));
        })
        .join()
        .unwrap();
    }

    #[test]
    fn stack_is_touched_to_the_requested_depth() {
        let here = 0u8;
        let top = std::ptr::from_ref(&here).addr();
        // 64 frames of at least a page each; the caller's own frame may lie on either side of `here`.
        let depth = top - touch_pages(64);
        assert!((63 * PAGE..80 * PAGE).contains(&depth), "{depth}");
        touch_stack(0);
    }

    #[test]
    fn absolute_sleep_ends_at_or_after_its_time() {
        let at = monotonic_ns() + 200_000;
        sleep_until_ns(at);
        assert!(monotonic_ns() >= at);
        sleep_until_ns(0);
    }
}
