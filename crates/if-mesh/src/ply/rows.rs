//! Elements as the PLY writer emits them.

use super::error::WriteError;
use crate::attributes::{Property, ScalarType};
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::Write;

/// Bytes per call of the writer.
pub(super) const BLOCK: usize = 1 << 16;

/// An element to be written, record by record.
pub(super) struct Rows<'a> {
    pub(super) name: &'a str,
    count: usize,
    pub(super) properties: Vec<Cow<'a, Property>>,
    /// For each property that is a list, the type of its lengths.
    lengths: Vec<Option<ScalarType>>,
}

impl<'a> Rows<'a> {
    pub(super) fn new(name: &'a str, count: usize, properties: Vec<Cow<'a, Property>>) -> Self {
        let length = |p: &Cow<'_, Property>| {
            let longest =
                p.lists.as_ref()?.windows(2).map(|w| w[1].saturating_sub(w[0])).max().unwrap_or(0);
            Some(if longest > u32::from(u8::MAX) { ScalarType::U32 } else { ScalarType::U8 })
        };
        let lengths = properties.iter().map(length).collect();
        Self { name, count, properties, lengths }
    }

    /// Validates the element and appends its lines to the header; `first` is a line for a first
    /// property.
    pub(super) fn declare(
        &self,
        header: &mut String,
        first: Option<String>,
    ) -> Result<(), WriteError> {
        let mut names: BTreeSet<&str> = first.iter().map(|_| "vertex_indices").collect();
        *header += &format!("element {} {}\n", checked(self.name)?, self.count);
        *header += &first.unwrap_or_default();
        for (p, length) in self.properties.iter().zip(&self.lengths) {
            if !names.insert(checked(&p.name)?) {
                return Err(WriteError::Name { name: p.name.clone() });
            }
            let (element, property) = (self.name.to_owned(), p.name.clone());
            if p.records() != self.count {
                let (expected, found) = (self.count, p.records());
                return Err(WriteError::PropertyLength { element, property, expected, found });
            }
            if !p.lists_divide_values() {
                let values = p.values.len();
                return Err(WriteError::Lists { element, property, values });
            }
            let list = length.map_or(String::new(), |t| format!("list {t} "));
            *header += &format!("property {list}{} {}\n", p.values.scalar_type(), p.name);
        }
        Ok(())
    }

    /// Writes all records.
    pub(super) fn write(&self, writer: &mut impl Write) -> Result<(), WriteError> {
        if self.lengths.iter().any(Option::is_some) {
            let mut out = Blocks { bytes: Vec::with_capacity(BLOCK), writer };
            for row in 0..self.count {
                self.append(row, &mut out.bytes);
                out.flush_if_full()?;
            }
            return out.flush();
        }
        let stride: usize = self.properties.iter().map(|p| p.values.scalar_type().size()).sum();
        let per_block = (BLOCK / stride.max(1)).max(1);
        let mut block = vec![0; per_block.min(self.count) * stride];
        for first in (0..self.count).step_by(per_block) {
            let bytes = &mut block[..per_block.min(self.count - first) * stride];
            let mut offset = 0;
            for p in &self.properties {
                p.values.put_strided(first, bytes, stride, offset);
                offset += p.values.scalar_type().size();
            }
            writer.write_all(bytes)?;
        }
        Ok(())
    }

    /// Appends the values of record `row`.
    pub(super) fn append(&self, row: usize, bytes: &mut Vec<u8>) {
        for (p, length) in self.properties.iter().zip(&self.lengths) {
            let range = p.range(row);
            if let Some(t) = length {
                bytes.extend_from_slice(&(range.len() as u32).to_le_bytes()[..t.size()]);
            }
            p.values.append(range, bytes);
        }
    }
}

/// Whether it is one word that people can see.
pub(super) fn is_name(name: &str) -> bool {
    !name.is_empty() && !name.contains(|c: char| c.is_whitespace() || c.is_control())
}

/// The name, if it is valid in a header.
fn checked(name: &str) -> Result<&str, WriteError> {
    if is_name(name) { Ok(name) } else { Err(WriteError::Name { name: name.to_owned() }) }
}

/// Collects records until there is a block of them.
pub(super) struct Blocks<'a, W> {
    pub(super) bytes: Vec<u8>,
    pub(super) writer: &'a mut W,
}

impl<W: Write> Blocks<'_, W> {
    pub(super) fn flush_if_full(&mut self) -> Result<(), WriteError> {
        if self.bytes.len() >= BLOCK { self.flush() } else { Ok(()) }
    }

    pub(super) fn flush(&mut self) -> Result<(), WriteError> {
        self.writer.write_all(&self.bytes)?;
        self.bytes.clear();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attributes::Column;

    #[test]
    fn lists_beyond_their_values_are_named() {
        let values = Column::U8(vec![7; 3]);
        let ids = Property { name: "ids".into(), values, lists: Some(vec![0, 1, 9]) };
        let error = Rows::new("vertex", 2, vec![Cow::Owned(ids)])
            .declare(&mut String::new(), None)
            .unwrap_err();
        assert_eq!(
            error.to_string(),
            "the lists of property `ids` of element `vertex` do not divide its 3 values; they must \
             ascend from 0 to that number"
        );
    }
}
