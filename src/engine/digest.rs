//! A number that says whether the state of a test is the same.

/// Values of a long vector that are hashed, evenly spread: a checkpoint must not cost a deadline.
const SAMPLED: usize = 1024;

/// FNV-1a, 64 bits at a time: quick, and good enough against damage and mistakes; not against malice.
pub(super) struct Digest(u64);

impl Digest {
    /// Of nothing.
    pub const fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    /// Takes one value. Real-time: yes.
    pub fn take(&mut self, value: f64) {
        let mixed = (self.0 ^ value.to_bits()).wrapping_mul(0x0000_0100_0000_01b3);
        // The product carries nothing downwards: without this the low bits would never see the high ones.
        self.0 = mixed ^ (mixed >> 32);
    }

    /// Takes a vector, of which many values are passed over. Real-time: yes.
    pub fn sample(&mut self, values: &[f64]) {
        for value in values.iter().step_by(values.len() / SAMPLED + 1) {
            self.take(*value);
        }
    }

    /// The digest. Real-time: yes.
    pub const fn value(&self) -> u64 {
        self.0
    }
}
