//! Random bits that are a function of a seed and a place: no state is kept.

/// 64 random bits for a seed and a place.
pub(super) fn bits(seed: u64, channel: &str, number: u64) -> u64 {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&seed.to_le_bytes());
    hasher.update(&number.to_le_bytes());
    hasher.update(channel.as_bytes());
    let mut first = [0; 8];
    hasher.finalize_xof().fill(&mut first);
    u64::from_le_bytes(first)
}
