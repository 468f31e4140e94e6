//! Fuzzing of the codecs on the stable compiler: seeded, so that a failure can be repeated, and aware of the formats, so that
//! spoilt inputs reach the depths. `cargo test` passes a short run, `tools/fuzz` one of ten million inputs with another
//! seed each time.
//!
//! Properties: no panic; nothing is allocated on the data path, and nowhere more than the limit; what decodes comes back
//! as it was when it is encoded again; a stream in pieces of any size takes the same course as in one; every call uses
//! bytes up, so nothing spins; who has not the key cannot make a frame that passes.

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
fn spoilt_frames_of_ours_are_refused_or_mean_what_they_say() {
    share(&mut Native::new(), 4);
}

#[test]
fn spoilt_control_messages_are_refused_or_mean_what_they_say() {
    share(&mut Handshake::new(), 3);
}

#[test]
fn spoilt_exchanges_of_openfresco_are_refused_or_mean_what_they_say() {
    share(&mut OpenFresco::new(), 3);
}
