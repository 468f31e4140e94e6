//! The state of a test as a value: [`TestState`] is taken, digested and restored.
//!
//! Whatever later rows depend on is [`Stateful`]: `visit_state` shows each of its values to a [`Visit`]. The same method serves
//! every direction, so saving and restoring cannot drift apart. [`state!`](crate::state!) derives it from a list of all fields.
//! A value is 64 bits wide and keeps its exact bits.
//! A state fits only a test whose values have the same number, kinds and order, in the same version of the program.
//! [`TestState::restore`] compares that first and otherwise changes nothing. Taking and digesting a state allocate nothing.
//! What only the last trial of a law left is not part of a state: a state is taken when no trial is pending.

use thiserror::Error;

/// Raised when values of the same number and kind change their meaning.
const FORMAT: u64 = 1;

/// Receives the values of a state one by one. A visitor reads them, or replaces them by those of a saved state.
pub trait Visit {
    /// Real numbers.
    fn numbers(&mut self, values: &mut [f64]);

    /// A counter or a code.
    fn count(&mut self, value: &mut u64);

    /// A position in a list of `len` entries, from 0.
    fn index(&mut self, value: &mut usize, len: usize);

    /// A yes or no.
    fn flag(&mut self, value: &mut bool);

    /// One real number.
    fn number(&mut self, value: &mut f64) {
        self.numbers(std::slice::from_mut(value));
    }

    /// A list of at most `most` real numbers, which has the capacity for them. It takes as much room however long it is.
    fn list(&mut self, values: &mut Vec<f64>, most: usize) {
        let mut len = values.len().min(most);
        self.index(&mut len, most + 1);
        for place in 0..most {
            let mut number = values.get(place).copied().unwrap_or(0.0);
            self.number(&mut number);
            if place >= len {
                continue;
            }
            match values.get_mut(place) {
                Some(value) => *value = number,
                None => values.push(number),
            }
        }
        values.truncate(len);
    }

    /// Begins the values of a part with this name. States of other parts do not fit.
    fn part(&mut self, name: &'static str) {
        let _ = name;
    }

    /// The state cannot be taken at this moment: an exchange is under way.
    fn refuse(&mut self) {}

    /// True if the values are replaced: what is computed from them must then be computed again.
    fn restores(&self) -> bool {
        false
    }
}

impl dyn Visit + '_ {
    /// One of a few values, which is in the list.
    pub fn choice<T: Copy + PartialEq>(&mut self, value: &mut T, list: &[T]) {
        let mut place = list.iter().position(|one| one == value).unwrap_or(0);
        self.index(&mut place, list.len());
        *value = list.get(place).copied().unwrap_or(*value);
    }

    /// A part that depends on the configuration. A saved state fits only a test with the same parts.
    pub fn configured<T: Stateful>(&mut self, part: &mut Option<T>) {
        if let Some(part) = part {
            part.visit_state(self);
        }
    }

    /// A value that has its own way into a state.
    pub fn by<T: ?Sized>(&mut self, value: &mut T, way: impl FnOnce(&mut T, &mut dyn Visit)) {
        way(value, self);
    }
}

/// Has a state. [`state!`](crate::state!) derives it.
pub trait Stateful {
    /// Visits every value that later rows depend on. Real-time: yes.
    fn visit_state(&mut self, visit: &mut dyn Visit);

    /// Visits a list. Its length belongs to the layout.
    fn visit_all(list: &mut [Self], visit: &mut dyn Visit)
    where
        Self: Sized,
    {
        for one in list {
            one.visit_state(visit);
        }
    }
}

/// Makes a type [`Stateful`] from a list of all of its fields.
///
/// `{ … }` lists the fields of the state in the order of their values, `keeps { … }` all others: settings, and values that
/// are recomputed. The macro takes the type apart without `..`. So a new field does not compile until one of the lists names it:
///
/// ```
/// struct Sums { weight: f64, squares: [f64; 2], work: Vec<f64> }
/// gusset_quantity::state! { Sums as "sums" { weight, squares } keeps { work } }
/// ```
///
/// ```compile_fail,E0027
/// struct Sums { weight: f64, squares: [f64; 2], work: Vec<f64> }
/// gusset_quantity::state! { Sums as "sums" { weight } keeps { work } }
/// ```
///
/// `as "sums"` names the part. A field with a method of [`Visit`] uses it, with arguments that may read other
/// fields: `newest: index(ring.len())`. `restored { … }` follows a restoration and computes what the state leaves out:
///
/// ```
/// struct Ring { newest: usize, ring: Vec<f64>, double: f64 }
/// gusset_quantity::state! {
///     Ring { newest: index(ring.len()), ring } keeps { double }
///     restored { *double = 2.0 * ring[*newest]; }
/// }
/// ```
///
/// An enum lists all of its variants. One that is missing does not compile:
///
/// ```compile_fail,E0004
/// #[derive(Clone, Copy, PartialEq)]
/// enum Energy { Off, FromNext, On }
/// gusset_quantity::state! { enum Energy { Off, On } }
/// ```
#[macro_export]
macro_rules! state {
    (enum $type:ty { $($variant:ident),+ $(,)? }) => {
        impl $crate::state::Stateful for $type {
            fn visit_state(&mut self, visit: &mut dyn $crate::state::Visit) {
                match self {
                    $(Self::$variant)|+ => visit.choice(self, &[$(Self::$variant),+]),
                }
            }
        }
    };
    (@[$($generics:tt)*] $type:ty $(as $name:literal)? {
        $($field:ident $(: $method:ident($($argument:expr),*))?),* $(,)?
    } $(keeps { $($kept:ident),* $(,)? })? $(restored $restored:block)?) => {
        impl $($generics)* $crate::state::Stateful for $type {
            fn visit_state(&mut self, visit: &mut dyn $crate::state::Visit) {
                let Self { $($field,)* $($($kept,)*)? } = self;
                $($(let _ = &$kept;)*)?
                $(visit.part($name);)?
                $($crate::state!(@field visit $field $($method($($argument),*))?);)*
                $(if visit.restores() $restored)?
            }
        }
    };
    (@field $visit:ident $field:ident) => {
        $crate::state::Stateful::visit_state($field, $visit)
    };
    (@field $visit:ident $field:ident $method:ident($($argument:expr),*)) => {
        $visit.$method($field, $($argument),*)
    };
    (<$generic:ident: $bound:ident> $($rest:tt)+) => {
        $crate::state!(@[<$generic: $bound>] $($rest)+);
    };
    ($($rest:tt)+) => {
        $crate::state!(@[] $($rest)+);
    };
}

impl Stateful for f64 {
    #[inline]
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        visit.number(self);
    }

    #[inline]
    fn visit_all(list: &mut [Self], visit: &mut dyn Visit) {
        visit.numbers(list);
    }
}

impl Stateful for u64 {
    #[inline]
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        visit.count(self);
    }
}

impl Stateful for u32 {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        let mut wide = u64::from(*self);
        visit.count(&mut wide);
        *self = u32::try_from(wide).unwrap_or(u32::MAX);
    }
}

impl Stateful for bool {
    #[inline]
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        visit.flag(self);
    }
}

/// A value that comes and goes. It takes as much room where it is missing.
impl<T: Stateful + Copy + Default> Stateful for Option<T> {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        let (mut is_there, mut value) = (self.is_some(), self.unwrap_or_default());
        is_there.visit_state(visit);
        value.visit_state(visit);
        *self = is_there.then_some(value);
    }
}

impl<T: Stateful> Stateful for [T] {
    #[inline]
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        T::visit_all(self, visit);
    }
}

impl<T: Stateful, const N: usize> Stateful for [T; N] {
    #[inline]
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        T::visit_all(self, visit);
    }

    /// Numbers of a table are visited at once.
    #[inline]
    fn visit_all(list: &mut [Self], visit: &mut dyn Visit) {
        T::visit_all(list.as_flattened_mut(), visit);
    }
}

impl<T: Stateful> Stateful for Vec<T> {
    #[inline]
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        T::visit_all(self, visit);
    }
}

impl<T: Stateful + ?Sized> Stateful for Box<T> {
    #[inline]
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        (**self).visit_state(visit);
    }
}

impl<T: Stateful + ?Sized> Stateful for &mut T {
    #[inline]
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        (**self).visit_state(visit);
    }
}

impl<A: Stateful, B: Stateful> Stateful for (A, B) {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        self.0.visit_state(visit);
        self.1.visit_state(visit);
    }
}

/// Why a state cannot be taken or restored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum StateError {
    /// The values do not fit into the room that was measured before.
    #[error("the state has {found} values, but there is room for {room}")]
    Room {
        /// Values found.
        found: usize,
        /// Values that fit.
        room: usize,
    },
    /// An exchange is under way, or a part has no state that can be taken.
    #[error("the state cannot be taken while an exchange is under way")]
    Pending,
    /// Another number of values.
    #[error("the saved state has {found} values, but the test has {wanted}")]
    Size {
        /// Values in the saved state.
        found: usize,
        /// Values in the test.
        wanted: usize,
    },
    /// Other kinds of values, other parts, or another version of the program.
    #[error("the saved state belongs to another test or another version of the program")]
    Layout,
    /// A value outside its domain.
    #[error("value {place} of the saved state is outside its domain")]
    Value {
        /// Place of the value, from 0.
        place: usize,
    },
}

/// The number of values of a state, and a hash of their kinds, order and parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Number of values.
    pub words: usize,
    /// Hash of kinds, order, parts and version.
    pub fingerprint: u64,
}

impl Layout {
    /// The layout of the values that `walk` visits. It changes no value.
    pub(crate) fn of(mut walk: impl FnMut(&mut dyn Visit)) -> Self {
        let mut measure = Measure::default();
        walk(&mut measure);
        Self {
            words: measure.words,
            fingerprint: measure.hash.value(),
        }
    }
}

/// The state of a test at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct TestState {
    layout: Layout,
    words: Vec<u64>,
}

impl TestState {
    /// An empty state with room for the values that `walk` visits. All memory is allocated and touched here.
    pub fn with_room(walk: impl FnMut(&mut dyn Visit)) -> Self {
        Self::empty(Layout::of(walk))
    }

    /// All memory is allocated and touched here.
    fn empty(layout: Layout) -> Self {
        let mut words = vec![0; layout.words];
        words.clear();
        Self { layout, words }
    }

    /// The present state of the values that `walk` visits.
    ///
    /// # Errors
    /// `walk` does not visit the same values each time.
    pub fn of(mut walk: impl FnMut(&mut dyn Visit)) -> Result<Self, StateError> {
        let mut state = Self::with_room(&mut walk);
        state.take(walk)?;
        Ok(state)
    }

    /// An empty state with the layout and the room of this one. All memory is allocated and touched here.
    #[must_use]
    pub fn with_same_room(&self) -> Self {
        Self::empty(self.layout)
    }

    /// A state that was read from a file.
    ///
    /// # Errors
    /// [`StateError::Size`] if the number of values is not that of the layout.
    pub fn from_words(layout: Layout, words: Vec<u64>) -> Result<Self, StateError> {
        if words.len() == layout.words {
            Ok(Self { layout, words })
        } else {
            Err(StateError::Size {
                found: words.len(),
                wanted: layout.words,
            })
        }
    }

    /// Replaces this state by the present values that `walk` visits. On an error the state is empty. Real-time: yes.
    ///
    /// # Errors
    /// [`StateError::Room`] if `walk` visits another number of values than at [`TestState::with_room`], [`StateError::Pending`] if a
    /// part refuses.
    pub fn take(&mut self, walk: impl FnOnce(&mut dyn Visit)) -> Result<(), StateError> {
        self.words.clear();
        let room = self.layout.words.min(self.words.capacity());
        let mut save = Save {
            words: &mut self.words,
            room,
            found: 0,
            is_refused: false,
        };
        walk(&mut save);
        let Save {
            found, is_refused, ..
        } = save;
        if found == self.layout.words && !is_refused {
            return Ok(());
        }
        self.words.clear();
        Err(if is_refused {
            StateError::Pending
        } else {
            StateError::Room {
                found,
                room: self.layout.words,
            }
        })
    }

    /// Replaces every value that `walk` visits by that of this state. Real-time: yes.
    ///
    /// # Errors
    /// The state does not fit; then nothing was changed. A value outside its domain is found on the way: the values are then
    /// of no use.
    pub fn restore(&self, mut walk: impl FnMut(&mut dyn Visit)) -> Result<(), StateError> {
        let wanted = Layout::of(&mut walk);
        if self.words.len() != wanted.words {
            return Err(StateError::Size {
                found: self.words.len(),
                wanted: wanted.words,
            });
        }
        if self.layout != wanted {
            return Err(StateError::Layout);
        }
        let mut restore = Restore {
            words: &self.words,
            place: 0,
            wrong: None,
        };
        walk(&mut restore);
        match restore.wrong {
            Some(place) => Err(StateError::Value { place }),
            None => Ok(()),
        }
    }

    /// True before the first state was taken.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.words.len() != self.layout.words
    }

    /// The layout that a test must have to restore it.
    #[must_use]
    pub const fn layout(&self) -> Layout {
        self.layout
    }

    /// The bits of its values in their order.
    #[must_use]
    pub fn words(&self) -> &[u64] {
        &self.words
    }
}

/// Hash of a state: FNV-1a over 64 bits at a time. It finds damage and mistakes; it does not resist malice.
#[derive(Debug, Clone)]
pub struct Digest(u64);

impl Default for Digest {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Digest {
    /// About this number of values of a long list is hashed, evenly spread: a checkpoint must not cost a deadline.
    const SAMPLED: usize = 1024;

    /// Adds one value. Real-time: yes.
    pub const fn add(&mut self, word: u64) {
        let mixed = (self.0 ^ word).wrapping_mul(0x0000_0100_0000_01b3);
        // The product carries nothing downwards: without this the low bits would never depend on the high ones.
        self.0 = mixed ^ (mixed >> 32);
    }

    /// Adds a list of values; of a long list some values, evenly spread. Real-time: yes.
    pub fn add_list(&mut self, words: impl ExactSizeIterator<Item = u64>) {
        let stride = words.len() / Self::SAMPLED + 1;
        words.step_by(stride).for_each(|word| self.add(word));
    }

    /// The hash so far.
    #[must_use]
    pub const fn value(&self) -> u64 {
        self.0
    }
}

impl Visit for Digest {
    fn numbers(&mut self, values: &mut [f64]) {
        self.add_list(values.iter().map(|value| value.to_bits()));
    }

    fn count(&mut self, value: &mut u64) {
        self.add(*value);
    }

    fn index(&mut self, value: &mut usize, _: usize) {
        self.add(*value as u64);
    }

    fn flag(&mut self, value: &mut bool) {
        self.add(u64::from(*value));
    }
}

/// Counts the values and hashes their kinds.
struct Measure {
    words: usize,
    hash: Digest,
}

impl Default for Measure {
    fn default() -> Self {
        let mut measure = Self {
            words: 0,
            hash: Digest::default(),
        };
        measure.hash.add(FORMAT);
        measure.name(env!("CARGO_PKG_VERSION"));
        measure
    }
}

impl Measure {
    fn name(&mut self, name: &str) {
        self.hash.add(name.len() as u64);
        name.bytes().for_each(|byte| self.hash.add(u64::from(byte)));
    }

    fn kind(&mut self, kind: u64, size: usize, words: usize) {
        self.hash.add(kind);
        self.hash.add(size as u64);
        self.words += words;
    }
}

impl Visit for Measure {
    fn numbers(&mut self, values: &mut [f64]) {
        self.kind(1, values.len(), values.len());
    }

    fn count(&mut self, _: &mut u64) {
        self.kind(2, 1, 1);
    }

    fn index(&mut self, _: &mut usize, len: usize) {
        self.kind(3, len, 1);
    }

    fn flag(&mut self, _: &mut bool) {
        self.kind(4, 1, 1);
    }

    fn part(&mut self, name: &'static str) {
        self.hash.add(5);
        self.name(name);
    }
}

/// Writes the values into room that is there already, and counts them.
struct Save<'a> {
    words: &'a mut Vec<u64>,
    room: usize,
    found: usize,
    is_refused: bool,
}

impl Save<'_> {
    fn add(&mut self, word: u64) {
        self.found += 1;
        if self.words.len() < self.room {
            self.words.push(word);
        }
    }
}

impl Visit for Save<'_> {
    fn numbers(&mut self, values: &mut [f64]) {
        self.found += values.len();
        if self.words.len() + values.len() <= self.room {
            let bits = values.iter().map(|value| value.to_bits());
            self.words.extend(bits);
        }
    }

    fn count(&mut self, value: &mut u64) {
        self.add(*value);
    }

    fn index(&mut self, value: &mut usize, _: usize) {
        self.add(*value as u64);
    }

    fn flag(&mut self, value: &mut bool) {
        self.add(u64::from(*value));
    }

    fn refuse(&mut self) {
        self.is_refused = true;
    }
}

/// Reads the values back. The layout was compared before.
struct Restore<'a> {
    words: &'a [u64],
    place: usize,
    /// Place of the first value outside its domain.
    wrong: Option<usize>,
}

impl Restore<'_> {
    fn next<T>(&mut self, to: &mut T, read: impl FnOnce(u64) -> Option<T>) {
        match self.words.get(self.place).and_then(|word| read(*word)) {
            Some(value) => *to = value,
            None => self.wrong = self.wrong.or(Some(self.place)),
        }
        self.place += 1;
    }
}

impl Visit for Restore<'_> {
    fn numbers(&mut self, values: &mut [f64]) {
        for value in values {
            self.next(value, |word| Some(f64::from_bits(word)));
        }
    }

    fn count(&mut self, value: &mut u64) {
        self.next(value, Some);
    }

    fn index(&mut self, value: &mut usize, len: usize) {
        let inside = |word| usize::try_from(word).ok().filter(|index| *index < len);
        self.next(value, inside);
    }

    fn flag(&mut self, value: &mut bool) {
        self.next(value, |word| match word {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        });
    }

    fn restores(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Clone, PartialEq)]
    struct Example {
        values: Vec<f64>,
        steps: u64,
        newest: usize,
        begun: bool,
    }

    crate::state! {
        Example as "example" { values, steps, newest: index(values.len()), begun }
    }

    fn example() -> Example {
        Example {
            values: vec![-0.0, f64::from_bits(0x7ff8_0000_0000_0123), 1e-320],
            steps: u64::MAX,
            newest: 2,
            begun: true,
        }
    }

    fn blank(len: usize) -> Example {
        Example {
            values: vec![0.0; len],
            steps: 0,
            newest: 0,
            begun: false,
        }
    }

    #[test]
    fn choices_and_options_have_a_fixed_size() {
        let walk = |choice: &mut char, known: &mut Option<[f64; 2]>, visit: &mut dyn Visit| {
            visit.choice(choice, &['a', 'b', 'c']);
            known.visit_state(visit);
        };
        for (choice, known) in [('a', None), ('c', Some([f64::NAN, -0.0]))] {
            let (mut one, mut other) = ((choice, known), ('b', Some([1.0; 2])));
            let state = TestState::of(|visit| walk(&mut one.0, &mut one.1, visit)).unwrap();
            assert_eq!(state.words().len(), 4);
            let restored = state.restore(|visit| walk(&mut other.0, &mut other.1, visit));
            restored.unwrap();
            let bits = |known: Option<[f64; 2]>| known.map(|two| two.map(f64::to_bits));
            assert_eq!((other.0, bits(other.1)), (choice, bits(known)));
        }
    }

    #[derive(Debug, Clone, Copy, PartialEq)]
    enum Energy {
        Off,
        FromNext,
        On,
    }

    crate::state! { enum Energy { Off, FromNext, On } }

    #[derive(Debug, Clone, PartialEq)]
    struct Derived<T> {
        table: [[f64; 2]; 2],
        ends: [(f64, u32); 2],
        energy: Energy,
        jump: Option<[f64; 2]>,
        part: Option<T>,
        last: f64,
    }

    crate::state! {
        <T: Stateful> Derived<T> as "derived" { energy, table, ends, jump, part: configured() }
        keeps { last }
        restored { *last = table[1][1]; }
    }

    #[test]
    fn a_derived_state_is_that_of_its_list() {
        let mut one = Derived {
            table: [[1.0, 2.0], [3.0, 4.0]],
            ends: [(5.0, 6), (7.0, 8)],
            energy: Energy::On,
            jump: None,
            part: Some(example()),
            last: 0.0,
        };
        let derived = Layout::of(|visit| one.visit_state(visit));
        let by_hand = Layout::of(|visit| {
            visit.part("derived");
            visit.index(&mut 0, 3);
            visit.numbers(&mut [0.0; 4]);
            for _ in 0..2 {
                visit.number(&mut 0.0);
                visit.count(&mut 0);
            }
            visit.flag(&mut false);
            visit.numbers(&mut [0.0; 2]);
            example().visit_state(visit);
        });
        assert_eq!(derived, by_hand);
        let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
        let mut other = Derived {
            table: [[0.0; 2]; 2],
            ends: [(0.0, 0); 2],
            energy: Energy::FromNext,
            jump: Some([9.0; 2]),
            part: Some(blank(3)),
            last: 0.0,
        };
        state.restore(|visit| other.visit_state(visit)).unwrap();
        assert_eq!((other.table, other.ends), (one.table, one.ends));
        assert_eq!((other.energy, other.jump), (Energy::On, None));
        // The kept value was recomputed.
        assert_eq!(other.last, 4.0);
        // A part that is not configured has no values.
        one.part = None;
        let without = Layout::of(|visit| one.visit_state(visit));
        assert_eq!(without.words + 6, derived.words);
    }

    #[test]
    fn restored_state_has_the_same_bits() {
        let mut one = example();
        let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
        let mut other = blank(3);
        state.restore(|visit| other.visit_state(visit)).unwrap();
        let bits = |example: &Example| -> Vec<u64> {
            example.values.iter().map(|value| value.to_bits()).collect()
        };
        assert_eq!(bits(&other), bits(&one));
        assert_eq!(
            (other.steps, other.newest, other.begun),
            (u64::MAX, 2, true)
        );
        assert_eq!(
            state,
            TestState::of(|visit| other.visit_state(visit)).unwrap()
        );
    }

    #[test]
    fn options_and_lists_have_a_fixed_size() {
        let walk = |option: &mut Option<f64>,
                    list: &mut Vec<f64>,
                    short: &mut u32,
                    visit: &mut dyn Visit| {
            option.visit_state(visit);
            visit.list(list, 4);
            short.visit_state(visit);
        };
        let (mut value, mut list, mut short) = (None, Vec::with_capacity(4), 0);
        let mut state =
            TestState::with_room(|visit| walk(&mut value, &mut list, &mut short, visit));
        for (option, numbers) in [
            (Some(f64::NAN), vec![1.0, 2.0, 3.0, 4.0]),
            (None, vec![]),
            (Some(-0.0), vec![5.0, 6.0]),
        ] {
            let (mut of, mut from, mut count) = (option, numbers.clone(), 7);
            state
                .take(|visit| walk(&mut of, &mut from, &mut count, visit))
                .unwrap();
            let used = allocation_counter::measure(|| {
                state
                    .restore(|visit| walk(&mut value, &mut list, &mut short, visit))
                    .unwrap();
            });
            assert_eq!(used.count_total, 0);
            assert_eq!(value.map(f64::to_bits), option.map(f64::to_bits));
            assert_eq!((&list, short), (&numbers, 7));
        }
    }

    #[test]
    fn state_that_does_not_fit_changes_nothing() {
        let mut one = example();
        let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
        let mut longer = blank(4);
        assert_eq!(
            state.restore(|visit| longer.visit_state(visit)),
            Err(StateError::Size {
                found: 6,
                wanted: 7
            })
        );
        let mut other = blank(3);
        // As many values, but of another part, or in another order.
        let of_another_part = state.restore(|visit| {
            visit.part("another");
            other.visit_state(visit);
        });
        let in_another_order = state.restore(|visit| {
            visit.part("example");
            visit.count(&mut other.steps);
            visit.numbers(&mut other.values);
            visit.index(&mut other.newest, 3);
            visit.flag(&mut other.begun);
        });
        assert_eq!(of_another_part, Err(StateError::Layout));
        assert_eq!(in_another_order, Err(StateError::Layout));
        assert_eq!(other, blank(3));
    }

    #[test]
    fn value_outside_its_domain_is_refused() {
        let mut one = example();
        let good = TestState::of(|visit| one.visit_state(visit)).unwrap();
        for (place, word) in [(4, 3), (5, 2)] {
            let mut words = good.words().to_vec();
            words[place] = word;
            let bad = TestState::from_words(good.layout(), words).unwrap();
            let mut other = blank(3);
            assert_eq!(
                bad.restore(|visit| other.visit_state(visit)),
                Err(StateError::Value { place })
            );
        }
        let short = TestState::from_words(good.layout(), vec![0; 5]);
        assert_eq!(
            short,
            Err(StateError::Size {
                found: 5,
                wanted: 6
            })
        );
    }

    #[test]
    fn taking_a_state_allocates_nothing() {
        let mut one = example();
        let mut state = TestState::with_room(|visit| one.visit_state(visit));
        assert!(state.is_empty());
        let mut digest = Digest::default();
        let used = allocation_counter::measure(|| {
            state.take(|visit| one.visit_state(visit)).unwrap();
            one.visit_state(&mut digest);
        });
        assert_eq!(used.count_total, 0);
        assert!(!state.is_empty());
        // A larger state does not fit, and leaves no half of a state.
        let mut grown = blank(4);
        let used = allocation_counter::measure(|| {
            assert_eq!(
                state.take(|visit| grown.visit_state(visit)),
                Err(StateError::Room { found: 7, room: 6 })
            );
        });
        assert_eq!(used.count_total, 0);
        assert!(state.is_empty());
        assert!(state.restore(|visit| one.visit_state(visit)).is_err());
    }

    #[test]
    fn digest_depends_on_every_bit() {
        let digest = |example: &Example| {
            let mut digest = Digest::default();
            example.clone().visit_state(&mut digest);
            digest.value()
        };
        let one = example();
        for place in 0..3 {
            for bit in [0, 31, 63] {
                let mut other = one.clone();
                other.values[place] = f64::from_bits(other.values[place].to_bits() ^ (1 << bit));
                assert_ne!(digest(&other), digest(&one), "{place} {bit}");
            }
        }
        let mut other = one.clone();
        other.begun = false;
        assert_ne!(digest(&other), digest(&one));
    }
}
