//! [`Aligned`]: numbers that begin on a cache line.
//!
//! The allocator's vectors begin anywhere; then every eighth number straddles two lines, and an access to eight at a
//! time costs two. This one skips the numbers before the first boundary. It behaves as a slice; alignment does not
//! change results.

use std::fmt;
use std::ops::{Deref, DerefMut};

use gusset_quantity::state::{Stateful, Visit};

/// Bytes of a line.
const LINE: usize = 64;

/// A fixed number of `f64`, the first one on a cache line.
pub struct Aligned {
    /// Ends with the last number.
    store: Vec<f64>,
    start: usize,
}

impl Aligned {
    /// `len` zeros.
    #[must_use]
    pub fn zeros(len: usize) -> Self {
        let mut store = vec![0.0; len + LINE / size_of::<f64>() - 1];
        // The offset may be unknown; then this is an ordinary vector.
        let offset = store.as_ptr().align_offset(LINE);
        let start = offset.min(store.len() - len);
        store.truncate(start + len);
        Self { store, start }
    }
}

impl Deref for Aligned {
    type Target = [f64];

    #[inline]
    fn deref(&self) -> &[f64] {
        self.store.get(self.start..).unwrap_or_default()
    }
}

impl DerefMut for Aligned {
    #[inline]
    fn deref_mut(&mut self) -> &mut [f64] {
        self.store.get_mut(self.start..).unwrap_or_default()
    }
}

impl Stateful for Aligned {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        visit.numbers(self);
    }
}

impl From<Vec<f64>> for Aligned {
    fn from(values: Vec<f64>) -> Self {
        let mut aligned = Self::zeros(values.len());
        aligned.copy_from_slice(&values);
        aligned
    }
}

impl IntoIterator for Aligned {
    type Item = f64;
    type IntoIter = std::iter::Skip<std::vec::IntoIter<f64>>;

    fn into_iter(self) -> Self::IntoIter {
        self.store.into_iter().skip(self.start)
    }
}

impl Clone for Aligned {
    fn clone(&self) -> Self {
        let mut other = Self::zeros(self.len());
        other.copy_from_slice(self);
        other
    }

    /// Allocates nothing if both have the same length.
    fn clone_from(&mut self, source: &Self) {
        if self.len() == source.len() {
            self.copy_from_slice(source);
        } else {
            *self = source.clone();
        }
    }
}

impl fmt::Debug for Aligned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.deref().fmt(f)
    }
}

impl<T: AsRef<[f64]> + ?Sized> PartialEq<T> for Aligned {
    fn eq(&self, other: &T) -> bool {
        **self == *other.as_ref()
    }
}

impl AsRef<[f64]> for Aligned {
    fn as_ref(&self) -> &[f64] {
        self
    }
}

impl<'a> IntoIterator for &'a Aligned {
    type Item = &'a f64;
    type IntoIter = std::slice::Iter<'a, f64>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<'a> IntoIterator for &'a mut Aligned {
    type Item = &'a mut f64;
    type IntoIter = std::slice::IterMut<'a, f64>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_number_is_aligned_copies_are_equal() {
        for len in [0, 1, 7, 8, 1000] {
            let mut vector = Aligned::zeros(len);
            assert_eq!(vector.as_ptr() as usize % LINE, 0);
            for (i, value) in (&mut vector).into_iter().enumerate() {
                *value = i as f64;
            }
            let copy = vector.clone();
            assert_eq!(copy.as_ptr() as usize % LINE, 0);
            assert_eq!(copy, vector);
            let mut other = Aligned::from(vec![1.0; len]);
            other.clone_from(&vector);
            assert_eq!(other, vector);
            other.clone_from(&Aligned::zeros(len + 1));
            assert_eq!(other.len(), len + 1);
        }
    }
}
