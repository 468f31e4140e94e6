//! Fuzzing of the codecs on the stable compiler: seeded, so that a failure can be repeated, and aware of the formats, so that
//! spoilt inputs reach the depths. `cargo test` passes a short run, `tools/fuzz` one of ten million inputs with another seed each
//! time.
//!
//! Properties: no panic. No allocation on the data path, and nowhere more than the limit. A decoded message is unchanged when it is
//! encoded and decoded again. A stream in pieces of any size takes the same course as in one. Every call uses bytes up, so nothing
//! spins. Without the key no valid frame can be made.

use crate::fuzz::handshake::Handshake;
use crate::fuzz::native::Native;
use crate::fuzz::openfresco::OpenFresco;
use crate::fuzz::{Target, run};

/// Inputs of all targets together, and the seed.
fn order() -> (u64, u64) {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse().unwrap());
    (
        number("GUSSET_FUZZ_INPUTS").unwrap_or(60_000),
        number("GUSSET_FUZZ_SEED").unwrap_or(20_140_402),
    )
}

fn share(target: &mut dyn Target, of_ten: u64) {
    let (inputs, seed) = order();
    run(target, inputs * of_ten / 10, seed);
}

#[test]
fn spoilt_frames_are_refused_or_consistent() {
    share(&mut Native::new(), 4);
}

#[test]
fn spoilt_control_is_refused_or_consistent() {
    share(&mut Handshake::new(), 3);
}

#[test]
fn spoilt_openfresco_refused_or_consistent() {
    share(&mut OpenFresco::new(), 3);
}
