//! The memory units of a simulated device (ETG.1000.4, FMMU): logical datagrams read and write its process data.

use super::device::Device;
use crate::wire::register as reg;
use crate::wire::register::AlState;

impl Device {
    /// A logical datagram: what its memory units map is read and written. Returns the working counter, to which a device adds once for
    /// all that it read and once for all that it wrote.
    pub(super) fn exchange(
        &mut self,
        (logical, reads, writes): (u32, bool, bool),
        data: &mut [u8],
        now_ns: u64,
    ) -> u16 {
        if self.state < AlState::SafeOp {
            return 0;
        }
        let (mut has_read, mut has_written) = (false, false);
        for unit in 0..8 {
            let at = reg::FMMU + unit * reg::FMMU_SIZE;
            let [kind, active] = self.word(at + 11).to_le_bytes();
            if active & 1 == 0 {
                continue;
            }
            let start = u64::from(self.word(at)) | u64::from(self.word(at + 2)) << 16;
            let end = start + u64::from(self.word(at + 4));
            // The unit may begin before the datagram, and end behind it.
            let first = start.max(u64::from(logical));
            let last = end.min(u64::from(logical) + data.len() as u64);
            let Some(length) = last.checked_sub(first).filter(|length| *length > 0) else {
                continue;
            };
            let length = length as usize;
            let from = (first - u64::from(logical)) as usize;
            let physical = usize::from(self.word(at + 8)) + (first - start) as usize;
            let part = data.get_mut(from..from + length);
            let own = self.memory.get_mut(physical..physical + length);
            let (Some(part), Some(own)) = (part, own) else {
                continue;
            };
            if kind & 2 != 0 && writes {
                own.copy_from_slice(part);
                has_written = true;
            } else if kind & 1 != 0 && reads {
                part.copy_from_slice(own);
                has_read = true;
            }
        }
        if has_written {
            self.written_ns = Some(now_ns);
            if self.asked_ns.take().is_some() {
                self.enter(AlState::Op);
                self.show(self.state, 0);
            }
        }
        let by_write = if reads { 2 } else { 1 };
        u16::from(has_read) + if has_written { by_write } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::super::device::{INPUTS, OUTPUTS};
    use super::super::tests::plan;
    use super::*;
    use crate::plan::TimeSource;

    const MS: u64 = 1_000_000;

    /// The drive of the plan in SAFE-OP: outputs at 0x100, and inputs at 0x106 in two units.
    fn drive() -> Device {
        let mut own = Device::new((0, true), (&plan().devices[3], ""), TimeSource::Loop, 0.0);
        own.state = AlState::SafeOp;
        for (unit, start, length, physical, kind) in [
            (0u16, 0x100u16, 6u16, OUTPUTS, 2u8),
            (1, 0x106, 2, INPUTS, 1),
            (2, 0x108, 6, INPUTS + 2, 1),
        ] {
            let at = reg::FMMU + unit * reg::FMMU_SIZE;
            own.put(at, &start.to_le_bytes());
            own.put(at + 4, &length.to_le_bytes());
            own.put(at + 8, &physical.to_le_bytes());
            own.put(at + 11, &[kind, 1]);
        }
        own
    }

    #[test]
    fn a_device_counts_once_for_each_way() {
        let mut own = drive();
        let mut data = [0u8; 14];
        assert_eq!(own.exchange((0x100, true, true), &mut data, 0), 3);
        assert_eq!(own.exchange((0x100, true, false), &mut data, 0), 1);
        assert_eq!(own.exchange((0x100, false, true), &mut data, 0), 1);
        assert_eq!(own.exchange((0x106, true, true), &mut data[..8], 0), 1);
        assert_eq!(own.exchange((0x10e, true, true), &mut data, 0), 0);
        own.state = AlState::PreOp;
        assert_eq!(own.exchange((0x100, true, true), &mut data, 0), 0);
    }

    #[test]
    fn a_unit_takes_its_part_of_a_datagram() {
        let mut own = drive();
        own.put(INPUTS, &[1, 2, 3, 4, 5, 6, 7, 8]);
        // It begins inside the outputs and ends inside the inputs.
        let mut data = [9u8; 8];
        assert_eq!(own.exchange((0x104, true, true), &mut data, 0), 3);
        assert_eq!(data, [9, 9, 1, 2, 3, 4, 5, 6]);
        let at = usize::from(OUTPUTS);
        assert_eq!(own.memory[at..at + 8], [0, 0, 0, 0, 9, 9, 0, 0]);
    }

    #[test]
    fn op_waits_for_the_first_outputs() {
        let op = AlState::Op as u8;
        let shown = |own: &Device| (own.word(reg::AL_STATUS), own.word(reg::AL_CODE));
        let mut own = drive();
        own.request(op, 0);
        own.watch(200 * MS);
        own.put(reg::AL_CODE, &[0, 0]);
        assert_eq!(own.state, AlState::SafeOp);
        own.exchange((0x100, true, true), &mut [0; 14], 200 * MS);
        assert_eq!((own.state, shown(&own)), (AlState::Op, (8, 0)));
        let mut late = drive();
        late.request(op, 0);
        late.watch(201 * MS);
        assert_eq!((late.state, shown(&late)), (AlState::SafeOp, (0x14, 0x19)));
        // Outputs that came before count for the time of the watchdog.
        for (age, state) in [(100, AlState::Op), (101, AlState::SafeOp)] {
            let mut own = drive();
            own.exchange((0x100, true, true), &mut [0; 14], 0);
            own.request(op, age * MS);
            assert_eq!(own.state, state, "{age}");
        }
    }
}
