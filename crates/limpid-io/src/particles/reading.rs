//! [`ReadOptions`], resolved for a file.

use super::labelled::canonical;
use super::{Attribute, AttributeMap, ReadOptions, Selection};
use crate::budget::Budget;

/// [`ReadOptions`], resolved for a file.
#[derive(Clone, Copy)]
pub(super) struct Reading<'a> {
    pub(super) options: &'a ReadOptions,
    /// The memory of the document that the file is, or belongs to.
    pub(super) budget: &'a Budget,
    pub(super) map: &'a AttributeMap,
    pub(super) skip_invalid: bool,
    pub(super) select: &'a Selection,
    pub(super) values: bool,
    pub(super) shown: Option<&'a str>,
}

impl<'a> Reading<'a> {
    pub(super) fn new(options: &'a ReadOptions, budget: &'a Budget) -> Self {
        let ReadOptions { max_unpacked: _, map, skip_invalid, select, values, shown, columns: _ } =
            options;
        let (shown, skip_invalid, values) = (shown.as_deref(), *skip_invalid, *values);
        Self { options, budget, map, skip_invalid, select, values, shown }
    }

    /// Whether the numbers of an array are kept until the file is read, beside what attribute it may be.
    pub(super) fn keeps(&self, array: &str) -> bool {
        self.map.has_column(array) || self.select.needs(array) || self.wants_column(array)
    }

    /// Whether the numbers of an array are among the contents.
    pub(super) fn wants_column(&self, array: &str) -> bool {
        let array = canonical(array);
        self.options.columns.contains(&array.as_str())
    }

    /// Whether an array is read.
    pub(super) fn wants(&self, array: &str) -> bool {
        self.map.attribute_of(array).is_some() || self.keeps(array) || self.shows(array)
    }

    /// Memory that reading an array takes, bytes a particle.
    pub(super) fn bytes_of(&self, array: &str) -> u64 {
        let kept = if self.keeps(array) { size_of::<f64>() as u64 } else { 0 };
        let shown = if self.shows_or_describes(array) { size_of::<[f32; 4]>() as u64 } else { 0 };
        self.map.attribute_of(array).map_or(0, Attribute::bytes) + kept + shown
    }
}
