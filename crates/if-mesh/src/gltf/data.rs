//! The data of a file being read: its accessors, and how much of them was used.

use super::accessor::{Elements, Wanted};
use super::document::{Document, Primitive};
use super::error::ReadError;
use super::source::Source;
use std::collections::BTreeMap;

pub(super) const POSITION: Wanted =
    Wanted { what: "POSITION", kind: "VEC3", is_whole: false, expected: "VEC3 of floats" };

/// Accessors may be used by several primitives, but the sum of their elements is bounded by this
/// many times the bytes of the file.
const REUSE: usize = 4;

/// A file whose accessors are being read.
pub(super) struct Data<'a> {
    pub(super) source: Source,
    pub(super) document: &'a Document,
    /// Bytes of the file and of those beside it.
    pub(super) size: usize,
    /// Sparse accessors, by what they were read as.
    decoded: BTreeMap<(usize, &'static str, bool), Elements>,
    /// Elements used so far.
    used: usize,
}

impl<'a> Data<'a> {
    /// Nothing read so far.
    pub(super) fn new(source: Source, document: &'a Document) -> Self {
        Self { size: source.size(), source, document, decoded: BTreeMap::new(), used: 0 }
    }

    /// Where the elements of an accessor are.
    pub(super) fn elements(
        &mut self,
        accessor: usize,
        wanted: &Wanted,
    ) -> Result<Elements, ReadError> {
        let key = (accessor, wanted.kind, wanted.is_whole);
        if let Some(found) = self.decoded.get(&key) {
            return Ok(*found);
        }
        let found = Elements::find(self.document, &mut self.source, accessor, wanted)?;
        if found.buffer != found.home {
            self.decoded.insert(key, found);
        }
        Ok(found)
    }

    /// Counts elements against what a file of this size may use.
    pub(super) fn spend(&mut self, elements: usize, what: &'static str) -> Result<(), ReadError> {
        self.used = self.used.saturating_add(elements);
        let is_fair = self.used <= REUSE.saturating_mul(self.size);
        if is_fair { Ok(()) } else { Err(ReadError::TooMuch { what }) }
    }

    pub(super) fn primitive(&self, [mesh, primitive]: [usize; 2]) -> &'a Primitive {
        &self.document.meshes[mesh].primitives[primitive]
    }

    /// The elements of an accessor, which must be as many as positions.
    pub(super) fn counted(
        &mut self,
        accessor: usize,
        wanted: &Wanted,
        what: &'static str,
        count: usize,
    ) -> Result<Elements, ReadError> {
        let elements = self.elements(accessor, wanted)?;
        if elements.count != count {
            let (found, expected) = (format!("{} elements", elements.count), "as many as POSITION");
            return Err(ReadError::Accessor { accessor, what, expected, found });
        }
        self.spend(count, "of morph targets and weights")?;
        Ok(elements)
    }
}
