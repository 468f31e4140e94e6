//! Limits the messages that strangers can cause. A peer can send as much as the network carries; the log must not fill the disk
//! because of it.

/// Most messages of one kind in one [`PERIOD_NS`].
const MOST: u64 = 100;
const PERIOD_NS: u64 = 60_000_000_000;

/// Whether one message is shown.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Allowance {
    /// The message passes.
    pub is_told: bool,
    /// A notice that follows it.
    pub notice: Option<String>,
}

/// Messages of one kind.
#[derive(Debug, Default)]
pub(super) struct Quota {
    since_ns: u64,
    told: u64,
    untold: u64,
}

impl Quota {
    /// One more message.
    pub(crate) fn take(&mut self, now_ns: u64) -> Allowance {
        let mut notice = None;
        if self.told == 0 || now_ns.saturating_sub(self.since_ns) >= PERIOD_NS {
            notice = (self.untold > 0).then(|| {
                let (count, messages) = match self.untold {
                    1 => ("one".to_owned(), "message"),
                    many => (many.to_string(), "messages"),
                };
                format!("{count} more {messages} of this kind came before it, not told")
            });
            (self.since_ns, self.told, self.untold) = (now_ns, 0, 0);
        }
        let is_told = self.told < MOST;
        if is_told {
            self.told += 1;
        } else {
            self.untold += 1;
        }
        if is_told && self.told == MOST {
            let left_ns = PERIOD_NS.saturating_sub(now_ns.saturating_sub(self.since_ns));
            let left_s = left_ns / 1_000_000_000;
            notice = Some(format!(
                "further messages of this kind are not told for {left_s} s"
            ));
        }
        Allowance { is_told, notice }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quota_reports_the_omitted_messages() {
        let mut quota = Quota::default();
        let mut take = |s: u64| quota.take(5 + s * 1_000_000_000);
        let plain = |is_told| Allowance {
            is_told,
            notice: None,
        };
        for _ in 1..MOST {
            assert_eq!(take(0), plain(true));
        }
        let last = take(10);
        assert!(last.is_told && last.notice.unwrap().contains("50 s"));
        assert_eq!((take(11), take(59)), (plain(false), plain(false)));
        let next = take(60);
        assert!(next.is_told && next.notice.unwrap().starts_with("2 more"));
        assert_eq!(take(61), plain(true));
    }
}
