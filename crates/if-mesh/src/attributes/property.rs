//! Named properties of vertices, faces or other records.

use super::column::Column;
use std::ops::Range;

/// One property of all records of an element.
#[derive(Clone, Debug, PartialEq)]
pub struct Property {
    /// Its name.
    pub name: String,
    /// The value of each record, or the values of all lists one after the other.
    pub values: Column,
    /// For a property of lists: the list of record `r` is `values[lists[r]..lists[r + 1]]`. They ascend
    /// from 0 to the number of values.
    pub lists: Option<Vec<u32>>,
}

impl Property {
    /// A property of one number per record.
    pub fn new(name: impl Into<String>, values: Column) -> Self {
        Self { name: name.into(), values, lists: None }
    }

    /// Number of records.
    pub fn records(&self) -> usize {
        self.lists.as_ref().map_or(self.values.len(), |l| l.len().saturating_sub(1))
    }

    /// Whether the lists, if it has any, ascend from 0 to the number of values.
    pub(crate) fn lists_divide_values(&self) -> bool {
        self.lists.as_ref().is_none_or(|l| {
            l.is_sorted()
                && l.first() == Some(&0)
                && l.last().is_some_and(|&n| n as usize == self.values.len())
        })
    }

    /// The range in `values` of the values of `record`.
    ///
    /// # Panics
    ///
    /// If `record` is out of range.
    pub fn range(&self, record: usize) -> Range<usize> {
        self.lists
            .as_ref()
            .map_or(record..record + 1, |l| l[record] as usize..l[record + 1] as usize)
    }
}
