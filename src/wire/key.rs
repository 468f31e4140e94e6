//! Keys: a secret both ends hold, the session key made from it and two nonces, and the MAC of a frame.
//!
//! All of it is BLAKE3: its key derivation mode makes keys, its keyed mode signs. The pre-shared key never signs
//! anything that carries data, and a session key is used in one session only, so a frame of yesterday's test proves
//! nothing today. Keys are read from a file by the caller and never printed: `Debug` shows nothing. This is
//! authentication, not secrecy: an eavesdropper can read the displacements.

use super::WireError;
use super::bytes::bounded;

/// Bytes of a MAC: BLAKE3's 32, cut to the first 16.
pub(crate) const MAC_LEN: usize = 16;
/// Bytes of a nonce. Fresh random bytes for every handshake, from the operating system.
pub const NONCE_LEN: usize = 32;
/// Bytes of a proof.
pub const PROOF_LEN: usize = 32;
/// A pre-shared key has at least this many bytes; 32 random ones are recommended.
pub(crate) const SHORTEST_KEY: usize = 16;
/// A pre-shared key has at most this many bytes.
pub const LONGEST_KEY: usize = 4096;

/// Contexts of the key derivation, one for each purpose. Never to be changed within a protocol version.
const PRE_SHARED_CONTEXT: &str = "gusset wire 1 pre-shared key";
const SESSION_CONTEXT: &str = "gusset wire 1 session key";

/// A nonce.
pub(crate) type Nonce = [u8; NONCE_LEN];
/// A proof that its writer has the key.
pub type Proof = [u8; PROOF_LEN];

/// The secret that both ends were given beforehand.
#[derive(Clone, PartialEq, Eq)]
pub struct PreSharedKey([u8; 32]);

impl PreSharedKey {
    /// Key from the bytes of a key file, unchanged: the caller decides about a line end.
    ///
    /// # Errors
    /// [`WireError::Bounds`] if the key is too short or too long.
    pub fn new(secret: &[u8]) -> Result<Self, WireError> {
        let (field, found) = ("length of the pre-shared key", secret.len() as i128);
        bounded(field, SHORTEST_KEY, LONGEST_KEY, found)?;
        Ok(Self(blake3::derive_key(PRE_SHARED_CONTEXT, secret)))
    }

    /// The key of one session. Both nonces and the session number enter, so neither end alone can bring an
    /// old key back.
    #[must_use]
    pub fn session(&self, controller: &Nonce, specimen: &Nonce, session: u64) -> SessionKey {
        let mut material = [0; 32 + 2 * NONCE_LEN + 8];
        let (key, rest) = material.split_at_mut(32);
        let (first, rest) = rest.split_at_mut(NONCE_LEN);
        let (second, number) = rest.split_at_mut(NONCE_LEN);
        key.copy_from_slice(&self.0);
        first.copy_from_slice(controller);
        second.copy_from_slice(specimen);
        number.copy_from_slice(&session.to_le_bytes());
        SessionKey(blake3::derive_key(SESSION_CONTEXT, &material))
    }

    /// Proof over `parts`, one after the other.
    pub(crate) fn proof(&self, parts: &[&[u8]]) -> Proof {
        keyed_hash(&self.0, parts)
    }
}

impl std::fmt::Debug for PreSharedKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("PreSharedKey(..)")
    }
}

/// The key of one session.
#[derive(Clone, PartialEq, Eq)]
pub struct SessionKey([u8; 32]);

impl SessionKey {
    /// The MAC of `bytes`. Real-time: yes.
    #[must_use]
    pub(crate) fn mac(&self, bytes: &[u8]) -> [u8; MAC_LEN] {
        let hash = blake3::keyed_hash(&self.0, bytes);
        let mut mac = [0; MAC_LEN];
        for (short, long) in mac.iter_mut().zip(hash.as_bytes()) {
            *short = *long;
        }
        mac
    }

    /// True if `mac` signs `bytes`; takes the same time whatever the answer. Real-time: yes.
    #[must_use]
    pub(crate) fn verify(&self, bytes: &[u8], mac: &[u8; MAC_LEN]) -> bool {
        same(&self.mac(bytes), mac)
    }

    /// Proof over `parts`, one after the other.
    pub(crate) fn proof(&self, parts: &[&[u8]]) -> Proof {
        keyed_hash(&self.0, parts)
    }
}

impl std::fmt::Debug for SessionKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("SessionKey(..)")
    }
}

fn keyed_hash(key: &[u8; 32], parts: &[&[u8]]) -> Proof {
    let mut hasher = blake3::Hasher::new_keyed(key);
    for part in parts {
        hasher.update(part);
    }
    *hasher.finalize().as_bytes()
}

/// Equality without an early exit, so that the duration does not reveal how many bytes were right.
pub(crate) fn same<const N: usize>(a: &[u8; N], b: &[u8; N]) -> bool {
    let difference = a
        .iter()
        .zip(b)
        .fold(0, |sum, (x, y)| std::hint::black_box(sum | (x ^ y)));
    difference == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn key_below_sixteen_bytes_is_refused() {
        assert!(matches!(
            PreSharedKey::new(&[7; 15]),
            Err(WireError::Bounds { found: 15, .. })
        ));
        assert!(PreSharedKey::new(&[7; 16]).is_ok());
        assert!(PreSharedKey::new(&[7; 4097]).is_err());
    }

    #[test]
    fn every_ingredient_changes_the_session_key() {
        let key = PreSharedKey::new(b"sixteen bytes or more").unwrap();
        let other = PreSharedKey::new(b"sixteen bytes or mire").unwrap();
        let base = key.session(&[1; 32], &[2; 32], 3);
        assert_ne!(base, other.session(&[1; 32], &[2; 32], 3));
        assert_ne!(base, key.session(&[9; 32], &[2; 32], 3));
        assert_ne!(base, key.session(&[1; 32], &[9; 32], 3));
        assert_ne!(base, key.session(&[1; 32], &[2; 32], 4));
        assert_ne!(base, key.session(&[2; 32], &[1; 32], 3));
        assert_eq!(base, key.session(&[1; 32], &[2; 32], 3));
    }

    #[test]
    fn mac_holds_for_its_bytes_and_key_only() {
        let key = PreSharedKey::new(&[5; 32]).unwrap();
        let session = key.session(&[1; 32], &[2; 32], 3);
        let mac = session.mac(b"displacement");
        assert!(session.verify(b"displacement", &mac));
        assert!(!session.verify(b"displacemenu", &mac));
        assert!(
            !key.session(&[1; 32], &[2; 32], 4)
                .verify(b"displacement", &mac)
        );
        for bit in 0..MAC_LEN * 8 {
            let mut wrong = mac;
            wrong[bit / 8] ^= 1 << (bit % 8);
            assert!(!session.verify(b"displacement", &wrong));
        }
    }

    #[test]
    fn keys_are_not_printed() {
        let key = PreSharedKey::new(&[0x41; 32]).unwrap();
        assert_eq!(format!("{key:?}"), "PreSharedKey(..)");
        assert_eq!(
            format!("{:?}", key.session(&[1; 32], &[2; 32], 3)),
            "SessionKey(..)"
        );
    }
}
