//! Little-endian numbers at byte offsets. Every access is checked and says what was missing; nothing panics,
//! nothing allocates. Real-time: yes.

use super::WireError;

/// Eight bytes of a frame.
pub(crate) type Word = [u8; 8];

/// The first and the last four bytes of a word.
pub(crate) const fn halves([a, b, c, d, e, f, g, h]: Word) -> (u32, u32) {
    (
        u32::from_le_bytes([a, b, c, d]),
        u32::from_le_bytes([e, f, g, h]),
    )
}

/// The word with these halves.
pub(crate) const fn joined(first: u32, last: u32) -> Word {
    (((last as u64) << 32) | first as u64).to_le_bytes()
}

/// `N` bytes at `at`.
pub(crate) fn array<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], WireError> {
    bytes
        .get(at..)
        .and_then(|rest| rest.first_chunk::<N>())
        .copied()
        .ok_or(WireError::Truncated {
            needed: at.saturating_add(N),
            found: bytes.len(),
        })
}

pub(crate) fn get_i32(bytes: &[u8], at: usize) -> Result<i32, WireError> {
    array(bytes, at).map(i32::from_le_bytes)
}

pub(crate) fn get_f64(bytes: &[u8], at: usize) -> Result<f64, WireError> {
    array(bytes, at).map(f64::from_le_bytes)
}

/// `count` doubles at `at`, still as bytes.
pub(crate) fn words(bytes: &[u8], at: usize, count: usize) -> Result<&[[u8; 8]], WireError> {
    let end = count
        .checked_mul(8)
        .and_then(|length| length.checked_add(at));
    end.and_then(|end| bytes.get(at..end))
        .map(|slice| slice.as_chunks::<8>().0)
        .ok_or(WireError::Truncated {
            needed: end.unwrap_or(usize::MAX),
            found: bytes.len(),
        })
}

/// Copies doubles out; the lengths must agree.
pub(crate) fn copy_words(
    field: &'static str,
    words: &[[u8; 8]],
    into: &mut [f64],
) -> Result<(), WireError> {
    same_length(field, into.len(), words.len())?;
    for (value, word) in into.iter_mut().zip(words) {
        *value = f64::from_le_bytes(*word);
    }
    Ok(())
}

/// All of `words` are finite numbers.
pub(crate) fn finite_words(field: &'static str, words: &[[u8; 8]]) -> Result<(), WireError> {
    match words
        .iter()
        .position(|word| !f64::from_le_bytes(*word).is_finite())
    {
        None => Ok(()),
        Some(index) => Err(WireError::NotFinite { field, index }),
    }
}

/// All of `values` are finite numbers.
pub(crate) fn finite(field: &'static str, values: &[f64]) -> Result<(), WireError> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => Err(WireError::NotFinite { field, index }),
    }
}

/// Writes `value` at `at`.
pub(crate) fn put<const N: usize>(
    out: &mut [u8],
    at: usize,
    value: [u8; N],
) -> Result<(), WireError> {
    let found = out.len();
    out.get_mut(at..)
        .and_then(|rest| rest.first_chunk_mut::<N>())
        .map(|place| *place = value)
        .ok_or(WireError::Room {
            needed: at.saturating_add(N),
            found,
        })
}

/// Writes doubles from `at` on.
pub(crate) fn put_doubles(out: &mut [u8], at: usize, values: &[f64]) -> Result<(), WireError> {
    let found = out.len();
    let end = at.saturating_add(values.len().saturating_mul(8));
    let place = out
        .get_mut(at..end)
        .ok_or(WireError::Room { needed: end, found })?;
    for (word, value) in place.as_chunks_mut::<8>().0.iter_mut().zip(values) {
        *word = value.to_le_bytes();
    }
    Ok(())
}

/// A number that must be from `lowest` to `highest`.
pub(crate) fn bounded(
    field: &'static str,
    lowest: usize,
    highest: usize,
    found: i128,
) -> Result<(), WireError> {
    if (lowest as i128..=highest as i128).contains(&found) {
        return Ok(());
    }
    Err(WireError::Bounds {
        field,
        lowest: lowest as i64,
        highest: highest as i64,
        found,
    })
}

/// Two lengths that must agree.
pub(crate) fn same_length(
    field: &'static str,
    expected: usize,
    found: usize,
) -> Result<(), WireError> {
    if expected == found {
        Ok(())
    } else {
        Err(WireError::Count {
            field,
            expected,
            found,
        })
    }
}
