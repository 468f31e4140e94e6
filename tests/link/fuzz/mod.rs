//! Parts of the fuzzing of the codecs: seeded dice, mutations that know doubles and counts, and a run that names the input on which
//! a property failed.

#![allow(clippy::disallowed_macros, reason = "a long run prints its counts")]

pub mod handshake;
pub mod native;
pub mod openfresco;

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Steele, Lea, Flood 2014: splitmix64.
pub struct Dice(pub u64);

impl Dice {
    pub fn roll(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// 0 to `bound` − 1; 0 for a bound of 0.
    pub fn below(&mut self, bound: usize) -> usize {
        (self.roll() % bound.max(1) as u64) as usize
    }

    pub fn one_in(&mut self, of: usize) -> bool {
        self.below(of) == 0
    }

    pub fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len())]
    }
}

/// Counts, lengths and codes at which checks turn.
pub const WORDS: [u32; 25] = [
    0,
    1,
    2,
    3,
    4,
    5,
    8,
    16,
    44,
    63,
    64,
    65,
    255,
    256,
    4096,
    4097,
    64_000,
    65_535,
    65_536,
    65_537,
    0x0010_0000,
    0x0100_0000,
    0x1000_0000,
    0x7fff_ffff,
    0xffff_ffff,
];

fn doubles() -> [f64; 20] {
    [
        0.0,
        -0.0,
        1.0,
        2.0,
        3.0,
        4.0,
        4.1,
        4.2,
        5.0,
        6.0,
        10.0,
        12.0,
        99.0,
        256.0,
        65_537.0,
        1e308,
        f64::MIN_POSITIVE / 2.0,
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
    ]
}

fn write(bytes: &mut [u8], at: usize, value: &[u8]) {
    for (place, byte) in bytes.iter_mut().skip(at).zip(value) {
        *place = *byte;
    }
}

/// Spoils `bytes` in up to eight places; `other` lends stretches of itself.
pub fn mutate(dice: &mut Dice, bytes: &mut Vec<u8>, other: &[u8]) {
    for _ in 0..dice.below(9) {
        let length = bytes.len();
        let at = dice.below(length + 1);
        match dice.below(11) {
            0 | 1 if length > 0 => bytes[at.min(length - 1)] ^= 1 << dice.below(8),
            2 if length > 0 => bytes[at.min(length - 1)] = dice.roll() as u8,
            3 | 4 => {
                let value = dice.pick(&WORDS).to_le_bytes();
                write(bytes, at & !3, &value[..*dice.pick(&[2, 4])]);
            }
            5 | 6 => {
                let value = dice.pick(&doubles()).to_le_bytes();
                // Aligned as vectors are, or as a body behind its header is.
                write(bytes, (at & !7) + *dice.pick(&[0, 4]), &value);
            }
            7 => bytes.truncate(at),
            8 => {
                let extra = dice.below(40);
                bytes.extend((0..extra).map(|_| dice.roll() as u8));
            }
            9 => {
                let from = dice.below(other.len() + 1);
                let stretch = dice.below(60).min(other.len() - from);
                write(bytes, at, &other[from..from + stretch]);
            }
            _ => {
                let stretch = dice.below(60).min(length - at);
                let copy = bytes[at..at + stretch].to_vec();
                let place = dice.below(length + 1);
                bytes.splice(place..place, copy);
            }
        }
        bytes.truncate(70_000);
    }
}

/// One codec with its inputs.
pub trait Target {
    /// As files of the corpus call it.
    fn name(&self) -> &'static str;
    /// Makes the next input.
    fn input(&mut self, dice: &mut Dice) -> Vec<u8>;
    /// The next input to be checked is one of the corpus.
    fn adopt(&mut self, input: &[u8]) {
        let _ = input;
    }
    /// Panics where a property fails. The dice decide where a stream is cut and the like.
    fn check(&mut self, dice: &mut Dice, input: &[u8]);
    /// How many inputs passed all checks of the codec, so that a run of nothing but refusals is noticed.
    fn accepted(&self) -> u64;
}

/// Inputs of files `<target>-*.hex`: bytes in hex, white space between, lines that begin with # are words. Those of
/// `<target>-bad-*.hex` once failed; the others are right, and must be for as long as the protocol has its version.
pub fn corpus(target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fuzz_corpus");
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if !(name.starts_with(&format!("{target}-")) && name.ends_with(".hex")) {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        let digits: Vec<u8> = text
            .lines()
            .filter(|line| !line.starts_with('#'))
            .flat_map(str::bytes)
            .filter(u8::is_ascii_hexdigit)
            .collect();
        let bytes = digits
            .chunks(2)
            .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
            .collect();
        found.push((name.to_owned(), bytes));
    }
    found
}

/// The unchanged corpus, then `inputs` new ones.
pub fn run(target: &mut dyn Target, inputs: u64, seed: u64) {
    let name = target.name();
    let known = corpus(name);
    let mut dice = Dice(seed);
    for index in 0..known.len() as u64 + inputs {
        let input = match known.get(index as usize) {
            Some((_, known)) => {
                target.adopt(known);
                known.clone()
            }
            None => target.input(&mut dice),
        };
        let cuts = dice.roll();
        let before = target.accepted();
        let outcome = catch_unwind(AssertUnwindSafe(|| target.check(&mut Dice(cuts), &input)));
        if outcome.is_err() {
            let hex: String = input.iter().map(|byte| format!("{byte:02x}")).collect();
            panic!(
                "{name}, input {index} of seed {seed} (cuts {cuts}): keep it as \
                 tests/fuzz_corpus/{name}-bad-what.hex\n{hex}"
            );
        }
        if let Some((file, _)) = known.get(index as usize) {
            let right = target.accepted() == before + 1;
            assert!(
                right || file.contains("-bad-"),
                "{file} is not right any more"
            );
        }
    }
    let accepted = target.accepted();
    eprintln!("{name}: {inputs} inputs of seed {seed}, {accepted} of them right");
    assert!(accepted * 100 > inputs, "only {accepted} got through");
}
