//! Binary records that are recognised and refused by name: SAC and miniSEED.

use crate::error::MotionError;

/// Refuses the bytes of a SAC or miniSEED file.
///
/// # Errors
/// [`MotionError::UnsupportedRecord`], which names the format and says how to convert it.
pub(in crate::read) fn refuse(name: &str, bytes: &[u8]) -> Result<(), MotionError> {
    let format = if is_mini_seed(bytes) {
        "miniSEED"
    } else if is_sac(bytes) {
        "SAC"
    } else {
        return Ok(());
    };
    Err(MotionError::UnsupportedRecord {
        file: name.into(),
        format,
        reason: "convert it to CSV with its sensitivity applied, for example with ObsPy: read(), \
                 remove_response(output=\"ACC\"), then numpy.savetxt",
    })
}

/// Version 2: six digits, a quality letter, a blank, and the zero bytes of a binary header. Version 3: `MS` and 3.
fn is_mini_seed(bytes: &[u8]) -> bool {
    if bytes.starts_with(b"MS\x03") {
        return true;
    }
    let Some((start, rest)) = bytes.split_at_checked(8) else {
        return false;
    };
    let is_number = start.iter().take(6).all(u8::is_ascii_digit);
    let is_data = start
        .get(6)
        .is_some_and(|quality| b"DRQM".contains(quality));
    is_number && is_data && start.ends_with(b" ") && rest.iter().take(40).any(|byte| *byte == 0)
}

/// The header version (6 or 7) in either byte order, and as many bytes as the header counts samples.
fn is_sac(bytes: &[u8]) -> bool {
    const HEADER: usize = 632;
    const COUNT: usize = 316;
    const VERSION: usize = 304;
    let word = |at: usize| -> Option<[u8; 4]> { bytes.get(at..at + 4)?.try_into().ok() };
    let (Some(version), Some(count)) = (word(VERSION), word(COUNT)) else {
        return false;
    };
    [u32::from_le_bytes, u32::from_be_bytes].iter().any(|read| {
        let is_version = matches!(read(version), 6 | 7);
        let samples = (bytes.len().saturating_sub(HEADER) / 4) as u64;
        is_version && u64::from(read(count)) <= samples
    })
}
