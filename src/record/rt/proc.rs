//! Readers of the kernel's text files: pure functions over bytes.
//!
//! Invariant: nothing here opens a file or allocates, except [`cpu_list`]; unknown or torn text gives `None`,
//! never a guess.

/// Context switches of a thread, from /proc/self/task/N/status.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Switches {
    /// The thread gave the processor up: it slept or waited.
    pub voluntary: u64,
    /// The processor was taken from it.
    pub involuntary: u64,
}

/// Reads both counts of context switches out of a status file.
#[must_use]
pub(crate) fn switches(status: &[u8]) -> Option<Switches> {
    Some(Switches {
        voluntary: field_after(status, b"voluntary_ctxt_switches:")?,
        involuntary: field_after(status, b"nonvoluntary_ctxt_switches:")?,
    })
}

fn field_after(text: &[u8], key: &[u8]) -> Option<u64> {
    text.split(|byte| *byte == b'\n')
        .find_map(|line| line.strip_prefix(key))
        .and_then(|rest| number(rest.trim_ascii()))
}

/// Minor page faults of a thread, from /proc/self/task/N/stat: the tenth field.
#[must_use]
pub(crate) fn minor_faults(stat: &[u8]) -> Option<u64> {
    // The second field is the name in brackets and may hold anything, blanks and brackets too.
    let end_of_name = stat.iter().rposition(|byte| *byte == b')')?;
    let after = stat.get(end_of_name + 1..)?;
    number(words(after).nth(7)?)
}

/// Nanoseconds that a thread was ready and waited for a processor, from /proc/self/task/N/schedstat: the second number.
#[must_use]
pub(crate) fn waited_ns(schedstat: &[u8]) -> Option<u64> {
    number(words(schedstat).nth(1)?)
}

/// Steal of one processor from /proc/stat in USER_HZ ticks (10 ms); of all of them if `cpu` is `None`.
#[must_use]
pub(crate) fn steal_ticks(stat: &[u8], cpu: Option<usize>) -> Option<u64> {
    processor_line(stat, cpu).and_then(|line| number(words(line).nth(8)?))
}

/// Steal as a share of all time since boot, 0 to 1.
#[must_use]
pub(crate) fn steal_share(stat: &[u8]) -> Option<f64> {
    let line = processor_line(stat, None)?;
    // user nice system idle iowait irq softirq steal; the guest times behind are part of user.
    let mut total = 0u64;
    let mut steal = 0;
    for word in words(line).skip(1).take(8) {
        steal = number(word)?;
        total = total.checked_add(steal)?;
    }
    (total > 0).then(|| steal as f64 / total as f64)
}

fn processor_line(stat: &[u8], cpu: Option<usize>) -> Option<&[u8]> {
    stat.split(|byte| *byte == b'\n').find(|line| {
        let name = words(line).next().unwrap_or_default();
        match (name.strip_prefix(b"cpu"), cpu) {
            (Some(b""), None) => true,
            (Some(digits), Some(cpu)) => number(digits) == Some(cpu as u64),
            _ => false,
        }
    })
}

fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|byte| byte.is_ascii_whitespace())
        .filter(|word| !word.is_empty())
}

fn number(digits: &[u8]) -> Option<u64> {
    std::str::from_utf8(digits).ok()?.parse().ok()
}

/// Reads "0-3,5" as 0, 1, 2, 3, 5; an empty line is an empty list.
#[must_use]
pub(crate) fn cpu_list(text: &str) -> Option<Vec<usize>> {
    /// More processors than Linux can be built for; bounds what a torn file can ask for.
    const MOST: usize = 1 << 16;
    let mut cpus = Vec::new();
    for part in text.trim().split(',').filter(|part| !part.is_empty()) {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (first, last): (usize, usize) = (first.parse().ok()?, last.parse().ok()?);
        if !(first <= last && last < MOST) {
            return None;
        }
        cpus.extend(first..=last);
    }
    Some(cpus)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const STATUS: &[u8] = b"Name:\tgusset-loop\nState:\tR (running)\nTgid:\t812\nThreads:\t4\n\
        Cpus_allowed_list:\t1\nvoluntary_ctxt_switches:\t30721\nnonvoluntary_ctxt_switches:\t17\n";
    const TASK_STAT: &[u8] =
        b"815 (odd) name (x) R 1 812 812 0 -1 4194368 143 0 2 0 19 4 0 0 -91 0 4 0 9 1 2";
    const STAT: &[u8] =
        b"cpu  40119 0 8294 194887 721 0 28 290 7 0\ncpu0 19075 0 2908 99672 339 0 3 13 0 0\n\
        cpu1 21044 0 5386 95214 382 0 25 277 7 0\ncpu11 1 2 3 4 5 6 7 8 9 10\nintr 5 6\nctxt 1\n";

    #[test]
    fn captured_files_give_their_numbers() {
        let expected = Switches {
            voluntary: 30_721,
            involuntary: 17,
        };
        assert_eq!(switches(STATUS), Some(expected));
        assert_eq!(minor_faults(TASK_STAT), Some(143));
        assert_eq!(waited_ns(b"88 1249000000 7\n"), Some(1_249_000_000));
        assert_eq!(waited_ns(b"88"), None);
        assert_eq!(steal_ticks(STAT, None), Some(290));
        assert_eq!(steal_ticks(STAT, Some(1)), Some(277));
        assert_eq!(steal_ticks(STAT, Some(11)), Some(8));
        assert_eq!(steal_ticks(STAT, Some(2)), None);
        // 290 of 40119 + 8294 + 194887 + 721 + 28 + 290; the 7 guest ticks are inside user.
        assert!((steal_share(STAT).unwrap() - 290.0 / 244_339.0).abs() < 1e-15);
    }

    #[test]
    fn torn_files_give_nothing() {
        assert_eq!(switches(&STATUS[..STATUS.len() - 5]), None);
        assert_eq!(minor_faults(b"815 (odd) R 1 2"), None);
        assert_eq!(minor_faults(b""), None);
        assert_eq!(steal_ticks(b"cpu  1 2 3", None), None);
        assert_eq!(steal_share(b"cpu  0 0 0 0 0 0 0 0"), None);
    }

    #[test]
    fn lists_of_processors() {
        assert_eq!(cpu_list("0-3,5\n"), Some(vec![0, 1, 2, 3, 5]));
        assert_eq!(cpu_list("7"), Some(vec![7]));
        assert_eq!(cpu_list("\n"), Some(vec![]));
        assert_eq!(cpu_list("3-1"), None);
        assert_eq!(cpu_list("0-99999999"), None);
        assert_eq!(cpu_list("all"), None);
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = (switches(&bytes), minor_faults(&bytes), steal_ticks(&bytes, Some(0)), steal_share(&bytes));
            let _ = cpu_list(&String::from_utf8_lossy(&bytes));
        }
    }
}
