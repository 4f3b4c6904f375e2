//! Fields of a file that is being written, one of which may be changed.

use super::super::damage::{EXTREMES, Random};

/// Source of each value that a writer writes. In a mutant one of them differs from the writer's.
///
/// Since the change is made before anything is compressed, summed or moved, it arrives at the reader behind valid
/// checksums and offsets.
pub(crate) struct Fields {
    random: Random,
    /// Which value is changed, counted from 0; in the valid file none.
    chosen: Option<usize>,
    /// Number of values so far.
    seen: usize,
    /// Description of the change.
    change: String,
    /// Whether the mutant may be another valid file.
    free: bool,
}

impl Fields {
    /// Of the valid file.
    pub(crate) fn valid() -> Self {
        Self { random: Random(0), chosen: None, seen: 0, change: String::new(), free: false }
    }

    /// With the value of this number changed.
    pub(crate) fn changing(chosen: usize, random: Random) -> Self {
        Self { random, chosen: Some(chosen), ..Self::valid() }
    }

    /// Number of values that the writer has asked for.
    pub(crate) fn seen(&self) -> usize {
        self.seen
    }

    /// Describes the change.
    pub(crate) fn change(&self) -> &str {
        &self.change
    }

    /// Whether the mutant may be another valid file, with other particles.
    pub(crate) fn is_free(&self) -> bool {
        self.free
    }

    /// Says that this mutant is another valid file, if it is.
    pub(crate) fn excuse(&mut self, valid: bool) {
        self.free |= valid;
    }

    fn turn(&mut self) -> bool {
        self.seen += 1;
        self.chosen == Some(self.seen - 1)
    }

    /// A count, length or offset that the rest of the file contradicts if it is wrong.
    pub(crate) fn number(&mut self, what: &str, value: u64) -> u64 {
        if !self.turn() {
            return value;
        }
        let other = match self.random.below(8) {
            0 => 0,
            1 => value.wrapping_sub(1),
            2 => value.wrapping_add(1),
            3 => value / 2,
            4 => value.wrapping_mul(2),
            5 => value.wrapping_add(1 + self.random.below(100) as u64),
            6 => value.wrapping_sub(1 + self.random.below(100) as u64),
            _ => EXTREMES[self.random.below(EXTREMES.len())],
        };
        self.change = format!("{what}: {value} -> {other}");
        other
    }

    /// A number by which a valid file may have other particles: an address, a size that has no second source.
    pub(crate) fn free_number(&mut self, what: &str, value: u64) -> u64 {
        self.free |= self.chosen == Some(self.seen);
        self.number(what, value)
    }

    /// A name, tag or magic.
    pub(crate) fn text(&mut self, what: &str, value: &str) -> String {
        if !self.turn() {
            return value.to_owned();
        }
        let at = self.random.below(value.len());
        let at = (0..=at).rev().find(|&at| value.is_char_boundary(at)).unwrap_or(0);
        let other = match self.random.below(6) {
            0 => String::new(),
            1 => value[..at].to_owned(),
            2 => format!("{value}{}", ["x", " ", "\0", "\"", "<", "é"][self.random.below(6)]),
            3 => format!("{}_{}", &value[..at], value.get(at + 1..).unwrap_or_default()),
            4 => value.chars().rev().collect(),
            _ => value.repeat(1 + self.random.below(300)),
        };
        self.change = format!("{what}: {value:?} -> {:?}", &other[..other.len().min(80)]);
        other
    }

    /// A type, flag or token, and others that it is not.
    pub(crate) fn choice<T: Copy + std::fmt::Debug>(
        &mut self,
        what: &str,
        value: T,
        others: &[T],
    ) -> T {
        if !self.turn() {
            return value;
        }
        let other = others[self.random.below(others.len())];
        self.change = format!("{what}: {value:?} -> {other:?}");
        other
    }

    /// A choice by which a valid file may have other particles.
    pub(crate) fn free_choice<T: Copy + std::fmt::Debug>(
        &mut self,
        what: &str,
        value: T,
        others: &[T],
    ) -> T {
        self.free |= self.chosen == Some(self.seen);
        self.choice(what, value, others)
    }

    /// A part that must be there once: it is left out, doubled, cut short or lengthened.
    pub(crate) fn part(&mut self, what: &str, mut value: Vec<u8>) -> Vec<u8> {
        if !self.turn() {
            return value;
        }
        let length = value.len();
        match self.random.below(4) {
            0 => value.clear(),
            1 => value.extend_from_within(..),
            2 => value.truncate(self.random.below(length)),
            _ => value.extend((0..=self.random.below(20)).map(|_| self.random.below(256) as u8)),
        }
        self.change = format!("{what}: {length} -> {} bytes", value.len());
        value
    }

    /// A whole file: it is cut off.
    pub(crate) fn cut(&mut self, what: &str, mut value: Vec<u8>) -> Vec<u8> {
        if self.turn() {
            let length = value.len();
            value.truncate(self.random.below(length));
            self.change = format!("{what}: cut off after {} of {length} bytes", value.len());
        }
        value
    }

    /// A list of parts: one is left out, doubled or changes its place with another.
    pub(crate) fn order<T: Clone>(&mut self, what: &str, mut parts: Vec<T>) -> Vec<T> {
        if !self.turn() || parts.is_empty() {
            return parts;
        }
        let [a, b] = [(); 2].map(|()| self.random.below(parts.len()));
        match self.random.below(3) {
            0 => drop(parts.remove(a)),
            1 => parts.insert(b, parts[a].clone()),
            _ => parts.swap(a, b),
        }
        self.change = format!("{what}: parts {a} and {b} left out, doubled or swapped");
        parts
    }
}
